// facing.c: where maps of normals are, and what is not known of them.
#include "render/facing.h"

#include "bsdf/table.h"
#include "render/blame.h"
#include "render/boundary.h"
#include "render/cuts.h"
#include "shape/shape.h"

// Whether there is a map within another one. within: it is inside one.
static bool maps_nest(const SceneView *view, int32_t bsdf, bool within) {
    if (bsdf < 0) {
        return false;
    }
    const BsdfNode *node = view->bsdfs + bsdf;
    const bool map = rey_bsdf_turns(node->kind);
    bool found = map && within;
    for (int k = 0; k < MAX_CHILDREN && !found; k++) {
        found = maps_nest(view, node->child[k], within || map);
    }
    return found;
}

static bool has_maps(const SceneView *view, const ShapeRecord *shape) {
    return !(shape->flags & SHAPE_UNSEEN) && view->bsdfs[shape->bsdf].turns;
}

const char *rey_facing_gap(const SceneView *view, const SensorRecord *sensor) {
    if (!rey_boundary_sees(sensor)) {
        return "of this sensor";
    }
    if (view->drops) {
        return "where 'path' with hide_emitters drops rays that only pass";
    }
    if (rey_boundary_chained(view) && !rey_chains_known(view, sensor)) {
        return "beside these smooth mirrors and glass";
    }
    for (int64_t i = 0; i < view->shapes_count; i++) {
        const ShapeRecord *shape = view->shapes + i;
        if (has_maps(view, shape) && maps_nest(view, shape->bsdf, false)) {
            return "of maps within other maps";
        }
        bool round = shape->kind == SHAPE_SPHERE || shape->kind == SHAPE_DISK || shape->kind == SHAPE_CYLINDER;
        bool placed = shape->kind == SHAPE_MESH || round;
        if (has_maps(view, shape) && !placed) {
            return "of maps on curves and grids of distances";
        }
    }
    return NULL;
}

bool rey_facing_in_media(const SceneView *view, const Param *p) {
    return view->has_media && p->texture >= 0 && (p->terms & REY_TERM_TERMINATOR);
}

int rey_terms_stated(const rey_scene *scene, int sensor, int terms) {
    return rey_facing_gap(&scene->view, scene->view.sensors + sensor) ? terms & ~REY_TERM_TERMINATOR : terms;
}

rey_result rey_facing_find(rey_scene *scene, Array *edges) {
    rey_result result = REY_OK;
    for (int32_t i = 0; i < scene->view.shapes_count && result == REY_OK; i++) {
        if (has_maps(&scene->view, scene->view.shapes + i)) {
            result = rey_faces_find(scene, i, EDGE_FACING, edges);
        }
    }
    return result;
}
