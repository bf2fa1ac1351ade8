// leg.h: ways through scenes with media that nobody records: up to where a ray collides or meets a surface that scatters. Surfaces
// of the kind null are passed on the way and are no vertices, so that the number of vertices is that of the way's depth; and paths
// need not be sorted, shaded and traced anew for each of them.
#pragma once

#include "integrator/flight.h"

// Where such ways end.
typedef struct Leg {
    Hit near;        // shape -1: a collision
    Int air, around; // the medium that it is in, -1 = a surface; the medium that the ray came through
    Spec weight, emission; // emission: of the media on the way, where it counts, times weights
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
        if (group_is_null(scene, group) && group->emitter < 0) { // light is seen by the paths themselves
            Hit safe = walk_hit(hit, mine);
            Interaction si = shape_interaction(scene, group->shape_kind, group->shape_flags, &safe);
            Vec3 past = pass_on(t, group, &si, &safe, d, mine, medium);
            *o = v3_select(mine, past, *o);
            passed = passed | mine;
        }
    }
    return passed;
}

// What a leg is asked for.
typedef struct LegDef {
    int most;      // surfaces that it may pass; where there are more, it ends at the next one
    bool emission, coherent;
    Mask unveiled; // lanes that pass masks and thin glass or end there, with an even chance
} LegDef;

// Masks and thin glass that the lanes of m meet: lets a half of them pass, as leg_pass does.
static NOINLINE Mask leg_unveil(const Tracer *t, const Hit *hit, Vec3 d, Float u, Mask m, Vec3 *o, Int *medium, Spec *weight) {
    Mask may;
    Vec3 past = *o;
    Int beyond = *medium;
    Spec pass = walk_pass(t, hit, d, m_set(false), m, &past, &may, &beyond);
    Mask opens = may & m_gt(spec_max(pass), f_set(0)), passed = opens & m_lt(u, f_set(0.5f));
    *o = v3_select(passed, past, *o);
    *medium = i_select(passed, beyond, *medium);
    *weight = spec_select(opens, spec_scale(*weight, f_set(2)), *weight);
    *weight = spec_select(passed, spec_mul(*weight, pass), *weight);
    return passed;
}

// What the ray meets first, `solid` the first surface that lets no light pass, however far away.
KFN Hit leg_meet(const SceneView *scene, const Ray *ray, const Hit *solid, Mask m) {
    Ray before = *ray;
    Float distance = v3_dot(v3_sub(solid->p, ray->o), ray->d);
    Mask near = mi_lt(i_set(-1), solid->shape) & m_le(distance, ray->tmax);
    before.tmax = f_select(near, distance, ray->tmax);
    Hit open = trace_open(scene, &before, m), none = *solid;
    none.shape = i_select(near, solid->shape, i_set(-1));
    return hit_select(mi_lt(i_set(-1), open.shape), &open, &none);
}

