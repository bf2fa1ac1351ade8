// airborne.h: boundary segments in scenes with participating media. Shadows lie in the air as they lie on surfaces: the near
// end of a segment is where a flight from the edge, away from the light, collides or meets a surface. Collisions are fixed in
// space: of n . (edge - lerp(near, far)) only what moves the edge or the light is left. Surfaces of the kind null are passed.
#pragma once

#include "integrator/boundary/edge.h"
#include "integrator/flight.h"

// Where rays from the edge end.
typedef struct Leg {
    Hit near;        // shape -1: a collision
    Int air, around; // the medium that it is in, -1 = a surface; the medium that the ray came through
    Spec weight;
    Mask m;
} Leg;

// Surfaces that rays pass: moves the lanes of m among them on, and returns them.
static NOINLINE Mask leg_pass(const Tracer *t, const Hit *hit, Vec3 d, Mask m, Vec3 *o, Int *medium) {
    const SceneView *scene = t->scene;
    Int groups = SHAPE_FIELD(scene, i_max(hit->shape, i_set(0)), group);
    Mask passed = m_set(false);
    for (Mask left = m, mine; m_any(left); left = left & ~mine) {
        int32_t id = i_lane(groups, m_first(left));
        const Group *group = scene->groups + id;
        mine = left & mi_eq(groups, i_set(id));
        if (scene->bsdfs[group->bsdf].kind == BSDF_NULL) {
            Hit safe = walk_hit(hit, mine);
            Interaction si = shape_interaction(scene, group->shape_kind, group->shape_flags, &safe);
            *o = v3_select(mine, interaction_behind(&si, d), *o);
            *medium = i_select(mine, medium_passed(t, group, &si, &safe, d, *medium, mine), *medium);
            passed = passed | mine;
        }
    }
    return passed;
}

static NOINLINE Leg leg_trace(Tracer *t, Vec3 o, Vec3 d, Int medium, const SampleKey *key, Mask m) {
    Leg leg = {.near = {i_set(-1), i_set(0), f_set(0), f_set(0), o, i_set(0)}, .air = i_set(-1), .around = medium};
    leg.weight = spec_set(f_set(1));
    leg.m = m_set(false);
    Mask left = m;
    for (int i = 0; i < MOST_SURFACES_IN_A_ROW && m_any(left); i++) {
        Ray ray = {o, d, f_set(INFINITY)};
        Hit hit = trace_media(t, &ray, left, false);
        t->job->rays += m_count(left);
        Mask found = left & mi_lt(i_set(-1), hit.shape), collides = m_set(false);
        Float far = f_select(found, f_max(v3_dot(v3_sub(hit.p, o), d), f_set(0)), f_set(INFINITY));
        for (Mask rest = left & mi_lt(i_set(-1), medium), mine; m_any(rest); rest = rest & ~mine) {
            int32_t id = i_lane(medium, m_first(rest));
            Track track = track_of(t, id);
            mine = rest & mi_eq(medium, i_set(id));
            Flight f = track_flight(&track, o, d, far, channel_shares(t, leg.weight), mine, key, (uint32_t)i * MOST_COLLISIONS);
            Mask collided = mine & f.real;
            leg.weight = spec_select(mine, spec_mul(leg.weight, f.weight), leg.weight);
            leg.near.p = v3_select(collided, v3_madd(o, f.t, d), leg.near.p);
            leg.air = i_select(collided, i_set(id), leg.air);
            collides = collides | collided;
        }
        leg.around = i_select(left, medium, leg.around);
        Mask passed = leg_pass(t, &hit, d, found & ~collides, &o, &medium), met = found & ~collides & ~passed;
        leg.near.shape = i_select(met, hit.shape, leg.near.shape);
        leg.near.prim = i_select(met, hit.prim, leg.near.prim);
        leg.near.instance = i_select(met, hit.instance, leg.near.instance);
        leg.near.u = f_select(met, hit.u, leg.near.u);
        leg.near.v = f_select(met, hit.v, leg.near.v);
        leg.near.p = v3_select(met, hit.p, leg.near.p);
        leg.m = leg.m | met | collides;
        left = passed;
    }
    leg.m = leg.m & m_gt(spec_max(leg.weight), f_set(0)) & m_finite(spec_sum(leg.weight));
    return leg;
}
