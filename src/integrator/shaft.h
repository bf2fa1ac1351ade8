// shaft.h: the borders of shafts of light in media, at which the light of a projector, or a spot, ends abruptly or jumps
// (emitter/beam.h). A flight that passes one at x, with n its normal, v its velocity and v' that of the ray's own point there, sees
// it move along the ray by dx = n . (v - v') / n . d, and what the light scatters differs by its jump J before and behind it:
//   dL = dx T(x) s a p J V,                                                                                      (border.h, 1)
// s the extinction, a the albedo, p the phase function, V what the shadow ray lets through. Each flight shows one of the borders
// that it passes, the more likely the more that brings. Where the light lies within the medium, that has no finite variance
// (render/beacons.c). docs/derivations/media.md.
#pragma once

#include "emitter/beam.h"
#include "integrator/border.h"
#include "integrator/walk.h"

// How far beside a border its light is looked up, as a share of the picture.
#define SHAFT_STEP 2e-5f
// Flights without end.
#define SHAFT_FAR 1e12f
// Random numbers of a flight, from here on: two for each border in question.
#define SHAFT_DIMENSION 16u

// A batch of flights, and the border that each of them shows.
typedef struct Shafts {
    Track track;
    bool uniform;        // the transmittance is known, and the whole way looked at; else what has been flown
    Spec sigma;          // extinction of uniform media
    Int slot;
    Vec3 o, d;
    Float low, high, tmax;
    Spec beta;
    SampleKey random;
    uint32_t asked;      // borders so far
    Mask m;              // lanes that show one
    Float at, worth, total;
    Int light;
    Vec3 n;
    Spec jump;           // before it less behind it, with the transmittance where that is known
} Shafts;

static Shafts shafts_load(const Tracer *t, const RecordBatch *batch) {
    const Records *r = &t->ws.records;
    const int32_t at = batch->first;
    Shafts s = {.track = track_of(t, batch->group), .m = m_first_n(batch->count)};
    s.uniform = track_is_uniform(&s.track);
    s.slot = i_select(s.m, i_load(r->slot + at), i_set(0));
    s.o = record_v3(r->px, r->py, r->pz, at);
    s.d = record_v3(r->dx, r->dy, r->dz, at);
    s.beta = spec_load(r->beta, at);
    s.sigma = s.uniform ? uniform_extinction(t->scene, &s.track, s.d) : spec_zero();
    s.low = f_set(0);
    s.tmax = s.high = f_load(r->sw + at);
    medium_span(t->scene, s.track.medium, s.track.sigma_t, s.o, s.d, &s.low, &s.high);
    s.high = f_min(s.uniform ? s.high : f_min(s.high, f_load(r->ldist + at)), f_set(SHAFT_FAR));
    s.random = stream_key(t, s.slot, batch->bounce, STREAM_PROBE);
    // The light sample there makes the path two longer.
    s.m = s.m & m_lt(s.low, s.high) & depth_allows(t->scene, i_load(r->depth + at) + 2);
    s.worth = s.total = s.at = f_set(0);
    s.light = i_set(-1);
    s.n = v3_zero();
    s.jump = spec_zero();
    return s;
}

