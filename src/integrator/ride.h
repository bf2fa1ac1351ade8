// ride.h: surfaces that move in media, and lights at a point and cameras there (beacon.h). What is scattered from one point to the
// next changes with one over the cube of their distance if they move differently, whose integral has no limit. So directions into
// media and distances to collisions are fixed, as behind a camera that moves (glide.h): a collision rides along with the surface
// that its ray left, and so does every later one, up to where the ray meets a surface. There the path slides over it; it goes on as
// from any surface. Segments that lead from surface to surface are attached at both ends (path_move.h), with what the medium
// between them lets through.
// With dx the motion of a ray's end along it, of a medium with extinction s that ends there,
//   dL = dx T (s a S + j) - dD s L,                                                                            (border.h, 1)
// dD = dx where the end slides, and along segments that are attached the change of their length. S is found by the path's probe.
// Shadow rays from collisions keep their direction, and their ends slide over the lights; those from surfaces keep both ends.
// Borders of media are passed, and points of the way between attached ends move with both (ride_add). The sensor's ray moves as
// the sensor says: by o' + s d' at the distance s, with a collision there or where it meets a surface (first_ride_adj).
// Borders of light in the air are passed as those of media are (shaft.h).
// What masks and thin glass let pass stays on its line, of which the stretch before them grows as that behind them shrinks.
#pragma once

#include "integrator/border.h"
#include "integrator/path_move.h"

// The light sample of a vertex.
typedef struct Connection {
    Vec3 from, d;
    Float distance;
    Int light, prim;
    Mask m;
} Connection;

// Of connections to surfaces, given the adjoint of direction, length, uv, barycentrics and the end's point in space: returns that
// of where they begin.
static NOINLINE Vec3 connection_end_adj(const Tracer *t, const Connection *c, const LightMove *move, Vec2 at, Vec3 point,
                                        bool slides, Sink *sink) {
    const SceneView *scene = t->scene;
    Int light = i_select(c->m, c->light, i_set(0)), shape = EMITTER_FIELD(scene, light, shape);
    Mask attached = c->m & mi_lt(i_set(-1), shape);
    if (!m_any(attached)) {
        return v3_zero();
    }
    Vec3 n, dr = v3_scale(c->d, move->distance), end = v3_madd(c->from, c->distance, c->d);
    Hit hit = point_hit(scene, i_select(attached, shape, i_set(-1)), i_select(attached, c->prim, i_set(0)), i_set(0), end, &n);
    if (slides) {
        SurfaceAdj worth = surface_adj_zero();
        worth.p = v3_add(dr, point);
        worth.uv = move->uv;
        worth.at = at;
        return v3_select(attached, v3_sub(rays_find_adj(t, &hit, c->d, &worth, sink, attached), dr), v3_zero());
    }
    Vec3 across = v3_madd(move->d, -v3_dot(c->d, move->d), c->d);
    dr = v3_madd(dr, f_safe_rcp(c->distance), across);
    points_move_adj(t, &hit, dr, v3_zero(), sink, attached);
    return v3_select(attached, v3_neg(dr), v3_zero());
}

// A collision has no point of a surface to which the vertex before it could be attached: it rides with that one. But for the part
// `still` of what leaves it, which moves with its light (beacon.h).
KFN void ride_collision(Tracer *t, Int slot, Vec3 p, Spec still, Int light, Mask m) {
    Mask beside = m & m_gt(spec_max(still), f_set(0));
    next_point(t, slot, p, m);
    i_scatter(t->ws.next, slot, i_set(NEXT_STILL), beside);
    i_scatter(t->ws.next_light, slot, light, beside);
    spec_scatter(t->ws.attached, slot, spec_zero_unless(m, still), m);
}

// What leaves the end of a flight reaches its beginning with the flight's weight.
KFN void ride_flight(Tracer *t, const RecordBatch *batch, Int slot, Mask m) {
    if (t->job->rides) {
        Spec attached = spec_mul(spec_gather(t->ws.attached, slot), spec_load(t->ws.records.weight, batch->first));
        spec_scatter(t->ws.attached, slot, attached, m);
    }
}

// s a S + j in front of ends of rays (side 0) or behind them, and s.
static NOINLINE Spec ride_side(const Tracer *t, const RecordBatch *batch, const BorderSurface *s, int side, Mask m,
                               Spec *extinction) {
    Spec sent = spec_zero();
    *extinction = spec_zero();
    for (Mask left = m & mi_lt(i_set(-1), s->medium[side]), mine; m_any(left); left = left & ~mine) {
        int32_t id = i_lane(s->medium[side], m_first(left));
        mine = left & mi_eq(s->medium[side], i_set(id));
        Filling f = medium_filling(t, id, s->p[side], s->d);
        Spec scattered = border_scattered(t, batch, side, s->slot, mine);
        sent = spec_select(mine, spec_add(spec_mul(f.extinction, scattered), f.emission), sent);
        *extinction = spec_select(mine, f.extinction, *extinction);
    }
    return sent;
}

// The ends of rays at a batch of surface vertices, from which `radiance` leaves. Adds what that asks of the rays to their drag.
// What is attached there asks for the length of attached rays, what goes on along chains for where they slide. What passes masks
// and thin glass, some of `behind`, stays on its line, which is shorter behind them by as much as it is longer before them.
static NOINLINE void ride_end_sweep(Tracer *t, const RecordBatch *batch, Spec radiance, Spec behind, Mask finite, Sink *sink) {
    if (!t->job->rides) {
        return;
    }
    BorderSurface s = border_surface(t, batch);
    Mask slides = records_slide(t, batch->first);
    Spec extinction, lost, gain = ride_side(t, batch, &s, 0, s.m, &extinction);
    Spec attached = spec_zero_unless(~slides, spec_gather(t->ws.attached, s.slot));
    gain = spec_sub(gain, spec_mul(extinction, spec_sub(radiance, attached)));
    lost = spec_mul(extinction, attached);
    if (group_is_veil(t, s.group)) {
        Mask passed = border_passed(t, batch, s.m);
        Spec sent = ride_side(t, batch, &s, 1, passed, &extinction), weight = spec_load(t->ws.records.weight, batch->first);
        sent = spec_mul(weight, spec_sub(sent, spec_mul(extinction, behind)));
        gain = spec_sub(gain, spec_zero_unless(passed, sent));
    }
    Mask m = s.m & finite & m_finite(spec_sum(gain) + spec_sum(lost));
    for (int c = 0; c < drives(t); c++) {
        Spec worth = spec_mul(slot_adjoint(t, s.slot, c), s.beta);
        Float dx = spec_dot(worth, gain), length = spec_dot(worth, lost);
        SurfaceAdj d = surface_adj_zero();
        d.p = v3_scale(s.si.ng, dx * s.rcp);
        d.p = v3_select(m, v3_madd(d.p, -length, s.d), v3_zero());
        if (t->job->live[batch->group] & LIVE_MOTION) {
            shape_move_adj(t->scene, s.group->shape_kind, s.group->shape_flags, &s.hit, &s.si, &d, sink, m);
        }
        const Carried first = {v3_neg(d.p), v3_zero()};
        first_ride_adj(t, batch, s.slot, s.hit.p, &first, sink, m);
        rows_scatter(&t->ws.drag, c, s.slot, v3_sub(rows_gather(&t->ws.drag, c, s.slot), d.p), m);
        forward_flush(t, sink, s.slot, c, m);
    }
}
