// probe.h: what is scattered towards the path at points where nothing collided. The derivative of a flight with respect
// to the extinction at s holds the transmittance to s and what is scattered there, whatever the extinction is, 0 included.
// Two estimates of that are combined by the balance heuristic. Collisions that happen find points of dense media, with
// density extinction x transmittance. A uniform point of a flight that gets as far as t, weighed by t, finds points also where
// the medium is empty, with the transmittance alone, since that is the expectation of the reach [nimier2022; yu2026].
// A path of its own finds the light there, which is not differentiated itself; one flight of each path gets one, the more
// likely the more that may bring.
// The score function, the sum over the path of d log f, is what is left without probes: collisions have all the weight, and
// points where the extinction is 0 have no part.
#pragma once

#include "integrator/sweep.h"

// The recorded flights of a batch again.
typedef struct FlightSweep {
    Mask m;
    Int slot;
    Vec3 o, d;
    Float low, high;   // the part of the flight that lies in the medium
    Float sparse;      // extinction at which probes and collisions count alike
    Float probe;       // a uniform point of the flight
    Spec beta;
} FlightSweep;

// Optical depth of a whole way through the medium at which probes and collisions count alike.
#define SPARSE_DEPTH 1.0f

KFN FlightSweep flight_load(const Tracer *t, const RecordBatch *batch) {
    const Records *r = &t->ws.records;
    FlightSweep f = {.m = m_first_n(batch->count)};
    f.slot = i_select(f.m, i_load(r->slot + batch->first), i_set(0));
    f.o = record_v3(r->px, r->py, r->pz, batch->first);
    f.d = record_v3(r->dx, r->dy, r->dz, batch->first);
    f.beta = spec_load(r->beta, batch->first);
    const MediumNode *medium = t->scene->media + batch->group;
    Float end = f_load(r->ldist + batch->first), far = f_load(r->sw + batch->first);
    f.low = f_set(0);
    medium_span(t->scene, medium, t->scene->volumes + medium->sigma_t, f.o, f.d, &f.low, &far);
    f.sparse = (t->job->score ? 0 : SPARSE_DEPTH) * f_safe_rcp(far - f.low);
    f.high = f_min(far, end);
    f.m = f.m & m_finite(f.high) & m_gt(f.high, f.low);
    SampleKey key = stream_key(t, f.slot, batch->bounce, STREAM_PROBE);
    f.probe = f_select(f.m, f_lerp(f.low, f.high, rng_1d(&key, 0)), f_set(0));
    return f;
}

KFN Spec rcp_of_sum(Spec sigma, Float sparse) {
    for (int c = 0; c < SPEC_N; c++) {
        sigma.c[c] = f_safe_rcp(sigma.c[c] + sparse);
    }
    return sigma;
}

// One over extinction + sparse at a point of the flight. Flakes are apart, so that others have sum and product in one operation.
KFN Spec flight_rcp(const Tracer *t, int32_t medium, const FlightSweep *f, Float at) {
    Track track = track_of(t, medium);
    Vec3 p = v3_madd(f->o, at, f->d);
    if (track.medium->flakes >= 0) {
        return rcp_of_sum(flakes_extinction(t->scene, &track, p, f->d), f->sparse);
    }
    return rcp_of_sum(bare_extinction(t->scene, &track, volume_to_local(t->scene, track.sigma_t, p, 1)), f->sparse);
}

// Weights of the probe at a point of the flight, by channel; collisions have the rest.
KFN Spec probe_share(const Tracer *t, int32_t medium, const FlightSweep *f, Float at) {
    return spec_scale(flight_rcp(t, medium, f, at), f->sparse);
}

KFN bool extinction_is_live(const Tracer *t, int32_t medium) {
    return (t->job->live[t->scene->groups_count + medium] & LIVE_EXTINCTION) != 0;
}

// Chooses one flight of each path, by reservoirs over the flights in the order of the records. All media count, so that the
// samples of a derivative do not depend on what else is selected.
static void probe_choose(Tracer *t, int32_t count) {
    Workspace *ws = &t->ws;
    for (int32_t i = 0; i < count; i++) {
        ws->probe[i] = -1;
        ws->probe_total[i] = 0;
    }
    for (int32_t b = 0; b < t->batch_count; b++) {
        const RecordBatch *batch = ws->batches + b;
        if (batch->tag != VERTEX_FLIGHT) {
            continue;
        }
        FlightSweep f = flight_load(t, batch);
        SampleKey key = stream_key(t, f.slot, batch->bounce, STREAM_PROBE);
        Spec share = probe_share(t, batch->group, &f, f.probe);
        Float worth = f_zero_unless(f.m, spec_dot(f.beta, share) * (f.high - f.low));
        Float total = real_gather(ws->probe_total, f.slot) + worth;
        Mask take = f.m & m_gt(worth, f_set(0)) & m_lt(rng_1d(&key, 1) * total, worth);
        f_scatter(ws->probe_total, f.slot, total, f.m);
        i_scatter(ws->probe, f.slot, i_iota() + batch->first, take);
        i_scatter(ws->probe_medium, f.slot, i_set(batch->group), take);
        f_scatter(ws->probe_at, f.slot, f.probe, take);
        f_scatter(ws->probe_worth, f.slot, worth, take);
    }
}

