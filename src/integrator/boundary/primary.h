// primary.h: the boundary term of what the camera sees. A picture is an integral over the film; where the radiance jumps
// by dL along a curve that moves over the film with normal velocity v, its derivative has the line integral of f dL v
// [li2018], docs/derivations/boundary.md, f the reconstruction filter. A sample is a point of an edge, seen by two paths on both
// sides of it that share their random numbers.
// NOT differentiated: jumps of volumes' voxels. What is seen behind mirrors and glass: mirrored.h.
#pragma once

#include "integrator/boundary/segments.h"
#include "integrator/film.h"

// Distance of the two paths from the edge, at most [pixels]: rounding of directions is some ten times smaller.
#define PRIMARY_STEP 2e-3f

// How far from their edges vertices in narrow triangles look up textures [of the way to the middle].
#define PRIMARY_INSET 1e-4f

// Dimensions of its own random numbers; the two paths draw theirs like those of the camera.
#define DIMENSION_EDGE 0x80000001u

// A sample, a pure function of its number.
typedef struct PrimarySample {
    EdgePoint edge;
    View view;
    Seen seen;
    Vec3 n;         // normal of the plane of edge and view: what moves along it moves the edge on the film
    Float nx, ny;   // the side of the edge that n points to, on the film, unit
    Float weight;   // of dL times the velocity along n, over the density
    Float step;     // distance of the two paths from the edge [pixels]
    Mask silhouette, m;
} PrimarySample;

// Beside the edges of smooth meshes thin bands are dark, whose other sides mirrored.h finds: the paths pass as near as those do.
// Where surfaces pass through each other, shadow rays start above the one and may miss the other, if the paths pass nearer than at
// most; there, rays that one lets pass start a step behind it and must meet the other one; where a plane
// cuts surfaces, they start on that; so do they in acute wedges. Borders of light hide nothing. scale: pixels per length across the
// edge.
static Float primary_step(const Tracer *t, const BoundaryJob *b, const EdgePoint *e, Float scale) {
    Mask smooth = mi_lt(i_set(0), SHAPE_FIELD(t->scene, i_max(e->hit.shape, i_set(0)), flags) & SHAPE_HAS_NORMALS);
    const real finest = 2 * film_resolution(t->sensor);
    Float step = f_select(e->meeting, f_set(PRIMARY_STEP), f_min(f_set(finest), f_set(PRIMARY_STEP)));
    step = f_select(smooth & m_set(b->chains), f_set(finest), step);
    Float behind = f_max(step, MEETING_STEPS * interaction_step(e->p) * scale);
    step = f_max(step, edge_wedge(e) * scale);
    Mask through = e->meeting & mi_lt(i_set(-1), e->met.shape);
    return f_select((through & m_set(b->chains)) | edge_clips(e), behind, step);
}

static void primary_sample(Tracer *t, const BoundaryJob *b, const Pinhole *pinhole, Int slot, Mask m, PrimarySample *out) {
    SampleKey key = slot_key(t, slot);
    out->view = view_make(t->scene, pinhole, t->sensor, sample_lens(t, &key));
    EdgePoint e = edge_sample(t->scene, b, rng_2d(&key, DIMENSION_EDGE), out->view.eye, pinhole->parallel);
    Seen s = view_see(&out->view, e.p);
    s.valid = s.valid | (edge_clips(&e) & m_gt(s.local.z, f_set(0))); // which lie on the plane, as far as floats can tell
    Vec3 n = v3_normalize(v3_cross(s.d, e.tangent));
    Vec2 along = view_push(&out->view, &s, e.tangent), across = view_push(&out->view, &s, n);
    // The side of n: across, less its part along the edge.
    Float length2 = along.x * along.x + along.y * along.y, r = f_safe_rcp(length2);
    Float turn = along.x * across.y - along.y * across.x, rcp = f_safe_rcp(f_sqrt(length2));
    out->nx = f_copysign(rcp, turn) * -along.y;
    out->ny = f_copysign(rcp, turn) * along.x;
    out->weight = f_abs(turn) * f_safe_rcp(e.probability);
    out->step = primary_step(t, b, &e, f_abs(turn) * rcp);
    out->silhouette = edge_is_silhouette(t->scene, b, &e, n, s.d);
    out->m = m & s.valid & m_gt(r, f_set(0)) & m_gt(e.probability, f_set(0)) & m_finite(out->weight) &
             m_gt(out->weight, f_set(0)) & (out->silhouette | e.crease);
    // The film ends where no samples are taken.
    const PathJob *job = t->job;
    out->m = out->m & m_ge(s.x, f_set((real)job->x)) & m_lt(s.x, f_set((real)(job->x + job->width))) &
             m_ge(s.y, f_set((real)job->y)) & m_lt(s.y, f_set((real)(job->y + job->height)));
    out->edge = e;
    out->seen = s;
    out->n = n;
}

