// directionalarea.h: a surface that emits along its normal only. No point off its beam sees it, and scattering meets its
// beam with probability 0: it lights what light tracing finds, and stays black for paths from the camera.
#pragma once

#include "emitter/light.h"

#define DIRECTIONALAREA_PARAMS(P) P(EMISSION, radiance, 1, 0, INFINITY, "radiosity of the beam", "W/m^2")
EMITTER_SLOTS(DirectionalArea, DIRECTIONALAREA_PARAMS)

KFN LightSample directionalarea_sample(const SceneView *scene, const Light *l, Vec3 ref, Vec2 u) {
    UNUSED(scene), UNUSED(l), UNUSED(u);
    LightSample s = light_at_point(ref, v3_zero());
    s.valid = m_set(false);
    return s;
}

KFN Float directionalarea_pdf(const SceneView *scene, const EmitterRecord *e, Vec3 ref, Vec3 d, const Interaction *si) {
    UNUSED(scene), UNUSED(e), UNUSED(ref), UNUSED(d), UNUSED(si);
    return f_set(0);
}

KFN Spec directionalarea_eval(const SceneView *scene, const Light *l, TexCoord uv, Float distance) {
    UNUSED(scene), UNUSED(l), UNUSED(uv), UNUSED(distance);
    return spec_zero();
}

KFN void directionalarea_adj(const SceneView *scene, const Light *l, TexCoord uv, Float distance, Spec dl,
                             LightMove *move, Sink *sink, Mask m) {
    UNUSED(scene), UNUSED(l), UNUSED(uv), UNUSED(distance), UNUSED(dl), UNUSED(move), UNUSED(sink), UNUSED(m);
}
