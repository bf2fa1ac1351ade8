// segments_move.h: the motion of boundary segments: of the points that they join or touch, of the directions in which normals
// there are at right angles to them, and of the ways that lead from their near points on to the sensor (upstream.h). Forward mode
// leaves in the segments' records at what rate what a vertex brings changes; reverse mode takes from there what all that it has
// brought is worth.
#pragma once

#include "integrator/boundary/slide.h"

// The share of the near points in the motion of the segments k..., after that of everything else.
static void segments_near_adj(Indirect *in, int32_t k, const Hit *near, Vec3 dnear, Float seen, Float unseen, Sink *sink, Mask m) {
    const Segments *q = &in->q;
    Vec2 lens = near_lens(in, i_min(i_iota() + k, i_set(q->count - 1)));
    Mask attached = m & mi_lt(i_set(-1), near->shape); // the others are in the air
    if (in->b->job.mode != MODE_FORWARD) {
        points_slide_adj(in, near, v3_scale(dnear, seen), lens, sink, attached);
        points_move_adj(in->t, near, v3_scale(dnear, unseen), v3_zero(), sink, attached);
        return;
    }
    Float common = sink_taken(sink);
    points_slide_adj(in, near, dnear, lens, sink, attached);
    f_store(q->seen + k, f_zero_unless(m, common + sink_taken(sink)));
    points_move_adj(in->t, near, dnear, v3_zero(), sink, attached);
    f_store(q->unseen + k, f_zero_unless(m, common + sink_taken(sink)));
}

// The motion of the segments k... but for their near points, worth `both`.
static void segments_ahead_adj(const Indirect *in, int32_t k, Vec3 n, Float both, Sink *sink, Mask m) {
    const Segments *q = &in->q;
    Hit near = LOAD_HIT(q, k, near), edge = LOAD_HIT(q, k, edge), far = LOAD_HIT(q, k, far);
    Float along = f_load(q->along + k);
    Mask attached = m & mi_lt(i_set(-1), far.shape);
    Vec3 met = v3_select(m, v3_scale(record_v3(q->mx, q->my, q->mz, k), both), v3_zero()); // of curves of two surfaces
    // n . (edge - lerp(near, far, along))
    points_move_adj(in->t, &edge, v3_sub(v3_scale(n, both), met), v3_zero(), sink, m);
    if (m_any(attached)) {
        points_move_adj(in->t, &far, v3_madd(met, -both * along, n), v3_zero(), sink, attached);
    }
    Mask border = m & ~attached & mi_lt(i_set(-1), far.prim) & m_set(boundary_is_paired(in->b->kind));
    if (sink->any_places && m_any(border)) {
        borders_move_adj(in->t->scene, far.prim, far.p, met, sink, border);
    }
    Int light = i_load(q->source + k);
    Mask delta = m & mi_lt(i_set(-1), light);
    if (sink->any_places && m_any(delta)) {
        // The direction from the near point turns the line past the edge.
        LightMove move = light_move_zero();
        Float behind = f_load(q->behind + k), total = f_select(m_gt(along, f_set(0)), behind * f_safe_rcp(along), f_set(1));
        move.d = v3_scale(n, -both * behind);
        lights_move_adj(in->t->scene, i_select(delta, light, i_set(0)), delta, near.p, record_v3(q->dx, q->dy, q->dz, k),
                        total, &move, sink);
    }
}

// The motion of the segments k..., worth `seen` where the sensor sees the near points, and `unseen` elsewhere: adds it to the
// gradient, or in forward mode leaves in both what it is.
static void segments_move_adj(Indirect *in, int32_t k, Sink *sink) {
    const Segments *q = &in->q;
    Mask m = m_first_n(q->count - k);
    bool forward = in->b->job.mode == MODE_FORWARD;
    Float seen = forward ? f_set(1) : f_load(q->seen + k), unseen = forward ? f_set(0) : f_load(q->unseen + k);
    Vec3 n = v3_select(m, record_v3(q->nx, q->ny, q->nz, k), v3_zero());
    m = m & m_finite(seen + unseen);
    Hit near = LOAD_HIT(q, k, near);
    segments_ahead_adj(in, k, n, seen + unseen, sink, m);
    segments_near_adj(in, k, &near, v3_scale(n, f_load(q->along + k) - 1.0f), seen, unseen, sink, m);
}

