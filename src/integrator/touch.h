// touch.h: borders of media that lie in other surfaces (SceneView.borders_touch), as that of a box of fog which stands on a floor,
// or beside another one. Embree meets one of the two, whichever it is, and rays step over both: so that the other one counts as
// well, it is looked for. Surfaces that scatter are met in the place of the border that lies in them; of two borders the ray
// crosses first the one whose near side is the medium that it comes from. Of three surfaces in one plane, one is lost.
#pragma once

#include "accel/trace.h"
#include "bsdf/bsdf.h"
#include "shape/shape.h"

enum { MOST_SURFACES_IN_A_ROW = 64 }; // a ray that meets more is taken to be blocked

static inline bool node_is_null(const BsdfNode *node) { return node->kind == BSDF_NULL; }
static inline bool node_spreads(const BsdfNode *node) { return node->spreads; }

// Lanes of m, all of which have a shape, whose functions are so. The others may have any number for one.
KFN Mask lanes_that(bool (*are)(const BsdfNode *node), const SceneView *scene, Int shape, Mask m) {
    Int groups = SHAPE_FIELD(scene, i_select(m, shape, i_set(0)), group);
    Mask found = m_set(false);
    for (Mask left = m, mine; m_any(left); left = left & ~mine) {
        int32_t id = i_lane(groups, m_first(left));
        mine = left & mi_eq(groups, i_set(id));
        found = found | (mine & m_set(are(scene->bsdfs + scene->groups[id].bsdf)));
    }
    return found;
}

// Lanes of m whose shapes are of the kind null.
KFN Mask null_lanes(const SceneView *scene, Int shape, Mask m) { return lanes_that(node_is_null, scene, shape, m); }

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
