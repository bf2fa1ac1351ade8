// vertex.h: what vertices of all kinds have in common: loading and recording them, weighing light against having sampled it
// otherwise, shadow rays, roulette, and the paths that go on.
#pragma once

#include "emitter/choice.h"
#include "integrator/split.h"
#include "integrator/walk.h"

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
    Int medium;      // that the ray came through
    Int begins;      // what the ray begins at
    Mask wanted;     // lanes of which what they bring is asked for
    bool live;       // and their derivatives are
    bool local;      // see RecordBatch
} Vertex;

// Entries of per-path arrays. near (uniform): they lie close to each other, from `first` on.
typedef struct Entries {
    Int at;
    int32_t first;
    bool near;
} Entries;

KFN Float entries_f(const real *base, Entries e) { return e.near ? f_near(base, e.first, e.at) : real_gather(base, e.at); }
KFN Int entries_i(const int32_t *base, Entries e) { return e.near ? i_near(base, e.first, e.at) : i_gather(base, e.at); }
KFN Vec3 entries_v3(const real *x, const real *y, const real *z, Entries e) {
    return v3(entries_f(x, e), entries_f(y, e), entries_f(z, e));
}

KFN Vertex vertex_load(const Tracer *t, const int32_t *order, int32_t count, int32_t bounce) {
    const Workspace *ws = &t->ws;
    const Paths *p = &ws->paths[t->current];
    Vertex v;
    v.m = m_first_n(count);
    v.at = i_select(v.m, i_load(order), i_set(order[0]));
    // Sorting keeps the order within groups, so that those of many paths are read nearly in a row.
    Mask near = mi_lt(v.at, i_set(order[0] + NEAR_LANES)) & mi_lt(i_set(order[0] - 1), v.at);
    const Entries e = {v.at, order[0], m_all(near)};
    v.slot = entries_i(p->slot, e);
    v.hit.shape = i_max(entries_i(ws->hit_shape, e), i_set(0));
    v.hit.prim = entries_i(ws->hit_prim, e);
    v.hit.instance = t->scene->instances_count ? entries_i(ws->hit_instance, e) : i_set(0);
    v.hit.u = entries_f(ws->hit_u, e);
    v.hit.v = entries_f(ws->hit_v, e);
    v.hit.p = entries_v3(ws->hit_x, ws->hit_y, ws->hit_z, e);
    v.d = entries_v3(p->dx, p->dy, p->dz, e);
    v.origin = entries_v3(p->px, p->py, p->pz, e);
    for (int c = 0; c < SPEC_N; c++) {
        v.beta.c[c] = entries_f(p->beta[c], e);
    }
    v.pdf = entries_f(p->pdf, e);
    v.depth = t->scene->through ? entries_i(p->depth, e) : i_set(bounce);
    v.medium = t->scene->has_media ? entries_i(p->medium, e) : i_set(-1);
    v.begins = t->scene->has_media ? entries_i(p->begins, e) : i_set(BEGINS_AT_SURFACE);
    v.wanted = v.m;
    v.live = true;
    v.local = false;
    return v;
}

// Where nothing but scattering is selected, a derivative asks for what leaves a vertex only if the path has met the selection, at
// this vertex or before: what else the path brings has no part in it. group: of surfaces, -1 = beyond them.
KFN void vertex_spare(Tracer *t, int32_t group, Vertex *v) {
    if (!t->spares) {
        return;
    }
    v->live = group >= 0 && (t->job->live[group] & LIVE_SCATTERING);
    if (v->live) {
        f_scatter(t->ws.reached, v->slot, f_set(1), v->m);
    } else {
        v->wanted = v->m & m_gt(real_gather(t->ws.reached, v->slot), f_set(0));
    }
}

// Adds radiance to the slots' sums. Slots are distinct within a batch.
KFN void slot_add(Tracer *t, Int slot, Spec l, Mask m) { spec_scatter_add(t->ws.radiance, slot, l, m); }

// Chooses a light per lane, with a random number of its own where there is a choice.
KFN Int light_choose(const SceneView *scene, const SampleKey *key, int32_t bounce, Float *probability) {
    Float u = scene->emitters_count > 1 ? rng_1d(key, dimension(bounce, PURPOSE_LIGHT_CHOICE)) : f_set(0);
    return emitter_choose(scene, u, probability);
}

// Lanes in which paths may have so many segments.
KFN Mask depth_allows(const SceneView *scene, Int segments) {
    return m_set(scene->max_depth < 0) | mi_lt(segments, i_set(scene->max_depth + 1));
}

