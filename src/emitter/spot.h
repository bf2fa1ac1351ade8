// spot.h: a point light along its local +z axis. The intensity is whole up to beam_width from the axis and falls
// linearly in the angle to 0 at cutoff_angle; a texture over the cone's tangent square filters it. The uv of samples are
// the slopes x/z and y/z of the local direction. NOT differentiated: the jump at the cutoff where the two angles agree.
#pragma once

#include "emitter/light.h"

#define SPOT_PARAMS(P)                                                                                                 \
    P(SPECTRUM, intensity, 1, 0, INFINITY, "radiant intensity on the axis", "W/sr")                                    \
    P(REAL, cutoff_angle, 20, 1e-3f, 89.9f, "angle from the axis beyond which nothing is emitted", "degrees")          \
    P(FRACTION, beam_width, 0.75f, 0, 89.9f, "angle from the axis up to which the intensity is whole", "degrees")             \
    P(COLOUR, texture, 1, 0, INFINITY, "factor on the intensity, over the cone", "")                                   \
    P(POSE, to_world, 0, -INFINITY, INFINITY, "from the light's space", "")
EMITTER_SLOTS(Spot, SPOT_PARAMS)

static inline int64_t spot_size(const TextureNode *textures, const EmitterRecord *e) {
    UNUSED(textures), UNUSED(e);
    return 12;
}
static inline bool spot_follow(const SceneView *view, const EmitterRecord *e) {
    return light_pose_follow(view, e, SLOT(Spot, to_world));
}

// What arrives along a slope: the falloff, its derivatives, and where the texture is read.
typedef struct SpotBeam {
    Float angle, cutoff, width, falloff, tangent, radius2;
    Mask edge;   // between beam and cutoff
    TexCoord uv;
} SpotBeam;

KFN SpotBeam spot_beam(const SceneView *scene, const Light *l, TexCoord slope) {
    SpotBeam b;
    Float sine, cosine;
    b.cutoff = light_real(scene, l, SLOT(Spot, cutoff_angle)) * TO_RADIANS;
    Float beam = light_real(scene, l, SLOT(Spot, beam_width)) * TO_RADIANS;
    b.radius2 = slope.x * slope.x + slope.y * slope.y;
    b.angle = f_atan2(f_sqrt(b.radius2), f_set(1));
    b.width = b.cutoff - beam;
    Mask soft = m_gt(b.width, f_set(1e-6f));
    Float edge = (b.cutoff - b.angle) / f_select(soft, b.width, f_set(1));
    b.edge = soft & m_gt(b.angle, beam) & m_lt(b.angle, b.cutoff);
    b.falloff = f_zero_unless(m_lt(b.angle, b.cutoff), f_select(b.edge, edge, f_set(1)));
    f_sincos(b.cutoff, &sine, &cosine);
    b.tangent = sine / cosine;
    b.uv = texcoord((Vec2){0.5f + 0.5f * slope.x / b.tangent, 0.5f + 0.5f * slope.y / b.tangent}, NULL);
    return b;
}

KFN LightSample spot_sample(const SceneView *scene, const Light *l, Vec3 ref, Vec2 u) {
    UNUSED(u);
    return light_along_slope(scene, l, SLOT(Spot, to_world), ref);
}

KFN Spec spot_eval(const SceneView *scene, const Light *l, TexCoord slope, Float distance) {
    SpotBeam b = spot_beam(scene, l, slope);
    Spec s = spec_mul(light_colour(scene, l, SLOT(Spot, intensity), b.uv), light_colour(scene, l, SLOT(Spot, texture), b.uv));
    return spec_scale(s, b.falloff * f_safe_rcp(distance * distance));
}

KFN void spot_adj(const SceneView *scene, const Light *l, TexCoord slope, Float distance, Spec dl, LightMove *move,
                  Sink *sink, Mask m) {
    SpotBeam b = spot_beam(scene, l, slope);
    Spec intensity = light_colour(scene, l, SLOT(Spot, intensity), b.uv);
    Spec filter = light_colour(scene, l, SLOT(Spot, texture), b.uv);
    Float rcp = f_safe_rcp(distance * distance);
    // L = I T falloff / distance^2
    Spec d = spec_scale(dl, b.falloff * rcp);
    Vec2 duv = {f_set(0), f_set(0)};
    light_colour_adj(scene, l, SLOT(Spot, intensity), b.uv, spec_mul(d, filter), &duv, sink, m);
    light_colour_adj(scene, l, SLOT(Spot, texture), b.uv, spec_mul(d, intensity), &duv, sink, m);
    Float along = spec_dot(dl, spec_mul(intensity, filter)) * rcp;
    // falloff = (cutoff - angle) / (cutoff - beam) at the edge
    Float de = f_zero_unless(b.edge, along / f_select(b.edge, b.width, f_set(1)));
    // uv = 1/2 + slope / (2 tan cutoff); d tan = 1 + tan^2
    Float by_tangent = -0.5f * (duv.x * slope.x + duv.y * slope.y) / (b.tangent * b.tangent);
    Float dcutoff = de * (1.0f - b.falloff) + by_tangent * (1.0f + b.tangent * b.tangent);
    light_real_adj(scene, l, SLOT(Spot, cutoff_angle), dcutoff * TO_RADIANS, sink, m);
    light_real_adj(scene, l, SLOT(Spot, beam_width), de * b.falloff * TO_RADIANS, sink, m);
    if (move) {
        // angle = atan |slope|
        Float by_slope = -de * f_safe_rcp((1.0f + b.radius2) * f_sqrt(b.radius2));
        move->uv.x = move->uv.x + by_slope * slope.x + 0.5f * duv.x / b.tangent;
        move->uv.y = move->uv.y + by_slope * slope.y + 0.5f * duv.y / b.tangent;
        move->distance = move->distance - 2.0f * along * b.falloff * f_safe_rcp(distance);
    }
}

KFN void spot_move_adj(const SceneView *scene, const Light *l, Vec3 ref, Vec3 d, Float distance, LightMove *move,
                       Sink *sink, Mask m) {
    slope_move_adj(scene, l, SLOT(Spot, to_world), ref, d, distance, move, sink, m);
}
