// alike.h: hits of two lines of sight between which no surface ends.
#pragma once

#include "integrator/boundary/edge.h"

static void triangle_load(const SceneView *scene, int32_t flags, const Hit *hit, Vec3 p[3]) {
    Corners c = mesh_corners(scene, hit->shape, hit->prim);
    Int positions = SHAPE_FIELD(scene, hit->shape, positions);
    for (int k = 0; k < 3; k++) {
        p[k] = theta_v3(scene, positions + c.i[k] * 3);
        p[k] = flags & SHAPE_INSTANCED ? pose_to_world(scene, instance_table(scene, hit), p[k]) : p[k];
    }
}

// Lanes of m in which two triangles of a mesh lie next to each other in a plane. Where they share their vertices, with all that
// these carry, nothing jumps between them.
static Mask triangles_join(const SceneView *scene, const Hit *a, const Hit *b, Mask m) {
    Vec3 p[2][3], n[2];
    Corners c[2];
    Int shared = i_set(0);
    for (int k = 0; k < 2; k++) {
        Hit h = *(k ? b : a);
        h.shape = i_select(m, h.shape, i_set(i_lane(h.shape, m_first(m))));
        h.prim = i_select(m, h.prim, i_set(0));
        c[k] = mesh_corners(scene, h.shape, h.prim);
        triangle_load(scene, 0, &h, p[k]);
        n[k] = v3_cross(v3_sub(p[k][1], p[k][0]), v3_sub(p[k][2], p[k][0]));
    }
    for (int i = 0; i < 9; i++) {
        shared = shared + i_select(mi_eq(c[0].i[i / 3], c[1].i[i % 3]), i_set(1), i_set(0));
    }
    Float dot = v3_dot(n[0], n[1]), flat = v3_dot(n[0], n[0]) * v3_dot(n[1], n[1]) * f_set((real)0.99999);
    return m & mi_lt(i_set(1), shared) & m_gt(dot, f_set(0)) & m_ge(dot * dot, flat);
}

// The part of a segment by which hits on one piece of a tube differ at most: it may hide itself where it bends.
#define TUBE_APART 0.05f

// Lanes of m in which hits on one shape, a tube, lie next to each other.
static Mask tubes_join(const SceneView *scene, const Hit *a, const Hit *b, Mask m) {
    Hit h = *a;
    h.shape = i_select(m, a->shape, i_set(i_lane(a->shape, m_first(m))));
    h.prim = i_select(m, a->prim, i_set(0));
    Int behind = b->prim - a->prim;
    Mask next = mi_eq(behind, i_set(1)) & ~tube_ends(scene, &h, true);
    Mask before = mi_eq(behind, i_set(-1)) & ~tube_ends(scene, &h, false);
    Mask near = m_lt(f_abs(b->u + f_from_i(behind) - a->u), f_set(TUBE_APART));
    return m & near & (mi_eq(behind, i_set(0)) | next | before);
}

// Lanes of m in which two lines meet one triangle, or two between which nothing jumps.
static Mask lines_share(const SceneView *scene, const Hit *a, const Hit *b, Mask m) {
    m = m & mi_eq(a->shape, b->shape) & mi_eq(a->instance, b->instance);
    Mask one = mi_eq(a->prim, b->prim), found = m & mi_lt(i_set(-1), a->shape), apart = found & ~one;
    Mask tube = found & mi_eq(SHAPE_FIELD(scene, i_select(found, a->shape, i_set(0)), kind), i_set(SHAPE_BSPLINE));
    if (m_any(tube)) {
        one = (one & ~tube) | tubes_join(scene, a, b, tube);
        apart = apart & ~tube;
    }
    if (!m_any(apart) || scene->attributes_count > 0) { // which may be of faces
        return m & one;
    }
    Int shape = i_select(apart, a->shape, i_set(0)), flags = SHAPE_FIELD(scene, shape, flags);
    apart = apart & mi_eq(SHAPE_FIELD(scene, shape, kind), i_set(SHAPE_MESH));
    apart = apart & mi_lt(i_set(0), flags & SHAPE_HAS_UVS); // else each has its own
    for (Mask left = apart; m_any(left);) { // the tangents that maps go by may turn
        int32_t id;
        Hit h;
        Mask mine = take_group(scene, a, &left, &id, &h);
        apart = scene->bsdfs[scene->groups[id].bsdf].turns ? apart & ~mine : apart;
    }
    return m & (one | (m_any(apart) ? triangles_join(scene, a, b, apart) : apart));
}
