// null.h: no surface at all; light passes straight through with weight 1.
#pragma once

#include "bsdf/record.h"

#define NO_PARAMS(P)
KIND_RECORD(Null, NO_PARAMS, NO_CONFIG)

KFN Spec null_eval(const Null *p, Vec3 wi, Vec3 wo, Int lobe) {
    UNUSED(p);
    UNUSED(wi);
    UNUSED(wo);
    return spec_set(f_zero_unless(mi_eq(lobe, i_set(LOBE_NULL)), f_set(1)));
}

KFN Float null_pdf(const Null *p, Vec3 wi, Vec3 wo, Int lobe) {
    return null_eval(p, wi, wo, lobe).c[0];
}

KFN BsdfSample null_sample(const Null *p, Vec3 wi, Float u1, Vec2 u2) {
    UNUSED(p);
    UNUSED(u1);
    UNUSED(u2);
    return (BsdfSample){v3_neg(wi), i_set(LOBE_NULL), f_set(1)};
}

KFN void null_adj(const Null *p, Vec3 wi, Vec3 wo, Int lobe, Spec df, Null *dp, Vec3 *dwi, Vec3 *dwo) {
    // The coefficient is constant.
    UNUSED(p), UNUSED(wi), UNUSED(wo), UNUSED(lobe), UNUSED(df), UNUSED(dp), UNUSED(dwi), UNUSED(dwo);
}

NO_SMOOTH_LOBE(null, Null)
