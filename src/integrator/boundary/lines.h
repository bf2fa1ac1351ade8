// lines.h: lines along which textures jump that move over their surfaces with to_uv, seen by vertices other than the camera. Paths
// are attached to surfaces, over which such a line sweeps with the velocity v, so that what leaves its points jumps:
//   dI += integral dl dw |n_g . w| (n . v) (L- - L+) W
// over the points of the line and the directions w from there to the vertex that sees it, W the importance of that; n in the
// surface, at right angles to the line, from the side of L- to that of L+. With F the number of the line at a fixed point, which
// to_uv has grow, and r the way over the surface along which it grows by 1, v = -F' r.
// Two paths look at the fields on both sides, and particles carry the difference to the sensor. What the sensor sees of lines
// itself: primary.h; in mirrors and through glass: mirrored.h.
// NOT differentiated: what collisions in media see of them.
#pragma once

#include "integrator/boundary/turning.h"

// Samples a batch of segments that end on a line, and keeps those that begin somewhere.
static void lines_segment(Tracer *t, const BoundaryJob *b, Mask m, Int number, Segments *q) {
    SampleKey key = slot_key(t, number);
    EdgePoint e = edge_sample(t->scene, b, rng_2d(&key, DIMENSION_EDGE_SEGMENT), v3_zero(), false);
    // Directions by their cosine, from either side of the surface.
    Vec3 area = v3_cross(e.side[0], e.tangent);
    Float size = v3_length(area);
    Vec3 n = v3_scale(area, f_safe_rcp(size)), local = warp_cosine_hemisphere(rng_2d(&key, DIMENSION_SEGMENT_END));
    n = v3_scale(n, f_select(m_lt(rng_1d(&key, DIMENSION_TURNING_SIDE), f_set(0.5f)), f_set(1), f_set(-1)));
    Frame frame = frame_from_normal(n);
    Vec3 w = frame_to_world(&frame, local);
    // r is some multiple of side[0], which with the tangent spans `area`.
    Float swept = v3_dot(e.rise, e.side[0]) * f_safe_rcp(v3_dot(e.side[0], e.side[0])) * size;
    Float weight = swept * TWO_PI * f_safe_rcp(e.probability);
    Float step = interaction_step(e.p);
    Ray ray = {v3_madd(e.p, step, n), w, f_set(INFINITY)};
    m = m & mi_lt(i_set(-1), e.line) & m_finite(weight) & m_gt(f_abs(weight), f_set(0)) & m_gt(e.probability, f_set(0));
    t->job->rays += m_count(m);
    Hit near = trace_closest(t->scene, &ray, m, false);
    m = m & mi_lt(i_set(-1), near.shape);
    int32_t at = q->count;
    Int line = i_select(m, e.line, i_set(0));
    Float scale = weight * MARK_FLOAT(b, line, scale);
    v3_compress(q->ox + at, q->oy + at, q->oz + at, ray.o, m);
    v3_compress(q->dx + at, q->dy + at, q->dz + at, v3_neg(w), m);
    v3_compress(q->nx + at, q->ny + at, q->nz + at, v3(scale * e.uv.x, scale * e.uv.y, scale), m);
    f_compress(q->along + at, e.nudge[0].x, m);
    f_compress(q->behind + at, e.nudge[0].y, m);
    f_compress(q->mx + at, e.nudge[1].x, m);
    f_compress(q->my + at, e.nudge[1].y, m);
    f_compress(q->seen + at, f_set(0), m);
    f_compress(q->unseen + at, f_set(0), m);
    spec_compress(q->light, at, spec_set(f_set(1)), m);
    i_compress(q->lit + at, i_set(SEGMENT_JUMP), m);
    i_compress(q->source + at, MARK_INT(b, line, at), m);
    i_compress(q->number + at, number, m);
    KEEP_HIT(q, at, near, &near, near.p, m);
    KEEP_HIT(q, at, edge, e.beside, e.beside[0].p, m);
    KEEP_HIT(q, at, far, e.beside + 1, e.beside[1].p, m);
    q->count += m_count(m);
}

// As segments_find.
static void lines_find(Tracer *t, const BoundaryJob *b, int64_t first, int32_t count, Segments *q) {
    q->count = 0;
    for (int32_t i = 0; i < count; i += LANES) {
        batch_numbers(t, i, first);
        lines_segment(t, b, m_first_n(count - i), i_iota() + i, q);
    }
}

// Starts the paths that look at both sides of the lines, in slots k and half + k.
static void lines_start(Tracer *t, const Segments *q, int32_t half) {
    segment_pairs(t, q, half);
    for (int32_t k = 0; k < half; k += LANES) {
        Int at = i_min(i_iota() + k, i_set(q->count - 1));
        Vec3 d = LOAD_V3(*q, dx, dy, dz, at);
        for (int side = 0; side < 2; side++) {
            Hit hit = side ? segment_far(q, at) : segment_edge(q, at);
            Ray ray = {v3_sub(hit.p, d), d, f_zero_unless(m_first_n(q->count - k), f_set(INFINITY))};
            path_begin(t, side * half + k, i_iota() + (side * half + k), &ray, f_set(1));
            hit_store(t, side * half + k, &hit);
            f_store(q->nudge_u + side * half + k, real_gather(side ? q->mx : q->along, at));
            f_store(q->nudge_v + side * half + k, real_gather(side ? q->my : q->behind, at));
        }
    }
    t->active = 2 * half;
    t->nudge[0] = q->nudge_u;
    t->nudge[1] = q->nudge_v;
}

// The motion of the segments k..., by their lines, as segments_move_adj. Where near points are has no part in it.
static void lines_move_adj(const Segments *q, bool forward, int32_t k, Sink *sink) {
    Mask m = m_first_n(q->count - k);
    Float worth = forward ? f_set(1) : f_load(q->seen + k) + f_load(q->unseen + k);
    m = m & m_finite(worth);
    Int at = i_select(m, i_load(q->source + k), i_set(0));
    Vec3 rate = v3_select(m, v3_scale(record_v3(q->nx, q->ny, q->nz, k), worth), v3_zero());
    sink_add_v3(sink, at, rate, m);
    if (forward) {
        f_store(q->seen + k, sink->derivative);
        f_store(q->unseen + k, sink->derivative);
        sink->derivative = f_set(0);
    }
}
