// kept.h: the derivative of what `path` drops with hidden emitters (SceneView.drops). What a path meets before a surface
// has scattered it or it has met a light counts only if that happens at all. With P_k the probability that the surface at
// vertex k lets the path pass, as pictures choose, what is met at vertex k while nothing is decided counts with
//     D_k = (P_k / q_k) D_(k+1)  where the path passed,  (1 - P_k) / (1 - q_k)  where it did not,
// of which the densities q_k of the derivative, roulette included, keep the expectation. D is multiplied into what is
// recorded of such vertices, so that the sweep finds what counts. The sweep adds two derivatives. That of P_k itself: of
// the sum met up to vertex k, times dD_k / dP_k. And that of the weights of MIS: as far as light that was sampled at
// vertex k is dropped and light that scattered rays meet is not, the picture is
//     f Le (D_k w + 1 - w),  w = a^2 / (a^2 + s^2),
// a the density of the light sample, which the texels of an environment decide, s that of scattering.
// NOT differentiated: P of thin glass and roulette by its colours.
#pragma once

#include "integrator/path_move.h"

// Survival of roulette in the picture, of paths with throughput beta.
KFN Float picture_survival(const SceneView *scene, Spec beta, int32_t bounce) {
    Float most = spec_max(beta);
    Float q = bounce + 1 < scene->rr_depth ? f_set(1) : f_min(most, f_set(0.95f));
    return f_zero_unless(m_gt(most, f_set(0)), q);
}

// How the paths of a batch that are undecided go on: fills keep with P / q or (1 - P) / (1 - q), and slope with its
// derivative by P. Returns the lanes that passed. *throughput: what the picture's is, before the vertex and behind it.
KFN Mask kept_choice(const Tracer *t, const SceneView *moved, const RecordBatch *batch, Int slot, Spec *throughput,
                     Float *keep, Float *slope) {
    SurfaceSweep s;
    surface_load(t, batch, slot, spec_zero(), &s);
    surface_parameterise(t, &s);
    const Vec3 on = v3_neg(s.wi);
    const Int null = i_set(LOBE_NULL);
    Float density = bsdf_pdf(&s.call, s.wi, on, null), p;
    s.call.scene = moved;
    s.call.floor = 0;
    Spec f = bsdf_eval_pdf(&s.call, s.wi, on, null, &p);
    Mask passed = mi_eq(i_load(t->ws.records.lobe + batch->first) & 3, null);
    Spec tint = spec_scale(f, f_safe_rcp(p));
    for (int c = 0; c < SPEC_N; c++) {
        // Where pictures never pass, as a path passes that hardly ever does.
        tint.c[c] = f_select(m_gt(p, f_set(0)), tint.c[c], f_set(1));
    }
    Spec onward = spec_mul(*throughput, tint);
    Float survival = picture_survival(t->scene, onward, batch->bounce);
    *throughput = spec_scale(onward, f_safe_rcp(survival));
    *slope = f_select(passed, s.scatter_weight * survival, -f_safe_rcp(1.0f - density));
    *keep = f_select(passed, p * *slope, (p - 1.0f) * *slope);
    return passed;
}

// From the camera on: what the paths have met while nothing was decided, and how each vertex decides.
static void kept_forward(Tracer *t, const SceneView *moved) {
    const Workspace *ws = &t->ws;
    const Records *r = &ws->records;
    for (int32_t b = 0; b < t->batch_count; b++) {
        const RecordBatch *batch = ws->batches + b;
        if (batch->tag != VERTEX_SURFACE) {
            continue;
        }
        int32_t at = batch->first;
        Mask m = m_first_n(batch->count);
        Int slot = i_select(m, i_load(r->slot + at), i_set(0));
        Mask undecided = m & m_le(f_load(r->mis + at), f_set(0));
        Spec met = spec_mul(spec_load(r->beta, at), spec_load(r->local, at)), throughput = spec_load(r->beta, at);
        if (!batch->first_vertex) {
            undecided = undecided & m_gt(real_gather(ws->undecided, slot), f_set(0));
            met = spec_add(met, spec_gather(ws->met, slot));
            throughput = spec_gather(ws->throughput, slot);
        }
        Float keep = f_set(0), slope = f_set(0);
        Mask passed = m_set(false);
        if (!batch->ends && m_any(undecided)) {
            passed = kept_choice(t, moved, batch, slot, &throughput, &keep, &slope);
        }
        spec_store(r->met, at, met);
        f_store(r->keep + at, f_select(undecided, keep, f_set(1)));
        f_store(r->slope + at, f_zero_unless(undecided, slope));
        f_scatter(ws->undecided, slot, f_zero_unless(undecided & passed, f_set(1)), m);
        spec_scatter(ws->met, slot, spec_scale(met, keep), m);
        spec_scatter(ws->throughput, slot, throughput, m);
    }
}

// Back again: what is met at each vertex counts as far as the path is kept, which is left in keep.
static void kept_backward(Tracer *t, int32_t count) {
    const Workspace *ws = &t->ws;
    const Records *r = &ws->records;
    memset(ws->kept, 0, (size_t)count * sizeof *ws->kept);
    for (int32_t b = t->batch_count - 1; b >= 0; b--) {
        const RecordBatch *batch = ws->batches + b;
        if (batch->tag != VERTEX_SURFACE) {
            continue;
        }
        int32_t at = batch->first;
        Mask m = m_first_n(batch->count);
        Int slot = i_select(m, i_load(r->slot + at), i_set(0));
        Float slope = f_load(r->slope + at);
        // Slopes are positive where a path passed while nothing was decided.
        Float behind = f_select(m_gt(slope, f_set(0)), real_gather(ws->kept, slot), f_set(1));
        Float kept = f_load(r->keep + at) * behind;
        f_scatter(ws->kept, slot, kept, m);
        f_store(r->slope + at, slope * behind);
        f_store(r->keep + at, kept);
        spec_store(r->local, at, spec_scale(spec_load(r->local, at), kept));
    }
}