// The ray of one of the two paths of a sample, by the side of the edge: -1 or 1, or 0 for the edge itself.
KFN SensorRay primary_ray(const Tracer *t, const PrimarySample *s, real side) {
    Float step = side * s->step;
    return sensor_ray(t->scene, t->sensor, s->seen.x + step * s->nx, s->seen.y + step * s->ny, s->view.lens);
}

// Lanes of edges of meshes, but for those at which other surfaces end, too.
static Mask primary_is_mesh(const Tracer *t, const PrimarySample *s) {
    const EdgePoint *e = &s->edge;
    Mask mesh = mi_eq(SHAPE_FIELD(t->scene, i_max(e->hit.shape, i_set(0)), kind), i_set(SHAPE_MESH));
    mesh = mesh & mi_eq(e->side_count, i_set(0));
    return mesh & ~(e->round | e->mark | e->meeting | m_gt(v3_dot(e->normal, e->normal), f_set(0)));
}

// Lanes of m whose edge the camera sees, between the surfaces that meet or end there.
static Mask primary_visible(Tracer *t, const BoundaryJob *b, const PrimarySample *s, Mask m) {
    const Ray rays[2] = {primary_ray(t, s, -1).ray, primary_ray(t, s, 1).ray};
    if (t->scene->hide_emitters) { // the sensor sees nothing of lights
        m = m & mi_lt(SHAPE_FIELD(t->scene, i_select(m, s->edge.hit.shape, i_set(0)), emitter), i_set(0));
    }
    // Paths beside marks and borders of light, where normals turn away and between the triangles of a mesh start on their surfaces
    // (primary_look), also where these are narrower than the paths' step, as they are next to outlines.
    Mask turns = m_gt(v3_dot(s->edge.normal, s->edge.normal), f_set(0));
    const EdgePoint *e = &s->edge;
    Mask parts = m_lt(edge_rise(e, e->side[0], s->n) * edge_rise(e, e->side[1], s->n), f_set(0)); // neither is seen edge-on
    Mask inner = primary_is_mesh(t, s) & ~s->silhouette & mi_lt(i_set(-1), e->other) & parts;
    Mask clips = edge_clips(&s->edge), own = m & (e->mark | e->border | turns | inner | clips);
    Mask visible = edge_between(t, b, &s->edge, true, s->silhouette, s->n, rays, m & ~own);
    if (m_any(own)) {
        Ray ray = primary_ray(t, s, 0).ray;
        Hit hit = trace_solid(t, &ray, true, own, NULL);
        Float reach = v3_dot(v3_sub(s->edge.p, ray.o), ray.d), found = v3_dot(v3_sub(hit.p, ray.o), ray.d);
        Mask same = mi_eq(hit.shape, s->edge.hit.shape) & mi_eq(hit.instance, s->edge.hit.instance);
        Mask here = same & m_le(f_abs(found - reach), 2e-5f * reach);
        // Triangles that are seen from their edge are met farther from the point than others, and rays to it may slip through
        // between two of them: what counts is that nothing lies before it.
        Mask clear = mi_lt(hit.shape, i_set(0)) | m_gt(found, reach * (1.0f - 2e-5f));
        clear = clear | (clips & m_gt(found, reach - interaction_step(s->edge.p))); // rays may begin there
        clear = clear | (same & (mi_eq(hit.prim, s->edge.hit.prim) | mi_eq(hit.prim, s->edge.other)));
        visible = visible | (own & (((e->mark | e->border) & here) | ((turns | inner | clips) & clear)));
    }
    return visible;
}

