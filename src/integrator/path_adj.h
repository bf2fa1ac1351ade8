// path_adj.h: the backward sweep over the recorded vertices of a chunk. With detached sampling the radiance leaving
// vertex k is  L_k = w_e Le + sum_lights f Le T w_l + f w_s L_(k+1),  so that its derivative with respect to anything
// in f and Le at that vertex is weighted by delta x throughput, and L is summed from the end of the path: no
// subtraction, and no division by f, so that nothing is lost where f = 0.
// NOT differentiated: visibility, positions, sampling decisions, chains of smooth mirrors and glass.
#pragma once

#include "integrator/path.h"

KFN Vec3 record_v3(const real *x, const real *y, const real *z, int32_t at) {
    return v3(f_load(x + at), f_load(y + at), f_load(z + at));
}

// The adjoint of one slot: in reverse mode the film's, in forward mode channel by channel 1.
KFN Spec slot_adjoint(const Tracer *t, Int slot, int channel) {
    if (t->job->mode == MODE_REVERSE) {
        return spec_gather(t->ws.adjoint, slot);
    }
    Spec delta = spec_zero();
    delta.c[channel] = f_set(1);
    return delta;
}

// Forward mode: moves what the sink gathered to the slots' derivative of one channel.
KFN void forward_flush(Tracer *t, Sink *sink, Int slot, int channel, Mask m) {
    if (t->job->mode == MODE_FORWARD) {
        f_scatter_add(t->ws.radiance[channel], slot, sink->derivative, m & m_finite(sink->derivative));
        sink->derivative = f_set(0);
    }
}

KFN int drives(const Tracer *t) { return t->job->mode == MODE_FORWARD ? SPEC_N : 1; }

static void escape_adj(Tracer *t, Sink *sink, const RecordBatch *batch) {
    const Records *r = &t->ws.records;
    const EmitterRecord *e = t->scene->emitters + t->scene->environment;
    int32_t at = batch->first;
    Mask m = m_first_n(batch->count);
    Int slot = i_select(m, i_load(r->slot + at), i_set(0));
    Vec3 d = record_v3(r->dx, r->dy, r->dz, at);
    Spec beta = spec_load(r->beta, at);
    Float mis = f_load(r->mis + at);
    Vec2 uv = environment_uv(t->scene, e, d);
    spec_scatter(t->ws.suffix, slot, spec_load(r->local, at), m);
    for (int c = 0; c < drives(t) && t->job->live_lights; c++) {
        // L = w_e Le
        Spec dl = spec_scale(spec_mul(slot_adjoint(t, slot, c), beta), mis);
        LightMove move = {v3_zero(), f_set(0), {f_set(0), f_set(0)}};
        emitter_adj(t->scene, t->scene->environment, texcoord(uv, NULL), f_set(1), spec_zero_unless(m, dl),
                    sink->any_places ? &move : NULL, sink, m);
        if (sink->any_places) {
            emitter_move_adj(t->scene, t->scene->environment, v3_zero(), d, f_set(1), &move, sink, m);
        }
        forward_flush(t, sink, slot, c, m);
    }
}

// What the sweep knows of a batch of surface vertices.
typedef struct SurfaceSweep {
    Mask m, lit, connected, scattered;
    Int slot, light, light_prim, lobe;
    Spec beta, suffix, light_weight, light_value, f_light;
    Float mis, scatter_weight, light_distance;
    Vec2 light_uv;
    Vec3 d, wi, light_d, wo_d, wl, wo;
    Hit hit;
    Interaction si;
    BsdfCall call;
    BsdfSurface surface;
    Vec3 dp_dv;
    const EmitterRecord *emitter;
    const Group *group;
} SurfaceSweep;

