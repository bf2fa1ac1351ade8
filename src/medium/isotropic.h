// isotropic.h: all directions alike, p = 1 / 4 pi.
#pragma once

#include "math/warp.h"
#include "medium/phase_record.h"

PHASE_RECORD(Isotropic, NO_PHASE_PARAMS)

KFN Float isotropic_eval(const Isotropic *p, Vec3 wi, Vec3 wo) {
    UNUSED(p), UNUSED(wi), UNUSED(wo);
    return f_set(INV_FOUR_PI);
}

KFN Float isotropic_pdf(const Isotropic *p, Vec3 wi, Vec3 wo) { return isotropic_eval(p, wi, wo); }

KFN Vec3 isotropic_sample(const Isotropic *p, Vec3 wi, Float u1, Vec2 u2) {
    UNUSED(p), UNUSED(wi), UNUSED(u1);
    return warp_uniform_sphere(u2);
}

KFN void isotropic_adj(const Isotropic *p, Vec3 wi, Vec3 wo, Float df, Isotropic *dp, Vec3 *dwi, Vec3 *dwo) {
    UNUSED(p), UNUSED(wi), UNUSED(wo), UNUSED(df), UNUSED(dp), UNUSED(dwi), UNUSED(dwo);
}
