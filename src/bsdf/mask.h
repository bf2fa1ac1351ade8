// mask.h: a surface with holes. With o = opacity clamped to [0, 1]: f = o nested + (1 - o) pass-through.
#pragma once

#include "bsdf/call.h"

#define MASK_PARAMS(P) P(REAL, opacity, 0.5f, 0, 1, "1 = the nested surface, 0 = a hole", "")
KIND_RECORD(MaskBsdf, MASK_PARAMS, NO_CONFIG)

KFN Float mask_opacity(const MaskBsdf *p) { return f_clamp(p->opacity, f_set(0), f_set(1)); }

KFN Spec mask_eval(const BsdfCall *call, const MaskBsdf *p, Vec3 wi, Vec3 wo, Int lobe) {
    Float o = mask_opacity(p);
    BsdfCall child = bsdf_child(call, 0);
    Float hole = f_zero_unless(mi_eq(lobe, i_set(LOBE_NULL)), 1.0f - o);
    return spec_add(spec_scale(bsdf_eval(&child, wi, wo, lobe), o), spec_set(hole));
}

KFN Float mask_probability(const MaskBsdf *p) { return f_clamp(mask_opacity(p), f_set(p->floor), f_set(1 - p->floor)); }

KFN Float mask_pdf(const BsdfCall *call, const MaskBsdf *p, Vec3 wi, Vec3 wo, Int lobe) {
    Float q = mask_probability(p);
    BsdfCall child = bsdf_child(call, 0);
    return q * bsdf_pdf(&child, wi, wo, lobe) + f_zero_unless(mi_eq(lobe, i_set(LOBE_NULL)), 1.0f - q);
}

KFN BsdfSample mask_sample(const BsdfCall *call, const MaskBsdf *p, Vec3 wi, Float u1, Vec2 u2) {
    Float q = mask_probability(p);
    Mask nested = m_lt(u1, q);
    BsdfCall child = bsdf_child(call, 0);
    BsdfSample s = bsdf_sample(&child, wi, f_min(u1 * f_safe_rcp(q), f_set(0.99999994f)), u2);
    s.wo = v3_select(nested, s.wo, v3_neg(wi));
    s.lobe = i_select(nested, s.lobe, i_set(LOBE_NULL));
    s.eta = f_select(nested, s.eta, f_set(1));
    return s;
}

KFN void mask_adj(const BsdfCall *call, const MaskBsdf *p, Vec3 wi, Vec3 wo, Int lobe, Spec df, Sink *sink, Mask m,
                  MaskBsdf *dp, Vec3 *dwi, Vec3 *dwo, Vec2 *duv) {
    Float o = mask_opacity(p);
    BsdfCall child = bsdf_child(call, 0);
    // f = o nested + (1 - o) [null]
    Float d = spec_dot(df, bsdf_eval(&child, wi, wo, lobe)) - f_zero_unless(mi_eq(lobe, i_set(LOBE_NULL)), spec_sum(df));
    dp->opacity = dp->opacity + f_zero_unless(share_inside(p->opacity), d);
    bsdf_adj(&child, wi, wo, lobe, spec_scale(df, o), sink, m, dwi, dwo, duv);
}

KFN void mask_pdf_adj(const BsdfCall *call, const MaskBsdf *p, Vec3 wi, Vec3 wo, Float dpdf, Sink *sink, Mask m,
                      MaskBsdf *dp, Vec3 *dwi, Vec3 *dwo, Vec2 *duv) {
    BsdfCall child = bsdf_child(call, 0);
    // pdf = o nested
    Float d = f_zero_unless(share_inside(p->opacity), dpdf * bsdf_pdf(&child, wi, wo, i_set(LOBE_SMOOTH)));
    dp->opacity = dp->opacity + d;
    bsdf_pdf_adj(&child, wi, wo, dpdf * mask_opacity(p), sink, m, dwi, dwo, duv);
}
