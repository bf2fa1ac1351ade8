// normalmap.h: scattering about normals read from a texture, n = normalize(2 c - 1) in the shading frame.
#pragma once

#include "bsdf/turned.h"

#define NORMALMAP_PARAMS(P)                                                                                            \
    P(NORMAL, normalmap, 0.5f, -INFINITY, INFINITY, "normals in the shading frame, (n + 1) / 2", "required")
#define TURNED_CONFIG(C)                                                                                               \
    C(flip_invalid_normals, 1, "false|true", "mirror normals that face away from the viewer")                          \
    C(use_shadowing_function, 1, "false|true", "soften the edge of the light by shadowing")
KIND_RECORD(NormalMap, NORMALMAP_PARAMS, TURNED_CONFIG)

KFN Vec3 normalmap_encoded(const NormalMap *p) {
    return v3(2.0f * p->normalmap.c[0] - 1.0f, 2.0f * p->normalmap.c[1] - 1.0f, 2.0f * p->normalmap.c[2] - 1.0f);
}

KFN Vec3 normalmap_normal(const NormalMap *p, Vec3 wi) {
    return turned_valid(v3_normalize(normalmap_encoded(p)), wi, p->flip_invalid_normals);
}

KFN void normalmap_normal_adj(const NormalMap *p, Vec3 wi, Vec3 dvalid, NormalMap *dp) {
    Vec3 encoded = normalmap_encoded(p), n = v3_normalize(encoded), dencoded = v3_zero();
    // valid = (+-x, +-y, z) of n = normalize(2 c - 1)
    v3_normalize_adj(encoded, turned_valid_adj(n, wi, p->flip_invalid_normals, dvalid), &dencoded);
    dp->normalmap.c[0] = dp->normalmap.c[0] + 2.0f * dencoded.x;
    dp->normalmap.c[1] = dp->normalmap.c[1] + 2.0f * dencoded.y;
    dp->normalmap.c[2] = dp->normalmap.c[2] + 2.0f * dencoded.z;
}

KFN Spec normalmap_eval(const BsdfCall *call, const NormalMap *p, Vec3 wi, Vec3 wo, Int lobe) {
    return turned_eval(call, normalmap_normal(p, wi), p->use_shadowing_function, wi, wo, lobe);
}

KFN Float normalmap_pdf(const BsdfCall *call, const NormalMap *p, Vec3 wi, Vec3 wo, Int lobe) {
    return turned_pdf(call, normalmap_normal(p, wi), wi, wo, lobe);
}

KFN BsdfSample normalmap_sample(const BsdfCall *call, const NormalMap *p, Vec3 wi, Float u1, Vec2 u2) {
    return turned_sample(call, normalmap_normal(p, wi), wi, u1, u2);
}

KFN void normalmap_adj(const BsdfCall *call, const NormalMap *p, Vec3 wi, Vec3 wo, Int lobe, Spec df, Sink *sink, Mask m,
                       NormalMap *dp, Vec3 *dwi, Vec3 *dwo, Vec2 *duv) {
    Vec3 dvalid = v3_zero();
    turned_watch(v3_normalize(normalmap_encoded(p)), wi, p->flip_invalid_normals, sink, m);
    turned_adj(call, normalmap_normal(p, wi), p->use_shadowing_function, wi, wo, lobe, df, sink, m, &dvalid, dwi, dwo, duv);
    normalmap_normal_adj(p, wi, dvalid, dp);
}

KFN void normalmap_pdf_adj(const BsdfCall *call, const NormalMap *p, Vec3 wi, Vec3 wo, Float dpdf, Sink *sink, Mask m,
                           NormalMap *dp, Vec3 *dwi, Vec3 *dwo, Vec2 *duv) {
    Vec3 dvalid = v3_zero();
    turned_pdf_adj(call, normalmap_normal(p, wi), wi, wo, dpdf, sink, m, &dvalid, dwi, dwo, duv);
    normalmap_normal_adj(p, wi, dvalid, dp);
}
