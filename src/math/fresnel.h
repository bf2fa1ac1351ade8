// fresnel.h: reflectance of smooth interfaces, exact and unpolarised, with the directions that go with it.
#pragma once

#include "math/vec.h"

// What both the dielectric formula and its adjoint need, on the incident side's terms: eta_it is (index of the other side)
// over (index of the side that the light comes from).
typedef struct DielectricTerms {
    Mask outside;      // incidence from the side of index 1
    Mask total;        // total internal reflection
    Float ci, ct;      // |cos| on both sides; ct = 0 in total reflection
    Float eta_it, eta_ti;
    Float rs, rp;      // amplitude ratios, up to sign
    Float inv_s, inv_p; // reciprocals of their denominators
} DielectricTerms;

KFN DielectricTerms fresnel_dielectric_terms(Float cos_i, Float eta) {
    DielectricTerms d;
    Float inv_eta = 1.0f / eta;
    d.outside = m_ge(cos_i, f_set(0));
    d.eta_it = f_select(d.outside, eta, inv_eta);
    d.eta_ti = f_select(d.outside, inv_eta, eta);
    d.ci = f_abs(cos_i);
    // Snell: ct^2 = 1 - (1 - ci^2) / eta_it^2, in a form that keeps its digits where eta is near 1 and at grazing angles.
    Float q = (d.eta_it - 1.0f) * (d.eta_it + 1.0f) + d.ci * d.ci;
    d.total = m_le(q, f_set(0)) & m_ne(d.eta_it, f_set(1));
    d.ct = f_safe_sqrt(q) * d.eta_ti;
    d.inv_s = f_safe_rcp(d.ci + d.eta_it * d.ct);
    d.inv_p = f_safe_rcp(d.ct + d.eta_it * d.ci);
    d.rs = (d.ci - d.eta_it * d.ct) * d.inv_s;
    d.rp = (d.ct - d.eta_it * d.ci) * d.inv_p;
    return d;
}

// Reflectance of a dielectric interface [walter2007 eq. 22]. cos_i is signed (positive on the side of index 1, from which
// eta is the relative index of the other side); *cos_t gets the cosine of the refracted direction, of opposite sign, and
// 0 in total internal reflection (F = 1). eta = 1 is no interface: F = 0.
KFN Float fresnel_dielectric(Float cos_i, Float eta, Float *cos_t, Float *eta_it, Float *eta_ti) {
    DielectricTerms d = fresnel_dielectric_terms(cos_i, eta);
    Float f = 0.5f * (d.rs * d.rs + d.rp * d.rp);
    f = f_select(d.total, f_set(1), f);
    *cos_t = f_select(d.outside, -d.ct, d.ct);
    *eta_it = d.eta_it;
    *eta_ti = d.eta_ti;
    return f_zero_unless(m_ne(d.eta_it, f_set(1)), f);
}

// Adjoint of (F, cos_t). The derivative is unbounded at the critical angle, and zero beyond it.
KFN void fresnel_dielectric_adj(Float cos_i, Float eta, Float df, Float dcos_t, Float *dcos_i, Float *deta) {
    DielectricTerms d = fresnel_dielectric_terms(cos_i, eta);
    // F = (rs^2 + rp^2) / 2, rs = (ci - e ct) / (ci + e ct), rp = (ct - e ci) / (ct + e ci), e = eta_it
    Float s = 2.0f * df * d.rs * f_sqr(d.inv_s), p = 2.0f * df * d.rp * f_sqr(d.inv_p);
    Float dci = d.eta_it * d.ct * (s - p);
    Float dct = d.eta_it * d.ci * (p - s) + f_select(d.outside, -dcos_t, dcos_t);
    Float de = -d.ci * d.ct * (s + p);
    // ct = sqrt(e^2 - 1 + ci^2) / e
    Float g = dct * f_safe_rcp(d.ct) * f_sqr(d.eta_ti);
    dci = dci + g * d.ci;
    de = de + g * (1.0f - d.ci) * (1.0f + d.ci) * d.eta_ti;
    // e = eta outside, 1 / eta inside; ci = |cos_i|
    Float deta_here = f_select(d.outside, de, -de * f_sqr(d.eta_it));
    Float dcos_here = f_select(d.outside, dci, -dci);
    *deta = *deta + f_zero_unless(~d.total, deta_here);
    *dcos_i = *dcos_i + f_zero_unless(~d.total, dcos_here);
}

