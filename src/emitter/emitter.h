// emitter.h: light sources: sampling towards a point, evaluation where a ray meets them, densities, and adjoints.
// The emitter is uniform over the lanes. NOT differentiated: positions, poses and the shapes of area lights.
#pragma once

#include "emitter/distribution.h"
#include "math/warp.h"
#include "shape/shape.h"

// A point on a light as seen from a reference point.
typedef struct LightSample {
    Vec3 d;         // unit direction towards the light
    Float distance; // to the point; infinite lights: beyond the scene
    Float pdf;      // per solid angle; delta lights: 1
    Vec2 uv;        // where the light's texture is read; barycentrics where that needs the triangle (e->attributes)
    Int prim;       // triangle of the light's mesh, else 0
    Mask valid;     // the light can be seen from there
} LightSample;

KFN bool emitter_is_delta(const EmitterRecord *e) { return e->kind == EMITTER_POINT; }

// ---- area --------------------------------------------------------------------------------------------------------

KFN LightSample area_sample(const SceneView *scene, const EmitterRecord *e, Vec3 ref, Vec2 u) {
    const ShapeRecord *shape = scene->shapes + e->shape;
    LightSample s;
    Hit hit = shape_sample(scene, e->shape, ref, u);
    Interaction si = shape_interaction(scene, shape->kind, shape->flags, &hit);
    Vec3 to_light = v3_sub(si.p, ref);
    Float r2 = v3_dot(to_light, to_light);
    s.distance = f_sqrt(r2);
    s.d = v3_scale(to_light, f_safe_rcp(s.distance));
    s.pdf = shape_pdf(scene, e->shape, ref, s.d, &si);
    s.uv = e->attributes ? (Vec2){hit.u, hit.v} : si.uv;
    s.prim = hit.prim;
    s.valid = m_lt(v3_dot(s.d, si.sh.n), f_set(0)) & m_gt(f_abs(v3_dot(s.d, si.ng)), f_set(1e-7f)) &
              m_gt(r2, f_set(0)) & m_gt(s.pdf, f_set(0));
    return s;
}

// Density with which area_sample picks the direction d from ref to the point si of the light's shape.
KFN Float area_pdf(const SceneView *scene, const EmitterRecord *e, Vec3 ref, Vec3 d, const Interaction *si) {
    return shape_pdf(scene, e->shape, ref, d, si);
}

// ---- environment -------------------------------------------------------------------------------------------------

// Where the environment image is read along a world direction: u periodic, v from the +y pole down.
KFN Vec2 envmap_uv(const SceneView *scene, const EmitterRecord *e, Vec3 d) {
    const float *t = scene->tables + e->table; // rows of the inverse rotation
    Vec3 v = v3(t[0] * d.x + t[1] * d.y + t[2] * d.z, t[3] * d.x + t[4] * d.y + t[5] * d.z,
                t[6] * d.x + t[7] * d.y + t[8] * d.z);
    Float u = f_atan2(v.x, -v.z) * INV_TWO_PI;
    return (Vec2){u - f_floor(u), f_acos(v.y) * INV_PI};
}

// Columns are texel centres and periodic, rows are nodes from pole to pole [Mitsuba's convention].
KFN Footprint envmap_footprint(const TextureNode *t, Vec2 uv) {
    Footprint f;
    Float x = uv.x * (real)t->width - 0.5f, y = uv.y * (real)(t->height - 1);
    Float x0 = f_floor(x), y0 = f_clamp(f_floor(y), f_set(0), f_set((real)(t->height - 2)));
    f.fx = x - x0;
    f.fy = f_clamp(y - y0, f_set(0), f_set(1));
    Int left = texture_wrap(i_from_f(x0), t->width, WRAP_REPEAT);
    Int right = texture_wrap(i_from_f(x0) + 1, t->width, WRAP_REPEAT);
    Int row = i_from_f(y0) * t->width;
    f.at[0] = row + left;
    f.at[1] = row + right;
    f.at[2] = row + left + t->width;
    f.at[3] = row + right + t->width;
    return f;
}

KFN Spec envmap_eval(const SceneView *scene, const EmitterRecord *e, Vec2 uv) {
    const TextureNode *t = scene->textures + e->slot;
    Footprint f = envmap_footprint(t, uv);
    Spec s = spec_zero();
    for (int k = 0; k < 4; k++) {
        s = spec_madd(s, footprint_weight(&f, k), bitmap_texel(scene, t, f.at[k]));
    }
    return spec_scale(s, f_set(scene->theta[scene->textures[e->scale].theta]));
}

KFN void envmap_adj(const SceneView *scene, const EmitterRecord *e, Vec2 uv, Spec dl, Sink *sink, Mask m) {
    const TextureNode *t = scene->textures + e->slot;
    const TextureNode *scale = scene->textures + e->scale;
    Footprint f = envmap_footprint(t, uv);
    Float s = f_set(scene->theta[scale->theta]);
    Spec image = spec_zero();
    for (int k = 0; k < 4; k++) {
        // L = scale sum_k w_k texel_k
        Float w = footprint_weight(&f, k);
        Int at = f.at[k] * t->channels + sink->texture_at[e->slot];
        image = spec_madd(image, w, bitmap_texel(scene, t, f.at[k]));
        for (int c = 0; c < SPEC_N && sink->texture_at[e->slot] >= 0; c++) {
            sink_add(sink, at + c, w * s * dl.c[c], m);
        }
    }
    if (sink->texture_at[e->scale] >= 0) {
        sink_add_uniform(sink, sink->texture_at[e->scale], spec_dot(dl, image), m);
    }
}

