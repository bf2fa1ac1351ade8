// glossy.h: what takes the noise out of the interior term where surfaces scatter into narrow lobes, as polished metal and rough
// glass do. With both ends of a segment attached, its derivative holds the slope of g = f |cos| across the lobe times how fast it
// turns: the narrower the lobe, the larger, though all that happens is that the lobe moves over what it shows. Now for every smooth
// field v(w) of directions and every psi(w) that is 0 around a part of one side of the surface,
//   integral div(psi g v) dw = 0,
// so that any number which does not depend on w, times that, may be subtracted. Here v(w) = u - w (w . u), whose divergence is
// -2 w . u, with
//   u = (velocity of b - velocity of x) / |b - x| - dw0,
// b what is seen from x along the lobe's middle w0, and dw0 how this turns with the direction that light leaves in and with the
// normal: the segment turns by the former, the lobe by the latter, and to first order in its width the slope of g is worth no more
// than their difference. The number is an estimate L0 of the light that comes along w0, by a path with the random numbers of that
// which goes on along w: L - L0 is what the light differs over the lobe. psi = (1 - rho^2)^2, rho^2 = (1 - w . w0) / (1 - w1 . w0),
// w1 the nearest direction at which g may jump: the horizon, and the cone at which rough refraction ends (bsdf/rim.h).
// Nothing is subtracted where a lobe shows nothing, or what neither moves nor is seen from what does, or a mirror or glass that
// shows the rest along a fixed direction; and little is won where it shows an edge of what is bright.
#pragma once

#include "integrator/corner.h"

// The least density in the middle of lobes that this is worth another path [1/sr].
#define NARROW 20.0f

// The least of that times 1 - w1 . w0: of a Gaussian lobe (r / width)^2 / 4 pi, r the angle to w1.
#define INSIDE 1.0f

// Of vertices: the middle of the lobe, in the shading frame and the world.
typedef struct Glossy {
    Mask m, refracts;
    Vec3 local, d;
    Float k, cos_t; // refracted: of the tangential parts of wi, and |local.z|
    Float reach;    // 1 - w1 . w0
} Glossy;

// Refracts as what is rough there, about its mean normal.
static void glossy_refract(const SurfaceSweep *s, Glossy *g) {
    const RoughDielectric p = roughdielectric_fetch(&s->call);
    Float eta = roughdielectric_eta(&p), c = f_abs(s->wi.z), e = f_select(m_gt(s->wi.z, f_set(0)), eta, 1.0f / eta);
    g->k = 1.0f / e;
    Float square = 1.0f - g->k * g->k * (1.0f - c * c);
    g->m = g->m & (~g->refracts | m_gt(square, f_set(1e-4f)));
    g->cos_t = f_sqrt(f_max(square, f_set(1e-4f)));
    // The horizon, and of GGX the cone at the height c / e; w0 is at the height cos_t above the surface.
    Float end = c * g->k, sine = f_safe_sqrt(1.0f - g->cos_t * g->cos_t);
    Float across = end * g->cos_t + f_safe_sqrt(1.0f - end * end) * sine;
    Mask ends = m_lt(end, f_set(1)) & m_set(roughdielectric_facets(&p).ggx);
    Float nearest = f_max(sine, f_select(ends, across, f_set(-1)));
    Vec3 local = v3(-g->k * s->wi.x, -g->k * s->wi.y, -f_sign(s->wi.z) * g->cos_t);
    g->local = v3_select(g->refracts, local, g->local);
    g->reach = f_select(g->refracts, 1.0f - nearest, g->reach);
}

