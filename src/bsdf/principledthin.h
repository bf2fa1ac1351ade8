// principledthin.h: the many-lobed surface of a thin sheet [burley2015 section 5.3], in the variant of the Mitsuba 3
// renderer: alike from both sides, without refraction. With d = diff_trans / 2 and m the half vector of wi and wo, the
// latter mirrored to the side of wi, the sum of
//   reflection    spec_trans R D G / (4 |cos_i|), R of principled_reflectance()
//   transmission  spec_trans base (1 - F) D' G' / (4 |cos_i|), the roughness scaled by 0.65 eta - 0.35
//   matte         (1 - spec_trans) (1 - d) principled_matte()
//   diffuse transmission  (1 - spec_trans) d base / pi |cos_o|
// NOT reciprocal: the transmission is cut where wo (but not wi) sees m from its back. Gains energy where sheen and
// spec_tint are on.
#pragma once

#include "bsdf/critical.h"
#include "bsdf/principled_lobes.h"

#define PRINCIPLEDTHIN_PARAMS(P)                                                                                       \
    P(SPEC, base_color, 0.5f, 0, 1, "colour", "")                                                                      \
    P(REAL, roughness, 0.5f, 0, 1, "how rough the highlights are", "")                                                 \
    P(REAL, anisotropic, 0, 0, 1, "how much longer the highlight is along the tangent", "")                            \
    P(REAL, spec_trans, 0, 0, 1, "1 = clear, 0 = diffuse", "")                                                         \
    P(REAL, eta, 1.5f, 1e-3f, INFINITY, "relative index of refraction of the sheet", "")                               \
    P(REAL, spec_tint, 0, 0, 1, "how much the reflection takes the colour of the base", "")                            \
    P(REAL, sheen, 0, 0, 1, "grazing gleam of cloth", "")                                                              \
    P(REAL, sheen_tint, 0, 0, 1, "how much the sheen takes the colour of the base", "")                                \
    P(REAL, flatness, 0, 0, 1, "diffuse reflection: 1 = as if light had scattered inside", "")                         \
    P(REAL, diff_trans, 0, 0, 2, "diffuse light: 0 = all is reflected, 2 = all is transmitted", "")                    \
    P(RATE, specular_reflectance_sampling_rate, 1, 0, INFINITY, "weight of the reflection in sampling", "")            \
    P(RATE, specular_transmittance_sampling_rate, 1, 0, INFINITY, "weight of the transmission in sampling", "")        \
    P(RATE, diffuse_reflectance_sampling_rate, 1, 0, INFINITY, "weight of the diffuse reflection in sampling", "")     \
    P(RATE, diffuse_transmittance_sampling_rate, 1, 0, INFINITY, "weight of the diffuse transmission in sampling", "")
KIND_RECORD(PrincipledThin, PRINCIPLEDTHIN_PARAMS, NO_CONFIG)

// What eval, pdf and the adjoint share. Directions are turned such that wi is on the upper side.
typedef struct ThinTerms {
    Mask counts, reflects, visible; // visible: both directions see the right side of the facet
    Float side;
    Vec3 wi, wo, h, m; // h: unnormalised half vector
    Float a, b;        // wi.m, wo.m
    Float fresnel, scale;
    Float matte, through; // weights of the diffuse lobes
    Microfacet mf;
} ThinTerms;

// Factor on the roughness of the transmission.
KFN Float principledthin_scale(Mask reflects, Float eta) { return f_select(reflects, f_set(1), 0.65f * eta - 0.35f); }

KFN ThinTerms principledthin_terms(const PrincipledThin *p, Vec3 wi, Vec3 wo, Int lobe) {
    ThinTerms t;
    t.side = f_sign(wi.z);
    t.wi = v3_scale(wi, t.side);
    t.wo = v3_scale(wo, t.side);
    t.reflects = m_gt(t.wo.z, f_set(0));
    t.counts = m_ne(wi.z * wo.z, f_set(0)) & mi_eq(lobe, i_set(LOBE_SMOOTH));
    t.h = v3_add(t.wi, v3(t.wo.x, t.wo.y, f_abs(t.wo.z)));
    t.m = v3_normalize(t.h);
    t.a = v3_dot(t.wi, t.m);
    t.b = v3_dot(t.wo, t.m);
    t.visible = m_gt(t.a, f_set(0)) & m_gt(t.b * t.wo.z, f_set(0));
    Float cos_t, eta_it, eta_ti, d = 0.5f * p->diff_trans;
    t.fresnel = fresnel_dielectric(t.a, p->eta, &cos_t, &eta_it, &eta_ti);
    t.scale = principledthin_scale(t.reflects, p->eta);
    t.matte = (1.0f - p->spec_trans) * (1.0f - d);
    t.through = (1.0f - p->spec_trans) * d;
    t.mf = principled_facets(p->roughness * t.scale, p->anisotropic);
    return t;
}

