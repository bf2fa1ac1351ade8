// envmap.h: radiance by direction from a picture in latitude and longitude. Sampled from the luminance of its cells;
// the table is the inverse pose, then that distribution (distribution.h).
#pragma once

#include "emitter/distribution.h"
#include "emitter/light.h"

#define ENVMAP_PARAMS(P)                                                                                               \
    P(IMAGE, data, 0, 0, INFINITY, "radiance by direction, rows from the +y pole", "W/(m^2 sr)")                       \
    P(REAL, scale, 1, 0, INFINITY, "factor on the image", "")                                                          \
    P(SKY, to_world, 0, -INFINITY, INFINITY, "from the image's space", "")
EMITTER_SLOTS(Envmap, ENVMAP_PARAMS)

enum { ENVMAP_DISTRIBUTION = 12 };

// ---- host --------------------------------------------------------------------------------------------------------

static inline double envmap_luminance(const float *texel) {
    return fmax(0, 0.212671 * (double)texel[0] + 0.715160 * (double)texel[1] + 0.072169 * (double)texel[2]);
}

// Mass of the cell between texel columns x, x + 1 and rows y, y + 1: mean luminance times the sine of its latitude.
static inline double envmap_cell_mass(const TextureNode *t, const float *texels, int64_t x, int64_t y) {
    int64_t right = (x + 1) % t->width;
    double sum = envmap_luminance(texels + 3 * (y * t->width + x)) + envmap_luminance(texels + 3 * (y * t->width + right)) +
                 envmap_luminance(texels + 3 * ((y + 1) * t->width + x)) +
                 envmap_luminance(texels + 3 * ((y + 1) * t->width + right));
    return 0.25 * sum;
}

// The distribution: luminance times sine, with a share for every direction, because the derivative with respect to a
// black texel is not 0.
static inline void envmap_distribution(const SceneView *view, const EmitterRecord *e) {
    const double uniform_share = 0.02;
    const TextureNode *t = view->textures + e->slot[SLOT(Envmap, data)];
    const float *texels = view->theta + t->theta;
    int64_t width = t->width, rows = t->height - 1;
    float *row_cdf = view->tables + e->table + ENVMAP_DISTRIBUTION, *cell_cdf = row_cdf + rows;
    double total = 0, sines = 0;
    for (int64_t y = 0; y < rows; y++) {
        double sine = sin(3.14159265358979323846 * ((double)y + 0.5) / (double)rows);
        sines += sine * (double)width;
        for (int64_t x = 0; x < width; x++) {
            total += sine * envmap_cell_mass(t, texels, x, y);
        }
    }
    double floor = total > 0 ? uniform_share * total / sines : 1;
    double row_sum = 0, all = total > 0 ? total * (1 + uniform_share) : sines;
    for (int64_t y = 0; y < rows; y++) {
        double sine = sin(3.14159265358979323846 * ((double)y + 0.5) / (double)rows);
        double mass = 0, sum = 0;
        for (int64_t x = 0; x < width; x++) {
            mass += envmap_cell_mass(t, texels, x, y) + floor;
        }
        for (int64_t x = 0; x < width; x++) {
            sum += envmap_cell_mass(t, texels, x, y) + floor;
            cell_cdf[y * width + x] = x + 1 == width ? 1 : (float)(sum / mass);
        }
        row_sum += mass * sine;
        row_cdf[y] = y + 1 == rows ? 1 : (float)(row_sum / all);
    }
}

// Inverse pose, row masses, masses within rows.
static inline int64_t envmap_size(const TextureNode *textures, const EmitterRecord *e) {
    const TextureNode *t = textures + e->slot[SLOT(Envmap, data)];
    return ENVMAP_DISTRIBUTION + (int64_t)(t->height - 1) * (t->width + 1);
}

static inline bool envmap_follow(const SceneView *view, const EmitterRecord *e) {
    envmap_distribution(view, e);
    return light_pose_follow(view, e, SLOT(Envmap, to_world));
}

// ---- kernels -----------------------------------------------------------------------------------------------------

// u periodic, v from the +y pole down, of a local direction.
KFN Vec2 envmap_local_uv(Vec3 v) {
    Float u = f_atan2(v.x, -v.z) * INV_TWO_PI;
    return (Vec2){u - f_floor(u), f_acos(v.y) * INV_PI};
}

