// edge.h: points of the curves along which pictures jump, one curve per lane.
#pragma once

#include "emitter/beam.h"
#include "integrator/boundary/facet.h"
#include "integrator/boundary/mark.h"
#include "integrator/boundary/round.h"
#include "integrator/boundary/view.h"

// How many steps of rays that start above a surface (interaction_step) paths keep off the curves along which surfaces meet, so that
// those that one surface lets pass meet the other one behind it.
#define MEETING_STEPS 8.0f

// The cotangent of the narrowest wedges in which paths keep off the edge for that.
#define MOST_WEDGE 20.0f

#define MEETING_INT(job, i, field)                                                                                     \
    i_gather((const int32_t *)(job)->meetings,                                                                         \
             (i) * (int32_t)(sizeof(MeetingRecord) / 4) + (int32_t)(offsetof(MeetingRecord, field) / 4))
#define MEETING_FLOAT(job, i, field, k)                                                                                \
    f_gather((const float *)(job)->meetings,                                                                           \
             (i) * (int32_t)(sizeof(MeetingRecord) / 4) + (int32_t)(offsetof(MeetingRecord, field) / 4) + (k))

#define SHARED_INT(job, i, field)                                                                                      \
    i_gather((const int32_t *)(job)->sides,                                                                            \
             (i) * (int32_t)(sizeof(SharedSide) / 4) + (int32_t)(offsetof(SharedSide, field) / 4))
#define SHARED_FLOAT(job, i, k)                                                                                        \
    f_gather((const float *)(job)->sides,                                                                              \
             (i) * (int32_t)(sizeof(SharedSide) / 4) + (int32_t)(offsetof(SharedSide, side) / 4) + (k))

// From the points p of edges into number i of the other surfaces that end there.
static Vec3 edge_shared_side(const BoundaryJob *b, Int i, Vec3 p) {
    Vec3 side = v3(SHARED_FLOAT(b, i, 0), SHARED_FLOAT(b, i, 1), SHARED_FLOAT(b, i, 2));
    return v3_select(mi_eq(SHARED_INT(b, i, radial), i_set(1)), v3_sub(side, p), side);
}

// The points of edges that other surfaces share: these have two sides, as those within meshes.
static void edge_of_several(const BoundaryJob *b, Int e, EdgePoint *out) {
    Mask shared = mi_lt(i_set(0), out->side_count);
    if (!m_any(shared)) {
        return;
    }
    out->sides = i_select(shared, EDGE_FIELD(b, e, sides), i_set(0));
    out->side[1] = v3_select(shared, edge_shared_side(b, out->sides, out->p), out->side[1]);
    out->open = out->open & ~shared;
    out->probability = out->probability * f_from_i(i_max(EDGE_FIELD(b, e, sharers), i_set(1)));
}

static void edge_of_mesh(const SceneView *scene, const BoundaryJob *b, Int e, Float t, Mask m, EdgePoint *out) {
    Int corner = i_select(m, EDGE_FIELD(b, e, corner), i_set(0));
    Hit hit = out->hit;
    hit.prim = i_select(m, EDGE_FIELD(b, e, prim), i_set(0));
    hit.shape = i_select(m, hit.shape, i_set(i_lane(hit.shape, m_first(m))));
    Corners c = mesh_corners(scene, hit.shape, hit.prim);
    Mask second = mi_eq(corner, i_set(1)), third = mi_eq(corner, i_set(2));
    Int from = i_select(second, c.i[1], i_select(third, c.i[2], c.i[0]));
    Int to = i_select(second, c.i[2], i_select(third, c.i[0], c.i[1]));
    Int apex = i_select(second, c.i[0], i_select(third, c.i[1], c.i[2]));
    Int opposite = EDGE_FIELD(b, e, opposite), positions = SHAPE_FIELD(scene, hit.shape, positions);
    Vec3 a = theta_v3(scene, positions + from * 3);
    Vec3 v[4] = {a, v3_sub(theta_v3(scene, positions + to * 3), a), v3_sub(theta_v3(scene, positions + apex * 3), a),
                 v3_sub(theta_v3(scene, positions + i_select(m, i_max(opposite, i_set(0)), i_set(0)) * 3), a)};
    Vec3 p = v3_madd(a, t, v[1]);
    Mask inside = m & mi_lt(i_set(-1), SHAPE_FIELD(scene, hit.shape, collection));
    if (m_any(inside)) {
        hit.instance = i_select(inside, hit.instance, i_set(0));
        p = v3_select(inside, pose_to_world(scene, instance_table(scene, &hit), p), p);
        for (int k = 1; k < 4; k++) {
            v[k] = v3_select(inside, instance_vector(scene, instance_table(scene, &hit), v[k]), v[k]);
        }
    }
    out->hit.prim = i_select(m, hit.prim, out->hit.prim);
    out->hit.u = f_select(m, f_select(second, 1.0f - t, f_select(third, f_set(0), t)), out->hit.u);
    out->hit.v = f_select(m, f_select(second, t, f_select(third, 1.0f - t, f_set(0))), out->hit.v);
    out->p = v3_select(m, p, out->p);
    out->tangent = v3_select(m, v[1], out->tangent);
    out->origin = v3_select(m, a, out->origin);
    out->side[0] = v3_select(m, v[2], out->side[0]);
    out->side[1] = v3_select(m, v[3], out->side[1]);
    out->open = out->open & ~(m & mi_lt(i_set(-1), opposite));
}

