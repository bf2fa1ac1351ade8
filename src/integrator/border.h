// border.h: where media begin and end, and what happens when such a border moves. A ray along d crosses it at x, and with n its
// normal and v its velocity the crossing moves along the ray by dx = n . v / n . d. The stretch dx passes from the medium
// behind x to the one in front of it, so that with L the radiance that comes from x
//   dL = dx T(x) ([s a S + j - s L] in front of x - [s a S + j - s L] behind x),                             (1)
// s the extinction, a S what is scattered towards the ray per unit of scattering coefficient, and j the emission; along shadow
// rays dT = dx T (s behind - s in front). Nothing hides anything there, so that there is no other term. docs/derivations/media.md.
// Borders are surfaces of the kind null, and the boxes of heterogeneous media. Where the two coincide, the border is the
// surface's. What is scattered is found by a path of its own, at one border of each path.
#pragma once

#include "integrator/carried.h"
#include "integrator/glide.h"
#include "integrator/probe.h"
#include "shape/move.h"

// Rays that graze a border more than this count as parallel to it.
#define LEAST_COSINE 1e-6f

// Where a ray crosses the box of a medium: a face of it.
typedef struct Face {
    Int axis;
    Mask upper, m;
    Float at;     // distance
} Face;

// The part of s a S + j - s L along d at a point of a medium that does not scatter, and s; 0 outside of the medium.
typedef struct Filling {
    Spec extinction, emission;
} Filling;

static NOINLINE Filling medium_filling(const Tracer *t, int32_t id, Vec3 p, Vec3 d) {
    const SceneView *scene = t->scene;
    const MediumNode *medium = scene->media + id;
    Track track = track_of(t, id);
    Filling f = {.emission = spec_zero()};
    Mask inside = m_set(true);
    if (medium->bounded) {
        const Float at[3] = {p.x, p.y, p.z};
        for (int k = 0; k < 3; k++) {
            real corner, size;
            medium_box(scene, track.sigma_t, k, &corner, &size);
            inside = inside & m_ge(at[k], f_set(corner)) & m_le(at[k], f_set(corner + size));
        }
    }
    f.extinction = spec_zero_unless(inside, medium_extinction(scene, &track, p, d));
    if (medium->emission >= 0) {
        const VolumeNode *emission = scene->volumes + medium->emission;
        f.emission = spec_zero_unless(inside, volume_eval(scene, emission, volume_to_local(scene, emission, p, 1)));
    }
    return f;
}

// The faces at which a ray enters and leaves the box of a medium before tmax. Faces that coincide with a surface at which the
// ray begins or ends are none.
static NOINLINE void medium_faces(const SceneView *scene, const VolumeNode *v, Vec3 o, Vec3 d, Float tmax, Mask m,
                                  Face face[2]) {
    const Float p[3] = {o.x, o.y, o.z}, q[3] = {d.x, d.y, d.z};
    Float low = f_set(-INFINITY), high = f_set(INFINITY), apart[2] = {f_set(0), f_set(0)};
    Float far = f_min(tmax, f_set(1e30f)), least = (1.0f + f_max(f_max(f_abs(o.x), f_abs(o.y)), f_abs(o.z))) * 1.5e-4f;
    face[0].axis = face[1].axis = i_set(0);
    face[0].upper = face[1].upper = m_set(false);
    for (int k = 0; k < 3; k++) {
        real corner, size;
        medium_box(scene, v, k, &corner, &size);
        Float first = f_set(-INFINITY), last = f_set(INFINITY);
        slab((p[k] - corner) * (1 / size), q[k] * (1 / size), &first, &last);
        Mask up = m_gt(q[k], f_set(0)), enters = m_gt(first, low), leaves = m_lt(last, high);
        low = f_max(low, first);
        high = f_min(high, last);
        face[0].axis = i_select(enters, i_set(k), face[0].axis);
        face[1].axis = i_select(leaves, i_set(k), face[1].axis);
        face[0].upper = (face[0].upper & ~enters) | (enters & ~up);
        face[1].upper = (face[1].upper & ~leaves) | (leaves & up);
        // How far the ray's ends are from the faces' planes.
        apart[0] = f_select(enters, first * f_abs(q[k]), apart[0]);
        apart[1] = f_select(leaves, (far - last) * f_abs(q[k]), apart[1]);
    }
    Mask crosses = m & m_lt(low, high);
    face[0].at = low;
    face[1].at = high;
    face[0].m = crosses & m_gt(low, f_set(0)) & m_lt(low, far) & m_gt(apart[0], least);
    face[1].m = crosses & m_gt(high, f_set(0)) & m_lt(high, far) & m_gt(apart[1], least);
}

