// plastic.h: a diffuse base under a smooth coat. Delta F(cos_i) ks, and the base seen through the coat:
// kd' (1 - F(cos_i)) (1 - F(cos_o)) cos_o / (pi eta^2), kd' = kd / (1 - kd Fdr) (nonlinear) or kd / (1 - Fdr), with Fdr
// the diffuse reflectance of the coat from inside. From the front side only.
#pragma once

#include "bsdf/record.h"
#include "math/fresnel.h"
#include "math/warp.h"

#define PLASTIC_PARAMS(P)                                                                                              \
    P(IOR, eta, 1.49f, 1e-3f, INFINITY, "relative index of refraction, interior over exterior", "polypropylene")       \
    P(SPEC, diffuse_reflectance, 0.5f, 0, 1, "colour of the base", "")                                                 \
    P(SPEC, specular_reflectance, 1, 0, 1, "factor on the reflection of the coat", "")
#define PLASTIC_CONFIG(C) C(nonlinear, 0, "false|true", "colour shifts by scattering inside the coat")
KIND_RECORD(Plastic, PLASTIC_PARAMS, PLASTIC_CONFIG)

// Base colour as scattered back and forth under the coat.
KFN Spec plastic_base(Spec kd, Float fdr, bool nonlinear) {
    for (int c = 0; c < SPEC_N; c++) {
        kd.c[c] = kd.c[c] * f_safe_rcp(1.0f - (nonlinear ? kd.c[c] * fdr : fdr));
    }
    return kd;
}

KFN void plastic_base_adj(Spec kd, Float fdr, bool nonlinear, Spec dbase, Spec *dkd, Float *dfdr) {
    for (int c = 0; c < SPEC_N; c++) {
        // base = kd / (1 - kd fdr), or kd / (1 - fdr)
        Float r = f_safe_rcp(1.0f - (nonlinear ? kd.c[c] * fdr : fdr));
        dkd->c[c] = dkd->c[c] + dbase.c[c] * r * (nonlinear ? r : f_set(1));
        *dfdr = *dfdr + dbase.c[c] * kd.c[c] * r * r * (nonlinear ? kd.c[c] : f_set(1));
    }
}

KFN Float plastic_fresnel(const Plastic *p, Float cosine) {
    Float cos_t, eta_it, eta_ti;
    return fresnel_dielectric(cosine, p->eta, &cos_t, &eta_it, &eta_ti);
}

// Probability of the coat: its share of what both send back.
KFN Float plastic_probability(const Plastic *p, Vec3 wi) {
    Float f = plastic_fresnel(p, wi.z);
    return lobe_probability(f * spec_mean(p->specular_reflectance), (1.0f - f) * spec_mean(p->diffuse_reflectance),
                            p->floor);
}

KFN Spec plastic_eval(const Plastic *p, Vec3 wi, Vec3 wo, Int lobe) {
    Mask front = m_gt(wi.z, f_set(0));
    Mask coat = front & mi_eq(lobe, i_set(LOBE_REFLECT));
    Mask base = front & m_gt(wo.z, f_set(0)) & mi_eq(lobe, i_set(LOBE_SMOOTH));
    Float fi = plastic_fresnel(p, wi.z), fo = plastic_fresnel(p, wo.z);
    Float rcp_eta = 1.0f / p->eta;
    Float through = (1.0f - fi) * (1.0f - fo) * wo.z * rcp_eta * rcp_eta * INV_PI;
    Spec kd = plastic_base(p->diffuse_reflectance, fresnel_diffuse_reflectance(rcp_eta), p->nonlinear);
    return spec_madd(spec_scale(p->specular_reflectance, f_zero_unless(coat, fi)), f_zero_unless(base, through), kd);
}

KFN Float plastic_pdf(const Plastic *p, Vec3 wi, Vec3 wo, Int lobe) {
    Mask front = m_gt(wi.z, f_set(0));
    Float q = plastic_probability(p, wi);
    Float base = f_zero_unless(m_gt(wo.z, f_set(0)) & mi_eq(lobe, i_set(LOBE_SMOOTH)), (1.0f - q) * wo.z * INV_PI);
    return f_zero_unless(front, base + f_zero_unless(mi_eq(lobe, i_set(LOBE_REFLECT)), q));
}

