// roughdielectric.h: rough glass [walter2007 eq. 20 and 21], from both sides. m is the (generalised) half vector turned
// to the upper side, a = wi.m, b = wo.m, and e the index of the other side over that of wi's side:
// reflection F D G / (4 |cos_i|), refraction (1 - F) D G |a b| / (|cos_i| (a + e b)^2), radiance compression included.
#pragma once

#include "bsdf/critical.h"
#include "bsdf/rim.h"
#include "bsdf/roughconductor.h"

#define ROUGHDIELECTRIC_PARAMS(P)                                                                                      \
    P(IOR, eta, 1.5046f, 1e-3f, INFINITY, "relative index of refraction, interior over exterior", "bk7")               \
    P(SPEC, specular_reflectance, 1, 0, 1, "factor on the reflection", "")                                             \
    P(SPEC, specular_transmittance, 1, 0, 1, "factor on the refraction", "")                                           \
    P(ALPHA_U, alpha_u, 0.1f, 0, 1, "roughness along the tangent", "")                                                 \
    P(ALPHA_V, alpha_v, 0.1f, 0, 1, "roughness across the tangent", "")
KIND_RECORD(RoughDielectric, ROUGHDIELECTRIC_PARAMS, MICROFACET_CONFIG)

// An index of 1 refracts nothing: every half vector but one belongs to no direction. A value close to it stands in for it.
KFN Float roughdielectric_eta(const RoughDielectric *p) {
    return f_select(m_eq(p->eta, f_set(1)), f_set(1.001f), p->eta);
}

// What eval, pdf and the adjoint share.
typedef struct RoughDielectricTerms {
    Mask counts, reflects;
    Vec3 h, m;   // unnormalised and final half vector
    Float turn;  // the sign that turned m up
    Float eta, e; // the index; its ratio along the path
    Float a, b, q, fresnel;
} RoughDielectricTerms;

KFN RoughDielectricTerms roughdielectric_terms(const RoughDielectric *p, Vec3 wi, Vec3 wo, Int lobe) {
    RoughDielectricTerms t;
    t.reflects = m_gt(wi.z * wo.z, f_set(0));
    t.eta = roughdielectric_eta(p);
    t.e = f_select(m_gt(wi.z, f_set(0)), t.eta, 1.0f / t.eta);
    t.h = v3_madd(wi, f_select(t.reflects, f_set(1), t.e), wo);
    Vec3 m = v3_normalize(t.h);
    t.turn = f_sign(m.z);
    t.m = v3_scale(m, t.turn);
    t.a = v3_dot(wi, t.m);
    t.b = v3_dot(wo, t.m);
    t.q = t.a + t.e * t.b;
    Float cos_t, eta_it, eta_ti;
    t.fresnel = fresnel_dielectric(t.a, t.eta, &cos_t, &eta_it, &eta_ti);
    t.counts = m_ne(wi.z * wo.z, f_set(0)) & mi_eq(lobe, i_set(LOBE_SMOOTH));
    return t;
}

// |a b| / (|cos_i| q^2): from normals to refracted directions.
KFN Float roughdielectric_refraction(const RoughDielectricTerms *t, Vec3 wi) {
    return f_abs(t->a * t->b) * f_safe_rcp(f_abs(wi.z) * t->q * t->q);
}

KFN Microfacet roughdielectric_facets(const RoughDielectric *p) {
    return microfacet_make(p->distribution, p->sample_visible, p->alpha_u, p->alpha_v);
}

KFN Spec roughdielectric_eval(const RoughDielectric *p, Vec3 wi, Vec3 wo, Int lobe) {
    Microfacet mf = roughdielectric_facets(p);
    RoughDielectricTerms t = roughdielectric_terms(p, wi, wo, lobe);
    Float dg = f_zero_unless(t.counts, microfacet_D(&mf, t.m) * smith_G(&mf, wi, wo, t.m));
    Float r = t.fresnel * dg * f_safe_rcp(4.0f * f_abs(wi.z));
    Float s = (1.0f - t.fresnel) * dg * roughdielectric_refraction(&t, wi);
    return spec_select(t.reflects, spec_scale(p->specular_reflectance, r), spec_scale(p->specular_transmittance, s));
}

// Probability of reflection for facets that reflect F; 1 in total internal reflection.
KFN Float roughdielectric_probability(const RoughDielectric *p, Float fresnel) {
    Float q = f_clamp(fresnel, f_set(p->floor), f_set(1 - p->floor));
    return f_select(m_lt(fresnel, f_set(1)), q, f_set(1));
}

// Facets seen from their back cannot have been sampled.
KFN Mask roughdielectric_visible(const RoughDielectricTerms *t, Vec3 wi, Vec3 wo) {
    return m_gt(t->a * wi.z, f_set(0)) & m_gt(t->b * wo.z, f_set(0));
}