// The ray's media begin at `from`, a point of its line; what it passes before that is nothing. weight: of the paths that go so.
static NOINLINE Leg leg_follow(Tracer *t, LegDef def, Ray ray, Vec3 from, Int medium, Spec weight, const SampleKey *key, Mask m) {
    Leg leg = {.near = {i_set(-1), i_set(0), f_set(0), f_set(0), ray.o, i_set(0)}, .air = i_set(-1), .around = medium};
    leg.weight = weight;
    leg.emission = spec_zero();
    leg.m = m_set(false);
    Mask left = m;
    // What lets no light pass need not be met again behind each surface that does.
    const bool apart = t->scene->open_apart && !t->scene->borders_touch;
    Hit solid = HIT_NONE;
    if (apart && m_any(m)) {
        Ray endless = {ray.o, ray.d, f_set(INFINITY)};
        solid = trace_kinds(t->scene, &endless, MEET_SOLID, m, def.coherent);
        t->job->rays += m_count(m);
    }
    for (int i = 0; i <= def.most && m_any(left); i++) {
        Hit hit = apart ? leg_meet(t->scene, &ray, &solid, left) : trace_media(t, &ray, left, def.coherent && i == 0);
        t->job->rays += apart ? 0 : m_count(left);
        Mask found = left & mi_lt(i_set(-1), hit.shape), collides = m_set(false);
        Float far = f_select(found, v3_dot(v3_sub(hit.p, from), ray.d), v3_dot(v3_sub(ray.o, from), ray.d) + ray.tmax);
        Mask begun = m_gt(far, f_set(0));
        for (Mask rest = left & begun & mi_lt(i_set(-1), medium), mine; m_any(rest); rest = rest & ~mine) {
            int32_t id = i_lane(medium, m_first(rest));
            Track track = track_of(t, id);
            mine = rest & mi_eq(medium, i_set(id));
            const uint32_t dimension = (uint32_t)i * MOST_COLLISIONS;
            Spec shares = channel_shares(t, leg.weight);
            Flight f = track_flight(&track, from, ray.d, far, shares, mine, key, dimension);
            Mask collided = mine & f.real;
            if (def.emission && t->scene->media[id].emission >= 0) {
                Float u = rng_1d(key, MOST_SURFACES_IN_A_ROW * MOST_COLLISIONS + (uint32_t)i), probe;
                Spec count, sent = emission_flown(&track, from, ray.d, f.t, far, shares, key, dimension, u, mine, &probe, &count);
                leg.emission = spec_add(leg.emission, spec_zero_unless(mine, spec_mul(leg.weight, sent)));
            }
            leg.weight = spec_select(mine, spec_mul(leg.weight, f.weight), leg.weight);
            leg.near.p = v3_select(collided, v3_madd(from, flight_inside(from, f.t, far), ray.d), leg.near.p);
            leg.air = i_select(collided, i_set(id), leg.air);
            collides = collides | collided;
        }
        leg.around = i_select(left, medium, leg.around);
        Int behind = medium;
        Mask passes = found & ~collides & m_set(i < def.most), passed = leg_pass(t, &hit, ray.d, passes, &ray.o, &behind);
        Mask veiled = def.unveiled & passes & ~passed;
        if (m_any(veiled)) {
            const uint32_t dimension = MOST_SURFACES_IN_A_ROW * (MOST_COLLISIONS + 1) + 1 + (uint32_t)i;
            passed = passed | leg_unveil(t, &hit, ray.d, rng_1d(key, dimension), veiled, &ray.o, &behind, &leg.weight);
        }
        Mask met = found & ~collides & ~passed;
        medium = i_select(begun, behind, medium);
        from = v3_select(passed & begun, hit.p, from);
        ray.tmax = f_select(passed, f_set(INFINITY), ray.tmax); // the sensor's far plane ends its rays before the first surface
        leg.near = hit_select(met, &hit, &leg.near);
        leg.m = leg.m | met | collides;
        left = passed;
    }
    leg.m = leg.m & m_gt(spec_max(leg.weight), f_set(0)) & m_finite(spec_sum(leg.weight));
    return leg;
}

// unveiled: lanes that pass masks and thin glass or end there, with an even chance.
KFN Leg leg_trace(Tracer *t, Ray ray, Vec3 from, Int medium, const SampleKey *key, Mask unveiled, Mask m) {
    const LegDef def = {.most = MOST_SURFACES_IN_A_ROW, .unveiled = unveiled};
    return leg_follow(t, def, ray, from, medium, spec_set(f_set(1)), key, m);
}

// What trace_stage and flight_stage do, for such ways of paths.
static void legs_stage(Tracer *t, LegDef def, int32_t bounce) {
    Paths *p = &t->ws.paths[t->current];
    for (int32_t k = 0; k < t->active; k += LANES) {
        Mask m = m_first_n(t->active - k);
        Ray ray = path_ray(p, k);
        Vec3 from = v3_madd(ray.o, -f_load(p->skip + k), ray.d);
        Int medium = i_select(m, i_load(p->medium + k), i_set(-1));
        SampleKey key = stream_key(t, i_select(m, i_load(p->slot + k), i_set(0)), bounce, STREAM_FLIGHT);
        m = m & m_gt(ray.tmax, f_set(0)); // some rays end at once
        Leg leg = leg_follow(t, def, ray, from, medium, spec_load(p->beta, k), &key, m);
        leg.near.shape = i_select(leg.m, leg.near.shape, i_set(-1));
        hit_store(t, k, &leg.near);
        if (def.emission) {
            slot_add(t, i_select(m, i_load(p->slot + k), i_set(0)), leg.emission, m & m_finite(spec_sum(leg.emission)));
        }
        Mask collides = leg.m & mi_lt(i_set(-1), leg.air);
        Int group = leg.air + ((int32_t)t->scene->groups_count + 1);
        i_store(t->ws.hit_group + k, i_select(collides, group, i_load(t->ws.hit_group + k)));
        i_store(p->medium + k, leg.around);
        spec_store(p->beta, k, spec_zero_unless(m & m_finite(spec_sum(leg.weight)), leg.weight));
    }
}
