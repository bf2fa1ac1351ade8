// principled_lobes.h: the parts that `principled` and `principledthin` are made of [burley2012, burley2015], each with
// its adjoint. The variants of the formulas are those of the Mitsuba 3 renderer's plugins.
#pragma once

#include "bsdf/record.h"
#include "math/microfacet.h"

// ---- roughness ---------------------------------------------------------------------------------------------------

#define PRINCIPLED_ALPHA_MIN 1e-3f

// sqrt(1 - 0.9 anisotropic): the square root of the ratio of the two alphas.
KFN Float principled_aspect(Float anisotropic) { return f_sqrt(f_max(1.0f - 0.9f * anisotropic, f_set(1e-4f))); }

// alpha_u = roughness^2 / aspect, alpha_v = roughness^2 aspect [burley2012 section 5.4].
KFN Microfacet principled_facets(Float roughness, Float anisotropic) {
    Float r2 = roughness * roughness, aspect = principled_aspect(anisotropic);
    Float least = f_set(PRINCIPLED_ALPHA_MIN);
    return microfacet_make(true, true, f_max(r2 / aspect, least), f_max(r2 * aspect, least));
}

KFN void principled_facets_adj(Float roughness, Float anisotropic, Float du, Float dv, Float *droughness,
                               Float *danisotropic) {
    Float r2 = roughness * roughness, aspect = principled_aspect(anisotropic), rcp = 1.0f / aspect;
    // u = max(r2 / aspect, least), v = max(r2 aspect, least)
    du = f_zero_unless(m_gt(r2 * rcp, f_set(PRINCIPLED_ALPHA_MIN)), du) * rcp;
    dv = f_zero_unless(m_gt(r2 * aspect, f_set(PRINCIPLED_ALPHA_MIN)), dv);
    *droughness = *droughness + 2.0f * roughness * (du + dv * aspect);
    // aspect = sqrt(1 - 0.9 anisotropic)
    *danisotropic = *danisotropic - 0.45f * rcp * r2 * (dv - du * rcp);
}

// ---- colour ------------------------------------------------------------------------------------------------------

// The base colour without its luminance; white for black.
KFN Spec principled_tint(Spec base) {
    Float y = luminance(base);
    return spec_select(m_gt(y, f_set(0)), spec_scale(base, f_safe_rcp(y)), spec_set(f_set(1)));
}

KFN void principled_tint_adj(Spec base, Spec dtint, Spec *dbase) {
    // tint = base / y, y = luminance(base)
    Float y = luminance(base), r = f_safe_rcp(y);
    dtint = spec_zero_unless(m_gt(y, f_set(0)), dtint);
    spec_acc(dbase, spec_scale(dtint, r));
    spec_acc(dbase, luminance_adj(-spec_dot(dtint, base) * r * r));
}

// 1 + (tint - 1) t
KFN Spec principled_towards(Spec tint, Float t) { return spec_madd(spec_set(1.0f - t), t, tint); }

// ---- Fresnel -----------------------------------------------------------------------------------------------------

// Schlick's weight of white at cosine > 0 from the side of index 1; the refracted cosine counts where the other side's
// index is the smaller one.
KFN Float principled_fall(Float cosine, Float eta) {
    Float sine2 = (1.0f - cosine * cosine) / (eta * eta);
    return schlick_weight(f_select(m_gt(eta, f_set(1)), f_abs(cosine), f_safe_sqrt(1.0f - sine2)));
}

KFN void principled_fall_adj(Float cosine, Float eta, Float dw, Float *dcosine, Float *deta) {
    Mask direct = m_gt(eta, f_set(1));
    Float r2 = 1.0f / (eta * eta), sine2 = (1.0f - cosine * cosine) * r2;
    Float x = f_select(direct, f_abs(cosine), f_safe_sqrt(1.0f - sine2)), dx = f_set(0);
    schlick_weight_adj(x, dw, &dx);
    // x = sqrt(1 - (1 - cosine^2) / eta^2), or |cosine|
    Float g = f_zero_unless(~direct & m_lt(sine2, f_set(1)), dx) * f_safe_rcp(x);
    *dcosine = *dcosine + g * cosine * r2 + f_zero_unless(direct, f_select(m_lt(cosine, f_set(0)), -dx, dx));
    *deta = *deta + g * sine2 / eta;
}

KFN Float principled_r0(Float eta) { return f_sqr((eta - 1.0f) / (eta + 1.0f)); }

