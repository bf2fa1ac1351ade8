// microfacet.h: the Beckmann and GGX distributions of microfacet normals, Smith's masking, and sampling of all normals
// or of the visible ones, with the adjoints of density and masking. Local frame, macro normal +z; anisotropic.
//
// Sampling is detached; the adjoint of the density is for pictures that depend on densities (integrator/kept.h).
#pragma once

#include "math/fresnel.h"

// The smallest roughness of a rough surface; smaller values act like this one. So the range of every roughness in the
// tables of kinds begins at 0: scenes and textures hold zeros, and below the smallest one the derivative is 0.
#define MICROFACET_ALPHA_MIN 1e-4f

typedef struct Microfacet {
    bool ggx;            // uniform; otherwise Beckmann
    bool sample_visible; // uniform
    Float alpha_u, alpha_v;
} Microfacet;

KFN Microfacet microfacet_make(bool ggx, bool sample_visible, Float alpha_u, Float alpha_v) {
    Microfacet mf;
    mf.ggx = ggx;
    mf.sample_visible = sample_visible;
    mf.alpha_u = f_max(alpha_u, f_set(MICROFACET_ALPHA_MIN));
    mf.alpha_v = f_max(alpha_v, f_set(MICROFACET_ALPHA_MIN));
    return mf;
}

// Adjoint of microfacet_make, for one of the two: accumulates what the derivative with respect to the clamped roughness
// means for the given one.
KFN void microfacet_alpha_adj(Float alpha, Float dclamped, Float *dalpha) {
    *dalpha = *dalpha + f_zero_unless(m_gt(alpha, f_set(MICROFACET_ALPHA_MIN)), dclamped);
}

// ---- density -----------------------------------------------------------------------------------------------------

// m.z where it is large enough for the density to be representable, else a number that is.
KFN Float microfacet_safe_z(Vec3 m) { return f_max(m.z, f_set(1e-5f)); }

// Without the threshold: D = 1 / (pi au av q^2) with q = x^2/au^2 + y^2/av^2 + z^2 for GGX [walter2007 eq. 33], and
// D = exp(-(x^2/au^2 + y^2/av^2) / z^2) / (pi au av z^4) for Beckmann [walter2007 eq. 25].
KFN Float microfacet_D_raw(const Microfacet *mf, Vec3 m) {
    Float z2 = f_sqr(microfacet_safe_z(m));
    Float t = f_sqr(m.x / mf->alpha_u) + f_sqr(m.y / mf->alpha_v);
    Float scale = INV_PI / (mf->alpha_u * mf->alpha_v);
    if (mf->ggx) {
        return scale / f_sqr(t + z2);
    }
    return scale * f_exp(-t / z2) / f_sqr(z2);
}

// Zero where D z is at most 1e-20, which includes m below the horizon.
KFN Mask microfacet_D_counts(Float d, Vec3 m) { return m_gt(d * m.z, f_set(1e-20f)); }

// Density of microfacet normals: area per solid angle and unit of macro area.
KFN Float microfacet_D(const Microfacet *mf, Vec3 m) {
    Float d = microfacet_D_raw(mf, m);
    return f_zero_unless(microfacet_D_counts(d, m), d);
}

