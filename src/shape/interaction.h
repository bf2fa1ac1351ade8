// interaction.h: what a ray found: point, geometric normal, shading frame, texture coordinates, and the adjoint of the
// frame with respect to vertex normals. Points are rebuilt from barycentrics, A + (u e1 + v e2), which is the most
// precise form in float. NOT differentiated here: positions (geometry that moves needs further terms).
#pragma once

#include "scene/texture.h"

typedef struct Interaction {
    Vec3 p;     // world position
    Vec3 ng;    // geometric normal, unit
    Frame sh;   // shading frame
    Vec2 uv;
    Vec3 dp_du; // unnormalised tangent that the frame is built on
} Interaction;

KFN Vec3 theta_v3(const SceneView *scene, Int at) {
    return v3(theta_at(scene, at), theta_at(scene, at + 1), theta_at(scene, at + 2));
}

KFN Float table_at(const SceneView *scene, Int index) {
#ifdef REAL_DOUBLE
    return (Float)scene->tables[index];
#else
    return f_gather(scene->tables, index);
#endif
}

KFN Vec3 table_v3(const SceneView *scene, Int at) {
    return v3(table_at(scene, at), table_at(scene, at + 1), table_at(scene, at + 2));
}

// Frame with normal n and s along dp_du [Gram-Schmidt].
KFN Frame frame_from_tangent(Vec3 n, Vec3 dp_du) {
    Frame f;
    Vec3 s = v3_madd(dp_du, -v3_dot(n, dp_du), n);
    Mask usable = m_gt(v3_dot(s, s), 1e-12f * v3_dot(dp_du, dp_du));
    Frame any = frame_from_normal(n);
    f.n = n;
    f.s = v3_select(usable, v3_normalize(s), any.s);
    f.t = v3_cross(n, f.s);
    return f;
}

// Accumulates the adjoint of frame_from_tangent into dn (dp_du is held fixed).
KFN void frame_from_tangent_adj(const Frame *f, Vec3 dp_du, const Frame *df, Vec3 *dn) {
    Vec3 ds = df->s;
    v3_acc(dn, df->n);
    // t = n x s
    v3_cross_adj(f->n, f->s, df->t, dn, &ds);
    // s = normalize(q), q = dp_du - n (n . dp_du)
    Float projection = v3_dot(f->n, dp_du);
    Vec3 q = v3_madd(dp_du, -projection, f->n), dq = v3_zero();
    Mask usable = m_gt(v3_dot(q, q), 1e-12f * v3_dot(dp_du, dp_du));
    v3_normalize_adj(v3_select(usable, q, f->s), v3_select(usable, ds, v3_zero()), &dq);
    v3_acc(dn, v3_madd(v3_scale(dq, -projection), -v3_dot(f->n, dq), dp_du));
}

KFN Interaction mesh_interaction(const SceneView *scene, int32_t flags, const Hit *hit) {
    Interaction si;
    Corners c = mesh_corners(scene, hit->shape, hit->prim);
    Int positions = SHAPE_FIELD(scene, hit->shape, positions);
    Vec3 a = theta_v3(scene, positions + c.i[0] * 3);
    Vec3 e1 = v3_sub(theta_v3(scene, positions + c.i[1] * 3), a);
    Vec3 e2 = v3_sub(theta_v3(scene, positions + c.i[2] * 3), a);
    Float w = 1.0f - hit->u - hit->v;
    si.p = v3_add(a, v3_add(v3_scale(e1, hit->u), v3_scale(e2, hit->v)));
    si.ng = v3_normalize(v3_cross(e1, e2));
    si.uv = (Vec2){hit->u, hit->v};
    si.dp_du = e1;
    if (flags & SHAPE_HAS_UVS) {
        Int uvs = SHAPE_FIELD(scene, hit->shape, uvs);
        Float u[3], v[3];
        for (int k = 0; k < 3; k++) {
            u[k] = theta_at(scene, uvs + c.i[k] * 2);
            v[k] = theta_at(scene, uvs + c.i[k] * 2 + 1);
        }
        si.uv.x = w * u[0] + hit->u * u[1] + hit->v * u[2];
        si.uv.y = w * v[0] + hit->u * v[1] + hit->v * v[2];
        // [e1 e2] = [dp_du dp_dv] J, solved for dp_du
        Float du1 = u[1] - u[0], du2 = u[2] - u[0], dv1 = v[1] - v[0], dv2 = v[2] - v[0];
        Float det = du1 * dv2 - dv1 * du2;
        Mask usable = m_gt(f_abs(det), f_set(1e-20f));
        Float r = 1.0f / f_select(usable, det, f_set(1));
        Vec3 t = v3_scale(v3_madd(v3_scale(e1, dv2), -dv1, e2), r);
        si.dp_du = v3_select(usable, t, e1);
    }
    Vec3 n = si.ng;
    if (flags & SHAPE_HAS_NORMALS) {
        Int normals = SHAPE_FIELD(scene, hit->shape, normals);
        Vec3 sum = v3_scale(theta_v3(scene, normals + c.i[0] * 3), w);
        sum = v3_madd(sum, hit->u, theta_v3(scene, normals + c.i[1] * 3));
        sum = v3_madd(sum, hit->v, theta_v3(scene, normals + c.i[2] * 3));
        n = v3_normalize(sum);
        n = v3_select(m_gt(v3_dot(n, n), f_set(0.5f)), n, si.ng);
    }
    if (flags & SHAPE_FLIP_NORMALS) {
        n = v3_neg(n);
        si.ng = v3_neg(si.ng);
    }
    si.sh = frame_from_tangent(n, si.dp_du);
    return si;
}

