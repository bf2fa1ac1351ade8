// touch.h: borders of media that lie in other surfaces (SceneView.borders_touch), as that of a box of fog which stands on a floor,
// or beside another one. Embree meets one of the two, whichever it is, and rays step over both: so that the other one counts as
// well, it is looked for. Surfaces that scatter are met in the place of the border that lies in them; of two borders the ray
// crosses first the one whose near side is the medium that it comes from. Of three surfaces in one plane, one is lost.
#pragma once

#include "accel/trace.h"
#include "bsdf/bsdf.h"
#include "shape/shape.h"

enum { MOST_SURFACES_IN_A_ROW = 64 }; // a ray that meets more is taken to be blocked

// Lanes of m whose shapes are of the kind null.
KFN Mask null_lanes(const SceneView *scene, Int shape, Mask m) {
    Int groups = SHAPE_FIELD(scene, i_max(shape, i_set(0)), group);
    Mask null = m_set(false);
    for (Mask left = m, mine; m_any(left); left = left & ~mine) {
        int32_t id = i_lane(groups, m_first(left));
        mine = left & mi_eq(groups, i_set(id));
        null = null | (mine & m_set(scene->bsdfs[scene->groups[id].bsdf].kind == BSDF_NULL));
    }
    return null;
}

// What a ray meets where Embree says that it meets `hit`.
static NOINLINE Hit hit_touching(const SceneView *scene, const Hit *hit, const Ray *ray, Mask m) {
    m = null_lanes(scene, hit->shape, m & mi_lt(i_set(-1), hit->shape));
    if (!m_any(m)) {
        return *hit;
    }
    Float left = ray->tmax - v3_dot(v3_sub(hit->p, ray->o), ray->d);
    Hit other = trace_beside(scene, hit, ray->d, interaction_step(hit->p), left, m);
    Mask found = m & mi_lt(i_set(-1), other.shape), takes = found & ~null_lanes(scene, other.shape, found);
    return hit_select(takes, &other, hit);
}

// Closest hits on surfaces that are not of the kind null.
static NOINLINE Hit trace_solid(const SceneView *scene, const Ray *given, Mask m) {
    Ray ray = *given;
    Hit hit = trace_closest(scene, &ray, m, false);
    Mask left = scene->has_media ? m : m_set(false);
    for (int i = 0; i < MOST_SURFACES_IN_A_ROW && m_any(left); i++) {
        hit = scene->borders_touch ? hit_touching(scene, &hit, &ray, left) : hit;
        left = null_lanes(scene, hit.shape, left & mi_lt(i_set(-1), hit.shape));
        if (!m_any(left)) {
            break;
        }
        Vec3 o = v3_madd(hit.p, interaction_step(hit.p), ray.d);
        ray.tmax = f_select(left, ray.tmax - v3_dot(v3_sub(o, ray.o), ray.d), ray.tmax);
        ray.o = v3_select(left, o, ray.o);
        Hit next = trace_closest(scene, &ray, left, false);
        hit = hit_select(left, &next, &hit);
    }
    return hit;
}
