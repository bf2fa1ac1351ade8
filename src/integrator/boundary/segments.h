// segments.h: boundary segments (segment.h) that are traced: what they begin at, and what comes along them.
#pragma once

#include "integrator/boundary/segment.h"
#include "integrator/boundary/veils.h"
#include "integrator/leg.h"

// The ray from the edge to the light or far point.
KFN Vec3 segment_offset(const Segment *s) {
    Vec3 p = s->edge.p;
    Float step = interaction_step(p);
    return v3_madd(p, step, s->n);
}

// Where rays from the edge towards what sees it begin: beside silhouettes, at o, and before edges between two faces that see it.
KFN Vec3 segment_before(const Segment *s, Vec3 o) {
    return v3_select(s->silhouette, o, v3_madd(s->edge.p, -4.0f * interaction_step(s->edge.p), s->d));
}

// And a direction from there that does not lead between those faces, where rays slip through.
KFN Vec3 segment_aside(const Segment *s) { return v3_select(s->silhouette, s->d, v3_neg(s->d)); }

// segment_offset of an edge that stands on another surface: beside it, the ray would begin behind that, where it lies between the
// edge and the viewer. It begins in front of it.
static Vec3 segment_stand(Tracer *t, const Segment *s, Vec3 o) {
    Vec3 p = s->edge.p, n;
    Float step = interaction_step(p);
    Ray back = {o, v3_neg(s->d), 32.0f * step};
    Hit met = trace_solid(t, &back, false, s->m, NULL);
    Mask m = s->m & mi_lt(i_set(-1), met.shape);
    m = m & ~(mi_eq(met.shape, s->edge.hit.shape) & mi_eq(met.instance, s->edge.hit.instance));
    if (!m_any(m)) {
        return o;
    }
    point_hit(t->scene, i_select(m, met.shape, i_set(-1)), i_select(m, met.prim, i_set(0)), met.instance, met.p, &n);
    Float rises[2] = {v3_dot(s->edge.side[0], n), v3_dot(s->edge.side[1], n)};
    Float above = f_select(m_lt(f_abs(rises[0]), f_abs(rises[1])), rises[1], rises[0]);
    m = m & m_lt(v3_dot(s->d, n) * above, f_set(0));
    return v3_select(m, v3_madd(met.p, -2.0f * step, s->d), o);
}

// The ray from o, beside the edge, to the light's point that the segment ends on: a step to the side in the same direction would
// lead into a light that is seen at a grazing angle.
static Ray segment_ahead(const Segment *s, Vec3 o) {
    Mask ends = m_lt(s->distance, f_set(INFINITY));
    Vec3 to = v3_sub(v3_madd(s->edge.p, f_select(ends, s->distance, f_set(1)), s->d), o);
    Float length = v3_length(to);
    return (Ray){o, v3_select(ends, v3_scale(to, f_safe_rcp(length)), s->d),
                 f_select(ends, length * (1.0f - SHADOW_SHORT), f_set(INFINITY))};
}

// In media, fog may have no end: lights beyond the scene are as far from near points, `behind` the edge, as shadow rays from there
// take them to be.
static Ray segment_reach(const Tracer *t, const Segment *s, Vec3 o, Float behind) {
    Ray ahead = segment_ahead(s, o);
    Float far = f_set((2 - 2 * SHADOW_SHORT) * (real)t->scene->bounds_radius) - behind;
    ahead.tmax = f_select(m_lt(s->distance, f_set(INFINITY)) | m_set(!t->scene->has_media), ahead.tmax, f_max(far, f_set(0)));
    return ahead;
}

// Lanes of m whose lights shine through masks and thin glass.
KFN Mask segment_unveiled(const Tracer *t, const Segment *s, Mask m) {
    return m & m_set(t->job->veils) & mi_lt(i_set(-1), s->source);
}

