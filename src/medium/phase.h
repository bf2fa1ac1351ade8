// phase.h: dispatch over the phase functions, generated from kinds.inl. The function is uniform over the lanes.
#pragma once

#include "medium/blendphase.h"
#include "medium/dictionary.h"
#include "medium/hg.h"
#include "medium/isotropic.h"
#include "medium/rayleigh.h"
#include "medium/sggx.h"
#include "medium/tabphase.h"

enum {
#define PHASE_LEAF(ENUM, ...) PHASE_##ENUM,
#define PHASE_ADAPTER(ENUM, ...) PHASE_##ENUM,
#include "medium/kinds.inl"
#undef PHASE_LEAF
#undef PHASE_ADAPTER
    PHASE_KIND_COUNT
};

// ---- fetch: slots to record; scatter: record adjoint to the sink -------------------------------------------------

KFN Float phase_fetch_NUMBER(const PhaseCall *call, int32_t slot) {
    return texture_eval_real(call->scene, slot, call->at);
}

KFN void phase_scatter_NUMBER(const PhaseCall *call, int32_t slot, Float d, Sink *sink, Mask m) {
    texture_adj_real(call->scene, slot, call->at, d, NULL, sink, m);
}

KFN PhaseTable phase_fetch_TABLE(const PhaseCall *call, int32_t slot) {
    const TextureNode *t = call->scene->textures + slot;
    return (PhaseTable){call->scene->theta + t->theta, t->width, i_set(0), f_set(0), f_set(0), f_set(0)};
}

KFN void phase_scatter_TABLE(const PhaseCall *call, int32_t slot, PhaseTable d, Sink *sink, Mask m) {
    int32_t at = sink->texture_at[slot], n = call->scene->textures[slot].width;
    if (at < 0) {
        return;
    }
    sink_add(sink, d.cell + at, d.left, m);
    sink_add(sink, d.cell + at + 1, d.right, m);
    for (int32_t i = 0; i < n; i++) {
        // integral = step x the sum of the values, the ends counting half
        real share = (i == 0 || i == n - 1 ? (real)1 : (real)2) / (real)(n - 1);
        sink_add_uniform(sink, at + i, d.all * share, m);
    }
}

KFN PhaseMatrix phase_fetch_MATRIX(const PhaseCall *call, int32_t slot) {
    return matrix_fetch(call->scene, slot, call->at.hit->p);
}

KFN void phase_scatter_MATRIX(const PhaseCall *call, int32_t slot, PhaseMatrix d, Sink *sink, Mask m) {
    matrix_scatter(call->scene, slot, call->at.hit->p, d, sink, m);
}

KFN PhaseWeights phase_fetch_WEIGHTS(const PhaseCall *call, int32_t slot) {
    const TextureNode *t = call->scene->textures + slot;
    return (PhaseWeights){call->scene->theta + t->theta, t->width, slot};
}

KFN void phase_scatter_WEIGHTS(const PhaseCall *call, int32_t slot, PhaseWeights d, Sink *sink, Mask m) {
    UNUSED(call), UNUSED(slot), UNUSED(d), UNUSED(sink), UNUSED(m);
}

#define FETCH_PHASE_FIELD(type, field, value, low, high, text)                                                         \
    record.field = phase_fetch_##type(call, node->slot[slot++]);
#define SCATTER_PHASE_FIELD(type, field, value, low, high, text)                                                       \
    phase_scatter_##type(call, node->slot[slot++], adjoint->field, sink, m);
#define DEFINE_PHASE_FETCH(prefix, Record, PARAMS)                                                                     \
    KFN Record prefix##_fetch(const PhaseCall *call) {                                                                 \
        const PhaseNode *node = call->scene->phases + call->node;                                                              \
        int slot = 0;                                                                                                  \
        Record record = {.floor = call->floor};                                                                        \
        record.table = node->table >= 0 ? call->scene->tables + node->table : NULL;                                    \
        PARAMS(FETCH_PHASE_FIELD) UNUSED(slot);                                                                        \
        return record;                                                                                                 \
    }                                                                                                                  \
    KFN void prefix##_scatter(const PhaseCall *call, const Record *adjoint, Sink *sink, Mask m) {                      \
        const PhaseNode *node = call->scene->phases + call->node;                                                              \
        int slot = 0;                                                                                                  \
        PARAMS(SCATTER_PHASE_FIELD) UNUSED(adjoint), UNUSED(node), UNUSED(slot), UNUSED(sink), UNUSED(m);              \
    }
