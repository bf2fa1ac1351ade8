// build_sdf.c: grids of signed distances.
#include "io/build.h"
#include "io/vol.h"
#include "shape/shape.h"

#include <string.h>

rey_result build_sdfgrid(Builder *b, rey_xml_node *node, int32_t id, const char *path, ShapeRecord *shape) {
    static const char *const normals[] = {"smooth", "analytic"};
    static const char *const why = "moving geometry moves silhouettes, seen by the camera and by other path vertices";
    rey_scene *scene = b->scene;
    rey_xml_child *emitter = rey_xml_child_of(node, REY_XML_BIT(REY_XML_EMITTER), 0);
    char *file = NULL, name[MAX_PATH_NAME];
    int mode;
    rey_vol vol;
    if (emitter) {
        return rey_xml_fail(b->ctx, emitter->at, REY_ERROR_UNSUPPORTED, "an sdfgrid cannot be a light");
    }
    TRY(rey_xml_get_choice(b->ctx, node, "normals", normals, 2, 0, &mode));
    TRY(rey_xml_resolve_file(b->ctx, b->source->document, node, "filename", &file));
    rey_result result = rey_vol_read(b->ctx, file, &vol);
    rey_free(b->ctx, file);
    TRY(result);
    const int32_t dims[3] = {vol.nz, vol.ny, vol.nx};
    int64_t count = (int64_t)vol.nx * vol.ny * vol.nz;
    if (vol.channels != 1 || vol.nx < 2 || vol.ny < 2 || vol.nz < 2) {
        result = rey_xml_fail(b->ctx, node->at, REY_ERROR_FORMAT,
                              "the grid has %d x %d x %d nodes of %d channels, expected at least 2 x 2 x 2 of 1", vol.nx,
                              vol.ny, vol.nz, vol.channels);
        rey_vol_free(b->ctx, &vol);
        return result;
    }
    shape->positions = rey_scene_append(scene, &scene->build.theta, sizeof(float), count);
    if (shape->positions >= 0) {
        memcpy(&ARRAY_AT(scene->build.theta, float, shape->positions), vol.data, (size_t)count * sizeof(float));
        const float nodes[3] = {(float)vol.nx, (float)vol.ny, (float)vol.nz};
        memcpy(&ARRAY_AT(scene->build.tables, float, shape->table + SDFGRID_NODES), nodes, sizeof nodes);
    }
    rey_vol_free(b->ctx, &vol);
    shape->flags |= mode == 0 ? SHAPE_SMOOTH_GRADIENT : 0;
    Param p = {PARAM_DEFAULTS, .theta = shape->positions, .count = (int32_t)count, .dims = 3,
               .shape = {dims[0], dims[1], dims[2]}, .unit = "scene units",
               .description = "signed distances at the nodes", .geometry = id, .why = why,
               .terms = REY_TERM_INTERIOR | REY_TERM_PRIMARY | REY_TERM_INDIRECT};
    build_join(name, path, "grid");
    return shape->positions < 0 || rey_scene_add_param(scene, name, p) < 0 ? REY_ERROR_MEMORY : REY_OK;
}
