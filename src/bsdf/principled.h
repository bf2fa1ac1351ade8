// principled.h: the surface of many lobes [burley2012, burley2015] in the variant of the Mitsuba 3 renderer. With
// brdf = (1 - metallic)(1 - spec_trans), bsdf = (1 - metallic) spec_trans and m the half vector of roughdielectric.h,
// from the front the sum of
//   reflection    R D G / (4 |cos_i|), R of principled_reflectance()
//   refraction    sqrt(base) bsdf (that of roughdielectric.h)
//   clearcoat     clearcoat / 4 (0.04 + 0.96 w) Dc Gc |cos_o|
//   diffuse       brdf base / pi |cos_o| principled_diffuse()
//   sheen         sheen (1 - metallic) w(wo.m) (1 + (tint - 1) sheen_tint) |cos_o|
// (the sheen also where brdf = 0, as that renderer's vectorised variants have it; its scalar ones leave it out there)
// and from the back bsdf F D G / (4 |cos_i|) and the refraction. Reciprocal; gains energy by design where sheen,
// clearcoat and spec_tint are on, or a rough white base lies under the dielectric reflection.
#pragma once

#include "bsdf/critical.h"
#include "bsdf/principled_lobes.h"
#include "bsdf/rim.h"

#define PRINCIPLED_PARAMS(P)                                                                                           \
    P(SPEC, base_color, 0.5f, 0, 1, "colour", "")                                                                      \
    P(REAL, roughness, 0.5f, 0, 1, "how rough the main lobe is", "")                                                   \
    P(REAL, anisotropic, 0, 0, 1, "how much longer the highlight is along the tangent", "")                            \
    P(REAL, metallic, 0, 0, 1, "1 = metal, 0 = dielectric", "")                                                        \
    P(REAL, spec_trans, 0, 0, 1, "share of the dielectric that is clear and refracts", "")                             \
    P(SPECULAR, specular, 0.5f, 0, 1, "reflectance at normal incidence over 0.08; or eta, the relative index", "")     \
    P(REAL, spec_tint, 0, 0, 1, "how much the dielectric reflection takes the colour of the base", "")                 \
    P(REAL, sheen, 0, 0, 1, "grazing gleam of cloth", "")                                                              \
    P(REAL, sheen_tint, 0, 0, 1, "how much the sheen takes the colour of the base", "")                                \
    P(REAL, flatness, 0, 0, 1, "diffuse reflection: 1 = as if light had scattered inside", "")                         \
    P(REAL, clearcoat, 0, 0, 1, "a second, colourless highlight", "")                                                  \
    P(REAL, clearcoat_gloss, 0, 0, 1, "how narrow the second highlight is", "")                                        \
    P(RATE, main_specular_sampling_rate, 1, 0, INFINITY, "weight of the main lobe in sampling", "")                    \
    P(RATE, clearcoat_sampling_rate, 1, 0, INFINITY, "weight of the second highlight in sampling", "")                 \
    P(RATE, diffuse_reflectance_sampling_rate, 1, 0, INFINITY, "weight of the diffuse lobe in sampling", "")
#define PRINCIPLED_CONFIG(C)                                                                                           \
    C(eta_given, 0, "given eta", "the index is given itself, not as `specular`")                                       \
    C(transmits, 0, "given spec_trans", "an index of 1 is avoided")
KIND_RECORD(Principled, PRINCIPLED_PARAMS, PRINCIPLED_CONFIG)

// ---- index of refraction -----------------------------------------------------------------------------------------

// An index of 1 has no main lobe at all, metal included; where light is refracted, and for derivatives, a value close
// to it stands in for it.
KFN Mask principled_degenerate(const Principled *p) {
    return m_eq(p->specular, f_set(p->eta_given ? 1 : 0)) & m_le(p->spec_trans, f_set(0)) & m_set(!p->transmits);
}

KFN Float principled_specular(const Principled *p) {
    Mask one = m_eq(p->specular, f_set(p->eta_given ? 1 : 0));
    return f_select(one, f_set(p->eta_given ? 1.001f : 1e-3f), p->specular);
}

