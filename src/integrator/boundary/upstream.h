// upstream.h: the way of boundary segments from their near points on towards the sensor, as far as it moves with them.
// A vertex that the sensor sees slides over its surface, and so does one that is seen in mirrors or through glass:
// chains keep the direction at the vertex before them (path_move.h), and the ray that they make carries what lies on it
// along. All others are attached, and what comes before them has no part in the motion. Per slot and level, the number
// of a near vertex, this keeps where it lies and how the particle came and went on. The motion is followed from the
// edge upstream:
//   drag, turn   adjoints of the position of the ray at the vertex before, and of its direction;
//   level j      an ordinary vertex: `seen` by the sensor it slides, `unseen` it is attached, both with its own worth,
//                or it slides along the ray of a chain that begins at level j + 1;
//                or one that mirrors or refracts: drag and turn go on through it;
//                or a collision, which rides along with the vertex that its ray comes from (ride.h), in a fixed direction: the drag
//                goes on, and an ordinary vertex at level j - 1 slides along the ray from there to it.
#pragma once

#include "integrator/boundary/segments.h"

// How a level was met: along a ray that its own direction fixes, or from an ordinary vertex that may be attached.
enum { UPSTREAM_NONE, UPSTREAM_RAY, UPSTREAM_POINT, UPSTREAM_REST };

// The vertices of one level as a batch.
typedef struct UpstreamVertex {
    Hit hit;
    Vec3 d;  // of the particle that came here
    Int met, lobe;
} UpstreamVertex;

KFN UpstreamVertex upstream_load(const Segments *q, int32_t level, int32_t k) {
    const Upstream *u = q->up + level;
    UpstreamVertex v = {.hit = {i_load(u->shape + k), i_load(u->prim + k), f_load(u->u + k), f_load(u->v + k),
                                record_v3(u->x, u->y, u->z, k), i_load(u->instance + k)},
                        .d = record_v3(u->dx, u->dy, u->dz, k),
                        .met = i_load(u->met + k),
                        .lobe = i_load(u->lobe + k)};
    return v;
}

KFN void upstream_begin(Segments *q) {
    const size_t bytes = CHUNK * sizeof(int32_t);
    for (int32_t k = 0; k < CHUNK; k++) {
        q->arrived[k] = UPSTREAM_RAY;
        q->level[k] = 0;
        q->full[k] = 0;
    }
    for (int j = 0; j < MOST_UPSTREAM; j++) {
        memset(q->up[j].met, 0, bytes);
    }
    q->levels = 0;
}

// Notes where the particles of a bounce have arrived. Ways with more levels than there is room for end. kind: that of the boundary.
static void upstream_arrive(Tracer *t, Segments *q, int32_t bounce, int32_t kind) {
    const Workspace *ws = &t->ws;
    const Paths *p = &ws->paths[t->current];
    for (int32_t k = 0; k < t->active; k += LANES) {
        Mask m = m_first_n(t->active - k);
        Int slot = i_select(m, i_load(p->slot + k), i_set(0)), arrived = i_gather(q->arrived, slot);
        Mask collides = m & mi_lt(i_set((int32_t)t->scene->groups_count), i_load(ws->hit_group + k));
        m = m & (mi_eq(arrived, i_set(UPSTREAM_RAY)) | mi_eq(arrived, i_set(UPSTREAM_POINT))) &
            (collides | mi_lt(i_set(-1), i_load(ws->hit_shape + k)));
        if (bounce >= MOST_UPSTREAM) {
            i_scatter(q->arrived, slot, i_set(UPSTREAM_NONE), m);
            continue;
        }
        Upstream *u = q->up + bounce;
        i_scatter(u->shape, slot, i_select(collides, i_set(-1), i_load(ws->hit_shape + k)), m);
        i_scatter(u->prim, slot, i_load(ws->hit_prim + k), m);
        i_scatter(u->instance, slot, i_load(ws->hit_instance + k), m);
        i_scatter(u->met, slot, arrived, m);
        i_scatter(u->lobe, slot, i_set(LOBE_SMOOTH), m);
        f_scatter(u->u, slot, f_load(ws->hit_u + k), m);
        f_scatter(u->v, slot, f_load(ws->hit_v + k), m);
        f_scatter(u->x, slot, f_load(ws->hit_x + k), m);
        f_scatter(u->y, slot, f_load(ws->hit_y + k), m);
        f_scatter(u->z, slot, f_load(ws->hit_z + k), m);
        f_scatter(u->dx, slot, f_load(p->dx + k), m);
        f_scatter(u->dy, slot, f_load(p->dy + k), m);
        f_scatter(u->dz, slot, f_load(p->dz + k), m);
        f_scatter(u->seen, slot, f_set(0), m);
        f_scatter(u->unseen, slot, f_set(0), m);
        f_scatter(u->passed, slot, f_set(0), m);
        i_scatter(q->arrived, slot, i_set(UPSTREAM_RAY), m & collides);
        if (bounce == 0 && boundary_is_chained(kind)) {
            i_scatter(q->full, slot, i_set(1), m & collides);
        }
        q->levels = bounce + 1;
    }
}