// Of the lanes of m, those whose path goes on in a narrow lobe.
static NOINLINE Glossy glossy_find(const Tracer *t, const SurfaceSweep *s, Mask m) {
    const BsdfNode *node = t->scene->bsdfs + s->group->bsdf;
    Glossy g = {.m = m_set(false), .refracts = m_set(false), .k = f_set(0), .cos_t = f_set(1)};
    if (!node->glossy || node->turns || node->surface) {
        return g;
    }
    g.m = m & s->scattered & mi_eq(s->lobe, i_set(LOBE_SMOOTH)) & m_gt(f_abs(s->wi.z), f_set(1e-2f));
    g.refracts = g.m & m_lt(s->wo.z * s->wi.z, f_set(0));
    g.local = v3(-s->wi.x, -s->wi.y, s->wi.z);
    g.reach = 1.0f - f_safe_sqrt(1.0f - s->wi.z * s->wi.z);
    if (node->kind == BSDF_ROUGHDIELECTRIC) {
        glossy_refract(s, &g);
    } else {
        g.m = g.m & ~g.refracts;
        g.refracts = m_set(false);
    }
    g.d = frame_to_world(&s->si.sh, g.local);
    return g;
}

// ---- the light in the middle of lobes ----------------------------------------------------------------------------

// Whether vertices of a batch move, or what they are seen from does, which `moved` says of their slots.
static Mask glossy_moves(const Tracer *t, const RecordBatch *batch, int32_t *moved) {
    const Records *r = &t->ws.records;
    Mask m = m_first_n(batch->count);
    Int slot = i_select(m, i_load(r->slot + batch->first), i_set(0));
    Mask slides = records_slide(t, batch->first) & m_set(t->job->any_camera || batch->bounce > 0);
    Mask moves = m_set(t->job->live[batch->group] & LIVE_MOTION) | slides;
    Mask before = batch->bounce > 0 ? mi_eq(i_gather(moved, slot), i_set(1)) : m_set(false);
    i_scatter(moved, slot, i_select(moves, i_set(1), i_set(0)), m);
    return moves | before;
}

// Of the rays of m that met hit, those whose points may matter: they move, or are seen from what does, and scatter, so that light's
// path goes on from them.
static Mask glance_matters(const Tracer *t, const Hit *hit, Mask moves, Mask m) {
    m = m & mi_lt(i_set(-1), hit->shape);
    Int group = SHAPE_FIELD(t->scene, i_select(m, hit->shape, i_set(0)), group);
    moves = moves | mi_lt(i_set(0), i_gather(t->job->live, group) & LIVE_MOTION);
    return m & moves & mi_eq(BSDF_FIELD(t->scene, GROUP_FIELD(t->scene, group, bsdf), spreads), i_set(1));
}

// Starts paths n... at what the vertices of a batch see along the middles of their narrow lobes, which their records note; returns
// the number of paths.
static int32_t glossy_push(Tracer *t, const RecordBatch *batch, int32_t n) {
    const Records *r = &t->ws.records;
    const int32_t at = batch->first;
    i_store(r->glance_shape + at, i_set(-1));
    Mask moves = glossy_moves(t, batch, t->ws.next_light), m = m_first_n(batch->count);
    if (batch->ends || !t->scene->bsdfs[t->scene->groups[batch->group].bsdf].glossy) {
        return 0;
    }
    SurfaceSweep s;
    surface_load(t, batch, i_select(m, i_load(r->slot + at), i_set(0)), spec_zero(), &s);
    // Whether a vertex has a corner must not depend on w, as does whether that passes through the corner's lens.
    Glossy g = glossy_find(t, &s, t->job->corner_at ? m & ~corner_near(t, batch).m : m);
    if (!m_any(g.m)) {
        return 0;
    }
    Float density = bsdf_pdf(&s.call, s.wi, g.local, i_set(LOBE_SMOOTH));
    m = g.m & m_gt(density, f_set(NARROW)) & m_gt(density * g.reach, f_set(INSIDE));
    if (!m_any(m)) {
        return 0;
    }
    Ray ray = {interaction_offset(&s.si, g.d), g.d, f_set(INFINITY)};
    Hit hit = trace_media(t, &ray, m, false);
    t->job->rays += m_count(m);
    m = glance_matters(t, &hit, moves, m);
    i_store(r->glance_shape + at, i_select(m, hit.shape, i_set(-1)));
    i_store(r->glance_prim + at, hit.prim);
    i_store(r->glance_instance + at, hit.instance);
    f_store(r->glance_distance + at, v3_length(v3_sub(hit.p, ray.o)));
    hit.shape = i_select(m, hit.shape, i_set(0));
    // Lights are weighted there as along w, so that what light samples bring is not subtracted.
    return side_push(t, at, ray.o, g.d, &hit, density, m, n);
}

