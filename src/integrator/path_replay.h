// path_replay.h: the picture of a scene along the recorded paths of another one, which differs in the values of its
// parameters alone: directions, densities, MIS weights, roulette and choices are those of the recording scene, values
// of functions and lights those of the moved one. E[f(moved) / p(recorded)] is the moved scene's picture, and its
// differences are free of the noise that choices make when they flip.
// NOT replayed: what moves hit points, light samples and the directions of mirrors and glass.
#pragma once

#include "integrator/path_adj.h"

static Spec replay_escape(Tracer *t, const RecordBatch *batch) {
    const Records *r = &t->ws.records;
    const EmitterRecord *e = t->scene->emitters + t->scene->environment;
    Vec2 uv = environment_uv(t->scene, e, record_v3(r->dx, r->dy, r->dz, batch->first));
    return spec_scale(emitter_eval(t->scene, e, texcoord(uv, NULL), f_set(1)), f_load(r->mis + batch->first));
}

// Radiance leaving a batch of vertices, given what arrives there.
static Spec replay_surface(Tracer *t, const RecordBatch *batch, Int slot, Spec suffix) {
    SurfaceSweep s;
    surface_load(t, batch, slot, suffix, &s);
    Spec l = spec_zero();
    surface_parameterise(t, &s);
    if (s.emitter) {
        Spec emission = emitter_eval(t->scene, s.emitter, texcoord(s.si.uv, &s.hit), f_set(1));
        l = spec_zero_unless(s.lit, spec_scale(emission, s.mis));
    }
    if (m_any(s.connected)) {
        Spec f = bsdf_eval(&s.call, s.wi, s.wl, i_set(LOBE_SMOOTH)), value, weight = s.light_weight;
        if (t->scene->through) {
            Passage p;
            p.found = false;
            surface_passage_find(t, batch, &s, &p);
            value = p.light_value;
            weight = spec_mul(weight, p.transmittance);
        } else {
            value = lights_eval(t->scene, s.light, s.connected, s.light_uv, s.light_prim, s.light_distance);
        }
        weight = t->scene->drops ? kept_replay(t, &s, weight) : weight;
        l = spec_add(l, spec_zero_unless(s.connected, spec_mul(spec_mul(f, value), weight)));
    }
    if (m_any(s.scattered)) {
        Spec f = bsdf_eval(&s.call, s.wi, s.wo, s.lobe);
        Spec onward = spec_mul(spec_scale(f, s.scatter_weight), suffix);
        l = spec_add(l, spec_zero_unless(s.scattered, onward));
    }
    return l;
}

// Radiance at the beginning of flights. Distances and collisions are the recording scene's.
static Spec replay_flight(Tracer *t, const RecordBatch *batch, Int slot, Spec suffix) {
    const Records *r = &t->ws.records;
    const int32_t at = batch->first;
    Track track = track_of(t, batch->group);
    Flights f = {.medium = batch->group, .m = m_first_n(batch->count), .slot = slot};
    f.o = record_v3(r->px, r->py, r->pz, at);
    f.d = record_v3(r->dx, r->dy, r->dz, at);
    f.shares = channel_shares(t, spec_load(r->beta, at));
    f.key = stream_key(t, slot, batch->bounce, STREAM_FLIGHT);
    f.flight = track_flight(&track, f.o, f.d, f_load(r->sw + at), f.shares, f.m, &f.key, 0);
    Spec l = spec_mul(f.flight.weight, suffix);
    return t->scene->media[batch->group].emission >= 0 ? spec_add(l, flight_emission(t, &f, batch->bounce)) : l;
}

static Spec replay_collision(Tracer *t, const RecordBatch *batch, Int slot, Spec suffix) {
    Passage p;
    p.found = false;
    CollisionSweep s = collision_load(t, batch, slot, suffix, &p);
    Spec l = spec_zero_unless(s.connected, spec_scale(s.lit, s.light_phase));
    return spec_mul(s.at.albedo, spec_add(l, spec_scale(s.onward, s.phase)));
}

static Spec replay_vertex(Tracer *t, const RecordBatch *batch, Int slot) {
    Spec suffix = spec_gather(t->ws.suffix, slot);
    switch (batch->tag) {
    case VERTEX_ESCAPED:
        return replay_escape(t, batch);
    case VERTEX_FLIGHT:
        return replay_flight(t, batch, slot, suffix);
    case VERTEX_MEDIUM:
        return replay_collision(t, batch, slot, suffix);
    default:
        return replay_surface(t, batch, slot, suffix);
    }
}

static void path_replay(Tracer *t) {
    const SceneView *recorded = t->scene;
    const Records *r = &t->ws.records;
    t->scene = t->job->moved; // t->deciding stays
    for (int32_t b = t->batch_count - 1; b >= 0; b--) {
        const RecordBatch *batch = t->ws.batches + b;
        Mask m = m_first_n(batch->count);
        Int slot = i_select(m, i_load(r->slot + batch->first), i_set(0));
        Spec l = replay_vertex(t, batch, slot);
        l = spec_zero_unless(m & m_finite(spec_sum(l)), l);
        spec_scatter(t->ws.suffix, slot, l, m);
        // The path's first vertex comes last.
        spec_scatter(t->ws.radiance, slot, spec_mul(spec_load(r->beta, batch->first), l), m);
    }
    t->scene = recorded;
}
