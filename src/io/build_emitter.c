// build_emitter.c: light sources.
#include "emitter/table.h"
#include "io/build.h"
#include "io/lenient.h"
#include "io/load.h"

#include <string.h>

static const char *const pose_why = "moving a light moves its shadows";
static const char *const beam_why = "without a soft edge the border of the beam is a jump";
static const char *const picture_why = "moving a projector moves its shadows and the border of the picture, which is a jump";
static const char *const fov_why = "the border of the picture, which is a jump, moves with the field of view";
static const char *const texture_why = "moving a light moves its shadows and the texture, which jumps";

static const char *emitter_word(void *user, int i) {
    UNUSED(user);
    return i < rey_emitter_kind_count ? rey_emitter_kinds[i].name : NULL;
}

// ---- parameters --------------------------------------------------------------------------------------------------

static rey_result colour_slot(Builder *b, rey_xml_node *node, const EmitterParam *p, const char *path, int32_t *out) {
    rey_colour_use colour = p->type <= EMITTER_PARAM_EMISSION ? REY_COLOUR_EMISSION : REY_COLOUR_UNBOUNDED;
    TextureUse use = {colour, false, p->low, p->high, p->unit, p->text, 0, NULL};
    double value = (double)p->value;
    TRY(build_slot(b, node, p->name, use, &value, 1, path, out));
    int kind = ARRAY_AT(b->scene->build.textures, TextureNode, *out).kind;
    if (build_is_volume(b, *out) && strcmp(node->type, "area") != 0) {
        return rey_xml_fail(b->ctx, rey_xml_place(node, p->name), REY_ERROR_UNSUPPORTED,
                            "'%s' of '%s' cannot be a volume, that of 'area' lights can", p->name, node->type);
    }
    bool one = kind == TEXTURE_CONSTANT || kind == TEXTURE_BLACKBODY;
    return one || p->type != EMITTER_PARAM_SPECTRUM
               ? REY_OK
               : rey_xml_fail(b->ctx, rey_xml_place(node, p->name), REY_ERROR_SCENE,
                              "'%s' of '%s' is one colour or spectrum for all directions, not a picture", p->name, node->type);
}

static rey_result number_slot(Builder *b, rey_xml_node *node, const EmitterParam *p, double value, const char *path,
                              int32_t *out) {
    TextureUse use = {REY_COLOUR_UNBOUNDED, true, p->low, p->high, p->unit, p->text, 0, NULL};
    TRY(build_slot(b, node, p->name, use, &value, 1, path, out));
    const TextureNode *t = &ARRAY_AT(b->scene->build.textures, TextureNode, *out);
    if (t->kind != TEXTURE_CONSTANT || t->channels != 1) {
        return rey_xml_fail_value(b->ctx, node, p->name, "'%s' of a light must be a number", p->name);
    }
    return REY_OK;
}

static float constant_value(const Builder *b, int32_t texture) {
    return ARRAY_AT(b->scene->build.theta, float, ARRAY_AT(b->scene->build.textures, TextureNode, texture).theta);
}

// Where a beam's two angles agree, what lies between them is a jump.
static bool is_hard(const Builder *b, int32_t fraction, int32_t whole) {
    return constant_value(b, fraction) >= constant_value(b, whole);
}

// A number whose default is a fraction of the one before.
static rey_result fraction_slot(Builder *b, rey_xml_node *node, const EmitterParam *p, const char *path, int32_t whole,
                                int32_t *out) {
    TRY(number_slot(b, node, p, (double)(p->value * constant_value(b, whole)), path, out));
    for (int i = 0; is_hard(b, *out, whole) && i < 2; i++) {
        Param *param = build_param_of(b, i ? *out : whole, 0);
        if (param) {
            param->terms |= REY_TERM_PRIMARY | REY_TERM_INDIRECT;
            param->why = beam_why;
        }
    }
    return REY_OK;
}

