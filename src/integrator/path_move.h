// path_move.h: the interior term of what moves, in material form: the film position is fixed, so that the first
// vertex is where the camera's ray meets its surface; all later vertices, and the points of light samples, are attached to
// their surfaces. A segment r = q - p of a path contributes with
//   f(p, r) ... |N_q . r| / |r|^3,   N_q the attached area vector at q,
// relative to its value when it was sampled: with c the segment's contribution, N_q the unit normal n now and r = |r| w
//   dr += c (n / (n . w) - 3 w) / |r| + (dw - w (w . dw)) / |r|,   dN_q += c w / (n . w)
// where dw is what the functions and lights at both ends make of the direction. Directions to environments are fixed.
// NOT differentiated: visibility, jumps of what the camera sees, vertices behind smooth mirrors and glass, surfaces that
// let a path pass, and transmittances of shadow rays.
#pragma once

#include "integrator/sweep.h"
#include "shape/move.h"

// Adjoint of one vertex: of wi (local), of the direction onwards, of the light sample, shading frame, surface and uv; and
// what light samples and the rest of the path contribute.
typedef struct VertexAdj {
    Vec3 wi, wo;
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

// Texture coordinates of attached points stay; those of spheres do as long as their pose remains a similarity.
KFN bool vertex_uv_moves(const SurfaceSweep *s, const Sink *sink) {
    return sink->any_motion && (s->first || s->group->shape_kind == SHAPE_SPHERE);
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

// Adds the adjoint of attached points of any surfaces: of their positions and area vectors.
static NOINLINE void points_move_adj(const Tracer *t, const Hit *hit, Vec3 dp, Vec3 darea, Sink *sink, Mask m) {
    const SceneView *scene = t->scene;
    for (Mask left = m, mine; m_any(left); left = left & ~mine) {
        int32_t id = scene->shapes[i_lane(hit->shape, m_first(left))].group;
        const Group *group = scene->groups + id;
        mine = left & mi_eq(SHAPE_FIELD(scene, hit->shape, group), i_set(id));
        if (!(t->job->live[id] & LIVE_MOTION)) {
            continue;
        }
        Hit h = *hit;
        h.shape = i_select(mine, hit->shape, i_set(i_lane(hit->shape, m_first(mine))));
        h.prim = i_select(mine, hit->prim, i_set(0));
        h.instance = i_select(mine, hit->instance, i_set(0));
        Interaction si = shape_interaction(scene, group->shape_kind, group->shape_flags, &h);
        SurfaceAdj d = surface_adj_zero();
        d.p = dp;
        d.area = darea;
        shape_move_adj(scene, group->shape_kind, group->shape_flags, &h, &si, &d, sink, mine);
    }
}

// The hit of a light sample: its point, and of meshes the barycentrics there.
KFN Hit light_hit(const SceneView *scene, Int shape, Int prim, Vec3 p, Vec3 *n) {
    Hit hit = {shape, prim, f_set(0), f_set(0), p, i_set(0)};
    *n = v3_zero();
    hit.shape = i_max(shape, i_set(0));
    for (Mask left = mi_lt(i_set(-1), shape), mine; m_any(left); left = left & ~mine) {
        int32_t first = i_lane(shape, m_first(left));
        const Group *group = scene->groups + scene->shapes[first].group;
        mine = left & mi_eq(SHAPE_FIELD(scene, hit.shape, group), i_set(scene->shapes[first].group));
        Hit h = hit;
        h.shape = i_select(mine, shape, i_set(first));
        h.prim = i_select(mine, prim, i_set(0));
        if (group->shape_kind == SHAPE_MESH) {
            Interaction corner = mesh_interaction(scene, 0, &h); // dp_du and dp_dv are the edges
            Vec3 q = v3_sub(p, corner.p), cross = v3_cross(corner.dp_du, corner.dp_dv);
            Float r = f_safe_rcp(v3_dot(cross, cross));
            h.u = v3_dot(v3_cross(q, corner.dp_dv), cross) * r;
            h.v = v3_dot(v3_cross(corner.dp_du, q), cross) * r;
            hit.u = f_select(mine, h.u, hit.u);
            hit.v = f_select(mine, h.v, hit.v);
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
        Hit hit = light_hit(scene, i_select(attached, shape, i_set(-1)), prim, p, &n);
        Vec3 dr = segment_adj(s->light_d, s->light_distance, n, v->lit, v->light.d, &darea);
        points_move_adj(t, &hit, dr, darea, sink, attached);
        dp = v3_select(attached, v3_neg(dr), dp);
    }
    return dp;
}

// The segment to the next vertex, which the sweep has just left: returns the adjoint of this vertex's position.
static Vec3 onward_move_adj(const Tracer *t, const SurfaceSweep *s, const VertexAdj *v, int channel, Sink *sink) {
    const Workspace *ws = &t->ws;
    const Records *r = &ws->records;
    Int next = i_gather(ws->next, s->slot);
    Mask attached = s->scattered & mi_lt(i_set(-1), next) & mi_eq(s->lobe, i_set(LOBE_SMOOTH));
    if (!m_any(attached)) {
        return v3_zero();
    }
    next = i_max(next, i_set(0));
    Vec3 q = LOAD_V3(*ws, next_px, next_py, next_pz, s->slot), n = LOAD_V3(*ws, next_nx, next_ny, next_nz, s->slot);
    Vec3 back = v3(real_gather(ws->back_x[channel], s->slot), real_gather(ws->back_y[channel], s->slot),
                   real_gather(ws->back_z[channel], s->slot));
    Vec3 darea, w = s->wo_d;
    Float distance = v3_length(v3_sub(q, s->si.p));
    Vec3 dr = segment_adj(w, distance, n, v->onward, v3_sub(v->wo, back), &darea);
    Hit hit = {i_gather(r->shape, next), i_gather(r->prim, next), real_gather(r->u, next), real_gather(r->v, next), q,
               i_gather(r->instance, next)};
    points_move_adj(t, &hit, dr, darea, sink, attached);
    return v3_select(attached, v3_neg(dr), v3_zero());
}

// The first vertex stays on the camera's ray: where surface or ray move, it slides.
static void camera_move_adj(const Tracer *t, const SurfaceSweep *s, Vec3 back, SurfaceAdj *d, Sink *sink) {
    Slide slide[2];
    shape_slide(t->scene, s->group->shape_kind, s->group->shape_flags, &s->hit, &s->si, slide);
    Vec3 position = slide_adj(slide, s->d, d);
    d->p = v3_sub(d->p, position);
    if (!sink->any_camera) {
        return;
    }
    Vec2 lens = {f_set(0), f_set(0)};
    if (sensor_has_lens(t->sensor)) {
        SampleKey key = slot_key(t, s->slot);
        lens = rng_2d(&key, DIMENSION_LENS);
    }
    RayAdj ray = {s->si.p, position, v3_neg(back)};
    sensor_ray_adj(t->scene, t->sensor, real_gather(t->ws.film_x, s->slot), real_gather(t->ws.film_y, s->slot), lens,
                   &ray, sink, s->m);
}

// Adjoint of where a batch of vertices lies, for one delta.
static NOINLINE void vertex_move_adj(const Tracer *t, const SurfaceSweep *s, VertexAdj *v, int32_t live, int channel,
                                     Sink *sink) {
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
    d.p = v3_add(connection_move_adj(t, s, v, sink), onward_move_adj(t, s, v, channel, sink));
    Vec3 back = frame_to_world(&s->si.sh, v->wi);
    if (s->first) {
        camera_move_adj(t, s, back, &d, sink);
    } else {
        f_scatter(t->ws.back_x[channel], s->slot, back.x, s->m);
        f_scatter(t->ws.back_y[channel], s->slot, back.y, s->m);
        f_scatter(t->ws.back_z[channel], s->slot, back.z, s->m);
    }
    if (live & LIVE_MOTION) {
        shape_move_adj(t->scene, s->group->shape_kind, s->group->shape_flags, &s->hit, &s->si, &d, sink, s->m);
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
