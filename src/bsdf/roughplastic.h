// roughplastic.h: a diffuse base under a rough coat: F D G / (4 cos_i) ks, and the base seen through the coat,
// kd' T(cos_i) T(cos_o) cos_o / (pi eta^2) with kd' as in plastic.h and T the coat's tabulated transmittance.
// From the front side only.
#pragma once

#include "bsdf/critical.h"
#include "bsdf/plastic.h"
#include "math/microfacet.h"

#define ROUGHPLASTIC_PARAMS(P)                                                                                         \
    P(IOR, eta, 1.49f, 1e-3f, INFINITY, "relative index of refraction, interior over exterior", "polypropylene")       \
    P(SPEC, diffuse_reflectance, 0.5f, 0, 1, "colour of the base", "")                                                 \
    P(SPEC, specular_reflectance, 1, 0, 1, "factor on the reflection of the coat", "")                                 \
    P(REAL, alpha, 0.1f, 0, 1, "roughness of the coat", "")
#define ROUGHPLASTIC_CONFIG(C)                                                                                         \
    MICROFACET_CONFIG(C)                                                                                               \
    C(nonlinear, 0, "false|true", "colour shifts by scattering inside the coat")
KIND_RECORD(RoughPlastic, ROUGHPLASTIC_PARAMS, ROUGHPLASTIC_CONFIG)

// The derived table: T at 64 cosines, its derivatives by alpha and by eta, then the internal reflectance and its two.
enum { COAT_NODES = 64, COAT_BY_ALPHA = 64, COAT_BY_ETA = 128, COAT_INTERNAL = 192, COAT_TABLE_SIZE = 195 };

KFN Float coat_node(const float *table, Int at) {
#ifdef REAL_DOUBLE
    return (Float)table[at];
#else
    return f_gather(table, at);
#endif
}

// Linear interpolation in the cosine; also the derivative with respect to it.
KFN Float coat_lookup(const float *table, Float cosine, Float *slope) {
    Float x = f_clamp(cosine, f_set(0), f_set(1)) * (real)(COAT_NODES - 1);
    Int i = i_min(i_from_f(x), i_set(COAT_NODES - 2));
    Float a = coat_node(table, i), b = coat_node(table, i + 1);
    *slope = (b - a) * (real)(COAT_NODES - 1);
    return a + (b - a) * (x - f_from_i(i));
}

KFN Float roughplastic_transmittance(const RoughPlastic *p, Float cosine) {
    Float slope;
    return coat_lookup(p->table, cosine, &slope);
}

KFN void roughplastic_transmittance_adj(const RoughPlastic *p, Float cosine, Float dt, RoughPlastic *dp, Float *dcosine) {
    Float slope, unused;
    coat_lookup(p->table, cosine, &slope);
    *dcosine = *dcosine + dt * slope;
    dp->alpha = dp->alpha + dt * coat_lookup(p->table + COAT_BY_ALPHA, cosine, &unused);
    dp->eta = dp->eta + dt * coat_lookup(p->table + COAT_BY_ETA, cosine, &unused);
}

KFN Microfacet roughplastic_facets(const RoughPlastic *p) {
    return microfacet_make(p->distribution, p->sample_visible, p->alpha, p->alpha);
}

KFN Mask roughplastic_counts(Vec3 wi, Vec3 wo, Int lobe) {
    return m_gt(wi.z, f_set(0)) & m_gt(wo.z, f_set(0)) & mi_eq(lobe, i_set(LOBE_SMOOTH));
}

KFN Spec roughplastic_eval(const RoughPlastic *p, Vec3 wi, Vec3 wo, Int lobe) {
    Mask counts = roughplastic_counts(wi, wo, lobe);
    Microfacet mf = roughplastic_facets(p);
    Vec3 m = v3_normalize(v3_add(wi, wo));
    Float cos_t, eta_it, eta_ti, f = fresnel_dielectric(v3_dot(wi, m), p->eta, &cos_t, &eta_it, &eta_ti);
    Float coat = f * microfacet_D(&mf, m) * smith_G(&mf, wi, wo, m) * f_safe_rcp(4.0f * wi.z);
    Float rcp_eta = 1.0f / p->eta;
    Float through = roughplastic_transmittance(p, wi.z) * roughplastic_transmittance(p, wo.z) * wo.z * rcp_eta * rcp_eta *
                    INV_PI;
    Spec kd = plastic_base(p->diffuse_reflectance, f_set(p->table[COAT_INTERNAL]), p->nonlinear);
    return spec_madd(spec_scale(p->specular_reflectance, f_zero_unless(counts, coat)), f_zero_unless(counts, through), kd);
}

KFN Float roughplastic_probability(const RoughPlastic *p, Vec3 wi) {
    Float t = roughplastic_transmittance(p, wi.z);
    return lobe_probability((1.0f - t) * spec_mean(p->specular_reflectance), t * spec_mean(p->diffuse_reflectance),
                            p->floor);
}

KFN Float roughplastic_pdf(const RoughPlastic *p, Vec3 wi, Vec3 wo, Int lobe) {
    Microfacet mf = roughplastic_facets(p);
    Vec3 m = v3_normalize(v3_add(wi, wo));
    Float q = roughplastic_probability(p, wi);
    Float coat = interface_pdf(&mf, wi, m, p->eta, p->floor) * f_safe_rcp(4.0f * v3_dot(wo, m));
    return f_zero_unless(roughplastic_counts(wi, wo, lobe), q * coat + (1.0f - q) * wo.z * INV_PI);
}

