// bumpmap.h: scattering about the normal of a surface displaced by a texture h of heights [blinn1978]. With the slopes
// (a, b) = scale grad h: n ~ (dp_du + a n_s) x (dp_dv + b n_s), the tangents made orthogonal to the shading normal n_s,
// turned to the side of the geometric normal.
#pragma once

#include "bsdf/normalmap.h"

#define BUMPMAP_PARAMS(P)                                                                                              \
    P(HEIGHT, nested_texture, 0, -INFINITY, INFINITY, "heights", "")                                                   \
    P(HEIGHT_SCALE, scale, 1, -INFINITY, INFINITY, "factor on the heights", "")
KIND_RECORD(BumpMap, BUMPMAP_PARAMS, TURNED_CONFIG)

// The product of the tangents in the shading frame: (u, 0, a) x (v, w, b).
KFN Vec3 bumpmap_product(const BumpMap *p, const BsdfSurface *s) {
    Float a = p->scale * p->nested_texture.x, b = p->scale * p->nested_texture.y;
    return v3(-a * s->vy, a * s->vx - b * s->ux, s->ux * s->vy);
}

KFN Float bumpmap_side(Vec3 product, const BsdfSurface *s) {
    return f_select(m_lt(v3_dot(product, s->ng), f_set(0)), f_set(-1), f_set(1));
}

// Before it is mirrored for viewers that it faces away from.
KFN Vec3 bumpmap_turned(const BsdfCall *call, const BumpMap *p) {
    Vec3 product = bumpmap_product(p, call->surface);
    return v3_scale(v3_normalize(product), bumpmap_side(product, call->surface));
}

KFN Vec3 bumpmap_normal(const BsdfCall *call, const BumpMap *p, Vec3 wi) {
    return turned_valid(bumpmap_turned(call, p), wi, p->flip_invalid_normals);
}

KFN void bumpmap_normal_adj(const BsdfCall *call, const BumpMap *p, Vec3 wi, Vec3 dvalid, BumpMap *dp) {
    const BsdfSurface *s = call->surface;
    Vec3 product = bumpmap_product(p, s), d = v3_zero();
    Float side = bumpmap_side(product, s), a = p->scale * p->nested_texture.x, b = p->scale * p->nested_texture.y;
    // valid = (+-x, +-y, z) of side normalize(product)
    Vec3 dn = turned_valid_adj(bumpmap_turned(call, p), wi, p->flip_invalid_normals, dvalid);
    v3_normalize_adj(product, v3_scale(dn, side), &d);
    // product = (-a vy, a vx - b ux, ux vy)
    Float da = d.y * s->vx - d.x * s->vy, db = -d.y * s->ux;
    dp->nested_texture.x = dp->nested_texture.x + da * p->scale;
    dp->nested_texture.y = dp->nested_texture.y + db * p->scale;
    dp->scale = dp->scale + da * p->nested_texture.x + db * p->nested_texture.y;
    if (call->dsurface) {
        BsdfSurface *ds = call->dsurface;
        ds->ux = ds->ux - b * d.y + s->vy * d.z;
        ds->vx = ds->vx + a * d.y;
        ds->vy = ds->vy - a * d.x + s->ux * d.z;
    }
}

KFN Spec bumpmap_eval(const BsdfCall *call, const BumpMap *p, Vec3 wi, Vec3 wo, Int lobe) {
    return turned_eval(call, bumpmap_normal(call, p, wi), p->use_shadowing_function, wi, wo, lobe);
}

KFN Float bumpmap_pdf(const BsdfCall *call, const BumpMap *p, Vec3 wi, Vec3 wo, Int lobe) {
    return turned_pdf(call, bumpmap_normal(call, p, wi), wi, wo, lobe);
}

KFN BsdfSample bumpmap_sample(const BsdfCall *call, const BumpMap *p, Vec3 wi, Float u1, Vec2 u2) {
    return turned_sample(call, bumpmap_normal(call, p, wi), wi, u1, u2);
}

KFN void bumpmap_adj(const BsdfCall *call, const BumpMap *p, Vec3 wi, Vec3 wo, Int lobe, Spec df, Sink *sink, Mask m,
                     BumpMap *dp, Vec3 *dwi, Vec3 *dwo, Vec2 *duv) {
    Vec3 dvalid = v3_zero();
    turned_adj(call, bumpmap_normal(call, p, wi), p->use_shadowing_function, wi, wo, lobe, df, sink, m, &dvalid, dwi,
               dwo, duv);
    turned_watch(bumpmap_turned(call, p), wi, true, sink, m);
    bumpmap_normal_adj(call, p, wi, dvalid, dp);
}

KFN void bumpmap_pdf_adj(const BsdfCall *call, const BumpMap *p, Vec3 wi, Vec3 wo, Float dpdf, Sink *sink, Mask m,
                         BumpMap *dp, Vec3 *dwi, Vec3 *dwo, Vec2 *duv) {
    Vec3 dvalid = v3_zero();
    turned_pdf_adj(call, bumpmap_normal(call, p, wi), wi, wo, dpdf, sink, m, &dvalid, dwi, dwo, duv);
    bumpmap_normal_adj(call, p, wi, dvalid, dp);
}
