// turned.h: scattering about a normal n other than the surface's own, in whose frame n is given: what normal and bump
// maps have in common. The nested function sees both directions in a frame about n, with its tangent along the
// surface's; light that is above one of the two surfaces and below the other one is dropped. Optionally the rest is
// shadowed as by a microsurface whose roughness follows from the angle between the normals [estevez2019 eq. 3 and 4].
// The jump where n turns away from the viewer is a boundary term (facing.h); where that is not known it is reported (turned_watch).
#pragma once

#include "bsdf/call.h"

typedef struct Turned {
    Frame frame;
    Vec3 wi, wo;
    Mask counts;
} Turned;

// n, or its mirror image about the surface's normal where n faces away from a viewer that the surface faces.
KFN Vec3 turned_valid(Vec3 n, Vec3 wi, int32_t flip_invalid) {
    Mask flip = m_set(flip_invalid) & m_le(wi.z * v3_dot(wi, n), f_set(0));
    return v3(f_select(flip, -n.x, n.x), f_select(flip, -n.y, n.y), n.z);
}

// Notes in the sink whether n faces the viewer as the surface does. Where it faces away from the light the value goes
// to 0 continuously, with the cosine. turns: where n points into the surface it is mirrored or turned round, and jumps once more;
// that is noted, too.
KFN void turned_watch(Vec3 n, Vec3 wi, bool turns, Sink *sink, Mask m) {
    if (sink->watch_turned) {
        Mask away = m_le(wi.z * v3_dot(wi, n), f_set(0));
        sink->faces |= (m_any(m & away) ? FACES_AWAY : 0) | (m_any(m & ~away) ? FACES_ALIKE : 0);
    }
    if (sink->watch_inward && turns) {
        sink->faces |= m_any(m & m_lt(n.z, f_set(0))) ? FACES_INWARD : 0;
    }
}

KFN Vec3 turned_valid_adj(Vec3 n, Vec3 wi, int32_t flip_invalid, Vec3 dvalid) {
    Mask flip = m_set(flip_invalid) & m_le(wi.z * v3_dot(wi, n), f_set(0));
    return v3(f_select(flip, -dvalid.x, dvalid.x), f_select(flip, -dvalid.y, dvalid.y), dvalid.z);
}

// (1, 0, 0) - n.x n for a unit vector n, without cancellation.
KFN Vec3 turned_tangent(Vec3 n) { return v3(n.y * n.y + n.z * n.z, -n.x * n.y, -n.x * n.z); }

// Frame about n, its tangent the surface's tangent (1, 0, 0) made orthogonal.
KFN Frame turned_frame(Vec3 n) {
    Frame f;
    f.n = n;
    f.s = v3_normalize(turned_tangent(n));
    f.t = v3_cross(n, f.s);
    return f;
}

KFN void turned_frame_adj(const Frame *f, const Frame *df, Vec3 *dn) {
    Vec3 n = f->n, ds = df->s, dq = v3_zero();
    v3_acc(dn, df->n);
    // t = n x s
    v3_cross_adj(n, f->s, df->t, dn, &ds);
    // s = normalize(q), q = (n.y^2 + n.z^2, -n.x n.y, -n.x n.z)
    v3_normalize_adj(turned_tangent(n), ds, &dq);
    v3_acc(dn, v3(-n.y * dq.y - n.z * dq.z, 2.0f * n.y * dq.x - n.x * dq.y, 2.0f * n.z * dq.x - n.x * dq.z));
}

KFN Turned turned_make(Vec3 n, Vec3 wi, Vec3 wo) {
    Turned t;
    t.frame = turned_frame(n);
    t.wi = frame_to_local(&t.frame, wi);
    t.wo = frame_to_local(&t.frame, wo);
    t.counts = m_gt(wo.z * t.wo.z, f_set(0));
    return t;
}

// G = 2 / (1 + sqrt(1 + a^2 tan^2 o)), a^2 = min(tan^2 n / 8, 1), with the cosines multiplied out; and its slopes.
KFN Float turned_shadow(Vec3 n, Vec3 wo, Vec3 *dn, Float *dwo_z) {
    Float inv_z2 = f_safe_rcp(f_max(8.0f * n.z * n.z, f_set(1e-6f))), c = f_abs(wo.z);
    Float tangent = (n.x * n.x + n.y * n.y) * inv_z2, a2 = f_min(tangent, f_set(1));
    Float r = f_safe_sqrt(c * c + a2 * (1.0f - c * c)), inv = f_safe_rcp(c + r), inv_r = f_safe_rcp(r);
    // G = 2 c / (c + r), r^2 = c^2 + a2 (1 - c^2): dG/dr = -2 c / (c + r)^2, dG/dc = 2 a2 / (r (c + r)^2)
    Float da2 = f_zero_unless(m_lt(tangent, f_set(1)), -c * f_sqr(inv) * (1.0f - c * c) * inv_r);
    // a2 = (n.x^2 + n.y^2) / (8 n.z^2)
    *dn = v3_scale(v3(n.x * inv_z2, n.y * inv_z2, -tangent * f_safe_rcp(n.z)), 2.0f * da2);
    *dwo_z = f_sign(wo.z) * 2.0f * a2 * inv_r * f_sqr(inv);
    return 2.0f * c * inv;
}