// Accumulates the adjoint dx of the distances at which rays along d cross faces.
static NOINLINE void face_adj(const SceneView *scene, const VolumeNode *v, const Face *face, Vec3 d, Float dx, Sink *sink) {
    const int32_t at = sink->volume_at[v - scene->volumes];
    if (at < 0) {
        return;
    }
    const Float along[3] = {d.x, d.y, d.z};
    for (int k = 0; k < 3; k++) {
        Mask m = face->m & mi_eq(face->axis, i_set(k)) & m_gt(f_abs(along[k]), f_set(LEAST_COSINE));
        Float share = f_zero_unless(m, dx * f_safe_rcp(along[k]));
        // Half of x + y + z -+ (|x| + |y| + |z|) + t, of the row of to_world.
        for (int j = 0; j < 3; j++) {
            real x = (real)scene->theta[v->to_world + 4 * k + j], half = x > 0 ? (real)0.5 : x < 0 ? (real)-0.5 : 0;
            sink_add_uniform(sink, at + 4 * k + j, share * (f_select(face->upper, f_set(half), f_set(-half)) + (real)0.5), m);
        }
        sink_add_uniform(sink, at + 4 * k + 3, share, m);
    }
}

// What the adjoint dx is worth to points of the ray that move: all over along.
static NOINLINE Vec3 face_turn(const Face *face, Vec3 d, Float dx) {
    Vec3 share = v3_zero();
    const Float along[3] = {d.x, d.y, d.z};
    Float *own[3] = {&share.x, &share.y, &share.z};
    for (int k = 0; k < 3; k++) {
        Mask m = face->m & mi_eq(face->axis, i_set(k)) & m_gt(f_abs(along[k]), f_set(LEAST_COSINE));
        *own[k] = f_zero_unless(m, dx * f_safe_rcp(along[k]));
    }
    return share;
}

// A point of a medium's box next to where a ray enters it, or leaves it.
KFN Vec3 face_inside(Vec3 p, Vec3 d, bool leaves) {
    Float step = (1.0f + f_max(f_max(f_abs(p.x), f_abs(p.y)), f_abs(p.z))) * 1e-5f;
    return v3_madd(p, leaves ? -step : step, d);
}

// ---- the border with the path's probe ----------------------------------------------------------------------------

KFN bool box_is_live(const Tracer *t, int32_t medium) {
    return (t->job->live[t->scene->groups_count + medium] & LIVE_BORDER) != 0;
}

// Whether the surfaces of a batch are borders that move.
KFN bool border_is_live(const Tracer *t, const RecordBatch *batch) {
    bool moves = t->job->any_borders && (t->job->live[batch->group] & LIVE_MOTION);
    return batch->tag == VERTEX_SURFACE && (moves || t->job->glides || t->job->rides);
}

// Offers points of the records from `at` on to the paths' reservoirs, each with the medium that it is in.
static void border_offer(Tracer *t, const RecordBatch *batch, int side, Int slot, int32_t medium, Vec3 p, Vec3 d, Float worth,
                         Mask m) {
    Workspace *ws = &t->ws;
    SampleKey key = stream_key(t, slot, batch->bounce, STREAM_PROBE);
    uint32_t dimension = 8 + (uint32_t)side + (batch->tag == VERTEX_FLIGHT ? 2 : 0);
    worth = f_zero_unless(m & m_finite(worth), worth);
    Float total = real_gather(ws->border_total, slot) + worth;
    Mask take = m & m_gt(worth, f_set(0)) & m_lt(rng_1d(&key, dimension) * total, worth);
    f_scatter(ws->border_total, slot, total, m);
    i_scatter(ws->border, slot, i_iota() + batch->first, take);
    i_scatter(ws->border_side, slot, i_set(side), take);
    i_scatter(ws->border_medium, slot, i_set(medium), take);
    i_scatter(ws->border_depth, slot, i_load(ws->records.depth + batch->first), take);
    f_scatter(ws->border_worth, slot, worth, take);
    f_scatter(ws->border_x, slot, p.x, take);
    f_scatter(ws->border_y, slot, p.y, take);
    f_scatter(ws->border_z, slot, p.z, take);
    f_scatter(ws->border_dx, slot, d.x, take);
    f_scatter(ws->border_dy, slot, d.y, take);
    f_scatter(ws->border_dz, slot, d.z, take);
}

