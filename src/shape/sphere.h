// sphere.h: spheres. Table: centre, radius, then the axes of the inverse rotation (rows). uv = (phi / 2 pi, theta / pi). They stay
// round where to_world stretches or shears: the radius is that of its first column, along which their first axis lies, and the
// second one lies in the plane of the first two.
#pragma once

#include "math/warp.h"
#include "shape/pose.h"

enum { SPHERE_TABLE = 13 };
#define SPHERE_PARAMS(P)                                                                                               \
    P(POINT, center, 0, 0, 0, "centre")                                                                                \
    P(LENGTH, radius, 1, 0, 0, "radius")

// Centre and radius become part of the pose. v: the parameters' numbers in order.
static inline bool sphere_fold(const double *v, double m[16]) {
    pose_translate(m, v);
    pose_scale(m, v[3], v[3], v[3]);
    return true;
}

static inline bool sphere_follow(const float m[16], float *t, float *area) {
    double inverse[12], axis[3][3], radius = 0, along = 0, width = 0, side = 0;
    if (!rey_affine_inverse(m, inverse)) {
        return false;
    }
    for (int k = 0; k < 3; k++) {
        t[k] = m[4 * k + 3];
        radius += (double)m[4 * k] * m[4 * k];
        along += (double)m[4 * k] * m[4 * k + 1];
    }
    for (int k = 0; k < 3; k++) {
        axis[1][k] = m[4 * k + 1] - along / radius * m[4 * k];
        width += axis[1][k] * axis[1][k];
    }
    radius = sqrt(radius);
    for (int k = 0; k < 3; k++) {
        axis[0][k] = m[4 * k] / radius;
        axis[1][k] /= sqrt(width);
    }
    for (int k = 0; k < 3; k++) {
        int i = (k + 1) % 3, j = (k + 2) % 3;
        axis[2][k] = axis[0][i] * axis[1][j] - axis[0][j] * axis[1][i];
        side += axis[2][k] * m[4 * k + 2];
    }
    for (int k = 0; k < 3; k++) {
        t[4 + k] = (float)axis[0][k];
        t[7 + k] = (float)axis[1][k];
        t[10 + k] = (float)(side < 0 ? -axis[2][k] : axis[2][k]);
    }
    t[3] = (float)radius;
    *area = (float)(4 * 3.14159265358979323846 * radius * radius);
    return true;
}

static NOINLINE Interaction sphere_interaction(const SceneView *scene, int32_t flags, const Hit *hit) {
    Interaction si;
    Int at = SHAPE_FIELD(scene, hit->shape, table);
    Vec3 centre = table_v3(scene, at);
    Float radius = table_v3(scene, at + 3).x;
    si.ng = v3_normalize(v3_sub(hit->p, centre));
    si.p = v3_madd(centre, radius, si.ng);
    Vec3 local = v3(v3_dot(table_v3(scene, at + 4), si.ng), v3_dot(table_v3(scene, at + 7), si.ng),
                    v3_dot(table_v3(scene, at + 10), si.ng));
    Float phi = f_atan2(local.y, local.x);
    phi = f_select(m_lt(phi, f_set(0)), phi + TWO_PI, phi);
    si.uv = (Vec2){phi * INV_TWO_PI, f_acos(local.z) * INV_PI};
    // dp_du = 2 pi (-y, x, 0) in the sphere's frame, back to the world through the transposed rotation
    Vec3 x = table_v3(scene, at + 4), y = table_v3(scene, at + 7);
    si.dp_du = v3_scale(v3_madd(v3_scale(x, -local.y), local.x, y), TWO_PI * radius);
    // dp_dv = pi (z cos phi, z sin phi, -r), with r the distance from the axis
    Float r = f_sqrt(local.x * local.x + local.y * local.y), zr = local.z * f_safe_rcp(r);
    Vec3 along = v3_madd(v3_scale(x, local.x * zr), local.y * zr, y);
    si.dp_dv = v3_scale(v3_madd(along, -r, table_v3(scene, at + 10)), PI * radius);
    if (flags & SHAPE_FLIP_NORMALS) {
        si.ng = v3_neg(si.ng);
    }
    si.sh = frame_from_tangent(si.ng, si.dp_du);
    return si;
}

