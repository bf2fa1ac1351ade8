// projector.h: a camera that emits its picture: pi scale T(u, v) / (z^2 cos a), where z is the depth below the lens and a
// the angle from the axis, so that a white diffuse plane at depth 1 that faces it shows scale T. The uv of samples are
// the slopes x/z and y/z of the local direction. NOT differentiated here: the jump at the frustum's border.
#pragma once

#include "emitter/light.h"

#define PROJECTOR_PARAMS(P)                                                                                            \
    P(EMISSION, irradiance, 1, 0, INFINITY, "radiance of a white plane at depth 1", "W/(m^2 sr)")                      \
    P(REAL, scale, 1, -INFINITY, INFINITY, "factor on the picture", "")                                                \
    P(FOV, x_fov, 0, 1e-3f, 179.9f, "horizontal field of view", "degrees")                                             \
    P(POSE, to_world, 0, -INFINITY, INFINITY, "from the projector's space, which is a camera's", "")
EMITTER_SLOTS(Projector, PROJECTOR_PARAMS)

// Behind the inverse pose: half the extent of the picture at depth 1, along x and y.
enum { PROJECTOR_EXTENT = 12, PROJECTOR_TABLE = 14 };

static inline int64_t projector_size(const TextureNode *textures, const EmitterRecord *e) {
    UNUSED(textures), UNUSED(e);
    return PROJECTOR_TABLE;
}
static inline bool projector_follow(const SceneView *view, const EmitterRecord *e) {
    const TextureNode *t = view->textures + e->slot[SLOT(Projector, irradiance)];
    double half = 0.5 * 3.14159265358979323846 / 180 *
                  (double)view->theta[view->textures[e->slot[SLOT(Projector, x_fov)]].theta];
    double aspect = t->kind == TEXTURE_BITMAP ? (double)t->width / t->height : 1;
    view->tables[e->table + PROJECTOR_EXTENT] = (float)tan(half);
    view->tables[e->table + PROJECTOR_EXTENT + 1] = (float)(tan(half) / aspect);
    return light_pose_follow(view, e, SLOT(Projector, to_world));
}

typedef struct ProjectorBeam {
    Float weight, secant2, x, y; // weight: pi / (distance^2 cos^3)
    Mask inside;
    TexCoord uv;
} ProjectorBeam;

KFN ProjectorBeam projector_beam(const SceneView *scene, const Light *l, TexCoord slope, Float distance) {
    ProjectorBeam b;
    b.x = light_table(scene, l, PROJECTOR_EXTENT);
    b.y = light_table(scene, l, PROJECTOR_EXTENT + 1);
    b.inside = m_lt(f_abs(slope.x), b.x) & m_lt(f_abs(slope.y), b.y);
    b.uv = texcoord((Vec2){0.5f - 0.5f * slope.x / b.x, 0.5f - 0.5f * slope.y / b.y}, NULL);
    b.secant2 = 1.0f + slope.x * slope.x + slope.y * slope.y;
    b.weight = f_zero_unless(b.inside, PI * b.secant2 * f_sqrt(b.secant2) * f_safe_rcp(distance * distance));
    return b;
}

// Accumulates the adjoint of half the picture's extent along x, to which that along y is in proportion.
KFN void projector_extent_adj(const SceneView *scene, const Light *l, Float d, Sink *sink, Mask m) {
    const Float x = light_table(scene, l, PROJECTOR_EXTENT);
    light_place_adj(l, SLOT(Projector, x_fov), 0, d * (1.0f + x * x) * (0.5f * TO_RADIANS), sink, m); // tan(x_fov / 2)
}

KFN LightSample projector_sample(const SceneView *scene, const Light *l, Vec3 ref, Vec2 u) {
    UNUSED(u);
    return light_along_slope(scene, l, SLOT(Projector, to_world), ref);
}

KFN Spec projector_eval(const SceneView *scene, const Light *l, TexCoord slope, Float distance) {
    ProjectorBeam b = projector_beam(scene, l, slope, distance);
    return spec_scale(light_colour(scene, l, SLOT(Projector, irradiance), b.uv),
                      b.weight * light_real(scene, l, SLOT(Projector, scale)));
}

KFN void projector_adj(const SceneView *scene, const Light *l, TexCoord slope, Float distance, Spec dl, LightMove *move,
                       Sink *sink, Mask m) {
    ProjectorBeam b = projector_beam(scene, l, slope, distance);
    Float scale = light_real(scene, l, SLOT(Projector, scale));
    Vec2 duv = {f_set(0), f_set(0)};
    // L = w scale T(uv)
    light_colour_adj(scene, l, SLOT(Projector, irradiance), b.uv, spec_scale(dl, b.weight * scale), &duv, sink, m);
    Float along = spec_dot(dl, light_colour(scene, l, SLOT(Projector, irradiance), b.uv)) * b.weight;
    light_real_adj(scene, l, SLOT(Projector, scale), along, sink, m);
    // w = pi (1 + |slope|^2)^(3/2) / distance^2, uv = 1/2 - slope / (2 extent)
    Float by_extent = 0.5f * (duv.x * slope.x / b.x + duv.y * slope.y / b.y) / b.x;
    projector_extent_adj(scene, l, by_extent, sink, m);
    if (move) {
        Float by_slope = 3.0f * along * scale / b.secant2;
        move->uv.x = move->uv.x + by_slope * slope.x - 0.5f * duv.x / b.x;
        move->uv.y = move->uv.y + by_slope * slope.y - 0.5f * duv.y / b.y;
        move->distance = move->distance - 2.0f * along * scale * f_safe_rcp(distance);
    }
}

KFN void projector_move_adj(const SceneView *scene, const Light *l, Vec3 ref, Vec3 d, Float distance,
                            LightMove *move, Sink *sink, Mask m) {
    slope_move_adj(scene, l, SLOT(Projector, to_world), ref, d, distance, move, sink, m);
}
