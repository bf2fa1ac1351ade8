// path.h: the path tracer, forward half. A chunk of paths advances bounce by bounce through stages: trace, sort by
// shading group, emission and shading per group, shadow rays. Power-heuristic MIS of scattering and light sampling
// [veach1995]; depth, roulette and hide_emitters as Mitsuba defines them. In derivative modes every vertex is recorded
// for path_adj.h. Sampling, densities, MIS weights and roulette are detached.
#pragma once

#include "bsdf/bsdf.h"
#include "emitter/choice.h"
#include "integrator/split.h"
#include "integrator/walk.h"

// ---- vertices ----------------------------------------------------------------------------------------------------

// One batch of lanes at a vertex: indices into the path arrays, and what was found there.
typedef struct Vertex {
    Int at;          // positions in the path arrays
    Mask m;
    Int slot;
    Hit hit;
    Vec3 d, origin;  // incoming ray's direction, and the previous vertex
    Spec beta;
    Float pdf;
    Int depth;       // path segments behind it; the bounce, unless scene->through
} Vertex;

KFN Vertex vertex_load(const Tracer *t, const int32_t *order, int32_t count, int32_t bounce) {
    const Workspace *ws = &t->ws;
    const Paths *p = &ws->paths[t->current];
    Vertex v;
    v.m = m_first_n(count);
    v.at = i_select(v.m, i_load(order), i_set(order[0]));
    v.slot = i_gather(p->slot, v.at);
    v.hit.shape = i_max(i_gather(ws->hit_shape, v.at), i_set(0));
    v.hit.prim = i_gather(ws->hit_prim, v.at);
    v.hit.instance = i_gather(ws->hit_instance, v.at);
    v.hit.u = real_gather(ws->hit_u, v.at);
    v.hit.v = real_gather(ws->hit_v, v.at);
    v.hit.p = LOAD_V3(*ws, hit_x, hit_y, hit_z, v.at);
    v.d = LOAD_V3(*p, dx, dy, dz, v.at);
    v.origin = LOAD_V3(*p, px, py, pz, v.at);
    v.beta = spec_gather(p->beta, v.at);
    v.pdf = real_gather(p->pdf, v.at);
    v.depth = t->scene->through ? i_gather(p->depth, v.at) : i_set(bounce);
    return v;
}

// Adds radiance to the slots' sums. Slots are distinct within a batch.
KFN void slot_add(Tracer *t, Int slot, Spec l, Mask m) { spec_scatter_add(t->ws.radiance, slot, l, m); }

// Claims LANES record entries for a batch; -1 when there is no room.
KFN int32_t record_claim(Tracer *t, int32_t tag, int32_t group, int32_t count) {
    if (t->record_count + LANES > t->ws.record_capacity || t->batch_count == t->ws.batch_capacity) {
        t->overflow = true;
        return -1;
    }
    int32_t first = t->record_count;
    t->ws.batches[t->batch_count++] = (RecordBatch){tag, group, first, count, false, false};
    t->record_count += LANES;
    return first;
}

KFN void record_vertex(Tracer *t, int32_t at, const Vertex *v, Float mis, Spec emission) {
    Records *r = &t->ws.records;
    i_store(r->shape + at, v->hit.shape);
    i_store(r->prim + at, v->hit.prim);
    i_store(r->instance + at, v->hit.instance);
    i_store(r->slot + at, v->slot);
    i_store(r->slides + at, i_select(m_lt(v->pdf, f_set(0)), i_set(1), i_set(0)));
    f_store(r->u + at, v->hit.u);
    f_store(r->v + at, v->hit.v);
    f_store(r->px + at, v->hit.p.x);
    f_store(r->py + at, v->hit.p.y);
    f_store(r->pz + at, v->hit.p.z);
    f_store(r->dx + at, v->d.x);
    f_store(r->dy + at, v->d.y);
    f_store(r->dz + at, v->d.z);
    f_store(r->mis + at, mis);
    spec_store(r->beta, at, v->beta);
    spec_store(r->light_weight, at, spec_zero());
    spec_store(r->local, at, emission);
    spec_store(r->weight, at, spec_zero());
    f_store(r->sw + at, f_set(0));
}