// Lanes of m whose edge's own surface lies on one side of it, and is no mesh that meets itself there in more than two triangles.
static Mask segment_folds(const Segment *s, Mask m) {
    const EdgePoint *e = &s->edge;
    const Mask alone = mi_eq(e->fan_count, i_set(0)) & mi_eq(e->side_count, i_set(0)) & ~e->mark & s->silhouette;
    Mask faces = ~e->open & mi_lt(i_set(-1), e->other), level = m_le(f_abs(edge_rise(e, e->side[0], s->n)), f_set(0));
    level = level | (faces & m_le(f_abs(edge_rise(e, e->side[1], s->n)), f_set(0)));
    return m & alone & ~level & (e->open | faces);
}

// What the edge's surface lets through a step from it, in its triangle `prim` on the side of `side`. Textures may jump at the end.
static Spec segment_share(Tracer *t, const Segment *s, Int prim, Vec3 side, Mask m) {
    const EdgePoint *e = &s->edge;
    Float inward = f_zero_unless(~e->round, interaction_step(e->p) * f_safe_rcp(v3_length(side)));
    Vec3 p = v3_madd(e->p, inward, side), n, past = p;
    Mask may;
    Hit hit = point_hit(t->scene, i_select(m, e->hit.shape, i_set(-1)), prim, e->hit.instance, p, &n);
    return walk_pass(t, &hit, s->d, m_set(false), m, &past, &may, NULL);
}

// In lanes of m of those: what their surface lets through there. Rays that touch an outline pass both of its sides.
static Spec segment_folded(Tracer *t, const Segment *s, Mask m) {
    const EdgePoint *e = &s->edge;
    Mask faces = m & ~e->open, both = m & e->round & m_le(v3_dot(e->outside, e->outside), f_set(0));
    Spec share = segment_share(t, s, e->hit.prim, e->side[0], m), second = share;
    if (m_any(faces)) {
        second = spec_select(faces, segment_share(t, s, i_max(e->other, i_set(0)), e->side[1], faces), second);
    }
    return spec_select(faces | both, spec_mul(share, second), share);
}

// What comes through the points beside lines along which a surface's share jumps, from the side that s->n points to less from the
// other one.
static Spec segment_mark_jump(Tracer *t, const Segment *s, Int around, Float behind, Int number, Mask m) {
    Mask may;
    Vec3 past = s->edge.p;
    Int beyond = around;
    Spec first = walk_pass(t, &s->edge.beside[0], s->d, m_set(false), m, &past, &may, NULL);
    Spec second = walk_pass(t, &s->edge.beside[1], s->d, m_set(false), m, &past, &may, t->scene->has_media ? &beyond : NULL);
    Spec through = veils_past(t, segment_reach(t, s, past, behind), f_set(0), beyond, number, m);
    return spec_mul(spec_sub(second, first), through); // s->n points away from edge.side[0]
}

// In lanes of m of those: what comes past the edge from the side where o lies less what comes on the other one. Where it can, this
// asks the edge's own surface what it lets through: lines and outlines of round surfaces may be tangents, and rays to either side
// of one pass the other, too. Other rays begin half-way between the edge and what is behind it, where surfaces that end at the
// edge are met by the second one alone.
static Spec segment_jump(Tracer *t, const Segment *s, Vec3 o, Int around, Float behind, Int number, Mask m) {
    Mask marks = m & s->edge.mark, folds = segment_folds(s, m);
    Spec marked = m_any(marks) ? segment_mark_jump(t, s, around, behind, number, marks) : spec_zero();
    m = m & ~marks;
    if (!m_any(m)) {
        return marked;
    }
    Ray back = {segment_before(s, o), v3_neg(s->d), f_set(INFINITY)};
    Hit first = trace_media(t, &back, m, false);
    t->job->rays += m_count(m);
    Float half = f_set(0.5f) * v3_length(v3_sub(first.p, o)), step = interaction_step(s->edge.p);
    half = f_select(m & mi_lt(i_set(-1), first.shape), half, f_set(0.5f * (real)t->scene->bounds_radius));
    Vec3 from = v3_madd(o, -half, s->d);
    Spec beside = veils_past(t, segment_reach(t, s, from, behind - half), half, around, number, m), jump = spec_zero();
    if (m_any(folds)) {
        jump = spec_mul(beside, spec_sub(spec_set(f_set(1)), segment_folded(t, s, folds)));
    }
    Mask rest = m & ~folds;
    if (m_any(rest)) {
        Ray ray = segment_reach(t, s, v3_madd(from, -2.0f * step, s->n), behind - half);
        jump = spec_select(rest, spec_sub(beside, veils_past(t, ray, half, around, number, rest)), jump);
    }
    return spec_select(marks, marked, jump);
}