// What is scattered at the records' borders, as the path of the probe has found it; elsewhere 0.
KFN Spec border_scattered(const Tracer *t, const RecordBatch *batch, int side, Int slot, Mask m) {
    const Workspace *ws = &t->ws;
    m = m & mi_eq(i_gather(ws->border, slot), i_iota() + batch->first) & mi_eq(i_gather(ws->border_side, slot), i_set(side));
    Float one_over = real_gather(ws->border_total, slot) * f_safe_rcp(real_gather(ws->border_worth, slot));
    Spec s = spec_scale(spec_gather(ws->border_scattered, slot), one_over);
    return spec_zero_unless(m & m_finite(spec_sum(s)), s);
}

// s a S + j - s L
KFN Spec border_gain(const Filling *f, Spec scattered, Spec radiance) {
    return spec_add(spec_mul(f->extinction, spec_sub(scattered, radiance)), f->emission);
}

// The point of the ray that led to the records whose adjoint is kept: its end, or where it has none, `from`, which is noted.
static Vec3 ride_reference(const Tracer *t, Int slot, Vec3 from, Mask m) {
    const Workspace *ws = &t->ws;
    Mask open = mi_eq(i_gather(ws->next, slot), i_set(NEXT_NONE));
    Vec3 ref = v3_select(open, from, LOAD_V3(*ws, next_px, next_py, next_pz, slot));
    next_point(t, slot, from, m & open);
    return ref;
}

// Where surfaces move (ride.h): adds the adjoint `all` of points of the ray that led to the records to that of the vertex where it
// began, or to the sensor. Where it ends at an attached vertex, that turns it: `end` is the part that what is attached there asks
// for.
static NOINLINE void ride_add(const Tracer *t, const RecordBatch *batch, int channel, Int slot, const Glide *all,
                              const Glide *end, Sink *sink, Mask m) {
    const Workspace *ws = &t->ws;
    const Carried first = {all->position, all->turn};
    first_ride_adj(t, batch, slot, all->ref, &first, sink, m);
    rows_scatter(&ws->drag, channel, slot, v3_add(rows_gather(&ws->drag, channel, slot), all->position), m);
    Int next = i_gather(ws->next, slot);
    Mask still = mi_eq(next, i_set(NEXT_STILL)), slides = ~still & records_slide(t, batch->first);
    Mask attached = m & ~slides & (still | mi_lt(i_set(-1), next));
    Vec3 turn = v3_select(slides, all->turn, end->turn);
    rows_scatter(&ws->turn, channel, slot, v3_add(rows_gather(&ws->turn, channel, slot), turn), (m & slides) | attached);
    if (m_any(attached)) {
        rows_scatter(&ws->pull, channel, slot, v3_add(rows_gather(&ws->pull, channel, slot), end->position), attached);
    }
}

// The same of one point p of the ray along d, given dp and the part of it that the end asks for.
static void ride_add_point(const Tracer *t, const RecordBatch *batch, int channel, Int slot, Vec3 p, Vec3 d, Vec3 dp, Vec3 attached,
                           Sink *sink, Mask m) {
    Glide end = {.ref = ride_reference(t, slot, p, m), .d = d}, all = end;
    glide_add(&end, p, attached, m);
    glide_add(&all, p, dp, m);
    ride_add(t, batch, channel, slot, &all, &end, sink, m);
}

