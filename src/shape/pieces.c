// pieces.c: round surfaces are cut into triangles to find where they may meet. Those of tubes are outside of them.
#include "shape/pieces.h"

#include "shape/affine.h"
#include "shape/shape.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { AROUND = 64, STACKS = 32, TUBE_AROUND = 16, TUBE_STACKS = 4 };

// ---- surfaces in triangles ---------------------------------------------------------------------------------------

static int32_t triangles_of(const SceneView *view, int32_t id) {
    if (id < 0) {
        return 1;
    }
    const ShapeRecord *shape = view->shapes + id;
    switch (shape->kind) {
    case SHAPE_MESH:
        return shape->triangle_count;
    case SHAPE_SPHERE:
        return 2 * AROUND * STACKS;
    case SHAPE_CYLINDER:
        return 2 * AROUND;
    case SHAPE_DISK:
        return AROUND;
    case SHAPE_BSPLINE:
        return REY_TUBE_PIECES; // of a segment
    default:
        return 0;
    }
}

// Node (column, row) of the grid of a round shape, in its own space; the last column is the first again.
static void round_node(int32_t kind, int32_t column, int32_t row, double p[3]) {
    const double pi = 3.14159265358979323846;
    double phi = 2 * pi * (column % AROUND) / AROUND, x = cos(phi), y = sin(phi);
    double theta = kind == SHAPE_SPHERE ? pi * row / STACKS : 0;
    double wide = kind == SHAPE_CYLINDER ? 1 : kind == SHAPE_DISK ? row : sin(theta);
    p[0] = wide * x;
    p[1] = wide * y;
    p[2] = kind == SHAPE_SPHERE ? cos(theta) : kind == SHAPE_CYLINDER ? row : 0;
}

// The columns and rows of the corners of both triangles of a cell.
static const int32_t cell_corners[2][3][2] = {{{0, 0}, {0, 1}, {1, 1}}, {{0, 0}, {1, 1}, {1, 0}}};

static void round_corner(const SceneView *view, const ShapeRecord *shape, int32_t triangle, int k, double p[3]) {
    int32_t cell = shape->kind == SHAPE_DISK ? triangle : triangle / 2, column = cell % AROUND, row = cell / AROUND;
    bool second = shape->kind != SHAPE_DISK && triangle % 2 == 1;
    const int32_t *at = cell_corners[second][k];
    double own[3];
    round_node(shape->kind, column + at[0], row + at[1], own);
    if (shape->kind == SHAPE_SPHERE) {
        const float *t = view->tables + shape->table;
        for (int c = 0; c < 3; c++) {
            p[c] = (double)t[c] + (double)t[3] * own[c];
        }
    } else {
        rey_affine_point(view->theta + shape->to_world, own, p);
    }
}

// Unit vector along v less its part along the unit vector t.
static void across_of(const double v[3], const double t[3], double out[3]) {
    double along = dot3(v, t), length2 = 0;
    for (int k = 0; k < 3; k++) {
        out[k] = v[k] - along * t[k];
        length2 += out[k] * out[k];
    }
    for (int k = 0; k < 3; k++) {
        out[k] = length2 > 0 ? out[k] / sqrt(length2) : 0;
    }
}

static CurvePoint tube_at(const SceneView *view, int32_t id, int32_t segment, float u) {
    Hit hit = {.shape = id, .prim = segment, .u = u};
    return bspline_point(view, &hit);
}

bool rey_tube_folds(const SceneView *view, int32_t id) {
    for (int32_t i = 0; i < 8 * view->shapes[id].segment_count; i++) {
        CurvePoint at = tube_at(view, id, i / 8, 0.125f * (float)(i % 8) + 0.0625f);
        float speed = v3_length(at.c1);
        if (speed * speed * speed < at.r * v3_length(v3_cross(at.c1, at.c2))) {
            return true;
        }
    }
    return false;
}

void rey_tube_box(const SceneView *view, int32_t id, int32_t segment, double room, double low[3], double high[3]) {
    const ShapeRecord *shape = view->shapes + id;
    const float *p = view->theta + shape->positions + 4 * (int64_t)view->segments[shape->segment + segment];
    for (int k = 0; k < 3; k++) {
        low[k] = INFINITY;
        high[k] = -INFINITY;
        for (int i = 0; i < BSPLINE_POINTS; i++) {
            low[k] = fmin(low[k], (double)p[4 * i + k] - room * (double)p[4 * i + 3]);
            high[k] = fmax(high[k], (double)p[4 * i + k] + room * (double)p[4 * i + 3]);
        }
    }
}

static void tangent_of(const CurvePoint *at, double t[3]) {
    Vec3 tangent = v3_normalize(at->c1);
    t[0] = (double)tangent.x;
    t[1] = (double)tangent.y;
    t[2] = (double)tangent.z;
}

