// glimpse.h: vertices of particles that the sensor sees in smooth mirrors and through smooth glass. No particle finds a
// pinhole by way of a mirror: lines of sight from random film positions are bent until they meet the vertex, by Newton's
// method [zeltner2020]. There may be several, of which one film position leads to one at most: the probability that any leads
// to it is estimated by trying others, which takes one over it on average.
// The vertex slides along the line, because the film position is fixed, and its motion goes back to the sensor with that of
// the ray (upstream.h).
#pragma once

#include "integrator/boundary/far.h"
#include "integrator/boundary/sightline.h"

#define DIMENSION_GLIMPSE 0x80002000u
#define GLIMPSE_SAME 0.02f // pixels between lines that are the same one

enum { MOST_STEPS = 24, MOST_GLIMPSES = 16384 };

// A line of sight of which the first `turns` vertices lead to a point.
typedef struct Glimpse {
    Sightline line;
    Int turns;
    Float x, y;
    Vec3 o, d;     // its last piece
    Float density; // pixels per area of a facing surface at the point
    Mask m;
} Glimpse;

// What its vertices let through.
static Spec glimpse_through(const Glimpse *g) {
    Spec through = spec_zero();
    for (int32_t i = 1; i < g->line.last; i++) {
        through = spec_select(mi_eq(g->turns, i_set(i)), g->line.through[i], through);
    }
    return through;
}

// Where the last piece begins, and how far it passes the point: a vector across it.
static Vec3 glimpse_end(const Sightline *s, Int turns, Vec3 target, Vec3 *o, Vec3 *d, Mask *ahead) {
    *o = v3_zero();
    *d = v3(f_set(0), f_set(0), f_set(1));
    for (int32_t i = 1; i < s->last; i++) {
        Mask here = mi_eq(turns, i_set(i));
        *o = v3_select(here, s->o[i], *o);
        *d = v3_select(here, s->d[i], *d);
    }
    Vec3 to = v3_sub(target, *o);
    Float along = v3_dot(to, *d);
    *ahead = m_gt(along, f_set(0));
    return v3_madd(to, -along, *d);
}

// Lanes of m whose lines take the same way over their first `turns` vertices.
static Mask glimpse_alike(const Sightline *a, const Sightline *b, Int turns, Mask m) {
    m = m & ~mi_lt(b->turns, turns);
    for (int32_t i = 0; i < a->last && i < b->last; i++) {
        Mask same = mi_eq(a->hit[i].shape, b->hit[i].shape) & mi_eq(a->hit[i].instance, b->hit[i].instance) &
                    mi_eq(a->behind[i], b->behind[i]) & mi_eq(a->lobe[i], b->lobe[i]);
        m = m & (same | ~mi_lt(i_set(i), turns));
    }
    return m;
}

// How the place where the line passes the point moves with the film position, by the rows of a matrix: along two vectors.
static void glimpse_slope(const Tracer *t, const Glimpse *g, Vec2 lens, Vec3 target, const Frame *across, Sink *still, Mask m,
                          Vec2 rows[2]) {
    for (int k = 0; k < 2; k++) {
        const Carried end = {k ? across->t : across->s, v3_zero()};
        Carried c = sightline_back(t, &g->line, g->turns, target, &end, still, m);
        rows[k] = film_adj(t, g->x, g->y, lens, g->line.hit[0].p, &c);
    }
}

