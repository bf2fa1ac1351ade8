// point.h: intensity over squared distance, the same in all directions.
#pragma once

#include "emitter/light.h"

#define POINT_PARAMS(P)                                                                                                \
    P(SPECTRUM, intensity, 1, 0, INFINITY, "radiant intensity", "W/sr")                                                \
    P(POSITION, position, 0, -INFINITY, INFINITY, "position of the light", "scene units")
EMITTER_SLOTS(Point, POINT_PARAMS)

KFN LightSample point_sample(const SceneView *scene, const Light *l, Vec3 ref, Vec2 u) {
    UNUSED(u);
    const int slot = SLOT(Point, position);
    return light_at_point(ref, v3(light_place(scene, l, slot, 0), light_place(scene, l, slot, 1),
                                  light_place(scene, l, slot, 2)));
}

KFN Spec point_eval(const SceneView *scene, const Light *l, TexCoord uv, Float distance) {
    return spec_scale(light_colour(scene, l, SLOT(Point, intensity), uv), f_safe_rcp(distance * distance));
}

KFN void point_adj(const SceneView *scene, const Light *l, TexCoord uv, Float distance, Spec dl, LightMove *move,
                   Sink *sink, Mask m) {
    // L = I / distance^2
    Float rcp = f_safe_rcp(distance * distance);
    light_colour_adj(scene, l, SLOT(Point, intensity), uv, spec_scale(dl, rcp), NULL, sink, m);
    if (move) {
        Float along = spec_dot(dl, light_colour(scene, l, SLOT(Point, intensity), uv));
        move->distance = move->distance - 2.0f * along * rcp * f_safe_rcp(distance);
    }
}

KFN void point_move_adj(const SceneView *scene, const Light *l, Vec3 ref, Vec3 d, Float distance, LightMove *move,
                        Sink *sink, Mask m) {
    UNUSED(scene), UNUSED(ref);
    Vec3 dp = light_at_point_adj(d, distance, move);
    move->ref = v3_sub(move->ref, dp);
    light_place_adj(l, SLOT(Point, position), 0, dp.x, sink, m);
    light_place_adj(l, SLOT(Point, position), 1, dp.y, sink, m);
    light_place_adj(l, SLOT(Point, position), 2, dp.z, sink, m);
}
