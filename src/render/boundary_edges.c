// boundary_edges.c: of the scene's edges, those that can move for the sensor, cut to what the film sees and weighted by
// their length there. Where this is a guess (lenses, round shapes), it decides the noise only.
#include "render/boundary_edges.h"

#include "bsdf/table.h"
#include "render/cuts.h"
#include "render/light_borders.h"
#include "render/projection.h"
#include "render/texture_steps.h"
#include "shape/shape.h"

static void instance_point(const SceneView *view, const EdgeRecord *e, double p[3]) {
    const float *m = view->theta + view->instances[e->instance].to_world;
    double q[3] = {p[0], p[1], p[2]};
    for (int k = 0; k < 3; k++) {
        p[k] = m[4 * k] * q[0] + m[4 * k + 1] * q[1] + m[4 * k + 2] * q[2] + m[4 * k + 3];
    }
}

static void mesh_point(const SceneView *view, const EdgeRecord *e, int32_t vertex, double p[3]) {
    const ShapeRecord *shape = view->shapes + e->shape;
    for (int k = 0; k < 3; k++) {
        p[k] = (double)view->theta[shape->positions + 3 * (int64_t)vertex + k];
    }
    if (shape->collection >= 0) {
        instance_point(view, e, p);
    }
}

// Whether rays from the eye pass both triangles of a mesh's edge on one side, or the picture jumps there anyway.
static bool can_jump(const SceneView *view, const double eye[4], const EdgeRecord *e, const double a[3], const double b[3],
                     const int32_t *corners) {
    if (e->crease == EDGE_CREASE || e->opposite < 0 || e->fan_count > 0) {
        return true;
    }
    double side[2][3], n[3], d[3];
    mesh_point(view, e, corners[(e->corner + 2) % 3], side[0]);
    mesh_point(view, e, e->opposite, side[1]);
    for (int k = 0; k < 3; k++) {
        d[k] = eye[k] - eye[3] * a[k];
    }
    for (int k = 0; k < 3; k++) {
        int i = (k + 1) % 3, j = (k + 2) % 3;
        n[k] = d[i] * (b[j] - a[j]) - d[j] * (b[i] - a[i]);
    }
    double s[2] = {0, 0}, size = 0;
    for (int k = 0; k < 3; k++) {
        s[0] += n[k] * (side[0][k] - a[k]);
        s[1] += n[k] * (side[1][k] - a[k]);
        size += fabs(n[k] * (side[0][k] - a[k])) + fabs(n[k] * (side[1][k] - a[k]));
    }
    // Near the change of sign the kernel decides.
    return s[0] * s[1] > -1e-9 * size * size;
}

// The angle between the planes of the triangles at a mesh's edge, pi where it is open; and its world length.
static double mesh_edge_angle(const SceneView *view, const EdgeRecord *e, double *length) {
    const int32_t *corners = view->triangles + 3 * ((int64_t)view->shapes[e->shape].triangle + e->prim);
    double a[3], p[3][3], n[2][3], length2 = 0, dot = 0, sizes[2] = {0, 0};
    mesh_point(view, e, corners[e->corner], a);
    mesh_point(view, e, corners[(e->corner + 1) % 3], p[0]);
    mesh_point(view, e, corners[(e->corner + 2) % 3], p[1]);
    mesh_point(view, e, e->opposite >= 0 ? e->opposite : corners[e->corner], p[2]);
    for (int k = 0; k < 9; k++) {
        p[k / 3][k % 3] -= a[k % 3];
    }
    for (int k = 0; k < 3; k++) {
        int i = (k + 1) % 3, j = (k + 2) % 3;
        length2 += p[0][k] * p[0][k];
        n[0][k] = p[0][i] * p[1][j] - p[0][j] * p[1][i];
        n[1][k] = p[2][i] * p[0][j] - p[2][j] * p[0][i];
        dot += n[0][k] * n[1][k];
        sizes[0] += n[0][k] * n[0][k];
        sizes[1] += n[1][k] * n[1][k];
    }
    double cosine = dot / sqrt(sizes[0] * sizes[1]), angle = acos(fmax(-1, fmin(1, cosine)));
    *length = sqrt(length2);
    return e->opposite < 0 || !isfinite(angle) ? 3.14159265358979323846 : angle;
}

