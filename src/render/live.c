// live.c: follows textures and nested scattering functions to find what depends on a selection.
#include "render/live.h"

static bool texture_live(const SceneView *view, const PathJob *job, int32_t id) {
    if (id < 0) {
        return false;
    }
    const TextureNode *node = view->textures + id;
    return job->texture_at[id] >= 0 || job->to_uv_at[id] >= 0 ||
           (node->kind == TEXTURE_ATTRIBUTE && job->any_attributes) || texture_live(view, job, node->child[0]) ||
           texture_live(view, job, node->child[1]);
}

static bool bsdf_live(const SceneView *view, const PathJob *job, int32_t id) {
    if (id < 0) {
        return false;
    }
    const BsdfNode *node = view->bsdfs + id;
    bool live = false;
    for (int k = 0; k < MAX_SLOTS; k++) {
        live |= texture_live(view, job, node->slot[k]);
    }
    for (int k = 0; k < MAX_CHILDREN; k++) {
        live |= bsdf_live(view, job, node->child[k]);
    }
    return live;
}

static bool emitter_live(const SceneView *view, const PathJob *job, int32_t id) {
    return id >= 0 && (texture_live(view, job, view->emitters[id].slot) || texture_live(view, job, view->emitters[id].scale));
}

void rey_live_groups(const SceneView *view, PathJob *job, int32_t *live) {
    for (int64_t i = 0; i < view->groups_count; i++) {
        const Group *group = view->groups + i;
        bool scattering = job->any_normals || bsdf_live(view, job, group->bsdf);
        live[i] = (scattering ? LIVE_SCATTERING : 0) | (emitter_live(view, job, group->emitter) ? LIVE_EMISSION : 0);
    }
    job->live = live;
    for (int32_t i = 0; i < (int32_t)view->emitters_count; i++) {
        job->live_lights |= emitter_live(view, job, i);
    }
}
