// curve.h: round tubes along curves. A segment is 4 control points of a uniform cubic B-spline or 2 of a polyline, each
// with a radius; a hit's u is the position along the segment. uv = (angle / 2 pi, position along all segments).
#pragma once

#include "shape/pose.h"

enum { BSPLINE_POINTS = 4, LINEAR_POINTS = 2 };

// Centre, radius and derivatives at the hit.
typedef struct CurvePoint {
    Vec3 c, c1, c2;
    Float r, r1;
    Float size; // of what the control points span
} CurvePoint;

// Weights of the control points in value, first, second and third derivative.
typedef struct CurveWeights {
    Float b[BSPLINE_POINTS], b1[BSPLINE_POINTS], b2[BSPLINE_POINTS], b3[BSPLINE_POINTS];
} CurveWeights;

KFN CurveWeights bspline_weights(Float v) {
    Float w = 1.0f - v, v2 = v * v;
    return (CurveWeights){{w * w * w * (1.0f / 6), (3.0f * v2 * v - 6.0f * v2 + 4.0f) * (1.0f / 6),
                           (-3.0f * v2 * v + 3.0f * v2 + 3.0f * v + 1.0f) * (1.0f / 6), v2 * v * (1.0f / 6)},
                          {-0.5f * w * w, 0.5f * (3.0f * v2 - 4.0f * v), 0.5f * (-3.0f * v2 + 2.0f * v + 1.0f), 0.5f * v2},
                          {w, 3.0f * v - 2.0f, 1.0f - 3.0f * v, v},
                          {f_set(-1), f_set(3), f_set(-3), f_set(1)}};
}

// Sums control points [first, first + n) of a shape with the weights of value, first and second derivative. The sums of the latter
// are 0: from one of the points on, so that points that are one stay so.
KFN CurvePoint curve_sum(const SceneView *scene, const Hit *hit, int n, const Float *b, const Float *b1, const Float *b2) {
    Int segment = SHAPE_FIELD(scene, hit->shape, segment) + hit->prim;
    Int at = SHAPE_FIELD(scene, hit->shape, positions) + i_gather(scene->segments, segment) * 4;
    CurvePoint p = {v3_zero(), v3_zero(), v3_zero(), f_set(0), f_set(0), f_set(0)};
    Vec3 base = v3(theta_at(scene, at + 4), theta_at(scene, at + 5), theta_at(scene, at + 6));
    Float base_r = theta_at(scene, at + 7);
    for (int k = 0; k < n; k++) {
        Vec3 c = v3(theta_at(scene, at + 4 * k), theta_at(scene, at + (4 * k + 1)), theta_at(scene, at + (4 * k + 2)));
        Float r = theta_at(scene, at + (4 * k + 3));
        Vec3 from = v3_sub(c, base);
        p.c = v3_madd(p.c, b[k], c);
        p.c1 = v3_madd(p.c1, b1[k], from);
        p.c2 = v3_madd(p.c2, b2[k], from);
        p.r = p.r + b[k] * r;
        p.r1 = p.r1 + b1[k] * (r - base_r);
        p.size = p.size + f_abs(from.x) + f_abs(from.y) + f_abs(from.z);
    }
    return p;
}

// The angle about the tangent from z x tangent on, in [0, 2 pi), as in the format; from x where the tangent is along z.
// radial is perpendicular to the tangent, so that its z is its part along tangent x (z x tangent).
KFN Float curve_angle(Vec3 tangent, Vec3 radial) {
    Mask upright = m_lt(tangent.x * tangent.x + tangent.y * tangent.y, f_set(1e-10f));
    Float across = f_select(upright, radial.x * tangent.z, radial.y * tangent.x - radial.x * tangent.y);
    Float angle = f_atan2(f_select(upright, radial.y, radial.z), across);
    return angle + f_zero_unless(m_lt(angle, f_set(0)), f_set(TWO_PI));
}

KFN Vec2 curve_uv(const SceneView *scene, const Hit *hit, Vec3 tangent, Vec3 radial) {
    Float angle = curve_angle(tangent, radial);
    Float segments = f_from_i(SHAPE_FIELD(scene, hit->shape, segment_count));
    return (Vec2){angle * INV_TWO_PI, (f_from_i(hit->prim) + hit->u) / segments};
}

// From the derivative along one segment to that along all of them, which v counts.
KFN Vec3 curve_along(const SceneView *scene, const Hit *hit, Vec3 d) {
    return v3_scale(d, f_from_i(SHAPE_FIELD(scene, hit->shape, segment_count)));
}

KFN Interaction curve_finish(int32_t flags, Interaction si) {
    if (flags & SHAPE_FLIP_NORMALS) {
        si.ng = v3_neg(si.ng);
    }
    si.sh = frame_from_tangent(si.ng, si.dp_du);
    return si;
}

// Where hit->u is.
KFN CurvePoint bspline_point(const SceneView *scene, const Hit *hit) {
    CurveWeights w = bspline_weights(hit->u);
    return curve_sum(scene, hit, BSPLINE_POINTS, w.b, w.b1, w.b2);
}

// How far beyond the ends of a segment feet may lie: the next segment goes on likewise.
#define TUBE_BEYOND 0.02f

// The foot of x on a segment, where (x - c) . c' = 0: moves hit->u there by Newton's method.
KFN CurvePoint bspline_foot(const SceneView *scene, Hit *hit, Vec3 x, int steps) {
    for (int i = 0;; i++) {
        CurvePoint p = bspline_point(scene, hit);
        if (i == steps) {
            return p;
        }
        Vec3 away = v3_sub(x, p.c);
        Float step = v3_dot(away, p.c1) * f_safe_rcp(v3_dot(p.c1, p.c1) - v3_dot(away, p.c2));
        step = f_clamp(step, f_set((real)-0.25), f_set((real)0.25));
        hit->u = f_clamp(hit->u + step, f_set(-TUBE_BEYOND), f_set(1 + TUBE_BEYOND));
    }
}