// Claims LANES record entries for a batch; -1 when there is no room.
KFN int32_t record_claim(Tracer *t, int32_t tag, int32_t group, int32_t count, int32_t bounce) {
    if (t->record_count + LANES > t->ws.record_capacity || t->batch_count == t->ws.batch_capacity) {
        t->overflow = true;
        return -1;
    }
    int32_t first = t->record_count;
    t->ws.batches[t->batch_count++] = (RecordBatch){.tag = tag, .group = group, .first = first, .count = count, .bounce = bounce};
    t->record_count += LANES;
    return first;
}

// Whether what a ray meets slides along it, by the density of its direction, what it begins at and its depth.
KFN Int record_slides(const Tracer *t, Float pdf, Int begins, Int depth) {
    Int slides = i_select(m_lt(pdf, f_set(0)) | mi_lt(i_set(BEGINS_AT_SURFACE), begins), i_set(SLIDES_ALONG), i_set(SLIDES_NOT));
    Mask seen = m_set(t->scene->has_media) & mi_eq(depth, i_set(0)) & ~mi_eq(begins, i_set(BEGINS_AT_VEIL));
    return i_select(seen, i_set(SLIDES_SEEN), slides);
}

KFN void record_vertex(Tracer *t, int32_t at, const Vertex *v, Float mis, Spec emission) {
    Records *r = &t->ws.records;
    i_store(r->slot + at, v->slot);
    spec_store(r->light_weight, at, spec_zero());
    spec_store(r->local, at, emission);
    spec_store(r->weight, at, spec_zero());
    if (!v->live) {
        return;
    }
    f_store(r->u + at, v->hit.u);
    f_store(r->v + at, v->hit.v);
    f_store(r->dx + at, v->d.x);
    f_store(r->dy + at, v->d.y);
    f_store(r->dz + at, v->d.z);
    f_store(r->mis + at, mis);
    spec_store(r->beta, at, v->beta);
    f_store(r->sw + at, f_set(0));
    if (v->local) {
        return;
    }
    i_store(r->shape + at, v->hit.shape);
    i_store(r->prim + at, v->hit.prim);
    i_store(r->instance + at, v->hit.instance);
    i_store(r->medium + at, v->medium);
    i_store(r->depth + at, v->depth);
    i_store(r->slides + at, record_slides(t, v->pdf, v->begins, v->depth));
    f_store(r->px + at, v->hit.p.x);
    f_store(r->py + at, v->hit.p.y);
    f_store(r->pz + at, v->hit.p.z);
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
KFN bool keeps_coverage(const Tracer *t) { return t->job->coverage || t->scene->drops; }

KFN void cover(Tracer *t, Int slot, Mask m) { f_scatter(t->ws.coverage, slot, f_set(1), m); }

// The ray to a light: it starts off the surface and aims at the same point, or it would pass or meet the light itself.
KFN void shadow_ray(const Interaction *si, Vec3 d, Float distance, Ray *ray) {
    ray->o = interaction_offset(si, d);
    Vec3 to_light = v3_sub(v3_madd(si->p, distance, d), ray->o);
    Float length = f_sqrt(v3_dot(to_light, to_light));
    ray->d = v3_scale(to_light, f_safe_rcp(length));
    ray->tmax = length * (1.0f - SHADOW_SHORT);
}

// Appends the shadow rays of m to lights: what they bring, to whom, and the media that they start in.
KFN void append_shadows(Tracer *t, const Ray *ray, Int light, Spec l, Int slot, int32_t record, Int medium, Mask m) {
    if (t->derivative && t->shadows_later) {
        return;
    }
    Shadows *q = &t->ws.shadows;
    int32_t at = t->shadow_count;
    v3_compress(q->ox + at, q->oy + at, q->oz + at, ray->o, m);
    v3_compress(q->dx + at, q->dy + at, q->dz + at, ray->d, m);
    f_compress(q->tmax + at, ray->tmax, m);
    spec_compress(q->radiance, at, l, m);
    i_compress(q->slot + at, slot, m);
    i_compress(q->record + at, i_iota() + record, m);
    if (t->scene->has_media) {
        i_compress(q->medium + at, medium, m);
    }
    if (t->job->veils) {
        i_compress(q->light + at, light, m);
    }
    t->shadow_count += m_count(m);
}

// The light sample of a vertex, along d; its weight is multiplied by the transmittance once that is known. Where lights stand
// (Tracer.spares), it is multiplied by what arrives as well, and nothing else is asked for.
KFN void record_light(Tracer *t, int32_t record, Int light, const LightSample *s, Vec3 d, Spec weight, Spec f) {
    Records *r = &t->ws.records;
    f_store(r->ldx + record, d.x);
    f_store(r->ldy + record, d.y);
    f_store(r->ldz + record, d.z);
    spec_store(r->light_weight, record, weight);
    if (t->spares) {
        return;
    }
    i_store(r->light + record, light);
    i_store(r->lprim + record, s->prim);
    f_store(r->lu + record, s->uv.x);
    f_store(r->lv + record, s->uv.y);
    f_store(r->ldist + record, s->distance);
    spec_store(r->light_f, record, f);
}

// How a batch of paths goes on from its vertices.
typedef struct Onward {
    Vec3 d;
    BsdfSample sample;
    Spec f, beta;                            // value of the scattering function; throughput
    Float pdf, rcp, eta2, roulette;          // density; 1 / (density x survival)
    Int depth;
    Mask m, passed;                          // lanes that go on; that went through a surface undeviated
    Int begins;                              // where the paths go on
    bool same;                               // rays that passed are still those that came
} Onward;

// Throughput and roulette of sampled directions, by value, density and 1 / density.
KFN void onward_weigh(const Tracer *t, const Vertex *v, Onward *w) {
    Spec weight = spec_scale(w->f, w->rcp);
    w->beta = spec_mul(v->beta, weight);
    w->m = w->m & m_gt(w->pdf, f_set(0)) & m_finite(spec_sum(w->beta));
    w->roulette = spec_max(w->beta);
    if (t->derivative) {
        // Paths of zero throughput go on: the derivative at the vertex that stopped them needs what lies behind it.
        Float before = real_gather(t->ws.paths[t->current].roulette, v->at);
        Float worth = f_select(lobe_is(w->sample.lobe, LOBE_RIM), f_set(1), spec_max(weight));
        w->roulette = before * f_max(worth, f_set(DERIVATIVE_FLOOR));
        w->m = v->live ? w->m : w->m & m_gt(spec_max(weight), f_set(0));
    } else {
        w->m = w->m & m_gt(w->roulette, f_set(0));
    }
}

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

// The paths of w->m go on from p, off which o lies, in their media.
KFN void append_paths(Tracer *t, const Vertex *v, Vec3 p, Vec3 o, const Onward *w, Int medium, int32_t at) {
    Paths *next = &t->ws.paths[1 - t->current];
    // Lights are weighed as seen from the last vertex that turned the path.
    Vec3 origin = p;
    Float density = f_select(mi_eq(w->sample.lobe, i_set(LOBE_SMOOTH)), w->pdf, f_set(PDF_DELTA));
    if (t->scene->hide_emitters && !t->scene->solid) {
        Mask absent = lobe_is(w->sample.lobe, LOBE_NULL) & m_le(v->pdf, f_set(PDF_VIEWED));
        density = f_select(absent, f_set(PDF_VIEWED), density);
    }
    if (t->scene->through) {
        Mask same = w->passed & m_set(w->same);
        origin = v3_select(same, v->origin, p);
        density = f_select(same, v->pdf, density);
        i_compress(next->depth + at, w->depth, w->m);
    }
    v3_compress(next->ox + at, next->oy + at, next->oz + at, o, w->m);
    v3_compress(next->dx + at, next->dy + at, next->dz + at, w->d, w->m);
    v3_compress(next->px + at, next->py + at, next->pz + at, origin, w->m);
    f_compress(next->tmax + at, f_set(INFINITY), w->m);
    spec_compress(next->beta, at, w->beta, w->m);
    f_compress(next->eta2 + at, w->eta2, w->m);
    f_compress(next->roulette + at, w->roulette, w->m);
    f_compress(next->pdf + at, density, w->m);
    i_compress(next->slot + at, v->slot, w->m);
    if (t->scene->has_media) {
        i_compress(next->medium + at, medium, w->m);
        i_compress(next->begins + at, w->begins, w->m);
        f_compress(next->skip + at, v3_dot(v3_sub(o, p), w->d), w->m);
    }
}

// d: where they go.
KFN void record_onward(Tracer *t, int32_t record, bool live, Vec3 d, const Onward *w) {
    Records *r = &t->ws.records;
    spec_store(r->weight, record, spec_zero_unless(w->m, spec_scale(w->f, w->rcp)));
    if (!live) {
        return;
    }
    f_store(r->wox + record, d.x);
    f_store(r->woy + record, d.y);
    f_store(r->woz + record, d.z);
    f_store(r->sw + record, f_zero_unless(w->m, w->rcp));
    i_store(r->lobe + record, w->sample.lobe);
}