// Multiplies what is recorded of `count` paths by how far it is kept, by the choices of the scene `moved` along paths of
// this one.
static void kept_stage(Tracer *t, const SceneView *moved, int32_t count) {
    kept_forward(t, moved);
    kept_backward(t, count);
}

// w / a of light samples, by the densities of the sample and of scattering; and its slopes, of w alone: samples stay.
typedef struct KeptWeight {
    Float value, by_light, by_scattering;
} KeptWeight;

KFN KeptWeight kept_weight(Float a, Float s) {
    Float inv = f_safe_rcp(a * a + s * s), k = 2.0f * s * f_sqr(inv);
    return (KeptWeight){a * inv, k * s, -k * a};
}

// Lanes of a batch whose light samples are dropped by another share than what scattered rays meet, and their densities.
KFN Mask kept_lights(const Tracer *t, const SurfaceSweep *s, Float *a) {
    *a = f_load(t->ws.records.light_pdf + s->at);
    return s->connected & m_gt(*a, f_set(0)) & ~m_eq(s->kept, f_set(1));
}

// Adjoint of keeping what the paths of a batch had met so far, for one delta.
KFN void kept_adj(const Tracer *t, const SurfaceSweep *s, const BsdfCall *call, Spec delta, VertexAdj *d, Sink *sink) {
    const Records *r = &t->ws.records;
    Float dp = f_load(r->slope + s->at) * spec_dot(delta, spec_load(r->met, s->at));
    Mask m = s->m & m_finite(dp) & ~m_eq(dp, f_set(0));
    if (m_any(m)) {
        Vec3 dwo = v3_zero();
        // P is the pass-through's coefficient, which is the same in every channel.
        bsdf_adj(call, s->wi, v3_neg(s->wi), i_set(LOBE_NULL), spec_set(f_zero_unless(m, dp) * (1.0f / SPEC_N)), sink, m,
                 &d->wi, &dwo, vertex_uv_adj(s, d, sink));
    }
}

// Adjoint of the weights of MIS of a batch's light samples, for one delta; weight: delta times throughput.
KFN void kept_weights_adj(const Tracer *t, const SurfaceSweep *s, const BsdfCall *call, int32_t live, Spec weight,
                          VertexAdj *d, Sink *sink) {
    Float a;
    Mask lights = kept_lights(t, s, &a);
    if (!m_any(lights)) {
        return;
    }
    // f Le (D - 1) w / a
    Float dw = f_zero_unless(lights, spec_dot(spec_mul(weight, s->f_light), s->light_value) * (s->kept - 1.0f));
    BsdfCall picture = bsdf_picture(call);
    KeptWeight w = kept_weight(a, bsdf_pdf(&picture, s->wi, s->wl, i_set(LOBE_SMOOTH)));
    if (live & LIVE_SCATTERING) {
        Vec3 dwl = v3_zero();
        bsdf_pdf_adj(&picture, s->wi, s->wl, dw * w.by_scattering, sink, lights, &d->wi, &dwl, vertex_uv_adj(s, d, sink));
        // wl = to_local(d), and d stays
        Vec3 stays = v3_zero();
        frame_to_local_adj(&s->si.sh, s->light_d, dwl, &d->frame, &stays);
    }
    if (sink->any_sky) {
        const EmitterRecord *e = t->scene->emitters + t->scene->environment;
        Mask sky = lights & mi_eq(s->light, i_set(t->scene->environment));
        environment_pdf_adj(t->scene, e, s->light_d, s->light_uv, f_zero_unless(sky, dw * w.by_light * e->weight), sink, sky);
    }
}

// The weights of light samples along recorded paths, of which D is that of the scene whose picture is asked for: kept, and
// moved with respect to what scattered rays meet, whose weights are the recording scene's.
KFN Spec kept_replay(const Tracer *t, const SurfaceSweep *s, Spec weight) {
    Float a;
    Mask lights = kept_lights(t, s, &a);
    Float now = a;
    if (t->scene->environment >= 0) {
        const EmitterRecord *e = t->scene->emitters + t->scene->environment, *then = t->deciding->emitters + t->scene->environment;
        Mask sky = lights & mi_eq(s->light, i_set(t->scene->environment));
        Float ratio = environment_pdf(t->scene, e, s->light_d, s->light_uv) *
                      f_safe_rcp(environment_pdf(t->deciding, then, s->light_d, s->light_uv));
        now = f_select(sky, a * ratio, a);
    }
    BsdfCall picture = bsdf_picture(&s->call);
    Float density = bsdf_pdf(&picture, s->wi, s->wl, i_set(LOBE_SMOOTH));
    Float moved = kept_weight(now, density).value * now * f_safe_rcp(a);
    Float tilt = f_zero_unless(lights, (s->kept - 1.0f) * (moved - spec_max(weight)));
    return spec_add(spec_scale(weight, s->kept), spec_set(tilt));
}