// ---- surfaces ----------------------------------------------------------------------------------------------------

typedef struct BorderSurface {
    const Group *group;
    Mask m;
    Int slot, medium[2]; // in front and behind
    Hit hit;
    Interaction si;
    Vec3 d, p[2];        // points of the two
    Spec beta;
    Float rcp;           // 1 / n . d
} BorderSurface;

static NOINLINE BorderSurface border_surface(const Tracer *t, const RecordBatch *batch) {
    const Records *r = &t->ws.records;
    const int32_t at = batch->first;
    BorderSurface s = {.group = t->scene->groups + batch->group, .m = m_first_n(batch->count)};
    s.slot = i_select(s.m, i_load(r->slot + at), i_set(0));
    s.hit = (Hit){i_load(r->shape + at), i_load(r->prim + at), f_load(r->u + at), f_load(r->v + at),
                  record_v3(r->px, r->py, r->pz, at), i_load(r->instance + at)};
    s.d = record_v3(r->dx, r->dy, r->dz, at);
    s.beta = spec_load(r->beta, at);
    s.si = shape_interaction(t->scene, s.group->shape_kind, s.group->shape_flags, &s.hit);
    Float cosine = v3_dot(s.si.ng, s.d);
    s.m = s.m & m_gt(f_abs(cosine), f_set(LEAST_COSINE));
    s.rcp = f_safe_rcp(f_select(s.m, cosine, f_set(1)));
    s.medium[0] = i_load(r->medium + at);
    s.medium[1] = medium_passed(t, s.group, &s.si, &s.hit, s.d, s.medium[0], s.m);
    s.p[0] = interaction_offset(&s.si, v3_neg(s.d));
    s.p[1] = interaction_offset(&s.si, s.d);
    return s;
}

// Lanes of m whose paths went on along their rays.
KFN Mask border_passed(const Tracer *t, const RecordBatch *batch, Mask m) {
    return m & lobe_is(i_load(t->ws.records.lobe + batch->first), LOBE_NULL);
}

static void border_surface_offer(Tracer *t, const RecordBatch *batch) {
    BorderSurface s = border_surface(t, batch);
    const bool veil = group_is_veil(t, s.group);
    const int sides = veil || group_is_null(t->scene, s.group) ? 2 : 1; // behind others, other rays begin
    for (int side = 0; side < sides; side++) {
        if (veil && side) { // of which not all paths pass
            s.m = border_passed(t, batch, s.m);
            s.beta = spec_mul(s.beta, spec_load(t->ws.records.weight, batch->first));
        }
        for (Mask left = s.m & mi_lt(i_set(-1), s.medium[side]), mine; m_any(left); left = left & ~mine) {
            int32_t id = i_lane(s.medium[side], m_first(left));
            mine = left & mi_eq(s.medium[side], i_set(id));
            Filling f = medium_filling(t, id, s.p[side], s.d);
            border_offer(t, batch, side, s.slot, id, s.p[side], s.d, spec_dot(s.beta, f.extinction) * f_abs(s.rcp), mine);
        }
    }
}

// What a border's motion along the ray brings; *lost: what of that the attached part of the radiance from beyond it loses.
static NOINLINE Spec border_jump(const Tracer *t, const RecordBatch *batch, const BorderSurface *s, Spec radiance, Spec attached,
                                 Spec *lost) {
    Spec jump = spec_zero();
    *lost = spec_zero();
    for (int side = 0; side < 2; side++) {
        Float sign = f_set(side ? -1 : 1);
        for (Mask left = s->m & mi_lt(i_set(-1), s->medium[side]), mine; m_any(left); left = left & ~mine) {
            int32_t id = i_lane(s->medium[side], m_first(left));
            mine = left & mi_eq(s->medium[side], i_set(id));
            Filling f = medium_filling(t, id, s->p[side], s->d);
            Spec gain = border_gain(&f, border_scattered(t, batch, side, s->slot, mine), radiance);
            jump = spec_add(jump, spec_zero_unless(mine, spec_scale(gain, sign)));
            *lost = spec_sub(*lost, spec_zero_unless(mine, spec_scale(spec_mul(f.extinction, attached), sign)));
        }
    }
    return jump;
}

