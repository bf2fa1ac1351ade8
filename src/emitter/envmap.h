// envmap.h: radiance by direction from a picture in latitude and longitude. Sampled from the luminance of its cells, and within
// a cell from the bilinear interpolation of its corners' luminance, as it is read: suns are single texels. So the density at
// a point is the interpolated luminance there times the sine of the row's latitude, and is found without the table of cells
// (the rounding of whose sums to 2^-24 it leaves out).
// The table is the inverse pose, the luminance that every direction has in addition, the factor of the density, the sines of
// the rows' latitudes, then the distribution of cells (distribution.h).
#pragma once

#include "emitter/distribution.h"
#include "emitter/light.h"
#include "math/colour.h"

#define ENVMAP_PARAMS(P)                                                                                               \
    P(IMAGE, data, 0, 0, INFINITY, "radiance by direction, rows from the +y pole", "W/(m^2 sr)")                       \
    P(REAL, scale, 1, 0, INFINITY, "factor on the image", "")                                                          \
    P(SKY, to_world, 0, -INFINITY, INFINITY, "from the image's space", "")
EMITTER_SLOTS(Envmap, ENVMAP_PARAMS)

enum { ENVMAP_FLOOR = 12, ENVMAP_SCALE = 13, ENVMAP_SINES = 14 };

// The share of every direction, over that of the picture.
#define ENVMAP_UNIFORM 0.02

// ---- host --------------------------------------------------------------------------------------------------------

static inline double envmap_luminance(const float *texel) {
    const double rgb[3] = {(double)texel[0], (double)texel[1], (double)texel[2]};
    return rey_xyz_of(rgb, 1);
}

// Of the latitude in the middle of a row of cells.
static inline double envmap_row_sine(int64_t y, int64_t rows) {
    return sin(3.14159265358979323846 * ((double)y + 0.5) / (double)rows);
}

// Luminance of a row of texels; the picture has one row more than the table, and that one is never kept.
static inline float envmap_row_luminance(const float *texels, const float *kept, bool last, int64_t x) {
    return last ? (float)fmax(0, envmap_luminance(texels + 3 * x)) : kept[x];
}

// Masses of the cells, each between texel columns x, x + 1 and rows y, y + 1: their mean luminance, in place of the
// luminance of its first texel, which `cells` holds. Returns their sum, weighted by the sine of the latitude.
static inline double envmap_cell_masses(const float *last_row, int64_t width, int64_t rows, float *cells) {
    double total = 0;
    for (int64_t y = 0; y < rows; y++) {
        float *row = cells + y * width;
        const float *below = row + width;
        bool last = y + 1 == rows;
        double sum = 0, first = (double)row[0] + (double)envmap_row_luminance(last_row, below, last, 0), left = first;
        for (int64_t x = 0; x < width; x++) {
            double right = first;
            if (x + 1 < width) {
                right = (double)row[x + 1] + (double)envmap_row_luminance(last_row, below, last, x + 1);
            }
            row[x] = (float)(0.25 * (left + right));
            sum += (double)row[x];
            left = right;
        }
        total += sum * envmap_row_sine(y, rows);
    }
    return total;
}

