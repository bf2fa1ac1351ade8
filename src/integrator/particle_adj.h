// particle_adj.h: derivatives of light tracing. A particle starts with the throughput beta_0 = Le w; vertex k sends
// C_k = beta_k f_k g_k to a place on the film and goes on with beta_(k+1) = beta_k f'_k w_k. Densities, positions, roulette
// and what is seen are detached. Reverse: the worth of what leaves a vertex, W_k = delta_k f_k g_k + f'_k w_k W_(k+1) with
// the film's adjoint delta where C_k went, is summed from the end, as path_adj.h does with radiance. Forward: contributions
// have places of their own, so that the derivative of beta travels with the particle.
// NOT differentiated: where lights, vertices and the sensor lie; chains of smooth mirrors and glass.
#pragma once

#include "integrator/particle.h"
#include "integrator/path_adj.h"

// The value of a vertex as the path tracer sees it: from the sensor's side towards the light's.
typedef struct Exchange {
    Vec3 view, light, view_d, light_d; // local, and in the world
    Int lobe;
    Mask m;
} Exchange;

// Accumulates the adjoint df of the value into the parameters of the function and into vertex normals.
static void exchange_adj(const Tracer *t, const SurfaceSweep *s, const Exchange *x, Spec df, Sink *sink) {
    BsdfCall call = s->call;
    BsdfSurface dsurface = {f_set(0), f_set(0), f_set(0), v3_zero()};
    Vec3 dview = v3_zero(), dlight = v3_zero(), unused = v3_zero();
    call.dsurface = call.surface && sink->any_normals ? &dsurface : NULL;
    bsdf_adj(&call, x->view, x->light, x->lobe, spec_zero_unless(x->m, df), sink, x->m, &dview, &dlight, NULL);
    if (sink->any_normals && s->group->shape_kind == SHAPE_MESH) {
        Frame dframe = {v3_zero(), v3_zero(), v3_zero()};
        // view = to_local(view_d), light = to_local(light_d)
        frame_to_local_adj(&s->si.sh, x->view_d, dview, &dframe, &unused);
        frame_to_local_adj(&s->si.sh, x->light_d, dlight, &dframe, &unused);
        // ux = s . dp_du, vx = s . dp_dv, vy = t . dp_dv
        if (call.surface) {
            v3_acc(&dframe.s, v3_madd(v3_scale(s->si.dp_du, dsurface.ux), dsurface.vx, s->dp_dv));
            v3_acc(&dframe.t, v3_scale(s->dp_dv, dsurface.vy));
        }
        mesh_interaction_adj(t->scene, s->group->shape_flags, &s->hit, &s->si, &dframe, sink, x->m);
    }
}

// What the sensor sees of the vertex.
KFN Exchange exchange_sight(const SurfaceSweep *s) {
    return (Exchange){s->wl, s->wi, s->light_d, v3_neg(s->d), i_set(LOBE_SMOOTH), s->connected};
}

// What goes on; values of delta lobes are those of the particle's own direction.
KFN Exchange exchange_onward(const SurfaceSweep *s) {
    Mask smooth = mi_eq(s->lobe, i_set(LOBE_SMOOTH));
    Vec3 back = v3_neg(s->d);
    return (Exchange){v3_select(smooth, s->wo, s->wi),   v3_select(smooth, s->wi, s->wo),
                      v3_select(smooth, s->wo_d, back), v3_select(smooth, back, s->wo_d), s->lobe, s->scattered};
}

// The vertices of a batch; s->call points into s.
static void landing_load(const Tracer *t, const RecordBatch *batch, Int slot, Spec suffix, SurfaceSweep *s) {
    surface_load(t, batch, slot, suffix, s);
    surface_parameterise(t, s);
}

// A particle is looked at from the sensor and from where it goes on.
static void watch_landings(const Tracer *t, const SurfaceSweep *s, Sink *sink) {
    const Exchange both[] = {exchange_sight(s), exchange_onward(s)};
    for (int k = 0; k < 2 && (t->job->watch_turned || t->job->watch_smooth); k++) {
        SurfaceSweep seen = *s;
        seen.m = both[k].m & mi_eq(both[k].lobe, i_set(LOBE_SMOOTH));
        seen.wi = both[k].view;
        seen.d = v3_neg(both[k].view_d);
        seen.call.uv.hit = &seen.hit;
        if (m_any(seen.m)) {
            watch_normals(t, &seen, sink);
        }
    }
}

// Starts of a batch.
typedef struct Starts {
    Int slot, light, prim;
    Vec2 uv;
    Float factor;
    Mask m;
} Starts;