// Adjoint of microfacet_D; m's coordinates are taken as three free numbers in the formulas above.
KFN void microfacet_D_adj(const Microfacet *mf, Vec3 m, Float dd, Float *dalpha_u, Float *dalpha_v, Vec3 *dm) {
    Float d = microfacet_D_raw(mf, m);
    Float g = f_zero_unless(microfacet_D_counts(d, m), dd * d);
    Float inv_u = 1.0f / mf->alpha_u, inv_v = 1.0f / mf->alpha_v;
    Float x = m.x * inv_u, y = m.y * inv_v, z = microfacet_safe_z(m);
    Float t = x * x + y * y;
    Float gt, gz; // g times the derivatives of log D with respect to t and z
    if (mf->ggx) {
        // log D = -log(au av) - 2 log(t + z^2) + const
        gt = -2.0f * g / (t + z * z);
        gz = 2.0f * gt * z;
    } else {
        // log D = -log(au av) - t / z^2 - 4 log z + const
        gt = -g / (z * z);
        gz = -2.0f * (gt * t + 2.0f * g) / z;
    }
    // t = (x / au)^2 + (y / av)^2
    *dalpha_u = *dalpha_u - (g + 2.0f * gt * x * x) * inv_u;
    *dalpha_v = *dalpha_v - (g + 2.0f * gt * y * y) * inv_v;
    v3_acc(dm, v3(2.0f * gt * x * inv_u, 2.0f * gt * y * inv_v, gz));
}

// ---- masking -----------------------------------------------------------------------------------------------------

// The coefficients of the rational fit to Beckmann's G1 [walter2007 eq. 27], written in s = |stretched tangent part|
// and c = |z|, a = c / s: G1 = (3.535 s c + 2.181 c^2) / (s^2 + 2.276 s c + 2.577 c^2) where a < 1.6, else 1.
KFN Float microfacet_beckmann_denominator(Float s, Float c) { return s * s + (2.276f * s + 2.577f * c) * c; }
KFN Mask microfacet_beckmann_masks(Float s, Float c) { return m_lt(c, 1.6f * s); }

// A direction with an opposite sign of z to its own side of m sees none of m: zero.
KFN Mask smith_G1_counts(Vec3 v, Vec3 m) { return m_gt(v3_dot(v, m) * v.z, f_set(0)); }

// Smith's masking for one direction [walter2007 eq. 34 for GGX, eq. 27 for Beckmann].
KFN Float smith_G1(const Microfacet *mf, Vec3 v, Vec3 m) {
    Float c = f_abs(v.z);
    Float s2 = f_sqr(mf->alpha_u * v.x) + f_sqr(mf->alpha_v * v.y);
    Float g;
    if (mf->ggx) {
        // 2 / (1 + sqrt(1 + s^2/c^2))
        g = 2.0f * c * f_safe_rcp(c + f_sqrt(s2 + c * c));
    } else {
        Float s = f_sqrt(s2);
        g = (3.535f * s + 2.181f * c) * c * f_safe_rcp(microfacet_beckmann_denominator(s, c));
        g = f_select(microfacet_beckmann_masks(s, c), g, f_set(1));
    }
    return f_zero_unless(smith_G1_counts(v, m), g);
}

// Adjoint of smith_G1. m enters only through the sides, so it gets none.
KFN void smith_G1_adj(const Microfacet *mf, Vec3 v, Vec3 m, Float dg, Float *dalpha_u, Float *dalpha_v, Vec3 *dv) {
    Float c = f_abs(v.z);
    Float x = mf->alpha_u * v.x, y = mf->alpha_v * v.y;
    Float s2 = x * x + y * y;
    Float h, dh, dc; // x and y enter through h: sqrt(s2 + c^2) for GGX, sqrt(s2) for Beckmann
    dg = f_zero_unless(smith_G1_counts(v, m), dg);
    if (mf->ggx) {
        // G = 2 c / (c + h), h = sqrt(s2 + c^2); the derivative by c, h's part included, is 2 s2 / (h (c + h)^2)
        h = f_sqrt(s2 + c * c);
        Float r2 = f_sqr(f_safe_rcp(c + h));
        dh = -2.0f * dg * c * r2;
        dc = 2.0f * dg * s2 * r2 * f_safe_rcp(h);
    } else {
        // G = (3.535 s c + 2.181 c^2) / M, M = s^2 + 2.276 s c + 2.577 c^2, or 1: a function of s / c alone, with
        // dG/ds = -c w / M^2 and dG/dc = s w / M^2, w = 3.535 s^2 + 4.362 s c - (3.535 2.577 - 2.181 2.276) c^2
        h = f_sqrt(s2);
        dg = f_zero_unless(microfacet_beckmann_masks(h, c), dg);
        Float w = (3.535f * h + 4.362f * c) * h - 4.145739f * c * c;
        w = dg * w * f_sqr(f_safe_rcp(microfacet_beckmann_denominator(h, c)));
        dh = -c * w;
        dc = h * w;
    }
    // h dh = au^2 vx dvx + av^2 vy dvy + ..., c = |vz|
    Float k = dh * f_safe_rcp(h);
    *dalpha_u = *dalpha_u + k * x * v.x;
    *dalpha_v = *dalpha_v + k * y * v.y;
    v3_acc(dv, v3(k * x * mf->alpha_u, k * y * mf->alpha_v, f_select(m_lt(v.z, f_set(0)), -dc, dc)));
}