// ---- what moves upstream -----------------------------------------------------------------------------------------

// The share of n . d, n a normal of x and d the direction of segments at right angles to it (turning.h), in the motion of what lies
// at x and beyond it, worth `worth`. Returns what that asks of the ray from the near point: of the position there, or along chains,
// which have their directions, of the position at x, and of the direction.
static Carried turnings_ahead_adj(const Indirect *in, int32_t k, Float worth, Sink *sink, Mask m) {
    const Segments *q = &in->q;
    const bool horizon = boundary_is_horizon(in->b->kind), chained = boundary_is_chained(in->b->kind);
    Vec3 d = record_v3(q->dx, q->dy, q->dz, k), turned = v3_select(m, v3_scale(d, f_load(q->along + k) * worth), v3_zero());
    Vec3 n = v3_select(m, v3_scale(record_v3(q->nx, q->ny, q->nz, k), worth), v3_zero());
    Vec3 apart = v3_scale(n, f_load(q->behind + k));
    Hit x = LOAD_HIT(q, k, edge), far = LOAD_HIT(q, k, far);
    SurfaceAdj own = surface_adj_zero();
    if (horizon) {
        own.ng = turned;
    } else {
        own.n = v3_neg(turned);
    }
    if (chained && !horizon) {
        return (Carried){rays_find_adj(in->t, &x, d, &own, sink, m), v3_neg(n)};
    }
    own.p = chained ? v3_zero() : v3_neg(apart);
    surfaces_move_adj(in->t, &x, &own, sink, m);
    if (chained) {
        return (Carried){v3_zero(), n};
    }
    if (horizon) { // x slides in the plane that its geometric normal stands for
        points_move_adj(in->t, &far, apart, v3_zero(), sink, m & mi_lt(i_set(-1), far.shape));
        return (Carried){v3_zero(), v3_zero()};
    }
    return (Carried){apart, v3_zero()};
}

// Of horizons that end beside lights at a point: n . (light' - x') over their distance.
static void besides_ahead_adj(const Indirect *in, int32_t k, Float worth, Sink *sink, Mask m) {
    const Segments *q = &in->q;
    Vec3 n = v3_scale(record_v3(q->nx, q->ny, q->nz, k), worth * f_load(q->behind + k));
    Hit x = LOAD_HIT(q, k, edge);
    n = v3_select(m, n, v3_zero());
    points_move_adj(in->t, &x, v3_neg(n), v3_zero(), sink, m);
    beacon_flow_adj(in->t, i_load(q->source + k), i_set(0), n, m_set(false), sink, m);
}

// The motion of the curves along which surfaces meet, of the segments k..., by the two surfaces, worth `worth`.
static void meetings_ahead_adj(const Indirect *in, int32_t k, Float worth, Sink *sink, Mask m) {
    const Segments *q = &in->q;
    Hit own = LOAD_HIT(q, k, edge), other = LOAD_HIT(q, k, far);
    Vec3 v = v3_scale(record_v3(q->nx, q->ny, q->nz, k), worth), w = v3_scale(record_v3(q->mx, q->my, q->mz, k), worth);
    points_move_adj(in->t, &own, v3_select(m, v, v3_zero()), v3_zero(), sink, m);
    Mask attached = m & mi_lt(i_set(-1), other.shape);
    points_move_adj(in->t, &other, v3_select(m, w, v3_zero()), v3_zero(), sink, attached);
    if (sink->any_places) {
        borders_move_adj(in->t->scene, other.prim, other.p, w, sink, m & ~attached);
    }
}

