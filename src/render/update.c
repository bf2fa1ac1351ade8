// update.c: rebuilds derived data of what changed, and nothing else.
#include "render/update.h"

#include "accel/accel.h"
#include "bsdf/table.h"
#include "emitter/update.h"
#include "math/colour.h"
#include "shape/update.h"

#include <string.h>

// Colours of black bodies whose temperature changed.
static void update_blackbodies(const SceneView *view) {
    for (int64_t i = 0; i < view->textures_count; i++) {
        const TextureNode *t = view->textures + i;
        if (t->kind != TEXTURE_BLACKBODY) {
            continue;
        }
        float *numbers = view->theta + t->theta, temperature = view->theta[view->textures[t->child[0]].theta];
        double rgb[3], slope[3];
        if (numbers[BLACKBODY_BUILT] == temperature) {
            continue;
        }
        rey_blackbody_to_rgb((double)temperature, (double)numbers[BLACKBODY_RANGE], (double)numbers[BLACKBODY_RANGE + 1],
                             rgb, slope);
        for (int c = 0; c < 3; c++) {
            numbers[c] = (float)rgb[c];
            numbers[BLACKBODY_SLOPE + c] = (float)slope[c];
        }
        numbers[BLACKBODY_BUILT] = temperature;
    }
}

rey_result rey_scene_update(rey_scene *scene) {
    SceneView *view = &scene->view;
    rey_result result = REY_OK;
    rey_scene_mark_changes(scene);
    if (!scene->dirty) {
        return REY_OK;
    }
    update_blackbodies(view);
    for (int32_t i = 0; i < view->shapes_count && result == REY_OK; i++) {
        result = scene->dirty_shapes[i] ? rey_shape_update(scene, i) : REY_OK;
    }
    for (int32_t i = 0; i < view->instances_count && result == REY_OK; i++) {
        result = scene->dirty_instances[i] ? rey_instance_update(scene, i) : REY_OK;
    }
    for (int32_t i = 0; i < view->bsdfs_count && result == REY_OK; i++) {
        result = scene->dirty_bsdfs[i] ? rey_bsdf_update(scene, i) : REY_OK;
    }
    for (int32_t i = 0; i < view->emitters_count && result == REY_OK; i++) {
        result = scene->dirty_emitters[i] ? rey_emitter_update(scene, i) : REY_OK;
    }
    if (result == REY_OK) {
        result = rey_accel_update(scene);
    }
    if (result != REY_OK) {
        return result;
    }
    rey_emitter_weights(scene);
    memset(scene->dirty_shapes, 0, (size_t)view->shapes_count);
    memset(scene->dirty_instances, 0, (size_t)view->instances_count);
    memset(scene->dirty_bsdfs, 0, (size_t)view->bsdfs_count);
    memset(scene->dirty_emitters, 0, (size_t)view->emitters_count);
    scene->dirty = false;
    return REY_OK;
}
