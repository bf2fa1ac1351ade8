// build_texture.c: textures and constants of the scene, with their parameters.
#include "io/build.h"
#include "io/lenient.h"
#include "io/load.h"
#include "scene/texels.h"

#include <math.h>
#include <string.h>

rey_result build_note_source(Builder *b, rey_xml_node *node, const char *property, int32_t texture) {
    TextureSource *s = rey_array_push(b->ctx, &b->source->textures, sizeof *s, 1);
    if (!s) {
        return REY_ERROR_MEMORY;
    }
    *s = (TextureSource){node, property, texture};
    return REY_OK;
}

rey_result build_add_texture(Builder *b, int32_t kind, int64_t count, int32_t *id, float **theta) {
    rey_scene *scene = b->scene;
    int32_t at = rey_scene_append(scene, &scene->build.theta, sizeof(float), count);
    *id = rey_scene_append(scene, &scene->build.textures, sizeof(TextureNode), 1);
    if (at < 0 || *id < 0) {
        return REY_ERROR_MEMORY;
    }
    TextureNode *t = &ARRAY_AT(scene->build.textures, TextureNode, *id);
    *t = (TextureNode){.kind = kind, .theta = at, .width = 1, .height = 1, .channels = 1, .to_uv = -1, .child = {-1, -1}};
    *theta = &ARRAY_AT(scene->build.theta, float, at);
    return REY_OK;
}

static Param texture_param(TextureUse use, int32_t texture, int32_t theta, int64_t count) {
    return (Param){PARAM_DEFAULTS, .theta = theta, .count = (int32_t)count, .low = use.low, .high = use.high,
                   .terms = REY_TERM_INTERIOR | use.terms, .why = use.why, .unit = use.unit, .description = use.text,
                   .texture = texture};
}

int build_texture_param(Builder *b, const char *name, Param p) {
    size_t texture = (size_t)(p.texture >= 0 ? p.texture : p.to_uv), known = b->texture_params.count;
    if (texture >= known &&
        !rey_array_push(b->ctx, &b->texture_params, sizeof(TextureParams), texture + 1 - known)) {
        return -1;
    }
    int32_t *slot = ARRAY_AT(b->texture_params, TextureParams, texture).param;
    int param = rey_scene_add_param(b->scene, name, p);
    slot[slot[0] ? 1 : 0] = param + 1;
    return param;
}

Param *build_param_of(Builder *b, int32_t texture, int k) {
    int32_t param = k < TEXTURE_MOST_PARAMS && (size_t)texture < b->texture_params.count
                        ? ARRAY_AT(b->texture_params, TextureParams, texture).param[k]
                        : 0;
    return param > 0 ? &ARRAY_AT(b->scene->params, Param, param - 1) : NULL;
}

// Parameters are differentiable where their derivative is not 0: an open range loses infinity, and bounds of 0 stay.
rey_result build_constant(Builder *b, rey_xml_node *node, const char *property, TextureUse use, const double *values,
                          int count, const char *path, int32_t *out) {
    float *theta;
    char name[MAX_PATH_NAME];
    TRY(build_add_texture(b, TEXTURE_CONSTANT, count, out, &theta));
    TextureNode *t = &ARRAY_AT(b->scene->build.textures, TextureNode, *out);
    t->channels = count;
    for (int i = 0; i < count; i++) {
        theta[i] = (float)values[i];
        if (!(theta[i] >= use.low && theta[i] <= use.high)) {
            return rey_xml_fail_value(b->ctx, node, property, "%s is %g, expected a number in [%g, %g]",
                                      property ? property : path, values[i], (double)use.low, (double)use.high);
        }
    }
    Param p = texture_param(use, *out, t->theta, count);
    p.dims = count > 1;
    p.shape[0] = count;
    build_join(name, path, "value");
    int param = build_texture_param(b, name, p);
    if (param < 0) {
        return REY_ERROR_MEMORY;
    }
    TRY(rey_scene_add_alias(b->scene, path, param));
    return build_note_source(b, node, property, *out);
}

