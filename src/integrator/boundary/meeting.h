// meeting.h: the curves along which two surfaces pass through each other, or light ends on one, seen by vertices other than the
// camera. Of the latter, the surface on both sides of the curve stands for two surfaces. What a
// vertex sees of each surface ends there, so that with v, v' the velocities of the curve and of the surface's own points
//   dI -= integral dl dw sin(dl, w) n . (v - v') L W
// for both surfaces, n at right angles to the curve and to w, towards the surface's visible side; L leaves it along -w.
// The curve moves across itself as both surfaces say: n . v = x a . (velocity of the one) + y b . (velocity of the other), a and
// b their normals, n = x a + y b. docs/derivations/boundary.md.
#pragma once

#include "integrator/boundary/turning.h"

// Lanes in which rays along d may meet a surface with the normal n: tubes, from outside alone.
KFN Mask meeting_shows(const SceneView *scene, Int shape, Vec3 n, Vec3 d) {
    return ~mi_eq(SHAPE_FIELD(scene, i_max(shape, i_set(0)), kind), i_set(SHAPE_BSPLINE)) | m_lt(v3_dot(n, d), f_set(0));
}

// What looks along the rays. In media, where their flights end; what collisions see is for riding.h.
static Hit meeting_near(Tracer *t, const Ray *ray, Int number, Segments *q, Mask *m) {
    if (!t->scene->has_media) {
        t->job->rays += m_count(*m);
        Hit near = trace_closest(t->scene, ray, *m, false);
        *m = *m & mi_lt(i_set(-1), near.shape);
        return near;
    }
    Int around = medium_around(t, ray->o, ray->d, *m);
    SampleKey key = stream_key(t, number, 0, STREAM_PROBE);
    Leg leg = leg_trace(t, *ray, ray->o, around, &key, m_set(false), *m);
    *m = leg.m & mi_lt(leg.air, i_set(0));
    segment_keep_leg(around, &leg, q, *m);
    return leg.near;
}

// Samples a batch of segments that end on one of the two surfaces of a curve, and keeps those that begin somewhere.
static void meeting_segment(Tracer *t, const BoundaryJob *b, Mask m, Int number, Segments *q) {
    SampleKey key = slot_key(t, number);
    EdgePoint e = edge_sample(t->scene, b, rng_2d(&key, DIMENSION_EDGE_SEGMENT), v3_zero(), false);
    Mask which = m_lt(rng_1d(&key, DIMENSION_TURNING_SIDE), f_set(0.5f)), border = mi_lt(e.met.shape, i_set(0));
    Mask first = which | border;
    Vec3 d = warp_uniform_sphere(rng_2d(&key, DIMENSION_SEGMENT_END)), across = v3_cross(d, e.tangent);
    Vec3 own = v3_select(first, e.across[0], e.across[1]), other = v3_select(first, e.across[1], e.across[0]);
    Float length = v3_length(across);
    // The visible half of the surface is on the viewer's side of the other one: along `other`, less its part along `own`.
    Float side = f_copysign(f_set(1), f_select(border, f_select(which, f_set(1), f_set(-1)), -v3_dot(d, other)));
    Vec3 half = v3_scale(v3_madd(other, -v3_dot(own, other), own), side);
    Vec3 n = v3_scale(across, f_safe_rcp(length));
    n = v3_scale(n, f_copysign(f_set(1), v3_dot(n, half)));
    Float weight = length * (8 * PI) * f_safe_rcp(e.probability);
    Float x = part_along(n, own, other), y = part_along(n, other, own);
    Float step = interaction_step(e.p);
    Ray ray = {v3_madd(e.p, -step, d), v3_neg(d), f_set(INFINITY)};
    m = m & m_finite(weight) & m_finite(x + y) & m_gt(weight, f_set(0)) & m_gt(e.probability, f_set(0));
    m = m & meeting_shows(t->scene, e.hit.shape, e.across[0], d) & meeting_shows(t->scene, e.met.shape, e.across[1], d);
    Hit near = meeting_near(t, &ray, number, q, &m);
    int32_t at = q->count;
    v3_compress(q->ox + at, q->oy + at, q->oz + at, ray.o, m);
    v3_compress(q->dx + at, q->dy + at, q->dz + at, d, m);
    v3_compress(q->nx + at, q->ny + at, q->nz + at, v3_scale(v3_sub(n, v3_scale(own, x)), weight), m);
    v3_compress(q->mx + at, q->my + at, q->mz + at, v3_scale(other, -y * weight), m);
    f_compress(q->seen + at, f_set(0), m);
    f_compress(q->unseen + at, f_set(0), m);
    spec_compress(q->light, at, spec_set(f_set(1)), m);
    i_compress(q->lit + at, i_set(SEGMENT_ALL), m);
    i_compress(q->source + at, i_set(-1), m);
    i_compress(q->number + at, number, m);
    KEEP_HIT(q, at, near, &near, near.p, m);
    Hit hits[2] = {e.hit, e.met};
    for (int k = 0; k < 2; k++) {
        hits[k].shape = i_select(first, e.hit.shape, e.met.shape);
        hits[k].prim = i_select(first, e.hit.prim, e.met.prim);
        hits[k].instance = i_select(first, e.hit.instance, e.met.instance);
        hits[k].u = f_select(first, e.hit.u, e.met.u);
        hits[k].v = f_select(first, e.hit.v, e.met.v);
        first = ~first;
    }
    // Beside the curve, out of the way of the other surface.
    Vec3 normal, beside = v3_madd(e.p, step * f_safe_rcp(v3_length(half)), half);
    Hit moved = point_hit(t->scene, i_select(m, hits[0].shape, i_set(-1)), hits[0].prim, hits[0].instance, beside, &normal);
    hits[0].u = f_select(m, moved.u, hits[0].u);
    hits[0].v = f_select(m, moved.v, hits[0].v);
    KEEP_HIT(q, at, edge, hits, v3_select(m, beside, e.p), m);
    KEEP_HIT(q, at, far, hits + 1, e.p, m);
    q->count += m_count(m);
}

// As segments_find.
static void meetings_find(Tracer *t, const BoundaryJob *b, int64_t first, int32_t count, Segments *q) {
    q->count = 0;
    for (int32_t i = 0; i < count; i += LANES) {
        batch_numbers(t, i, first);
        meeting_segment(t, b, m_first_n(count - i), i_iota() + i, q);
    }
}

// Starts the paths that look at the surfaces that the segments end on.
static void meetings_start(Tracer *t, const Segments *q) {
    for (int32_t k = 0; k < q->count; k += LANES) {
        Int at = i_min(i_iota() + k, i_set(q->count - 1));
        Hit hit = segment_edge(q, at);
        Vec3 d = LOAD_V3(*q, dx, dy, dz, at);
        Ray ray = {v3_sub(hit.p, d), d, f_zero_unless(m_first_n(q->count - k), f_set(INFINITY))};
        path_begin(t, k, i_iota() + k, &ray, f_set(1));
        hit_store(t, k, &hit);
        if (t->scene->has_media) {
            i_store(t->ws.paths[0].medium + k, i_gather(q->medium, at));
        }
    }
    t->active = q->count;
}
