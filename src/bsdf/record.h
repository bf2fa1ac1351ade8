// record.h: the record of one scattering function at one batch of hits, generated from its parameter list.
#pragma once

#include "scene/kind.h"
#include "scene/texture_gradient.h"

// Reflections, refractions and rims of the two functions of a blend may go different ways. Their lobes carry, above the three
// bits of the list above, one bit per blend on the way to the function that they belong to, the outermost blend lowest.
KFN Mask lobe_is(Int lobe, int kind) { return mi_eq(lobe & 7, i_set(kind)); }
KFN Mask lobe_is_shared(Int lobe) { return mi_eq(lobe, i_set(LOBE_SMOOTH)) | lobe_is(lobe, LOBE_NULL); }
KFN Int lobe_from_child(Int lobe, int child) {
    return i_select(lobe_is_shared(lobe), lobe, (lobe & 7) | ((lobe >> 3) * 2 + child) * 8);
}
KFN Int lobe_to_child(Int lobe) { return (lobe & 7) | (lobe >> 4) * 8; }
// Reflections and refractions: their directions follow from wi.
KFN Mask lobe_turns(Int lobe) { return lobe_is(lobe, LOBE_REFLECT) | lobe_is(lobe, LOBE_TRANSMIT); }
// The same, and what passes undeviated.
KFN Mask lobe_follows(Int lobe) { return lobe_turns(lobe) | lobe_is(lobe, LOBE_NULL); }
KFN Mask lobe_in_child(Int lobe, int child) { return lobe_is_shared(lobe) | mi_eq(lobe >> 3 & 1, i_set(child)); }
// Directions out of many, so that the next vertex may lie wherever they lead.
KFN Mask lobe_spreads(Int lobe) { return lobe_is(lobe, LOBE_SMOOTH) | lobe_is(lobe, LOBE_RIM); }

typedef struct BsdfSample {
    Vec3 wo;
    Int lobe;
    Float eta; // relative index of refraction along the sampled direction, 1 for reflection
} BsdfSample;

#define FIELD_SPEC Spec
#define FIELD_REAL Float
#define FIELD_IOR Float
#define FIELD_SMOOTH_IOR Float
#define FIELD_SPECULAR Float
#define FIELD_RATE Float
#define FIELD_METAL_ETA Spec
#define FIELD_METAL_K Spec
#define FIELD_ALPHA_U Float
#define FIELD_ALPHA_V Float
#define FIELD_NORMAL Spec
#define FIELD_HEIGHT Vec2
#define FIELD_HEIGHT_SCALE Float

#define RECORD_FIELD(type, field, value, low, high, text, option) FIELD_##type field;
#define RECORD_CONFIG(field, value, choices, text) int32_t field;

// A record also knows its derived table and the smallest probability with which a lobe is to be selected: 0 for
// pictures, positive for derivatives, which can be non-zero where a lobe's own weight is 0; and that of the directions along
// which its value jumps, if it does (rim.h).
#define KIND_RECORD(Type, PARAMS, CONFIG)                                                                              \
    typedef struct Type {                                                                                              \
        PARAMS(RECORD_FIELD) CONFIG(RECORD_CONFIG) const float *table;                                                 \
        real floor, rim;                                                                                               \
    } Type;

#define NO_CONFIG(C)

// Adjoint of a mirrored direction wo = (-wi.x, -wi.y, wi.z), in the lanes of m.
KFN void mirrored_adj(Mask m, const Vec3 *dwo, Vec3 *dwi) {
    Vec3 d = v3_select(m, *dwo, v3_zero());
    v3_acc(dwi, v3(-d.x, -d.y, d.z));
}

// Probability of the first of two lobes with weights a and b, kept at least `floor` away from 0 and 1.
KFN Float lobe_probability(Float a, Float b, real floor) {
    Float p = a * f_safe_rcp(a + b);
    p = f_select(m_gt(a + b, f_set(1e-30f)), p, f_set(0.5f));
    return f_clamp(p, f_set(floor), f_set(1 - floor));
}

// Adjoint of lobe_probability without a floor.
KFN void lobe_probability_adj(Float a, Float b, Float dp, Float *da, Float *db) {
    // p = a / (a + b)
    Float r = f_zero_unless(m_gt(a + b, f_set(1e-30f)), dp * f_sqr(f_safe_rcp(a + b)));
    *da = *da + r * b;
    *db = *db - r * a;
}

// The density of functions that have no smooth lobe is 0 there.
#define NO_SMOOTH_LOBE(prefix, Record)                                                                                 \
    KFN void prefix##_pdf_adj(const Record *p, Vec3 wi, Vec3 wo, Float dpdf, Record *dp, Vec3 *dwi, Vec3 *dwo) {       \
        UNUSED(p), UNUSED(wi), UNUSED(wo), UNUSED(dpdf), UNUSED(dp), UNUSED(dwi), UNUSED(dwo);                         \
    }
