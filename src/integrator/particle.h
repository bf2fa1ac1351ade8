// particle.h: light tracing: particles start on lights, scatter, and every vertex is connected to a point of the
// sensor, so that contributions carry a film position of their own. Paths of at least two segments; what the sensor sees
// of lights directly is left to a camera pass. The weights are those of the path tracer read backwards, shading normals
// included [veach1997 section 5.3]. In derivative modes every vertex is recorded for particle_adj.h.
#pragma once

#include "integrator/particle_job.h"
#include "integrator/particle_sight.h"
#include "integrator/particle_start.h"
#include "integrator/path.h"
#include "sensor/filter.h"

// ---- film --------------------------------------------------------------------------------------------------------

// Pixels that a contribution at x reaches along one axis, and what each of them gets of it.
static void footprint_along(const SensorRecord *s, double x, int32_t *first, int32_t *last) {
    *first = (int32_t)floor(x);
    *last = *first + 1;
    if (s->filter != FILM_BOX) {
        filter_range(s, (float)x, first, last);
    }
}

KFN float footprint_share(const SensorRecord *s, int32_t pixel, double x) {
    return s->filter == FILM_BOX ? 1 : filter_eval(s, (float)(pixel + 0.5 - x));
}

static void particle_splat(Tracer *t, double x, double y, const double *l) {
    PathJob *job = t->job;
    const SensorRecord *s = t->sensor;
    int32_t x0 = job->x - job->border, y0 = job->y - job->border;
    int32_t width = job->width + 2 * job->border, height = job->height + 2 * job->border;
    int32_t left, right, top, bottom;
    if (!(l[0] + l[1] + l[2] - (l[0] + l[1] + l[2]) == 0)) {
        job->nonfinite++;
        return;
    }
    footprint_along(s, x, &left, &right);
    footprint_along(s, y, &top, &bottom);
    for (int32_t j = top < y0 ? y0 : top; j < bottom && j < y0 + height; j++) {
        float wy = footprint_share(s, j, y);
        for (int32_t i = left < x0 ? x0 : left; i < right && i < x0 + width; i++) {
            float w = wy * footprint_share(s, i, x);
            double *pixel = job->film + ((int64_t)(j - y0) * width + i - x0) * SPEC_N;
            for (int c = 0; c < SPEC_N; c++) {
                pixel[c] += (double)w * l[c];
            }
        }
    }
}

static void particle_splat_lanes(Tracer *t, Float x, Float y, Spec l, Mask m) {
    for (uint32_t bits = m_bits(m); bits; bits &= bits - 1) {
        int lane = __builtin_ctz(bits);
        double rgb[SPEC_N];
        for (int c = 0; c < SPEC_N; c++) {
            rgb[c] = (double)f_lane(l.c[c], lane);
        }
        particle_splat(t, (double)f_lane(x, lane), (double)f_lane(y, lane), rgb);
    }
}

// ---- vertices ----------------------------------------------------------------------------------------------------

// What a batch of lanes found, seen from the light: wl points back to where the particle came from.
typedef struct Landing {
    Vertex v;
    Interaction si;
    BsdfCall call;
    BsdfSurface surface;
    Vec3 wl, dp_dv;
    Float cosine; // of the surface itself
    const Group *group;
} Landing;

// Lanes of m in which nothing stands in the way of rays. seen: nor do lights that hide from the sensor, which they lead to.
KFN Mask rays_open(Tracer *t, const Ray *ray, bool seen, Mask m) {
    t->job->rays += m_count(m);
    if (seen && t->scene->hide_emitters) {
        Hit hit = trace_past_emitters(t, *ray, m, trace_closest(t->scene, ray, m, false));
        return m & mi_lt(hit.shape, i_set(0));
    }
    return m & m_gt(spec_max(trace_transmittance(t->scene, ray, m)), f_set(0));
}

// Lanes of m whose ray reaches the sensor, or unless it is `seen`, what the sensor sees it in: tubes stop only what that sends out.
KFN Mask particle_open(Tracer *t, const Ray *ray, bool seen, Mask m) {
    Ray back = {v3_madd(ray->o, ray->tmax, ray->d), v3_neg(ray->d), ray->tmax};
    return rays_open(t, t->scene->segments_count ? &back : ray, seen, m);
}

// What the sensor sees of a vertex: the place of the light sample is the position on the film.
KFN void record_sight(Tracer *t, int32_t record, const Sight *sight, Vec3 d, Float weight, Spec f) {
    Records *r = &t->ws.records;
    f_store(r->ldx + record, d.x);
    f_store(r->ldy + record, d.y);
    f_store(r->ldz + record, d.z);
    f_store(r->lu + record, sight->x);
    f_store(r->lv + record, sight->y);
    spec_store(r->light_weight, record, spec_set(weight));
    spec_store(r->light_f, record, f);
}