// One channel of a conductor's reflectance: the terms of sqrt((eta + i k)^2 - sin^2) = a + i b.
typedef struct ConductorTerms {
    Float c, c2, s2; // |cos_i|, its square, 1 - its square
    Float t, w;      // real and imaginary part under the root
    Float m;         // |t + i w| = a^2 + b^2
    Float a, b;
} ConductorTerms;

KFN ConductorTerms fresnel_conductor_terms(Float cos_i, Float eta, Float k) {
    ConductorTerms d;
    d.c = f_min(f_abs(cos_i), f_set(1));
    d.c2 = d.c * d.c;
    d.s2 = (1.0f - d.c) * (1.0f + d.c);
    d.t = (eta - k) * (eta + k) - d.s2;
    d.w = 2.0f * eta * k;
    d.m = f_sqrt(d.t * d.t + d.w * d.w);
    // The larger of a and b from the half-angle formula, the other one from w = 2 a b: no cancellation.
    Float large = f_sqrt(0.5f * (d.m + f_abs(d.t)));
    Float small = 0.5f * d.w * f_safe_rcp(large);
    Mask positive = m_ge(d.t, f_set(0));
    d.a = f_select(positive, large, small);
    d.b = f_select(positive, small, large);
    return d;
}

// Reflectance of a conductor with index eta + i k, exact and unpolarised [born1999 section 14.2]:
// Rs = (m + c^2 - 2 a c) / (m + c^2 + 2 a c), Rp = Rs (m c^2 + s^4 - 2 a c s^2) / (m c^2 + s^4 + 2 a c s^2).
KFN Float fresnel_conductor_one(Float cos_i, Float eta, Float k) {
    ConductorTerms d = fresnel_conductor_terms(cos_i, eta, k);
    Float v = 2.0f * d.a * d.c, u = d.m + d.c2, q = d.m * d.c2 + d.s2 * d.s2, r = v * d.s2;
    Float rs = (u - v) * f_safe_rcp(u + v);
    Float ratio = (q - r) * f_safe_rcp(q + r);
    return 0.5f * rs * (1.0f + ratio);
}

KFN void fresnel_conductor_one_adj(Float cos_i, Float eta, Float k, Float df, Float *dcos_i, Float *deta, Float *dk) {
    ConductorTerms d = fresnel_conductor_terms(cos_i, eta, k);
    Float v = 2.0f * d.a * d.c, u = d.m + d.c2, q = d.m * d.c2 + d.s2 * d.s2, r = v * d.s2;
    Float inv_uv = f_safe_rcp(u + v), inv_qr = f_safe_rcp(q + r);
    Float rs = (u - v) * inv_uv, ratio = (q - r) * inv_qr;
    // F = rs (1 + ratio) / 2
    Float drs = 0.5f * df * (1.0f + ratio), dratio = 0.5f * df * rs;
    // ratio = (q - r) / (q + r)
    Float dq = 2.0f * dratio * r * f_sqr(inv_qr), dr = -2.0f * dratio * q * f_sqr(inv_qr);
    // rs = (u - v) / (u + v), r = v s2
    Float du = 2.0f * drs * v * f_sqr(inv_uv), dv = -2.0f * drs * u * f_sqr(inv_uv) + dr * d.s2;
    // u = m + c2, q = m c2 + s2^2, v = 2 a c
    Float dm = du + dq * d.c2, ds2 = dr * v + 2.0f * dq * d.s2, dc2 = du + dq * d.m;
    Float da = 2.0f * d.c * dv, dc = 2.0f * d.a * dv;
    // m = |t + i w|, a + i b = sqrt(t + i w): d(a) = (a dt + b dw) / (2 m)
    Float inv_m = f_safe_rcp(d.m);
    Float dt = (dm * d.t + 0.5f * da * d.a) * inv_m, dw = (dm * d.w + 0.5f * da * d.b) * inv_m;
    // t = eta^2 - k^2 - s2, w = 2 eta k, s2 = 1 - c2
    *deta = *deta + 2.0f * (dt * eta + dw * k);
    *dk = *dk + 2.0f * (dw * eta - dt * k);
    dc2 = dc2 - ds2 + dt;
    *dcos_i = *dcos_i + f_sign(cos_i) * (dc + 2.0f * d.c * dc2);
}

