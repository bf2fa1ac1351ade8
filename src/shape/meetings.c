// meetings.c: triangles that pass through each other. Round surfaces are cut into triangles to find where they may meet;
// the ends of what is found are then brought to the surfaces themselves.
#include "shape/meetings.h"

#include "shape/affine.h"
#include "shape/overlaps.h"
#include "shape/shape.h"

#include <math.h>
#include <string.h>

enum { AROUND = 64, STACKS = 32 };
#define TOUCH 1e-4 // of the smaller triangle's size

typedef struct Facets {
    rey_scene *scene;
    const LightBorder *borders;
    MeetingMoves *moves;
    const void *user;
    Array bodies, body_boxes; // of Body, of Box
    Array pieces, boxes;      // of Piece, of Box
    Array *meetings;
} Facets;

// A shape, or an instance of one; shape -1: the border of a light with the number `instance`.
typedef struct Body {
    int32_t shape, instance;
    int32_t meets; // may meet another
} Body;

// A triangle of a body's mesh, or of those that stand for a round shape.
typedef struct Piece {
    int32_t body, triangle;
} Piece;

typedef struct Triangle {
    double p[3][3], n[3]; // n: unit
    double size;          // of its longest side
} Triangle;

static double dot3(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static void cross3(const double a[3], const double b[3], double out[3]) {
    for (int k = 0; k < 3; k++) {
        int i = (k + 1) % 3, j = (k + 2) % 3;
        out[k] = a[i] * b[j] - a[j] * b[i];
    }
}

static void affine_point(const float *m, const double p[3], double out[3]) {
    for (int k = 0; k < 3; k++) {
        out[k] = (double)m[4 * k] * p[0] + (double)m[4 * k + 1] * p[1] + (double)m[4 * k + 2] * p[2] + (double)m[4 * k + 3];
    }
}

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

static void round_corner(const SceneView *view, const ShapeRecord *shape, int32_t triangle, int k, double p[3]) {
    int32_t cell = shape->kind == SHAPE_DISK ? triangle : triangle / 2, column = cell % AROUND, row = cell / AROUND;
    bool second = shape->kind != SHAPE_DISK && triangle % 2 == 1;
    static const int32_t corners[2][3][2] = {{{0, 0}, {0, 1}, {1, 1}}, {{0, 0}, {1, 1}, {1, 0}}};
    const int32_t *at = corners[second][k];
    double own[3];
    round_node(shape->kind, column + at[0], row + at[1], own);
    if (shape->kind == SHAPE_SPHERE) {
        const float *t = view->tables + shape->table;
        for (int c = 0; c < 3; c++) {
            p[c] = (double)t[c] + (double)t[3] * own[c];
        }
    } else {
        affine_point(view->theta + shape->to_world, own, p);
    }
}

static const int32_t *mesh_triangle(const SceneView *view, const ShapeRecord *shape, int32_t triangle) {
    return view->triangles + 3 * ((int64_t)shape->triangle + triangle);
}

static void corner_of(const Facets *f, const Body *body, int32_t triangle, int k, double p[3]) {
    const SceneView *view = &f->scene->view;
    if (body->shape < 0) {
        for (int c = 0; c < 3; c++) {
            p[c] = (double)f->borders[body->instance].p[k][c];
        }
        return;
    }
    const ShapeRecord *shape = view->shapes + body->shape;
    if (shape->kind != SHAPE_MESH) {
        round_corner(view, shape, triangle, k, p);
        return;
    }
    const float *own = view->theta + shape->positions + 3 * (int64_t)mesh_triangle(view, shape, triangle)[k];
    double q[3] = {(double)own[0], (double)own[1], (double)own[2]};
    if (shape->collection >= 0) {
        affine_point(view->theta + view->instances[body->instance].to_world, q, p);
    } else {
        memcpy(p, q, sizeof q);
    }
}

static Triangle triangle_of(const Facets *f, const Piece *piece) {
    Triangle t = {.size = 0};
    double e[2][3];
    for (int k = 0; k < 3; k++) {
        corner_of(f, &ARRAY_AT(f->bodies, Body, piece->body), piece->triangle, k, t.p[k]);
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

// ---- the surfaces themselves -------------------------------------------------------------------------------------

static Quadric quadric_of_plane(const Triangle *t) {
    Quadric q = {.constant = 0};
    for (int k = 0; k < 3; k++) {
        q.centre[k] = (float)t->p[0][k];
        q.linear[k] = (float)t->n[k];
    }
    return q;
}

// f = (|x - centre|^2 - radius^2) / (2 radius)
static Quadric quadric_of_sphere(const float *table) {
    Quadric q = {{table[0], table[1], table[2]}, {0, 0, 0}, -0.5f * table[3], {0}};
    for (int k = 0; k < 3; k++) {
        q.matrix[k] = 1 / table[3];
    }
    return q;
}

// f = (x^2 + y^2 - 1) / 2 in its own space, times a length
static Quadric quadric_of_cylinder(const float *table) {
    const float *x = table + 12, *y = table + 16; // rows of the inverse
    float size = 1 / sqrtf(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]);
    Quadric q = {{table[3], table[7], table[11]}, {0, 0, 0}, -0.5f * size, {0}};
    for (int k = 0; k < 3; k++) {
        int i = (k + 1) % 3, j = (k + 2) % 3;
        q.matrix[k] = size * (x[k] * x[k] + y[k] * y[k]);
        q.matrix[3 + k] = size * (x[i] * x[j] + y[i] * y[j]);
    }
    return q;
}

static Quadric quadric_of(const Facets *f, const Body *body, const Triangle *t) {
    const SceneView *view = &f->scene->view;
    const ShapeRecord *shape = body->shape < 0 ? NULL : view->shapes + body->shape;
    if (!shape && f->borders[body->instance].round) {
        return f->borders[body->instance].cone;
    }
    if (shape && shape->kind == SHAPE_SPHERE) {
        return quadric_of_sphere(view->tables + shape->table);
    }
    if (shape && shape->kind == SHAPE_CYLINDER) {
        return quadric_of_cylinder(view->tables + shape->table);
    }
    return quadric_of_plane(t);
}

static double quadric_value(const Quadric *q, const double x[3], double gradient[3]) {
    double y[3], value = (double)q->constant;
    for (int k = 0; k < 3; k++) {
        y[k] = x[k] - (double)q->centre[k];
    }
    for (int k = 0; k < 3; k++) {
        int i = (k + 1) % 3, j = (k + 2) % 3;
        double my = (double)q->matrix[k] * y[k] + (double)q->matrix[3 + j] * y[i] + (double)q->matrix[3 + i] * y[j];
        gradient[k] = my + (double)q->linear[k];
        value += (0.5 * my + (double)q->linear[k]) * y[k];
    }
    return value;
}

// Brings a point to both surfaces by the shortest steps; false where they do not meet nearby.
static bool meet_at(const Quadric surface[2], double x[3], double near) {
    double start[3] = {x[0], x[1], x[2]}, off2 = 0;
    for (int i = 0; i < 8; i++) {
        double g[2][3], f[2];
        for (int s = 0; s < 2; s++) {
            f[s] = quadric_value(surface + s, x, g[s]);
        }
        double aa = dot3(g[0], g[0]), ab = dot3(g[0], g[1]), bb = dot3(g[1], g[1]), det = aa * bb - ab * ab;
        if (!(det > 1e-12 * aa * bb)) {
            return false;
        }
        double a = (f[0] * bb - f[1] * ab) / det, b = (f[1] * aa - f[0] * ab) / det;
        for (int k = 0; k < 3; k++) {
            x[k] -= a * g[0][k] + b * g[1][k];
        }
    }
    for (int k = 0; k < 3; k++) {
        off2 += (x[k] - start[k]) * (x[k] - start[k]);
    }
    return off2 < near * near;
}

// ---- pairs of triangles ------------------------------------------------------------------------------------------

// Where the sides of a pass through the plane of b: two points, if it lies on both sides of it.
static bool pass_through(const Triangle *a, const Triangle *b, double touch, double points[2][3]) {
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
static bool triangles_meet(const Triangle *a, const Triangle *b, double ends[2][3]) {
    double line[3], pa[2][3], pb[2][3], touch = TOUCH * fmin(a->size, b->size);
    cross3(a->n, b->n, line);
    if (dot3(line, line) < 1e-10 || !pass_through(a, b, touch, pa) || !pass_through(b, a, touch, pb)) {
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

// Neighbours in a mesh touch in any case.
static bool share_vertex(const SceneView *view, const ShapeRecord *shape, int32_t a, int32_t b) {
    const int32_t *x = mesh_triangle(view, shape, a), *y = mesh_triangle(view, shape, b), *welded = view->welded + shape->welded;
    for (int i = 0; i < 9; i++) {
        if (welded[x[i / 3]] == welded[y[i % 3]]) {
            return true;
        }
    }
    return false;
}

static rey_result pieces_overlap(void *user, int32_t first, int32_t second) {
    Facets *f = user;
    const SceneView *view = &f->scene->view;
    const Piece *piece[2] = {&ARRAY_AT(f->pieces, Piece, first), &ARRAY_AT(f->pieces, Piece, second)};
    const Body *body[2] = {&ARRAY_AT(f->bodies, Body, piece[0]->body), &ARRAY_AT(f->bodies, Body, piece[1]->body)};
    if (body[0]->shape < 0) { // borders come last
        return REY_OK;
    }
    const ShapeRecord *shape = view->shapes + body[0]->shape;
    if (piece[0]->body == piece[1]->body &&
        (shape->kind != SHAPE_MESH || share_vertex(view, shape, piece[0]->triangle, piece[1]->triangle))) {
        return REY_OK;
    }
    Triangle t[2] = {triangle_of(f, piece[0]), triangle_of(f, piece[1])};
    double ends[2][3];
    MeetingRecord m;
    if (!triangles_meet(t, t + 1, ends)) {
        return REY_OK;
    }
    bool round = false;
    for (int i = 0; i < 2; i++) {
        const LightBorder *border = body[i]->shape < 0 ? f->borders + body[i]->instance : NULL;
        bool mesh = border ? !border->round : view->shapes[body[i]->shape].kind == SHAPE_MESH;
        m.shape[i] = body[i]->shape;
        m.instance[i] = border ? 0 : body[i]->instance;
        m.prim[i] = border ? border->light : mesh ? piece[i]->triangle : 0;
        m.surface[i] = quadric_of(f, body[i], t + i);
        round |= !mesh;
    }
    double near = 0.1 * fmin(t[0].size, t[1].size);
    if (round && !(meet_at(m.surface, ends[0], near) && meet_at(m.surface, ends[1], near))) {
        return REY_OK;
    }
    for (int i = 0; i < 6; i++) {
        m.ends[i] = (float)ends[i / 3][i % 3];
    }
    MeetingRecord *record = rey_array_push(f->scene->ctx, f->meetings, sizeof *record, 1);
    if (!record) {
        return REY_ERROR_MEMORY;
    }
    *record = m;
    return REY_OK;
}

// ---- all of them -------------------------------------------------------------------------------------------------

static rey_result add_body(Facets *f, int32_t shape, int32_t instance) {
    rey_context *ctx = f->scene->ctx;
    Body *body = rey_array_push(ctx, &f->bodies, sizeof *body, 1);
    Box *box = rey_array_push(ctx, &f->body_boxes, sizeof *box, 1);
    if (!body || !box) {
        return REY_ERROR_MEMORY;
    }
    *body = (Body){shape, instance, 0};
    *box = box_of_points(NULL, 0);
    for (int32_t i = 0; i < triangles_of(&f->scene->view, shape); i++) {
        double p[3][3];
        for (int k = 0; k < 3; k++) {
            corner_of(f, body, i, k, p[k]);
        }
        Box one = box_of_points(p, 3);
        for (int k = 0; k < 3; k++) {
            box->low[k] = fminf(box->low[k], one.low[k]);
            box->high[k] = fmaxf(box->high[k], one.high[k]);
        }
    }
    box->moves = f->moves(f->user, shape, shape < 0 ? f->borders[instance].light : instance);
    body->meets = shape >= 0 && box->moves && f->scene->view.shapes[shape].kind == SHAPE_MESH; // itself
    return REY_OK;
}

static rey_result add_bodies(Facets *f, int32_t border_count) {
    const SceneView *view = &f->scene->view;
    rey_result result = REY_OK;
    for (int32_t id = 0; id < view->shapes_count && result == REY_OK; id++) {
        const ShapeRecord *shape = view->shapes + id;
        if ((shape->flags & SHAPE_UNSEEN) || triangles_of(view, id) == 0) {
            continue;
        }
        if (shape->collection < 0) {
            result = add_body(f, id, 0);
        }
        for (int32_t i = 0; i < view->instances_count && shape->collection >= 0 && result == REY_OK; i++) {
            result = view->instances[i].group == shape->collection ? add_body(f, id, i) : REY_OK;
        }
    }
    for (int32_t i = 0; i < border_count && result == REY_OK; i++) {
        result = add_body(f, -1, i);
    }
    return result;
}

static rey_result bodies_overlap(void *user, int32_t first, int32_t second) {
    Facets *f = user;
    ARRAY_AT(f->bodies, Body, first).meets = 1;
    ARRAY_AT(f->bodies, Body, second).meets = 1;
    return REY_OK;
}

static rey_result add_pieces(Facets *f) {
    rey_context *ctx = f->scene->ctx;
    for (int32_t b = 0; b < (int32_t)f->bodies.count; b++) {
        const Body *body = &ARRAY_AT(f->bodies, Body, b);
        int32_t n = body->meets ? triangles_of(&f->scene->view, body->shape) : 0;
        if (n == 0) {
            continue;
        }
        Piece *pieces = rey_array_push(ctx, &f->pieces, sizeof *pieces, (size_t)n);
        Box *boxes = rey_array_push(ctx, &f->boxes, sizeof *boxes, (size_t)n);
        if (!pieces || !boxes) {
            return REY_ERROR_MEMORY;
        }
        for (int32_t i = 0; i < n; i++) {
            double p[3][3];
            for (int k = 0; k < 3; k++) {
                corner_of(f, body, i, k, p[k]);
            }
            pieces[i] = (Piece){b, i};
            boxes[i] = box_of_points(p, 3);
            boxes[i].moves = ARRAY_AT(f->body_boxes, Box, b).moves;
        }
    }
    return f->pieces.count < INT32_MAX ? REY_OK : rey_fail(ctx, REY_ERROR_UNSUPPORTED, "more than 2^31 triangles may meet");
}

rey_result rey_meetings_find(rey_scene *scene, const LightBorder *borders, int32_t border_count, MeetingMoves *moves,
                             const void *user, Array *meetings) {
    Facets f = {.scene = scene, .borders = borders, .moves = moves, .user = user, .meetings = meetings};
    rey_context *ctx = scene->ctx;
    rey_result result = add_bodies(&f, border_count);
    if (result == REY_OK) {
        result = rey_overlaps_find(ctx, f.body_boxes.data, (int32_t)f.bodies.count, bodies_overlap, &f);
    }
    if (result == REY_OK) {
        result = add_pieces(&f);
    }
    if (result == REY_OK) {
        result = rey_overlaps_find(ctx, f.boxes.data, (int32_t)f.pieces.count, pieces_overlap, &f);
    }
    rey_array_free(ctx, &f.bodies);
    rey_array_free(ctx, &f.body_boxes);
    rey_array_free(ctx, &f.pieces);
    rey_array_free(ctx, &f.boxes);
    return result;
}