KFN Starts starts_load(const Tracer *t, const RecordBatch *batch) {
    const Records *r = &t->ws.records;
    int32_t at = batch->first;
    Starts s = {i_load(r->slot + at), i_load(r->light + at), i_load(r->lprim + at),
                {f_load(r->lu + at), f_load(r->lv + at)}, f_load(r->sw + at), m_set(false)};
    s.m = m_first_n(batch->count) & m_gt(s.factor, f_set(0));
    return s;
}

// What the sensor saw of a batch of vertices.
typedef struct Seen {
    Float x, y;
    Spec weight, f;
    Mask m;
} Seen;

KFN Seen seen_load(const Tracer *t, const RecordBatch *batch) {
    const Records *r = &t->ws.records;
    int32_t at = batch->first;
    Seen s = {f_load(r->lu + at), f_load(r->lv + at), spec_load(r->light_weight, at), spec_load(r->light_f, at),
              m_set(false)};
    s.m = m_first_n(batch->count) & m_gt(s.weight.c[0], f_set(0));
    s.f = spec_zero_unless(s.m, s.f);
    return s;
}

KFN Int batch_slot(const Tracer *t, const RecordBatch *batch) {
    return i_select(m_first_n(batch->count), i_load(t->ws.records.slot + batch->first), i_set(0));
}

// ---- reverse -----------------------------------------------------------------------------------------------------

// The film's adjoint under the filter around a place on it.
static void film_worth(const Tracer *t, double x, double y, double share, real *delta) {
    const SensorRecord *s = t->sensor;
    int32_t left, right, top, bottom, last_x = s->crop_x + s->crop_width, last_y = s->crop_y + s->crop_height;
    double sum[SPEC_N] = {0};
    footprint_along(s, x, &left, &right);
    footprint_along(s, y, &top, &bottom);
    for (int32_t j = top < s->crop_y ? s->crop_y : top; j < bottom && j < last_y; j++) {
        float wy = footprint_share(s, j, y);
        for (int32_t i = left < s->crop_x ? s->crop_x : left; i < right && i < last_x; i++) {
            float w = wy * footprint_share(s, i, x);
            const float *pixel =
                t->job->adjoint + ((int64_t)(j - s->crop_y) * s->crop_width + i - s->crop_x) * SPEC_N;
            for (int c = 0; c < SPEC_N; c++) {
                sum[c] += (double)w * (double)pixel[c];
            }
        }
    }
    for (int c = 0; c < SPEC_N; c++) {
        delta[c] = (real)(share * sum[c]);
    }
}

// The same per lane of m, times the weight of what arrives there.
static Spec sight_worth(const Tracer *t, const Seen *s, double share) {
    real worth[SPEC_N][LANES] = {{0}};
    Spec delta;
    for (uint32_t bits = m_bits(s->m); bits; bits &= bits - 1) {
        int lane = __builtin_ctz(bits);
        real one[SPEC_N];
        film_worth(t, (double)f_lane(s->x, lane), (double)f_lane(s->y, lane), share, one);
        for (int c = 0; c < SPEC_N; c++) {
            worth[c][lane] = one[c];
        }
    }
    for (int c = 0; c < SPEC_N; c++) {
        delta.c[c] = f_load(worth[c]);
    }
    return spec_mul(delta, s->weight);
}

static void particle_backward(Tracer *t, double share) {
    const Records *r = &t->ws.records;
    Sink sink = sink_of(t->job);
    for (int32_t b = t->batch_count - 1; b >= 0; b--) {
        const RecordBatch *batch = t->ws.batches + b;
        if (batch->tag == VERTEX_LIGHT) {
            if (t->job->live_lights) {
                // beta = Le w
                Starts s = starts_load(t, batch);
                Spec worth = spec_zero_unless(s.m, spec_gather(t->ws.suffix, s.slot));
                starts_adj(t->scene, s.light, s.m, s.uv, s.prim, spec_scale(worth, s.factor), &sink);
            }
            continue;
        }
        Seen at = seen_load(t, batch);
        Int slot = batch_slot(t, batch);
        Spec sight = sight_worth(t, &at, share), suffix = spec_gather(t->ws.suffix, slot);
        // W = delta f g + f' w W_next
        Spec worth = spec_add(spec_mul(sight, at.f), spec_mul(spec_load(r->weight, batch->first), suffix));
        Mask finite = m_finite(spec_sum(worth));
        spec_scatter(t->ws.suffix, slot, spec_zero_unless(finite, worth), m_first_n(batch->count));
        if (t->job->live[batch->group] & LIVE_SCATTERING) {
            SurfaceSweep s;
            landing_load(t, batch, slot, suffix, &s);
            Exchange seen = exchange_sight(&s), onward = exchange_onward(&s);
            Spec beta = spec_zero_unless(finite, s.beta);
            watch_landings(t, &s, &sink);
            exchange_adj(t, &s, &seen, spec_mul(beta, sight), &sink);
            exchange_adj(t, &s, &onward, spec_scale(spec_mul(beta, s.suffix), s.scatter_weight), &sink);
        }
    }
    t->job->faces |= sink.faces;
}

