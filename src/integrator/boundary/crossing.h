// crossing.h: which edge lies between two lines of sight that part: what they meet says it, and how it moves. With r a point
// of the line there, both sides part where F = n . e - n' . e' - (n - n') . r = 0. Of an edge, e is its point, n the normal of
// the plane of edge and line, and n' = 0. Where two surfaces pass through each other, their points e and e' are at the same
// distance on the line, n = N / (N . d) and n' = N' / (N' . d). Lines of textures are as edges.
// Meshes with vertex normals add two curves on which F = n . d = 0 within one triangle (turning.h): n its shading normal, which
// turns away from the line that meets it there; or n its plane's normal at the vertex before, in front of which or behind which
// what is mirrored or refracted there along d begins.
#pragma once

#include "integrator/boundary/alike.h"
#include "integrator/boundary/beam.h"
#include "integrator/boundary/sightline.h"

typedef struct Crossing {
    Hit hit, other;      // e and e', as attached points
    Vec3 p;              // on the line
    Vec3 n, n_other, across; // across: n - n'
    Mask m, meeting;
    Float wedge;         // how far off the paths must pass it [MEETING_STEPS]: between faces of one mesh, the cotangent of their
                         // angle where it is acute; else 0
    Mask terminator, horizon; // n . view = 0 in the triangle of `hit`: where the line ends, or at the vertex before
    Vec3 view;
    Int light;           // whose border the surface of `hit` passes through there, else -1: `other` is that
    Int step;            // of the texture that jumps there, else -1: how it rises over the surface, and uv
    Vec3 rise;
    Vec2 uv;
} Crossing;

// The edge of the surface of `own` that is next to another ray. inside: how far that passes on the surface's side of it, as a
// share of the surface's size; less than 0, it misses the surface.
typedef struct Miss {
    Hit edge;
    Vec3 n;
    Float inside;
    Vec3 normal, du, dv; // of the surface at `own`: its unit normal, and tangents along u and v
} Miss;

// Where rounding could have brought a ray from one side of an edge to the other.
#define MISS_NEAR 1e-4f

static Miss miss_triangle(const SceneView *scene, int32_t flags, const Hit *own, Vec3 o, Vec3 d) {
    Vec3 p[3];
    triangle_load(scene, flags, own, p);
    Vec3 e1 = v3_sub(p[1], p[0]), e2 = v3_sub(p[2], p[0]), g = v3_cross(e1, e2);
    Float s = v3_dot(v3_sub(p[0], o), g) * f_safe_rcp(v3_dot(d, g)), rcp = f_safe_rcp(v3_dot(g, g));
    Vec3 q = v3_sub(v3_madd(o, s, d), p[0]);
    Float u = v3_dot(v3_cross(q, e2), g) * rcp, v = v3_dot(v3_cross(e1, q), g) * rcp;
    Float there[3] = {1.0f - u - v, u, v}, here[3] = {1.0f - own->u - own->v, own->u, own->v};
    Mask first = m_lt(there[0], there[1]) & m_lt(there[0], there[2]), second = ~first & m_lt(there[1], there[2]);
    Float b = f_select(first, there[0], f_select(second, there[1], there[2]));
    Float a = f_max(f_select(first, here[0], f_select(second, here[1], here[2])), f_set(0));
    Float part = f_select(m_lt(b, f_set(0)), a * f_safe_rcp(a - b), f_set(1));
    Miss out = {.edge = *own, .inside = f_select(m_gt(s, f_set(0)), b, f_set(-1))};
    out.edge.u = own->u + part * (u - own->u);
    out.edge.v = own->v + part * (v - own->v);
    out.edge.p = v3_madd(v3_madd(p[0], out.edge.u, e1), out.edge.v, e2);
    Vec3 tangent = v3_select(first, v3_sub(p[2], p[1]), v3_select(second, e2, e1));
    out.n = v3_normalize(v3_cross(d, tangent));
    return out;
}

static Miss miss_sphere(const SceneView *scene, const Hit *own, Vec3 o, Vec3 d) {
    Int at = SHAPE_FIELD(scene, own->shape, table);
    Vec3 centre = table_v3(scene, at), q = v3_sub(o, centre);
    Float radius = table_at(scene, at + 3);
    q = v3_madd(q, -v3_dot(q, d), d);
    Float distance = v3_length(q);
    Miss out = {.edge = *own, .inside = 1.0f - distance * f_safe_rcp(radius)};
    out.n = v3_scale(q, f_safe_rcp(distance));
    out.edge.p = v3_madd(centre, radius, out.n);
    return out;
}

