// principled_adj.h: the adjoints of principled_eval, lobe by lobe, and of principled_pdf.
#pragma once

#include "bsdf/principled.h"

// Adjoints of what the lobes share.
typedef struct PrincipledBack {
    Float a, b, e, eta, fresnel, brdf, bsdf;
    Float dg; // of D Gi Go
    Vec3 m;
} PrincipledBack;

KFN void principled_reflection_adj(const Principled *p, const PrincipledTerms *t, Vec3 wi, Float dg, Spec df,
                                   Principled *dp, PrincipledBack *back, Vec3 *dwi) {
    Float k = f_safe_rcp(4.0f * f_abs(wi.z));
    // f = colour D G k, k = 1 / (4 |cos_i|)
    Spec dcolour = spec_zero_unless(t->reflects, spec_scale(df, dg * k));
    Float dvalue = f_zero_unless(t->reflects, spec_dot(df, principled_reflection(p, t)));
    back->dg = back->dg + dvalue * k;
    dwi->z = dwi->z - dvalue * dg * k * f_safe_rcp(wi.z);
    // colour = bsdf F from the back
    Float dback = f_zero_unless(~t->front, spec_sum(dcolour));
    back->fresnel = back->fresnel + dback * t->bsdf;
    back->bsdf = back->bsdf + dback * t->fresnel;
    // colour = principled_reflectance(...) from the front; without a main lobe, only the index has an effect
    PrincipledReflectanceAdj d = {spec_zero(), f_set(0), f_set(0), f_set(0), f_set(0), f_set(0)};
    principled_reflectance_adj(p->base_color, p->metallic, p->spec_tint, t->fresnel, t->a, t->eta,
                               spec_zero_unless(t->front, dcolour), &d);
    Mask on = ~principled_degenerate(p);
    spec_acc(&dp->base_color, spec_zero_unless(on, d.base));
    dp->metallic = dp->metallic + f_zero_unless(on, d.metallic);
    dp->spec_tint = dp->spec_tint + f_zero_unless(on, d.tinted);
    back->fresnel = back->fresnel + d.exact;
    back->a = back->a + f_zero_unless(on, d.cosine);
    back->eta = back->eta + d.eta;
}

// d sqrt(x) / dx, kept finite where x is 0.
KFN Float principled_root_slope(Float x) { return 0.5f / f_sqrt(f_max(x, f_set(1e-4f))); }

KFN void principled_refraction_adj(const Principled *p, const PrincipledTerms *t, Vec3 wi, Float dg, Spec df,
                                   Principled *dp, PrincipledBack *back, Vec3 *dwi) {
    df = spec_zero_unless(~t->reflects, df);
    Float jacobian = principled_refraction(t, wi), k = dg * jacobian, f1 = 1.0f - t->fresnel;
    // f = sqrt(base) bsdf (1 - F) D G jacobian
    for (int c = 0; c < SPEC_N; c++) {
        Float slope = principled_root_slope(p->base_color.c[c]);
        dp->base_color.c[c] = dp->base_color.c[c] + df.c[c] * t->bsdf * f1 * k * slope;
    }
    Float dvalue = spec_dot(df, principled_root(p->base_color)), dk = dvalue * t->bsdf * f1;
    back->bsdf = back->bsdf + dvalue * f1 * k;
    back->fresnel = back->fresnel - dvalue * t->bsdf * k;
    back->dg = back->dg + dk * jacobian;
    // jacobian = |a b| / (|cos_i| q^2), q = a + e b
    Float g = dk * k, rcp_q = f_safe_rcp(t->q);
    dwi->z = dwi->z - g * f_safe_rcp(wi.z);
    back->a = back->a + g * (f_safe_rcp(t->a) - 2.0f * rcp_q);
    back->b = back->b + g * (f_safe_rcp(t->b) - 2.0f * t->e * rcp_q);
    back->e = back->e - 2.0f * g * t->b * rcp_q;
}

