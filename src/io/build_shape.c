// build_shape.c: shapes, and the shading groups that they fall into.
#include "io/build.h"
#include "io/lenient.h"
#include "io/build_attribute.h"
#include "io/build_parts.h"
#include "io/load.h"
#include "shape/shape.h"
#include "shape/update.h"

#include <math.h>
#include <string.h>

static const char *const moving_why = "moving geometry moves silhouettes, seen by the camera and by other path vertices";
static const char *const normals_why = "the picture jumps where a shading normal turns away from the viewer or the light";

enum { GEOMETRY_TERMS = REY_TERM_INTERIOR | REY_TERM_PRIMARY | REY_TERM_INDIRECT };

static const char *shape_word(void *user, int i) {
    static const char *const words[] = {"rectangle", "cube",       "sphere",   "disk",  "cylinder", "bsplinecurve", "linearcurve",
                                        "sdfgrid",   "shapegroup", "instance", "merge", "obj",      "ply",          "serialized"};
    UNUSED(user);
    return i < COUNT_OF(words) ? words[i] : NULL;
}

// Room for numbers in theta with a parameter path.name (alias path.old), shape count x width.
static rey_result vertex_param(Builder *b, const char *path, const char *name, const char *old, int64_t count, int width,
                               Param p, int32_t *theta) {
    char full[MAX_PATH_NAME];
    *theta = rey_scene_append(b->scene, &b->scene->build.theta, sizeof(float), count * width);
    if (*theta < 0) {
        return REY_ERROR_MEMORY;
    }
    p.theta = *theta;
    p.count = (int32_t)(count * width);
    p.dims = 2;
    p.shape[0] = (int32_t)count;
    p.shape[1] = width;
    build_join(full, path, name);
    int param = rey_scene_add_param(b->scene, full, p);
    if (param < 0) {
        return REY_ERROR_MEMORY;
    }
    build_join(full, path, old);
    return rey_scene_add_alias(b->scene, full, param);
}

rey_result build_load_mesh(Builder *b, rey_xml_node *node, rey_mesh *mesh, bool *smooth) {
    LoadedFile file;
    rey_result result = load_take(b->ctx, b->source->document, b->ahead, node, &file);
    *mesh = file.mesh;
    *smooth = file.smooth_normals;
    return result;
}

rey_result build_copy_mesh(Builder *b, const rey_mesh *mesh, int32_t id, const char *path, ShapeRecord *shape) {
    rey_scene *scene = b->scene;
    int64_t v = mesh->vertex_count, f = mesh->face_count;
    Param positions = {PARAM_DEFAULTS, .unit = "scene units", .description = "vertex positions", .terms = GEOMETRY_TERMS,
                       .why = moving_why, .geometry = id};
    Param normals = {PARAM_DEFAULTS, .description = "vertex normals", .terms = GEOMETRY_TERMS, .why = normals_why, .normals = id};
    Param uvs = {PARAM_DEFAULTS, .description = "texture coordinates", .terms = 0,
                 .why = "what the texture coordinates of vertices change is not computed; the to_uv of a texture, which moves all "
                        "of it, has a derivative"};
    shape->vertex_count = (int32_t)v;
    shape->triangle_count = (int32_t)f;
    TRY(vertex_param(b, path, "positions", "vertex_positions", v, 3, positions, &shape->positions));
    memcpy(&ARRAY_AT(scene->build.theta, float, shape->positions), mesh->positions, (size_t)v * 3 * sizeof(float));
    if (mesh->normals) {
        shape->flags |= SHAPE_HAS_NORMALS;
        TRY(vertex_param(b, path, "normals", "vertex_normals", v, 3, normals, &shape->normals));
        memcpy(&ARRAY_AT(scene->build.theta, float, shape->normals), mesh->normals, (size_t)v * 3 * sizeof(float));
    }
    if (mesh->uvs) {
        shape->flags |= SHAPE_HAS_UVS;
        TRY(vertex_param(b, path, "texcoords", "vertex_texcoords", v, 2, uvs, &shape->uvs));
        memcpy(&ARRAY_AT(scene->build.theta, float, shape->uvs), mesh->uvs, (size_t)v * 2 * sizeof(float));
    }
    for (int i = 0; i < mesh->attribute_count; i++) {
        TRY(build_mesh_attribute(b, &mesh->attributes[i], id, path, v, f));
    }
    int32_t triangles = rey_scene_append(scene, &scene->build.triangles, sizeof(int32_t), 3 * f);
    shape->welded = rey_scene_append(scene, &scene->build.welded, sizeof(int32_t), v);
    if (triangles < 0 || shape->welded < 0) {
        return REY_ERROR_MEMORY;
    }
    shape->triangle = triangles / 3;
    memcpy(&ARRAY_AT(scene->build.triangles, int32_t, triangles), mesh->faces, (size_t)f * 3 * sizeof(int32_t));
    for (int64_t i = 0; i < v; i++) {
        ARRAY_AT(scene->build.welded, int32_t, shape->welded + i) = (int32_t)mesh->position_index[i];
    }
    return REY_OK;
}

