// segment.h: boundary segments: straight pieces of light paths that touch an edge. A segment runs from the near point,
// towards the sensor, past a point of the edge to the far point, towards the light. When the three points move with
// velocities a, e and b, light of the far point moves over the near side's surfaces as far as the edge leaves the line of
// the other two: by n . (e - lerp(a, b)), n the normal of the plane of edge and segment, and the flux through a piece dl
// of the edge within the solid angle dw is L sin(dl, w) dl dw times that [zhang2020]; derived in
// docs/derivations/boundary.md. Far points are attached to their surfaces, and so is what lies behind
// them; the near side of the edge adds nothing, because its own light moves along with it.
#pragma once

#include "integrator/boundary/edge.h"

// Beside the numbers of edges: the light, and where on it or which direction.
#define DIMENSION_EDGE_SEGMENT 0x80000002u
#define DIMENSION_SEGMENT_LIGHT 0x80000003u
#define DIMENSION_SEGMENT_END 0x80000004u
#define DIMENSION_TURNING_SIDE 0x80000005u

// Blocks of samples that end on lights take turns with blocks that leave into a random direction.
enum { SEGMENT_BLOCK = 16, MOST_RUNGS = 64, MOST_UPSTREAM = 64 };

// Lights of which every point sees the same direction, or all.
enum { EMITTER_INFINITE_KINDS = 1 << EMITTER_CONSTANT | 1 << EMITTER_ENVMAP | 1 << EMITTER_DIRECTIONAL };

#define SEGMENT_POINT(F, x) F(x##_u) F(x##_v) F(x##_x) F(x##_y) F(x##_z)
#define SEGMENT_HIT(I, x) I(x##_shape) I(x##_prim) I(x##_instance)
// Origin and direction of the far half; n times the weight; distance of edge and near point, absolute and over that of the
// ends; what the near point's share of the derivative is worth where it is seen by the camera, and elsewhere; the second surface
// of a meeting: what its motion is worth; of the paths beside lines of textures, what is added to their uv; how far chained ones
// pass from the edge. In media: what the near point is in (leg.h), and the edge, what the flight to it weighs, and whether it was
// looked for along a ray of the sensor's. Of rims: the lobe, or the map's number.
#define SEGMENT_FLOATS(F)                                                                                              \
    F(ox) F(oy) F(oz) F(dx) F(dy) F(dz) F(nx) F(ny) F(nz) F(behind) F(along) F(seen) F(unseen) F(mx) F(my) F(mz)                \
        F(nudge_u) F(nudge_v) F(apart)                                                                                          \
        SEGMENT_POINT(F, near) SEGMENT_POINT(F, edge) SEGMENT_POINT(F, far)
#define SEGMENT_INTS(I)                                                                                                \
    I(number) I(lit) I(source) I(air) I(around) I(medium) I(sighted) I(rim)                                                     \
        SEGMENT_HIT(I, near) SEGMENT_HIT(I, edge) SEGMENT_HIT(I, far)
#define SEGMENT_SPECS(S) S(light) S(flown)

// Near vertices of one level (upstream.h): where they lie, where the particle came from and went on, and what the motion of a
// vertex is worth where it is seen by the sensor, and elsewhere; and that of all before it where it is seen along a chain.
#define UPSTREAM_FLOATS(F) F(u) F(v) F(x) F(y) F(z) F(dx) F(dy) F(dz) F(seen) F(unseen) F(passed)
#define UPSTREAM_INTS(I) I(shape) I(prim) I(instance) I(met) I(lobe)

typedef struct Upstream {
    UPSTREAM_FLOATS(DECLARE_FLOAT) UPSTREAM_INTS(DECLARE_INT)
} Upstream;

// Of the particle in a slot: how it came to its vertex, the level of the last vertex that moves with it, whether its first
// vertex turned the segment, and the last one's lobe; forward mode: what is carried upstream, and its rate so far.
#define WAY_INTS(I) I(arrived) I(level) I(full) I(lobe)
#define WAY_FLOATS(F) F(rate) F(dragx) F(dragy) F(dragz) F(turnx) F(turny) F(turnz)

typedef struct Segments {
    SEGMENT_FLOATS(DECLARE_FLOAT) SEGMENT_INTS(DECLARE_INT) SEGMENT_SPECS(DECLARE_SPEC)
    WAY_FLOATS(DECLARE_FLOAT) WAY_INTS(DECLARE_INT)
    real *rungs[MOST_RUNGS * SPEC_N];
    SpecRows sent, brought;
    Upstream up[MOST_UPSTREAM];
    Fork fork;
    int32_t levels; // of `up` that are in use
    int32_t count;
} Segments;

