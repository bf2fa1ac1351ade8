// texture.h: textures as kernels see them, and their adjoints. The texture is uniform over the lanes; a constant costs
// one broadcast. Derivatives go to the texels, to uv, and to to_uv where that moves no jump.
// NOT differentiated: jumps of nearest-neighbour texels, checker edges and clamped borders under a moving uv.
#pragma once

#include "scene/attribute.h"
#include "scene/texels.h"
#include "scene/volume.h"

KFN Vec2 texture_map_uv(const SceneView *scene, const TextureNode *t, Vec2 uv) {
    if (t->to_uv < 0) {
        return uv;
    }
    const float *m = scene->theta + t->to_uv;
    return (Vec2){uv.x * m[0] + uv.y * m[1] + m[2], uv.x * m[3] + uv.y * m[4] + m[5]};
}

KFN void texture_map_uv_adj(const SceneView *scene, const TextureNode *t, Vec2 uv, Vec2 d, Vec2 *duv, int32_t to_uv_at,
                            Sink *sink, Mask m) {
    if (t->to_uv < 0) {
        duv->x = duv->x + d.x;
        duv->y = duv->y + d.y;
        return;
    }
    // x = m0 u + m1 v + m2, y = m3 u + m4 v + m5
    const float *a = scene->theta + t->to_uv;
    duv->x = duv->x + d.x * a[0] + d.y * a[3];
    duv->y = duv->y + d.x * a[1] + d.y * a[4];
    if (to_uv_at >= 0) {
        sink_add_uniform(sink, to_uv_at, d.x * uv.x, m);
        sink_add_uniform(sink, to_uv_at + 1, d.x * uv.y, m);
        sink_add_uniform(sink, to_uv_at + 2, d.x, m);
        sink_add_uniform(sink, to_uv_at + 3, d.y * uv.x, m);
        sink_add_uniform(sink, to_uv_at + 4, d.y * uv.y, m);
        sink_add_uniform(sink, to_uv_at + 5, d.y, m);
    }
}

// The four texels around uv (nearest: all the same) and the bilinear weights.
typedef struct Footprint {
    Int at[4];     // texel numbers: 00, 10, 01, 11
    Float fx, fy;  // weights of the second column and row
} Footprint;

KFN Footprint texture_footprint(const TextureNode *t, Vec2 uv) {
    // Far-away coordinates lose their fraction anyway; the clamp keeps the integer conversion defined.
    Float x = f_clamp(uv.x * (real)t->width, f_set(-1e7f), f_set(1e7f));
    Float y = f_clamp(uv.y * (real)t->height, f_set(-1e7f), f_set(1e7f));
    Footprint f;
    if (t->filter == FILTER_NEAREST) {
        Int ix = texture_wrap(i_from_f(f_floor(x)), t->width, t->wrap);
        Int iy = texture_wrap(i_from_f(f_floor(y)), t->height, t->wrap);
        f.at[0] = f.at[1] = f.at[2] = f.at[3] = iy * t->width + ix;
        f.fx = f.fy = f_set(0);
        return f;
    }
    x = x - 0.5f;
    y = y - 0.5f;
    Float x0 = f_floor(x), y0 = f_floor(y);
    f.fx = x - x0;
    f.fy = y - y0;
    Int ix0 = i_from_f(x0), iy0 = i_from_f(y0);
    Int ix1 = texture_wrap(ix0 + 1, t->width, t->wrap), iy1 = texture_wrap(iy0 + 1, t->height, t->wrap);
    ix0 = texture_wrap(ix0, t->width, t->wrap);
    iy0 = texture_wrap(iy0, t->height, t->wrap);
    f.at[0] = iy0 * t->width + ix0;
    f.at[1] = iy0 * t->width + ix1;
    f.at[2] = iy1 * t->width + ix0;
    f.at[3] = iy1 * t->width + ix1;
    return f;
}

KFN Float footprint_weight(const Footprint *f, int corner) {
    return (corner & 1 ? f->fx : 1.0f - f->fx) * (corner & 2 ? f->fy : 1.0f - f->fy);
}

