// mirrored.h: the boundary term of what the sensor sees in smooth mirrors and through smooth glass. As for what it sees
// itself, the picture jumps along curves of the film that move, but they are not known beforehand: an edge may be seen along
// many chains, or none. They are looked for on the film: short strips of random length, place and direction, at whose ends
// the lines of sight (sightline.h) part, are halved until a place where they do so behind their first vertices is known.
// Strips of length r cross a curve dl times with the probability 2 r dl / (pi area). A strip may cross several curves, or one
// twice, and finds one at most: the probability that a strip across a place finds it is estimated by repeating that, which is
// one over it on average. How fast the curve moves follows from what the lines meet there (crossing.h).
// What lies behind the first vertex that scatters is for other terms (reach.h).
#pragma once

#include "integrator/boundary/crossing.h"
#include "integrator/film.h"

#define DIMENSION_STRIP_PLACE 0x80000010u
#define DIMENSION_STRIP_TURN 0x80000011u
#define DIMENSION_STRIP_AGAIN 0x80001000u

// Of two paths beside a curve along which surfaces meet, the largest distance [pixels].
#define WIDEST_MEETING ((real)0.05)

// Lengths of strips: LONGEST_STRIP pixels, and halves of that.
enum { STRIP_LENGTHS = 7, LONGEST_STRIP = 8, MOST_AGAIN = 512 };

typedef struct Strips {
    real x, y, width, height; // the part of the film that counts
    real end;                 // length at which halving ends [pixels]
    real length[STRIP_LENGTHS], reached[STRIP_LENGTHS]; // cumulative probabilities of those that cross a place
    real density;             // strips that cross a curve, per pixel of it
} Strips;

static Strips strips_of(const Tracer *t) {
    const PathJob *job = t->job;
    Strips s = {.x = (real)job->x, .y = (real)job->y, .width = (real)job->width, .height = (real)job->height};
    s.end = film_resolution(t->sensor);
    double sum = 0;
    for (int k = 0; k < STRIP_LENGTHS; k++) {
        s.length[k] = (real)ldexp(LONGEST_STRIP, -k);
        sum += (double)(s.length[k] / ((s.width + s.length[k]) * (s.height + s.length[k])));
        s.reached[k] = (real)sum;
    }
    for (int k = 0; k < STRIP_LENGTHS; k++) {
        s.reached[k] = s.reached[k] / (real)sum;
    }
    s.density = (real)(sum / STRIP_LENGTHS * 2 / 3.14159265358979323846);
    return s;
}

// A strip per lane, from its first end to the second one.
typedef struct Strip {
    Float x[2], y[2], length;
} Strip;

static Strip strip_around(Float x, Float y, Float dx, Float dy, Float length, Float before) {
    Strip s = {{x - before * dx, x + (length - before) * dx}, {y - before * dy, y + (length - before) * dy}, length};
    return s;
}

static Strip strip_sample(const Strips *all, const SampleKey *key) {
    Vec2 place = rng_2d(key, DIMENSION_STRIP_PLACE), turn = rng_2d(key, DIMENSION_STRIP_TURN);
    Float which = f_min(f_floor(turn.y * (real)STRIP_LENGTHS), f_set(STRIP_LENGTHS - 1)), sine, cosine, length = f_set(0);
    for (int k = 0; k < STRIP_LENGTHS; k++) {
        length = f_select(m_eq(which, f_set((real)k)), f_set(all->length[k]), length);
    }
    f_sincos(TWO_PI * turn.x, &sine, &cosine);
    Float x = all->x - 0.5f * length + place.x * (all->width + length);
    Float y = all->y - 0.5f * length + place.y * (all->height + length);
    return strip_around(x, y, cosine, sine, length, 0.5f * length);
}