KFN void principled_coat_adj(const Principled *p, const PrincipledTerms *t, Vec3 wi, Vec3 wo, Float df, Principled *dp,
                             PrincipledBack *back, Vec3 *dwi, Vec3 *dwo) {
    df = f_zero_unless(principled_visible(t, wi, wo), df);
    Float s = 0.04f + 0.96f * principled_fall(t->a, t->eta), d = clearcoat_D(t->m, clearcoat_alpha(p->clearcoat_gloss));
    Float gi = clearcoat_G1(wi.z), go = clearcoat_G1(wo.z), co = f_abs(wo.z), dvalue = 0.25f * df * p->clearcoat;
    // f = clearcoat / 4 s D Gi Go |cos_o|
    dp->clearcoat = dp->clearcoat + 0.25f * df * s * d * gi * go * co;
    principled_fall_adj(t->a, t->eta, 0.96f * dvalue * d * gi * go * co, &back->a, &back->eta);
    clearcoat_D_adj(t->m, p->clearcoat_gloss, dvalue * s * gi * go * co, &back->m, &dp->clearcoat_gloss);
    clearcoat_G1_adj(wi.z, dvalue * s * d * go * co, &dwi->z);
    clearcoat_G1_adj(wo.z, dvalue * s * d * gi * co, &dwo->z);
    dwo->z = dwo->z + f_sign(wo.z) * dvalue * s * d * gi * go;
}

KFN void principled_base_adj(const Principled *p, const PrincipledTerms *t, Vec3 wi, Vec3 wo, Spec df, Principled *dp,
                             PrincipledBack *back, Vec3 *dwi, Vec3 *dwo) {
    Float dci = f_set(0), dco = f_set(0);
    PrincipledMatte matte = principled_matte_of(p, t), d = {.base = spec_zero()};
    principled_matte_adj(&matte, f_abs(wi.z), f_abs(wo.z), t->b, df, &d, &dci, &dco, &back->b);
    spec_acc(&dp->base_color, d.base);
    dp->roughness = dp->roughness + d.roughness;
    dp->flatness = dp->flatness + d.flatness;
    dp->sheen = dp->sheen + d.sheen;
    dp->sheen_tint = dp->sheen_tint + d.tinted;
    // diffuse = brdf, gleam = 1 - metallic
    back->brdf = back->brdf + d.diffuse;
    dp->metallic = dp->metallic - d.gleam;
    // ci = |wi.z|, co = |wo.z|
    dwi->z = dwi->z + f_sign(wi.z) * dci;
    dwo->z = dwo->z + f_sign(wo.z) * dco;
}

// Back to the parameters and directions that eval and pdf share.
KFN void principled_terms_adj(const Principled *p, const PrincipledTerms *t, Vec3 wi, Vec3 wo, PrincipledBack *back,
                              Principled *dp, Vec3 *dwi, Vec3 *dwo) {
    // brdf = (1 - metallic) (1 - spec_trans), bsdf = (1 - metallic) spec_trans
    dp->metallic = dp->metallic - back->brdf * (1.0f - p->spec_trans) - back->bsdf * p->spec_trans;
    dp->spec_trans = dp->spec_trans + (1.0f - p->metallic) * (back->bsdf - back->brdf);
    // F(a, eta), a = wi . m, b = wo . m
    Float da = f_set(0);
    fresnel_dielectric_adj(t->a, t->eta, back->fresnel, f_set(0), &da, &back->eta);
    back->a = back->a + f_zero_unless(~principled_degenerate(p), da);
    v3_acc(dwi, v3_scale(t->m, back->a));
    v3_acc(dwo, v3_scale(t->m, back->b));
    v3_acc(&back->m, v3_madd(v3_scale(wi, back->a), back->b, wo));
    // m = turn normalize(h), h = wi + wo or wi + e wo
    Vec3 dh = v3_zero();
    v3_normalize_adj(t->h, v3_scale(back->m, t->turn), &dh);
    v3_acc(dwi, dh);
    v3_acc(dwo, v3_scale(dh, f_select(t->reflects, f_set(1), t->e)));
    Float de = back->e + f_zero_unless(~t->reflects, v3_dot(dh, wo));
    // e = eta, or 1 / eta from the back
    principled_eta_adj(p, back->eta + f_select(t->front, de, -de * t->e * t->e), &dp->specular);
}