// Offers the lanes of m the border at the distance `at` with the normal n of the light's space, one of `count`.
static NOINLINE void shaft_offer(const Tracer *t, const Light *l, const Float extent[2], Float at, Vec3 n, Float count, Float u,
                                 Mask m, Shafts *s) {
    const SceneView *scene = t->scene;
    at = f_select(m, at, f_set(0));
    LightSample to = emitter_sample_as(scene, l, v3_madd(s->o, at, s->d), (Vec2){f_set(0), f_set(0)});
    Vec3 normal = light_gradient_to_world(scene, l, n);
    Float along = v3_dot(normal, s->d), steep = f_sqrt(n.x * n.x + n.y * n.y);
    // Along the ray, (u, v) cross the border as n has it, or against that.
    Float step = f_copysign((f_abs(extent[0]) + f_abs(extent[1])) * SHAFT_STEP, along) * f_safe_rcp(steep);
    TexCoord before = texcoord((Vec2){to.uv.x - step * n.x, to.uv.y - step * n.y}, NULL);
    TexCoord behind = texcoord((Vec2){to.uv.x + step * n.x, to.uv.y + step * n.y}, NULL);
    Spec jump = spec_sub(emitter_eval_as(scene, l, before, to.distance), emitter_eval_as(scene, l, behind, to.distance));
    jump = spec_scale(jump, count);
    jump = s->uniform ? spec_mul(jump, uniform_transmittance(s->sigma, at)) : jump;
    Float worth = f_set(0), slant = v3_length(normal) * f_safe_rcp(f_abs(along));
    for (int c = 0; c < SPEC_N; c++) {
        worth = worth + f_abs(jump.c[c] * s->beta.c[c]) * slant;
    }
    m = m & to.valid & m_gt(worth, f_set(0)) & m_finite(worth);
    s->total = s->total + f_zero_unless(m, worth);
    m = m & m_lt(u * s->total, worth);
    s->at = f_select(m, at, s->at);
    s->worth = f_select(m, worth, s->worth);
    s->light = i_select(m, l->id, s->light);
    s->n = v3_select(m, v3_scale(normal, f_safe_rcp(along)), s->n);
    s->jump = spec_select(m, jump, s->jump);
}

// Of the lines of a step of the light's picture that flights pass, any one.
static void shaft_lines(const Tracer *t, const Light *l, const Float extent[2], const StepRecord *step, Vec3 q, Vec3 dq,
                        Shafts *s) {
    Vec2 u = rng_2d(&s->random, SHAFT_DIMENSION + s->asked++);
    Float ends[2];
    // Where the flight is before the light, its value rises or falls all the way.
    Float level = -q.z * f_safe_rcp(dq.z), low = s->low, high = s->high;
    low = f_select(m_gt(dq.z, f_set(0)), f_max(low, level), low);
    high = f_select(m_lt(dq.z, f_set(0)), f_min(high, level), high);
    Mask m = s->m & m_lt(low, high) & (m_gt(q.z, f_set(0)) | m_gt(dq.z, f_set(0)));
    Vec3 zero = beam_plane(step, extent, f_set(0));
    for (int k = 0; k < 2; k++) {
        Float at = f_select(m, k ? high : low, f_set(0));
        Vec3 p = v3_madd(q, at, dq);
        ends[k] = v3_dot(zero, p) * f_safe_rcp(f_max(p.z, f_set(1e-30f)));
    }
    Float least = -f_floor(-f_max(f_min(ends[0], ends[1]), f_set((real)step->low)));
    Float most = f_floor(f_min(f_max(ends[0], ends[1]), f_set((real)step->high))), count = most - least + 1.0f;
    Vec3 n = beam_plane(step, extent, least + f_min(f_floor(u.x * count), count - 1.0f));
    Float at = -v3_dot(n, q) * f_safe_rcp(v3_dot(n, dq));
    m = m & m_ge(count, f_set(1)) & m_gt(at, low) & m_lt(at, high) & m_gt(q.z + at * dq.z, f_set(0));
    if (m_any(m)) {
        shaft_offer(t, l, extent, at, n, count, u.y, m, s);
    }
}

// The cone of a spot, x^2 + y^2 = tan^2 z^2, where flights enter or leave it.
static void shaft_cone(const Tracer *t, const Light *l, const Float extent[2], Vec3 q, Vec3 dq, Shafts *s) {
    const Float t2 = extent[0] * extent[0];
    Float a = dq.x * dq.x + dq.y * dq.y - t2 * dq.z * dq.z, b = q.x * dq.x + q.y * dq.y - t2 * q.z * dq.z;
    Float c = q.x * q.x + q.y * q.y - t2 * q.z * q.z, square = b * b - a * c;
    Float far = -(b + f_copysign(f_safe_sqrt(square), b));
    const Float root[2] = {far * f_safe_rcp(a), c * f_safe_rcp(far)};
    for (int k = 0; k < 2; k++) {
        Vec3 p = v3_madd(q, root[k], dq);
        Mask m = s->m & m_gt(square, f_set(0)) & m_gt(root[k], s->low) & m_lt(root[k], s->high) & m_gt(p.z, f_set(0));
        Float u = rng_1d(&s->random, SHAFT_DIMENSION + s->asked++);
        if (m_any(m)) {
            shaft_offer(t, l, extent, root[k], v3(p.x, p.y, -t2 * p.z), f_set(1), u, m, s);
        }
    }
}