static void border_surface_sweep(Tracer *t, const RecordBatch *batch, Spec suffix, Mask finite, Sink *sink) {
    BorderSurface s = border_surface(t, batch);
    Spec weight = spec_load(t->ws.records.weight, batch->first), lost;
    Spec attached = spec_mul(weight, spec_gather(t->ws.attached, s.slot));
    Spec jump = border_jump(t, batch, &s, spec_mul(weight, suffix), attached, &lost);
    Mask m = s.m & finite & m_finite(spec_sum(jump));
    for (int c = 0; c < drives(t); c++) {
        Float dx = spec_dot(spec_mul(slot_adjoint(t, s.slot, c), s.beta), jump);
        SurfaceAdj d = surface_adj_zero();
        d.p = v3_scale(s.si.ng, f_zero_unless(m, dx * s.rcp));
        if (t->job->live[batch->group] & LIVE_MOTION) {
            shape_move_adj(t->scene, s.group->shape_kind, s.group->shape_flags, &s.hit, &s.si, &d, sink, m);
        }
        if (t->job->glides) {
            Glide g = glide_load(t, c, s.slot, glide_reference(t, s.slot, s.hit.p), s.d);
            glide_add(&g, s.hit.p, v3_neg(d.p), m);
            glide_store(t, &g, c, s.slot, m);
        } else if (t->job->rides) {
            Float loses = spec_dot(spec_mul(slot_adjoint(t, s.slot, c), s.beta), lost) * s.rcp;
            ride_add_point(t, batch, c, s.slot, s.hit.p, s.d, v3_neg(d.p), v3_scale(s.si.ng, -loses), sink, m);
        }
        forward_flush(t, sink, s.slot, c, m);
    }
    if (t->job->glides) {
        glide_refer(t, s.slot, glide_reference(t, s.slot, s.hit.p), m);
    }
}

// ---- boxes -------------------------------------------------------------------------------------------------------

typedef struct BorderBox {
    const VolumeNode *sigma_t;
    Mask m;
    Int slot;
    Vec3 o, d, p[2];
    Spec beta, weight[2]; // weight: of the flight at the faces
    Face face[2];
    Filling inside[2];
} BorderBox;

static NOINLINE BorderBox border_box(const Tracer *t, const RecordBatch *batch) {
    const Records *r = &t->ws.records;
    const int32_t at = batch->first;
    BorderBox b = {.sigma_t = t->scene->volumes + t->scene->media[batch->group].sigma_t, .m = m_first_n(batch->count)};
    b.slot = i_select(b.m, i_load(r->slot + at), i_set(0));
    b.o = record_v3(r->px, r->py, r->pz, at);
    b.d = record_v3(r->dx, r->dy, r->dz, at);
    b.beta = spec_load(r->beta, at);
    medium_faces(t->scene, b.sigma_t, b.o, b.d, f_load(r->sw + at), b.m, b.face);
    // All flights get to the first face, to the second one those that do not collide.
    b.face[1].m = b.face[1].m & ~(Mask)i_load(r->prim + at);
    b.weight[0] = spec_set(f_set(1));
    b.weight[1] = spec_load(r->weight, at);
    for (int k = 0; k < 2; k++) {
        b.face[k].at = f_select(b.face[k].m, b.face[k].at, f_set(0));
        b.p[k] = v3_madd(b.o, b.face[k].at, b.d);
        b.inside[k] = medium_filling(t, batch->group, face_inside(b.p[k], b.d, k), b.d);
    }
    return b;
}

// 1 / n . d of faces.
static Float face_slant(const BorderBox *b, int k) {
    Int axis = b->face[k].axis;
    Float along = f_select(mi_eq(axis, i_set(0)), b->d.x, f_select(mi_eq(axis, i_set(1)), b->d.y, b->d.z));
    return f_safe_rcp(f_abs(along));
}

