// build_emitter.c: light sources.
#include "emitter/update.h"
#include "io/build.h"
#include "io/image.h"

#include <string.h>

static const char *const pose_why = "moving a light moves its shadows and its outline";

static const char *emitter_word(void *user, int i) {
    static const char *const words[] = {"area", "point", "constant", "envmap"};
    UNUSED(user);
    return i < COUNT_OF(words) ? words[i] : NULL;
}

static rey_result emission_slot(Builder *b, rey_xml_node *node, const char *name, const char *unit, const char *text,
                                const char *path, int32_t *out) {
    TextureUse use = {REY_COLOUR_EMISSION, false, 0, INFINITY, unit, text, 0, NULL};
    char slot[MAX_PATH_NAME];
    double one = 1;
    build_join(slot, path, name);
    return build_slot(b, node, name, use, &one, 1, slot, out);
}

static rey_result build_point(Builder *b, rey_xml_node *node, const char *path, EmitterRecord *e) {
    double position[3] = {0, 0, 0}, matrix[16];
    TRY(emission_slot(b, node, "intensity", "W/sr", "radiant intensity", path, &e->slot));
    if (rey_xml_has(node, "to_world")) {
        if (rey_xml_has(node, "position")) {
            return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE, "either 'position' or 'to_world' may be given");
        }
        TRY(rey_xml_get_transform(b->ctx, node, "to_world", matrix));
        for (int k = 0; k < 3; k++) {
            position[k] = matrix[4 * k + 3];
        }
    }
    TRY(rey_xml_get_vec3(b->ctx, node, "position", position, position));
    e->position = rey_scene_append(b->scene, &b->scene->build.theta, sizeof(float), 3);
    char name[MAX_PATH_NAME];
    build_join(name, path, "position");
    Param p = {PARAM_DEFAULTS, .theta = e->position, .count = 3, .dims = 1, .shape = {3}, .unit = "scene units",
               .description = "position of the light", .terms = REY_TERM_INTERIOR | REY_TERM_INDIRECT, .why = pose_why};
    if (e->position < 0 || rey_scene_add_param(b->scene, name, p) < 0) {
        return REY_ERROR_MEMORY;
    }
    for (int k = 0; k < 3; k++) {
        ARRAY_AT(b->scene->build.theta, float, e->position + k) = (float)position[k];
    }
    return REY_OK;
}

// The environment image: RGB, at least 2 columns and 3 rows.
static rey_result envmap_load(Builder *b, rey_xml_node *node, rey_image *image) {
    char *file = NULL;
    TRY(rey_xml_resolve_file(b->ctx, b->source->document, node, "filename", &file));
    rey_result result = rey_image_read(b->ctx, file, image);
    rey_free(b->ctx, file);
    TRY(result);
    TRY(rey_image_to_rgb(b->ctx, image));
    if (image->srgb) {
        rey_image_decode_srgb(image);
    }
    for (int64_t i = 0; i < (int64_t)image->width * image->height * 3; i++) {
        if (!isfinite(image->data[i]) || image->data[i] < 0) {
            return rey_xml_fail(b->ctx, node->at, REY_ERROR_FORMAT,
                                "the environment image has a value that is negative or not finite");
        }
    }
    if (image->width < 2 || image->height < 3) {
        return rey_xml_fail(b->ctx, node->at, REY_ERROR_UNSUPPORTED,
                            "the environment image is %d x %d, at least 2 x 3 pixels are needed", image->width,
                            image->height);
    }
    return REY_OK;
}

static rey_result envmap_data(Builder *b, rey_xml_node *node, const rey_image *image, const char *path, EmitterRecord *e) {
    rey_scene *scene = b->scene;
    int64_t count = (int64_t)image->width * image->height * 3;
    int32_t at = rey_scene_append(scene, &scene->build.theta, sizeof(float), count);
    e->slot = rey_scene_append(scene, &scene->build.textures, sizeof(TextureNode), 1);
    e->table = rey_scene_append(scene, &scene->build.tables, sizeof(float),
                                rey_envmap_table_size(image->width, image->height));
    char name[MAX_PATH_NAME];
    build_join(name, path, "data");
    Param p = {PARAM_DEFAULTS, .theta = at, .count = (int32_t)count, .dims = 3,
               .shape = {image->height, image->width, 3}, .low = 0, .unit = "W/(m^2 sr)", .terms = REY_TERM_INTERIOR,
               .description = "radiance by direction, rows from the +y pole", .texture = e->slot};
    TextureSource *source = rey_array_push(b->ctx, &b->source->textures, sizeof *source, 1);
    if (at < 0 || e->slot < 0 || e->table < 0 || !source || rey_scene_add_param(scene, name, p) < 0) {
        return REY_ERROR_MEMORY;
    }
    *source = (TextureSource){node, NULL, e->slot};
    memcpy(&ARRAY_AT(scene->build.theta, float, at), image->data, (size_t)count * sizeof(float));
    ARRAY_AT(scene->build.textures, TextureNode, e->slot) =
        (TextureNode){.kind = TEXTURE_BITMAP, .theta = at, .width = image->width, .height = image->height, .channels = 3,
                      .filter = FILTER_BILINEAR, .to_uv = -1, .child = {-1, -1}};
    return REY_OK;
}

