// collision_adj.h: the adjoint of vertices in media. What leaves a collision is
//   albedo (sum_lights p Le T w_l + p w_s L_next),
// p the phase function; the extinction is in the flight's weight. Where surfaces move, it rides (ride.h), or moves with a light in
// part (beacon.h).
#pragma once

#include "integrator/walk_adj.h"

// What the sweep knows of a batch of collisions.
typedef struct CollisionSweep {
    Mask m, connected, scattered;
    Int light, light_prim;
    Spec beta, onward;                   // onward: w_s L_next
    Spec unshadowed, transmittance, lit; // w_l, T and Le w_l T
    Spec light_value;
    Float light_phase, phase, light_distance;
    Vec2 light_uv;
    Vec3 light_d, wo;
    Hit hit;
    Collision at;
    BeaconFlow flow;                     // of the light sample: its share is 0 where there is none
    Spec flowing;                        // that share of what the light sample brings, but for the throughput before it
    Spec extinction;                     // where that counts: of lanes that move with their light in part
    Mask ahead;                          // lanes whose next vertex does; and what that leaves
    Spec attached;
} CollisionSweep;

// What of the light sample moves with its light, and of what was found onwards (beacon.h).
static NOINLINE void collision_flow(Tracer *t, const RecordBatch *batch, Int slot, CollisionSweep *s) {
    const Records *r = &t->ws.records;
    s->ahead = s->scattered & mi_eq(i_gather(t->ws.next, slot), i_set(NEXT_STILL));
    s->attached = spec_zero_unless(s->ahead, spec_scale(spec_gather(t->ws.attached, slot), f_load(r->sw + batch->first)));
    Float before = f_load(r->u + batch->first); // distance of the vertex before it
    Mask m = s->connected, first = records_first(t, batch, m);
    s->flow = (BeaconFlow){f_set(0), f_set(0), v3_zero(), v3_zero(), v3_zero(), first};
    if (t->pinhole && m_any(first)) {
        s->flow = beacon_view(t, s->light, slot, s->hit.p, first);
    }
    Float radius = beacon_radius(t, s->light, m & ~first);
    BeaconShare near = beacon_share(radius, s->light_distance, before, m & ~first & m_gt(radius, f_set(0)));
    // Vertices per volume are as one over the square of `before`.
    Float along = near.by_vertex - 2.0f * near.chi * f_safe_rcp(before);
    Vec3 slope = v3_madd(v3_scale(s->at.wi, -along), -near.by_light, s->light_d);
    s->flow.share = f_select(first, s->flow.share, near.chi);
    s->flow.rcp = f_select(first, s->flow.rcp, f_safe_rcp(before));
    s->flow.slope = v3_select(first, s->flow.slope, v3_select(m_gt(near.chi, f_set(0)), slope, v3_zero()));
    Mask flows = m_gt(s->flow.share, f_set(0));
    s->flowing = spec_zero_unless(flows, spec_scale(spec_mul(s->lit, s->at.albedo), s->light_phase * s->flow.share));
    if (m_any(flows)) {
        Track track = track_of(t, batch->group);
        s->extinction = medium_extinction(t->scene, &track, s->hit.p, v3_neg(s->at.wi));
    }
}

static NOINLINE CollisionSweep collision_load(Tracer *t, const RecordBatch *batch, Int slot, Spec suffix, Passage *p) {
    const Records *r = &t->ws.records;
    const int32_t at = batch->first;
    CollisionSweep s = {.m = m_first_n(batch->count)};
    s.hit = (Hit){.shape = i_set(0), .prim = i_set(0), .instance = i_set(0), .p = record_v3(r->px, r->py, r->pz, at)};
    Vec3 d = record_v3(r->dx, r->dy, r->dz, at);
    s.beta = spec_load(r->beta, at);
    s.unshadowed = spec_load(r->light_weight, at);
    collision_passage_find(t, batch, s.hit.p, slot, p);
    s.connected = p->open;
    s.scattered = s.m & m_gt(f_load(r->sw + at), f_set(0));
    s.light = i_load(r->light + at);
    s.light_prim = i_load(r->lprim + at);
    s.light_uv = (Vec2){f_load(r->lu + at), f_load(r->lv + at)};
    s.light_distance = f_load(r->ldist + at);
    s.light_d = v3_select(s.connected, record_v3(r->ldx, r->ldy, r->ldz, at), d);
    s.wo = v3_select(s.scattered, record_v3(r->wox, r->woy, r->woz, at), d);
    s.onward = spec_zero_unless(s.scattered, spec_scale(suffix, f_load(r->sw + at)));
    s.at = collision_look(t, batch->group, &s.hit, d);
    s.light_phase = phase_eval(&s.at.call, s.at.wi, s.light_d);
    s.phase = phase_eval(&s.at.call, s.at.wi, s.wo);
    s.light_value = p->light_value;
    s.transmittance = p->transmittance;
    s.lit = spec_mul(s.light_value, spec_mul(s.unshadowed, s.transmittance));
    if (t->job->rides && t->job->beacons) {
        collision_flow(t, batch, slot, &s);
    }
    return s;
}