// Separable masking and shadowing.
KFN Float smith_G(const Microfacet *mf, Vec3 wi, Vec3 wo, Vec3 m) { return smith_G1(mf, wi, m) * smith_G1(mf, wo, m); }

// ---- sampling ----------------------------------------------------------------------------------------------------

// Area of the microsurface projected on the direction wi (wi.z > 0), per unit of macro area, all backfacing parts left
// out: the exact normalisation of the visible normals. Beckmann's differs by up to 0.35 % from wi.z / smith_G1, which
// is a fit; the sampler draws from the exact one.
KFN Float microfacet_projected_area(const Microfacet *mf, Vec3 wi) {
    Float s2 = f_sqr(mf->alpha_u * wi.x) + f_sqr(mf->alpha_v * wi.y);
    if (mf->ggx) {
        return 0.5f * (wi.z + f_sqrt(s2 + wi.z * wi.z)); // [heitz2014 eq. 72]
    }
    // c (1 + erf a) / 2 + s exp(-a^2) / (2 sqrt pi), a = c / s  [heitz2014 eq. 66]
    Float s = f_sqrt(s2);
    Float a = f_min(wi.z * f_safe_rcp(s), f_set(9));
    a = f_select(m_gt(s, f_set(1e-30f)), a, f_set(9));
    return 0.5f * (wi.z * (1.0f + f_erf(a)) + s * f_exp(-a * a) * (1.0f / SQRT_PI));
}

// Density per solid angle of microfacet_sample. wi must be on the upper side (zero otherwise).
KFN Float microfacet_pdf(const Microfacet *mf, Vec3 wi, Vec3 m) {
    Float d = microfacet_D(mf, m);
    if (!mf->sample_visible) {
        return d * f_max(m.z, f_set(0));
    }
    Mask up = m_gt(wi.z, f_set(0));
    Float area = microfacet_projected_area(mf, v3_select(up, wi, v3(f_set(0), f_set(0), f_set(1))));
    return f_zero_unless(up, d * f_max(v3_dot(wi, m), f_set(0)) / area);
}

// Adjoint of microfacet_projected_area.
KFN void microfacet_projected_area_adj(const Microfacet *mf, Vec3 wi, Float da, Float *dalpha_u, Float *dalpha_v,
                                       Vec3 *dwi) {
    Float x = mf->alpha_u * wi.x, y = mf->alpha_v * wi.y, s2 = x * x + y * y, k, dc;
    if (mf->ggx) {
        // A = (c + r) / 2, r^2 = s^2 + c^2
        Float r = f_safe_rcp(f_sqrt(s2 + wi.z * wi.z));
        k = 0.5f * da * r;
        dc = 0.5f * da * (1.0f + wi.z * r);
    } else {
        // dA/dc = (1 + erf a) / 2, dA/ds = exp(-a^2) / (2 sqrt pi): what a = c / s brings cancels
        Float s = f_sqrt(s2), a = f_min(wi.z * f_safe_rcp(s), f_set(9));
        a = f_select(m_gt(s, f_set(1e-30f)), a, f_set(9));
        k = 0.5f * da * f_exp(-a * a) * (1.0f / SQRT_PI) * f_safe_rcp(s);
        dc = 0.5f * da * (1.0f + f_erf(a));
    }
    // s ds = au^2 x dx + av^2 y dy + ...
    *dalpha_u = *dalpha_u + k * x * wi.x;
    *dalpha_v = *dalpha_v + k * y * wi.y;
    v3_acc(dwi, v3(k * x * mf->alpha_u, k * y * mf->alpha_v, dc));
}