// A strip that crosses a place where the curve's normal is known, as they do.
static Strip strip_across(const Strips *all, const SampleKey *key, int32_t again, Float x, Float y, Float nx, Float ny) {
    uint32_t first = DIMENSION_STRIP_AGAIN + 2 * (uint32_t)again;
    Vec2 u = rng_2d(key, first), v = rng_2d(key, first + 1);
    Float length = f_set(all->length[0]), sine = 2.0f * v.x - 1.0f, cosine = f_safe_sqrt(1.0f - sine * sine);
    for (int k = 1; k < STRIP_LENGTHS; k++) {
        length = f_select(m_ge(u.x, f_set(all->reached[k - 1])), f_set(all->length[k]), length);
    }
    Float way = f_select(m_lt(u.y, f_set((real)0.5)), f_set(1), f_set(-1));
    return strip_around(x, y, way * (cosine * nx - sine * ny), way * (cosine * ny + sine * nx), length, v.y * length);
}

enum { LINES_ALIKE = -1 };

// The first vertex at which two lines of sight part because they meet different surfaces there, or different fields of one's
// textures, or one on both sides of a border of light. 0: it is what the sensor sees itself, or they take different lobes, where
// nothing jumps on average, but thin bands may lie beside, as where glass refracts rays into itself shortly before all of the light
// is mirrored. LINES_ALIKE: none of these.
static Int lines_part(const Tracer *t, const BoundaryJob *job, const Sightline *a, const Sightline *b, Mask m) {
    Int level = i_set(LINES_ALIKE);
    for (int32_t i = 0; i < a->last && i < b->last; i++) {
        Mask same = lines_share(t->scene, a->hit + i, b->hit + i, m) & mi_eq(a->behind[i], b->behind[i]);
        Vec2 unused;
        Int step;
        Mask met = m & same & mi_lt(i_set(-1), a->hit[i].shape);
        same = same & ~fields_part(t->scene, job, a->hit[i].shape, a->uv[i], b->uv[i], met, &unused, &step);
        if (job->beam_count > 0) {
            BeamBorder border;
            met = lanes_that(node_spreads, t->scene, a->hit[i].shape, met); // others do not show it
            same = same & ~beams_part(t->scene, job, a->hit[i].p, b->hit[i].p, met, &border);
        }
        level = i_select(m & ~same, i_set(i), level);
        Mask alike = mi_eq(a->lobe[i], b->lobe[i]);
        level = i_select(m & same & ~alike, i_set(0), level);
        m = m & same & alike & lobe_follows(a->lobe[i]);
    }
    return level;
}

// Lanes of m whose lines meet something that moves up to where they part.
static Mask lines_move(const Tracer *t, const BoundaryJob *b, const Sightline lines[2], Int level, Mask m) {
    if (b->everywhere) {
        return m;
    }
    Mask moves = m_set(false);
    for (int32_t i = 0; i < 2 * (MOST_SIGHT + 1); i++) {
        const Sightline *line = lines + i / (MOST_SIGHT + 1);
        int32_t k = i % (MOST_SIGHT + 1);
        Mask on = k < line->last ? m & ~mi_lt(level, i_set(k)) & mi_lt(i_set(-1), line->hit[k].shape) : m_set(false);
        if (m_any(on)) {
            Int group = SHAPE_FIELD(t->scene, i_select(on, line->hit[k].shape, i_set(0)), group);
            moves = moves | (on & mi_eq(i_gather(t->job->live, group) & LIVE_MOTION, i_set(LIVE_MOTION)));
        }
    }
    return moves;
}

static void strip_look(Tracer *t, const SampleKey *key, Vec2 lens, const Strip *s, int end, Mask m, Sightline *line) {
    sightline_trace(t, key, lens, s->x[end], s->y[end], m, line);
}

// Where a strip's ends part, as far as something moves up to there. At level 0 another curve may lie between them.
static Int strip_level(const Tracer *t, const BoundaryJob *b, const Sightline line[2], Mask m) {
    Int level = lines_part(t, b, line, line + 1, m & (mi_lt(i_set(0), line[0].turns) | mi_lt(i_set(0), line[1].turns)));
    Mask deep = mi_lt(i_set(0), level), moves = lines_move(t, b, line, level, m & deep);
    return i_select(moves | (m & ~deep), level, i_set(LINES_ALIKE));
}

