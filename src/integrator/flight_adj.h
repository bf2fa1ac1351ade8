// flight_adj.h: adjoints of flights, collisions and transmittances. Along a flight that gets to t with weight w and finds L
// there, the derivative with respect to the extinction at s < t is
//   -w L + w(s) albedo(s) (what is scattered at s towards the path),
// and the emission that is met behind s is lost as well. The first part is found at points of its own, the second one at
// collisions and at the path's probe (probe.h). Nothing is divided by an extinction or a throughput.
// Of media with a sigma_s and a sigma_a the first part belongs to both, and the second one, without the albedo, to sigma_s.
// NOT differentiated: the choice of distances, channels and real collisions. Where media lie: border.h.
#pragma once

#include "integrator/shaft.h"

enum { FLIGHT_POINTS = 2 }; // per flight, and per piece of a shadow ray

// What the extinction loses grows with, and what it gains: one and the same, unless the medium has a sigma_s.
enum { LOSS, GAIN };
KFN const VolumeNode *medium_part(const SceneView *scene, const MediumNode *medium, int part) {
    return scene->volumes + (part == GAIN && medium->sigma_s >= 0 ? medium->sigma_s : medium->sigma_t);
}

// The adjoint of the area of flakes, given that of scale v area at a point of the world.
KFN Float projection_adj(const SceneView *scene, const MediumNode *medium, const VolumeNode *v, Vec3 p, Spec d) {
    Spec bare = volume_eval(scene, v, volume_to_local(scene, v, p, 1));
    return spec_dot(d, bare) * (real)scene->theta[medium->scale];
}

// Accumulates the adjoint d of scale v area along w at a point of the world, v a volume of the medium.
static NOINLINE void coefficient_adj(const SceneView *scene, const MediumNode *medium, const VolumeNode *v, Vec3 p, Vec3 w,
                                     Spec d, Sink *sink, Mask m) {
    const int32_t at = sink->texture_at[v->texture], scale_at = sink->texture_at[medium->scale_texture];
    d = spec_zero_unless(m, d);
    if (medium->flakes >= 0) {
        flakes_area_adj(scene, medium->flakes, p, w, projection_adj(scene, medium, v, p, d), sink, m);
        d = spec_scale(d, flakes_area(scene, medium->flakes, p, w));
    }
    // coefficient = scale v
    if (at >= 0 || volume_moves(scene, v, sink)) {
        volume_world_adj(scene, v, p, spec_scale(d, f_set((real)scene->theta[medium->scale])), sink, m);
    }
    if (scale_at >= 0) {
        sink_add_uniform(sink, scale_at, spec_dot(d, volume_eval(scene, v, volume_to_local(scene, v, p, 1))), m);
    }
}

// Accumulates the adjoint d of a part of the extinction along w at a point of the world.
KFN void extinction_adj(const SceneView *scene, const MediumNode *medium, int part, Vec3 p, Vec3 w, Spec d, Sink *sink, Mask m) {
    if (medium->sigma_s < 0) {
        coefficient_adj(scene, medium, scene->volumes + medium->sigma_t, p, w, d, sink, m);
        return;
    }
    // sigma_t = sigma_s + sigma_a
    coefficient_adj(scene, medium, scene->volumes + medium->sigma_s, p, w, d, sink, m);
    if (part == LOSS) {
        coefficient_adj(scene, medium, scene->volumes + medium->sigma_a, p, w, d, sink, m);
    }
}

// The same of the point and the direction, as far as flakes are concerned.
static NOINLINE void extinction_turn(const SceneView *scene, const MediumNode *medium, int part, Vec3 p, Vec3 w, Spec d, Mask m,
                                     Vec3 *dp, Vec3 *dw) {
    const VolumeNode *v = medium_part(scene, medium, part);
    flakes_area_turn(scene, medium->flakes, p, w, projection_adj(scene, medium, v, p, spec_zero_unless(m, d)), dp, dw);
}

// Adds to dp and dw what the adjoint d of a part of the extinction along w at a point of the world makes of the two.
static NOINLINE void extinction_slope(const SceneView *scene, const MediumNode *medium, int part, Vec3 p, Vec3 w, Spec d, Mask m,
                                      Vec3 *dp, Vec3 *dw) {
    const VolumeNode *v = medium_part(scene, medium, part);
    d = spec_zero_unless(m, d);
    if (medium->flakes >= 0) {
        Vec3 point = v3_zero(), turn = v3_zero();
        extinction_turn(scene, medium, part, p, w, d, m, &point, &turn);
        v3_acc(dp, v3_select(m, point, v3_zero()));
        v3_acc(dw, v3_select(m, turn, v3_zero()));
        d = spec_scale(d, flakes_area(scene, medium->flakes, p, w));
    }
    if (v->kind == VOLUME_GRID) {
        Vec3 slope = volume_slope(scene, v, p, spec_scale(d, f_set((real)scene->theta[medium->scale])));
        v3_acc(dp, v3_select(m, slope, v3_zero()));
    }
}