KFN Float power_heuristic(Float a, Float b) { return a * a * f_safe_rcp(a * a + b * b); }

// Weight of what a scattered ray met, against having sampled it as a light with density light_pdf.
KFN Float scattered_weight(const Tracer *t, const Vertex *v, Float light_pdf) {
    Float pdf = v->pdf;
    if (t->scene->split) {
        Split s = split_of(t->scene, (UInt)i_gather(t->ws.sample, v->slot));
        light_pdf = light_pdf * s.light_pdf;
        pdf = pdf * s.scatter_pdf;
    }
    return f_select(m_lt(v->pdf, f_set(0)), f_set(1), power_heuristic(pdf, light_pdf));
}

// Alpha of a path is 1 where an environment shows, and where the path meets a surface that does not merely let it pass.
KFN bool keeps_coverage(const Tracer *t) { return t->job->coverage || (t->scene->drops && !t->derivative); }

KFN void cover(Tracer *t, Int slot, Mask m) { f_scatter(t->ws.coverage, slot, f_set(1), m); }

// Paths that left the scene: the environment, weighed against having been sampled as a light.
static void escape_batch(Tracer *t, const int32_t *order, int32_t count, int32_t bounce) {
    const SceneView *scene = t->scene;
    if (scene->environment < 0 || (bounce == 0 && scene->hide_emitters)) {
        return;
    }
    const EmitterRecord *e = scene->emitters + scene->environment;
    Vertex v = vertex_load(t, order, count, bounce);
    if (scene->hide_emitters) {
        v.m = v.m & m_gt(v.pdf, f_set(PDF_VIEWED));
    }
    Vec2 uv = environment_uv(scene, e, v.d);
    Float mis = f_zero_unless(v.m, scattered_weight(t, &v, environment_pdf(scene, e, v.d, uv) * e->weight));
    Spec l = spec_scale(emitter_eval(scene, e, texcoord(uv, NULL), f_set(1)), mis);
    if (!t->derivative) {
        slot_add(t, v.slot, spec_mul(v.beta, l), v.m);
        return;
    }
    int32_t at = record_claim(t, VERTEX_ESCAPED, -1, count);
    if (at >= 0) {
        record_vertex(t, at, &v, mis, l);
        t->ws.batches[t->batch_count - 1].first_vertex = bounce == 0;
    }
}

// MIS weight of light that the ray met at an area light, against having sampled that light.
KFN Float emission_weight(const Tracer *t, const EmitterRecord *e, const Vertex *v, const Interaction *si) {
    return scattered_weight(t, v, surface_light_pdf(t->scene, e, v->origin, v->d, si) * e->weight);
}

// The ray to a light: it starts off the surface and aims at the same point, or it would pass or meet the light itself.
KFN void shadow_ray(const Interaction *si, Vec3 d, Float distance, Ray *ray) {
    ray->o = interaction_offset(si, d);
    Vec3 to_light = v3_sub(v3_madd(si->p, distance, d), ray->o);
    Float length = f_sqrt(v3_dot(to_light, to_light));
    ray->d = v3_scale(to_light, f_safe_rcp(length));
    ray->tmax = length * (1.0f - 9e-4f);
}

// Appends the shadow rays of m: what they bring, and to whom.
KFN void append_shadows(Tracer *t, const Ray *ray, Spec l, Int slot, int32_t record, Mask m) {
    Shadows *q = &t->ws.shadows;
    int32_t at = t->shadow_count;
    v3_compress(q->ox + at, q->oy + at, q->oz + at, ray->o, m);
    v3_compress(q->dx + at, q->dy + at, q->dz + at, ray->d, m);
    f_compress(q->tmax + at, ray->tmax, m);
    spec_compress(q->radiance, at, l, m);
    i_compress(q->slot + at, slot, m);
    i_compress(q->record + at, i_iota() + record, m);
    t->shadow_count += m_count(m);
}

