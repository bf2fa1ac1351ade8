// rim.h: where rough refraction ends. GGX normals have a density even where they are seen edge-on, m.z = 0, and directions that
// would ask for normals below that are refracted by none. With the cosines c_i, c_o and e the index of the side of wo over that
// of wi's, the value  f = f_+ H(s g), g = c_i - e c_o, s = sign(1 - e),  jumps to 0 along a cone of directions that moves with
// the index, with wi and with the frame. Its derivative has, beside the slope of f_+, the part  f_+ delta(g) s g'.  Smooth
// sampling never finds it: directions on the cone are sampled apart where derivatives are asked for (LOBE_RIM). Their value is
// 0, their density counts per azimuth, of which delta(g) leaves 1 / e, and their adjoint is that part.
// What lights at a point or with one direction send through such surfaces, which no sampled direction meets, is a boundary term
// (integrator/boundary/rim_vertex.h). Beckmann's density is 0 on the rim.
#pragma once

#include "bsdf/record.h"
#include "math/microfacet.h"
#include "math/warp.h"

#define RIM_ALWAYS 1e6f // as `rim` of a call: samples of functions that have one are of it

// Probability of the rim; 0 where there is none, and small where normals hardly reach it.
KFN Float rim_share(const Microfacet *mf, Vec3 wi, Float e, real rim) {
    Mask exists = m_lt(f_abs(wi.z), e) & m_ne(wi.z, f_set(0)) & m_set(mf->ggx);
    return f_zero_unless(exists, f_min(rim * f_min(f_max(mf->alpha_u, mf->alpha_v), f_set(1)), f_set(1)));
}

KFN Vec3 rim_direction(Vec3 wi, Float e, Float u) {
    Float z = -wi.z / e, r = f_safe_sqrt(1.0f - z * z), sine, cosine;
    f_sincos(TWO_PI * u, &sine, &cosine);
    return v3(r * cosine, r * sine, z);
}

// Density of smooth directions and of the rim, in a mixture of both.
KFN Float rim_pdf(Float share, Int lobe, Float smooth) {
    return f_select(mi_eq(lobe, i_set(LOBE_RIM)), share * INV_TWO_PI, (1.0f - share) * smooth);
}

// f_+ of a white interface: (1 - F) D G |a b| / (|cos_i| (a + e b)^2) with the normal on the rim that wi's side sees.
KFN Float rim_value(const Microfacet *mf, Vec3 wi, Vec3 wo, Float eta, Float e) {
    Vec3 m = v3_normalize(v3(wi.x + e * wo.x, wi.y + e * wo.y, f_set(0)));
    m = v3_scale(m, f_sign(v3_dot(wi, m) * wi.z));
    Float a = v3_dot(wi, m), b = v3_dot(wo, m), q = a + e * b, cos_t, eta_it, eta_ti;
    Float through = 1.0f - fresnel_dielectric(a, eta, &cos_t, &eta_it, &eta_ti);
    return through * microfacet_D_raw(mf, m) * smith_G(mf, wi, wo, m) * f_abs(a * b) * f_safe_rcp(f_abs(wi.z) * q * q);
}

// Adjoint of f for directions on the rim; df: of f_+. Returns the adjoint of e.
KFN Float rim_adj(Vec3 wi, Vec3 wo, Float e, Float df, Vec3 *dwi, Vec3 *dwo) {
    // f = f_+ H(s g), g = |wi.z| - e |wo.z|
    Float dg = df * f_sign(1.0f - e) * f_safe_rcp(e);
    dwi->z = dwi->z + dg * f_sign(wi.z);
    dwo->z = dwo->z - dg * e * f_sign(wo.z);
    return -dg * f_abs(wo.z);
}
