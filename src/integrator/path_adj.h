// path_adj.h: the backward sweep over the recorded vertices of a chunk. With detached sampling the radiance leaving
// vertex k is  L_k = w_e Le + sum_lights f Le T w_l + f w_s L_(k+1),  so that its derivative with respect to anything
// in f and Le at that vertex is weighted by delta x throughput, and L is summed from the end of the path: no
// subtraction, and no division by f, so that nothing is lost where f = 0.
// Vertices in media: collision_adj.h, the ways between: flight_adj.h.
// NOT differentiated: visibility, sampling decisions. What moves: path_move.h.
#pragma once

#include "integrator/collision_adj.h"
#include "integrator/glossy.h"
#include "integrator/kept.h"

static void escape_adj(Tracer *t, Sink *sink, const RecordBatch *batch) {
    const Records *r = &t->ws.records;
    const EmitterRecord *e = t->scene->emitters + t->scene->environment;
    int32_t at = batch->first;
    Mask m = m_first_n(batch->count);
    Int slot = i_select(m, i_load(r->slot + at), i_set(0));
    spec_scatter(t->ws.suffix, slot, spec_load(r->local, at), m);
    if (!t->job->live_lights) {
        return;
    }
    Vec3 d = record_v3(r->dx, r->dy, r->dz, at);
    Spec beta = spec_load(r->beta, at);
    Float mis = f_load(r->mis + at);
    Vec2 uv = environment_uv(t->scene, e, d);
    const bool moves = sink->any_places || sink->any_motion || t->job->glides;
    for (int c = 0; c < drives(t); c++) {
        // L = w_e Le
        Spec dl = spec_scale(spec_mul(slot_adjoint(t, slot, c), beta), mis);
        LightMove move = light_move_zero();
        emitter_adj(t->scene, t->scene->environment, texcoord(uv, NULL), f_set(1), spec_zero_unless(m, dl),
                    moves ? &move : NULL, sink, m);
        if (moves) {
            emitter_move_adj(t->scene, t->scene->environment, v3_zero(), d, f_set(1), &move, sink, m);
        }
        if (sink->any_motion || t->job->glides) {
            rows_scatter(&t->ws.turn, c, slot, move.d, m);
        }
        const Carried carried = {v3_zero(), move.d};
        if (t->job->rides) {
            first_ride_adj(t, batch, slot, d, &carried, sink, m);
        } else if (sink->any_camera && batch->first_vertex && !t->job->glides) {
            camera_move_adj(t, slot, d, &carried, sink, m);
        }
        forward_flush(t, sink, slot, c, m);
    }
}

// Adjoint of the light samples of a vertex for one delta: of L += f Le (T w_l).
KFN void connections_adj(const Tracer *t, const SurfaceSweep *s, const BsdfCall *call, int32_t live, Spec weight,
                         VertexAdj *d, Sink *sink) {
    bool moves = sink->any_places || sink->any_motion;
    Spec both = spec_scale(spec_mul(weight, s->light_weight), s->kept);
    Vec2 *at = sink->at;
    Vec3 *point = sink->point;
    sink->at = NULL; // light samples are attached
    sink->point = point ? &d->light_point : NULL;
    if (t->job->live_lights) {
        lights_adj(t->scene, s->light, s->connected, s->light_uv, s->light_prim, s->light_distance,
                   spec_zero_unless(s->connected, spec_mul(both, s->f_light)), moves ? &d->light : NULL, sink);
    }
    sink->at = at;
    sink->point = point;
    if (live & LIVE_SCATTERING) {
        Vec3 dwl = v3_zero();
        Spec df = spec_zero_unless(s->connected, spec_mul(both, s->light_value));
        bsdf_adj(call, s->wi, s->wl, i_set(LOBE_SMOOTH), df, sink, s->connected, &d->wi, &dwl, vertex_uv_adj(s, d, sink));
        // wl = to_local(d)
        frame_to_local_adj(&s->si.sh, s->light_d, dwl, &d->frame, &d->light.d);
        if (sink->any_motion) {
            d->lit = spec_dot(df, s->f_light);
        }
    }
    if (moves) {
        lights_move_adj(t->scene, s->light, s->connected, s->si.p, s->light_d, s->light_distance, &d->light, sink);
    }
}

