// indirect.h: the boundary term of silhouettes that other vertices of a path see: shadows and everything that light
// passes on its way. Boundary segments (segments.h) are continued at both ends: a path on the far side says how much light
// comes, by its number of segments; a particle on the near side carries it to the sensor. In reverse mode the particle
// gathers what the film's adjoint makes of it, at its first vertex and at the others: the first one slides over its
// surface, because the film position is fixed.
// Edges along chains of smooth mirrors and glass (chained.h), and as collisions see them (riding.h), take the same way.
// What the camera sees of this in mirrors and through glass: glimpse.h.
#pragma once

#include "integrator/boundary/segments_move.h"

// ---- the near side -----------------------------------------------------------------------------------------------

// What a vertex that is seen at x, y brings to the derivative: to the picture, or times the film's adjoint to the segment.
static void near_book(Indirect *in, const Sight *sight, Spec l, Int slot, int32_t bounce, Mask m) {
    Tracer *t = in->t;
    real *rows = bounce == 0 ? in->q.seen : in->q.unseen;
    for (uint32_t bits = m_bits(m); bits; bits &= bits - 1) {
        int lane = __builtin_ctz(bits);
        int32_t k = i_lane(slot, lane);
        rows = in->upstream ? upstream_row(&in->q, k, bounce) : rows;
        if (!rows) {
            continue;
        }
        double x = (double)f_lane(sight->x, lane), y = (double)f_lane(sight->y, lane), rgb[SPEC_N];
        float delta[SPEC_N];
        if (in->b->job.mode == MODE_FORWARD) {
            for (int c = 0; c < SPEC_N; c++) {
                rgb[c] = (double)f_lane(l.c[c], lane) * (double)rows[k];
            }
            particle_splat(t, x, y, rgb);
            continue;
        }
        film_worth(t->sensor, in->filter, in->b->job.adjoint, (float)x, (float)y, (int32_t)floor(x), (int32_t)floor(y),
                   delta);
        for (int c = 0; c < SPEC_N; c++) {
            rows[k] += delta[c] * in->b->scale * f_lane(l.c[c], lane);
        }
    }
}

// Lanes of vertices in scenes where some of them are no ends of segments, from which paths to the sensor are not too deep.
KFN Mask near_reaches(const Tracer *t, const Vertex *v) {
    return v->m & depth_allows(t->scene, v->depth + 2);
}

// Connects vertices to the sensor, as light tracing does (particle.h).
static void near_connect(Indirect *in, const Landing *at, int32_t bounce) {
    Tracer *t = in->t;
    Sight sight = camera_look(in->pinhole, t->scene, t->sensor, at->si.p, near_lens(in, at->v.slot));
    const PathJob *job = t->job;
    Mask m = at->v.m & sight.valid & m_gt(at->cosine, f_set(0)) & m_ge(sight.x, f_set((real)job->x)) &
             m_lt(sight.x, f_set((real)(job->x + job->width))) & m_ge(sight.y, f_set((real)job->y)) &
             m_lt(sight.y, f_set((real)(job->y + job->height)));
    if (!m_any(m)) {
        return;
    }
    Vec3 d = v3_select(m, sight.d, v3_neg(at->v.d));
    Spec f = bsdf_eval(&at->call, frame_to_local(&at->si.sh, d), at->wl, i_set(LOBE_SMOOTH));
    Float weight = f_abs(v3_dot(at->si.ng, d)) * f_safe_rcp(at->cosine) * sight.density;
    Spec l = spec_mul(spec_scale(spec_mul(at->v.beta, f), weight), far_radiance(in, at->v.slot, at->v.depth));
    m = m & m_gt(jump_size(l), f_set(0)) & m_finite(spec_sum(l));
    if (t->scene->has_media) {
        Ray ray = {interaction_offset(&at->si, d), d, sight.length * (1.0f - SHADOW_SHORT)};
        m = sight_clear(in->t, &ray, medium_behind(at->group, at->si.ng, d, at->v.medium), at->v.slot, bounce, true, m, &l);
    } else if (m_any(m)) {
        // As the sensor's rays find it, which do not start above surfaces: where things touch, there is little between them.
        Ray ray = {v3_madd(at->si.p, sight.length, d), v3_neg(d), sight.length - 0.25f * interaction_step(at->si.p)};
        m = rays_open(t, &ray, true, m);
    }
    near_book(in, &sight, l, at->v.slot, bounce, m);
}

