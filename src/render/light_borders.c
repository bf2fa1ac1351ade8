// light_borders.c: the surfaces in the air at which light jumps: the borders of projectors' pictures, the lines along which these
// jump, and the cones of spots without a soft border.
#include "render/light_borders.h"

#include "bsdf/table.h"
#include "emitter/emitter.h"
#include "render/texture_steps.h"
#include "scene/texels.h"

#include <math.h>

enum { MOST_BORDERS = 4096 };

static bool ends_lit(const SceneView *view, const TextureNode *t) {
    bool lit = t->kind != TEXTURE_BITMAP || t->to_uv >= 0;
    for (int32_t i = 0; i < t->width * t->height && !lit; i++) {
        int32_t x = i % t->width, y = i / t->width;
        bool outermost = x == 0 || y == 0 || x == t->width - 1 || y == t->height - 1;
        for (int32_t c = 0; c < t->channels && outermost; c++) {
            lit |= rey_texel(view, t, (int64_t)t->channels * i + c) != 0;
        }
    }
    return lit;
}

// A point beyond the scene along a slope of the light's space.
static void beyond(const SceneView *view, const float *m, double x, double y, float p[3]) {
    double far = (double)view->bounds_radius;
    for (int k = 0; k < 3; k++) {
        far += fabs((double)m[4 * k + 3] - (double)view->bounds_centre[k]);
    }
    for (int k = 0; k < 3; k++) {
        p[k] = (float)((double)m[4 * k + 3] +
                       2 * far * ((double)m[4 * k] * x + (double)m[4 * k + 1] * y + (double)m[4 * k + 2]));
    }
}

static LightBorder border_between(const SceneView *view, int32_t light, int slot, double spread, const double a[2],
                                  const double b[2]) {
    LightBorder border = {.light = light};
    const double *slopes[2] = {a, b};
    for (int c = 0; c < 3; c++) {
        border.p[0][c] = view->theta[view->emitters[light].slot[slot] + 4 * c + 3];
    }
    for (int k = 0; k < 2; k++) {
        beyond(view, view->theta + view->emitters[light].slot[slot], spread * slopes[k][0], spread * slopes[k][1],
               border.p[k + 1]);
    }
    return border;
}

static rey_result push_border(rey_scene *scene, Array *borders, LightBorder border) {
    if (borders->count >= MOST_BORDERS) {
        return rey_fail(scene->ctx, REY_ERROR_UNSUPPORTED, "the pictures of projectors jump along more than %d lines",
                        MOST_BORDERS);
    }
    LightBorder *one = rey_array_push(scene->ctx, borders, sizeof *one, 1);
    if (!one) {
        return REY_ERROR_MEMORY;
    }
    *one = border;
    return REY_OK;
}

// The line between two places of a projector's picture, by their uv.
static rey_result push_picture_line(rey_scene *scene, int32_t light, const double from[2], const double to[2], Array *borders) {
    const SceneView *view = &scene->view;
    const float *extent = view->tables + view->emitters[light].table + PROJECTOR_EXTENT;
    double a[2], b[2];
    for (int k = 0; k < 2; k++) {
        a[k] = (1 - 2 * from[k]) * (double)extent[k];
        b[k] = (1 - 2 * to[k]) * (double)extent[k];
    }
    return push_border(scene, borders, border_between(view, light, SLOT(Projector, to_world), 1, a, b));
}

// Where the picture ends, and where it jumps.
static rey_result find_picture(rey_scene *scene, int32_t light, Array *borders) {
    static const double corners[5][2] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}, {0, 0}};
    const SceneView *view = &scene->view;
    int32_t texture = view->emitters[light].slot[SLOT(Projector, irradiance)];
    rey_result result = REY_OK;
    for (int k = 0; k < 4 && result == REY_OK && ends_lit(view, view->textures + texture); k++) {
        result = push_picture_line(scene, light, corners[k], corners[k + 1], borders);
    }
    Array steps = {0};
    result = result == REY_OK ? rey_light_steps(scene, texture, &steps) : result;
    for (size_t i = 0; i < steps.count && result == REY_OK; i++) {
        const TextureStep *s = &ARRAY_AT(steps, TextureStep, i);
        double low = s->offset + fmin(s->u, 0) + fmin(s->v, 0), high = s->offset + fmax(s->u, 0) + fmax(s->v, 0), ends[2][2];
        for (double level = fmax(ceil(low), s->low); level <= fmin(floor(high), s->high) && result == REY_OK; level++) {
            int side;
            result = !rey_step_across(s, level, ends, &side) ? REY_OK
                                                             : push_picture_line(scene, light, ends[0], ends[1], borders);
        }
    }
    rey_array_free(scene->ctx, &steps);
    return result;
}

