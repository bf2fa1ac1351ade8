// thindielectric.h: a sheet of glass with light bouncing between its two faces. With F of one face, the sum over the
// bounces reflects R = F + (1 - F)^2 F (1 + F^2 + F^4 + ...) = 2 F / (1 + F) and lets 1 - R pass undeviated
// [born1999 section 7.6]. Both faces look alike; the index turns no ray.
#pragma once

#include "bsdf/record.h"
#include "math/fresnel.h"

#define THINDIELECTRIC_PARAMS(P)                                                                                       \
    P(IOR, eta, 1.5046f, 1e-3f, INFINITY, "relative index of refraction, interior over exterior", "bk7")               \
    P(SPEC, specular_reflectance, 1, 0, 1, "factor on the reflection", "")                                             \
    P(SPEC, specular_transmittance, 1, 0, 1, "factor on the light that passes", "")
KIND_RECORD(ThinDielectric, THINDIELECTRIC_PARAMS, NO_CONFIG)

KFN Float thindielectric_reflectance(const ThinDielectric *p, Vec3 wi) {
    Float cos_t, eta_it, eta_ti, f = fresnel_dielectric(f_abs(wi.z), p->eta, &cos_t, &eta_it, &eta_ti);
    return 2.0f * f / (1.0f + f);
}

KFN Spec thindielectric_eval(const ThinDielectric *p, Vec3 wi, Vec3 wo, Int lobe) {
    UNUSED(wo);
    Float r = thindielectric_reflectance(p, wi);
    Spec f = spec_scale(p->specular_reflectance, f_zero_unless(mi_eq(lobe, i_set(LOBE_REFLECT)), r));
    return spec_madd(f, f_zero_unless(mi_eq(lobe, i_set(LOBE_NULL)), 1.0f - r), p->specular_transmittance);
}

// Probability of reflection; 1 where total internal reflection leaves nothing else.
KFN Float thindielectric_probability(const ThinDielectric *p, Vec3 wi) {
    Float r = thindielectric_reflectance(p, wi);
    return f_select(m_ge(r, f_set(1)), f_set(1), f_clamp(r, f_set(p->floor), f_set(1 - p->floor)));
}

KFN Float thindielectric_pdf(const ThinDielectric *p, Vec3 wi, Vec3 wo, Int lobe) {
    UNUSED(wo);
    Float q = thindielectric_probability(p, wi);
    return f_zero_unless(mi_eq(lobe, i_set(LOBE_REFLECT)), q) + f_zero_unless(mi_eq(lobe, i_set(LOBE_NULL)), 1.0f - q);
}

KFN BsdfSample thindielectric_sample(const ThinDielectric *p, Vec3 wi, Float u1, Vec2 u2) {
    UNUSED(u2);
    Mask reflects = m_lt(u1, thindielectric_probability(p, wi));
    return (BsdfSample){v3_select(reflects, v3(-wi.x, -wi.y, wi.z), v3_neg(wi)),
                        i_select(reflects, i_set(LOBE_REFLECT), i_set(LOBE_NULL)), f_set(1)};
}

KFN void thindielectric_adj(const ThinDielectric *p, Vec3 wi, Vec3 wo, Int lobe, Spec df, ThinDielectric *dp, Vec3 *dwi,
                            Vec3 *dwo) {
    UNUSED(wo);
    mirrored_adj(mi_eq(lobe, i_set(LOBE_REFLECT)), dwo, dwi);
    Float cos_t, eta_it, eta_ti, f = fresnel_dielectric(f_abs(wi.z), p->eta, &cos_t, &eta_it, &eta_ti);
    Float inv = 1.0f / (1.0f + f), r = 2.0f * f * inv, dcos = f_set(0);
    Spec dr = spec_zero_unless(mi_eq(lobe, i_set(LOBE_REFLECT)), df);
    Spec dt = spec_zero_unless(mi_eq(lobe, i_set(LOBE_NULL)), df);
    // f = R specular_reflectance or (1 - R) specular_transmittance
    spec_acc(&dp->specular_reflectance, spec_scale(dr, r));
    spec_acc(&dp->specular_transmittance, spec_scale(dt, 1.0f - r));
    Float dreflected = spec_dot(dr, p->specular_reflectance) - spec_dot(dt, p->specular_transmittance);
    // R = 2 F / (1 + F), F of |cos|
    fresnel_dielectric_adj(f_abs(wi.z), p->eta, 2.0f * dreflected * f_sqr(inv), f_set(0), &dcos, &dp->eta);
    dwi->z = dwi->z + f_sign(wi.z) * dcos;
}

NO_SMOOTH_LOBE(thindielectric, ThinDielectric)