KFN Spec fresnel_conductor(Float cos_i, Spec eta, Spec k) {
    Spec f;
    for (int i = 0; i < SPEC_N; i++) {
        f.c[i] = fresnel_conductor_one(cos_i, eta.c[i], k.c[i]);
    }
    return f;
}

KFN void fresnel_conductor_adj(Float cos_i, Spec eta, Spec k, Spec df, Float *dcos_i, Spec *deta, Spec *dk) {
    for (int i = 0; i < SPEC_N; i++) {
        fresnel_conductor_one_adj(cos_i, eta.c[i], k.c[i], df.c[i], dcos_i, &deta->c[i], &dk->c[i]);
    }
}

// The fit for eta > 1, a polynomial in x = 1 / eta, and its slope in x.
KFN Float fresnel_diffuse_above(Float x, Float *slope) {
    const float coefficients[5] = {4.98554f, -7.80989f, 6.75335f, -3.4793f, 0.919317f};
    Float p = f_set(-1.36881f), dp = f_set(0);
    for (int i = 0; i < 5; i++) {
        dp = dp * x + p;
        p = p * x + coefficients[i];
    }
    *slope = dp;
    return p;
}

// The fit for eta < 1 exceeds 1 below 0.26. Below this index it is carried on, without a step, by the relation with the
// other side, 1 - R(eta) = eta^2 (1 - R(1 / eta)), which follows from the conservation of etendue.
#define FRESNEL_DIFFUSE_LEAST 0.4f
#define FRESNEL_DIFFUSE_MATCH 0.95847f

// Reflectance of a smooth dielectric under uniform diffuse light from the side of index 1, polynomial fits:
// eta < 1 [egan1973], eta > 1 [deon2011 eq. 5 and 6]. The light from inside a body of index n sees eta = 1 / n.
KFN Float fresnel_diffuse_reflectance(Float eta) {
    Mask low = m_lt(eta, f_set(FRESNEL_DIFFUSE_LEAST));
    Float x = 1.0f / eta, slope, above = fresnel_diffuse_above(f_select(low, eta, x), &slope);
    Float below = (eta * -1.4399f + 0.7099f) * eta + 0.6681f + 0.0636f * x;
    below = f_select(low, 1.0f - FRESNEL_DIFFUSE_MATCH * eta * eta * (1.0f - above), below);
    return f_select(m_lt(eta, f_set(1)), below, above);
}

KFN void fresnel_diffuse_reflectance_adj(Float eta, Float dr, Float *deta) {
    Mask low = m_lt(eta, f_set(FRESNEL_DIFFUSE_LEAST));
    Float x = 1.0f / eta, slope, above = fresnel_diffuse_above(f_select(low, eta, x), &slope);
    // below = -1.4399 eta^2 + 0.7099 eta + 0.6681 + 0.0636 / eta, or 1 - match eta^2 (1 - above(eta))
    Float below = 2.0f * -1.4399f * eta + 0.7099f - 0.0636f * x * x;
    below = f_select(low, FRESNEL_DIFFUSE_MATCH * eta * (eta * slope - 2.0f * (1.0f - above)), below);
    // above = polynomial in x = 1 / eta
    *deta = *deta + dr * f_select(m_lt(eta, f_set(1)), below, -slope * x * x);
}

// The mirror direction of wi about m.
KFN Vec3 reflect(Vec3 wi, Vec3 m) { return v3_sub(v3_scale(m, 2.0f * v3_dot(wi, m)), wi); }

// The refracted direction, with cos_t and eta_ti as fresnel_dielectric(wi . m, ...) gives them.
KFN Vec3 refract(Vec3 wi, Vec3 m, Float cos_t, Float eta_ti) {
    return v3_sub(v3_scale(m, v3_dot(wi, m) * eta_ti + cos_t), v3_scale(wi, eta_ti));
}

// (1 - x)^5 clamped to [0, 1] [schlick1994 eq. 15].
KFN Float schlick_weight(Float x) { return f_pow5(f_clamp(1.0f - x, f_set(0), f_set(1))); }

KFN void schlick_weight_adj(Float x, Float dw, Float *dx) {
    Float c = f_clamp(1.0f - x, f_set(0), f_set(1));
    *dx = *dx - f_zero_unless(m_ge(x, f_set(0)), 5.0f * f_sqr(f_sqr(c)) * dw);
}
