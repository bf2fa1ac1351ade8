// path_move.h: the interior term of what moves, in material form: the film position is fixed, so that the first
// vertex is where the camera's ray meets its surface; all later vertices, and the points of light samples, are attached to
// their surfaces. A segment r = q - p of a path contributes with
//   f(p, r) ... |N_q . r| / |r|^3,   N_q the attached area vector at q,
// relative to its value when it was sampled: with c the segment's contribution, N_q the unit normal n now and r = |r| w
//   dr += c (n / (n . w) - 3 w) / |r| + (dw - w (w . dw)) / |r|,   dN_q += c w / (n . w)
// where dw is what the functions and lights at both ends make of the direction. Directions to environments are fixed.
// Chains of smooth mirrors and glass are not attached: the direction at the vertex before them (or the film position) is
// fixed, and what follows slides along the rays that this makes, up to the first vertex that scatters. A ray carries the
// adjoints of its position where it meets the next surface (drag) and of its direction (turn) back through the chain.
// Radiance that leaves a vertex is thus of two kinds: `attached`, and what came along a chain. Light samples cannot make
// chains, so that no MIS weight joins the two.
// NOT differentiated here: visibility, jumps of what the camera sees, and transmittances of shadow rays (walk_adj.h).
#pragma once

#include "integrator/beacon_view.h"
#include "shape/move.h"

// Adjoint of one vertex: of wi (local), of the direction onwards, of the light sample, shading frame, surface and uv; and
// what light samples and the rest of the path contribute; p: of its position, beside what these ask for.
typedef struct VertexAdj {
    Vec3 p, wi, wo;
    Vec3 point, light_point; // where volumes are read: there, and at the light sample
    LightMove light;
    Frame frame;
    BsdfSurface surface;
    Vec2 uv, at;
    Float lit, onward;
} VertexAdj;

// Where nothing moves, only what lights and normals ask for is set: the rest is never read.
KFN void vertex_adj_clear(VertexAdj *d, bool motion) {
    if (motion) {
        memset(d, 0, sizeof *d);
        return;
    }
    d->wi = d->wo = v3_zero();
    d->frame = (Frame){v3_zero(), v3_zero(), v3_zero()};
    d->surface = (BsdfSurface){f_set(0), f_set(0), f_set(0), v3_zero()};
    d->light.d = v3_zero();
    d->light.distance = d->light.uv.x = d->light.uv.y = f_set(0);
}

// Texture coordinates of attached points stay.
KFN bool vertex_uv_moves(const SurfaceSweep *s, const Sink *sink) {
    return sink->any_motion && m_any(s->slides | s->chained);
}
KFN Vec2 *vertex_uv_adj(const SurfaceSweep *s, VertexAdj *d, const Sink *sink) {
    return vertex_uv_moves(s, sink) ? &d->uv : NULL;
}

// What wi and the parameterisation make of the shading frame.
KFN void vertex_frame_adj(const SurfaceSweep *s, bool surface, VertexAdj *d) {
    Vec3 unused = v3_zero();
    // wi = to_local(-d)
    frame_to_local_adj(&s->si.sh, v3_neg(s->d), d->wi, &d->frame, &unused);
    // ux = s . dp_du, vx = s . dp_dv, vy = t . dp_dv
    if (surface) {
        v3_acc(&d->frame.s, v3_madd(v3_scale(s->si.dp_du, d->surface.ux), d->surface.vx, s->dp_dv));
        v3_acc(&d->frame.t, v3_scale(s->dp_dv, d->surface.vy));
    }
}

// Adjoint of a segment r = distance w to a point with normal n: contribution c and adjoint dw of the direction.
KFN Vec3 segment_adj(Vec3 w, Float distance, Vec3 n, Float c, Vec3 dw, Vec3 *darea) {
    Float rcp = f_safe_rcp(distance), facing = c * f_safe_rcp(v3_dot(n, w));
    *darea = v3_scale(w, facing);
    Vec3 across = v3_madd(dw, -v3_dot(w, dw), w);
    return v3_scale(v3_madd(v3_madd(across, facing, n), -3.0f * c, w), rcp);
}

