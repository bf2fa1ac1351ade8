// meetings.c: triangles that pass through each other. Of round surfaces the ends of what is found are brought to the surfaces
// themselves.
#include "shape/pieces.h"
#include "shape/shape.h"

#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#define TOUCH 1e-4 // of the smaller triangle's size

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

// One of a shapegroup's space, without a linear part, in the world: M becomes A^T M A, A the linear part of the inverse, times a
// length. table: rows of to_world and of its inverse.
static Quadric quadric_of_instance(const float *table, const Quadric *own) {
    const float *m = own->matrix, *a = table + 12;
    const float full[3][3] = {{m[0], m[5], m[4]}, {m[5], m[1], m[3]}, {m[4], m[3], m[2]}};
    static const int at[6][2] = {{0, 0}, {1, 1}, {2, 2}, {1, 2}, {2, 0}, {0, 1}};
    float size = 1 / sqrtf(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]);
    Quadric q = {.constant = own->constant * size};
    for (int k = 0; k < 3; k++) {
        const float *row = table + 4 * k, *c = own->centre;
        q.centre[k] = row[0] * c[0] + row[1] * c[1] + row[2] * c[2] + row[3];
    }
    for (int k = 0; k < 6; k++) {
        for (int i = 0; i < 9; i++) {
            q.matrix[k] += size * a[4 * (i / 3) + at[k][0]] * full[i / 3][i % 3] * a[4 * (i % 3) + at[k][1]];
        }
    }
    return q;
}