// The light sample of a vertex; its weight is multiplied by the transmittance once that is known.
KFN void record_light(Tracer *t, int32_t record, Int light, const LightSample *s, Float weight, Spec f) {
    Records *r = &t->ws.records;
    i_store(r->light + record, light);
    i_store(r->lprim + record, s->prim);
    f_store(r->ldx + record, s->d.x);
    f_store(r->ldy + record, s->d.y);
    f_store(r->ldz + record, s->d.z);
    f_store(r->lu + record, s->uv.x);
    f_store(r->lv + record, s->uv.y);
    f_store(r->ldist + record, s->distance);
    spec_store(r->light_weight, record, spec_set(weight));
    spec_store(r->light_f, record, f);
}

// Light sampling at a batch of surface vertices: appends shadow rays with what they will bring.
KFN void connect_lights(Tracer *t, const Vertex *v, const Interaction *si, const BsdfCall *call, Vec3 wi,
                        const SampleKey *key, int32_t bounce, int32_t record) {
    const SceneView *scene = t->scene;
    Float choice;
    SampleKey light_key = *key;
    Split split;
    if (scene->split) {
        split = split_of(scene, key->sample);
        light_key.sample = split.light_sample;
        key = &light_key;
    }
    Int light = emitter_choose(scene, rng_1d(key, dimension(bounce, PURPOSE_LIGHT_CHOICE)), &choice);
    Spec radiance;
    LightSample s = lights_sample(scene, light, v->m, si->p, rng_2d(key, dimension(bounce, PURPOSE_LIGHT)), &radiance);
    Vec3 wo = frame_to_local(&si->sh, s.d);
    Int smooth = i_set(LOBE_SMOOTH);
    Float scatter_pdf;
    Spec f = bsdf_eval_pdf(call, wi, wo, smooth, &scatter_pdf);
    Float pdf = s.pdf * choice;
    Float other_pdf = scatter_pdf, own_pdf = pdf;
    Mask drawn = v->m;
    if (scene->split) {
        own_pdf = pdf * split.light_pdf;
        other_pdf = scatter_pdf * split.scatter_pdf;
        pdf = pdf * f_safe_rcp(split.light_weight);
        drawn = drawn & split.light;
    }
    if (scene->through && scene->max_depth >= 0) {
        drawn = drawn & mi_lt(v->depth + 1, i_set(scene->max_depth));
    }
    Float mis = f_select(light_is_delta(scene, light), f_set(1), power_heuristic(own_pdf, other_pdf));
    Float weight = mis * f_safe_rcp(pdf);
    Spec l = spec_scale(spec_mul(f, radiance), weight);
    l = t->derivative ? l : spec_mul(v->beta, l);
    // A derivative may be non-zero where the value is 0, wherever scattering has a positive density.
    Mask useful = t->derivative ? m_gt(scatter_pdf, f_set(0)) | m_gt(spec_max(f), f_set(0)) : m_gt(spec_max(l), f_set(0));
    Mask m = drawn & s.valid & useful & m_gt(weight, f_set(0));
    Ray ray;
    shadow_ray(si, s.d, s.distance, &ray);
    append_shadows(t, &ray, l, v->slot, record, m);
    if (record >= 0) {
        record_light(t, record, light, &s, f_zero_unless(m, weight), f);
    }
}

// How a batch of paths goes on from its vertices.
typedef struct Onward {
    Vec3 d;
    BsdfSample sample;
    Spec f, beta;                            // value of the scattering function; throughput
    Float pdf, rcp, eta2, roulette;          // density; 1 / (density x survival)
    Int depth;
    Mask m, passed;                          // lanes that go on; that went through a surface undeviated
} Onward;

// Roulette from rr_depth on.
KFN void play_roulette(const Tracer *t, const SampleKey *key, int32_t bounce, Onward *w) {
    const SceneView *scene = t->scene;
    if (bounce + 1 < scene->rr_depth) {
        return;
    }
    Float q = f_min(w->roulette * w->eta2, f_set(0.95f));
    if (scene->through) {
        q = f_select(mi_lt(i_set(scene->rr_depth), w->depth), q, f_set(1));
    }
    w->m = w->m & m_lt(rng_1d(key, dimension(bounce, PURPOSE_ROULETTE)), q);
    Float survival = f_safe_rcp(q);
    w->beta = spec_scale(w->beta, survival);
    w->roulette = w->roulette * survival;
    w->rcp = w->rcp * survival;
}

