// bsdf.h: dispatch over the scattering functions, generated from kinds.inl. The function is uniform over the lanes.
#pragma once

#include "bsdf/blendbsdf.h"
#include "bsdf/bumpmap.h"
#include "bsdf/call.h"
#include "bsdf/conductor.h"
#include "bsdf/dielectric.h"
#include "bsdf/diffuse.h"
#include "bsdf/mask.h"
#include "bsdf/normalmap.h"
#include "bsdf/null.h"
#include "bsdf/plastic.h"
#include "bsdf/principled_adj.h"
#include "bsdf/principledthin.h"
#include "bsdf/roughconductor.h"
#include "bsdf/roughdielectric.h"
#include "bsdf/roughplastic.h"
#include "bsdf/thindielectric.h"
#include "bsdf/twosided.h"

enum {
#define BSDF_LEAF(ENUM, ...) BSDF_##ENUM,
#define BSDF_ADAPTER(ENUM, ...) BSDF_##ENUM,
#include "bsdf/kinds.inl"
#undef BSDF_LEAF
#undef BSDF_ADAPTER
    BSDF_KIND_COUNT
};

// ---- fetch: texture slots to record; scatter: record adjoint to textures -----------------------------------------

#define FETCH_SPEC texture_eval
#define FETCH_REAL texture_eval_real
#define FETCH_IOR texture_eval_real
#define FETCH_SMOOTH_IOR texture_eval_real
#define FETCH_SPECULAR texture_eval_real
#define FETCH_RATE texture_eval_real
#define FETCH_METAL_ETA texture_eval
#define FETCH_METAL_K texture_eval
#define FETCH_ALPHA_U texture_eval_real
#define FETCH_ALPHA_V texture_eval_real
#define FETCH_NORMAL texture_eval
#define FETCH_HEIGHT texture_gradient
#define FETCH_HEIGHT_SCALE texture_eval_real
#define SCATTER_SPEC texture_adj
#define SCATTER_REAL texture_adj_real
#define SCATTER_IOR texture_adj_real
#define SCATTER_SMOOTH_IOR texture_adj_real
#define SCATTER_SPECULAR texture_adj_real
#define SCATTER_RATE texture_adj_real
#define SCATTER_METAL_ETA texture_adj
#define SCATTER_METAL_K texture_adj
#define SCATTER_ALPHA_U texture_adj_real
#define SCATTER_ALPHA_V texture_adj_real
#define SCATTER_NORMAL texture_adj
#define SCATTER_HEIGHT texture_gradient_adj
#define SCATTER_HEIGHT_SCALE texture_adj_real

#define FETCH_FIELD(type, field, value, low, high, text, option)                                                       \
    record.field = FETCH_##type(call->scene, node->slot[slot++], call->uv);
#define FETCH_CONFIG(field, value, choices, text) record.field = node->config[config++];
#define SCATTER_FIELD(type, field, value, low, high, text, option)                                                     \
    if (duv || texture_wanted(call->scene, sink, node->slot[slot])) {                                                  \
        SCATTER_##type(call->scene, node->slot[slot], call->uv, adjoint.field, duv, sink, m);                          \
    }                                                                                                                  \
    slot++;

// With hidden emitters `path` drops a path by what it chose where surfaces let light pass; of thin glass, whose coefficient
// is not the probability of passing (kept.h), derivatives choose as pictures do.
KFN real bsdf_floor(const BsdfCall *call, const BsdfNode *node) {
    return call->scene->drops && node->kind == BSDF_THINDIELECTRIC ? 0 : call->floor;
}

#define DEFINE_FETCH(prefix, Record, PARAMS, CONFIG)                                                                   \
    KFN Record prefix##_fetch(const BsdfCall *call) {                                                                  \
        const BsdfNode *node = call->scene->bsdfs + call->node;                                                        \
        int slot = 0, config = 0;                                                                                      \
        Record record = {.floor = bsdf_floor(call, node), .rim = call->rim};                                           \
        record.table = node->table >= 0 ? call->scene->tables + node->table : NULL;                                    \
        PARAMS(FETCH_FIELD) CONFIG(FETCH_CONFIG) UNUSED(slot), UNUSED(config);                                         \
        return record;                                                                                                 \
    }                                                                                                                  \
    KFN void prefix##_scatter(const BsdfCall *call, Record adjoint, Sink *sink, Mask m, Vec2 *duv) {                   \
        const BsdfNode *node = call->scene->bsdfs + call->node;                                                        \
        int slot = 0;                                                                                                  \
        PARAMS(SCATTER_FIELD) UNUSED(adjoint), UNUSED(node), UNUSED(slot), UNUSED(sink), UNUSED(m), UNUSED(duv);       \
    }
#define BSDF_LEAF(ENUM, prefix, Record, name, sides, PARAMS, CONFIG, reference)                                        \
    DEFINE_FETCH(prefix, Record, PARAMS, CONFIG)
#define BSDF_ADAPTER(ENUM, prefix, Record, name, sides, PARAMS, CONFIG, fewest, most, child, reference)                \
    DEFINE_FETCH(prefix, Record, PARAMS, CONFIG)
#include "bsdf/kinds.inl"
#undef BSDF_LEAF
#undef BSDF_ADAPTER

// ---- dispatch ----------------------------------------------------------------------------------------------------