rey_result build_number(Builder *b, float value, int32_t *out) {
    float *theta;
    TRY(build_add_texture(b, TEXTURE_CONSTANT, 1, out, &theta));
    theta[0] = value;
    return REY_OK;
}

static rey_result bitmap_to_uv(Builder *b, rey_xml_node *node, const char *path, int32_t texture, bool smooth) {
    static const char *const why = "the lines along which nearest texels and checks jump move over their surfaces";
    double m[6];
    if (!rey_xml_has(node, "to_uv")) {
        return REY_OK;
    }
    TRY(rey_xml_get_transform2(b->ctx, node, "to_uv", m));
    int32_t at = rey_scene_append(b->scene, &b->scene->build.theta, sizeof(float), 9);
    char name[MAX_PATH_NAME];
    build_join(name, path, "to_uv");
    Param p = {PARAM_DEFAULTS, .theta = at, .count = 9, .dims = 2, .shape = {3, 3}, .to_uv = texture,
               .description = "texture coordinates to the texture's own", .terms = REY_TERM_INTERIOR};
    if (!smooth) {
        p.terms |= REY_TERM_PRIMARY | REY_TERM_INDIRECT;
        p.why = why;
    }
    if (at < 0 || build_texture_param(b, name, p) < 0) {
        return REY_ERROR_MEMORY;
    }
    float *theta = &ARRAY_AT(b->scene->build.theta, float, at);
    for (int k = 0; k < 6; k++) {
        theta[k] = (float)m[k];
    }
    theta[8] = 1;
    ARRAY_AT(b->scene->build.textures, TextureNode, texture).to_uv = at;
    return REY_OK;
}

// Packed numbers get their place in theta when the scene is whole.
static rey_result add_packed(Builder *b, const PackedImage *packed, int64_t count, TextureNode *t) {
    rey_scene *scene = b->scene;
    int64_t bytes = count * rey_texel_bytes(packed->storage), words = (bytes + 3) / 4;
    if (scene->build.levels.count == 0) {
        int32_t first = rey_scene_append(scene, &scene->build.levels, sizeof(float), LEVELS_COUNT);
        if (first < 0) {
            return REY_ERROR_MEMORY;
        }
        rey_pack_levels(&ARRAY_AT(scene->build.levels, float, first));
    }
    if (4 * ((int64_t)scene->build.texels.count + words) > INT32_MAX) {
        return rey_fail(b->ctx, REY_ERROR_UNSUPPORTED, "the scene's bitmaps hold more than 2^31 bytes; format=\"variant\" stores "
                                                       "them as floats");
    }
    int32_t at = rey_scene_append(scene, &scene->build.texels, sizeof(int32_t), words);
    if (at < 0) {
        return REY_ERROR_MEMORY;
    }
    memcpy(&ARRAY_AT(scene->build.texels, int32_t, at), packed->bytes, (size_t)bytes);
    t->storage = packed->storage;
    t->texels = at * (4 / rey_texel_bytes(packed->storage));
    return REY_OK;
}

static rey_result add_texels(Builder *b, const LoadedFile *file, int64_t count, int32_t *out) {
    float *theta;
    TextureNode packed = {0};
    if (file->packed.bytes) {
        TRY(add_packed(b, &file->packed, count, &packed));
    }
    TRY(build_add_texture(b, TEXTURE_BITMAP, file->packed.bytes ? 0 : count, out, &theta));
    if (file->packed.bytes) {
        TextureNode *t = &ARRAY_AT(b->scene->build.textures, TextureNode, *out);
        t->storage = packed.storage;
        t->texels = packed.texels;
    } else {
        memcpy(theta, file->image.data, (size_t)count * sizeof *theta);
    }
    return REY_OK;
}

