// path_replay.h: the recorded paths of one scene in another one, which differs in the values of its parameters alone:
// directions, densities, MIS weights, roulette and choices are those of the recording scene, values of functions and lights
// those of the moved one. E[f(moved) / p(recorded)] is the moved scene's picture, and its differences are free of the noise that
// choices make when they flip. What the records say of values and throughput becomes what holds in the moved scene, so that the
// sweep of path_adj.h finds the moved scene's derivative along the same paths: with detached sampling, that is E of the
// derivative of f(moved) / p(recorded).
// NOT replayed: what moves hit points, light samples and the directions of mirrors and glass. Nor the probes of extinctions
// (probe.h): derivatives along paths of another scene are those of the score function.
#pragma once

#include "integrator/path_adj.h"

// What leaves a batch of vertices: local + weight x what arrives there from the rest of the path.
typedef struct Leaving {
    Spec local, weight;
} Leaving;

static Leaving replay_escape(Tracer *t, const RecordBatch *batch) {
    const Records *r = &t->ws.records;
    const EmitterRecord *e = t->scene->emitters + t->scene->environment;
    Vec2 uv = environment_uv(t->scene, e, record_v3(r->dx, r->dy, r->dz, batch->first));
    Spec l = spec_scale(emitter_eval(t->scene, e, texcoord(uv, NULL), f_set(1)), f_load(r->mis + batch->first));
    return (Leaving){l, spec_zero()};
}

// What light samples bring, unless the sweep looks at their shadow rays later.
static Spec replay_light(Tracer *t, const RecordBatch *batch, SurfaceSweep *s) {
    Spec f = bsdf_eval(&s->call, s->wi, s->wl, i_set(LOBE_SMOOTH)), value, weight = s->light_weight;
    spec_store(t->ws.records.light_f, batch->first, f);
    if (t->shadows_later) {
        return spec_zero();
    }
    if (t->scene->through) {
        Passage p;
        p.found = false;
        surface_passage_find(t, batch, s, &p);
        value = p.light_value;
        weight = spec_mul(weight, p.transmittance);
    } else {
        value = lights_eval(t->scene, s->light, s->connected, s->light_uv, s->light_prim, s->light_distance);
    }
    weight = t->scene->drops ? kept_replay(t, s, weight) : weight;
    return spec_zero_unless(s->connected, spec_mul(spec_mul(f, value), weight));
}

static Leaving replay_surface(Tracer *t, const RecordBatch *batch, Int slot) {
    SurfaceSweep s;
    surface_load(t, batch, slot, spec_zero(), &s);
    Leaving v = {spec_zero(), spec_zero()};
    surface_parameterise(t, &s);
    if (s.emitter) {
        Spec emission = emitter_eval(t->scene, s.emitter, texcoord(s.si.uv, &s.hit), f_set(1));
        v.local = spec_zero_unless(s.lit, spec_scale(emission, s.mis));
    }
    if (m_any(s.connected)) {
        v.local = spec_add(v.local, replay_light(t, batch, &s));
    }
    if (m_any(s.scattered)) {
        Spec f = bsdf_eval(&s.call, s.wi, s.wo, s.lobe);
        v.weight = spec_zero_unless(s.scattered, spec_scale(f, s.scatter_weight));
    }
    return v;
}

// Of flights. Distances and collisions are the recording scene's.
static Leaving replay_flight(Tracer *t, const RecordBatch *batch, Int slot) {
    const Records *r = &t->ws.records;
    const int32_t at = batch->first;
    Track track = track_of(t, batch->group);
    Flights f = {.medium = batch->group, .m = m_first_n(batch->count), .slot = slot};
    f.o = record_v3(r->px, r->py, r->pz, at);
    f.d = record_v3(r->dx, r->dy, r->dz, at);
    f.tmax = f_load(r->sw + at);
    f.shares = channel_shares(t, spec_load(r->beta, at));
    f.key = stream_key(t, slot, batch->bounce, STREAM_FLIGHT);
    f.flight = track_flight(&track, f.o, f.d, f.tmax, f.shares, f.m, &f.key, 0);
    Leaving v = {spec_zero(), f.flight.weight};
    if (t->scene->media[batch->group].emission >= 0) {
        v.local = flight_emission(t, &f, batch->bounce);
        f_store(r->u + at, f.probe);
        spec_store(r->light_weight, at, f.probe_weight);
    }
    return v;
}

