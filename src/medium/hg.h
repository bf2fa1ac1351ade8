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
    // The inverse of the distribution, (1 + g^2 - ((1 - g^2) / (1 + g q))^2) / 2 g with q = 2 u - 1, multiplied out so that
    // nothing is divided by g.
    Float g = p->g, q = 2.0f * u2.x - 1.0f, g2 = g * g;
    Float above = q * (1.0f + g2) + 0.5f * g * (q * q * (1.0f + g2) + 3.0f - g2);
    return phase_direction(wi, f_clamp(above / f_sqr(1.0f + g * q), f_set(-1), f_set(1)), u2.y);
}

KFN void hg_adj(const Hg *p, Vec3 wi, Vec3 wo, Float df, Hg *dp, Vec3 *dwi, Vec3 *dwo) {
    Float g = p->g, cosine = phase_cosine(wi, wo), b = hg_bracket(g, cosine);
    Float power = INV_FOUR_PI / (b * f_sqrt(b)), dpower = -1.5f * (1.0f - g * g) * power / b;
    // p = (1 - g^2) b^(-3/2) / 4 pi, b = (1 - g)^2 + 2 g (1 - cos)
    dp->g = dp->g + df * (-2.0f * g * power + dpower * (2.0f * g - 2.0f * cosine));
    phase_cosine_adj(wi, wo, -2.0f * g * df * dpower, dwi, dwo);
}
