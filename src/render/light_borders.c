// light_borders.c: the surfaces in the air at which light jumps: the borders of projectors' pictures, the lines along which these
// and spots' textures jump, and the cones of spots without a soft border.
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

// A picture in the light of a projector or a spot.
typedef struct Picture {
    int32_t light, texture;
    int slot;         // of the light's pose
    double extent[2]; // uv = 1/2 - slope / (2 extent)
} Picture;

static double spot_tangent(const SceneView *view, const EmitterRecord *e) {
    return tan((double)view->theta[view->textures[e->slot[SLOT(Spot, cutoff_angle)]].theta] * 3.14159265358979323846 / 180);
}

static bool has_picture(const EmitterRecord *e) { return e->kind == EMITTER_PROJECTOR || e->kind == EMITTER_SPOT; }

static Picture picture_of(const SceneView *view, int32_t light) {
    const EmitterRecord *e = view->emitters + light;
    if (e->kind == EMITTER_SPOT) {
        double extent = -spot_tangent(view, e);
        return (Picture){light, e->slot[SLOT(Spot, texture)], SLOT(Spot, to_world), {extent, extent}};
    }
    const float *extent = view->tables + e->table + PROJECTOR_EXTENT;
    return (Picture){light, e->slot[SLOT(Projector, irradiance)], SLOT(Projector, to_world),
                     {(double)extent[0], (double)extent[1]}};
}

// The line between two places of a picture, by their uv.
static rey_result push_picture_line(rey_scene *scene, const Picture *picture, const double from[2], const double to[2],
                                    Array *borders) {
    double a[2], b[2];
    for (int k = 0; k < 2; k++) {
        a[k] = (1 - 2 * from[k]) * picture->extent[k];
        b[k] = (1 - 2 * to[k]) * picture->extent[k];
    }
    return push_border(scene, borders, border_between(&scene->view, picture->light, picture->slot, 1, a, b));
}

// Whether a light is a projector whose picture does not end black.
static bool has_sides(const SceneView *view, int32_t light) {
    const EmitterRecord *e = view->emitters + light;
    return e->kind == EMITTER_PROJECTOR && ends_lit(view, view->textures + e->slot[SLOT(Projector, irradiance)]);
}

// Where a projector's picture ends.
static rey_result find_sides(rey_scene *scene, int32_t light, Array *borders) {
    static const double corners[5][2] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}, {0, 0}};
    const Picture picture = picture_of(&scene->view, light);
    rey_result result = REY_OK;
    for (int k = 0; k < 4 && result == REY_OK; k++) {
        result = push_picture_line(scene, &picture, corners[k], corners[k + 1], borders);
    }
    return result;
}

// Where a picture jumps.
static rey_result find_lines(rey_scene *scene, int32_t light, Array *borders) {
    const Picture picture = picture_of(&scene->view, light);
    Array steps = {0};
    rey_result result = rey_light_steps(scene, picture.texture, &steps);
    for (size_t i = 0; i < steps.count && result == REY_OK; i++) {
        const TextureStep *s = &ARRAY_AT(steps, TextureStep, i);
        double low = s->offset + fmin(s->u, 0) + fmin(s->v, 0), high = s->offset + fmax(s->u, 0) + fmax(s->v, 0), ends[2][2];
        for (double level = fmax(ceil(low), s->low); level <= fmin(floor(high), s->high) && result == REY_OK; level++) {
            int side;
            result = !rey_step_across(s, level, ends, &side) ? REY_OK
                                                             : push_picture_line(scene, &picture, ends[0], ends[1], borders);
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
    double spread = spot_tangent(view, e);
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
        if (has_sides(view, i)) {
            result = find_sides(scene, i, borders);
        } else if (rey_light_is_abrupt(view, view->emitters + i)) {
            result = find_cone(scene, i, borders);
        }
        result = result == REY_OK && has_picture(view->emitters + i) ? find_lines(scene, i, borders) : result;
    }
    return result;
}

static rey_result push_record(rey_scene *scene, TextureStep step, Array *steps) {
    StepRecord *one = rey_array_push(scene->ctx, steps, sizeof *one, 1);
    if (one) {
        *one = rey_step_record(&step);
    }
    return one ? REY_OK : REY_ERROR_MEMORY;
}

// The sides of a projector's picture, and the lines along which it or a spot's jumps.
static rey_result push_picture_records(rey_scene *scene, int32_t light, Array *steps) {
    const SceneView *view = &scene->view;
    Array lines = {0};
    rey_result result = rey_light_steps(scene, picture_of(view, light).texture, &lines);
    for (int k = 0; k < 2 && result == REY_OK && has_sides(view, light); k++) {
        result = push_record(scene, (TextureStep){.sort = STEP_LINES, .at = -1, .u = k == 0, .v = k == 1, .high = 1}, steps);
    }
    for (size_t i = 0; i < lines.count && result == REY_OK; i++) {
        result = push_record(scene, ARRAY_AT(lines, TextureStep, i), steps);
    }
    rey_array_free(scene->ctx, &lines);
    return result;
}

rey_result rey_beam_records(rey_scene *scene, Array *steps, Array *beams) {
    const SceneView *view = &scene->view;
    rey_result result = REY_OK;
    for (int32_t i = 0; i < view->emitters_count && result == REY_OK; i++) {
        const EmitterRecord *e = view->emitters + i;
        BeamRecord beam = {.light = i, .first = (int32_t)steps->count, .cone = rey_light_is_abrupt(view, e)};
        result = has_picture(e) ? push_picture_records(scene, i, steps) : REY_OK;
        beam.end = (int32_t)steps->count;
        if (result != REY_OK || (!beam.cone && beam.end == beam.first)) {
            continue;
        }
        BeamRecord *one = rey_array_push(scene->ctx, beams, sizeof *one, 1);
        if (!one) {
            return REY_ERROR_MEMORY;
        }
        *one = beam;
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
