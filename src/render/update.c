// update.c: rebuilds derived data of what changed, and nothing else.
#include "render/update.h"

#include "accel/accel.h"
#include "bsdf/table.h"
#include "emitter/update.h"
#include "shape/update.h"

#include <string.h>

rey_result rey_scene_update(rey_scene *scene) {
    SceneView *view = &scene->view;
    rey_result result = REY_OK;
    rey_scene_mark_changes(scene);
    if (!scene->dirty) {
        return REY_OK;
    }
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