// One case per function: its record is p, and RUN(prefix, arguments before the directions) says what to do with it.
#define BSDF_LEAF(ENUM, prefix, Record, ...)                                                                           \
    case BSDF_##ENUM: {                                                                                                \
        Record p = prefix##_fetch(call);                                                                               \
        RUN(prefix, &p)                                                                                                \
    }
#define BSDF_ADAPTER(ENUM, prefix, Record, ...)                                                                        \
    case BSDF_##ENUM: {                                                                                                \
        Record p = prefix##_fetch(call);                                                                               \
        RUN(prefix, call, &p)                                                                                          \
    }

// f cos_o of the smooth lobe, or the coefficient of a delta lobe. Directions are local; dead lanes hold valid ones.
static NOINLINE Spec bsdf_eval(const BsdfCall *call, Vec3 wi, Vec3 wo, Int lobe) {
    switch (call->scene->bsdfs[call->node].kind) {
#define RUN(prefix, ...) return prefix##_eval(__VA_ARGS__, wi, wo, lobe);
#include "bsdf/kinds.inl"
#undef RUN
    default:
        return spec_zero();
    }
}

// Density of bsdf_sample per solid angle, or the probability of a delta lobe.
static NOINLINE Float bsdf_pdf(const BsdfCall *call, Vec3 wi, Vec3 wo, Int lobe) {
    switch (call->scene->bsdfs[call->node].kind) {
#define RUN(prefix, ...) return prefix##_pdf(__VA_ARGS__, wi, wo, lobe);
#include "bsdf/kinds.inl"
#undef RUN
    default:
        return f_set(0);
    }
}

// Value and density at once: one fetch, and what the two have in common is computed once.
static NOINLINE Spec bsdf_eval_pdf(const BsdfCall *call, Vec3 wi, Vec3 wo, Int lobe, Float *pdf) {
    switch (call->scene->bsdfs[call->node].kind) {
#define RUN(prefix, ...)                                                                                               \
    *pdf = prefix##_pdf(__VA_ARGS__, wi, wo, lobe);                                                                    \
    return prefix##_eval(__VA_ARGS__, wi, wo, lobe);
#include "bsdf/kinds.inl"
#undef RUN
    default:
        *pdf = f_set(0);
        return spec_zero();
    }
}

// u1 selects lobes, u2 directions. Samples of no use have density 0.
static NOINLINE BsdfSample bsdf_sample(const BsdfCall *call, Vec3 wi, Float u1, Vec2 u2) {
    switch (call->scene->bsdfs[call->node].kind) {
#define RUN(prefix, ...) return prefix##_sample(__VA_ARGS__, wi, u1, u2);
#include "bsdf/kinds.inl"
#undef RUN
    default:
        return (BsdfSample){wi, i_set(LOBE_NULL), f_set(1)};
    }
}
#undef BSDF_LEAF
#undef BSDF_ADAPTER

// One case per function, as above: its record is p and that record's adjoint dp.
#define BSDF_LEAF(ENUM, prefix, Record, ...)                                                                           \
    case BSDF_##ENUM: {                                                                                                \
        Record p = prefix##_fetch(call), dp = {0};                                                                     \
        RUN_LEAF(prefix)                                                                                               \
        prefix##_scatter(call, dp, sink, m, duv);                                                                      \
        break;                                                                                                         \
    }
#define BSDF_ADAPTER(ENUM, prefix, Record, ...)                                                                        \
    case BSDF_##ENUM: {                                                                                                \
        Record p = prefix##_fetch(call), dp = {0};                                                                     \
        RUN_ADAPTER(prefix)                                                                                            \
        prefix##_scatter(call, dp, sink, m, duv);                                                                      \
        break;                                                                                                         \
    }

static NOINLINE void bsdf_adj(const BsdfCall *call, Vec3 wi, Vec3 wo, Int lobe, Spec df, Sink *sink, Mask m, Vec3 *dwi,
                              Vec3 *dwo, Vec2 *duv) {
    switch (call->scene->bsdfs[call->node].kind) {
#define RUN_LEAF(prefix) prefix##_adj(&p, wi, wo, lobe, df, &dp, dwi, dwo);
#define RUN_ADAPTER(prefix) prefix##_adj(call, &p, wi, wo, lobe, df, sink, m, &dp, dwi, dwo, duv);
#include "bsdf/kinds.inl"
#undef RUN_LEAF
#undef RUN_ADAPTER
    default:
        break;
    }
}

static NOINLINE void bsdf_pdf_adj(const BsdfCall *call, Vec3 wi, Vec3 wo, Float dpdf, Sink *sink, Mask m, Vec3 *dwi,
                                  Vec3 *dwo, Vec2 *duv) {
    switch (call->scene->bsdfs[call->node].kind) {
#define RUN_LEAF(prefix) prefix##_pdf_adj(&p, wi, wo, dpdf, &dp, dwi, dwo);
#define RUN_ADAPTER(prefix) prefix##_pdf_adj(call, &p, wi, wo, dpdf, sink, m, &dp, dwi, dwo, duv);
#include "bsdf/kinds.inl"
#undef RUN_LEAF
#undef RUN_ADAPTER
    default:
        break;
    }
}
#undef BSDF_LEAF
#undef BSDF_ADAPTER
