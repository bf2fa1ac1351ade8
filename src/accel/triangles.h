// triangles.h: rays against the few triangles of surfaces that let light pass, such as the hulls of media, all lanes against one
// triangle after the other. Up to MOST_OPEN_TRIANGLES of them this is faster than Embree, which then knows only what lets no light
// pass, so that shadow rays need not ask it again behind each hull.
#pragma once

#include "scene/ray.h"
#include "scene/scene.h"

KFN Vec3 open_corner(const SceneView *scene, int32_t i, Vec3 o) {
    const float *p = scene->open_corners[i];
    return v3_sub(v3(f_set((real)p[0]), f_set((real)p[1]), f_set((real)p[2])), o);
}

// The lanes that one of them may be met in; *low: how far from where they begin.
KFN Mask triangles_may_meet(const SceneView *scene, const Ray *ray, Float t, Mask m, Float *low) {
    const Float o[3] = {ray->o.x, ray->o.y, ray->o.z}, d[3] = {ray->d.x, ray->d.y, ray->d.z};
    Float high = t;
    *low = f_set(0);
    for (int k = 0; k < 3; k++) {
        Mask crosses = ~m_eq(d[k], f_set(0));
        Float rcp = f_safe_rcp(d[k]);
        Float a = (f_set((real)scene->open_low[k]) - o[k]) * rcp, b = (f_set((real)scene->open_high[k]) - o[k]) * rcp;
        *low = f_select(crosses, f_max(*low, f_min(a, b)), *low);
        high = f_select(crosses, f_min(high, f_max(a, b)), high);
    }
    return m & m_le(*low, high);
}

// What rays see of the corners and edges of these triangles.
typedef struct OpenView {
    Vec3 corner[MOST_OPEN_CORNERS];        // from o
    Float volume[2 * MOST_OPEN_CORNERS];   // that direction and edge span, by the way along the edge
} OpenView;

// o: points of the rays that are no farther from the triangles than these are wide. Two triangles see the same of an edge that they
// share, so that no ray passes between them.
KFN void open_view(const SceneView *scene, Vec3 o, Vec3 d, OpenView *view) {
    Vec3 moment[MOST_OPEN_CORNERS];
    for (int32_t i = 0; i < scene->open_corners_count; i++) {
        view->corner[i] = open_corner(scene, i, o);
        moment[i] = v3_cross(d, view->corner[i]);
    }
    for (int32_t i = 0; i < scene->open_edges_count; i++) {
        const int32_t *edge = scene->open_edges[i];
        Float volume = v3_dot(moment[edge[0]], view->corner[edge[1]]);
        view->volume[2 * i] = volume;
        view->volume[2 * i + 1] = -volume;
    }
}

// Puts closer hits of the lanes of m on such triangles into *hit and their distances into *t. aside: what is left aside, null =
// nothing, as trace_others has it.
static NOINLINE void triangles_meet(const SceneView *scene, const Ray *ray, const Hit *aside, Mask m, Float *t, Hit *hit) {
    Float low;
    OpenView view;
    m = triangles_may_meet(scene, ray, *t, m, &low);
    if (!m_any(m)) {
        return;
    }
    low = f_zero_unless(m, low);
    open_view(scene, v3_madd(ray->o, low, ray->d), ray->d, &view);
    for (int32_t i = 0; i < scene->open_triangles_count; i++) {
        const OpenTriangle *triangle = scene->open_triangles + i;
        // The edge across from a corner makes the corner's barycentric; the three together are normal . direction.
        Float w = view.volume[triangle->way[1]], u = view.volume[triangle->way[2]], v = view.volume[triangle->way[0]];
        Mask inside = m_ge(f_min(f_min(u, v), w), f_set(0)) | m_le(f_max(f_max(u, v), w), f_set(0));
        inside = m & inside;
        if (!m_any(inside)) {
            continue;
        }
        const float *g = triangle->normal;
        Vec3 n = v3(f_set((real)g[0]), f_set((real)g[1]), f_set((real)g[2]));
        Float sum = u + v + w, rcp = f_safe_rcp(sum), at = v3_dot(n, view.corner[triangle->corner]) * rcp + low;
        Mask closer = inside & m_gt(at, f_set(0)) & m_lt(at, *t) & ~m_eq(sum, f_set(0));
        if (aside) {
            Mask all = mi_lt(aside->prim, i_set(0)), own = all | mi_eq(aside->prim, i_set(triangle->prim));
            closer = closer & ~(mi_eq(aside->shape, i_set(triangle->shape)) & own);
        }
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
    triangles_meet(scene, ray, NULL, m, &t, &hit);
    return m & mi_lt(i_set(-1), hit.shape);
}
