// flight.h: paths in participating media. Between the surfaces that rays were traced to, a path flies through its medium:
// where it collides it scatters instead of reaching the surface. All lanes of a batch share a medium. Light sampling and
// phase sampling are combined as at surfaces; depth counts real collisions. In derivative modes flights are recorded in
// front of the vertices that they end at: what arrives at their beginning is local + weight x what leaves their end.
#pragma once

#include "integrator/aim.h"
#include "integrator/vertex.h"
#include "medium/phase.h"

// Smallest share of a channel in the choice of distances; derivatives also count channels in which paths bring nothing.
#define CHANNEL_FLOOR 1e-3f
#define CHANNEL_DERIVATIVE_FLOOR 0.1f

// Shares of the channels in the choice of distances, by what the path brings in each of them.
KFN Spec channel_shares(const Tracer *t, Spec beta) {
    const real floor = t->derivative ? CHANNEL_DERIVATIVE_FLOOR : CHANNEL_FLOOR, even = (real)1 / SPEC_N;
    Float sum = spec_sum(beta);
    Mask dark = ~m_gt(sum, f_set(0));
    Float rcp = (1 - floor) * f_safe_rcp(sum);
    Spec shares;
    for (int c = 0; c < SPEC_N; c++) {
        shares.c[c] = f_select(dark, f_set(even), f_max(beta.c[c], f_set(0)) * rcp + floor * even);
    }
    return spec_scale(shares, f_safe_rcp(spec_sum(shares)));
}

// A batch of flights through one medium.
typedef struct Flights {
    int32_t medium;
    Mask m;
    Int at, slot;       // positions in the path arrays
    Vec3 o, d;
    Float tmax;         // distance to the surface
    Spec beta, shares;
    SampleKey key;
    Flight flight;
    Float probe;        // where emission is looked up
    Spec probe_weight;  // what that counts
} Flights;

KFN Flights flights_load(const Tracer *t, int32_t medium, const int32_t *order, int32_t count, int32_t bounce) {
    const Workspace *ws = &t->ws;
    const Paths *p = &ws->paths[t->current];
    Flights f = {.medium = medium, .m = m_first_n(count)};
    f.at = i_select(f.m, i_load(order), i_set(order[0]));
    f.slot = i_gather(p->slot, f.at);
    f.d = LOAD_V3(*p, dx, dy, dz, f.at);
    f.o = v3_madd(LOAD_V3(*p, ox, oy, oz, f.at), -real_gather(p->skip, f.at), f.d);
    Mask found = mi_lt(i_set(-1), i_gather(ws->hit_shape, f.at));
    Float distance = v3_dot(v3_sub(LOAD_V3(*ws, hit_x, hit_y, hit_z, f.at), f.o), f.d);
    f.tmax = f_select(found, f_max(distance, f_set(0)), real_gather(p->tmax, f.at));
    f.beta = spec_gather(p->beta, f.at);
    f.shares = channel_shares(t, f.beta);
    f.key = stream_key(t, f.slot, bounce, STREAM_FLIGHT);
    return f;
}

// Emission along flights that got to distances `flown`: the expectation of such a distance, at a uniform point of it, is the
// integral of the transmittance, also where nothing collides. u: which point; key, dimension: as of the flights.
// probe: where that is; weight: what emission counts there.
static NOINLINE Spec emission_flown(const Track *track, Vec3 o, Vec3 d, Float flown, Float tmax, Spec shares, const SampleKey *key,
                                    uint32_t dimension, Float u, Mask m, Float *probe, Spec *weight) {
    const SceneView *scene = track->values;
    const VolumeNode *emission = scene->volumes + track->medium->emission;
    Float low = f_set(0), high = flown;
    medium_span(scene, track->medium, track->sigma_t, o, d, &low, &high);
    m = m & m_gt(high, low) & m_finite(high);
    *probe = f_select(m, f_lerp(low, high, u), f_set(0));
    *weight = spec_zero_unless(m, spec_scale(track_weight(track, o, d, *probe, tmax, shares, m, key, dimension), high - low));
    Vec3 p = volume_to_local(scene, emission, v3_madd(o, *probe, d), 1);
    return spec_mul(volume_eval(scene, emission, p), *weight);
}