// Where a shading normal is at right angles to the direction to `eye`, or to `eye` itself where the view is parallel.
static void edge_of_terminator(const SceneView *scene, Float t, Vec3 eye, bool parallel, Mask m, EdgePoint *out) {
    Facet f = facet_load(scene, &out->hit, m);
    Float u, v, which = f_min(f_floor(6.0f * t), f_set(5)), s = 6.0f * t - which;
    Int choice = i_from_f(which);
    Mask found = m & facet_cross(&f, eye, parallel, choice >> 1, mi_eq(choice & 1, i_set(1)), s, &u, &v);
    Vec2 slope = facet_slope(&f, eye, parallel, u, v);
    // The curve runs along (du, dv) = (-slope.y, slope.x), here in units in which |du| + |dv| + |du + dv| = 1.
    Float size = f_abs(slope.x) + f_abs(slope.y) + f_abs(slope.x - slope.y), r = f_safe_rcp(size);
    Vec3 e1 = v3_sub(f.p[1], f.p[0]), e2 = v3_sub(f.p[2], f.p[0]), n = facet_at(f.n, u, v);
    Vec3 tangent = v3_scale(v3_madd(v3_scale(e1, -slope.y), slope.x, e2), r);
    Float length = v3_length(n), steep = slope.x * slope.x + slope.y * slope.y;
    Vec3 rise = v3_scale(v3_madd(v3_scale(e1, slope.x), slope.y, e2), length * f_safe_rcp(steep));
    found = found & m_gt(size, f_set(0)) & m_gt(length, f_set(0));
    out->p = v3_select(m, facet_at(f.p, u, v), out->p);
    out->hit.u = f_select(m, u, out->hit.u);
    out->hit.v = f_select(m, v, out->hit.v);
    out->tangent = v3_select(m, tangent, out->tangent);
    out->normal = v3_select(m, v3_scale(n, f_safe_rcp(length)), out->normal);
    out->view = v3_select(m, facet_view(eye, parallel, out->p), out->view);
    out->rise = v3_select(m, rise, out->rise);
    out->open = out->open & ~m;
    out->probability = f_select(m, f_zero_unless(found, out->probability * (1.0f / 6)), out->probability);
}

KFN Vec3 meeting_end(const BoundaryJob *b, Int i, int end) {
    return v3(MEETING_FLOAT(b, i, ends, 3 * end), MEETING_FLOAT(b, i, ends, 3 * end + 1),
              MEETING_FLOAT(b, i, ends, 3 * end + 2));
}

// Where the surface is a tube: the distance from it.
static Float meeting_tube(const SceneView *scene, const BoundaryJob *b, Int i, int which, Vec3 x, Float value, Vec3 *gradient) {
    Int shape = MEETING_INT(b, i, shape[which]);
    Mask tube = mi_lt(i_set(-1), shape) & mi_eq(SHAPE_FIELD(scene, i_max(shape, i_set(0)), kind), i_set(SHAPE_BSPLINE));
    if (!m_any(tube)) {
        return value;
    }
    Hit hit = {i_select(tube, shape, i_set(i_lane(shape, m_first(tube)))), i_select(tube, MEETING_INT(b, i, prim[which]), i_set(0)),
               f_set(0), f_set(0), x, MEETING_INT(b, i, instance[which])};
    Vec3 slope;
    Float distance = tube_distance(scene, &hit, x, &slope);
    *gradient = v3_select(tube, slope, *gradient);
    return f_select(tube, distance, value);
}

