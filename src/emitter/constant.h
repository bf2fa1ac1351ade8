// constant.h: the same radiance from every direction beyond the scene.
#pragma once

#include "emitter/light.h"

#define CONSTANT_PARAMS(P) P(SPECTRUM, radiance, 1, 0, INFINITY, "radiance from everywhere", "W/(m^2 sr)")
EMITTER_SLOTS(Constant, CONSTANT_PARAMS)

KFN LightSample constant_sample(const SceneView *scene, const Light *l, Vec3 ref, Vec2 u) {
    UNUSED(l), UNUSED(ref);
    LightSample s;
    s.d = warp_uniform_sphere(u);
    s.distance = f_set(2 * (real)scene->bounds_radius);
    s.pdf = f_set(INV_FOUR_PI);
    s.uv = (Vec2){f_set(0), f_set(0)};
    s.prim = i_set(0);
    s.valid = m_set(true);
    return s;
}

KFN Vec2 constant_uv(const SceneView *scene, const EmitterRecord *e, Vec3 d) {
    UNUSED(scene), UNUSED(e), UNUSED(d);
    return (Vec2){f_set(0), f_set(0)};
}

KFN Float constant_pdf(const SceneView *scene, const EmitterRecord *e, Vec3 d, Vec2 uv) {
    UNUSED(scene), UNUSED(e), UNUSED(d), UNUSED(uv);
    return f_set(INV_FOUR_PI);
}

KFN Spec constant_eval(const SceneView *scene, const Light *l, TexCoord uv, Float distance) {
    UNUSED(distance);
    return light_colour(scene, l, SLOT(Constant, radiance), uv);
}

KFN void constant_adj(const SceneView *scene, const Light *l, TexCoord uv, Float distance, Spec dl, LightMove *move,
                      Sink *sink, Mask m) {
    UNUSED(distance), UNUSED(move);
    light_colour_adj(scene, l, SLOT(Constant, radiance), uv, dl, NULL, sink, m);
}

KFN void constant_move_adj(const SceneView *scene, const Light *l, Vec3 ref, Vec3 d, Float distance,
                           LightMove *move, Sink *sink, Mask m) {
    UNUSED(scene), UNUSED(l), UNUSED(ref), UNUSED(d), UNUSED(distance), UNUSED(move), UNUSED(sink), UNUSED(m);
}

KFN void constant_pdf_adj(const SceneView *scene, const EmitterRecord *e, Vec3 d, Vec2 uv, Float dpdf, Sink *sink, Mask m) {
    UNUSED(scene), UNUSED(e), UNUSED(d), UNUSED(uv), UNUSED(dpdf), UNUSED(sink), UNUSED(m);
}
