// level_view.h: curves g = 0 on the film, g a function of what the sensor sees there, or sees in smooth mirrors and through smooth
// glass: the rims of rough refraction (rim_view.h), and where normals of maps turn away (facing_view.h). They are looked for as
// those of mirrored.h: by halving strips at whose ends g has either sign.
#pragma once

#include "integrator/boundary/mirrored.h"
#include "integrator/boundary/rim_vertex.h"
#include "integrator/boundary/facing.h"

// What a film position sees of it.
typedef struct LevelView {
    Sightline line;
    Int level;   // of its vertices; any, because what reflects or passes may scatter, too
    RimVertex x; // of normals of maps, `lobe` is the map's number
    Float probability;     // of the light and of the lobe or map
    Spec arrives, through; // of the light; of the line
    Ray shadow;
    Rim rim;     // of normals of maps, g alone
    Int sides;   // of maps of lower numbers: a bit each, whether they face what looks at them
} LevelView;

// The vertices in surfaces of a group.
static void rim_view_group(Tracer *t, const BoundaryJob *b, int32_t group, const Hit *hit, Float u, bool whole, Mask m,
                           LevelView *v) {
    Sink still = sink_of(b->still);
    SurfaceSweep s;
    const Vec2 anywhere = {f_set(0), f_set(0)};
    looked_surface(t, group, hit, m, &s);
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

// The vertices on surfaces of a group, each of which is asked for one of the maps there.
static void facing_view_group(const Tracer *t, const BoundaryJob *b, int32_t group, const Hit *hit, Float u, Mask m, LevelView *v) {
    Sink still = sink_of(b->still);
    SurfaceSweep s;
    const int32_t bsdf = t->scene->groups[group].bsdf, count = map_count(t->scene, bsdf);
    looked_surface(t, group, hit, m, &s);
    Vec3 wi = frame_to_local(&s.si.sh, v3_neg(v->x.d));
    Int number = i_min(i_from_f(u * (real)count), i_set(count - 1));
    for (int32_t k = 0; k < count; k++) {
        Vec3 n = v3_zero();
        facing_adj(&s.call, map_find(t->scene, bsdf, k), wi, f_set(1), &still, m, &n, NULL);
        Float g = v3_dot(n, wi);
        Mask mine = m & mi_eq(number, i_set(k)), later = m & mi_lt(i_set(k), number) & m_gt(g, f_set(0));
        v->rim.g = f_select(mine, g, v->rim.g);
        v->rim.m = v->rim.m | (mine & m_gt(v3_dot(n, n), f_set(0)));
        v->sides = v->sides | i_select(later, i_set(1 << (k & 31)), i_set(0));
    }
    v->x.lobe = i_select(m, number, v->x.lobe);
    v->probability = f_select(m, v->probability * f_set(1 / (real)(count > 0 ? count : 1)), v->probability);
}

// The light of rims; false where there is none.
static Mask level_light(const Tracer *t, Mask m, LevelView *v) {
    const Vec2 zero = {f_set(0), f_set(0)};
    LightSample l = lights_sample(t->scene, v->x.light, m, v->x.hit.p, zero, &v->arrives);
    v->x.light_d = l.d;
    v->x.light_distance = l.distance;
    return m & l.valid & m_gt(spec_max(v->arrives), f_set(0));
}

// whole: with its value and the way to the light.
static NOINLINE void level_look(Tracer *t, const BoundaryJob *b, Int slot, Float x, Float y, bool whole, Mask m, LevelView *v) {
    const SceneView *scene = t->scene;
    SampleKey key = sightline_key(t, slot), own = slot_key(t, slot);
    const bool turned = b->kind == BOUNDARY_FACING_VIEW;
    Ends end;
    v->sides = i_set(0);
    v->probability = f_set(1);
    v->rim = (Rim){spec_zero(), f_set(0), f_set(0), m_set(false)};
    v->x.lobe = i_set(LOBE_SMOOTH);
    v->level = i_set(0);
    v->shadow = (Ray){v3_zero(), v3(f_set(0), f_set(0), f_set(1)), f_set(0)};
    m = turned ? m : m & rim_light(scene, &own, &v->x.light, &v->probability);
    sightline_trace(t, &key, sample_lens(t, &own), x, y, m, &v->line);
    if (!m_any(m)) {
        return;
    }
    Float levels = f_from_i(v->line.turns + 1);
    v->level = i_min(i_from_f(rng_1d(&own, DIMENSION_SEGMENT_END) * levels), v->line.turns);
    v->probability = v->probability / levels;
    ends_load(&v->line, v->level, 0, &end);
    v->x.hit = end.hit[0];
    v->x.d = end.d[0];
    v->through = v->line.through[0];
    Int before = i_set(0);
    for (int32_t i = 1; i < v->line.last; i++) {
        v->through = spec_select(mi_eq(v->level, i_set(i)), v->line.through[i], v->through);
        before = i_select(mi_eq(v->level, i_set(i)), v->line.depth[i], before);
    }
    m = m & mi_lt(i_set(-1), v->x.hit.shape) & depth_allows(scene, before + 2);
    m = turned ? m : level_light(t, m, v);
    Float u = rng_1d(&own, DIMENSION_TURNING_SIDE);
    for (Mask left = m; m_any(left);) {
        int32_t id;
        Hit h;
        Mask mine = take_group(scene, &v->x.hit, &left, &id, &h);
        if (turned) {
            facing_view_group(t, b, id, &h, u, mine, v);
        } else if (t->job->live[id] & LIVE_SCATTERING) {
            rim_view_group(t, b, id, &h, u, whole, mine, v);
        }
    }
}

// Lanes in which g has either sign at the ends of a strip, of one lobe or map.
KFN Mask level_between(const LevelView *a, const LevelView *b) {
    return a->rim.m & b->rim.m & mi_eq(a->x.hit.shape, b->x.hit.shape) & mi_eq(a->x.hit.instance, b->x.hit.instance) &
           mi_eq(a->x.lobe, b->x.lobe) & m_lt(a->rim.g * b->rim.g, f_set(0));
}

// What halving needs of its ends.
typedef struct LevelEnds {
    Float g[2];
    Mask m;
} LevelEnds;

static LevelEnds level_strip(Tracer *t, const BoundaryJob *b, Int slot, const Strip *s, Mask m, LevelView v[2]) {
    for (int k = 0; k < 2; k++) {
        level_look(t, b, slot, s->x[k], s->y[k], false, m, v + k);
    }
    return (LevelEnds){{v[0].rim.g, v[1].rim.g}, m & level_between(v, v + 1)};
}

// Halves strips until their ends lie next to g = 0, of surfaces that are smooth there; returns the lanes in which they do.
static NOINLINE Mask level_narrow(Tracer *t, const BoundaryJob *b, Int slot, real end, Strip *s, Mask m) {
    LevelView v[2], middle;
    LevelEnds e = level_strip(t, b, slot, s, m, v);
    for (;;) {
        Mask open = e.m & m_gt(s->length, f_set(end));
        if (!m_any(open)) {
            break;
        }
        Float x = 0.5f * (s->x[0] + s->x[1]), y = 0.5f * (s->y[0] + s->y[1]);
        level_look(t, b, slot, x, y, false, open, &middle);
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
    // Between two facets g jumps. Where normals of several maps turn away at once, the first one counts.
    e = level_strip(t, b, slot, s, e.m, v);
    Mask alike = mi_eq(v[0].x.hit.prim, v[1].x.hit.prim) & mi_eq(v[0].level, v[1].level) & mi_eq(v[0].sides, v[1].sides);
    return e.m & alike;
}

// What the derivative of s g at a film position, times `worth`, asks of the ray from the sensor.
static Carried level_view_adj(const Tracer *t, const BoundaryJob *b, const LevelView *v, Float worth, Sink *sink, Mask m) {
    Carried c = b->kind == BOUNDARY_FACING_VIEW
                    ? facing_vertex_adj(t, &v->x.hit, v->x.d, v->x.lobe, f_set(0), true, worth, sink, m)
                    : rim_vertex_adj(t, &v->x, f_set(0), true, worth * v->rim.scale, sink, m);
    return sightline_back(t, &v->line, v->level, v->x.hit.p, &c, sink, m);
}

// How fast it grows over the film there: its gradient.
static NOINLINE Vec2 level_slope(const Tracer *t, const BoundaryJob *b, const LevelView *v, Vec2 lens, Float x, Float y, Mask m) {
    Sink still = sink_of(b->still);
    still.any_motion = true; // so that all that slides counts
    Carried carried = level_view_adj(t, b, v, f_set(1), &still, m);
    return film_adj(t, x, y, lens, v->line.hit[0].p, &carried);
}

// A place of a curve.
typedef struct LevelPlace {
    LevelView view;
    Float x, y, nx, ny, slope; // on the film, with the normal towards where g grows, and how fast it does
} LevelPlace;

// What there is at a film position between the ends of a narrow strip; false where no curve is.
static Mask level_place(Tracer *t, const BoundaryJob *b, const Strips *all, Int slot, Float x, Float y, bool whole, Mask m,
                        LevelPlace *at) {
    SampleKey own = slot_key(t, slot);
    at->x = x;
    at->y = y;
    level_look(t, b, slot, x, y, whole, m, &at->view);
    m = m & at->view.rim.m & strips_inside(all, x, y);
    Vec2 g = level_slope(t, b, &at->view, sample_lens(t, &own), x, y, m);
    at->slope = f_sqrt(g.x * g.x + g.y * g.y);
    Float rcp = f_safe_rcp(at->slope);
    at->nx = g.x * rcp;
    at->ny = g.y * rcp;
    // Where a surface hides another part of itself g jumps, too.
    Mask meets = m_le(f_abs(at->view.rim.g), f_set(1e-5f) + at->slope * f_set(8 * all->end));
    return m & meets & m_gt(at->slope, f_set(0)) & m_finite(at->slope);
}

// How many strips across a curve it takes until one finds it, 0 where none does, as curve_again.
static Float level_again(Tracer *t, const BoundaryJob *b, const Strips *all, Int slot, const LevelPlace *at, Mask m) {
    SampleKey own = slot_key(t, slot);
    Float count = f_set(0);
    Mask left = m;
    for (int32_t n = 0; n < MOST_AGAIN && m_any(left); n++) {
        Strip s = strip_across(all, &own, n, at->x, at->y, at->nx, at->ny);
        Mask found = level_narrow(t, b, slot, all->end, &s, left);
        Float dx = 0.5f * (s.x[0] + s.x[1]) - at->x, dy = 0.5f * (s.y[0] + s.y[1]) - at->y;
        Mask again = left & found & m_lt(dx * dx + dy * dy, f_set(400 * all->end * all->end));
        count = f_select(again, f_set((real)(n + 1)), count);
        left = left & ~again;
    }
    return count;
}

// Adds the derivative of g at a film position, times `worth`.
static void level_book(const Tracer *t, const BoundaryJob *b, Int slot, const LevelView *v, Float x, Float y, Float worth,
                       Sink *sink, Mask m) {
    SampleKey own = slot_key(t, slot);
    Carried carried = level_view_adj(t, b, v, f_zero_unless(m, worth), sink, m);
    if (sink->any_camera) {
        RayAdj ray = {v->line.hit[0].p, carried.drag, carried.turn};
        sensor_ray_adj(t->scene, t->sensor, x, y, sample_lens(t, &own), &ray, sink, m);
    }
}

// As strips_find: those at whose ends g has either sign.
static int32_t level_strips_find(Tracer *t, const BoundaryJob *b, const Strips *all, int64_t first, int32_t count, int32_t *kept) {
    int32_t kept_count = 0;
    for (int32_t i = 0; i < count; i += LANES) {
        LevelView v[2];
        batch_numbers(t, i, first);
        SampleKey own = slot_key(t, i_iota() + i);
        Strip s = strip_sample(all, &own);
        Mask m = level_strip(t, b, i_iota() + i, &s, m_first_n(count - i), v).m;
        i_compress(kept + kept_count, i_iota() + i, m);
        kept_count += m_count(m);
    }
    return kept_count;
}