// The cone of a spot that ends abruptly, between 64 of its lines: x^2 + y^2 = tan^2 z^2 in the light's space.
static rey_result find_cone(rey_scene *scene, int32_t light, Array *borders) {
    enum { AROUND = 64 };
    const double turn = 2 * 3.14159265358979323846 / AROUND;
    const SceneView *view = &scene->view;
    const EmitterRecord *e = view->emitters + light;
    const float *x = view->tables + e->table, *y = x + 4, *z = x + 8; // rows of the inverse
    double spread = tan((double)view->theta[view->textures[e->slot[SLOT(Spot, cutoff_angle)]].theta] * turn * AROUND / 360);
    float size = 1 / sqrtf(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]), t2 = (float)(spread * spread);
    Quadric cone = {.constant = 0};
    for (int k = 0; k < 3; k++) {
        int i = (k + 1) % 3, j = (k + 2) % 3;
        cone.centre[k] = view->theta[e->slot[SLOT(Spot, to_world)] + 4 * k + 3];
        cone.matrix[k] = size * (x[k] * x[k] + y[k] * y[k] - t2 * z[k] * z[k]);
        cone.matrix[3 + k] = size * (x[i] * x[j] + y[i] * y[j] - t2 * z[i] * z[j]);
    }
    rey_result result = REY_OK;
    for (int k = 0; k < AROUND && result == REY_OK; k++) {
        double a[2] = {cos(turn * k), sin(turn * k)}, b[2] = {cos(turn * (k + 1)), sin(turn * (k + 1))};
        LightBorder border = border_between(view, light, SLOT(Spot, to_world), spread, a, b);
        border.round = true;
        border.cone = cone;
        result = push_border(scene, borders, border);
    }
    return result;
}

static rey_result find_borders(rey_scene *scene, Array *borders) {
    const SceneView *view = &scene->view;
    rey_result result = REY_OK;
    for (int32_t i = 0; i < view->emitters_count && result == REY_OK; i++) {
        const EmitterRecord *e = view->emitters + i;
        if (e->kind == EMITTER_PROJECTOR) {
            result = find_picture(scene, i, borders);
        } else if (e->kind == EMITTER_SPOT && rey_light_is_abrupt(view, e)) {
            result = find_cone(scene, i, borders);
        }
    }
    return result;
}

// Borders of media hide nothing, so that nothing jumps where they pass through surfaces.
static void leave_out_passed(const SceneView *view, Array *meetings) {
    MeetingRecord *all = meetings->data;
    size_t kept = 0;
    for (size_t i = 0; i < meetings->count && view->has_media; i++) {
        bool passed = false;
        for (int k = 0; k < 2; k++) {
            int32_t shape = all[i].shape[k];
            passed |= shape >= 0 && rey_bsdf_passes(view->bsdfs[view->shapes[shape].bsdf].kind);
        }
        if (!passed) {
            all[kept++] = all[i];
        }
    }
    meetings->count = view->has_media ? kept : meetings->count;
}

rey_result rey_meetings_with_borders(rey_scene *scene, const LightBorder *clips, int clip_count, MeetingMoves *moves,
                                     const void *user, Array *meetings) {
    Array borders = {0};
    rey_result result = find_borders(scene, &borders);
    for (int i = 0; i < clip_count && result == REY_OK; i++) {
        result = push_border(scene, &borders, clips[i]);
    }
    if (result == REY_OK) {
        result = rey_meetings_find(scene, borders.data, (int32_t)borders.count, moves, user, meetings);
    }
    leave_out_passed(&scene->view, meetings);
    rey_array_free(scene->ctx, &borders);
    return result;
}

// In degrees.
static float spot_number(const SceneView *view, const EmitterRecord *e, int slot) {
    return view->theta[view->textures[e->slot[slot]].theta];
}

bool rey_light_is_abrupt(const SceneView *view, const EmitterRecord *e) {
    return e->kind == EMITTER_SPOT &&
           spot_number(view, e, SLOT(Spot, beam_width)) >= spot_number(view, e, SLOT(Spot, cutoff_angle));
}

bool rey_light_is_steep(const SceneView *view, const EmitterRecord *e) {
    return e->kind == EMITTER_SPOT && !rey_light_is_abrupt(view, e) &&
           spot_number(view, e, SLOT(Spot, beam_width)) >= spot_number(view, e, SLOT(Spot, cutoff_angle)) * (1 - 1e-3f);
}
