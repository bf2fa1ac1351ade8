// beside.h: what edges hide of collisions beside lights at a point. From a vertex y past an edge e such a collision x is seen as a
// point that moves as the light does, with the share chi of the light that it scatters (beacon.h): the edge leaves the line of the
// two by
//   n . (e' - (1 - a) y' - a x'),   a = |e - y| / |x - y|.
// riding.h knows n . (e' - y') of all that is scattered, so that n . (y' - x') times a chi of this light is missing: these are
// segments that end there, of which nothing moves but the vertices they come from, and the light. Edges between x and its light
// lie outside of the ball, and so would x, behind them. Horizons have such segments, too (turning.h).
#pragma once

#include "integrator/beacon.h"
#include "integrator/boundary/chained.h"

// Points of the balls.
typedef struct BesidePoint {
    Vec3 centre, p;
    Float radius, r; // of the ball; and of p, after rounding
    Int light;
} BesidePoint;

// A random ball; returns what is left of the choice, which is less than their number.
static Float beside_ball(const Tracer *t, Float choice, BesidePoint *end) {
    const PathJob *job = t->job;
    Int which = i_min(i_from_f(choice), i_set(job->beacon_count - 1));
    end->centre = beacon_place(t, which);
    end->radius = BEACON_FIELD(t, which, radius);
    end->light = i_gather(&job->beacons->light, which * (int32_t)(sizeof(Beacon) / sizeof(float)));
    return choice - f_from_i(which);
}

// What they scatter along -d of their lights' light, per unit of volume.
static NOINLINE Spec beside_light(Tracer *t, const BesidePoint *end, Vec3 d, Int number, Mask m) {
    const SceneView *scene = t->scene;
    const Vec3 x = end->p;
    Spec arriving, worth = spec_zero();
    LightSample l = lights_sample(scene, i_select(m, end->light, i_set(0)), m, x, (Vec2){f_set(0.5f), f_set(0.5f)}, &arriving);
    Int medium = medium_around(t, x, d, m);
    Mask blocked;
    Fog fog = {medium, stream_key(t, number, 0, STREAM_FLIGHT), false, f_set(0)};
    Ray ray;
    collision_shadow_ray(x, l.d, l.distance, &ray);
    m = m & l.valid;
    arriving = spec_mul(arriving, walk_transmittance(t, ray, m_set(false), m, &fog, &blocked, NULL));
    for (Mask left = m & mi_lt(i_set(-1), medium), mine; m_any(left); left = left & ~mine) {
        int32_t id = i_lane(medium, m_first(left));
        mine = left & mi_eq(medium, i_set(id));
        Hit hit = {i_set(0), i_set(0), f_set(0), f_set(0), x, i_set(0)};
        Collision c = collision_look(t, id, &hit, d);
        Track track = track_of(t, id);
        Spec scattered = spec_scale(spec_mul(c.albedo, medium_extinction(scene, &track, x, d)), phase_eval(&c.call, c.wi, l.d));
        worth = spec_select(mine, spec_mul(scattered, arriving), worth);
    }
    return worth;
}

// A point of a ball, at a distance from its light that is uniform, as the edge sees it.
static void beside_sample(Tracer *t, const BoundaryJob *b, Int slot, Float share, Mask m, Segment *s, BesidePoint *end) {
    SampleKey key = slot_key(t, slot);
    const real count = (real)t->job->beacon_count;
    Vec2 u = rng_2d(&key, DIMENSION_EDGE_SEGMENT);
    Float part = beside_ball(t, rng_1d(&key, DIMENSION_SEGMENT_LIGHT) * count, end);
    Vec3 away = warp_uniform_sphere(rng_2d(&key, DIMENSION_SEGMENT_END));
    end->p = v3_madd(end->centre, f_max(part, f_set(1e-6f)) * end->radius, away);
    end->r = v3_length(v3_sub(end->p, end->centre));
    s->edge = edge_sample(t->scene, b, u, end->p, false);
    Vec3 across = v3_sub(end->p, s->edge.p);
    s->distance = v3_length(across);
    s->d = v3_scale(across, f_safe_rcp(s->distance));
    s->far = (Hit){i_set(-1), i_set(0), f_set(0), f_set(0), end->p, i_set(0)};
    s->source = i_set(-1);
    s->attached = m_set(false);
    s->m = m;
    segment_measure(t, b, true, share, s);
    if (m_any(s->m)) {
        s->source = i_select(s->m, end->light, s->source);
        // Volume over its density, and solid angle from the edge over volume.
        Float weight = 4 * PI * end->r * end->r * end->radius * count * f_safe_rcp(s->distance * s->distance);
        s->light = spec_scale(beside_light(t, end, s->d, slot, s->m), weight);
        s->m = s->m & m_gt(spec_max(s->light), f_set(0));
    }
}

static void beside_find(Tracer *t, const BoundaryJob *b, Int number, Float share, Mask m, Segments *q) {
    Segment s;
    BesidePoint end;
    beside_sample(t, b, number, share, m, &s, &end);
    if (!m_any(s.m)) {
        return;
    }
    Vec3 o = segment_stand(t, &s, segment_offset(&s));
    Int around = medium_around(t, o, s.d, s.m);
    m = segment_shine(t, &s, o, around, f_set(0), number, s.m);
    if (!m_any(m)) {
        return;
    }
    SampleKey key = stream_key(t, number, 0, STREAM_PROBE);
    Leg leg = leg_trace(t, (Ray){o, v3_neg(s.d), f_set(INFINITY)}, o, around, &key, m_set(false), m);
    Float behind = v3_length(v3_sub(leg.near.p, s.edge.p)), whole = behind + s.distance;
    BeaconShare still = beacon_share(end.radius, end.r, whole, leg.m);
    s.light = spec_scale(s.light, still.chi * behind * f_safe_rcp(whole));
    m = leg.m & m_gt(spec_max(s.light), f_set(0));
    segment_keep_leg(around, &leg, q, m);
    i_compress(q->sighted + q->count, i_set(0), m);
    segment_keep(&s, o, &leg.near, SEGMENT_BESIDE, number, q, m);
}
