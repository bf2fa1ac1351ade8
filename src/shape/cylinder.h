// cylinder.h: open cylinders: x^2 + y^2 = 1, 0 <= z <= 1 through to_world. Table: rows of to_world (12), rows of its
// inverse (12). uv = (phi / 2 pi, z); the outside is the front.
#pragma once

#include "shape/pose.h"

enum { CYLINDER_TABLE = 24 };
#define CYLINDER_PARAMS(P)                                                                                             \
    P(POINT, p0, 0, 0, 0, "centre of one end")                                                                         \
    P(POINT, p1, 0, 0, 1, "centre of the other end")                                                                   \
    P(LENGTH, radius, 1, 0, 0, "radius")

// End points and radius become part of the pose; false when the ends coincide. v: the parameters' numbers in order.
static inline bool cylinder_fold(const double *v, double m[16]) {
    double axis[3] = {v[3] - v[0], v[4] - v[1], v[5] - v[2]}, frame[16] = {0};
    double length = sqrt(axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2]);
    if (!(length > 0)) {
        return false;
    }
    double n[3] = {axis[0] / length, axis[1] / length, axis[2] / length};
    // The basis of [duff2017], as other programs of the format build it: it decides where u begins.
    double sign = n[2] >= 0 ? 1 : -1, a = -1 / (sign + n[2]), b = n[0] * n[1] * a;
    double s[3] = {n[0] * n[0] * a * sign + 1, b * sign, -n[0] * sign}, t[3] = {b, n[1] * n[1] * a + sign, -n[1]};
    for (int k = 0; k < 3; k++) {
        frame[4 * k] = s[k] * v[6];
        frame[4 * k + 1] = t[k] * v[6];
        frame[4 * k + 2] = axis[k];
        frame[4 * k + 3] = v[k];
    }
    frame[15] = 1;
    pose_multiply(m, frame);
    return true;
}

static inline bool cylinder_follow(const float m[16], float *t, float *area) {
    // Mean of |dp_du x dp_dv| over u, by the trapezoid rule, which is exact for circles.
    enum { STEPS = 64 };
    double sum = 0;
    for (int i = 0; i < STEPS; i++) {
        double phi = 2 * 3.14159265358979323846 * i / STEPS, x = -sin(phi), y = cos(phi);
        double e[3], z[3] = {m[2], m[6], m[10]};
        for (int k = 0; k < 3; k++) {
            e[k] = m[4 * k] * x + m[4 * k + 1] * y;
        }
        double n[3] = {e[1] * z[2] - e[2] * z[1], e[2] * z[0] - e[0] * z[2], e[0] * z[1] - e[1] * z[0]};
        sum += sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    }
    *area = (float)(2 * 3.14159265358979323846 * sum / STEPS);
    return pose_table(m, t);
}

static inline void cylinder_bounds(const Surface *surface, unsigned prim, float low[3], float high[3]) {
    const float *t = surface->table;
    UNUSED(prim);
    for (int k = 0; k < 3; k++) {
        float reach = sqrtf(t[4 * k] * t[4 * k] + t[4 * k + 1] * t[4 * k + 1]);
        low[k] = t[4 * k + 3] - reach + fminf(t[4 * k + 2], 0);
        high[k] = t[4 * k + 3] + reach + fmaxf(t[4 * k + 2], 0);
    }
}

// Distance at which a ray, given in the cylinder's own space, meets it between near and far; negative when it does not.
static inline float cylinder_meet(const Surface *surface, unsigned prim, const double o[3], const double d[3], float near,
                                  float far) {
    UNUSED(surface), UNUSED(prim);
    double a = d[0] * d[0] + d[1] * d[1], b = o[0] * d[0] + o[1] * d[1];
    // Discriminant from the distance of the ray to the axis, which does not cancel.
    double miss = o[0] * d[1] - o[1] * d[0], discriminant = a - miss * miss;
    if (!(a > 0) || !(discriminant >= 0)) {
        return -1;
    }
    double root = sqrt(discriminant);
    for (int side = -1; side <= 1; side += 2) {
        double at = (-b + side * root) / a, z = o[2] + at * d[2];
        if (at > near && at < far && z >= 0 && z <= 1) {
            return (float)at;
        }
    }
    return -1;
}

static NOINLINE Interaction cylinder_interaction(const SceneView *scene, int32_t flags, const Hit *hit) {
    Interaction si;
    Int at = SHAPE_FIELD(scene, hit->shape, table);
    Vec3 local = pose_to_local(scene, at, hit->p);
    Float rr = f_safe_rcp(f_sqrt(local.x * local.x + local.y * local.y));
    local.x = local.x * rr;
    local.y = local.y * rr;
    si.p = pose_to_world(scene, at, local);
    si.ng = pose_normal(scene, at, v3(local.x, local.y, f_set(0)));
    Float phi = f_atan2(local.y, local.x);
    phi = f_select(m_lt(phi, f_set(0)), phi + TWO_PI, phi);
    si.uv = (Vec2){phi * INV_TWO_PI, local.z};
    si.dp_du = v3_scale(v3_madd(v3_scale(pose_column(scene, at, 0), -local.y), local.x, pose_column(scene, at, 1)), f_set(TWO_PI));
    si.dp_dv = pose_column(scene, at, 2);
    if (flags & SHAPE_FLIP_NORMALS) {
        si.ng = v3_neg(si.ng);
    }
    si.sh = frame_from_tangent(si.ng, si.dp_du);
    return si;
}

// Where uv lies.
KFN Vec3 cylinder_point(const SceneView *scene, Int at, Vec2 uv) {
    Float sine, cosine;
    f_sincos(TWO_PI * uv.x, &sine, &cosine);
    return pose_to_world(scene, at, v3(cosine, sine, uv.y));
}

// Uniform over uv.
KFN Hit cylinder_sample(const SceneView *scene, int32_t id, Vec3 ref, Vec2 u) {
    UNUSED(ref);
    return hit_at(id, cylinder_point(scene, i_set(scene->shapes[id].table), u));
}

KFN Float cylinder_pdf(const SceneView *scene, int32_t id, Vec3 ref, Vec3 d, const Interaction *si) {
    UNUSED(scene), UNUSED(id);
    return area_density(ref, d, si, v3_length(v3_cross(si->dp_du, si->dp_dv)));
}