// Adjoint of microfacet_pdf.
KFN void microfacet_pdf_adj(const Microfacet *mf, Vec3 wi, Vec3 m, Float dpdf, Float *dalpha_u, Float *dalpha_v, Vec3 *dwi,
                            Vec3 *dm) {
    Float d = microfacet_D(mf, m);
    if (!mf->sample_visible) {
        // D m.z
        microfacet_D_adj(mf, m, dpdf * f_max(m.z, f_set(0)), dalpha_u, dalpha_v, dm);
        dm->z = dm->z + dpdf * d;
        return;
    }
    // D (wi . m) / A(wi)
    Float cosine = v3_dot(wi, m);
    Mask seen = m_gt(wi.z, f_set(0)) & m_gt(cosine, f_set(0));
    Vec3 up = v3_select(seen, wi, v3(f_set(0), f_set(0), f_set(1)));
    Float rcp = 1.0f / microfacet_projected_area(mf, up), k = f_zero_unless(seen, dpdf) * rcp;
    microfacet_D_adj(mf, m, k * cosine, dalpha_u, dalpha_v, dm);
    microfacet_projected_area_adj(mf, up, -k * d * cosine * rcp, dalpha_u, dalpha_v, dwi);
    v3_acc(dwi, v3_scale(m, k * d));
    v3_acc(dm, v3_scale(wi, k * d));
}

// Adjoint of the half vector normalize(wi + wo).
KFN void half_vector_adj(Vec3 wi, Vec3 wo, Vec3 dm, Vec3 *dwi, Vec3 *dwo) {
    Vec3 dh = v3_zero();
    v3_normalize_adj(v3_add(wi, wo), dm, &dh);
    v3_acc(dwi, dh);
    v3_acc(dwo, dh);
}

// Adjoint of microfacet_pdf(wi, m) / (4 wo . m), m the half vector: of the density of mirrored directions wo.
KFN void microfacet_mirrored_pdf_adj(const Microfacet *mf, Vec3 wi, Vec3 wo, Float dpdf, Float *dalpha_u, Float *dalpha_v,
                                     Vec3 *dwi, Vec3 *dwo) {
    Vec3 m = v3_normalize(v3_add(wi, wo)), dm = v3_zero();
    Float rcp = f_safe_rcp(v3_dot(wo, m)), k = 0.25f * dpdf * rcp, dcosine = -k * microfacet_pdf(mf, wi, m) * rcp;
    microfacet_pdf_adj(mf, wi, m, k, dalpha_u, dalpha_v, dwi, &dm);
    v3_acc(dwo, v3_scale(m, dcosine));
    v3_acc(&dm, v3_scale(wo, dcosine));
    half_vector_adj(wi, wo, dm, dwi, dwo);
}

// All normals, with density D m.z [walter2007 eq. 28, 29, 35, 36].
KFN Vec3 microfacet_sample_all(const Microfacet *mf, Float u1, Float u2) {
    Float sine, cosine;
    f_sincos(TWO_PI * u2, &sine, &cosine);
    Float r2 = mf->ggx ? u1 / (1.0f - u1) : f_max(-f_log(1.0f - u1), f_set(0));
    Float r = f_sqrt(r2);
    return v3_normalize(v3(mf->alpha_u * r * cosine, mf->alpha_v * r * sine, f_set(1)));
}

