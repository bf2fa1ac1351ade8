// build_volume.c: fields over space: numbers, colours and textures where a volume may stand, and objects.
#include "io/build.h"
#include "io/lenient.h"
#include "io/grid.h"
#include "shape/affine.h"

#include <math.h>
#include <string.h>

static const char *volume_word(void *user, int i) {
    static const char *const words[] = {
#define VOLUME(ENUM, prefix, name) name,
#include "scene/volumes.inl"
#undef VOLUME
    };
    UNUSED(user);
    return i < COUNT_OF(words) ? words[i] : NULL;
}

static rey_result add_volume(Builder *b, VolumeNode volume, int32_t *out) {
    rey_scene *scene = b->scene;
    *out = rey_scene_append(scene, &scene->build.volumes, sizeof volume, 1);
    TRY(*out < 0 ? REY_ERROR_MEMORY : REY_OK);
    ARRAY_AT(scene->build.volumes, VolumeNode, *out) = volume;
    return REY_OK;
}

// Whether two poses are one, written in two ways.
static bool same_place(const float *pose, const double m[16]) {
    double largest = 0, apart = 0;
    for (int k = 0; k < 16; k++) {
        largest = fmax(largest, fabs(m[k]));
        apart = fmax(apart, fabs(m[k] - (double)pose[k]));
    }
    return apart <= 1e-6 * largest;
}

// The place of the volume b->beside, whose parameter gets a further name.
static rey_result share_place(Builder *b, rey_xml_node *node, const char *path, const double m[16], VolumeNode *volume) {
    rey_scene *scene = b->scene;
    const int32_t beside = b->beside - 1;
    const VolumeNode *other = &ARRAY_AT(scene->build.volumes, VolumeNode, beside);
    char name[MAX_PATH_NAME];
    if (!same_place(&ARRAY_AT(scene->build.theta, float, other->to_world), m)) {
        return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE,
                            "'sigma_a' stands elsewhere than 'sigma_s', whose sum is the extinction: expected the same to_world");
    }
    volume->to_world = other->to_world;
    volume->table = other->table;
    build_join(name, path, "to_world");
    for (size_t i = 0; i < scene->params.count; i++) {
        const Param *p = &ARRAY_AT(scene->params, Param, i);
        if (p->volume >= 0 && p->theta == other->to_world) {
            return rey_scene_add_alias(scene, name, (int)i);
        }
    }
    return REY_OK;
}

// Where a volume stands, with the parameter `path`.to_world, which places the box (null = the unit cube).
static rey_result build_place(Builder *b, rey_xml_node *node, const char *path, const float *box, int32_t id,
                              VolumeNode *volume) {
    double m[16];
    TRY(rey_xml_get_transform(b->ctx, node, "to_world", m));
    for (int k = 0; k < 3 && box; k++) { // the box lies from box[0 to 2] to box[3 to 5]
        const double *row = m + 4 * k;
        m[4 * k + 3] += row[0] * (double)box[0] + row[1] * (double)box[1] + row[2] * (double)box[2];
        for (int axis = 0; axis < 3; axis++) {
            m[4 * k + axis] *= (double)box[3 + axis] - (double)box[axis];
        }
    }
    if (rey_matrix_determinant(m) == 0) {
        return rey_xml_fail_value(b->ctx, node, "to_world", "the volume's to_world%s cannot be inverted",
                                  box ? " with the box of its file" : "");
    }
    if (b->beside) {
        return share_place(b, node, path, m, volume);
    }
    Param pose = {PARAM_DEFAULTS, .terms = REY_TERM_INTERIOR, .volume = id};
    TRY(build_pose(b, m, path, pose, &volume->to_world));
    volume->table = rey_scene_append(b->scene, &b->scene->build.tables, sizeof(float), 12);
    return volume->table < 0 ? REY_ERROR_MEMORY : REY_OK;
}

static VolumeNode empty_volume(int32_t kind) {
    return (VolumeNode){.kind = kind, .nx = 1, .ny = 1, .nz = 1, .table = -1, .to_world = -1};
}

