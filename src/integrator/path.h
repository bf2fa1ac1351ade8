// path.h: the path tracer, forward half. A chunk of paths advances bounce by bounce through stages: trace, sort by
// shading group, emission and shading per group, shadow rays. Power-heuristic MIS of scattering and light sampling
// [veach1995]; depth, roulette and hide_emitters as Mitsuba defines them. In derivative modes every vertex is recorded
// for path_adj.h. Sampling, densities, MIS weights and roulette are detached.
#pragma once

#include "integrator/aim.h"
#include "integrator/leg.h"

// ---- surfaces ----------------------------------------------------------------------------------------------------

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
    vertex_spare(t, -1, &v);
    if (t->spares && !m_any(v.wanted)) {
        return;
    }
    Vec2 uv = environment_uv(scene, e, v.d);
    Float mis = f_zero_unless(v.m, scattered_weight(t, &v, environment_pdf(scene, e, v.d, uv) * e->weight));
    Spec l = spec_scale(emitter_eval(scene, e, texcoord(uv, NULL), f_set(1)), mis);
    if (!t->derivative) {
        slot_add(t, v.slot, spec_mul(v.beta, l), v.m);
        return;
    }
    int32_t at = record_claim(t, VERTEX_ESCAPED, -1, count, bounce);
    if (at >= 0) {
        record_vertex(t, at, &v, mis, l);
        t->ws.batches[t->batch_count - 1].first_vertex = bounce == 0;
    }
}

// MIS weight of light that the ray met at an area light, against having sampled that light.
KFN Float emission_weight(const Tracer *t, const EmitterRecord *e, const Vertex *v, const Interaction *si) {
    return scattered_weight(t, v, surface_light_pdf(t->scene, e, v->origin, v->d, si) * e->weight);
}

// The density with which pictures draw directions: where paths are dropped, pictures depend on the weights of MIS (kept.h),
// and derivatives weigh as pictures do. pdf: the density of the call.
KFN Float picture_pdf(const BsdfCall *call, Vec3 wi, Vec3 wo, Int lobe, Float pdf) {
    BsdfCall picture = bsdf_picture(call);
    return call->scene->drops && call->floor > 0 ? bsdf_pdf(&picture, wi, wo, lobe) : pdf;
}

// What directions from surfaces of a group aim at. Of functions with smooth lobes alone, which choose nothing but a direction.
KFN Aim surface_aim(const Tracer *t, const Group *group) {
    Aim aim = aim_of(t);
    bool aims = t->scene->bsdfs[group->bsdf].aims && !t->scene->drops && !t->focus;
    aim.count = aims ? aim.count : 0;
    return aim;
}

