// scene.c: life cycle of the flat scene: arrays grow while it is loaded and stay where they are afterwards.
#include "scene/texels.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

enum {
    ARRAY_TAIL = 16,      // entries behind the end of an array that wide loads may touch
    ARRAY_LARGE = 1 << 20 // entries that are many
};

rey_result rey_scene_new(rey_context *ctx, rey_scene **out) {
    rey_scene *scene = rey_alloc(ctx, sizeof *scene);
    if (!scene) {
        return REY_ERROR_MEMORY;
    }
    scene->ctx = ctx;
    scene->view.environment = -1;
    scene->view.emitter_cdf = -1;
    scene->view.max_depth = -1;
    scene->view.rr_depth = 5;
    scene->headroom = 1;
    *out = scene;
    return REY_OK;
}

void rey_scene_use(rey_scene *scene, int integrator) {
    const Integrator *from = &ARRAY_AT(scene->integrators, Integrator, integrator);
    SceneView *to = &scene->view;
#define SETTING(type, name, comment) memcpy(&to->name, &from->name, sizeof to->name);
#include "scene/settings.inl"
#undef SETTING
}

void rey_scene_forget_integrators(rey_scene *scene) {
    for (size_t i = 0; i < scene->channels.count; i++) {
        rey_free(scene->ctx, ARRAY_AT(scene->channels, Channel, i).name);
    }
    rey_free(scene->ctx, scene->integrator);
    scene->integrator = NULL;
    scene->channels.count = scene->integrators.count = 0;
}

int32_t rey_scene_append(rey_scene *scene, Array *array, size_t item_bytes, int64_t n) {
    if (n < 0 || (uint64_t)n + array->count > INT32_MAX) {
        rey_fail(scene->ctx, REY_ERROR_UNSUPPORTED, "the scene holds more than 2^31 numbers of one kind");
        return -1;
    }
    size_t first = array->count;
    // Room for the tail, and behind much for what little may follow, so that it does not have to move.
    size_t spare = ARRAY_TAIL + (n >= ARRAY_LARGE ? (size_t)n / 16 : 0);
    if (n > 0 && !rey_array_push(scene->ctx, array, item_bytes, (size_t)n + spare)) {
        return -1;
    }
    array->count = first + (size_t)n;
    return (int32_t)first;
}

rey_result rey_scene_add_note(rey_scene *scene, const char *format, ...) {
    char text[1024];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    for (size_t i = 0; i < scene->notes.count; i++) {
        if (strcmp(ARRAY_AT(scene->notes, char *, i), text) == 0) {
            return REY_OK;
        }
    }
    char *copy = rey_strdup(scene->ctx, text), **note = rey_array_push(scene->ctx, &scene->notes, sizeof *note, 1);
    if (note) {
        *note = copy;
    } else {
        rey_free(scene->ctx, copy);
    }
    return copy && note ? REY_OK : REY_ERROR_MEMORY;
}

// Makes an array fit: entries behind the end that wide loads may touch, and little more. Most arrays fit already, so that
// what a scene is made of is not copied. more: entries for which there must be room besides.
static rey_result settle(rey_scene *scene, Array *array, size_t item_bytes, size_t more) {
    size_t count = array->count, wanted = count + ARRAY_TAIL + more;
    if (wanted == ARRAY_TAIL || (array->capacity >= wanted && array->capacity - wanted <= wanted / 4)) {
        return REY_OK;
    }
    Array exact = {0};
    if (!rey_array_push(scene->ctx, &exact, item_bytes, wanted)) {
        return REY_ERROR_MEMORY;
    }
    if (count) {
        memcpy(exact.data, array->data, count * item_bytes);
    }
    exact.count = count;
    rey_array_free(scene->ctx, array);
    *array = exact;
    return REY_OK;
}

