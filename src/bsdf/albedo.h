// albedo.h: the colour of a surface, for denoisers: the reflectance of the diffuse part where a function has one, else
// pi times its value towards the normal.
#pragma once

#include "bsdf/bsdf.h"

static Spec bsdf_albedo(const BsdfCall *call, Vec3 wi) {
    BsdfCall first, second;
    switch (call->scene->bsdfs[call->node].kind) {
    case BSDF_DIFFUSE:
        return diffuse_fetch(call).reflectance;
    case BSDF_PLASTIC:
        return plastic_fetch(call).diffuse_reflectance;
    case BSDF_ROUGHPLASTIC:
        return roughplastic_fetch(call).diffuse_reflectance;
    case BSDF_PRINCIPLED:
        return principled_fetch(call).base_color;
    case BSDF_PRINCIPLEDTHIN:
        return principledthin_fetch(call).base_color;
    case BSDF_TWOSIDED:
        first = twosided_side(call, false);
        second = twosided_side(call, true);
        return spec_select(m_lt(wi.z, f_set(0)), bsdf_albedo(&second, v3(wi.x, wi.y, -wi.z)), bsdf_albedo(&first, wi));
    case BSDF_BLENDBSDF: {
        Float share = f_clamp(blendbsdf_fetch(call).weight, f_set(0), f_set(1));
        first = bsdf_child(call, 0);
        second = bsdf_child(call, 1);
        return spec_add(spec_scale(bsdf_albedo(&first, wi), 1.0f - share), spec_scale(bsdf_albedo(&second, wi), share));
    }
    case BSDF_MASK:
    case BSDF_NORMALMAP:
    case BSDF_BUMPMAP:
        first = bsdf_child(call, 0);
        return bsdf_albedo(&first, wi);
    default:
        return spec_scale(bsdf_eval(call, wi, v3(f_set(0), f_set(0), f_set(1)), i_set(LOBE_SMOOTH)), f_set(PI));
    }
}