static rey_result build_mesh(Builder *b, rey_xml_node *node, int32_t id, const char *path, ShapeRecord *shape) {
    rey_mesh mesh = {0};
    bool smooth = false;
    rey_result result = build_load_mesh(b, node, &mesh, &smooth);
    if (result == REY_OK) {
        shape->flags |= smooth ? SHAPE_SMOOTH_NORMALS : 0;
        result = build_copy_mesh(b, &mesh, id, path, shape);
    }
    rey_mesh_free(b->ctx, &mesh);
    return result;
}

// Rectangle or cube: a mesh whose vertices follow to_world when that changes.
static rey_result build_posed_mesh(Builder *b, bool cube, int32_t id, const char *path, ShapeRecord *shape) {
    rey_scene *scene = b->scene;
    float vertices[CUBE_VERTICES][8];
    int32_t triangles[CUBE_TRIANGLES][3];
    if (cube) {
        rey_cube_mesh(vertices, triangles);
    } else {
        rey_rectangle_mesh(vertices, triangles);
    }
    shape->vertex_count = cube ? CUBE_VERTICES : RECTANGLE_VERTICES;
    shape->triangle_count = cube ? CUBE_TRIANGLES : RECTANGLE_TRIANGLES;
    shape->flags |= SHAPE_HAS_UVS;
    Param positions = {PARAM_DEFAULTS, .unit = "scene units", .description = "vertex positions", .terms = GEOMETRY_TERMS,
                       .why = moving_why, .geometry = id};
    TRY(vertex_param(b, path, "positions", "vertex_positions", shape->vertex_count, 3, positions, &shape->positions));
    shape->uvs = rey_scene_append(scene, &scene->build.theta, sizeof(float), 2 * shape->vertex_count);
    int32_t at = rey_scene_append(scene, &scene->build.triangles, sizeof(int32_t), 3 * shape->triangle_count);
    shape->welded = rey_scene_append(scene, &scene->build.welded, sizeof(int32_t), shape->vertex_count);
    if (shape->uvs < 0 || at < 0 || shape->welded < 0) {
        return REY_ERROR_MEMORY;
    }
    shape->triangle = at / 3;
    for (int32_t i = 0; i < shape->vertex_count; i++) {
        int32_t first = 0;
        while (memcmp(vertices[first], vertices[i], 3 * sizeof(float)) != 0) {
            first++;
        }
        ARRAY_AT(scene->build.welded, int32_t, shape->welded + i) = first;
        memcpy(&ARRAY_AT(scene->build.theta, float, shape->uvs + 2 * i), vertices[i] + 6, 2 * sizeof(float));
    }
    return REY_OK;
}

// A plugin of one surface that follows to_world, from shape/kinds.inl.
typedef struct PosedParam {
    bool point; // three numbers, else one positive number
    const char *name;
    double value[3];
} PosedParam;

typedef struct PosedPlugin {
    const char *name;
    int32_t kind, table;
    bool (*fold)(const double *values, double m[16]);
    PosedParam params[4];
} PosedPlugin;