KFN Spec turned_eval(const BsdfCall *call, Vec3 n, int32_t shadowing, Vec3 wi, Vec3 wo, Int lobe) {
    Turned t = turned_make(n, wi, wo);
    BsdfCall child = bsdf_child(call, 0);
    Vec3 by_n;
    Float by_wo, shadow = shadowing ? turned_shadow(n, wo, &by_n, &by_wo) : f_set(1);
    return spec_zero_unless(t.counts, spec_scale(bsdf_eval(&child, t.wi, t.wo, lobe), shadow));
}

KFN Float turned_pdf(const BsdfCall *call, Vec3 n, Vec3 wi, Vec3 wo, Int lobe) {
    Turned t = turned_make(n, wi, wo);
    BsdfCall child = bsdf_child(call, 0);
    return f_zero_unless(t.counts, bsdf_pdf(&child, t.wi, t.wo, lobe));
}

KFN BsdfSample turned_sample(const BsdfCall *call, Vec3 n, Vec3 wi, Float u1, Vec2 u2) {
    Frame f = turned_frame(n);
    BsdfCall child = bsdf_child(call, 0);
    BsdfSample s = bsdf_sample(&child, frame_to_local(&f, wi), u1, u2);
    Vec3 wo = frame_to_world(&f, s.wo);
    s.wo = v3_select(m_gt(wo.z * s.wo.z, f_set(0)), wo, v3_zero());
    return s;
}

// Accumulates the adjoint of turned_eval into dn, dwi, dwo, and into the nested function's own parameters.
KFN void turned_adj(const BsdfCall *call, Vec3 n, int32_t shadowing, Vec3 wi, Vec3 wo, Int lobe, Spec df, Sink *sink,
                    Mask m, Vec3 *dn, Vec3 *dwi, Vec3 *dwo, Vec2 *duv) {
    Turned t = turned_make(n, wi, wo);
    BsdfCall child = bsdf_child(call, 0);
    Vec3 da = v3_zero(), db = v3_zero();
    Frame dframe = {v3_zero(), v3_zero(), v3_zero()};
    df = spec_zero_unless(t.counts, df);
    // f = nested G
    if (shadowing) {
        Vec3 by_n;
        Float by_wo, shadow = turned_shadow(n, wo, &by_n, &by_wo);
        Float dshadow = spec_dot(df, bsdf_eval(&child, t.wi, t.wo, lobe));
        *dn = v3_madd(*dn, dshadow, by_n);
        dwo->z = dwo->z + dshadow * by_wo;
        df = spec_scale(df, shadow);
    }
    Mask delta = lobe_turns(lobe);
    if (m_any(delta)) {
        // wo = to_world(nested wo)
        Vec3 dsampled = v3_select(delta, *dwo, v3_zero());
        frame_to_world_adj(t.wo, dsampled, &dframe);
        db = frame_to_local(&t.frame, dsampled);
    }
    bsdf_adj(&child, t.wi, t.wo, lobe, df, sink, m, &da, &db, duv);
    // nested(to_local(wi), to_local(wo))
    frame_to_local_adj(&t.frame, wi, da, &dframe, dwi);
    frame_to_local_adj(&t.frame, wo, v3_select(delta, v3_zero(), db), &dframe, dwo);
    turned_frame_adj(&t.frame, &dframe, dn);
}

// The same of turned_pdf.
KFN void turned_pdf_adj(const BsdfCall *call, Vec3 n, Vec3 wi, Vec3 wo, Float dpdf, Sink *sink, Mask m, Vec3 *dn, Vec3 *dwi,
                        Vec3 *dwo, Vec2 *duv) {
    Turned t = turned_make(n, wi, wo);
    BsdfCall child = bsdf_child(call, 0);
    Vec3 da = v3_zero(), db = v3_zero();
    Frame dframe = {v3_zero(), v3_zero(), v3_zero()};
    bsdf_pdf_adj(&child, t.wi, t.wo, f_zero_unless(t.counts, dpdf), sink, m, &da, &db, duv);
    frame_to_local_adj(&t.frame, wi, da, &dframe, dwi);
    frame_to_local_adj(&t.frame, wo, db, &dframe, dwo);
    turned_frame_adj(&t.frame, &dframe, dn);
}
