// build_ranges.c: pictures with numbers that their slot has no use for, such as reflectances below 0: they are used as they are, as
// in the format, and said.
#include "io/build.h"
#include "scene/texels.h"

#include <math.h>

// Skies are refused where they are negative as they are read.
static bool is_sky(const SceneView *view, int32_t texture) {
    bool sky = false;
    for (int k = 0; view->environment >= 0 && k < MAX_EMITTER_SLOTS; k++) {
        sky = sky || view->emitters[view->environment].slot[k] == texture;
    }
    return sky;
}

// Whether some number is out of range: pictures are large, and nearly all of them have none.
static bool reaches_out(const SceneView *view, const TextureNode *t, const Param *p) {
    const float low = p->low, high = p->high, *values = view->theta + t->theta;
    bool outside = false;
    if (t->storage == TEXELS_FLOAT) {
        for (int64_t i = 0; i < p->count; i++) {
            outside |= (values[i] < low) | (values[i] > high);
        }
        return outside;
    }
    for (int64_t i = 0; i < p->count && !outside; i++) {
        float value = rey_texel(view, t, i);
        outside = value < low || value > high;
    }
    return outside;
}

rey_result build_note_ranges(Builder *b) {
    const SceneView *view = &b->scene->view;
    for (size_t k = 0; k < b->scene->params.count; k++) {
        const Param *p = &ARRAY_AT(b->scene->params, Param, k);
        const TextureNode *t = p->texture >= 0 ? view->textures + p->texture : NULL;
        bool bounded = isfinite(p->low) || isfinite(p->high);
        if (!t || t->kind != TEXTURE_BITMAP || t->storage == TEXELS_BYTE || t->storage == TEXELS_SRGB || !bounded ||
            is_sky(view, p->texture) || !reaches_out(view, t, p)) {
            continue;
        }
        float least = INFINITY, most = -INFINITY;
        int64_t outside = 0;
        for (int64_t i = 0; i < p->count; i++) {
            float value = rey_texel(view, t, i);
            outside += value < p->low || value > p->high;
            least = fminf(least, value);
            most = fmaxf(most, value);
        }
        TRY(rey_scene_add_note(b->scene,
                               "warning: %lld of the %lld numbers of %s lie outside of %g to %g, and go from %g to %g: "
                               "they are used as they are", (long long)outside, (long long)p->count, p->name, (double)p->low,
                               (double)p->high, (double)least, (double)most));
    }
    return REY_OK;
}