// ---- forward -----------------------------------------------------------------------------------------------------

// What the sink gathered of one channel.
KFN Float sink_take(Sink *sink) {
    Float d = f_zero_unless(m_finite(sink->derivative), sink->derivative);
    sink->derivative = f_set(0);
    return d;
}

// Derivatives of one of a vertex's values, channel by channel.
static Spec exchange_derivative(const Tracer *t, const SurfaceSweep *s, const Exchange *x, Sink *sink) {
    Spec df = spec_zero();
    for (int c = 0; c < SPEC_N; c++) {
        Spec one = spec_zero();
        one.c[c] = f_set(1);
        exchange_adj(t, s, x, one, sink);
        df.c[c] = sink_take(sink);
    }
    return df;
}

static void particle_tangent(Tracer *t) {
    const Records *r = &t->ws.records;
    Sink sink = sink_of(t->job);
    for (int32_t b = 0; b < t->batch_count; b++) {
        const RecordBatch *batch = t->ws.batches + b;
        if (batch->tag == VERTEX_LIGHT) {
            Starts s = starts_load(t, batch);
            Spec dbeta = spec_zero();
            for (int c = 0; c < SPEC_N && t->job->live_lights; c++) {
                Spec one = spec_zero();
                one.c[c] = s.factor;
                starts_adj(t->scene, s.light, s.m, s.uv, s.prim, one, &sink);
                dbeta.c[c] = sink_take(&sink);
            }
            spec_scatter(t->ws.suffix, s.slot, dbeta, s.m);
            continue;
        }
        // C = beta f g, beta_next = beta f' w
        Seen at = seen_load(t, batch);
        Int slot = batch_slot(t, batch);
        Spec dbeta = spec_gather(t->ws.suffix, slot), dsight = spec_mul(dbeta, at.f);
        dbeta = spec_mul(dbeta, spec_load(r->weight, batch->first));
        if (t->job->live[batch->group] & LIVE_SCATTERING) {
            SurfaceSweep s;
            landing_load(t, batch, slot, spec_zero(), &s);
            Exchange seen = exchange_sight(&s), onward = exchange_onward(&s);
            watch_landings(t, &s, &sink);
            spec_acc(&dsight, spec_mul(s.beta, exchange_derivative(t, &s, &seen, &sink)));
            Spec df = exchange_derivative(t, &s, &onward, &sink);
            spec_acc(&dbeta, spec_scale(spec_mul(s.beta, df), s.scatter_weight));
        }
        particle_splat_lanes(t, at.x, at.y, spec_mul(dsight, at.weight), at.m);
        spec_scatter(t->ws.suffix, slot, dbeta, m_first_n(batch->count));
    }
    t->job->faces |= sink.faces;
}

// ---- replay ------------------------------------------------------------------------------------------------------

// The picture of a scene with other parameters along the recorded particles: see path_replay.h.
static void particle_replay(Tracer *t) {
    const SceneView *recorded = t->scene;
    t->scene = t->job->moved;
    for (int32_t b = 0; b < t->batch_count; b++) {
        const RecordBatch *batch = t->ws.batches + b;
        if (batch->tag == VERTEX_LIGHT) {
            Starts s = starts_load(t, batch);
            Spec beta = spec_scale(starts_value(t->scene, s.light, s.m, s.uv, s.prim), s.factor);
            spec_scatter(t->ws.suffix, s.slot, beta, s.m);
            continue;
        }
        SurfaceSweep s;
        Int slot = batch_slot(t, batch);
        landing_load(t, batch, slot, spec_gather(t->ws.suffix, slot), &s);
        Exchange seen = exchange_sight(&s), onward = exchange_onward(&s);
        Spec f = bsdf_eval(&s.call, seen.view, seen.light, seen.lobe);
        particle_splat_lanes(t, s.light_uv.x, s.light_uv.y, spec_mul(spec_mul(s.suffix, f), s.light_weight), s.connected);
        Spec beta = spec_scale(spec_mul(s.suffix, bsdf_eval(&s.call, onward.view, onward.light, onward.lobe)),
                               s.scatter_weight);
        spec_scatter(t->ws.suffix, s.slot, spec_zero_unless(s.scattered, beta), s.m);
    }
    t->scene = recorded;
}