// Random bits of a strip's own, so that whether it finds a place depends on the strip alone.
static UInt strip_bits(const Strip *s) {
    const Float grid = f_set(65536);
    UInt4 v = {(UInt)i_from_f(s->x[0] * grid), (UInt)i_from_f(s->y[0] * grid), (UInt)i_from_f(s->x[1] * grid),
               (UInt)i_from_f(s->y[1] * grid)};
    return rng_hash4(v).x;
}

// Halves strips until their ends lie next to where the lines part behind their first vertices; returns the levels, 0 or less
// where they never do. Of two halves whose ends part, that is kept in which they do so behind their first vertices, or else
// either: outlines and edges of the mirror hide what is beside them. If they do in both, that in which they do so earlier: where
// two mirrors pass through each other, there is a band on either side of their curve (curve_in_band).
static NOINLINE Int strip_narrow(Tracer *t, const BoundaryJob *b, const SampleKey *key, Vec2 lens, real end, Strip *s,
                                 Mask m) {
    Sightline line[2], middle;
    UInt bits = strip_bits(s);
    strip_look(t, key, lens, s, 0, m, line);
    strip_look(t, key, lens, s, 1, m, line + 1);
    for (Int level = strip_level(t, b, line, m);; bits = bits >> 1) {
        Mask open = m & mi_lt(i_set(LINES_ALIKE), level) & m_gt(s->length, f_set(end));
        if (!m_any(open)) {
            return i_select(lines_move(t, b, line, level, m & mi_lt(i_set(0), level)), level, i_set(0));
        }
        Float x = 0.5f * (s->x[0] + s->x[1]), y = 0.5f * (s->y[0] + s->y[1]);
        sightline_trace(t, key, lens, x, y, open, &middle);
        Int before = lines_part(t, b, line, &middle, open), behind = lines_part(t, b, &middle, line + 1, open);
        Mask either = mi_eq(behind, i_set(0)) & mi_eq((Int)bits & 1, i_set(0)), only = mi_lt(behind, i_set(0));
        Mask earlier = mi_lt(i_set(0), before) & ~(mi_lt(i_set(0), behind) & mi_lt(behind, before));
        Mask first = open & (earlier | (mi_eq(before, i_set(0)) & (either | only))), second = open & ~first;
        sightline_take(line + 1, &middle, first);
        sightline_take(line, &middle, second);
        s->x[1] = f_select(first, x, s->x[1]);
        s->y[1] = f_select(first, y, s->y[1]);
        s->x[0] = f_select(second, x, s->x[0]);
        s->y[0] = f_select(second, y, s->y[0]);
        s->length = f_select(open, 0.5f * s->length, s->length);
        level = i_select(first, before, i_select(second, behind, level));
    }
}

// ---- the jump of a strip's ends ----------------------------------------------------------------------------------

// The curve between the ends of a strip.
typedef struct Curve {
    Sightline line[2];
    Crossing crossing;
    Int level;
    Vec2 lens;
    Float x, y, nx, ny, slope; // its place and normal on the film, towards where F grows, and how fast it does
    Mask m;
} Curve;

// Lanes of m in which rays begin next to a surface that lies before or behind their start: where another surface touches the one
// that they leave, they start beyond it in a band as narrow as the step that they start above theirs. The band's border is none of
// the scene's curves: what it hides, it takes from the curve along which the surfaces meet. Bands within smooth meshes count: those
// end at edges, beside which primary.h sees them.
static Mask curve_in_band(Tracer *t, const Sightline *line, Int level, Mask m) {
    Ends at, before;
    ends_load(line, level, 0, &at);
    ends_load(line, level - 1, 0, &before);
    Vec3 o = at.o[0], step = v3_sub(o, before.hit[0].p);
    Int shape = before.hit[0].shape;
    Float length = v3_length(step);
    Vec3 back = v3_select(m, v3_scale(step, -f_safe_rcp(length)), v3(f_set(0), f_set(0), f_set(1)));
    Ray ray = {v3_madd(o, -0.5f * length, back), back, 1.45f * length};
    Hit hit = trace_solid(t, &ray, false, m, NULL);
    Mask smooth = mi_lt(i_set(0), SHAPE_FIELD(t->scene, i_select(m, shape, i_set(0)), flags) & SHAPE_HAS_NORMALS);
    return m & mi_lt(i_set(-1), hit.shape) & ~(smooth & mi_eq(hit.shape, shape));
}