KFN void append_paths(Tracer *t, const Vertex *v, const Interaction *si, const Onward *w, int32_t at) {
    const Paths *p = &t->ws.paths[t->current];
    Paths *next = &t->ws.paths[1 - t->current];
    // Lights are weighed as seen from the last vertex that turned the path.
    Vec3 origin = si->p;
    Float density = f_select(mi_eq(w->sample.lobe, i_set(LOBE_SMOOTH)), w->pdf, f_set(PDF_DELTA));
    if (t->scene->hide_emitters && !t->scene->solid) {
        Mask absent = mi_eq(w->sample.lobe & 3, i_set(LOBE_NULL)) & m_le(v->pdf, f_set(PDF_VIEWED));
        density = f_select(absent, f_set(PDF_VIEWED), density);
    }
    if (t->scene->through) {
        origin = v3_select(w->passed, v->origin, si->p);
        density = f_select(w->passed, v->pdf, density);
        i_compress(next->depth + at, w->depth, w->m);
    }
    v3_compress(next->ox + at, next->oy + at, next->oz + at, interaction_offset(si, w->d), w->m);
    v3_compress(next->dx + at, next->dy + at, next->dz + at, w->d, w->m);
    v3_compress(next->px + at, next->py + at, next->pz + at, origin, w->m);
    f_compress(next->tmax + at, f_set(INFINITY), w->m);
    spec_compress(next->beta, at, w->beta, w->m);
    f_compress(next->eta2 + at, w->eta2, w->m);
    f_compress(next->roulette + at, w->roulette, w->m);
    f_compress(next->pdf + at, density, w->m);
    i_compress(next->slot + at, v->slot, w->m);
    i_compress(next->medium + at, i_gather(p->medium, v->at), w->m);
}

KFN void record_onward(Tracer *t, int32_t record, const Onward *w) {
    Records *r = &t->ws.records;
    f_store(r->wox + record, w->d.x);
    f_store(r->woy + record, w->d.y);
    f_store(r->woz + record, w->d.z);
    f_store(r->sw + record, f_zero_unless(w->m, w->rcp));
    spec_store(r->weight, record, spec_zero_unless(w->m, spec_scale(w->f, w->rcp)));
    i_store(r->lobe + record, w->sample.lobe);
}

// Samples how the paths go on and appends the survivors to the next bounce's paths; returns their number.
KFN int32_t scatter_paths(Tracer *t, const Vertex *v, const Interaction *si, const BsdfCall *call, Vec3 wi,
                          const SampleKey *key, int32_t bounce, int32_t record, int32_t next_count) {
    const SceneView *scene = t->scene;
    const Paths *p = &t->ws.paths[t->current];
    SampleKey scatter_key = *key;
    Split split;
    if (scene->split) {
        split = split_of(scene, key->sample);
        scatter_key.sample = split.scatter_sample;
        key = &scatter_key;
    }
    Onward w;
    w.sample = bsdf_sample(call, wi, rng_1d(key, dimension(bounce, PURPOSE_LOBE)),
                           rng_2d(key, dimension(bounce, PURPOSE_DIRECTION)));
    w.f = bsdf_eval_pdf(call, wi, w.sample.wo, w.sample.lobe, &w.pdf);
    w.rcp = f_safe_rcp(w.pdf);
    w.m = v->m;
    if (scene->split) {
        w.rcp = w.rcp * split.scatter_weight;
        w.m = w.m & split.scatter;
    }
    Spec weight = spec_scale(w.f, w.rcp);
    w.beta = spec_mul(v->beta, weight);
    w.eta2 = real_gather(p->eta2, v->at) * w.sample.eta * w.sample.eta;
    w.m = w.m & m_gt(w.pdf, f_set(0)) & m_finite(spec_sum(w.beta));
    w.passed = m_set(scene->through) & mi_eq(w.sample.lobe & 3, i_set(LOBE_NULL));
    w.depth = v->depth + i_select(w.passed, i_set(0), i_set(1));
    if (scene->through && scene->max_depth >= 0) {
        w.m = w.m & mi_lt(w.depth, i_set(scene->max_depth));
    }
    w.roulette = spec_max(w.beta);
    if (t->derivative) {
        // Paths of zero throughput go on: the derivative at the vertex that stopped them needs what lies behind it.
        w.roulette = real_gather(p->roulette, v->at) * f_max(spec_max(weight), f_set(DERIVATIVE_FLOOR));
    } else {
        w.m = w.m & m_gt(w.roulette, f_set(0));
    }
    play_roulette(t, key, bounce, &w);
    w.d = frame_to_world(&si->sh, w.sample.wo);
    append_paths(t, v, si, &w, next_count);
    if (keeps_coverage(t)) {
        Mask passes = mi_eq(w.sample.lobe & 3, i_set(LOBE_NULL));
        cover(t, v->slot, scene->solid ? v->m : v->m & ~passes);
    }
    if (record >= 0) {
        record_onward(t, record, &w);
    }
    return next_count + m_count(w.m);
}

