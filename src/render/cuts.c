// cuts.c: where maps without a shadowing function are, and what is not known of them.
#include "render/cuts.h"

#include "bsdf/table.h"
#include "emitter/emitter.h"
#include "render/motion.h"

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

// What is not known of a shape that cuts light off, null where all is. sharp: there are such lights; moves: points or normals do.
static const char *gap_of_shape(const SceneView *view, const ShapeRecord *shape, bool sharp, bool moves, bool sees) {
    bool round = shape->kind != SHAPE_MESH, bent = round || (shape->flags & SHAPE_HAS_NORMALS);
    if (cuts_within_map(view, shape->bsdf, false)) {
        return "cut light off at the planes of another map's normals";
    }
    if (bent && sharp) {
        return "cut the light of points and of single directions off along a curve of round or smooth surfaces";
    }
    return moves && (bent || !sees) ? "cut light off at the plane of a surface" : NULL;
}

const char *rey_cuts_gap(const rey_scene *scene, const Param *p, char object[OBJECT_NAME]) {
    const SceneView *view = &scene->view;
    const bool sharp = has_sharp_light(view), sees = p->camera >= 0;
    bool moves = p->geometry >= 0 || p->instance >= 0 || sees || p->normals >= 0;
    bool turns = p->texture >= 0 && (p->terms & REY_TERM_TERMINATOR), lights = p->emitter >= 0 && sharp;
    for (int32_t i = 0; i < (int32_t)view->shapes_count && (moves || turns || lights); i++) {
        const ShapeRecord *shape = view->shapes + i;
        bool cuts = rey_cuts_within(view, shape->bsdf) && (!turns || cuts_within_map(view, shape->bsdf, false));
        const char *gap = cuts && !rey_moves_border(view, p) ? gap_of_shape(view, shape, sharp, moves, sees) : NULL;
        if (gap) {
            rey_name_bsdf(scene, shape->bsdf, object);
            return gap;
        }
    }
    return NULL;
}