// Points spread evenly over [low, high], one in each of FLIGHT_POINTS parts of it.
KFN Float flight_point(Float low, Float high, const SampleKey *key, uint32_t dimension, int k) {
    return f_lerp(low, high, (rng_1d(key, dimension + (uint32_t)k) + (real)k) * ((real)1 / FLIGHT_POINTS));
}

// ---- flights -----------------------------------------------------------------------------------------------------

// What the sweep of a batch of flights knows before it knows the adjoint.
typedef struct FlightAdj {
    FlightSweep f;
    const MediumNode *medium;
    Spec onward, emission;       // light from the flight's end, and from the way
    Spec attached;               // the part of the former that is attached to it (path_move.h)
    Float emission_at;
    Spec emission_weight;
    Float point[FLIGHT_POINTS];
    Mask probed, collided;       // lanes whose flight has the path's probe; that collide
    Float end;
    Spec gain, hit;              // what is scattered at the probe and at the collision, weighed
} FlightAdj;

static NOINLINE FlightAdj flight_adj_load(const Tracer *t, const RecordBatch *batch, Spec suffix) {
    const SceneView *scene = t->scene;
    const Workspace *ws = &t->ws;
    const int32_t at = batch->first;
    FlightAdj a = {.f = flight_load(t, batch), .medium = scene->media + batch->group};
    a.onward = spec_mul(spec_load(ws->records.weight, at), suffix);
    a.attached = t->job->rides ? spec_mul(spec_load(ws->records.weight, at), spec_gather(ws->attached, a.f.slot)) : a.onward;
    a.emission = spec_load(ws->records.local, at);
    a.emission_at = f_load(ws->records.u + at);
    a.emission_weight = spec_load(ws->records.light_weight, at);
    a.probed = a.collided = m_set(false);
    if (!extinction_is_live(t, batch->group)) {
        return a;
    }
    SampleKey key = stream_key(t, a.f.slot, batch->bounce, STREAM_PROBE);
    for (int k = 0; k < FLIGHT_POINTS; k++) {
        a.point[k] = f_select(a.f.m, flight_point(a.f.low, a.f.high, &key, 2, k), f_set(0));
    }
    a.probed = a.f.m & mi_eq(i_gather(ws->probe, a.f.slot), i_iota() + at);
    a.collided = m_first_n(batch->count) & (Mask)i_load(ws->records.prim + at);
    a.end = f_select(a.collided, f_load(ws->records.ldist + at), f_set(0));
    // Collisions have the density extinction, and the weight extinction / (extinction + sparse).
    a.hit = spec_mul(a.onward, flight_rcp(t, batch->group, &a.f, a.end));
    if (a.medium->sigma_s >= 0) {
        Spec scattered = spec_mul(spec_load(ws->records.weight, at), spec_gather(ws->collided, a.f.slot));
        a.hit = spec_mul(scattered, flight_rcp(t, batch->group, &a.f, a.end));
        a.collided = a.collided & m_finite(spec_sum(scattered));
    }
    a.gain = spec_zero();
    if (m_any(a.probed)) {
        Track track = track_of(t, batch->group);
        SampleKey own = stream_key(t, a.f.slot, batch->bounce, STREAM_FLIGHT);
        Float tmax = f_load(ws->records.sw + at);
        Spec weight = track_weight(&track, a.f.o, a.f.d, a.f.probe, tmax, channel_shares(t, a.f.beta), a.probed, &own, 0);
        // The flight was chosen with the probability worth / total.
        Float one_over = real_gather(ws->probe_total, a.f.slot) * f_safe_rcp(real_gather(ws->probe_worth, a.f.slot));
        Spec share = spec_scale(probe_share(t, batch->group, &a.f, a.f.probe), one_over * (a.f.high - a.f.low));
        Spec scattered = spec_mul(spec_mul(weight, share), spec_gather(ws->scattered, a.f.slot));
        a.gain = spec_zero_unless(a.probed & m_finite(spec_sum(scattered)), scattered);
    }
    return a;
}

// Adds to g what the adjoint d of a part of the extinction at a distance along the flight makes of the ray.
static NOINLINE void flight_point_glide(const Tracer *t, const FlightAdj *a, int part, Float at, Spec d, Glide *g, Mask m) {
    Vec3 p = v3_madd(a->f.o, at, a->f.d), dp = v3_zero(), dw = v3_zero();
    extinction_slope(t->scene, a->medium, part, p, a->f.d, d, m, &dp, &dw);
    glide_add(g, p, dp, m);
    g->turn = v3_add(g->turn, dw);
}

// Accumulates that adjoint.
KFN void flight_point_adj(const Tracer *t, const FlightAdj *a, int part, Float at, Spec d, Glide *g, Sink *sink, Mask m) {
    extinction_adj(t->scene, a->medium, part, v3_madd(a->f.o, at, a->f.d), a->f.d, d, sink, m);
    if (g) {
        flight_point_glide(t, a, part, at, d, g, m);
    }
}