// Takes the lanes of the group that the first of *left belongs to out of it, and returns them. *of: their hits, in other lanes safe
// ones.
KFN Mask take_group(const SceneView *scene, const Hit *hit, Mask *left, int32_t *group, Hit *of) {
    int32_t first = i_lane(hit->shape, m_first(*left));
    *group = scene->shapes[first].group;
    Mask mine = *left & mi_eq(SHAPE_FIELD(scene, i_select(*left, hit->shape, i_set(first)), group), i_set(*group));
    *of = *hit;
    of->shape = i_select(mine, hit->shape, i_set(first));
    of->prim = i_select(mine, hit->prim, i_set(0));
    of->instance = i_select(mine, hit->instance, i_set(0));
    *left = *left & ~mine;
    return mine;
}

// Adds the adjoint d of attached points of any surfaces.
static NOINLINE void surfaces_move_adj(const Tracer *t, const Hit *hit, const SurfaceAdj *d, Sink *sink, Mask m) {
    const SceneView *scene = t->scene;
    for (Mask left = m; m_any(left);) {
        int32_t id;
        Hit h;
        Mask mine = take_group(scene, hit, &left, &id, &h);
        const Group *group = scene->groups + id;
        if (!(t->job->live[id] & LIVE_MOTION)) {
            continue;
        }
        Interaction si = shape_interaction(scene, group->shape_kind, group->shape_flags, &h);
        shape_move_adj(scene, group->shape_kind, group->shape_flags, &h, &si, d, sink, mine);
    }
}

// Of their positions and area vectors.
KFN void points_move_adj(const Tracer *t, const Hit *hit, Vec3 dp, Vec3 darea, Sink *sink, Mask m) {
    SurfaceAdj d = surface_adj_zero();
    d.p = dp;
    d.area = darea;
    surfaces_move_adj(t, hit, &d, sink, m);
}

// Where rays along d meet surfaces, with the adjoint `worth` of what they find: returns that of the rays' positions.
static Vec3 rays_find_adj(const Tracer *t, const Hit *hit, Vec3 d, const SurfaceAdj *worth, Sink *sink, Mask m) {
    const SceneView *scene = t->scene;
    Vec3 drag = v3_zero();
    for (Mask left = m; m_any(left);) {
        int32_t id;
        Hit h;
        Mask mine = take_group(scene, hit, &left, &id, &h);
        const Group *group = scene->groups + id;
        Interaction si = shape_interaction(scene, group->shape_kind, group->shape_flags, &h);
        Slide slide[2];
        SurfaceAdj a = *worth;
        shape_slide(scene, group->shape_kind, group->shape_flags, &h, &si, slide);
        Vec3 position = slide_adj(slide, d, &a);
        a.p = v3_sub(a.p, position);
        if (t->job->live[id] & LIVE_MOTION) {
            shape_move_adj(scene, group->shape_kind, group->shape_flags, &h, &si, &a, sink, mine);
        }
        drag = v3_select(mine, position, drag);
    }
    return drag;
}

// A point of a surface, such as a light sample, as a hit: of meshes with the barycentrics there, of tubes with the position.
KFN Hit point_hit(const SceneView *scene, Int shape, Int prim, Int instance, Vec3 p, Vec3 *n) {
    Hit hit = {shape, prim, f_set(0), f_set(0), p, instance};
    *n = v3_zero();
    hit.shape = i_max(shape, i_set(0));
    for (Mask left = mi_lt(i_set(-1), shape), mine; m_any(left); left = left & ~mine) {
        int32_t first = i_lane(shape, m_first(left));
        const Group *group = scene->groups + scene->shapes[first].group;
        mine = left & mi_eq(SHAPE_FIELD(scene, hit.shape, group), i_set(scene->shapes[first].group));
        Hit h = hit;
        h.shape = i_select(mine, shape, i_set(first));
        h.prim = i_select(mine, prim, i_set(0));
        h.instance = i_select(mine, instance, i_set(0));
        if (group->shape_kind == SHAPE_MESH) {
            // dp_du and dp_dv are the edges
            Interaction corner = shape_interaction(scene, SHAPE_MESH, group->shape_flags & SHAPE_INSTANCED, &h);
            Vec3 q = v3_sub(p, corner.p), cross = v3_cross(corner.dp_du, corner.dp_dv);
            Float r = f_safe_rcp(v3_dot(cross, cross));
            h.u = v3_dot(v3_cross(q, corner.dp_dv), cross) * r;
            h.v = v3_dot(v3_cross(corner.dp_du, q), cross) * r;
            hit.u = f_select(mine, h.u, hit.u);
            hit.v = f_select(mine, h.v, hit.v);
        } else if (group->shape_kind == SHAPE_BSPLINE) {
            Vec3 away;
            tube_distance(scene, &h, p, &away);
            hit.u = f_select(mine, h.u, hit.u);
        }
        *n = v3_select(mine, shape_interaction(scene, group->shape_kind, group->shape_flags, &h).ng, *n);
    }
    return hit;
}