// The number that a byte of a packed bitmap stands for.
KFN Float byte_number(const SceneView *scene, const TextureNode *t, Int byte) {
    Int index = byte + (t->storage == TEXELS_SRGB ? LEVELS_SRGB : LEVELS_BYTE);
#ifdef REAL_DOUBLE
    return (Float)scene->levels[index];
#else
    return f_gather(scene->levels, index);
#endif
}

// The number of the low 16 bits, a binary16: a sign, 5 bits of exponent, 10 of mantissa; below 2^-14 without a leading one.
KFN Float half_number(Int half) {
    Int exponent = half >> 10 & 31, least = i_min(exponent, i_set(1));
    // Exponents 0 and 1 stand for the same power.
    Float value = f_ldexp(f_from_i((half & 1023) + (least << 10)), exponent - least - 24);
    return f_select(mi_eq(half & 0x8000, i_set(0)), value, -value);
}

// Number `index` of a packed bitmap.
static NOINLINE Float packed_texel(const SceneView *scene, const TextureNode *t, Int index) {
    Int n = index + t->texels;
    return t->storage == TEXELS_HALF ? half_number(i_gather_halves(scene->texels, n))
                                     : byte_number(scene, t, i_gather_bytes(scene->texels, n) & 255);
}

// And that with the two behind it.
static NOINLINE Spec packed_colour(const SceneView *scene, const TextureNode *t, Int index) {
    Int n = index + t->texels;
    Spec s;
    if (t->storage == TEXELS_HALF) {
        Int two = i_gather_halves(scene->texels, n);
        s.c[0] = half_number(two);
        s.c[1] = half_number(two >> 16);
        s.c[2] = half_number(i_gather_halves(scene->texels, n + 2));
        return s;
    }
    Int bytes = i_gather_bytes(scene->texels, n);
    for (int c = 0; c < SPEC_N; c++) {
        s.c[c] = byte_number(scene, t, bytes >> (8 * c) & 255);
    }
    return s;
}

KFN Float texel_number(const SceneView *scene, const TextureNode *t, Int index) {
    return t->storage == TEXELS_FLOAT ? theta_at(scene, index + t->theta) : packed_texel(scene, t, index);
}

KFN Spec bitmap_texel(const SceneView *scene, const TextureNode *t, Int at) {
    Int index = at * t->channels;
    if (t->channels == 1) {
        return spec_set(texel_number(scene, t, index));
    }
    if (t->storage == TEXELS_FLOAT) {
        static_assert(SPEC_N == 3, "colours are read as three numbers");
        Spec s;
        f_gather3(scene->theta, index + t->theta, s.c);
        return s;
    }
    return packed_colour(scene, t, index);
}

KFN Spec bitmap_eval(const SceneView *scene, const TextureNode *t, Vec2 uv) {
    Footprint f = texture_footprint(t, texture_map_uv(scene, t, uv));
    if (t->filter == FILTER_NEAREST) {
        return bitmap_texel(scene, t, f.at[0]);
    }
    Spec s = spec_zero();
    for (int k = 0; k < 4; k++) {
        s = spec_madd(s, footprint_weight(&f, k), bitmap_texel(scene, t, f.at[k]));
    }
    return s;
}

KFN void bitmap_adj(const SceneView *scene, int32_t id, Vec2 uv, Spec d, Vec2 *duv, Sink *sink, Mask m) {
    const TextureNode *t = scene->textures + id;
    Footprint f = texture_footprint(t, texture_map_uv(scene, t, uv));
    int corners = t->filter == FILTER_NEAREST ? 1 : 4;
    if (sink->texture_at[id] >= 0) {
        for (int k = 0; k < corners; k++) {
            // s = sum_k w_k texel_k
            Float w = footprint_weight(&f, k);
            Int at = f.at[k] * t->channels + sink->texture_at[id];
            if (t->channels == 1) {
                sink_add(sink, at, w * spec_sum(d), m);
            } else {
                sink_add_spec(sink, at, spec_scale(d, w), m);
            }
        }
    }
    if (corners == 4 && (duv || sink->to_uv_at[id] >= 0)) {
        Float v[4];
        Vec2 unused = {f_set(0), f_set(0)};
        for (int k = 0; k < 4; k++) {
            v[k] = spec_dot(d, bitmap_texel(scene, t, f.at[k]));
        }
        // s(fx, fy) bilinear, fx = u' width - ..., fy = v' height - ...
        Vec2 g;
        g.x = f_zero_unless(m, ((v[1] - v[0]) * (1.0f - f.fy) + (v[3] - v[2]) * f.fy) * (real)t->width);
        g.y = f_zero_unless(m, ((v[2] - v[0]) * (1.0f - f.fx) + (v[3] - v[1]) * f.fx) * (real)t->height);
        texture_map_uv_adj(scene, t, uv, g, duv ? duv : &unused, sink->to_uv_at[id], sink, m);
    }
}