// Reflectance of the main lobe from the front: exact for the dielectric share, Schlick's approximation
// R + (1 - R) w for its tinted share (R = tint r0) and for metal (R = base).
KFN Spec principled_reflectance(Spec base, Float metallic, Float tinted, Float exact, Float cosine, Float eta) {
    Float w = principled_fall(cosine, eta), plain = (1.0f - metallic) * (1.0f - tinted);
    Spec f = spec_set(plain * exact + (1.0f - plain) * w);
    spec_acc(&f, spec_scale(base, metallic * (1.0f - w)));
    if (m_any(m_ne(tinted, f_set(0)))) {
        f = spec_madd(f, (1.0f - metallic) * tinted * (1.0f - w) * principled_r0(eta), principled_tint(base));
    }
    return f;
}

typedef struct PrincipledReflectanceAdj {
    Spec base;
    Float metallic, tinted, exact, cosine, eta;
} PrincipledReflectanceAdj;

KFN void principled_reflectance_adj(Spec base, Float metallic, Float tinted, Float exact, Float cosine, Float eta,
                                    Spec df, PrincipledReflectanceAdj *d) {
    Float w = principled_fall(cosine, eta), r0 = principled_r0(eta), white = spec_sum(df);
    Float fm = 1.0f - metallic, ft = 1.0f - tinted;
    Spec tint = principled_tint(base), dtint = spec_zero();
    Float dbase = spec_dot(df, base), dcolour = spec_dot(df, tint);
    // f = fm ft exact + (1 - fm ft) w + metallic (1 - w) base + fm tinted (1 - w) r0 tint
    Float coloured = dcolour * (1.0f - w) * r0;
    d->exact = d->exact + white * fm * ft;
    d->metallic = d->metallic + dbase * (1.0f - w) + white * ft * (w - exact) - tinted * coloured;
    d->tinted = d->tinted + fm * (white * (w - exact) + coloured);
    Float dw = white * (1.0f - fm * ft) - metallic * dbase - fm * tinted * r0 * dcolour;
    spec_acc(&d->base, spec_scale(df, metallic * (1.0f - w)));
    spec_acc(&dtint, spec_scale(df, fm * tinted * (1.0f - w) * r0));
    principled_tint_adj(base, dtint, &d->base);
    principled_fall_adj(cosine, eta, dw, &d->cosine, &d->eta);
    // r0 = ((eta - 1) / (eta + 1))^2
    Float r = 1.0f / (eta + 1.0f);
    d->eta = d->eta + 4.0f * dcolour * fm * tinted * (1.0f - w) * (eta - 1.0f) * r * r * r;
}

// ---- diffuse -----------------------------------------------------------------------------------------------------

// Diffuse and retro-reflection [burley2012 section 5.3, burley2015 eq. 4], blended with the flat approximation of
// subsurface scattering; ci and co are the cosines, cd that between either direction and the half vector.
typedef struct PrincipledDiffuse {
    Float wi, wo, r;       // Schlick's weights; 2 roughness cd^2
    Float smooth, flat;    // the two ends of the blend
    Float si, so, through; // flat = 1.25 (si so through + 0.5)
} PrincipledDiffuse;

KFN PrincipledDiffuse principled_diffuse(Float ci, Float co, Float cd, Float roughness) {
    PrincipledDiffuse d;
    d.wi = schlick_weight(ci);
    d.wo = schlick_weight(co);
    d.r = 2.0f * roughness * cd * cd;
    d.smooth = (1.0f - 0.5f * d.wi) * (1.0f - 0.5f * d.wo) + d.r * (d.wo + d.wi + d.wo * d.wi * (d.r - 1.0f));
    d.si = 1.0f + (0.5f * d.r - 1.0f) * d.wi;
    d.so = 1.0f + (0.5f * d.r - 1.0f) * d.wo;
    d.through = f_safe_rcp(ci + co) - 0.5f;
    d.flat = 1.25f * (d.si * d.so * d.through + 0.5f);
    return d;
}