// Lanes of m in which what was found against d is seen along d, too: tubes stop rays from outside alone.
static Mask segment_forwards(Tracer *t, Vec3 o, Vec3 near, Vec3 d, Mask m) {
    Float step = interaction_step(near);
    Ray ray = {v3_madd(near, step, d), d, v3_dot(v3_sub(o, near), d) - 2.0f * step};
    Mask far = m & m_gt(ray.tmax, f_set(0));
    t->job->rays += m_count(far);
    return (m & ~far) | (far & m_gt(spec_max(trace_transmittance(t->scene, &ray, far)), f_set(0)));
}

// Lanes of m in which rays from the near point pass the edge: they start a step above their surface, behind what hangs closer
// before it, as a poster does before a wall. What stands on the surface is left to segment_stand.
static Mask segment_clears(const Tracer *t, const Segment *s, const Hit *near, Mask m) {
    Float step = interaction_step(near->p);
    Vec3 n, to = v3_sub(s->edge.p, near->p);
    Mask close = m & m_lt(v3_dot(to, to), (64.0f * step) * (64.0f * step));
    Int shape = i_select(close, near->shape, i_set(-1));
    if (!m_any(close)) {
        return m;
    }
    point_hit(t->scene, shape, i_select(close, near->prim, i_set(0)), near->instance, near->p, &n);
    Float height = f_abs(v3_dot(to, n));
    return m & ~(close & m_lt(height, step) & m_gt(height, 0.02f * step));
}

// Without media, lanes of m whose light arrives at o, or comes to one side of the edge alone: weighs it with the difference.
static Mask segment_lit(Tracer *t, Segment *s, Vec3 o, Int number, Mask m) {
    Mask unveiled = segment_unveiled(t, s, m), lit = m & ~unveiled;
    Ray ahead = segment_ahead(s, o);
    t->job->rays += m_count(lit);
    lit = lit & m_gt(spec_max(trace_transmittance(t->scene, &ahead, lit)), f_set(0));
    if (m_any(unveiled)) {
        Spec jump = segment_jump(t, s, o, i_set(-1), f_set(0), number, unveiled);
        s->light = spec_select(unveiled, spec_mul(s->light, jump), s->light);
        lit = lit | (unveiled & m_gt(jump_size(jump), f_set(0)));
    }
    return lit;
}

// Without media, what the rays of m back from the edge end at. Where shadow rays pass what is there, too, it is one of the points
// from which these come, `back` begins behind what they pass on the way, and the light is weighed with that.
static Hit segment_near(Tracer *t, Segment *s, Int number, Mask m, Ray *back) {
    Mask unveiled = segment_unveiled(t, s, m), plain = m & ~unveiled;
    t->job->rays += m_count(plain);
    Hit near = trace_closest(t->scene, back, plain, false);
    if (m_any(unveiled)) {
        SampleKey key = slot_key(t, number);
        Float chance;
        Spec pass;
        Hit met = veils_meet(t, back, &key, &chance, &pass, unveiled);
        near = hit_select(unveiled, &met, &near);
        s->light = spec_select(unveiled, spec_scale(spec_mul(s->light, pass), chance), s->light);
    }
    return near;
}

