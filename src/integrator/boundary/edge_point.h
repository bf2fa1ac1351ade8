// edge_point.h: a point of a curve along which pictures jump, and which curve it is on.
#pragma once

#include "integrator/boundary/boundary_job.h"
#include "integrator/path_move.h"

// A point x(t) of an edge, attached to its surface.
typedef struct EdgePoint {
    Hit hit;
    Vec3 p, tangent;    // tangent: dx/dt
    Vec3 side[2];       // from the edge into its surfaces; the second one only where it is not open
    Mask open, crease;
    Int other;          // the second triangle, or EDGE_
    Int fan, fan_count; // see EdgeRecord; 0 where none
    Int sides, side_count; // the same; the first of these is side[1]
    Vec3 origin;        // of a mesh's edge: its first vertex, in its own space
    Mask round;         // which points it has depends on the eye
    Vec3 inner, middle; // of round ones: the point beside it whose normal is turned to the eye by OUTLINE_TURN; a point inside,
                        // wherever the eye is
    Vec3 outside;       // what is seen there can be seen by rays against it alone, since tubes have no inside; 0 = by all
    Float probability;  // of the edge, over the part of its parameter that counts: dP/dt
    // Where the shading normal n turns away from the viewer, along F = n . view = 0: n, the vector to the viewer, and how far
    // over the surface F rises by 1. Of lines of textures, F is the step that is a whole number there, and `rise` that of it.
    // Elsewhere 0.
    Vec3 normal, view, rise;
    Mask meeting;       // where the surface passes through that of the hit `met`, or through a light's border, where its
                        // shape is -1 and its prim the light or BORDER_; across: the normals of both
    Hit met;
    Vec3 across[2];
    Mask mark;          // a line of its surface's texture; beside: the points on both sides of it, the first one at side[0]
    Mask border;        // the border of a light on it, of which `beside` says the same
    Hit beside[2];
    Vec2 nudge[2];      // what is added to their uv
    Mask half;          // it lies on the surface's end, and moves with to_uv alone
    Int line;           // number of its mark, where its to_uv is selected, else -1
    Vec2 uv;
} EdgePoint;

// Lanes of curves along which a plane cuts what the sensor sees.
KFN Mask edge_clips(const EdgePoint *e) {
    return e->meeting & mi_lt(e->met.shape, i_set(0)) & mi_lt(e->met.prim, i_set(0));
}

// How narrow what is looked for on the film may be [pixels]: rounding of directions is some hundred times smaller.
KFN real film_resolution(const SensorRecord *sensor) {
    return sensor->width > 25 ? (real)4e-6 * (real)sensor->width : (real)1e-4;
}

// Which sample of its random numbers a slot stands for.
KFN void slot_number(Tracer *t, int32_t k, int64_t number) {
    t->ws.pixel[k] = (int32_t)(number / BOUNDARY_PER_SET);
    t->ws.sample[k] = (int32_t)(number % BOUNDARY_PER_SET);
}

// The slots i... of a batch stand for the samples first + i...
KFN void batch_numbers(Tracer *t, int32_t i, int64_t first) {
    for (int32_t k = i; k < i + LANES; k++) {
        slot_number(t, k, first + k);
    }
}

// Radians.
#define OUTLINE_TURN 1e-3f
// Half the angle between two directions on both sides of the plane at right angles to a normal.
#define NORMAL_TURN 1e-4f

#define EDGE_FIELD(job, i, field)                                                                                      \
    i_gather((const int32_t *)(job)->edges,                                                                            \
             (i) * (int32_t)(sizeof(EdgeRecord) / 4) + (int32_t)(offsetof(EdgeRecord, field) / 4))
#define EDGE_FLOAT(job, i, field)                                                                                      \
    f_gather((const float *)(job)->edges,                                                                              \
             (i) * (int32_t)(sizeof(EdgeRecord) / 4) + (int32_t)(offsetof(EdgeRecord, field) / 4))

KFN Int edge_choose(const BoundaryJob *b, Float u, Float *probability) {
    Int low = i_set(0), high = i_set(b->edge_count - 1);
    for (int32_t left = b->edge_count; left > 1; left = (left + 1) / 2) {
        Int middle = (low + high) >> 1;
        Mask right = m_le(f_gather(b->cdf, middle), u) & mi_lt(low, high);
        low = i_select(right, middle + 1, low);
        high = i_select(right, high, i_max(middle, low));
    }
    Float before = f_select(mi_lt(i_set(0), low), f_gather(b->cdf, i_max(low - 1, i_set(0))), f_set(0));
    *probability = f_gather(b->cdf, low) - before;
    return low;
}
