// remesh_parts.h: a mesh that changes, and what is around its points.
#pragma once

#include "fit/remesh.h"

typedef struct Remesh {
    rey_context *ctx;
    RemeshDef def;
    Array points;    // double, three each
    Array triangles; // int32_t, three each
    // As rey_remesh_look found them; a pass may change `points` and `triangles`, not these.
    PointMesh mesh;
    int32_t *order;         // edges, by length
    int32_t *first, *around; // of each point, its triangles
    int32_t *degree;        // neighbours of each point
    bool *border;           // points that must stay
    bool *touched, *touched_triangle; // by a change of this pass
} Remesh;

rey_result rey_remesh_open(Remesh *r, const PointMesh *mesh, const double *points);
void rey_remesh_forget(Remesh *r);
// Finds edges and neighbourhoods anew; the longest edges come first, or the shortest.
rey_result rey_remesh_look(Remesh *r, bool longest_first);
// Drops triangles with equal corners and points without triangles.
rey_result rey_remesh_compact(Remesh *r);

double *rey_remesh_point(const Remesh *r, int32_t point);
int32_t *rey_remesh_triangle(const Remesh *r, int32_t triangle);
double rey_remesh_distance(const double *a, const double *b);
double rey_remesh_length(const Remesh *r, int32_t a, int32_t b);
bool rey_remesh_joined(const Remesh *r, int32_t a, int32_t b); // by an edge
void rey_remesh_normal(const double *const p[3], double n[3]); // of twice the area