KFN Sight particle_look(const Tracer *t, const Pinhole *pinhole, const Landing *at, int32_t bounce) {
    Vec2 u = {f_set(0), f_set(0)};
    if (t->sensor->kind == SENSOR_PERSPECTIVE || t->sensor->kind == SENSOR_ORTHOGRAPHIC) {
        return camera_look(pinhole, t->scene, t->sensor, at->si.p, u);
    }
    // The vertices of particles sample no lights.
    SampleKey key = slot_key(t, at->v.slot);
    u = rng_2d(&key, dimension(bounce + 1, PURPOSE_LIGHT));
    return t->sensor->kind == SENSOR_BATCH
               ? batch_look(t->scene, t->sensor, at->si.p, rng_1d(&key, dimension(bounce + 1, PURPOSE_LIGHT_CHOICE)), u)
               : single_look(pinhole, t->scene, t->sensor, at->si.p, u);
}

// Adds what the vertices send to the sensor: with F = f |cos| as the path tracer has it, for a viewer at the sensor,
// beta F |ng . wc| / |ng . wl| x pixels per area.
static void particle_connect(Tracer *t, const Pinhole *pinhole, const Landing *at, int32_t bounce,
                             int32_t record) {
    const PathJob *job = t->job;
    Sight sight = particle_look(t, pinhole, at, bounce);
    Mask m = at->v.m & sight.valid & m_gt(at->cosine, f_set(0)) & m_ge(sight.x, f_set((real)job->x)) &
             m_lt(sight.x, f_set((real)(job->x + job->width))) & m_ge(sight.y, f_set((real)job->y)) &
             m_lt(sight.y, f_set((real)(job->y + job->height)));
    if (!m_any(m)) {
        return;
    }
    Vec3 d = v3_select(m, sight.d, v3_neg(at->v.d)), view = frame_to_local(&at->si.sh, d);
    Float weight = f_abs(v3_dot(at->si.ng, d)) * f_safe_rcp(at->cosine) * sight.density, pdf = f_set(0);
    Spec f = t->derivative ? bsdf_eval_pdf(&at->call, view, at->wl, i_set(LOBE_SMOOTH), &pdf)
                           : bsdf_eval(&at->call, view, at->wl, i_set(LOBE_SMOOTH));
    Spec l = spec_scale(spec_mul(at->v.beta, f), weight);
    // A derivative may be non-zero where the value is 0, wherever scattering has a positive density.
    m = m & (t->derivative ? m_gt(pdf, f_set(0)) | m_gt(spec_max(f), f_set(0)) : m_gt(spec_max(l), f_set(0)));
    Ray ray = {interaction_offset(&at->si, d), d, sight.length * (1.0f - SHADOW_SHORT)};
    m = particle_open(t, &ray, true, m);
    if (t->derivative) {
        record_sight(t, record, &sight, d, f_zero_unless(m, weight), f);
    } else {
        particle_splat_lanes(t, sight.x, sight.y, l, m);
    }
}

// Stores the particles of m behind the `count` that are there already; returns their number.
static int32_t particle_append(Paths *next, int32_t count, Vec3 o, Vec3 d, Spec beta, Float eta2, Float roulette, Int slot,
                               Mask m) {
    f_compress(next->ox + count, o.x, m);
    f_compress(next->oy + count, o.y, m);
    f_compress(next->oz + count, o.z, m);
    f_compress(next->dx + count, d.x, m);
    f_compress(next->dy + count, d.y, m);
    f_compress(next->dz + count, d.z, m);
    f_compress(next->tmax + count, f_set(INFINITY), m);
    spec_compress(next->beta, count, beta, m);
    f_compress(next->eta2 + count, eta2, m);
    f_compress(next->roulette + count, roulette, m);
    i_compress(next->slot + count, slot, m);
    return count + m_count(m);
}

// The value of a sampled direction, and what it is multiplied with: the path tracer's value is taken with the directions
// exchanged; of delta lobes, whose value knows one direction only, the factor by which radiance grows at refraction is
// undone.
KFN Spec particle_value(const Landing *at, const BsdfSample *s, Float *factor) {
    Float pdf;
    Mask smooth = mi_eq(s->lobe, i_set(LOBE_SMOOTH));
    Spec f = bsdf_eval_pdf(&at->call, at->wl, s->wo, s->lobe, &pdf);
    Vec3 d = frame_to_world(&at->si.sh, s->wo);
    Float ratio = f_abs(v3_dot(at->si.ng, d)) * f_safe_rcp(at->cosine);
    Float turn = s->eta * s->eta * f_abs(at->wl.z) * f_safe_rcp(f_abs(s->wo.z));
    *factor = f_select(smooth, f_set(1), turn) * ratio * f_safe_rcp(pdf);
    *factor = f_zero_unless(at->v.m & m_gt(pdf, f_set(0)) & m_gt(at->cosine, f_set(0)), *factor);
    Spec exchanged = m_any(smooth) ? bsdf_eval(&at->call, s->wo, at->wl, i_set(LOBE_SMOOTH)) : f;
    return spec_select(smooth, exchanged, f);
}

