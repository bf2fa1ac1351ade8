// texture_gradient.h: the slope of a texture, read as a number, in u and v: what bump maps need. Of a bilinear bitmap it
// is linear within a texel cell; of constants, nearest texels and within the fields of a checkerboard it is 0.
// NOT differentiated: the jumps of the slope where uv moves from one cell to the next.
#pragma once

#include "scene/texture.h"

KFN Float bitmap_number(const SceneView *scene, const TextureNode *t, Int at) {
    Spec s = bitmap_texel(scene, t, at);
    return t->channels == 1 ? s.c[0] : luminance(s);
}

// Slopes of the weight of one corner along the columns and the rows [per unit of the texture's own coordinates].
KFN Vec2 footprint_slope(const TextureNode *t, const Footprint *f, int corner) {
    Float x = (corner & 2 ? f->fy : 1.0f - f->fy) * (real)t->width;
    Float y = (corner & 1 ? f->fx : 1.0f - f->fx) * (real)t->height;
    return (Vec2){corner & 1 ? x : -x, corner & 2 ? y : -y};
}

// Slopes in the texture's own coordinates.
KFN Vec2 bitmap_slope(const SceneView *scene, const TextureNode *t, const Footprint *f) {
    Vec2 g = {f_set(0), f_set(0)};
    for (int k = 0; k < 4; k++) {
        Vec2 w = footprint_slope(t, f, k);
        Float v = bitmap_number(scene, t, f->at[k]);
        g.x = g.x + w.x * v;
        g.y = g.y + w.y * v;
    }
    return g;
}

static NOINLINE Vec2 texture_gradient(const SceneView *scene, int32_t id, TexCoord uv) {
    const TextureNode *t = scene->textures + id;
    Vec2 g = {f_set(0), f_set(0)};
    if (t->kind == TEXTURE_CHECKERBOARD) {
        Mask first = checkerboard_first(scene, t, (Vec2){uv.x, uv.y});
        Vec2 a = texture_gradient(scene, t->child[1], uv), b = texture_gradient(scene, t->child[0], uv);
        return (Vec2){f_select(first, a.x, b.x), f_select(first, a.y, b.y)};
    }
    if (t->kind != TEXTURE_BITMAP || t->filter == FILTER_NEAREST) {
        return g;
    }
    Footprint f = texture_footprint(t, texture_map_uv(scene, t, (Vec2){uv.x, uv.y}));
    g = bitmap_slope(scene, t, &f);
    if (t->to_uv >= 0) {
        const float *m = scene->theta + t->to_uv;
        g = (Vec2){g.x * m[0] + g.y * m[3], g.x * m[1] + g.y * m[4]};
    }
    return g;
}

// to_uv stands in the chain rule as well as in the position: g_u = g_x m0 + g_y m3, g_v = g_x m1 + g_y m4.
KFN void gradient_map_adj(const SceneView *scene, const TextureNode *t, const Footprint *f, int32_t to_uv_at, Vec2 d,
                          Sink *sink, Mask m) {
    if (t->to_uv >= 0 && to_uv_at >= 0) {
        Vec2 g = bitmap_slope(scene, t, f);
        sink_add_uniform(sink, to_uv_at, d.x * g.x, m);
        sink_add_uniform(sink, to_uv_at + 1, d.y * g.x, m);
        sink_add_uniform(sink, to_uv_at + 3, d.x * g.y, m);
        sink_add_uniform(sink, to_uv_at + 4, d.y * g.y, m);
    }
}

KFN void bitmap_gradient_adj(const SceneView *scene, int32_t id, TexCoord uv, Vec2 d, Vec2 *duv, Sink *sink, Mask m) {
    const TextureNode *t = scene->textures + id;
    Footprint f = texture_footprint(t, texture_map_uv(scene, t, (Vec2){uv.x, uv.y}));
    gradient_map_adj(scene, t, &f, sink->to_uv_at[id], d, sink, m);
    Vec2 e = d; // the adjoint in the texture's own coordinates
    if (t->to_uv >= 0) {
        const float *a = scene->theta + t->to_uv;
        e = (Vec2){d.x * a[0] + d.y * a[1], d.x * a[3] + d.y * a[4]};
    }
    Float mixed = f_set(0);
    for (int k = 0; k < 4; k++) {
        // g = sum_k slope_k texel_k
        Vec2 w = footprint_slope(t, &f, k);
        Float dtexel = w.x * e.x + w.y * e.y, v = bitmap_number(scene, t, f.at[k]);
        mixed = mixed + (k == 0 || k == 3 ? v : -v);
        if (sink->texture_at[id] >= 0) {
            Int at = f.at[k] * t->channels + sink->texture_at[id];
            Spec parts = luminance_adj(dtexel);
            for (int c = 0; c < t->channels; c++) {
                sink_add(sink, at + c, t->channels == 1 ? dtexel : parts.c[c], m);
            }
        }
    }
    if (duv || sink->to_uv_at[id] >= 0) {
        // The slope along the columns changes along the rows, by the mixed second difference, and the other way round.
        Vec2 unused = {f_set(0), f_set(0)}, dxy;
        mixed = f_zero_unless(m, mixed * ((real)t->width * (real)t->height));
        dxy = (Vec2){e.y * mixed, e.x * mixed};
        texture_map_uv_adj(scene, t, (Vec2){uv.x, uv.y}, dxy, duv ? duv : &unused, sink->to_uv_at[id], sink, m);
    }
}

// Accumulates the adjoint d of texture_gradient into the sink and into duv (may be null).
static NOINLINE void texture_gradient_adj(const SceneView *scene, int32_t id, TexCoord uv, Vec2 d, Vec2 *duv, Sink *sink,
                                          Mask m) {
    const TextureNode *t = scene->textures + id;
    if (t->kind == TEXTURE_CHECKERBOARD) {
        Mask first = checkerboard_first(scene, t, (Vec2){uv.x, uv.y});
        texture_gradient_adj(scene, t->child[1], uv, d, duv, sink, m & first);
        texture_gradient_adj(scene, t->child[0], uv, d, duv, sink, m & ~first);
    } else if (t->kind == TEXTURE_BITMAP && t->filter != FILTER_NEAREST) {
        bitmap_gradient_adj(scene, id, uv, d, duv, sink, m);
    }
}
