// riding.h: edges as collisions see them where surfaces move in media. A collision rides along with the surface that its ray left
// (ride.h), by r', and what leaves it keeps its direction, so that all of what it sees jumps where that passes an edge, as the
// beginning of a chain does (chained.h): with e the point of the edge, n the normal of the plane of edge and ray,
//   dI += integral dl dw |w x T| n . (e' - r') (L- - L+) W.
// Where a surface looks past an edge, this is so for what is scattered in the air behind it, before the light meets a surface;
// surfaces behind it are attached (indirect.h). Lights at a point are attached, too.
// Borders of media are passed. Smooth mirrors and glass are pieces of what collides: the segments of this kind are also those of
// chained.h, with the flights of media between the vertices.
#pragma once

#include "integrator/boundary/beside.h"

// Segments that end on lights and whose near points are collisions or, where there are chains, pieces of these: no chain ends on a
// light at a point or of one direction.
static void riding_shine(Tracer *t, const BoundaryJob *b, Segment *s, Int number, Segments *q) {
    Vec3 o = segment_stand(t, s, segment_offset(s)), before = segment_before(s, o);
    Int around = medium_around(t, before, segment_aside(s), s->m);
    SampleKey key = stream_key(t, number, 0, STREAM_PROBE);
    Ray back = {before, v3_neg(s->d), f_set(INFINITY)};
    Leg leg = leg_trace(t, back, before, around, &key, segment_unveiled(t, s, s->m), s->m);
    Mask m = leg.m & (mi_lt(i_set(-1), leg.air) | (mi_lt(s->source, i_set(0)) & m_set(b->chains)));
    m = m_any(m) ? segment_shine(t, s, o, around, v3_length(v3_sub(leg.near.p, o)), number, m) : m;
    // Directions stay, and the ends slide over their lights.
    s->attached = m_set(false);
    s->distance = f_select(mi_lt(s->source, i_set(0)), f_set(INFINITY), s->distance);
    segment_keep_leg(around, &leg, q, m);
    i_compress(q->sighted + q->count, i_set(0), m);
    segment_keep(s, o, &leg.near, true, number, q, m);
}

// Segments in any direction. Surfaces that scatter see the same air on both sides of an edge between two faces.
static void riding_trace(Tracer *t, const BoundaryJob *b, const Segment *s, Int number, Segments *q) {
    Vec3 o = segment_before(s, segment_offset(s));
    Int around = medium_around(t, o, v3_neg(s->d), s->m); // towards the edge, rays may slip through between its faces
    SampleKey key = stream_key(t, number, 0, STREAM_PROBE);
    Leg leg = leg_trace(t, (Ray){o, v3_neg(s->d), f_set(INFINITY)}, o, around, &key, m_set(false), s->m);
    Mask m = leg.m & (s->silhouette | mi_lt(i_set(-1), leg.air) | m_set(b->chains));
    if (m_any(m)) {
        Float behind;
        m = chained_between(t, b, s, leg.near.p, m, &behind);
        segment_keep_leg(around, &leg, q, m);
        i_compress(q->sighted + q->count, i_set(0), m);
        chained_keep(s, o, &leg.near, behind, number, q, m);
    }
}

// Collisions that the sensor sees: on one of its rays, at an angle that is uniform as the edge sees it (track.h). Collisions at
// random distances from the edge would seldom be seen, and some of them from very near.
static Vec3 riding_sight(Tracer *t, const BoundaryJob *b, const Pinhole *pinhole, Int slot, Float share, Mask m, Segment *s) {
    const SceneView *scene = t->scene;
    const PathJob *job = t->job;
    SampleKey key = slot_key(t, slot);
    Vec2 u = rng_2d(&key, DIMENSION_EDGE_SEGMENT), film = rng_2d(&key, DIMENSION_SEGMENT_END);
    Vec2 lens = sample_lens(t, &key);
    Float x = (real)job->x + film.x * (real)job->width, y = (real)job->y + film.y * (real)job->height;
    Ray ray = sensor_ray(scene, t->sensor, x, y, lens).ray;
    Hit hit = trace_solid(t, &ray, true, m, NULL);
    Mask ends = mi_lt(i_set(-1), hit.shape);
    Float length = f_select(ends, v3_dot(v3_sub(hit.p, ray.o), ray.d), f_set(INFINITY));
    s->edge = edge_sample(scene, b, u, v3_zero(), false);
    Focus focus = focus_look(edge_reference(&s->edge), ray.o, ray.d, length);
    Float distance = focus_distance(&focus, rng_1d(&key, DIMENSION_SEGMENT_LIGHT));
    Vec3 near = v3_madd(ray.o, distance, ray.d);
    if (m_any(s->edge.round)) {
        s->edge = edge_sample(scene, b, u, near, false);
    }
    Vec3 across = v3_sub(s->edge.p, near);
    s->distance = v3_length(across);
    s->d = v3_scale(across, f_safe_rcp(s->distance));
    // Directions and distances of collisions as the edge sees them, over their density.
    Sight sight = camera_look(pinhole, scene, t->sensor, near, lens);
    Float density = sight.density * focus_density(&focus, distance) * (s->distance * s->distance);
    s->light = spec_set((real)job->width * (real)job->height * f_safe_rcp(density));
    s->m = m & sight.valid & m_gt(distance, f_set(0)) & m_lt(distance, length) & m_gt(density, f_set(0));
    s->attached = m_set(false);
    s->source = i_set(-1);
    segment_measure(t, b, false, share, s);
    return near;
}