// The unit circle at a height, next to a point.
static void miss_rim(const SceneView *scene, Int at, Vec3 q, Float height, Vec3 d, Float inside, Miss *out, Mask m) {
    Float r = f_safe_rcp(f_sqrt(q.x * q.x + q.y * q.y)), x = q.x * r, y = q.y * r;
    Vec3 tangent = v3_madd(v3_scale(pose_column(scene, at, 0), -y), x, pose_column(scene, at, 1));
    out->edge.p = v3_select(m, pose_to_world(scene, at, v3(x, y, height)), out->edge.p);
    out->n = v3_select(m, v3_normalize(v3_cross(d, tangent)), out->n);
    out->inside = f_select(m, inside, out->inside);
}

static Miss miss_disk(const SceneView *scene, const Hit *own, Vec3 o, Vec3 d) {
    Int at = SHAPE_FIELD(scene, own->shape, table);
    Vec3 lo = pose_to_local(scene, at, o), ld = pose_direction_to_local(scene, at, d);
    Vec3 q = v3_madd(lo, -lo.z * f_safe_rcp(ld.z), ld);
    Miss out = {.edge = *own, .n = v3_zero()};
    miss_rim(scene, at, q, f_set(0), d, 1.0f - f_sqrt(q.x * q.x + q.y * q.y), &out, m_set(true));
    return out;
}

static Miss miss_cylinder(const SceneView *scene, const Hit *own, Vec3 o, Vec3 d) {
    Int at = SHAPE_FIELD(scene, own->shape, table);
    Vec3 lo = pose_to_local(scene, at, o), ld = pose_direction_to_local(scene, at, d);
    Float a = ld.x * ld.x + ld.y * ld.y, b = lo.x * ld.x + lo.y * ld.y, c = lo.x * lo.x + lo.y * lo.y - 1.0f;
    Float root = b * b - a * c, rcp = f_safe_rcp(a), width = f_safe_sqrt(root) * rcp;
    Float middle = -b * rcp, here = v3_dot(v3_sub(own->p, o), d);
    Mask behind = m_gt(here, middle);
    Vec3 q = v3_madd(lo, middle + f_select(behind, width, -width), ld);
    // The ray's distance from the axis, and its place along it.
    Float across = 1.0f - f_sqrt(f_max(1.0f - root * rcp, f_set(0))), along = f_min(q.z, 1.0f - q.z);
    Mask aside = m_lt(across, f_set(0)) | m_lt(across, along), low = m_lt(q.z, f_set((real)0.5));
    Miss out = {.edge = *own, .n = v3_zero()};
    miss_rim(scene, at, q, f_set(0), d, along, &out, ~aside & low);
    miss_rim(scene, at, q, f_set(1), d, along, &out, ~aside & ~low);
    miss_rim(scene, at, q, q.z, d, across, &out, aside);
    out.n = v3_select(aside, v3_normalize(v3_cross(d, pose_column(scene, at, 2))), out.n);
    return out;
}