// Light sampling at a batch of surface vertices: appends shadow rays with what they will bring.
KFN void connect_lights(Tracer *t, const Group *group, const Vertex *v, const Interaction *si, const BsdfCall *call,
                        Vec3 wi, const SampleKey *key, int32_t bounce, int32_t record) {
    const SceneView *scene = t->scene;
    Float choice;
    SampleKey light_key = *key;
    Split split;
    if (scene->split) {
        split = split_of(scene, key->sample);
        light_key.sample = split.light_sample;
        key = &light_key;
    }
    Int light = light_choose(scene, key, bounce, &choice);
    Spec radiance;
    LightSample s = lights_sample(scene, light, v->m, si->p, rng_2d(key, dimension(bounce, PURPOSE_LIGHT)), &radiance);
    Vec3 wo = frame_to_local(&si->sh, s.d);
    Int smooth = i_set(LOBE_SMOOTH);
    Float scatter_pdf;
    Spec f = bsdf_eval_pdf(call, wi, wo, smooth, &scatter_pdf);
    const Aim aim = surface_aim(t, group);
    scatter_pdf = aim_density(&aim, si->p, s.d, scatter_pdf);
    Float pdf = s.pdf * choice;
    Float other_pdf = picture_pdf(call, wi, wo, smooth, scatter_pdf), own_pdf = pdf;
    Mask drawn = v->wanted;
    if (scene->split) {
        own_pdf = pdf * split.light_pdf;
        other_pdf = scatter_pdf * split.scatter_pdf;
        pdf = pdf * f_safe_rcp(split.light_weight);
        drawn = drawn & split.light;
    }
    if (scene->through) {
        drawn = drawn & depth_allows(scene, v->depth + 2);
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
    append_shadows(t, &ray, light, l, v->slot, record, medium_behind(group, si->ng, s.d, v->medium), m);
    if (record >= 0 && v->live) {
        Spec brings = spec_zero_unless(m, t->spares ? spec_scale(radiance, weight) : spec_set(weight));
        record_light(t, record, light, &s, v->local ? wo : s.d, brings, f);
        if (scene->drops) {
            f_store(t->ws.records.light_pdf + record, f_zero_unless(~light_is_delta(scene, light), own_pdf));
        }
    }
}

// Samples a direction, its value and density; a share of them aims.
KFN void surface_sample(const Tracer *t, const Group *group, const Vertex *v, const Interaction *si, const BsdfCall *call, Vec3 wi,
                        const SampleKey *key, int32_t bounce, Onward *w) {
    const Aim aim = surface_aim(t, group);
    w->sample = bsdf_sample(call, wi, rng_1d(key, dimension(bounce, PURPOSE_LOBE)),
                            rng_2d(key, dimension(bounce, PURPOSE_DIRECTION)));
    if (aim.count > 0) {
        Vec3 d = frame_to_world(&si->sh, w->sample.wo);
        Mask aimed = aim_take(&aim, si->p, key, bounce, v->m, &d);
        w->sample.wo = v3_select(aimed, frame_to_local(&si->sh, d), w->sample.wo);
        w->sample.lobe = i_select(aimed, i_set(LOBE_SMOOTH), w->sample.lobe);
    }
    w->f = bsdf_eval_pdf(call, wi, w->sample.wo, w->sample.lobe, &w->pdf);
    if (aim.count > 0) {
        w->pdf = aim_density(&aim, si->p, frame_to_world(&si->sh, w->sample.wo), w->pdf);
    }
}

// Samples how the paths go on and appends the survivors to the next bounce's paths; returns their number.
KFN int32_t scatter_paths(Tracer *t, const Group *group, const Vertex *v, const Interaction *si, const BsdfCall *call,
                          Vec3 wi, const SampleKey *key, int32_t bounce, int32_t record, int32_t next_count) {
    const SceneView *scene = t->scene;
    const Paths *p = &t->ws.paths[t->current];
    SampleKey scatter_key = *key;
    Split split;
    BsdfCall rims;
    bool only_rims = t->derivative && scene->split && scene->scatter_samples == 0; // which light samples never find
    if (only_rims) {
        rims = *call;
        rims.rim = RIM_ALWAYS;
        call = &rims;
    } else if (scene->split) {
        split = split_of(scene, key->sample);
        scatter_key.sample = split.scatter_sample;
        key = &scatter_key;
    }
    const bool veil = group_is_veil(t, group);
    Onward w = {.begins = i_set(BEGINS_AT_SURFACE), .same = !veil};
    surface_sample(t, group, v, si, call, wi, key, bounce, &w);
    w.rcp = f_safe_rcp(w.pdf);
    w.m = v->m;
    if (only_rims) {
        w.m = w.m & lobe_is(w.sample.lobe, LOBE_RIM);
    } else if (scene->split) {
        w.rcp = w.rcp * split.scatter_weight;
        w.m = w.m & split.scatter;
    }
    w.eta2 = real_gather(p->eta2, v->at) * w.sample.eta * w.sample.eta;
    w.passed = m_set(scene->through) & lobe_is(w.sample.lobe, LOBE_NULL);
    w.depth = v->depth + i_select(w.passed, i_set(0), i_set(1));
    if (scene->through) {
        w.m = w.m & depth_allows(scene, w.depth + 1);
    }
    w.begins = i_select(w.passed, veil ? i_set(BEGINS_AT_VEIL) : v->begins, w.begins);
    onward_weigh(t, v, &w);
    play_roulette(t, key, bounce, &w);
    w.pdf = picture_pdf(call, wi, w.sample.wo, w.sample.lobe, w.pdf);
    w.d = frame_to_world(&si->sh, w.sample.wo);
    Vec3 o = interaction_offset(si, w.d);
    Int medium = medium_behind(group, si->ng, w.d, v->medium);
    if (scene->has_media && m_any(w.m & w.passed)) {
        Int through = v->medium;
        o = v3_select(w.passed, pass_on(t, group, si, &v->hit, w.d, w.m & w.passed, &through), o);
        medium = i_select(w.passed, through, medium);
    }
    append_paths(t, v, si->p, o, &w, medium, next_count);
    if (keeps_coverage(t)) {
        Mask passes = lobe_is(w.sample.lobe, LOBE_NULL);
        cover(t, v->slot, scene->solid ? v->m : v->m & ~passes);
    }
    if (record >= 0) {
        record_onward(t, record, v->live, v->local ? w.sample.wo : w.d, &w);
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

// The latest batch of vertices, with texture coordinates uv and seen along wi.
KFN void record_surface(Tracer *t, int32_t record, const Vertex *v, Vec2 uv, Vec3 wi, Float mis, Spec emission) {
    RecordBatch *batch = t->ws.batches + t->batch_count - 1;
    Vertex seen = *v;
    batch->first_vertex = batch->bounce == 0;
    batch->local = v->local;
    if (v->local) {
        seen.d = v3_neg(wi);
        seen.hit.u = uv.x;
        seen.hit.v = uv.y;
    }
    record_vertex(t, record, &seen, mis, emission);
}

// Emission, light sampling and scattering of lanes that share a group.
static int32_t surface_batch(Tracer *t, const Group *group, int32_t group_id, const int32_t *order, int32_t count,
                             int32_t bounce, int32_t next_count) {
    const SceneView *scene = t->scene;
    Vertex v = vertex_load(t, order, count, bounce);
    Interaction si = shape_interaction(scene, group->shape_kind, group->shape_flags, &v.hit);
    if (t->nudge[0] && bounce == t->first_bounce) {
        si.uv.x = si.uv.x + real_gather(t->nudge[0], v.slot);
        si.uv.y = si.uv.y + real_gather(t->nudge[1], v.slot);
    }
    vertex_spare(t, group_id, &v);
    if (scene->has_media && t->derivative) {
        borders_watch(t, group, si.ng, v.d, v.medium, v.m);
    }
    const bool wanted = m_any(v.wanted);
    Vec3 wi = frame_to_local(&si.sh, v3_neg(v.d));
    Float mis = f_set(0);
    Spec emission = spec_zero();
    if (group->emitter >= 0 && wanted) {
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
    if (t->derivative && wanted) {
        record = record_claim(t, VERTEX_SURFACE, group_id, count, bounce);
        if (record < 0) {
            return next_count;
        }
        v.local = t->local && !scene->bsdfs[group->bsdf].surface;
        record_surface(t, record, &v, si.uv, wi, mis, emission);
    }
    if (scene->max_depth >= 0 && bounce + 1 >= scene->max_depth && !scene->through) {
        if (record >= 0) {
            t->ws.batches[t->batch_count - 1].ends = true;
        }
        return next_count;
    }
    SampleKey key = slot_key(t, v.slot);
    BsdfCall call = bsdf_call(scene, group->bsdf, texcoord(si.uv, &v.hit), t->floor);
    call.rim = t->floor;
    BsdfSurface surface;
    Vec3 dp_dv;
    if (scene->bsdfs[group->bsdf].surface) {
        find_surface(scene, group, &v.hit, &surface, &dp_dv);
        call.surface = &surface;
    }
    if (wanted && scene->emitters_count > 0 && scene->bsdfs[group->bsdf].spreads) {
        connect_lights(t, group, &v, &si, &call, wi, &key, bounce, record);
    }
    return scatter_paths(t, group, &v, &si, &call, wi, &key, bounce, record, next_count);
}

// ---- bounces -----------------------------------------------------------------------------------------------------

// Sorts the bounce's rays by group (0 = escaped): fills ws.order, and where each group begins.
static void sort_stage(Tracer *t, int32_t *begin, int32_t groups) {
    counting_sort(t->ws.hit_group, 0, t->active, groups, t->ws.order, begin);
}

static void shadow_stage(Tracer *t, int32_t bounce) {
    const Shadows *q = &t->ws.shadows;
    const bool media = t->scene->has_media;
    double start = stage_seconds();
    for (int32_t k = 0; k < t->shadow_count; k += LANES) {
        Mask m = m_first_n(t->shadow_count - k);
        Ray ray;
        ray.o = v3(f_load(q->ox + k), f_load(q->oy + k), f_load(q->oz + k));
        ray.d = v3(f_load(q->dx + k), f_load(q->dy + k), f_load(q->dz + k));
        ray.tmax = f_load(q->tmax + k);
        Mask blocked, end = t->job->veils ? veils_end(t, i_select(m, i_load(q->light + k), i_set(0))) : m_set(false);
        Fog fog = {.past_lights = false};
        if (media) {
            fog.medium = i_select(m, i_load(q->medium + k), i_set(-1));
            fog.key = stream_key(t, i_select(m, i_load(q->slot + k), i_set(0)), bounce, STREAM_SHADOW);
        }
        Spec transmittance = t->scene->through ? walk_transmittance(t, ray, end, m, media ? &fog : NULL, &blocked, NULL)
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

// Where vertices that let paths pass are no segments' ends: keeps what the paths have brought since the last call, with `more`
// segments than led to their vertices.
static void rungs_add(Tracer *t, int32_t more) {
    const Paths *p = &t->ws.paths[t->current];
    t->rungs_kept = t->rung_count;
    for (int32_t k = 0; k < t->active; k++) {
        const int32_t slot = p->slot[k];
        for (int c = 0; c < SPEC_N; c++) {
            const real more_light = t->ws.radiance[c][slot] - t->brought[c][slot];
            t->brought[c][slot] = t->ws.radiance[c][slot];
            for (int32_t r = p->depth[k] + more; r < t->rung_count && more_light != 0; r++) {
                t->rungs[r * SPEC_N + c][slot] += more_light;
            }
        }
    }
}

// Keeps what paths of up to rung + 1 segments have brought.
static void rungs_keep(Tracer *t, int32_t rung) {
    for (int c = 0; c < SPEC_N && rung == 0; c++) {
        memcpy(t->sent[c], t->ws.radiance[c], CHUNK * sizeof(real));
    }
    if (t->job->veils) {
        rungs_add(t, 0);
        return;
    }
    for (int c = 0; c < SPEC_N && rung < t->rung_count; c++) {
        memcpy(t->rungs[rung * SPEC_N + c], t->ws.radiance[c], CHUNK * sizeof(real));
        t->rungs_kept = rung + 1;
    }
}

// After their first vertices: what the paths have brought, and which of the `count` that go on are chains.
static void fork_store(Tracer *t, int32_t count) {
    const Paths *next = &t->ws.paths[1 - t->current];
    for (int c = 0; c < SPEC_N; c++) {
        memcpy(t->fork->first[c], t->ws.radiance[c], CHUNK * sizeof(real));
    }
    for (int32_t k = 0; k < count; k += LANES) {
        Mask m = m_first_n(count - k);
        i_scatter(t->fork->way, i_select(m, i_load(next->slot + k), i_set(0)), i_set(FORK_CHAIN),
                  m & m_eq(f_load(next->pdf + k), f_set(PDF_DELTA)));
    }
}

// In media, before that: which paths collide first. All that they bring is theirs; others have brought what media sent out on
// their way.
static void fork_air(Tracer *t) {
    const Paths *p = &t->ws.paths[t->current];
    for (int c = 0; c < SPEC_N; c++) {
        memcpy(t->fork->air[c], t->ws.radiance[c], CHUNK * sizeof(real));
    }
    for (int32_t k = 0; k < t->active; k += LANES) {
        Mask m = m_first_n(t->active - k);
        i_scatter(t->fork->way, i_select(m, i_load(p->slot + k), i_set(0)), i_set(FORK_AIR),
                  m & mi_lt(i_set((int32_t)t->scene->groups_count), i_load(t->ws.hit_group + k)));
    }
}

// Whether paths pass surfaces of the kind null without a stage of their own. Those behind which lights hide from the sensor, and
// those that a picture's alpha shows, are looked at one by one.
static bool path_takes_legs(const Tracer *t) {
    const SceneView *scene = t->scene;
    const bool alone = t->derivative || t->fork || t->on_lines;
    return scene->has_media && scene->open_apart && !alone && !scene->hide_emitters && !scene->solid;
}

// Of those as many as a packet's lanes usually meet in a row.
enum { PASSED_AT_ONCE = 2 };

// Runs the chunk's paths to their ends. begin: scratch of the number of groups and media, and 2 entries.
static void path_forward(Tracer *t, int32_t *begin) {
    const SceneView *scene = t->scene;
    for (int32_t i = 0; keeps_coverage(t) && i < t->active; i++) {
        t->ws.coverage[i] = scene->environment >= 0 && !scene->hide_emitters && !scene->solid && scene->max_depth != 0;
    }
    const int32_t surfaces = (int32_t)scene->groups_count + 1;
    const int32_t groups = surfaces + (scene->has_media ? (int32_t)scene->media_count : 0);
    for (int32_t bounce = t->first_bounce; t->active > 0 && !t->overflow && bounce < MAX_BOUNCES; bounce++) {
        if (scene->max_depth >= 0 && bounce >= scene->max_depth && (!scene->through || scene->max_depth == 0)) {
            return;
        }
        const bool counts = scene->has_media && t->rungs; // the number of vertices
        const bool there = t->placed && bounce == t->first_bounce; // those that count have flown there, too
        const bool legs = !there && (counts || path_takes_legs(t));
        if (legs) {
            const int32_t most = counts ? MOST_SURFACES_IN_A_ROW : PASSED_AT_ONCE;
            legs_stage(t, (LegDef){.most = most, .emission = true, .coherent = bounce == 0}, bounce);
        } else if (!there) {
            trace_stage(t, bounce);
        }
        if (scene->has_media) {
            if (!legs && !counts) {
                flight_stage(t, begin, bounce);
            }
            if (t->fork && bounce == t->first_bounce) {
                fork_air(t);
            }
        }
        sort_stage(t, begin, groups);
        t->shadow_count = 0;
        int32_t next_count = 0;
        for (int32_t g = 0; g < groups; g++) {
            for (int32_t k = begin[g]; k < begin[g + 1] && !t->overflow; k += LANES) {
                int32_t count = begin[g + 1] - k < LANES ? begin[g + 1] - k : LANES;
                if (g == 0) {
                    escape_batch(t, t->ws.order + k, count, bounce);
                } else if (g >= surfaces) {
                    next_count = collision_batch(t, g - surfaces, t->ws.order + k, count, bounce, next_count);
                } else {
                    next_count = surface_batch(t, scene->groups + g - 1, g - 1, t->ws.order + k, count, bounce,
                                               next_count);
                }
            }
        }
        if (t->rungs) {
            rungs_keep(t, bounce - t->first_bounce);
        }
        shadow_stage(t, bounce);
        if (t->rungs && t->job->veils) {
            rungs_add(t, 1);
        }
        if (t->fork && bounce == t->first_bounce) {
            fork_store(t, next_count);
        }
        t->current = 1 - t->current;
        t->active = next_count;
    }
}
