// api.c: the parts of the public interface that belong to no module: they check arguments and hold no logic.
#include "io/mitsuba.h"
#include "io/save.h"
#include "render/update.h"
#include "scene/values.h"

#include <stdio.h>

static rey_result load(rey_context *ctx, const char *path, const rey_define *defines, int define_count, int flags,
                       rey_scene **out) {
    rey_result result = rey_begin(ctx, path && out && (!define_count || defines));
    if (out) {
        *out = NULL;
    }
    if (result != REY_OK) {
        return result;
    }
    if (define_count < 0) {
        return rey_fail(ctx, REY_ERROR_ARGUMENT, "define_count is %d, expected at least 0", define_count);
    }
    result = rey_mitsuba_load(ctx, path, defines, define_count, flags, out);
    if (result == REY_OK && (result = rey_scene_update(*out)) != REY_OK && result != REY_ERROR_MEMORY) {
        char why[1024];
        snprintf(why, sizeof why, "%s", rey_error(ctx));
        rey_fail(ctx, result, "%s: %s", path, why);
    }
    if (result != REY_OK) {
        rey_scene_destroy(*out);
        *out = NULL;
    }
    return result;
}

rey_result rey_scene_load(rey_context *ctx, const char *path, const rey_define *defines, int define_count,
                          rey_scene **out) {
    return load(ctx, path, defines, define_count, 0, out);
}

rey_result rey_scene_load_lenient(rey_context *ctx, const char *path, const rey_define *defines, int define_count,
                                  rey_scene **out) {
    return load(ctx, path, defines, define_count, LOAD_LENIENT, out);
}

int rey_scene_ignored_count(const rey_scene *scene) {
    return scene ? (int)rey_mitsuba_ignored(scene)->count : 0;
}

const char *rey_scene_ignored(const rey_scene *scene, int i) {
    const Array *list = scene ? rey_mitsuba_ignored(scene) : &(Array){0};
    return i >= 0 && i < (int)list->count ? ARRAY_AT(*list, char *, i) : NULL;
}

rey_result rey_scene_save(const rey_scene *scene, const char *path) {
    rey_result result = rey_begin(scene ? scene->ctx : NULL, path != NULL);
    return result == REY_OK ? rey_mitsuba_save(scene, path) : result;
}

rey_result rey_scene_load_values(rey_scene *scene, const char *path) {
    rey_scene *from = NULL;
    rey_result result = rey_begin(scene ? scene->ctx : NULL, path != NULL);
    if (result == REY_OK) {
        result = load(scene->ctx, path, NULL, 0, 0, &from);
    }
    if (result == REY_OK) {
        result = rey_values_check(scene, from, path);
    }
    for (ValuesPhase phase = VALUES_POSES; phase < VALUES_PHASES && result == REY_OK; phase++) {
        result = rey_values_copy(scene, from, path, phase);
        if (result == REY_OK) {
            result = rey_scene_update(scene);
        }
    }
    rey_scene_destroy(from);
    return result;
}

rey_result rey_scene_film_size(const rey_scene *scene, int sensor, int *width, int *height) {
    rey_result result = rey_begin(scene ? scene->ctx : NULL, width && height);
    if (result != REY_OK) {
        return result;
    }
    if (scene->view.sensors_count == 0) {
        return rey_fail(scene->ctx, REY_ERROR_SCENE, "%s: the scene has no sensor to render with, expected one such as <sensor "
                                                     "type=\"perspective\">", rey_mitsuba_file(scene));
    }
    if (sensor < 0 || sensor >= scene->view.sensors_count) {
        return rey_fail(scene->ctx, REY_ERROR_ARGUMENT, "sensor %d does not exist: the scene has %d, counted from 0",
                        sensor, (int)scene->view.sensors_count);
    }
    *width = scene->view.sensors[sensor].crop_width;
    *height = scene->view.sensors[sensor].crop_height;
    return REY_OK;
}

int rey_scene_sensor_count(const rey_scene *scene) {
    return scene ? (int)scene->view.sensors_count : 0;
}

int rey_scene_note_count(const rey_scene *scene) {
    return scene ? (int)scene->notes.count : 0;
}

const char *rey_scene_note(const rey_scene *scene, int note) {
    return scene && note >= 0 && note < (int)scene->notes.count ? ARRAY_AT(scene->notes, char *, note) : NULL;
}

void rey_scene_get_info(const rey_scene *scene, rey_scene_info *info) {
    if (!info) {
        return;
    }
    if (!scene) {
        *info = (rey_scene_info){.integrator = ""};
        return;
    }
    const SceneView *v = &scene->view;
    *info = (rey_scene_info){.shapes = v->shapes_count,
                             .instances = v->instances_count,
                             .bsdfs = v->bsdfs_count,
                             .emitters = v->emitters_count,
                             .textures = v->textures_count,
                             .sensors = v->sensors_count,
                             .triangles = v->triangles_count / 3,
                             .parameters = (int64_t)scene->params.count,
                             .bytes = (int64_t)scene->arena_bytes,
                             .sample_count = v->sensors_count ? v->sensors[0].spp : 0,
                             .max_depth = v->max_depth,
                             .rr_depth = v->rr_depth,
                             .integrator = scene->integrator ? scene->integrator : ""};
    for (int64_t i = 0; i < v->shapes_count; i++) {
        info->vertices += v->shapes[i].vertex_count;
    }
    for (size_t i = 0; i < scene->params.count; i++) {
        info->parameter_floats += ARRAY_AT(scene->params, Param, i).count;
    }
    for (int k = 0; k < 3; k++) {
        info->bounds[k] = (double)v->bounds_centre[k] - v->bounds_half[k];
        info->bounds[3 + k] = (double)v->bounds_centre[k] + v->bounds_half[k];
    }
}