KFN LightSample envmap_sample(const SceneView *scene, const EmitterRecord *e, Vec2 u) {
    const TextureNode *t = scene->textures + e->slot;
    LightSample s;
    Float density;
    s.uv = grid_sample(scene, e->table + 9, t->width, t->height - 1, u, &density);
    // Cell column i covers [i + 1/2, i + 3/2] of the image, the span between two texel centres.
    s.uv.x = s.uv.x + 0.5f / (real)t->width;
    s.uv.x = s.uv.x - f_floor(s.uv.x);
    Float sin_theta, cos_theta, sin_phi, cos_phi;
    f_sincos(s.uv.y * PI, &sin_theta, &cos_theta);
    f_sincos(s.uv.x * TWO_PI, &sin_phi, &cos_phi);
    Vec3 v = v3(sin_theta * sin_phi, cos_theta, -sin_theta * cos_phi);
    const float *r = scene->tables + e->table; // transpose of the inverse rotation
    s.d = v3(r[0] * v.x + r[3] * v.y + r[6] * v.z, r[1] * v.x + r[4] * v.y + r[7] * v.z,
             r[2] * v.x + r[5] * v.y + r[8] * v.z);
    s.distance = f_set(2 * scene->bounds_radius);
    s.pdf = density * f_safe_rcp(2.0f * PI * PI * sin_theta);
    s.valid = m_gt(s.pdf, f_set(0));
    s.prim = i_set(0);
    return s;
}

KFN Float envmap_pdf(const SceneView *scene, const EmitterRecord *e, Vec2 uv) {
    const TextureNode *t = scene->textures + e->slot;
    Float sin_theta, cos_theta;
    f_sincos(uv.y * PI, &sin_theta, &cos_theta);
    uv.x = uv.x - 0.5f / (real)t->width;
    uv.x = uv.x - f_floor(uv.x);
    return grid_pdf(scene, e->table + 9, t->width, t->height - 1, uv) * f_safe_rcp(2.0f * PI * PI * sin_theta);
}

// ---- all kinds ---------------------------------------------------------------------------------------------------

KFN LightSample emitter_sample(const SceneView *scene, const EmitterRecord *e, Vec3 ref, Vec2 u) {
    LightSample s;
    switch (e->kind) {
    case EMITTER_AREA:
        return area_sample(scene, e, ref, u);
    case EMITTER_POINT: {
        const float *p = scene->theta + e->position;
        Vec3 to_light = v3_sub(v3(f_set(p[0]), f_set(p[1]), f_set(p[2])), ref);
        s.distance = v3_length(to_light);
        s.d = v3_scale(to_light, f_safe_rcp(s.distance));
        s.pdf = f_set(1);
        s.uv = (Vec2){f_set(0), f_set(0)};
        s.prim = i_set(0);
        s.valid = m_gt(s.distance, f_set(0));
        return s;
    }
    case EMITTER_CONSTANT:
        s.d = warp_uniform_sphere(u);
        s.distance = f_set(2 * scene->bounds_radius);
        s.pdf = f_set(INV_FOUR_PI);
        s.uv = (Vec2){f_set(0), f_set(0)};
        s.prim = i_set(0);
        s.valid = m_set(true);
        return s;
    default:
        return envmap_sample(scene, e, u);
    }
}

// Where the texture of a sampled light is read. hit: room for the point's triangle.
KFN TexCoord emitter_texcoord(const SceneView *scene, const EmitterRecord *e, Vec2 uv, Int prim, Hit *hit) {
    if (!e->attributes) {
        return texcoord(uv, NULL);
    }
    *hit = (Hit){i_set(e->shape), prim, uv.x, uv.y, v3_zero(), i_set(0)};
    return texcoord(mesh_interaction(scene, scene->shapes[e->shape].flags, hit).uv, hit);
}

// Radiance that arrives from a light sample (point lights: intensity over squared distance).
KFN Spec emitter_eval(const SceneView *scene, const EmitterRecord *e, TexCoord uv, Float distance) {
    switch (e->kind) {
    case EMITTER_ENVMAP:
        return envmap_eval(scene, e, (Vec2){uv.x, uv.y});
    case EMITTER_POINT:
        return spec_scale(texture_eval(scene, e->slot, uv), f_safe_rcp(distance * distance));
    default:
        return texture_eval(scene, e->slot, uv);
    }
}

// Accumulates the adjoint of emitter_eval into the light's own parameters.
KFN void emitter_adj(const SceneView *scene, const EmitterRecord *e, TexCoord uv, Float distance, Spec dl, Sink *sink,
                     Mask m) {
    switch (e->kind) {
    case EMITTER_ENVMAP:
        envmap_adj(scene, e, (Vec2){uv.x, uv.y}, dl, sink, m);
        break;
    case EMITTER_POINT:
        texture_adj(scene, e->slot, uv, spec_scale(dl, f_safe_rcp(distance * distance)), NULL, sink, m);
        break;
    default:
        texture_adj(scene, e->slot, uv, dl, NULL, sink, m);
    }
}