// Light samples: returns the adjoint of the vertex's position.
static Vec3 connection_move_adj(const Tracer *t, const SurfaceSweep *s, const VertexAdj *v, Sink *sink) {
    const SceneView *scene = t->scene;
    Int light = i_select(s->connected, s->light, i_set(0)), shape = EMITTER_FIELD(scene, light, shape);
    Mask attached = s->connected & mi_lt(i_set(-1), shape);
    Vec3 dp = v3_select(s->connected, v->light.ref, v3_zero());
    if (m_any(attached)) {
        Vec3 n, darea, p = v3_madd(s->si.p, s->light_distance, s->light_d);
        Int prim = i_select(attached, s->light_prim, i_set(0));
        Hit hit = point_hit(scene, i_select(attached, shape, i_set(-1)), prim, i_set(0), p, &n);
        Vec3 dr = segment_adj(s->light_d, s->light_distance, n, v->lit, v->light.d, &darea);
        points_move_adj(t, &hit, v3_add(dr, v->light_point), darea, sink, attached);
        dp = v3_select(attached, v3_neg(dr), dp);
    }
    return dp;
}

// One over the distance of the next vertex.
KFN Float still_turn(const Tracer *t, Int slot, Vec3 from) {
    return f_safe_rcp(v3_length(v3_sub(LOAD_V3(t->ws, next_px, next_py, next_pz, slot), from)));
}

// The segment along w to a collision that moves with its light in part (beacon.h), of the lanes of m, rcp one over its length:
// returns the adjoint of where it begins by its direction there, whose adjoint is dw, and by points of the way, which move with
// both ends. What else it asks for, collisions know. seen: from the sensor.
static NOINLINE Vec3 still_move_adj(const Tracer *t, Int slot, int channel, Float rcp, Vec3 w, Vec3 dw, Mask seen, Sink *sink,
                                    Mask m) {
    const Workspace *ws = &t->ws;
    Vec3 pull = rows_gather(&ws->pull, channel, slot), turn = rows_gather(&ws->turn, channel, slot);
    Vec3 dr = v3_madd(pull, rcp, v3_add(turn, dw));
    dr = v3_select(m, v3_madd(dr, -v3_dot(w, dr), w), v3_zero());
    beacon_flow_adj(t, i_gather(ws->next_light, slot), slot, dr, seen, sink, m);
    return v3_neg(dr);
}

