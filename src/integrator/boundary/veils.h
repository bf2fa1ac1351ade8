// veils.h: masks and thin glass before lights that no path meets by chance: shadow rays to those pass them (PathJob.veils), and so
// do the segments that end there. Both sides of an edge may be lit, so that these segments bring the difference; and what they
// begin at may be behind such surfaces, which rays pass or not with an even chance.
#pragma once

#include "integrator/boundary/view.h"

#define DIMENSION_VEIL_PASS 0x80000300u

// What rays meet that pass such surfaces or end there, with an even chance, where `ray` then begins. *chance: 1 over the
// probability of this; *pass: what those let through.
static Hit veils_meet(Tracer *t, Ray *ray, const SampleKey *key, Float *chance, Spec *pass, Mask m) {
    const SceneView *scene = t->scene;
    Hit met = HIT_NONE;
    *chance = f_set(1);
    *pass = spec_set(f_set(1));
    for (uint32_t i = 0; i < MOST_SURFACES_IN_A_ROW && m_any(m); i++) {
        t->job->rays += scene->has_media ? 0 : m_count(m);
        Hit hit = scene->has_media ? trace_solid(t, ray, false, m, NULL) : trace_closest(scene, ray, m, false);
        met = hit_select(m, &hit, &met);
        Mask opens = m & mi_lt(i_set(-1), hit.shape) & m_set(scene->through), may;
        Vec3 past = ray->o;
        Spec one = walk_pass(t, &hit, ray->d, m_set(false), opens, &past, &may, NULL);
        opens = may & m_gt(spec_max(one), f_set(0));
        *chance = f_select(opens, *chance * 2.0f, *chance);
        m = opens & m_lt(rng_1d(key, DIMENSION_VEIL_PASS + i), f_set(0.5f));
        *pass = spec_select(m, spec_mul(*pass, one), *pass);
        ray->o = v3_select(m, v3_madd(hit.p, interaction_step(hit.p), ray->d), ray->o);
    }
    return met;
}

// Jumps have either sign.
KFN Float jump_size(Spec l) { return f_max(spec_max(l), spec_max(spec_scale(l, f_set(-1)))); }

// What of a light comes along a ray that begins `lead` before an edge, in the medium `around`, which counts from there on.
static Spec veils_past(Tracer *t, Ray ray, Float lead, Int around, Int number, Mask m) {
    Fog fog = {around, stream_key(t, number, 0, STREAM_SHADOW), false, lead};
    Mask blocked;
    return walk_transmittance(t, ray, m_set(false), m, t->scene->has_media ? &fog : NULL, &blocked, NULL);
}
