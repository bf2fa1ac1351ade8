// directional.h: parallel light along the local +z axis; irradiance is that of a facing plane, anywhere.
#pragma once

#include "emitter/light.h"

#define DIRECTIONAL_PARAMS(P)                                                                                          \
    P(SPECTRUM, irradiance, 1, 0, INFINITY, "irradiance of a facing plane", "W/m^2")                                   \
    P(AXIS, to_world, 0, -INFINITY, INFINITY, "turns +z into the direction in which the light travels", "")
EMITTER_SLOTS(Directional, DIRECTIONAL_PARAMS)

KFN Vec3 directional_axis(const SceneView *scene, const Light *l) {
    const int slot = SLOT(Directional, to_world);
    return v3(light_place(scene, l, slot, 2), light_place(scene, l, slot, 6), light_place(scene, l, slot, 10));
}

KFN LightSample directional_sample(const SceneView *scene, const Light *l, Vec3 ref, Vec2 u) {
    UNUSED(ref), UNUSED(u);
    LightSample s;
    s.d = v3_neg(v3_normalize(directional_axis(scene, l)));
    s.distance = f_set(2 * (real)scene->bounds_radius);
    s.pdf = f_set(1);
    s.uv = (Vec2){f_set(0), f_set(0)};
    s.prim = i_set(0);
    s.valid = m_set(true);
    return s;
}

KFN Spec directional_eval(const SceneView *scene, const Light *l, TexCoord uv, Float distance) {
    UNUSED(distance);
    return light_colour(scene, l, SLOT(Directional, irradiance), uv);
}

KFN void directional_adj(const SceneView *scene, const Light *l, TexCoord uv, Float distance, Spec dl, LightMove *move,
                         Sink *sink, Mask m) {
    UNUSED(distance), UNUSED(move);
    light_colour_adj(scene, l, SLOT(Directional, irradiance), uv, dl, NULL, sink, m);
}

KFN void directional_move_adj(const SceneView *scene, const Light *l, Vec3 ref, Vec3 d, Float distance,
                              LightMove *move, Sink *sink, Mask m) {
    UNUSED(ref), UNUSED(d), UNUSED(distance);
    // d = -normalize(axis)
    Vec3 da = v3_zero();
    v3_normalize_adj(directional_axis(scene, l), v3_neg(move->d), &da);
    light_place_adj(l, SLOT(Directional, to_world), 2, da.x, sink, m);
    light_place_adj(l, SLOT(Directional, to_world), 6, da.y, sink, m);
    light_place_adj(l, SLOT(Directional, to_world), 10, da.z, sink, m);
}