static const PosedPlugin *posed_plugin(const char *name) {
    static const PosedPlugin plugins[] = {
        {NULL, 0, 0, NULL, {{0}}},
#define FORM_POINT true
#define FORM_LENGTH false
#define POSED_PARAM(form, field, x, y, z, text) {FORM_##form, #field, {x, y, z}},
#define SHAPE_MESH_KIND(ENUM, prefix)
#define SHAPE_CURVE(ENUM, prefix, ...)
#define SHAPE_POSED(ENUM, prefix, form, plugin, PARAMS)                                                                \
    {plugin, SHAPE_##ENUM, ENUM##_TABLE, prefix##_fold, {PARAMS(POSED_PARAM){false, NULL, {0}}}},
#include "shape/kinds.inl"
#undef SHAPE_MESH_KIND
#undef SHAPE_POSED
#undef SHAPE_CURVE
    };
    for (int i = 1; i < COUNT_OF(plugins); i++) {
        if (strcmp(plugins[i].name, name) == 0) {
            return &plugins[i];
        }
    }
    return NULL;
}

// The plugin's own parameters become part of the pose.
static rey_result posed_fold(Builder *b, rey_xml_node *node, const PosedPlugin *plugin, double m[16]) {
    double values[12];
    int n = 0;
    for (const PosedParam *p = plugin->params; p->name; p++) {
        if (p->point) {
            TRY(rey_xml_get_vec3(b->ctx, node, p->name, p->value, values + n));
            n += 3;
            continue;
        }
        TRY(rey_xml_get_float(b->ctx, node, p->name, p->value[0], &values[n]));
        if (!(values[n] > 0)) {
            return rey_xml_fail_value(b->ctx, node, p->name, "the %s is %g, expected a positive number", p->name,
                                      values[n]);
        }
        n++;
    }
    if (!plugin->fold(values, m)) {
        return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE, "the %s has no extent", node->type);
    }
    return REY_OK;
}

// Spheres stay round, with the radius that the x axis gets.
static rey_result note_stretched(Builder *b, rey_xml_node *node, const double m[16]) {
    double length[3], shear = 0;
    for (int k = 0; k < 3; k++) {
        int j = (k + 1) % 3;
        length[k] = sqrt(m[k] * m[k] + m[4 + k] * m[4 + k] + m[8 + k] * m[8 + k]);
        shear = fmax(shear, fabs(m[k] * m[j] + m[4 + k] * m[4 + j] + m[8 + k] * m[8 + j]));
    }
    double unequal = fmax(fabs(length[1] - length[0]), fabs(length[2] - length[0]));
    if (unequal <= 1e-4 * length[0] && shear <= 1e-4 * length[0] * length[0]) {
        return REY_OK;
    }
    return rey_scene_add_note(b->scene, "warning: %s:%d: to_world stretches or shears this sphere, which stays round, of radius "
                              "%g; an <instance> of it can be stretched", node->at.file, node->at.line, length[0]);
}

static rey_result build_posed(Builder *b, rey_xml_node *node, int32_t id, const char *path, ShapeRecord *shape) {
    double m[16];
    const PosedPlugin *plugin = posed_plugin(node->type);
    TRY(rey_xml_get_transform(b->ctx, node, "to_world", m));
    if (plugin) {
        TRY(posed_fold(b, node, plugin, m));
    }
    if (rey_matrix_determinant(m) == 0) {
        return rey_xml_fail_value(b->ctx, node, "to_world", "the shape's to_world cannot be inverted");
    }
    Param pose = {PARAM_DEFAULTS, .terms = GEOMETRY_TERMS, .why = moving_why, .geometry = id};
    TRY(build_pose(b, m, path, pose, &shape->to_world));
    if (!plugin) {
        return build_posed_mesh(b, strcmp(node->type, "cube") == 0, id, path, shape);
    }
    if (plugin->kind == SHAPE_SPHERE) {
        TRY(note_stretched(b, node, m));
    }
    shape->kind = plugin->kind;
    if (plugin->kind == SHAPE_SPHERE && rey_matrix_determinant(m) < 0) {
        shape->flags ^= SHAPE_FLIP_NORMALS;
        shape->mirrored = 1;
    }
    // Embree reads a sphere's centre and radius from here by one load of 16 bytes, which must be aligned.
    Array *tables = &b->scene->build.tables;
    int32_t padding = (int32_t)(-tables->count % 4);
    int32_t first = rey_scene_append(b->scene, tables, sizeof(float), padding + plugin->table);
    shape->table = first + padding;
    TRY(first >= 0 ? REY_OK : REY_ERROR_MEMORY);
    return plugin->kind == SHAPE_SDFGRID ? build_sdfgrid(b, node, id, path, shape) : REY_OK;
}

