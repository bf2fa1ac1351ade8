// light_borders.c: the borders of projectors' pictures.
#include "render/light_borders.h"

#include "emitter/emitter.h"
#include "scene/texels.h"

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

// A corner of the picture, beyond the scene.
static void corner(const SceneView *view, const EmitterRecord *e, int which, float p[3]) {
    const float *m = view->theta + e->slot[SLOT(Projector, to_world)], *extent = view->tables + e->table + PROJECTOR_EXTENT;
    float far = view->bounds_radius;
    for (int k = 0; k < 3; k++) {
        far += fabsf(m[4 * k + 3] - view->bounds_centre[k]);
    }
    float x = which == 0 || which == 3 ? extent[0] : -extent[0], y = which < 2 ? extent[1] : -extent[1];
    for (int k = 0; k < 3; k++) {
        p[k] = m[4 * k + 3] + 2 * far * (m[4 * k] * x + m[4 * k + 1] * y + m[4 * k + 2]);
    }
}

static rey_result find_borders(rey_scene *scene, Array *borders) {
    const SceneView *view = &scene->view;
    for (int64_t i = 0; i < view->emitters_count; i++) {
        const EmitterRecord *e = view->emitters + i;
        if (e->kind != EMITTER_PROJECTOR || !ends_lit(view, view->textures + e->slot[SLOT(Projector, irradiance)])) {
            continue;
        }
        LightBorder *sides = rey_array_push(scene->ctx, borders, sizeof *sides, 4);
        if (!sides) {
            return REY_ERROR_MEMORY;
        }
        for (int k = 0; k < 4; k++) {
            const float *m = view->theta + e->slot[SLOT(Projector, to_world)];
            for (int c = 0; c < 3; c++) {
                sides[k].p[0][c] = m[4 * c + 3];
            }
            corner(view, e, k, sides[k].p[1]);
            corner(view, e, (k + 1) % 4, sides[k].p[2]);
        }
    }
    return REY_OK;
}

rey_result rey_meetings_with_borders(rey_scene *scene, MeetingMoves *moves, const void *user, Array *meetings) {
    Array borders = {0};
    rey_result result = find_borders(scene, &borders);
    if (result == REY_OK) {
        result = rey_meetings_find(scene, borders.data, (int32_t)borders.count, moves, user, meetings);
    }
    rey_array_free(scene->ctx, &borders);
    return result;
}

bool rey_light_is_abrupt(const SceneView *view, const EmitterRecord *e) {
    if (e->kind != EMITTER_SPOT) {
        return false;
    }
    float cutoff = view->theta[view->textures[e->slot[SLOT(Spot, cutoff_angle)]].theta];
    return view->theta[view->textures[e->slot[SLOT(Spot, beam_width)]].theta] >= cutoff * (1 - 1e-3f);
}