KFN Float roughdielectric_pdf(const RoughDielectric *p, Vec3 wi, Vec3 wo, Int lobe) {
    Microfacet mf = roughdielectric_facets(p);
    RoughDielectricTerms t = roughdielectric_terms(p, wi, wo, lobe);
    Vec3 up = v3_scale(wi, f_sign(wi.z)); // facets are sampled for the side of wi
    Float choice = roughdielectric_probability(p, t.fresnel);
    Float reflected = choice * f_safe_rcp(4.0f * f_abs(t.b));
    Float refracted = (1.0f - choice) * f_abs(t.b) * t.e * t.e * f_safe_rcp(t.q * t.q);
    Float pdf = f_zero_unless(t.counts & roughdielectric_visible(&t, wi, wo),
                              interface_pdf(&mf, up, t.m, t.e, p->floor) * f_select(t.reflects, reflected, refracted));
    return p->rim > 0 ? rim_pdf(rim_share(&mf, wi, t.e, p->rim), lobe, pdf) : pdf;
}

KFN BsdfSample roughdielectric_sample(const RoughDielectric *p, Vec3 wi, Float u1, Vec2 u2) {
    Microfacet mf = roughdielectric_facets(p);
    Float eta = roughdielectric_eta(p), e = f_select(m_gt(wi.z, f_set(0)), eta, 1.0f / eta);
    Mask rim = m_set(false);
    if (p->rim > 0) {
        rim = warp_event(rim_share(&mf, wi, e, p->rim), &u1);
    }
    Vec3 m = interface_sample(&mf, v3_scale(wi, f_sign(wi.z)), e, p->floor, &u1, u2);
    Float cos_t, eta_it, eta_ti, f = fresnel_dielectric(v3_dot(wi, m), eta, &cos_t, &eta_it, &eta_ti);
    Mask reflects = m_lt(u1, roughdielectric_probability(p, f)) & ~rim;
    Vec3 wo = v3_select(reflects, reflect(wi, m), refract(wi, m, cos_t, eta_ti));
    // A reflected direction below the surface, or a refracted one above it, has no density there; nor has a facet seen
    // from its back, which sampling of all normals can give.
    Mask right_side = (reflects ^ m_le(wi.z * wo.z, f_set(0))) & m_gt(v3_dot(wi, m) * wi.z, f_set(0)) &
                      m_gt(m.z, f_set(0));
    wo = v3_select(right_side, wo, v3(wo.x, wo.y, f_set(0)));
    wo = v3_select(rim, rim_direction(wi, e, u2.x), wo);
    Float onward = f_select(rim, e, f_select(reflects, f_set(1), eta_it));
    return (BsdfSample){wo, i_select(rim, i_set(LOBE_RIM), i_set(LOBE_SMOOTH)), onward};
}

// Adjoints of what eval and pdf share.
typedef struct RoughDielectricBack {
    Float a, b, e, fresnel;
    Vec3 m;
} RoughDielectricBack;

KFN void roughdielectric_terms_adj(const RoughDielectricTerms *t, Vec3 wi, Vec3 wo, RoughDielectricBack *back,
                                   RoughDielectric *dp, Vec3 *dwi, Vec3 *dwo) {
    Vec3 dh = v3_zero();
    fresnel_dielectric_adj(t->a, t->eta, f_zero_unless(t->counts, back->fresnel), f_set(0), &back->a, &dp->eta);
    // a = wi . m, b = wo . m
    v3_acc(dwi, v3_scale(t->m, back->a));
    v3_acc(dwo, v3_scale(t->m, back->b));
    v3_acc(&back->m, v3_madd(v3_scale(wi, back->a), back->b, wo));
    // m = turn normalize(h), h = wi + wo or wi + e wo
    v3_normalize_adj(t->h, v3_scale(back->m, t->turn), &dh);
    v3_acc(dwi, dh);
    v3_acc(dwo, v3_scale(dh, f_select(t->reflects, f_set(1), t->e)));
    Float de = back->e + f_zero_unless(~t->reflects, v3_dot(dh, wo));
    // e = eta, or 1 / eta from inside
    dp->eta = dp->eta + f_zero_unless(t->counts, f_select(m_gt(wi.z, f_set(0)), de, -de * t->e * t->e));
}

// Adjoint on the rim.
KFN void roughdielectric_rim_adj(const RoughDielectric *p, const Microfacet *mf, Vec3 wi, Vec3 wo, Spec df, RoughDielectric *dp,
                                 Vec3 *dwi, Vec3 *dwo) {
    Mask front = m_gt(wi.z, f_set(0));
    Float eta = roughdielectric_eta(p), e = f_select(front, eta, 1.0f / eta);
    // f = colour f_+ H(s g), e = eta, or 1 / eta from inside
    Float de = rim_adj(wi, wo, e, spec_dot(df, p->specular_transmittance) * rim_value(mf, wi, wo, eta, e), dwi, dwo);
    dp->eta = dp->eta + f_select(front, de, -de * e * e);
}