static Spec flight_emission(const Tracer *t, Flights *f, int32_t bounce) {
    Track track = track_of(t, f->medium);
    SampleKey key = stream_key(t, f->slot, bounce, STREAM_EMISSION);
    return emission_flown(&track, f->o, f->d, f->flight.t, f->tmax, f->shares, &f->key, 0, rng_1d(&key, 0), f->m, &f->probe,
                          &f->probe_weight);
}

KFN void record_flight(Tracer *t, const Flights *f, int32_t count, int32_t bounce, Spec emission) {
    int32_t at = record_claim(t, VERTEX_FLIGHT, f->medium, count, bounce);
    if (at < 0) {
        return;
    }
    Records *r = &t->ws.records;
    i_store(r->slot + at, f->slot);
    i_store(r->depth + at, i_gather(t->ws.paths[t->current].depth, f->at));
    i_store(r->prim + at, f->flight.real);
    f_store(r->px + at, f->o.x);
    f_store(r->py + at, f->o.y);
    f_store(r->pz + at, f->o.z);
    f_store(r->dx + at, f->d.x);
    f_store(r->dy + at, f->d.y);
    f_store(r->dz + at, f->d.z);
    if (t->job->rides) {
        const Paths *p = &t->ws.paths[t->current];
        Int begins = i_gather(p->begins, f->at), depth = i_gather(p->depth, f->at);
        i_store(r->slides + at, record_slides(t, real_gather(p->pdf, f->at), begins, depth));
    }
    f_store(r->ldist + at, f->flight.t);
    f_store(r->sw + at, f->tmax);
    f_store(r->u + at, f->probe);
    spec_store(r->beta, at, f->beta);
    spec_store(r->light_weight, at, f->probe_weight);
    spec_store(r->local, at, emission);
    spec_store(r->weight, at, f->flight.weight);
}

// The distance to a collision on the way from o to tmax, off both ends: the next ray must not begin on the wrong side of a border.
KFN Float flight_inside(Vec3 o, Float distance, Float tmax) {
    Float largest = f_max(f_max(f_abs(o.x), f_abs(o.y)), f_abs(o.z));
    Float step = f_min((1.0f + largest) * 3e-6f, 0.5f * tmax);
    return f_min(f_max(distance, step), tmax - step);
}

// Flies one batch: paths that collide go to the medium's group, all carry their weight.
static void fly(Tracer *t, int32_t id, const int32_t *order, int32_t count, int32_t bounce) {
    const SceneView *scene = t->scene;
    const MediumNode *medium = scene->media + id;
    Workspace *ws = &t->ws;
    Paths *p = &ws->paths[t->current];
    Flights f = flights_load(t, id, order, count, bounce);
    Track track = track_of(t, id);
    f.flight = track_flight(&track, f.o, f.d, f.tmax, f.shares, f.m, &f.key, 0);
    f.flight.t = f_select(f.flight.real, flight_inside(f.o, f.flight.t, f.tmax), f.flight.t);
    Spec emission = spec_zero();
    if (medium->emission >= 0) {
        emission = flight_emission(t, &f, bounce);
    }
    if (t->derivative) {
        record_flight(t, &f, count, bounce, emission);
        Float floored = f_max(spec_max(f.flight.weight), f_set(DERIVATIVE_FLOOR));
        f_scatter(p->roulette, f.at, real_gather(p->roulette, f.at) * floored, f.m);
    } else {
        slot_add(t, f.slot, spec_mul(f.beta, emission), f.m);
    }
    spec_scatter(p->beta, f.at, spec_mul(f.beta, f.flight.weight), f.m);
    Vec3 end = v3_madd(f.o, f.flight.t, f.d);
    i_scatter(ws->hit_group, f.at, i_set((int32_t)scene->groups_count + 1 + id), f.flight.real);
    f_scatter(ws->hit_x, f.at, end.x, f.flight.real);
    f_scatter(ws->hit_y, f.at, end.y, f.flight.real);
    f_scatter(ws->hit_z, f.at, end.z, f.flight.real);
}