// Adjoint of what scattering brings of the radiance l behind: L += f w_s l. dwo: of the direction onwards.
KFN void scattered_adj(const SurfaceSweep *s, const BsdfCall *call, Spec weight, Spec l, Mask m, VertexAdj *d, Vec3 *dwo,
                       Sink *sink) {
    Vec3 local = v3_zero();
    Spec df = spec_zero_unless(m, spec_scale(spec_mul(weight, l), s->scatter_weight));
    bsdf_adj(call, s->wi, s->wo, s->lobe, df, sink, m, &d->wi, &local, vertex_uv_adj(s, d, sink));
    frame_to_local_adj(&s->si.sh, s->wo_d, local, &d->frame, dwo);
}

// Adjoint of the vertex's outgoing radiance for one delta, by what of the vertex is live.
KFN void surface_adj(const Tracer *t, const SurfaceSweep *s, int32_t live, Spec delta, int channel, Sink *sink) {
    Spec weight = spec_mul(delta, s->beta);
    VertexAdj d;
    vertex_adj_clear(&d, sink->any_motion);
    BsdfCall call = s->call;
    call.dsurface = call.surface && (sink->any_normals || sink->any_motion) ? &d.surface : NULL;
    bool uv_moves = vertex_uv_moves(s, sink);
    sink->at = uv_moves ? &d.at : NULL;
    sink->point = sink->any_motion ? &d.point : NULL;
    // Volumes are looked up where points that move lie.
    if ((live & LIVE_EMISSION) || (s->emitter && (uv_moves || (sink->point && s->emitter->attributes)))) {
        // L += w_e Le
        LightMove seen = light_move_zero();
        emitter_adj(t->scene, s->group->emitter, texcoord(s->si.uv, &s->hit), f_set(1),
                    spec_zero_unless(s->lit, spec_scale(weight, s->mis)), uv_moves ? &seen : NULL, sink, s->lit);
        d.uv = seen.uv;
    }
    if (m_any(s->connected)) {
        connections_adj(t, s, &call, live, weight, &d, sink);
    }
    if (t->scene->drops) {
        if (live & LIVE_SCATTERING) {
            kept_adj(t, s, &call, delta, &d, sink);
        }
        kept_weights_adj(t, s, &call, live, weight, &d, sink);
    }
    Mask scattered = sink->any_motion ? s->scattered & ~s->chained : s->scattered;
    if ((live & LIVE_SCATTERING) && m_any(scattered)) {
        Spec chain = spec_sub(s->suffix, s->attached);
        scattered_adj(s, &call, weight, s->attached, scattered, &d, &d.wo, sink);
        if (sink->any_motion && m_any(scattered & m_gt(spec_dot(chain, chain), f_set(0)))) {
            // A chain that begins here has a fixed direction.
            Vec3 fixed = v3_zero();
            scattered_adj(s, &call, weight, chain, scattered, &d, &fixed, sink);
        }
    }
    sink->at = NULL;
    sink->point = NULL;
    if (sink->any_motion) {
        d.onward = f_zero_unless(scattered, spec_dot(spec_mul(weight, s->attached), spec_load(t->ws.records.weight, s->at)));
        d.p = s->corner ? corner_move_adj(t, s, weight, sink) : s->dp;
        if (s->glossy) {
            glossy_move_adj(t, s, weight, &d, sink);
        }
        vertex_move_adj(t, s, &d, weight, live, channel, sink);
    } else if (sink->any_normals && s->group->shape_kind == SHAPE_MESH) {
        vertex_frame_adj(s, call.surface != NULL, &d);
        mesh_interaction_adj(t->scene, s->group->shape_flags, &s->hit, &s->si, &d.frame, sink, s->m);
    }
}

