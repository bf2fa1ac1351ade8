// emitter.h: dispatch over the kinds of light, generated from kinds.inl: sampling towards a point, evaluation where a
// ray meets them, densities, and adjoints. NOT differentiated: the shapes of lights that are surfaces.
#pragma once

#include "emitter/area.h"
#include "emitter/constant.h"
#include "emitter/directional.h"
#include "emitter/directionalarea.h"
#include "emitter/envmap.h"
#include "emitter/point.h"
#include "emitter/projector.h"
#include "emitter/spot.h"

enum {
#define EMITTER_SURFACE(ENUM, ...) EMITTER_##ENUM,
#define EMITTER_ENVIRONMENT EMITTER_SURFACE
#define EMITTER_DELTA EMITTER_SURFACE
#include "emitter/kinds.inl"
#undef EMITTER_SURFACE
#undef EMITTER_ENVIRONMENT
#undef EMITTER_DELTA
    EMITTER_KIND_COUNT
};

// Kinds of which every point sees one direction only: bits.
enum {
    EMITTER_DELTA_KINDS = 0
#define EMITTER_SURFACE(...)
#define EMITTER_ENVIRONMENT(...)
#define EMITTER_DELTA(ENUM, ...) | 1 << EMITTER_##ENUM
#include "emitter/kinds.inl"
#undef EMITTER_SURFACE
#undef EMITTER_ENVIRONMENT
#undef EMITTER_DELTA
};

// Where in theta the coordinates of a light's position are, in the world; false of lights that are not at a point.
KFN bool emitter_place(const EmitterRecord *e, int32_t at[3]) {
    const bool point = e->kind == EMITTER_POINT, spot = e->kind == EMITTER_SPOT;
    const int pose = spot ? SLOT(Spot, to_world) : SLOT(Projector, to_world);
    for (int k = 0; k < 3; k++) {
        at[k] = point ? e->slot[SLOT(Point, position)] + k : e->slot[pose] + 4 * k + 3;
    }
    return point || spot || e->kind == EMITTER_PROJECTOR;
}

KFN bool emitter_is_delta(const EmitterRecord *e) { return EMITTER_DELTA_KINDS >> e->kind & 1; }

#define EMITTER_SURFACE EMITTER_CASE
#define EMITTER_ENVIRONMENT EMITTER_CASE
#define EMITTER_DELTA EMITTER_CASE

KFN LightSample emitter_sample_as(const SceneView *scene, const Light *l, Vec3 ref, Vec2 u) {
    switch (l->e->kind) {
#define EMITTER_CASE(ENUM, prefix, ...)                                                                                \
    case EMITTER_##ENUM:                                                                                               \
        return prefix##_sample(scene, l, ref, u);
    default:
#include "emitter/kinds.inl"
#undef EMITTER_CASE
    }
}

KFN Spec emitter_eval_as(const SceneView *scene, const Light *l, TexCoord uv, Float distance) {
    switch (l->e->kind) {
#define EMITTER_CASE(ENUM, prefix, ...)                                                                                \
    case EMITTER_##ENUM:                                                                                               \
        return prefix##_eval(scene, l, uv, distance);
    default:
#include "emitter/kinds.inl"
#undef EMITTER_CASE
    }
}

KFN void emitter_adj_as(const SceneView *scene, const Light *l, TexCoord uv, Float distance, Spec dl, LightMove *move,
                        Sink *sink, Mask m) {
    switch (l->e->kind) {
#define EMITTER_CASE(ENUM, prefix, ...)                                                                                \
    case EMITTER_##ENUM:                                                                                               \
        prefix##_adj(scene, l, uv, distance, dl, move, sink, m);                                                       \
        break;
#include "emitter/kinds.inl"
#undef EMITTER_CASE
    default:
        break;
    }
}

#undef EMITTER_SURFACE
#define EMITTER_SURFACE(...)

KFN void emitter_move_adj_as(const SceneView *scene, const Light *l, Vec3 ref, Vec3 d, Float distance,
                             LightMove *move, Sink *sink, Mask m) {
    switch (l->e->kind) {
#define EMITTER_CASE(ENUM, prefix, ...)                                                                                \
    case EMITTER_##ENUM:                                                                                               \
        prefix##_move_adj(scene, l, ref, d, distance, move, sink, m);                                                  \
        break;
#include "emitter/kinds.inl"
#undef EMITTER_CASE
    default:
        break;
    }
}

#undef EMITTER_ENVIRONMENT
#undef EMITTER_DELTA
#define EMITTER_DELTA(...)

// ---- environments: where the light is read along a direction, and its density there ------------------------------

