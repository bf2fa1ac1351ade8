// tubes.h: where rays meet tubes, more exactly than Embree says. It iterates until the point is near the tube; what a normal makes
// with a ray that grazes is then no better than a thousandth, and derivatives divide by that.
#pragma once

#include "scene/ray.h"
#include "shape/shape.h"

// The least cosine between rays and normals: what rounding leaves of it.
#define TUBE_GRAZE 1e-3f

// One step along rays at x, x and d in the space of the curve: the rays meet the tube at the root of a quadratic (tube_line) at
// which they enter. Returns t. Rays of *misses do not get there.
KFN Float tube_step(const SceneView *scene, Hit *hit, Vec3 x, Vec3 d, CurvePoint *foot, Mask *misses) {
    const TubeLine l = tube_line(scene, hit, x, d);
    Float root2 = l.f1 * l.f1 - l.f * l.f2;
    *foot = l.foot;
    *misses = m_lt(root2, TUBE_GRAZE * TUBE_GRAZE * v3_dot(d, d) * l.foot.r * l.foot.r);
    return (-l.f1 - f_zero_unless(~*misses, f_safe_sqrt(root2))) * f_safe_rcp(l.f2);
}

// In lanes of m that met B-spline curves: moves hits along their rays, by no more than a tube's radius. Those few that Embree lets
// meet a tube that they miss are put on the side that faces them: where they touch it they would count without bound.
static NOINLINE void tubes_refine(const SceneView *scene, const Ray *ray, Hit *hit, Mask m) {
    Int shape = i_max(hit->shape, i_set(0));
    m = m & mi_lt(i_set(-1), hit->shape) & mi_eq(SHAPE_FIELD(scene, shape, kind), i_set(SHAPE_BSPLINE));
    if (!m_any(m)) {
        return;
    }
    Int first = i_set(i_lane(shape, m_first(m))), at = i_set(0);
    Hit h = {i_select(m, shape, first), i_select(m, hit->prim, i_set(0)), hit->u, f_set(0), hit->p,
             i_select(m, hit->instance, i_set(0))};
    Vec3 d = ray->d;
    Mask inside = m & mi_lt(i_set(-1), SHAPE_FIELD(scene, h.shape, collection)), misses;
    if (m_any(inside)) {
        at = instance_table(scene, &h);
        h.p = v3_select(inside, pose_to_local(scene, at, h.p), h.p);
        d = v3_select(inside, pose_direction_to_local(scene, at, d), d);
    }
    CurvePoint p;
    Float moved = tube_step(scene, &h, h.p, d, &p, &misses);
    moved = moved + tube_step(scene, &h, v3_madd(h.p, moved, d), d, &p, &misses);
    m = m & m_lt(moved * moved * v3_dot(d, d), p.r * p.r);
    misses = misses & m;
    hit->u = f_select(m, h.u, hit->u);
    hit->p = v3_select(m, v3_madd(hit->p, moved, ray->d), hit->p);
    if (m_any(misses)) {
        Vec3 across = v3_normalize(v3_madd(d, -v3_dot(d, p.c1) * f_safe_rcp(v3_dot(p.c1, p.c1)), p.c1));
        Vec3 facing = v3_madd(p.c, -p.r, across);
        facing = m_any(inside) ? v3_select(inside, pose_to_world(scene, at, facing), facing) : facing;
        hit->p = v3_select(misses, facing, hit->p);
    }
}
