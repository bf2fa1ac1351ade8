// texels.c: packed textures, and what becomes of them when somebody changes them.
#include "scene/texels.h"

#include <math.h>

int rey_texel_bytes(int32_t storage) { return storage == TEXELS_FLOAT ? 4 : storage == TEXELS_HALF ? 2 : 1; }

static int64_t number_count(const TextureNode *t) { return (int64_t)t->width * t->height * t->channels; }

rey_result rey_texels_place(rey_scene *scene, int64_t *numbers) {
    const int64_t first = (int64_t)scene->build.theta.count;
    TextureNode *textures = scene->build.textures.data;
    *numbers = 0;
    for (size_t i = 0; i < scene->build.textures.count; i++) {
        TextureNode *t = textures + i;
        if (t->storage != TEXELS_FLOAT) {
            if (first + *numbers + number_count(t) > INT32_MAX) {
                return rey_fail(scene->ctx, REY_ERROR_UNSUPPORTED, "the scene holds more than 2^31 numbers of one kind");
            }
            t->theta = (int32_t)(first + *numbers);
            *numbers += number_count(t);
        }
    }
    for (size_t i = 0; i < scene->params.count; i++) {
        Param *p = &ARRAY_AT(scene->params, Param, i);
        if (p->texture >= 0 && textures[p->texture].storage != TEXELS_FLOAT) {
            p->theta = textures[p->texture].theta;
        }
    }
    return REY_OK;
}

static float half_value(uint32_t bits) {
    int exponent = bits >> 10 & 31;
    float value = ldexpf((float)((bits & 1023) + (exponent ? 1024 : 0)), (exponent ? exponent : 1) - 25);
    return bits >> 15 ? -value : value;
}

float rey_texel(const SceneView *view, const TextureNode *t, int64_t i) {
    if (t->storage == TEXELS_FLOAT) {
        return view->theta[t->theta + i];
    }
    const int bytes = rey_texel_bytes(t->storage);
    const unsigned char *at = (const unsigned char *)view->texels + (t->texels + i) * bytes;
    if (t->storage == TEXELS_HALF) {
        return half_value((uint32_t)at[0] | (uint32_t)at[1] << 8);
    }
    return view->levels[(t->storage == TEXELS_SRGB ? LEVELS_SRGB : LEVELS_BYTE) + at[0]];
}

void rey_texels_promote(rey_scene *scene, int32_t texture, bool unpack) {
    TextureNode *t = (TextureNode *)(uintptr_t)(scene->view.textures + texture);
    if (t->storage == TEXELS_FLOAT) {
        return;
    }
    float *out = scene->view.theta + t->theta;
    for (int64_t i = 0; i < number_count(t) && unpack; i++) {
        out[i] = rey_texel(&scene->view, t, i);
    }
    scene->arena_bytes += (size_t)number_count(t) * sizeof *out;
    t->storage = TEXELS_FLOAT;
}
