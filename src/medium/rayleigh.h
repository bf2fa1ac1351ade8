// rayleigh.h: molecules, p = 3 / (16 pi) (1 + cos^2) [rayleigh1871].
#pragma once

#include "medium/phase_record.h"

PHASE_RECORD(Rayleigh, NO_PHASE_PARAMS)

#define RAYLEIGH_NORM (0.75f * INV_FOUR_PI)

KFN Float rayleigh_eval(const Rayleigh *p, Vec3 wi, Vec3 wo) {
    UNUSED(p);
    Float cosine = phase_cosine(wi, wo);
    return RAYLEIGH_NORM * (1.0f + cosine * cosine);
}

KFN Float rayleigh_pdf(const Rayleigh *p, Vec3 wi, Vec3 wo) { return rayleigh_eval(p, wi, wo); }

KFN Vec3 rayleigh_sample(const Rayleigh *p, Vec3 wi, Float u1, Vec2 u2) {
    UNUSED(p), UNUSED(u1);
    // cos^3 + 3 cos = 2 z with z = 4 u - 2, by Cardano's formula; of its two roots one is minus the inverse of the other.
    Float z = 4.0f * u2.x - 2.0f;
    Float root = f_exp(f_log(f_abs(z) + f_sqrt(z * z + 1.0f)) * (1.0f / 3.0f));
    Float cosine = f_copysign(root - 1.0f / root, z);
    return phase_direction(wi, f_clamp(cosine, f_set(-1), f_set(1)), u2.y);
}

KFN void rayleigh_adj(const Rayleigh *p, Vec3 wi, Vec3 wo, Float df, Rayleigh *dp, Vec3 *dwi, Vec3 *dwo) {
    UNUSED(p), UNUSED(dp);
    // p = n (1 + cos^2)
    phase_cosine_adj(wi, wo, 2.0f * RAYLEIGH_NORM * df * phase_cosine(wi, wo), dwi, dwo);
}
