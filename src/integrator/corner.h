// corner.h: what takes the noise out of the interior term near inner corners, where two surfaces touch that move differently, or
// where a mesh meets itself and slides over the film. With both ends attached, light between points x and b at a distance r
// changes with |velocity of b - velocity of x| / r, whose square is not integrable there. Seen from x the ends' motion is a field
// v of directions, and of the light  integral g(w) L(b(w)) dw,  g = f |cos|, the singular part of the derivative is
// integral div(g v) L dw. Now for every function psi(w) that is 0 outside of a part of the wall's plane, a lens that stands on the
// line where it meets the plane of x,
//   integral div(psi g v) dw = 0,   div(psi g v) = psi div(g v) + g v . grad psi,
// because psi g is 0 all around the lens: on the line itself directions lie in the plane of x, where the cosine is 0. So any
// number that does not depend on w, times that, may be subtracted. The number is an estimate L0 of the light that leaves the wall
// at a point b0 next to x, by a path with the random numbers of that which goes on from b: L - L0 is as small as the distances
// are, but where one of the two paths passes an edge, and what is left of the square is integrable but for a logarithm. Where the
// wall is glossy, its light depends on w, too, and that part stays.
// It holds whether or not the ray gets to the wall, so that all rays that pass through the lens count. x has the lens that is
// nearest, if it lies closer to the line than to its ends.
#pragma once

#include "integrator/path_move.h"

// The lens of vertices, and how a ray passes through it.
typedef struct Corner {
    Mask m;
    Int wall, prim;
    Vec3 o, along, up; // see CornerRecord
    Float length, steep;
    Float at, apart;   // of the vertex: along the line, and away from it
    Float psi;         // at the point p of the lens that the ray passes
    Vec3 p, gradient;
} Corner;

#define CORNER_INT(t, i, field)                                                                                        \
    i_gather((const int32_t *)(t)->job->corners,                                                                       \
             (i) * (int32_t)(sizeof(CornerRecord) / 4) + (int32_t)(offsetof(CornerRecord, field) / 4))
#define CORNER_FLOAT(t, i, field, k)                                                                                   \
    f_gather((const float *)(t)->job->corners,                                                                         \
             (i) * (int32_t)(sizeof(CornerRecord) / 4) + (int32_t)(offsetof(CornerRecord, field) / 4) + (k))
#define CORNER_V3(t, i, field) v3(CORNER_FLOAT(t, i, field, 0), CORNER_FLOAT(t, i, field, 1), CORNER_FLOAT(t, i, field, 2))

// Of vertices at p that rays along d have found. first: those of the sensor, which slide over surfaces that move: only there do
// both ends move differently where a mesh meets itself.
static NOINLINE Corner corner_find(const Tracer *t, const Hit *hit, Vec3 d, bool first, Mask m) {
    Corner c = {.m = m_set(false)};
    Int begin = i_gather(t->job->corner_at, hit->shape), end = i_gather(t->job->corner_at, hit->shape + 1), best = i_set(0);
    Float nearest = f_set(1);
    m = m & mi_lt(begin, end);
    for (Mask left = m; m_any(left); begin = begin + 1, left = m & mi_lt(begin, end)) {
        Int i = i_select(left, begin, i_set(0));
        Vec3 normal = CORNER_V3(t, i, normal), q = v3_sub(hit->p, CORNER_V3(t, i, origin));
        Float length = CORNER_FLOAT(t, i, length, 0), at = v3_dot(q, CORNER_V3(t, i, along)), above = v3_dot(q, normal);
        Float room = at * (length - at) * f_safe_rcp(length), apart2 = v3_dot(q, q) - at * at;
        Float ratio = f_safe_sqrt(apart2) * f_safe_rcp(room);
        Mask parts = m_set(first) | ~mi_eq(CORNER_INT(t, i, wall), hit->shape);
        // The wall may be of the same mesh: next to the line its points lie near the viewer's plane, but nearer to its own.
        Float before = f_abs(v3_dot(q, v3_cross(CORNER_V3(t, i, along), CORNER_V3(t, i, up))));
        Mask take = left & parts & m_gt(room, f_set(0)) & m_lt(ratio, nearest) & m_lt(v3_dot(d, normal), f_set(0)) &
                    m_lt(f_abs(above), f_min(1e-4f * length, 0.5f * before));
        nearest = f_select(take, ratio, nearest);
        best = i_select(take, i, best);
        c.m = c.m | take;
    }
    if (!m_any(c.m)) {
        return c;
    }
    c.wall = CORNER_INT(t, best, wall);
    c.prim = CORNER_INT(t, best, prim);
    c.o = CORNER_V3(t, best, origin);
    c.along = CORNER_V3(t, best, along);
    c.up = CORNER_V3(t, best, up);
    c.length = CORNER_FLOAT(t, best, length, 0);
    c.steep = CORNER_FLOAT(t, best, steep, 0);
    Vec3 q = v3_sub(hit->p, c.o), wall = v3_cross(c.along, c.up), off = CORNER_V3(t, best, normal);
    c.at = v3_dot(q, c.along);
    c.apart = v3_length(v3_madd(q, -c.at, c.along));
    // Next to a wall that overhangs, rays would begin behind it.
    Interaction si = {.p = hit->p, .ng = off};
    c.m = c.m & m_gt(v3_dot(q, wall) * v3_dot(v3_sub(interaction_offset(&si, off), c.o), wall), f_set(0));
    return c;
}