// Next to the tube where it is closest to the ray, from the foot of `own` on, or to the circle at which it ends.
static NOINLINE Miss miss_tube(const SceneView *scene, const Hit *own, Vec3 o, Vec3 d) {
    enum { APPROACHES = 6 };
    Hit h = *own, entry = *own;
    Float t = v3_dot(v3_sub(own->p, o), d);
    TubeLine l = tube_line(scene, &h, v3_madd(o, t, d), d);
    for (int i = 1; i < APPROACHES; i++) { // to where |x - c| - r is least
        t = t - f_clamp(l.f1 * f_safe_rcp(l.f2), -l.foot.r, l.foot.r);
        l = tube_line(scene, &h, v3_madd(o, t, d), d);
    }
    const CurvePoint c = l.foot;
    Float distance = v3_length(l.away), across = 1.0f - distance * f_safe_rcp(c.r);
    Vec3 e = v3_scale(l.away, f_safe_rcp(distance));
    Miss out = {.edge = h, .inside = across};
    out.edge.u = f_clamp(h.u, f_set(0), f_set(1));
    out.edge.p = v3_madd(c.c, c.r, e);
    out.n = v3_normalize(v3_madd(e, -c.r1 * l.slope, c.c1));
    // Where the ray enters, and how far from an end that is.
    Float half = f_safe_sqrt(-l.f * f_safe_rcp(l.f2));
    bspline_foot(scene, &entry, v3_madd(o, t - half, d), 2);
    Mask low = tube_ends(scene, own, false), high = tube_ends(scene, own, true);
    Float speed = v3_length(c.c1) * f_safe_rcp(c.r), begin = entry.u * speed, rest = (1.0f - entry.u) * speed;
    Float along = f_min(f_select(low, begin, f_set(INFINITY)), f_select(high, rest, f_set(INFINITY)));
    Mask rim = m_ge(across, f_set(0)) & m_lt(along, across);
    if (m_any(rim)) {
        Hit end = *own;
        end.u = f_select(low & (m_lt(begin, rest) | ~high), f_set(0), f_set(1));
        CurvePoint p = bspline_point(scene, &end);
        Vec3 axis = v3_normalize(p.c1), q = v3_sub(p.c, o);
        q = v3_sub(v3_scale(d, v3_dot(q, axis) * f_safe_rcp(v3_dot(d, axis))), q);
        Vec3 radial = v3_normalize(v3_madd(q, -v3_dot(q, axis), axis));
        out.edge.u = f_select(rim, end.u, out.edge.u);
        out.edge.p = v3_select(rim, v3_madd(p.c, p.r, radial), out.edge.p);
        out.n = v3_select(rim, v3_normalize(v3_cross(d, v3_cross(axis, radial))), out.n);
        out.inside = f_select(rim, along, out.inside);
    }
    return out;
}

static Miss miss_round(const SceneView *scene, int32_t kind, const Hit *own, Vec3 o, Vec3 d) {
    switch (kind) {
    case SHAPE_SPHERE:
        return miss_sphere(scene, own, o, d);
    case SHAPE_DISK:
        return miss_disk(scene, own, o, d);
    case SHAPE_CYLINDER:
        return miss_cylinder(scene, own, o, d);
    case SHAPE_BSPLINE:
        return miss_tube(scene, own, o, d);
    default:
        return (Miss){.edge = *own, .n = v3_zero(), .inside = f_set(1)};
    }
}

// Through the group's own space.
static Miss miss_instance(const SceneView *scene, int32_t kind, const Hit *own, Vec3 o, Vec3 d) {
    Int at = instance_table(scene, own);
    Hit local = instance_hit(scene, own);
    Miss out = miss_round(scene, kind, &local, pose_to_local(scene, at, o), v3_normalize(pose_direction_to_local(scene, at, d)));
    out.edge.p = pose_to_world(scene, at, out.edge.p);
    out.n = pose_normal(scene, at, out.n);
    return out;
}

// The edges of the surfaces that other rays meet at `own`, next to rays.
static NOINLINE Miss surfaces_miss(const Tracer *t, const Hit *own, Vec3 o, Vec3 d, Mask m) {
    const SceneView *scene = t->scene;
    Miss out = {.edge = *own, .n = v3_zero(), .inside = f_set(1), .normal = v3_zero(), .du = v3_zero(), .dv = v3_zero()};
    for (Mask left = m; m_any(left);) {
        int32_t id;
        Hit h;
        Mask mine = take_group(scene, own, &left, &id, &h);
        const Group *group = scene->groups + id;
        Miss one = {.edge = h, .n = v3_zero(), .inside = f_set(1)};
        if (group->shape_kind == SHAPE_MESH) {
            one = miss_triangle(scene, group->shape_flags, &h, o, d);
        } else if (group->shape_flags & SHAPE_INSTANCED) {
            one = miss_instance(scene, group->shape_kind, &h, o, d);
        } else {
            one = miss_round(scene, group->shape_kind, &h, o, d);
        }
        Interaction si = shape_interaction(scene, group->shape_kind, group->shape_flags, &h);
        out.normal = v3_select(mine, si.ng, out.normal);
        out.du = v3_select(mine, si.dp_du, out.du);
        out.dv = v3_select(mine, si.dp_dv, out.dv);
        out.edge = hit_select(mine, &one.edge, &out.edge);
        out.n = v3_select(mine, one.n, out.n);
        out.inside = f_select(mine, one.inside, out.inside);
    }
    return out;
}