// The distribution: luminance times sine, with a share for every direction, because the derivative with respect to a
// black texel is not 0. Every texel is looked at once.
static inline void envmap_distribution(const SceneView *view, const EmitterRecord *e) {
    const TextureNode *t = view->textures + e->slot[SLOT(Envmap, data)];
    const float *texels = view->theta + t->theta;
    int64_t width = t->width, rows = t->height - 1;
    float *table_sines = view->tables + e->table + ENVMAP_SINES, *row_cdf = table_sines + rows;
    float *cells = grid_cells(row_cdf, (int32_t)width, (int32_t)rows);
    double sines = 0, row_sum = 0;
    for (int64_t i = 0; i < rows * width; i++) {
        cells[i] = (float)fmax(0, envmap_luminance(texels + 3 * i));
    }
    double total = envmap_cell_masses(texels + 3 * rows * width, width, rows, cells);
    for (int64_t y = 0; y < rows; y++) {
        sines += envmap_row_sine(y, rows) * (double)width;
        table_sines[y] = (float)envmap_row_sine(y, rows);
    }
    double floor = total > 0 ? ENVMAP_UNIFORM * total / sines : 1;
    double all = total > 0 ? total * (1 + ENVMAP_UNIFORM) : sines;
    view->tables[e->table + ENVMAP_FLOOR] = (float)floor;
    view->tables[e->table + ENVMAP_SCALE] = (float)((double)(rows * width) / all);
    for (int64_t y = 0; y < rows; y++) {
        float *row = cells + y * width;
        double mass = 0, sum = 0;
        for (int64_t x = 0; x < width; x++) {
            mass += (double)row[x] + floor;
        }
        for (int64_t x = 0; x < width; x++) {
            sum += (double)row[x] + floor;
            row[x] = x + 1 == width ? 1 : (float)(sum / mass);
        }
        row_sum += mass * envmap_row_sine(y, rows);
        row_cdf[y] = y + 1 == rows ? 1 : (float)(row_sum / all);
    }
    grid_finish(row_cdf, (int32_t)width, (int32_t)rows);
}

// The derivative of the logarithm of the sum of all masses by a number of the picture.
static inline double envmap_log_sum_slope(const SceneView *view, const EmitterRecord *e, int64_t number) {
    const TextureNode *t = view->textures + e->slot[SLOT(Envmap, data)];
    const int64_t rows = t->height - 1, texel = number / t->channels, y = texel / t->width;
    const double scale = (double)view->tables[e->table + ENVMAP_SCALE];
    const double sum = (double)(rows * t->width) / (scale * (1 + ENVMAP_UNIFORM));
    const float *sines = view->tables + e->table + ENVMAP_SINES;
    const double above = y > 0 ? (double)sines[y - 1] : 0, below = y < rows ? (double)sines[y] : 0;
    // A texel is a corner of two cells of either row.
    bool counts = envmap_luminance(view->theta + t->theta + t->channels * texel) >= 0;
    return counts ? 0.5 * (above + below) * rey_xyz_rows[1][number % t->channels] / sum : 0;
}

static inline int64_t envmap_size(const TextureNode *textures, const EmitterRecord *e) {
    const TextureNode *t = textures + e->slot[SLOT(Envmap, data)];
    return ENVMAP_SINES + t->height - 1 + grid_size(t->width, t->height - 1);
}

static inline bool envmap_follow(const SceneView *view, const EmitterRecord *e) {
    envmap_distribution(view, e);
    return light_pose_follow(view, e, SLOT(Envmap, to_world));
}

// ---- kernels -----------------------------------------------------------------------------------------------------

// The picture is read along the line of a direction in its own space, whatever the direction's length there: poses may
// scale and shear. (Mitsuba 3.9.1 takes acos of y without normalising, and its light samples have that length: with
// such poses it finds other radiance than it samples. With rotations and mirrors both agree.)
// u periodic, v from the +y pole down: u = atan2(x, -z) / 2 pi, v = atan2(|(x, z)|, y) / pi.
KFN Vec2 envmap_uv(const SceneView *scene, const EmitterRecord *e, Vec3 d) {
    Light l = light_alone(e, i_set(0));
    Vec3 y = light_direction_to_local(scene, &l, d);
    Float u = f_atan2(y.x, -y.z) * INV_TWO_PI;
    return (Vec2){u - f_floor(u), f_atan2(f_sqrt(y.x * y.x + y.z * y.z), y.y) * INV_PI};
}

