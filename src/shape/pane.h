// pane.h: points that slide over flat panes. Points that keep their place on a pane of rough glass which moves see what is behind
// it, and are seen, in directions that change, for which the slopes of narrow lobes are paid twice. They may as well keep to the
// line of sight: with v the velocity of the pane's own points, n its normal and e = d / (n . d), d the view's direction, they move
// with
//   v + k s,   s = (n . v) e - v,
// which differs from v along the pane only; k is 1 within, 0 on the border, and fades where the pane is seen at a grazing angle.
// All terms of a derivative take the velocities of attached points from here. Areas of points grow by
//   div (k s) = k ((n . v) div e + e_t . grad (n . v) - div v) + s . grad k,   e_t = e - n,
// beside div v. The borders of the pane stay its own. Nothing on it may jump, or depend on where it is.
#pragma once

#include "shape/motion.h"
#include "shape/panes.h"

// e_t . e_t at which points no longer slide: two over one.
#define PANE_SIGHT 4.0f

// k and its gradient along the pane with the normal n, given e_t and how fast it grows there.
typedef struct PaneFade {
    Float k;
    Vec3 slope;
} PaneFade;

KFN PaneFade pane_fade(const PaneSet *set, Int pane, Vec3 p, Vec3 across, Float growth) {
    PaneFade f = {f_set(1), v3_zero()};
    for (int i = 0; i < PANE_SIDES; i++) {
        const float *side = set->pane->side[i];
        Int at = pane * (int32_t)(sizeof(PaneRecord) / sizeof(float));
        Vec3 in = v3(f_gather(side, at), f_gather(side + 1, at), f_gather(side + 2, at));
        Float left = f_max(1.0f - f_max(v3_dot(in, p) + f_gather(side + 3, at), f_set(0)), f_set(0));
        f.slope = v3_madd(v3_scale(f.slope, 1.0f - left * left), 2.0f * left * f.k, in);
        f.k = f.k * (1.0f - left * left);
    }
    Float inside = f_max(1.0f - v3_dot(across, across) * (1.0f / PANE_SIGHT), f_set(0));
    f.slope = v3_scale(f.slope, inside * inside);
    f.slope = v3_madd(f.slope, -4.0f / PANE_SIGHT * f.k * inside * growth, across);
    f.k = f.k * inside * inside;
    return f;
}

// The adjoint d of points that are attached in this way, as one of points that keep their place.
static NOINLINE SurfaceAdj pane_adj(const PaneSet *set, const Hit *hit, const Interaction *si, const SurfaceAdj *d) {
    Int first = i_gather(set->at, hit->shape);
    Mask m = mi_lt(i_set(-1), first);
    SurfaceAdj a = *d;
    if (!m_any(m)) {
        return a;
    }
    Int pane = i_gather(set->of, i_select(m, first + hit->prim, i_set(0)));
    m = m & mi_lt(i_set(-1), pane);
    Float parallel = f_set(1 - set->eye[3]);
    Vec3 n = si->ng, eye = v3(f_set(set->eye[0]), f_set(set->eye[1]), f_set(set->eye[2]));
    Vec3 look = v3_select(m_gt(parallel, f_set(0)), eye, v3_sub(si->p, eye));
    Float r = 1.0f / v3_dot(look, n), growth = (1.0f - parallel) * r;
    Vec3 e = v3_scale(look, r), across = v3_sub(e, n);
    PaneFade f = pane_fade(set, i_max(pane, i_set(0)), si->p, across, growth);
    m = m & m_gt(f.k, f_set(0)) & m_finite(r);
    f.k = f_zero_unless(m, f.k);
    f.slope = v3_select(m, f.slope, v3_zero());
    growth = f_zero_unless(m, growth);
    e = v3_select(m, e, n);
    across = v3_select(m, across, v3_zero());
    Float grows = v3_dot(d->area, n), kept = grows * f.k;
    a.p = v3_scale(d->p, 1.0f - f.k);
    a.p = v3_madd(a.p, f.k * v3_dot(d->p, e) + grows * (2.0f * f.k * growth + v3_dot(f.slope, e)), n);
    a.p = v3_madd(a.p, -grows, f.slope);
    a.area = v3_madd(d->area, -kept, n);
    // e_t = x dp_du + y dp_dv
    Vec3 cross = v3_cross(si->dp_du, si->dp_dv);
    Float rcp = f_safe_rcp(v3_dot(cross, cross));
    a.dp_du = v3_madd(d->dp_du, kept * v3_dot(v3_cross(across, si->dp_dv), cross) * rcp, n);
    a.dp_dv = v3_madd(d->dp_dv, kept * v3_dot(v3_cross(si->dp_du, across), cross) * rcp, n);
    return a;
}