static Leaving replay_collision(Tracer *t, const RecordBatch *batch, Int slot) {
    const Records *r = &t->ws.records;
    Passage p;
    p.found = t->shadows_later; // then nothing is known to arrive yet
    if (p.found) {
        p.open = m_first_n(batch->count) & m_gt(spec_max(spec_load(r->light_weight, batch->first)), f_set(0));
        p.transmittance = p.light_value = spec_zero();
    }
    CollisionSweep s = collision_load(t, batch, slot, spec_set(f_set(1)), &p);
    spec_store(r->light_f, batch->first, spec_scale(s.at.albedo, s.light_phase));
    Spec l = spec_zero_unless(s.connected, spec_scale(s.lit, s.light_phase));
    return (Leaving){spec_mul(s.at.albedo, l), spec_mul(s.at.albedo, spec_scale(s.onward, s.phase))};
}

static Leaving replay_vertex(Tracer *t, const RecordBatch *batch, Int slot) {
    switch (batch->tag) {
    case VERTEX_ESCAPED:
        return replay_escape(t, batch);
    case VERTEX_FLIGHT:
        return replay_flight(t, batch, slot);
    case VERTEX_MEDIUM:
        return replay_collision(t, batch, slot);
    default:
        return replay_surface(t, batch, slot);
    }
}

// Adds the throughputs of the vertices of m to the sums of weights.
static void replay_weigh(const Tracer *t, Spec then, Spec now, Mask m) {
    double *w = t->job->weights;
    real a[LANES], b[LANES];
    m = m & m_finite(spec_sum(then) + spec_sum(now));
    f_store(a, f_zero_unless(m, spec_sum(then)));
    f_store(b, f_zero_unless(m, spec_sum(now)));
    for (int i = 0; i < LANES; i++) {
        const double x = (double)a[i], y = (double)b[i], both = x + (y < 0 ? -y : y);
        w[WEIGHT_THEN] += x;
        w[WEIGHT_NOW] += y;
        w[WEIGHT_SQUARE] += x > 0 ? y * y / x : 0;
        w[WEIGHT_ALL] += both;
        w[WEIGHT_WITHIN] += x <= y * t->job->within && y <= x * t->job->within ? both : 0;
    }
}

// The throughputs of the records, from the first vertices on; ws.throughput holds those before them.
static void replay_throughputs(Tracer *t) {
    const Records *r = &t->ws.records;
    for (int32_t b = 0; b < t->batch_count; b++) {
        const RecordBatch *batch = t->ws.batches + b;
        Mask m = m_first_n(batch->count);
        Int slot = i_select(m, i_load(r->slot + batch->first), i_set(0));
        Spec beta = spec_gather(t->ws.throughput, slot);
        if (t->job->weights && batch->tag != VERTEX_FLIGHT) {
            replay_weigh(t, spec_load(r->beta, batch->first), beta, m);
        }
        spec_store(r->beta, batch->first, beta);
        beta = spec_mul(beta, spec_load(r->weight, batch->first));
        spec_scatter(t->ws.throughput, slot, spec_zero_unless(m_finite(spec_sum(beta)), beta), m);
    }
}

// t->scene is the moved one.
static void path_replay(Tracer *t) {
    const Records *r = &t->ws.records;
    for (int32_t b = t->batch_count - 1; b >= 0; b--) {
        const RecordBatch *batch = t->ws.batches + b;
        Mask m = m_first_n(batch->count);
        Int slot = i_select(m, i_load(r->slot + batch->first), i_set(0));
        Spec suffix = spec_gather(t->ws.suffix, slot), beta = spec_load(r->beta, batch->first);
        Leaving v = replay_vertex(t, batch, slot);
        spec_store(r->local, batch->first, v.local);
        spec_store(r->weight, batch->first, v.weight);
        Spec l = spec_add(v.local, spec_mul(v.weight, suffix));
        l = spec_zero_unless(m & m_finite(spec_sum(l)), l);
        spec_scatter(t->ws.suffix, slot, l, m);
        // The path's first vertex comes last.
        spec_scatter(t->ws.radiance, slot, spec_mul(beta, l), m);
        spec_scatter(t->ws.throughput, slot, beta, m);
    }
    if (t->job->weights || t->job->mode == MODE_REVERSE) {
        replay_throughputs(t);
    }
}
