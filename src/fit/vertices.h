// vertices.h: the vertices of a mesh as unknowns: preconditioned steps, and what keeps a surface in shape. Vertices at the
// same position move together. Of the variables and gradients of a parameter, three per vertex, those of the first vertex
// of each point count; the others stay 0.
#pragma once

#include "fit/laplacian.h"

// Weights of the regularisers, all of them pure numbers. With l the mean length of the edges at the start,
//   laplacian    mean over points of |x - mean of its neighbours|^2 / l^2
//   edge_length  mean over edges of (length / l - 1)^2
//   normals      sum of 1 - n_1 . n_2 over edges between two triangles, divided by the number of edges
typedef struct Regularisers {
    double laplacian, edge_length, normals;
} Regularisers;

typedef struct Vertices {
    PointMesh mesh;
    Laplacian *laplacian;
    Regularisers weights;
    double length;                  // mean length of the edges at the start
    double *points, *scratch, *sum; // workspace, three numbers per point
    int32_t *degree;                // edges at each point
} Vertices;

// The mesh as rey_point_mesh_create wants it. Freed with rey_vertices_free, also after a failure.
rey_result rey_vertices_create(rey_context *ctx, int32_t vertex_count, const int32_t *welded, int32_t triangle_count,
                               const int32_t *indices, double smoothness, Regularisers weights, Vertices **out);
void rey_vertices_free(rey_context *ctx, Vertices *vertices);

// Variables of a start, whose welded vertices become equal.
void rey_vertices_begin(Vertices *vertices, float *start, double *variable);
// The points of these values; valid until the next call.
const double *rey_vertices_points(Vertices *vertices, const float *value);
void rey_vertices_follow(Vertices *vertices, const double *variable, float *value);
// Replaces the gradient in the values by that in the variables.
void rey_vertices_gradient(Vertices *vertices, double *gradient);
// The weighted sum of the regularisers; adds its gradient in the values.
double rey_vertices_regularise(Vertices *vertices, const float *value, double *gradient);
