// build_curve.c: curves.
#include "io/build.h"
#include "io/curve.h"
#include "shape/shape.h"

#include <string.h>

static const char *const moving_why = "moving geometry moves silhouettes, seen by the camera and by other path vertices";

typedef struct CurvePlugin {
    const char *name;
    int32_t kind;
    int order;
} CurvePlugin;

static const CurvePlugin *curve_plugin(const char *name) {
    static const CurvePlugin plugins[] = {
        {NULL, 0, 0},
#define SHAPE_MESH_KIND(ENUM, prefix)
#define SHAPE_POSED(ENUM, prefix, ...)
#define SHAPE_CURVE(ENUM, prefix, form, plugin) {plugin, SHAPE_##ENUM, ENUM##_POINTS},
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

bool build_is_curve(const char *name) { return curve_plugin(name) != NULL; }

int build_curve_order(const char *name) { return curve_plugin(name)->order; }

// Centres follow to_world; radii do not.
static void curves_transform(rey_curves *curves, const double m[16]) {
    for (size_t i = 0; i < curves->points.count; i++) {
        float *p = (float *)curves->points.data + 4 * i;
        double x = p[0], y = p[1], z = p[2];
        for (int k = 0; k < 3; k++) {
            p[k] = (float)(m[4 * k] * x + m[4 * k + 1] * y + m[4 * k + 2] * z + m[4 * k + 3]);
        }
    }
}

static rey_result curves_take(Builder *b, const rey_curves *curves, int32_t id, const char *path, ShapeRecord *shape) {
    rey_scene *scene = b->scene;
    int64_t points = (int64_t)curves->points.count, segments = (int64_t)curves->segments.count;
    // The ray tracer reads a control point by one load of 16 bytes, which must be aligned.
    int32_t padding = (int32_t)(-scene->build.theta.count % 4);
    int32_t at = rey_scene_append(scene, &scene->build.theta, sizeof(float), padding + 4 * points);
    shape->segment = rey_scene_append(scene, &scene->build.segments, sizeof(int32_t), segments);
    if (at < 0 || shape->segment < 0) {
        return REY_ERROR_MEMORY;
    }
    shape->positions = at + padding;
    shape->vertex_count = (int32_t)points;
    shape->segment_count = (int32_t)segments;
    memcpy(&ARRAY_AT(scene->build.theta, float, shape->positions), curves->points.data, (size_t)points * 4 * sizeof(float));
    memcpy(&ARRAY_AT(scene->build.segments, int32_t, shape->segment), curves->segments.data,
           (size_t)segments * sizeof(int32_t));
    Param p = {PARAM_DEFAULTS, .theta = shape->positions, .count = (int32_t)(4 * points), .dims = 2,
               .shape = {(int32_t)points, 4}, .unit = "scene units", .description = "control points: position, radius",
               .terms = REY_TERM_INTERIOR | REY_TERM_PRIMARY | REY_TERM_INDIRECT, .why = moving_why, .geometry = id};
    char name[MAX_PATH_NAME];
    build_join(name, path, "control_points");
    return rey_scene_add_param(scene, name, p) < 0 ? REY_ERROR_MEMORY : REY_OK;
}

rey_result build_curve(Builder *b, rey_xml_node *node, int32_t id, const char *path, ShapeRecord *shape) {
    const CurvePlugin *plugin = curve_plugin(node->type);
    rey_xml_child *emitter = rey_xml_child_of(node, REY_XML_BIT(REY_XML_EMITTER), 0);
    double m[16];
    char *file = NULL;
    rey_curves curves;
    if (emitter) {
        return rey_xml_fail(b->ctx, emitter->at, REY_ERROR_UNSUPPORTED, "a curve cannot be a light");
    }
    TRY(rey_xml_get_transform(b->ctx, node, "to_world", m));
    TRY(rey_xml_resolve_file(b->ctx, b->source->document, node, "filename", &file));
    rey_result result = rey_xml_named_file(b->ctx, rey_xml_find(node, "filename")->at,
                                           rey_curves_read(b->ctx, file, plugin->order, &curves));
    rey_free(b->ctx, file);
    TRY(result);
    curves_transform(&curves, m);
    shape->kind = plugin->kind;
    result = curves_take(b, &curves, id, path, shape);
    rey_curves_free(b->ctx, &curves);
    return result;
}