// The value of one of the two surfaces of a meeting at x, and its gradient.
static Float meeting_surface(const SceneView *scene, const BoundaryJob *b, Int i, int which, Vec3 x, Vec3 *gradient) {
    Float y[3], g[3], value = MEETING_FLOAT(b, i, surface[which].constant, 0);
    y[0] = x.x - MEETING_FLOAT(b, i, surface[which].centre, 0);
    y[1] = x.y - MEETING_FLOAT(b, i, surface[which].centre, 1);
    y[2] = x.z - MEETING_FLOAT(b, i, surface[which].centre, 2);
    for (int k = 0; k < 3; k++) {
        int p = (k + 1) % 3, q = (k + 2) % 3;
        Float my = MEETING_FLOAT(b, i, surface[which].matrix, k) * y[k] +
                   MEETING_FLOAT(b, i, surface[which].matrix, 3 + q) * y[p] +
                   MEETING_FLOAT(b, i, surface[which].matrix, 3 + p) * y[q];
        Float linear = MEETING_FLOAT(b, i, surface[which].linear, k);
        g[k] = my + linear;
        value = value + (0.5f * my + linear) * y[k];
    }
    *gradient = v3(g[0], g[1], g[2]);
    return scene->segments_count ? meeting_tube(scene, b, i, which, x, value, gradient) : value;
}

// The curve along which two surfaces pass through each other: its point in the plane through p(t), on the straight line between
// its ends, at right angles to that line.
static void edge_of_meeting(const SceneView *scene, const BoundaryJob *b, Int e, Float t, Mask m, EdgePoint *out) {
    Int i = i_select(m, EDGE_FIELD(b, e, prim), i_set(0));
    Vec3 from = meeting_end(b, i, 0), along = v3_sub(meeting_end(b, i, 1), from), p = v3_madd(from, t, along), g[2];
    for (int step = 0; step < 4; step++) {
        Float f0 = meeting_surface(scene, b, i, 0, p, g), f1 = meeting_surface(scene, b, i, 1, p, g + 1);
        Vec3 back = v3_sub(v3_scale(v3_cross(along, g[0]), f1), v3_scale(v3_cross(along, g[1]), f0));
        Float r = f_safe_rcp(v3_dot(along, v3_cross(g[0], g[1])));
        p = v3_madd(p, -r, back);
    }
    Vec3 tangent = v3_cross(g[0], g[1]);
    tangent = v3_scale(tangent, v3_dot(along, along) * f_safe_rcp(v3_dot(along, tangent)));
    Hit *hits[2] = {&out->hit, &out->met};
    for (int k = 0; k < 2; k++) {
        Vec3 normal;
        Hit hit = point_hit(scene, i_select(m, MEETING_INT(b, i, shape[k]), i_set(-1)), MEETING_INT(b, i, prim[k]),
                            MEETING_INT(b, i, instance[k]), p, &normal);
        hits[k]->shape = i_select(m, MEETING_INT(b, i, shape[k]), hits[k]->shape);
        hits[k]->prim = i_select(m, hit.prim, hits[k]->prim);
        hits[k]->instance = i_select(m, hit.instance, hits[k]->instance);
        hits[k]->u = f_select(m, hit.u, hits[k]->u);
        hits[k]->v = f_select(m, hit.v, hits[k]->v);
        out->across[k] = v3_normalize(g[k]);
    }
    out->met.p = p;
    out->p = v3_select(m, p, out->p);
    out->tangent = v3_select(m, tangent, out->tangent);
    // Never a silhouette: whoever sees it sees both.
    out->side[0] = v3_select(m, v3_cross(tangent, g[0]), out->side[0]);
    out->side[1] = v3_select(m, v3_neg(out->side[0]), out->side[1]);
    out->open = out->open & ~m;
    out->border = m & mi_lt(out->met.shape, i_set(0)) & mi_lt(i_set(-1), out->met.prim);
}

