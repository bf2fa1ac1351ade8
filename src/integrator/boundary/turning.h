// turning.h: the jumps of light that leaves or reaches a surface at right angles to one of its normals, seen by vertices other
// than the camera. Terminator: what a point x scatters and emits jumps where its shading normal n turns away from the vertex a
// that looks at it. Horizon: what x receives jumps where its geometric normal n turns away from where the light comes from,
// because rays then start behind the surface; scattering goes by the shading normal and goes on. With r the distance,
//   dI += integral dA_x dphi |n_g . w| (n' . w + n . (a' - x') / r) (L+ - L-) W        terminator, W the importance at a
//   dI += integral dA_x dphi f |n_s . w| (n' . w + n . (b' - x') / r) L W              horizon, -L from below
// over the points x of meshes, for the first two smooth ones, and the directions w at right angles to n:
// docs/derivations/boundary.md.
// Along chains of smooth mirrors and glass (chained.h) F = n . w is carried back with the ray, whose direction at the vertex before
// the chain is fixed. Terminator: F' is that of where the ray meets the surface. Horizon: x begins the chain, or w is what it makes
// of a ray that comes back along v,
//   dI += integral dA_x dphi |n_g . w| F' (L+ - L-) W                                  terminator
//   dI += integral dA_x dphi f |n_g . v| (dv / dw) F' L W                              horizon, -L from below
// Cut: maps without a shadowing function scatter what comes from one side of the plane of the surface's own shading normal n
// only, f with the cosine of the map's normal: as the horizon, f on either side.
// In media, what collisions see and send keeps its direction as along chains, and what surfaces do comes through the air. Of what
// is scattered beside lights at a point, a part moves as they do (beacon.h): segments of horizons that end there, as those of
// beside.h, bring the second half of its F'.
// NOT differentiated: where lights at a point or with one direction cross the plane of a triangle.
#pragma once

#include "integrator/boundary/beside.h"
#include "integrator/boundary/facing.h"

// What a segment says of its light in `lit`, beside "no" and "from a light": all that comes along it, or the difference
// between two directions beside it (NORMAL_TURN), the other one in a second slot.
enum { SEGMENT_ALL = 2, SEGMENT_JUMP = 3 };

// A batch of segments that leave x, in the edge record's place, along d.
typedef struct Turning {
    Hit hit;
    Vec3 p, n, ng, d;
    Float weight, factor; // factor: of the light that comes, 1 or -1
    Int map;              // its number, where the normal is one's (facing.h)
    Mask m;
} Turning;

// The geometric normal, on the side on which the interaction has it.
KFN Vec3 turning_cross(const SceneView *scene, const Facet *f, const Hit *hit, Mask m) {
    Int shape = i_select(m, hit->shape, i_set(i_lane(hit->shape, m_first(m))));
    Mask flip = mi_lt(i_set(0), SHAPE_FIELD(scene, shape, flags) & SHAPE_FLIP_NORMALS);
    Mask inside = m & mi_lt(i_set(-1), SHAPE_FIELD(scene, shape, collection));
    Vec3 cross = v3_cross(v3_sub(f->p[1], f->p[0]), v3_sub(f->p[2], f->p[0]));
    if (m_any(inside)) { // by the inverse transpose; a mirror turns the corners round
        Hit h = *hit;
        h.instance = i_select(inside, hit->instance, i_set(0));
        Int at = instance_table(scene, &h);
        Float det = v3_dot(v3_cross(table_v3(scene, at), table_v3(scene, at + 4)), table_v3(scene, at + 8));
        flip = flip ^ (inside & m_lt(det, f_set(0)));
    }
    return v3_select(flip, v3_neg(cross), cross);
}

// A point of a random triangle; cross: normal times twice the area. Returns the shading normal.
static Vec3 turning_point(const SceneView *scene, const BoundaryJob *b, const SampleKey *key, Turning *out, Vec3 *cross,
                          Float *probability) {
    Vec2 at = rng_2d(key, DIMENSION_EDGE_SEGMENT);
    Int e = edge_choose(b, rng_1d(key, DIMENSION_SEGMENT_LIGHT), probability);
    Float root = f_sqrt(1.0f - at.x);
    out->hit = (Hit){EDGE_FIELD(b, e, shape), EDGE_FIELD(b, e, prim), 1.0f - root, at.y * root, v3_zero(),
                     EDGE_FIELD(b, e, instance)};
    Facet f = facet_load(scene, &out->hit, m_set(true));
    *cross = turning_cross(scene, &f, &out->hit, m_set(true));
    out->ng = v3_scale(*cross, f_safe_rcp(v3_length(*cross)));
    out->p = out->hit.p = facet_at(f.p, out->hit.u, out->hit.v);
    Mask smooth = mi_lt(i_set(0), SHAPE_FIELD(scene, out->hit.shape, flags) & SHAPE_HAS_NORMALS);
    return v3_select(smooth, v3_normalize(facet_at(f.n, out->hit.u, out->hit.v)), out->ng);
}