// eta = 2 / (1 - sqrt(0.08 specular)) - 1: the inverse of specular = ((eta - 1) / (eta + 1))^2 / 0.08.
KFN Float principled_eta(const Principled *p) {
    Float x = principled_specular(p);
    return p->eta_given ? x : 2.0f / (1.0f - f_sqrt(0.08f * x)) - 1.0f;
}

KFN void principled_eta_adj(const Principled *p, Float deta, Float *dspecular) {
    Float q = f_sqrt(0.08f * principled_specular(p));
    // eta = 2 / (1 - q) - 1, q = sqrt(0.08 specular)
    *dspecular = *dspecular + (p->eta_given ? deta : deta * 0.08f * f_safe_rcp(q) / f_sqr(1.0f - q));
}

// ---- what eval, pdf and the adjoint share ------------------------------------------------------------------------

typedef struct PrincipledTerms {
    Mask counts, front, reflects;
    Float eta, e;  // the index; its ratio along the path
    Vec3 h, m;     // unnormalised and final half vector
    Float turn;    // the sign that turned m up
    Float a, b, q; // wi.m, wo.m, a + e b
    Float fresnel, brdf, bsdf;
    Microfacet mf;
} PrincipledTerms;

KFN PrincipledTerms principled_terms(const Principled *p, Vec3 wi, Vec3 wo, Int lobe) {
    PrincipledTerms t;
    t.front = m_gt(wi.z, f_set(0));
    t.reflects = m_gt(wi.z * wo.z, f_set(0));
    t.counts = m_ne(wi.z * wo.z, f_set(0)) & mi_eq(lobe, i_set(LOBE_SMOOTH));
    t.eta = principled_eta(p);
    t.e = f_select(t.front, t.eta, 1.0f / t.eta);
    t.h = v3_madd(wi, f_select(t.reflects, f_set(1), t.e), wo);
    Vec3 m = v3_normalize(t.h);
    t.turn = f_sign(m.z);
    t.m = v3_scale(m, t.turn);
    t.a = v3_dot(wi, t.m);
    t.b = v3_dot(wo, t.m);
    t.q = t.a + t.e * t.b;
    Float cos_t, eta_it, eta_ti;
    t.fresnel = fresnel_dielectric(t.a, t.eta, &cos_t, &eta_it, &eta_ti);
    t.brdf = (1.0f - p->metallic) * (1.0f - p->spec_trans);
    t.bsdf = (1.0f - p->metallic) * p->spec_trans;
    t.mf = principled_facets(p->roughness, p->anisotropic);
    return t;
}

// Both directions on the outer side of the facet.
KFN Mask principled_visible(const PrincipledTerms *t, Vec3 wi, Vec3 wo) {
    return m_gt(t->a * wi.z, f_set(0)) & m_gt(t->b * wo.z, f_set(0));
}

// |a b| / (|cos_i| q^2): from normals to refracted directions.
KFN Float principled_refraction(const PrincipledTerms *t, Vec3 wi) {
    return f_abs(t->a * t->b) * f_safe_rcp(f_abs(wi.z) * t->q * t->q);
}

// ---- value -------------------------------------------------------------------------------------------------------

KFN Spec principled_root(Spec base) {
    for (int c = 0; c < SPEC_N; c++) {
        base.c[c] = f_safe_sqrt(base.c[c]);
    }
    return base;
}

// The factor of D G / (4 |cos_i|).
KFN Spec principled_reflection(const Principled *p, const PrincipledTerms *t) {
    Spec front = principled_reflectance(p->base_color, p->metallic, p->spec_tint, t->fresnel, t->a, t->eta);
    return spec_select(t->front, spec_zero_unless(~principled_degenerate(p), front), spec_set(t->bsdf * t->fresnel));
}

KFN Mask principled_upper(const PrincipledTerms *t) { return t->counts & t->front & t->reflects; }

KFN Float principled_coat(const Principled *p, const PrincipledTerms *t, Vec3 wi, Vec3 wo) {
    Float schlick = 0.04f + 0.96f * principled_fall(t->a, t->eta);
    Float value = schlick * clearcoat_D(t->m, clearcoat_alpha(p->clearcoat_gloss)) * clearcoat_G1(wi.z) *
                  clearcoat_G1(wo.z) * f_abs(wo.z);
    return f_zero_unless(principled_upper(t) & principled_visible(t, wi, wo), 0.25f * p->clearcoat * value);
}

