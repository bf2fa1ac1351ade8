// rim_vertex.h: vertices of rough refraction whose light is that of a point or of one direction. Where such refraction ends
// (bsdf/rim.h) the value, f = f_+ H(s g), jumps with a direction to the light that is given. With all of the two directions fixed,
//   dI += integral f_+ delta(g) s g' L W
// over the points of such surfaces and the directions to what looks at them. The adjoints of both directions, f_+ s / e and
// -f_+ s times a normal (rim_adj), tell f_+, e and that normal of whatever functions are nested within each other.
#pragma once

#include "integrator/boundary/segments.h"
#include "integrator/exchange.h"

// A light of a point or one direction per lane, and its probability. False where the light chosen is of another sort.
KFN Mask rim_light(const SceneView *scene, const SampleKey *key, Int *light, Float *probability) {
    *light = emitter_choose(scene, rng_1d(key, DIMENSION_SEGMENT_LIGHT), probability);
    return light_is_delta(scene, *light);
}

// The surfaces of a group. s must stay where it is.
static void rim_surface(const Tracer *t, int32_t group, const Hit *hit, Mask m, SurfaceSweep *s) {
    s->group = t->scene->groups + group;
    s->hit = *hit;
    s->m = m;
    s->si = shape_interaction(t->scene, s->group->shape_kind, s->group->shape_flags, hit);
    s->call = bsdf_call(t->scene, s->group->bsdf, texcoord(s->si.uv, NULL), t->floor);
    s->call.rim = RIM_ALWAYS;
    surface_parameterise(t, s);
}

typedef struct Rim {
    Spec value;  // f_+
    Float scale; // of an adjoint of the value whose product with it is s g': e over the sum of f_+
    Float g;
    Mask m;      // whether there is one
} Rim;

// The rim that a lobe belongs to, whether the directions lie on it or not, without its value.
static NOINLINE Rim rim_measure(const SurfaceSweep *s, const Exchange *x, Sink *still, Mask m) {
    Rim r = {.value = spec_zero()};
    Vec3 dview = v3_zero(), dlight = v3_zero();
    bsdf_adj(&s->call, x->view, x->light, x->lobe, spec_set(f_set(1)), still, m, &dview, &dlight, NULL);
    Float viewed = v3_length(dview), sum = v3_length(dlight), e = sum * f_safe_rcp(viewed), rcp = f_safe_rcp(sum);
    Float a = v3_dot(dlight, x->view) * rcp, b = v3_dot(dlight, x->light) * rcp;
    r.scale = e * rcp;
    r.g = f_abs(a) - e * f_abs(b);
    r.m = m & m_gt(viewed, f_set(0)) & m_finite(r.scale) & m_lt(a * b, f_set(0));
    return r;
}

// Its value.
static Spec rim_colour(const SurfaceSweep *s, const Exchange *x, Sink *still, Mask m) {
    Spec value = spec_zero();
    for (int c = 0; c < SPEC_N; c++) {
        Spec one = spec_zero();
        Vec3 dview = v3_zero(), dlight = v3_zero();
        one.c[c] = f_set(1);
        bsdf_adj(&s->call, x->view, x->light, x->lobe, one, still, m, &dview, &dlight, NULL);
        value.c[c] = v3_length(dlight);
    }
    return value;
}

// The derivative of s g at the vertices of segments k... by the parameters of their functions and by vertex normals, worth `worth`.
static NOINLINE void rims_move_adj(const Tracer *t, const Segments *q, int32_t k, Float worth, Sink *sink, Mask m) {
    Hit x = LOAD_HIT(q, k, edge);
    Vec3 view = v3_neg(record_v3(q->dx, q->dy, q->dz, k)), light = record_v3(q->nx, q->ny, q->nz, k);
    Spec df = spec_set(worth * f_load(q->behind + k));
    for (Mask left = m; m_any(left);) {
        int32_t id;
        Hit h;
        SurfaceSweep s;
        Mask mine = take_group(t->scene, &x, &left, &id, &h);
        rim_surface(t, id, &h, mine, &s);
        Exchange e = {frame_to_local(&s.si.sh, view), frame_to_local(&s.si.sh, light), view, light, i_load(q->rim + k), mine};
        exchange_adj(t, &s, &e, df, sink);
    }
}

// Keeps vertices of m, which something looks at along the ray out of the surface, and what of the light goes there.
static void rim_keep(Segments *q, const Hit *x, const Ray *ray, Vec3 light, const Rim *r, Int lobe, Spec l, Int number, Mask m) {
    int32_t at = q->count;
    v3_compress(q->ox + at, q->oy + at, q->oz + at, ray->o, m);
    v3_compress(q->dx + at, q->dy + at, q->dz + at, v3_neg(ray->d), m);
    v3_compress(q->nx + at, q->ny + at, q->nz + at, light, m);
    f_compress(q->behind + at, r->scale, m);
    f_compress(q->seen + at, f_set(0), m);
    f_compress(q->unseen + at, f_set(0), m);
    spec_compress(q->light, at, l, m);
    i_compress(q->lit + at, i_set(1), m);
    i_compress(q->rim + at, lobe, m);
    i_compress(q->source + at, i_set(-1), m);
    i_compress(q->number + at, number, m);
    KEEP_HIT(q, at, near, x, x->p, m);
    KEEP_HIT(q, at, edge, x, x->p, m);
    KEEP_HIT(q, at, far, x, x->p, m);
    q->count += m_count(m);
}
