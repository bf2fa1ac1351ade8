// curve_move.h: B-spline tubes whose control points move. Points keep their position along the segment and their angle
// about the tangent, so that their texture coordinates stay. How points slide over tubes.
// NOT differentiated: the control points of polylines.
#pragma once

#include "shape/curve.h"
#include "shape/motion.h"

// The axes that curve_angle counts from: s along z x tangent, t = tangent x s.
KFN Vec3 curve_level(Vec3 tangent) { return v3(-tangent.y, tangent.x, f_set(0)); }

KFN Frame curve_frame(Vec3 tangent) {
    Frame f;
    Mask upright = m_lt(tangent.x * tangent.x + tangent.y * tangent.y, f_set(1e-10f));
    f.s = v3_select(upright, v3(f_sign(tangent.z), f_set(0), f_set(0)), v3_normalize(curve_level(tangent)));
    f.n = tangent;
    f.t = v3_cross(tangent, f.s);
    return f;
}

// Accumulates the adjoints ds, dt of its axes into the tangent's.
KFN void curve_frame_adj(Vec3 tangent, Vec3 ds, Vec3 dt, Vec3 *dtangent) {
    Frame f = curve_frame(tangent);
    Vec3 dlevel = v3_zero();
    v3_cross_adj(tangent, f.s, dt, dtangent, &ds);
    // s = normalize(-tangent.y, tangent.x, 0)
    Mask upright = m_lt(tangent.x * tangent.x + tangent.y * tangent.y, f_set(1e-10f));
    v3_normalize_adj(v3_select(upright, f.s, curve_level(tangent)), v3_select(upright, v3_zero(), ds), &dlevel);
    dtangent->x = dtangent->x + dlevel.y;
    dtangent->y = dtangent->y - dlevel.x;
}

// The tube at a hit: tangent, unit vectors away from the axis and around it, and the former's coordinates in the frame
// about the tangent, which attached points keep.
typedef struct CurveAxes {
    CurvePoint p;
    Vec3 tangent, e, around;
    Float speed, rcp, x, y; // rcp: one over speed, for derivatives: 0 where a curve begins at control points that are one
} CurveAxes;

KFN CurveAxes curve_axes(CurvePoint p, Vec3 point) {
    CurveAxes c;
    c.p = p;
    c.speed = v3_length(p.c1);
    c.rcp = f_zero_unless(m_gt(c.speed, 3e-6f * p.size), f_safe_rcp(c.speed));
    c.tangent = v3_scale(p.c1, f_safe_rcp(c.speed));
    Vec3 away = v3_sub(point, p.c);
    c.e = v3_normalize(v3_madd(away, -v3_dot(away, c.tangent), c.tangent));
    c.around = v3_cross(c.tangent, c.e);
    Frame f = curve_frame(c.tangent);
    c.x = v3_dot(c.e, f.s);
    c.y = v3_dot(c.e, f.t);
    return c;
}

// Adjoints of the centre, its derivatives, radii, and on the way of tangent, e and speed.
typedef struct CurveAdj {
    Vec3 c, c1, c2, tangent, e;
    Float r, r1, speed;
} CurveAdj;

KFN CurveAdj curve_adj_zero(void) {
    Vec3 z = v3_zero();
    return (CurveAdj){z, z, z, z, z, f_set(0), f_set(0), f_set(0)};
}

// dp_du = 2 pi r tangent x e
KFN void curve_around_adj(const CurveAxes *c, Vec3 d, CurveAdj *out) {
    out->r = out->r + TWO_PI * v3_dot(d, c->around);
    v3_cross_adj(c->tangent, c->e, v3_scale(d, TWO_PI * c->p.r), &out->tangent, &out->e);
}

// From the axes back to the control points, and to the sink.
KFN void curve_finish_adj(const SceneView *scene, const Hit *hit, const CurveAxes *c, const CurveWeights *w, int points,
                          CurveAdj *d, Sink *sink, Mask m) {
    // e = x s + y t
    curve_frame_adj(c->tangent, v3_scale(d->e, c->x), v3_scale(d->e, c->y), &d->tangent);
    // tangent = c1 / speed
    v3_normalize_adj(c->p.c1, v3_select(m_gt(c->rcp, f_set(0)), d->tangent, v3_zero()), &d->c1);
    d->c1 = v3_madd(d->c1, d->speed, c->tangent);
    Int segment = SHAPE_FIELD(scene, hit->shape, segment) + hit->prim;
    Int begin = i_gather(sink->points_at, hit->shape);
    m = m & mi_lt(i_set(-1), begin);
    Int at = i_select(m, begin + i_gather(scene->segments, segment) * 4, i_set(0));
    for (int k = 0; k < points; k++) {
        Vec3 p = v3_madd(v3_madd(v3_scale(d->c, w->b[k]), w->b1[k], d->c1), w->b2[k], d->c2);
        sink_add(sink, at + 4 * k, p.x, m);
        sink_add(sink, at + (4 * k + 1), p.y, m);
        sink_add(sink, at + (4 * k + 2), p.z, m);
        sink_add(sink, at + (4 * k + 3), w->b[k] * d->r + w->b1[k] * d->r1, m);
    }
}

