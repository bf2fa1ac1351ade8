// hg.h: p = (1 - g^2) / (4 pi (1 + g^2 - 2 g cos)^(3/2)) [henyey1941]; forward for g > 0.
#pragma once

#include "medium/phase_record.h"

#define HG_PARAMS(P) P(NUMBER, g, 0.8f, -0.999f, 0.999f, "mean cosine of the angle of scattering")
PHASE_RECORD(Hg, HG_PARAMS)

// The bracket, as (1 - g)^2 + 2 g (1 - cos), which keeps its digits in narrow forward peaks.
KFN Float hg_bracket(Float g, Float cosine) { return f_max(f_sqr(1.0f - g) + 2.0f * g * (1.0f - cosine), f_set(1e-7f)); }

KFN Float hg_eval(const Hg *p, Vec3 wi, Vec3 wo) {
    Float b = hg_bracket(p->g, phase_cosine(wi, wo));
    return INV_FOUR_PI * (1.0f - p->g * p->g) / (b * f_sqrt(b));
}

KFN Float hg_pdf(const Hg *p, Vec3 wi, Vec3 wo) { return hg_eval(p, wi, wo); }

KFN Vec3 hg_sample(const Hg *p, Vec3 wi, Float u1, Vec2 u2) {
    UNUSED(u1);
    // The inverse of the distribution, cos = (1 + a^2 - ((1 - a^2) / s)^2) / 2 a with a = |g| and s = 1 - a + 2 a u, as the
    // difference from 1: 1 - cos = (1 - a)^2 (1 - u) (1 + a + s) / s^2, in which nothing cancels and nothing is divided by g.
    Mask forward = m_ge(p->g, f_set(0));
    Float a = f_abs(p->g), u = f_select(forward, u2.x, 1.0f - u2.x);
    Float s = (1.0f - a) + 2.0f * a * u, ratio = (1.0f - a) / s;
    Float h = f_clamp(ratio * ratio * (1.0f - u) * (1.0f + a + s), f_set(0), f_set(2));
    return phase_direction_at(wi, f_select(forward, 1.0f - h, h - 1.0f), f_safe_sqrt(h * (2.0f - h)), u2.y);
}

KFN void hg_adj(const Hg *p, Vec3 wi, Vec3 wo, Float df, Hg *dp, Vec3 *dwi, Vec3 *dwo) {
    Float g = p->g, cosine = phase_cosine(wi, wo), b = hg_bracket(g, cosine);
    Float power = INV_FOUR_PI / (b * f_sqrt(b)), dpower = -1.5f * (1.0f - g * g) * power / b;
    // p = (1 - g^2) b^(-3/2) / 4 pi, b = (1 - g)^2 + 2 g (1 - cos)
    dp->g = dp->g + df * (-2.0f * g * power + dpower * (2.0f * g - 2.0f * cosine));
    phase_cosine_adj(wi, wo, -2.0f * g * df * dpower, dwi, dwo);
}