// Finds which of `count` samples from number `first` on can contribute; writes their numbers behind `kept`.
static int32_t primary_find(Tracer *t, const BoundaryJob *b, const Pinhole *pinhole, int64_t first, int32_t count,
                            int32_t *kept, int32_t kept_count) {
    for (int32_t i = 0; i < count; i += LANES) {
        Mask m = m_first_n(count - i);
        Int slot = i_iota() + i;
        batch_numbers(t, i, first);
        PrimarySample s;
        primary_sample(t, b, pinhole, slot, m, &s);
        Mask visible = m_any(s.m) ? primary_visible(t, b, &s, s.m) : s.m;
        i_compress(kept + kept_count, slot, visible);
        kept_count += m_count(visible);
    }
    return kept_count;
}

// In media, what lies before the edge is on both sides the same: the paths k and half + k begin half-way between the edge and the
// last border before it, in lanes of m, with what gets there; their media begin at the edge. Where the near plane cuts surfaces,
// nothing lies before the edge.
static void primary_approach(Tracer *t, const PrimarySample *s, int32_t k, int32_t half, Mask m) {
    Paths *p = &t->ws.paths[0];
    const EdgePoint *e = &s->edge;
    Ray ray = primary_ray(t, s, 0).ray;
    Float reach = v3_dot(v3_sub(e->p, ray.o), ray.d), step = interaction_step(e->p);
    Mask begins = edge_clips(e) & mi_eq(e->met.prim, i_set(BORDER_NEAR));
    m = m & ~begins;
    if (!m_any(m)) {
        return;
    }
    Vec3 out = v3_scale(s->n, f_select(m_gt(edge_first_rise(e, s->n), f_set(0)), -step, step));
    Vec3 from = v3_select(s->silhouette, v3_add(e->p, out), v3_madd(e->p, -4.0f * step, ray.d));
    Ray back = {from, v3_neg(ray.d), reach};
    Hit before = trace_closest(t->scene, &back, m, false);
    t->job->rays += m_count(m);
    Float clear = f_select(mi_lt(i_set(-1), before.shape), f_min(v3_length(v3_sub(before.p, from)), reach), reach);
    Mask blocked;
    Fog fog = {i_set(t->sensor->medium), stream_key(t, i_iota() + k, 0, STREAM_SHADOW), t->scene->hide_emitters, f_set(0)};
    Ray to = {ray.o, v3_normalize(v3_sub(from, ray.o)), v3_length(v3_sub(from, ray.o))};
    Spec arrives = walk_transmittance(t, to, m_set(true), m, &fog, &blocked, NULL);
    Int medium = medium_around(t, from, back.d, m);
    for (int side = 0; side < 2; side++) {
        int32_t at = side * half + k;
        Vec3 d = record_v3(p->dx, p->dy, p->dz, at), o = record_v3(p->ox, p->oy, p->oz, at);
        o = v3_madd(o, f_zero_unless(~begins, reach - 0.5f * clear), d);
        f_store(p->ox + at, o.x);
        f_store(p->oy + at, o.y);
        f_store(p->oz + at, o.z);
        f_store(p->skip + at, f_zero_unless(~begins, -0.5f * clear));
        i_store(p->medium + at, i_select(begins, i_load(p->medium + at), medium));
        arrives = spec_select(begins, spec_set(f_set(1)), spec_zero_unless(m, arrives));
        spec_store(p->beta, at, spec_mul(spec_load(p->beta, at), arrives));
    }
}

