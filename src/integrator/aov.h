// aov.h: a pass of its own over the first surfaces behind the pixels, for channels other than colour. Its samples lie
// where those of the colour pass of the same seed lie.
#pragma once

#include "bsdf/albedo.h"
#include "integrator/path.h"

// How the texture coordinates change from a pixel to its neighbours [pixel / sqrt(samples)]: the neighbours' rays meet
// the tangent plane, and the offset is solved for in the tangents by least squares [igehy1999 section 3].
typedef struct UvSlopes {
    Vec2 dx, dy;
} UvSlopes;

KFN Vec2 uv_slope(const Interaction *si, const Ray *ray, const Ray *neighbour, real step) {
    Vec3 o = v3_madd(ray->o, f_set(step), v3_sub(neighbour->o, ray->o));
    Vec3 d = v3_madd(ray->d, f_set(step), v3_sub(neighbour->d, ray->d));
    Float t = v3_dot(si->ng, v3_sub(si->p, o)) * f_safe_rcp(v3_dot(si->ng, d));
    Vec3 dp = v3_sub(v3_madd(o, t, d), si->p);
    Float a = v3_dot(si->dp_du, si->dp_du), b = v3_dot(si->dp_du, si->dp_dv), c = v3_dot(si->dp_dv, si->dp_dv);
    Float u = v3_dot(si->dp_du, dp), v = v3_dot(si->dp_dv, dp), rcp = f_safe_rcp(a * c - b * b);
    return (Vec2){(c * u - b * v) * rcp, (a * v - b * u) * rcp};
}

static NOINLINE UvSlopes uv_slopes(const Tracer *t, const Interaction *si, Int slot) {
    Float x = real_gather(t->ws.film_x, slot), y = real_gather(t->ws.film_y, slot);
    real step = 1 / (real)sqrt((double)t->job->spp);
    SampleKey key = slot_key(t, slot);
    Vec2 lens = sample_lens(t, &key);
    Ray ray = sensor_ray(t->scene, t->sensor, x, y, lens).ray;
    Ray right = sensor_ray(t->scene, t->sensor, x + 1.0f, y, lens).ray;
    Ray below = sensor_ray(t->scene, t->sensor, x, y + 1.0f, lens).ray;
    return (UvSlopes){uv_slope(si, &ray, &right, step), uv_slope(si, &ray, &below, step)};
}

KFN void aov_store_3(Tracer *t, int32_t row, Int slot, Vec3 v, Mask m) {
    f_scatter(t->ws.channel[row], slot, v.x, m);
    f_scatter(t->ws.channel[row + 1], slot, v.y, m);
    f_scatter(t->ws.channel[row + 2], slot, v.z, m);
}

KFN void aov_store_2(Tracer *t, int32_t row, Int slot, Vec2 v, Mask m) {
    f_scatter(t->ws.channel[row], slot, v.x, m);
    f_scatter(t->ws.channel[row + 1], slot, v.y, m);
}

KFN Vec3 aov_albedo(const Tracer *t, const Group *group, const Vertex *v, const Interaction *si) {
    BsdfCall call = bsdf_call(t->scene, group->bsdf, texcoord(si->uv, &v->hit), 0);
    BsdfSurface surface;
    Vec3 dp_dv;
    if (t->scene->bsdfs[group->bsdf].surface) {
        find_surface(t->scene, group, &v->hit, &surface, &dp_dv);
        call.surface = &surface;
    }
    Spec s = bsdf_albedo(&call, frame_to_local(&si->sh, v3_neg(v->d)));
    return v3(s.c[0], s.c[1], s.c[2]);
}

// Stores quantity `kind` of a batch from channel `row` on.
static void aov_store(Tracer *t, int32_t kind, int32_t row, const Group *group, const Vertex *v, const Interaction *si) {
    switch (kind) {
    case AOV_DEPTH:
        f_scatter(t->ws.channel[row], v->slot, v3_dot(v3_sub(si->p, v->origin), v->d), v->m);
        break;
    case AOV_POSITION:
        aov_store_3(t, row, v->slot, si->p, v->m);
        break;
    case AOV_UV:
        aov_store_2(t, row, v->slot, si->uv, v->m);
        break;
    case AOV_GEO_NORMAL:
        aov_store_3(t, row, v->slot, si->ng, v->m);
        break;
    case AOV_SH_NORMAL:
        aov_store_3(t, row, v->slot, si->sh.n, v->m);
        break;
    case AOV_DP_DU:
        aov_store_3(t, row, v->slot, si->dp_du, v->m);
        break;
    case AOV_DP_DV:
        aov_store_3(t, row, v->slot, si->dp_dv, v->m);
        break;
    case AOV_DUV_DX:
        aov_store_2(t, row, v->slot, uv_slopes(t, si, v->slot).dx, v->m);
        break;
    case AOV_DUV_DY:
        aov_store_2(t, row, v->slot, uv_slopes(t, si, v->slot).dy, v->m);
        break;
    case AOV_PRIM_INDEX:
        f_scatter(t->ws.channel[row], v->slot, f_from_i(v->hit.prim), v->m);
        break;
    case AOV_SHAPE_INDEX:
        f_scatter(t->ws.channel[row], v->slot, f_from_i(v->hit.shape + 1), v->m);
        break;
    default:
        aov_store_3(t, row, v->slot, aov_albedo(t, group, v, si), v->m);
    }
}

// Fills ws.channel, and ws.coverage with 1 where a surface is, for the chunk's `count` samples. begin: scratch of group count + 2
// entries. Lights that pictures hide are surfaces here.
static void aov_forward(Tracer *t, int32_t *begin, int32_t count) {
    const SceneView *scene = t->scene;
    SceneView all = *scene;
    int32_t groups = (int32_t)scene->groups_count + 1;
    for (int32_t i = 0, row = 0; i < scene->aov_count; row += aov_components(scene->aovs[i]), i++) {
        for (int32_t c = 0; c < aov_components(scene->aovs[i]); c++) {
            memset(t->ws.channel[row + c], 0, (size_t)count * sizeof(real));
        }
    }
    memset(t->ws.coverage, 0, (size_t)count * sizeof(real));
    all.hide_emitters = false;
    t->scene = &all;
    trace_stage(t, 0);
    sort_stage(t, begin, groups);
    for (int32_t g = 1; g < groups; g++) {
        const Group *group = scene->groups + g - 1;
        for (int32_t k = begin[g]; k < begin[g + 1]; k += LANES) {
            Vertex v = vertex_load(t, t->ws.order + k, begin[g + 1] - k < LANES ? begin[g + 1] - k : LANES, 0);
            Interaction si = shape_interaction(scene, group->shape_kind, group->shape_flags, &v.hit);
            for (int32_t i = 0, row = 0; i < scene->aov_count; row += aov_components(scene->aovs[i]), i++) {
                aov_store(t, scene->aovs[i], row, group, &v, &si);
            }
            cover(t, v.slot, v.m);
        }
    }
    t->scene = scene;
}