static double mesh_edge_weight(const SceneView *view, const EdgeRecord *e) {
    double length, angle = mesh_edge_angle(view, e, &length);
    return length * angle;
}

static double see_mesh_edge(const SceneView *view, const Projection *p, const double eye[4], EdgeRecord *e) {
    const int32_t *corners = view->triangles + 3 * ((int64_t)view->shapes[e->shape].triangle + e->prim);
    double a[3], b[3];
    mesh_point(view, e, corners[e->corner], a);
    mesh_point(view, e, corners[(e->corner + 1) % 3], b);
    double part = 1, length;
    if (p->pinhole && !can_jump(view, eye, e, a, b, corners)) {
        // What the planes of both triangles hide of the light differs by an angle, where the cosine is no larger.
        double angle = e->crease == EDGE_SOFT ? mesh_edge_angle(view, e, &length) : 0;
        part = fmin(1, angle * angle);
    }
    return part > 0 ? part * rey_see_line(p, a, b, e) : 0;
}

// The normal of a vertex in the world.
static void mesh_normal(const SceneView *view, const EdgeRecord *e, int32_t vertex, double n[3]) {
    const ShapeRecord *shape = view->shapes + e->shape;
    const float *own = view->theta + shape->normals + 3 * (int64_t)vertex;
    const float *inverse = shape->collection >= 0 ? view->tables + view->instances[e->instance].table + 12 : NULL;
    for (int k = 0; k < 3; k++) {
        n[k] = (double)own[k];
    }
    for (int k = 0; k < 3 && inverse; k++) {
        n[k] = (double)inverse[k] * (double)own[0] + (double)inverse[4 + k] * (double)own[1] +
               (double)inverse[8 + k] * (double)own[2];
    }
}

// Whether the shading normal of a triangle is somewhere at right angles to the direction to the eye, which may be off by
// `radius`: facet.h says how that depends on the corners.
static bool can_turn(const double p[3][3], const double n[3][3], const double eye[4], double radius) {
    bool above = false, below = false;
    for (int i = 0; i < 3; i++) {
        for (int j = i; j < 3; j++) {
            double q = 0, size = 0;
            for (int k = 0; k < 3; k++) {
                double to[2] = {eye[k] - eye[3] * p[i][k], eye[k] - eye[3] * p[j][k]};
                q += n[i][k] * to[1] + n[j][k] * to[0];
                size += fabs(n[i][k]) * (fabs(to[1]) * 1e-6 + radius) + fabs(n[j][k]) * (fabs(to[0]) * 1e-6 + radius);
            }
            above |= q > -size;
            below |= q < size;
        }
    }
    return above && below;
}

// The length on the film of the longest edge of a triangle that the film sees in part.
static double see_triangle(const Projection *p, const double world[3][3]) {
    double film[3][2], low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY}, length = 0;
    const double most = 2 * (p->high_x - p->low_x + p->high_y - p->low_y);
    int behind = 0;
    for (int i = 0; i < 3; i++) {
        double local[3];
        rey_to_sensor(p, world[i], local);
        behind += local[2] < p->near;
        rey_to_film(p, local, film[i]);
    }
    if (behind) {
        return behind < 3 ? most : 0;
    }
    for (int i = 0; i < 3; i++) {
        const double *a = film[i], *b = film[(i + 1) % 3];
        length = fmax(length, hypot(a[0] - b[0], a[1] - b[1]));
        for (int k = 0; k < 2; k++) {
            low[k] = fmin(low[k], a[k]);
            high[k] = fmax(high[k], a[k]);
        }
    }
    if (p->pinhole && (high[0] < p->low_x || low[0] > p->high_x || high[1] < p->low_y || low[1] > p->high_y)) {
        return 0;
    }
    return fmin(length, most) + (p->pinhole ? 0 : 1);
}

static double see_terminator(const SceneView *view, const Projection *p, const double eye[4], const EdgeRecord *e) {
    const int32_t *corners = view->triangles + 3 * ((int64_t)view->shapes[e->shape].triangle + e->prim);
    double q[3][3], n[3][3];
    for (int k = 0; k < 3; k++) {
        mesh_point(view, e, corners[k], q[k]);
        mesh_normal(view, e, corners[k], n[k]);
    }
    return can_turn(q, n, eye, p->lens) ? see_triangle(p, q) : 0;
}

