// ends.c: what moves the ends of rough refraction.
#include "bsdf/ends.h"

bool rey_bsdf_ends_within(const SceneView *view, int32_t bsdf) {
    const BsdfNode *node = view->bsdfs + bsdf;
    bool found = rey_bsdf_ends(view, node);
    for (int k = 0; k < MAX_CHILDREN && !found; k++) {
        found = node->child[k] >= 0 && rey_bsdf_ends_within(view, node->child[k]);
    }
    return found;
}

// Whether what a texture says depends on a parameter.
static bool texture_depends(const SceneView *view, int32_t texture, const Param *p) {
    if (texture < 0) {
        return false;
    }
    const TextureNode *t = view->textures + texture;
    return texture == p->texture || texture == p->to_uv || (t->kind == TEXTURE_ATTRIBUTE && p->attribute >= 0) ||
           (t->kind == TEXTURE_VOLUME && p->volume >= 0) || texture_depends(view, t->child[0], p) ||
           texture_depends(view, t->child[1], p);
}

bool rey_bsdf_ends_move(const SceneView *view, int32_t bsdf, const Param *p, bool turned) {
    const BsdfNode *node = view->bsdfs + bsdf;
    const BsdfKind *kind = rey_bsdf_kinds + node->kind;
    for (int k = 0; k < kind->param_count && !turned; k++) {
        ParamType type = kind->params[k].type;
        turned = (type == PARAM_IOR || type == PARAM_SPECULAR || type == PARAM_NORMAL || type == PARAM_HEIGHT ||
                  type == PARAM_HEIGHT_SCALE) && texture_depends(view, node->slot[k], p);
    }
    bool found = turned && rey_bsdf_ends(view, node);
    for (int k = 0; k < MAX_CHILDREN && !found; k++) {
        found = node->child[k] >= 0 && rey_bsdf_ends_move(view, node->child[k], p, turned);
    }
    return found;
}