// The factor of spec_trans D G / (4 cos_i).
KFN Spec principledthin_colour(const PrincipledThin *p, const ThinTerms *t) {
    Spec reflected = principled_reflectance(p->base_color, f_set(0), p->spec_tint, t->fresnel, t->a, p->eta);
    return spec_select(t->reflects, reflected, spec_scale(p->base_color, 1.0f - t->fresnel));
}

KFN PrincipledMatte principledthin_matte_of(const PrincipledThin *p, const ThinTerms *t) {
    return (PrincipledMatte){p->base_color, p->roughness, p->flatness, p->sheen, p->sheen_tint, t->matte, t->matte};
}

KFN Spec principledthin_eval(const PrincipledThin *p, Vec3 wi, Vec3 wo, Int lobe) {
    ThinTerms t = principledthin_terms(p, wi, wo, lobe);
    PrincipledMatte matte = principledthin_matte_of(p, &t);
    Spec f = spec_select(t.reflects, principled_matte(&matte, t.wi.z, f_abs(t.wo.z), t.b),
                         spec_scale(p->base_color, t.through * f_abs(t.wo.z) * INV_PI));
    if (m_any(m_ne(p->spec_trans, f_set(0)))) {
        Float dg = microfacet_D(&t.mf, t.m) * smith_G(&t.mf, t.wi, t.wo, t.m);
        f = spec_madd(f, p->spec_trans * dg * f_safe_rcp(4.0f * t.wi.z), principledthin_colour(p, &t));
    }
    return spec_zero_unless(t.counts, f);
}

// ---- sampling ----------------------------------------------------------------------------------------------------

enum { THIN_REFLECTION, THIN_TRANSMISSION, THIN_MATTE, THIN_THROUGH, THIN_LOBES };

KFN void principledthin_weights(const PrincipledThin *p, Float lobes[THIN_LOBES]) {
    Float d = 0.5f * p->diff_trans, diffuse = 1.0f - p->spec_trans;
    lobes[THIN_REFLECTION] = 0.5f * p->spec_trans * p->specular_reflectance_sampling_rate;
    lobes[THIN_TRANSMISSION] = 0.5f * p->spec_trans * p->specular_transmittance_sampling_rate;
    lobes[THIN_MATTE] = diffuse * (1.0f - d) * p->diffuse_reflectance_sampling_rate;
    lobes[THIN_THROUGH] = diffuse * d * p->diffuse_transmittance_sampling_rate;
}

KFN void principledthin_choice(const PrincipledThin *p, Float lobes[THIN_LOBES]) {
    principledthin_weights(p, lobes);
    principled_probabilities(THIN_LOBES, lobes, p->floor);
}

KFN Float principledthin_pdf(const PrincipledThin *p, Vec3 wi, Vec3 wo, Int lobe) {
    ThinTerms t = principledthin_terms(p, wi, wo, lobe);
    Float lobes[THIN_LOBES];
    principledthin_choice(p, lobes);
    Float clear = f_select(t.reflects, lobes[THIN_REFLECTION], lobes[THIN_TRANSMISSION]);
    Float pdf = f_select(t.reflects, lobes[THIN_MATTE], lobes[THIN_THROUGH]) * f_abs(t.wo.z) * INV_PI;
    if (m_any(m_gt(clear, f_set(0)))) {
        // wi and the mirrored wo make the same angle with m.
        Float facets = interface_pdf(&t.mf, t.wi, t.m, p->eta, p->floor);
        Float jacobian = f_safe_rcp(4.0f * v3_dot(v3_sub(t.h, t.wi), t.m));
        pdf = pdf + f_zero_unless(t.visible, clear * facets * jacobian);
    }
    return f_zero_unless(t.counts, pdf);
}

