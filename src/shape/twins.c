// twins.c: sorts what stands in a scene by all the numbers that say where it is, so that twins follow each other.
#include "shape/twins.h"

#include "shape/cut.h"
#include "shape/shape.h"

#include <stdlib.h>
#include <string.h>

enum { POSE_NUMBERS = 12, KIND_OF_INSTANCES = -1 };

typedef struct Place {
    int32_t kind, collection; // of instances: the shapegroup that they place
    int32_t count, triangles;
    const float *numbers;
    const int32_t *corners; // of triangles, or where the segments of curves begin
    Twin twin;
} Place;

static Place place_of(const SceneView *view, int32_t i) {
    const ShapeRecord *shape = view->shapes + i;
    Place p = {.kind = shape->kind, .collection = shape->collection, .twin = {i, -1}};
    if (shape->kind == SHAPE_MESH) {
        p.count = 3 * shape->vertex_count;
        p.numbers = view->theta + shape->positions;
        p.triangles = 3 * shape->triangle_count;
        p.corners = rey_mesh_triangle(view, shape, 0);
    } else if (shape->segment_count > 0) {
        p.count = 4 * shape->vertex_count;
        p.numbers = view->theta + shape->positions;
        p.triangles = shape->segment_count;
        p.corners = view->segments + shape->segment;
    } else {
        p.count = POSE_NUMBERS;
        p.numbers = view->theta + shape->to_world;
    }
    return p;
}

static int order(int32_t a, int32_t b) { return (a > b) - (a < b); }

static int compare_places(const void *first, const void *second) {
    const Place *a = first, *b = second;
    int by = order(a->kind, b->kind);
    by = by ? by : order(a->collection, b->collection);
    by = by ? by : order(a->count, b->count);
    by = by ? by : order(a->triangles, b->triangles);
    by = by ? by : memcmp(a->numbers, b->numbers, (size_t)a->count * sizeof *a->numbers);
    return by || !a->triangles ? by : memcmp(a->corners, b->corners, (size_t)a->triangles * sizeof *a->corners);
}

rey_result rey_twins_find(rey_scene *scene, bool (*stands)(const SceneView *view, const ShapeRecord *shape), Twin twins[2]) {
    const SceneView *view = &scene->view;
    size_t count = 0;
    Place *places = rey_alloc(scene->ctx, (size_t)(view->shapes_count + view->instances_count + 1) * sizeof *places);
    twins[0] = twins[1] = (Twin){-1, -1};
    if (!places) {
        return REY_ERROR_MEMORY;
    }
    for (int64_t i = 0; i < view->shapes_count; i++) {
        if (stands(view, view->shapes + i)) {
            places[count++] = place_of(view, (int32_t)i);
        }
    }
    for (int64_t i = 0; i < view->instances_count; i++) {
        places[count++] = (Place){.kind = KIND_OF_INSTANCES, .collection = view->instances[i].group, .count = POSE_NUMBERS,
                                  .numbers = view->theta + view->instances[i].to_world, .twin = {-1, (int32_t)i}};
    }
    qsort(places, count, sizeof *places, compare_places);
    for (size_t i = 1; i < count; i++) {
        if (compare_places(places + i - 1, places + i) == 0) {
            twins[0] = places[i - 1].twin;
            twins[1] = places[i].twin;
            break;
        }
    }
    rey_free(scene->ctx, places);
    return REY_OK;
}
