// build_sdf.c: grids of signed distances.
#include "io/build.h"
#include "io/grid.h"
#include "shape/shape.h"

#include <string.h>

static rey_result read_nodes(Builder *b, const rey_xml_node *node, const rey_grid *grid, ShapeRecord *shape) {
    rey_scene *scene = b->scene;
    if (grid->channels != 1 || grid->nx < 2 || grid->ny < 2 || grid->nz < 2) {
        return rey_xml_fail(b->ctx, node->at, REY_ERROR_FORMAT,
                            "the grid has %d x %d x %d nodes of %d channels, expected at least 2 x 2 x 2 of 1", grid->nx,
                            grid->ny, grid->nz, grid->channels);
    }
    const float nodes[3] = {(float)grid->nx, (float)grid->ny, (float)grid->nz};
    memcpy(&ARRAY_AT(scene->build.tables, float, shape->table + SDFGRID_NODES), nodes, sizeof nodes);
    shape->positions = rey_scene_append(scene, &scene->build.theta, sizeof(float), rey_grid_count(grid));
    return shape->positions < 0
               ? REY_ERROR_MEMORY
               : rey_xml_named_file(b->ctx, node->at,
                                    rey_grid_read(b->ctx, grid, &ARRAY_AT(scene->build.theta, float, shape->positions)));
}

rey_result build_sdfgrid(Builder *b, rey_xml_node *node, int32_t id, const char *path, ShapeRecord *shape) {
    static const char *const normals[] = {"smooth", "analytic"};
    static const char *const why = "moving geometry moves silhouettes, seen by the camera and by other path vertices";
    rey_xml_child *emitter = rey_xml_child_of(node, REY_XML_BIT(REY_XML_EMITTER), 0);
    char *file = NULL, name[MAX_PATH_NAME];
    int mode;
    rey_grid grid;
    if (emitter) {
        return rey_xml_fail(b->ctx, emitter->at, REY_ERROR_UNSUPPORTED, "an sdfgrid cannot be a light");
    }
    TRY(rey_xml_get_choice(b->ctx, node, "normals", normals, 2, 0, &mode));
    TRY(rey_xml_resolve_file(b->ctx, b->source->document, node, "filename", &file));
    rey_result result = rey_xml_named_file(b->ctx, rey_xml_find(node, "filename")->at, rey_grid_open(b->ctx, file, &grid));
    const int32_t dims[3] = {grid.nz, grid.ny, grid.nx};
    int64_t count = rey_grid_count(&grid);
    if (result == REY_OK) {
        result = read_nodes(b, node, &grid, shape);
        rey_grid_close(b->ctx, &grid);
    }
    rey_free(b->ctx, file);
    TRY(result);
    shape->flags |= mode == 0 ? SHAPE_SMOOTH_GRADIENT : 0;
    Param p = {PARAM_DEFAULTS, .theta = shape->positions, .count = (int32_t)count, .dims = 3,
               .shape = {dims[0], dims[1], dims[2]}, .unit = "scene units",
               .description = "signed distances at the nodes", .geometry = id, .why = why,
               .terms = REY_TERM_INTERIOR | REY_TERM_PRIMARY | REY_TERM_INDIRECT};
    build_join(name, path, "grid");
    return rey_scene_add_param(b->scene, name, p) < 0 ? REY_ERROR_MEMORY : REY_OK;
}