KFN BsdfSample principledthin_sample(const PrincipledThin *p, Vec3 wi, Float u1, Vec2 u2) {
    Float lobes[THIN_LOBES], side = f_sign(wi.z);
    principledthin_choice(p, lobes);
    Float first = lobes[THIN_REFLECTION], second = first + lobes[THIN_TRANSMISSION];
    Float third = second + lobes[THIN_MATTE];
    Mask reflected = m_lt(u1, first), clear = m_lt(u1, second), matte = m_lt(u1, third);
    Microfacet mf = principled_facets(p->roughness * principledthin_scale(reflected, p->eta), p->anisotropic);
    // A random number of its own for the chosen one of the first two lobes.
    Float inner = f_select(reflected, u1 * f_safe_rcp(first), (u1 - first) * f_safe_rcp(lobes[THIN_TRANSMISSION]));
    Vec3 up = v3_scale(wi, side), m = interface_sample(&mf, up, p->eta, p->floor, &inner, u2), wo = reflect(up, m);
    // Directions on the wrong side, or that see the facet from the wrong side, have no density.
    Mask good = m_gt(wo.z, f_set(0)) & m_gt(v3_dot(up, m), f_set(0)) & m_gt(m.z, f_set(0));
    wo.z = f_select(reflected, wo.z, -wo.z);
    good = good & (reflected | m_lt(v3_dot(wo, m), f_set(0)));
    wo.z = f_zero_unless(good, wo.z);
    Vec3 cosine = warp_cosine_hemisphere(u2);
    wo = v3_select(clear, wo, v3_scale(cosine, f_select(matte, f_set(1), f_set(-1))));
    return (BsdfSample){v3_scale(wo, side), i_set(LOBE_SMOOTH), f_set(1)};
}

// ---- adjoint -----------------------------------------------------------------------------------------------------

typedef struct ThinBack {
    Float a, b, fresnel, eta;
    Vec3 wi, wo, m;
} ThinBack;

KFN void principledthin_clear_adj(const PrincipledThin *p, const ThinTerms *t, Spec df, PrincipledThin *dp,
                                  ThinBack *back) {
    Float d = microfacet_D(&t->mf, t->m), gi = smith_G1(&t->mf, t->wi, t->m), go = smith_G1(&t->mf, t->wo, t->m);
    Float k = f_safe_rcp(4.0f * t->wi.z), shape = d * gi * go * k;
    // f = spec_trans colour D Gi Go / (4 wi.z)
    Spec dcolour = spec_scale(df, p->spec_trans * shape);
    Float dvalue = spec_dot(df, principledthin_colour(p, t)), dshape = dvalue * p->spec_trans;
    dp->spec_trans = dp->spec_trans + dvalue * shape;
    back->wi.z = back->wi.z - dshape * shape * f_safe_rcp(t->wi.z);
    // colour = base (1 - F) below
    Spec below = spec_zero_unless(~t->reflects, dcolour);
    spec_acc(&dp->base_color, spec_scale(below, 1.0f - t->fresnel));
    back->fresnel = back->fresnel - spec_dot(below, p->base_color);
    // colour = principled_reflectance(...) above
    PrincipledReflectanceAdj r = {.base = spec_zero()};
    principled_reflectance_adj(p->base_color, f_set(0), p->spec_tint, t->fresnel, t->a, p->eta,
                               spec_zero_unless(t->reflects, dcolour), &r);
    spec_acc(&dp->base_color, r.base);
    dp->spec_tint = dp->spec_tint + r.tinted;
    back->fresnel = back->fresnel + r.exact;
    back->a = back->a + r.cosine;
    back->eta = back->eta + r.eta;
    // D Gi Go
    Float du = f_set(0), dv = f_set(0), dr = f_set(0);
    microfacet_D_adj(&t->mf, t->m, dshape * gi * go * k, &du, &dv, &back->m);
    smith_G1_adj(&t->mf, t->wi, t->m, dshape * d * go * k, &du, &dv, &back->wi);
    smith_G1_adj(&t->mf, t->wo, t->m, dshape * d * gi * k, &du, &dv, &back->wo);
    principled_facets_adj(p->roughness * t->scale, p->anisotropic, du, dv, &dr, &dp->anisotropic);
    // roughness scale, scale = 1 or 0.65 eta - 0.35
    dp->roughness = dp->roughness + dr * t->scale;
    back->eta = back->eta + f_zero_unless(~t->reflects, 0.65f * dr * p->roughness);
}

