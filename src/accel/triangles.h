// triangles.h: rays against the few triangles of surfaces that let light pass, such as the hulls of media, all lanes against one
// triangle after the other. Up to MOST_OPEN_TRIANGLES of them this is faster than Embree, which then knows only what lets no light
// pass, so that shadow rays need not ask it again behind each hull.
#pragma once

#include "scene/ray.h"
#include "scene/scene.h"

// Corners relative to where rays begin: two triangles see the same of an edge that they share, so that no ray passes between them.
KFN Float edge_volume(Vec3 a, Vec3 b, Vec3 d) { return v3_dot(v3_cross(v3_add(a, b), v3_sub(a, b)), d); }

KFN Vec3 open_corner(const OpenTriangle *triangle, int k, Vec3 o) {
    const float *p = triangle->corner[k];
    return v3_sub(v3(f_set((real)p[0]), f_set((real)p[1]), f_set((real)p[2])), o);
}

// The lanes that one of them may be met in.
KFN Mask triangles_may_meet(const SceneView *scene, const Ray *ray, Float t, Mask m) {
    const Float o[3] = {ray->o.x, ray->o.y, ray->o.z}, d[3] = {ray->d.x, ray->d.y, ray->d.z};
    Float low = f_set(0), high = t;
    for (int k = 0; k < 3; k++) {
        Mask crosses = ~m_eq(d[k], f_set(0));
        Float rcp = f_safe_rcp(d[k]);
        Float a = (f_set((real)scene->open_low[k]) - o[k]) * rcp, b = (f_set((real)scene->open_high[k]) - o[k]) * rcp;
        low = f_select(crosses, f_max(low, f_min(a, b)), low);
        high = f_select(crosses, f_min(high, f_max(a, b)), high);
    }
    return m & m_le(low, high);
}

// Puts closer hits of the lanes of m on such triangles into *hit and their distances into *t. aside: a shape that is left aside.
static NOINLINE void triangles_meet(const SceneView *scene, const Ray *ray, Int aside, Mask m, Float *t, Hit *hit) {
    m = triangles_may_meet(scene, ray, *t, m);
    if (!m_any(m)) {
        return;
    }
    for (int32_t i = 0; i < scene->open_triangles_count; i++) {
        const OpenTriangle *triangle = scene->open_triangles + i;
        Vec3 a = open_corner(triangle, 0, ray->o), b = open_corner(triangle, 1, ray->o), c = open_corner(triangle, 2, ray->o);
        Float u = edge_volume(a, c, ray->d), v = edge_volume(b, a, ray->d), w = edge_volume(c, b, ray->d);
        Mask inside = (m_ge(u, f_set(0)) & m_ge(v, f_set(0)) & m_ge(w, f_set(0))) |
                      (m_le(u, f_set(0)) & m_le(v, f_set(0)) & m_le(w, f_set(0)));
        inside = m & inside & ~mi_eq(aside, i_set(triangle->shape));
        if (!m_any(inside)) {
            continue;
        }
        Vec3 n = v3_cross(v3_sub(b, a), v3_sub(c, a));
        Float at = v3_dot(n, a) * f_safe_rcp(v3_dot(n, ray->d)), sum = u + v + w, rcp = f_safe_rcp(sum);
        Mask closer = inside & m_gt(at, f_set(0)) & m_lt(at, *t) & ~m_eq(sum, f_set(0));
        *t = f_select(closer, at, *t);
        hit->shape = i_select(closer, i_set(triangle->shape), hit->shape);
        hit->prim = i_select(closer, i_set(triangle->prim), hit->prim);
        hit->instance = i_select(closer, i_set(0), hit->instance);
        hit->u = f_select(closer, u * rcp, hit->u);
        hit->v = f_select(closer, v * rcp, hit->v);
    }
}

// Lanes in whose way one is.
KFN Mask triangles_block(const SceneView *scene, const Ray *ray, Mask m) {
    Float t = ray->tmax;
    Hit hit = {i_set(-1), i_set(0), f_set(0), f_set(0), v3_zero(), i_set(0)};
    triangles_meet(scene, ray, i_set(-1), m, &t, &hit);
    return m & mi_lt(i_set(-1), hit.shape);
}
