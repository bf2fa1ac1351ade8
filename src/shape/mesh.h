// mesh.h: triangle meshes: interaction with its adjoint in the vertex normals, and uniform sampling of their area. What
// moving vertices do stands in mesh_move.h.
// Points are rebuilt from barycentrics, A + (u e1 + v e2), which is the most precise form in float.
#pragma once

#include "shape/instance.h"

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
    si.dp_dv = e2;
    if (flags & SHAPE_HAS_UVS) {
        Int uvs = SHAPE_FIELD(scene, hit->shape, uvs);
        Float u[3], v[3];
        for (int k = 0; k < 3; k++) {
            Vec3 uv = theta_v3(scene, uvs + c.i[k] * 2); // and one number more
            u[k] = uv.x;
            v[k] = uv.y;
        }
        si.uv.x = w * u[0] + hit->u * u[1] + hit->v * u[2];
        si.uv.y = w * v[0] + hit->u * v[1] + hit->v * v[2];
        // [e1 e2] = [dp_du dp_dv] J, solved for the tangents
        Float du1 = u[1] - u[0], du2 = u[2] - u[0], dv1 = v[1] - v[0], dv2 = v[2] - v[0];
        Float det = du1 * dv2 - dv1 * du2;
        Mask usable = m_gt(f_abs(det), f_set(1e-20f));
        Float r = 1.0f / f_select(usable, det, f_set(1));
        Vec3 t = v3_scale(v3_madd(v3_scale(e1, dv2), -dv1, e2), r);
        si.dp_du = v3_select(usable, t, e1);
        t = v3_scale(v3_madd(v3_scale(e2, du1), -du2, e1), r);
        si.dp_dv = v3_select(usable, t, e2);
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

// Adds the adjoint dsum of the interpolated normals' sum to the vertex normals that are asked for.
KFN void mesh_normals_add(const Hit *hit, const Corners *c, Vec3 dsum, Sink *sink, Mask m) {
    Float w[3] = {1.0f - hit->u - hit->v, hit->u, hit->v};
    Int begin = i_gather(sink->normals_at, hit->shape);
    m = m & mi_lt(i_set(-1), begin);
    begin = i_max(begin, i_set(0));
    for (int k = 0; k < 3; k++) {
        Int at = i_select(m, begin + c->i[k] * 3, i_set(0));
        sink_add_v3(sink, at, v3_scale(dsum, w[k]), m);
    }
}

KFN Vec3 mesh_normal_sum(const SceneView *scene, const Hit *hit, const Corners *c) {
    Int normals = SHAPE_FIELD(scene, hit->shape, normals);
    Vec3 sum = v3_scale(theta_v3(scene, normals + c->i[0] * 3), 1.0f - hit->u - hit->v);
    sum = v3_madd(sum, hit->u, theta_v3(scene, normals + c->i[1] * 3));
    return v3_madd(sum, hit->v, theta_v3(scene, normals + c->i[2] * 3));
}

// Accumulates the adjoint df of the shading frame into the vertex normals of the mesh.
KFN void mesh_interaction_adj(const SceneView *scene, int32_t flags, const Hit *hit, const Interaction *si,
                              const Frame *df, Sink *sink, Mask m) {
    if (!(flags & SHAPE_HAS_NORMALS)) {
        return;
    }
    Corners c = mesh_corners(scene, hit->shape, hit->prim);
    Vec3 dn = v3_zero(), dsum = v3_zero(), sum = mesh_normal_sum(scene, hit, &c);
    frame_from_tangent_adj(&si->sh, si->dp_du, df, &dn, NULL);
    // n = +- normalize(sum), sum = sum_k w_k n_k
    if (flags & SHAPE_FLIP_NORMALS) {
        dn = v3_neg(dn);
    }
    if (flags & SHAPE_INSTANCED) {
        dn = instance_normal_adj(scene, hit, v3_normalize(sum), dn);
    }
    v3_normalize_adj(sum, dn, &dsum);
    mesh_normals_add(hit, &c, dsum, sink, m);
}

// Uniform over the area: triangle by binary search in the cumulative areas, then uniform inside it.
KFN Hit mesh_sample(const SceneView *scene, int32_t id, Vec3 ref, Vec2 u) {
    const ShapeRecord *shape = scene->shapes + id;
    UNUSED(ref);
    Float mass;
    Hit hit;
    hit.shape = i_set(id);
    hit.prim = cdf_search(scene, i_set(shape->area_cdf), shape->triangle_count, u.x, &u.x, &mass);
    Float root = f_sqrt(1.0f - u.x);
    hit.u = 1.0f - root;
    hit.v = u.y * root;
    hit.p = v3_zero();
    hit.instance = i_set(0);
    return hit;
}

KFN Float mesh_pdf(const SceneView *scene, int32_t id, Vec3 ref, Vec3 d, const Interaction *si) {
    return area_density(ref, d, si, f_set(scene->shapes[id].area));
}

// Of a mesh per lane.
KFN Hit mesh_sample_many(const SceneView *scene, Int id, Vec2 u) {
    Hit hit;
    hit.shape = id;
    hit.prim = cdf_search_many(scene, SHAPE_FIELD(scene, id, area_cdf), SHAPE_FIELD(scene, id, triangle_count), u.x, &u.x);
    Float root = f_sqrt(1.0f - u.x);
    hit.u = 1.0f - root;
    hit.v = u.y * root;
    hit.p = v3_zero();
    hit.instance = i_set(0);
    return hit;
}
