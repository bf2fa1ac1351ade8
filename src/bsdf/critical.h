// critical.h: normals of rough interfaces for derivatives. Seen from the denser side, Fresnel's formula depends on the
// index through the refracted cosine c = sqrt(a^2 - a_c^2) / e, a = wi.m, which vanishes at the critical angle: there
// dF/d(index) grows like 1/c, and normals of a smooth density give its estimate an infinite variance, as the integral
// of (1/c)^2 c dc diverges. A part of the normals is therefore drawn with c uniform in [0, 1] and the azimuth about wi
// uniform, which has the density a / (2 pi e^2 c): the derivative over the density stays bounded. Next to the critical angle the
// digits of c^2 give out, and normals that were drawn so would be found to lie behind it, with no such density: c^2 is uniform up
// to the square of CRITICAL_LEAST on both sides of the angle.
#pragma once

#include "math/microfacet.h"
#include "math/warp.h"

#ifdef REAL_DOUBLE
#define CRITICAL_LEAST 1e-7
#else
#define CRITICAL_LEAST 2e-3f
#endif

// Share of such normals: none for pictures (floor = 0), and none where the other side's index ratio e is at least 1.
KFN Float critical_share(Float e, real floor) { return f_zero_unless(m_lt(e, f_set(1)), f_set(floor)); }

// (c e)^2 = e^2 - s^2 with the sine s between wi and m: for small e the cosines are all near 1 and have no digits left.
KFN Float critical_pdf(Vec3 wi, Vec3 m, Float e) {
    Float a = v3_dot(wi, m), s = v3_length(v3_cross(wi, m)), c2e2 = (e - s) * (e + s);
    Float least = CRITICAL_LEAST * e, ce = f_max(f_safe_sqrt(c2e2), least);
    return f_zero_unless(m_gt(c2e2, -(least * least)) & m_gt(a, f_set(0)), INV_TWO_PI * a / (e * ce));
}

KFN Vec3 critical_sample(Vec3 wi, Float e, Vec2 u) {
    const real least = CRITICAL_LEAST;
    Float c2 = f_select(m_lt(u.x, f_set(least)), 2 * least * u.x - least * least, u.x * u.x);
    Float sine, cosine, r = e * f_safe_sqrt(1.0f - c2), a = f_safe_sqrt((1.0f - r) * (1.0f + r));
    f_sincos(TWO_PI * u.y, &sine, &cosine);
    Frame frame = frame_from_normal(wi);
    return frame_to_world(&frame, v3(r * cosine, r * sine, a));
}

// Density of interface_sample; wi is on the upper side, e the index of the other side over that of wi's side.
KFN Float interface_pdf(const Microfacet *mf, Vec3 wi, Vec3 m, Float e, real floor) {
    Float pdf = microfacet_pdf(mf, wi, m);
    if (floor > 0) {
        Float share = critical_share(e, floor);
        pdf = f_lerp(pdf, critical_pdf(wi, m, e), share);
    }
    return pdf;
}

// A microfacet normal; *u1 decides how, and is uniform again afterwards. Normals below the surface have no density.
KFN Vec3 interface_sample(const Microfacet *mf, Vec3 wi, Float e, real floor, Float *u1, Vec2 u2) {
    Vec3 m = microfacet_sample(mf, wi, u2.x, u2.y);
    if (floor > 0) {
        Mask critical = warp_event(critical_share(e, floor), u1);
        m = v3_select(critical, critical_sample(wi, f_min(e, f_set(1)), u2), m);
    }
    return m;
}