// Traces both halves and keeps the segments that have ends.
static void segment_trace(Tracer *t, Segment *s, bool lit, Int number, Segments *q) {
    Vec3 o = segment_stand(t, s, segment_offset(s));
    Ray ahead = {o, s->d, f_set(INFINITY)}, back = {segment_before(s, o), v3_neg(s->d), f_set(INFINITY)};
    Mask m = s->m;
    if (lit) {
        m = segment_lit(t, s, o, number, m);
    } else {
        t->job->rays += m_count(m);
        s->far = trace_closest(t->scene, &ahead, m, false);
        s->attached = m & mi_lt(i_set(-1), s->far.shape);
        m = s->attached;
    }
    if (!m_any(m)) {
        return;
    }
    Hit near = segment_near(t, s, number, m, &back);
    m = m & mi_lt(i_set(-1), near.shape);
    if (t->scene->segments_count && m_any(m)) {
        m = segment_forwards(t, back.o, near.p, s->d, m);
    }
    m = segment_clears(t, s, &near, m);
    segment_keep(s, o, &near, lit, number, q, m);
}

// In media, lanes of m whose light arrives at o, in the medium `around`: weighs it with what the way there lets through.
static Mask segment_shine(Tracer *t, Segment *s, Vec3 o, Int around, Float behind, Int number, Mask m) {
    Fog fog = {around, stream_key(t, number, 0, STREAM_SHADOW), false, f_set(0)};
    Mask blocked, unveiled = segment_unveiled(t, s, m);
    Spec through = walk_transmittance(t, segment_reach(t, s, o, behind), m_set(true), m & ~unveiled, &fog, &blocked, NULL);
    if (m_any(unveiled)) {
        through = spec_select(unveiled, segment_jump(t, s, o, around, behind, number, unveiled), through);
    }
    s->light = spec_mul(s->light, through);
    return m & m_gt(jump_size(through), f_set(0));
}

// Keeps where the flights of m from the edge, in `medium`, have ended, of segments that are stored next.
KFN void segment_keep_leg(Int medium, const Leg *leg, Segments *q, Mask m) {
    i_compress(q->medium + q->count, medium, m);
    i_compress(q->air + q->count, leg->air, m);
    i_compress(q->around + q->count, leg->around, m);
    spec_compress(q->flown, q->count, leg->weight, m);
}

// As segment_trace in media. Where surfaces move, what collisions see of edges is another kind (riding.h).
static void segment_fly(Tracer *t, Segment *s, bool lit, Int number, Segments *q) {
    const bool rides = t->job->rides;
    Vec3 o = rides ? segment_stand(t, s, segment_offset(s)) : segment_offset(s), before = segment_before(s, o);
    Int around = medium_around(t, before, segment_aside(s), s->m);
    Mask m = s->m;
    if (!lit) {
        Ray ahead = {o, s->d, f_set(INFINITY)};
        s->far = trace_solid(t, &ahead, false, m, NULL);
        m = s->attached = m & mi_lt(i_set(-1), s->far.shape);
    }
    if (!m_any(m)) {
        return;
    }
    SampleKey key = stream_key(t, number, 0, STREAM_PROBE);
    Ray back = {before, v3_neg(s->d), f_set(INFINITY)};
    Leg leg = leg_trace(t, back, before, around, &key, segment_unveiled(t, s, m), m);
    m = rides ? leg.m & mi_lt(leg.air, i_set(0)) : leg.m;
    if (lit && m_any(m)) {
        m = segment_shine(t, s, o, around, v3_length(v3_sub(leg.near.p, o)), number, m);
    }
    segment_keep_leg(around, &leg, q, m);
    segment_keep(s, o, &leg.near, lit, number, q, m);
}

// Samples numbers first... of a chunk and keeps the segments among them.
static void segments_find(Tracer *t, const BoundaryJob *b, int64_t first, int32_t count, Segments *q) {
    q->count = 0;
    for (int32_t i = 0; i < count; i += LANES) {
        SegmentTurn turn = segment_turn(t, b->kind, first + i);
        if (!turn.lit && !turn.indirect) {
            return;
        }
        batch_numbers(t, i, first);
        Segment s;
        segment_sample(t, b, i_iota() + i, turn.lit, turn.share, m_first_n(count - i), &s);
        if (m_any(s.m) && t->scene->has_media) {
            segment_fly(t, &s, turn.lit, i_iota() + i, q);
        } else if (m_any(s.m)) {
            segment_trace(t, &s, turn.lit, i_iota() + i, q);
        }
    }
}
