// dropped.c: what of a derivative is not known where `path` drops light. What is: integrator/kept.h.
#include "render/dropped.h"

#include "bsdf/table.h"
#include "emitter/table.h"
#include "render/blame.h"

// Where a function stands: in one that lets a part of the light pass, and in one that turns the shading normal.
typedef struct Place {
    bool shared, turned, lit; // lit: lights have an extent, so that MIS weighs them
} Place;

// Whether a parameter is, or is read by, a texture.
static bool texture_reads(const SceneView *view, int32_t id, const Param *p) {
    if (id < 0) {
        return false;
    }
    const TextureNode *t = view->textures + id;
    return p->texture == id || p->to_uv == id || (t->kind == TEXTURE_ATTRIBUTE && p->attribute >= 0) ||
           (t->kind == TEXTURE_VOLUME && p->theta == view->volumes[t->volume].theta) ||
           texture_reads(view, t->child[0], p) || texture_reads(view, t->child[1], p);
}

// Whether a parameter of a function decides in a way that is not known how much light is dropped.
static bool gap_of_function(const SceneView *view, int32_t id, const Param *p, Place place) {
    const BsdfNode *bsdf = view->bsdfs + id;
    const bool thin = rey_bsdf_holds(view, id, rey_bsdf_tints), turns = rey_bsdf_turns(bsdf->kind);
    const bool shares = rey_bsdf_kinds[bsdf->kind].adapter && rey_bsdf_holds(view, id, rey_bsdf_opens);
    for (int k = 0; k < rey_bsdf_kinds[bsdf->kind].param_count; k++) {
        bool draws = place.lit && (shares ? place.turned || turns : place.shared && (turns || rey_bsdf_draws(bsdf->kind, k)));
        if ((thin || draws) && texture_reads(view, bsdf->slot[k], p)) {
            return true;
        }
    }
    place.shared = place.shared || shares;
    place.turned = place.turned || turns;
    bool gap = false;
    for (int k = 0; k < MAX_CHILDREN && bsdf->child[k] >= 0; k++) {
        gap = gap || gap_of_function(view, bsdf->child[k], p, place);
    }
    return gap;
}

static bool gap_of_light(const SceneView *view, const EmitterRecord *e, const Param *p) {
    const EmitterKind *kind = rey_emitter_kinds + e->kind;
    bool gap = false;
    for (int k = 0; k < kind->param_count; k++) {
        gap = gap || (kind->params[k].type == EMITTER_PARAM_IMAGE && kind->form == EMITTER_IS_ENVIRONMENT &&
                      texture_reads(view, e->slot[k], p));
    }
    return gap;
}

const char *rey_dropped_gap(const SceneView *view, const Param *p, int terms) {
    if (!view->drops) {
        return NULL;
    }
    bool moves = terms & (REY_TERM_PRIMARY | REY_TERM_INDIRECT | REY_TERM_SPECULAR), gap = false;
    Place place = {false};
    for (int64_t i = 0; i < view->emitters_count; i++) {
        place.lit = place.lit || rey_emitter_kinds[view->emitters[i].kind].form != EMITTER_IS_DELTA;
        gap = gap || gap_of_light(view, view->emitters + i, p);
    }
    for (int32_t i = 0; i < (int32_t)view->bsdfs_count; i++) {
        gap = gap || gap_of_function(view, i, p, place);
        gap = gap || (p->normals >= 0 && (place.lit || rey_bsdf_tints(view->bsdfs[i].kind)));
    }
    return moves ? "with hide_emitters, 'path' drops light of surfaces that let a part of it pass, also where this parameter moves "
                   "something. 'volpath' drops none"
         : gap   ? "with hide_emitters, 'path' drops light of surfaces that let a part of it pass, and how much depends on the "
                   "densities that this parameter decides. 'volpath' drops none"
                 : NULL;
}