KFN BsdfSample roughplastic_sample(const RoughPlastic *p, Vec3 wi, Float u1, Vec2 u2) {
    Microfacet mf = roughplastic_facets(p);
    Float q = roughplastic_probability(p, wi), inner = u1 * f_safe_rcp(q);
    Vec3 m = interface_sample(&mf, wi, p->eta, p->floor, &inner, u2);
    Vec3 wo = v3_select(m_lt(u1, q), reflect(wi, m), warp_cosine_hemisphere(u2));
    return (BsdfSample){wo, i_set(LOBE_SMOOTH), f_set(1)};
}

KFN void roughplastic_adj(const RoughPlastic *p, Vec3 wi, Vec3 wo, Int lobe, Spec df, RoughPlastic *dp, Vec3 *dwi,
                          Vec3 *dwo) {
    df = spec_zero_unless(roughplastic_counts(wi, wo, lobe), df);
    Microfacet mf = roughplastic_facets(p);
    Vec3 m = v3_normalize(v3_add(wi, wo)), dm = v3_zero();
    Float cosine = v3_dot(wi, m), dcosine = f_set(0), cos_t, eta_it, eta_ti;
    Float f = fresnel_dielectric(cosine, p->eta, &cos_t, &eta_it, &eta_ti);
    Float d = microfacet_D(&mf, m), gi = smith_G1(&mf, wi, m), go = smith_G1(&mf, wo, m);
    Float rcp = f_safe_rcp(4.0f * wi.z), coat = f * d * gi * go * rcp;
    // f = ks coat + kd' through, coat = F D Gi Go / (4 wi.z)
    Float dcoat = spec_dot(df, p->specular_reflectance), du = f_set(0), dv = f_set(0);
    spec_acc(&dp->specular_reflectance, spec_scale(df, coat));
    fresnel_dielectric_adj(cosine, p->eta, dcoat * d * gi * go * rcp, f_set(0), &dcosine, &dp->eta);
    microfacet_D_adj(&mf, m, dcoat * f * gi * go * rcp, &du, &dv, &dm);
    smith_G1_adj(&mf, wi, m, dcoat * f * d * go * rcp, &du, &dv, dwi);
    smith_G1_adj(&mf, wo, m, dcoat * f * d * gi * rcp, &du, &dv, dwo);
    dwi->z = dwi->z - dcoat * coat * f_safe_rcp(wi.z);
    microfacet_alpha_adj(p->alpha, du + dv, &dp->alpha);
    v3_acc(dwi, v3_scale(m, dcosine));
    v3_acc(&dm, v3_scale(wi, dcosine));
    half_vector_adj(wi, wo, dm, dwi, dwo);
    // through = T(wi.z) T(wo.z) wo.z / (pi eta^2)
    Float rcp_eta = 1.0f / p->eta, rest = rcp_eta * rcp_eta * INV_PI, dfdr = f_set(0);
    Float ti = roughplastic_transmittance(p, wi.z), to = roughplastic_transmittance(p, wo.z);
    Float internal = f_set(p->table[COAT_INTERNAL]);
    Spec kd = plastic_base(p->diffuse_reflectance, internal, p->nonlinear);
    Float dthrough = spec_dot(df, kd);
    plastic_base_adj(p->diffuse_reflectance, internal, p->nonlinear, spec_scale(df, ti * to * wo.z * rest),
                     &dp->diffuse_reflectance, &dfdr);
    roughplastic_transmittance_adj(p, wi.z, dthrough * to * wo.z * rest, dp, &dwi->z);
    roughplastic_transmittance_adj(p, wo.z, dthrough * ti * wo.z * rest, dp, &dwo->z);
    dwo->z = dwo->z + dthrough * ti * to * rest;
    dp->eta = dp->eta - 2.0f * dthrough * ti * to * wo.z * rest * rcp_eta + dfdr * (real)p->table[COAT_INTERNAL + 2];
    dp->alpha = dp->alpha + dfdr * (real)p->table[COAT_INTERNAL + 1];
}

KFN void roughplastic_pdf_adj(const RoughPlastic *p, Vec3 wi, Vec3 wo, Float dpdf, RoughPlastic *dp, Vec3 *dwi, Vec3 *dwo) {
    Microfacet mf = roughplastic_facets(p);
    Vec3 m = v3_normalize(v3_add(wi, wo));
    Float q = roughplastic_probability(p, wi), coat = microfacet_pdf(&mf, wi, m) * f_safe_rcp(4.0f * v3_dot(wo, m));
    Float du = f_set(0), dv = f_set(0), da = f_set(0), db = f_set(0);
    dpdf = f_zero_unless(roughplastic_counts(wi, wo, i_set(LOBE_SMOOTH)), dpdf);
    // pdf = q coat + (1 - q) wo.z / pi
    dwo->z = dwo->z + dpdf * (1.0f - q) * INV_PI;
    microfacet_mirrored_pdf_adj(&mf, wi, wo, dpdf * q, &du, &dv, dwi, dwo);
    microfacet_alpha_adj(p->alpha, du + dv, &dp->alpha);
    // q the share of a = (1 - T) ks beside b = T kd
    Float t = roughplastic_transmittance(p, wi.z), ks = spec_mean(p->specular_reflectance), kd = spec_mean(p->diffuse_reflectance);
    lobe_probability_adj((1.0f - t) * ks, t * kd, dpdf * (coat - wo.z * INV_PI), &da, &db);
    spec_acc(&dp->specular_reflectance, spec_set(da * (1.0f - t) * (1.0f / SPEC_N)));
    spec_acc(&dp->diffuse_reflectance, spec_set(db * t * (1.0f / SPEC_N)));
    roughplastic_transmittance_adj(p, wi.z, db * kd - da * ks, dp, &dwi->z);
}
