// normals.h: smooth vertex normals, weighted by corner angles and summed over welded positions [thurmer1998].
#pragma once

#include "base/context.h"

// A mesh's geometry: positions (3 per vertex), indices (3 per triangle), and per vertex the first one at its position.
typedef struct MeshView {
    const float *positions;
    const uint32_t *faces, *welded;
    int64_t vertex_count, face_count;
} MeshView;

// Unit normal of triangle (a, b, c) and the angles at its corners [rad]; false (and zeros) when it has no area.
bool rey_face_normal(const float a[3], const float b[3], const float c[3], double normal[3], double angles[3]);
// sums[3 welded[v] ..] = sum over faces of angle times normal, in the order of the faces; 3 per vertex, overwritten.
void rey_normal_sums(const MeshView *mesh, double *sums);
// normals[3 v ..] = unit(sums[3 welded[v] ..]), or (0,0,1) where the sum is zero.
void rey_normals_from_sums(const MeshView *mesh, const double *sums, float *normals);

// Accumulates the adjoint of the unit normals of rey_normals_from_sums (3 per vertex) into that of the positions. sums: those
// of rey_normal_sums.
rey_result rey_normals_adj(rey_context *ctx, const MeshView *mesh, const double *sums, const double *dnormals,
                           double *dpositions);
// The motion of the normals that a motion of the positions makes; overwrites.
rey_result rey_normals_tangent(rey_context *ctx, const MeshView *mesh, const float *positions, float *normals);