// The parameterisation of the surface, for functions that ask for it. It looks at the surface again, so that nothing of
// this is computed for all the others.
static NOINLINE void find_surface(const SceneView *scene, const Group *group, const Hit *hit, BsdfSurface *surface,
                                  Vec3 *dp_dv) {
    Interaction si = shape_interaction(scene, group->shape_kind, group->shape_flags, hit);
    surface->ux = v3_dot(si.sh.s, si.dp_du);
    surface->vx = v3_dot(si.sh.s, si.dp_dv);
    surface->vy = v3_dot(si.sh.t, si.dp_dv);
    surface->ng = frame_to_local(&si.sh, si.ng);
    *dp_dv = si.dp_dv;
}

// Emission, light sampling and scattering of lanes that share a group.
static int32_t surface_batch(Tracer *t, const Group *group, int32_t group_id, const int32_t *order, int32_t count,
                             int32_t bounce, int32_t next_count) {
    const SceneView *scene = t->scene;
    Vertex v = vertex_load(t, order, count, bounce);
    Interaction si = shape_interaction(scene, group->shape_kind, group->shape_flags, &v.hit);
    Vec3 wi = frame_to_local(&si.sh, v3_neg(v.d));
    Float mis = f_set(0);
    Spec emission = spec_zero();
    if (group->emitter >= 0) {
        const EmitterRecord *e = scene->emitters + group->emitter;
        Mask lit = v.m & m_gt(wi.z, f_set(0));
        mis = f_zero_unless(lit, emission_weight(t, e, &v, &si));
        emission = spec_zero_unless(lit, spec_scale(emitter_eval(scene, e, texcoord(si.uv, &v.hit), f_set(1)), mis));
        if (!t->derivative) {
            slot_add(t, v.slot, spec_mul(v.beta, emission), lit);
        }
        if (keeps_coverage(t)) {
            cover(t, v.slot, lit);
        }
    }
    int32_t record = -1;
    if (t->derivative) {
        record = record_claim(t, VERTEX_SURFACE, group_id, count);
        if (record < 0) {
            return next_count;
        }
        record_vertex(t, record, &v, mis, emission);
        t->ws.batches[t->batch_count - 1].first_vertex = bounce == 0;
    }
    if (scene->max_depth >= 0 && bounce + 1 >= scene->max_depth && !scene->through) {
        if (record >= 0) {
            t->ws.batches[t->batch_count - 1].ends = true;
        }
        return next_count;
    }
    SampleKey key = slot_key(t, v.slot);
    BsdfCall call = {scene, group->bsdf, texcoord(si.uv, &v.hit), t->floor, NULL, NULL};
    BsdfSurface surface;
    Vec3 dp_dv;
    if (scene->bsdfs[group->bsdf].surface) {
        find_surface(scene, group, &v.hit, &surface, &dp_dv);
        call.surface = &surface;
    }
    if (scene->emitters_count > 0) {
        connect_lights(t, &v, &si, &call, wi, &key, bounce, record);
    }
    return scatter_paths(t, &v, &si, &call, wi, &key, bounce, record, next_count);
}

// ---- bounces -----------------------------------------------------------------------------------------------------

