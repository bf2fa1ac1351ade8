// facing.h: where the normals n of normal and bump maps turn away from what looks at them, F = n . w = 0: there scattering about
// them jumps (bsdf/turned.h). F' is that of n, with its texture and the surface's frame, and of the direction w (looked.h). Other
// vertices see that as they see shading normals turn away (turning.h):
//   dI += integral dA_x dphi |n_g . w| (n' . w + n . (a' - x') / r) (L+ - L-) W
// over the points x of surfaces that have maps and the directions w at right angles to n, and along chains of smooth mirrors and
// glass as those do; the sensor: facing_view.h.
// NOT differentiated: maps within other maps, where those mirror normals.
#pragma once

#include "bsdf/facing.h"
#include "integrator/boundary/looked.h"
#include "integrator/boundary/segments.h"

// How often directions leave on the side of the surface that its geometric normal is on.
#define TURNING_OUTSIDE 0.75f

// The derivative of F at vertices that are looked at along d, of maps of these numbers, times `worth`: as rim_vertex_adj.
static NOINLINE Carried facing_vertex_adj(const Tracer *t, const Hit *hit, Vec3 d, Int number, Float behind, bool slides,
                                          Float worth, Sink *sink, Mask m) {
    Carried all = {v3_zero(), v3_zero()};
    for (Mask left = m; m_any(left);) {
        Looked at;
        looked_take(t, hit, d, slides, &left, &at, sink);
        const SurfaceSweep *s = &at.s;
        const int32_t count = map_count(t->scene, s->group->bsdf);
        for (int32_t k = 0; k < count; k++) {
            facing_adj(&s->call, map_find(t->scene, s->group->bsdf, k), s->wi, worth, sink, s->m & mi_eq(number, i_set(k)),
                       &at.d.wi, vertex_uv_adj(s, &at.d, sink));
        }
        looked_over(sink);
        looked_finish(t, &at, v3_zero(), behind, sink, &all);
    }
    return all;
}

// Of the segments k..., seen from their near points.
static Carried facing_ahead_adj(const Tracer *t, const Segments *q, int32_t k, bool slides, Float worth, Sink *sink, Mask m) {
    Hit x = LOAD_HIT(q, k, edge);
    return facing_vertex_adj(t, &x, record_v3(q->dx, q->dy, q->dz, k), i_load(q->rim + k), f_load(q->behind + k), slides,
                             worth * f_load(q->along + k), sink, m);
}

// Points of surfaces, and directions in which one of the maps there turns away.
typedef struct FacingPoint {
    Hit hit;
    Vec3 n, ng, d;
    Float weight; // dA dphi |n_g . d| over the density of both
    Int number;   // of the map
    Mask m;
} FacingPoint;

// Puts hits of one kind of surface to uv, of meshes to their barycentrics; returns the area per uv there.
static Float facing_place(const SceneView *scene, const Group *group, Vec2 uv, Hit *h) {
    const int32_t kind = group->shape_kind, instanced = group->shape_flags & SHAPE_INSTANCED;
    Int at = SHAPE_FIELD(scene, h->shape, table);
    if (kind == SHAPE_MESH) {
        Float root = f_sqrt(1.0f - uv.x);
        h->u = 1.0f - root;
        h->v = uv.y * root;
    } else {
        h->p = kind == SHAPE_SPHERE ? sphere_point(scene, at, uv)
               : kind == SHAPE_DISK ? disk_point(scene, at, uv)
                                    : cylinder_point(scene, at, uv);
        h->p = instanced ? pose_to_world(scene, instance_table(scene, h), h->p) : h->p;
    }
    // Without texture coordinates the tangents of triangles are their edges.
    Interaction si = shape_interaction(scene, kind, instanced, h);
    h->p = si.p;
    Float area = v3_length(v3_cross(si.dp_du, si.dp_dv));
    return kind == SHAPE_MESH ? 0.5f * area : area;
}

