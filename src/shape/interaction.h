// interaction.h: what kernels know of a point of a surface: position, geometric normal, shading frame, texture
// coordinates. How it changes with the geometry stands in motion.h.
#pragma once

#include "scene/tables.h"
#include "scene/texture.h"

typedef struct Interaction {
    Vec3 p;     // world position
    Vec3 ng;    // geometric normal, unit
    Frame sh;   // shading frame
    Vec2 uv;
    Vec3 dp_du; // unnormalised tangent that the frame is built on
    Vec3 dp_dv;
} Interaction;

// Frame with normal n and s along dp_du [Gram-Schmidt].
KFN Frame frame_from_tangent(Vec3 n, Vec3 dp_du) {
    Frame f;
    Vec3 s = v3_madd(dp_du, -v3_dot(n, dp_du), n);
    Mask usable = m_gt(v3_dot(s, s), 1e-12f * v3_dot(dp_du, dp_du));
    Frame any = frame_from_normal(n);
    f.n = n;
    f.s = v3_select(usable, v3_normalize(s), any.s);
    f.t = v3_cross(n, f.s);
    return f;
}

// Accumulates the adjoint of frame_from_tangent into dn and dtangent (null: dp_du is held fixed).
KFN void frame_from_tangent_adj(const Frame *f, Vec3 dp_du, const Frame *df, Vec3 *dn, Vec3 *dtangent) {
    Vec3 ds = df->s;
    v3_acc(dn, df->n);
    // t = n x s
    v3_cross_adj(f->n, f->s, df->t, dn, &ds);
    // s = normalize(q), q = dp_du - n (n . dp_du)
    Float projection = v3_dot(f->n, dp_du);
    Vec3 q = v3_madd(dp_du, -projection, f->n), dq = v3_zero();
    Mask usable = m_gt(v3_dot(q, q), 1e-12f * v3_dot(dp_du, dp_du));
    v3_normalize_adj(v3_select(usable, q, f->s), v3_select(usable, ds, v3_zero()), &dq);
    v3_acc(dn, v3_madd(v3_scale(dq, -projection), -v3_dot(f->n, dq), dp_du));
    if (dtangent) {
        v3_acc(dtangent, v3_madd(dq, -v3_dot(f->n, dq), f->n));
    }
}

// How far from a point of a surface rays begin.
KFN Float interaction_step(Vec3 p) { return (1.0f + f_max(f_max(f_abs(p.x), f_abs(p.y)), f_abs(p.z))) * 9e-5f; }

// Origin of a ray that leaves si towards d: off the surface by an epsilon of the coordinates' size.
KFN Vec3 interaction_offset(const Interaction *si, Vec3 d) {
    return v3_madd(si->p, f_copysign(interaction_step(si->p), v3_dot(si->ng, d)), si->ng);
}

// The same of a ray that passes undeviated and stays the same line.
KFN Vec3 interaction_behind(const Interaction *si, Vec3 d) { return v3_madd(si->p, interaction_step(si->p), d); }

// Density per solid angle, seen from ref along d, of points that are uniform over an area around si.
KFN Float area_density(Vec3 ref, Vec3 d, const Interaction *si, Float area) {
    Vec3 to_point = v3_sub(si->p, ref);
    return v3_dot(to_point, to_point) * f_safe_rcp(f_abs(v3_dot(d, si->ng)) * area);
}