// How near to its edge a point of a triangle lies beyond it, as far as floats can tell [barycentric].
#define TRIANGLE_END 3e-7f

// Lanes of m in which rays leave a triangle at its very edge: of a convex body they may begin outside of the next face, which they
// should meet at once. What they see instead parts them from others, in a band that is as narrow as rounding.
static Mask curve_at_end(const SceneView *scene, const Sightline *line, Int level, Mask m) {
    Ends before;
    ends_load(line, level - 1, 0, &before);
    const Hit *h = before.hit;
    Mask mesh = mi_eq(SHAPE_FIELD(scene, i_select(m, h->shape, i_set(0)), kind), i_set(SHAPE_MESH));
    return m & mesh & m_lt(f_min(f_min(h->u, h->v), 1.0f - h->u - h->v), f_set(TRIANGLE_END));
}

static NOINLINE void curve_find(Tracer *t, const BoundaryJob *b, Int slot, const Strip *s, Mask m, Curve *c) {
    SampleKey key = sightline_key(t, slot), own = slot_key(t, slot);
    Sink still = sink_of(b->still);
    c->lens = sample_lens(t, &own);
    strip_look(t, &key, c->lens, s, 0, m, c->line);
    strip_look(t, &key, c->lens, s, 1, m, c->line + 1);
    c->level = lines_part(t, b, c->line, c->line + 1, m);
    m = m & mi_lt(i_set(0), c->level);
    m = m & ~curve_in_band(t, c->line, c->level, m) & ~curve_in_band(t, c->line + 1, c->level, m);
    m = m & ~curve_at_end(t->scene, c->line, c->level, m) & ~curve_at_end(t->scene, c->line + 1, c->level, m);
    c->crossing = crossing_find(t, b, c->line, c->level, m);
    Carried carried = crossing_move_adj(t, &c->crossing, c->line, c->level, f_set(1), &still);
    c->x = 0.5f * (s->x[0] + s->x[1]);
    c->y = 0.5f * (s->y[0] + s->y[1]);
    Vec2 g = film_adj(t, c->x, c->y, c->lens, c->line[0].hit[0].p, &carried);
    c->slope = f_sqrt(g.x * g.x + g.y * g.y);
    Float rcp = f_safe_rcp(c->slope);
    c->nx = g.x * rcp;
    c->ny = g.y * rcp;
    c->m = c->crossing.m & m_gt(c->slope, f_set(0)) & m_finite(c->slope);
}

// How many strips across a curve it takes until one finds it, 0 where none does: of few that are found, one in many is lost.
static Float curve_again(Tracer *t, const BoundaryJob *b, const Strips *all, Int slot, const Curve *c) {
    SampleKey key = sightline_key(t, slot), own = slot_key(t, slot);
    Float count = f_set(0);
    Mask left = c->m;
    for (int32_t n = 0; n < MOST_AGAIN && m_any(left); n++) {
        Strip s = strip_across(all, &own, n, c->x, c->y, c->nx, c->ny);
        Int level = strip_narrow(t, b, &key, c->lens, all->end, &s, left);
        Float dx = 0.5f * (s.x[0] + s.x[1]) - c->x, dy = 0.5f * (s.y[0] + s.y[1]) - c->y;
        Mask again = left & mi_eq(level, c->level) & m_lt(dx * dx + dy * dy, f_set(400 * all->end * all->end));
        count = f_select(again, f_set((real)(n + 1)), count);
        left = left & ~again;
    }
    return count;
}

// ---- samples -----------------------------------------------------------------------------------------------------