// Bends the line from a film position until it meets the point.
static NOINLINE void glimpse_seek(Tracer *t, const SampleKey *key, Vec2 lens, Vec2 film, Float stop, Vec3 target, Sink *still,
                                  Mask m, Glimpse *g) {
    Sightline next;
    Mask ahead;
    sightline_trace(t, key, lens, film.x, film.y, m, &g->line);
    Float turns = f_from_i(g->line.turns), other = 1.0f + f_floor(f_min((4.0f * stop - 3.0f), f_set((real)0.999)) * turns);
    g->turns = i_from_f(f_select(m_lt(stop, f_set((real)0.75)), turns, other));
    g->x = film.x;
    g->y = film.y;
    m = m & mi_lt(i_set(0), g->line.turns);
    Vec3 off = glimpse_end(&g->line, g->turns, target, &g->o, &g->d, &ahead);
    m = m & ahead;
    Float scale = f_set(1), least = (1.0f + f_max(f_max(f_abs(target.x), f_abs(target.y)), f_abs(target.z))) * 2e-5f;
    g->m = m_set(false);
    g->density = f_set(0);
    for (int step = 0; step < MOST_STEPS && m_any(m); step++) {
        Frame across = frame_from_normal(g->d);
        Vec2 rows[2];
        glimpse_slope(t, g, lens, target, &across, still, m, rows);
        Float det = rows[0].x * rows[1].y - rows[0].y * rows[1].x, rcp = f_safe_rcp(det);
        Mask there = m & m_lt(v3_dot(off, off), least * least) & m_gt(f_abs(det), f_set(0));
        g->density = f_select(there, f_abs(rcp), g->density);
        g->m = g->m | there;
        m = m & ~there & m_gt(f_abs(det), f_set(0)) & m_gt(scale, f_set((real)1e-4));
        if (!m_any(m)) {
            return;
        }
        Float a = v3_dot(off, across.s), b = v3_dot(off, across.t), factor = scale * rcp;
        Float x = g->x + factor * (a * rows[1].y - b * rows[0].y), y = g->y + factor * (b * rows[0].x - a * rows[1].x);
        m = m & m_finite(x + y);
        Vec3 o, d;
        sightline_trace(t, key, lens, x, y, m, &next);
        Mask moved = glimpse_alike(&g->line, &next, g->turns, m);
        Vec3 left = glimpse_end(&next, g->turns, target, &o, &d, &ahead);
        moved = moved & ahead & m_lt(v3_dot(left, left), v3_dot(off, off));
        sightline_take(&g->line, &next, moved);
        g->x = f_select(moved, x, g->x);
        g->y = f_select(moved, y, g->y);
        g->o = v3_select(moved, o, g->o);
        g->d = v3_select(moved, d, g->d);
        off = v3_select(moved, left, off);
        scale = f_select(moved, f_min(2.0f * scale, f_set(1)), 0.25f * scale);
    }
}

// The line from a random film position.
static void glimpse_try(const Indirect *in, const SampleKey *key, Vec2 lens, int32_t number, Vec3 target, Sink *still, Mask m,
                        Glimpse *g) {
    const PathJob *job = in->t->job;
    uint32_t first = DIMENSION_GLIMPSE + 2 * (uint32_t)number;
    Vec2 u = rng_2d(key, first);
    Vec2 film = {(real)job->x + u.x * (real)job->width, (real)job->y + u.y * (real)job->height};
    glimpse_seek(in->t, key, lens, film, rng_1d(key, first + 1), target, still, m, g);
}

// How many film positions it takes until one leads to the same line; 0: none does.
static Float glimpse_again(const Indirect *in, const SampleKey *key, Vec2 lens, Vec3 target, const Glimpse *found, Sink *still) {
    Float count = f_set(0);
    Mask left = found->m;
    for (int32_t n = 1; n <= MOST_GLIMPSES && m_any(left); n++) {
        Glimpse g;
        glimpse_try(in, key, lens, n, target, still, left, &g);
        Float dx = g.x - found->x, dy = g.y - found->y;
        Mask again = left & g.m & mi_eq(g.turns, found->turns) & m_lt(dx * dx + dy * dy, f_set(GLIMPSE_SAME * GLIMPSE_SAME));
        count = f_select(again, f_set((real)n), count);
        left = left & ~again;
    }
    return count;
}

// A vertex of a particle that lines of sight are to lead to: on a surface, or a collision.
typedef struct Glimpsed {
    const Hit *hit;
    Int slot, depth;
    Vec3 p;
    bool air;
} Glimpsed;

// Adds what the motion of vertices at the ends of these lines is worth, drag: the adjoint of where the segment's line is there.
// Collisions lie at fixed distances on the lines.
static void glimpse_move_adj(const Tracer *t, const Glimpse *g, const Glimpsed *at, Vec3 drag, Vec2 lens, Sink *sink, Mask m) {
    const Hit *hit = at->hit;
    const Carried end = {at->air ? drag : rays_meet_adj(t, hit, g->d, drag, sink, m), v3_zero()};
    Carried c = sightline_back(t, &g->line, g->turns, hit->p, &end, sink, m);
    if (sink->any_camera) {
        RayAdj adj = {g->line.hit[0].p, c.drag, c.turn};
        sensor_ray_adj(t->scene, t->sensor, g->x, g->y, lens, &adj, sink, m);
    }
}