// Directions at right angles to n on the side of the surface's shading normal that n was taken for, in a half circle of which
// `turn` says how much; false where it is not there that the map is seen edge-on, or where one of a lower number is, which counts.
static Mask facing_direction(const SurfaceSweep *s, Float side, Float turn, Int number, Sink *still, FacingPoint *out, Mask m) {
    const SceneView *scene = s->call.scene;
    Vec3 up = v3_scale(s->si.sh.n, side), across = v3_madd(up, -v3_dot(up, out->n), out->n);
    Frame any = frame_from_normal(out->n);
    Float size = v3_length(across), sine, cosine;
    Vec3 x = v3_select(m_gt(size, f_set(1e-6f)), v3_scale(across, f_safe_rcp(size)), any.s), y = v3_cross(out->n, x);
    f_sincos(PI * (turn - 0.5f), &sine, &cosine);
    Vec3 d = v3_madd(v3_scale(x, cosine), sine, y), wi = frame_to_local(&s->si.sh, d);
    out->d = v3_select(m, d, out->d);
    const int32_t count = map_count(scene, s->group->bsdf);
    for (int32_t k = 0; k < count; k++) {
        Vec3 n = v3_zero();
        facing_adj(&s->call, map_find(scene, s->group->bsdf, k), wi, f_set(1), still, m, &n, NULL);
        Mask edge_on = m_gt(v3_dot(n, n), f_set(0)) & m_lt(f_abs(v3_dot(n, wi)), f_set(1e-5f));
        m = m & (edge_on | ~mi_eq(number, i_set(k))) & ~(edge_on & mi_lt(i_set(k), number));
    }
    return m;
}

static void facing_sample(const Tracer *t, const BoundaryJob *b, const SampleKey *key, FacingPoint *out) {
    const SceneView *scene = t->scene;
    Vec2 place = rng_2d(key, DIMENSION_EDGE_SEGMENT), way = rng_2d(key, DIMENSION_SEGMENT_END);
    Float probability, which = rng_1d(key, DIMENSION_TURNING_SIDE);
    Int e = edge_choose(b, rng_1d(key, DIMENSION_SEGMENT_LIGHT), &probability);
    Sink still = sink_of(b->still);
    out->hit = (Hit){EDGE_FIELD(b, e, shape), EDGE_FIELD(b, e, prim), f_set(0), f_set(0), v3_zero(), EDGE_FIELD(b, e, instance)};
    out->n = out->ng = out->d = v3_zero();
    out->weight = f_set(0);
    out->number = i_set(0);
    out->m = m_set(false);
    Mask outside = m_lt(way.x, f_set(TURNING_OUTSIDE));
    Float side = f_select(outside, f_set(1), f_set(-1));
    Float share = f_select(outside, f_set(TURNING_OUTSIDE), f_set(1 - TURNING_OUTSIDE));
    for (Mask left = m_gt(probability, f_set(0)); m_any(left);) {
        int32_t id;
        Hit h;
        SurfaceSweep s;
        Mask mine = take_group(scene, &out->hit, &left, &id, &h);
        Float area = facing_place(scene, scene->groups + id, place, &h);
        looked_surface(t, id, &h, mine, &s);
        const int32_t count = map_count(scene, s.group->bsdf);
        Int number = i_min(i_from_f(which * (real)count), i_set(count - 1));
        Vec3 n = v3_zero(), wi = v3(f_set(0), f_set(0), side);
        for (int32_t k = 0; k < count; k++) {
            facing_adj(&s.call, map_find(scene, s.group->bsdf, k), wi, f_set(1), &still, mine & mi_eq(number, i_set(k)), &n, NULL);
        }
        mine = mine & m_gt(v3_dot(n, n), f_set(0));
        out->n = v3_select(mine, frame_to_world(&s.si.sh, n), out->n);
        mine = facing_direction(&s, side, way.y, number, &still, out, mine);
        Float weight = area * f_abs(v3_dot(s.si.ng, out->d)) * (PI * (real)count) / (share * probability);
        out->ng = v3_select(mine, s.si.ng, out->ng);
        out->hit = hit_select(mine, &h, &out->hit);
        out->weight = f_select(mine, weight, out->weight);
        out->number = i_select(mine, number, out->number);
        out->m = out->m | mine;
    }
}