// A volume of one value, which a texture holds.
static rey_result take_texture(Builder *b, rey_xml_position at, int32_t texture, VolumeNode *volume) {
    const TextureNode *t = &ARRAY_AT(b->scene->build.textures, TextureNode, texture);
    if (t->kind != TEXTURE_CONSTANT) {
        return rey_xml_fail(b->ctx, at, REY_ERROR_SCENE, "the texture of a volume must be one value, as it has no surface");
    }
    volume->texture = texture;
    volume->theta = t->theta;
    volume->channels = t->channels;
    return REY_OK;
}

static rey_result build_constvolume(Builder *b, rey_xml_node *node, TextureUse use, const char *path, int32_t id,
                                    VolumeNode *volume) {
    char name[MAX_PATH_NAME];
    double one = 1;
    int32_t texture;
    *volume = empty_volume(VOLUME_CONSTANT);
    use.colour = REY_COLOUR_UNBOUNDED;
    build_join(name, path, "value");
    TRY(build_slot(b, node, "value", use, &one, 1, name, &texture));
    TRY(take_texture(b, node->at, texture, volume));
    return rey_xml_has(node, "to_world") ? build_place(b, node, path, NULL, id, volume) : REY_OK;
}

static rey_result add_grid(Builder *b, rey_xml_node *node, const rey_grid *grid, TextureUse use, const char *path, int32_t id,
                           VolumeNode *volume) {
    int64_t count = rey_grid_count(grid);
    char name[MAX_PATH_NAME];
    float *theta;
    if (grid->channels != 1 && grid->channels != 3 && grid->channels != 6) {
        return rey_xml_fail(b->ctx, node->at, REY_ERROR_FORMAT, "the grid has %d channels, expected 1, 3 or 6", grid->channels);
    }
    TRY(build_add_texture(b, TEXTURE_VOLUME, count, &volume->texture, &theta));
    TRY(rey_xml_named_file(b->ctx, node->at, rey_grid_read(b->ctx, grid, theta)));
    TextureNode *t = &ARRAY_AT(b->scene->build.textures, TextureNode, volume->texture);
    t->channels = grid->channels;
    t->volume = id;
    t->filter = volume->filter;
    volume->theta = t->theta;
    volume->channels = grid->channels;
    volume->nx = grid->nx;
    volume->ny = grid->ny;
    volume->nz = grid->nz;
    Param p = {PARAM_DEFAULTS, .theta = t->theta, .count = (int32_t)count, .dims = 3,
               .shape = {grid->nz, grid->ny, grid->nx * grid->channels},
               .low = use.low, .high = use.high, .terms = REY_TERM_INTERIOR | use.terms, .why = use.why, .unit = use.unit,
               .description = use.text, .texture = volume->texture};
    build_join(name, path, "data");
    TRY(build_texture_param(b, name, p) < 0 ? REY_ERROR_MEMORY : REY_OK);
    return build_note_source(b, node, NULL, volume->texture);
}

static rey_result build_gridvolume(Builder *b, rey_xml_node *node, TextureUse use, const char *path, int32_t id,
                                   VolumeNode *volume) {
    static const char *const filters[] = {"nearest", "trilinear"}, *const wraps[] = {"repeat", "mirror", "clamp"};
    int filter, wrap;
    bool raw, box, accel;
    double largest;
    char *file = NULL;
    rey_grid grid;
    *volume = empty_volume(VOLUME_GRID);
    TRY(rey_xml_get_choice(b->ctx, node, "filter_type", filters, 2, FILTER_BILINEAR, &filter));
    TRY(rey_xml_get_choice(b->ctx, node, "wrap_mode", wraps, 3, WRAP_CLAMP, &wrap));
    TRY(rey_xml_get_bool(b->ctx, node, "raw", false, &raw));
    TRY(rey_xml_get_bool(b->ctx, node, "accel", true, &accel));
    TRY(rey_xml_get_bool(b->ctx, node, "use_grid_bbox", false, &box));
    TRY(rey_xml_get_float(b->ctx, node, "max_value", 0, &largest)); // bounds are found from the values
    volume->filter = filter;
    volume->wrap = wrap;
    TRY(rey_xml_resolve_file(b->ctx, b->source->document, node, "filename", &file));
    rey_result result = rey_xml_named_file(b->ctx, rey_xml_find(node, "filename")->at, rey_grid_open(b->ctx, file, &grid));
    if (result == REY_OK) {
        result = box && !grid.placed
                     ? rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE,
                                    "the file says no box along the axes, which 'use_grid_bbox' asks for")
                     : add_grid(b, node, &grid, use, path, id, volume);
        rey_grid_close(b->ctx, &grid);
    }
    rey_free(b->ctx, file);
    TRY(result);
    return build_place(b, node, path, box ? grid.box : NULL, id, volume);
}