// What two lines meet at the levels where they part.
typedef struct Ends {
    Hit hit[2];
    Vec3 o[2], d[2];
    Vec2 uv[2];
    Int behind[2];
    Float reach[2];
} Ends;

static void ends_load(const Sightline *line, Int level, int k, Ends *e) {
    e->hit[k] = line->hit[0];
    e->o[k] = line->o[0];
    e->d[k] = line->d[0];
    e->uv[k] = line->uv[0];
    e->behind[k] = line->behind[0];
    for (int32_t i = 1; i < line->last; i++) {
        Mask here = mi_eq(level, i_set(i));
        e->hit[k] = hit_select(here, line->hit + i, e->hit + k);
        e->o[k] = v3_select(here, line->o[i], e->o[k]);
        e->d[k] = v3_select(here, line->d[i], e->d[k]);
        e->uv[k] = (Vec2){f_select(here, line->uv[i].x, e->uv[k].x), f_select(here, line->uv[i].y, e->uv[k].y)};
        e->behind[k] = i_select(here, line->behind[i], e->behind[k]);
    }
    Mask found = mi_lt(i_set(-1), e->hit[k].shape);
    e->reach[k] = f_select(found, v3_dot(v3_sub(e->hit[k].p, e->o[k]), e->d[k]), f_set(INFINITY));
}

// Where they meet one surface on both sides of a line of its texture, half-way between them: the normal of the plane of line and
// ray.
static Mask crossing_mark(const Tracer *t, const BoundaryJob *b, const Ends *e, const Miss *miss, Mask m, Hit *hit, Vec3 *n,
                          Crossing *c) {
    const Hit *h = e->hit;
    Vec2 across;
    m = m & mi_eq(h[0].shape, h[1].shape) & mi_eq(h[0].prim, h[1].prim) & mi_eq(h[0].instance, h[1].instance) &
        mi_eq(e->behind[0], e->behind[1]);
    m = fields_part(t->scene, b, h[0].shape, e->uv[0], e->uv[1], m, &across, &c->step);
    Float steep = f_safe_rcp(across.x * across.x + across.y * across.y);
    c->rise = v3_scale(v3_madd(v3_scale(miss->du, across.x), across.y, miss->dv), steep);
    c->uv = (Vec2){0.5f * (e->uv[0].x + e->uv[1].x), 0.5f * (e->uv[0].y + e->uv[1].y)};
    Vec3 line = v3_madd(v3_scale(miss->du, -across.y), across.x, miss->dv);
    *hit = h[0];
    hit->u = 0.5f * (h[0].u + h[1].u);
    hit->v = 0.5f * (h[0].v + h[1].v);
    hit->p = v3_scale(v3_add(h[0].p, h[1].p), f_set((real)0.5));
    *n = v3_normalize(v3_cross(e->d[0], line));
    return m;
}

// Where a border of light lies between them on one surface: as where surfaces pass through each other, n = x a + y b, a and b the
// normals of both.
static Mask crossing_beam(const Tracer *t, const BoundaryJob *b, const Ends *e, const Miss *miss, Mask m, Crossing *c) {
    BeamBorder border;
    c->light = i_set(-1);
    if (b->beam_count == 0) {
        return m_set(false);
    }
    m = m & mi_eq(e->behind[0], e->behind[1]);
    m = lanes_that(node_spreads, t->scene, e->hit->shape, lines_share(t->scene, e->hit, e->hit + 1, m));
    m = beams_part(t->scene, b, e->hit[0].p, e->hit[1].p, m, &border);
    Vec3 own = miss->normal, n = v3_normalize(v3_cross(e->d[0], v3_cross(own, border.normal)));
    Float x = part_along(n, own, border.normal);
    c->light = i_select(m, border.light, c->light);
    c->n = v3_select(m, v3_scale(own, x), c->n);
    c->n_other = v3_select(m, v3_sub(v3_scale(own, x), n), c->n_other);
    c->hit = hit_select(m, e->hit, &c->hit);
    c->p = v3_select(m, e->hit[0].p, c->p);
    c->wedge = f_select(m, f_set(1.0f / MEETING_STEPS), c->wedge); // beyond what rounding makes of the border
    return m;
}

