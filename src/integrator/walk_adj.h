// walk_adj.h: adjoints of what shadow rays pass, surfaces and media, and finding them again.
#pragma once

#include "integrator/flight_adj.h"
#include "integrator/path_move.h"

// Accumulates the adjoint dt of the product of what a walk's surfaces let through.
static NOINLINE void walk_adj(const Tracer *t, const Walk *walk, Spec dt, Sink *sink) {
    const SceneView *scene = t->scene;
    Spec behind[MOST_SURFACES_IN_A_ROW], after = spec_set(f_set(1)), before = after;
    for (int32_t i = walk->count - 1; i >= 0; i--) {
        behind[i] = after;
        after = spec_select(walk->m[i], spec_mul(after, walk->pass[i]), after);
    }
    for (int32_t i = 0; i < walk->count; i++) {
        // T = before pass behind
        Spec dpass = spec_zero_unless(walk->m[i], spec_mul(dt, spec_mul(before, behind[i])));
        Int groups = SHAPE_FIELD(scene, i_max(walk->hit[i].shape, i_set(0)), group);
        before = spec_select(walk->m[i], spec_mul(before, walk->pass[i]), before);
        for (Mask left = walk->m[i]; m_any(left);) {
            int32_t id = i_lane(groups, m_first(left));
            Mask mine = left & mi_eq(groups, i_set(id));
            const Group *group = scene->groups + id;
            left = left & ~mine;
            if (!(t->job->live[id] & LIVE_SCATTERING)) {
                continue;
            }
            Hit hit = walk_hit(&walk->hit[i], mine);
            Interaction si = shape_interaction(scene, group->shape_kind, group->shape_flags, &hit);
            BsdfCall call = {scene, group->bsdf, texcoord(si.uv, &hit), t->floor, NULL, NULL};
            Vec3 wo = frame_to_local(&si.sh, walk->d), dwi = v3_zero(), dwo = v3_zero(), unused = v3_zero();
            Frame dframe = {v3_zero(), v3_zero(), v3_zero()};
            bsdf_adj(&call, v3_neg(wo), wo, i_set(LOBE_NULL), spec_zero_unless(mine, dpass), sink, mine, &dwi, &dwo,
                     NULL);
            if (sink->any_normals && group->shape_kind == SHAPE_MESH) {
                frame_to_local_adj(&si.sh, walk->d, v3_sub(dwo, dwi), &dframe, &unused);
                mesh_interaction_adj(scene, group->shape_flags, &hit, &si, &dframe, sink, mine);
            }
        }
    }
}

// Finds the transmittance of shadow rays again, which start in `medium` at vertices of a bounce.
static NOINLINE Spec walk_again(Tracer *t, const Ray *ray, Int slot, Int medium, int32_t bounce, Mask m, Walk *walk) {
    Mask blocked;
    Fog fog;
    walk->count = walk->segments = 0;
    walk->d = ray->d;
    walk->clear = spec_set(f_set(1));
    if (t->scene->has_media) {
        fog.medium = medium;
        fog.key = stream_key(t, slot, bounce, STREAM_SHADOW);
    }
    return walk_transmittance(t, *ray, m, t->scene->has_media ? &fog : NULL, &blocked, walk);
}

// Accumulates the adjoint dt of a walk's transmittance, whose value is `transmittance`.
static void passage_adj(const Tracer *t, const Walk *walk, Spec transmittance, Spec dt, Int slot, int32_t bounce, Sink *sink) {
    walk_adj(t, walk, spec_mul(dt, walk->clear), sink);
    if (t->job->live_extinctions) {
        SampleKey key = stream_key(t, slot, bounce, STREAM_SHADOW_PROBE);
        fog_adj(t, walk, transmittance, dt, &key, sink);
    }
}

// Whether shadow rays pass surfaces or media whose transmittance depends on the selection.
KFN bool passing_is_live(const Tracer *t) {
    for (int64_t g = 0; g < t->scene->groups_count && t->scene->through; g++) {
        if ((t->job->live[g] & LIVE_SCATTERING) && t->scene->bsdfs[t->scene->groups[g].bsdf].transmits) {
            return true;
        }
    }
    return t->job->live_extinctions;
}