// The points beside the border of a light on a surface: so close that seldom another border lies between them.
static void edge_beside_border(const SceneView *scene, EdgePoint *out) {
    const Float step = 0.1f * interaction_step(out->p);
    for (int k = 0; k < 2; k++) {
        Vec3 normal, p = v3_madd(out->p, step * f_safe_rcp(v3_length(out->side[k])), out->side[k]);
        Hit hit = point_hit(scene, i_select(out->border, out->hit.shape, i_set(-1)), out->hit.prim, out->hit.instance, p, &normal);
        hit.p = p;
        out->beside[k] = hit_select(out->border, &hit, out->beside + k);
    }
}

// The line along which a texture jumps, on both sides of which the same surface is seen.
static void edge_of_mark(const SceneView *scene, const BoundaryJob *b, Int e, Float t, Mask m, EdgePoint *out) {
    Int number = i_select(m, EDGE_FIELD(b, e, corner), i_set(0));
    MarkFrame f;
    out->half = m & mi_eq(MARK_INT(b, number, half), i_set(1));
    out->line = i_select(m & mi_lt(i_set(-1), MARK_INT(b, number, at)), number, i_set(-1));
    out->hit.prim = i_select(m, EDGE_FIELD(b, e, prim), out->hit.prim);
    for (int k = 0; k < 2; k++) {
        Float off = f_select(out->half, f_set(MARK_STEP), f_set(k ? -MARK_STEP : MARK_STEP));
        out->beside[k] = out->hit;
        out->beside[k].p = mark_at(scene, b, number, t, off, &out->beside[k], m, &f);
    }
    Vec3 p = mark_at(scene, b, number, t, f_zero_unless(out->half, f_set(MARK_STEP)), &out->hit, m, &f);
    Float slope = MARK_FLOAT(b, number, u) * f.turned.x + MARK_FLOAT(b, number, v) * f.turned.y;
    // Where the end of a surface leaves no room for the other side, uv alone is taken across the line.
    Float near = f_safe_rcp(f_sqrt(f.turned.x * f.turned.x + f.turned.y * f.turned.y)) * MARK_STEP;
    near = f_zero_unless(mi_lt(i_set(-1), out->line), near);
    Float far = near + f_zero_unless(out->half, 2.0f * MARK_STEP * f.unit);
    out->nudge[0] = (Vec2){near * f.turned.x, near * f.turned.y};
    out->nudge[1] = (Vec2){-far * f.turned.x, -far * f.turned.y};
    out->uv = f.uv;
    out->rise = v3_select(mi_lt(i_set(-1), out->line), v3_scale(f.across, f_safe_rcp(slope)), out->rise);
    out->p = v3_select(m, p, out->p);
    out->tangent = v3_select(m, f.tangent, out->tangent);
    out->side[0] = v3_select(m, f.across, out->side[0]);
    out->side[1] = v3_select(m, v3_neg(f.across), out->side[1]);
    out->open = out->open & ~m;
}

// Adds what lines of textures are worth that move where their steps F change: to_uv has them change by `df`.
static void edge_line_adj(const BoundaryJob *b, const EdgePoint *e, Float df, Sink *sink, Mask m) {
    m = m & mi_lt(i_set(-1), e->line);
    if (!m_any(m)) {
        return;
    }
    Int line = i_select(m, e->line, i_set(0)), at = i_select(m, MARK_INT(b, line, at), i_set(0));
    Float d = f_zero_unless(m, df) * MARK_FLOAT(b, line, scale);
    sink_add_v3(sink, at, v3(d * e->uv.x, d * e->uv.y, d), m);
}