// The segment to the next vertex, which the sweep has just left: returns the adjoint of this vertex's position.
static Vec3 onward_move_adj(const Tracer *t, const SurfaceSweep *s, const VertexAdj *v, int channel, Sink *sink) {
    const Workspace *ws = &t->ws;
    const Records *r = &ws->records;
    Int next = i_gather(ws->next, s->slot);
    Mask spread = s->scattered & lobe_spreads(s->lobe), attached = spread & mi_lt(i_set(-1), next);
    // A chain that begins here, or a ray to a collision, moves with this vertex, in its fixed direction.
    Vec3 drag = v3_select(spread, rows_gather(&ws->drag, channel, s->slot), v3_zero());
    Mask still = spread & mi_eq(next, i_set(NEXT_STILL));
    if (m_any(still)) {
        v3_acc(&drag, still_move_adj(t, s->slot, channel, still_turn(t, s->slot, s->si.p), s->wo_d, v->wo, m_set(false), sink,
                                     still));
    }
    if (!m_any(attached)) {
        return drag;
    }
    next = i_max(next, i_set(0));
    Vec3 q = LOAD_V3(*ws, next_px, next_py, next_pz, s->slot), n = LOAD_V3(*ws, next_nx, next_ny, next_nz, s->slot);
    Vec3 back = rows_gather(&ws->back, channel, s->slot);
    Vec3 darea, w = s->wo_d;
    Float distance = v3_length(v3_sub(q, s->si.p));
    Vec3 dr = segment_adj(w, distance, n, v->onward, v3_sub(v->wo, back), &darea);
    if (t->job->rides) { // points of the way move with both ends
        Vec3 pull = rows_gather(&ws->pull, channel, s->slot), turn = rows_gather(&ws->turn, channel, s->slot);
        pull = v3_madd(pull, f_safe_rcp(distance), turn);
        dr = v3_add(dr, v3_madd(pull, -v3_dot(w, pull), w));
    }
    Hit hit = {i_gather(r->shape, next), i_gather(r->prim, next), real_gather(r->u, next), real_gather(r->v, next), q,
               i_gather(r->instance, next)};
    points_move_adj(t, &hit, dr, darea, sink, attached);
    return v3_select(attached, v3_sub(drag, dr), drag);
}

// Adjoint of where vertices lie, for one delta; dp: of their positions. The lanes of `slides` lie where a ray meets
// their surface, and what that asks of the ray is added to `carried`.
static NOINLINE void vertex_place_adj(const Tracer *t, const SurfaceSweep *s, VertexAdj *v, Vec3 dp, Mask slides,
                                      int32_t live, Carried *carried, Sink *sink) {
    SurfaceAdj d = surface_adj_zero();
    bool surface = s->call.surface != NULL;
    vertex_frame_adj(s, surface, v);
    frame_from_tangent_adj(&s->si.sh, s->si.dp_du, &v->frame, &d.n, &d.dp_du);
    if (surface) {
        d.dp_du = v3_madd(d.dp_du, v->surface.ux, s->si.sh.s);
        d.dp_dv = v3_madd(v3_scale(s->si.sh.s, v->surface.vx), v->surface.vy, s->si.sh.t);
    }
    d.uv = v->uv;
    d.at = v->at;
    d.p = v3_add(dp, v->point);
    if (m_any(slides)) {
        Slide slide[2];
        shape_slide(t->scene, s->group->shape_kind, s->group->shape_flags, &s->hit, &s->si, slide);
        Vec3 position = v3_select(slides, slide_adj(slide, s->d, &d), v3_zero());
        d.p = v3_sub(d.p, position);
        v3_acc(&carried->drag, position);
        v3_acc(&carried->turn, v3_select(slides, v3_neg(frame_to_world(&s->si.sh, v->wi)), v3_zero()));
    }
    if (live & LIVE_MOTION) {
        shape_move_adj(t->scene, s->group->shape_kind, s->group->shape_flags, &s->hit, &s->si, &d, sink, s->m);
    }
}

// What is mirrored or refracted at a batch of vertices, for one delta: L += f w_s L_next along a direction that follows from
// how the path came.
static NOINLINE void chain_move_adj(const Tracer *t, const SurfaceSweep *s, Spec weight, int32_t live, int channel,
                                    Carried *carried, Sink *sink) {
    const Workspace *ws = &t->ws;
    SurfaceSweep chain = *s;
    chain.m = s->scattered & s->chained;
    Mask passes = chain.m & lobe_is(s->lobe, LOBE_NULL), turns = chain.m & ~passes;
    Vec3 drag = rows_gather(&ws->drag, channel, s->slot), turn = rows_gather(&ws->turn, channel, s->slot);
    // The ray's position at the next vertex is p + distance d'; behind an environment there is none.
    Vec3 q = LOAD_V3(*ws, next_px, next_py, next_pz, s->slot);
    Mask meets = ~mi_eq(i_gather(ws->next, s->slot), i_set(NEXT_NONE));
    Vec3 dd = v3_select(meets, v3_madd(turn, v3_length(v3_sub(q, s->si.p)), drag), turn);
    VertexAdj d;
    vertex_adj_clear(&d, true);
    BsdfCall own = s->call;
    own.dsurface = own.surface ? &d.surface : NULL;
    // d' = to_world(wo(wi))
    Vec3 sampled = v3_select(turns, dd, v3_zero()), dwo = frame_to_local(&s->si.sh, sampled);
    frame_to_world_adj(s->wo, sampled, &d.frame);
    Spec df = spec_zero_unless(chain.m, spec_scale(spec_mul(weight, s->suffix), s->scatter_weight));
    sink->at = &d.at;
    sink->point = &d.point;
    bsdf_adj(&own, s->wi, s->wo, s->lobe, df, sink, chain.m, &d.wi, &dwo, &d.uv);
    sink->at = NULL;
    sink->point = NULL;
    // A ray that passes stays the same line.
    v3_acc(&carried->drag, v3_select(passes, drag, v3_zero()));
    v3_acc(&carried->turn, v3_select(passes, dd, v3_zero()));
    vertex_place_adj(t, &chain, &d, v3_select(turns, drag, v3_zero()), chain.m, live, carried, sink);
}