// Writes the numbers of those of `count` samples from number `first` on whose strips find something behind `kept`.
static int32_t strips_find(Tracer *t, const BoundaryJob *b, const Strips *all, int64_t first, int32_t count, int32_t *kept) {
    int32_t kept_count = 0;
    for (int32_t i = 0; i < count; i += LANES) {
        Mask m = m_first_n(count - i);
        Int slot = i_iota() + i;
        batch_numbers(t, i, first);
        SampleKey key = sightline_key(t, slot), own = slot_key(t, slot);
        Vec2 lens = sample_lens(t, &own);
        Strip s = strip_sample(all, &own);
        Sightline line[2];
        strip_look(t, &key, lens, &s, 0, m, line);
        strip_look(t, &key, lens, &s, 1, m, line + 1);
        m = m & mi_lt(i_set(LINES_ALIKE), strip_level(t, b, line, m));
        i_compress(kept + kept_count, slot, m);
        kept_count += m_count(m);
    }
    return kept_count;
}

// Numbers the slots i... of a batch of those that are kept.
static void strips_number(Tracer *t, int64_t first, const int32_t *kept, int32_t i, int32_t count) {
    for (int32_t k = i; k < i + LANES; k++) {
        slot_number(t, k, first + kept[k < count ? k : i]);
    }
}

// Lanes whose place on the film counts.
KFN Mask strips_inside(const Strips *all, Float x, Float y) {
    return m_ge(x, f_set(all->x)) & m_lt(x, f_set(all->x + all->width)) & m_ge(y, f_set(all->y)) &
           m_lt(y, f_set(all->y + all->height));
}

// How far apart paths pass a curve [pixels], so that those whose directions are rounded in another order pass it there, too.
KFN Float strip_apart(const Strips *all) { return f_set(4 * all->end); }

// The same so far apart that rays that go on from a surface meet another one that it meets there, or ends at in an acute wedge.
KFN Float curve_apart(const Strips *all, const Curve *c) {
    Float steps = MEETING_STEPS * f_select(c->crossing.meeting, f_set(1), c->crossing.wedge);
    Float gap = 2.0f * steps * interaction_step(c->crossing.p) * f_safe_rcp(c->slope);
    return f_clamp(gap, strip_apart(all), f_set(WIDEST_MEETING));
}

// Keeps a strip's ends (o, d), what it is worth (behind), how far apart the two paths are that look at its curve (along), and its
// number.
static void strip_keep(const Strip *s, Float worth, Float apart, Int number, Segments *q, Mask m) {
    f_compress(q->ox + q->count, s->x[0], m);
    f_compress(q->oy + q->count, s->y[0], m);
    f_compress(q->dx + q->count, s->x[1], m);
    f_compress(q->dy + q->count, s->y[1], m);
    f_compress(q->behind + q->count, worth, m);
    f_compress(q->along + q->count, apart, m);
    i_compress(q->number + q->count, number, m);
    q->count += m_count(m);
}

// Finds the curves of those strips.
static void curves_find(Tracer *t, const BoundaryJob *b, const Strips *all, int64_t first, const int32_t *kept, int32_t count,
                        Segments *q) {
    q->count = 0;
    for (int32_t i = 0; i < count; i += LANES) {
        Mask m = m_first_n(count - i);
        strips_number(t, first, kept, i, count);
        Int slot = i_iota() + i;
        SampleKey key = sightline_key(t, slot), own = slot_key(t, slot);
        Strip s = strip_sample(all, &own);
        m = m & mi_lt(i_set(0), strip_narrow(t, b, &key, sample_lens(t, &own), all->end, &s, m));
        Curve c;
        curve_find(t, b, slot, &s, m, &c);
        c.m = c.m & m & strips_inside(all, c.x, c.y);
        Float weight = m_any(c.m) ? curve_again(t, b, all, slot, &c) * f_set(1 / all->density) : f_set(0);
        c.m = c.m & m_gt(weight, f_set(0));
        strip_keep(&s, weight, curve_apart(all, &c), i_load(kept + i), q, c.m);
    }
}