static double see_meeting(const Render *r, const Projection *p, EdgeRecord *e) {
    const MeetingRecord *m = &ARRAY_AT(r->meetings, MeetingRecord, e->prim);
    double ends[2][3];
    for (int k = 0; k < 6; k++) {
        ends[k / 3][k % 3] = (double)m->ends[k];
    }
    return rey_see_line(p, ends[0], ends[1], e);
}

// The world point of a mark's end.
static void mark_point(const SceneView *view, const EdgeRecord *e, const float uv[2], double p[3]) {
    const ShapeRecord *shape = view->shapes + e->shape;
    if (shape->kind == SHAPE_MESH) {
        const int32_t *corners = view->triangles + 3 * ((int64_t)shape->triangle + e->prim);
        double q[3][3];
        for (int k = 0; k < 3; k++) {
            mesh_point(view, e, corners[k], q[k]);
        }
        for (int k = 0; k < 3; k++) {
            p[k] = q[0][k] + (double)uv[0] * (q[1][k] - q[0][k]) + (double)uv[1] * (q[2][k] - q[0][k]);
        }
        return;
    }
    const double pi = 3.14159265358979323846;
    const float *m = view->theta + shape->to_world;
    bool disk = shape->kind == SHAPE_DISK, sphere = shape->kind == SHAPE_SPHERE;
    double phi = 2 * pi * (double)uv[disk ? 1 : 0], r = disk ? (double)uv[0] : sphere ? sin(pi * (double)uv[1]) : 1;
    double x = r * cos(phi), y = r * sin(phi), z = disk ? 0 : sphere ? cos(pi * (double)uv[1]) : (double)uv[1];
    for (int k = 0; k < 3; k++) {
        p[k] = (double)m[4 * k] * x + (double)m[4 * k + 1] * y + (double)m[4 * k + 2] * z + (double)m[4 * k + 3];
    }
}

static double see_mark(const Render *r, const Projection *p, EdgeRecord *e) {
    const SceneView *view = &r->scene->view;
    const float *ends = ARRAY_AT(r->marks, MarkRecord, e->corner).ends;
    double a[3], b[3], local[2][3], film[2][2];
    mark_point(view, e, ends, a);
    mark_point(view, e, ends + 2, b);
    if (view->shapes[e->shape].kind == SHAPE_MESH) {
        return rey_see_line(p, a, b, e);
    }
    // Beside the straight line between them.
    rey_to_sensor(p, a, local[0]);
    rey_to_sensor(p, b, local[1]);
    const double most = p->high_x - p->low_x + p->high_y - p->low_y;
    if (local[0][2] < p->near || local[1][2] < p->near) {
        return local[0][2] < p->near && local[1][2] < p->near ? 0 : most;
    }
    rey_to_film(p, local[0], film[0]);
    rey_to_film(p, local[1], film[1]);
    return fmin(hypot(film[0][0] - film[1][0], film[0][1] - film[1][1]), most) + 0.01;
}

// Length in the world.
static double mark_weight(const Render *r, const EdgeRecord *e) {
    const float *ends = ARRAY_AT(r->marks, MarkRecord, e->corner).ends;
    double a[3], b[3], length2 = 0;
    mark_point(&r->scene->view, e, ends, a);
    mark_point(&r->scene->view, e, ends + 2, b);
    for (int k = 0; k < 3; k++) {
        length2 += (b[k] - a[k]) * (b[k] - a[k]);
    }
    return sqrt(length2);
}

// A piece of a round shape: as many pixels as the shape's size has, if it is not behind the sensor.
static double see_round(const SceneView *view, const Projection *p, const EdgeRecord *e) {
    const float *m = view->theta + view->shapes[e->shape].to_world;
    double centre[3] = {m[3], m[7], m[11]}, local[3], size = rey_pose_size(m);
    rey_to_sensor(p, centre, local);
    if (local[2] + 2 * size < p->near) {
        return 0;
    }
    double distance = p->parallel ? 1 : fmax(local[2], size);
    return fabs(p->scale_x) * 6 * size / distance * (double)(e->last - e->first) + 0.01;
}

// Whether the selection moves a shape.
static bool shape_moves_itself(const Render *r, int32_t id, int32_t instance) {
    const PathJob *job = &r->job;
    return id >= 0 && (job->points_at[id] >= 0 || job->pose_at[id] >= 0 ||
                       (r->scene->view.shapes[id].collection >= 0 && job->instance_at[instance] >= 0));
}

