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

// The hit, with a shape of this group also in the lanes that hit another one.
KFN Hit walk_hit(const Hit *hit, Mask mine) {
    int lane = m_first(mine);
    Hit safe = *hit;
    safe.shape = i_select(mine, hit->shape, i_set(i_lane(hit->shape, lane)));
    safe.prim = i_select(mine, hit->prim, i_set(i_lane(hit->prim, lane)));
    safe.instance = i_select(mine, hit->instance, i_set(i_lane(hit->instance, lane)));
    return safe;
}

// The media before and behind surfaces that rays along d, which are in `medium`, meet at a hit.
static NOINLINE void media_beside(const SceneView *scene, const Hit *hit, Vec3 d, Int medium, Mask m, Int *before, Int *behind) {
    Int groups = SHAPE_FIELD(scene, i_select(m, hit->shape, i_set(0)), group);
    *before = *behind = medium;
    for (Mask left = m, mine; m_any(left); left = left & ~mine) {
        int32_t id = i_lane(groups, m_first(left));
        const Group *group = scene->groups + id;
        mine = left & mi_eq(groups, i_set(id));
        Hit safe = walk_hit(hit, mine);
        Vec3 ng = shape_interaction(scene, group->shape_kind, group->shape_flags, &safe).ng;
        *before = i_select(mine, medium_behind(group, ng, v3_neg(d), medium), *before);
        *behind = i_select(mine, medium_behind(group, ng, d, medium), *behind);
    }
}

// The medium behind borders that rays along d pass at a hit, `far` by the hit alone: of two in one place (touch.h), the ray
// crosses first the one whose near side is the medium that it comes from.
static NOINLINE Int medium_touching(const Tracer *t, const Hit *hit, Vec3 d, Int medium, Int far, Mask m) {
    Float step = interaction_step(hit->p);
    Int near, beyond;
    Hit other = trace_beside(t->scene, hit, d, step, step, m);
    m = m & mi_lt(i_set(-1), other.shape);
    media_beside(t->scene, &other, d, medium, m, &near, &beyond);
    // Two boxes of one medium: the ray leaves first the one that it is in.
    Mask second = mi_eq(near, far) & ~(mi_eq(near, medium) & ~mi_eq(beyond, far));
    return i_select(m & second, beyond, far);
}

// The medium that rays of m along d go on in behind a hit that they pass.
KFN Int medium_passed(const Tracer *t, const Group *group, const Interaction *si, const Hit *hit, Vec3 d, Int medium, Mask m) {
    Int far = medium_behind(group, si->ng, d, medium);
    return t->scene->borders_touch && m_any(m) ? medium_touching(t, hit, d, medium, far, m) : far;
}

// Lanes of m whose hits are so near to an edge of a surface that rays may meet another face of it before they have gone a step.
static NOINLINE Mask hits_near_edges(const SceneView *scene, const Group *group, const Hit *hit, Float step, Mask m) {
    enum { SHARPEST = 4 }; // one over the least sine of the angle between two faces
    if (group->shape_kind != SHAPE_MESH || (group->shape_flags & SHAPE_INSTANCED)) {
        return m & m_set(group->shape_kind == SHAPE_MESH || group->shape_kind == SHAPE_DISK || group->shape_kind == SHAPE_CYLINDER);
    }
    Corners c = mesh_corners(scene, hit->shape, hit->prim);
    Int positions = SHAPE_FIELD(scene, hit->shape, positions);
    Vec3 p[3], edge[3];
    for (int k = 0; k < 3; k++) {
        p[k] = theta_v3(scene, positions + c.i[k] * 3);
    }
    Float longest = f_set(0);
    for (int k = 0; k < 3; k++) {
        edge[k] = v3_sub(p[(k + 1) % 3], p[k]);
        longest = f_max(longest, v3_dot(edge[k], edge[k]));
    }
    Float least = f_min(f_min(hit->u, hit->v), 1.0f - hit->u - hit->v);
    return m & ~m_gt(least * v3_length(v3_cross(edge[0], edge[1])), SHARPEST * step * f_sqrt(longest));
}

// Borders that rays of m along d meet less than a step behind a hit that they pass, as next to an edge of a box: they are passed,
// too, and where something else lies there, rays go on half-way to it. *o and *medium: as of one border.
static NOINLINE void pass_close_borders(const Tracer *t, const Hit *hit, Vec3 d, Float step, Mask m, Vec3 *o, Int *medium) {
    enum { MOST_FACES = 4 };
    const SceneView *scene = t->scene;
    Hit from = *hit;
    Float left = step, skip = scene->borders_touch ? 0.02f * step : f_set(0); // two in one place have been parted already
    for (int i = 0; i < MOST_FACES && m_any(m); i++) {
        Hit next = trace_others(scene, &from, (Ray){v3_madd(from.p, skip, d), d, left - skip}, m);
        Mask found = m & mi_lt(i_set(-1), next.shape), nulls = null_lanes(scene, next.shape, found);
        Float way = v3_dot(v3_sub(next.p, from.p), d);
        *o = v3_select(found & ~nulls, v3_madd(from.p, 0.5f * way, d), *o);
        Int before, behind;
        media_beside(scene, &next, d, *medium, nulls, &before, &behind);
        *medium = i_select(nulls, behind, *medium);
        from = hit_select(nulls, &next, &from);
        left = left - f_zero_unless(nulls, way);
        m = nulls & m_gt(left, f_set(0));
    }
}

// Where rays of m along d that pass the surface of a hit go on, and the medium that they do so in. Past borders of media, which may
// touch each other, a ray stays on its line: next to outlines, a step to the side would lengthen what lies within by much more than
// that step, and lengths count. Others, such as thin glass, it leaves as it leaves any surface, so that it meets the back of a body
// next to the body's outline.
static NOINLINE Vec3 pass_on(const Tracer *t, const Group *group, const Interaction *si, const Hit *hit, Vec3 d, Mask m,
                             Int *medium) {
    *medium = i_select(m, medium_passed(t, group, si, hit, d, *medium, m), *medium);
    if (!group_is_null(t->scene, group)) {
        return interaction_offset(si, d);
    }
    Vec3 o = interaction_behind(si, d);
    Float step = interaction_step(si->p);
    m = hits_near_edges(t->scene, group, hit, step, m);
    if (m_any(m)) {
        pass_close_borders(t, hit, d, step, m, &o, medium);
    }
    return o;
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