// Any direction at right angles to n; returns what of the rest has no density, as turning_directions does.
static Float cut_directions(Vec2 way, Turning *out) {
    Frame around = frame_from_normal(out->n);
    Float sine, cosine;
    f_sincos(TWO_PI * way.x, &sine, &cosine);
    out->d = v3_madd(v3_scale(around.s, cosine), sine, around.t);
    return f_set(TWO_PI);
}

// In proportion to the cosine with the part of another normal across n; returns dphi over their density, of terminators times
// |n_g . d|, which is the length of that part times that cosine; 0 where there is none.
static Float turning_directions(Vec2 way, Vec3 other, bool horizon, Turning *out) {
    Vec3 across = v3_madd(other, -v3_dot(other, out->n), out->n);
    Float size = v3_length(across), rcp = f_safe_rcp(size);
    Vec3 x = v3_scale(across, rcp), y = v3_cross(out->n, x);
    Mask outside = m_lt(way.x, f_set(TURNING_OUTSIDE));
    Float share = f_select(outside, f_set(TURNING_OUTSIDE), f_set(1 - TURNING_OUTSIDE));
    Float sine = 2.0f * way.y - 1.0f, cosine = f_safe_sqrt(1.0f - sine * sine);
    out->d = v3_madd(v3_scale(x, f_select(outside, cosine, -cosine)), sine, y);
    Float density = share * (horizon ? 0.5f * cosine : f_set(0.5f));
    return f_zero_unless(m_gt(size, f_set(1e-6f)) & m_gt(density, f_set(0)), (horizon ? f_set(1) : size) * f_safe_rcp(density));
}

static void turning_sample(Tracer *t, const BoundaryJob *b, Int slot, Mask m, Turning *out) {
    SampleKey key = slot_key(t, slot);
    out->map = i_set(-1);
    if (boundary_is_facing(b->kind)) {
        FacingPoint at;
        facing_sample(t, b, &key, &at);
        m = m & at.m & m_finite(at.weight) & m_gt(at.weight, f_set(0));
        *out = (Turning){at.hit, at.hit.p, at.n, at.ng, at.d, at.weight, f_set(1), at.number, m};
        return;
    }
    Vec2 way = rng_2d(&key, DIMENSION_SEGMENT_END);
    Float probability;
    Vec3 cross, shading = turning_point(t->scene, b, &key, out, &cross, &probability);
    bool horizon = boundary_is_horizon(b->kind);
    out->n = horizon ? out->ng : shading;
    Float around = b->kind == BOUNDARY_CUT ? cut_directions(way, out)
                                           : turning_directions(way, horizon ? shading : out->ng, horizon, out);
    out->weight = 0.5f * v3_length(cross) * around * f_safe_rcp(probability);
    out->factor = f_set(1);
    if (!boundary_is_terminator(b->kind)) { // what comes from above or from below, each with its own distance
        Mask above = m_lt(rng_1d(&key, DIMENSION_TURNING_SIDE), f_set(0.5f));
        out->factor = f_select(above, f_set(2), f_set(-2));
    }
    out->m = m & m_gt(probability, f_set(0)) & m_finite(out->weight) & m_gt(out->weight, f_set(0));
}

// In media, where the particles' flights from x have ended, and the medium of x; horizons, whose particles begin there: what is lit
// through. Returns the lanes whose segments are this kind's: those of collisions keep their directions, as chains do.
static Mask turning_fly(Tracer *t, const BoundaryJob *b, const Turning *s, const Ray *ray, Int number, Segments *q, Hit *end) {
    const int32_t kind = b->kind;
    Int around = medium_around(t, ray->o, ray->d, s->m);
    Leg leg = {.near = s->hit, .air = i_set(-1), .around = around, .weight = spec_set(f_set(1)), .m = s->m};
    Mask m = s->m;
    if (boundary_is_terminator(kind)) {
        SampleKey key = stream_key(t, number, 0, STREAM_PROBE);
        leg = leg_trace(t, *ray, ray->o, around, &key, m_set(false), m);
        *end = leg.near;
        const bool rides = boundary_is_riding(kind);
        m = leg.m & ((mi_lt(leg.air, i_set(0)) ^ m_set(rides)) | m_set(rides && b->chains)); // surfaces may be pieces of chains
    } else if (kind == BOUNDARY_HORIZON) {
        *end = trace_solid(t, ray, false, m, NULL);
        m = m & (mi_lt(i_set(-1), end->shape) | m_set(t->scene->environment >= 0));
    }
    segment_keep_leg(around, &leg, q, m);
    return m;
}

