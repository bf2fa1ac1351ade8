// rim_view.h: the rims of rough refraction in the light of a point or of one direction (rim_vertex.h), as the sensor sees them, or
// sees them in smooth mirrors and through smooth glass. There they are curves g = 0 on the film,
//   dI += integral dl f_+ s g' L / |grad g|,
// which are looked for as those of mirrored.h: by halving strips at whose ends g has either sign.
#pragma once

#include "integrator/boundary/mirrored.h"
#include "integrator/boundary/rim_vertex.h"

// What a film position sees of the rim.
typedef struct RimView {
    Sightline line;
    Int level;   // of its vertices; any, because what reflects or passes may scatter, too
    RimVertex x;
    Float probability;     // of the light and of the lobe
    Spec arrives, through; // of the light; of the line
    Ray shadow;
    Rim rim;
} RimView;

// The vertices in surfaces of a group.
static void rim_view_group(Tracer *t, const BoundaryJob *b, int32_t group, const Hit *hit, Float u, bool whole, Mask m,
                           RimView *v) {
    Sink still = sink_of(b->still);
    SurfaceSweep s;
    const Vec2 anywhere = {f_set(0), f_set(0)};
    rim_surface(t, group, hit, m, &s);
    Vec3 wi = frame_to_local(&s.si.sh, v3_neg(v->x.d));
    BsdfSample sample = bsdf_sample(&s.call, wi, u, anywhere);
    m = m & lobe_is(sample.lobe, LOBE_RIM);
    if (!m_any(m)) {
        return;
    }
    Float pdf = bsdf_pdf(&s.call, wi, sample.wo, sample.lobe) * TWO_PI;
    RimVertex x = v->x;
    x.lobe = sample.lobe;
    Rim r = rim_measure(&s, &x, &still, m & m_gt(pdf, f_set(0)));
    if (whole) {
        Ray shadow;
        shadow_ray(&s.si, v->x.light_d, v->x.light_distance, &shadow);
        v->shadow.o = v3_select(m, shadow.o, v->shadow.o);
        v->shadow.d = v3_select(m, shadow.d, v->shadow.d);
        v->shadow.tmax = f_select(m, shadow.tmax, v->shadow.tmax);
        v->rim.value = spec_select(m, rim_colour(&s, &x, &still, r.m), v->rim.value);
    }
    v->probability = f_select(m, v->probability * pdf, v->probability);
    v->x.lobe = i_select(m, sample.lobe, v->x.lobe);
    v->rim.scale = f_select(m, r.scale, v->rim.scale);
    v->rim.g = f_select(m, r.g, v->rim.g);
    v->rim.m = v->rim.m | (r.m & m_ne(r.g, f_set(0)));
}

// whole: with its value and the way to the light.
static NOINLINE void rim_look(Tracer *t, const BoundaryJob *b, Int slot, Float x, Float y, bool whole, Mask m, RimView *v) {
    const SceneView *scene = t->scene;
    SampleKey key = sightline_key(t, slot), own = slot_key(t, slot);
    const Vec2 zero = {f_set(0), f_set(0)};
    Ends end;
    v->rim = (Rim){spec_zero(), f_set(0), f_set(0), m_set(false)};
    v->x.lobe = i_set(LOBE_SMOOTH);
    v->level = i_set(0);
    v->shadow = (Ray){v3_zero(), v3(f_set(0), f_set(0), f_set(1)), f_set(0)};
    m = m & rim_light(scene, &own, &v->x.light, &v->probability);
    sightline_trace(t, &key, sightline_lens(t, &own), x, y, m, &v->line);
    if (!m_any(m)) {
        return;
    }
    const int32_t depth = scene->max_depth;
    Float levels = f_from_i(v->line.turns + 1);
    v->level = i_min(i_from_f(rng_1d(&own, DIMENSION_SEGMENT_END) * levels), v->line.turns);
    v->probability = v->probability / levels;
    ends_load(&v->line, v->level, 0, &end);
    v->x.hit = end.hit[0];
    v->x.d = end.d[0];
    v->through = v->line.through[0];
    for (int32_t i = 1; i < v->line.last; i++) {
        v->through = spec_select(mi_eq(v->level, i_set(i)), v->line.through[i], v->through);
    }
    m = m & mi_lt(i_set(-1), v->x.hit.shape) & (m_set(depth < 0) | mi_lt(v->level + 1, i_set(depth)));
    LightSample l = lights_sample(scene, v->x.light, m, v->x.hit.p, zero, &v->arrives);
    v->x.light_d = l.d;
    v->x.light_distance = l.distance;
    m = m & l.valid & m_gt(spec_max(v->arrives), f_set(0));
    Float u = rng_1d(&own, DIMENSION_TURNING_SIDE);
    for (Mask left = m; m_any(left);) {
        int32_t id;
        Hit h;
        Mask mine = take_group(scene, &v->x.hit, &left, &id, &h);
        if (t->job->live[id] & LIVE_SCATTERING) {
            rim_view_group(t, b, id, &h, u, whole, mine, v);
        }
    }
}