// Starts the two paths of every sample that was kept: slots k and half + k.
static void primary_start(Tracer *t, const BoundaryJob *b, const Pinhole *pinhole, int64_t first, const int32_t *kept,
                          int32_t count, int32_t half) {
    for (int32_t k = 0; k < half; k++) {
        int64_t number = first + kept[k < count ? k : 0];
        slot_number(t, k, number);
        slot_number(t, half + k, number);
    }
    for (int32_t k = 0; k < half; k += LANES) {
        Int slot = i_iota() + k;
        PrimarySample s;
        primary_sample(t, b, pinhole, slot, m_set(true), &s);
        f_store(t->ws.film_x + k, s.seen.x);
        f_store(t->ws.film_y + k, s.seen.y);
        for (int side = 0; side < 2; side++) {
            SensorRay r = primary_ray(t, &s, side ? 1 : -1);
            // Lanes beyond the count carry rays that end at once.
            r.ray.tmax = f_zero_unless(m_first_n(count - k), r.ray.tmax);
            path_begin(t, side * half + k, slot + side * half, &r.ray, r.weight);
        }
        if (t->job->rides) {
            primary_approach(t, &s, k, half, m_first_n(count - k) & s.m);
        }
    }
    t->active = 2 * half;
    t->current = 0;
    t->record_count = t->batch_count = 0;
    t->overflow = false;
    t->job->paths += 2 * count;
}

// The directions of two paths, k and half + k, that meet a terminator's point from before and from behind its shading normal: what
// a mirror makes of such a ray dips below the surface at once, which no step over the surface would resolve.
static void primary_turn(Tracer *t, const PrimarySample *s, int32_t k, int32_t half, Mask m) {
    Paths *p = &t->ws.paths[0];
    Mask above = m_gt(v3_dot(s->edge.rise, s->n), f_set(0));
    for (int side = 0; side < 2; side++) {
        int32_t at = side * half + k;
        Vec3 d = record_v3(p->dx, p->dy, p->dz, at), n = s->edge.normal;
        Float turn = f_select(side ? above : ~above, f_set(-NORMAL_TURN), f_set(NORMAL_TURN));
        d = v3_select(m, v3_normalize(v3_madd(d, turn - v3_dot(d, n), n)), d);
        f_store(p->dx + at, d.x);
        f_store(p->dy + at, d.y);
        f_store(p->dz + at, d.z);
    }
}

// Of meshes, the first vertices of paths k... on one side of their edges (-1, 1: that of n) lie on the edge, in the triangle that
// is seen there, along the view of it: the paths' step may go beyond that triangle, or beyond the band that is dark because its
// normals turn away, whose other side is for the curve that ends it (facet.h); and where shading runs on over many narrow
// triangles, what it changes by over that step at each of their edges adds up. Faces without vertex normals are left where the step
// stays in the triangle, and so are acute wedges: rays that begin on an inner edge begin on both of its faces. What textures are
// there is looked up a little inside: exactly on the edge, one that jumps along it has the same value for both sides.
static NOINLINE void primary_touch(Tracer *t, const PrimarySample *s, int32_t k, real side, Mask m) {
    const SceneView *scene = t->scene;
    const EdgePoint *e = &s->edge;
    Workspace *ws = &t->ws;
    Paths *p = &ws->paths[0];
    Hit met = {i_load(ws->hit_shape + k), i_load(ws->hit_prim + k), f_load(ws->hit_u + k), f_load(ws->hit_v + k),
               record_v3(ws->hit_x, ws->hit_y, ws->hit_z, k), i_load(ws->hit_instance + k)};
    // Of the triangles on this side, the one that rises nearer to the viewer, seen along the edge.
    Vec3 seen = s->seen.d;
    Float run = v3_dot(seen, e->tangent) * f_safe_rcp(v3_dot(e->tangent, e->tangent));
    Vec3 across = v3_madd(seen, -run, e->tangent);
    Float rise[2], slope[2];
    for (int i = 0; i < 2; i++) {
        rise[i] = side * edge_rise(e, e->side[i], s->n);
        slope[i] = v3_dot(e->side[i], across) * f_safe_rcp(rise[i]);
    }
    Mask second = m_gt(rise[1], f_set(0)) & mi_lt(i_set(-1), e->other), first = m_gt(rise[0], f_set(0));
    second = second & (~first | m_lt(slope[1], slope[0]));
    m = m & (first | second) & ~mi_eq(e->other, i_set(EDGE_ANY));
    if (!m_any(m)) {
        return;
    }
    Vec3 n, d = record_v3(p->dx, p->dy, p->dz, k);
    Hit hit = point_hit(scene, i_select(m, e->hit.shape, i_set(-1)), i_select(m, i_select(second, e->other, e->hit.prim), i_set(0)),
                        e->hit.instance, e->p, &n);
    hit.u = f_lerp(f_clamp(hit.u, f_set(0), f_set(1)), f_set(1.0f / 3), f_set(PRIMARY_INSET));
    hit.v = f_lerp(f_clamp(hit.v, f_set(0), f_set(1)), f_set(1.0f / 3), f_set(PRIMARY_INSET));
    Mask inside = m & mi_eq(met.shape, hit.shape) & mi_eq(met.prim, hit.prim) & mi_eq(met.instance, hit.instance);
    Mask smooth = mi_lt(i_set(0), SHAPE_FIELD(scene, i_max(e->hit.shape, i_set(0)), flags) & SHAPE_HAS_NORMALS);
    Mask wedge = m_gt(edge_wedge(e), f_set(0));
    m = m & ((smooth & ~wedge) | ~inside);
    met = hit_select(m, &hit, &met);
    d = v3_select(m, s->seen.d, d);
    hit_store(t, k, &met);
    f_store(p->dx + k, d.x);
    f_store(p->dy + k, d.y);
    f_store(p->dz + k, d.z);
}