// The particles of m, vertices of one bounce, have gone on with the lobes that the tracer has noted. kind: that of the boundary.
static void upstream_leave(const Tracer *t, Segments *q, Int slot, int32_t bounce, int32_t kind, Mask m) {
    Int arrived = i_gather(q->arrived, slot), lobe = i_gather(t->lobes, slot);
    Mask ray = m & mi_eq(arrived, i_set(UPSTREAM_RAY)), point = m & mi_eq(arrived, i_set(UPSTREAM_POINT));
    Mask turns = lobe_follows(lobe) & (ray | point), ends = point & ~turns;
    if (bounce >= MOST_UPSTREAM) {
        return;
    }
    i_scatter(q->up[bounce].lobe, slot, lobe, ray | point);
    i_scatter(q->arrived, slot, i_select(turns, i_set(UPSTREAM_RAY), i_set(UPSTREAM_POINT)), ray | point);
    i_scatter(q->arrived, slot, i_set(UPSTREAM_REST), ends);
    i_scatter(q->level, slot, i_set(bounce - 1), ends);
    if (bounce == 0) {
        // Segments that are not rays at their near points have ordinary ends only.
        const bool chained = boundary_is_chained(kind);
        i_scatter(chained ? q->full : q->arrived, slot, i_set(chained ? 1 : UPSTREAM_NONE), turns);
        if (boundary_is_horizon(kind)) { // nothing that passes lies in the plane of its triangle
            i_scatter(q->arrived, slot, i_set(UPSTREAM_NONE), turns & lobe_is(lobe, LOBE_NULL));
        }
    }
}

// Where the worth of what a slot brings at a bounce is kept, or in forward mode its rate; null: nowhere.
KFN real *upstream_row(const Segments *q, int32_t slot, int32_t bounce) {
    switch (q->arrived[slot]) {
    case UPSTREAM_RAY:
        return q->up[bounce].seen;
    case UPSTREAM_POINT:
        return q->up[bounce - 1].unseen;
    case UPSTREAM_REST:
        return q->up[q->level[slot]].unseen;
    default:
        return NULL;
    }
}

// ---- motion ------------------------------------------------------------------------------------------------------

// Where rays along d meet surfaces, with the adjoint of those points: returns that of the rays' positions.
static Vec3 rays_meet_adj(const Tracer *t, const Hit *hit, Vec3 d, Vec3 dp, Sink *sink, Mask m) {
    SurfaceAdj worth = surface_adj_zero();
    worth.p = dp;
    return rays_find_adj(t, hit, d, &worth, sink, m);
}