// g: null unless the ray moves; end: of attached lanes, what their end asks for alone (ride_add), else null.
static NOINLINE void flight_adj(const Tracer *t, const FlightAdj *a, int32_t live, Spec delta, Glide *g, Glide *end, Sink *sink) {
    const SceneView *scene = t->scene;
    Spec worth = spec_mul(delta, a->f.beta);
    const Mask m = a->f.m;
    if (live & LIVE_EXTINCTION) {
        Float each = (a->f.high - a->f.low) * ((real)1 / FLIGHT_POINTS);
        for (int k = 0; k < FLIGHT_POINTS; k++) {
            Spec behind = spec_zero_unless(m_lt(a->point[k], a->emission_at), a->emission);
            Spec lost = spec_scale(spec_mul(worth, spec_add(a->onward, behind)), -each);
            flight_point_adj(t, a, LOSS, a->point[k], lost, g, sink, m);
            if (end) {
                flight_point_glide(t, a, LOSS, a->point[k], spec_scale(spec_mul(worth, a->attached), -each), end, m);
            }
        }
        flight_point_adj(t, a, GAIN, a->end, spec_mul(worth, a->hit), g, sink, a->collided);
        if (m_any(a->probed)) {
            flight_point_adj(t, a, GAIN, a->f.probe, spec_mul(worth, a->gain), g, sink, a->probed);
        }
    }
    if (live & LIVE_GLOW) {
        const VolumeNode *emission = scene->volumes + a->medium->emission;
        Vec3 p = v3_madd(a->f.o, a->emission_at, a->f.d);
        Spec d = spec_zero_unless(m, spec_mul(worth, a->emission_weight));
        volume_world_adj(scene, emission, p, d, sink, m);
        if (g) {
            glide_look(scene, g, emission, p, d, m);
        }
    }
}

static void flight_sweep(Tracer *t, const RecordBatch *batch, Int slot, Spec suffix, Mask finite, Sink *sink) {
    const int32_t live = t->job->live[t->scene->groups_count + batch->group];
    if (t->job->beam_count > 0) {
        shafts_sweep(t, batch, finite, sink);
    }
    if (!(live & (LIVE_EXTINCTION | LIVE_GLOW | LIVE_BORDER))) {
        return;
    }
    FlightAdj a = flight_adj_load(t, batch, suffix);
    a.f.m = a.f.m & finite;
    a.probed = a.probed & finite;
    a.collided = a.collided & finite;
    const bool glides = t->job->glides, rides = t->job->rides;
    Vec3 ref = rides ? ride_reference(t, slot, a.f.o, a.f.m) : glide_reference(t, slot, a.f.o);
    for (int c = 0; c < drives(t); c++) {
        Glide g = {.ref = ref, .d = a.f.d}, end = g;
        if (glides) {
            g = glide_load(t, c, slot, ref, a.f.d);
        }
        Spec delta = spec_zero_unless(finite, slot_adjoint(t, slot, c));
        flight_adj(t, &a, live, delta, glides || rides ? &g : NULL, rides ? &end : NULL, sink);
        if (glides) {
            glide_store(t, &g, c, slot, a.f.m);
        } else if (rides) {
            ride_add(t, batch, c, slot, &g, &end, sink, a.f.m);
        }
        forward_flush(t, sink, slot, c, finite);
    }
    if (glides) {
        glide_refer(t, slot, ref, a.f.m);
    }
    if (live & LIVE_BORDER) {
        border_box_sweep(t, batch, a.onward, a.attached, a.emission, finite, sink);
    }
}

// ---- shadow rays -------------------------------------------------------------------------------------------------

// Accumulates the adjoint dt of a walk's transmittance, whose value is `transmittance`, with respect to the extinctions on
// its way: dT / d extinction(s) = -T.
static NOINLINE void fog_adj(const Tracer *t, const Walk *walk, Spec transmittance, Spec dt, const SampleKey *key, Sink *sink) {
    const SceneView *scene = t->scene;
    dt = spec_mul(dt, transmittance);
    for (int32_t i = 0; i < walk->segments; i++) {
        for (Mask left = mi_lt(i_set(-1), walk->medium[i]), mine; m_any(left); left = left & ~mine) {
            int32_t id = i_lane(walk->medium[i], m_first(left));
            const MediumNode *medium = scene->media + id;
            mine = left & mi_eq(walk->medium[i], i_set(id));
            if (!extinction_is_live(t, id)) {
                continue;
            }
            Float low = f_set(0), high = walk->length[i];
            medium_span(scene, medium, scene->volumes + medium->sigma_t, walk->o[i], walk->d, &low, &high);
            Mask m = mine & m_gt(high, low) & m_finite(high);
            Float each = (high - low) * ((real)-1 / FLIGHT_POINTS);
            for (int k = 0; k < FLIGHT_POINTS; k++) {
                Float at = f_select(m, flight_point(low, high, key, (uint32_t)(i * FLIGHT_POINTS), k), f_set(0));
                extinction_adj(scene, medium, LOSS, v3_madd(walk->o[i], at, walk->d), walk->d, spec_scale(dt, each), sink, m);
            }
        }
    }
}
