// chamfer.h: how far two surfaces are apart.
#pragma once

#include "base/context.h"

typedef struct Triangles {
    const float *positions; // three per vertex
    const int32_t *indices; // three per triangle
    int64_t vertex_count, triangle_count;
} Triangles;

// Mean of the mean distances of points, spread evenly over each surface, to the other one [scene units].
rey_result rey_chamfer(rey_context *ctx, const Triangles *a, const Triangles *b, double *distance);
// Diagonal of the bounding box.
double rey_triangles_diagonal(const Triangles *t);