// Flies all paths that are in media, sorted by medium. begin: scratch of the number of media and 2 entries.
static void flight_stage(Tracer *t, int32_t *begin, int32_t bounce) {
    const int32_t media = (int32_t)t->scene->media_count + 1;
    const int32_t *medium = t->ws.paths[t->current].medium;
    counting_sort(medium, 1, t->active, media, t->ws.order, begin);
    for (int32_t id = 0; id + 1 < media; id++) {
        for (int32_t k = begin[id + 1]; k < begin[id + 2]; k += LANES) {
            fly(t, id, t->ws.order + k, begin[id + 2] - k < LANES ? begin[id + 2] - k : LANES, bounce);
        }
    }
}

// ---- collisions --------------------------------------------------------------------------------------------------

typedef struct Collision {
    const MediumNode *medium;
    PhaseCall call;
    Vec3 wi;
    Spec albedo;
    bool backwards; // wi leads to the light and wo to the camera
} Collision;

// What scatters over the extinction, at a point of the world: between voxels, a ratio of two fields is not a field of ratios.
static NOINLINE Spec scattering_ratio(const SceneView *scene, const MediumNode *medium, Vec3 p) {
    const VolumeNode *sigma_s = scene->volumes + medium->sigma_s, *sigma_t = scene->volumes + medium->sigma_t;
    Spec s = volume_eval(scene, sigma_s, volume_to_local(scene, sigma_s, p, 1));
    Spec sum = volume_eval(scene, sigma_t, volume_to_local(scene, sigma_t, p, 1));
    for (int c = 0; c < SPEC_N; c++) {
        Mask some = m_gt(sum.c[c], f_set(0));
        s.c[c] = f_zero_unless(some, s.c[c] / f_select(some, sum.c[c], f_set(1)));
    }
    return s;
}

KFN Spec medium_albedo(const SceneView *scene, const MediumNode *medium, Vec3 p) {
    if (medium->sigma_s >= 0) {
        return scattering_ratio(scene, medium, p);
    }
    const VolumeNode *albedo = scene->volumes + medium->albedo;
    return volume_eval(scene, albedo, volume_to_local(scene, albedo, p, 1));
}

KFN Collision collision_look(const Tracer *t, int32_t medium, const Hit *hit, Vec3 d) {
    const SceneView *scene = t->scene;
    Collision c = {.medium = scene->media + medium, .wi = v3_neg(d)};
    c.call = (PhaseCall){.scene = scene, .node = c.medium->phase, .floor = t->floor};
    c.call.at = texcoord((Vec2){f_set(0), f_set(0)}, hit);
    c.albedo = t->bare && c.medium->sigma_s >= 0 ? spec_set(f_set(1)) : medium_albedo(scene, c.medium, hit->p);
    return c;
}

// The phase function between wi and wo where the flight that collided came along -wi. It is evaluated from the camera's side; but
// of flakes, extinction times phase function is what is the same both ways, and the extinction that counts is that of the flight.
KFN Float collision_phase(const Collision *c, Vec3 wo) {
    bool exchanged = c->backwards && c->medium->flakes < 0;
    return phase_eval(&c->call, exchanged ? wo : c->wi, exchanged ? c->wi : wo);
}

KFN void collision_shadow_ray(Vec3 p, Vec3 d, Float distance, Ray *ray) {
    *ray = (Ray){p, d, distance * (1.0f - SHADOW_SHORT)};
}

