// dictionary.h: p = sum w_i p_i / sum w_i over any number of functions. The first node has the weights; each node has one of
// the functions, and the node with the next one.
#pragma once

#include "medium/phase_call.h"

#define DICTIONARY_PARAMS(P) P(WEIGHTS, weights, 1, 0, INFINITY, "share of each function; their scale is free")
PHASE_RECORD(Dictionary, DICTIONARY_PARAMS)

// The function of a node, which becomes the next one.
KFN PhaseCall dictionary_next(const PhaseCall *call, int32_t *node) {
    PhaseCall c = *call;
    c.node = call->scene->phases[*node].child[0];
    *node = call->scene->phases[*node].child[1];
    return c;
}

KFN real dictionary_scale(const Dictionary *p) {
    real sum = 0;
    for (int32_t i = 0; i < p->weights.count; i++) {
        sum += (real)p->weights.values[i];
    }
    return sum > 0 ? 1 / sum : 0;
}

KFN Float dictionary_eval(const PhaseCall *call, const Dictionary *p, Vec3 wi, Vec3 wo) {
    Float sum = f_set(0);
    int32_t node = call->node;
    for (int32_t i = 0; i < p->weights.count && node >= 0; i++) {
        PhaseCall one = dictionary_next(call, &node);
        sum = sum + (real)p->weights.values[i] * phase_eval(&one, wi, wo);
    }
    return sum * dictionary_scale(p);
}

// Probability of one: where its weight is 0, its derivative is not.
KFN real dictionary_choice(const Dictionary *p, int32_t i, real scale) {
    return (1 - p->floor) * (real)p->weights.values[i] * scale + p->floor / (real)p->weights.count;
}

KFN Float dictionary_pdf(const PhaseCall *call, const Dictionary *p, Vec3 wi, Vec3 wo) {
    Float sum = f_set(0);
    real scale = dictionary_scale(p);
    int32_t node = call->node;
    for (int32_t i = 0; i < p->weights.count && node >= 0; i++) {
        PhaseCall one = dictionary_next(call, &node);
        sum = sum + dictionary_choice(p, i, scale) * phase_pdf(&one, wi, wo);
    }
    return sum;
}

KFN Vec3 dictionary_sample(const PhaseCall *call, const Dictionary *p, Vec3 wi, Float u1, Vec2 u2) {
    Vec3 d = v3_neg(wi);
    Mask left = m_set(true);
    real scale = dictionary_scale(p), before = 0;
    int32_t node = call->node;
    for (int32_t i = 0; i < p->weights.count && node >= 0 && m_any(left); i++) {
        PhaseCall one = dictionary_next(call, &node);
        real share = dictionary_choice(p, i, scale);
        Mask take = left & (m_lt(u1, f_set(before + share)) | m_set(i + 1 == p->weights.count));
        if (share > 0 && m_any(take)) {
            // What is left of u1 chooses further down.
            Float rest = f_clamp((u1 - before) / share, f_set(0), f_set(0.99999994f));
            d = v3_select(take, phase_sample(&one, wi, rest, u2), d);
        }
        left = left & ~take;
        before += share;
    }
    return d;
}

KFN void dictionary_adj(const PhaseCall *call, const Dictionary *p, Vec3 wi, Vec3 wo, Float df, Sink *sink, Mask m,
                        Dictionary *dp, Vec3 *dwi, Vec3 *dwo) {
    UNUSED(dp);
    Float value = dictionary_eval(call, p, wi, wo);
    real scale = dictionary_scale(p);
    int32_t node = call->node, at = sink->texture_at[p->weights.slot];
    for (int32_t i = 0; i < p->weights.count && node >= 0; i++) {
        PhaseCall one = dictionary_next(call, &node);
        phase_adj(&one, wi, wo, df * ((real)p->weights.values[i] * scale), sink, m, dwi, dwo);
        if (at >= 0) {
            // dp / dw_i = (p_i - p) / sum
            sink_add_uniform(sink, at + i, df * (phase_eval(&one, wi, wo) - value) * scale, m);
        }
    }
}