// A point of a random edge; u in the unit square.
static NOINLINE EdgePoint edge_sample(const SceneView *scene, const BoundaryJob *b, Vec2 u, Vec3 eye, bool parallel) {
    EdgePoint out;
    Int e = edge_choose(b, u.x, &out.probability), kind = EDGE_FIELD(b, e, kind);
    Float first = EDGE_FLOAT(b, e, first), range = EDGE_FLOAT(b, e, last) - first, t = first + range * u.y;
    out.hit = (Hit){EDGE_FIELD(b, e, shape), i_set(0), f_set(0), f_set(0), v3_zero(), EDGE_FIELD(b, e, instance)};
    out.probability = out.probability * f_safe_rcp(range);
    out.p = out.tangent = out.side[0] = out.side[1] = v3_zero();
    out.normal = out.view = out.rise = out.across[0] = out.across[1] = v3_zero();
    out.inner = out.middle = out.outside = v3_zero();
    out.open = m_set(true);
    out.other = EDGE_FIELD(b, e, other);
    out.fan = EDGE_FIELD(b, e, fan);
    out.fan_count = EDGE_FIELD(b, e, fan_count);
    out.sides = i_set(0);
    out.side_count = EDGE_FIELD(b, e, side_count);
    out.origin = v3_zero();
    out.crease = mi_lt(i_set(0), EDGE_FIELD(b, e, crease));
    Mask mesh = mi_eq(kind, i_set(EDGE_MESH)), terminator = mi_eq(kind, i_set(EDGE_TERMINATOR));
    out.meeting = mi_eq(kind, i_set(EDGE_MEETING));
    out.met = out.hit;
    out.border = m_set(false);
    if (m_any(mesh)) {
        edge_of_mesh(scene, b, e, t, mesh, &out);
    }
    edge_of_round(scene, b, e, kind, t, eye, parallel, &out);
    edge_of_several(b, e, &out);
    if (m_any(terminator)) {
        out.hit.prim = i_select(terminator, EDGE_FIELD(b, e, prim), out.hit.prim);
        edge_of_terminator(scene, t, eye, parallel, terminator, &out);
    }
    if (m_any(out.meeting)) {
        edge_of_meeting(scene, b, e, t, out.meeting, &out);
    }
    out.mark = mi_eq(kind, i_set(EDGE_MARK));
    out.beside[0] = out.beside[1] = out.hit;
    out.nudge[0] = out.nudge[1] = out.uv = (Vec2){f_set(0), f_set(0)};
    out.half = m_set(false);
    out.line = i_set(-1);
    if (m_any(out.mark)) {
        edge_of_mark(scene, b, e, t, out.mark, &out);
    }
    if (m_any(out.border)) {
        edge_beside_border(scene, &out);
    }
    out.hit.p = out.p;
    return out;
}

// x in n = x a + y b, of unit vectors in one plane.
KFN Float part_along(Vec3 n, Vec3 a, Vec3 b) {
    Float c = v3_dot(a, b);
    return (v3_dot(n, a) - c * v3_dot(n, b)) * f_safe_rcp(1.0f - c * c);
}

// The middle of the surfaces of round edges, and the point itself of others.
KFN Vec3 edge_reference(const EdgePoint *e) { return v3_select(e->round, e->middle, e->p); }

// How far a surface at an edge rises above the plane with the unit normal n through it; 0 where it lies in the plane as far as
// floats can tell.
KFN Float edge_rise(const EdgePoint *e, Vec3 side, Vec3 n) {
    Float rise = v3_dot(side, n), least = 1e-6f * v3_length(side) + 1e-7f * v3_length(e->p);
    return f_zero_unless(m_gt(f_abs(rise), least), rise);
}

// That of the first surface that does not lie in the plane.
KFN Float edge_first_rise(const EdgePoint *e, Vec3 n) {
    Float rise = edge_rise(e, e->side[0], n);
    return f_select(m_gt(f_abs(rise), f_set(0)), rise, f_zero_unless(~e->open, edge_rise(e, e->side[1], n)));
}

// The cotangent of the angle between a and b where it is acute, MOST_WEDGE at most; else 0.
KFN Float acute_cotangent(Vec3 a, Vec3 b) {
    Float cosine = v3_dot(a, b), sine = v3_length(v3_cross(a, b));
    return f_zero_unless(m_gt(cosine, f_set(0)), f_min(cosine * f_safe_rcp(sine), f_set(MOST_WEDGE)));
}

// How far from an edge between two surfaces that meet at an acute angle, by which they part too slowly: rays that start a step
// (interaction_step) off the one, into the wedge, must start on their own side of the other. 0 elsewhere.
KFN Float edge_wedge(const EdgePoint *e) {
    Vec3 across[2];
    for (int i = 0; i < 2; i++) {
        Float run = v3_dot(e->side[i], e->tangent) * f_safe_rcp(v3_dot(e->tangent, e->tangent));
        across[i] = v3_madd(e->side[i], -run, e->tangent);
    }
    Float steps = acute_cotangent(across[0], across[1]) * MEETING_STEPS;
    return f_zero_unless(~(e->open | e->round | e->meeting), steps * interaction_step(e->p));
}

