// blendbsdf.h: a mixture of two functions. With w = weight clamped to [0, 1]: f = (1 - w) first + w second.
#pragma once

#include "bsdf/call.h"

#define BLENDBSDF_PARAMS(P) P(REAL, weight, 0.5f, 0, 1, "share of the second function", "required")
KIND_RECORD(BlendBsdf, BLENDBSDF_PARAMS, NO_CONFIG)

KFN Float blendbsdf_weight(const BlendBsdf *p) { return f_clamp(p->weight, f_set(0), f_set(1)); }

// Probability of sampling the second function.
KFN Float blendbsdf_probability(const BlendBsdf *p) {
    return f_clamp(blendbsdf_weight(p), f_set(p->floor), f_set(1 - p->floor));
}

KFN Spec blendbsdf_child_eval(const BsdfCall *call, int child, Vec3 wi, Vec3 wo, Int lobe) {
    Mask mine = lobe_in_child(lobe, child);
    BsdfCall inner = bsdf_child(call, child);
    return m_any(mine) ? spec_zero_unless(mine, bsdf_eval(&inner, wi, wo, lobe_to_child(lobe))) : spec_zero();
}

KFN Float blendbsdf_child_pdf(const BsdfCall *call, int child, Vec3 wi, Vec3 wo, Int lobe) {
    Mask mine = lobe_in_child(lobe, child);
    BsdfCall inner = bsdf_child(call, child);
    return m_any(mine) ? f_zero_unless(mine, bsdf_pdf(&inner, wi, wo, lobe_to_child(lobe))) : f_set(0);
}

KFN Spec blendbsdf_eval(const BsdfCall *call, const BlendBsdf *p, Vec3 wi, Vec3 wo, Int lobe) {
    Float w = blendbsdf_weight(p);
    Spec f = spec_scale(blendbsdf_child_eval(call, 0, wi, wo, lobe), 1.0f - w);
    return spec_madd(f, w, blendbsdf_child_eval(call, 1, wi, wo, lobe));
}

KFN Float blendbsdf_pdf(const BsdfCall *call, const BlendBsdf *p, Vec3 wi, Vec3 wo, Int lobe) {
    Float q = blendbsdf_probability(p);
    return (1.0f - q) * blendbsdf_child_pdf(call, 0, wi, wo, lobe) + q * blendbsdf_child_pdf(call, 1, wi, wo, lobe);
}

// A sample that is of no use to its own function must not count under the density of the other one: it becomes the zero
// vector, to which no function gives a density.
KFN BsdfSample blendbsdf_child_sample(const BsdfCall *call, int child, Vec3 wi, Float u1, Vec2 u2) {
    BsdfCall inner = bsdf_child(call, child);
    BsdfSample s = bsdf_sample(&inner, wi, f_clamp(u1, f_set(0), f_set(0.99999994f)), u2);
    Mask useful = m_gt(bsdf_pdf(&inner, wi, s.wo, s.lobe), f_set(0));
    s.wo = v3_select(useful, s.wo, v3_zero());
    s.lobe = i_select(useful, lobe_from_child(s.lobe, child), i_set(LOBE_SMOOTH));
    return s;
}

KFN BsdfSample blendbsdf_sample(const BsdfCall *call, const BlendBsdf *p, Vec3 wi, Float u1, Vec2 u2) {
    Float q = blendbsdf_probability(p);
    Mask second = m_lt(u1, q);
    BsdfSample s = blendbsdf_child_sample(call, 0, wi, (u1 - q) * f_safe_rcp(1.0f - q), u2);
    BsdfSample t = blendbsdf_child_sample(call, 1, wi, u1 * f_safe_rcp(q), u2);
    s.wo = v3_select(second, t.wo, s.wo);
    s.lobe = i_select(second, t.lobe, s.lobe);
    s.eta = f_select(second, t.eta, s.eta);
    return s;
}

KFN void blendbsdf_adj(const BsdfCall *call, const BlendBsdf *p, Vec3 wi, Vec3 wo, Int lobe, Spec df, Sink *sink, Mask m,
                       BlendBsdf *dp, Vec3 *dwi, Vec3 *dwo, Vec2 *duv) {
    Float w = blendbsdf_weight(p);
    // f = (1 - w) first + w second
    Spec slope = spec_sub(blendbsdf_child_eval(call, 1, wi, wo, lobe), blendbsdf_child_eval(call, 0, wi, wo, lobe));
    dp->weight = dp->weight + f_zero_unless(share_inside(p->weight), spec_dot(df, slope));
    for (int child = 0; child < 2; child++) {
        Mask mine = m & lobe_in_child(lobe, child);
        if (m_any(mine)) {
            BsdfCall inner = bsdf_child(call, child);
            Spec d = spec_zero_unless(mine, spec_scale(df, child ? w : 1.0f - w));
            Vec3 own = v3_select(mine, *dwo, v3_zero());
            bsdf_adj(&inner, wi, wo, lobe_to_child(lobe), d, sink, mine, dwi, &own, duv);
            *dwo = v3_select(mine, own, *dwo);
        }
    }
}

KFN void blendbsdf_pdf_adj(const BsdfCall *call, const BlendBsdf *p, Vec3 wi, Vec3 wo, Float dpdf, Sink *sink, Mask m,
                           BlendBsdf *dp, Vec3 *dwi, Vec3 *dwo, Vec2 *duv) {
    const Int smooth = i_set(LOBE_SMOOTH);
    BsdfCall first = bsdf_child(call, 0), second = bsdf_child(call, 1);
    Float w = blendbsdf_weight(p), slope = bsdf_pdf(&second, wi, wo, smooth) - bsdf_pdf(&first, wi, wo, smooth);
    // pdf = (1 - w) first + w second
    dp->weight = dp->weight + f_zero_unless(share_inside(p->weight), dpdf * slope);
    bsdf_pdf_adj(&first, wi, wo, dpdf * (1.0f - w), sink, m, dwi, dwo, duv);
    bsdf_pdf_adj(&second, wi, wo, dpdf * w, sink, m, dwi, dwo, duv);
}