// What collisions per volume, which scatter of the light sample's `lit`, change with where they lie, dp, and with the direction w
// along which they are met, dw. Nothing changes where nothing collides, but for voxels about it.
static NOINLINE void collisions_slope(const Tracer *t, const CollisionSweep *s, Spec lit, Vec3 w, Vec3 *dp, Vec3 *dw) {
    const SceneView *scene = t->scene;
    const MediumNode *medium = s->at.medium;
    Mask m = m_gt(s->flow.share, f_set(0));
    Spec brought = spec_scale(lit, s->light_phase), by_extinction = spec_zero();
    for (int c = 0; c < SPEC_N; c++) { // of a medium with a sigma_s, that over the extinction is the albedo
        Float worth = medium->sigma_s >= 0 ? brought.c[c] : brought.c[c] * s->at.albedo.c[c];
        by_extinction.c[c] = f_zero_unless(m, worth * f_safe_rcp(s->extinction.c[c]));
    }
    extinction_slope(scene, medium, GAIN, s->hit.p, w, by_extinction, m, dp, dw);
    if (medium->sigma_s < 0 && scene->volumes[medium->albedo].kind == VOLUME_GRID) {
        v3_acc(dp, volume_slope(scene, scene->volumes + medium->albedo, s->hit.p, spec_zero_unless(m, brought)));
    }
}

// What the flow asks of the motion of the light beyond that of the ray, beside what is on the way of either: of a contribution
// `lit` of the light sample, by which dwi is the adjoint of the direction back, and ride that of the collision's position.
static NOINLINE Vec3 flow_adj(const Tracer *t, const CollisionSweep *s, Int slot, Spec lit, Vec3 dwi, Vec3 ride) {
    const BeaconFlow *flow = &s->flow;
    Spec worth = spec_scale(spec_mul(lit, s->at.albedo), s->light_phase);
    Vec3 w = v3_neg(s->at.wi), dw = v3_zero();
    if (!medium_is_even(t->scene, (int32_t)(s->at.medium - t->scene->media))) {
        collisions_slope(t, s, lit, w, &ride, &dw);
    }
    dwi = v3_sub(dwi, dw);
    Vec3 across = v3_madd(dwi, -v3_dot(w, dwi), w);
    Vec3 d = v3_madd(v3_madd(ride, -flow->rcp, across), -spec_dot(worth, s->extinction), w);
    d = v3_madd(v3_scale(d, flow->share), spec_sum(worth), flow->slope);
    if (t->job->mode == MODE_REVERSE && flows_drift(t)) { // in forward mode: flow_drift
        Spec brought = spec_mul(s->beta, s->flowing);
        d = v3_madd(d, spec_dot(brought, spec_gather(t->ws.adjoint_x, slot)), flow->film_x);
        d = v3_madd(d, spec_dot(brought, spec_gather(t->ws.adjoint_y, slot)), flow->film_y);
    }
    return v3_select(m_gt(flow->share, f_set(0)), d, v3_zero());
}

// Forward mode: what the flow carries across the film.
static NOINLINE void flow_drift(const Tracer *t, const CollisionSweep *s, Int slot, int channel, Sink *sink, Mask m) {
    const BeaconFlow *flow = &s->flow;
    m = m & flow->first & m_gt(flow->share, f_set(0));
    if (t->job->mode != MODE_FORWARD || !flows_drift(t) || !m_any(m)) {
        return;
    }
    Float brought = s->beta.c[channel] * s->flowing.c[channel];
    const Vec3 along[2] = {flow->film_x, flow->film_y};
    real *out[2] = {t->ws.adjoint_x[channel], t->ws.adjoint_y[channel]};
    for (int i = 0; i < 2; i++) {
        beacon_flow_adj(t, s->light, slot, v3_scale(along[i], brought), flow->first, sink, m);
        f_scatter_add(out[i], slot, sink_taken(sink), m);
    }
}