KFN void roughdielectric_adj(const RoughDielectric *p, Vec3 wi, Vec3 wo, Int lobe, Spec df, RoughDielectric *dp,
                             Vec3 *dwi, Vec3 *dwo) {
    Microfacet mf = roughdielectric_facets(p);
    Mask rim = mi_eq(lobe, i_set(LOBE_RIM));
    if (m_any(rim)) {
        roughdielectric_rim_adj(p, &mf, wi, wo, spec_zero_unless(rim, df), dp, dwi, dwo);
    }
    RoughDielectricTerms t = roughdielectric_terms(p, wi, wo, lobe);
    Float d = microfacet_D(&mf, t.m), gi = smith_G1(&mf, wi, t.m), go = smith_G1(&mf, wo, t.m);
    Float rcp_ci = f_safe_rcp(wi.z);
    Float jacobian = f_select(t.reflects, 0.25f * f_abs(rcp_ci), roughdielectric_refraction(&t, wi));
    Float k = d * gi * go * jacobian, share = f_select(t.reflects, t.fresnel, 1.0f - t.fresnel);
    df = spec_zero_unless(t.counts, df);
    // f = colour share K, K = D Gi Go jacobian
    Spec dr = spec_zero_unless(t.reflects, df), ds = spec_zero_unless(~t.reflects, df);
    spec_acc(&dp->specular_reflectance, spec_scale(dr, share * k));
    spec_acc(&dp->specular_transmittance, spec_scale(ds, share * k));
    Float dvalue = spec_dot(dr, p->specular_reflectance) + spec_dot(ds, p->specular_transmittance);
    Float dk = dvalue * share, du = f_set(0), dv = f_set(0);
    RoughDielectricBack back = {.fresnel = f_select(t.reflects, dvalue * k, -dvalue * k), .m = v3_zero()};
    microfacet_D_adj(&mf, t.m, dk * gi * go * jacobian, &du, &dv, &back.m);
    smith_G1_adj(&mf, wi, t.m, dk * d * go * jacobian, &du, &dv, dwi);
    smith_G1_adj(&mf, wo, t.m, dk * d * gi * jacobian, &du, &dv, dwo);
    microfacet_alpha_adj(p->alpha_u, du, &dp->alpha_u);
    microfacet_alpha_adj(p->alpha_v, dv, &dp->alpha_v);
    // jacobian = 1 / (4 |wi.z|), or |a b| / (|wi.z| q^2) with q = a + e b
    Float g = f_zero_unless(t.counts, dk * k);
    dwi->z = dwi->z - g * rcp_ci;
    Float gt = f_zero_unless(~t.reflects, g), rcp_q = f_safe_rcp(t.q);
    back.a = gt * (f_safe_rcp(t.a) - 2.0f * rcp_q);
    back.b = gt * (f_safe_rcp(t.b) - 2.0f * t.e * rcp_q);
    back.e = -2.0f * gt * t.b * rcp_q;
    roughdielectric_terms_adj(&t, wi, wo, &back, dp, dwi, dwo);
}

KFN void roughdielectric_pdf_adj(const RoughDielectric *p, Vec3 wi, Vec3 wo, Float dpdf, RoughDielectric *dp, Vec3 *dwi,
                                 Vec3 *dwo) {
    Microfacet mf = roughdielectric_facets(p);
    RoughDielectricTerms t = roughdielectric_terms(p, wi, wo, i_set(LOBE_SMOOTH));
    dpdf = f_zero_unless(t.counts & roughdielectric_visible(&t, wi, wo), dpdf);
    Float side = f_sign(wi.z), rcp_q = f_safe_rcp(t.q), rcp_b = f_safe_rcp(t.b), du = f_set(0), dv = f_set(0);
    Vec3 up = v3_scale(wi, side), dup = v3_zero();
    Float reflects = roughdielectric_probability(p, t.fresnel), share = f_select(t.reflects, reflects, 1.0f - reflects);
    Float jacobian = f_select(t.reflects, 0.25f * f_abs(rcp_b), f_abs(t.b) * f_sqr(t.e * rcp_q));
    // pdf = facets share jacobian
    Float k = microfacet_pdf(&mf, up, t.m) * jacobian, g = dpdf * k * share, gt = f_zero_unless(~t.reflects, g);
    RoughDielectricBack back = {.fresnel = f_select(t.reflects, dpdf * k, -dpdf * k), .m = v3_zero()};
    microfacet_pdf_adj(&mf, up, t.m, dpdf * share * jacobian, &du, &dv, &dup, &back.m);
    microfacet_alpha_adj(p->alpha_u, du, &dp->alpha_u);
    microfacet_alpha_adj(p->alpha_v, dv, &dp->alpha_v);
    v3_acc(dwi, v3_scale(dup, side));
    // jacobian = 1 / (4 |b|), or |b| e^2 / q^2 with q = a + e b
    back.a = -2.0f * gt * rcp_q;
    back.b = f_select(t.reflects, -g * rcp_b, gt * (rcp_b - 2.0f * t.e * rcp_q));
    back.e = 2.0f * gt * (f_safe_rcp(t.e) - t.b * rcp_q);
    roughdielectric_terms_adj(&t, wi, wo, &back, dp, dwi, dwo);
}
