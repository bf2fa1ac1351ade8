// dielectric.h: smooth glass. Deltas: reflection F and refraction (1 - F) / eta_it^2 (radiance is compressed), each
// times its colour; from both sides.
#pragma once

#include "bsdf/record.h"
#include "math/fresnel.h"

#define DIELECTRIC_PARAMS(P)                                                                                           \
    P(SMOOTH_IOR, eta, 1.5046f, 1e-3f, INFINITY, "relative index of refraction, interior over exterior", "bk7")        \
    P(SPEC, specular_reflectance, 1, 0, 1, "factor on the reflection", "")                                             \
    P(SPEC, specular_transmittance, 1, 0, 1, "factor on the refraction", "")
KIND_RECORD(Dielectric, DIELECTRIC_PARAMS, NO_CONFIG)

KFN Spec dielectric_eval(const Dielectric *p, Vec3 wi, Vec3 wo, Int lobe) {
    UNUSED(wo);
    Float cos_t, eta_it, eta_ti, f = fresnel_dielectric(wi.z, p->eta, &cos_t, &eta_it, &eta_ti);
    Mask reflects = mi_eq(lobe, i_set(LOBE_REFLECT)), refracts = mi_eq(lobe, i_set(LOBE_TRANSMIT));
    Spec r = spec_scale(p->specular_reflectance, f_zero_unless(reflects, f));
    return spec_madd(r, f_zero_unless(refracts, (1.0f - f) * eta_ti * eta_ti), p->specular_transmittance);
}

// Probability of reflection; 1 in total internal reflection, where there is nothing else.
KFN Float dielectric_probability(const Dielectric *p, Vec3 wi, Float f, Float cos_t) {
    UNUSED(wi);
    Float q = f_clamp(f, f_set(p->floor), f_set(1 - p->floor));
    return f_select(m_eq(cos_t, f_set(0)), f_set(1), q);
}

KFN Float dielectric_pdf(const Dielectric *p, Vec3 wi, Vec3 wo, Int lobe) {
    UNUSED(wo);
    Float cos_t, eta_it, eta_ti, f = fresnel_dielectric(wi.z, p->eta, &cos_t, &eta_it, &eta_ti);
    Float q = dielectric_probability(p, wi, f, cos_t);
    return f_zero_unless(mi_eq(lobe, i_set(LOBE_REFLECT)), q) + f_zero_unless(mi_eq(lobe, i_set(LOBE_TRANSMIT)), 1.0f - q);
}

KFN BsdfSample dielectric_sample(const Dielectric *p, Vec3 wi, Float u1, Vec2 u2) {
    UNUSED(u2);
    Float cos_t, eta_it, eta_ti, f = fresnel_dielectric(wi.z, p->eta, &cos_t, &eta_it, &eta_ti);
    Mask reflects = m_lt(u1, dielectric_probability(p, wi, f, cos_t));
    Vec3 refracted = v3(-eta_ti * wi.x, -eta_ti * wi.y, cos_t);
    return (BsdfSample){v3_select(reflects, v3(-wi.x, -wi.y, wi.z), refracted),
                        i_select(reflects, i_set(LOBE_REFLECT), i_set(LOBE_TRANSMIT)),
                        f_select(reflects, f_set(1), eta_it)};
}

KFN void dielectric_adj(const Dielectric *p, Vec3 wi, Vec3 wo, Int lobe, Spec df, Dielectric *dp, Vec3 *dwi, Vec3 *dwo) {
    UNUSED(wo);
    Float cos_t, eta_it, eta_ti, f = fresnel_dielectric(wi.z, p->eta, &cos_t, &eta_it, &eta_ti);
    Mask refracts = mi_eq(lobe, i_set(LOBE_TRANSMIT));
    Spec dr = spec_zero_unless(mi_eq(lobe, i_set(LOBE_REFLECT)), df);
    Spec dt = spec_zero_unless(refracts, df);
    // wo = (-wi.x, -wi.y, wi.z) or (-eta_ti wi.x, -eta_ti wi.y, cos_t)
    mirrored_adj(mi_eq(lobe, i_set(LOBE_REFLECT)), dwo, dwi);
    Vec3 dbent = v3_select(refracts, *dwo, v3_zero());
    v3_acc(dwi, v3(-eta_ti * dbent.x, -eta_ti * dbent.y, f_set(0)));
    // r = F specular_reflectance, t = (1 - F) eta_ti^2 specular_transmittance
    Float tint = spec_dot(dt, p->specular_transmittance);
    spec_acc(&dp->specular_reflectance, spec_scale(dr, f));
    spec_acc(&dp->specular_transmittance, spec_scale(dt, (1.0f - f) * eta_ti * eta_ti));
    Float dfresnel = spec_dot(dr, p->specular_reflectance) - tint * eta_ti * eta_ti;
    fresnel_dielectric_adj(wi.z, p->eta, dfresnel, dbent.z, &dwi->z, &dp->eta);
    // eta_ti = 1 / eta from outside, eta from inside
    Float deta_ti = 2.0f * tint * (1.0f - f) * eta_ti - wi.x * dbent.x - wi.y * dbent.y;
    dp->eta = dp->eta + f_select(m_ge(wi.z, f_set(0)), -deta_ti * eta_ti * eta_ti, deta_ti);
}

NO_SMOOTH_LOBE(dielectric, Dielectric)
