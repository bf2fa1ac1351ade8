// spheres.h: rays against the few spheres that stand in the scene by themselves, all lanes against one sphere after the
// other. Embree meets spheres one ray at a time, as curves; up to MOST_OWN_SPHERES of them this is faster.
#pragma once

#include "scene/ray.h"
#include "shape/shape.h"

// The squared reciprocal length of the rays' directions, and where a line through a sphere is inside it.
typedef struct SphereChord {
    Mask meets;
    Float front, back; // distances
} SphereChord;

KFN SphereChord sphere_chord(const float *sphere, const Ray *ray, Float rcp_length2, Mask m) {
    // By the distance of the line from the centre, which keeps its digits when the sphere is far away.
    SphereChord c;
    Vec3 to_centre = v3_sub(v3(f_set(sphere[0]), f_set(sphere[1]), f_set(sphere[2])), ray->o);
    Float nearest = v3_dot(to_centre, ray->d) * rcp_length2;
    Vec3 offset = v3_madd(to_centre, -nearest, ray->d);
    Float rest = sphere[3] * sphere[3] - v3_dot(offset, offset);
    c.meets = m & m_ge(rest, f_set(0));
    c.front = c.back = nearest;
    if (m_any(c.meets)) {
        Float half = f_safe_sqrt(rest * rcp_length2);
        c.front = nearest - half;
        c.back = nearest + half;
    }
    return c;
}

KFN const float *sphere_table(const SceneView *scene, int32_t i) {
    return scene->tables + scene->shapes[scene->own_spheres[i]].table;
}

// Which surfaces rays are to meet: those that let no light pass, those that let some pass, or both.
enum { MEET_SOLID = 1, MEET_OPEN = 2, MEET_ALL = 3 };

KFN bool sphere_is(const SceneView *scene, int32_t i, int which) {
    const ShapeRecord *shape = scene->shapes + scene->own_spheres[i];
    return (which & (scene->bsdfs[shape->bsdf].transmits ? MEET_OPEN : MEET_SOLID)) != 0;
}

// Distances of the closest spheres of a sort within the rays' ranges, else tmax; *shape: their numbers, else -1.
KFN Float spheres_meet(const SceneView *scene, const Ray *ray, int which, Mask m, Int *shape) {
    Float rcp_length2 = f_safe_rcp(v3_dot(ray->d, ray->d)), t = ray->tmax;
    *shape = i_set(-1);
    for (int32_t i = 0; i < scene->own_spheres_count; i++) {
        if (!sphere_is(scene, i, which)) {
            continue;
        }
        SphereChord c = sphere_chord(sphere_table(scene, i), ray, rcp_length2, m);
        if (m_any(c.meets)) {
            Float at = f_select(m_gt(c.front, f_set(0)), c.front, c.back);
            Mask closer = c.meets & m_gt(at, f_set(0)) & m_lt(at, t);
            t = f_select(closer, at, t);
            *shape = i_select(closer, i_set(scene->own_spheres[i]), *shape);
        }
    }
    return t;
}

// Lanes in whose way a sphere of a sort is.
KFN Mask spheres_block(const SceneView *scene, const Ray *ray, int which, Mask m) {
    Float rcp_length2 = f_safe_rcp(v3_dot(ray->d, ray->d));
    Mask blocked = m_set(false);
    for (int32_t i = 0; i < scene->own_spheres_count; i++) {
        if (!sphere_is(scene, i, which)) {
            continue;
        }
        SphereChord c = sphere_chord(sphere_table(scene, i), ray, rcp_length2, m);
        if (m_any(c.meets)) {
            Mask front = m_gt(c.front, f_set(0)) & m_lt(c.front, ray->tmax);
            Mask back = m_gt(c.back, f_set(0)) & m_lt(c.back, ray->tmax);
            blocked = blocked | (c.meets & (front | back));
        }
    }
    return blocked;
}