// psi = (1 - rho^2)^2 where rho = height / (steep s (1 - s) length) < 1.
static void corner_pass(Corner *c, Vec3 from, Vec3 w) {
    Vec3 normal = v3_cross(c->along, c->up);
    Float distance = v3_dot(v3_sub(c->o, from), normal) * f_safe_rcp(v3_dot(w, normal));
    c->p = v3_madd(from, distance, w);
    Vec3 q = v3_sub(c->p, c->o);
    Float x = v3_dot(q, c->along), h = v3_dot(q, c->up), r = f_safe_rcp(c->length), s = x * r;
    Float room = c->steep * x * (1.0f - s), rcp = f_safe_rcp(room), rho = h * rcp;
    c->m = c->m & m_gt(distance, f_set(0)) & m_gt(h, f_set(0)) & m_gt(room, f_set(0)) & m_lt(rho, f_set(1));
    Float inside = 1.0f - rho * rho, slope = -4.0f * inside * rho;
    c->psi = f_zero_unless(c->m, inside * inside);
    // d rho = dh / room - rho d room / room
    Vec3 drho = v3_scale(v3_madd(c->up, -rho * c->steep * (1.0f - 2.0f * s), c->along), rcp);
    c->gradient = v3_select(c->m, v3_scale(drho, slope), v3_zero());
}

// As point_hit.
static Hit corner_hit(const Tracer *t, const Corner *c, Vec3 p, Vec3 *n) {
    return point_hit(t->scene, i_select(c->m, c->wall, i_set(-1)), i_select(c->m, c->prim, i_set(0)), i_set(0), p, n);
}

// Of the recorded vertices of a batch.
static Corner corner_near(const Tracer *t, const RecordBatch *batch) {
    const Records *r = &t->ws.records;
    int32_t at = batch->first;
    Mask smooth = m_first_n(batch->count) & m_gt(f_load(r->sw + at), f_set(0));
    smooth = smooth & mi_eq(i_select(smooth, i_load(r->lobe + at), i_set(-1)), i_set(LOBE_SMOOTH));
    Hit hit = {.shape = i_select(smooth, i_load(r->shape + at), i_set(0)), .p = record_v3(r->px, r->py, r->pz, at)};
    return corner_find(t, &hit, record_v3(r->dx, r->dy, r->dz, at), batch->bounce == 0, smooth);
}

// As their corners see them.
static Corner corner_load(const Tracer *t, const RecordBatch *batch) {
    const Records *r = &t->ws.records;
    int32_t at = batch->first;
    Corner c = corner_near(t, batch);
    if (m_any(c.m)) {
        corner_pass(&c, record_v3(r->px, r->py, r->pz, at), record_v3(r->wox, r->woy, r->woz, at));
    }
    return c;
}