// Adjoint where the refraction ends.
KFN void principled_rim_adj(const Principled *p, const PrincipledTerms *t, Vec3 wi, Vec3 wo, Spec df, Principled *dp, Vec3 *dwi,
                            Vec3 *dwo) {
    // f = sqrt(base) bsdf f_+ H(s g), e = eta, or 1 / eta from the back
    Float dvalue = spec_dot(df, principled_root(p->base_color)) * t->bsdf * rim_value(&t->mf, wi, wo, t->eta, t->e);
    Float de = rim_adj(wi, wo, t->e, dvalue, dwi, dwo);
    principled_eta_adj(p, f_select(t->front, de, -de * t->e * t->e), &dp->specular);
}

KFN void principled_adj(const Principled *p, Vec3 wi, Vec3 wo, Int lobe, Spec df, Principled *dp, Vec3 *dwi,
                        Vec3 *dwo) {
    PrincipledTerms t = principled_terms(p, wi, wo, lobe);
    Mask rim = mi_eq(lobe, i_set(LOBE_RIM));
    if (m_any(rim)) {
        principled_rim_adj(p, &t, wi, wo, spec_zero_unless(rim, df), dp, dwi, dwo);
    }
    Float d = microfacet_D(&t.mf, t.m), gi = smith_G1(&t.mf, wi, t.m), go = smith_G1(&t.mf, wo, t.m), dg = d * gi * go;
    df = spec_zero_unless(t.counts, df);
    PrincipledBack back = {.m = v3_zero()};
    principled_reflection_adj(p, &t, wi, dg, df, dp, &back, dwi);
    principled_refraction_adj(p, &t, wi, dg, df, dp, &back, dwi);
    Spec upper = spec_zero_unless(principled_upper(&t), df);
    if (m_any(principled_upper(&t))) {
        principled_base_adj(p, &t, wi, wo, upper, dp, &back, dwi, dwo);
        principled_coat_adj(p, &t, wi, wo, spec_sum(upper), dp, &back, dwi, dwo);
    }
    // D Gi Go
    Float du = f_set(0), dv = f_set(0);
    microfacet_D_adj(&t.mf, t.m, back.dg * gi * go, &du, &dv, &back.m);
    smith_G1_adj(&t.mf, wi, t.m, back.dg * d * go, &du, &dv, dwi);
    smith_G1_adj(&t.mf, wo, t.m, back.dg * d * gi, &du, &dv, dwo);
    principled_facets_adj(p->roughness, p->anisotropic, du, dv, &dp->roughness, &dp->anisotropic);
    principled_terms_adj(p, &t, wi, wo, &back, dp, dwi, dwo);
}

// Of the probabilities of the lobes, and of reflection by the facets of the main one.
KFN void principled_choice_adj(const Principled *p, const PrincipledTerms *t, Float dlobes[PRINCIPLED_LOBES], Float dshare,
                               Principled *dp, PrincipledBack *back) {
    Float weights[PRINCIPLED_LOBES];
    principled_weights(p, weights);
    for (int i = 0; i < PRINCIPLED_LOBES; i++) {
        dlobes[i] = f_zero_unless(t->front, dlobes[i]); // from the back there is but one
    }
    principled_probabilities_adj(PRINCIPLED_LOBES, weights, dlobes);
    Float dcoat = 0.25f * dlobes[PRINCIPLED_COAT], ddiffuse = dlobes[PRINCIPLED_DIFFUSE];
    dp->main_specular_sampling_rate = dp->main_specular_sampling_rate + dlobes[PRINCIPLED_MAIN];
    // coat = clearcoat / 4 rate, diffuse = brdf rate
    dp->clearcoat = dp->clearcoat + dcoat * p->clearcoat_sampling_rate;
    dp->clearcoat_sampling_rate = dp->clearcoat_sampling_rate + dcoat * p->clearcoat;
    dp->diffuse_reflectance_sampling_rate = dp->diffuse_reflectance_sampling_rate + ddiffuse * t->brdf;
    back->brdf = back->brdf + ddiffuse * p->diffuse_reflectance_sampling_rate;
    // share = 1 - bsdf (1 - F) from the front, F from the back
    dshare = f_zero_unless(m_lt(t->fresnel, f_set(1)), dshare);
    back->fresnel = back->fresnel + f_select(t->front, dshare * t->bsdf, dshare);
    back->bsdf = back->bsdf - f_zero_unless(t->front, dshare * (1.0f - t->fresnel));
}

