// rims.c: whether the ends of rough refraction move where no sampled direction finds them.
#include "render/rims.h"

#include "bsdf/table.h"
#include "emitter/emitter.h"
#include "render/particles.h"

// What of the scene's light comes along directions that are not sampled by scattering, null where none does.
static const char *unsampled(const rey_scene *scene) {
    const SceneView *view = &scene->view;
    if (rey_traces_particles(scene)) {
        return "light tracing does not find that. The integrator 'path' does";
    }
    if (view->split && view->scatter_samples == 0) {
        return "'direct' without bsdf_samples does not find that";
    }
    for (int64_t i = 0; i < view->emitters_count; i++) {
        if (emitter_is_delta(view->emitters + i)) {
            return "for lights at a point or with one direction that is not known";
        }
    }
    return NULL;
}

// Whether a parameter moves the ends of the refraction of a function: its index, or the normals of a map around it.
static bool moves_end(const SceneView *view, int32_t bsdf, const Param *p, bool turned) {
    const BsdfNode *node = view->bsdfs + bsdf;
    const BsdfKind *kind = rey_bsdf_kinds + node->kind;
    bool moves = turned;
    for (int k = 0; k < kind->param_count && p->texture >= 0; k++) {
        ParamType type = kind->params[k].type;
        bool counts = type == PARAM_IOR || type == PARAM_SPECULAR || type == PARAM_NORMAL || type == PARAM_HEIGHT ||
                      type == PARAM_HEIGHT_SCALE;
        moves |= counts && node->slot[k] == p->texture;
    }
    bool found = moves && rey_bsdf_ends(view, node);
    for (int k = 0; k < MAX_CHILDREN && !found; k++) {
        found = node->child[k] >= 0 && moves_end(view, node->child[k], p, moves);
    }
    return found;
}

static bool any_ends(const SceneView *view) {
    bool found = false;
    for (int64_t i = 0; i < view->bsdfs_count && !found; i++) {
        found = rey_bsdf_ends(view, view->bsdfs + i);
    }
    return found;
}

const char *rey_rims_gap(const rey_scene *scene, const Param *p, char object[OBJECT_NAME]) {
    const SceneView *view = &scene->view;
    const char *gap = unsampled(scene);
    gap = gap && any_ends(view) ? gap : NULL; // far fewer functions are looked at than by shape
    const bool moves = p->geometry >= 0 || p->instance >= 0 || p->camera >= 0 || p->normals >= 0 || p->emitter >= 0;
    for (int64_t i = 0; i < view->shapes_count && gap; i++) {
        int32_t bsdf = view->shapes[i].bsdf;
        if (moves_end(view, bsdf, p, moves)) {
            rey_name_bsdf(scene, bsdf, object);
            return gap;
        }
    }
    return NULL;
}