static int32_t particle_scatter(Tracer *t, const Landing *at, int32_t bounce, int32_t record, int32_t next_count) {
    const Paths *p = &t->ws.paths[t->current];
    SampleKey key = slot_key(t, at->v.slot);
    Onward w = {.begins = i_set(BEGINS_AT_SURFACE)};
    w.sample = bsdf_sample(&at->call, at->wl, rng_1d(&key, dimension(bounce + 1, PURPOSE_LOBE)),
                           rng_2d(&key, dimension(bounce + 1, PURPOSE_DIRECTION)));
    w.eta2 = real_gather(p->eta2, at->v.at) * f_safe_rcp(w.sample.eta * w.sample.eta);
    w.f = particle_value(at, &w.sample, &w.rcp);
    Mask m = at->v.m & m_gt(w.rcp, f_set(0));
    Spec weight = spec_zero_unless(m, spec_scale(w.f, w.rcp));
    w.beta = spec_mul(at->v.beta, weight);
    m = m & m_finite(spec_sum(w.beta));
    // As paths from the camera do, particles of no weight go on where derivatives are asked for.
    Float least = t->derivative ? f_max(spec_max(weight), f_set(DERIVATIVE_FLOOR)) : spec_max(weight);
    w.roulette = real_gather(p->roulette, at->v.at) * least;
    m = t->derivative ? m : m & m_gt(spec_max(w.beta), f_set(0));
    if (bounce + 2 >= t->scene->rr_depth) {
        Float q = f_min(w.roulette, f_set(0.95f)), rcp = f_safe_rcp(q);
        m = m & m_lt(rng_1d(&key, dimension(bounce + 1, PURPOSE_ROULETTE)), q);
        w.beta = spec_scale(w.beta, rcp);
        w.rcp = w.rcp * rcp;
        w.roulette = w.roulette * rcp;
    }
    w.m = m;
    w.d = frame_to_world(&at->si.sh, w.sample.wo);
    if (record >= 0) {
        record_onward(t, record, true, w.d, &w);
    }
    if (t->lobes) {
        i_scatter(t->lobes, at->v.slot, w.sample.lobe, at->v.m);
    }
    Paths *next = &t->ws.paths[1 - t->current];
    Vec3 o = interaction_offset(&at->si, w.d);
    const Mask passed = lobe_is(w.sample.lobe, LOBE_NULL);
    if (t->scene->through) {
        i_compress(next->depth + next_count, at->v.depth + i_select(passed, i_set(0), i_set(1)), m);
    }
    if (t->scene->has_media) {
        Int medium = medium_behind(at->group, at->si.ng, w.d, at->v.medium), through = at->v.medium;
        o = v3_select(passed, pass_on(t, at->group, &at->si, &at->v.hit, w.d, m & passed, &through), o);
        i_compress(next->medium + next_count, i_select(passed, through, medium), m);
        f_compress(next->skip + next_count, v3_dot(v3_sub(o, at->si.p), w.d), m);
    }
    return particle_append(next, next_count, o, w.d, w.beta, w.eta2, w.roulette, at->v.slot, m);
}

// Fills what follows from the vertex.
KFN void landing_look(const Tracer *t, const Group *group, Landing *at) {
    const SceneView *scene = t->scene;
    at->group = group;
    at->si = shape_interaction(scene, group->shape_kind, group->shape_flags, &at->v.hit);
    at->wl = frame_to_local(&at->si.sh, v3_neg(at->v.d));
    at->cosine = f_abs(v3_dot(at->si.ng, at->v.d));
    at->call = bsdf_call(scene, group->bsdf, texcoord(at->si.uv, &at->v.hit), t->floor);
    if (scene->bsdfs[group->bsdf].surface) {
        find_surface(scene, group, &at->v.hit, &at->surface, &at->dp_dv);
        at->call.surface = &at->surface;
    }
}

static int32_t particle_batch(Tracer *t, const Pinhole *pinhole, int32_t group_id, const int32_t *order, int32_t count,
                              int32_t bounce, int32_t next_count) {
    const SceneView *scene = t->scene;
    const Group *group = scene->groups + group_id;
    bool ends = scene->max_depth >= 0 && bounce + 3 > scene->max_depth;
    int32_t record = -1;
    Landing at;
    at.v = vertex_load(t, order, count, bounce);
    if (t->derivative) {
        record = record_claim(t, VERTEX_SURFACE, group_id, count, bounce);
        if (record < 0) {
            return next_count;
        }
        record_vertex(t, record, &at.v, f_set(0), spec_zero());
    }
    landing_look(t, group, &at);
    if (!scene->hide_emitters || group->emitter < 0) {
        particle_connect(t, pinhole, &at, bounce, record);
    }
    return ends ? next_count : particle_scatter(t, &at, bounce, record, next_count);
}

