// live.c: follows textures and nested scattering functions to find what depends on a selection.
#include "render/live.h"

#include "bsdf/table.h"
#include "emitter/table.h"
#include "render/blame.h"
#include "render/veils.h"

static bool texture_live(const SceneView *view, const PathJob *job, int32_t id) {
    if (id < 0) {
        return false;
    }
    const TextureNode *node = view->textures + id;
    return job->texture_at[id] >= 0 || job->to_uv_at[id] >= 0 ||
           (node->kind == TEXTURE_ATTRIBUTE && job->any_attributes) ||
           (node->kind == TEXTURE_VOLUME && job->volume_at[node->volume] >= 0) || texture_live(view, job, node->child[0]) ||
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
    bool live = false;
    for (int k = 0; id >= 0 && k < rey_emitter_kinds[view->emitters[id].kind].param_count; k++) {
        bool place = rey_emitter_kinds[view->emitters[id].kind].params[k].type >= EMITTER_PARAM_POSITION;
        live |= job->place_at[MAX_EMITTER_SLOTS * id + k] >= 0 || (!place && texture_live(view, job, view->emitters[id].slot[k]));
    }
    return live;
}

static bool phase_live(const SceneView *view, const PathJob *job, int32_t id) {
    if (id < 0) {
        return false;
    }
    const PhaseNode *node = view->phases + id;
    bool live = false;
    for (int k = 0; k < MAX_PHASE_SLOTS; k++) {
        live |= texture_live(view, job, node->slot[k]);
    }
    for (int k = 0; k < MAX_PHASE_CHILDREN; k++) {
        live |= phase_live(view, job, node->child[k]);
    }
    return live;
}

bool rey_phase_varies(const SceneView *view, int32_t id) {
    bool varies = false;
    for (int k = 0; id >= 0 && k < MAX_PHASE_SLOTS; k++) {
        varies |= rey_texture_holds(view, view->phases[id].slot[k], rey_is_volume);
    }
    for (int k = 0; id >= 0 && k < MAX_PHASE_CHILDREN; k++) {
        varies |= rey_phase_varies(view, view->phases[id].child[k]);
    }
    return varies;
}

static bool volume_live(const SceneView *view, const PathJob *job, int32_t id) {
    return id >= 0 && texture_live(view, job, view->volumes[id].texture);
}

static bool volume_varies(const SceneView *view, int32_t id) { return id >= 0 && view->volumes[id].kind == VOLUME_GRID; }

static int32_t medium_live(const SceneView *view, const PathJob *job, const MediumNode *medium) {
    bool extinction = volume_live(view, job, medium->sigma_t) || volume_live(view, job, medium->sigma_s) ||
                      volume_live(view, job, medium->sigma_a) || texture_live(view, job, medium->scale_texture) ||
                      texture_live(view, job, medium->flakes);
    bool emission = volume_live(view, job, medium->emission), borders = job->volume_at[medium->sigma_t] >= 0;
    // What scatters, where it is told as such, is a part of the extinction (integrator/flight_adj.h).
    bool albedo = volume_live(view, job, medium->albedo), phase = phase_live(view, job, medium->phase);
    if (job->glides || job->rides) { // rays glide over them
        extinction |= volume_varies(view, medium->sigma_t) || medium->flakes >= 0; // which rays that turn see from another side
        albedo |= volume_varies(view, medium->albedo);
        emission |= volume_varies(view, medium->emission);
        borders = true;
        // Mirrors and cameras show collisions from another side.
        phase |= job->any_camera || rey_bsdfs_used(view, rey_bsdf_mirrors) || rey_phase_varies(view, medium->phase);
    }
    return (extinction ? LIVE_EXTINCTION : 0) | (albedo ? LIVE_ALBEDO : 0) | (phase ? LIVE_PHASE : 0) |
           (emission ? LIVE_GLOW : 0) | (medium->bounded && borders ? LIVE_BORDER : 0);
}

// Groups of surfaces of which something selected moves a point or a vertex normal.
static void moving_groups(const SceneView *view, const PathJob *job, int32_t *live) {
    for (int64_t i = 0; i < view->shapes_count; i++) {
        const ShapeRecord *shape = view->shapes + i;
        bool moves = job->points_at[i] >= 0 || job->pose_at[i] >= 0 || job->normals_at[i] >= 0;
        for (int64_t k = 0; k < view->instances_count && (shape->flags & SHAPE_INSTANCED) && !moves; k++) {
            moves = job->instance_at[k] >= 0 && view->instances[k].group == shape->collection;
        }
        live[shape->group] |= moves ? LIVE_MOTION : 0;
    }
}

void rey_live_groups(const SceneView *view, PathJob *job, int32_t *live) {
    const bool points = job->any_places || job->any_motion || job->glides || job->rides;
    const bool sharp = points && job->veils && rey_veils_sharp(view);
    for (int64_t i = 0; i < view->groups_count; i++) {
        const Group *group = view->groups + i;
        // What moves changes the directions from which every surface is lit.
        bool scattering = job->any_normals || job->any_places || job->any_motion || bsdf_live(view, job, group->bsdf);
        const bool uneven = sharp && rey_veil_is_uneven(view, group->bsdf);
        live[i] = (scattering ? LIVE_SCATTERING : 0) | (emitter_live(view, job, group->emitter) ? LIVE_EMISSION : 0) |
                  (uneven ? LIVE_UNEVEN : 0);
        job->veils_turn |= uneven;
    }
    moving_groups(view, job, live);
    for (int64_t i = 0; i < view->media_count && view->has_media; i++) {
        live[view->groups_count + i] = medium_live(view, job, view->media + i);
        job->live_extinctions |= (live[view->groups_count + i] & LIVE_EXTINCTION) != 0;
        job->live_borders |= (live[view->groups_count + i] & LIVE_BORDER) != 0;
    }
    job->live_borders |= job->any_borders || job->glides || job->rides;
    job->live = live;
    job->live_lights |= job->any_motion || job->glides;
    for (int32_t i = 0; i < (int32_t)view->emitters_count; i++) {
        job->live_lights |= emitter_live(view, job, i);
    }
}