// The motion of the segments k... but for their near points, worth `worth`: returns what it asks of the rays from there. still:
// only that.
static Carried ways_begin_adj(const Indirect *in, int32_t k, Float worth, bool still, Sink *sink, Mask m) {
    const Segments *q = &in->q;
    if (boundary_is_facing(in->b->kind)) {
        return facing_ahead_adj(in->t, q, k, boundary_is_chained(in->b->kind), worth, sink, m);
    }
    Mask beside = m & mi_eq(i_load(q->lit + k), i_set(SEGMENT_BESIDE));
    if (boundary_is_terminator(in->b->kind) || boundary_is_horizon(in->b->kind)) {
        if (!still && m_any(beside)) {
            besides_ahead_adj(in, k, worth, sink, beside);
        }
        return turnings_ahead_adj(in, k, worth, sink, m & ~beside);
    }
    if (boundary_is_rim(in->b->kind)) {
        return rims_ahead_adj(in->t, q, k, boundary_is_chained(in->b->kind), worth, sink, m);
    }
    if (in->b->kind == BOUNDARY_MEETING) { // where near points are has no part in it
        if (!still) {
            meetings_ahead_adj(in, k, worth, sink, m);
        }
        return (Carried){v3_zero(), v3_zero()};
    }
    Vec3 n = v3_select(m, record_v3(q->nx, q->ny, q->nz, k), v3_zero());
    if (!still) {
        segments_ahead_adj(in, k, n, worth, sink, m & ~beside);
    }
    if (!still && sink->any_places && m_any(beside)) { // of which the near point alone counts, and the light
        beacon_flow_adj(in->t, i_load(q->source + k), i_set(0), v3_scale(n, -worth), m_set(false), sink, beside);
    }
    Float drag = f_select(beside, f_set(1), f_load(q->along + k) - 1.0f);
    return (Carried){v3_scale(n, drag * worth), v3_zero()};
}

KFN void carried_store(const Segments *q, int32_t k, const Carried *c) {
    f_store(q->dragx + k, c->drag.x);
    f_store(q->dragy + k, c->drag.y);
    f_store(q->dragz + k, c->drag.z);
    f_store(q->turnx + k, c->turn.x);
    f_store(q->turny + k, c->turn.y);
    f_store(q->turnz + k, c->turn.z);
}

// Forward mode: the rates of the ways that end at the vertices of a bounce, where the particles have just arrived.
static void ways_advance(Indirect *in, int32_t bounce, Sink *sink) {
    const Segments *q = &in->q;
    for (int32_t k = 0; k < q->count && bounce < q->levels && in->b->job.mode == MODE_FORWARD; k += LANES) {
        Mask m = m_first_n(q->count - k);
        Carried c = {record_v3(q->dragx, q->dragy, q->dragz, k), record_v3(q->turnx, q->turny, q->turnz, k)};
        Float rate = f_load(q->rate + k);
        if (bounce == 0) {
            c = ways_begin_adj(in, k, f_set(1), false, sink, m);
            rate = sink_taken(sink);
        } else {
            upstream_turn_adj(in->t, q, bounce - 1, k, &c, sink, m);
            rate = rate + sink_taken(sink);
        }
        upstream_ride_adj(in->t, q, bounce, k, &c, sink, m);
        rate = rate + sink_taken(sink);
        UpstreamVertex at = upstream_load(q, bounce, k);
        Mask air = m & mi_lt(i_set(UPSTREAM_NONE), at.met) & mi_lt(at.hit.shape, i_set(0));
        Mask ray = m & mi_eq(at.met, i_set(UPSTREAM_RAY)) & ~air;
        Vec2 lens = near_lens(in, i_min(i_iota() + k, i_set(q->count - 1)));
        points_slide_adj(in, &at.hit, c.drag, lens, sink, ray);
        collisions_slide_adj(in, at.hit.p, c.drag, lens, sink, air);
        f_store(q->up[bounce].seen + k, f_zero_unless(ray | air, rate + sink_taken(sink)));
        points_move_adj(in->t, &at.hit, c.drag, v3_zero(), sink, ray);
        f_store(q->up[bounce].unseen + k, f_zero_unless(ray, rate + sink_taken(sink)));
        f_store(q->rate + k, rate);
        carried_store(q, k, &c);
    }
}