// Vertices of a level at which two lines meet one triangle with vertex normals; lanes of m.
static Mask smooth_alike(const SceneView *scene, const Hit hit[2], Mask m) {
    m = m & mi_lt(i_set(-1), hit[0].shape) & mi_eq(hit[0].shape, hit[1].shape) & mi_eq(hit[0].prim, hit[1].prim) &
        mi_eq(hit[0].instance, hit[1].instance);
    return m & mi_lt(i_set(0), SHAPE_FIELD(scene, i_select(m, hit[0].shape, i_set(0)), flags) & SHAPE_HAS_NORMALS);
}

// Lanes of m in which the normal of such a triangle turns away from lines that meet it, or its plane from those that leave it.
static void crossing_turns(const Tracer *t, const Sightline lines[2], const Ends *e, Int level, Mask m, Crossing *c) {
    const SceneView *scene = t->scene;
    Ends before;
    Vec3 ng = v3_zero(), shading = ng;
    for (int k = 0; k < 2; k++) {
        ends_load(lines + k, level - 1, k, &before);
    }
    Mask left = smooth_alike(scene, before.hit, m), own = smooth_alike(scene, e->hit, m);
    c->terminator = own & ~mi_eq(e->behind[0], e->behind[1]);
    Hit hit = hit_select(c->terminator, e->hit, before.hit);
    for (left = left | c->terminator; m_any(left);) {
        int32_t id;
        Hit h;
        Mask mine = take_group(scene, &hit, &left, &id, &h);
        Interaction si = shape_interaction(scene, scene->groups[id].shape_kind, scene->groups[id].shape_flags, &h);
        ng = v3_select(mine, si.ng, ng);
        shading = v3_select(mine, si.sh.n, shading);
    }
    c->horizon = ~c->terminator & m_lt(v3_dot(ng, e->d[0]) * v3_dot(ng, e->d[1]), f_set(0));
    Mask turns = c->terminator | c->horizon;
    c->view = e->d[0];
    c->hit = hit_select(turns, &hit, &c->hit);
    c->p = v3_select(turns, e->hit[0].p, c->p);
    c->n = v3_select(turns, v3_select(c->terminator, shading, ng), c->n);
    c->m = c->m | turns;
    c->meeting = c->meeting & ~turns;
    c->wedge = f_zero_unless(~turns, c->wedge);
    c->step = i_select(turns, i_set(-1), c->step);
    c->light = i_select(turns, i_set(-1), c->light);
}

// The wedge between two faces that the lines of m meet.
static Float crossing_wedge(const Ends *e, const Miss *miss, Mask m) {
    const Hit *h = e->hit;
    m = m & mi_eq(h[0].shape, h[1].shape) & mi_eq(h[0].instance, h[1].instance) & ~mi_eq(h[0].prim, h[1].prim);
    return f_zero_unless(m, acute_cotangent(v3_neg(miss[0].normal), miss[1].normal));
}