static rey_result position_slot(Builder *b, rey_xml_node *node, const EmitterParam *row, Param p, const char *path,
                                int32_t *out) {
    double position[3] = {0, 0, 0}, matrix[16];
    if (rey_xml_has(node, "to_world")) {
        if (rey_xml_has(node, row->name)) {
            return rey_xml_fail_value(b->ctx, node, "to_world", "either '%s' or 'to_world' may be given", row->name);
        }
        TRY(rey_xml_get_transform(b->ctx, node, "to_world", matrix));
        for (int k = 0; k < 3; k++) {
            position[k] = matrix[4 * k + 3];
        }
    }
    TRY(rey_xml_get_vec3(b->ctx, node, row->name, position, position));
    *out = rey_scene_append(b->scene, &b->scene->build.theta, sizeof(float), 3);
    p.theta = *out;
    p.count = p.shape[0] = 3;
    p.dims = 1;
    p.unit = row->unit;
    p.description = row->text;
    if (*out < 0 || rey_scene_add_param(b->scene, path, p) < 0) {
        return REY_ERROR_MEMORY;
    }
    for (int k = 0; k < 3; k++) {
        ARRAY_AT(b->scene->build.theta, float, *out + k) = (float)position[k];
    }
    return REY_OK;
}

rey_result build_direction(Builder *b, rey_xml_node *node, double matrix[16]) {
    double d[3] = {0, 0, 1}, length, z[3], x[3];
    if (rey_xml_has(node, "to_world")) {
        return rey_xml_fail_value(b->ctx, node, "to_world", "either 'direction' or 'to_world' may be given");
    }
    TRY(rey_xml_get_vec3(b->ctx, node, "direction", d, d));
    length = sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
    if (!(length > 0)) {
        return rey_xml_fail_value(b->ctx, node, "direction", "the direction of a %s must not be 0", node->type);
    }
    for (int k = 0; k < 3; k++) {
        z[k] = d[k] / length;
    }
    double sign = z[2] < 0 ? -1 : 1, a = -1 / (sign + z[2]); // [duff2017 listing 3]
    x[0] = 1 + sign * z[0] * z[0] * a;
    x[1] = sign * z[0] * z[1] * a;
    x[2] = -sign * z[0];
    for (int k = 0; k < 16; k++) {
        matrix[k] = k == 15;
    }
    for (int k = 0; k < 3; k++) {
        int next = (k + 1) % 3, last = (k + 2) % 3;
        matrix[4 * k] = x[k];
        matrix[4 * k + 1] = z[next] * x[last] - z[last] * x[next];
        matrix[4 * k + 2] = z[k];
    }
    return REY_OK;
}

static rey_result pose_slot(Builder *b, rey_xml_node *node, const EmitterParam *row, Param p, const char *path,
                            int32_t *out) {
    double matrix[16];
    if (row->type == EMITTER_PARAM_AXIS && rey_xml_has(node, "direction")) {
        TRY(build_direction(b, node, matrix));
    } else {
        TRY(rey_xml_get_transform(b->ctx, node, "to_world", matrix));
    }
    if (row->type == EMITTER_PARAM_SKY) { // what lies beyond the scene casts no shadow of its own
        p.terms = REY_TERM_INTERIOR;
        p.why = NULL;
    }
    return build_pose(b, matrix, path, p, out);
}

static rey_result fov_slot(Builder *b, rey_xml_node *node, const EmitterParam *row, Param p, int32_t picture, const char *path,
                           int32_t *out) {
    const TextureNode *t = &ARRAY_AT(b->scene->build.textures, TextureNode, picture);
    double aspect = t->kind == TEXTURE_BITMAP ? (double)t->width / t->height : 1, fov;
    TRY(build_field_of_view(b, node, aspect, &fov));
    TRY(build_number(b, (float)fov, out));
    p.theta = ARRAY_AT(b->scene->build.textures, TextureNode, *out).theta;
    p.count = 1;
    p.low = row->low;
    p.high = row->high;
    p.unit = row->unit;
    p.description = row->text;
    return rey_scene_add_param(b->scene, path, p) < 0 ? REY_ERROR_MEMORY : REY_OK;
}

// ---- environment pictures ----------------------------------------------------------------------------------------

