// facing.h: the normals n of the maps within a function, and on which side of them a viewer is: the sign of n . wi, at which the
// value jumps (turned.h). Maps are numbered as they are met from the outside; those within other maps are left out.
#pragma once

#include "bsdf/bsdf.h"

KFN bool is_map(const SceneView *scene, int32_t node) {
    const int32_t kind = scene->bsdfs[node].kind;
    return kind == BSDF_NORMALMAP || kind == BSDF_BUMPMAP;
}

// The map of number *left at or below a node, -1 where there are fewer, and *left what remains of the number.
static int32_t map_below(const SceneView *scene, int32_t node, int32_t *left) {
    if (node >= 0 && is_map(scene, node)) {
        return (*left)-- == 0 ? node : -1;
    }
    int32_t found = -1;
    for (int k = 0; node >= 0 && k < MAX_CHILDREN && found < 0; k++) {
        found = map_below(scene, scene->bsdfs[node].child[k], left);
    }
    return found;
}

static int32_t map_find(const SceneView *scene, int32_t bsdf, int32_t number) { return map_below(scene, bsdf, &number); }

static int32_t map_count(const SceneView *scene, int32_t bsdf) {
    int32_t left = INT32_MAX;
    map_below(scene, bsdf, &left);
    return INT32_MAX - left;
}

// The child in which a map lies, of lanes that see the front or the back of the surface; -1: none of them see it.
static int32_t map_side(const BsdfCall *call, int32_t map, bool back) {
    const SceneView *scene = call->scene;
    const BsdfNode *node = scene->bsdfs + call->node;
    for (int k = 0; k < MAX_CHILDREN; k++) {
        const bool sees = node->kind != BSDF_TWOSIDED || node->child[1] < 0 || k == (back ? 1 : 0);
        for (int32_t i = 0, found = 0; node->child[k] >= 0 && sees && found >= 0; i++) {
            found = map_find(scene, node->child[k], i);
            if (found == map) {
                return k;
            }
        }
    }
    return -1;
}

// Adds df times the slope of n . wi to *dwi, to the sink and to *duv, in the lanes of m that see the map. With df = 1, *dwi becomes
// n.
static NOINLINE void facing_adj(const BsdfCall *call, int32_t map, Vec3 wi, Float df, Sink *sink, Mask m, Vec3 *dwi,
                                Vec2 *duv) {
    if (call->node == map) {
        df = f_zero_unless(m, df);
        if (call->scene->bsdfs[map].kind == BSDF_NORMALMAP) {
            NormalMap p = normalmap_fetch(call), dp = {0};
            p.flip_invalid_normals = 0;
            *dwi = v3_madd(*dwi, df, normalmap_normal(&p, wi));
            normalmap_normal_adj(&p, wi, v3_scale(wi, df), &dp);
            normalmap_scatter(call, dp, sink, m, duv);
        } else {
            BumpMap p = bumpmap_fetch(call), dp = {0};
            p.flip_invalid_normals = 0;
            *dwi = v3_madd(*dwi, df, bumpmap_normal(call, &p, wi));
            bumpmap_normal_adj(call, &p, wi, v3_scale(wi, df), &dp);
            bumpmap_scatter(call, dp, sink, m, duv);
        }
        return;
    }
    const bool flips = call->scene->bsdfs[call->node].kind == BSDF_TWOSIDED;
    const Mask behind = m_lt(wi.z, f_set(0));
    for (int back = 0; back < (flips ? 2 : 1); back++) {
        const int32_t child = map_side(call, map, back);
        Mask mine = flips ? m & (back ? behind : ~behind) : m;
        if (child < 0 || !m_any(mine)) {
            continue;
        }
        BsdfCall inner = bsdf_child(call, child);
        Vec3 d = v3_zero();
        facing_adj(&inner, map, back ? v3_flip_z(mine, wi) : wi, df, sink, mine, &d, duv);
        *dwi = v3_add(*dwi, v3_select(mine, back ? v3_flip_z(mine, d) : d, v3_zero()));
    }
}