// What the part of the radiance onwards that moves with a light asks of the collision's position.
static Vec3 still_onward_adj(const Tracer *t, const CollisionSweep *s, Spec delta, Int slot, int channel, Sink *sink) {
    Sink quiet = *sink; // parameters have had their share
    quiet.texture_at = t->job->none;
    quiet.point = NULL;
    Vec3 dwi = v3_zero(), dwo = v3_zero();
    Spec onward = spec_mul(spec_mul(delta, s->beta), s->attached);
    phase_adj(&s->at.call, s->at.wi, s->wo, spec_dot(onward, s->at.albedo), &quiet, s->ahead, &dwi, &dwo);
    return still_move_adj(t, slot, channel, still_turn(t, slot, s->hit.p), s->wo, dwo, m_set(false), sink, s->ahead);
}

// What the light sample of a flow asks, `pull`, of its light and of the ray; the sensor's part has its own place.
static void flow_finish(const Tracer *t, const CollisionSweep *s, Int slot, Vec3 pull, Glide *g, Sink *sink) {
    Mask m = m_gt(s->flow.share, f_set(0));
    beacon_flow_adj(t, s->light, slot, pull, s->flow.first, sink, m);
    glide_add(g, s->hit.p, v3_neg(pull), m & ~s->flow.first);
}

// g: the ray that the collision ended; null unless it glides. Returns what flow_adj does.
static NOINLINE Vec3 collision_adj(const Tracer *t, const CollisionSweep *s, Int slot, int32_t live, Spec delta, Glide *g,
                                   Sink *sink) {
    const SceneView *scene = t->scene;
    Spec worth = spec_mul(delta, s->beta);
    Spec lit = spec_zero_unless(s->connected, spec_mul(worth, s->lit)), onward = spec_mul(worth, s->onward);
    LightMove move = light_move_zero();
    Vec3 dwi = v3_zero(), dwo = v3_zero(), pull = v3_zero();
    Vec3 slope = v3_zero(), light_slope = v3_zero(); // the latter: where volumes are looked up
    const bool moves = sink->any_places || g;
    if (t->job->live_lights && m_any(s->connected)) {
        Spec dl = spec_mul(spec_mul(worth, spec_mul(s->unshadowed, s->transmittance)), s->at.albedo);
        Vec2 at = {f_set(0), f_set(0)};
        sink->at = t->job->rides ? &at : NULL; // shadow rays that ride slide over their lights
        sink->point = t->job->rides ? &light_slope : NULL;
        lights_adj(scene, s->light, s->connected, s->light_uv, s->light_prim, s->light_distance,
                   spec_zero_unless(s->connected, spec_scale(dl, s->light_phase)), moves ? &move : NULL, sink);
        sink->at = NULL;
        sink->point = NULL;
        if (t->job->rides) {
            Connection to = {s->hit.p, s->light_d, s->light_distance, s->light, s->light_prim, s->connected};
            glide_add(g, s->hit.p, connection_end_adj(t, &to, &move, at, light_slope, true, sink), s->connected);
            // Those of surfaces have been used; of lights at a point they say in which direction the light leaves.
            Mask points = mi_lt(EMITTER_FIELD(scene, i_select(s->connected, s->light, i_set(0)), shape), i_set(0));
            move.uv = (Vec2){f_zero_unless(points, move.uv.x), f_zero_unless(points, move.uv.y)};
        }
    }
    sink->point = g ? &slope : NULL;
    if (moves && m_any(s->connected)) {
        phase_adj(&s->at.call, s->at.wi, s->light_d, spec_dot(lit, s->at.albedo), sink, s->connected, &dwi, &move.d);
        lights_move_adj(scene, s->light, s->connected, s->hit.p, s->light_d, s->light_distance, &move, sink);
        if (t->job->rides && t->job->beacons) {
            pull = flow_adj(t, s, slot, lit, dwi, v3_add(move.ref, slope));
        }
    }
    if (live & LIVE_ALBEDO) {
        const VolumeNode *albedo = scene->volumes + s->at.medium->albedo;
        Spec d = spec_add(spec_scale(lit, s->light_phase), spec_scale(onward, s->phase));
        volume_world_adj(scene, albedo, s->hit.p, spec_zero_unless(s->m, d), sink, s->m);
        if (g) {
            glide_look(scene, g, albedo, s->hit.p, d, s->m);
        }
    }
    if (live & LIVE_PHASE) {
        if (!moves) {
            phase_adj(&s->at.call, s->at.wi, s->light_d, spec_dot(lit, s->at.albedo), sink, s->connected, &dwi, &dwo);
        }
        phase_adj(&s->at.call, s->at.wi, s->wo, spec_dot(onward, s->at.albedo), sink, s->scattered, &dwi, &dwo);
    }
    sink->point = NULL;
    if (g) {
        glide_add(g, s->hit.p, v3_add(slope, v3_select(s->connected, move.ref, v3_zero())), s->m);
        g->turn = v3_select(s->m, v3_neg(dwi), v3_zero());
    }
    return pull;
}