// Adjoint of where a batch of vertices lies, for one delta.
static NOINLINE void vertex_move_adj(const Tracer *t, const SurfaceSweep *s, VertexAdj *v, Spec weight, int32_t live,
                                     int channel, Sink *sink) {
    Carried carried = {v3_zero(), v3_zero()};
    Vec3 dp = v3_add(v->p, v3_add(connection_move_adj(t, s, v, sink), onward_move_adj(t, s, v, channel, sink)));
    vertex_place_adj(t, s, v, dp, s->slides, live, &carried, sink);
    Vec3 back = frame_to_world(&s->si.sh, v->wi);
    if (m_any(s->scattered & s->chained)) {
        chain_move_adj(t, s, weight, live, channel, &carried, sink);
    }
    const bool rides = t->job->rides;
    if (sink->any_camera && (s->first || rides)) { // borders may lie before what the sensor sees
        Mask seen = rides ? s->m & records_seen(t, s->at) : s->m;
        camera_move_adj(t, s->slot, s->si.p, &carried, sink, seen);
    }
    if (s->first) {
        return;
    }
    rows_scatter(&t->ws.back, channel, s->slot, back, s->m);
    rows_scatter(&t->ws.drag, channel, s->slot, carried.drag, s->m);
    // Rays that keep their direction are not turned, and what turns attached ones is kept there instead (ride_add).
    Vec3 turn = v3_select(s->slides | m_set(!rides), carried.turn, v3_zero());
    rows_scatter(&t->ws.turn, channel, s->slot, turn, s->m);
    if (rides) {
        rows_scatter(&t->ws.pull, channel, s->slot, v3_zero(), s->m);
    }
}

// Forgets the vertices of the chunk before.
KFN void vertices_forget(Tracer *t) {
    Workspace *ws = &t->ws;
    const size_t bytes = CHUNK * sizeof(real);
    memset(ws->next, 0xff, CHUNK * sizeof *ws->next);
    for (int c = 0; c < SPEC_N; c++) {
        memset(ws->attached[c], 0, bytes);
    }
    const ChannelRows *rows[] = {&ws->drag, &ws->turn, &ws->pull};
    for (int i = 0; i < (t->job->rides ? 3 : 2); i++) {
        for (int c = 0; c < drives(t); c++) {
            memset(rows[i]->x[c], 0, bytes);
            memset(rows[i]->y[c], 0, bytes);
            memset(rows[i]->z[c], 0, bytes);
        }
    }
}

// Leaves the vertices for those before them.
KFN void vertex_keep(Tracer *t, const SurfaceSweep *s) {
    Workspace *ws = &t->ws;
    i_scatter(ws->next, s->slot, i_iota() + s->at, s->m);
    f_scatter(ws->next_px, s->slot, s->si.p.x, s->m);
    f_scatter(ws->next_py, s->slot, s->si.p.y, s->m);
    f_scatter(ws->next_pz, s->slot, s->si.p.z, s->m);
    f_scatter(ws->next_nx, s->slot, s->si.ng.x, s->m);
    f_scatter(ws->next_ny, s->slot, s->si.ng.y, s->m);
    f_scatter(ws->next_nz, s->slot, s->si.ng.z, s->m);
}