#define PHASE_LEAF(ENUM, prefix, Record, name, PARAMS, reference) DEFINE_PHASE_FETCH(prefix, Record, PARAMS)
#define PHASE_ADAPTER(ENUM, prefix, Record, name, PARAMS, children, reference) DEFINE_PHASE_FETCH(prefix, Record, PARAMS)
#include "medium/kinds.inl"
#undef PHASE_LEAF
#undef PHASE_ADAPTER

// ---- dispatch ----------------------------------------------------------------------------------------------------

static NOINLINE Float phase_eval(const PhaseCall *call, Vec3 wi, Vec3 wo) {
    switch (call->scene->phases[call->node].kind) {
#define PHASE_LEAF(ENUM, prefix, Record, ...)                                                                          \
    case PHASE_##ENUM: {                                                                                               \
        Record p = prefix##_fetch(call);                                                                               \
        return prefix##_eval(&p, wi, wo);                                                                              \
    }
#define PHASE_ADAPTER(ENUM, prefix, Record, ...)                                                                       \
    case PHASE_##ENUM: {                                                                                               \
        Record p = prefix##_fetch(call);                                                                               \
        return prefix##_eval(call, &p, wi, wo);                                                                        \
    }
#include "medium/kinds.inl"
#undef PHASE_LEAF
#undef PHASE_ADAPTER
    default:
        return f_set(0);
    }
}

// Density of phase_sample per solid angle.
static NOINLINE Float phase_pdf(const PhaseCall *call, Vec3 wi, Vec3 wo) {
    switch (call->scene->phases[call->node].kind) {
#define PHASE_LEAF(ENUM, prefix, Record, ...)                                                                          \
    case PHASE_##ENUM: {                                                                                               \
        Record p = prefix##_fetch(call);                                                                               \
        return prefix##_pdf(&p, wi, wo);                                                                               \
    }
#define PHASE_ADAPTER(ENUM, prefix, Record, ...)                                                                       \
    case PHASE_##ENUM: {                                                                                               \
        Record p = prefix##_fetch(call);                                                                               \
        return prefix##_pdf(call, &p, wi, wo);                                                                         \
    }
#include "medium/kinds.inl"
#undef PHASE_LEAF
#undef PHASE_ADAPTER
    default:
        return f_set(0);
    }
}

// u1 chooses among functions, u2 directions.
static NOINLINE Vec3 phase_sample(const PhaseCall *call, Vec3 wi, Float u1, Vec2 u2) {
    switch (call->scene->phases[call->node].kind) {
#define PHASE_LEAF(ENUM, prefix, Record, ...)                                                                          \
    case PHASE_##ENUM: {                                                                                               \
        Record p = prefix##_fetch(call);                                                                               \
        return prefix##_sample(&p, wi, u1, u2);                                                                        \
    }
#define PHASE_ADAPTER(ENUM, prefix, Record, ...)                                                                       \
    case PHASE_##ENUM: {                                                                                               \
        Record p = prefix##_fetch(call);                                                                               \
        return prefix##_sample(call, &p, wi, u1, u2);                                                                  \
    }
#include "medium/kinds.inl"
#undef PHASE_LEAF
#undef PHASE_ADAPTER
    default:
        return wi;
    }
}

static NOINLINE void phase_adj(const PhaseCall *call, Vec3 wi, Vec3 wo, Float df, Sink *sink, Mask m, Vec3 *dwi,
                               Vec3 *dwo) {
    switch (call->scene->phases[call->node].kind) {
#define PHASE_LEAF(ENUM, prefix, Record, ...)                                                                          \
    case PHASE_##ENUM: {                                                                                               \
        Record p = prefix##_fetch(call), dp = {.floor = 0};                                                            \
        prefix##_adj(&p, wi, wo, df, &dp, dwi, dwo);                                                                   \
        prefix##_scatter(call, &dp, sink, m);                                                                          \
        break;                                                                                                         \
    }
#define PHASE_ADAPTER(ENUM, prefix, Record, ...)                                                                       \
    case PHASE_##ENUM: {                                                                                               \
        Record p = prefix##_fetch(call), dp = {.floor = 0};                                                            \
        prefix##_adj(call, &p, wi, wo, df, sink, m, &dp, dwi, dwo);                                                    \
        prefix##_scatter(call, &dp, sink, m);                                                                          \
        break;                                                                                                         \
    }
#include "medium/kinds.inl"
#undef PHASE_LEAF
#undef PHASE_ADAPTER
    default:
        break;
    }
}