static void collision_sweep(Tracer *t, const RecordBatch *batch, Int slot, Spec suffix, Mask finite, bool live_passing,
                            Passage *p, Sink *sink) {
    const int32_t live = t->job->live[t->scene->groups_count + batch->group];
    const bool glides = t->job->glides || t->job->rides, flows = t->job->rides && t->job->beacons;
    if (!(live & (LIVE_ALBEDO | LIVE_PHASE)) && !t->job->live_lights && !live_passing && !glides) {
        return;
    }
    CollisionSweep s = collision_load(t, batch, slot, suffix, p);
    s.at.call.at.hit = &s.hit; // not where it was loaded
    if (s.at.medium->sigma_s >= 0) { // where an extinction is live, so is what shadow rays pass
        Spec lit = spec_zero_unless(s.connected, spec_scale(s.lit, s.light_phase));
        spec_scatter(t->ws.collided, slot, spec_add(lit, spec_scale(s.onward, s.phase)), s.m);
    }
    for (int c = 0; c < drives(t); c++) {
        Spec delta = spec_zero_unless(finite, slot_adjoint(t, slot, c));
        // Where it goes on, its direction stays: the ray ahead is dragged along as a whole.
        Glide g = {.ref = s.hit.p, .d = s.at.wi};
        if (glides) {
            g.position = rows_gather(&t->ws.drag, c, slot);
        }
        Vec3 pull = collision_adj(t, &s, slot, live, delta, glides ? &g : NULL, sink);
        if (live_passing) {
            // L += albedo p Le w_l T
            Spec dt = spec_mul(spec_mul(delta, s.beta), spec_mul(s.unshadowed, spec_mul(s.at.albedo, s.light_value)));
            dt = spec_scale(dt, s.light_phase);
            Connection to = {s.hit.p, s.light_d, s.light_distance, s.light, s.light_prim, s.connected};
            Vec3 dp = connection_passage_adj(t, &p->walk, s.transmittance, dt, slot, batch->bounce, &to, true, sink);
            g.position = v3_add(g.position, dp);
            pull = flows ? v3_madd(pull, s.flow.share, dp) : pull;
        }
        if (m_any(s.ahead)) {
            v3_acc(&g.position, still_onward_adj(t, &s, delta, slot, c, sink));
        }
        if (flows) {
            flow_finish(t, &s, slot, pull, &g, sink);
        }
        if (t->job->rides) {
            const Carried first = {g.position, g.turn};
            first_ride_adj(t, batch, slot, s.hit.p, &first, sink, finite);
        }
        forward_flush(t, sink, slot, c, s.m);
        if (flows) {
            flow_drift(t, &s, slot, c, sink, finite);
            g.turn = v3_select(m_gt(s.flow.share, f_set(0)), v3_zero(), g.turn); // is in what it asks for already
            rows_scatter(&t->ws.pull, c, slot, v3_zero(), s.m);
        }
        if (glides) {
            glide_store(t, &g, c, slot, finite);
        }
    }
    if (t->job->rides) {
        ride_collision(t, slot, s.hit.p, s.flowing, s.light, s.m);
    } else if (glides) {
        glide_refer(t, slot, s.hit.p, finite);
    }
}