// Rays along d that are mirrored or refracted into wo, to meet something at a distance: carries the adjoints of their
// position there and of their direction back. Rays that pass stay the same lines.
static Carried rays_turn_adj(const Tracer *t, const Hit *hit, Vec3 d, Vec3 wo, Int lobe, Float distance,
                             const Carried *ahead, Sink *sink, Mask m) {
    const SceneView *scene = t->scene;
    Mask passes = m & lobe_is(lobe, LOBE_NULL);
    Vec3 turn = v3_madd(ahead->turn, distance, ahead->drag);
    Carried back = {v3_select(passes, ahead->drag, v3_zero()), v3_select(passes, turn, v3_zero())};
    for (Mask left = m & ~passes; m_any(left);) {
        int32_t id;
        SurfaceSweep s = {.m = m_set(false)};
        Mask mine = take_group(scene, hit, &left, &id, &s.hit);
        s.group = scene->groups + id;
        s.si = shape_interaction(scene, s.group->shape_kind, s.group->shape_flags, &s.hit);
        s.m = mine;
        s.d = d;
        s.wi = frame_to_local(&s.si.sh, v3_neg(d));
        s.wo = frame_to_local(&s.si.sh, wo);
        s.call = bsdf_call(scene, s.group->bsdf, texcoord(s.si.uv, &s.hit), t->floor);
        VertexAdj v;
        vertex_adj_clear(&v, true);
        if (scene->bsdfs[s.group->bsdf].surface) {
            find_surface(scene, s.group, &s.hit, &s.surface, &s.dp_dv);
            s.call.surface = &s.surface;
            s.call.dsurface = &v.surface;
        }
        // d' = to_world(wo(wi)), and the ray's position is p + distance d'
        Vec3 sampled = v3_select(mine, turn, v3_zero());
        Vec3 dwo = frame_to_local(&s.si.sh, sampled);
        frame_to_world_adj(s.wo, sampled, &v.frame);
        Int own = i_select(mine, lobe, i_set(LOBE_SMOOTH));
        bsdf_adj(&s.call, s.wi, s.wo, own, spec_zero(), sink, mine, &v.wi, &dwo, &v.uv);
        Carried one = {v3_zero(), v3_zero()};
        vertex_place_adj(t, &s, &v, v3_select(mine, ahead->drag, v3_zero()), mine, t->job->live[id], &one, sink);
        back.drag = v3_select(mine, one.drag, back.drag);
        back.turn = v3_select(mine, one.turn, back.turn);
    }
    return back;
}

// The lanes of m whose level turned the way into a chain: takes `c` through it.
static void upstream_turn_adj(const Tracer *t, const Segments *q, int32_t level, int32_t k, Carried *c, Sink *sink,
                              Mask m) {
    UpstreamVertex at = upstream_load(q, level, k), before;
    Int next_met = level + 1 < MOST_UPSTREAM ? i_load(q->up[level + 1].met + k) : i_set(UPSTREAM_NONE);
    m = m & mi_lt(i_set(UPSTREAM_NONE), at.met) & lobe_follows(at.lobe) & mi_eq(next_met, i_set(UPSTREAM_RAY));
    if (!m_any(m)) {
        return;
    }
    Mask slides = m & mi_eq(at.met, i_set(UPSTREAM_POINT));
    Vec3 onwards = v3_neg(at.d), from = record_v3(q->edge_x, q->edge_y, q->edge_z, k);
    if (level > 0) {
        before = upstream_load(q, level - 1, k);
        from = before.hit.p;
        if (m_any(slides)) {
            c->drag = v3_select(slides, rays_meet_adj(t, &before.hit, onwards, c->drag, sink, slides), c->drag);
            c->turn = v3_select(slides, v3_zero(), c->turn);
        }
    }
    UpstreamVertex next = upstream_load(q, level + 1, k);
    Carried back = rays_turn_adj(t, &at.hit, v3_select(m, v3_neg(next.d), onwards), onwards, at.lobe,
                                 v3_length(v3_sub(from, at.hit.p)), c, sink, m);
    c->drag = v3_select(m, back.drag, c->drag);
    c->turn = v3_select(m, back.turn, c->turn);
}

// The lanes of m whose level is a collision: the surface before it, if it is an ordinary vertex, slides along the ray from there.
static void upstream_ride_adj(const Tracer *t, const Segments *q, int32_t level, int32_t k, Carried *c, Sink *sink, Mask m) {
    if (!t->scene->has_media) {
        return;
    }
    UpstreamVertex at = upstream_load(q, level, k);
    m = m & mi_lt(i_set(UPSTREAM_NONE), at.met) & mi_lt(at.hit.shape, i_set(0));
    Mask slides = m & mi_eq(at.met, i_set(UPSTREAM_POINT)) & m_set(level > 0);
    if (m_any(slides)) {
        UpstreamVertex before = upstream_load(q, level - 1, k);
        c->drag = v3_select(slides, rays_meet_adj(t, &before.hit, v3_neg(at.d), c->drag, sink, slides), c->drag);
    }
    c->turn = v3_select(m, v3_zero(), c->turn);
}