// Visible normals of GGX: in the stretched space where the surface is a hemisphere, mirrored directions fill a
// spherical cap uniformly [dupuy2023 listing 3], the same density as [heitz2018] with fewer operations.
KFN Vec3 microfacet_sample_visible_ggx(const Microfacet *mf, Vec3 wi, Float u1, Float u2) {
    Vec3 v = v3_normalize(v3(mf->alpha_u * wi.x, mf->alpha_v * wi.y, wi.z));
    Float sine, cosine;
    f_sincos(TWO_PI * u1, &sine, &cosine);
    // cos = (1 - u2)(1 + v.z) - v.z, so 1 - cos = u2 (1 + v.z)
    Float k = u2 * (1.0f + v.z);
    Float r = f_safe_sqrt(k * (2.0f - k));
    return v3_normalize(v3(mf->alpha_u * (r * cosine + v.x), mf->alpha_v * (r * sine + v.y), (1.0f - u2) * (1.0f + v.z)));
}

// Slope x of a visible Beckmann normal of unit roughness seen from (s, 0, c): the root of
// (c (1 + erf x) + s exp(-x^2) / sqrt pi) / 2 = u area [heitz2014b], in the variable b = erf x, in which the left side
// is smooth and its derivative (c - s x) / 2 [jakob2014]. Bracketed Newton steps: never outside, bisection if it would.
KFN Float microfacet_beckmann_slope(Float s, Float c, Float u) {
    Float a = f_min(c / f_max(s, f_set(1e-9f)), f_set(9));
    Float b_max = f_erf(a);
    Float target = u * (c * (1.0f + b_max) + s * f_exp(-a * a) * (1.0f / SQRT_PI));
    // First guess [jakob2014]
    Float theta = f_acos(c);
    Float fit = 1.0f + theta * (-0.876f + theta * (0.4265f - 0.0594f * theta));
    Float low = f_set(-1), high = b_max;
    Float b = b_max - (1.0f + b_max) * f_pow(1.0f - u, fit);
    Float x = f_set(0);
    for (int i = 0; i < 6; i++) {
        b = f_select(m_ge(b, low) & m_le(b, high), b, 0.5f * (low + high));
        x = f_min(f_erfinv(b), a);
        Float error = c * (1.0f + b) + s * f_exp(-x * x) * (1.0f / SQRT_PI) - target;
        Mask above = m_gt(error, f_set(0));
        high = f_select(above, b, high);
        low = f_select(above, low, b);
        b = b - error / f_max(c - s * x, f_set(1e-7f));
    }
    b = f_clamp(b, low, high);
    return f_min(f_erfinv(b), a);
}

KFN Vec3 microfacet_sample_visible_beckmann(const Microfacet *mf, Vec3 wi, Float u1, Float u2) {
    Vec3 v = v3_normalize(v3(mf->alpha_u * wi.x, mf->alpha_v * wi.y, wi.z));
    Float s = f_sqrt(v.x * v.x + v.y * v.y), inv_s = f_safe_rcp(s);
    Float cosine = f_select(m_gt(s, f_set(1e-30f)), v.x * inv_s, f_set(1)), sine = v.y * inv_s;
    Float x = microfacet_beckmann_slope(s, v.z, u1);
    Float y = f_erfinv(2.0f * u2 - 1.0f);
    return v3_normalize(v3(-mf->alpha_u * (cosine * x - sine * y), -mf->alpha_v * (sine * x + cosine * y), f_set(1)));
}

// A microfacet normal with density microfacet_pdf; wi must be on the upper side.
KFN Vec3 microfacet_sample(const Microfacet *mf, Vec3 wi, Float u1, Float u2) {
    if (!mf->sample_visible) {
        return microfacet_sample_all(mf, u1, u2);
    }
    wi = v3_select(m_gt(wi.z, f_set(0)), wi, v3(f_set(0), f_set(0), f_set(1)));
    if (mf->ggx) {
        return microfacet_sample_visible_ggx(mf, wi, u1, u2);
    }
    return microfacet_sample_visible_beckmann(mf, wi, u1, u2);
}