// Checkerboard: lanes on color0 when looked up as a colour. As a number the two are swapped [Mitsuba's convention].
KFN Mask checkerboard_first(const SceneView *scene, const TextureNode *t, Vec2 uv) {
    uv = texture_map_uv(scene, t, uv);
    Mask a = m_gt(uv.x - f_floor(uv.x), f_set(0.5f));
    Mask b = m_gt(uv.y - f_floor(uv.y), f_set(0.5f));
    return ~(a ^ b);
}

KFN Float luminance(Spec s) { return s.c[0] * 0.212671f + s.c[1] * 0.715160f + s.c[2] * 0.072169f; }
KFN Spec luminance_adj(Float d) {
    Spec s;
    s.c[0] = d * 0.212671f;
    s.c[1] = d * 0.715160f;
    s.c[2] = d * 0.072169f;
    return s;
}

// A field over space, looked up where the hit is; 0 where there is none.
KFN Spec volume_texture_eval(const SceneView *scene, const TextureNode *t, const Hit *hit) {
    const VolumeNode *v = scene->volumes + t->volume;
    return hit ? volume_eval(scene, v, volume_to_local(scene, v, hit->p, 1)) : spec_zero();
}

KFN void volume_texture_adj(const SceneView *scene, int32_t id, const Hit *hit, Spec d, Sink *sink, Mask m) {
    const VolumeNode *v = scene->volumes + scene->textures[id].volume;
    if (hit) {
        volume_world_adj(scene, v, hit->p, d, sink, m);
    }
    if (hit && sink->point && v->kind == VOLUME_GRID) {
        v3_acc(sink->point, v3_select(m, volume_slope(scene, v, hit->p, d), v3_zero()));
    }
}

static NOINLINE Spec texture_eval_general(const SceneView *scene, int32_t id, TexCoord uv) {
    const TextureNode *t = scene->textures + id;
    if (t->kind == TEXTURE_CONSTANT || t->kind == TEXTURE_BLACKBODY) {
        const float *v = scene->theta + t->theta;
        Spec s;
        for (int c = 0; c < SPEC_N; c++) {
            s.c[c] = f_set(v[t->channels == 1 ? 0 : c]);
        }
        return s;
    }
    if (t->kind == TEXTURE_BITMAP) {
        return bitmap_eval(scene, t, (Vec2){uv.x, uv.y});
    }
    if (t->kind == TEXTURE_ATTRIBUTE) {
        return attribute_eval(scene, t, uv.hit);
    }
    if (t->kind == TEXTURE_VOLUME) {
        return volume_texture_eval(scene, t, uv.hit);
    }
    return spec_select(checkerboard_first(scene, t, (Vec2){uv.x, uv.y}), texture_eval_general(scene, t->child[0], uv),
                       texture_eval_general(scene, t->child[1], uv));
}

static NOINLINE Float texture_eval_real_general(const SceneView *scene, int32_t id, TexCoord uv) {
    const TextureNode *t = scene->textures + id;
    if (t->kind == TEXTURE_CHECKERBOARD) {
        return f_select(checkerboard_first(scene, t, (Vec2){uv.x, uv.y}), texture_eval_real_general(scene, t->child[1], uv),
                        texture_eval_real_general(scene, t->child[0], uv));
    }
    Spec s = texture_eval_general(scene, id, uv);
    return t->channels == 1 ? s.c[0] : luminance(s);
}