KFN SurfaceSweep surface_load(const Tracer *t, const RecordBatch *batch, Int slot, Spec suffix) {
    const Records *r = &t->ws.records;
    int32_t at = batch->first;
    SurfaceSweep s;
    s.m = m_first_n(batch->count);
    s.slot = slot;
    s.suffix = suffix;
    s.group = t->scene->groups + batch->group;
    s.hit.shape = i_load(r->shape + at);
    s.hit.prim = i_load(r->prim + at);
    s.hit.instance = i_load(r->instance + at);
    s.hit.u = f_load(r->u + at);
    s.hit.v = f_load(r->v + at);
    s.hit.p = record_v3(r->px, r->py, r->pz, at);
    s.d = record_v3(r->dx, r->dy, r->dz, at);
    s.beta = spec_load(r->beta, at);
    s.mis = f_load(r->mis + at);
    s.light_weight = spec_load(r->light_weight, at);
    s.f_light = spec_load(r->light_f, at);
    s.scatter_weight = f_load(r->sw + at);
    s.lit = s.m & m_gt(s.mis, f_set(0));
    s.connected = s.m & m_gt(spec_max(s.light_weight), f_set(0));
    s.scattered = s.m & m_gt(s.scatter_weight, f_set(0));
    s.light = i_load(r->light + at);
    s.light_prim = i_load(r->lprim + at);
    s.lobe = i_load(r->lobe + at);
    s.light_uv = (Vec2){f_load(r->lu + at), f_load(r->lv + at)};
    s.light_distance = f_load(r->ldist + at);
    // Lanes without a light sample or a continuation get directions that do no harm.
    Vec3 back = v3_neg(s.d);
    s.light_d = v3_select(s.connected, record_v3(r->ldx, r->ldy, r->ldz, at), back);
    s.wo_d = v3_select(s.scattered, record_v3(r->wox, r->woy, r->woz, at), back);
    s.lobe = i_select(s.scattered, s.lobe, i_set(LOBE_SMOOTH));
    s.si = shape_interaction(t->scene, s.group->shape_kind, s.group->shape_flags, &s.hit);
    s.wi = frame_to_local(&s.si.sh, back);
    s.wl = frame_to_local(&s.si.sh, s.light_d);
    s.wo = frame_to_local(&s.si.sh, s.wo_d);
    s.call = (BsdfCall){t->scene, s.group->bsdf, texcoord(s.si.uv, NULL), t->floor, NULL, NULL};
    s.emitter = s.group->emitter >= 0 ? t->scene->emitters + s.group->emitter : NULL;
    return s;
}

// Adjoint of the vertex's outgoing radiance for one delta, by what of the vertex is live.
KFN void surface_adj(const Tracer *t, const SurfaceSweep *s, int32_t live, Spec delta, Sink *sink) {
    Spec weight = spec_mul(delta, s->beta);
    Vec3 dwi = v3_zero();
    Frame dframe = {v3_zero(), v3_zero(), v3_zero()};
    Vec3 unused = v3_zero();
    BsdfCall call = s->call;
    BsdfSurface dsurface = {f_set(0), f_set(0), f_set(0), v3_zero()};
    call.dsurface = call.surface && sink->any_normals ? &dsurface : NULL;
    if (live & LIVE_EMISSION) {
        // L += w_e Le
        emitter_adj(t->scene, s->group->emitter, texcoord(s->si.uv, &s->hit), f_set(1),
                    spec_zero_unless(s->lit, spec_scale(weight, s->mis)), NULL, sink, s->lit);
    }
    if (m_any(s->connected)) {
        // L += f Le (T w_l)
        Vec3 dwl = v3_zero();
        Spec both = spec_mul(weight, s->light_weight);
        LightMove move = {v3_zero(), f_set(0), {f_set(0), f_set(0)}};
        if (t->job->live_lights) {
            lights_adj(t->scene, s->light, s->connected, s->light_uv, s->light_prim, s->light_distance,
                       spec_zero_unless(s->connected, spec_mul(both, s->f_light)), sink->any_places ? &move : NULL, sink);
        }
        if (live & LIVE_SCATTERING) {
            Spec df = spec_zero_unless(s->connected, spec_mul(both, s->light_value));
            bsdf_adj(&call, s->wi, s->wl, i_set(LOBE_SMOOTH), df, sink, s->connected, &dwi, &dwl, NULL);
            // wl = to_local(d)
            frame_to_local_adj(&s->si.sh, s->light_d, dwl, &dframe, &move.d);
        }
        if (sink->any_places) {
            lights_move_adj(t->scene, s->light, s->connected, s->si.p, s->light_d, s->light_distance, &move, sink);
        }
    }
    if ((live & LIVE_SCATTERING) && m_any(s->scattered)) {
        // L += f w_s L_next
        Vec3 dwo = v3_zero();
        Spec df = spec_zero_unless(s->scattered, spec_scale(spec_mul(weight, s->suffix), s->scatter_weight));
        bsdf_adj(&call, s->wi, s->wo, s->lobe, df, sink, s->scattered, &dwi, &dwo, NULL);
        frame_to_local_adj(&s->si.sh, s->wo_d, dwo, &dframe, &unused);
    }
    if (sink->any_normals && s->group->shape_kind == SHAPE_MESH) {
        // wi = to_local(-d)
        frame_to_local_adj(&s->si.sh, v3_neg(s->d), dwi, &dframe, &unused);
        // ux = s . dp_du, vx = s . dp_dv, vy = t . dp_dv
        if (call.surface) {
            v3_acc(&dframe.s, v3_madd(v3_scale(s->si.dp_du, dsurface.ux), dsurface.vx, s->dp_dv));
            v3_acc(&dframe.t, v3_scale(s->dp_dv, dsurface.vy));
        }
        mesh_interaction_adj(t->scene, s->group->shape_flags, &s->hit, &s->si, &dframe, sink, s->m);
    }
}