// The same of collisions.
static int32_t near_collisions(Indirect *in, int32_t medium, const int32_t *order, int32_t count, int32_t bounce,
                               int32_t next_count) {
    Tracer *t = in->t;
    const PathJob *job = t->job;
    Vertex v = vertex_load(t, order, count, bounce);
    v.m = near_reaches(t, &v);
    if (!m_any(v.m)) {
        return next_count;
    }
    Sight sight = camera_look(in->pinhole, t->scene, t->sensor, v.hit.p, near_lens(in, v.slot));
    Collision c = collision_look(t, medium, &v.hit, v.d);
    Mask m = v.m & sight.valid & m_ge(sight.x, f_set((real)job->x)) & m_lt(sight.x, f_set((real)(job->x + job->width))) &
             m_ge(sight.y, f_set((real)job->y)) & m_lt(sight.y, f_set((real)(job->y + job->height)));
    if (bounce == 0 && in->b->kind == BOUNDARY_RIDING) { // of any direction, only those that are looked for are seen
        Mask sighted = mi_eq(i_gather(in->q.sighted, v.slot), i_set(1));
        m = m & (sighted | mi_eq(i_gather(in->q.lit, v.slot), i_set(1)));
        v.m = v.m & ~sighted;
    }
    Vec3 d = v3_select(m, sight.d, v3_neg(v.d));
    c.backwards = true;
    Spec f = spec_scale(c.albedo, collision_phase(&c, d) * sight.density);
    Spec l = spec_mul(spec_mul(v.beta, f), far_radiance(in, v.slot, v.depth));
    m = m & m_gt(jump_size(l), f_set(0)) & m_finite(spec_sum(l));
    Ray ray = {v.hit.p, d, sight.length * (1.0f - SHADOW_SHORT)};
    m = sight_clear(in->t, &ray, v.medium, v.slot, bounce, true, m, &l);
    near_book(in, &sight, l, v.slot, bounce, m);
    if (in->glimpses && m_any(v.m)) {
        glimpse_connect_air(in, &v, &c, near_lens(in, v.slot), bounce);
    }
    SampleKey key = slot_key(t, v.slot);
    return collision_scatter(t, &v, &c, &key, bounce, v.m, -1, next_count);
}

// Whether particles start at the near points themselves.
KFN bool segments_at_surface(const BoundaryJob *b) { return boundary_is_horizon(b->kind) || b->kind == BOUNDARY_CUT; }

static int32_t near_batch(Indirect *in, const Group *group, const int32_t *order, int32_t count, int32_t bounce,
                          int32_t next_count) {
    const SceneView *scene = in->t->scene;
    Landing at;
    at.v = vertex_load(in->t, order, count, bounce);
    landing_look(in->t, group, &at);
    if (segments_at_surface(in->b) && bounce == 0) {
        at.cosine = f_set(1); // is part of no weight of the segment's
        if (in->b->kind == BOUNDARY_CUT) { // on the side that `factor` says
            at.wl.z = f_copysign(f_set(1e-6f), real_gather(in->q.along, at.v.slot));
        }
    }
    if (scene->through) {
        at.v.m = near_reaches(in->t, &at.v);
    }
    if (!scene->hide_emitters || group->emitter < 0) {
        near_connect(in, &at, bounce);
    }
    if (in->glimpses && m_any(at.v.m)) {
        glimpse_connect(in, &at, near_lens(in, at.v.slot), bounce);
    }
    if (scene->max_depth >= 0 && bounce + 3 > scene->max_depth && !scene->through) {
        return next_count;
    }
    next_count = particle_scatter(in->t, &at, bounce, -1, next_count);
    if (in->upstream) {
        upstream_leave(in->t, &in->q, at.v.slot, bounce, in->b->kind, at.v.m);
    }
    return next_count;
}

// In media, puts particles k... where their flights from the edge have ended.
static void near_place(Tracer *t, const Segments *q, int32_t k) {
    Paths *p = &t->ws.paths[0];
    Mask m = m_first_n(q->count - k);
    Hit hit = LOAD_HIT(q, k, near);
    Int air = i_load(q->air + k), group = air + ((int32_t)t->scene->groups_count + 1);
    hit.shape = i_select(m, hit.shape, i_set(-1));
    hit_store(t, k, &hit);
    i_store(t->ws.hit_group + k, i_select(m & mi_lt(i_set(-1), air), group, i_load(t->ws.hit_group + k)));
    i_store(p->medium + k, i_load(q->around + k));
    spec_store(p->beta, k, spec_load(q->flown, k));
}

// Whether they are there or, without media, are known to meet it, or have passed what they pass on the way to it.
static bool segments_know_near(const Indirect *in) {
    const bool meet = boundary_is_rim(in->b->kind) || (in->t->job->veils && in->b->kind == BOUNDARY_INDIRECT);
    return segments_at_surface(in->b) || (meet && !in->t->scene->has_media);
}