static rey_result image_slot(Builder *b, rey_xml_node *node, const EmitterParam *row, const char *path, int32_t *out) {
    rey_scene *scene = b->scene;
    LoadedFile file;
    rey_result result = load_take(b->ctx, b->source->document, b->ahead, node, &file);
    const rey_image image = file.image;
    int64_t count = (int64_t)image.width * image.height * 3;
    if (result == REY_OK && count > INT32_MAX) {
        result = rey_xml_fail(b->ctx, node->at, REY_ERROR_UNSUPPORTED, "the environment image has more than 2^31 values");
    }
    int32_t at = result ? -1 : rey_scene_append(scene, &scene->build.theta, sizeof(float), count);
    *out = result ? -1 : rey_scene_append(scene, &scene->build.textures, sizeof(TextureNode), 1);
    TextureSource *source = result ? NULL : rey_array_push(b->ctx, &b->source->textures, sizeof *source, 1);
    Param p = {PARAM_DEFAULTS, .theta = at, .count = (int32_t)count, .dims = 3, .shape = {image.height, image.width, 3},
               .low = row->low, .unit = row->unit, .terms = REY_TERM_INTERIOR, .description = row->text,
               .texture = *out};
    if (result == REY_OK && (at < 0 || *out < 0 || !source || build_texture_param(b, path, p) < 0)) {
        result = REY_ERROR_MEMORY;
    }
    if (result == REY_OK) {
        *source = (TextureSource){node, NULL, *out};
        memcpy(&ARRAY_AT(scene->build.theta, float, at), image.data, (size_t)count * sizeof(float));
        ARRAY_AT(scene->build.textures, TextureNode, *out) =
            (TextureNode){.kind = TEXTURE_BITMAP, .theta = at, .width = image.width, .height = image.height,
                          .channels = 3, .filter = FILTER_BILINEAR, .to_uv = -1, .child = {-1, -1}};
    }
    load_free(b->ctx, &file);
    return result;
}

// ---- lights ------------------------------------------------------------------------------------------------------

static bool texture_jumps(const Builder *b, int32_t texture) {
    const TextureNode *t = &ARRAY_AT(b->scene->build.textures, TextureNode, texture);
    return t->kind == TEXTURE_CHECKERBOARD || (t->kind == TEXTURE_BITMAP && t->filter == FILTER_NEAREST);
}

// What a light casts moves with it: the parameter for its place, which comes after what it casts.
static Param place_param(const Builder *b, const EmitterKind *kind, const EmitterRecord *e, int32_t id, int place) {
    Param p = {PARAM_DEFAULTS, .terms = REY_TERM_INTERIOR | REY_TERM_INDIRECT, .why = pose_why, .emitter = id,
               .place = place};
    for (int i = place - 1; i >= 0 && kind->params[place].type == EMITTER_PARAM_POSE; i--) {
        EmitterParamType type = kind->params[i].type;
        const char *why = type == EMITTER_PARAM_FOV                                                    ? picture_why
                          : type == EMITTER_PARAM_FRACTION && is_hard(b, e->slot[i], e->slot[i - 1]) ? beam_why
                          : type <= EMITTER_PARAM_COLOUR && texture_jumps(b, e->slot[i])             ? texture_why
                                                                                                     : NULL;
        if (why) {
            p.terms |= REY_TERM_PRIMARY;
            p.why = why;
        }
    }
    return p;
}

// Brings the rows of the kind's parameters into the record's slots.
static rey_result build_rows(Builder *b, rey_xml_node *node, const EmitterKind *kind, int32_t id, const char *path,
                             EmitterRecord *e) {
    for (int i = 0; i < kind->param_count; i++) {
        const EmitterParam *row = kind->params + i;
        char name[MAX_PATH_NAME];
        build_join(name, path, row->name);
        Param place = place_param(b, kind, e, id, i);
        int32_t *slot = &e->slot[i];
        switch (row->type) {
        case EMITTER_PARAM_SPECTRUM:
        case EMITTER_PARAM_EMISSION:
        case EMITTER_PARAM_COLOUR:
            TRY(colour_slot(b, node, row, name, slot));
            break;
        case EMITTER_PARAM_REAL:
            TRY(number_slot(b, node, row, (double)row->value, name, slot));
            break;
        case EMITTER_PARAM_FRACTION:
            TRY(fraction_slot(b, node, row, name, e->slot[i - 1], slot));
            break;
        case EMITTER_PARAM_IMAGE:
            TRY(image_slot(b, node, row, name, slot));
            break;
        case EMITTER_PARAM_FOV:
            place.terms |= REY_TERM_PRIMARY;
            place.why = fov_why;
            TRY(fov_slot(b, node, row, place, e->slot[0], name, slot));
            break;
        case EMITTER_PARAM_POSITION:
            TRY(position_slot(b, node, row, place, name, slot));
            break;
        default:
            TRY(pose_slot(b, node, row, place, path, slot));
        }
    }
    return REY_OK;
}