// ---- particles ---------------------------------------------------------------------------------------------------

// The records of a chunk have room for its starts.
KFN void record_start(Tracer *t, Int light, const ParticleStart *s, Float factor, Int slot, int32_t lanes) {
    Records *r = &t->ws.records;
    int32_t at = record_claim(t, VERTEX_LIGHT, -1, lanes, 0);
    i_store(r->light + at, light);
    i_store(r->lprim + at, s->prim);
    i_store(r->slot + at, slot);
    f_store(r->lu + at, s->uv.x);
    f_store(r->lv + at, s->uv.y);
    f_store(r->sw + at, factor);
    spec_scatter(t->ws.suffix, slot, spec_zero(), m_first_n(lanes));
}

// Starts `count` particles from number `first` on.
static void particle_start_stage(Tracer *t, int64_t first, int32_t count) {
    enum { PER_SET = 1 << 24 }; // samples of one scramble
    const SceneView *scene = t->scene;
    for (int32_t i = 0; i < count; i++) {
        t->ws.pixel[i] = (int32_t)((first + i) / PER_SET);
        t->ws.sample[i] = (int32_t)((first + i) % PER_SET);
    }
    t->active = t->current = 0;
    t->record_count = t->batch_count = 0;
    t->overflow = false;
    for (int32_t i = 0; i < count; i += LANES) {
        Mask m = m_first_n(count - i);
        Int slot = i_select(m, i_iota() + i, i_set(i));
        SampleKey key = slot_key(t, slot);
        Float choice;
        Int light = emitter_choose(scene, rng_1d(&key, dimension(0, PURPOSE_LIGHT_CHOICE)), &choice);
        Vec2 u1 = rng_2d(&key, dimension(0, PURPOSE_LIGHT)), u2 = rng_2d(&key, dimension(0, PURPOSE_DIRECTION));
        Vec2 zero = {f_set(0), f_set(0)};
        ParticleStart s = {v3_zero(), v3_zero(), zero, i_set(0), f_set(0), m_set(false)};
        for (Mask left = m, mine; m_any(left); left = left & ~mine) {
            int32_t id = i_lane(light, m_first(left));
            mine = left & mi_eq(light, i_set(id));
            ParticleStart one = emitter_start(scene, scene->emitters + id, u1, u2);
            s.o = v3_select(mine, one.o, s.o);
            s.d = v3_select(mine, one.d, s.d);
            s.uv.x = f_select(mine, one.uv.x, s.uv.x);
            s.uv.y = f_select(mine, one.uv.y, s.uv.y);
            s.prim = i_select(mine, one.prim, s.prim);
            s.factor = f_select(mine, one.factor, s.factor);
            s.valid = s.valid | (mine & one.valid);
        }
        Spec beta = spec_scale(starts_value(scene, light, m, s.uv, s.prim), s.factor * f_safe_rcp(choice));
        m = m & s.valid & m_finite(spec_sum(beta)) & (t->derivative ? m : m_gt(spec_max(beta), f_set(0)));
        if (t->derivative) {
            int32_t lanes = count - i < LANES ? count - i : LANES;
            record_start(t, light, &s, f_zero_unless(m, s.factor * f_safe_rcp(choice)), slot, lanes);
        }
        t->active = particle_append(&t->ws.paths[0], t->active, s.o, s.d, beta, f_set(1), f_set(1), slot, m);
    }
    t->job->paths += count;
}

// Runs the particles to their ends. begin: scratch of group count + 2 entries.
static void particle_forward(Tracer *t, const Pinhole *pinhole, int32_t *begin) {
    const SceneView *scene = t->scene;
    int32_t groups = (int32_t)scene->groups_count + 1;
    for (int32_t bounce = 0; t->active > 0 && !t->overflow && bounce < MAX_BOUNCES; bounce++) {
        if (scene->max_depth >= 0 && bounce + 2 > scene->max_depth) {
            return;
        }
        trace_stage(t, 1);
        sort_stage(t, begin, groups);
        int32_t next_count = 0;
        for (int32_t g = 1; g < groups; g++) {
            for (int32_t k = begin[g]; k < begin[g + 1] && !t->overflow; k += LANES) {
                int32_t count = begin[g + 1] - k < LANES ? begin[g + 1] - k : LANES;
                next_count = particle_batch(t, pinhole, g - 1, t->ws.order + k, count, bounce, next_count);
            }
        }
        t->current = 1 - t->current;
        t->active = next_count;
    }
}
