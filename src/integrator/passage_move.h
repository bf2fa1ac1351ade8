// passage_move.h: the transmittance of shadow rays as borders of media move, and as the rays turn because their light does. With
// w the ray's direction, a point at distance s from where it begins moves by s dw, so that with the transmittance T
//   dT = -T int s grad(extinction) . dw ds - T extinction(end) d(length) + T sum_i dx_i (extinction behind - in front),
//   dx_i = n . (v_i - s_i dw) / n . w
// at the borders i that it crosses (border.h). In media of flakes the extinction also changes by its slope along dw itself.
// What surfaces dim is in walk_adj.h. NOT differentiated: jumps between nearest voxels under rays that turn.
#pragma once

#include "integrator/beacon.h"
#include "integrator/flight_adj.h"

// Adjoint of a shadow ray's direction and length; from: where its vertex lies; points: lanes whose light lies at a point and moves;
// beacons: whose light has a beacon.
typedef struct Turn {
    Vec3 from, d;
    Vec3 shift;    // of all points alike
    Float distance;
    Mask points, beacons;
} Turn;

// Surfaces on the way of a walk: the medium in front of number i is that of its piece i, behind it of the next one.
static NOINLINE void passed_surfaces_adj(const Tracer *t, const Walk *walk, int32_t i, Spec dt, Turn *turn, Sink *sink) {
    const SceneView *scene = t->scene;
    Int groups = SHAPE_FIELD(scene, i_max(walk->hit[i].shape, i_set(0)), group);
    for (Mask left = walk->m[i] & m_set(i + 1 < walk->segments), mine; m_any(left); left = left & ~mine) {
        int32_t id = i_lane(groups, m_first(left));
        const Group *group = scene->groups + id;
        mine = left & mi_eq(groups, i_set(id));
        bool moves = (t->job->any_borders || t->job->rides) && (t->job->live[id] & LIVE_MOTION);
        if (!moves && !turn) {
            continue;
        }
        Hit hit = walk_hit(&walk->hit[i], mine);
        Interaction si = shape_interaction(scene, group->shape_kind, group->shape_flags, &hit);
        Float cosine = v3_dot(si.ng, walk->d), dx = f_set(0);
        Mask m = mine & m_gt(f_abs(cosine), f_set(LEAST_COSINE));
        for (int side = 0; side < 2; side++) {
            Vec3 p = interaction_offset(&si, side ? walk->d : v3_neg(walk->d));
            Int medium = walk->medium[i + side];
            for (Mask rest = m & mi_lt(i_set(-1), medium), own; m_any(rest); rest = rest & ~own) {
                int32_t number = i_lane(medium, m_first(rest));
                own = rest & mi_eq(medium, i_set(number));
                Filling f = medium_filling(t, number, p, walk->d);
                Float share = f_zero_unless(own, spec_dot(dt, f.extinction));
                dx = side ? dx + share : dx - share;
            }
        }
        SurfaceAdj d = surface_adj_zero();
        d.p = v3_scale(si.ng, f_zero_unless(m, dx * f_safe_rcp(f_select(m, cosine, f_set(1)))));
        if (moves) {
            shape_move_adj(scene, group->shape_kind, group->shape_flags, &hit, &si, &d, sink, m);
        }
        if (turn) {
            Float far = f_zero_unless(m, v3_dot(v3_sub(hit.p, turn->from), walk->d));
            turn->d = v3_madd(turn->d, -far, d.p);
            turn->shift = v3_sub(turn->shift, d.p);
        }
    }
}

// The boxes of the media that piece i of a walk leads through.
static NOINLINE void passed_boxes_adj(const Tracer *t, const Walk *walk, int32_t i, Spec dt, Turn *turn, Sink *sink) {
    for (Mask left = mi_lt(i_set(-1), walk->medium[i]), mine; m_any(left); left = left & ~mine) {
        int32_t id = i_lane(walk->medium[i], m_first(left));
        const MediumNode *medium = t->scene->media + id;
        mine = left & mi_eq(walk->medium[i], i_set(id));
        if (!box_is_live(t, id) && !(turn && medium->bounded)) {
            continue;
        }
        const VolumeNode *v = t->scene->volumes + medium->sigma_t;
        Face face[2];
        medium_faces(t->scene, v, walk->o[i], walk->d, walk->length[i], mine, face);
        for (int k = 0; k < 2; k++) {
            Float at = f_select(face[k].m, face[k].at, f_set(0));
            Vec3 p = v3_madd(walk->o[i], at, walk->d);
            Filling f = medium_filling(t, id, face_inside(p, walk->d, k), walk->d);
            Float dx = f_zero_unless(face[k].m, spec_dot(dt, f.extinction));
            dx = k ? -dx : dx;
            if (box_is_live(t, id)) {
                face_adj(t->scene, v, face + k, walk->d, dx, sink);
            }
            if (turn) {
                Float far = f_zero_unless(face[k].m, v3_dot(v3_sub(p, turn->from), walk->d));
                Vec3 share = face_turn(face + k, walk->d, dx);
                turn->d = v3_madd(turn->d, -far, share);
                turn->shift = v3_sub(turn->shift, share);
            }
        }
    }
}

