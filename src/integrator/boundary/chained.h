// chained.h: edges along chains of smooth mirrors and glass that begin at a vertex other than the camera. The
// direction at the vertex before a chain is fixed (path_move.h), so that all of what the chain sees jumps where it
// passes an edge, as the film does: with F = n . (e - r), e the point of the edge and r that of the ray next to it,
//   dI += integral dl dw |w x T| (n . e' - n . r') (L- - L+) W,
// W the importance that comes to the edge. Phase space is what chains preserve, so that dl dw |w x T| is that of the
// vertex before the chain. A segment's near point is that vertex, or it is part of the chain: which one the particle
// that carries the light decides (upstream.h). Where it is that vertex, what jumps is only what the far points mirror
// or refract; all other light of theirs is attached to them (indirect.h).
// Surfaces that let a part of the light pass in its direction are pieces of chains as mirrors are: masks, thin glass.
#pragma once

#include "integrator/boundary/upstream.h"

// What a segment says of its light in `lit`, beside "no" and "from a light": it meets surfaces on both sides of the edge, and
// no segments to lights pass there; or its light is scattered beside a light at a point (beside.h).
enum { SEGMENT_CREASE = 4, SEGMENT_BESIDE = 5 };

// Distance of the two rays from the edge. Where surfaces pass through each other the rays to lights start a step above them, and
// must start on their own side of the other one; so must those in an acute wedge.
KFN Float chained_step(const EdgePoint *e) {
    Float step = (1.0f + f_max(f_max(f_abs(e->p.x), f_abs(e->p.y)), f_abs(e->p.z))) * 1e-5f;
    Float apart = f_select(mi_lt(e->met.shape, i_set(0)), f_set(1), f_set(MEETING_STEPS)); // borders of light hide nothing
    return f_select(e->meeting, apart * interaction_step(e->p), f_max(step, edge_wedge(e)));
}

// The rays past both sides of an edge, from half-way to the near point on: n points to the second one.
KFN Ray chained_ray(Vec3 p, Vec3 d, Vec3 n, Float behind, Float step, int side) {
    Vec3 o = v3_madd(v3_madd(p, behind * -0.5f, d), side ? step : -step, n);
    return (Ray){o, d, f_set(INFINITY)};
}

// Lanes of m from whose near points rays meet the edge between its surfaces.
static Mask chained_between(Tracer *t, const BoundaryJob *b, const Segment *s, Vec3 near, Mask m, Float *behind) {
    const EdgePoint *e = &s->edge;
    *behind = f_select(m, v3_length(v3_sub(near, e->p)), f_set(1));
    Float step = chained_step(e);
    Ray rays[2] = {chained_ray(e->p, s->d, s->n, *behind, step, 0), chained_ray(e->p, s->d, s->n, *behind, step, 1)};
    return edge_between(t, b, e, false, s->silhouette, s->n, rays, m);
}

// Stores the segments of m, in any direction. Where surfaces pass through each other, the edge moves with both (meeting.h): `far`
// is on the other one, or its prim is the light whose border passes, else -1; and beside n = x a + y b there is y b.
static void chained_keep(const Segment *s, Vec3 o, const Hit *near, Float behind, Int number, Segments *q, Mask m) {
    const EdgePoint *e = &s->edge;
    int32_t at = q->count;
    Float y = part_along(s->n, e->across[1], e->across[0]);
    Vec3 other = v3_select(e->meeting, v3_scale(e->across[1], -s->weight * y), v3_zero());
    v3_compress(q->ox + at, q->oy + at, q->oz + at, o, m);
    v3_compress(q->dx + at, q->dy + at, q->dz + at, s->d, m);
    v3_compress(q->nx + at, q->ny + at, q->nz + at, v3_scale(s->n, -s->weight), m);
    v3_compress(q->mx + at, q->my + at, q->mz + at, other, m);
    f_compress(q->behind + at, behind, m);
    f_compress(q->apart + at, chained_step(e), m);
    spec_compress(q->light, at, s->light, m);
    i_compress(q->lit + at, i_select(s->silhouette, i_set(0), i_set(SEGMENT_CREASE)), m);
    i_compress(q->source + at, i_set(-1), m);
    i_compress(q->number + at, number, m);
    f_compress(q->along + at, f_set(0), m);
    Hit none = *near;
    none.shape = none.prim = i_set(-1);
    Hit far = hit_select(e->meeting, &e->met, &none);
    KEEP_HIT(q, at, near, near, near->p, m);
    KEEP_HIT(q, at, edge, &e->hit, e->p, m);
    KEEP_HIT(q, at, far, &far, e->p, m);
    q->count += m_count(m);
}

