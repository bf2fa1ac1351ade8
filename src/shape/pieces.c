// pieces.c: the triangles of all surfaces, and those pairs of them that may meet.
#include "shape/pieces.h"

#include "shape/affine.h"
#include "shape/shape.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static int32_t triangles_of(const SceneView *view, int32_t id) { return id < 0 ? 1 : rey_cut_triangles(view, id); }

static void corner_of(const Pieces *s, const Body *body, int32_t triangle, int k, double p[3]) {
    const SceneView *view = &s->scene->view;
    if (body->shape < 0) {
        for (int c = 0; c < 3; c++) {
            p[c] = (double)s->borders[body->instance].p[k][c];
        }
        return;
    }
    rey_cut_corner(view, body->shape, triangle, k, p);
    if (view->shapes[body->shape].collection >= 0) {
        rey_affine_point(view->theta + view->instances[body->instance].to_world, p, p);
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
    Box box = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}, 0, -1};
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

static void grow(Box *box, const float low[3], const float high[3]) {
    for (int k = 0; k < 3; k++) {
        box->low[k] = fminf(box->low[k], low[k]);
        box->high[k] = fmaxf(box->high[k], high[k]);
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
        grow(&box, one.low, one.high);
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
        rey_cut_box(view, body->shape, body->segment, low, high);
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

// Whether a body's triangles may meet each other.
static bool meets_itself(const Pieces *s, const Body *body) {
    const ShapeRecord *shape = body->shape < 0 ? NULL : s->scene->view.shapes + body->shape;
    return shape && shape->kind == SHAPE_MESH && shape->triangle_count <= s->itself;
}

static rey_result add_body(Pieces *s, int32_t shape, int32_t instance, int32_t segment) {
    rey_context *ctx = s->scene->ctx;
    Body *body = rey_array_push(ctx, &s->bodies, sizeof *body, 1);
    Box *box = rey_array_push(ctx, &s->body_boxes, sizeof *box, 1);
    if (!body || !box) {
        return REY_ERROR_MEMORY;
    }
    *body = (Body){shape, instance, segment, box_of_points(NULL, 0)};
    if (shape < 0 || s->scene->view.shapes[shape].kind == SHAPE_MESH) {
        *box = box_of_triangles(s, body);
    } else {
        *box = box_of_round(&s->scene->view, body);
    }
    widen(s, box);
    box->moves = s->moves(s->user, shape, shape < 0 ? s->borders[instance].light : instance);
    if (meets_itself(s, body) && box->moves) {
        grow(&body->window, box->low, box->high);
    }
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
        if ((shape->flags & SHAPE_UNSEEN) || triangles_of(view, id) == 0 || (s->meshes && shape->kind != SHAPE_MESH)) {
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

// Whether of two spheres in the world one lies outside or inside of the other.
static bool spheres_apart(const Pieces *s, const Body *a, const Body *b) {
    const SceneView *view = &s->scene->view;
    const Body *both[2] = {a, b};
    const float *table[2];
    for (int i = 0; i < 2; i++) {
        const ShapeRecord *shape = both[i]->shape < 0 ? NULL : view->shapes + both[i]->shape;
        if (!shape || shape->kind != SHAPE_SPHERE || shape->collection >= 0) {
            return false;
        }
        table[i] = view->tables + shape->table;
    }
    float d2 = 0, far = table[0][3] + table[1][3], near = fabsf(table[0][3] - table[1][3]), room = 2 * s->margin * far;
    for (int k = 0; k < 3; k++) {
        d2 += (table[0][k] - table[1][k]) * (table[0][k] - table[1][k]);
    }
    return sqrtf(d2) > far + room || sqrtf(d2) + room < near;
}

static rey_result bodies_overlap(void *user, int32_t first, int32_t second) {
    Pieces *s = user;
    Body *a = &ARRAY_AT(s->bodies, Body, first), *b = &ARRAY_AT(s->bodies, Body, second);
    const Box *x = &ARRAY_AT(s->body_boxes, Box, first), *y = &ARRAY_AT(s->body_boxes, Box, second);
    float low[3], high[3];
    if (rey_bodies_join(&s->scene->view, a, b) || spheres_apart(s, a, b)) {
        return REY_OK;
    }
    for (int k = 0; k < 3; k++) {
        low[k] = fmaxf(x->low[k], y->low[k]);
        high[k] = fminf(x->high[k], y->high[k]);
    }
    grow(&a->window, low, high);
    grow(&b->window, low, high);
    return REY_OK;
}

static rey_result add_pieces(Pieces *s) {
    rey_context *ctx = s->scene->ctx;
    for (int32_t b = 0; b < (int32_t)s->bodies.count; b++) {
        const Body *body = &ARRAY_AT(s->bodies, Body, b);
        const int32_t n = body->window.low[0] <= body->window.high[0] ? triangles_of(&s->scene->view, body->shape) : 0;
        const int32_t family = meets_itself(s, body) ? -1 : b;
        int32_t kept = 0;
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
            Box box = box_of_points(p, 3);
            widen(s, &box);
            box.moves = ARRAY_AT(s->body_boxes, Box, b).moves;
            box.family = family;
            if (!rey_boxes_apart(&box, &body->window)) {
                pieces[kept] = (Piece){b, triangle};
                boxes[kept++] = box;
            }
        }
        s->pieces.count -= (size_t)(n - kept);
        s->boxes.count -= (size_t)(n - kept);
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