// Of a tube's triangle: nodes around the axis count from a vector that goes along it without turning about it.
static void tube_corner(const SceneView *view, int32_t id, int32_t triangle, int corner, double p[3]) {
    int32_t cell = triangle % REY_TUBE_PIECES / 2;
    const int32_t *at = cell_corners[triangle % 2][corner];
    const int32_t column = cell % TUBE_AROUND + at[0], row = cell / TUBE_AROUND + at[1];
    const double pi = 3.14159265358979323846, phi = 2 * pi * column / TUBE_AROUND;
    CurvePoint axis = tube_at(view, id, triangle / REY_TUBE_PIECES, 0);
    double t[3], e[3], f[3];
    tangent_of(&axis, t);
    const double least[3] = {fabs(t[0]) < 0.5, fabs(t[0]) >= 0.5, 0};
    across_of(least, t, e);
    for (int32_t i = 1; i <= row; i++) {
        axis = tube_at(view, id, triangle / REY_TUBE_PIECES, (float)i / TUBE_STACKS);
        tangent_of(&axis, t);
        across_of(e, t, e);
    }
    cross3(t, e, f);
    const double c[3] = {(double)axis.c.x, (double)axis.c.y, (double)axis.c.z}, wide = (double)axis.r / cos(pi / TUBE_AROUND);
    for (int k = 0; k < 3; k++) {
        p[k] = c[k] + wide * (cos(phi) * e[k] + sin(phi) * f[k]);
    }
}

const int32_t *rey_mesh_triangle(const SceneView *view, const ShapeRecord *shape, int32_t triangle) {
    return view->triangles + 3 * ((int64_t)shape->triangle + triangle);
}

static void corner_of(const Pieces *s, const Body *body, int32_t triangle, int k, double p[3]) {
    const SceneView *view = &s->scene->view;
    if (body->shape < 0) {
        for (int c = 0; c < 3; c++) {
            p[c] = (double)s->borders[body->instance].p[k][c];
        }
        return;
    }
    const ShapeRecord *shape = view->shapes + body->shape;
    double q[3];
    if (shape->kind == SHAPE_MESH) {
        const float *own = view->theta + shape->positions + 3 * (int64_t)rey_mesh_triangle(view, shape, triangle)[k];
        for (int c = 0; c < 3; c++) {
            q[c] = (double)own[c];
        }
    } else if (shape->kind == SHAPE_BSPLINE) {
        tube_corner(view, body->shape, triangle, k, q);
    } else {
        round_corner(view, shape, triangle, k, q);
    }
    if (shape->collection >= 0) {
        rey_affine_point(view->theta + view->instances[body->instance].to_world, q, p);
    } else {
        memcpy(p, q, sizeof q);
    }
}

Triangle rey_piece_triangle(const Pieces *s, const Piece *piece) {
    Triangle t = {.size = 0};
    double e[2][3];
    for (int k = 0; k < 3; k++) {
        corner_of(s, &ARRAY_AT(s->bodies, Body, piece->body), piece->triangle, k, t.p[k]);
    }
    for (int k = 0; k < 3; k++) {
        double side[3];
        for (int c = 0; c < 3; c++) {
            side[c] = t.p[(k + 1) % 3][c] - t.p[k][c];
        }
        t.size = fmax(t.size, sqrt(dot3(side, side)));
    }
    for (int c = 0; c < 3; c++) {
        e[0][c] = t.p[1][c] - t.p[0][c];
        e[1][c] = t.p[2][c] - t.p[0][c];
    }
    cross3(e[0], e[1], t.n);
    double length = sqrt(dot3(t.n, t.n));
    for (int c = 0; c < 3; c++) {
        t.n[c] = length > 0 ? t.n[c] / length : 0;
    }
    return t;
}

static Box box_of_points(const double (*p)[3], int count) {
    Box box = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}, 0};
    for (int i = 0; i < count; i++) {
        for (int k = 0; k < 3; k++) {
            box.low[k] = fminf(box.low[k], (float)p[i][k]);
            box.high[k] = fmaxf(box.high[k], (float)p[i][k]);
        }
    }
    return box;
}

// ---- pairs of triangles ------------------------------------------------------------------------------------------