// Light sampling at a batch of collisions.
static void collision_lights(Tracer *t, const Vertex *v, const Collision *c, const SampleKey *key, int32_t bounce, Mask m,
                             int32_t record) {
    const SceneView *scene = t->scene;
    Float choice;
    Int light = light_choose(scene, key, bounce, &choice);
    Spec radiance;
    LightSample s = lights_sample(scene, light, v->m, v->hit.p, rng_2d(key, dimension(bounce, PURPOSE_LIGHT)), &radiance);
    const Aim aim = aim_of(t);
    Float scatter_pdf = aim_density(&aim, v->hit.p, s.d, phase_pdf(&c->call, c->wi, s.d));
    Float value = phase_eval(&c->call, c->wi, s.d), pdf = s.pdf * choice;
    Float mis = f_select(light_is_delta(scene, light), f_set(1), power_heuristic(pdf, scatter_pdf));
    Float weight = mis * f_safe_rcp(pdf);
    Spec f = spec_scale(c->albedo, value), l = spec_scale(spec_mul(f, radiance), weight);
    l = t->derivative ? l : spec_mul(v->beta, l);
    m = m & s.valid & m_gt(weight, f_set(0)) & (m_set(t->derivative) | m_gt(spec_max(l), f_set(0)));
    Ray ray;
    collision_shadow_ray(v->hit.p, s.d, s.distance, &ray);
    append_shadows(t, &ray, light, l, v->slot, record, v->medium, m);
    if (record >= 0) {
        record_light(t, record, light, &s, s.d, spec_set(f_zero_unless(m, weight)), f);
    }
}

// Samples how the paths of m go on; returns the number of the next bounce's paths.
static int32_t collision_scatter(Tracer *t, const Vertex *v, const Collision *c, const SampleKey *key, int32_t bounce, Mask m,
                                 int32_t record, int32_t next_count) {
    const Paths *p = &t->ws.paths[t->current];
    Onward w = {.m = m, .passed = m_set(false), .begins = i_set(BEGINS_IN_AIR), .depth = v->depth + 1,
                .eta2 = real_gather(p->eta2, v->at)};
    w.d = phase_sample(&c->call, c->wi, rng_1d(key, dimension(bounce, PURPOSE_LOBE)),
                       rng_2d(key, dimension(bounce, PURPOSE_DIRECTION)));
    w.sample.lobe = i_set(LOBE_SMOOTH);
    const Aim aim = aim_of(t);
    if (aim.count > 0) {
        aim_take(&aim, v->hit.p, key, bounce, m, &w.d);
    }
    w.pdf = aim_density(&aim, v->hit.p, w.d, phase_pdf(&c->call, c->wi, w.d));
    w.rcp = f_safe_rcp(w.pdf);
    w.f = spec_scale(c->albedo, collision_phase(c, w.d));
    onward_weigh(t, v, &w);
    play_roulette(t, key, bounce, &w);
    append_paths(t, v, v->hit.p, v->hit.p, &w, v->medium, next_count);
    if (record >= 0) {
        record_onward(t, record, true, w.d, &w);
    }
    return next_count + m_count(w.m);
}

// Light sampling and scattering of lanes that collided in one medium.
static int32_t collision_batch(Tracer *t, int32_t medium, const int32_t *order, int32_t count, int32_t bounce,
                               int32_t next_count) {
    const SceneView *scene = t->scene;
    Vertex v = vertex_load(t, order, count, bounce);
    int32_t record = -1;
    if (t->derivative) {
        record = record_claim(t, VERTEX_MEDIUM, medium, count, bounce);
        if (record < 0) {
            return next_count;
        }
        record_vertex(t, record, &v, f_set(0), spec_zero());
        f_store(t->ws.records.u + record, v3_length(v3_sub(v.hit.p, v.origin))); // the vertex before it (beacon.h)
    }
    if (keeps_coverage(t)) {
        cover(t, v.slot, v.m);
    }
    Mask m = v.m & depth_allows(scene, v.depth + 2);
    if (!m_any(m)) {
        return next_count;
    }
    SampleKey key = slot_key(t, v.slot);
    Collision c = collision_look(t, medium, &v.hit, v.d);
    if (scene->emitters_count > 0) {
        collision_lights(t, &v, &c, &key, bounce, m, record);
    }
    return collision_scatter(t, &v, &c, &key, bounce, m, record, next_count);
}