static rey_result build_bitmap(Builder *b, rey_xml_node *node, TextureUse use, const char *path, int32_t *out) {
    static const char *const filters[] = {"nearest", "bilinear"}, *const wraps[] = {"repeat", "mirror", "clamp"};
    int filter, wrap;
    bool accel;
    LoadedFile file;
    TRY(rey_xml_get_choice(b->ctx, node, "filter_type", filters, 2, FILTER_BILINEAR, &filter));
    TRY(rey_xml_get_choice(b->ctx, node, "wrap_mode", wraps, 3, WRAP_REPEAT, &wrap));
    TRY(rey_xml_get_bool(b->ctx, node, "accel", true, &accel));
    rey_result result = load_take(b->ctx, b->source->document, b->ahead, node, &file);
    const rey_image image = file.image;
    int64_t count = (int64_t)image.width * image.height * image.channels;
    if (result == REY_OK) {
        result = add_texels(b, &file, count, out);
    }
    if (result == REY_OK) {
        TextureNode *t = &ARRAY_AT(b->scene->build.textures, TextureNode, *out);
        t->width = image.width;
        t->height = image.height;
        t->channels = image.channels;
        t->filter = filter;
        t->wrap = wrap;
        char name[MAX_PATH_NAME];
        build_join(name, path, "data");
        Param p = texture_param(use, *out, t->theta, count);
        p.dims = 3;
        p.shape[0] = image.height;
        p.shape[1] = image.width;
        p.shape[2] = image.channels;
        int param = build_texture_param(b, name, p);
        result = param < 0 ? REY_ERROR_MEMORY : bitmap_to_uv(b, node, path, *out, filter == FILTER_BILINEAR);
    }
    load_free(b->ctx, &file);
    return result == REY_OK ? build_note_source(b, node, NULL, *out) : result;
}

static rey_result build_checkerboard(Builder *b, rey_xml_node *node, TextureUse use, const char *path, int32_t *out) {
    double c0 = 0.4, c1 = 0.2;
    char name[MAX_PATH_NAME];
    int32_t child[2];
    float *theta;
    build_join(name, path, "color0");
    TRY(build_slot(b, node, "color0", use, &c0, 1, name, &child[0]));
    build_join(name, path, "color1");
    TRY(build_slot(b, node, "color1", use, &c1, 1, name, &child[1]));
    TRY(build_add_texture(b, TEXTURE_CHECKERBOARD, 0, out, &theta));
    TextureNode *t = &ARRAY_AT(b->scene->build.textures, TextureNode, *out);
    t->child[0] = child[0];
    t->child[1] = child[1];
    TRY(bitmap_to_uv(b, node, path, *out, false));
    return build_note_source(b, node, NULL, *out);
}

static rey_result build_attribute(Builder *b, rey_xml_node *node, const char *path, int32_t *out) {
    float *theta;
    char name[MAX_PATH_NAME];
    double one = 1;
    int32_t scale;
    TextureUse use = {REY_COLOUR_UNBOUNDED, true, -INFINITY, INFINITY, "", "factor on the mesh's values", 0, NULL};
    build_join(name, path, "scale");
    TRY(build_slot(b, node, "scale", use, &one, 1, name, &scale));
    if (ARRAY_AT(b->scene->build.textures, TextureNode, scale).kind != TEXTURE_CONSTANT) {
        return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE, "'scale' of a mesh_attribute must be a number");
    }
    TRY(build_add_texture(b, TEXTURE_ATTRIBUTE, 0, out, &theta));
    TextureNode *t = &ARRAY_AT(b->scene->build.textures, TextureNode, *out);
    t->child[0] = scale;
    t->channels = 3;
    TRY(build_attribute_texture(b, node, *out));
    return build_note_source(b, node, NULL, *out);
}

// A field over space where a surface lies in it.
static rey_result build_volume_texture(Builder *b, rey_xml_node *node, TextureUse use, const char *path, int32_t *out) {
    rey_xml_child *child = rey_xml_child_of(node, REY_XML_BIT(REY_XML_VOLUME), 0);
    char name[MAX_PATH_NAME];
    int32_t id;
    if (!child) {
        return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE, "a texture 'volume' takes one nested volume, found none");
    }
    build_join(name, path, "volume");
    TRY(build_volume(b, child->node, use, name, &id));
    const VolumeNode *v = &ARRAY_AT(b->scene->build.volumes, VolumeNode, id);
    *out = v->texture;
    return v->channels <= 3 ? REY_OK
                            : rey_xml_fail(b->ctx, child->at, REY_ERROR_SCENE,
                                           "the volume of a texture has %d channels, expected 1 or 3", v->channels);
}

