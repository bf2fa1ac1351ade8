// update.c: derived data of emitters.
#include "emitter/update.h"

#include "shape/update.h"

static double texel_luminance(const float *texel) {
    return fmax(0, 0.212671 * (double)texel[0] + 0.715160 * (double)texel[1] + 0.072169 * (double)texel[2]);
}

// Mass of the cell between texel columns x, x + 1 and rows y, y + 1: mean luminance times the sine of its latitude.
static double cell_mass(const TextureNode *t, const float *texels, int64_t x, int64_t y) {
    int64_t right = (x + 1) % t->width;
    double sum = texel_luminance(texels + 3 * (y * t->width + x)) + texel_luminance(texels + 3 * (y * t->width + right)) +
                 texel_luminance(texels + 3 * ((y + 1) * t->width + x)) +
                 texel_luminance(texels + 3 * ((y + 1) * t->width + right));
    return 0.25 * sum;
}

// The distribution: luminance times sine, with a share for every direction, because the derivative with respect to a
// black texel is not 0.
static void envmap_distribution(SceneView *view, const EmitterRecord *e) {
    const double uniform_share = 0.02;
    const TextureNode *t = view->textures + e->slot;
    const float *texels = view->theta + t->theta;
    int64_t width = t->width, rows = t->height - 1;
    float *row_cdf = view->tables + e->table + 9, *cell_cdf = row_cdf + rows;
    double total = 0, sines = 0;
    for (int64_t y = 0; y < rows; y++) {
        double sine = sin(3.14159265358979323846 * ((double)y + 0.5) / (double)rows);
        sines += sine * (double)width;
        for (int64_t x = 0; x < width; x++) {
            total += sine * cell_mass(t, texels, x, y);
        }
    }
    double floor = total > 0 ? uniform_share * total / sines : 1;
    double row_sum = 0, all = total > 0 ? total * (1 + uniform_share) : sines;
    for (int64_t y = 0; y < rows; y++) {
        double sine = sin(3.14159265358979323846 * ((double)y + 0.5) / (double)rows);
        double mass = 0, sum = 0;
        for (int64_t x = 0; x < width; x++) {
            mass += cell_mass(t, texels, x, y) + floor;
        }
        for (int64_t x = 0; x < width; x++) {
            sum += cell_mass(t, texels, x, y) + floor;
            cell_cdf[y * width + x] = x + 1 == width ? 1 : (float)(sum / mass);
        }
        row_sum += mass * sine;
        row_cdf[y] = y + 1 == rows ? 1 : (float)(row_sum / all);
    }
}

rey_result rey_emitter_update(rey_scene *scene, int32_t id) {
    SceneView *view = &scene->view;
    const EmitterRecord *e = view->emitters + id;
    if (e->kind != EMITTER_ENVMAP) {
        return REY_OK;
    }
    double inverse[12];
    if (!rey_affine_inverse(view->theta + e->to_world, inverse)) {
        return rey_fail(scene->ctx, REY_ERROR_SCENE, "an envmap's to_world cannot be inverted");
    }
    for (int k = 0; k < 9; k++) {
        view->tables[e->table + k] = (float)inverse[k / 3 * 4 + k % 3];
    }
    envmap_distribution(view, e);
    return REY_OK;
}

void rey_emitter_weights(rey_scene *scene) {
    SceneView *view = &scene->view;
    double total = 0, sum = 0;
    view->uniform_emitters = true;
    for (int64_t i = 0; i < view->emitters_count; i++) {
        total += view->emitters[i].weight;
        view->uniform_emitters &= view->emitters[i].weight == view->emitters[0].weight;
    }
    for (int64_t i = 0; i < view->emitters_count; i++) {
        EmitterRecord *e = view->emitters + i;
        e->weight = total > 0 ? (float)(e->weight / total) : 1.0f / (float)view->emitters_count;
        sum += e->weight;
        view->tables[view->emitter_cdf + i] = i + 1 == view->emitters_count ? 1 : (float)sum;
    }
}