rey_result build_surface(Builder *b, rey_xml_node *node, rey_xml_child *bsdf, int32_t id, const char *path,
                         ShapeRecord *shape) {
    char name[MAX_PATH_NAME];
    bool several = rey_xml_count_children(node, REY_XML_BIT(REY_XML_BSDF)) > 1 && !build_has_parts(node);
    if (several || rey_xml_count_children(node, REY_XML_BIT(REY_XML_EMITTER)) > 1) {
        return rey_xml_fail(b->ctx, node->at, REY_ERROR_SCENE, "a shape can have one bsdf and one emitter");
    }
    build_join(name, path, "interior_medium");
    TRY(build_medium_slot(b, node, "interior", name, &shape->interior));
    build_join(name, path, "exterior_medium");
    TRY(build_medium_slot(b, node, "exterior", name, &shape->exterior));
    rey_xml_child *emitter = rey_xml_child_of(node, REY_XML_BIT(REY_XML_EMITTER), 0);
    rey_xml_child *sensor = rey_xml_child_of(node, REY_XML_BIT(REY_XML_SENSOR), 0);
    build_join(name, path, "bsdf");
    if (bsdf) {
        Snapshot s = build_snapshot(b);
        bool left_out;
        TRY(build_forgive(b, &s, bsdf, " (a diffuse bsdf takes its place)",
                          build_bsdf(b, bsdf->node, name, &shape->bsdf), &left_out));
        bsdf = left_out ? NULL : bsdf;
    }
    if (!bsdf) {
        TRY(build_default_bsdf(b, node, emitter ? 0 : 0.5, name, &shape->bsdf));
    }
    if (emitter && b->collection >= 0) {
        return rey_xml_fail(b->ctx, emitter->at, REY_ERROR_UNSUPPORTED, "a light cannot stand inside a shapegroup");
    }
    if (emitter) {
        build_join(name, path, "emitter");
        Snapshot s = build_snapshot(b);
        bool left_out;
        TRY(build_forgive(b, &s, emitter, "", build_emitter(b, emitter->node, id, name, &shape->emitter), &left_out));
        if (left_out && !bsdf) { // the default of shapes that shine is black
            const BsdfNode *own = &ARRAY_AT(b->scene->build.bsdfs, BsdfNode, shape->bsdf);
            const TextureNode *colour = &ARRAY_AT(b->scene->build.textures, TextureNode, own->slot[0]);
            for (int c = 0; c < 3; c++) {
                ARRAY_AT(b->scene->build.theta, float, colour->theta + c) = 0.5f;
            }
        }
        emitter = left_out ? NULL : emitter;
    }
    if (shape->kind == SHAPE_MESH && (emitter || sensor || (shape->flags & SHAPE_UNSEEN))) {
        shape->area_cdf = rey_scene_append(b->scene, &b->scene->build.tables, sizeof(float), shape->triangle_count);
        TRY(shape->area_cdf < 0 ? REY_ERROR_MEMORY : REY_OK);
    }
    if (sensor) {
        build_join(name, path, "sensor");
        TRY(build_sensor(b, sensor->node, id, name));
    }
    return build_group(b, shape);
}

