// load_values.c: --load: values of parameters from a saved scene, or those of one parameter from a file.
#include "cli.h"
#include "npy.h"

#include "base/context.h"
#include "io/image.h"
#include "scene/absent.h"
#include "scene/scene.h"

#include <stdio.h>
#include <string.h>
#include <strings.h>

// The picture's values as they are meant: 8-bit files decoded, grey or three channels as the parameter has them.
static rey_result read_picture(rey_context *ctx, const char *path, const rey_param_info *info, float *values) {
    rey_image image = {0};
    rey_result result = rey_image_read(ctx, path, &image);
    if (result == REY_OK && info->dims == 3 && info->shape[2] == 3) {
        result = rey_image_to_rgb(ctx, path, &image);
    }
    if (result == REY_OK && image.srgb) {
        rey_image_decode_srgb(&image);
    }
    if (result == REY_OK && (info->dims != 3 || image.height != info->shape[0] || image.width != info->shape[1] ||
                             image.channels != info->shape[2])) {
        char expected[64];
        cli_shape_text(info, expected, sizeof expected);
        result = rey_fail(ctx, REY_ERROR_PARAM, "%s: '%s' has the shape %dx%dx%d, expected %s as in the scene", path,
                          info->name, image.height, image.width, image.channels, info->dims ? expected : "one number");
    }
    if (result == REY_OK) {
        memcpy(values, image.data, (size_t)info->count * sizeof *values);
    }
    rey_image_free(ctx, &image);
    return result;
}

static rey_result load_one(rey_context *ctx, rey_scene *scene, const char *name, size_t length, const char *path) {
    char text[512];
    rey_param_info info;
    snprintf(text, sizeof text, "%.*s", (int)length, name);
    int param = rey_param_find(scene, text);
    if (param < 0) {
        char absent[ABSENT_BYTES];
        rey_param_absent(scene, text, absent);
        return rey_fail(ctx, REY_ERROR_ARGUMENT, "--load %s=%s: the scene has no parameter '%s'%s", text, path, text,
                        absent[0] ? absent : "; 'reynolds params' lists them");
    }
    if (!path[0]) {
        return rey_fail(ctx, REY_ERROR_ARGUMENT, "--load %s=: the name of a file is missing, expected FILE.xml or NAME=FILE", text);
    }
    rey_result result = rey_param_get_info(scene, param, &info);
    float *values = result ? NULL : rey_alloc_array(ctx, (size_t)info.count, sizeof *values);
    size_t size = strlen(path);
    if (!values) {
        return result ? result : REY_ERROR_MEMORY;
    }
    bool array = size > 4 && strcasecmp(path + size - 4, ".npy") == 0;
    result = array ? cli_npy_read_param(ctx, path, &info, rey_scene_grid_channels(scene, param), values)
                   : read_picture(ctx, path, &info, values);
    if (result == REY_OK) {
        char why[1024];
        result = rey_param_set(scene, param, values, info.count);
        snprintf(why, sizeof why, "%s", rey_error(ctx));
        result = result ? rey_fail(ctx, result, "%s: %s", path, why) : REY_OK;
    }
    rey_free(ctx, values);
    return result;
}

rey_result cli_load_values(const Options *options, rey_context *ctx, rey_scene *scene) {
    rey_result result = REY_OK;
    for (int i = 0; i < options->load_count && result == REY_OK; i++) {
        const char *text = options->loads[i], *equals = strchr(text, '=');
        result = equals ? load_one(ctx, scene, text, (size_t)(equals - text), equals + 1)
                        : rey_scene_load_values(scene, text);
    }
    return result;
}