KFN void principledthin_diffuse_adj(const PrincipledThin *p, const ThinTerms *t, Spec df, PrincipledThin *dp,
                                    ThinBack *back) {
    Spec above = spec_zero_unless(t->reflects, df), below = spec_zero_unless(~t->reflects, df);
    Float co = f_abs(t->wo.z), dco = f_set(0);
    PrincipledMatte matte = principledthin_matte_of(p, t), d = {.base = spec_zero()};
    principled_matte_adj(&matte, t->wi.z, co, t->b, above, &d, &back->wi.z, &dco, &back->b);
    spec_acc(&dp->base_color, d.base);
    dp->roughness = dp->roughness + d.roughness;
    dp->flatness = dp->flatness + d.flatness;
    dp->sheen = dp->sheen + d.sheen;
    dp->sheen_tint = dp->sheen_tint + d.tinted;
    Float dmatte = d.diffuse + d.gleam;
    // f = base through / pi |wo.z| below
    Float dvalue = spec_dot(below, p->base_color) * INV_PI, dthrough = dvalue * co;
    spec_acc(&dp->base_color, spec_scale(below, t->through * co * INV_PI));
    dco = dco + dvalue * t->through;
    back->wo.z = back->wo.z + f_sign(t->wo.z) * dco;
    // matte = (1 - spec_trans) (1 - diff_trans / 2), through = (1 - spec_trans) diff_trans / 2
    Float half = 0.5f * p->diff_trans;
    dp->spec_trans = dp->spec_trans - dmatte * (1.0f - half) - dthrough * half;
    dp->diff_trans = dp->diff_trans + 0.5f * (1.0f - p->spec_trans) * (dthrough - dmatte);
}

// Back to the parameters and directions that eval and pdf share.
KFN void principledthin_terms_adj(const PrincipledThin *p, const ThinTerms *t, ThinBack *back, PrincipledThin *dp, Vec3 *dwi,
                                  Vec3 *dwo) {
    // F(a, eta), a = wi . m, b = wo . m
    fresnel_dielectric_adj(t->a, p->eta, back->fresnel, f_set(0), &back->a, &back->eta);
    dp->eta = dp->eta + back->eta;
    v3_acc(&back->wi, v3_scale(t->m, back->a));
    v3_acc(&back->wo, v3_scale(t->m, back->b));
    v3_acc(&back->m, v3_madd(v3_scale(t->wi, back->a), back->b, t->wo));
    // m = normalize(h), h = wi + (wo.x, wo.y, |wo.z|)
    Vec3 dh = v3_zero();
    v3_normalize_adj(t->h, back->m, &dh);
    v3_acc(&back->wi, dh);
    v3_acc(&back->wo, v3(dh.x, dh.y, f_sign(t->wo.z) * dh.z));
    // turned to the side of wi
    v3_acc(dwi, v3_scale(back->wi, t->side));
    v3_acc(dwo, v3_scale(back->wo, t->side));
}

KFN void principledthin_adj(const PrincipledThin *p, Vec3 wi, Vec3 wo, Int lobe, Spec df, PrincipledThin *dp, Vec3 *dwi,
                            Vec3 *dwo) {
    ThinTerms t = principledthin_terms(p, wi, wo, lobe);
    ThinBack back = {.wi = v3_zero()};
    df = spec_zero_unless(t.counts, df);
    principledthin_clear_adj(p, &t, df, dp, &back);
    principledthin_diffuse_adj(p, &t, df, dp, &back);
    principledthin_terms_adj(p, &t, &back, dp, dwi, dwo);
}

