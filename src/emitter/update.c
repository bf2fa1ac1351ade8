// update.c: derived data of emitters.
#include "emitter/update.h"

#include "emitter/emitter.h"
#include "emitter/table.h"

enum {
    SORTS = 64,         // combinations of the flags of shapes
    SMALLEST_FAMILY = 2 // lights from which on gathering pays
};

rey_result rey_emitter_update(rey_scene *scene, int32_t id) {
    const EmitterRecord *e = scene->view.emitters + id;
    const EmitterKind *kind = rey_emitter_kinds + e->kind;
    return kind->follow(&scene->view, e)
               ? REY_OK
               : rey_fail(scene->ctx, REY_ERROR_SCENE, "to_world of a light of kind %s cannot be inverted", kind->name);
}

// Lights whose numbers can be gathered belong to one family when kernels treat them alike: the same kind, all textures
// constant and, for surfaces, a mesh with the same flags. Returns the number of that sort, -1 for the others.
static int32_t family_sort(const SceneView *view, const EmitterRecord *e) {
    const EmitterKind *kind = rey_emitter_kinds + e->kind;
    for (int i = 0; i < kind->param_count; i++) {
        EmitterParamType type = kind->params[i].type;
        bool colour = type == EMITTER_PARAM_EMISSION || type == EMITTER_PARAM_COLOUR;
        const TextureNode *t = view->textures + e->slot[i];
        if (colour && (t->kind != TEXTURE_CONSTANT || t->channels != 3)) {
            return -1;
        }
    }
    if (kind->form == EMITTER_IS_DELTA) {
        return e->kind * SORTS;
    }
    const ShapeRecord *shape = view->shapes + e->shape;
    bool mesh = kind->form == EMITTER_IS_SURFACE && shape->kind == SHAPE_MESH;
    return mesh ? e->kind * SORTS + (shape->flags & (SORTS - 1)) : -1;
}

// A family is named by its first member.
static void find_families(SceneView *view) {
    int32_t first[EMITTER_KIND_COUNT * SORTS], count[EMITTER_KIND_COUNT * SORTS] = {0};
    for (int64_t i = 0; i < view->emitters_count; i++) {
        int32_t sort = family_sort(view, view->emitters + i);
        if (sort >= 0 && count[sort]++ == 0) {
            first[sort] = (int32_t)i;
        }
    }
    for (int64_t i = 0; i < view->emitters_count; i++) {
        int32_t sort = family_sort(view, view->emitters + i);
        view->emitters[i].family = sort >= 0 && count[sort] >= SMALLEST_FAMILY ? first[sort] : -1;
    }
}

void rey_emitter_weights(rey_scene *scene) {
    SceneView *view = &scene->view;
    find_families(view);
    double total = 0, sum = 0;
    view->uniform_emitters = true;
    for (int64_t i = 0; i < view->emitters_count; i++) {
        total += view->emitters[i].weight;
        view->uniform_emitters &= view->emitters[i].weight == view->emitters[0].weight;
    }
    for (int64_t i = 0; i < view->emitters_count; i++) {
        EmitterRecord *e = view->emitters + i;
        e->weight = total > 0 ? (float)(e->weight / total) : 1.0f / (float)view->emitters_count;
        sum += e->weight;
        view->tables[view->emitter_cdf + i] = i + 1 == view->emitters_count ? 1 : (float)sum;
    }
}