// Notes lights at a point that lie within medium `id` and are not known there, as it seems at the ends of rays along d. Some rays
// slip through the edges of borders: a second one, from the light to the side, says whether it is so.
static NOINLINE void watch_light(const Tracer *t, Vec3 end, int32_t id, Vec3 d, Mask seems, Sink *sink) {
    if (!m_any(seems) || (sink->faces & LIGHT_WITHIN)) {
        return;
    }
    Frame across = frame_from_normal(d);
    Int medium = medium_around(t, end, v3_normalize(v3_madd(across.s, f_set(0.37f), across.t)), seems);
    sink->faces |= m_any(seems & mi_eq(medium, i_set(id))) ? LIGHT_WITHIN : 0;
}

// Slopes of the extinction along the pieces of a walk, and the extinction at its end.
static NOINLINE void turned_fog_adj(const Tracer *t, const Walk *walk, Spec dt, const SampleKey *key, Turn *turn, Sink *sink) {
    const SceneView *scene = t->scene;
    for (int32_t i = 0; i < walk->segments; i++) {
        for (Mask left = mi_lt(i_set(-1), walk->medium[i]), mine; m_any(left); left = left & ~mine) {
            int32_t id = i_lane(walk->medium[i], m_first(left));
            const MediumNode *medium = scene->media + id;
            mine = left & mi_eq(walk->medium[i], i_set(id));
            Float low = f_set(0), high = walk->length[i];
            Mask ends = mine & m_finite(high) & (i < walk->count ? ~walk->m[i] : mine);
            if (m_any(ends)) {
                Vec3 end = v3_madd(walk->o[i], f_select(ends, high, f_set(0)), walk->d);
                Filling f = medium_filling(t, id, end, walk->d);
                turn->distance = turn->distance - f_zero_unless(ends, spec_dot(dt, f.extinction));
                Mask unknown = ends & turn->points & ~turn->beacons;
                watch_light(t, end, id, walk->d, unknown & m_gt(spec_max(f.extinction), f_set(0)), sink);
            }
            const VolumeNode *v = scene->volumes + medium->sigma_t;
            medium_span(scene, medium, v, walk->o[i], walk->d, &low, &high);
            Mask m = mine & m_gt(high, low) & m_finite(high);
            if (!(v->kind == VOLUME_GRID || medium->flakes >= 0) || !m_any(m)) {
                continue;
            }
            Spec lost = spec_scale(dt, (high - low) * ((real)-1 / FLIGHT_POINTS));
            for (int k = 0; k < FLIGHT_POINTS; k++) {
                Float at = f_select(m, flight_point(low, high, key, (uint32_t)(i * FLIGHT_POINTS), k), f_set(0));
                Vec3 p = v3_madd(walk->o[i], at, walk->d), slope = v3_zero();
                extinction_slope(scene, medium, LOSS, p, walk->d, lost, m, &slope, &turn->d);
                turn->d = v3_madd(turn->d, f_zero_unless(m, v3_dot(v3_sub(p, turn->from), walk->d)), slope);
                turn->shift = v3_add(turn->shift, slope);
            }
        }
    }
}

// Accumulates the adjoint dt of a walk's transmittance, whose value is `transmittance`, as borders move and, unless turn is
// null, as the ray turns.
static void passage_move_adj(const Tracer *t, const Walk *walk, Spec transmittance, Spec dt, const SampleKey *key, Turn *turn,
                             Sink *sink) {
    dt = spec_mul(dt, transmittance);
    for (int32_t i = 0; i < walk->count && (t->job->any_borders || t->job->rides || turn); i++) {
        passed_surfaces_adj(t, walk, i, dt, turn, sink);
    }
    for (int32_t i = 0; i < walk->segments; i++) {
        passed_boxes_adj(t, walk, i, dt, turn, sink);
    }
    if (turn) {
        turned_fog_adj(t, walk, dt, key, turn, sink);
    }
}
