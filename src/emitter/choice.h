// choice.h: a light per lane. Lanes whose lights belong to one family are handled in one call that gathers their
// numbers; other lights are uniform in kernels, so that each one present in the batch takes its turn.
#pragma once

#include "emitter/emitter.h"

// Chooses an emitter per lane; returns its number and the probability of the choice.
KFN Int emitter_choose(const SceneView *scene, Float u, Float *probability) {
    int32_t n = (int32_t)scene->emitters_count;
    if (scene->uniform_emitters) {
        *probability = f_set(1.0f / (real)n);
        return i_min(i_from_f(u * (real)n), i_set(n - 1));
    }
    Float fraction;
    return cdf_search(scene, i_set(scene->emitter_cdf), n, u, &fraction, probability);
}

// Delta lights cannot be met by scattering, so their samples count whole.
KFN Mask light_is_delta(const SceneView *scene, Int light) {
    if (scene->emitters_count == 1) {
        return m_set(emitter_is_delta(scene->emitters));
    }
    return mi_eq((i_set(EMITTER_DELTA_KINDS) >> EMITTER_FIELD(scene, light, kind)) & 1, i_set(1));
}

// Takes the lanes that can go with the first of `left`; *mine says which.
KFN Light lights_next(const SceneView *scene, Int light, Mask left, Mask *mine) {
    int32_t id = i_lane(light, m_first(left));
    const EmitterRecord *e = scene->emitters + id;
    if (e->family < 0) {
        *mine = left & mi_eq(light, i_set(id));
        return light_alone(e, i_set(id));
    }
    *mine = left & mi_eq(EMITTER_FIELD(scene, light, family), i_set(e->family));
    return (Light){e, i_select(*mine, light, i_set(id)), true};
}

static NOINLINE LightSample family_sample(const SceneView *scene, const Light *l, Vec3 ref, Vec2 u, Spec *radiance) {
    Light many = {l->e, l->id, true};
    LightSample s = emitter_sample_as(scene, &many, ref, u);
    *radiance = emitter_eval_as(scene, &many, texcoord(s.uv, NULL), s.distance);
    return s;
}

static NOINLINE Spec family_eval(const SceneView *scene, const Light *l, Vec2 uv, Float distance) {
    Light many = {l->e, l->id, true};
    return emitter_eval_as(scene, &many, texcoord(uv, NULL), distance);
}

static NOINLINE void family_adj(const SceneView *scene, const Light *l, Vec2 uv, Float distance, Spec dl,
                                LightMove *move, Sink *sink, Mask m) {
    Light many = {l->e, l->id, true};
    emitter_adj_as(scene, &many, texcoord(uv, NULL), distance, dl, move, sink, m);
}

static NOINLINE LightSample single_sample(const SceneView *scene, const EmitterRecord *e, Vec3 ref, Vec2 u,
                                          Spec *radiance) {
    Hit hit;
    LightSample s = emitter_sample(scene, e, ref, u);
    *radiance = emitter_eval(scene, e, emitter_texcoord(scene, e, s.uv, s.prim, &hit), s.distance);
    return s;
}

// Samples each lane's light; *radiance is what arrives from it.
KFN LightSample lights_sample(const SceneView *scene, Int light, Mask m, Vec3 ref, Vec2 u, Spec *radiance) {
    LightSample s = {v3(f_set(0), f_set(0), f_set(1)), f_set(1), f_set(0), {f_set(0), f_set(0)}, i_set(0), m_set(false)};
    *radiance = spec_zero();
    for (Mask left = m, mine; m_any(left); left = left & ~mine) {
        Light l = lights_next(scene, light, left, &mine);
        Spec r;
        LightSample one = l.many ? family_sample(scene, &l, ref, u, &r) : single_sample(scene, l.e, ref, u, &r);
        s.d = v3_select(mine, one.d, s.d);
        s.distance = f_select(mine, one.distance, s.distance);
        s.pdf = f_select(mine, one.pdf, s.pdf);
        s.uv.x = f_select(mine, one.uv.x, s.uv.x);
        s.uv.y = f_select(mine, one.uv.y, s.uv.y);
        s.prim = i_select(mine, one.prim, s.prim);
        s.valid = s.valid | (mine & one.valid);
        *radiance = spec_select(mine, r, *radiance);
    }
    return s;
}

// What arrives from each lane's light sample.
KFN Spec lights_eval(const SceneView *scene, Int light, Mask m, Vec2 uv, Int prim, Float distance) {
    Spec radiance = spec_zero();
    for (Mask left = m, mine; m_any(left); left = left & ~mine) {
        Light l = lights_next(scene, light, left, &mine);
        Hit hit;
        Spec r = l.many ? family_eval(scene, &l, uv, distance)
                        : emitter_eval(scene, l.e, emitter_texcoord(scene, l.e, uv, i_select(mine, prim, i_set(0)), &hit),
                                       distance);
        radiance = spec_select(mine, r, radiance);
    }
    return radiance;
}

KFN void lights_adj(const SceneView *scene, Int light, Mask m, Vec2 uv, Int prim, Float distance, Spec dl,
                    LightMove *move, Sink *sink) {
    for (Mask left = m, mine; m_any(left); left = left & ~mine) {
        Light l = lights_next(scene, light, left, &mine);
        Spec d = spec_zero_unless(mine, dl);
        if (l.many) {
            family_adj(scene, &l, uv, distance, d, move, sink, mine);
        } else {
            Hit hit;
            TexCoord at = emitter_texcoord(scene, l.e, uv, i_select(mine, prim, i_set(0)), &hit);
            emitter_adj_as(scene, &l, at, distance, d, move, sink, mine);
        }
    }
}

// The adjoint of where each lane's light sample lies; that of the reference point is added to move.
static NOINLINE void lights_move_adj(const SceneView *scene, Int light, Mask m, Vec3 ref, Vec3 d, Float distance,
                                     LightMove *move, Sink *sink) {
    for (Mask left = m, mine; m_any(left); left = left & ~mine) {
        Light l = lights_next(scene, light, left, &mine);
        LightMove one = *move;
        one.ref = v3_zero();
        emitter_move_adj_as(scene, &l, ref, d, distance, &one, sink, mine);
        move->ref = v3_select(mine, one.ref, move->ref);
    }
}