static bool light_moves(const Render *r, int32_t light) {
    bool moves = false;
    for (int k = 0; k < MAX_EMITTER_SLOTS; k++) {
        moves |= r->job.place_at[MAX_EMITTER_SLOTS * light + k] >= 0;
    }
    return moves;
}

// The same, as the sensor sees it; id -1: of a light.
static bool moves_on_film(const void *render, int32_t id, int32_t instance) {
    const Render *r = render;
    return r->job.any_camera || (id < 0 ? light_moves(r, instance) : shape_moves_itself(r, id, instance));
}

// Whether it moves the line of a texture over its surface.
static bool line_moves(const Render *r, const EdgeRecord *e) {
    return e->kind == EDGE_MARK && ARRAY_AT(r->marks, MarkRecord, e->corner).at >= 0;
}

// Whether it moves what an edge looks like. Meetings were looked for where something moves.
static bool edge_moves(const Render *r, const EdgeRecord *e) {
    return e->kind == EDGE_MEETING || moves_on_film(r, e->shape, e->instance) ||
           ((e->kind == EDGE_TERMINATOR || e->kind == EDGE_CUT) && r->job.normals_at[e->shape] >= 0);
}

// The length of a curve in the world, where what meets there can move.
static double meeting_weight(const Render *r, const EdgeRecord *e) {
    const MeetingRecord *m = &ARRAY_AT(r->meetings, MeetingRecord, e->prim);
    double length2 = 0;
    for (int k = 0; k < 3; k++) {
        length2 += (double)(m->ends[3 + k] - m->ends[k]) * (double)(m->ends[3 + k] - m->ends[k]);
    }
    bool moves = shape_moves_itself(r, m->shape[0], m->instance[0]) || shape_moves_itself(r, m->shape[1], m->instance[1]) ||
                 (m->shape[1] < 0 && light_moves(r, m->prim[1]));
    return moves ? sqrt(length2) : 0;
}

static rey_result accumulate(Render *r, BoundaryPlan *plan, Array *kept, Array *weights) {
    int64_t n = (int64_t)kept->count;
    plan->edges = kept->data;
    plan->cdf = weights->data;
    kept->data = weights->data = NULL;
    double sum = 0, total = 0;
    if (n > 1 << 28) {
        return rey_fail(r->scene->ctx, REY_ERROR_UNSUPPORTED, "more than 2^28 edges move");
    }
    for (int64_t i = 0; i < n; i++) {
        total += (double)plan->cdf[i];
    }
    for (int64_t i = 0; i < n; i++) {
        sum += (double)plan->cdf[i];
        plan->cdf[i] = i == n - 1 ? 1 : (float)(sum / total);
    }
    plan->job.edge_count = (int32_t)n;
    return REY_OK;
}

static rey_result keep_edge(Render *r, const EdgeRecord *e, double weight, bool *round, Array *kept, Array *weights) {
    if (!(weight > 0)) {
        return REY_OK;
    }
    EdgeRecord *edge = rey_array_push(r->scene->ctx, kept, sizeof *edge, 1);
    float *number = rey_array_push(r->scene->ctx, weights, sizeof *number, 1);
    if (!edge || !number) {
        return REY_ERROR_MEMORY;
    }
    *edge = *e;
    *number = (float)weight;
    bool smooth = e->kind == EDGE_MESH && (r->scene->view.shapes[e->shape].flags & SHAPE_HAS_NORMALS);
    *round |= e->kind == EDGE_OUTLINE || e->kind == EDGE_SIDE || e->kind == EDGE_MARK || e->kind == EDGE_TERMINATOR || smooth;
    return REY_OK;
}

static double round_edge_weight(const SceneView *view, const EdgeRecord *e) {
    return 20 * rey_pose_size(view->theta + view->shapes[e->shape].to_world) * (double)(e->last - e->first);
}

// World area of a triangle.
static double triangle_area(const SceneView *view, const EdgeRecord *e) {
    const int32_t *corners = view->triangles + 3 * ((int64_t)view->shapes[e->shape].triangle + e->prim);
    double p[3][3], area2 = 0;
    for (int k = 0; k < 3; k++) {
        mesh_point(view, e, corners[k], p[k]);
    }
    for (int k = 0; k < 3; k++) {
        int i = (k + 1) % 3, j = (k + 2) % 3;
        double n = (p[1][i] - p[0][i]) * (p[2][j] - p[0][j]) - (p[1][j] - p[0][j]) * (p[2][i] - p[0][i]);
        area2 += n * n;
    }
    return 0.5 * sqrt(area2);
}