static void near_particles(Indirect *in, int32_t *begin, Sink *sink) {
    Tracer *t = in->t;
    const Segments *q = &in->q;
    uint32_t scramble = t->job->scramble;
    t->job->scramble = rng_mix(scramble, 1); // independent of the far side
    const bool media = t->scene->has_media, known = segments_know_near(in);
    for (int32_t k = 0; k < q->count; k += LANES) {
        Int slot = i_min(i_iota() + k, i_set(q->count - 1));
        Ray ray = {LOAD_V3(*q, ox, oy, oz, slot), v3_neg(LOAD_V3(*q, dx, dy, dz, slot)), f_set(INFINITY)};
        Spec kept = spec_load(t->ws.radiance, k);
        path_begin(t, k, slot, &ray, f_set(1));
        spec_store(t->ws.radiance, k, kept);
        if (media) {
            near_place(t, q, k);
        }
        if (known) {
            Hit hit = LOAD_HIT(q, k, near);
            hit.shape = i_select(m_first_n(q->count - k), hit.shape, i_set(q->near_shape[0]));
            hit_store(t, k, &hit);
        }
    }
    t->active = q->count;
    t->current = 0;
    t->placed = known || media;
    int32_t surfaces = (int32_t)t->scene->groups_count + 1, groups = surfaces + (media ? (int32_t)t->scene->media_count : 0);
    t->lobes = in->upstream ? q->lobe : NULL;
    for (int32_t bounce = 0; t->active > 0 && bounce < MAX_BOUNCES; bounce++) {
        if (!t->placed) {
            if (media) {
                legs_stage(t, (LegDef){.most = MOST_SURFACES_IN_A_ROW, .emission = t->rungs != NULL}, bounce);
            } else {
                trace_stage(t, 1);
            }
        }
        t->placed = false;
        if (in->upstream) {
            upstream_arrive(t, &in->q, bounce, in->b->kind);
            ways_advance(in, bounce, sink);
        }
        if (in->glimpses && in->upstream && in->b->job.mode == MODE_REVERSE) {
            ways_carry(in, bounce);
        }
        sort_stage(t, begin, groups);
        int32_t next_count = 0;
        for (int32_t g = 1; g < groups; g++) {
            for (int32_t k = begin[g]; k < begin[g + 1]; k += LANES) {
                int32_t count = begin[g + 1] - k < LANES ? begin[g + 1] - k : LANES;
                next_count = g >= surfaces
                                 ? near_collisions(in, g - surfaces, t->ws.order + k, count, bounce, next_count)
                                 : near_batch(in, t->scene->groups + g - 1, t->ws.order + k, count, bounce, next_count);
            }
        }
        t->current = 1 - t->current;
        t->active = next_count;
    }
    t->lobes = NULL;
    t->job->scramble = scramble;
}

// Samples first... of a chunk.
static void indirect_chunk(Indirect *in, int64_t first, int32_t count, Sink *sink, int32_t *begin) {
    Tracer *t = in->t;
    Segments *q = &in->q;
    // Collisions near the camera count one over the square of their distance.
    const Vec3 *focus = in->pinhole->parallel ? NULL : &in->pinhole->origin;
    const int32_t lamps = t->lamp_count; // which paths from the far sides look for
    t->lamp_count = 0;
    t->focus = t->job->rides && !boundary_is_chained(in->b->kind) ? NULL : focus; // their near points are surfaces'
    if (in->b->kind == BOUNDARY_INDIRECT) {
        segments_find(t, in->b, first, count, q);
    } else if (in->b->kind == BOUNDARY_MEETING) {
        meetings_find(t, in->b, first, count, q);
    } else if (in->b->kind == BOUNDARY_LINES) {
        lines_find(t, in->b, first, count, q);
    } else if (in->b->kind == BOUNDARY_CHAINED) {
        chained_find(t, in->b, first, count, q);
    } else if (in->b->kind == BOUNDARY_RIDING) {
        ridings_find(t, in->b, in->pinhole, first, count, q);
    } else if (boundary_is_rim(in->b->kind)) {
        rims_find(t, in->b, first, count, q);
    } else {
        turnings_find(t, in->b, first, count, q);
    }
    t->lamp_count = lamps;
    if (q->count == 0) {
        return;
    }
    slot_numbers(t, q, first);
    if (in->upstream) {
        upstream_begin(q);
    }
    for (int32_t k = 0; k < q->count && in->b->job.mode == MODE_FORWARD && !in->upstream; k += LANES) {
        moves_adj(in, k, sink);
    }
    t->focus = NULL;
    far_paths(in, begin);
    t->focus = focus;
    t->lamp_count = 0;
    near_particles(in, begin, sink);
    t->focus = NULL;
    t->lamp_count = lamps;
    for (int32_t k = 0; k < q->count && in->b->job.mode == MODE_REVERSE; k += LANES) {
        moves_adj(in, k, sink);
    }
}