// Whether a tube ends with a segment, behind it or before it: the next one does not begin a control point further.
KFN Mask tube_ends(const SceneView *scene, const Hit *hit, bool behind) {
    Int first = SHAPE_FIELD(scene, hit->shape, segment), next = hit->prim + (behind ? 1 : -1);
    Mask there = mi_lt(i_set(-1), next) & mi_lt(next, SHAPE_FIELD(scene, hit->shape, segment_count));
    Int own = i_gather(scene->segments, first + hit->prim);
    Int other = i_gather(scene->segments, first + i_select(there, next, hit->prim));
    return ~(there & mi_eq(other, own + (behind ? 1 : -1)));
}

// A tube next to a point x of a line along d: with c(u) the foot of x, (x - c) . c' = 0, f(t) = |x + t d - c|^2 - r^2 is
// a quadratic in t but for how the curve bends. f, and halves of f' and f''; slope: du / dt over c' . d.
typedef struct TubeLine {
    CurvePoint foot;
    Vec3 away;
    Float f, f1, f2, slope;
} TubeLine;

KFN TubeLine tube_line(const SceneView *scene, Hit *hit, Vec3 x, Vec3 d) {
    TubeLine l = {.foot = bspline_foot(scene, hit, x, 2)};
    const CurvePoint *p = &l.foot;
    l.away = v3_sub(x, p->c);
    l.slope = f_safe_rcp(v3_dot(p->c1, p->c1) - v3_dot(l.away, p->c2));
    Float along = v3_dot(d, p->c1), u1 = along * l.slope;
    l.f = v3_dot(l.away, l.away) - p->r * p->r;
    l.f1 = v3_dot(l.away, d) - p->r * p->r1 * u1;
    l.f2 = v3_dot(d, d) - along * u1 - p->r1 * p->r1 * u1 * u1;
    return l;
}

// Where nothing is known of the foot.
enum { BSPLINE_SEARCH = 6 };

// Distance of x from a tube, and its gradient, in the space of the curve. hit->u is set.
KFN Float bspline_distance(const SceneView *scene, Hit *hit, Vec3 x, Vec3 *gradient) {
    hit->u = f_set((real)0.5);
    CurvePoint p = bspline_foot(scene, hit, x, BSPLINE_SEARCH);
    Vec3 away = v3_sub(x, p.c);
    Float distance = v3_length(away), slope = f_safe_rcp(v3_dot(p.c1, p.c1) - v3_dot(away, p.c2));
    *gradient = v3_madd(v3_scale(away, f_safe_rcp(distance)), -p.r1 * slope, p.c1);
    return distance - p.r;
}

// Swept circle p = c + r e, e perpendicular to T = c' / |c'|: n is parallel to e - T r' / (|c'| - r (c'' . e) / |c'|).
static NOINLINE Interaction bspline_interaction(const SceneView *scene, int32_t flags, const Hit *hit) {
    CurvePoint p = bspline_point(scene, hit);
    Float speed = v3_length(p.c1);
    Vec3 tangent = v3_scale(p.c1, f_safe_rcp(speed)), away = v3_sub(hit->p, p.c);
    Vec3 e = v3_normalize(v3_madd(away, -v3_dot(away, tangent), tangent));
    Float stretch = speed - p.r * v3_dot(p.c2, e) * f_safe_rcp(speed);
    Interaction si;
    si.ng = v3_normalize(v3_madd(e, -p.r1 * f_safe_rcp(stretch), tangent));
    si.p = v3_madd(p.c, p.r, e);
    si.uv = curve_uv(scene, hit, tangent, e);
    si.dp_du = v3_scale(v3_cross(tangent, e), TWO_PI * p.r);
    si.dp_dv = curve_along(scene, hit, v3_madd(v3_scale(tangent, stretch), p.r1, e));
    return curve_finish(flags, si);
}

// Cone that touches the spheres at both ends, and those spheres: the normal points away from the sphere of the family
// between them that touches the surface at p.
static NOINLINE Interaction linear_interaction(const SceneView *scene, int32_t flags, const Hit *hit) {
    Float b[2] = {1.0f - hit->u, hit->u}, b1[2] = {f_set(-1), f_set(1)}, b2[2] = {f_set(0), f_set(0)};
    CurvePoint p = curve_sum(scene, hit, LINEAR_POINTS, b, b1, b2);
    Float length2 = v3_dot(p.c1, p.c1);
    Vec3 start = v3_madd(p.c, -hit->u, p.c1), tangent = v3_normalize(p.c1);
    Float r0 = p.r - hit->u * p.r1;
    // (p - c(t)) . c' + r(t) r' = 0
    Float t = (v3_dot(v3_sub(hit->p, start), p.c1) + r0 * p.r1) * f_safe_rcp(length2 - p.r1 * p.r1);
    t = f_clamp(t, f_set(0), f_set(1));
    Vec3 centre = v3_madd(start, t, p.c1);
    Interaction si;
    si.ng = v3_normalize(v3_sub(hit->p, centre));
    si.p = v3_madd(centre, r0 + t * p.r1, si.ng);
    Vec3 away = v3_sub(si.p, p.c);
    Vec3 e = v3_normalize(v3_madd(away, -v3_dot(away, tangent), tangent));
    si.uv = curve_uv(scene, hit, tangent, e);
    si.dp_du = v3_scale(v3_cross(tangent, e), TWO_PI * p.r);
    si.dp_dv = curve_along(scene, hit, v3_madd(p.c1, p.r1, e));
    return curve_finish(flags, si);
}