KFN void principled_diffuse_adj(const PrincipledDiffuse *d, Float ci, Float co, Float cd, Float roughness,
                                Float flatness, Float dvalue, Float *dci, Float *dco, Float *dcd, Float *droughness) {
    // value = smooth + (flat - smooth) flatness
    Float ds = dvalue * (1.0f - flatness), df = 1.25f * dvalue * flatness;
    // flat = 1.25 (si so through + 0.5), through = 1 / (ci + co) - 0.5
    Float rcp = f_safe_rcp(ci + co), dsum = -df * d->si * d->so * rcp * rcp;
    Float dsi = df * d->so * d->through, dso = df * d->si * d->through;
    // si = 1 + (r / 2 - 1) wi, so likewise; smooth = (1 - wi / 2) (1 - wo / 2) + r (wo + wi + wo wi (r - 1))
    Float dr = 0.5f * (dsi * d->wi + dso * d->wo) + ds * (d->wo + d->wi + d->wo * d->wi * (2.0f * d->r - 1.0f));
    Float half_r = 0.5f * d->r - 1.0f, mixed = d->r * (d->r - 1.0f);
    Float dwi = dsi * half_r + ds * (d->r + mixed * d->wo - 0.5f * (1.0f - 0.5f * d->wo));
    Float dwo = dso * half_r + ds * (d->r + mixed * d->wi - 0.5f * (1.0f - 0.5f * d->wi));
    // r = 2 roughness cd^2
    *droughness = *droughness + 2.0f * dr * cd * cd;
    *dcd = *dcd + 4.0f * dr * roughness * cd;
    schlick_weight_adj(ci, dwi, dci);
    schlick_weight_adj(co, dwo, dco);
    *dci = *dci + dsum;
    *dco = *dco + dsum;
}

// Diffuse reflection and sheen together, without the weights of the lobes that they share the surface with:
// |cos_o| (diffuse base / pi blend + gleam sheen w(cd) (1 + (tint - 1) tinted)). Also the record of its adjoint.
typedef struct PrincipledMatte {
    Spec base;
    Float roughness, flatness, sheen, tinted;
    Float diffuse, gleam; // weights
} PrincipledMatte;

KFN Spec principled_matte(const PrincipledMatte *p, Float ci, Float co, Float cd) {
    PrincipledDiffuse d = principled_diffuse(ci, co, cd, p->roughness);
    Spec f = spec_scale(p->base, p->diffuse * INV_PI * co * f_lerp(d.smooth, d.flat, p->flatness));
    if (m_any(m_ne(p->sheen, f_set(0)))) {
        Spec colour = principled_towards(principled_tint(p->base), p->tinted);
        f = spec_madd(f, p->sheen * p->gleam * schlick_weight(f_abs(cd)) * co, colour);
    }
    return f;
}

KFN void principled_matte_adj(const PrincipledMatte *p, Float ci, Float co, Float cd, Spec df, PrincipledMatte *dp,
                              Float *dci, Float *dco, Float *dcd) {
    PrincipledDiffuse d = principled_diffuse(ci, co, cd, p->roughness);
    Float shape = f_lerp(d.smooth, d.flat, p->flatness) * INV_PI;
    // f = base diffuse / pi |cos_o| blend
    spec_acc(&dp->base, spec_scale(df, p->diffuse * co * shape));
    Float dvalue = spec_dot(df, p->base), dblend = dvalue * p->diffuse * co * INV_PI;
    dp->diffuse = dp->diffuse + dvalue * co * shape;
    *dco = *dco + dvalue * p->diffuse * shape;
    dp->flatness = dp->flatness + dblend * (d.flat - d.smooth);
    principled_diffuse_adj(&d, ci, co, cd, p->roughness, p->flatness, dblend, dci, dco, dcd, &dp->roughness);
    // f += sheen gleam w(|cd|) colour |cos_o|, colour = 1 + (tint - 1) tinted
    Spec tint = principled_tint(p->base);
    Float w = schlick_weight(f_abs(cd)), k = p->sheen * p->gleam * w * co, dsheen, dabs = f_set(0);
    dsheen = spec_dot(df, principled_towards(tint, p->tinted));
    dp->tinted = dp->tinted + k * (spec_dot(df, tint) - spec_sum(df));
    principled_tint_adj(p->base, spec_scale(df, k * p->tinted), &dp->base);
    dp->sheen = dp->sheen + dsheen * p->gleam * w * co;
    dp->gleam = dp->gleam + dsheen * p->sheen * w * co;
    *dco = *dco + dsheen * p->sheen * p->gleam * w;
    schlick_weight_adj(f_abs(cd), dsheen * p->sheen * p->gleam * co, &dabs);
    *dcd = *dcd + f_sign(cd) * dabs;
}

// ---- clearcoat ---------------------------------------------------------------------------------------------------

#define CLEARCOAT_MASKING_ALPHA 0.25f

KFN Float clearcoat_alpha(Float gloss) { return 0.1f - 0.099f * f_clamp(gloss, f_set(0), f_set(1)); }

// 1 + (alpha^2 - 1) z^2 for a unit vector, without cancellation.
KFN Float clearcoat_denominator(Vec3 m, Float alpha) { return m.x * m.x + m.y * m.y + f_sqr(alpha * m.z); }