// |det A^-1| of the pose A.
KFN real envmap_shrinking(const SceneView *scene, const EmitterRecord *e) {
    real b[12];
    for (int k = 0; k < 12; k++) {
        b[k] = (real)scene->tables[e->table + k];
    }
    real det = b[0] * (b[5] * b[10] - b[6] * b[9]) - b[1] * (b[4] * b[10] - b[6] * b[8]) +
               b[2] * (b[4] * b[9] - b[5] * b[8]);
    return det < 0 ? -det : det;
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
        sink_add_spec(sink, at, spec_scale(dl, w * scale), m);
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

// The picture turns over directions that stay, or directions turn.
KFN void envmap_move_adj(const SceneView *scene, const Light *l, Vec3 ref, Vec3 d, Float distance, LightMove *move,
                         Sink *sink, Mask m) {
    UNUSED(ref), UNUSED(distance);
    // u = atan2(x, -z) / 2 pi, v = atan2(ring, y) / pi, ring = |(x, z)|
    Vec3 y = light_direction_to_local(scene, l, d);
    Float ring2 = f_max(y.x * y.x + y.z * y.z, f_set(1e-12f)), ring = f_sqrt(ring2);
    Float du = move->uv.x * INV_TWO_PI / ring2, dv = move->uv.y * INV_PI / (ring2 + y.y * y.y);
    Float dring = dv * y.y / ring;
    Vec3 dy = v3(dring * y.x - du * y.z, -dv * ring, dring * y.z + du * y.x);
    move->d = v3_add(move->d, light_direction_to_local_adj(scene, l, SLOT(Envmap, to_world), y, dy, sink, m));
}

// A cell as sampling counts it: luminance at its corners, and what makes that a density per unit square.
typedef struct EnvmapCell {
    Float corner[4];
    Float scale;
} EnvmapCell;

KFN EnvmapCell envmap_cell(const SceneView *scene, const EmitterRecord *e, const Footprint *f, Int row) {
    const TextureNode *t = scene->textures + e->slot[SLOT(Envmap, data)];
    const real floor = (real)scene->tables[e->table + ENVMAP_FLOOR];
    EnvmapCell cell;
    for (int k = 0; k < 4; k++) {
        cell.corner[k] = f_max(luminance(bitmap_texel(scene, t, f->at[k])), f_set(0)) + floor;
    }
    cell.scale = table_at(scene, row + (e->table + ENVMAP_SINES)) * (real)scene->tables[e->table + ENVMAP_SCALE];
    return cell;
}

// Density per unit square at (x, y) in the cell.
KFN Float envmap_cell_density(const EnvmapCell *c, Float x, Float y) {
    return f_lerp(f_lerp(c->corner[0], c->corner[1], x), f_lerp(c->corner[2], c->corner[3], x), y) * c->scale;
}

// Sample of the density that goes from a at 0 to b at 1 linearly.
KFN Float envmap_sample_linear(Float a, Float b, Float u) {
    return f_min(u * (a + b) * f_safe_rcp(a + f_safe_sqrt(f_lerp(a * a, b * b, u))), f_set(1));
}

// The footprint of cell (column, row): column i is the span between the texel centres i and i + 1.
KFN Footprint envmap_cell_footprint(const TextureNode *t, Int column, Int row) {
    Footprint f = {.fx = f_set(0), .fy = f_set(0)};
    Int left = row * t->width + column, right = i_select(mi_lt(column, i_set(t->width - 1)), left + 1, row * t->width);
    f.at[0] = left;
    f.at[1] = right;
    f.at[2] = left + t->width;
    f.at[3] = right + t->width;
    return f;
}

KFN LightSample envmap_sample(const SceneView *scene, const Light *l, Vec3 ref, Vec2 u) {
    UNUSED(ref);
    const TextureNode *t = scene->textures + l->e->slot[SLOT(Envmap, data)];
    LightSample s;
    GridCell at = grid_sample(scene, l->e->table + ENVMAP_SINES + t->height - 1, t->width, t->height - 1, u);
    Footprint f = envmap_cell_footprint(t, at.column, at.row);
    EnvmapCell c = envmap_cell(scene, l->e, &f, at.row);
    Float y = envmap_sample_linear(c.corner[0] + c.corner[1], c.corner[2] + c.corner[3], at.fy);
    Float x = envmap_sample_linear(f_lerp(c.corner[0], c.corner[2], y), f_lerp(c.corner[1], c.corner[3], y), at.fx);
    Float density = envmap_cell_density(&c, x, y);
    s.uv.x = (f_from_i(at.column) + x + 0.5f) * (1.0f / (real)t->width);
    s.uv.y = (f_from_i(at.row) + y) * (1.0f / (real)(t->height - 1));
    s.uv.x = s.uv.x - f_floor(s.uv.x);
    Float sin_theta, cos_theta, sin_phi, cos_phi;
    f_sincos(s.uv.y * PI, &sin_theta, &cos_theta);
    f_sincos(s.uv.x * TWO_PI, &sin_phi, &cos_phi);
    Vec3 v = v3(sin_theta * sin_phi, cos_theta, -sin_theta * cos_phi);
    // d = A v / |A v|
    const float *a = scene->theta + l->e->slot[SLOT(Envmap, to_world)];
    s.d = v3(a[0] * v.x + a[1] * v.y + a[2] * v.z, a[4] * v.x + a[5] * v.y + a[6] * v.z,
             a[8] * v.x + a[9] * v.y + a[10] * v.z);
    Float length = v3_length(s.d);
    s.d = v3_scale(s.d, f_safe_rcp(length));
    s.distance = f_set(2 * (real)scene->bounds_radius);
    // Solid angles: d omega_v = |det A^-1| |A v|^3 d omega_d.
    Float stretch = length * length * length * envmap_shrinking(scene, l->e);
    s.pdf = density * stretch * f_safe_rcp(2.0f * PI * PI * sin_theta);
    s.valid = m_gt(s.pdf, f_set(0));
    s.prim = i_set(0);
    return s;
}

// The cell of a direction, and the factor from densities per unit square to those per solid angle.
KFN EnvmapCell envmap_cell_towards(const SceneView *scene, const EmitterRecord *e, Vec3 d, Vec2 uv, Footprint *f, Float *factor) {
    const TextureNode *t = scene->textures + e->slot[SLOT(Envmap, data)];
    Light l = light_alone(e, i_set(0));
    // With y = A^-1 d = v / |A v|: |A v|^3 / sin = 1 / (|y|^2 |(x, z)|).
    Vec3 y = light_direction_to_local(scene, &l, d);
    Float ring2 = y.x * y.x + y.z * y.z;
    *factor = envmap_shrinking(scene, e) * f_safe_rcp(2.0f * PI * PI * f_sqrt(ring2) * (ring2 + y.y * y.y));
    *f = envmap_footprint(t, uv);
    Int row = i_max(i_min(i_from_f(uv.y * (real)(t->height - 1)), i_set(t->height - 2)), i_set(0));
    return envmap_cell(scene, e, f, row);
}

KFN Float envmap_pdf(const SceneView *scene, const EmitterRecord *e, Vec3 d, Vec2 uv) {
    Footprint f;
    Float factor;
    EnvmapCell cell = envmap_cell_towards(scene, e, d, uv, &f, &factor);
    return envmap_cell_density(&cell, f.fx, f.fy) * factor;
}

// Adjoint of envmap_pdf by the texels' luminance y, and by the logarithm of the sum of all masses (sink->sky_at):
// the density is that of a constant share plus one in proportion to sum_k w_k y_k / sum.
KFN void envmap_pdf_adj(const SceneView *scene, const EmitterRecord *e, Vec3 d, Vec2 uv, Float dpdf, Sink *sink, Mask m) {
    const int32_t image = e->slot[SLOT(Envmap, data)];
    const TextureNode *t = scene->textures + image;
    Footprint f;
    Float factor, share = f_set(0);
    EnvmapCell cell = envmap_cell_towards(scene, e, d, uv, &f, &factor);
    for (int k = 0; k < 4; k++) {
        Float w = footprint_weight(&f, k) * cell.scale * factor * dpdf, y = luminance(bitmap_texel(scene, t, f.at[k]));
        Spec dtexel = luminance_adj(f_zero_unless(m_ge(y, f_set(0)), w));
        Int at = f.at[k] * t->channels + sink->texture_at[image];
        sink_add_spec(sink, at, dtexel, m);
        share = share + w * f_max(y, f_set(0));
    }
    sink_add_uniform(sink, sink->sky_at, -share, m);
}