// Finds the near points of segments in any direction, and keeps those that meet the edge between its surfaces.
static void chained_trace(Tracer *t, const BoundaryJob *b, const Segment *s, Int number, Segments *q) {
    Vec3 o = segment_before(s, segment_offset(s));
    Ray back = {o, v3_neg(s->d), f_set(INFINITY)};
    t->job->rays += m_count(s->m);
    Hit near = trace_closest(t->scene, &back, s->m, false);
    Mask m = s->m & mi_lt(i_set(-1), near.shape);
    if (m_any(m)) {
        Float behind;
        m = chained_between(t, b, s, near.p, m, &behind);
        chained_keep(s, o, &near, behind, number, q, m);
    }
}

// As segments_find. No chain ends on a light at a point or of one direction.
static void chained_find(Tracer *t, const BoundaryJob *b, int64_t first, int32_t count, Segments *q) {
    q->count = 0;
    for (int32_t i = 0; i < count; i += LANES) {
        SegmentTurn turn = segment_turn(t, b->kind, first + i);
        if (!turn.indirect) {
            return;
        }
        batch_numbers(t, i, first);
        Segment s;
        segment_sample(t, b, i_iota() + i, turn.lit, turn.share, m_first_n(count - i), &s);
        s.m = s.m & mi_lt(s.source, i_set(0));
        if (m_any(s.m) && turn.lit) {
            segment_trace(t, &s, true, i_iota() + i, q);
        } else if (m_any(s.m)) {
            chained_trace(t, b, &s, i_iota() + i, q);
        }
    }
    // The far points lie where the rays meet their surfaces.
    memset(q->along, 0, (size_t)q->count * sizeof(real));
}

// Starts the paths on both sides of the edges, in slots k and half + k.
static void chained_start(Tracer *t, const Segments *q, int32_t half) {
    segment_pairs(t, q, half);
    for (int32_t k = 0; k < half; k += LANES) {
        Int at = i_min(i_iota() + k, i_set(q->count - 1));
        Vec3 p = LOAD_V3(*q, edge_x, edge_y, edge_z, at), d = LOAD_V3(*q, dx, dy, dz, at);
        Vec3 n = v3_normalize(v3_neg(LOAD_V3(*q, nx, ny, nz, at)));
        Int lit = i_gather(q->lit, at);
        Mask m = m_first_n(q->count - k) & ~(mi_eq(lit, i_set(1)) | mi_eq(lit, i_set(SEGMENT_BESIDE)));
        Float step = real_gather(q->apart, at);
        for (int side = 0; side < 2; side++) { // first the side that n points to
            Ray ray = chained_ray(p, d, n, real_gather(q->behind, at), step, 1 - side);
            ray.tmax = f_zero_unless(m, ray.tmax);
            path_begin(t, side * half + k, i_iota() + (side * half + k), &ray, f_set(1));
            if (t->scene->has_media) { // what lies before the edge is on both sides the same
                f_store(t->ws.paths[0].skip + (side * half + k), real_gather(q->behind, at) * -0.5f);
                i_store(t->ws.paths[0].medium + (side * half + k), i_gather(q->medium, at));
            }
        }
    }
    t->active = 2 * half;
}