// Lanes in which g has either sign at the ends of a strip, on rims of one light.
KFN Mask rim_between(const RimView *a, const RimView *b) {
    return a->rim.m & b->rim.m & mi_eq(a->x.hit.shape, b->x.hit.shape) & mi_eq(a->x.hit.instance, b->x.hit.instance) &
           mi_eq(a->x.lobe, b->x.lobe) & m_lt(a->rim.g * b->rim.g, f_set(0));
}

// What halving needs of its ends.
typedef struct RimEnds {
    Float g[2];
    Mask m;
} RimEnds;

static RimEnds rim_strip(Tracer *t, const BoundaryJob *b, Int slot, const Strip *s, Mask m, RimView v[2]) {
    for (int k = 0; k < 2; k++) {
        rim_look(t, b, slot, s->x[k], s->y[k], false, m, v + k);
    }
    return (RimEnds){{v[0].rim.g, v[1].rim.g}, m & rim_between(v, v + 1)};
}

// Halves strips until their ends lie next to g = 0, of surfaces that are smooth there; returns the lanes in which they do.
static NOINLINE Mask rim_narrow(Tracer *t, const BoundaryJob *b, Int slot, real end, Strip *s, Mask m) {
    RimView v[2], middle;
    RimEnds e = rim_strip(t, b, slot, s, m, v);
    for (;;) {
        Mask open = e.m & m_gt(s->length, f_set(end));
        if (!m_any(open)) {
            break;
        }
        Float x = 0.5f * (s->x[0] + s->x[1]), y = 0.5f * (s->y[0] + s->y[1]);
        rim_look(t, b, slot, x, y, false, open, &middle);
        Mask first = open & m_lt(e.g[0] * middle.rim.g, f_set(0)), second = open & ~first;
        e.m = e.m & (middle.rim.m | ~open);
        s->x[1] = f_select(first, x, s->x[1]);
        s->y[1] = f_select(first, y, s->y[1]);
        e.g[1] = f_select(first, middle.rim.g, e.g[1]);
        s->x[0] = f_select(second, x, s->x[0]);
        s->y[0] = f_select(second, y, s->y[0]);
        e.g[0] = f_select(second, middle.rim.g, e.g[0]);
        s->length = f_select(open, 0.5f * s->length, s->length);
    }
    // Between two facets g jumps, and there is no rim.
    e = rim_strip(t, b, slot, s, e.m, v);
    Mask alike = mi_eq(v[0].x.hit.prim, v[1].x.hit.prim) & mi_eq(v[0].level, v[1].level);
    return e.m & alike;
}

// What the derivative of s g at a film position, times `worth`, asks of the ray from the sensor.
static Carried rim_view_adj(const Tracer *t, const RimView *v, Float worth, Sink *sink, Mask m) {
    Carried c = rim_vertex_adj(t, &v->x, f_set(0), true, worth * v->rim.scale, sink, m);
    return sightline_back(t, &v->line, v->level, v->x.hit.p, &c, sink, m);
}

// How fast it grows over the film there: its gradient.
static NOINLINE Vec2 rim_slope(const Tracer *t, const BoundaryJob *b, const RimView *v, Vec2 lens, Float x, Float y, Mask m) {
    Sink still = sink_of(b->still);
    still.any_motion = true; // so that all that slides counts
    Carried carried = rim_view_adj(t, v, f_set(1), &still, m);
    return film_adj(t, x, y, lens, v->line.hit[0].p, &carried);
}

// How many strips across a curve it takes until one finds it, 0 where none does, as curve_again.
static Float rim_again(Tracer *t, const BoundaryJob *b, const Strips *all, Int slot, Float x, Float y, Float nx, Float ny, Mask m) {
    SampleKey own = slot_key(t, slot);
    Float count = f_set(0);
    Mask left = m;
    for (int32_t n = 0; n < MOST_AGAIN && m_any(left); n++) {
        Strip s = strip_across(all, &own, n, x, y, nx, ny);
        Mask found = rim_narrow(t, b, slot, all->end, &s, left);
        Float dx = 0.5f * (s.x[0] + s.x[1]) - x, dy = 0.5f * (s.y[0] + s.y[1]) - y;
        Mask again = left & found & m_lt(dx * dx + dy * dy, f_set(400 * all->end * all->end));
        count = f_select(again, f_set((real)(n + 1)), count);
        left = left & ~again;
    }
    return count;
}