// Whether a surface at an edge lies on the same side as `first`. What rays along d meet edge-on is an outline once, at the edge
// that they pass first: a noon sun on an upright wall, a plan of it.
KFN Mask edge_goes_with(const EdgePoint *e, Vec3 side, Vec3 n, Vec3 d, Float first) {
    Float rise = edge_rise(e, side, n);
    return m_gt(rise * first, f_set(0)) | (m_le(f_abs(rise), f_set(0)) & m_gt(v3_dot(side, d), f_set(0)));
}

// Whether all triangles at an edge lie on one side of the plane with normal n through it and d: a silhouette for rays in that
// plane along d. Elsewhere such rays pass from one of its faces to another.
static Mask edge_is_silhouette(const SceneView *scene, const BoundaryJob *b, const EdgePoint *e, Vec3 n, Vec3 d) {
    Float first = edge_first_rise(e, n);
    Mask silhouette = e->open | (edge_goes_with(e, e->side[0], n, d, first) & edge_goes_with(e, e->side[1], n, d, first));
    silhouette = silhouette & m_gt(f_abs(first), f_set(0));
    Mask left = silhouette & mi_lt(i_set(0), e->fan_count);
    for (int32_t i = 0; m_any(left); i++, left = left & mi_lt(i_set(i), e->fan_count)) {
        Hit hit = e->hit;
        hit.shape = i_select(left, hit.shape, i_set(i_lane(hit.shape, m_first(left))));
        Int vertex = i_gather(b->fans, i_select(left, e->fan + i, i_set(0)));
        Int at = i_select(left, SHAPE_FIELD(scene, hit.shape, positions) + vertex * 3, i_set(0));
        Vec3 side = v3_sub(theta_v3(scene, at), e->origin);
        Mask inside = left & mi_lt(i_set(-1), SHAPE_FIELD(scene, hit.shape, collection));
        if (m_any(inside)) {
            hit.instance = i_select(inside, hit.instance, i_set(0));
            side = v3_select(inside, instance_vector(scene, instance_table(scene, &hit), side), side);
        }
        silhouette = silhouette & (~left | edge_goes_with(e, side, n, d, first));
    }
    left = silhouette & mi_lt(i_set(1), e->side_count);
    for (int32_t i = 1; m_any(left); i++, left = left & mi_lt(i_set(i), e->side_count)) {
        Vec3 side = edge_shared_side(b, i_select(left, e->sides + i, i_set(0)), e->p);
        silhouette = silhouette & (~left | edge_goes_with(e, side, n, d, first));
    }
    return silhouette;
}

// Lanes of m in which hits lie on one of the other surfaces that end there; *faces: in its part that does.
static Mask edge_meets_others(const BoundaryJob *b, const EdgePoint *e, const Hit *hit, Mask m, Mask *faces) {
    Mask found = m_set(false), left = m & mi_lt(i_set(0), e->side_count);
    *faces = found;
    for (int32_t i = 0; m_any(left); i++, left = left & mi_lt(i_set(i), e->side_count)) {
        Int at = i_select(left, e->sides + i, i_set(0)), prim = SHARED_INT(b, at, prim);
        Mask one = left & mi_eq(hit->shape, SHARED_INT(b, at, shape)) & mi_eq(hit->instance, SHARED_INT(b, at, instance));
        found = found | one;
        *faces = *faces | (one & mi_eq(hit->prim, prim));
    }
    return found;
}

