// rim_vertex.h: vertices of rough refraction whose light is that of a point or of one direction. Where such refraction ends
// (bsdf/rim.h) the value, f = f_+ H(s g), jumps with a direction to the light that is given. With all of the two directions fixed,
//   dI += integral f_+ delta(g) s g' L W
// over the points of such surfaces and the directions to what looks at them. The adjoints of both directions, f_+ s / e and
// -f_+ s times a normal (rim_adj), tell f_+, e and that normal of whatever functions are nested within each other. g' is that of
// attached points, or, along chains and from a film position, of where the ray meets the surface (turning.h).
#pragma once

#include "integrator/boundary/looked.h"
#include "integrator/boundary/segments.h"

// A vertex that a ray meets, the light that shines on it, and the lobe.
typedef struct RimVertex {
    Hit hit;
    Vec3 d, light_d; // of the ray; towards the light
    Float light_distance;
    Int light, lobe;
} RimVertex;

// A light of a point or one direction per lane, and its probability. False where the light chosen is of another sort.
KFN Mask rim_light(const SceneView *scene, const SampleKey *key, Int *light, Float *probability) {
    *light = emitter_choose(scene, rng_1d(key, DIMENSION_SEGMENT_LIGHT), probability);
    return light_is_delta(scene, *light);
}

// What surfaces and media let through along shadow rays of m from such vertices.
static Spec rim_lit(Tracer *t, const Ray *shadow, Int slot, Mask m) {
    const bool media = t->scene->has_media;
    if (!t->scene->through) {
        t->job->rays += m_count(m);
        return trace_transmittance(t->scene, shadow, m);
    }
    Mask blocked;
    Fog fog = {.past_lights = false};
    if (media) {
        fog.medium = medium_around(t, shadow->o, shadow->d, m);
        fog.key = stream_key(t, slot, 0, STREAM_SHADOW);
    }
    return walk_transmittance(t, *shadow, m_set(false), m, media ? &fog : NULL, &blocked, NULL);
}

typedef struct Rim {
    Spec value;  // f_+
    Float scale; // of an adjoint of the value whose product with it is s g': e over the sum of f_+
    Float g;
    Mask m;      // whether there is one
} Rim;

// The rim that a lobe belongs to, whether the directions lie on it or not, without its value.
static NOINLINE Rim rim_measure(const SurfaceSweep *s, const RimVertex *x, Sink *still, Mask m) {
    Rim r = {.value = spec_zero()};
    Vec3 view = frame_to_local(&s->si.sh, v3_neg(x->d)), light = frame_to_local(&s->si.sh, x->light_d);
    Vec3 dview = v3_zero(), dlight = v3_zero();
    bsdf_adj(&s->call, view, light, x->lobe, spec_set(f_set(1)), still, m, &dview, &dlight, NULL);
    Float viewed = v3_length(dview), sum = v3_length(dlight), e = sum * f_safe_rcp(viewed), rcp = f_safe_rcp(sum);
    Float a = v3_dot(dlight, view) * rcp, b = v3_dot(dlight, light) * rcp;
    r.scale = e * rcp;
    r.g = f_abs(a) - e * f_abs(b);
    r.m = m & m_gt(viewed, f_set(0)) & m_finite(r.scale) & m_lt(a * b, f_set(0));
    return r;
}

// Its value.
static Spec rim_colour(const SurfaceSweep *s, const RimVertex *x, Sink *still, Mask m) {
    Vec3 view = frame_to_local(&s->si.sh, v3_neg(x->d)), light = frame_to_local(&s->si.sh, x->light_d);
    Spec value = spec_zero();
    for (int c = 0; c < SPEC_N; c++) {
        Spec one = spec_zero();
        Vec3 dview = v3_zero(), dlight = v3_zero();
        one.c[c] = f_set(1);
        bsdf_adj(&s->call, view, light, x->lobe, one, still, m, &dview, &dlight, NULL);
        value.c[c] = v3_length(dlight);
    }
    return value;
}

// The derivative of s g, times `worth`: adds that of the functions, the surfaces and the lights. slides: where the rays meet the
// surfaces; else of attached points, at 1 / behind from what looks at them. Returns what that asks of the rays: of the position
// there and of the direction, or of the position of what looks.
static NOINLINE Carried rim_vertex_adj(const Tracer *t, const RimVertex *x, Float behind, bool slides, Float worth, Sink *sink,
                                       Mask m) {
    Carried all = {v3_zero(), v3_zero()};
    for (Mask left = m; m_any(left);) {
        Looked at;
        looked_take(t, &x->hit, x->d, slides, &left, &at, sink);
        const SurfaceSweep *s = &at.s;
        Vec3 light = frame_to_local(&s->si.sh, x->light_d), dlight = v3_zero();
        bsdf_adj(&s->call, s->wi, light, x->lobe, spec_zero_unless(s->m, spec_set(worth)), sink, s->m, &at.d.wi, &dlight,
                 vertex_uv_adj(s, &at.d, sink));
        looked_over(sink);
        LightMove move = light_move_zero();
        frame_to_local_adj(&s->si.sh, x->light_d, dlight, &at.d.frame, &move.d);
        lights_move_adj(t->scene, x->light, s->m, s->hit.p, x->light_d, x->light_distance, &move, sink);
        looked_finish(t, &at, v3_select(s->m, move.ref, v3_zero()), behind, sink, &all);
    }
    return all;
}

// Of the segments k....
static Carried rims_ahead_adj(const Tracer *t, const Segments *q, int32_t k, bool slides, Float worth, Sink *sink, Mask m) {
    RimVertex x = {LOAD_HIT(q, k, edge), record_v3(q->dx, q->dy, q->dz, k), record_v3(q->nx, q->ny, q->nz, k), f_load(q->mx + k),
                   i_load(q->source + k), i_load(q->rim + k)};
    return rim_vertex_adj(t, &x, f_load(q->behind + k), slides, worth * f_load(q->along + k), sink, m);
}

// Keeps vertices of m, at which something looks along the rays, and what of the light goes there. near: what looks.
static void rims_keep(Segments *q, const RimVertex *x, const Rim *r, Vec3 o, const Hit *near, Spec l, Int number, Mask m) {
    int32_t at = q->count;
    v3_compress(q->ox + at, q->oy + at, q->oz + at, o, m);
    v3_compress(q->dx + at, q->dy + at, q->dz + at, x->d, m);
    v3_compress(q->nx + at, q->ny + at, q->nz + at, x->light_d, m);
    f_compress(q->mx + at, x->light_distance, m);
    f_compress(q->behind + at, f_safe_rcp(v3_length(v3_sub(near->p, x->hit.p))), m);
    f_compress(q->along + at, r->scale, m);
    f_compress(q->seen + at, f_set(0), m);
    f_compress(q->unseen + at, f_set(0), m);
    spec_compress(q->light, at, l, m);
    i_compress(q->lit + at, i_set(1), m);
    i_compress(q->rim + at, x->lobe, m);
    i_compress(q->source + at, x->light, m);
    i_compress(q->number + at, number, m);
    KEEP_HIT(q, at, near, near, near->p, m);
    KEEP_HIT(q, at, edge, &x->hit, x->hit.p, m);
    KEEP_HIT(q, at, far, &x->hit, x->hit.p, m);
    q->count += m_count(m);
}