// The state of n paths that collide at once where they begin, beside what is particular to each of them.
static void probes_begin(Tracer *t, int32_t n) {
    Workspace *ws = &t->ws;
    Paths *p = &ws->paths[0];
    for (int32_t k = 0; k < n; k += LANES) {
        f_store(p->tmax + k, f_set(INFINITY));
        f_store(p->eta2 + k, f_set(1));
        f_store(p->roulette + k, f_set(1));
        f_store(p->pdf + k, f_set(PDF_DELTA));
        spec_store(p->beta, k, spec_set(f_set(1)));
        i_store(ws->hit_shape + k, i_set(-1));
        i_store(ws->hit_prim + k, i_set(0));
        i_store(ws->hit_instance + k, i_set(0));
    }
    t->active = n;
    t->current = 0;
}

// Path n... of the lanes of m, as if it had come along d and collided at o; returns how many there are.
KFN int32_t probe_push(Tracer *t, int32_t n, Vec3 o, Vec3 d, Int medium, Int depth, Int slot, Mask m) {
    Workspace *ws = &t->ws;
    Paths *p = &ws->paths[0];
    v3_compress(p->ox + n, p->oy + n, p->oz + n, o, m);
    v3_compress(p->px + n, p->py + n, p->pz + n, o, m);
    v3_compress(p->dx + n, p->dy + n, p->dz + n, d, m);
    v3_compress(ws->hit_x + n, ws->hit_y + n, ws->hit_z + n, o, m);
    i_compress(ws->hit_group + n, medium + ((int32_t)t->scene->groups_count + 1), m);
    i_compress(p->medium + n, medium, m);
    i_compress(p->depth + n, depth, m);
    i_compress(p->slot + n, slot, m);
    return m_count(m);
}

// Starts a path at the point of each chosen flight whose medium is asked for, as if it had collided there.
static void probe_start(Tracer *t, int32_t count) {
    const Workspace *ws = &t->ws;
    const Records *r = &ws->records;
    int32_t n = 0;
    for (int32_t k = 0; k < count; k += LANES) {
        Int slot = i_select(m_first_n(count - k), i_iota() + k, i_set(0)), record = i_gather(ws->probe, slot);
        Mask m = m_first_n(count - k) & mi_lt(i_set(-1), record);
        Int medium = i_select(m, i_gather(ws->probe_medium, slot), i_set(0));
        Int live = i_gather(t->job->live, medium + (int32_t)t->scene->groups_count);
        m = m & mi_eq(live & LIVE_EXTINCTION, i_set(LIVE_EXTINCTION));
        record = i_max(record, i_set(0));
        Vec3 d = LOAD_V3(*r, dx, dy, dz, record);
        Vec3 o = v3_madd(LOAD_V3(*r, px, py, pz, record), real_gather(ws->probe_at, slot), d);
        n += probe_push(t, n, o, d, medium, i_gather(r->depth, record), slot, m);
    }
    probes_begin(t, n);
}

// Runs the paths of probes; `out` becomes what each of them brought. The records stay as they are. t->bare: of their first
// vertices.
static void probes_run(Tracer *t, int32_t *begin, int32_t count, uint32_t salt, SpecRows out) {
    const uint32_t scramble = t->job->scramble;
    const int32_t surfaces = (int32_t)t->scene->groups_count + 1, groups = surfaces + (int32_t)t->scene->media_count;
    t->derivative = false;
    t->floor = 0;
    t->job->scramble = rng_mix(scramble, salt); // random numbers of their own
    for (int c = 0; c < SPEC_N; c++) {
        memset(t->ws.radiance[c], 0, (size_t)count * sizeof(real));
    }
    int32_t next_count = 0;
    t->shadow_count = 0;
    sort_stage(t, begin, groups);
    for (int32_t g = surfaces; g < groups; g++) {
        for (int32_t k = begin[g]; k < begin[g + 1]; k += LANES) {
            int32_t lanes = begin[g + 1] - k < LANES ? begin[g + 1] - k : LANES;
            next_count = collision_batch(t, g - surfaces, t->ws.order + k, lanes, 0, next_count);
        }
    }
    shadow_stage(t, 0);
    t->bare = false;
    t->current = 1;
    t->active = next_count;
    t->first_bounce = 1;
    path_forward(t, begin);
    for (int c = 0; c < SPEC_N; c++) {
        memcpy(out[c], t->ws.radiance[c], (size_t)count * sizeof(real));
    }
    t->job->scramble = scramble;
}

static void probe_stage(Tracer *t, int32_t *begin, int32_t count) {
    const Tracer before = *t;
    probe_choose(t, count);
    probe_start(t, count);
    t->bare = true;
    probes_run(t, begin, count, 0x70726f62u, t->ws.scattered);
    *t = before;
}