bool build_is_volume(const Builder *b, int32_t texture) {
    const TextureNode *t = &ARRAY_AT(b->scene->build.textures, TextureNode, texture);
    return t->kind == TEXTURE_VOLUME || (t->child[0] >= 0 && build_is_volume(b, t->child[0])) ||
           (t->child[1] >= 0 && build_is_volume(b, t->child[1]));
}

// A texture that several slots share needs the terms of all of them, and its values must suit them all.
static void add_use(Builder *b, int32_t texture, const TextureUse *use, bool values) {
    const TextureNode *node = &ARRAY_AT(b->scene->build.textures, TextureNode, texture);
    Param *p;
    // Temperatures and factors have ranges of their own.
    values = values && (node->kind == TEXTURE_CONSTANT || node->kind == TEXTURE_BITMAP || node->kind == TEXTURE_CHECKERBOARD);
    for (int k = 0; (p = build_param_of(b, texture, k)); k++) {
        p->terms |= use->terms;
        p->why = use->why && !*p->why ? use->why : p->why;
        if (values && p->texture == texture) {
            p->low = fmaxf(p->low, use->low);
            p->high = fminf(p->high, use->high);
        }
    }
    for (int k = 0; k < 2; k++) {
        if (node->child[k] >= 0) {
            add_use(b, node->child[k], use, values);
        }
    }
}

rey_result build_texture(Builder *b, rey_xml_node *node, TextureUse use, const char *path, int32_t *out) {
    bool first;
    TRY(build_visit(b, node, path, &first));
    if (!first) {
        *out = node->built;
        add_use(b, *out, &use, true);
        return REY_OK;
    }
    if (strcmp(node->type, "bitmap") == 0) {
        TRY(build_bitmap(b, node, use, path, out));
    } else if (strcmp(node->type, "checkerboard") == 0) {
        TRY(build_checkerboard(b, node, use, path, out));
    } else if (strcmp(node->type, "mesh_attribute") == 0) {
        TRY(build_attribute(b, node, path, out));
    } else if (strcmp(node->type, "volume") == 0) {
        TRY(build_volume_texture(b, node, use, path, out));
    } else {
        TRY(build_spectrum(b, node, use, path, out));
    }
    node->built = *out;
    add_use(b, *out, &use, true);
    TRY(build_check_unused(b, node));
    return build_finish(b, node, path);
}

rey_result build_slot(Builder *b, rey_xml_node *node, const char *name, TextureUse use, const double *value, int count,
                      const char *path, int32_t *out) {
    double rgb[3] = {value[0], count == 3 ? value[1] : value[0], count == 3 ? value[2] : value[0]};
    rey_xml_child *child = rey_xml_child_named(node, name);
    if (child) {
        if (!(REY_XML_BIT(child->node->tag) & REY_XML_TEXTURES)) {
            return rey_xml_fail(b->ctx, child->at, REY_ERROR_SCENE, "'%s' must be a texture, not a %s", name,
                                rey_xml_tag_name(child->node->tag));
        }
        Snapshot s = build_snapshot(b);
        bool left_out;
        TRY(build_forgive(b, &s, child, " (the default takes its place)",
                          build_texture(b, child->node, use, path, out), &left_out));
        if (!left_out) {
            return REY_OK;
        }
        return build_constant(b, node, name, use, rgb, use.real ? 1 : 3, path, out);
    }
    rey_xml_property *p = rey_xml_find(node, name);
    bool number = p && (p->kind == REY_XML_FLOAT_VALUE || p->kind == REY_XML_INTEGER_VALUE);
    if (use.real && (!p || number)) {
        TRY(rey_xml_get_float(b->ctx, node, name, value[0], &rgb[0]));
        return build_constant(b, node, name, use, rgb, 1, path, out);
    }
    if (p) {
        TRY(rey_xml_get_colour(b->ctx, node, name, use.colour, rgb, rgb));
    }
    return build_constant(b, node, name, use, rgb, 3, path, out);
}