KFN PrincipledMatte principled_matte_of(const Principled *p, const PrincipledTerms *t) {
    return (PrincipledMatte){p->base_color, p->roughness, p->flatness,       p->sheen,
                             p->sheen_tint, t->brdf,      1.0f - p->metallic};
}

KFN Spec principled_eval(const Principled *p, Vec3 wi, Vec3 wo, Int lobe) {
    PrincipledTerms t = principled_terms(p, wi, wo, lobe);
    Float dg = f_zero_unless(t.counts, microfacet_D(&t.mf, t.m) * smith_G(&t.mf, wi, wo, t.m));
    Spec f = spec_scale(principled_reflection(p, &t), f_zero_unless(t.reflects, dg * f_safe_rcp(4.0f * f_abs(wi.z))));
    Mask refracts = t.counts & ~t.reflects;
    if (m_any(refracts & m_ne(t.bsdf, f_set(0)))) {
        Float s = t.bsdf * (1.0f - t.fresnel) * dg * principled_refraction(&t, wi);
        f = spec_madd(f, f_zero_unless(refracts, s), principled_root(p->base_color));
    }
    if (m_any(principled_upper(&t))) {
        PrincipledMatte matte = principled_matte_of(p, &t);
        spec_acc(&f, spec_zero_unless(principled_upper(&t), principled_matte(&matte, f_abs(wi.z), f_abs(wo.z), t.b)));
        if (m_any(m_ne(p->clearcoat, f_set(0)))) {
            spec_acc(&f, spec_set(principled_coat(p, &t, wi, wo)));
        }
    }
    return f;
}

// ---- sampling ----------------------------------------------------------------------------------------------------

enum { PRINCIPLED_MAIN, PRINCIPLED_COAT, PRINCIPLED_DIFFUSE, PRINCIPLED_LOBES };

typedef struct PrincipledChoice {
    Float lobes[PRINCIPLED_LOBES]; // probabilities
    Mask any;                      // is there anything to sample?
} PrincipledChoice;

KFN void principled_weights(const Principled *p, Float weights[PRINCIPLED_LOBES]) {
    weights[PRINCIPLED_MAIN] = p->main_specular_sampling_rate;
    weights[PRINCIPLED_COAT] = 0.25f * p->clearcoat * p->clearcoat_sampling_rate;
    weights[PRINCIPLED_DIFFUSE] = (1.0f - p->metallic) * (1.0f - p->spec_trans) * p->diffuse_reflectance_sampling_rate;
}

KFN PrincipledChoice principled_choice(const Principled *p, Vec3 wi) {
    Mask front = m_gt(wi.z, f_set(0));
    Float fm = 1.0f - p->metallic;
    PrincipledChoice c;
    principled_weights(p, c.lobes);
    principled_probabilities(PRINCIPLED_LOBES, c.lobes, p->floor);
    for (int i = 0; i < PRINCIPLED_LOBES; i++) {
        c.lobes[i] = f_select(front, c.lobes[i], f_set(i == PRINCIPLED_MAIN));
    }
    c.any = m_ne(wi.z, f_set(0)) & (front | m_gt(fm * p->spec_trans, f_set(0)) | m_set(p->floor > 0));
    return c;
}

// Probability of reflection by a facet that was chosen for the main lobe.
KFN Float principled_share(const Principled *p, Mask front, Float fresnel) {
    Float bsdf = (1.0f - p->metallic) * p->spec_trans;
    Float q = f_select(front, 1.0f - bsdf * (1.0f - fresnel), fresnel);
    return f_select(m_lt(fresnel, f_set(1)), f_clamp(q, f_set(p->floor), f_set(1 - p->floor)), f_set(1));
}

// Of the end of the refraction, which only counts where something is refracted.
KFN Float principled_rim(const Principled *p, const Microfacet *mf, Vec3 wi, Float e) {
    return f_zero_unless(m_ne((1.0f - p->metallic) * p->spec_trans, f_set(0)), rim_share(mf, wi, e, p->rim));
}