// GTR with exponent 1 [burley2012 eq. 4].
KFN Float clearcoat_D(Vec3 m, Float alpha) {
    Float a2 = alpha * alpha;
    Float d = (a2 - 1.0f) * INV_PI / (f_log(a2) * f_max(clearcoat_denominator(m, alpha), f_set(1e-12f)));
    return f_zero_unless(m_gt(d * m.z, f_set(1e-20f)), d);
}

KFN void clearcoat_D_adj(Vec3 m, Float gloss, Float dd, Vec3 *dm, Float *dgloss) {
    Float alpha = clearcoat_alpha(gloss), a2 = alpha * alpha, g = dd * clearcoat_D(m, alpha);
    Float r = 1.0f / f_max(clearcoat_denominator(m, alpha), f_set(1e-12f));
    // log D = log(a2 - 1) - log log(a2) - log(x^2 + y^2 + a2 z^2) + const, a2 = alpha^2
    Float dalpha = 2.0f * g * (alpha / (a2 - 1.0f) - 1.0f / (alpha * f_log(a2)) - alpha * m.z * m.z * r);
    g = -2.0f * g * r;
    v3_acc(dm, v3(g * m.x, g * m.y, g * a2 * m.z));
    *dgloss = *dgloss - 0.099f * f_zero_unless(m_ge(gloss, f_set(0)) & m_le(gloss, f_set(1)), dalpha);
}

// Normals with density D z: sin^2 = (alpha^(2 (1 - u)) - alpha^2) / (1 - alpha^2) [burley2012 eq. 5].
KFN Vec3 clearcoat_sample(Float alpha, Vec2 u) {
    Float a2 = alpha * alpha, sine, cosine;
    Float sine2 = f_clamp((f_pow(a2, 1.0f - u.y) - a2) / (1.0f - a2), f_set(0), f_set(1));
    f_sincos(TWO_PI * u.x, &sine, &cosine);
    Float r = f_sqrt(sine2);
    return v3(r * cosine, r * sine, f_sqrt(1.0f - sine2));
}

// Smith's masking for GGX in terms of the cosine alone: 2 c / (c + sqrt(c^2 + alpha^2 (1 - c^2))).
KFN Float clearcoat_G1(Float z) {
    const float a2 = CLEARCOAT_MASKING_ALPHA * CLEARCOAT_MASKING_ALPHA;
    Float c = f_abs(z);
    return 2.0f * c * f_safe_rcp(c + f_safe_sqrt(c * c + a2 * (1.0f - c * c)));
}

KFN void clearcoat_G1_adj(Float z, Float dg, Float *dz) {
    const float a2 = CLEARCOAT_MASKING_ALPHA * CLEARCOAT_MASKING_ALPHA;
    // G = 2 c / (c + h), h^2 = a2 + (1 - a2) c^2: dG/dc = 2 (h - c dh/dc) / (c + h)^2 = 2 a2 / (h (c + h)^2)
    Float c = f_abs(z), h = f_safe_sqrt(c * c + a2 * (1.0f - c * c)), r = f_safe_rcp(c + h);
    *dz = *dz + f_sign(z) * dg * 2.0f * a2 * f_safe_rcp(h) * r * r;
}

// ---- selection ---------------------------------------------------------------------------------------------------

// Weights of n lobes to probabilities that are at least `floor`; the first lobe takes all where every weight is 0.
KFN void principled_probabilities(int n, Float *weights, real floor) {
    Float sum = f_set(0);
    for (int i = 0; i < n; i++) {
        weights[i] = f_max(weights[i], f_set(0));
        sum = sum + weights[i];
    }
    Mask some = m_gt(sum, f_set(1e-30f));
    Float scale = (1 - (real)n * floor) * f_safe_rcp(sum);
    for (int i = 0; i < n; i++) {
        weights[i] = floor + f_select(some, weights[i] * scale, f_set(i == 0 ? 1 - (real)n * floor : 0));
    }
}

// Adjoint of the same without a floor, from those of the n probabilities to those of the weights, in place.
KFN void principled_probabilities_adj(int n, const Float *weights, Float *d) {
    Float sum = f_set(0), mean = f_set(0);
    for (int i = 0; i < n; i++) {
        sum = sum + f_max(weights[i], f_set(0));
    }
    Float scale = f_zero_unless(m_gt(sum, f_set(1e-30f)), f_safe_rcp(sum));
    for (int i = 0; i < n; i++) {
        mean = mean + d[i] * f_max(weights[i], f_set(0)) * scale;
    }
    for (int i = 0; i < n; i++) {
        // p_i = w_i / sum_j w_j
        d[i] = f_zero_unless(m_ge(weights[i], f_set(0)), (d[i] - mean) * scale);
    }
}
