// facet.h: triangles with vertex normals, and the curve in one along which its shading normal is at right angles to a viewer.
// With b the barycentrics, N = sum b_k N_k the interpolated normal before it is made a unit vector, P the point and o the eye,
//   q(b) = N . (o - P) = sum b_j b_k q_jk,   q_jk = (N_j . (o - P_k) + N_k . (o - P_j)) / 2,
// is 0 there: a conic. docs/derivations/boundary.md.
#pragma once

#include "shape/shape.h"

typedef struct Facet {
    Vec3 p[3], n[3]; // corners and their normals in the world; normals of any length, on the side that shades
} Facet;

// Triangles of meshes in the lanes of m, of one of them in the others; normals of those that have them at their vertices.
static Facet facet_load(const SceneView *scene, const Hit *hit, Mask m) {
    Hit h = *hit;
    h.shape = i_select(m, hit->shape, i_set(i_lane(hit->shape, m_first(m))));
    h.prim = i_select(m, hit->prim, i_set(i_lane(hit->prim, m_first(m))));
    Corners c = mesh_corners(scene, h.shape, h.prim);
    Int positions = SHAPE_FIELD(scene, h.shape, positions), normals = SHAPE_FIELD(scene, h.shape, normals);
    normals = i_select(mi_lt(i_set(-1), normals), normals, positions);
    Mask inside = m & mi_lt(i_set(-1), SHAPE_FIELD(scene, h.shape, collection));
    Mask flip = mi_lt(i_set(0), SHAPE_FIELD(scene, h.shape, flags) & SHAPE_FLIP_NORMALS);
    h.instance = i_select(inside, hit->instance, i_set(0));
    Facet f;
    for (int k = 0; k < 3; k++) {
        f.p[k] = theta_v3(scene, positions + c.i[k] * 3);
        f.n[k] = theta_v3(scene, normals + c.i[k] * 3);
        f.n[k] = v3_select(flip, v3_neg(f.n[k]), f.n[k]);
        if (m_any(inside)) {
            Int at = instance_table(scene, &h);
            Vec3 n = pose_gradient(scene, at, f.n[k]);
            f.p[k] = v3_select(inside, pose_to_world(scene, at, f.p[k]), f.p[k]);
            f.n[k] = v3_select(inside, n, f.n[k]);
        }
    }
    return f;
}

// The values of a at the barycentrics (1 - u - v, u, v).
KFN Vec3 facet_at(const Vec3 a[3], Float u, Float v) {
    return v3_madd(v3_madd(v3_scale(a[0], 1.0f - u - v), u, a[1]), v, a[2]);
}

KFN Float facet_pick(Int k, const Float a[3]) {
    return f_select(mi_eq(k, i_set(1)), a[1], f_select(mi_eq(k, i_set(2)), a[2], a[0]));
}

// From the eye, or along it where the view is parallel, to a point: backwards.
KFN Vec3 facet_view(Vec3 eye, bool parallel, Vec3 p) { return parallel ? v3_neg(eye) : v3_sub(eye, p); }

// Where the curve crosses the line on which barycentric number k is s: root 0 or 1 of the quadratic along it. The density of
// points of the curve, with k and the root drawn evenly and s uniform, is sum |db_k| / 6, whatever its direction.
static Mask facet_cross(const Facet *f, Vec3 eye, bool parallel, Int k, Mask second, Float s, Float *u, Float *v) {
    Float q[3], r[3]; // of corners, and of the edges opposite them
    for (int i = 0; i < 3; i++) {
        int j = (i + 1) % 3, l = (i + 2) % 3;
        q[i] = v3_dot(f->n[i], facet_view(eye, parallel, f->p[i]));
        r[i] = 0.5f * (v3_dot(f->n[j], facet_view(eye, parallel, f->p[l])) + v3_dot(f->n[l], facet_view(eye, parallel, f->p[j])));
    }
    Int j = i_select(mi_eq(k, i_set(2)), i_set(0), k + 1), l = i_select(mi_eq(k, i_set(0)), i_set(2), k - 1);
    Float rest = 1.0f - s, own = s * s * facet_pick(k, q), both = 2.0f * s * rest, rest2 = rest * rest;
    Float qkj = facet_pick(l, r), qkl = facet_pick(j, r);
    // c0 (1 - x)^2 + 2 c1 x (1 - x) + c2 x^2 along the line from b_j = 1 - s to b_l = 1 - s
    Float c0 = own + both * qkj + rest2 * facet_pick(j, q), c2 = own + both * qkl + rest2 * facet_pick(l, q);
    Float c1 = own + 0.5f * both * (qkj + qkl) + rest2 * facet_pick(k, r);
    Float a = c0 - 2.0f * c1 + c2, b = c1 - c0, root2 = b * b - a * c0;
    Float h = -(b + f_copysign(f_safe_sqrt(root2), b));
    Float over = f_select(second, a, h), x = f_select(second, h, c0) / f_select(m_gt(f_abs(over), f_set(0)), over, f_set(1));
    Mask found = m_ge(root2, f_set(0)) & m_gt(f_abs(over), f_set(0)) & m_ge(x, f_set(0)) & m_le(x, f_set(1));
    x = f_select(found, x, f_set(0));
    Float bj = rest * (1.0f - x), bl = rest * x;
    Mask zero = mi_eq(k, i_set(0)), one = mi_eq(k, i_set(1)); // (k, j, l) = (0, 1, 2), (1, 2, 0) or (2, 0, 1)
    *u = f_select(zero, bj, f_select(one, s, bl));
    *v = f_select(zero, bl, f_select(one, bj, s));
    return found;
}

// q's slopes in the barycentrics u and v.
KFN Vec2 facet_slope(const Facet *f, Vec3 eye, bool parallel, Float u, Float v) {
    Vec3 view = facet_view(eye, parallel, facet_at(f->p, u, v)), n = facet_at(f->n, u, v);
    Vec2 d = {v3_dot(v3_sub(f->n[1], f->n[0]), view), v3_dot(v3_sub(f->n[2], f->n[0]), view)};
    if (!parallel) {
        d.x = d.x - v3_dot(n, v3_sub(f->p[1], f->p[0]));
        d.y = d.y - v3_dot(n, v3_sub(f->p[2], f->p[0]));
    }
    return d;
}