// Finds the first vertices of those paths. Beside the outline of a round surface its normal turns with the root of the distance,
// which no step would resolve: there the vertex is the point that is all but on the outline. Beside marks it is on their surface.
static void primary_look(Tracer *t, const BoundaryJob *b, const Pinhole *pinhole, Segments *q, int32_t count, int32_t half) {
    trace_stage(t, 0);
    for (int32_t k = 0; k < count && b->round; k += LANES) {
        PrimarySample s;
        primary_sample(t, b, pinhole, i_iota() + k, m_first_n(count - k), &s);
        Mask above = m_gt(edge_first_rise(&s.edge, s.n), f_set(0)), m = m_first_n(count - k), round = s.edge.round & m;
        Mask turns = m & m_gt(v3_dot(s.edge.normal, s.edge.normal), f_set(0));
        Mask own = m & primary_is_mesh(t, &s);
        for (int side = 0; side < 2 && m_any(own); side++) {
            primary_touch(t, &s, side * half + k, side ? 1 : -1, own);
        }
        Mask lines = s.edge.mark | s.edge.border;
        for (int side = 0; side < 2 && m_any(round | lines | turns); side++) {
            int32_t at = side * half + k;
            Mask inside = round & (side ? above : ~above);
            const Workspace *ws = &t->ws;
            Hit hit = {i_select(inside, s.edge.hit.shape, i_load(ws->hit_shape + at)),
                       i_select(inside, s.edge.hit.prim, i_load(ws->hit_prim + at)),
                       f_select(inside, s.edge.hit.u, f_load(ws->hit_u + at)),
                       f_zero_unless(~inside, f_load(ws->hit_v + at)),
                       v3_select(inside, s.edge.inner, record_v3(ws->hit_x, ws->hit_y, ws->hit_z, at)),
                       i_select(inside, s.edge.hit.instance, i_load(ws->hit_instance + at))};
            Hit beside = hit_select(side ? above : ~above, s.edge.beside, s.edge.beside + 1);
            hit = hit_select(m & lines, &beside, &hit);
            hit = hit_select(turns, &s.edge.hit, &hit);
            hit_store(t, at, &hit);
        }
        if (m_any(turns)) {
            primary_turn(t, &s, k, half, turns);
        }
        nudges_store(&s.edge, above, q, k, half + k);
    }
    t->placed = true;
    t->nudge[0] = b->lines ? q->nudge_u : NULL;
    t->nudge[1] = q->nudge_v;
}