// Chooses the border that each flight shows.
static void shafts_choose(const Tracer *t, Shafts *s) {
    for (int32_t i = 0; i < t->job->beam_count; i++) {
        const BeamRecord *beam = t->job->beams + i;
        Light l = light_alone(t->scene->emitters + beam->light, i_set(beam->light));
        Vec3 q = light_to_local(t->scene, &l, s->o), dq = light_direction_to_local(t->scene, &l, s->d);
        Float extent[2];
        beam_extent(t->scene, &l, extent);
        if (beam->cone) {
            shaft_cone(t, &l, extent, q, dq, s);
        }
        for (int32_t k = beam->first; k < beam->end; k++) {
            shaft_lines(t, &l, extent, t->job->beam_steps + k, q, dq, s);
        }
    }
    s->m = s->m & mi_lt(i_set(-1), s->light);
}

// What is scattered there of the jump, over the probability of the choice.
static Spec shaft_scattered(Tracer *t, const RecordBatch *batch, const Shafts *s, Hit *hit) {
    const SceneView *scene = t->scene;
    Int light = i_select(s->m, s->light, i_set(i_lane(s->light, m_first(s->m))));
    Spec radiance, jump = s->jump;
    LightSample to = lights_sample(scene, light, s->m, hit->p, (Vec2){f_set(0), f_set(0)}, &radiance);
    Collision c = collision_look(t, batch->group, hit, s->d);
    Spec f = spec_scale(c.albedo, phase_eval(&c.call, c.wi, to.d) * s->total * f_safe_rcp(s->worth));
    f = spec_mul(f, medium_extinction(scene, &s->track, hit->p, s->d));
    if (!s->uniform) {
        SampleKey own = stream_key(t, s->slot, batch->bounce, STREAM_FLIGHT);
        jump = spec_mul(jump, track_weight(&s->track, s->o, s->d, s->at, s->tmax, channel_shares(t, s->beta), s->m, &own, 0));
    }
    Ray ray;
    Mask blocked;
    Fog fog = {.medium = i_set(batch->group), .key = stream_key(t, s->slot, batch->bounce, STREAM_SHADOW), .past_lights = false};
    collision_shadow_ray(hit->p, to.d, to.distance, &ray);
    Spec passed = walk_transmittance(t, ray, veils_end(t, light), s->m, &fog, &blocked, NULL);
    return spec_mul(spec_mul(f, jump), passed);
}

// Accumulates what borders of light are worth that flights pass.
static NOINLINE void shafts_sweep(Tracer *t, const RecordBatch *batch, Mask finite, Sink *sink) {
    Shafts s = shafts_load(t, batch);
    s.m = s.m & finite;
    shafts_choose(t, &s);
    if (!m_any(s.m)) {
        return;
    }
    Hit hit = {.shape = i_set(0), .prim = i_set(0), .instance = i_set(0), .p = v3_madd(s.o, s.at, s.d)};
    Spec gain = shaft_scattered(t, batch, &s, &hit);
    Mask m = s.m & m_finite(spec_sum(gain));
    for (int c = 0; c < drives(t); c++) {
        Float worth = spec_dot(spec_mul(slot_adjoint(t, s.slot, c), s.beta), gain);
        Vec3 move = v3_select(m, v3_scale(s.n, worth), v3_zero());
        if (sink->any_places) {
            borders_move_adj(t->scene, s.light, hit.p, move, sink, m);
        }
        if (t->job->glides) {
            Glide g = glide_load(t, c, s.slot, glide_reference(t, s.slot, s.o), s.d);
            glide_add(&g, hit.p, v3_neg(move), m);
            glide_store(t, &g, c, s.slot, m);
        } else if (t->job->rides) {
            ride_add_point(t, batch, c, s.slot, hit.p, s.d, v3_neg(move), v3_zero(), sink, m);
        }
        forward_flush(t, sink, s.slot, c, m);
    }
    if (t->job->glides) {
        glide_refer(t, s.slot, glide_reference(t, s.slot, s.o), m);
    }
}