// A volume may have been built for another use: its values are checked again, and their range becomes that of all uses.
static rey_result check_use(Builder *b, const rey_xml_node *node, int32_t id, const TextureUse *use) {
    const VolumeNode *v = &ARRAY_AT(b->scene->build.volumes, VolumeNode, id);
    const float *values = &ARRAY_AT(b->scene->build.theta, float, v->theta);
    int64_t count = (int64_t)v->nx * v->ny * v->nz * v->channels;
    for (int64_t i = 0; i < count; i++) {
        if (!(values[i] >= use->low && values[i] <= use->high)) {
            return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE,
                                "the volume holds %g, expected numbers in [%g, %g]: %s", (double)values[i],
                                (double)use->low, (double)use->high, use->text);
        }
    }
    Param *p = build_param_of(b, v->texture, 0);
    if (p) {
        p->low = p->low > use->low ? p->low : use->low;
        p->high = p->high < use->high ? p->high : use->high;
        p->terms |= use->terms;
    }
    return REY_OK;
}

rey_result build_volume(Builder *b, rey_xml_node *node, TextureUse use, const char *path, int32_t *out) {
    bool first;
    TRY(build_visit(b, node, path, &first));
    if (!first) {
        *out = node->built;
        return check_use(b, node, *out, &use);
    }
    VolumeNode volume;
    TRY(add_volume(b, empty_volume(VOLUME_CONSTANT), out)); // its number, which parameters refer to
    if (strcmp(node->type, "constvolume") == 0) {
        TRY(build_constvolume(b, node, use, path, *out, &volume));
    } else if (strcmp(node->type, "gridvolume") == 0) {
        TRY(build_gridvolume(b, node, use, path, *out, &volume));
    } else {
        return build_unknown(b, node, volume_word, NULL);
    }
    ARRAY_AT(b->scene->build.volumes, VolumeNode, *out) = volume;
    TRY(check_use(b, node, *out, &use));
    node->built = *out;
    TRY(build_check_unused(b, node));
    return build_finish(b, node, path);
}

static rey_result add_value(Builder *b, const rey_xml_node *node, int32_t texture, const char *path, int32_t *out) {
    VolumeNode volume = empty_volume(VOLUME_CONSTANT);
    TRY(take_texture(b, node->at, texture, &volume));
    Param *p = build_param_of(b, texture, 0);
    TRY(p ? rey_scene_add_alias(b->scene, path, (int)(p - (Param *)b->scene->params.data)) : REY_OK);
    return add_volume(b, volume, out);
}

// A value or texture in place of a volume: one value everywhere, named as if a constvolume stood there.
static rey_result build_value(Builder *b, rey_xml_node *node, const char *name, TextureUse use, double value,
                              const char *path, int32_t *out) {
    char full[MAX_PATH_NAME];
    int32_t texture;
    build_join(full, path, "value");
    TRY(build_slot(b, node, name, use, &value, 1, full, &texture));
    return add_value(b, node, texture, path, out);
}

rey_result build_volume_slot(Builder *b, rey_xml_node *node, const char *name, TextureUse use, double value,
                             const char *path, int32_t *out) {
    rey_xml_child *child = rey_xml_child_named(node, name);
    if (!child || child->node->tag != REY_XML_VOLUME) {
        return build_value(b, node, name, use, value, path, out);
    }
    return build_volume(b, child->node, use, path, out);
}