// Notes whether shading normals that depend on the selection face the viewer as the surface does. The picture jumps
// where they begin to face the other way, which is somewhere if paths meet both; faces may also be wound the wrong way
// round throughout. Where normals turn away from the light, the scattering function goes to 0 with the cosine, and
// nothing jumps.
KFN void watch_normals(const Tracer *t, const SurfaceSweep *s, Sink *sink) {
    // What moves: the surface, the sensor, or an earlier vertex that looks at it.
    bool moved = sink->any_motion && (sink->any_camera || !s->first || (t->job->live[s->group - t->scene->groups] & LIVE_MOTION));
    bool smooth = s->group->shape_kind == SHAPE_MESH && (s->group->shape_flags & SHAPE_HAS_NORMALS) && t->job->watch_smooth;
    if (smooth && (sink->any_normals || moved)) {
        Mask selected = moved ? s->m : s->m & mi_lt(i_set(-1), i_gather(sink->normals_at, s->hit.shape));
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

// Whether something selected reaches a batch of surface vertices.
KFN bool surface_is_live(const Tracer *t, const RecordBatch *batch, bool live_passing) {
    return batch->tag == VERTEX_SURFACE && (t->job->live[batch->group] || t->job->live_lights || live_passing);
}

// The adjoint of such a batch.
static void surface_sweep(Tracer *t, const RecordBatch *batch, SurfaceSweep *s, Mask finite, bool live_passing, Passage *p,
                          Sink *sink) {
    PathJob *job = t->job;
    const int32_t live = job->live[batch->group];
    surface_parameterise(t, s);
    if ((job->watch_turned || job->watch_smooth) && (live & (LIVE_SCATTERING | LIVE_MOTION)) && !batch->ends) {
        watch_normals(t, s, sink);
    }
    Mask seen = t->scene->has_media ? records_first(t, batch, s->m) : m_set(s->first);
    if ((job->any_motion || job->any_places) && m_any(seen & s->scattered & s->chained)) {
        sink->faces |= CAMERA_MIRRORED;
    }
    if (t->scene->through) {
        surface_passage_find(t, batch, s, p);
        s->connected = p->open;
        s->light_value = p->light_value;
    } else if (t->spares) {
        s->light_value = spec_set(f_set(1)); // the recorded weight holds it
    } else if ((live & LIVE_SCATTERING) || t->scene->drops) {
        s->light_value = lights_eval(t->scene, s->light, s->connected, s->light_uv, s->light_prim, s->light_distance);
    }
    Corner corner;
    if (job->corner_at && !batch->ends) {
        corner = corner_load(t, batch);
        s->corner = m_any(corner.m) ? &corner : NULL;
        corner_meet(t, s->slot, &corner);
    }
    Glossy glossy;
    if (job->glossy && !batch->ends) {
        glossy = glossy_load(t, s);
        s->glossy = m_any(glossy.m) ? &glossy : NULL;
    }
    Spec unshadowed = s->light_weight, transmittance = spec_set(f_set(1));
    if (t->scene->through) {
        transmittance = p->transmittance;
        s->light_weight = spec_mul(unshadowed, transmittance);
    }
    for (int c = 0; c < drives(t); c++) {
        Spec delta = spec_zero_unless(finite, slot_adjoint(t, s->slot, c));
        if (live_passing) {
            // L += f Le w_l T
            Spec dt = spec_mul(spec_mul(spec_mul(delta, s->beta), unshadowed), spec_mul(s->f_light, s->light_value));
            Connection to = {s->si.p, s->light_d, s->light_distance, s->light, s->light_prim, s->connected};
            s->dp = connection_passage_adj(t, &p->walk, transmittance, dt, s->slot, batch->bounce, &to, false, sink);
        }
        surface_adj(t, s, live, delta, c, sink);
        forward_flush(t, sink, s->slot, c, s->m);
    }
    if (job->any_motion) {
        vertex_keep(t, s);
    }
}

// Keeps what leaves the vertices of a batch and does not go on along a chain; returns what their successors left.
static Spec attached_keep(Tracer *t, const RecordBatch *batch, Int slot, Spec suffix, Mask m) {
    const Records *r = &t->ws.records;
    int32_t at = batch->first;
    Spec next = spec_gather(t->ws.attached, slot);
    Mask chained = chain_lanes(t, i_load(r->lobe + at), records_slide(t, at));
    Spec onward = spec_zero_unless(~chained, spec_mul(spec_load(r->weight, at), suffix));
    spec_scatter(t->ws.attached, slot, spec_add(spec_load(r->local, at), onward), m);
    return next;
}

// The sensor's part in the adjoints of rays that glide.
static void glides_end(Tracer *t, int32_t count, Sink *sink) {
    for (int32_t k = 0; k < count; k += LANES) {
        Mask m = m_first_n(count - k);
        Int slot = i_select(m, i_iota() + k, i_set(k));
        for (int c = 0; c < drives(t); c++) {
            Glide g = glide_load(t, c, slot, glide_reference(t, slot, v3_zero()), v3_zero());
            Carried carried = {g.position, g.turn};
            Mask finite = m & m_finite(v3_dot(g.position, g.position) + v3_dot(g.turn, g.turn));
            camera_move_adj(t, slot, g.ref, &carried, sink, finite);
            forward_flush(t, sink, slot, c, finite);
        }
    }
}

// What lies between the sensor and collisions that move with their lights (beacon_view.h).
static void flows_end(Tracer *t, int32_t count, Sink *sink) {
    for (int32_t k = 0; k < count; k += LANES) {
        Int slot = i_select(m_first_n(count - k), i_iota() + k, i_set(k));
        Mask m = m_first_n(count - k) & mi_eq(i_gather(t->ws.next, slot), i_set(NEXT_STILL));
        if (!m_any(m)) {
            continue;
        }
        Vec2 lens = slot_lens(t, slot);
        Vec3 d = sensor_ray(t->scene, t->sensor, real_gather(t->ws.film_x, slot), real_gather(t->ws.film_y, slot), lens).ray.d;
        Float rcp = beacon_turn(t, LOAD_V3(t->ws, next_px, next_py, next_pz, slot), lens);
        for (int c = 0; c < drives(t); c++) {
            still_move_adj(t, slot, c, rcp, d, v3_zero(), m, sink, m);
            forward_flush(t, sink, slot, c, m);
        }
    }
}

// What is left of the sensor's rays.
static void first_rays_end(Tracer *t, int32_t count, Sink *sink) {
    if (t->job->glides) {
        glides_end(t, count, sink);
    }
    if (t->pinhole) {
        flows_end(t, count, sink);
    }
}

// The borders that a batch of surface vertices lies on. Whether these are no vertices of the path: where surfaces move, segments
// are attached through surfaces of the kind null.
static bool passed_sweep(Tracer *t, const RecordBatch *batch, Int slot, Spec suffix, Mask finite, Mask m, Sink *sink) {
    const bool passed = t->job->rides && group_is_null(t->scene, t->scene->groups + batch->group);
    if (border_is_live(t, batch) && (passed || !t->job->rides)) {
        border_surface_sweep(t, batch, suffix, finite, sink);
    }
    if (passed) {
        ride_flight(t, batch, slot, m);
    }
    return passed;
}

// Sweeps the records of a chunk of so many paths from the last vertex to the first.
static void path_backward(Tracer *t, int32_t count) {
    PathJob *job = t->job;
    const Records *r = &t->ws.records;
    Sink sink = sink_of(job);
    bool live_passing = passing_is_live(t);
    SurfaceSweep s;
    Passage p;
    if (job->any_motion) {
        vertices_forget(t);
    }
    if (job->glides) {
        glides_forget(t);
    }
    for (int32_t b = t->batch_count - 1; b >= 0; b--) {
        const RecordBatch *batch = t->ws.batches + b;
        if (batch->tag == VERTEX_ESCAPED) {
            escape_adj(t, &sink, batch);
            continue;
        }
        Mask m = m_first_n(batch->count);
        Int slot = i_select(m, i_load(r->slot + batch->first), i_set(0));
        Spec suffix = spec_gather(t->ws.suffix, slot);
        const bool surface = surface_is_live(t, batch, live_passing);
        if (surface) {
            surface_load(t, batch, slot, suffix, &s);
        }
        p.found = false;
        if (t->shadows_later && batch->tag != VERTEX_FLIGHT) {
            passage_light(t, batch, slot, &s, &p);
        }
        // L = local + weight L_next
        Spec l = spec_add(spec_load(r->local, batch->first), spec_mul(spec_load(r->weight, batch->first), suffix));
        Mask finite = m & m_finite(spec_sum(l));
        spec_scatter(t->ws.suffix, slot, spec_zero_unless(finite, l), m);
        if (batch->tag == VERTEX_FLIGHT) {
            flight_sweep(t, batch, slot, suffix, finite, &sink);
            ride_flight(t, batch, slot, m);
            continue;
        }
        if (batch->tag == VERTEX_MEDIUM) {
            collision_sweep(t, batch, slot, suffix, finite, live_passing, &p, &sink);
            continue;
        }
        if (passed_sweep(t, batch, slot, suffix, finite, m, &sink)) {
            continue;
        }
        Spec attached = job->any_motion ? attached_keep(t, batch, slot, suffix, finite) : suffix;
        if (surface) {
            s.attached = attached;
            surface_sweep(t, batch, &s, finite, live_passing, &p, &sink);
        }
        ride_end_sweep(t, batch, l, suffix, finite, &sink);
    }
    first_rays_end(t, count, &sink);
    job->faces |= sink.faces;
}