static void border_box_offer(Tracer *t, const RecordBatch *batch) {
    BorderBox b = border_box(t, batch);
    for (int k = 0; k < 2; k++) {
        Spec there = spec_mul(b.beta, b.weight[k]);
        border_offer(t, batch, k, b.slot, batch->group, b.p[k], b.d,
                     spec_dot(there, b.inside[k].extinction) * face_slant(&b, k), b.face[k].m);
    }
}

// onward, emission: what the flight's end and its way bring; attached: the part of the former that is attached to the end.
static void border_box_sweep(Tracer *t, const RecordBatch *batch, Spec onward, Spec attached, Spec emission, Mask finite,
                             Sink *sink) {
    BorderBox b = border_box(t, batch);
    Spec gain[2];
    for (int k = 0; k < 2; k++) {
        // Of the weight times L, which `onward` is.
        Spec own = border_gain(b.inside + k, border_scattered(t, batch, k, b.slot, b.face[k].m), spec_zero());
        Spec radiance = k ? onward : spec_add(onward, emission);
        gain[k] = spec_sub(spec_mul(b.weight[k], own), spec_mul(b.inside[k].extinction, radiance));
        b.face[k].m = b.face[k].m & finite & m_finite(spec_sum(gain[k]));
    }
    for (int c = 0; c < drives(t); c++) {
        Spec delta = spec_mul(slot_adjoint(t, b.slot, c), b.beta);
        for (int k = 0; k < 2; k++) {
            Float dx = f_zero_unless(b.face[k].m, spec_dot(delta, gain[k]));
            dx = k ? dx : -dx;
            face_adj(t->scene, b.sigma_t, b.face + k, b.d, dx, sink);
            if (t->job->glides) {
                Glide g = glide_load(t, c, b.slot, glide_reference(t, b.slot, b.o), b.d);
                glide_add(&g, b.p[k], v3_neg(face_turn(b.face + k, b.d, dx)), b.face[k].m);
                glide_store(t, &g, c, b.slot, b.face[k].m);
            } else if (t->job->rides) {
                Float lost = spec_dot(delta, spec_mul(b.inside[k].extinction, attached));
                Vec3 all = face_turn(b.face + k, b.d, dx), end = face_turn(b.face + k, b.d, k ? -lost : lost);
                ride_add_point(t, batch, c, b.slot, b.p[k], b.d, v3_neg(all), v3_neg(end), sink, b.face[k].m);
            }
        }
        forward_flush(t, sink, b.slot, c, b.m);
    }
    if (t->job->glides) {
        glide_refer(t, b.slot, glide_reference(t, b.slot, b.o), b.face[0].m | b.face[1].m);
    }
}

// ---- probes ------------------------------------------------------------------------------------------------------

static void border_choose(Tracer *t, int32_t count) {
    Workspace *ws = &t->ws;
    for (int32_t i = 0; i < count; i++) {
        ws->border[i] = -1;
        ws->border_total[i] = 0;
    }
    for (int32_t b = 0; b < t->batch_count; b++) {
        const RecordBatch *batch = ws->batches + b;
        if (border_is_live(t, batch)) {
            border_surface_offer(t, batch);
        } else if (batch->tag == VERTEX_FLIGHT && box_is_live(t, batch->group)) {
            border_box_offer(t, batch);
        }
    }
}

static void border_start(Tracer *t, int32_t count) {
    const Workspace *ws = &t->ws;
    int32_t n = 0;
    for (int32_t k = 0; k < count; k += LANES) {
        Int slot = i_select(m_first_n(count - k), i_iota() + k, i_set(0));
        Mask m = m_first_n(count - k) & mi_lt(i_set(-1), i_gather(ws->border, slot));
        Vec3 o = LOAD_V3(*ws, border_x, border_y, border_z, slot), d = LOAD_V3(*ws, border_dx, border_dy, border_dz, slot);
        Int medium = i_gather(ws->border_medium, slot);
        n += probe_push(t, n, o, d, medium, i_gather(ws->border_depth, slot), slot, m);
    }
    probes_begin(t, n);
}

static void border_stage(Tracer *t, int32_t *begin, int32_t count) {
    const Tracer before = *t;
    border_choose(t, count);
    border_start(t, count);
    probes_run(t, begin, count, 0x626f7264u, t->ws.border_scattered);
    *t = before;
}