// Where the sides of a pass through the plane of b: two points, if it lies on both sides of it.
bool rey_triangle_passes(const Triangle *a, const Triangle *b, double touch, double points[2][3]) {
    double d[3];
    int count = 0;
    for (int k = 0; k < 3; k++) {
        double q[3] = {a->p[k][0] - b->p[0][0], a->p[k][1] - b->p[0][1], a->p[k][2] - b->p[0][2]};
        d[k] = dot3(b->n, q);
        d[k] = fabs(d[k]) < touch ? 0 : d[k];
    }
    if (!(fmin(d[0], fmin(d[1], d[2])) < 0 && fmax(d[0], fmax(d[1], d[2])) > 0)) {
        return false;
    }
    for (int k = 0; k < 3 && count < 2; k++) {
        int next = (k + 1) % 3;
        if (d[k] == 0) {
            memcpy(points[count++], a->p[k], sizeof a->p[k]);
        } else if (d[k] * d[next] < 0) {
            double s = d[k] / (d[k] - d[next]);
            for (int c = 0; c < 3; c++) {
                points[count][c] = a->p[k][c] + s * (a->p[next][c] - a->p[k][c]);
            }
            count++;
        }
    }
    return count == 2;
}

// The line on which two triangles meet.
bool rey_triangles_meet(const Triangle *a, const Triangle *b, TriangleReach *reach, double tolerance, double ends[2][3]) {
    double line[3], pa[2][3], pb[2][3], touch = tolerance * fmin(a->size, b->size);
    cross3(a->n, b->n, line);
    if (dot3(line, line) < 1e-10 || !reach(a, b, touch, pa) || !reach(b, a, touch, pb)) {
        return false;
    }
    double a0 = dot3(line, pa[0]), a1 = dot3(line, pa[1]), b0 = dot3(line, pb[0]), b1 = dot3(line, pb[1]);
    double low = fmax(fmin(a0, a1), fmin(b0, b1)), high = fmin(fmax(a0, a1), fmax(b0, b1));
    if (!(high - low > 1e-7 * touch * sqrt(dot3(line, line)))) {
        return false;
    }
    for (int i = 0; i < 2; i++) {
        double s = ((i ? high : low) - a0) / (a1 - a0);
        for (int c = 0; c < 3; c++) {
            ends[i][c] = pa[0][c] + s * (pa[1][c] - pa[0][c]);
        }
    }
    return true;
}

// ---- what overlaps -------------------------------------------------------------------------------------------------

static void widen(const Pieces *s, Box *box) {
    float size = 0;
    for (int k = 0; k < 3; k++) {
        size = fmaxf(size, box->high[k] - box->low[k]);
    }
    for (int k = 0; k < 3; k++) {
        box->low[k] -= s->margin * size;
        box->high[k] += s->margin * size;
    }
}

static Box box_of_triangles(const Pieces *s, const Body *body) {
    Box box = box_of_points(NULL, 0);
    for (int32_t i = 0; i < triangles_of(&s->scene->view, body->shape); i++) {
        double p[3][3];
        for (int k = 0; k < 3; k++) {
            corner_of(s, body, i, k, p[k]);
        }
        Box one = box_of_points((const double(*)[3])p, 3);
        for (int k = 0; k < 3; k++) {
            box.low[k] = fminf(box.low[k], one.low[k]);
            box.high[k] = fmaxf(box.high[k], one.high[k]);
        }
    }
    return box;
}

static Box box_of_round(const SceneView *view, const Body *body) {
    const ShapeRecord *shape = view->shapes + body->shape;
    double low[3] = {-1, -1, 0}, high[3] = {1, 1, shape->kind == SHAPE_CYLINDER}, corners[8][3];
    if (shape->kind == SHAPE_SPHERE) {
        const float *table = view->tables + shape->table;
        for (int k = 0; k < 3; k++) {
            low[k] = (double)table[k] - (double)table[3];
            high[k] = (double)table[k] + (double)table[3];
        }
    } else if (shape->kind == SHAPE_BSPLINE) {
        rey_tube_box(view, body->shape, body->segment, 1 / cos(3.14159265358979323846 / TUBE_AROUND), low, high);
    }
    for (int i = 0; i < 8; i++) {
        double *p = corners[i];
        for (int k = 0; k < 3; k++) {
            p[k] = i >> k & 1 ? high[k] : low[k];
        }
        if (shape->kind == SHAPE_DISK || shape->kind == SHAPE_CYLINDER) {
            rey_affine_point(view->theta + shape->to_world, p, p);
        }
        if (shape->collection >= 0) {
            rey_affine_point(view->theta + view->instances[body->instance].to_world, p, p);
        }
    }
    return box_of_points((const double(*)[3])corners, 8);
}

static rey_result add_body(Pieces *s, int32_t shape, int32_t instance, int32_t segment) {
    rey_context *ctx = s->scene->ctx;
    Body *body = rey_array_push(ctx, &s->bodies, sizeof *body, 1);
    Box *box = rey_array_push(ctx, &s->body_boxes, sizeof *box, 1);
    if (!body || !box) {
        return REY_ERROR_MEMORY;
    }
    *body = (Body){shape, instance, segment, 0};
    if (shape < 0 || s->scene->view.shapes[shape].kind == SHAPE_MESH) {
        *box = box_of_triangles(s, body);
    } else {
        *box = box_of_round(&s->scene->view, body);
    }
    widen(s, box);
    box->moves = s->moves(s->user, shape, shape < 0 ? s->borders[instance].light : instance);
    body->meets = s->itself && shape >= 0 && box->moves && s->scene->view.shapes[shape].kind == SHAPE_MESH; // itself
    return REY_OK;
}