// ---- what is subtracted ------------------------------------------------------------------------------------------

// Those of the recorded vertices of a batch.
static Glossy glossy_load(const Tracer *t, const SurfaceSweep *s) {
    Mask m = s->m & mi_lt(i_set(-1), i_load(t->ws.records.glance_shape + s->at));
    return m_any(m) ? glossy_find(t, s, m) : (Glossy){.m = m_set(false)};
}

// What a record has noted.
static Hit glance_hit(const Tracer *t, int32_t at, Vec3 from, Vec3 d, Mask m, Vec3 *n) {
    const Records *r = &t->ws.records;
    Vec3 p = v3_madd(from, f_load(r->glance_distance + at), d);
    return point_hit(t->scene, i_select(m, i_load(r->glance_shape + at), i_set(-1)), i_load(r->glance_prim + at),
                     i_load(r->glance_instance + at), p, n);
}

// Adds the adjoint a of the middle of the lobes to those of the direction and the frame that it follows from.
static void glossy_middle_adj(const SurfaceSweep *s, const Glossy *g, Vec3 a, VertexAdj *v) {
    frame_to_world_adj(g->local, a, &v->frame);
    Vec3 local = frame_to_local(&s->si.sh, a);
    // local.z = -sign(wi.z) sqrt(1 - k^2 (wi.x^2 + wi.y^2)) where it is refracted
    Float rise = local.z * f_sign(s->wi.z) * g->k * g->k / g->cos_t;
    Vec3 refracted = v3(rise * s->wi.x - g->k * local.x, rise * s->wi.y - g->k * local.y, f_set(0));
    v3_acc(&v->wi, v3_select(g->refracts, refracted, v3(-local.x, -local.y, local.z)));
}

// For one delta.
static NOINLINE void glossy_move_adj(const Tracer *t, const SurfaceSweep *s, Spec weight, VertexAdj *v, Sink *sink) {
    const Glossy *g = s->glossy;
    Spec l0 = spec_zero_unless(g->m, spec_load(t->ws.records.side, s->at)), worth = spec_mul(weight, l0);
    Float c = spec_dot(worth, spec_load(t->ws.records.weight, s->at));
    Vec3 unused = v3_zero(), local = v3_zero(), w = s->wo_d, normal;
    double nothing = 0;
    Sink still = still_sink(t->job, &nothing);
    bsdf_adj(&s->call, s->wi, s->wo, s->lobe, spec_scale(worth, s->scatter_weight), &still, g->m, &unused, &local, NULL);
    Float rho2 = (1.0f - v3_dot(w, g->d)) * f_safe_rcp(g->reach), inside = f_max(1.0f - rho2, f_set(0));
    Float psi = inside * inside, slope = 2.0f * inside * f_safe_rcp(g->reach);
    // psi grad g + g grad psi - 2 psi g w, the gradients across w
    Vec3 a = v3_madd(v3_scale(frame_to_world(&s->si.sh, local), psi), c * slope, g->d);
    a = v3_madd(a, -v3_dot(w, a) - 2.0f * psi * c, w);
    Mask m = g->m & m_gt(inside, f_set(0)) & m_finite(v3_dot(a, a));
    a = v3_select(m, a, v3_zero());
    Hit hit = glance_hit(t, s->at, interaction_offset(&s->si, g->d), g->d, g->m, &normal);
    Vec3 dr = v3_scale(a, f_safe_rcp(v3_length(v3_sub(hit.p, s->si.p))));
    dr = v3_select(m, dr, v3_zero());
    v3_acc(&v->p, dr);
    points_move_adj(t, &hit, v3_neg(dr), v3_zero(), sink, m);
    glossy_middle_adj(s, g, a, v);
}