KFN void principledthin_choice_adj(const PrincipledThin *p, Float d[THIN_LOBES], PrincipledThin *dp) {
    Float weights[THIN_LOBES], half = 0.5f * p->diff_trans, diffuse = 1.0f - p->spec_trans;
    principledthin_weights(p, weights);
    principled_probabilities_adj(THIN_LOBES, weights, d);
    Float dmatte = d[THIN_MATTE] * p->diffuse_reflectance_sampling_rate;
    Float dthrough = d[THIN_THROUGH] * p->diffuse_transmittance_sampling_rate;
    // reflection, transmission = spec_trans / 2 rate
    dp->specular_reflectance_sampling_rate = dp->specular_reflectance_sampling_rate + 0.5f * d[THIN_REFLECTION] * p->spec_trans;
    dp->specular_transmittance_sampling_rate =
        dp->specular_transmittance_sampling_rate + 0.5f * d[THIN_TRANSMISSION] * p->spec_trans;
    dp->spec_trans = dp->spec_trans + 0.5f * (d[THIN_REFLECTION] * p->specular_reflectance_sampling_rate +
                                              d[THIN_TRANSMISSION] * p->specular_transmittance_sampling_rate);
    // matte = (1 - spec_trans) (1 - diff_trans / 2) rate, through = (1 - spec_trans) diff_trans / 2 rate
    dp->diffuse_reflectance_sampling_rate =
        dp->diffuse_reflectance_sampling_rate + d[THIN_MATTE] * diffuse * (1.0f - half);
    dp->diffuse_transmittance_sampling_rate = dp->diffuse_transmittance_sampling_rate + d[THIN_THROUGH] * diffuse * half;
    dp->spec_trans = dp->spec_trans - dmatte * (1.0f - half) - dthrough * half;
    dp->diff_trans = dp->diff_trans + 0.5f * diffuse * (dthrough - dmatte);
}

KFN void principledthin_pdf_adj(const PrincipledThin *p, Vec3 wi, Vec3 wo, Float dpdf, PrincipledThin *dp, Vec3 *dwi,
                                Vec3 *dwo) {
    ThinTerms t = principledthin_terms(p, wi, wo, i_set(LOBE_SMOOTH));
    ThinBack back = {.wi = v3_zero()};
    Float lobes[THIN_LOBES], dlobes[THIN_LOBES];
    principledthin_choice(p, lobes);
    dpdf = f_zero_unless(t.counts, dpdf);
    // pdf = clear facets / (4 c) + diffuse |wo.z| / pi, c = (wo.x, wo.y, |wo.z|) . m
    Vec3 mirrored = v3_sub(t.h, t.wi);
    Float clear = f_select(t.reflects, lobes[THIN_REFLECTION], lobes[THIN_TRANSMISSION]);
    Float diffuse = f_select(t.reflects, lobes[THIN_MATTE], lobes[THIN_THROUGH]);
    Float rcp = f_safe_rcp(v3_dot(mirrored, t.m)), k = 0.25f * f_zero_unless(t.visible, dpdf) * rcp;
    Float facets = microfacet_pdf(&t.mf, t.wi, t.m), du = f_set(0), dv = f_set(0), dr = f_set(0);
    microfacet_pdf_adj(&t.mf, t.wi, t.m, k * clear, &du, &dv, &back.wi, &back.m);
    principled_facets_adj(p->roughness * t.scale, p->anisotropic, du, dv, &dr, &dp->anisotropic);
    dp->roughness = dp->roughness + dr * t.scale;
    back.eta = f_zero_unless(~t.reflects, 0.65f * dr * p->roughness);
    Float dc = -k * clear * facets * rcp;
    v3_acc(&back.m, v3_scale(mirrored, dc));
    v3_acc(&back.wo, v3(t.m.x * dc, t.m.y * dc, f_sign(t.wo.z) * (t.m.z * dc + dpdf * diffuse * INV_PI)));
    Float dclear = k * facets, ddiffuse = dpdf * f_abs(t.wo.z) * INV_PI;
    dlobes[THIN_REFLECTION] = f_zero_unless(t.reflects, dclear);
    dlobes[THIN_TRANSMISSION] = f_zero_unless(~t.reflects, dclear);
    dlobes[THIN_MATTE] = f_zero_unless(t.reflects, ddiffuse);
    dlobes[THIN_THROUGH] = f_zero_unless(~t.reflects, ddiffuse);
    principledthin_choice_adj(p, dlobes, dp);
    principledthin_terms_adj(p, &t, &back, dp, dwi, dwo);
}
