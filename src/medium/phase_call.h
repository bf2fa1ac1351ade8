// phase_call.h: how a phase function made of others calls these; defined in phase.h.
#pragma once

#include "medium/phase_record.h"

typedef struct PhaseCall {
    const SceneView *scene;
    int32_t node;
    TexCoord at;
    real floor; // see PHASE_RECORD
} PhaseCall;

static NOINLINE Float phase_eval(const PhaseCall *call, Vec3 wi, Vec3 wo);
static NOINLINE Float phase_pdf(const PhaseCall *call, Vec3 wi, Vec3 wo);
static NOINLINE Vec3 phase_sample(const PhaseCall *call, Vec3 wi, Float u1, Vec2 u2);
// Accumulates the adjoint df of phase_eval into the sink (lanes of m), dwi and dwo.
static NOINLINE void phase_adj(const PhaseCall *call, Vec3 wi, Vec3 wo, Float df, Sink *sink, Mask m, Vec3 *dwi, Vec3 *dwo);

KFN PhaseCall phase_child(const PhaseCall *call, int child) {
    PhaseCall c = *call;
    c.node = call->scene->phases[call->node].child[child];
    return c;
}