// Accumulates the adjoint dt of a walk's transmittance, the product of what its surfaces let through.
static NOINLINE void walk_adj(const Tracer *t, const Walk *walk, Spec dt, Sink *sink) {
    const SceneView *scene = t->scene;
    Spec behind[MOST_SURFACES_IN_A_ROW], after = spec_set(f_set(1)), before = after;
    for (int32_t i = walk->count - 1; i >= 0; i--) {
        behind[i] = after;
        after = spec_select(walk->m[i], spec_mul(after, walk->pass[i]), after);
    }
    for (int32_t i = 0; i < walk->count; i++) {
        // T = before pass behind
        Spec dpass = spec_zero_unless(walk->m[i], spec_mul(dt, spec_mul(before, behind[i])));
        Int groups = SHAPE_FIELD(scene, i_max(walk->hit[i].shape, i_set(0)), group);
        before = spec_select(walk->m[i], spec_mul(before, walk->pass[i]), before);
        for (Mask left = walk->m[i]; m_any(left);) {
            int32_t id = i_lane(groups, m_first(left));
            Mask mine = left & mi_eq(groups, i_set(id));
            const Group *group = scene->groups + id;
            left = left & ~mine;
            if (!(t->job->live[id] & LIVE_SCATTERING)) {
                continue;
            }
            Hit hit = walk_hit(&walk->hit[i], mine);
            Interaction si = shape_interaction(scene, group->shape_kind, group->shape_flags, &hit);
            BsdfCall call = {scene, group->bsdf, texcoord(si.uv, &hit), t->floor, NULL, NULL};
            Vec3 wo = frame_to_local(&si.sh, walk->d), dwi = v3_zero(), dwo = v3_zero(), unused = v3_zero();
            Frame dframe = {v3_zero(), v3_zero(), v3_zero()};
            bsdf_adj(&call, v3_neg(wo), wo, i_set(LOBE_NULL), spec_zero_unless(mine, dpass), sink, mine, &dwi, &dwo,
                     NULL);
            if (sink->any_normals && group->shape_kind == SHAPE_MESH) {
                frame_to_local_adj(&si.sh, walk->d, v3_sub(dwo, dwi), &dframe, &unused);
                mesh_interaction_adj(scene, group->shape_flags, &hit, &si, &dframe, sink, mine);
            }
        }
    }
}

// Finds the transmittance of the batch's shadow rays again.
static NOINLINE Spec walk_again(Tracer *t, const SurfaceSweep *s, Walk *walk) {
    Ray ray;
    Mask blocked;
    shadow_ray(&s->si, s->light_d, s->light_distance, &ray);
    walk->count = 0;
    walk->d = ray.d;
    return walk_transmittance(t, ray, s->connected, &blocked, walk);
}

// Whether shadow rays pass surfaces whose transmittance depends on the selection.
KFN bool passing_is_live(const Tracer *t) {
    for (int64_t g = 0; g < t->scene->groups_count && t->scene->through; g++) {
        if ((t->job->live[g] & LIVE_SCATTERING) && t->scene->bsdfs[t->scene->groups[g].bsdf].transmits) {
            return true;
        }
    }
    return false;
}