// Where the picture is read along a world direction.
KFN Vec2 envmap_uv(const SceneView *scene, const EmitterRecord *e, Vec3 d) {
    Light l = light_alone(e, i_set(0));
    return envmap_local_uv(light_direction_to_local(scene, &l, d));
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

KFN Spec envmap_image(const SceneView *scene, const Light *l, const Footprint *f) {
    const TextureNode *t = scene->textures + l->e->slot[SLOT(Envmap, data)];
    Spec s = spec_zero();
    for (int k = 0; k < 4; k++) {
        s = spec_madd(s, footprint_weight(f, k), bitmap_texel(scene, t, f->at[k]));
    }
    return s;
}

KFN Spec envmap_eval(const SceneView *scene, const Light *l, TexCoord uv, Float distance) {
    UNUSED(distance);
    Footprint f = envmap_footprint(scene->textures + l->e->slot[SLOT(Envmap, data)], (Vec2){uv.x, uv.y});
    return spec_scale(envmap_image(scene, l, &f), light_real(scene, l, SLOT(Envmap, scale)));
}

KFN void envmap_adj(const SceneView *scene, const Light *l, TexCoord uv, Float distance, Spec dl, LightMove *move,
                    Sink *sink, Mask m) {
    UNUSED(distance);
    const int32_t image = l->e->slot[SLOT(Envmap, data)];
    const TextureNode *t = scene->textures + image;
    Footprint f = envmap_footprint(t, (Vec2){uv.x, uv.y});
    Float scale = light_real(scene, l, SLOT(Envmap, scale));
    for (int k = 0; k < 4 && sink->texture_at[image] >= 0; k++) {
        // L = scale sum_k w_k texel_k
        Float w = footprint_weight(&f, k);
        Int at = f.at[k] * t->channels + sink->texture_at[image];
        for (int c = 0; c < SPEC_N; c++) {
            sink_add(sink, at + c, w * scale * dl.c[c], m);
        }
    }
    light_real_adj(scene, l, SLOT(Envmap, scale), spec_dot(dl, envmap_image(scene, l, &f)), sink, m);
    if (move) {
        Float v[4];
        for (int k = 0; k < 4; k++) {
            v[k] = spec_dot(dl, bitmap_texel(scene, t, f.at[k])) * scale;
        }
        move->uv.x = move->uv.x + ((v[1] - v[0]) * (1.0f - f.fy) + (v[3] - v[2]) * f.fy) * (real)t->width;
        move->uv.y = move->uv.y + ((v[2] - v[0]) * (1.0f - f.fx) + (v[3] - v[1]) * f.fx) * (real)(t->height - 1);
    }
}

// The picture turns over directions that stay.
KFN void envmap_move_adj(const SceneView *scene, const Light *l, Vec3 ref, Vec3 d, Float distance, LightMove *move,
                         Sink *sink, Mask m) {
    UNUSED(ref), UNUSED(distance);
    // u = atan2(x, -z) / 2 pi, v = acos(y) / pi
    Vec3 y = light_direction_to_local(scene, l, d);
    Float ring = f_max(y.x * y.x + y.z * y.z, f_set(1e-12f));
    Float du = move->uv.x * INV_TWO_PI / ring, dv = -move->uv.y * INV_PI * f_safe_rcp(f_safe_sqrt(1.0f - y.y * y.y));
    light_direction_to_local_adj(scene, l, SLOT(Envmap, to_world), y, v3(-du * y.z, dv, du * y.x), sink, m);
}

KFN LightSample envmap_sample(const SceneView *scene, const Light *l, Vec3 ref, Vec2 u) {
    UNUSED(ref);
    const TextureNode *t = scene->textures + l->e->slot[SLOT(Envmap, data)];
    LightSample s;
    Float density;
    s.uv = grid_sample(scene, l->e->table + ENVMAP_DISTRIBUTION, t->width, t->height - 1, u, &density);
    // Cell column i covers [i + 1/2, i + 3/2] of the image, the span between two texel centres.
    s.uv.x = s.uv.x + 0.5f / (real)t->width;
    s.uv.x = s.uv.x - f_floor(s.uv.x);
    Float sin_theta, cos_theta, sin_phi, cos_phi;
    f_sincos(s.uv.y * PI, &sin_theta, &cos_theta);
    f_sincos(s.uv.x * TWO_PI, &sin_phi, &cos_phi);
    Vec3 v = v3(sin_theta * sin_phi, cos_theta, -sin_theta * cos_phi);
    const float *r = scene->tables + l->e->table; // transpose of the inverse rotation
    s.d = v3(r[0] * v.x + r[4] * v.y + r[8] * v.z, r[1] * v.x + r[5] * v.y + r[9] * v.z,
             r[2] * v.x + r[6] * v.y + r[10] * v.z);
    s.distance = f_set(2 * (real)scene->bounds_radius);
    s.pdf = density * f_safe_rcp(2.0f * PI * PI * sin_theta);
    s.valid = m_gt(s.pdf, f_set(0));
    s.prim = i_set(0);
    return s;
}

KFN Float envmap_pdf(const SceneView *scene, const EmitterRecord *e, Vec2 uv) {
    const TextureNode *t = scene->textures + e->slot[SLOT(Envmap, data)];
    Float sin_theta, cos_theta;
    f_sincos(uv.y * PI, &sin_theta, &cos_theta);
    uv.x = uv.x - 0.5f / (real)t->width;
    uv.x = uv.x - f_floor(uv.x);
    return grid_pdf(scene, e->table + ENVMAP_DISTRIBUTION, t->width, t->height - 1, uv) *
           f_safe_rcp(2.0f * PI * PI * sin_theta);
}
