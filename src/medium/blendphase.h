// blendphase.h: p = (1 - w) first + w second.
#pragma once

#include "medium/phase_call.h"

#define BLENDPHASE_PARAMS(P) P(NUMBER, weight, 0.5f, 0, 1, "share of the second function")
PHASE_RECORD(BlendPhase, BLENDPHASE_PARAMS)

// Where the clamp of the share lets derivatives through; interpolation may round out of the range.
KFN Mask blendphase_inside(Float w) { return m_ge(w, f_set(-1e-5f)) & m_le(w, f_set(1 + 1e-5f)); }

KFN Float blendphase_eval(const PhaseCall *call, const BlendPhase *p, Vec3 wi, Vec3 wo) {
    PhaseCall first = phase_child(call, 0), second = phase_child(call, 1);
    return f_lerp(phase_eval(&first, wi, wo), phase_eval(&second, wi, wo), f_clamp(p->weight, f_set(0), f_set(1)));
}

// Probability of the second one.
KFN Float blendphase_choice(const BlendPhase *p) { return f_clamp(p->weight, f_set(p->floor), f_set(1 - p->floor)); }

KFN Float blendphase_pdf(const PhaseCall *call, const BlendPhase *p, Vec3 wi, Vec3 wo) {
    PhaseCall first = phase_child(call, 0), second = phase_child(call, 1);
    return f_lerp(phase_pdf(&first, wi, wo), phase_pdf(&second, wi, wo), blendphase_choice(p));
}

KFN Vec3 blendphase_sample(const PhaseCall *call, const BlendPhase *p, Vec3 wi, Float u1, Vec2 u2) {
    PhaseCall first = phase_child(call, 0), second = phase_child(call, 1);
    Float share = blendphase_choice(p);
    Mask take = m_lt(u1, share);
    // What is left of u1 chooses further down.
    Float left = f_select(take, u1 * f_safe_rcp(share), (u1 - share) * f_safe_rcp(1.0f - share));
    left = f_clamp(left, f_set(0), f_set(0.99999994f));
    return v3_select(take, phase_sample(&second, wi, left, u2), phase_sample(&first, wi, left, u2));
}

KFN void blendphase_adj(const PhaseCall *call, const BlendPhase *p, Vec3 wi, Vec3 wo, Float df, Sink *sink, Mask m,
                        BlendPhase *dp, Vec3 *dwi, Vec3 *dwo) {
    PhaseCall first = phase_child(call, 0), second = phase_child(call, 1);
    Float w = f_clamp(p->weight, f_set(0), f_set(1));
    // p = (1 - w) first + w second
    phase_adj(&first, wi, wo, df * (1.0f - w), sink, m, dwi, dwo);
    phase_adj(&second, wi, wo, df * w, sink, m, dwi, dwo);
    Float difference = phase_eval(&second, wi, wo) - phase_eval(&first, wi, wo);
    dp->weight = dp->weight + f_zero_unless(blendphase_inside(p->weight), df * difference);
}
