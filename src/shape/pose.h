// pose.h: what shapes that follow a to_world share. Their tables begin with the rows of to_world (12) and of its inverse
// (12), spheres excepted.
#pragma once

#include "shape/affine.h"
#include "shape/interaction.h"

// What the ray tracer's callbacks of a shape see: its table and, of grids, the values and the voxels that the surface
// passes, one primitive each.
typedef struct Surface {
    const float *table, *grid;
    int32_t *voxels;
    unsigned primitives;
} Surface;

// ---- host: row-major 4 x 4, applied to what comes before ---------------------------------------------------------

static inline void pose_multiply(double m[16], const double r[16]) {
    double out[16];
    for (int i = 0; i < 16; i++) {
        out[i] = 0;
        for (int k = 0; k < 4; k++) {
            out[i] += m[i / 4 * 4 + k] * r[4 * k + i % 4];
        }
    }
    memcpy(m, out, sizeof out);
}

static inline void pose_translate(double m[16], const double v[3]) {
    for (int k = 0; k < 3; k++) {
        m[4 * k + 3] += m[4 * k] * v[0] + m[4 * k + 1] * v[1] + m[4 * k + 2] * v[2];
    }
}

static inline void pose_scale(double m[16], double x, double y, double z) {
    for (int k = 0; k < 3; k++) {
        m[4 * k] *= x;
        m[4 * k + 1] *= y;
        m[4 * k + 2] *= z;
    }
}

// Fills the first 24 numbers of a table; false when the pose is singular.
static inline bool pose_table(const float m[16], float *t) {
    double inverse[12];
    if (!rey_affine_inverse(m, inverse)) {
        return false;
    }
    for (int k = 0; k < 12; k++) {
        t[k] = m[k];
        t[12 + k] = (float)inverse[k];
    }
    return true;
}

// A ray in the shape's own space: distances stay the same.
static inline void pose_ray(const float *t, const float o[3], const float d[3], double local_o[3], double local_d[3]) {
    const float *r = t + 12;
    for (int k = 0; k < 3; k++, r += 4) {
        local_o[k] = (double)r[0] * o[0] + (double)r[1] * o[1] + (double)r[2] * o[2] + r[3];
        local_d[k] = (double)r[0] * d[0] + (double)r[1] * d[1] + (double)r[2] * d[2];
    }
}

// ---- kernels: `at` is where the table begins ---------------------------------------------------------------------

KFN Vec3 pose_to_local(const SceneView *scene, Int at, Vec3 p) {
    Float r[3];
    for (int k = 0; k < 3; k++) {
        r[k] = v3_dot(table_v3(scene, at + (12 + 4 * k)), p) + table_at(scene, at + (15 + 4 * k));
    }
    return v3(r[0], r[1], r[2]);
}

KFN Vec3 pose_direction_to_local(const SceneView *scene, Int at, Vec3 d) {
    return v3(v3_dot(table_v3(scene, at + 12), d), v3_dot(table_v3(scene, at + 16), d), v3_dot(table_v3(scene, at + 20), d));
}

KFN Vec3 pose_column(const SceneView *scene, Int at, int column) {
    return v3(table_at(scene, at + column), table_at(scene, at + (4 + column)), table_at(scene, at + (8 + column)));
}

KFN Vec3 pose_to_world(const SceneView *scene, Int at, Vec3 p) {
    Float r[3];
    for (int k = 0; k < 3; k++) {
        r[k] = v3_dot(table_v3(scene, at + 4 * k), p) + table_at(scene, at + (3 + 4 * k));
    }
    return v3(r[0], r[1], r[2]);
}

// Gradients and normals follow the inverse transpose.
KFN Vec3 pose_gradient(const SceneView *scene, Int at, Vec3 n) {
    Vec3 r = v3_scale(table_v3(scene, at + 12), n.x);
    r = v3_madd(r, n.y, table_v3(scene, at + 16));
    return v3_madd(r, n.z, table_v3(scene, at + 20));
}

KFN Vec3 pose_normal(const SceneView *scene, Int at, Vec3 n) { return v3_normalize(pose_gradient(scene, at, n)); }

// A point of a shape without triangles.
KFN Hit hit_at(int32_t id, Vec3 p) { return (Hit){i_set(id), i_set(0), f_set(0), f_set(0), p, i_set(0)}; }
