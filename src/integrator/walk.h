// walk.h: shadow rays that surfaces may let through undeviated (holes, absent surfaces, thin glass): the transmittance
// is the product of the pass-through lobes on the way, found surface by surface, and of the media between them.
#pragma once

#include "bsdf/bsdf.h"
#include "integrator/fog.h"


typedef struct Walk {
    int32_t count;
    Vec3 d;
    Hit hit[MOST_SURFACES_IN_A_ROW];
    Mask m[MOST_SURFACES_IN_A_ROW];    // lanes that met a surface that may let light through
    Spec pass[MOST_SURFACES_IN_A_ROW]; // and the share that it lets through
    int32_t segments;                  // with media: the pieces in front of, between and behind the surfaces
    Vec3 o[MOST_SURFACES_IN_A_ROW + 1];
    Float length[MOST_SURFACES_IN_A_ROW + 1];
    Int medium[MOST_SURFACES_IN_A_ROW + 1]; // -1: vacuum, or a surface blocks the way
    Spec clear;                        // what the media let through
} Walk;

// Whether a surface lets light pass of lights that paths meet by chance, which shadow rays do not bring (PathJob.veils): paths that
// go on through it count as chains do.
KFN bool group_is_veil(const Tracer *t, const Group *group) {
    const BsdfNode *bsdf = t->scene->bsdfs + group->bsdf;
    return t->job->veils && bsdf->transmits && !(t->scene->has_media && group_is_null(t->scene, group));
}

// Lanes whose shadow rays end at such surfaces.
KFN Mask veils_end(const Tracer *t, Int light) {
    return t->job->veils ? ~light_is_delta(t->scene, i_max(light, i_set(0))) : m_set(false);
}

// The medium at infinity: that of the sensor, unless it is the inside of some surface and not its outside, too.
static Int medium_beyond(const Tracer *t) {
    int32_t id = t->sensor->medium;
    for (int64_t i = 0; i < t->scene->groups_count; i++) {
        const Group *group = t->scene->groups + i;
        id = group->interior == t->sensor->medium && group->exterior != t->sensor->medium ? -1 : id;
    }
    return i_set(id);
}

static bool surfaces_separate(const SceneView *scene) {
    for (int64_t i = 0; i < scene->groups_count; i++) {
        if (scene->groups[i].interior >= 0 || scene->groups[i].exterior >= 0) {
            return true;
        }
    }
    return false;
}

// The direction from o towards number i of the surfaces that part media.
static Vec3 beacon_direction(const SceneView *scene, int32_t i, Vec3 o) {
    const float *p = scene->beacons[i % scene->beacons_count];
    return v3_normalize(v3_sub(v3(f_set((real)p[0]), f_set((real)p[1]), f_set((real)p[2])), o));
}

// The directions in which rays along d that got away look for such surfaces: not straight back, where there may be an edge, between
// whose faces rays slip through.
static Vec3 medium_other_way(const SceneView *scene, Vec3 o, Vec3 d) {
    if (scene->beacons_count > 0) {
        return beacon_direction(scene, 0, o);
    }
    Frame across = frame_from_normal(d);
    return v3_normalize(v3_madd(v3_neg(d), f_set((real)0.02), v3_madd(across.s, f_set((real)0.37), across.t)));
}

// Those in which they go on from a wall that threw them back, number i of these: towards such surfaces by turns where they lie on
// its side, which `up` points to, else as mirrors would have it.
static Vec3 medium_thrown_back(const SceneView *scene, int32_t i, Vec3 o, Vec3 up, Vec3 mirrored) {
    if (i % 2 || scene->beacons_count == 0) {
        return mirrored;
    }
    Vec3 d = beacon_direction(scene, i / 2, o);
    return v3_select(m_gt(v3_dot(d, up), f_set((real)1e-3)), d, mirrored);
}

// The media around points: a ray along d says so where it meets a surface that has a medium on either side. All others leave light
// in its medium: the ray passes those that let light pass, and is thrown back by those that do not. Where it gets away, it tries
// another way; where it finds no such surface, the medium is the sensor's.
static NOINLINE Int medium_around(const Tracer *t, Vec3 o, Vec3 d, Mask m) {
    const SceneView *scene = t->scene;
    Int medium = i_set(t->sensor->medium);
    Mask left = surfaces_separate(scene) ? m : m_set(false), turned = m_set(false);
    for (int i = 0; i < MOST_SURFACES_IN_A_ROW && m_any(left); i++) {
        Ray ray = {o, d, f_set(INFINITY)};
        Hit hit = trace_media(t, &ray, left, false);
        t->job->rays += m_count(left);
        Mask met = left & mi_lt(i_set(-1), hit.shape), lost = left & ~met & turned;
        medium = m_any(lost) ? i_select(lost, medium_beyond(t), medium) : medium;
        turned = turned | (left & ~met);
        if (m_any(left & ~met)) {
            d = v3_select(left & ~met, medium_other_way(scene, o, d), d);
        }
        left = left & ~lost;
        Int groups = SHAPE_FIELD(scene, i_max(hit.shape, i_set(0)), group);
        for (Mask rest = met, mine; m_any(rest); rest = rest & ~mine) {
            int32_t id = i_lane(groups, m_first(rest));
            const Group *group = scene->groups + id;
            mine = rest & mi_eq(groups, i_set(id));
            Hit safe = walk_hit(&hit, mine);
            Interaction si = shape_interaction(scene, group->shape_kind, group->shape_flags, &safe);
            if (group->interior >= 0 || group->exterior >= 0) {
                medium = i_select(mine, medium_behind(group, si.ng, v3_neg(d), medium), medium);
                left = left & ~mine;
            } else if (scene->bsdfs[group->bsdf].transmits) {
                o = v3_select(mine, interaction_behind(&si, d), o);
            } else {
                Vec3 mirrored = v3_neg(reflect(d, si.ng)), from = interaction_offset(&si, mirrored);
                Vec3 up = v3_scale(si.ng, f_copysign(f_set(1), v3_dot(si.ng, mirrored)));
                d = v3_select(mine, medium_thrown_back(scene, i, from, up, mirrored), d);
                o = v3_select(mine, from, o);
            }
        }
    }
    return medium;
}