// What the vertices bring to the derivative, as near_book does.
static void glimpse_book(Indirect *in, const Glimpse *g, const Glimpsed *at, Spec l, Vec2 lens, int32_t bounce, Mask m) {
    Tracer *t = in->t;
    Segments *q = &in->q;
    const bool forward = in->b->job.mode == MODE_FORWARD;
    Int slot = at->slot;
    Mask slides = in->upstream ? m & mi_eq(i_gather(q->arrived, slot), i_set(UPSTREAM_RAY)) : m_set(false);
    Vec3 drag = v3_select(slides, LOAD_V3(*q, dragx, dragy, dragz, slot), v3_zero());
    real rate[LANES];
    if (forward && in->upstream) {
        in->sink->derivative = f_set(0);
        glimpse_move_adj(t, g, at, drag, lens, in->sink, slides);
        f_store(rate, real_gather(q->rate, slot) + in->sink->derivative);
        in->sink->derivative = f_set(0);
    }
    Float worth = f_set(0);
    for (uint32_t bits = m_bits(m); bits; bits &= bits - 1) {
        int lane = __builtin_ctz(bits);
        int32_t k = i_lane(slot, lane);
        bool sliding = in->upstream && q->arrived[k] == UPSTREAM_RAY;
        real *row = !in->upstream ? q->unseen : sliding ? q->up[bounce].passed : upstream_row(q, k, bounce);
        double x = (double)f_lane(g->x, lane), y = (double)f_lane(g->y, lane), rgb[SPEC_N];
        float delta[SPEC_N], own = 0;
        if (!row) {
            continue;
        }
        if (forward) {
            for (int c = 0; c < SPEC_N; c++) {
                rgb[c] = (double)f_lane(l.c[c], lane) * (double)(sliding ? rate[lane] : row[k]);
            }
            particle_splat(t, x, y, rgb);
            continue;
        }
        film_worth(t->sensor, in->filter, in->b->job.adjoint, (float)x, (float)y, (int32_t)floor(x), (int32_t)floor(y),
                   delta);
        for (int c = 0; c < SPEC_N; c++) {
            own += delta[c] * in->b->scale * f_lane(l.c[c], lane);
        }
        row[k] += own;
        worth = f_select(mi_eq(i_iota(), i_set(lane)), f_set(own), worth);
    }
    if (!forward && m_any(slides)) {
        Mask finite = slides & m_finite(worth);
        glimpse_move_adj(t, g, at, v3_scale(drag, f_zero_unless(finite, worth)), lens, in->sink, finite);
    }
}

// What reaches vertices along segments, where lines of sight with so many further vertices lead to them.
static Spec glimpse_radiance(const Indirect *in, const Glimpsed *at, const Glimpse *g) {
    Spec l = spec_zero();
    for (int32_t i = 1; i < g->line.last; i++) {
        Int depth = at->depth + g->line.depth[i];
        Mask mine = g->m & mi_eq(g->turns, i_set(i)) & depth_allows(in->t->scene, depth + 2);
        l = m_any(mine) ? spec_select(mine, far_radiance(in, at->slot, depth), l) : l;
    }
    return l;
}

// A line from a random film position that leads to the vertices of m. *back: the direction from them to its last mirror, whose
// distance it returns.
static Float glimpse_find(Indirect *in, const SampleKey *key, const Glimpsed *at, Vec2 lens, Sink *still, Mask m, Glimpse *g,
                          Vec3 *back) {
    const PathJob *job = in->t->job;
    m = in->upstream ? m & mi_lt(i_set(UPSTREAM_NONE), i_gather(in->q.arrived, at->slot)) : m;
    glimpse_try(in, key, lens, 0, at->p, still, m, g);
    g->m = g->m & m_ge(g->x, f_set((real)job->x)) & m_lt(g->x, f_set((real)(job->x + job->width))) &
           m_ge(g->y, f_set((real)job->y)) & m_lt(g->y, f_set((real)(job->y + job->height)));
    Vec3 to = v3_sub(g->o, at->p);
    Float length = v3_length(to);
    *back = v3_select(g->m, v3_scale(to, f_safe_rcp(length)), v3(f_set(0), f_set(0), f_set(1)));
    return length;
}