KFN CurveAxes bspline_axes(const SceneView *scene, const Hit *hit, const CurveWeights *w) {
    return curve_axes(curve_sum(scene, hit, BSPLINE_POINTS, w->b, w->b1, w->b2), hit->p);
}

static NOINLINE void bspline_move_adj(const SceneView *scene, int32_t flags, const Hit *hit, const Interaction *si,
                                      const SurfaceAdj *d, Sink *sink, Mask m) {
    CurveWeights w = bspline_weights(hit->u);
    CurveAxes c = bspline_axes(scene, hit, &w);
    const CurvePoint *p = &c.p;
    CurveAdj out = curve_adj_zero();
    Float sign = f_set(flags & SHAPE_FLIP_NORMALS ? -1 : 1), rcp = c.rcp, bend = v3_dot(p->c2, c.e) * rcp;
    Float stretch = c.speed - p->r * bend, dstretch;
    // p = c + r e
    out.c = d->p;
    out.r = v3_dot(d->p, c.e);
    out.e = v3_scale(d->p, p->r);
    // ng = normalize(v), v = stretch e - r' tangent; the area vector is along r v
    Vec3 v = v3_madd(v3_scale(c.e, stretch), -p->r1, c.tangent), dv = v3_zero();
    v3_normalize_adj(v, v3_scale(v3_add(d->n, d->ng), sign), &dv);
    dv = v3_madd(dv, sign * f_safe_rcp(v3_length(v)), d->area);
    out.r = out.r + v3_dot(d->area, si->ng) * f_safe_rcp(p->r);
    dstretch = v3_dot(dv, c.e);
    out.e = v3_madd(out.e, stretch, dv);
    out.r1 = -v3_dot(dv, c.tangent);
    out.tangent = v3_scale(dv, -p->r1);
    curve_around_adj(&c, d->dp_du, &out);
    // dp_dv = n (stretch tangent + r' e)
    Vec3 along = curve_along(scene, hit, d->dp_dv);
    dstretch = dstretch + v3_dot(along, c.tangent);
    out.tangent = v3_madd(out.tangent, stretch, along);
    out.r1 = out.r1 + v3_dot(along, c.e);
    out.e = v3_madd(out.e, p->r1, along);
    // stretch = speed - r (c'' . e) / speed
    out.speed = dstretch * (1.0f + p->r * bend * rcp);
    out.r = out.r - dstretch * bend;
    out.c2 = v3_scale(c.e, -dstretch * p->r * rcp);
    out.e = v3_madd(out.e, -dstretch * p->r * rcp, p->c2);
    curve_finish_adj(scene, hit, &c, &w, BSPLINE_POINTS, &out, sink, m);
}

// ---- sliding: along dp_du and dp_dv --------------------------------------------------------------------------------

// Turns of the frame about the tangent, as that moves by dtangent, about itself: texture coordinates begin there.
KFN Float curve_twist(const CurveAxes *c, Vec3 dtangent) {
    Frame f = curve_frame(c->tangent);
    Vec3 by = v3_zero(), none = v3_zero();
    curve_frame_adj(c->tangent, f.t, none, &by); // t . ds
    return v3_dot(by, dtangent);
}