// As strips_find: those at whose ends g has either sign.
static int32_t rim_strips_find(Tracer *t, const BoundaryJob *b, const Strips *all, int64_t first, int32_t count, int32_t *kept) {
    int32_t kept_count = 0;
    for (int32_t i = 0; i < count; i += LANES) {
        RimView v[2];
        batch_numbers(t, i, first);
        SampleKey own = slot_key(t, i_iota() + i);
        Strip s = strip_sample(all, &own);
        Mask m = rim_strip(t, b, i_iota() + i, &s, m_first_n(count - i), v).m;
        i_compress(kept + kept_count, i_iota() + i, m);
        kept_count += m_count(m);
    }
    return kept_count;
}

// Keeps the places that those strips find: where on the film, in ws, and in q the strip's number and what the derivative of g there
// is worth.
static void rim_views_find(Tracer *t, const BoundaryJob *b, const Strips *all, int64_t first, const int32_t *kept, int32_t count,
                           Segments *q) {
    q->count = 0;
    for (int32_t i = 0; i < count; i += LANES) {
        strips_number(t, first, kept, i, count);
        Int slot = i_iota() + i;
        SampleKey own = slot_key(t, slot);
        Strip s = strip_sample(all, &own);
        Mask m = rim_narrow(t, b, slot, all->end, &s, m_first_n(count - i));
        if (!m_any(m)) {
            continue;
        }
        RimView v;
        Vec2 lens = sightline_lens(t, &own);
        Float x = 0.5f * (s.x[0] + s.x[1]), y = 0.5f * (s.y[0] + s.y[1]);
        rim_look(t, b, slot, x, y, true, m, &v);
        m = m & v.rim.m & strips_inside(all, x, y);
        t->job->rays += m_count(m);
        m = m & m_gt(spec_max(trace_transmittance(t->scene, &v.shadow, m)), f_set(0));
        if (!m_any(m)) {
            continue;
        }
        Vec2 g = rim_slope(t, b, &v, lens, x, y, m);
        Float slope = f_sqrt(g.x * g.x + g.y * g.y), rcp = f_safe_rcp(slope);
        // Where a surface hides another part of itself g jumps, too.
        Mask meets = m_le(f_abs(v.rim.g), f_set(1e-5f) + slope * f_set(8 * all->end));
        m = m & meets & m_gt(slope, f_set(0)) & m_finite(slope);
        Float weight = rim_again(t, b, all, slot, x, y, g.x * rcp, g.y * rcp, m) * rcp * f_set(1 / all->density);
        Spec l = spec_mul(spec_mul(v.through, v.arrives), v.rim.value);
        l = spec_scale(l, weight * f_safe_rcp(v.probability));
        m = m & m_gt(weight, f_set(0)) & m_finite(spec_sum(l)) & m_gt(spec_max(l), f_set(0));
        f_compress(t->ws.film_x + q->count, x, m);
        f_compress(t->ws.film_y + q->count, y, m);
        spec_compress(q->light, q->count, l, m);
        i_compress(q->number + q->count, i_load(kept + i), m);
        q->count += m_count(m);
    }
}

// Books them. Reverse: the film's adjoint lies in ws.adjoint.
static void rim_views_finish(Tracer *t, const BoundaryJob *b, int64_t first, const Segments *q, Sink *sink) {
    for (int32_t k = 0; k < q->count; k += LANES) {
        Mask m = m_first_n(q->count - k);
        Int slot = i_iota() + k;
        Float x = f_load(t->ws.film_x + k), y = f_load(t->ws.film_y + k);
        RimView v;
        strips_number(t, first, q->number, k, q->count);
        SampleKey own = slot_key(t, slot);
        rim_look(t, b, slot, x, y, false, m, &v);
        Spec l = spec_load(q->light, k);
        bool forward = b->job.mode == MODE_FORWARD;
        Float worth = forward ? f_set(1) : spec_dot(l, spec_load(t->ws.adjoint, k));
        m = m & v.rim.m & m_finite(worth);
        Carried carried = rim_view_adj(t, &v, f_zero_unless(m, worth), sink, m);
        if (sink->any_camera) {
            RayAdj ray = {v.line.hit[0].p, carried.drag, carried.turn};
            sensor_ray_adj(t->scene, t->sensor, x, y, sightline_lens(t, &own), &ray, sink, m);
        }
        if (forward) {
            spec_store(t->ws.radiance, k, spec_zero_unless(m, spec_scale(l, sink->derivative)));
            sink->derivative = f_set(0);
        }
    }
}