KFN BsdfSample plastic_sample(const Plastic *p, Vec3 wi, Float u1, Vec2 u2) {
    Mask coat = m_lt(u1, plastic_probability(p, wi));
    return (BsdfSample){v3_select(coat, v3(-wi.x, -wi.y, wi.z), warp_cosine_hemisphere(u2)),
                        i_select(coat, i_set(LOBE_REFLECT), i_set(LOBE_SMOOTH)), f_set(1)};
}

KFN void plastic_adj(const Plastic *p, Vec3 wi, Vec3 wo, Int lobe, Spec df, Plastic *dp, Vec3 *dwi, Vec3 *dwo) {
    Mask front = m_gt(wi.z, f_set(0));
    Spec dcoat = spec_zero_unless(front & mi_eq(lobe, i_set(LOBE_REFLECT)), df);
    Spec dbase = spec_zero_unless(front & m_gt(wo.z, f_set(0)) & mi_eq(lobe, i_set(LOBE_SMOOTH)), df);
    mirrored_adj(front & mi_eq(lobe, i_set(LOBE_REFLECT)), dwo, dwi);
    Float fi = plastic_fresnel(p, wi.z), fo = plastic_fresnel(p, wo.z);
    Float rcp_eta = 1.0f / p->eta, fdr = fresnel_diffuse_reflectance(rcp_eta);
    Float rest = wo.z * rcp_eta * rcp_eta * INV_PI, ti = 1.0f - fi, to = 1.0f - fo;
    Spec kd = plastic_base(p->diffuse_reflectance, fdr, p->nonlinear);
    // f = F ks, or kd' ti to wo.z / (pi eta^2)
    Float dthrough = spec_dot(dbase, kd), dfdr = f_set(0), drcp = f_set(0);
    spec_acc(&dp->specular_reflectance, spec_scale(dcoat, fi));
    plastic_base_adj(p->diffuse_reflectance, fdr, p->nonlinear, spec_scale(dbase, ti * to * rest),
                     &dp->diffuse_reflectance, &dfdr);
    Float dfi = spec_dot(dcoat, p->specular_reflectance) - dthrough * to * rest;
    fresnel_dielectric_adj(wi.z, p->eta, dfi, f_set(0), &dwi->z, &dp->eta);
    fresnel_dielectric_adj(wo.z, p->eta, -dthrough * ti * rest, f_set(0), &dwo->z, &dp->eta);
    dwo->z = dwo->z + dthrough * ti * to * rcp_eta * rcp_eta * INV_PI;
    // fdr(1 / eta), 1 / eta^2
    fresnel_diffuse_reflectance_adj(rcp_eta, dfdr, &drcp);
    drcp = drcp + 2.0f * dthrough * ti * to * wo.z * rcp_eta * INV_PI;
    dp->eta = dp->eta - drcp * rcp_eta * rcp_eta;
}

KFN void plastic_pdf_adj(const Plastic *p, Vec3 wi, Vec3 wo, Float dpdf, Plastic *dp, Vec3 *dwi, Vec3 *dwo) {
    Float f = plastic_fresnel(p, wi.z), coat = spec_mean(p->specular_reflectance), base = spec_mean(p->diffuse_reflectance);
    dpdf = f_zero_unless(m_gt(wi.z, f_set(0)) & m_gt(wo.z, f_set(0)), dpdf * INV_PI);
    // pdf = (1 - q) wo.z / pi, q the share of a = F ks beside b = (1 - F) kd
    Float da = f_set(0), db = f_set(0);
    dwo->z = dwo->z + dpdf * (1.0f - plastic_probability(p, wi));
    lobe_probability_adj(f * coat, (1.0f - f) * base, -dpdf * wo.z, &da, &db);
    spec_acc(&dp->specular_reflectance, spec_set(da * f * (1.0f / SPEC_N)));
    spec_acc(&dp->diffuse_reflectance, spec_set(db * (1.0f - f) * (1.0f / SPEC_N)));
    fresnel_dielectric_adj(wi.z, p->eta, da * coat - db * base, f_set(0), &dwi->z, &dp->eta);
}