// As workspace_layout.
static inline size_t segments_layout(Segments *q, char *block) {
    size_t at = 0, n = CHUNK + 2 * LANES;
#define CARVE_SEGMENT(name) CARVE(q->name, n)
#define CARVE_SEGMENT_SPEC(name) CARVE_SPEC(q->name, n)
    SEGMENT_FLOATS(CARVE_SEGMENT)
    SEGMENT_INTS(CARVE_SEGMENT)
    SEGMENT_SPECS(CARVE_SEGMENT_SPEC)
    for (int i = 0; i < MOST_RUNGS * SPEC_N; i++) {
        CARVE(q->rungs[i], n)
    }
    CARVE_SPEC(q->sent, n)
    CARVE_SPEC(q->brought, n)
#define CARVE_UPSTREAM(name) CARVE(q->up[i].name, n)
    for (int i = 0; i < MOST_UPSTREAM; i++) {
        UPSTREAM_FLOATS(CARVE_UPSTREAM)
        UPSTREAM_INTS(CARVE_UPSTREAM)
    }
    WAY_FLOATS(CARVE_SEGMENT)
    WAY_INTS(CARVE_SEGMENT)
    CARVE_SPEC(q->fork.air, n)
    CARVE_SPEC(q->fork.first, n)
    CARVE(q->fork.way, n)
    q->count = 0;
    return at;
}

// A batch of segments as it is sampled.
typedef struct Segment {
    EdgePoint edge;
    Vec3 d, n;       // towards the light; away from what hides it
    Float weight, distance; // of the light, or infinite
    Spec light;      // what comes along d over its density; random directions: 1 over theirs
    Hit far;
    Int source;      // the delta light that it ends on, -1 = none
    Mask m, attached; // attached: the far point lies on a surface
    Mask silhouette;
} Segment;

// The batches of a chunk take turns: whether this one's segments end on lights, and what share of all of them it is.
typedef struct SegmentTurn {
    bool direct, indirect; // what there is
    bool lit, sighted;     // sighted: near points are chosen along rays of the sensor's (riding.h)
    bool beside;           // they end beside lights at a point (beside.h)
    Float share;
} SegmentTurn;

static SegmentTurn segment_turn(const Tracer *t, int32_t kind, int64_t number) {
    const SceneView *scene = t->scene;
    // Collisions see what a light's own edge shows, too; and what lets pass is no segment's end.
    const int32_t shown = (kind == BOUNDARY_RIDING ? 1 : 2) - t->job->veils;
    SegmentTurn r = {.direct = scene->emitters_count > 0, .indirect = scene->max_depth < 0 || scene->max_depth > shown};
    r.indirect = r.indirect && (!scene->has_media || t->job->rides); // else only lights move there
    const int32_t riding = t->job->beacons ? 3 : 2, ways = kind == BOUNDARY_RIDING && r.indirect ? riding : r.indirect;
    const int32_t all = r.direct + ways;
    const int32_t way = all > 0 ? (int32_t)(number / SEGMENT_BLOCK % all) : 0;
    r.lit = r.direct && way == 0;
    r.sighted = ways >= 2 && way == r.direct + 1;
    r.beside = ways == 3 && way == r.direct + 2;
    r.share = f_set((real)all);
    return r;
}

KFN Vec3 segment_far_eye(const SceneView *scene, Vec3 reference, Vec3 d) {
    return v3_madd(reference, f_set(1e4f * (real)scene->bounds_radius), d);
}