// ---- the light of the walls --------------------------------------------------------------------------------------

// Starts paths n... of the lanes m, which are what vertices `at`... see along d from `from`, as directions of that density would;
// notes in ws.next which vertices those are, and returns the number of paths.
static int32_t side_push(Tracer *t, int32_t at, Vec3 from, Vec3 d, const Hit *hit, Float density, Mask m, int32_t n) {
    Workspace *ws = &t->ws;
    const Records *r = &ws->records;
    Paths *q = &ws->paths[0];
    Spec beta = spec_mul(spec_load(r->beta, at), spec_load(r->weight, at));
    Int group = SHAPE_FIELD(t->scene, hit->shape, group) + 1;
    v3_compress(q->ox + n, q->oy + n, q->oz + n, from, m);
    v3_compress(q->px + n, q->py + n, q->pz + n, from, m);
    v3_compress(q->dx + n, q->dy + n, q->dz + n, d, m);
    f_compress(q->pdf + n, density, m);
    f_compress(q->eta2 + n, f_max(spec_max(beta), f_set(1e-3f)), m); // roulette as of the path itself
    i_compress(q->slot + n, i_load(r->slot + at), m);
    v3_compress(ws->hit_x + n, ws->hit_y + n, ws->hit_z + n, hit->p, m);
    f_compress(ws->hit_u + n, hit->u, m);
    f_compress(ws->hit_v + n, hit->v, m);
    i_compress(ws->hit_shape + n, hit->shape, m);
    i_compress(ws->hit_prim + n, hit->prim, m);
    i_compress(ws->hit_instance + n, hit->instance, m);
    i_compress(ws->hit_group + n, group, m);
    i_compress(ws->next + n, i_iota() + at, m);
    return m_count(m);
}

// Runs n such paths, whose first vertices are those of number `bounce`, and leaves what they bring with the vertices.
static void side_paths_run(Tracer *t, int32_t *begin, int32_t n, int32_t bounce) {
    Workspace *ws = &t->ws;
    Paths *q = &ws->paths[0];
    for (int32_t k = 0; k < n; k += LANES) {
        f_store(q->tmax + k, f_set(INFINITY));
        f_store(q->roulette + k, f_set(1));
        f_store(q->skip + k, f_set(0));
        spec_store(q->beta, k, spec_set(f_set(1)));
        i_store(q->depth + k, i_set(bounce));
        i_store(q->medium + k, i_set(-1));
    }
    for (int c = 0; c < SPEC_N; c++) {
        memset(ws->radiance[c], 0, CHUNK * sizeof(real));
    }
    t->active = n;
    t->current = 0;
    t->first_bounce = bounce;
    t->placed = true;
    path_forward(t, begin);
    for (int32_t k = 0; k < n; k++) {
        int32_t record = ws->next[k], slot = ws->records.slot[record];
        for (int c = 0; c < SPEC_N; c++) {
            ws->records.side[c][record] = ws->radiance[c][slot];
        }
    }
}

// Starts paths n... at the points next to the vertices of a batch.
static int32_t corner_push(Tracer *t, const RecordBatch *batch, int32_t n) {
    if (batch->ends) {
        return 0;
    }
    Corner c = corner_load(t, batch);
    if (!m_any(c.m)) {
        return 0;
    }
    const Records *r = &t->ws.records;
    Vec3 from = record_v3(r->px, r->py, r->pz, batch->first), normal;
    Float room = c.at * (1.0f - c.at * f_safe_rcp(c.length));
    Float height = f_min(c.apart, 0.5f * c.steep * room);
    Vec3 p = v3_madd(v3_madd(c.o, c.at, c.along), height, c.up);
    Hit hit = corner_hit(t, &c, p, &normal);
    return side_push(t, batch->first, from, v3_normalize(v3_sub(p, from)), &hit, f_set(PDF_DELTA), c.m, n);
}