KFN Spec texture_eval(const SceneView *scene, int32_t id, TexCoord uv) {
    const TextureNode *t = scene->textures + id;
    if (t->kind == TEXTURE_CONSTANT && t->channels == SPEC_N) {
        Spec s;
        for (int c = 0; c < SPEC_N; c++) {
            s.c[c] = f_set(scene->theta[t->theta + c]);
        }
        return s;
    }
    return texture_eval_general(scene, id, uv);
}

// The texture as a number: the luminance of a colour.
KFN Float texture_eval_real(const SceneView *scene, int32_t id, TexCoord uv) {
    const TextureNode *t = scene->textures + id;
    if (t->kind == TEXTURE_CONSTANT && t->channels == 1) {
        return f_set(scene->theta[t->theta]);
    }
    return texture_eval_real_general(scene, id, uv);
}

// Does the derivative of this texture, or of one inside it, leave through the sink?
KFN bool texture_wanted(const SceneView *scene, const Sink *sink, int32_t id) {
    const TextureNode *t = scene->textures + id;
    bool volume = t->kind == TEXTURE_VOLUME && (sink->any_volumes || sink->point);
    return sink->texture_at[id] >= 0 || sink->to_uv_at[id] >= 0 || t->kind == TEXTURE_CHECKERBOARD ||
           t->kind == TEXTURE_ATTRIBUTE || t->kind == TEXTURE_BLACKBODY || volume;
}

KFN void blackbody_adj(const SceneView *scene, const TextureNode *t, Spec d, Sink *sink, Mask m) {
    const float *slope = scene->theta + t->theta + BLACKBODY_SLOPE;
    int32_t at = sink->texture_at[t->child[0]];
    if (at >= 0) {
        sink_add_uniform(sink, at, d.c[0] * (real)slope[0] + d.c[1] * (real)slope[1] + d.c[2] * (real)slope[2], m);
    }
}

// Accumulates the adjoint d of texture_eval into the sink and into duv (may be null).
static NOINLINE void texture_adj(const SceneView *scene, int32_t id, TexCoord uv, Spec d, Vec2 *duv, Sink *sink, Mask m) {
    const TextureNode *t = scene->textures + id;
    int32_t at = sink->texture_at[id];
    if (t->kind == TEXTURE_CONSTANT) {
        if (at >= 0 && t->channels == 1) {
            sink_add_uniform(sink, at, spec_sum(d), m);
        } else if (at >= 0) {
            for (int c = 0; c < SPEC_N; c++) {
                sink_add_uniform(sink, at + c, d.c[c], m);
            }
        }
    } else if (t->kind == TEXTURE_BITMAP) {
        bitmap_adj(scene, id, (Vec2){uv.x, uv.y}, d, duv, sink, m);
    } else if (t->kind == TEXTURE_ATTRIBUTE) {
        attribute_adj(scene, id, uv.hit, d, sink, m);
    } else if (t->kind == TEXTURE_BLACKBODY) {
        blackbody_adj(scene, t, d, sink, m);
    } else if (t->kind == TEXTURE_VOLUME) {
        volume_texture_adj(scene, id, uv.hit, d, sink, m);
    } else {
        Mask first = checkerboard_first(scene, t, (Vec2){uv.x, uv.y});
        texture_adj(scene, t->child[0], uv, d, duv, sink, m & first);
        texture_adj(scene, t->child[1], uv, d, duv, sink, m & ~first);
    }
}

static NOINLINE void texture_adj_real(const SceneView *scene, int32_t id, TexCoord uv, Float d, Vec2 *duv, Sink *sink,
                                      Mask m) {
    const TextureNode *t = scene->textures + id;
    if (t->kind == TEXTURE_CHECKERBOARD) {
        Mask first = checkerboard_first(scene, t, (Vec2){uv.x, uv.y});
        texture_adj_real(scene, t->child[1], uv, d, duv, sink, m & first);
        texture_adj_real(scene, t->child[0], uv, d, duv, sink, m & ~first);
    } else if (t->channels == 1) {
        Spec one = spec_zero(); // the single channel is read once, so its adjoint counts once
        one.c[0] = d;
        texture_adj(scene, id, uv, one, duv, sink, m);
    } else {
        texture_adj(scene, id, uv, luminance_adj(d), duv, sink, m);
    }
}
