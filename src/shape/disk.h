// disk.h: disks. Table: rows of to_world (12), rows of its inverse (12). uv = (r, phi / 2 pi).
#pragma once

#include "math/warp.h"
#include "shape/pose.h"

enum { DISK_TABLE = 24 };

static inline bool disk_fold(const double *v, double m[16]) {
    UNUSED(v), UNUSED(m);
    return true;
}

static inline bool disk_follow(const float m[16], float *t, float *area) {
    double x[3] = {m[0], m[4], m[8]}, y[3] = {m[1], m[5], m[9]};
    double n[3] = {x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]};
    *area = (float)(3.14159265358979323846 * sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]));
    return pose_table(m, t);
}

static inline void disk_bounds(const Surface *surface, unsigned prim, float low[3], float high[3]) {
    const float *t = surface->table;
    UNUSED(prim);
    for (int k = 0; k < 3; k++) {
        float reach = sqrtf(t[4 * k] * t[4 * k] + t[4 * k + 1] * t[4 * k + 1]);
        low[k] = t[4 * k + 3] - reach;
        high[k] = t[4 * k + 3] + reach;
    }
}

// Distance at which a ray, given in the disk's own space, meets it between near and far; negative when it does not.
static inline float disk_meet(const Surface *surface, unsigned prim, const double o[3], const double d[3], float near,
                              float far) {
    UNUSED(surface), UNUSED(prim);
    double at = d[2] != 0 ? -o[2] / d[2] : -1;
    double x = o[0] + at * d[0], y = o[1] + at * d[1];
    return at > near && at < far && x * x + y * y <= 1 ? (float)at : -1;
}

static NOINLINE Interaction disk_interaction(const SceneView *scene, int32_t flags, const Hit *hit) {
    Interaction si;
    Int at = SHAPE_FIELD(scene, hit->shape, table);
    Vec3 local;
    local.x = v3_dot(table_v3(scene, at + 12), hit->p) + table_at(scene, at + 15);
    local.y = v3_dot(table_v3(scene, at + 16), hit->p) + table_at(scene, at + 19);
    Vec3 x = v3(table_at(scene, at), table_at(scene, at + 4), table_at(scene, at + 8));
    Vec3 y = v3(table_at(scene, at + 1), table_at(scene, at + 5), table_at(scene, at + 9));
    Vec3 o = v3(table_at(scene, at + 3), table_at(scene, at + 7), table_at(scene, at + 11));
    si.p = v3_madd(v3_madd(o, local.x, x), local.y, y);
    // The normal follows the inverse transpose: the third row of the inverse.
    si.ng = v3_normalize(table_v3(scene, at + 20));
    Float r = f_sqrt(local.x * local.x + local.y * local.y);
    Float phi = f_atan2(local.y, local.x);
    phi = f_select(m_lt(phi, f_set(0)), phi + TWO_PI, phi);
    si.uv = (Vec2){r, phi * INV_TWO_PI};
    Float rr = f_safe_rcp(r);
    si.dp_du = v3_madd(v3_scale(x, local.x * rr), local.y * rr, y);
    si.dp_du = v3_select(m_gt(r, f_set(0)), si.dp_du, x);
    // dp_dv = 2 pi r (-sin phi, cos phi)
    si.dp_dv = v3_scale(v3_madd(v3_scale(y, local.x), -local.y, x), f_set(TWO_PI));
    if (flags & SHAPE_FLIP_NORMALS) {
        si.ng = v3_neg(si.ng);
    }
    si.sh = frame_from_tangent(si.ng, si.dp_du);
    return si;
}

// Where uv lies.
KFN Vec3 disk_point(const SceneView *scene, Int at, Vec2 uv) {
    Float sine, cosine;
    f_sincos(TWO_PI * uv.y, &sine, &cosine);
    return pose_to_world(scene, at, v3(uv.x * cosine, uv.x * sine, f_set(0)));
}

// Uniform over the area.
KFN Hit disk_sample(const SceneView *scene, int32_t id, Vec3 ref, Vec2 u) {
    const float *t = scene->tables + scene->shapes[id].table;
    UNUSED(ref);
    Vec2 q = warp_uniform_disk(u);
    return hit_at(id, v3(q.x * t[0] + q.y * t[1] + t[3], q.x * t[4] + q.y * t[5] + t[7], q.x * t[8] + q.y * t[9] + t[11]));
}

// Of a disk per lane.
KFN Hit disk_sample_many(const SceneView *scene, Int id, Vec3 ref, Vec2 u) {
    Int at = SHAPE_FIELD(scene, id, table);
    UNUSED(ref);
    Vec2 q = warp_uniform_disk(u);
    Float p[3];
    for (int k = 0; k < 3; k++) {
        p[k] = q.x * table_at(scene, at + 4 * k) + q.y * table_at(scene, at + 4 * k + 1) + table_at(scene, at + 4 * k + 3);
    }
    Hit hit = hit_at(0, v3(p[0], p[1], p[2]));
    hit.shape = id;
    return hit;
}

KFN Float disk_pdf(const SceneView *scene, int32_t id, Vec3 ref, Vec3 d, const Interaction *si) {
    return area_density(ref, d, si, f_set(scene->shapes[id].area));
}