// Books what the vertices bring along these lines, f: what they scatter along them times what has come so far. The last pieces are
// `ray`, in `medium`.
static void glimpse_bring(Indirect *in, const SampleKey *key, Glimpse *g, const Glimpsed *at, const Ray *ray, Int medium, Spec f,
                          Vec2 lens, Sink *still, int32_t bounce) {
    Tracer *t = in->t;
    Spec l = spec_scale(spec_mul(f, glimpse_through(g)), g->density);
    l = spec_mul(l, glimpse_radiance(in, at, g));
    g->m = g->m & m_gt(jump_size(l), f_set(0)) & m_finite(spec_sum(l));
    if (!m_any(g->m)) {
        return;
    }
    if (t->scene->has_media) {
        g->m = sight_clear(t, ray, medium, at->slot, bounce + MAX_BOUNCES, false, g->m, &l);
        l = sightline_clear(t, &g->line, g->turns, at->slot, bounce + 1, g->m, l);
    } else {
        g->m = particle_open(t, ray, false, g->m);
    }
    if (m_any(g->m)) {
        l = spec_scale(l, glimpse_again(in, key, lens, at->p, g, still));
        glimpse_book(in, g, at, l, lens, bounce, g->m & m_gt(spec_max(spec_mul(l, l)), f_set(0)));
    }
}

// Random numbers of the lines that lead to vertices of a bounce.
KFN SampleKey glimpse_key(const Tracer *t, Int slot, int32_t bounce) {
    SampleKey key = slot_key(t, slot);
    key.scramble = rng_mix(key.scramble, 2 + (uint32_t)bounce);
    return key;
}

// Connects vertices to the sensor along chains of smooth mirrors and glass.
static NOINLINE void glimpse_connect(Indirect *in, const Landing *at, Vec2 lens, int32_t bounce) {
    Tracer *t = in->t;
    if (!t->scene->bsdfs[at->call.node].spreads) {
        return;
    }
    SampleKey key = glimpse_key(t, at->v.slot, bounce);
    Sink still = sink_of(in->b->still);
    const Glimpsed seen = {&at->v.hit, at->v.slot, at->v.depth, at->si.p, false};
    Glimpse g;
    Vec3 d;
    Float length = glimpse_find(in, &key, &seen, lens, &still, at->v.m & m_gt(at->cosine, f_set(0)), &g, &d);
    if (!m_any(g.m)) {
        return;
    }
    Spec f = bsdf_eval(&at->call, frame_to_local(&at->si.sh, d), at->wl, i_set(LOBE_SMOOTH));
    f = spec_scale(spec_mul(at->v.beta, f), f_abs(v3_dot(at->si.ng, d)) * f_safe_rcp(at->cosine));
    Ray ray;
    shadow_ray(&at->si, d, length, &ray);
    Int medium = t->scene->has_media ? medium_behind(at->group, at->si.ng, d, at->v.medium) : i_set(-1);
    glimpse_bring(in, &key, &g, &seen, &ray, medium, f, lens, &still, bounce);
}

// The same of collisions.
static NOINLINE void glimpse_connect_air(Indirect *in, const Vertex *v, const Collision *c, Vec2 lens, int32_t bounce) {
    SampleKey key = glimpse_key(in->t, v->slot, bounce);
    Sink still = sink_of(in->b->still);
    const Glimpsed seen = {&v->hit, v->slot, v->depth, v->hit.p, true};
    Glimpse g;
    Vec3 d;
    Float length = glimpse_find(in, &key, &seen, lens, &still, v->m, &g, &d);
    if (m_any(g.m)) {
        Spec f = spec_mul(v->beta, spec_scale(c->albedo, collision_phase(c, d)));
        Ray ray = {v->hit.p, d, length * (1.0f - SHADOW_SHORT)};
        glimpse_bring(in, &key, &g, &seen, &ray, v->medium, f, lens, &still, bounce);
    }
}