// Notes whether shading normals that depend on the selection face the viewer as the surface does. The picture jumps
// where they begin to face the other way, which is somewhere if paths meet both; faces may also be wound the wrong way
// round throughout. Where normals turn away from the light, the scattering function goes to 0 with the cosine, and
// nothing jumps.
KFN void watch_normals(const Tracer *t, const SurfaceSweep *s, Sink *sink) {
    if (sink->any_normals && s->group->shape_kind == SHAPE_MESH) {
        Mask selected = s->m & mi_lt(i_set(-1), i_gather(sink->normals_at, s->hit.shape));
        Float geometric = -v3_dot(s->d, s->si.ng);
        Mask away = m_le(s->wi.z * geometric, f_set(0));
        sink->faces |= (m_any(selected & away) ? FACES_AWAY : 0) | (m_any(selected & ~away) ? FACES_ALIKE : 0);
    }
    if (t->scene->bsdfs[s->group->bsdf].turns) {
        // Maps look at the viewer also where they scatter nothing to any light.
        Vec3 dwi = v3_zero(), dwo = v3_zero();
        bsdf_adj(&s->call, s->wi, s->wi, i_set(LOBE_SMOOTH), spec_zero(), sink, s->m, &dwi, &dwo, NULL);
    }
}

static Sink sink_of(const PathJob *job) {
    return (Sink){.gradient = job->gradient,
                  .tangent = job->tangent,
                  .texture_at = job->texture_at,
                  .to_uv_at = job->to_uv_at,
                  .normals_at = job->normals_at,
                  .attribute_at = job->attribute_at,
                  .place_at = job->place_at,
                  .any_normals = job->any_normals,
                  .any_attributes = job->any_attributes,
                  .any_places = job->any_places,
                  .watch_turned = job->watch_turned,
                  .derivative = f_set(0)};
}

// The adjoint of a batch of surface vertices that something selected reaches.
static void surface_sweep(Tracer *t, const RecordBatch *batch, Int slot, Spec suffix, Mask finite, bool live_passing,
                          Sink *sink) {
    PathJob *job = t->job;
    int32_t live = job->live[batch->group];
    Walk walk;
    SurfaceSweep s = surface_load(t, batch, slot, suffix);
    s.call.uv.hit = &s.hit;
    if (t->scene->bsdfs[s.group->bsdf].surface) {
        find_surface(t->scene, s.group, &s.hit, &s.surface, &s.dp_dv);
        s.call.surface = &s.surface;
    }
    if (job->watch_turned && (live & LIVE_SCATTERING) && !batch->ends) {
        watch_normals(t, &s, sink);
    }
    if ((live & LIVE_SCATTERING) || live_passing) {
        s.light_value = lights_eval(t->scene, s.light, s.connected, s.light_uv, s.light_prim, s.light_distance);
    }
    Spec unshadowed = s.light_weight;
    if (t->scene->through) {
        s.light_weight = spec_mul(unshadowed, walk_again(t, &s, &walk));
    }
    for (int c = 0; c < drives(t); c++) {
        Spec delta = spec_zero_unless(finite, slot_adjoint(t, slot, c));
        surface_adj(t, &s, live, delta, sink);
        if (live_passing) {
            // L += f Le w_l T
            Spec dt = spec_mul(spec_mul(spec_mul(delta, s.beta), unshadowed), spec_mul(s.f_light, s.light_value));
            walk_adj(t, &walk, spec_zero_unless(s.connected, dt), sink);
        }
        forward_flush(t, sink, slot, c, s.m);
    }
}

// Sweeps the chunk's records from the last vertex to the first.
static void path_backward(Tracer *t) {
    PathJob *job = t->job;
    const Records *r = &t->ws.records;
    Sink sink = sink_of(job);
    bool live_passing = passing_is_live(t);
    for (int32_t b = t->batch_count - 1; b >= 0; b--) {
        const RecordBatch *batch = t->ws.batches + b;
        if (batch->tag == VERTEX_ESCAPED) {
            escape_adj(t, &sink, batch);
            continue;
        }
        Mask m = m_first_n(batch->count);
        Int slot = i_select(m, i_load(r->slot + batch->first), i_set(0));
        Spec suffix = spec_gather(t->ws.suffix, slot);
        // L = local + weight L_next
        Spec l = spec_add(spec_load(r->local, batch->first), spec_mul(spec_load(r->weight, batch->first), suffix));
        Mask finite = m & m_finite(spec_sum(l));
        spec_scatter(t->ws.suffix, slot, spec_zero_unless(finite, l), m);
        if (job->live[batch->group] || job->live_lights || live_passing) {
            surface_sweep(t, batch, slot, suffix, finite, live_passing, &sink);
        }
    }
    job->faces |= sink.faces;
}