// Accumulates the adjoint df of the shading frame into the vertex normals of the mesh.
KFN void mesh_interaction_adj(const SceneView *scene, int32_t flags, const Hit *hit, const Interaction *si,
                              const Frame *df, Sink *sink, Mask m) {
    if (!(flags & SHAPE_HAS_NORMALS)) {
        return;
    }
    Corners c = mesh_corners(scene, hit->shape, hit->prim);
    Int normals = SHAPE_FIELD(scene, hit->shape, normals);
    Float w[3] = {1.0f - hit->u - hit->v, hit->u, hit->v};
    Vec3 dn = v3_zero(), dsum = v3_zero(), sum = v3_zero();
    frame_from_tangent_adj(&si->sh, si->dp_du, df, &dn);
    // n = +- normalize(sum), sum = sum_k w_k n_k
    if (flags & SHAPE_FLIP_NORMALS) {
        dn = v3_neg(dn);
    }
    for (int k = 0; k < 3; k++) {
        sum = v3_madd(sum, w[k], theta_v3(scene, normals + c.i[k] * 3));
    }
    v3_normalize_adj(sum, dn, &dsum);
    Int begin = i_gather(sink->normals_at, hit->shape);
    m = m & mi_lt(i_set(-1), begin);
    begin = i_max(begin, i_set(0));
    for (int k = 0; k < 3; k++) {
        Int at = i_select(m, begin + c.i[k] * 3, i_set(0));
        sink_add(sink, at, w[k] * dsum.x, m);
        sink_add(sink, at + 1, w[k] * dsum.y, m);
        sink_add(sink, at + 2, w[k] * dsum.z, m);
    }
}

// Sphere: table = centre, radius, then the inverse rotation (rows). uv = (phi / 2 pi, theta / pi).
KFN Interaction sphere_interaction(const SceneView *scene, int32_t flags, const Hit *hit) {
    Interaction si;
    Int at = SHAPE_FIELD(scene, hit->shape, table);
    Vec3 centre = table_v3(scene, at);
    Float radius = table_at(scene, at + 3);
    si.ng = v3_normalize(v3_sub(hit->p, centre));
    si.p = v3_madd(centre, radius, si.ng);
    Vec3 local = v3(v3_dot(table_v3(scene, at + 4), si.ng), v3_dot(table_v3(scene, at + 7), si.ng),
                    v3_dot(table_v3(scene, at + 10), si.ng));
    Float phi = f_atan2(local.y, local.x);
    phi = f_select(m_lt(phi, f_set(0)), phi + TWO_PI, phi);
    si.uv = (Vec2){phi * INV_TWO_PI, f_acos(local.z) * INV_PI};
    // dp_du = 2 pi (-y, x, 0) in the sphere's frame, back to the world through the transposed rotation
    Vec3 x = table_v3(scene, at + 4), y = table_v3(scene, at + 7);
    si.dp_du = v3_scale(v3_madd(v3_scale(x, -local.y), local.x, y), TWO_PI * radius);
    if (flags & SHAPE_FLIP_NORMALS) {
        si.ng = v3_neg(si.ng);
    }
    si.sh = frame_from_tangent(si.ng, si.dp_du);
    return si;
}

// Disk: table = rows of to_world (12), rows of its inverse (12). uv = (r, phi / 2 pi).
KFN Interaction disk_interaction(const SceneView *scene, int32_t flags, const Hit *hit) {
    Interaction si;
    Int at = SHAPE_FIELD(scene, hit->shape, table);
    Vec3 local;
    local.x = v3_dot(table_v3(scene, at + 12), hit->p) + table_at(scene, at + 15);
    local.y = v3_dot(table_v3(scene, at + 16), hit->p) + table_at(scene, at + 19);
    Vec3 x = v3(table_at(scene, at), table_at(scene, at + 4), table_at(scene, at + 8));
    Vec3 y = v3(table_at(scene, at + 1), table_at(scene, at + 5), table_at(scene, at + 9));
    Vec3 o = v3(table_at(scene, at + 3), table_at(scene, at + 7), table_at(scene, at + 11));
    si.p = v3_madd(v3_madd(o, local.x, x), local.y, y);
    // The normal follows the inverse transpose: the third row of the inverse.
    si.ng = v3_normalize(table_v3(scene, at + 20));
    Float r = f_sqrt(local.x * local.x + local.y * local.y);
    Float phi = f_atan2(local.y, local.x);
    phi = f_select(m_lt(phi, f_set(0)), phi + TWO_PI, phi);
    si.uv = (Vec2){r, phi * INV_TWO_PI};
    Float rr = f_safe_rcp(r);
    si.dp_du = v3_madd(v3_scale(x, local.x * rr), local.y * rr, y);
    si.dp_du = v3_select(m_gt(r, f_set(0)), si.dp_du, x);
    if (flags & SHAPE_FLIP_NORMALS) {
        si.ng = v3_neg(si.ng);
    }
    si.sh = frame_from_tangent(si.ng, si.dp_du);
    return si;
}

// kind and flags are uniform: they are part of the shading group.
KFN Interaction shape_interaction(const SceneView *scene, int32_t kind, int32_t flags, const Hit *hit) {
    return kind == SHAPE_MESH     ? mesh_interaction(scene, flags, hit)
           : kind == SHAPE_SPHERE ? sphere_interaction(scene, flags, hit)
                                  : disk_interaction(scene, flags, hit);
}

// Origin of a ray that leaves si towards d: off the surface by an epsilon of the coordinates' size.
KFN Vec3 interaction_offset(const Interaction *si, Vec3 d) {
    Float largest = f_max(f_max(f_abs(si->p.x), f_abs(si->p.y)), f_abs(si->p.z));
    Float step = (1.0f + largest) * 9e-5f;
    return v3_madd(si->p, f_copysign(step, v3_dot(si->ng, d)), si->ng);
}
