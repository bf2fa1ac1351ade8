// update.c: rebuilds derived data of what changed, and nothing else.
#include "render/update.h"

#include "accel/accel.h"
#include "bsdf/table.h"
#include "emitter/update.h"
#include "math/colour.h"
#include "medium/majorant_build.h"
#include "medium/sum.h"
#include "medium/table.h"
#include "shape/affine.h"
#include "shape/touches.h"
#include "shape/update.h"

#include <math.h>
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

static rey_result update_volume(rey_scene *scene, const VolumeNode *v) {
    double inverse[12];
    if (v->to_world < 0) {
        return REY_OK;
    }
    if (!rey_affine_inverse(scene->view.theta + v->to_world, inverse)) {
        return rey_fail(scene->ctx, REY_ERROR_PARAM, "a volume's to_world cannot be inverted");
    }
    for (int k = 0; k < 12; k++) {
        scene->view.tables[v->table + k] = (float)inverse[k];
    }
    return REY_OK;
}

// What media derive from their parameters.
static rey_result update_media(rey_scene *scene) {
    const SceneView *view = &scene->view;
    for (int64_t i = 0; i < view->volumes_count; i++) {
        rey_result result = scene->dirty_volumes[i] ? update_volume(scene, view->volumes + i) : REY_OK;
        if (result != REY_OK) {
            return result;
        }
    }
    for (int64_t i = 0; i < view->phases_count; i++) {
        if (scene->dirty_phases[i]) {
            rey_phase_update(view, view->phases + i);
        }
    }
    for (int64_t i = 0; i < view->media_count; i++) {
        if (scene->dirty_media[i]) {
            rey_medium_sum(view, view->media + i);
            rey_medium_update(view, view->volumes + view->media[i].sigma_t, view->media + i, scene->headroom);
        }
    }
    memset(scene->dirty_volumes, 0, (size_t)view->volumes_count);
    memset(scene->dirty_phases, 0, (size_t)view->phases_count);
    memset(scene->dirty_media, 0, (size_t)view->media_count);
    return REY_OK;
}

// Embree asserts that rays begin within 1.8e18 of the origin. Shapes, sensors and lights stay so far below that what is added to
// their places (a pose times a corner, a disk around the bounds) does, too.
static const float FARTHEST = 1e17f;

static rey_result check_places(const rey_scene *scene) {
    for (size_t i = 0; i < scene->params.count; i++) {
        const Param *p = &ARRAY_AT(scene->params, Param, i);
        const float *values = scene->view.theta + p->theta;
        bool place = p->geometry >= 0 || p->instance >= 0 || p->camera >= 0 || p->emitter >= 0, far = false;
        if (!place || (p->version == p->built && scene->view.embree)) {
            continue;
        }
        for (int32_t k = 0; k < p->count; k++) {
            far |= !(fabsf(values[k]) <= FARTHEST);
        }
        if (far) {
            return rey_fail(scene->ctx, REY_ERROR_PARAM, "%s has a number beyond %g: that is too far away for rays", p->name,
                            (double)FARTHEST);
        }
    }
    return REY_OK;
}

// Poses of instances multiply what their groups hold.
static rey_result check_bounds(const rey_scene *scene) {
    const SceneView *view = &scene->view;
    bool near = view->bounds_radius <= 10 * FARTHEST;
    for (int k = 0; k < 3; k++) {
        near = near && fabsf(view->bounds_centre[k]) <= 10 * FARTHEST;
    }
    return near ? REY_OK : rey_fail(scene->ctx, REY_ERROR_PARAM, "the scene reaches farther than %g: that is too far for rays",
                                    10 * (double)FARTHEST);
}

// Whether shapes or instances changed since this was called last.
static bool shapes_changed(const rey_scene *scene) {
    bool changed = false;
    for (int64_t i = 0; i < scene->view.shapes_count; i++) {
        changed |= scene->dirty_shapes[i] != 0;
    }
    for (int64_t i = 0; i < scene->view.instances_count; i++) {
        changed |= scene->dirty_instances[i] != 0;
    }
    return changed;
}

rey_result rey_scene_update(rey_scene *scene) {
    SceneView *view = &scene->view;
    rey_result result = check_places(scene);
    if (result != REY_OK) {
        return result;
    }
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
        result = update_media(scene);
    }
    if (result == REY_OK) {
        result = rey_accel_update(scene);
    }
    if (result == REY_OK) {
        result = check_bounds(scene);
    }
    if (result == REY_OK && shapes_changed(scene)) {
        result = rey_borders_touch(scene, &view->borders_touch);
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
