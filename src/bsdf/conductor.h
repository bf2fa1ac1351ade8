// conductor.h: a smooth metal. One delta: F(cos_i; eta + i k) x specular_reflectance, from the front side only.
#pragma once

#include "bsdf/record.h"
#include "math/fresnel.h"

#define CONDUCTOR_PARAMS(P)                                                                                            \
    P(METAL_ETA, eta, 0, 0, INFINITY, "real part of the index of refraction", "")                                      \
    P(METAL_K, k, 1, 0, INFINITY, "imaginary part of the index of refraction", "")                                     \
    P(SPEC, specular_reflectance, 1, 0, 1, "factor on the reflection", "")
KIND_RECORD(Conductor, CONDUCTOR_PARAMS, NO_CONFIG)

KFN Mask conductor_counts(Vec3 wi, Int lobe) { return m_gt(wi.z, f_set(0)) & mi_eq(lobe, i_set(LOBE_REFLECT)); }

KFN Spec conductor_eval(const Conductor *p, Vec3 wi, Vec3 wo, Int lobe) {
    UNUSED(wo);
    Spec f = spec_mul(fresnel_conductor(wi.z, p->eta, p->k), p->specular_reflectance);
    return spec_zero_unless(conductor_counts(wi, lobe), f);
}

KFN Float conductor_pdf(const Conductor *p, Vec3 wi, Vec3 wo, Int lobe) {
    UNUSED(p);
    UNUSED(wo);
    return f_zero_unless(conductor_counts(wi, lobe), f_set(1));
}

KFN BsdfSample conductor_sample(const Conductor *p, Vec3 wi, Float u1, Vec2 u2) {
    UNUSED(p);
    UNUSED(u1);
    UNUSED(u2);
    return (BsdfSample){v3(-wi.x, -wi.y, wi.z), i_set(LOBE_REFLECT), f_set(1)};
}

KFN void conductor_adj(const Conductor *p, Vec3 wi, Vec3 wo, Int lobe, Spec df, Conductor *dp, Vec3 *dwi, Vec3 *dwo) {
    UNUSED(wo);
    mirrored_adj(conductor_counts(wi, lobe), dwo, dwi);
    df = spec_zero_unless(conductor_counts(wi, lobe), df);
    // f = F(wi.z) specular_reflectance
    Spec fresnel = fresnel_conductor(wi.z, p->eta, p->k);
    spec_acc(&dp->specular_reflectance, spec_mul(df, fresnel));
    fresnel_conductor_adj(wi.z, p->eta, p->k, spec_mul(df, p->specular_reflectance), &dwi->z, &dp->eta, &dp->k);
}

NO_SMOOTH_LOBE(conductor, Conductor)
