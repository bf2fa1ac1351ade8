// shares.h: how the density of the smooth lobe, as pictures draw it, depends on what masks and blends share out.
#pragma once

#include "bsdf/bsdf.h"

// Adds the adjoint dpdf of bsdf_pdf(call, wi, wo, LOBE_SMOOTH), whose floor is 0, to the shares of masks and blends.
// NOT differentiated: densities of what they are made of.
static NOINLINE void bsdf_shares_adj(const BsdfCall *call, Vec3 wi, Vec3 wo, Float dpdf, Sink *sink, Mask m, Vec2 *duv) {
    const Int smooth = i_set(LOBE_SMOOTH);
    switch (call->scene->bsdfs[call->node].kind) {
    case BSDF_TWOSIDED: {
        Mask back = m_lt(wi.z, f_set(0));
        BsdfCall front_call = twosided_side(call, false), back_call = twosided_side(call, true);
        wi = v3_flip_z(back, wi);
        wo = v3_flip_z(back, wo);
        bsdf_shares_adj(&front_call, wi, wo, f_zero_unless(~back, dpdf), sink, m & ~back, duv);
        bsdf_shares_adj(&back_call, wi, wo, f_zero_unless(back, dpdf), sink, m & back, duv);
        break;
    }
    case BSDF_MASK: {
        MaskBsdf p = mask_fetch(call), dp = {0};
        BsdfCall child = bsdf_child(call, 0);
        // pdf = o nested
        dp.opacity = f_zero_unless(share_inside(p.opacity), dpdf * bsdf_pdf(&child, wi, wo, smooth));
        mask_scatter(call, dp, sink, m, duv);
        bsdf_shares_adj(&child, wi, wo, dpdf * mask_opacity(&p), sink, m, duv);
        break;
    }
    case BSDF_BLENDBSDF: {
        BlendBsdf p = blendbsdf_fetch(call), dp = {0};
        BsdfCall first = bsdf_child(call, 0), second = bsdf_child(call, 1);
        Float w = blendbsdf_weight(&p), slope = bsdf_pdf(&second, wi, wo, smooth) - bsdf_pdf(&first, wi, wo, smooth);
        // pdf = (1 - w) first + w second
        dp.weight = f_zero_unless(share_inside(p.weight), dpdf * slope);
        blendbsdf_scatter(call, dp, sink, m, duv);
        bsdf_shares_adj(&first, wi, wo, dpdf * (1.0f - w), sink, m, duv);
        bsdf_shares_adj(&second, wi, wo, dpdf * w, sink, m, duv);
        break;
    }
    default:
        break;
    }
}