#define EMITTER_ENVIRONMENT EMITTER_CASE
KFN Vec2 environment_uv(const SceneView *scene, const EmitterRecord *e, Vec3 d) {
    switch (e->kind) {
#define EMITTER_CASE(ENUM, prefix, ...)                                                                                \
    case EMITTER_##ENUM:                                                                                               \
        return prefix##_uv(scene, e, d);
    default:
#include "emitter/kinds.inl"
#undef EMITTER_CASE
    }
}

KFN Float environment_pdf(const SceneView *scene, const EmitterRecord *e, Vec3 d, Vec2 uv) {
    switch (e->kind) {
#define EMITTER_CASE(ENUM, prefix, ...)                                                                                \
    case EMITTER_##ENUM:                                                                                               \
        return prefix##_pdf(scene, e, d, uv);
    default:
#include "emitter/kinds.inl"
#undef EMITTER_CASE
    }
}

KFN void environment_pdf_adj(const SceneView *scene, const EmitterRecord *e, Vec3 d, Vec2 uv, Float dpdf, Sink *sink, Mask m) {
    switch (e->kind) {
#define EMITTER_CASE(ENUM, prefix, ...)                                                                                \
    case EMITTER_##ENUM:                                                                                               \
        prefix##_pdf_adj(scene, e, d, uv, dpdf, sink, m);                                                              \
        break;
#include "emitter/kinds.inl"
#undef EMITTER_CASE
    default:
        break;
    }
}
#undef EMITTER_ENVIRONMENT
#define EMITTER_ENVIRONMENT(...)

// ---- surfaces ----------------------------------------------------------------------------------------------------

#undef EMITTER_SURFACE
#define EMITTER_SURFACE EMITTER_CASE
// Density with which a surface is sampled from ref along d to its point si.
KFN Float surface_light_pdf(const SceneView *scene, const EmitterRecord *e, Vec3 ref, Vec3 d, const Interaction *si) {
    switch (e->kind) {
#define EMITTER_CASE(ENUM, prefix, ...)                                                                                \
    case EMITTER_##ENUM:                                                                                               \
        return prefix##_pdf(scene, e, ref, d, si);
    default:
#include "emitter/kinds.inl"
#undef EMITTER_CASE
    }
}
#undef EMITTER_SURFACE
#undef EMITTER_ENVIRONMENT
#undef EMITTER_DELTA

// ---- one light for all lanes -------------------------------------------------------------------------------------

KFN LightSample emitter_sample(const SceneView *scene, const EmitterRecord *e, Vec3 ref, Vec2 u) {
    Light l = light_alone(e, i_set(0));
    return emitter_sample_as(scene, &l, ref, u);
}

// Where the texture of a sampled light is read. hit: room for the point that it is read at.
KFN TexCoord emitter_texcoord(const SceneView *scene, const EmitterRecord *e, Vec2 uv, Int prim, Hit *hit) {
    if (!e->attributes) {
        return texcoord(uv, NULL);
    }
    if (scene->shapes[e->shape].kind != SHAPE_MESH) {
        *hit = hit_at(e->shape, shape_point(scene, e->shape, uv));
        return texcoord(uv, hit);
    }
    *hit = (Hit){i_set(e->shape), prim, uv.x, uv.y, v3_zero(), i_set(0)};
    Interaction si = mesh_interaction(scene, scene->shapes[e->shape].flags, hit);
    hit->p = si.p;
    return texcoord(si.uv, hit);
}

// What arrives from a light sample: radiance, or of delta lights the irradiance of a facing plane.
KFN Spec emitter_eval(const SceneView *scene, const EmitterRecord *e, TexCoord uv, Float distance) {
    Light l = light_alone(e, i_set(0));
    return emitter_eval_as(scene, &l, uv, distance);
}

// Accumulates the adjoint of emitter_eval into the light's own parameters, and into move (may be null). id: of the light.
KFN void emitter_adj(const SceneView *scene, int32_t id, TexCoord uv, Float distance, Spec dl, LightMove *move,
                     Sink *sink, Mask m) {
    Light l = light_alone(scene->emitters + id, i_set(id));
    emitter_adj_as(scene, &l, uv, distance, dl, move, sink, m);
}

// Accumulates the adjoint of the sample's place into the light's position or pose.
KFN void emitter_move_adj(const SceneView *scene, int32_t id, Vec3 ref, Vec3 d, Float distance, LightMove *move,
                          Sink *sink, Mask m) {
    Light l = light_alone(scene->emitters + id, i_set(id));
    emitter_move_adj_as(scene, &l, ref, d, distance, move, sink, m);
}
