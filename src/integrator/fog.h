// fog.h: the media between the surfaces. A path's medium changes at surfaces that name one on either side; other surfaces
// stand in whatever is around them.
#pragma once

#include "integrator/stages.h"
#include "medium/track.h"

// Streams of random numbers for walks that take any number of them: one for each kind of walk and bounce.
enum { STREAM_FLIGHT, STREAM_SHADOW, STREAM_EMISSION, STREAM_PROBE, STREAM_SHADOW_PROBE, STREAMS };

KFN SampleKey stream_key(const Tracer *t, Int slot, int32_t bounce, uint32_t stream) {
    SampleKey key = slot_key(t, slot);
    key.scramble = rng_mix(rng_mix(key.scramble, 0x6d656469u), (uint32_t)bounce * STREAMS + stream);
    return key;
}

// Whether a surface is of the kind null, which with media is a border of theirs that rays pass.
KFN bool group_is_null(const SceneView *scene, const Group *group) { return node_is_null(scene->bsdfs + group->bsdf); }

// The medium that a ray along d enters behind a surface with normal ng, or stays in.
KFN Int medium_behind(const Group *group, Vec3 ng, Vec3 d, Int medium) {
    if (group->interior < 0 && group->exterior < 0) {
        return medium;
    }
    return i_select(m_gt(v3_dot(ng, d), f_set(0)), i_set(group->exterior), i_set(group->interior));
}

// Counts borders of media that rays along d met, and those of them that name another medium than `medium`, which the rays came
// through, on that side: where surfaces do not agree about what lies between them, or media overlap, the medium at a point depends
// on the way there. Faces that lie in others are not asked: medium_touching knows them.
KFN void borders_watch(const Tracer *t, const Group *group, Vec3 ng, Vec3 d, Int medium, Mask m) {
    if ((group->interior >= 0 || group->exterior >= 0) && !t->scene->borders_touch) {
        t->job->borders += m_count(m);
        t->job->astray += m_count(m & ~mi_eq(medium_behind(group, ng, v3_neg(d), medium), medium));
    }
}

// The medium behind borders that rays along d pass at a hit, `far` by the hit alone: of two in one place (touch.h), the ray
// crosses first the one whose near side is the medium that it comes from.
static NOINLINE Int medium_touching(const Tracer *t, const Hit *hit, Vec3 d, Int medium, Int far, Mask m) {
    const SceneView *scene = t->scene;
    Float step = interaction_step(hit->p);
    Hit other = trace_beside(scene, hit, d, step, step, m);
    Int groups = SHAPE_FIELD(scene, i_max(other.shape, i_set(0)), group), out = far;
    for (Mask left = m & mi_lt(i_set(-1), other.shape), mine; m_any(left); left = left & ~mine) {
        int32_t id = i_lane(groups, m_first(left));
        const Group *group = scene->groups + id;
        mine = left & mi_eq(groups, i_set(id));
        if (group->interior < 0 && group->exterior < 0) {
            continue;
        }
        Hit safe = other;
        int32_t shape = i_lane(other.shape, m_first(mine));
        safe.shape = i_select(mine, other.shape, i_set(shape));
        safe.prim = i_select(mine, other.prim, i_set(i_lane(other.prim, m_first(mine))));
        safe.instance = i_select(mine, other.instance, i_set(i_lane(other.instance, m_first(mine))));
        Vec3 ng = shape_interaction(scene, group->shape_kind, group->shape_flags, &safe).ng;
        Int near = medium_behind(group, ng, v3_neg(d), medium), beyond = medium_behind(group, ng, d, medium);
        // Two boxes of one medium: the ray leaves first the one that it is in.
        Mask second = mi_eq(near, far) & ~(mi_eq(near, medium) & ~mi_eq(beyond, far));
        out = i_select(mine & second, beyond, out);
    }
    return out;
}

// The medium that rays of m along d go on in behind a hit that they pass.
KFN Int medium_passed(const Tracer *t, const Group *group, const Interaction *si, const Hit *hit, Vec3 d, Int medium, Mask m) {
    Int far = medium_behind(group, si->ng, d, medium);
    return t->scene->borders_touch && m_any(m) ? medium_touching(t, hit, d, medium, far, m) : far;
}

KFN Track track_of(const Tracer *t, int32_t medium) {
    const MediumNode *node = t->scene->media + medium;
    Track track = {t->deciding, t->scene, node, t->scene->volumes + node->sigma_t, t->job->moved != NULL, !t->job->moved,
                   t->focus, t->focus != NULL};
    for (int32_t i = t->lamp_count; i > 0 && !t->focus; i--) { // they are in the order of their media
        if (t->lamp_medium[i - 1] == medium) {
            track.focus = t->lamps + i - 1;
            track.foci++;
        }
    }
    return track;
}

// What a shadow ray needs to know of media.
typedef struct Fog {
    Int medium; // that it is in
    SampleKey key;
    bool past_lights; // that hide from the sensor, from which the ray comes
    Float lead;       // behind the ray's origin, where the media that count begin
} Fog;

// Transmittance of a segment of shadow rays number `segment`, each in a medium of its own.
static NOINLINE Spec fog_transmittance(const Tracer *t, const Fog *fog, Int medium, const Ray *ray, Float length,
                                       int32_t segment, Mask m) {
    Spec transmittance = spec_set(f_set(1));
    for (Mask left = m & mi_lt(i_set(-1), medium), mine; m_any(left); left = left & ~mine) {
        int32_t id = i_lane(medium, m_first(left));
        Track track = track_of(t, id);
        mine = left & mi_eq(medium, i_set(id));
        Spec one = track_transmittance(&track, ray->o, ray->d, length, mine, &fog->key, (uint32_t)segment * MOST_COLLISIONS);
        transmittance = spec_select(mine, one, transmittance);
    }
    return transmittance;
}