KFN Strip strip_load(const Segments *q, int32_t k) {
    Strip s = {{f_load(q->ox + k), f_load(q->dx + k)}, {f_load(q->oy + k), f_load(q->dy + k)}, f_set(0)};
    return s;
}

// The strip with its ends that far apart.
static Strip strip_widen(const Strip *s, Float length) {
    Float x = 0.5f * (s->x[0] + s->x[1]), y = 0.5f * (s->y[0] + s->y[1]), dx = s->x[1] - s->x[0], dy = s->y[1] - s->y[0];
    Float r = f_safe_rcp(f_sqrt(dx * dx + dy * dy));
    return strip_around(x, y, dx * r, dy * r, length, 0.5f * length);
}

// Starts the two paths of every strip: slots k and half + k.
static void curves_start(Tracer *t, const Segments *q, int64_t first, int32_t half) {
    for (int32_t k = 0; k < half; k++) {
        int64_t number = first + q->number[k < q->count ? k : 0];
        slot_number(t, k, number);
        slot_number(t, half + k, number);
    }
    for (int32_t k = 0; k < half; k += LANES) {
        Strip near = strip_load(q, k), s = strip_widen(&near, f_load(q->along + k));
        Int slot = i_iota() + k;
        SampleKey own = slot_key(t, slot);
        f_store(t->ws.film_x + k, 0.5f * (s.x[0] + s.x[1]));
        f_store(t->ws.film_y + k, 0.5f * (s.y[0] + s.y[1]));
        for (int end = 0; end < 2; end++) {
            SensorRay r = sensor_ray(t->scene, t->sensor, s.x[end], s.y[end], sample_lens(t, &own));
            r.ray.tmax = f_zero_unless(m_first_n(q->count - k), r.ray.tmax);
            path_begin(t, end * half + k, slot + end * half, &r.ray, r.weight);
        }
    }
    t->active = 2 * half;
    t->current = 0;
    t->record_count = t->batch_count = 0;
    t->overflow = false;
    t->job->paths += 2 * q->count;
}

// Books what the paths found. Reverse: the film's adjoint lies in ws.adjoint.
static void curves_finish(Tracer *t, const BoundaryJob *b, const Segments *q, Sink *sink, int32_t half) {
    for (int32_t k = 0; k < q->count; k += LANES) {
        Mask m = m_first_n(q->count - k);
        Strip s = strip_load(q, k);
        Curve c;
        curve_find(t, b, i_iota() + k, &s, m, &c);
        // Where F < 0 grows as F falls.
        Mask up = m_gt((s.x[1] - s.x[0]) * c.nx + (s.y[1] - s.y[0]) * c.ny, f_set(0));
        Spec jump = spec_sub(spec_load(t->ws.radiance, k), spec_load(t->ws.radiance, half + k));
        Float worth = f_select(up, f_set(-1), f_set(1)) * f_load(q->behind + k) * f_safe_rcp(c.slope);
        if (b->job.mode == MODE_REVERSE) {
            worth = worth * spec_dot(jump, spec_load(t->ws.adjoint, k));
        }
        c.crossing.m = c.m & m_finite(worth) & m_finite(spec_sum(jump));
        c.crossing.meeting = c.crossing.meeting & c.crossing.m;
        Carried carried = crossing_move_adj(t, &c.crossing, c.line, c.level, worth, sink);
        crossing_line_adj(b, &c.crossing, worth, sink);
        if (sink->any_camera) {
            RayAdj ray = {c.line[0].hit[0].p, carried.drag, carried.turn};
            sensor_ray_adj(t->scene, t->sensor, c.x, c.y, c.lens, &ray, sink, c.crossing.m);
        }
        if (b->job.mode == MODE_FORWARD) {
            spec_store(t->ws.radiance, k, spec_zero_unless(c.crossing.m, spec_scale(jump, sink->derivative)));
            sink->derivative = f_set(0);
        }
    }
}