// Towards a point of a light, as the edge sees it.
static void segment_to_light(const Tracer *t, const BoundaryJob *b, const SampleKey *key, Vec2 u, Segment *s) {
    const SceneView *scene = t->scene;
    Float choice;
    Vec2 at = rng_2d(key, DIMENSION_SEGMENT_END);
    Vec3 reference = edge_reference(&s->edge);
    Int light = emitter_choose(scene, rng_1d(key, DIMENSION_SEGMENT_LIGHT), &choice);
    LightSample l = lights_sample(scene, light, s->m, reference, at, &s->light);
    Int shape = EMITTER_FIELD(scene, light, shape), kind = EMITTER_FIELD(scene, light, kind);
    Mask round = s->m & s->edge.round, endless = mi_eq((i_set(EMITTER_INFINITE_KINDS) >> kind) & 1, i_set(1));
    Vec3 end = v3_madd(reference, l.distance, l.d), normal = v3_zero();
    s->attached = s->m & l.valid & mi_lt(i_set(-1), shape);
    s->far = point_hit(scene, i_select(s->attached, shape, i_set(-1)), i_select(s->attached, l.prim, i_set(0)),
                       i_set(0), end, &normal);
    Float factor = f_set(1);
    if (m_any(round)) {
        Vec3 eye = v3_select(endless, segment_far_eye(scene, reference, l.d), end);
        s->edge = edge_sample(scene, b, u, eye, false);
        Vec3 to_end = v3_sub(end, s->edge.p);
        Float distance = v3_length(to_end);
        Vec3 d = v3_scale(to_end, f_safe_rcp(distance));
        Mask near = round & ~endless & light_is_delta(scene, light);
        if (m_any(near)) {
            Spec again;
            lights_sample(scene, light, near, s->edge.p, at, &again);
            s->light = spec_select(near, again, s->light);
        }
        // Of points of surfaces: their solid angle from the edge over that from the reference.
        Float turned = f_max(-v3_dot(d, normal), f_set(0)) * f_safe_rcp(f_abs(v3_dot(l.d, normal)));
        Float ratio = l.distance * l.distance * f_safe_rcp(distance * distance) * turned;
        factor = f_select(round & s->attached, ratio, factor);
        Mask moved = round & ~endless;
        l.d = v3_select(moved, d, l.d);
        l.distance = f_select(moved, distance, l.distance);
    }
    s->source = i_select(light_is_delta(scene, light), light, i_set(-1));
    s->d = l.d;
    s->distance = f_select(endless, f_set(INFINITY), l.distance);
    s->light = spec_scale(s->light, factor * f_safe_rcp(l.pdf * choice));
    s->m = s->m & l.valid & m_gt(l.pdf, f_set(0)) & m_gt(spec_max(s->light), f_set(0));
}

static void segment_to_anywhere(const Tracer *t, const BoundaryJob *b, const SampleKey *key, Vec2 u, Segment *s) {
    s->d = warp_uniform_sphere(rng_2d(key, DIMENSION_SEGMENT_END));
    if (m_any(s->edge.round)) {
        s->edge = edge_sample(t->scene, b, u, segment_far_eye(t->scene, edge_reference(&s->edge), s->d), false);
    }
    s->light = spec_set(f_set(4 * PI));
    s->distance = f_set(INFINITY);
}

// Lanes whose light passes what lets more or less through on both sides of the edge: faces of thin glass, or seams of masks.
KFN Mask segment_parts(const Tracer *t, const Segment *s) {
    if (!t->job->veils_turn) {
        return m_set(false);
    }
    Int live = i_gather(t->job->live, SHAPE_FIELD(t->scene, i_max(s->edge.hit.shape, i_set(0)), group));
    return s->edge.crease & ~s->edge.meeting & mi_lt(i_set(-1), s->source) & mi_lt(i_set(0), live & LIVE_UNEVEN);
}

// Weighs segments whose edges and directions are known. lit: they end on lights.
static void segment_measure(const Tracer *t, const BoundaryJob *b, bool lit, Float share, Segment *s) {
    Vec3 across = v3_cross(s->d, s->edge.tangent);
    Float length = v3_length(across);
    Vec3 n = v3_scale(across, f_safe_rcp(length));
    Float into = edge_first_rise(&s->edge, n);
    s->n = v3_scale(n, f_select(m_gt(into, f_set(0)), f_set(-1), f_set(1)));
    s->weight = length * share * f_safe_rcp(s->edge.probability);
    s->silhouette = edge_is_silhouette(t->scene, b, &s->edge, n, s->d);
    Mask parts = lit ? segment_parts(t, s) : s->edge.crease & m_set(boundary_is_paired(b->kind));
    Mask jumps = s->silhouette | parts;
    const EdgePoint *e = &s->edge;
    Mask shown = m_le(v3_dot(e->outside, e->outside), f_set(0)) | m_lt(v3_dot(e->outside, s->d), f_set(0));
    s->m = s->m & jumps & shown & m_gt(f_abs(into), f_set(0)) & m_gt(s->weight, f_set(0)) & m_finite(s->weight) &
           m_gt(s->edge.probability, f_set(0));
}

// Samples a batch of segments without tracing them. lit: they end on lights.
static NOINLINE void segment_sample(Tracer *t, const BoundaryJob *b, Int slot, bool lit, Float share, Mask m, Segment *s) {
    SampleKey key = slot_key(t, slot);
    Vec2 u = rng_2d(&key, DIMENSION_EDGE_SEGMENT);
    s->edge = edge_sample(t->scene, b, u, v3_zero(), false);
    s->m = m;
    s->attached = m_set(false);
    s->source = i_set(-1);
    if (lit) {
        segment_to_light(t, b, &key, u, s);
    } else {
        segment_to_anywhere(t, b, &key, u, s);
    }
    segment_measure(t, b, lit, share, s);
}