KFN Float principled_pdf(const Principled *p, Vec3 wi, Vec3 wo, Int lobe) {
    PrincipledTerms t = principled_terms(p, wi, wo, lobe);
    PrincipledChoice c = principled_choice(p, wi);
    Float share = principled_share(p, t.front, t.fresnel);
    Float facets = interface_pdf(&t.mf, v3_scale(wi, f_sign(wi.z)), t.m, t.e, p->floor);
    Float by_reflection = f_safe_rcp(4.0f * f_abs(t.b));
    Float by_refraction = f_abs(t.b) * t.e * t.e * f_safe_rcp(t.q * t.q);
    Float pdf = c.lobes[PRINCIPLED_MAIN] * facets *
                f_select(t.reflects, share * by_reflection, (1.0f - share) * by_refraction);
    if (m_any(m_gt(c.lobes[PRINCIPLED_COAT], f_set(0)))) {
        Float coat = clearcoat_D(t.m, clearcoat_alpha(p->clearcoat_gloss)) * t.m.z;
        pdf = pdf + f_zero_unless(principled_upper(&t), c.lobes[PRINCIPLED_COAT] * coat * by_reflection);
    }
    pdf = f_zero_unless(principled_visible(&t, wi, wo), pdf);
    pdf = pdf + f_zero_unless(principled_upper(&t), c.lobes[PRINCIPLED_DIFFUSE] * wo.z * INV_PI);
    pdf = f_zero_unless(t.counts & c.any, pdf);
    return p->rim > 0 ? rim_pdf(principled_rim(p, &t.mf, wi, t.e), lobe, pdf) : pdf;
}

KFN BsdfSample principled_sample(const Principled *p, Vec3 wi, Float u1, Vec2 u2) {
    PrincipledChoice c = principled_choice(p, wi);
    Mask front = m_gt(wi.z, f_set(0)), rim = m_set(false);
    Microfacet mf = principled_facets(p->roughness, p->anisotropic);
    Float eta = principled_eta(p), e = f_select(front, eta, 1.0f / eta);
    if (p->rim > 0) {
        rim = warp_event(principled_rim(p, &mf, wi, e), &u1);
    }
    // [0, main): the main lobe, with a random number of its own; then the clearcoat; then diffuse
    Float main = c.lobes[PRINCIPLED_MAIN], coat = main + c.lobes[PRINCIPLED_COAT];
    Float inner = f_min(u1 * f_safe_rcp(main), f_set(0.99999994f));
    Vec3 m = interface_sample(&mf, v3_scale(wi, f_sign(wi.z)), e, p->floor, &inner, u2);
    Float cos_t, eta_it, eta_ti, fresnel = fresnel_dielectric(v3_dot(wi, m), eta, &cos_t, &eta_it, &eta_ti);
    Mask refracts = m_lt(u1, main) & m_ge(inner, principled_share(p, front, fresnel));
    Mask coated = m_ge(u1, main) & m_lt(u1, coat), diffuse = m_ge(u1, coat) & m_ge(u1, main);
    if (m_any(coated)) {
        m = v3_select(coated, clearcoat_sample(clearcoat_alpha(p->clearcoat_gloss), u2), m);
    }
    Vec3 wo = v3_select(refracts, refract(wi, m, cos_t, eta_ti), reflect(wi, m));
    // Directions on the wrong side, or from facets that are seen from their back, have no density.
    Mask good = (refracts ^ m_gt(wi.z * wo.z, f_set(0))) & m_gt(v3_dot(wi, m) * wi.z, f_set(0)) & m_gt(m.z, f_set(0)) &
                c.any;
    wo = v3_select(diffuse, warp_cosine_hemisphere(u2), wo);
    wo = v3_select(good | (diffuse & c.any), wo, v3(wo.x, wo.y, f_set(0)));
    wo = v3_select(rim, rim_direction(wi, e, u2.x), wo);
    return (BsdfSample){wo, i_select(rim, i_set(LOBE_RIM), i_set(LOBE_SMOOTH)),
                        f_select(rim, e, f_select(refracts, eta_it, f_set(1)))};
}