// What the surfaces that the lanes of m hit do to light that passes along d, and where the ray goes on behind them. end: lanes that
// end at veils.
// `may` becomes the lanes whose surface could let light through, *medium what they go on in (null: there are no media).
static NOINLINE Spec walk_pass(const Tracer *t, const Hit *hit, Vec3 d, Mask end, Mask m, Vec3 *o, Mask *may, Int *medium) {
    const SceneView *scene = t->scene;
    Int groups = SHAPE_FIELD(scene, i_max(hit->shape, i_set(0)), group);
    Spec pass = spec_zero();
    *may = m_set(false);
    for (Mask left = m; m_any(left);) {
        int32_t id = i_lane(groups, m_first(left));
        Mask mine = left & mi_eq(groups, i_set(id));
        const Group *group = scene->groups + id;
        left = left & ~mine;
        mine = group_is_veil(t, group) ? mine & ~end : mine;
        if (!scene->bsdfs[group->bsdf].transmits || !m_any(mine)) {
            continue;
        }
        Hit safe = walk_hit(hit, mine);
        Interaction si = shape_interaction(scene, group->shape_kind, group->shape_flags, &safe);
        BsdfCall call = bsdf_call(scene, group->bsdf, texcoord(si.uv, &safe), t->floor);
        Vec3 wo = frame_to_local(&si.sh, d);
        pass = spec_select(mine, bsdf_eval(&call, v3_neg(wo), wo, i_set(LOBE_NULL)), pass);
        Vec3 past = medium ? pass_on(t, group, &si, &safe, d, mine, medium) : interaction_offset(&si, d);
        *o = v3_select(mine, past, *o);
        *may = *may | mine;
    }
    return pass;
}

// Shadow rays end a little before their lights; the media do not. By what part of the ray's length.
#define SHADOW_SHORT 9e-4f

// Transmittance of the rays of m. end: those that end at veils; blocked becomes the lanes that no choice of parameters would open;
// walk may be null, and so is fog where there are no media.
static NOINLINE Spec walk_transmittance(Tracer *t, Ray ray, Mask end, Mask m, Fog *fog, Mask *blocked, Walk *walk) {
    Spec transmittance = spec_set(f_zero_unless(m, f_set(1)));
    const Float beyond = ray.tmax * (SHADOW_SHORT / (1.0f - SHADOW_SHORT));
    Float skip = fog ? -fog->lead : f_set(0); // of the medium, by the step off the surface before
    const bool past_lights = fog && fog->past_lights;
    // What lets no light pass is asked first, and need not be met again behind each surface that does.
    const bool apart = t->scene->open_apart && !past_lights && !(fog && t->scene->borders_touch);
    Mask left = apart ? trace_clear(t->scene, &ray, m) : m;
    *blocked = m & ~left;
    transmittance = spec_zero_unless(left, transmittance);
    t->job->rays += apart ? m_count(m) : 0;
    for (int32_t i = 0; m_any(left); i++) {
        Hit hit = apart ? trace_open(t->scene, &ray, left) : trace_media(t, &ray, left, false);
        t->job->rays += apart ? 0 : m_count(left);
        hit = past_lights ? trace_past_emitters(t, ray, left, hit) : hit;
        Vec3 o = ray.o;
        Mask found = left & mi_lt(i_set(-1), hit.shape), may = m_set(false);
        Int medium = fog ? fog->medium : i_set(-1);
        if (!m_any(found) && !fog) {
            break;
        }
        Spec pass = walk_pass(t, &hit, ray.d, end, found, &o, &may, fog ? &fog->medium : NULL);
        may = may & m_set(i < MOST_SURFACES_IN_A_ROW);
        if (walk && i < MOST_SURFACES_IN_A_ROW) {
            walk->hit[i] = hit;
            walk->m[i] = may;
            walk->pass[i] = pass;
            walk->count = i + 1;
        }
        if (fog) {
            Mask open = left & (may | ~found);
            Ray piece = {v3_madd(ray.o, -skip, ray.d), ray.d, ray.tmax};
            Float length = f_max(f_select(found, v3_dot(v3_sub(hit.p, ray.o), ray.d), ray.tmax + beyond) + skip, f_set(0));
            Spec clear = fog_transmittance(t, fog, medium, &piece, length, i, open);
            skip = f_zero_unless(found, v3_dot(v3_sub(o, hit.p), ray.d));
            transmittance = spec_select(open, spec_mul(transmittance, clear), transmittance);
            if (walk && i <= MOST_SURFACES_IN_A_ROW) {
                walk->o[i] = piece.o;
                walk->length[i] = length;
                walk->medium[i] = i_select(open, medium, i_set(-1));
                walk->clear = spec_select(open, spec_mul(walk->clear, clear), walk->clear);
                walk->segments = i + 1;
            }
        }
        *blocked = *blocked | (found & ~may);
        transmittance = spec_select(found, spec_zero_unless(may, spec_mul(transmittance, pass)), transmittance);
        ray.tmax = ray.tmax - v3_dot(v3_sub(o, ray.o), ray.d);
        ray.o = o;
        // A derivative may be non-zero where the product is 0.
        left = t->derivative ? may : may & m_gt(spec_max(transmittance), f_set(0));
    }
    return transmittance;
}