static NOINLINE void bspline_slide(const SceneView *scene, int32_t flags, const Hit *hit, const Interaction *si, Slide out[2]) {
    CurveWeights w = bspline_weights(hit->u);
    CurveAxes c = bspline_axes(scene, hit, &w);
    CurvePoint p = c.p, higher = curve_sum(scene, hit, BSPLINE_POINTS, w.b2, w.b3, w.b2);
    Vec3 c3 = higher.c1;
    Float r2 = higher.r, rcp = c.rcp, n = f_from_i(SHAPE_FIELD(scene, hit->shape, segment_count));
    Float sign = f_set(flags & SHAPE_FLIP_NORMALS ? -1 : 1), bend = v3_dot(p.c2, c.e) * rcp, stretch = c.speed - p.r * bend;
    Vec3 v = v3_madd(v3_scale(c.e, stretch), -p.r1, c.tangent);
    // around: e goes along `around`, that along -e
    Float ds = -p.r * v3_dot(p.c2, c.around) * rcp;
    Vec3 dv = v3_madd(v3_scale(c.e, ds), stretch, c.around);
    out[0] = slide_along(si->dp_du, f_set(1), f_set(0));
    out[0].n = out[0].ng = v3_scale(slide_normalized(v, dv), sign * TWO_PI);
    out[0].dp_du = v3_scale(c.e, -TWO_PI * TWO_PI * p.r);
    out[0].dp_dv = v3_scale(v3_madd(v3_scale(c.tangent, ds), p.r1, c.around), n * TWO_PI);
    // along: e stays perpendicular to the tangent
    Float slowing = v3_dot(c.tangent, p.c2);
    Vec3 dtangent = v3_scale(v3_madd(p.c2, -slowing, c.tangent), rcp);
    Vec3 de = v3_scale(c.tangent, -v3_dot(dtangent, c.e));
    Float dbend = (v3_dot(c3, c.e) + v3_dot(p.c2, de) - bend * slowing) * rcp;
    ds = slowing - p.r1 * bend - p.r * dbend;
    dv = v3_madd(v3_madd(v3_madd(v3_scale(c.e, ds), stretch, de), -r2, c.tangent), -p.r1, dtangent);
    out[1] = slide_along(si->dp_dv, -n * INV_TWO_PI * curve_twist(&c, dtangent), f_set(1));
    out[1].n = out[1].ng = v3_scale(slide_normalized(v, dv), sign * n);
    Vec3 turned = v3_add(v3_cross(dtangent, c.e), v3_cross(c.tangent, de));
    out[1].dp_du = v3_scale(v3_madd(v3_scale(c.around, p.r1), p.r, turned), n * TWO_PI);
    Vec3 second = v3_madd(v3_scale(dtangent, stretch), ds, c.tangent);
    out[1].dp_dv = v3_scale(v3_madd(v3_madd(second, r2, c.e), p.r1, de), n * n);
}

// Cones and the spheres at their ends: where v is along dp_du, or in the plane of the normal and the axis, dn = v / r on spheres,
// and on cones, whose normals are the same along their lines, for the former alone.
static NOINLINE void linear_slide(const SceneView *scene, int32_t flags, const Hit *hit, const Interaction *si, Slide out[2]) {
    Float b[2] = {1.0f - hit->u, hit->u}, b1[2] = {f_set(-1), f_set(1)}, b2[2] = {f_set(0), f_set(0)};
    CurveAxes c = curve_axes(curve_sum(scene, hit, LINEAR_POINTS, b, b1, b2), hit->p);
    Float n = f_from_i(SHAPE_FIELD(scene, hit->shape, segment_count)), sign = f_set(flags & SHAPE_FLIP_NORMALS ? -1 : 1);
    Vec3 normal = v3_scale(si->ng, sign), away = v3_sub(si->p, c.p.c);
    Mask cone = m_gt(hit->u, f_set(0)) & m_lt(hit->u, f_set(1));
    // around: e goes along `around`, that along -e
    Float size = v3_dot(away, c.e), dphi = TWO_PI * c.p.r * f_safe_rcp(size);
    out[0] = slide_along(si->dp_du, dphi * INV_TWO_PI, f_set(0));
    out[0].n = out[0].ng = v3_scale(si->dp_du, sign * f_safe_rcp(c.p.r));
    out[0].dp_du = v3_scale(c.e, -TWO_PI * c.p.r * dphi);
    out[0].dp_dv = v3_scale(c.around, n * c.p.r1 * dphi);
    // along, in units of all segments
    Vec3 along = v3_select(cone, v3_madd(c.p.c1, c.p.r1, normal), v3_scale(v3_cross(c.around, normal), c.speed));
    out[1] = slide_along(v3_scale(along, n), f_set(0), f_select(cone, f_set(1), f_set(0)));
    out[1].n = out[1].ng = v3_select(cone, v3_zero(), v3_scale(along, sign * n * f_safe_rcp(c.p.r)));
    out[1].dp_du = v3_scale(c.around, f_select(cone, TWO_PI * c.p.r1 * n, f_set(0)));
}