static rey_result build_envmap(Builder *b, rey_xml_node *node, int32_t id, const char *path, EmitterRecord *e) {
    rey_image image = {0};
    rey_result result = envmap_load(b, node, &image);
    if (result == REY_OK) {
        result = envmap_data(b, node, &image, path, e);
    }
    rey_image_free(b->ctx, &image);
    TRY(result);
    TextureUse use = {REY_COLOUR_UNBOUNDED, true, 0, INFINITY, "", "factor on the image", 0, NULL};
    char name[MAX_PATH_NAME];
    double one = 1, matrix[16];
    bool mis_compensation;
    build_join(name, path, "scale");
    TRY(build_slot(b, node, "scale", use, &one, 1, name, &e->scale));
    TRY(rey_xml_get_bool(b->ctx, node, "mis_compensation", false, &mis_compensation));
    TRY(rey_xml_get_transform(b->ctx, node, "to_world", matrix));
    Param pose = {PARAM_DEFAULTS, .terms = REY_TERM_INTERIOR | REY_TERM_INDIRECT, .why = pose_why, .emitter = id};
    return build_pose(b, matrix, path, pose, &e->to_world);
}

static rey_result set_environment(Builder *b, rey_xml_node *node, int32_t id) {
    if (b->scene->view.environment >= 0) {
        return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE, "a scene can have only one environment emitter");
    }
    b->scene->view.environment = id;
    return REY_OK;
}

// Radiance and sampling weight of an area light. Several shapes may share one by reference: its values are read once.
static rey_result build_area(Builder *b, rey_xml_node *node, const char *path, EmitterRecord *e) {
    bool first;
    double weight;
    e->kind = EMITTER_AREA;
    TRY(build_visit(b, node, path, &first));
    if (first) {
        TRY(emission_slot(b, node, "radiance", "W/(m^2 sr)", "emitted radiance", path, &node->built));
    }
    e->slot = node->built;
    TRY(rey_xml_get_float(b->ctx, node, "sampling_weight", 1, &weight));
    e->weight = (float)weight;
    if (first) {
        TRY(rey_xml_check_unused(b->ctx, node, NULL, NULL));
        TRY(build_finish(b, node, path));
    }
    return REY_OK;
}

// Lights that belong to no shape.
static rey_result build_free_emitter(Builder *b, rey_xml_node *node, int32_t id, const char *path, EmitterRecord *e) {
    bool first;
    double weight;
    TRY(build_visit(b, node, path, &first));
    if (!first) {
        return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE, "this emitter can stand in one place only");
    }
    if (strcmp(node->type, "constant") == 0) {
        e->kind = EMITTER_CONSTANT;
        TRY(emission_slot(b, node, "radiance", "W/(m^2 sr)", "radiance from everywhere", path, &e->slot));
        TRY(set_environment(b, node, id));
    } else if (strcmp(node->type, "point") == 0) {
        e->kind = EMITTER_POINT;
        TRY(build_point(b, node, path, e));
    } else if (strcmp(node->type, "envmap") == 0) {
        e->kind = EMITTER_ENVMAP;
        TRY(build_envmap(b, node, id, path, e));
        TRY(set_environment(b, node, id));
    } else {
        return build_unknown(b, node, emitter_word, NULL);
    }
    TRY(rey_xml_get_float(b->ctx, node, "sampling_weight", 1, &weight));
    e->weight = (float)weight;
    node->built = id;
    TRY(rey_xml_check_unused(b->ctx, node, NULL, NULL));
    return build_finish(b, node, path);
}

rey_result build_emitter(Builder *b, rey_xml_node *node, int32_t shape, const char *path, int32_t *out) {
    EmitterRecord e = {.shape = shape, .slot = -1, .scale = -1, .position = -1, .to_world = -1, .table = -1};
    bool area = strcmp(node->type, "area") == 0;
    if (!area && shape >= 0) {
        return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE, "a shape's emitter must be an 'area' light, not '%s'",
                            node->type);
    }
    if (area && shape < 0) { // declared here, for shapes to refer to
        return build_area(b, node, path, &e);
    }
    int32_t id = rey_scene_append(b->scene, &b->scene->build.emitters, sizeof e, 1);
    if (id < 0) {
        return REY_ERROR_MEMORY;
    }
    TRY(area ? build_area(b, node, path, &e) : build_free_emitter(b, node, id, path, &e));
    if (!(e.weight >= 0) || !isfinite(e.weight)) {
        return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE, "sampling_weight is %g, expected a number >= 0",
                            (double)e.weight);
    }
    ARRAY_AT(b->scene->build.emitters, EmitterRecord, id) = e;
    *out = id;
    return REY_OK;
}