// Stores the segments of m, which begin at o and whose lights are stored, one over `rcp` long.
static void turning_keep(const Turning *s, Vec3 o, Float rcp, int32_t lit, Int number, const Hit *near, const Hit *far, Segments *q,
                         Mask m) {
    const int32_t at = q->count;
    // Segments run from the near point, towards the sensor, to the far one: of a terminator, x is that.
    Vec3 d = lit == SEGMENT_JUMP ? v3_neg(s->d) : s->d, n = v3_scale(s->n, s->weight * s->factor);
    v3_compress(q->ox + at, q->oy + at, q->oz + at, o, m);
    v3_compress(q->dx + at, q->dy + at, q->dz + at, d, m);
    v3_compress(q->nx + at, q->ny + at, q->nz + at, n, m);
    f_compress(q->behind + at, rcp, m);
    f_compress(q->along + at, s->weight * s->factor, m);
    f_compress(q->seen + at, f_set(0), m);
    f_compress(q->unseen + at, f_set(0), m);
    i_compress(q->lit + at, i_set(lit), m);
    i_compress(q->rim + at, s->map, m);
    i_compress(q->number + at, number, m);
    KEEP_HIT(q, at, edge, &s->hit, s->p, m);
    KEEP_HIT(q, at, near, near, near->p, m);
    KEEP_HIT(q, at, far, far, far->p, m);
    q->count += m_count(m);
}

// Finds where the segments end and keeps those that do.
static void turning_trace(Tracer *t, const BoundaryJob *b, const Turning *s, Int number, Segments *q) {
    const bool horizon = !boundary_is_terminator(b->kind);
    Float step = interaction_step(s->p);
    // Where both normals are the same, what comes from above n is above the surface.
    Float up = v3_dot(s->ng, s->d);
    up = f_select(m_gt(f_abs(up), f_set(horizon ? 1e-4f : 0)), up, s->factor);
    Ray ray = {v3_madd(s->p, f_copysign(step, up), s->ng), s->d, f_set(INFINITY)};
    Hit end = {i_set(-1), i_set(0), f_set(0), f_set(0), s->p, i_set(0)};
    Mask m = s->m, met;
    if (t->scene->has_media) {
        m = turning_fly(t, b, s, &ray, number, q, &end);
        met = mi_lt(i_set(-1), end.shape);
    } else {
        t->job->rays += m_count(m);
        end = trace_closest(t->scene, &ray, m, false);
        met = mi_lt(i_set(-1), end.shape);
        m = m & (horizon ? met | m_set(t->scene->environment >= 0) : met);
    }
    if (!m_any(m)) {
        return;
    }
    Float near = f_zero_unless(met, f_safe_rcp(v3_length(v3_sub(end.p, s->p))));
    end.shape = i_select(met, end.shape, i_set(-1));
    spec_compress(q->light, q->count, spec_set(f_set(1)), m);
    i_compress(q->source + q->count, i_set(-1), m);
    const int32_t lit = horizon ? SEGMENT_ALL : SEGMENT_JUMP;
    turning_keep(s, ray.o, near, lit, number, horizon ? &s->hit : &end, horizon ? &end : &s->hit, q, m);
}

// A horizon of a point x and a point of a ball around a light: in the plane of x's triangle, with one over the square of the
// distance from the light, or from where the plane comes close to that. Returns the distance of the two.
static Float turning_to_ball(Tracer *t, const BoundaryJob *b, Int slot, Turning *s, BesidePoint *end) {
    SampleKey key = slot_key(t, slot);
    const real count = (real)t->job->beacon_count;
    Vec2 u = rng_2d(&key, DIMENSION_SEGMENT_END);
    Float probability, pick = rng_1d(&key, DIMENSION_TURNING_SIDE) * (2 * count);
    Vec3 cross;
    turning_point(t->scene, b, &key, s, &cross, &probability);
    s->n = s->ng;
    s->map = i_set(-1);
    Mask above = m_lt(pick, f_set(count));
    s->factor = f_select(above, f_set(1), f_set(-1));
    beside_ball(t, f_select(above, pick, pick - count), end);
    Float height = v3_dot(v3_sub(end->centre, s->p), s->n), r2 = end->radius * end->radius;
    Float least = f_max(height * height, 1e-6f * r2), range = f_log(r2 * f_safe_rcp(least)), sine, cosine;
    Float away2 = least * f_exp(u.x * range), away = f_safe_sqrt(away2 - least);
    Frame plane = frame_from_normal(s->n);
    f_sincos(TWO_PI * u.y, &sine, &cosine);
    Vec3 foot = v3_madd(end->centre, -height, s->n);
    end->p = v3_madd(v3_madd(foot, away * cosine, plane.s), away * sine, plane.t);
    end->r = v3_length(v3_sub(end->p, end->centre));
    Vec3 across = v3_sub(end->p, s->p);
    Float distance = v3_length(across);
    s->d = v3_scale(across, f_safe_rcp(distance));
    Float area = PI * away2 * range; // over the density of the point in the plane
    s->weight = 0.5f * v3_length(cross) * area * (2 * count) * f_safe_rcp(probability * distance);
    s->m = s->m & m_gt(probability, f_set(0)) & m_lt(least, r2) & m_lt(end->r, end->radius) & m_gt(s->weight, f_set(0)) &
           m_finite(s->weight);
    return distance;
}