// Where two surfaces with normals a and b pass through each other, their curve moves across itself as both say:
// n = x a + y b, and x a . (velocity of the one) + y b . (velocity of the other).
static void primary_meeting_adj(Tracer *t, const PrimarySample *s, Vec3 along, Vec3 *first, Sink *sink) {
    Mask m = s->m & s->edge.meeting, attached = m & mi_lt(i_set(-1), s->edge.met.shape);
    Vec3 a = s->edge.across[0], b = s->edge.across[1];
    Float c = v3_dot(a, b), r = f_safe_rcp(1.0f - c * c), na = v3_dot(along, a), nb = v3_dot(along, b);
    *first = v3_select(m, v3_scale(a, (na - c * nb) * r), *first);
    Vec3 other = v3_scale(b, (nb - c * na) * r);
    points_move_adj(t, &s->edge.met, other, v3_zero(), sink, attached);
    Mask clips = edge_clips(&s->edge) & m;
    if (sink->any_places) {
        borders_move_adj(t->scene, s->edge.met.prim, s->edge.p, other, sink, m & ~attached & ~clips);
    }
    if (sink->any_camera && m_any(clips)) { // the planes move with its pose
        Vec3 unused = v3_zero();
        pose_point_adj(t->scene, t->sensor, s->seen.local, other, &unused, sink, clips);
    }
}

// Adds the motion of the edges along n, worth `worth`. A terminator is where F = n . view is 0: where F grows, it moves back over
// the surface, down the slope. So do lines of textures.
static void primary_move_adj(Tracer *t, const BoundaryJob *b, const PrimarySample *s, Float worth, bool parallel, Sink *sink) {
    Vec3 along = v3_scale(s->n, f_zero_unless(s->m, worth));
    SurfaceAdj d = surface_adj_zero();
    Float df = -v3_dot(along, s->edge.rise);
    edge_line_adj(b, &s->edge, df, sink, s->m);
    along = v3_select(s->edge.half, v3_zero(), along);
    RayAdj ray = {s->edge.p, v3_neg(along), v3_zero()};
    d.p = v3_select(s->edge.meeting, v3_zero(), along);
    d.n = v3_scale(s->edge.view, df);
    if (parallel) { // view = - direction
        ray.direction = v3_scale(s->edge.normal, -df);
    } else { // view = eye - p; the eye is the ray's point minus distance times direction
        Vec3 toward = v3_scale(s->edge.normal, df);
        d.p = v3_sub(d.p, toward);
        ray.position = v3_add(ray.position, toward);
        ray.direction = v3_scale(toward, -s->seen.distance);
    }
    if (m_any(s->edge.meeting)) {
        primary_meeting_adj(t, s, along, &d.p, sink);
    }
    surfaces_move_adj(t, &s->edge.hit, &d, sink, s->m);
    if (sink->any_camera) {
        sensor_ray_adj(t->scene, t->sensor, s->seen.x, s->seen.y, s->view.lens, &ray, sink, s->m);
    }
}

// Books what the paths found: slots k and half + k. Reverse: film_adj has left the film's adjoint in ws.adjoint.
static void primary_finish(Tracer *t, const BoundaryJob *b, const Pinhole *pinhole, Sink *sink, int32_t count,
                           int32_t half) {
    for (int32_t k = 0; k < count; k += LANES) {
        Int slot = i_iota() + k;
        PrimarySample s;
        primary_sample(t, b, pinhole, slot, m_first_n(count - k), &s);
        // The edge takes from the side that n points to, and gives to the other.
        Spec jump = spec_sub(spec_load(t->ws.radiance, k), spec_load(t->ws.radiance, half + k));
        Float worth = s.weight;
        if (b->job.mode == MODE_REVERSE) {
            worth = worth * spec_dot(jump, spec_load(t->ws.adjoint, k));
        }
        s.m = s.m & m_finite(worth) & m_finite(spec_sum(jump));
        primary_move_adj(t, b, &s, worth, pinhole->parallel, sink);
        if (b->job.mode == MODE_FORWARD) {
            spec_store(t->ws.radiance, k, spec_zero_unless(s.m, spec_scale(jump, sink->derivative)));
            sink->derivative = f_set(0);
        }
    }
}