KFN void principled_pdf_adj(const Principled *p, Vec3 wi, Vec3 wo, Float dpdf, Principled *dp, Vec3 *dwi, Vec3 *dwo) {
    PrincipledTerms t = principled_terms(p, wi, wo, i_set(LOBE_SMOOTH));
    PrincipledChoice c = principled_choice(p, wi);
    PrincipledBack back = {.m = v3_zero()};
    dpdf = f_zero_unless(t.counts & c.any, dpdf);
    // pdf = main facets share jacobian + coat D z / (4 |b|) + diffuse wo.z / pi
    Float seen = f_zero_unless(principled_visible(&t, wi, wo), dpdf), upper = f_zero_unless(principled_upper(&t), dpdf);
    Float rcp_b = f_safe_rcp(t.b), rcp_q = f_safe_rcp(t.q), side = f_sign(wi.z), du = f_set(0), dv = f_set(0);
    Vec3 up = v3_scale(wi, side), dup = v3_zero();
    Float reflected = principled_share(p, t.front, t.fresnel), by_reflection = 0.25f * f_abs(rcp_b);
    Float share = f_select(t.reflects, reflected, 1.0f - reflected);
    Float jacobian = f_select(t.reflects, by_reflection, f_abs(t.b) * f_sqr(t.e * rcp_q));
    Float facets = microfacet_pdf(&t.mf, up, t.m), main = c.lobes[PRINCIPLED_MAIN];
    microfacet_pdf_adj(&t.mf, up, t.m, seen * main * share * jacobian, &du, &dv, &dup, &back.m);
    principled_facets_adj(p->roughness, p->anisotropic, du, dv, &dp->roughness, &dp->anisotropic);
    v3_acc(dwi, v3_scale(dup, side));
    Float coat = clearcoat_D(t.m, clearcoat_alpha(p->clearcoat_gloss)), dcoat = f_zero_unless(principled_upper(&t), seen);
    Float k = dcoat * c.lobes[PRINCIPLED_COAT] * by_reflection;
    clearcoat_D_adj(t.m, p->clearcoat_gloss, k * t.m.z, &back.m, &dp->clearcoat_gloss);
    back.m.z = back.m.z + k * coat;
    dwo->z = dwo->z + upper * c.lobes[PRINCIPLED_DIFFUSE] * INV_PI;
    // jacobian = 1 / (4 |b|), or |b| e^2 / q^2 with q = a + e b
    Float g = seen * main * facets * share * jacobian, gt = f_zero_unless(~t.reflects, g);
    back.a = -2.0f * gt * rcp_q;
    back.b = f_select(t.reflects, -(g + k * coat * t.m.z) * rcp_b, gt * (rcp_b - 2.0f * t.e * rcp_q));
    back.e = 2.0f * gt * (f_safe_rcp(t.e) - t.b * rcp_q);
    Float dlobes[PRINCIPLED_LOBES], dshare = seen * main * facets * jacobian;
    dlobes[PRINCIPLED_MAIN] = seen * facets * share * jacobian;
    dlobes[PRINCIPLED_COAT] = dcoat * coat * t.m.z * by_reflection;
    dlobes[PRINCIPLED_DIFFUSE] = upper * wo.z * INV_PI;
    principled_choice_adj(p, &t, dlobes, f_select(t.reflects, dshare, -dshare), dp, &back);
    principled_terms_adj(p, &t, wi, wo, &back, dp, dwi, dwo);
}