// Keeps the horizons of m whose lights come from there.
static void turning_beside(Tracer *t, const BoundaryJob *b, Int number, Float share, Mask m, Segments *q) {
    Turning s = {.m = m};
    BesidePoint end;
    Segment way = {.source = i_set(-1)}; // to the ball, on the side that counts
    way.distance = turning_to_ball(t, b, number, &s, &end);
    if (!m_any(s.m)) {
        return;
    }
    s.weight = s.weight * share;
    way.d = s.d;
    way.n = v3_scale(s.ng, s.factor);
    way.edge.p = s.p;
    BeaconShare still = beacon_share(end.radius, end.r, way.distance, s.m);
    way.light = spec_scale(beside_light(t, &end, s.d, number, s.m), still.chi);
    Vec3 o = segment_offset(&way);
    Int around = medium_around(t, o, s.d, s.m);
    m = segment_shine(t, &way, o, around, f_set(0), number, s.m & m_gt(spec_max(way.light), f_set(0)));
    Leg leg = {.near = s.hit, .air = i_set(-1), .around = around, .weight = spec_set(f_set(1))};
    segment_keep_leg(around, &leg, q, m);
    Hit light = {i_set(-1), i_set(0), f_set(0), f_set(0), end.p, i_set(0)};
    i_compress(q->source + q->count, end.light, m);
    spec_compress(q->light, q->count, way.light, m);
    turning_keep(&s, o, f_safe_rcp(way.distance), SEGMENT_BESIDE, number, &s.hit, &light, q, m);
}

// As segments_find.
static void turnings_find(Tracer *t, const BoundaryJob *b, int64_t first, int32_t count, Segments *q) {
    const bool beside = b->kind == BOUNDARY_RIDING_HORIZON && t->job->beacons;
    const Float share = f_set(beside ? 2 : 1); // blocks of both take turns
    q->count = 0;
    for (int32_t i = 0; i < count; i += LANES) {
        batch_numbers(t, i, first);
        Turning s;
        if (beside && (first + i) / SEGMENT_BLOCK % 2) {
            turning_beside(t, b, i_iota() + i, share, m_first_n(count - i), q);
            continue;
        }
        turning_sample(t, b, i_iota() + i, m_first_n(count - i), &s);
        s.weight = s.weight * share;
        if (m_any(s.m)) {
            turning_trace(t, b, &s, i_iota() + i, q);
        }
    }
}

// Terminators: starts the paths that look at x from both sides of its shading normal's plane, in slots k and half + k.
static void turning_start(Tracer *t, const Segments *q, int32_t half) {
    segment_pairs(t, q, half);
    for (int32_t k = 0; k < half; k += LANES) {
        Int at = i_min(i_iota() + k, i_set(q->count - 1));
        Hit hit = segment_edge(q, at);
        Vec3 d = LOAD_V3(*q, dx, dy, dz, at), n = v3_normalize(LOAD_V3(*q, nx, ny, nz, at));
        for (int side = 0; side < 2; side++) {
            Vec3 to = v3_normalize(v3_madd(d, f_set(side ? NORMAL_TURN : -NORMAL_TURN), n)); // first from where n points to
            Ray ray = {v3_sub(hit.p, to), to, f_zero_unless(m_first_n(q->count - k), f_set(INFINITY))};
            path_begin(t, side * half + k, i_iota() + (side * half + k), &ray, f_set(1));
            hit_store(t, side * half + k, &hit);
            if (t->scene->has_media) {
                i_store(t->ws.paths[0].medium + (side * half + k), i_gather(q->medium, at));
            }
        }
    }
    t->active = 2 * half;
}
