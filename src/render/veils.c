// veils.c: what lets shadow rays pass, and to which lights.
#include "render/veils.h"

#include "bsdf/table.h"
#include "emitter/table.h"
#include "render/blame.h"
#include "render/boundary.h"

bool rey_veil_is_uneven(const SceneView *view, int32_t bsdf) {
    const BsdfNode *node = view->bsdfs + bsdf;
    if (!rey_bsdf_holds(view, bsdf, rey_bsdf_opens)) {
        return false;
    }
    bool uneven = rey_bsdf_tints(node->kind);
    for (int k = 0; k < MAX_SLOTS && !uneven; k++) {
        uneven = node->slot[k] >= 0 && view->textures[node->slot[k]].kind != TEXTURE_CONSTANT;
    }
    for (int k = 0; k < MAX_CHILDREN && !uneven; k++) {
        uneven = node->child[k] >= 0 && rey_veil_is_uneven(view, node->child[k]);
    }
    return uneven;
}

bool rey_veils_sharp(const SceneView *view) {
    bool sharp = false;
    for (int64_t i = 0; i < view->emitters_count; i++) {
        sharp |= rey_emitter_kinds[view->emitters[i].kind].form == EMITTER_IS_DELTA;
    }
    return sharp && view->through && rey_boundary_veiled(view);
}