static NOINLINE Crossing crossing_find(const Tracer *t, const BoundaryJob *b, const Sightline lines[2], Int level, Mask m) {
    Ends e;
    Miss miss[2];
    for (int k = 0; k < 2; k++) {
        ends_load(lines + k, level, k, &e);
    }
    Mask met[2], edge[2];
    for (int k = 0; k < 2; k++) {
        met[k] = m & mi_lt(i_set(-1), e.hit[k].shape);
        miss[k] = surfaces_miss(t, e.hit + k, e.o[1 - k], e.d[1 - k], met[k]);
        edge[k] = met[k] & m_lt(miss[k].inside, f_set(0));
    }
    Hit line;
    Vec3 across;
    Crossing c;
    Mask mark = crossing_mark(t, b, &e, miss, met[0] & met[1], &line, &across, &c);
    // Rounding may leave the other ray inside, too: there it is the edge of what is nearer, or of what ends next to it.
    Mask open = m & ~edge[0] & ~edge[1];
    for (int k = 0; k < 2; k++) {
        Mask nearer = m_lt(e.reach[k], e.reach[1 - k] * 0.999f), close = m_lt(miss[k].inside, f_set(MISS_NEAR));
        edge[k] = edge[k] | (open & met[k] & (~met[1 - k] | nearer | close));
    }
    // Edges of what is nearer hide what lies behind.
    Mask second = edge[1] & (~edge[0] | m_lt(e.reach[1], e.reach[0]));
    c.hit = hit_select(second, &miss[1].edge, &miss[0].edge);
    c.other = e.hit[1];
    c.step = i_select(mark, c.step, i_set(-1));
    c.n = v3_select(second, miss[1].n, miss[0].n);
    c.p = c.hit.p;
    c.meeting = met[0] & met[1] & ~edge[0] & ~edge[1] & ~mark;
    c.wedge = crossing_wedge(&e, miss, met[0] & met[1] & ~c.meeting & ~mark);
    Float slant[2] = {v3_dot(miss[0].normal, e.d[0]), v3_dot(miss[1].normal, e.d[1])};
    c.n = v3_select(c.meeting, v3_scale(miss[0].normal, f_safe_rcp(slant[0])), c.n);
    c.n_other = v3_select(c.meeting, v3_scale(miss[1].normal, f_safe_rcp(slant[1])), v3_zero());
    c.hit = hit_select(c.meeting, e.hit, &c.hit);
    c.p = v3_select(c.meeting, e.hit[0].p, c.p);
    c.hit = hit_select(mark, &line, &c.hit);
    c.p = v3_select(mark, line.p, c.p);
    c.n = v3_select(mark, across, c.n);
    Mask beam = crossing_beam(t, b, &e, miss, met[0] & met[1] & ~mark, &c);
    c.meeting = c.meeting & ~beam;
    c.m = edge[0] | edge[1] | c.meeting | mark | beam;
    crossing_turns(t, lines, &e, level, m, &c);
    c.across = v3_sub(c.n, c.n_other);
    return c;
}

// Adds the motion of what the lines meet there, and of the way of the line to it, worth `worth`. Returns what that asks of
// the ray that the sensor sends to the line's first vertex.
static Carried crossing_move_adj(const Tracer *t, const Crossing *c, const Sightline *line, Int level, Float worth,
                                 Sink *sink) {
    Float own = f_zero_unless(c->m, worth);
    Mask turns = c->terminator | c->horizon;
    Carried end = {v3_select(turns, v3_zero(), v3_scale(c->across, -own)), v3_select(turns, v3_scale(c->n, own), v3_zero())};
    points_move_adj(t, &c->hit, v3_scale(c->n, own), v3_zero(), sink, c->m & ~turns);
    if (m_any(c->meeting)) {
        points_move_adj(t, &c->other, v3_scale(c->n_other, -own), v3_zero(), sink, c->meeting);
    }
    Mask beam = c->m & mi_lt(i_set(-1), c->light);
    if (sink->any_places && m_any(beam)) {
        borders_move_adj(t->scene, c->light, c->p, v3_scale(c->n_other, -own), sink, beam);
    }
    if (m_any(turns)) {
        SurfaceAdj d = surface_adj_zero();
        d.ng = v3_scale(c->view, own);
        surfaces_move_adj(t, &c->hit, &d, sink, c->horizon & c->m);
        d.n = d.ng;
        d.ng = v3_zero();
        end.drag = v3_select(c->terminator, rays_find_adj(t, &c->hit, c->view, &d, sink, c->terminator & c->m), end.drag);
    }
    return sightline_back(t, line, level, c->p, &end, sink, c->m);
}

// The same of lines of textures, by their to_uv: where a step grows, its line moves back over the surface.
static void crossing_line_adj(const BoundaryJob *b, const Crossing *c, Float worth, Sink *sink) {
    Mask m = c->m & mi_lt(i_set(-1), c->step);
    if (!b->lines || !m_any(m)) {
        return;
    }
    Int step = i_select(m, c->step, i_set(0)), at = STEP_INT(b, step, at);
    m = m & mi_lt(i_set(-1), at);
    at = i_select(m, at, i_set(0));
    Float d = f_zero_unless(m, -worth * v3_dot(c->n, c->rise)) * STEP_FLOAT(b, step, scale);
    sink_add_v3(sink, at, v3(d * c->uv.x, d * c->uv.y, d), m);
}
