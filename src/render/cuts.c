// cuts.c: where maps without a shadowing function are, and what is not known of them.
#include "render/cuts.h"

#include "bsdf/table.h"
#include "emitter/emitter.h"
#include "render/boundary.h"
#include "render/motion.h"
#include "shape/edges.h"

bool rey_cuts_within(const SceneView *view, int32_t bsdf) {
    const BsdfNode *node = view->bsdfs + bsdf;
    bool cuts = bsdf >= 0 && rey_bsdf_cuts(node);
    for (int k = 0; bsdf >= 0 && k < MAX_CHILDREN && !cuts; k++) {
        cuts = rey_cuts_within(view, node->child[k]);
    }
    return cuts;
}

// Whether one cuts off at the plane of another map's normals. within: it is inside a map.
static bool cuts_within_map(const SceneView *view, int32_t bsdf, bool within) {
    const BsdfNode *node = view->bsdfs + bsdf;
    bool found = bsdf >= 0 && within && rey_bsdf_cuts(node);
    for (int k = 0; bsdf >= 0 && k < MAX_CHILDREN && !found; k++) {
        found = cuts_within_map(view, node->child[k], within || rey_bsdf_turns(node->kind));
    }
    return found;
}

// Whether some light comes to a point from one direction only.
static bool has_sharp_light(const SceneView *view) {
    for (int64_t i = 0; i < view->emitters_count; i++) {
        int32_t kind = view->emitters[i].kind;
        if (view->emitters[i].shape < 0 && kind != EMITTER_CONSTANT && kind != EMITTER_ENVMAP) {
            return true;
        }
    }
    return false;
}

rey_result rey_faces_find(rey_scene *scene, int32_t id, int32_t kind, Array *edges) {
    const SceneView *view = &scene->view;
    const ShapeRecord *shape = view->shapes + id;
    const int64_t instances = shape->collection >= 0 ? view->instances_count : 1;
    for (int64_t i = 0; i < instances; i++) {
        if (shape->collection >= 0 && view->instances[i].group != shape->collection) {
            continue;
        }
        const int32_t count = shape->kind == SHAPE_MESH ? shape->triangle_count : 1;
        for (int32_t k = 0; k < count; k++) {
            EdgeRecord *e = rey_array_push(scene->ctx, edges, sizeof *e, 1);
            if (!e) {
                return REY_ERROR_MEMORY;
            }
            *e = (EdgeRecord){.kind = kind, .shape = id, .instance = (int32_t)i, .prim = k, .opposite = EDGE_OPEN,
                              .other = EDGE_ANY, .crease = EDGE_CREASE, .last = 1};
        }
    }
    return REY_OK;
}

rey_result rey_cuts_find(rey_scene *scene, Array *edges) {
    rey_result result = REY_OK;
    for (int32_t i = 0; i < scene->view.shapes_count && result == REY_OK; i++) {
        const ShapeRecord *shape = scene->view.shapes + i;
        if (shape->kind == SHAPE_MESH && !(shape->flags & SHAPE_UNSEEN) && rey_cuts_within(&scene->view, shape->bsdf)) {
            result = rey_faces_find(scene, i, EDGE_CUT, edges);
        }
    }
    return result;
}

// What is not known of a shape that cuts light off, null where all is. sharp: there are such lights; moves: points or normals do;
// looks: the sensor does, which leaves the planes of flat triangles where they are.
static const char *gap_of_shape(const SceneView *view, const ShapeRecord *shape, bool sharp, bool moves, bool looks) {
    bool round = shape->kind != SHAPE_MESH, bent = round || (shape->flags & SHAPE_HAS_NORMALS);
    if (view->has_media && moves && (bent || !looks)) {
        return "cut off what comes through participating media";
    }
    if (cuts_within_map(view, shape->bsdf, false)) {
        return "cut light off at the planes of another map's normals";
    }
    if (bent && sharp) {
        return "cut the light of points and of single directions off along a curve of round or smooth surfaces";
    }
    return moves && round ? "cut light off at the planes of surfaces other than meshes" : NULL;
}

const char *rey_cuts_gap(const rey_scene *scene, const SensorRecord *sensor, const Param *p, char object[OBJECT_NAME]) {
    const SceneView *view = &scene->view;
    const bool sharp = has_sharp_light(view);
    bool moves = p->geometry >= 0 || p->instance >= 0 || p->camera >= 0 || p->normals >= 0;
    bool turns = p->texture >= 0 && (p->terms & REY_TERM_TERMINATOR), lights = p->emitter >= 0 && sharp;
    for (int32_t i = 0; i < (int32_t)view->shapes_count && (moves || turns || lights); i++) {
        const ShapeRecord *shape = view->shapes + i;
        bool cuts = rey_cuts_within(view, shape->bsdf) && (!turns || cuts_within_map(view, shape->bsdf, false));
        const char *gap = cuts && !rey_moves_border(view, p) ? gap_of_shape(view, shape, sharp, moves, p->camera >= 0) : NULL;
        if (cuts && p->normals >= 0 && !rey_turning_known(view, sensor)) {
            gap = "cut light off where vertex normals move, which is not known of smooth mirrors, glass, media and this sensor";
        }
        if (gap) {
            rey_name_bsdf(scene, shape->bsdf, object);
            return gap;
        }
    }
    return NULL;
}
