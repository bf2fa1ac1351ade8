// roughconductor.h: a rough metal. f cos_o = F(wi.m) D(m) G(wi, wo, m) / (4 cos_i) x specular_reflectance
// [walter2007 eq. 20], m the half vector; from the front side only.
#pragma once

#include "bsdf/record.h"
#include "math/microfacet.h"

#define ROUGHCONDUCTOR_PARAMS(P)                                                                                       \
    P(METAL_ETA, eta, 0, 0, INFINITY, "real part of the index of refraction", "")                                      \
    P(METAL_K, k, 1, 0, INFINITY, "imaginary part of the index of refraction", "")                                     \
    P(SPEC, specular_reflectance, 1, 0, 1, "factor on the reflection", "")                                             \
    P(ALPHA_U, alpha_u, 0.1f, 0, 1, "roughness along the tangent", "")                                                 \
    P(ALPHA_V, alpha_v, 0.1f, 0, 1, "roughness across the tangent", "")
#define MICROFACET_CONFIG(C)                                                                                           \
    C(distribution, 0, "beckmann|ggx", "distribution of microfacet normals")                                           \
    C(sample_visible, 1, "false|true", "sample the visible normals only")
KIND_RECORD(RoughConductor, ROUGHCONDUCTOR_PARAMS, MICROFACET_CONFIG)

KFN Microfacet roughconductor_facets(const RoughConductor *p) {
    return microfacet_make(p->distribution, p->sample_visible, p->alpha_u, p->alpha_v);
}

KFN Mask roughconductor_counts(Vec3 wi, Vec3 wo, Int lobe) {
    return m_gt(wi.z, f_set(0)) & m_gt(wo.z, f_set(0)) & mi_eq(lobe, i_set(LOBE_SMOOTH));
}

KFN Spec roughconductor_eval(const RoughConductor *p, Vec3 wi, Vec3 wo, Int lobe) {
    Microfacet mf = roughconductor_facets(p);
    Vec3 m = v3_normalize(v3_add(wi, wo));
    Float shape = microfacet_D(&mf, m) * smith_G(&mf, wi, wo, m) * f_safe_rcp(4.0f * wi.z);
    Spec f = spec_mul(fresnel_conductor(v3_dot(wi, m), p->eta, p->k), p->specular_reflectance);
    return spec_scale(f, f_zero_unless(roughconductor_counts(wi, wo, lobe), shape));
}

KFN Float roughconductor_pdf(const RoughConductor *p, Vec3 wi, Vec3 wo, Int lobe) {
    Microfacet mf = roughconductor_facets(p);
    Vec3 m = v3_normalize(v3_add(wi, wo));
    Float pdf = microfacet_pdf(&mf, wi, m) * f_safe_rcp(4.0f * v3_dot(wo, m));
    return f_zero_unless(roughconductor_counts(wi, wo, lobe), pdf);
}

KFN BsdfSample roughconductor_sample(const RoughConductor *p, Vec3 wi, Float u1, Vec2 u2) {
    UNUSED(u1);
    Microfacet mf = roughconductor_facets(p);
    return (BsdfSample){reflect(wi, microfacet_sample(&mf, wi, u2.x, u2.y)), i_set(LOBE_SMOOTH), f_set(1)};
}

KFN void roughconductor_adj(const RoughConductor *p, Vec3 wi, Vec3 wo, Int lobe, Spec df, RoughConductor *dp, Vec3 *dwi,
                            Vec3 *dwo) {
    Mask counts = roughconductor_counts(wi, wo, lobe);
    Microfacet mf = roughconductor_facets(p);
    Vec3 m = v3_normalize(v3_add(wi, wo)), dm = v3_zero();
    Float d = microfacet_D(&mf, m), gi = smith_G1(&mf, wi, m), go = smith_G1(&mf, wo, m);
    Float rcp = f_safe_rcp(4.0f * wi.z), shape = d * gi * go * rcp, cosine = v3_dot(wi, m);
    Spec fresnel = fresnel_conductor(cosine, p->eta, p->k);
    df = spec_zero_unless(counts, df);
    // f = F specular_reflectance shape
    Float dshape = spec_dot(df, spec_mul(fresnel, p->specular_reflectance)), dcosine = f_set(0);
    spec_acc(&dp->specular_reflectance, spec_scale(spec_mul(df, fresnel), shape));
    fresnel_conductor_adj(cosine, p->eta, p->k, spec_scale(spec_mul(df, p->specular_reflectance), shape), &dcosine,
                          &dp->eta, &dp->k);
    // shape = D Gi Go / (4 wi.z)
    Float du = f_set(0), dv = f_set(0);
    microfacet_D_adj(&mf, m, dshape * gi * go * rcp, &du, &dv, &dm);
    smith_G1_adj(&mf, wi, m, dshape * d * go * rcp, &du, &dv, dwi);
    smith_G1_adj(&mf, wo, m, dshape * d * gi * rcp, &du, &dv, dwo);
    dwi->z = dwi->z - f_zero_unless(counts, dshape * shape * f_safe_rcp(wi.z));
    microfacet_alpha_adj(p->alpha_u, du, &dp->alpha_u);
    microfacet_alpha_adj(p->alpha_v, dv, &dp->alpha_v);
    // cosine = wi . m, m = normalize(wi + wo)
    v3_acc(dwi, v3_scale(m, dcosine));
    v3_acc(&dm, v3_scale(wi, dcosine));
    half_vector_adj(wi, wo, dm, dwi, dwo);
}

KFN void roughconductor_pdf_adj(const RoughConductor *p, Vec3 wi, Vec3 wo, Float dpdf, RoughConductor *dp, Vec3 *dwi,
                                Vec3 *dwo) {
    Microfacet mf = roughconductor_facets(p);
    Float du = f_set(0), dv = f_set(0);
    dpdf = f_zero_unless(roughconductor_counts(wi, wo, i_set(LOBE_SMOOTH)), dpdf);
    microfacet_mirrored_pdf_adj(&mf, wi, wo, dpdf, &du, &dv, dwi, dwo);
    microfacet_alpha_adj(p->alpha_u, du, &dp->alpha_u);
    microfacet_alpha_adj(p->alpha_v, dv, &dp->alpha_v);
}