// Counting sort of the bounce's rays by group (0 = escaped): fills ws.order, and where each group begins.
static void sort_stage(Tracer *t, int32_t *begin, int32_t groups) {
    const Workspace *ws = &t->ws;
    memset(begin, 0, (size_t)(groups + 1) * sizeof *begin);
    for (int32_t k = 0; k < t->active; k++) {
        begin[ws->hit_group[k] + 1]++;
    }
    for (int32_t g = 0; g < groups; g++) {
        begin[g + 1] += begin[g];
    }
    for (int32_t k = 0; k < t->active; k++) {
        ws->order[begin[ws->hit_group[k]]++] = k;
    }
    memmove(begin + 1, begin, (size_t)groups * sizeof *begin);
    begin[0] = 0;
}

static void shadow_stage(Tracer *t) {
    const Shadows *q = &t->ws.shadows;
    double start = stage_seconds();
    for (int32_t k = 0; k < t->shadow_count; k += LANES) {
        Mask m = m_first_n(t->shadow_count - k);
        Ray ray;
        ray.o = v3(f_load(q->ox + k), f_load(q->oy + k), f_load(q->oz + k));
        ray.d = v3(f_load(q->dx + k), f_load(q->dy + k), f_load(q->dz + k));
        ray.tmax = f_load(q->tmax + k);
        Mask blocked;
        Spec transmittance = t->scene->through ? walk_transmittance(t, ray, m, &blocked, NULL)
                                               : trace_transmittance(t->scene, &ray, m);
        Spec l = spec_mul(spec_load(q->radiance, k), transmittance);
        Mask open = m & m_gt(spec_max(transmittance), f_set(0));
        if (!t->derivative) {
            slot_add(t, i_load(q->slot + k), l, open);
            continue;
        }
        Int record = i_select(m, i_load(q->record + k), i_set(0));
        const Records *r = &t->ws.records;
        spec_scatter_add(r->local, record, l, open);
        // Where the transmittance may change, the sweep finds it again.
        Spec kept = t->scene->through ? spec_set(f_zero_unless(~blocked, f_set(1))) : transmittance;
        spec_scatter(r->light_weight, record, spec_mul(spec_gather(r->light_weight, record), kept), m);
    }
    t->job->rays += t->scene->through ? 0 : t->shadow_count;
    t->job->trace_seconds += stage_seconds() - start;
}

// Keeps what paths of up to rung + 1 segments have brought.
static void rung_store(Tracer *t, int32_t rung) {
    for (int c = 0; c < SPEC_N && rung < t->rung_count; c++) {
        memcpy(t->rungs[rung * SPEC_N + c], t->ws.radiance[c], CHUNK * sizeof(real));
        t->rungs_kept = rung + 1;
    }
}

// Runs the chunk's paths to their ends. begin: scratch of group count + 2 entries.
static void path_forward(Tracer *t, int32_t *begin) {
    const SceneView *scene = t->scene;
    for (int32_t i = 0; keeps_coverage(t) && i < t->active; i++) {
        t->ws.coverage[i] = scene->environment >= 0 && !scene->hide_emitters;
    }
    int32_t groups = (int32_t)scene->groups_count + 1;
    for (int32_t bounce = t->first_bounce; t->active > 0 && !t->overflow && bounce < MAX_BOUNCES; bounce++) {
        if (scene->max_depth >= 0 && bounce >= scene->max_depth && (!scene->through || scene->max_depth == 0)) {
            return;
        }
        trace_stage(t, bounce);
        sort_stage(t, begin, groups);
        t->shadow_count = 0;
        int32_t next_count = 0;
        for (int32_t g = 0; g < groups; g++) {
            for (int32_t k = begin[g]; k < begin[g + 1] && !t->overflow; k += LANES) {
                int32_t count = begin[g + 1] - k < LANES ? begin[g + 1] - k : LANES;
                if (g == 0) {
                    escape_batch(t, t->ws.order + k, count, bounce);
                } else {
                    next_count = surface_batch(t, scene->groups + g - 1, g - 1, t->ws.order + k, count, bounce,
                                               next_count);
                }
            }
        }
        if (t->rungs) {
            rung_store(t, bounce - t->first_bounce);
        }
        shadow_stage(t);
        t->current = 1 - t->current;
        t->active = next_count;
    }
}