// Lanes of m in which nothing hides the edge's point itself. viewed: from the sensor.
static Mask edge_is_seen(Tracer *t, const BoundaryJob *b, const EdgePoint *e, bool viewed, const Ray rays[2], Mask m) {
    Vec3 o = v3_scale(v3_add(rays[0].o, rays[1].o), f_set((real)0.5)), to = v3_sub(e->p, o);
    Float reach = v3_length(to);
    Ray ray = {o, v3_scale(to, f_safe_rcp(reach)), f_set(INFINITY)};
    Hit hit = trace_solid(t, &ray, viewed, m, NULL);
    Mask own = mi_eq(hit.shape, e->hit.shape) & mi_eq(hit.instance, e->hit.instance) &
               (e->round | mi_eq(hit.prim, e->hit.prim) | mi_eq(hit.prim, e->other));
    Mask faces;
    edge_meets_others(b, e, &hit, m, &faces);
    own = own | faces;
    return m & (mi_lt(hit.shape, i_set(0)) | own | m_gt(v3_dot(v3_sub(hit.p, o), ray.d), reach * (1.0f - 1e-4f)));
}

// Lanes of m in which two rays, the second one on the side of n, pass an edge between the surfaces that meet or end there. Next
// to a corner a path may miss them; what it meets instead belongs to another edge's jump. viewed: they come from the sensor.
static Mask edge_between(Tracer *t, const BoundaryJob *b, const EdgePoint *e, bool viewed, Mask silhouette, Vec3 n,
                         const Ray rays[2], Mask m) {
    Mask own[2], clear[2], grazed[2], here[2], above = m_gt(edge_first_rise(e, n), f_set(0));
    for (int side = 0; side < 2; side++) {
        Ray ray = rays[side];
        Hit hit = trace_solid(t, &ray, viewed, m, NULL);
        Float reach = v3_dot(v3_sub(e->p, ray.o), ray.d), found = v3_dot(v3_sub(hit.p, ray.o), ray.d);
        Mask met = mi_lt(i_set(-1), hit.shape), near = m_le(f_abs(found - reach), 1e-3f * reach);
        // Surfaces that pass through each other are met where the ray is as far from the curve, by the angle in which it does.
        Float beside = 2.0f * v3_length(v3_sub(v3_madd(ray.o, reach, ray.d), e->p));
        Mask own_near = near | m_le(f_abs(found - reach), beside * f_safe_rcp(f_abs(v3_dot(ray.d, e->across[0]))));
        Mask met_near = near | m_le(f_abs(found - reach), beside * f_safe_rcp(f_abs(v3_dot(ray.d, e->across[1]))));
        own[side] = mi_eq(hit.shape, e->hit.shape) & mi_eq(hit.instance, e->hit.instance);
        Mask faces = own[side] & (mi_eq(hit.prim, e->hit.prim) | mi_eq(hit.prim, e->other) |
                                  (own_near & mi_eq(e->other, i_set(EDGE_ANY))));
        Mask their_faces, others = edge_meets_others(b, e, &hit, met, &their_faces);
        faces = faces | their_faces;
        if (m_any(e->meeting)) {
            Mask other = met & mi_eq(hit.shape, e->met.shape) & mi_eq(hit.instance, e->met.instance);
            faces = faces | (e->meeting & met_near & other);
        }
        // Of a rim that is seen edge-on, one half hides the other.
        Mask rim = mi_eq(e->other, i_set(EDGE_ANY)) & ~e->round;
        own[side] = (silhouette & (own[side] | others) & (~rim | near)) | faces;
        here[side] = own[side] & m_le(f_abs(found - reach), 1e-2f * reach);
        clear[side] = ~met | m_gt(found, reach * (1.0f - 1e-4f));
        grazed[side] = ~clear[side] & m_gt(found, reach * (1.0f - 2e-2f));
    }
    // What the edge stands on is met just before it.
    Mask open = m & silhouette & ((above & own[1] & grazed[0]) | (~above & own[0] & grazed[1]));
    if (m_any(open)) {
        Mask seen = edge_is_seen(t, b, e, viewed, rays, open);
        clear[0] = clear[0] | (seen & grazed[0]);
        clear[1] = clear[1] | (seen & grazed[1]);
    }
    Mask inside = (above & own[1] & clear[0]) | (~above & own[0] & clear[1]);
    // Where the side of a cylinder comes into view beside a disk that closes it, it is narrower than the rays are apart.
    Mask closed = mi_eq(e->other, i_set(EDGE_ANY)) & mi_lt(i_set(0), e->side_count);
    Mask beside = closed & ((here[0] & clear[1]) | (here[1] & clear[0]));
    return m & ((silhouette & inside) | (~silhouette & ((own[0] & own[1]) | beside)));
}