// Where uv lies.
KFN Vec3 sphere_point(const SceneView *scene, Int at, Vec2 uv) {
    Float sine, cosine, r, z;
    f_sincos(TWO_PI * uv.x, &sine, &cosine);
    f_sincos(PI * uv.y, &r, &z);
    Vec3 n = v3_scale(table_v3(scene, at + 4), r * cosine);
    n = v3_madd(n, r * sine, table_v3(scene, at + 7));
    n = v3_madd(n, z, table_v3(scene, at + 10));
    return v3_madd(table_v3(scene, at), table_at(scene, at + 3), n);
}

// The cone of directions that a sphere subtends from a point outside.
typedef struct SphereCone {
    Vec3 to_centre;
    Float d2, distance, one_minus_cos;
    Mask outside;
} SphereCone;

KFN SphereCone sphere_cone(Vec3 centre, Float radius, Vec3 ref) {
    SphereCone c;
    c.to_centre = v3_sub(centre, ref);
    c.d2 = v3_dot(c.to_centre, c.to_centre);
    c.distance = f_sqrt(c.d2);
    c.outside = m_gt(c.distance, radius * 1.0001f);
    Float sin2_max = f_min(radius * radius / f_max(c.d2, f_set(1e-30f)), f_set(1));
    c.one_minus_cos = sin2_max / (1.0f + f_safe_sqrt(1.0f - sin2_max));
    return c;
}

// Uniform in that cone, from outside; uniform over the area, from inside.
KFN Vec3 sphere_sample_point(Vec3 centre, Float radius, Vec3 ref, Vec2 u) {
    SphereCone c = sphere_cone(centre, radius, ref);
    Float drop = u.x * c.one_minus_cos; // 1 - cos of the sampled angle
    Float cos_theta = 1.0f - drop, sin2 = drop * (2.0f - drop), sine, cosine;
    f_sincos(TWO_PI * u.y, &sine, &cosine);
    Vec3 axis = v3_scale(c.to_centre, f_safe_rcp(c.distance));
    Frame frame = frame_from_normal(v3_select(c.outside, axis, v3(f_set(0), f_set(0), f_set(1))));
    Float sin_theta = f_safe_sqrt(sin2);
    Vec3 direction = frame_to_world(&frame, v3(sin_theta * cosine, sin_theta * sine, cos_theta));
    Float t_hit = c.distance * cos_theta - f_safe_sqrt(radius * radius - c.d2 * sin2);
    return v3_select(c.outside, v3_madd(ref, t_hit, direction), v3_madd(centre, radius, warp_uniform_sphere(u)));
}

KFN Float sphere_density(Vec3 centre, Float radius, Vec3 ref, Vec3 d, const Interaction *si, Float area) {
    SphereCone c = sphere_cone(centre, radius, ref);
    return f_select(c.outside, f_safe_rcp(TWO_PI * c.one_minus_cos), area_density(ref, d, si, area));
}

KFN Hit sphere_sample(const SceneView *scene, int32_t id, Vec3 ref, Vec2 u) {
    const float *t = scene->tables + scene->shapes[id].table;
    return hit_at(id, sphere_sample_point(v3(f_set(t[0]), f_set(t[1]), f_set(t[2])), f_set(t[3]), ref, u));
}

KFN Float sphere_pdf(const SceneView *scene, int32_t id, Vec3 ref, Vec3 d, const Interaction *si) {
    const float *t = scene->tables + scene->shapes[id].table;
    return sphere_density(v3(f_set(t[0]), f_set(t[1]), f_set(t[2])), f_set(t[3]), ref, d, si,
                          f_set(scene->shapes[id].area));
}

// Of a sphere per lane.
KFN Hit sphere_sample_many(const SceneView *scene, Int id, Vec3 ref, Vec2 u) {
    Int at = SHAPE_FIELD(scene, id, table);
    Hit hit = hit_at(0, sphere_sample_point(table_v3(scene, at), table_at(scene, at + 3), ref, u));
    hit.shape = id;
    return hit;
}

KFN Float sphere_pdf_many(const SceneView *scene, Int id, Vec3 ref, Vec3 d, const Interaction *si) {
    Int at = SHAPE_FIELD(scene, id, table);
    return sphere_density(table_v3(scene, at), table_at(scene, at + 3), ref, d, si, SHAPE_FLOAT(scene, id, area));
}