rey_result rey_scene_freeze(rey_scene *scene) {
    size_t largest = 0;
    int64_t packed;
    rey_result result = rey_texels_place(scene, &packed);
    if (result != REY_OK) {
        return result;
    }
#define ARRAY(type, name, comment) largest = sizeof(type) > largest ? sizeof(type) : largest;
#include "scene/arrays.inl"
#undef ARRAY
    scene->arena_bytes = ARRAY_TAIL * largest;
    scene->arena = rey_alloc(scene->ctx, scene->arena_bytes);
    scene->dirty_shapes = rey_alloc(scene->ctx, scene->build.shapes.count + 1);
    scene->dirty_instances = rey_alloc(scene->ctx, scene->build.instances.count + 1);
    scene->dirty_bsdfs = rey_alloc(scene->ctx, scene->build.bsdfs.count + 1);
    scene->dirty_emitters = rey_alloc(scene->ctx, scene->build.emitters.count + 1);
    scene->dirty_volumes = rey_alloc(scene->ctx, scene->build.volumes.count + 1);
    scene->dirty_media = rey_alloc(scene->ctx, scene->build.media.count + 1);
    scene->dirty_phases = rey_alloc(scene->ctx, scene->build.phases.count + 1);
    if (!scene->arena || !scene->dirty_shapes || !scene->dirty_instances || !scene->dirty_bsdfs || !scene->dirty_emitters ||
        !scene->dirty_volumes || !scene->dirty_media || !scene->dirty_phases) {
        return REY_ERROR_MEMORY;
    }
#define ARRAY(type, name, comment)                                                                                                 \
    if (settle(scene, &scene->build.name, sizeof(type),                                                                            \
               (void *)&scene->build.name == (void *)&scene->build.theta ? (size_t)packed : 0) != REY_OK) {                        \
        return REY_ERROR_MEMORY;                                                                                                   \
    }                                                                                                                              \
    scene->view.name = scene->build.name.data ? scene->build.name.data : scene->arena;                                             \
    scene->view.name##_count = (int64_t)scene->build.name.count;                                                                   \
    scene->arena_bytes += scene->build.name.capacity * sizeof(type);
#include "scene/arrays.inl"
#undef ARRAY
    scene->arena_bytes -= (size_t)packed * sizeof(float); // as long as nothing is written there
    memset(scene->dirty_shapes, 1, (size_t)scene->view.shapes_count);
    memset(scene->dirty_instances, 1, (size_t)scene->view.instances_count);
    memset(scene->dirty_bsdfs, 1, (size_t)scene->view.bsdfs_count);
    memset(scene->dirty_emitters, 1, (size_t)scene->view.emitters_count);
    memset(scene->dirty_volumes, 1, (size_t)scene->view.volumes_count);
    memset(scene->dirty_media, 1, (size_t)scene->view.media_count);
    memset(scene->dirty_phases, 1, (size_t)scene->view.phases_count);
    scene->dirty = true;
    return REY_OK;
}

void rey_scene_destroy(rey_scene *scene) {
    if (!scene) {
        return;
    }
    rey_context *ctx = scene->ctx;
    if (scene->accel_free) {
        scene->accel_free(scene);
    }
#define ARRAY(type, name, comment) rey_array_free(ctx, &scene->build.name);
#include "scene/arrays.inl"
#undef ARRAY
    rey_names_free(ctx, &scene->param_names);
    rey_names_free(ctx, &scene->alias_names);
    rey_scene_forget_params(scene, 0, 0);
    for (size_t i = 0; i < scene->notes.count; i++) {
        rey_free(ctx, ARRAY_AT(scene->notes, char *, i));
    }
    rey_array_free(ctx, &scene->notes);
    rey_scene_forget_integrators(scene);
    rey_array_free(ctx, &scene->integrators);
    rey_array_free(ctx, &scene->channels);
    rey_array_free(ctx, &scene->params);
    rey_array_free(ctx, &scene->aliases);
    rey_free(ctx, scene->arena);
    rey_free(ctx, scene->dirty_shapes);
    rey_free(ctx, scene->dirty_instances);
    rey_free(ctx, scene->dirty_bsdfs);
    rey_free(ctx, scene->dirty_emitters);
    rey_free(ctx, scene->dirty_volumes);
    rey_free(ctx, scene->dirty_media);
    rey_free(ctx, scene->dirty_phases);
    if (scene->document_free) {
        scene->document_free(scene->document);
    }
    rey_free(ctx, scene);
}