static Quadric quadric_of(const Pieces *s, const Body *body, const Triangle *t) {
    const SceneView *view = &s->scene->view;
    const ShapeRecord *shape = body->shape < 0 ? NULL : view->shapes + body->shape;
    if (!shape && s->borders[body->instance].round) {
        return s->borders[body->instance].cone;
    }
    if (shape && (shape->kind == SHAPE_SPHERE || shape->kind == SHAPE_CYLINDER)) {
        const float *table = view->tables + shape->table;
        Quadric q = shape->kind == SHAPE_SPHERE ? quadric_of_sphere(table) : quadric_of_cylinder(table);
        return shape->collection < 0 ? q : quadric_of_instance(view->tables + view->instances[body->instance].table, &q);
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

// The value of a meeting's surface, and its gradient.
static double surface_value(const SceneView *view, const MeetingRecord *m, int which, const double x[3], double gradient[3]) {
    Hit hit = {.shape = m->shape[which], .prim = m->prim[which], .instance = m->instance[which]};
    if (hit.shape < 0 || view->shapes[hit.shape].kind != SHAPE_BSPLINE) {
        return quadric_value(m->surface + which, x, gradient);
    }
    Vec3 slope;
    float distance = tube_distance(view, &hit, v3((float)x[0], (float)x[1], (float)x[2]), &slope);
    gradient[0] = (double)slope.x;
    gradient[1] = (double)slope.y;
    gradient[2] = (double)slope.z;
    return (double)distance;
}

// Brings a point to both surfaces by the shortest steps; false where they do not meet nearby.
static bool meet_at(const SceneView *view, const MeetingRecord *m, double x[3], double near) {
    double start[3] = {x[0], x[1], x[2]}, off2 = 0;
    for (int i = 0; i < 8; i++) {
        double g[2][3], f[2];
        for (int s = 0; s < 2; s++) {
            f[s] = surface_value(view, m, s, x, g[s]);
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

// Neighbours in a mesh touch in any case.
static bool share_vertex(const SceneView *view, const ShapeRecord *shape, int32_t a, int32_t b) {
    const int32_t *x = rey_mesh_triangle(view, shape, a), *y = rey_mesh_triangle(view, shape, b);
    const int32_t *welded = view->welded + shape->welded;
    for (int i = 0; i < 9; i++) {
        if (welded[x[i / 3]] == welded[y[i % 3]]) {
            return true;
        }
    }
    return false;
}

// A side of a triangle that lies in another one's face, or on a side of it. Where the triangle beyond it is on the other side of
// the face, both together pass through it; on a side of it they do where that holds for all four. That is, of triangles in one
// plane: sides between others are edges, which are known by themselves where they are outlines.
typedef struct Half {
    int32_t body, vertices[2], other, face; // vertices: welded; face: -1 = a side of the other body,
    int32_t across[2];                      // with these vertices
    int32_t sort;                           // 1: the triangle is above the face, 2: that of the side is above the triangle
    float normals[2][3];                    // of the triangle and of the face
    MeetingRecord meeting;
} Half;

// Puts the same next to each other.
static int compare_halves(const void *a, const void *b) { return memcmp(a, b, offsetof(Half, normals)); }

// Whether triangles of one body lie in one plane, and those of the other one.
static bool are_even(const Half *a, const Half *b) {
    bool even = true;
    for (int i = 0; i < 2; i++) {
        const float *n = a->normals[i], *m = b->normals[i];
        float x = n[1] * m[2] - n[2] * m[1], y = n[2] * m[0] - n[0] * m[2], z = n[0] * m[1] - n[1] * m[0];
        even &= x * x + y * y + z * z < (float)(TOUCH * TOUCH);
    }
    return even;
}

static bool is_flat(const Pieces *s, const Body *body) {
    const int32_t kind = body->shape < 0 ? -1 : s->scene->view.shapes[body->shape].kind;
    return body->shape < 0 ? !s->borders[body->instance].round : kind == SHAPE_MESH || kind == SHAPE_DISK;
}

// The side of a that lies in the plane of b: its ends, and the number of the corner that is not on it, or -1 where there is no such
// side. *above: where that corner is.
static int side_in(const Triangle *a, const Triangle *b, double touch, double on[2][3], bool *above) {
    int count = 0, off = -1;
    for (int k = 0; k < 3; k++) {
        double q[3] = {a->p[k][0] - b->p[0][0], a->p[k][1] - b->p[0][1], a->p[k][2] - b->p[0][2]}, d = dot3(b->n, q);
        if (fabs(d) >= touch) {
            off = k;
            *above = d > 0;
        } else if (count < 2) {
            memcpy(on[count++], a->p[k], sizeof on[0]);
        }
    }
    return count == 2 ? off : -1;
}

static void side_vertices(const Pieces *s, const Piece *piece, int off, int32_t vertices[2]) {
    const SceneView *view = &s->scene->view;
    const ShapeRecord *shape = view->shapes + ARRAY_AT(s->bodies, Body, piece->body).shape;
    const int32_t *corners = rey_mesh_triangle(view, shape, piece->triangle), *welded = view->welded + shape->welded;
    int32_t x = welded[corners[(off + 1) % 3]], y = welded[corners[(off + 2) % 3]];
    vertices[0] = x < y ? x : y;
    vertices[1] = x < y ? y : x;
}

// The part of the line between two points that others on it span.
static bool span(double on[2][3], double across[2][3], double least, double ends[2][3]) {
    double line[3], length2 = 0, at[2];
    for (int k = 0; k < 3; k++) {
        line[k] = on[1][k] - on[0][k];
        length2 += line[k] * line[k];
    }
    for (int i = 0; i < 2; i++) {
        double q[3] = {across[i][0] - on[0][0], across[i][1] - on[0][1], across[i][2] - on[0][2]};
        at[i] = length2 > 0 ? dot3(q, line) / length2 : 0;
    }
    double from = fmax(0, fmin(at[0], at[1])), to = fmin(1, fmax(at[0], at[1]));
    for (int k = 0; k < 3; k++) {
        ends[0][k] = on[0][k] + from * line[k];
        ends[1][k] = on[0][k] + to * line[k];
    }
    return (to - from) * sqrt(length2) > least;
}

static bool is_mesh(const Pieces *s, const Piece *piece) {
    const int32_t id = ARRAY_AT(s->bodies, Body, piece->body).shape;
    return id >= 0 && s->scene->view.shapes[id].kind == SHAPE_MESH;
}

// Of t[own], of a mesh, and a face that it does not pass through.
static bool half_of(const Pieces *s, const Piece *const *piece, const Triangle *t, int own, Half *half, double ends[2][3]) {
    const Triangle *a = t + own, *b = t + !own;
    double touch = TOUCH * fmin(a->size, b->size), on[2][3], across[2][3];
    bool above = false, beside = false;
    if (!is_mesh(s, piece[own]) || !is_flat(s, &ARRAY_AT(s->bodies, Body, piece[!own]->body))) {
        return false;
    }
    *half = (Half){.body = piece[own]->body, .other = piece[!own]->body, .face = piece[!own]->triangle, .across = {-1, -1}};
    int off = side_in(a, b, touch, on, &above);
    if (off < 0) {
        return false;
    }
    if (!rey_triangle_passes(b, a, touch, across)) {
        int far = side_in(b, a, touch, across, &beside);
        if (far < 0 || !is_mesh(s, piece[!own]) || half->body == half->other) {
            return false;
        }
        half->face = -1;
        side_vertices(s, piece[!own], far, half->across);
    }
    side_vertices(s, piece[own], off, half->vertices);
    half->sort = above + 2 * beside;
    for (int k = 0; k < 3; k++) {
        half->normals[0][k] = (float)a->n[k];
        half->normals[1][k] = (float)b->n[k];
    }
    return span(on, across, touch, ends);
}

static rey_result keep(const Pieces *s, const MeetingRecord *m) {
    MeetingRecord *record = rey_array_push(s->scene->ctx, s->found, sizeof *record, 1);
    if (!record) {
        return REY_ERROR_MEMORY;
    }
    *record = *m;
    return REY_OK;
}

static rey_result keep_half(const Pieces *s, const Half *half, const MeetingRecord *m) {
    Half *kept = rey_array_push(s->scene->ctx, s->halves, sizeof *kept, 1);
    if (!kept) {
        return REY_ERROR_MEMORY;
    }
    *kept = *half;
    kept->meeting = *m;
    return REY_OK;
}

// Of halves that belong together one is kept.
static rey_result join_halves(const Pieces *s) {
    Half *halves = s->halves->data;
    if (s->halves->count > 0) {
        qsort(halves, s->halves->count, sizeof *halves, compare_halves);
    }
    rey_result result = REY_OK;
    for (size_t i = 0, next; i < s->halves->count && result == REY_OK; i = next) {
        unsigned sorts = 0;
        bool even = true;
        for (next = i; next < s->halves->count && memcmp(halves + i, halves + next, offsetof(Half, sort)) == 0; next++) {
            sorts |= 1u << halves[next].sort;
            even &= are_even(halves + i, halves + next);
        }
        if (even && sorts == (halves[i].face < 0 ? 15u : 3u)) {
            result = keep(s, &halves[i].meeting);
        }
    }
    return result;
}

static rey_result pieces_overlap(void *user, int32_t first, int32_t second) {
    Pieces *s = user;
    const SceneView *view = &s->scene->view;
    const Piece *piece[2] = {&ARRAY_AT(s->pieces, Piece, first), &ARRAY_AT(s->pieces, Piece, second)};
    const Body *body[2] = {&ARRAY_AT(s->bodies, Body, piece[0]->body), &ARRAY_AT(s->bodies, Body, piece[1]->body)};
    if (body[0]->shape < 0) { // borders come last
        return REY_OK;
    }
    const ShapeRecord *shape = view->shapes + body[0]->shape;
    bool itself = piece[0]->body == piece[1]->body;
    if (rey_bodies_join(view, body[0], body[1]) ||
        (itself && share_vertex(view, shape, piece[0]->triangle, piece[1]->triangle))) {
        return REY_OK;
    }
    Triangle t[2] = {rey_piece_triangle(s, piece[0]), rey_piece_triangle(s, piece[1])};
    double ends[2][3];
    MeetingRecord m;
    Half half;
    bool meet = rey_triangles_meet(t, t + 1, rey_triangle_passes, TOUCH, ends), halved = false;
    for (int own = 0; own < 2 && !meet && !halved; own++) {
        halved = half_of(s, piece, t, own, &half, ends);
    }
    if (!meet && !halved) {
        return REY_OK;
    }
    bool round = false, tube = false;
    for (int i = 0; i < 2; i++) {
        const LightBorder *border = body[i]->shape < 0 ? s->borders + body[i]->instance : NULL;
        const int32_t kind = border ? -1 : view->shapes[body[i]->shape].kind;
        bool mesh = border ? !border->round : kind == SHAPE_MESH;
        m.shape[i] = body[i]->shape;
        m.instance[i] = border ? 0 : body[i]->instance;
        m.prim[i] = border                  ? border->light
                    : mesh                  ? piece[i]->triangle
                    : kind == SHAPE_BSPLINE ? piece[i]->triangle / REY_TUBE_PIECES
                                            : 0;
        m.surface[i] = quadric_of(s, body[i], t + i);
        round |= !mesh;
        tube |= kind == SHAPE_BSPLINE;
    }
    double near = (tube ? 0.5 : 0.1) * fmin(t[0].size, t[1].size); // tubes' triangles lie outside of them
    if (round && !(meet_at(view, &m, ends[0], near) && meet_at(view, &m, ends[1], near))) {
        return REY_OK;
    }
    for (int i = 0; i < 6; i++) {
        m.ends[i] = (float)ends[i / 3][i % 3];
    }
    return halved ? keep_half(s, &half, &m) : keep(s, &m);
}

rey_result rey_meetings_find(rey_scene *scene, const LightBorder *borders, int32_t border_count, MeetingMoves *moves,
                             const void *user, Array *meetings) {
    Array halves = {0};
    Pieces s = {.scene = scene, .borders = borders, .border_count = border_count, .moves = moves, .user = user, .itself = INT32_MAX,
                .found = meetings, .halves = &halves};
    rey_result result = rey_pieces_overlap(&s, pieces_overlap);
    result = result == REY_OK ? join_halves(&s) : result;
    rey_array_free(scene->ctx, &halves);
    return result;
}
