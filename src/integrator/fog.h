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

// The medium that a ray along d enters behind a surface with normal ng, or stays in.
KFN Int medium_behind(const Group *group, Vec3 ng, Vec3 d, Int medium) {
    if (group->interior < 0 && group->exterior < 0) {
        return medium;
    }
    return i_select(m_gt(v3_dot(ng, d), f_set(0)), i_set(group->exterior), i_set(group->interior));
}

KFN Track track_of(const Tracer *t, int32_t medium) {
    const MediumNode *node = t->scene->media + medium;
    return (Track){t->deciding, t->scene, node, t->scene->volumes + node->sigma_t, t->job->moved != NULL, !t->job->moved,
                   t->focus};
}

// What a shadow ray needs to know of media.
typedef struct Fog {
    Int medium; // that it is in
    SampleKey key;
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