// Tells of the first surface that is hardly larger than the step off surfaces with which rays begin (interaction_step).
static rey_result note_small(Builder *b, const rey_xml_node *node, const ShapeRecord *shape) {
    const double share = 0.02;
    const float *theta = (const float *)b->scene->build.theta.data;
    const bool posed = shape->to_world >= 0; // two opposite corners of what it lies in
    const int64_t count = b->small || b->collection >= 0 ? 0 : posed ? 2 : shape->kind == SHAPE_MESH ? shape->vertex_count : 0;
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY}, size = 0, step = 0;
    for (int64_t i = 0; i < count; i++) {
        double far = 0;
        for (int k = 0; k < 3; k++) {
            const float *row = posed ? theta + shape->to_world + 4 * k : NULL;
            double half = posed ? fabs((double)row[0]) + fabs((double)row[1]) + fabs((double)row[2]) : 0;
            double x = posed ? (double)row[3] + (i ? half : -half) : (double)theta[shape->positions + 3 * i + k];
            low[k] = fmin(low[k], x);
            high[k] = fmax(high[k], x);
            size = fmax(size, high[k] - low[k]);
            far = fmax(far, fmax(fabs(low[k]), fabs(high[k])));
        }
        step = 9e-5 * (1 + far);
        if (step <= share * size) { // farther points widen it by more than they lengthen the step
            return REY_OK;
        }
    }
    if (!(size > 0) || !isfinite(step)) {
        return REY_OK;
    }
    b->small = true;
    return rey_scene_add_note(b->scene, "derivatives: %s:%d: this %s is %.3g wide, and rays begin %.3g off its surface (9e-5 of "
                              "1 + the largest coordinate): what moves near it will have wrong derivatives; bring the scene nearer "
                              "to the origin, or make it larger", node->at.file, node->at.line, node->type, size, step);
}

rey_result build_shape(Builder *b, rey_xml_node *node, const char *path) {
    if (strcmp(node->type, "shapegroup") == 0) {
        return build_shapegroup(b, node, path);
    }
    if (strcmp(node->type, "merge") == 0) {
        return build_merge(b, node, path);
    }
    if (strcmp(node->type, "instance") == 0) {
        return build_instance(b, node, path);
    }
    ShapeRecord shape = {.emitter = -1, .interior = -1, .exterior = -1, .positions = -1, .normals = -1, .uvs = -1,
                         .to_world = -1, .table = -1, .area_cdf = -1, .collection = b->collection};
    bool first, flip;
    double weight;
    TRY(build_visit(b, node, path, &first));
    TRY(rey_xml_get_bool(b->ctx, node, "flip_normals", false, &flip));
    TRY(rey_xml_get_float(b->ctx, node, "silhouette_sampling_weight", 1, &weight));
    shape.flags = (flip ? SHAPE_FLIP_NORMALS : 0) | (b->collection >= 0 ? SHAPE_INSTANCED : 0) | b->shape_flags;
    if (build_has_parts(node)) {
        TRY(build_parts(b, node, path, shape));
        TRY(build_check_unused(b, node));
        return build_finish(b, node, path);
    }
    int32_t id = rey_scene_append(b->scene, &b->scene->build.shapes, sizeof shape, 1);
    if (id < 0) {
        return REY_ERROR_MEMORY;
    }
    if (load_kind(node) == FILE_MESH) {
        TRY(build_mesh(b, node, id, path, &shape));
    } else if (strcmp(node->type, "rectangle") == 0 || strcmp(node->type, "cube") == 0 || posed_plugin(node->type)) {
        TRY(build_posed(b, node, id, path, &shape));
    } else if (build_is_curve(node->type)) {
        TRY(build_curve(b, node, id, path, &shape));
    } else {
        return build_unknown(b, node, shape_word, NULL);
    }
    TRY(build_surface(b, node, rey_xml_child_of(node, REY_XML_BIT(REY_XML_BSDF), 0), id, path, &shape));
    TRY(note_small(b, node, &shape));
    ARRAY_AT(b->scene->build.shapes, ShapeRecord, id) = shape;
    ShapeSource *source = rey_array_push(b->ctx, &b->source->shapes, sizeof *source, 1);
    if (!source) {
        return REY_ERROR_MEMORY;
    }
    *source = (ShapeSource){node, id};
    node->built = id;
    TRY(build_check_unused(b, node));
    return build_finish(b, node, path);
}

rey_result build_target_shape(Builder *b, rey_xml_node *node, const char *path, int32_t *out) {
    static const char *const plain[] = {"rectangle", "disk", "sphere", "cylinder", "cube", "obj", "ply", "serialized"};
    bool known = false;
    for (int i = 0; i < COUNT_OF(plain); i++) {
        known |= strcmp(node->type, plain[i]) == 0;
    }
    if (!known) {
        return rey_xml_fail(b->ctx, node->at, REY_ERROR_UNSUPPORTED, "a %s cannot be the target of a sensor", node->type);
    }
    b->shape_flags = SHAPE_UNSEEN;
    rey_result result = build_shape(b, node, path);
    b->shape_flags = 0;
    *out = node->built;
    return result;
}