// World area of a triangle times the largest sine of the angles between its normals.
static double turning_weight(const SceneView *view, const EdgeRecord *e) {
    const int32_t *corners = view->triangles + 3 * ((int64_t)view->shapes[e->shape].triangle + e->prim);
    double p[3][3], ng[3], largest = 0, area2 = 0;
    for (int k = 0; k < 3; k++) {
        mesh_point(view, e, corners[k], p[k]);
    }
    for (int k = 0; k < 3; k++) {
        int i = (k + 1) % 3, j = (k + 2) % 3;
        ng[k] = (p[1][i] - p[0][i]) * (p[2][j] - p[0][j]) - (p[1][j] - p[0][j]) * (p[2][i] - p[0][i]);
        area2 += ng[k] * ng[k];
    }
    for (int c = 0; c < 3 && area2 > 0; c++) {
        double n[3], cross2 = 0, length2 = 0;
        mesh_normal(view, e, corners[c], n);
        for (int k = 0; k < 3; k++) {
            int i = (k + 1) % 3, j = (k + 2) % 3;
            cross2 += (n[i] * ng[j] - n[j] * ng[i]) * (n[i] * ng[j] - n[j] * ng[i]);
            length2 += n[k] * n[k];
        }
        largest = length2 > 0 ? fmax(largest, sqrt(cross2 / (length2 * area2))) : largest;
    }
    return largest > 1e-6 ? sqrt(area2) * largest : 0;
}

// What an edge that the sensor sees, or that other vertices see, is worth.
typedef struct Weigher {
    Projection projection;
    double eye[4];  // or the direction of parallel views, and 0
    int32_t kind;   // BOUNDARY_
    double still;   // factor on edges that stand still: they may pass light between what moves
} Weigher;

static Weigher weigher_of(const Render *r, int32_t kind) {
    const SceneView *view = &r->scene->view;
    const float *m = view->theta + r->plan.sensor->to_world;
    Weigher w = {rey_projection_of(view, &r->plan), {m[3], m[7], m[11], 1}, kind, r->job.any_camera ? 1 : 0.25};
    if (w.projection.parallel) {
        w.eye[0] = m[2], w.eye[1] = m[6], w.eye[2] = m[10], w.eye[3] = 0;
    }
    bool ends_move = r->job.any_motion || (kind == BOUNDARY_INDIRECT && r->job.any_places);
    w.still = kind == BOUNDARY_PRIMARY || !ends_move ? 0 : w.still;
    return w;
}

// Whether what a surface sends out jumps where its shading normal turns away: not that of smooth glass, which mirrors all of the
// light there, from both sides and into the same direction.
static bool ends_at_normals(const SceneView *view, const ShapeRecord *shape) {
    return shape->emitter >= 0 || !rey_bsdf_refracts(view->bsdfs[shape->bsdf].kind);
}

// Collisions see lights beside what they light, which is that much darker or so.
#define RIDING_GLOW 8