// Each segment of a tube is a body, lest all of a head of hair is cut up.
static rey_result add_shape(Pieces *s, int32_t shape, int32_t instance) {
    const ShapeRecord *record = s->scene->view.shapes + shape;
    if (record->kind != SHAPE_BSPLINE) {
        return add_body(s, shape, instance, -1);
    }
    rey_result result = REY_OK;
    for (int32_t i = 0; i < record->segment_count && result == REY_OK; i++) {
        result = add_body(s, shape, instance, i);
    }
    return result;
}

static rey_result add_bodies(Pieces *s) {
    const SceneView *view = &s->scene->view;
    rey_result result = REY_OK;
    for (int32_t id = 0; id < view->shapes_count && result == REY_OK; id++) {
        const ShapeRecord *shape = view->shapes + id;
        if ((shape->flags & SHAPE_UNSEEN) || triangles_of(view, id) == 0) {
            continue;
        }
        if (shape->collection < 0) {
            result = add_shape(s, id, 0);
        }
        for (int32_t i = 0; i < view->instances_count && shape->collection >= 0 && result == REY_OK; i++) {
            result = view->instances[i].group == shape->collection ? add_shape(s, id, i) : REY_OK;
        }
    }
    for (int32_t i = 0; i < s->border_count && result == REY_OK; i++) {
        result = add_body(s, -1, i, -1);
    }
    return result;
}

bool rey_bodies_join(const SceneView *view, const Body *a, const Body *b) {
    if (a->segment < 0 || b->segment < 0 || a->shape != b->shape || a->instance != b->instance) {
        return false;
    }
    const int32_t *first = view->segments + view->shapes[a->shape].segment;
    return abs(first[a->segment] - first[b->segment]) <= 1;
}

static rey_result bodies_overlap(void *user, int32_t first, int32_t second) {
    Pieces *s = user;
    Body *a = &ARRAY_AT(s->bodies, Body, first), *b = &ARRAY_AT(s->bodies, Body, second);
    bool meet = !rey_bodies_join(&s->scene->view, a, b);
    a->meets |= meet;
    b->meets |= meet;
    return REY_OK;
}

static rey_result add_pieces(Pieces *s) {
    rey_context *ctx = s->scene->ctx;
    for (int32_t b = 0; b < (int32_t)s->bodies.count; b++) {
        const Body *body = &ARRAY_AT(s->bodies, Body, b);
        int32_t n = body->meets ? triangles_of(&s->scene->view, body->shape) : 0;
        if (n == 0) {
            continue;
        }
        Piece *pieces = rey_array_push(ctx, &s->pieces, sizeof *pieces, (size_t)n);
        Box *boxes = rey_array_push(ctx, &s->boxes, sizeof *boxes, (size_t)n);
        if (!pieces || !boxes) {
            return REY_ERROR_MEMORY;
        }
        for (int32_t i = 0; i < n; i++) {
            double p[3][3];
            const int32_t triangle = i + (body->segment < 0 ? 0 : REY_TUBE_PIECES * body->segment);
            for (int k = 0; k < 3; k++) {
                corner_of(s, body, triangle, k, p[k]);
            }
            pieces[i] = (Piece){b, triangle};
            boxes[i] = box_of_points(p, 3);
            widen(s, boxes + i);
            boxes[i].moves = ARRAY_AT(s->body_boxes, Box, b).moves;
        }
    }
    return s->pieces.count < INT32_MAX ? REY_OK : rey_fail(ctx, REY_ERROR_UNSUPPORTED, "more than 2^31 triangles may meet");
}

rey_result rey_pieces_overlap(Pieces *s, OverlapFn *overlap) {
    rey_context *ctx = s->scene->ctx;
    rey_result result = add_bodies(s);
    if (result == REY_OK) {
        result = rey_overlaps_find(ctx, s->body_boxes.data, (int32_t)s->bodies.count, bodies_overlap, s);
    }
    if (result == REY_OK) {
        result = add_pieces(s);
    }
    if (result == REY_OK) {
        result = rey_overlaps_find(ctx, s->boxes.data, (int32_t)s->pieces.count, overlap, s);
    }
    rey_array_free(ctx, &s->bodies);
    rey_array_free(ctx, &s->body_boxes);
    rey_array_free(ctx, &s->pieces);
    rey_array_free(ctx, &s->boxes);
    return result;
}
