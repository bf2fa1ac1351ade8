// twosided.h: one function for the front, the same or another one for the back. The back sees mirrored directions.
#pragma once

#include "bsdf/call.h"
#include "bsdf/null.h"

#define TWOSIDED_CONFIG(C)                                                                                             \
    C(allow_transmission, 0, "false|true", "accept functions that let light through")
KIND_RECORD(Twosided, NO_PARAMS, TWOSIDED_CONFIG)

KFN Vec3 v3_flip_z(Mask flip, Vec3 v) { return v3(v.x, v.y, f_select(flip, -v.z, v.z)); }

// The child of lane side `back`; children[1] is the back's when there are two.
KFN BsdfCall twosided_side(const BsdfCall *call, bool back) {
    int32_t second = call->scene->bsdfs[call->node].child[1];
    return bsdf_child(call, back && second >= 0 ? 1 : 0);
}

KFN bool twosided_shared(const BsdfCall *call) { return call->scene->bsdfs[call->node].child[1] < 0; }

KFN Spec twosided_eval(const BsdfCall *call, const Twosided *p, Vec3 wi, Vec3 wo, Int lobe) {
    UNUSED(p);
    Mask back = m_lt(wi.z, f_set(0));
    wi = v3_flip_z(back, wi);
    wo = v3_flip_z(back, wo);
    BsdfCall front_call = twosided_side(call, false);
    Spec f = bsdf_eval(&front_call, wi, wo, lobe);
    if (!twosided_shared(call) && m_any(back)) {
        BsdfCall back_call = twosided_side(call, true);
        f = spec_select(back, bsdf_eval(&back_call, wi, wo, lobe), f);
    }
    return f;
}

KFN Float twosided_pdf(const BsdfCall *call, const Twosided *p, Vec3 wi, Vec3 wo, Int lobe) {
    UNUSED(p);
    Mask back = m_lt(wi.z, f_set(0));
    wi = v3_flip_z(back, wi);
    wo = v3_flip_z(back, wo);
    BsdfCall front_call = twosided_side(call, false);
    Float pdf = bsdf_pdf(&front_call, wi, wo, lobe);
    if (!twosided_shared(call) && m_any(back)) {
        BsdfCall back_call = twosided_side(call, true);
        pdf = f_select(back, bsdf_pdf(&back_call, wi, wo, lobe), pdf);
    }
    return pdf;
}

KFN BsdfSample twosided_sample(const BsdfCall *call, const Twosided *p, Vec3 wi, Float u1, Vec2 u2) {
    UNUSED(p);
    Mask back = m_lt(wi.z, f_set(0));
    wi = v3_flip_z(back, wi);
    BsdfCall front_call = twosided_side(call, false);
    BsdfSample s = bsdf_sample(&front_call, wi, u1, u2);
    if (!twosided_shared(call) && m_any(back)) {
        BsdfCall back_call = twosided_side(call, true);
        BsdfSample b = bsdf_sample(&back_call, wi, u1, u2);
        s.wo = v3_select(back, b.wo, s.wo);
        s.lobe = i_select(back, b.lobe, s.lobe);
        s.eta = f_select(back, b.eta, s.eta);
    }
    s.wo = v3_flip_z(back, s.wo);
    return s;
}

KFN void twosided_adj(const BsdfCall *call, const Twosided *p, Vec3 wi, Vec3 wo, Int lobe, Spec df, Sink *sink, Mask m,
                      Twosided *dp, Vec3 *dwi, Vec3 *dwo, Vec2 *duv) {
    UNUSED(p);
    UNUSED(dp);
    Mask back = m_lt(wi.z, f_set(0));
    Vec3 a = v3_flip_z(back, wi), b = v3_flip_z(back, wo), da = v3_zero(), db = v3_flip_z(back, *dwo);
    BsdfCall front_call = twosided_side(call, false);
    if (twosided_shared(call)) {
        bsdf_adj(&front_call, a, b, lobe, df, sink, m, &da, &db, duv);
    } else {
        BsdfCall back_call = twosided_side(call, true);
        bsdf_adj(&front_call, a, b, lobe, spec_zero_unless(~back, df), sink, m & ~back, &da, &db, duv);
        bsdf_adj(&back_call, a, b, lobe, spec_zero_unless(back, df), sink, m & back, &da, &db, duv);
    }
    // a = flip(wi), b = flip(wo)
    v3_acc(dwi, v3_flip_z(back, da));
    *dwo = v3_flip_z(back, db);
}

KFN void twosided_pdf_adj(const BsdfCall *call, const Twosided *p, Vec3 wi, Vec3 wo, Float dpdf, Sink *sink, Mask m,
                          Twosided *dp, Vec3 *dwi, Vec3 *dwo, Vec2 *duv) {
    UNUSED(p), UNUSED(dp);
    Mask back = m_lt(wi.z, f_set(0));
    Vec3 a = v3_flip_z(back, wi), b = v3_flip_z(back, wo), da = v3_zero(), db = v3_zero();
    BsdfCall front_call = twosided_side(call, false);
    if (twosided_shared(call)) {
        bsdf_pdf_adj(&front_call, a, b, dpdf, sink, m, &da, &db, duv);
    } else {
        BsdfCall back_call = twosided_side(call, true);
        bsdf_pdf_adj(&front_call, a, b, f_zero_unless(~back, dpdf), sink, m & ~back, &da, &db, duv);
        bsdf_pdf_adj(&back_call, a, b, f_zero_unless(back, dpdf), sink, m & back, &da, &db, duv);
    }
    // a = flip(wi), b = flip(wo)
    v3_acc(dwi, v3_flip_z(back, da));
    v3_acc(dwo, v3_flip_z(back, db));
}