// Reverse mode: what is carried upstream to there, where chains lead on to the sensor.
static void ways_carry(Indirect *in, int32_t bounce) {
    const Segments *q = &in->q;
    Sink still = sink_of(in->b->still);
    for (int32_t k = 0; k < q->count && bounce < q->levels; k += LANES) {
        Mask m = m_first_n(q->count - k);
        Carried c;
        if (bounce == 0) {
            c = ways_begin_adj(in, k, f_set(1), true, &still, m);
        } else {
            c = (Carried){record_v3(q->dragx, q->dragy, q->dragz, k), record_v3(q->turnx, q->turny, q->turnz, k)};
            upstream_turn_adj(in->t, q, bounce - 1, k, &c, &still, m);
        }
        upstream_ride_adj(in->t, q, bounce, k, &c, &still, m);
        carried_store(q, k, &c);
    }
}

// Reverse mode: the motion of the segments k... and of their ways, by what the vertices of every level are worth.
static void ways_move_adj(Indirect *in, int32_t k, Sink *sink) {
    const Segments *q = &in->q;
    Mask m = m_first_n(q->count - k);
    Float worth[MOST_UPSTREAM + 1], sum = f_set(0);
    for (int32_t j = q->levels; j >= 0; j--) { // of a level and all that follow
        Mask met = j < q->levels ? m & mi_lt(i_set(UPSTREAM_NONE), i_load(q->up[j].met + k)) : m_set(false);
        Float own = j < q->levels ? f_load(q->up[j].seen + k) + f_load(q->up[j].unseen + k) + f_load(q->up[j].passed + k)
                                  : f_set(0);
        sum = sum + f_zero_unless(met, own);
        worth[j] = sum;
    }
    m = m & m_finite(sum);
    Carried c = ways_begin_adj(in, k, worth[0], false, sink, m);
    Vec2 lens = near_lens(in, i_min(i_iota() + k, i_set(q->count - 1)));
    for (int32_t j = 0; j < q->levels; j++) {
        // Shares of the whole, which may be so small that one over it is infinite.
        Float some = f_select(m_ne(worth[j], f_set(0)), worth[j], f_set(1)), seen = f_load(q->up[j].seen + k) / some;
        upstream_ride_adj(in->t, q, j, k, &c, sink, m);
        UpstreamVertex at = upstream_load(q, j, k);
        Mask ray = m & mi_eq(at.met, i_set(UPSTREAM_RAY)) & mi_lt(i_set(-1), at.hit.shape);
        Mask air = m & mi_lt(i_set(UPSTREAM_NONE), at.met) & mi_lt(at.hit.shape, i_set(0));
        collisions_slide_adj(in, at.hit.p, v3_scale(c.drag, seen), lens, sink, air);
        if (m_any(ray)) {
            points_slide_adj(in, &at.hit, v3_scale(c.drag, seen), lens, sink, ray);
            points_move_adj(in->t, &at.hit, v3_scale(c.drag, f_load(q->up[j].unseen + k) / some), v3_zero(), sink, ray);
        }
        Float share = worth[j + 1] / some;
        c = (Carried){v3_scale(c.drag, share), v3_scale(c.turn, share)};
        upstream_turn_adj(in->t, q, j, k, &c, sink, m);
    }
}

// The same of n . d between x and the other end of segments at right angles to n (turning.h).
static void turnings_move_adj(Indirect *in, int32_t k, Sink *sink) {
    const Segments *q = &in->q;
    Mask m = m_first_n(q->count - k);
    bool forward = in->b->job.mode == MODE_FORWARD;
    Float seen = forward ? f_set(1) : f_load(q->seen + k), unseen = forward ? f_set(0) : f_load(q->unseen + k);
    m = m & m_finite(seen + unseen);
    Hit near = LOAD_HIT(q, k, near);
    turnings_ahead_adj(in, k, seen + unseen, sink, m);
    if (!boundary_is_horizon(in->b->kind)) {
        Vec3 apart = v3_scale(record_v3(q->nx, q->ny, q->nz, k), f_load(q->behind + k));
        segments_near_adj(in, k, &near, v3_select(m, apart, v3_zero()), seen, unseen, sink, m);
    } else if (forward) {
        Float all = sink_taken(sink);
        f_store(q->seen + k, all);
        f_store(q->unseen + k, all);
    }
}

