// edge_sizes.c: edges on the film and in the world. Where this is a guess (lenses, round shapes), it decides the noise only.
#include "render/edge_sizes.h"

#include "shape/affine.h"
#include "shape/cut.h"
#include "shape/shape.h"

#include <math.h>

static void instance_point(const SceneView *view, const EdgeRecord *e, double p[3]) {
    rey_affine_point(view->theta + view->instances[e->instance].to_world, p, p);
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
    if (e->crease == EDGE_CREASE || e->crease == EDGE_STEP || e->opposite < 0 || e->fan_count > 0) {
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
    Projection see = *p;
    see.near *= m->shape[1] < 0 && m->prim[1] == BORDER_NEAR ? 0.999 : 1; // on which its own curves lie
    return rey_see_line(&see, ends[0], ends[1], e);
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
    if (shape->collection >= 0) {
        instance_point(view, e, p);
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

static double mark_length(const Render *r, const EdgeRecord *e) {
    const float *ends = ARRAY_AT(r->marks, MarkRecord, e->corner).ends;
    double a[3], b[3], length2 = 0;
    mark_point(&r->scene->view, e, ends, a);
    mark_point(&r->scene->view, e, ends + 2, b);
    for (int k = 0; k < 3; k++) {
        length2 += (b[k] - a[k]) * (b[k] - a[k]);
    }
    return sqrt(length2);
}

// The middle of a round shape, or of a tube's segment, and its size. No point of it is further from there than *reach: a pose whose
// entries are at most `size` makes vectors at most three times that.
static double round_ball(const SceneView *view, const EdgeRecord *e, double centre[3], double *reach) {
    const ShapeRecord *shape = view->shapes + e->shape;
    double size = 0;
    if (shape->kind == SHAPE_BSPLINE) {
        double low[3], high[3];
        rey_tube_box(view, e->shape, e->prim, low, high);
        for (int k = 0; k < 3; k++) {
            centre[k] = 0.5 * (low[k] + high[k]);
            size = fmax(size, 0.5 * (high[k] - low[k]));
        }
        *reach = 2 * size;
    } else {
        const float *m = view->theta + shape->to_world;
        for (int k = 0; k < 3; k++) {
            centre[k] = (double)m[4 * k + 3];
        }
        size = rey_pose_size(m);
        *reach = 4.5 * size; // of a cylinder's other end
    }
    if (shape->collection >= 0) {
        double wider = rey_pose_size(view->theta + view->instances[e->instance].to_world);
        instance_point(view, e, centre);
        size *= wider;
        *reach *= 3 * wider;
    }
    return size;
}

// Whether the film may see some of what is within `reach` of a point in the sensor's space.
static bool may_see(const Projection *p, const double local[3], double reach) {
    if (!p->pinhole || local[2] - reach < p->near) {
        return local[2] + reach > p->near;
    }
    double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
    for (int i = 0; i < 4; i++) {
        double along = i % 2 ? reach : -reach, across = i / 2 ? reach : -reach, film[2];
        rey_to_film(p, (double[3]){local[0] + across, local[1] + across, local[2] + along}, film);
        for (int k = 0; k < 2; k++) {
            low[k] = fmin(low[k], film[k]);
            high[k] = fmax(high[k], film[k]);
        }
    }
    return high[0] > p->low_x && low[0] < p->high_x && high[1] > p->low_y && low[1] < p->high_y;
}

// Of round shapes' edges, how long they are, in units of the shape's size.
static double round_length(const EdgeRecord *e) { return (e->kind == EDGE_TUBE ? 1.5 : 6) * (double)(e->last - e->first); }

// As many pixels as the shape's size has.
static double see_round(const SceneView *view, const Projection *p, const EdgeRecord *e) {
    double centre[3], local[3], reach, size = round_ball(view, e, centre, &reach);
    rey_to_sensor(p, centre, local);
    double distance = p->parallel ? 1 : fmax(local[2], size);
    return may_see(p, local, reach) ? fabs(p->scale_x) * size / distance * round_length(e) + 0.01 : 0;
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

static double meeting_length(const Render *r, const EdgeRecord *e) {
    const MeetingRecord *m = &ARRAY_AT(r->meetings, MeetingRecord, e->prim);
    double length2 = 0;
    for (int k = 0; k < 3; k++) {
        length2 += (double)(m->ends[3 + k] - m->ends[k]) * (double)(m->ends[3 + k] - m->ends[k]);
    }
    return sqrt(length2);
}

double rey_edge_on_film(const Render *r, const Projection *p, const double eye[4], EdgeRecord *e) {
    const SceneView *view = &r->scene->view;
    switch (e->kind) {
    case EDGE_MEETING:
        return see_meeting(r, p, e);
    case EDGE_MARK:
        return see_mark(r, p, e);
    case EDGE_TERMINATOR:
        return see_terminator(view, p, eye, e);
    case EDGE_MESH:
        return see_mesh_edge(view, p, eye, e);
    default:
        return see_round(view, p, e);
    }
}

double rey_edge_in_world(const Render *r, const EdgeRecord *e, bool steps) {
    const SceneView *view = &r->scene->view;
    double length, angle, centre[3], reach;
    switch (e->kind) {
    case EDGE_MEETING:
        return meeting_length(r, e);
    case EDGE_MARK:
        return mark_length(r, e);
    case EDGE_CUT:
        return triangle_area(view, e);
    case EDGE_FACING:
        return view->shapes[e->shape].kind == SHAPE_MESH ? triangle_area(view, e)
                                                         : 12 * pow(round_ball(view, e, centre, &reach), 2);
    case EDGE_TERMINATOR:
        return turning_weight(view, e);
    case EDGE_MESH:
        angle = mesh_edge_angle(view, e, &length);
        angle = steps && e->crease == EDGE_STEP ? fmax(angle, 1) : angle; // jumps whatever the angle is
        return length * angle * (double)(e->last - e->first);
    default:
        return 10 / 3.0 * round_ball(view, e, centre, &reach) * round_length(e); // a silhouette in an angle of about pi
    }
}
