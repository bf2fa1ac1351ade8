// shape.h: dispatch over the kinds of surface, generated from kinds.inl. Kind and flags are uniform over the lanes: they
// are part of the shading group.
#pragma once

#include "shape/curve.h"
#include "shape/cylinder.h"
#include "shape/disk.h"
#include "shape/instance.h"
#include "shape/mesh.h"
#include "shape/sdfgrid.h"
#include "shape/sphere.h"

// Parameters of a plugin that are folded into its pose: P(form, name, x, y, z, description), form POINT (three numbers)
// or LENGTH (one positive number).
#define NO_SHAPE_PARAMS(P)

enum {
#define SHAPE_MESH_KIND(ENUM, prefix) SHAPE_##ENUM,
#define SHAPE_POSED(ENUM, prefix, ...) SHAPE_##ENUM,
#define SHAPE_CURVE(ENUM, prefix, ...) SHAPE_##ENUM,
#include "shape/kinds.inl"
#undef SHAPE_MESH_KIND
#undef SHAPE_POSED
#undef SHAPE_CURVE
    SHAPE_KIND_COUNT
};

#define SHAPE_MESH_KIND SHAPE_CASE
#define SHAPE_POSED SHAPE_CASE
#define SHAPE_CURVE SHAPE_CASE

KFN Interaction surface_interaction(const SceneView *scene, int32_t kind, int32_t flags, const Hit *hit) {
    switch (kind) {
#define SHAPE_CASE(ENUM, prefix, ...)                                                                                  \
    case SHAPE_##ENUM:                                                                                                 \
        return prefix##_interaction(scene, flags, hit);
    default:
#include "shape/kinds.inl"
#undef SHAPE_CASE
    }
}

KFN Interaction shape_interaction(const SceneView *scene, int32_t kind, int32_t flags, const Hit *hit) {
    if (flags & SHAPE_INSTANCED) {
        Hit local = instance_hit(scene, hit);
        Interaction si = surface_interaction(scene, kind, flags, &local);
        return instance_interaction(scene, hit, &si);
    }
    return surface_interaction(scene, kind, flags, hit);
}

#undef SHAPE_CURVE
#define SHAPE_CURVE(...) // no lights

// A point of shape `id` to connect ref with.
KFN Hit shape_sample(const SceneView *scene, int32_t id, Vec3 ref, Vec2 u) {
    switch (scene->shapes[id].kind) {
#define SHAPE_CASE(ENUM, prefix, ...)                                                                                  \
    case SHAPE_##ENUM:                                                                                                 \
        return prefix##_sample(scene, id, ref, u);
    default:
#include "shape/kinds.inl"
#undef SHAPE_CASE
    }
}

// Where uv lies on shape `id`, of those that give light and are no meshes.
KFN Vec3 shape_point(const SceneView *scene, int32_t id, Vec2 uv) {
    const int32_t kind = scene->shapes[id].kind;
    Int at = i_set(scene->shapes[id].table);
    return kind == SHAPE_SPHERE ? sphere_point(scene, at, uv)
           : kind == SHAPE_DISK ? disk_point(scene, at, uv)
                                : cylinder_point(scene, at, uv);
}

// Distance of x from tubes, which all lanes of *hit lie on, as bspline_distance; of those in shapegroups in units of these, with
// the gradient in the world.
KFN Float tube_distance(const SceneView *scene, Hit *hit, Vec3 x, Vec3 *gradient) {
    Mask inside = mi_lt(i_set(-1), SHAPE_FIELD(scene, hit->shape, collection));
    if (!m_any(inside)) {
        return bspline_distance(scene, hit, x, gradient);
    }
    hit->instance = i_select(inside, hit->instance, i_set(0));
    Int at = instance_table(scene, hit);
    Float distance = bspline_distance(scene, hit, v3_select(inside, pose_to_local(scene, at, x), x), gradient);
    *gradient = v3_select(inside, pose_gradient(scene, at, *gradient), *gradient);
    return distance;
}

// Kinds whose points and numbers move.h knows how to move; all slide.
KFN bool shape_moves(int32_t kind) {
    return kind == SHAPE_MESH || kind == SHAPE_SPHERE || kind == SHAPE_DISK || kind == SHAPE_CYLINDER ||
           kind == SHAPE_BSPLINE;
}

// With a shape of the same kind per lane, of kinds that know how.
KFN bool shape_samples_many(int32_t kind) { return kind == SHAPE_MESH || kind == SHAPE_SPHERE || kind == SHAPE_DISK; }

KFN Hit shape_sample_many(const SceneView *scene, int32_t kind, Int id, Vec3 ref, Vec2 u) {
    return kind == SHAPE_SPHERE ? sphere_sample_many(scene, id, ref, u)
           : kind == SHAPE_DISK ? disk_sample_many(scene, id, ref, u)
                                : mesh_sample_many(scene, id, u);
}

KFN Float shape_pdf_many(const SceneView *scene, int32_t kind, Int id, Vec3 ref, Vec3 d, const Interaction *si) {
    return kind == SHAPE_SPHERE ? sphere_pdf_many(scene, id, ref, d, si)
                                : area_density(ref, d, si, SHAPE_FLOAT(scene, id, area));
}

// Density per solid angle with which shape_sample finds the point si along d.
KFN Float shape_pdf(const SceneView *scene, int32_t id, Vec3 ref, Vec3 d, const Interaction *si) {
    switch (scene->shapes[id].kind) {
#define SHAPE_CASE(ENUM, prefix, ...)                                                                                  \
    case SHAPE_##ENUM:                                                                                                 \
        return prefix##_pdf(scene, id, ref, d, si);
    default:
#include "shape/kinds.inl"
#undef SHAPE_CASE
    }
}

#undef SHAPE_MESH_KIND
#undef SHAPE_POSED
#undef SHAPE_CURVE