// The same where maps cut light off. The plane of the shading normal turns where x slides.
static void cuts_move_adj(Indirect *in, int32_t k, Sink *sink) {
    const Segments *q = &in->q;
    bool forward = in->b->job.mode == MODE_FORWARD;
    Float seen = forward ? f_set(1) : f_load(q->seen + k), unseen = forward ? f_set(1) : f_load(q->unseen + k);
    Mask m = m_first_n(q->count - k) & m_finite(seen + unseen);
    Vec3 apart = v3_scale(record_v3(q->nx, q->ny, q->nz, k), f_load(q->behind + k));
    Vec3 turned = v3_scale(record_v3(q->dx, q->dy, q->dz, k), f_load(q->along + k));
    apart = v3_select(m, apart, v3_zero());
    Hit x = LOAD_HIT(q, k, edge), far = LOAD_HIT(q, k, far);
    Vec2 lens = near_lens(in, i_min(i_iota() + k, i_set(q->count - 1)));
    Mask attached = m & mi_lt(i_set(-1), far.shape);
    points_move_adj(in->t, &far, v3_scale(apart, forward ? f_set(1) : seen + unseen), v3_zero(), sink, attached);
    Float common = forward ? sink_taken(sink) : f_set(0);
    SurfaceAdj own = surface_adj_zero();
    own.p = v3_scale(apart, -seen);
    own.n = v3_select(m, v3_scale(turned, seen), v3_zero());
    surfaces_slide_adj(in, &x, &own, lens, sink, m);
    if (forward) {
        f_store(q->seen + k, f_zero_unless(m, common + sink_taken(sink)));
    }
    own.p = v3_scale(apart, -unseen);
    own.n = v3_select(m, v3_scale(turned, unseen), v3_zero());
    surfaces_move_adj(in->t, &x, &own, sink, m);
    if (forward) {
        f_store(q->unseen + k, f_zero_unless(m, common + sink_taken(sink)));
    }
}

// The same of the two surfaces of meetings.
static void meetings_move_adj(Indirect *in, int32_t k, Sink *sink) {
    const Segments *q = &in->q;
    bool forward = in->b->job.mode == MODE_FORWARD;
    Mask m = m_first_n(q->count - k);
    Float worth = forward ? f_set(1) : f_load(q->seen + k) + f_load(q->unseen + k);
    meetings_ahead_adj(in, k, worth, sink, m & m_finite(worth));
    if (forward) {
        Float all = sink_taken(sink);
        f_store(q->seen + k, all);
        f_store(q->unseen + k, all);
    }
}

// The same of rims, and of normals of maps.
static void looked_move_adj(Indirect *in, int32_t k, Sink *sink) {
    const Segments *q = &in->q;
    bool forward = in->b->job.mode == MODE_FORWARD;
    Float seen = forward ? f_set(1) : f_load(q->seen + k), unseen = forward ? f_set(0) : f_load(q->unseen + k);
    Float worth = seen + unseen;
    Mask m = m_first_n(q->count - k) & m_finite(worth) & m_ne(worth, f_set(0));
    Hit near = LOAD_HIT(q, k, near);
    Carried c = in->b->kind == BOUNDARY_FACING ? facing_ahead_adj(in->t, q, k, false, worth, sink, m)
                                               : rims_ahead_adj(in->t, q, k, false, worth, sink, m);
    Float some = f_select(m, worth, f_set(1));
    segments_near_adj(in, k, &near, c.drag, seen / some, unseen / some, sink, m);
}

static void moves_adj(Indirect *in, int32_t k, Sink *sink) {
    if (in->upstream) {
        ways_move_adj(in, k, sink);
    } else if (in->b->kind == BOUNDARY_INDIRECT) {
        segments_move_adj(in, k, sink);
    } else if (in->b->kind == BOUNDARY_MEETING) {
        meetings_move_adj(in, k, sink);
    } else if (in->b->kind == BOUNDARY_LINES) {
        lines_move_adj(&in->q, in->b->job.mode == MODE_FORWARD, k, sink);
    } else if (in->b->kind == BOUNDARY_CUT) {
        cuts_move_adj(in, k, sink);
    } else if (in->b->kind == BOUNDARY_RIM || in->b->kind == BOUNDARY_FACING) {
        looked_move_adj(in, k, sink);
    } else {
        turnings_move_adj(in, k, sink);
    }
}