static rey_result set_environment(Builder *b, rey_xml_node *node, int32_t id) {
    if (b->scene->view.environment >= 0) {
        return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE, "a scene can have only one environment emitter");
    }
    b->scene->view.environment = id;
    return REY_OK;
}

static rey_result get_weight(Builder *b, rey_xml_node *node, EmitterRecord *e) {
    double weight;
    TRY(rey_xml_get_float(b->ctx, node, "sampling_weight", 1, &weight));
    e->weight = (float)weight;
    if (!(e->weight >= 0) || !isfinite(e->weight)) {
        return rey_xml_fail_value(b->ctx, node, "sampling_weight", "sampling_weight is %g, expected a number >= 0", weight);
    }
    return REY_OK;
}

// A light that is a surface. Several shapes may share one by reference: its only parameter is read once.
static rey_result build_surface(Builder *b, rey_xml_node *node, const EmitterKind *kind, const char *path,
                                EmitterRecord *e) {
    bool first;
    TRY(build_visit(b, node, path, &first));
    if (first) {
        TRY(build_rows(b, node, kind, -1, path, e));
        node->built = e->slot[0];
    }
    e->slot[0] = node->built;
    TRY(get_weight(b, node, e));
    if (first) {
        TRY(build_check_unused(b, node));
        TRY(build_finish(b, node, path));
    }
    return REY_OK;
}

// Lights that belong to no shape.
static rey_result build_free(Builder *b, rey_xml_node *node, const EmitterKind *kind, int32_t id, const char *path,
                             EmitterRecord *e) {
    bool first, compensation;
    TRY(build_visit(b, node, path, &first));
    if (!first) {
        return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE, "this emitter can stand in one place only");
    }
    TRY(build_rows(b, node, kind, id, path, e));
    if (kind->form == EMITTER_IS_ENVIRONMENT) {
        TRY(rey_xml_get_bool(b->ctx, node, "mis_compensation", false, &compensation));
        TRY(set_environment(b, node, id));
    }
    int64_t size = kind->table_size(b->scene->build.textures.data, e);
    if (size > 0) {
        e->table = rey_scene_append(b->scene, &b->scene->build.tables, sizeof(float), size);
        TRY(e->table < 0 ? REY_ERROR_MEMORY : REY_OK);
    }
    TRY(get_weight(b, node, e));
    node->built = id;
    TRY(build_check_unused(b, node));
    return build_finish(b, node, path);
}

rey_result build_emitter(Builder *b, rey_xml_node *node, int32_t shape, const char *path, int32_t *out) {
    EmitterRecord e = {.shape = shape, .table = -1, .family = -1};
    for (int i = 0; i < MAX_EMITTER_SLOTS; i++) {
        e.slot[i] = -1;
    }
    e.kind = rey_emitter_kind_find(node->type);
    if (e.kind < 0) {
        return build_unknown(b, node, emitter_word, NULL);
    }
    const EmitterKind *kind = rey_emitter_kinds + e.kind;
    bool surface = kind->form == EMITTER_IS_SURFACE;
    char name[MAX_PATH_NAME];
    int32_t medium; // that it stands in: paths know that without it
    build_join(name, path, "medium");
    TRY(build_medium_slot(b, node, NULL, name, &medium));
    if (!surface && shape >= 0) {
        return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE, "a shape's emitter must be an 'area' light, not '%s'",
                            node->type);
    }
    if (surface && shape < 0) { // declared here, for shapes to refer to
        return build_surface(b, node, kind, path, &e);
    }
    int32_t id = rey_scene_append(b->scene, &b->scene->build.emitters, sizeof e, 1);
    if (id < 0) {
        return REY_ERROR_MEMORY;
    }
    TRY(surface ? build_surface(b, node, kind, path, &e) : build_free(b, node, kind, id, path, &e));
    ARRAY_AT(b->scene->build.emitters, EmitterRecord, id) = e;
    *out = id;
    return REY_OK;
}