// The extinction of whatever media points lie in, along d.
static NOINLINE Spec extinction_at(const Tracer *t, Int medium, Vec3 p, Vec3 d, Mask m) {
    Spec extinction = spec_zero();
    for (Mask left = m & mi_lt(i_set(-1), medium), mine; m_any(left); left = left & ~mine) {
        int32_t id = i_lane(medium, m_first(left));
        Track track = track_of(t, id);
        mine = left & mi_eq(medium, i_set(id));
        extinction = spec_select(mine, medium_extinction(t->scene, &track, p, d), extinction);
    }
    return extinction;
}

// Keeps those of them that the edge sees.
static void riding_see(Tracer *t, const BoundaryJob *b, Segment *s, Vec3 near, Int number, Segments *q) {
    Vec3 o = segment_before(s, segment_offset(s)), d = v3_neg(s->d);
    Leg leg = {.air = medium_around(t, near, d, s->m)};
    leg.near = (Hit){i_set(-1), i_set(0), f_set(0), f_set(0), near, i_set(0)};
    leg.weight = extinction_at(t, leg.air, near, d, s->m);
    Mask m = s->m & m_gt(spec_max(leg.weight), f_set(0)), blocked;
    if (!m_any(m)) {
        return;
    }
    Int around = medium_around(t, o, d, m);
    Fog fog = {around, stream_key(t, number, 0, STREAM_PROBE), false, f_set(0)};
    Ray back = {o, d, v3_length(v3_sub(near, o))};
    leg.weight = spec_mul(leg.weight, walk_transmittance(t, back, m_set(true), m, &fog, &blocked, NULL));
    leg.around = leg.air;
    m = m & m_gt(spec_max(leg.weight), f_set(0));
    Float behind;
    m = chained_between(t, b, s, near, m, &behind);
    segment_keep_leg(around, &leg, q, m);
    i_compress(q->sighted + q->count, i_set(1), m);
    chained_keep(s, o, &leg.near, behind, number, q, m);
}

// As segments_find.
static void ridings_find(Tracer *t, const BoundaryJob *b, const Pinhole *pinhole, int64_t first, int32_t count, Segments *q) {
    const Vec3 *focus = t->focus;
    q->count = 0;
    for (int32_t i = 0; i < count; i += LANES) {
        SegmentTurn turn = segment_turn(t, b->kind, first + i);
        if (!turn.lit && !turn.indirect) {
            break;
        }
        batch_numbers(t, i, first);
        if (turn.beside) {
            t->focus = NULL;
            beside_find(t, b, i_iota() + i, turn.share, m_first_n(count - i), q);
            continue;
        }
        Segment s;
        if (turn.sighted) {
            Vec3 near = riding_sight(t, b, pinhole, i_iota() + i, turn.share, m_first_n(count - i), &s);
            if (m_any(s.m)) {
                riding_see(t, b, &s, near, i_iota() + i, q);
            }
            continue;
        }
        t->focus = turn.lit ? focus : NULL; // what others bring from their first collisions is found from the sensor
        segment_sample(t, b, i_iota() + i, turn.lit, turn.share, m_first_n(count - i), &s);
        if (m_any(s.m) && turn.lit) {
            riding_shine(t, b, &s, i_iota() + i, q);
        } else if (m_any(s.m)) {
            riding_trace(t, b, &s, i_iota() + i, q);
        }
    }
    t->focus = focus;
}
