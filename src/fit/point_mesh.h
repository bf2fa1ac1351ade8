// point_mesh.h: which points, triangles and edges a mesh consists of. Vertices that a seam in uv or normals split are one point.
#pragma once

#include "base/context.h"

typedef struct PointEdge {
    int32_t a, b;        // points, a < b
    int32_t triangle[2]; // -1 = none; both -1 where more than two meet
} PointEdge;

typedef struct PointMesh {
    int32_t vertex_count, point_count, triangle_count, edge_count;
    int32_t *point;      // of each vertex
    int32_t *vertex;     // first vertex of each point
    int32_t *triangles;  // three points each
    PointEdge *edges;  // in the order of their ends
} PointMesh;

// welded: per vertex the first one at the same position; indices: three vertices per triangle. Freed with rey_point_mesh_free,
// also after a failure.
rey_result rey_point_mesh_create(rey_context *ctx, int32_t vertex_count, const int32_t *welded, int32_t triangle_count,
                              const int32_t *indices, PointMesh *out);
// points: three numbers each.
double rey_point_mesh_area(const PointMesh *mesh, const double *points);
void rey_point_mesh_free(rey_context *ctx, PointMesh *mesh);