// May cut the edge to what the film sees.
static double edge_weight(const Render *r, const Weigher *w, EdgeRecord *e) {
    const SceneView *view = &r->scene->view;
    if (w->kind == BOUNDARY_LINES) {
        return line_moves(r, e) ? mark_weight(r, e) : 0;
    }
    if (w->kind != BOUNDARY_PRIMARY && e->kind == EDGE_MARK && ARRAY_AT(r->marks, MarkRecord, e->corner).half) {
        return 0;
    }
    double factor = edge_moves(r, e) || (w->kind == BOUNDARY_PRIMARY && line_moves(r, e)) ? 1 : w->still;
    bool hides = !view->has_media || !rey_bsdf_passes(view->bsdfs[view->shapes[e->shape].bsdf].kind);
    if (factor == 0 || !hides || (w->kind == BOUNDARY_MEETING && e->kind != EDGE_MEETING)) {
        return 0;
    }
    bool turning = boundary_is_terminator(w->kind) || boundary_is_horizon(w->kind);
    if ((w->kind == BOUNDARY_CUT) != (e->kind == EDGE_CUT)) {
        return 0;
    }
    factor *= w->kind == BOUNDARY_RIDING && view->shapes[e->shape].emitter >= 0 ? RIDING_GLOW : 1;
    bool marks = w->kind == BOUNDARY_PRIMARY || boundary_is_paired(w->kind);
    if (w->kind != BOUNDARY_PRIMARY && (turning != (e->kind == EDGE_TERMINATOR) || (e->kind == EDGE_MARK && !marks))) {
        return 0;
    }
    switch (e->kind) {
    case EDGE_MEETING:
        return w->kind == BOUNDARY_PRIMARY ? see_meeting(r, &w->projection, e) : meeting_weight(r, e);
    case EDGE_CUT:
        return factor * triangle_area(view, e);
    case EDGE_MARK:
        return w->kind == BOUNDARY_PRIMARY ? see_mark(r, &w->projection, e) : factor * mark_weight(r, e);
    case EDGE_TERMINATOR:
        if (!boundary_is_horizon(w->kind) && !ends_at_normals(view, view->shapes + e->shape)) {
            return 0;
        }
        return turning ? factor * turning_weight(view, e) : see_terminator(view, &w->projection, w->eye, e);
    case EDGE_MESH:
        return w->kind == BOUNDARY_PRIMARY ? see_mesh_edge(view, &w->projection, w->eye, e)
                                           : factor * mesh_edge_weight(view, e);
    default:
        return w->kind == BOUNDARY_PRIMARY ? see_round(view, &w->projection, e) : factor * round_edge_weight(view, e);
    }
}

static rey_result find_meetings(Render *r) {
    r->meetings_found = true;
    return rey_meetings_with_borders(r->scene, moves_on_film, r, &r->meetings);
}

// Keeps the curves along which surfaces pass through each other, as far as the sensor sees them.
static rey_result keep_meetings(Render *r, const Weigher *w, BoundaryPlan *plan, Array *kept, Array *weights) {
    rey_result result = r->meetings_found ? REY_OK : find_meetings(r);
    for (size_t i = 0; i < r->meetings.count && result == REY_OK; i++) {
        EdgeRecord e = {.kind = EDGE_MEETING, .shape = ARRAY_AT(r->meetings, MeetingRecord, i).shape[0], .prim = (int32_t)i,
                        .opposite = EDGE_OPEN, .other = EDGE_ANY, .crease = EDGE_CREASE, .last = 1};
        double weight = edge_weight(r, w, &e);
        result = keep_edge(r, &e, weight, &plan->job.round, kept, weights);
    }
    return result;
}

// Whether lines of textures on a shape matter: along chains and from collisions, what moves shows them also where they stand still.
static bool seen_moving(const void *render, int32_t id, int32_t instance) {
    const Render *r = render;
    return (r->terms & REY_TERM_SPECULAR) || r->job.rides || moves_on_film(r, id, instance);
}

static rey_result find_edges(Render *r) {
    Array steps = {0};
    rey_result result = rey_texture_steps(r->scene, r->job.to_uv_at, &steps);
    if (result == REY_OK) {
        result = rey_edges_find(r->scene, &steps, &r->edges, &r->fans);
    }
    if (result == REY_OK) {
        result = rey_marks_find(r->scene, &steps, seen_moving, r, &r->edges, &r->marks);
    }
    result = result == REY_OK ? rey_cuts_find(r->scene, &r->edges) : result;
    rey_array_free(r->scene->ctx, &steps);
    return result;
}

rey_result rey_boundary_edges(Render *r, int32_t kind, BoundaryPlan *plan) {
    const Weigher w = weigher_of(r, kind);
    Array kept = {0}, weights = {0};
    rey_result result = r->edges.count ? REY_OK : find_edges(r);
    for (size_t i = 0; i < r->edges.count && result == REY_OK; i++) {
        EdgeRecord e = ARRAY_AT(r->edges, EdgeRecord, i);
        double weight = edge_weight(r, &w, &e);
        result = keep_edge(r, &e, weight, &plan->job.round, &kept, &weights);
    }
    if (result == REY_OK && (kind == BOUNDARY_PRIMARY || kind == BOUNDARY_MEETING)) {
        result = keep_meetings(r, &w, plan, &kept, &weights);
    }
    if (result == REY_OK) {
        result = accumulate(r, plan, &kept, &weights);
    }
    rey_array_free(r->scene->ctx, &kept);
    rey_array_free(r->scene->ctx, &weights);
    return result;
}
