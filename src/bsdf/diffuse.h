// diffuse.h: Lambert's law. f cos = rho / pi cos_o, from the front side only [lambert1760].
#pragma once

#include "bsdf/record.h"
#include "math/warp.h"

#define DIFFUSE_PARAMS(P) P(SPEC, reflectance, 0.5f, 0, 1, "fraction of light reflected", "")
KIND_RECORD(Diffuse, DIFFUSE_PARAMS, NO_CONFIG)

KFN Spec diffuse_eval(const Diffuse *p, Vec3 wi, Vec3 wo, Int lobe) {
    Mask front = m_gt(wi.z, f_set(0)) & m_gt(wo.z, f_set(0)) & mi_eq(lobe, i_set(LOBE_SMOOTH));
    return spec_scale(p->reflectance, f_zero_unless(front, wo.z * INV_PI));
}

KFN Float diffuse_pdf(const Diffuse *p, Vec3 wi, Vec3 wo, Int lobe) {
    UNUSED(p);
    Mask front = m_gt(wi.z, f_set(0)) & m_gt(wo.z, f_set(0)) & mi_eq(lobe, i_set(LOBE_SMOOTH));
    return f_zero_unless(front, wo.z * INV_PI);
}

KFN BsdfSample diffuse_sample(const Diffuse *p, Vec3 wi, Float u1, Vec2 u2) {
    UNUSED(p);
    UNUSED(wi);
    UNUSED(u1);
    return (BsdfSample){warp_cosine_hemisphere(u2), i_set(LOBE_SMOOTH), f_set(1)};
}

KFN void diffuse_adj(const Diffuse *p, Vec3 wi, Vec3 wo, Int lobe, Spec df, Diffuse *dp, Vec3 *dwi, Vec3 *dwo) {
    UNUSED(dwi);
    // f = reflectance wo.z / pi
    Mask front = m_gt(wi.z, f_set(0)) & m_gt(wo.z, f_set(0)) & mi_eq(lobe, i_set(LOBE_SMOOTH));
    df = spec_zero_unless(front, df);
    spec_acc(&dp->reflectance, spec_scale(df, wo.z * INV_PI));
    dwo->z = dwo->z + spec_dot(df, p->reflectance) * INV_PI;
}

KFN void diffuse_pdf_adj(const Diffuse *p, Vec3 wi, Vec3 wo, Float dpdf, Diffuse *dp, Vec3 *dwi, Vec3 *dwo) {
    UNUSED(p), UNUSED(dp), UNUSED(dwi);
    // pdf = wo.z / pi
    dwo->z = dwo->z + f_zero_unless(m_gt(wi.z, f_set(0)) & m_gt(wo.z, f_set(0)), dpdf * INV_PI);
}