KFN void hit_compress(real *u, real *v, real *x, real *y, real *z, int32_t *shape, int32_t *prim, int32_t *instance,
                      const Hit *hit, Vec3 p, Mask m) {
    f_compress(u, hit->u, m);
    f_compress(v, hit->v, m);
    v3_compress(x, y, z, p, m);
    i_compress(shape, hit->shape, m);
    i_compress(prim, hit->prim, m);
    i_compress(instance, hit->instance, m);
}

#define KEEP_HIT(q, at, name, hit, p, m)                                                                               \
    hit_compress((q)->name##_u + (at), (q)->name##_v + (at), (q)->name##_x + (at), (q)->name##_y + (at),               \
                 (q)->name##_z + (at), (q)->name##_shape + (at), (q)->name##_prim + (at), (q)->name##_instance + (at), \
                 hit, p, m)
#define LOAD_HIT(q, k, name)                                                                                           \
    ((Hit){i_load((q)->name##_shape + (k)), i_load((q)->name##_prim + (k)), f_load((q)->name##_u + (k)),               \
           f_load((q)->name##_v + (k)), record_v3((q)->name##_x, (q)->name##_y, (q)->name##_z, (k)),                   \
           i_load((q)->name##_instance + (k))})

// Stores the segments of m that begin at near points and go on from o.
static void segment_keep(const Segment *s, Vec3 o, const Hit *near, int32_t lit, Int number, Segments *q, Mask m) {
    Vec3 p = s->edge.p;
    Float behind = v3_length(v3_sub(near->p, p)), before = v3_length(v3_sub(s->far.p, p));
    Float along = f_select(s->attached | m_lt(s->distance, f_set(INFINITY)), behind * f_safe_rcp(behind + before), f_set(0));
    int32_t at = q->count;
    Hit far = s->far;
    far.shape = i_select(s->attached, s->far.shape, i_set(-1));
    v3_compress(q->ox + at, q->oy + at, q->oz + at, o, m);
    v3_compress(q->dx + at, q->dy + at, q->dz + at, s->d, m);
    // What the edge gains on the side of n, the light loses.
    v3_compress(q->nx + at, q->ny + at, q->nz + at, v3_scale(s->n, -s->weight), m);
    v3_compress(q->mx + at, q->my + at, q->mz + at, v3_zero(), m);
    f_compress(q->behind + at, behind, m);
    f_compress(q->along + at, along, m);
    f_compress(q->seen + at, f_set(0), m);
    f_compress(q->unseen + at, f_set(0), m);
    spec_compress(q->light, at, s->light, m);
    i_compress(q->lit + at, i_set(lit), m);
    i_compress(q->source + at, s->source, m);
    i_compress(q->number + at, number, m);
    KEEP_HIT(q, at, near, near, near->p, m);
    KEEP_HIT(q, at, edge, &s->edge.hit, p, m);
    KEEP_HIT(q, at, far, &far, far.p, m);
    q->count += m_count(m);
}

// The edge's point of the segments at.
KFN Hit segment_edge(const Segments *q, Int at) {
    return (Hit){i_gather(q->edge_shape, at), i_gather(q->edge_prim, at), real_gather(q->edge_u, at), real_gather(q->edge_v, at),
                 LOAD_V3(*q, edge_x, edge_y, edge_z, at), i_gather(q->edge_instance, at)};
}

// And the far point.
KFN Hit segment_far(const Segments *q, Int at) {
    return (Hit){i_gather(q->far_shape, at), i_gather(q->far_prim, at), real_gather(q->far_u, at), real_gather(q->far_v, at),
                 LOAD_V3(*q, far_x, far_y, far_z, at), i_gather(q->far_instance, at)};
}

// Two paths for every segment, in slots k and half + k, share its numbers.
static void segment_pairs(Tracer *t, const Segments *q, int32_t half) {
    for (int32_t k = 0; k < half; k++) {
        int32_t at = k < q->count ? k : q->count - 1;
        t->ws.pixel[k] = t->ws.pixel[half + k] = t->ws.pixel[at];
        t->ws.sample[k] = t->ws.sample[half + k] = t->ws.sample[at];
    }
}

// Keeps what is added to the uv of the paths in the slots `first` and `second`, the latter on the side of side[0] where `above`.
KFN void nudges_store(const EdgePoint *e, Mask above, Segments *q, int32_t first, int32_t second) {
    f_store(q->nudge_u + first, f_select(above, e->nudge[1].x, e->nudge[0].x));
    f_store(q->nudge_v + first, f_select(above, e->nudge[1].y, e->nudge[0].y));
    f_store(q->nudge_u + second, f_select(above, e->nudge[0].x, e->nudge[1].x));
    f_store(q->nudge_v + second, f_select(above, e->nudge[0].y, e->nudge[1].y));
}
