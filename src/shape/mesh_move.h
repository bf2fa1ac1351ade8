// mesh_move.h: triangle meshes that move: points keep their barycentrics.
#pragma once

#include "shape/mesh.h"
#include "shape/motion.h"

// dp_du = u[0] e1 + u[1] e2, dp_dv = v[0] e1 + v[1] e2, and the texture coordinates at the corners.
typedef struct MeshTangents {
    Float u[2], v[2];
    Vec2 uv[3];
} MeshTangents;

KFN MeshTangents mesh_tangents(const SceneView *scene, int32_t flags, const Hit *hit, const Corners *c) {
    Float one = f_set(1), zero = f_set(0);
    MeshTangents t = {{one, zero}, {zero, one}, {{zero, zero}, {one, zero}, {zero, one}}};
    if (!(flags & SHAPE_HAS_UVS)) {
        return t;
    }
    Int uvs = SHAPE_FIELD(scene, hit->shape, uvs);
    for (int k = 0; k < 3; k++) {
        t.uv[k] = (Vec2){theta_at(scene, uvs + c->i[k] * 2), theta_at(scene, uvs + c->i[k] * 2 + 1)};
    }
    Float du1 = t.uv[1].x - t.uv[0].x, du2 = t.uv[2].x - t.uv[0].x;
    Float dv1 = t.uv[1].y - t.uv[0].y, dv2 = t.uv[2].y - t.uv[0].y, det = du1 * dv2 - dv1 * du2;
    Mask usable = m_gt(f_abs(det), f_set(1e-20f));
    Float r = 1.0f / f_select(usable, det, one);
    t.u[0] = f_select(usable, dv2 * r, one);
    t.u[1] = f_select(usable, -dv1 * r, zero);
    t.v[0] = f_select(usable, -du2 * r, zero);
    t.v[1] = f_select(usable, du1 * r, one);
    return t;
}

// Along the two edges from the first corner.
KFN void mesh_slide(const SceneView *scene, int32_t flags, const Hit *hit, const Interaction *si, Slide out[2]) {
    Corners c = mesh_corners(scene, hit->shape, hit->prim);
    MeshTangents t = mesh_tangents(scene, flags, hit, &c);
    Int positions = SHAPE_FIELD(scene, hit->shape, positions);
    Vec3 a = theta_v3(scene, positions + c.i[0] * 3);
    UNUSED(si);
    for (int k = 0; k < 2; k++) {
        out[k] = slide_along(v3_sub(theta_v3(scene, positions + c.i[k + 1] * 3), a), t.uv[k + 1].x - t.uv[0].x,
                             t.uv[k + 1].y - t.uv[0].y);
        out[k].at = (Vec2){f_set(k == 0), f_set(k == 1)};
        if (flags & SHAPE_HAS_NORMALS) {
            Int normals = SHAPE_FIELD(scene, hit->shape, normals);
            Vec3 n0 = theta_v3(scene, normals + c.i[0] * 3), n1 = theta_v3(scene, normals + c.i[k + 1] * 3);
            out[k].n = slide_normalized(mesh_normal_sum(scene, hit, &c), v3_sub(n1, n0));
            out[k].n = flags & SHAPE_FLIP_NORMALS ? v3_neg(out[k].n) : out[k].n;
        }
    }
}

// Adds the adjoints of the corner a and of the edges from it to the vertices that are asked for.
KFN void mesh_points_add(const Hit *hit, const Corners *c, Vec3 dp, Vec3 de1, Vec3 de2, Sink *sink, Mask m) {
    Int begin = i_gather(sink->points_at, hit->shape);
    Vec3 d[3] = {v3_sub(v3_sub(dp, de1), de2), de1, de2};
    m = m & mi_lt(i_set(-1), begin);
    begin = i_max(begin, i_set(0));
    for (int k = 0; k < 3 && m_any(m); k++) {
        Int at = i_select(m, begin + c->i[k] * 3, i_set(0));
        sink_add_v3(sink, at, d[k], m);
    }
}

KFN void mesh_move_adj(const SceneView *scene, int32_t flags, const Hit *hit, const Interaction *si, const SurfaceAdj *d,
                       Sink *sink, Mask m) {
    Corners c = mesh_corners(scene, hit->shape, hit->prim);
    MeshTangents t = mesh_tangents(scene, flags, hit, &c);
    Int positions = SHAPE_FIELD(scene, hit->shape, positions);
    Vec3 a = theta_v3(scene, positions + c.i[0] * 3);
    Vec3 e1 = v3_sub(theta_v3(scene, positions + c.i[1] * 3), a);
    Vec3 e2 = v3_sub(theta_v3(scene, positions + c.i[2] * 3), a);
    Vec3 cross = v3_cross(e1, e2), dcross = v3_zero(), dng = d->ng, dn = d->n, area = d->area;
    if (flags & SHAPE_FLIP_NORMALS) {
        dng = v3_neg(dng);
        dn = v3_neg(dn);
        area = v3_neg(area);
    }
    if (flags & SHAPE_HAS_NORMALS) {
        Vec3 dsum = v3_zero();
        v3_normalize_adj(mesh_normal_sum(scene, hit, &c), dn, &dsum);
        mesh_normals_add(hit, &c, dsum, sink, m);
    } else {
        dng = v3_add(dng, dn);
    }
    // p = a + u e1 + v e2
    Vec3 de1 = v3_scale(d->p, hit->u), de2 = v3_scale(d->p, hit->v);
    // dp_du = u0 e1 + u1 e2, dp_dv = v0 e1 + v1 e2
    de1 = v3_madd(v3_madd(de1, t.u[0], d->dp_du), t.v[0], d->dp_dv);
    de2 = v3_madd(v3_madd(de2, t.u[1], d->dp_du), t.v[1], d->dp_dv);
    // ng = normalize(e1 x e2), and the area vector is e1 x e2 in units of its length
    v3_normalize_adj(cross, dng, &dcross);
    dcross = v3_madd(dcross, f_safe_rcp(v3_length(cross)), area);
    v3_cross_adj(e1, e2, dcross, &de1, &de2);
    mesh_points_add(hit, &c, d->p, de1, de2, sink, m);
    // Rectangles and cubes follow a pose.
    Int at = i_gather(sink->pose_at, hit->shape);
    if (m_any(m & mi_lt(i_set(-1), at))) {
        Int pose = i_max(SHAPE_FIELD(scene, hit->shape, to_world), i_set(0));
        pose_move_adj(scene, pose, at, si, d, sink, m);
    }
}
