// update.c: derived data of emitters.
#include "emitter/update.h"

#include "emitter/emitter.h"
#include "emitter/table.h"

enum {
    FLAG_SORTS = 64,     // combinations of the flags of shapes
    BLACK_SORTS = 4,     // of which colours are those of black bodies
    MOST_FAMILIES = 32,  // further ones stay alone
    SMALLEST_FAMILY = 2  // lights from which on gathering pays
};

rey_result rey_emitter_update(rey_scene *scene, int32_t id) {
    const EmitterRecord *e = scene->view.emitters + id;
    const EmitterKind *kind = rey_emitter_kinds + e->kind;
    return kind->follow(&scene->view, e)
               ? REY_OK
               : rey_fail(scene->ctx, REY_ERROR_SCENE, "to_world of a light of kind %s cannot be inverted", kind->name);
}

// Lights whose numbers can be gathered belong to one family when kernels treat them alike: the same kind, all textures
// constant, the same ones of black bodies and, for surfaces, the same flags and a kind of shape that can do it. Returns
// the number of that sort, -1 for the others.
static int32_t family_sort(const SceneView *view, const EmitterRecord *e) {
    const EmitterKind *kind = rey_emitter_kinds + e->kind;
    int32_t black = 0;
    for (int i = 0; i < kind->param_count; i++) {
        EmitterParamType type = kind->params[i].type;
        bool colour = type <= EMITTER_PARAM_COLOUR;
        const TextureNode *t = view->textures + e->slot[i];
        if (colour && ((t->kind != TEXTURE_CONSTANT && t->kind != TEXTURE_BLACKBODY) || t->channels != 3)) {
            return -1;
        }
        black |= colour && t->kind == TEXTURE_BLACKBODY ? (i > 0 ? 2 : 1) : 0;
    }
    int32_t first = (e->kind * BLACK_SORTS + black) * SHAPE_KIND_COUNT * FLAG_SORTS;
    if (kind->form == EMITTER_IS_DELTA) {
        return first;
    }
    const ShapeRecord *shape = view->shapes + e->shape;
    bool known = kind->form == EMITTER_IS_SURFACE && shape_samples_many(shape->kind);
    return known ? first + shape->kind * FLAG_SORTS + (shape->flags & (FLAG_SORTS - 1)) : -1;
}

// A family is named by its first member.
static void find_families(SceneView *view) {
    int32_t sorts[MOST_FAMILIES], first[MOST_FAMILIES], count[MOST_FAMILIES] = {0}, n = 0;
    for (int64_t i = 0; i < view->emitters_count; i++) {
        int32_t sort = family_sort(view, view->emitters + i), k = 0;
        while (k < n && sorts[k] != sort) {
            k++;
        }
        if (k == n && sort >= 0 && n < MOST_FAMILIES) {
            sorts[n] = sort;
            first[n] = (int32_t)i;
            n++;
        }
        view->emitters[i].family = k < n ? k : -1;
        count[k < n ? k : 0] += k < n;
    }
    for (int64_t i = 0; i < view->emitters_count; i++) {
        int32_t *family = &view->emitters[i].family;
        *family = *family >= 0 && count[*family] >= SMALLEST_FAMILY ? first[*family] : -1;
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