// Runs the side paths of all vertices of a chunk, bounce by bounce; push starts those of a batch, and returns their number.
static void side_stage(Tracer *t, int32_t *begin, int32_t (*push)(Tracer *t, const RecordBatch *batch, int32_t n)) {
    const Tracer before = *t;
    t->derivative = false;
    for (int32_t b = 0; b < before.batch_count;) {
        int32_t n = 0, bounce = before.ws.batches[b].bounce;
        for (; b < before.batch_count && before.ws.batches[b].bounce == bounce; b++) {
            const RecordBatch *batch = before.ws.batches + b;
            n += batch->tag == VERTEX_SURFACE ? push(t, batch, n) : 0;
        }
        if (n > 0) {
            side_paths_run(t, begin, n, bounce + 1);
        }
    }
    *t = before;
}

// ---- what is subtracted ------------------------------------------------------------------------------------------

// A sink of nothing.
static Sink still_sink(const PathJob *job, double *unused) {
    PathJob still = *job;
    still.texture_at = still.to_uv_at = still.normals_at = still.attribute_at = still.place_at = job->none;
    still.points_at = still.pose_at = still.instance_at = still.camera_at = still.volume_at = job->none;
    still.gradient = unused;
    still.tangent = NULL;
    return sink_of(&still);
}

// Where the rays got to the wall, they met it at their next vertices, which they aimed at from a little above their own.
static void corner_meet(const Tracer *t, Int slot, Corner *c) {
    const Workspace *ws = &t->ws;
    Int next = i_gather(ws->next, slot);
    Mask met = c->m & mi_lt(i_set(-1), next);
    met = met & mi_eq(i_gather(ws->records.shape, i_max(next, i_set(0))), c->wall);
    Vec3 q = LOAD_V3(*ws, next_px, next_py, next_pz, slot), n = v3_cross(c->along, c->up);
    met = met & m_lt(f_abs(v3_dot(v3_sub(q, c->o), n)), 1e-4f * c->length);
    c->p = v3_select(met, q, c->p);
}

// As segment_adj, of the ray along w from a vertex to the point of the lens: psi div(g v) + g v . grad psi, v by the motion of both
// ends. For w fixed, the point slides over the wall by their difference, less what of it along w leaves the wall.
KFN Vec3 corner_segment_adj(const Corner *k, Vec3 from, Vec3 w, Vec3 n, Float c, Vec3 dw, Vec3 *darea) {
    Vec3 dr = segment_adj(w, v3_length(v3_sub(k->p, from)), n, c, dw, darea), g = k->gradient;
    Vec3 slope = v3_madd(g, -v3_dot(w, g) * f_safe_rcp(v3_dot(n, w)), n);
    *darea = v3_scale(*darea, k->psi);
    return v3_madd(v3_scale(dr, k->psi), c, slope);
}

// What is subtracted for one delta: returns the adjoint of the vertex's position.
static Vec3 corner_move_adj(const Tracer *t, const SurfaceSweep *s, Spec weight, Sink *sink) {
    const Corner *corner = s->corner;
    Spec l0 = spec_zero_unless(corner->m, spec_load(t->ws.records.side, s->at));
    VertexAdj v;
    double unused = 0;
    Sink still = still_sink(t->job, &unused);
    vertex_adj_clear(&v, true);
    Vec3 n, darea, local = v3_zero(), dw = v3_zero();
    Spec df = spec_zero_unless(corner->m, spec_scale(spec_mul(weight, l0), s->scatter_weight));
    bsdf_adj(&s->call, s->wi, s->wo, s->lobe, df, &still, corner->m, &v.wi, &local, NULL);
    frame_to_local_adj(&s->si.sh, s->wo_d, local, &v.frame, &dw);
    Float c = f_zero_unless(corner->m, spec_dot(spec_mul(weight, l0), spec_load(t->ws.records.weight, s->at)));
    Hit hit = corner_hit(t, corner, corner->p, &n);
    Vec3 dr = v3_select(corner->m, corner_segment_adj(corner, s->si.p, s->wo_d, n, c, dw, &darea), v3_zero());
    Mask m = corner->m & m_finite(v3_dot(dr, dr));
    dr = v3_select(m, dr, v3_zero());
    points_move_adj(t, &hit, v3_neg(dr), v3_select(m, v3_neg(darea), v3_zero()), sink, m);
    return dr;
}
