// marks.c: cuts the lines along which textures jump into pieces, one per triangle of a mesh, many per line of a round surface.
// Each place is part of one piece at most, since a jump must not count twice: lines that two steps share are the first
// one's, those along a triangle's sides belong to the mesh's edges, and those along the ends of uv to rims and seams.
#include "shape/marks.h"

#include "shape/shape.h"

#include <math.h>

// Of the distance between two jumps: lines as near as that to an edge are on it.
#define NEARLY 1e-4

enum { PIECES = 32, MOST_MARKS = 1 << 22 };

static double step_at(const TextureStep *s, const double uv[2]) { return s->u * uv[0] + s->v * uv[1] + s->offset; }

static bool in_range(const TextureStep *s, double level) { return level >= s->low && level <= s->high; }

bool rey_step_along(const Array *steps, size_t first, const double a[2], const double b[2]) {
    int32_t shape = first < steps->count ? ARRAY_AT(*steps, TextureStep, first).shape : -1;
    for (size_t i = first; i < steps->count && ARRAY_AT(*steps, TextureStep, i).shape == shape; i++) {
        const TextureStep *s = &ARRAY_AT(*steps, TextureStep, i);
        double at = step_at(s, a), level = nearbyint(at);
        if (s->sort == STEP_LINES && fabs(at - level) < NEARLY && fabs(step_at(s, b) - level) < NEARLY && in_range(s, level)) {
            return true;
        }
    }
    return false;
}

// Whether an earlier step of the same shape jumps along the line on which step number i is `level`.
static bool known_before(const Array *steps, size_t first, size_t i, double level) {
    const TextureStep *s = &ARRAY_AT(*steps, TextureStep, i);
    double size = hypot(s->u, s->v);
    for (size_t k = first; k < i; k++) {
        const TextureStep *t = &ARRAY_AT(*steps, TextureStep, k);
        double other = hypot(t->u, t->v), turn = fabs(t->u * s->v - t->v * s->u);
        if (t->sort != STEP_LINES || !(other > 0) || turn > 1e-6 * size * other) {
            continue;
        }
        double ratio = (t->u * s->u + t->v * s->v) / (size * size), at = t->offset + ratio * (level - s->offset);
        double whole = nearbyint(at);
        if (fabs(at - whole) < NEARLY && in_range(t, whole)) {
            return true;
        }
    }
    return false;
}

// Where the pieces go.
typedef struct Marking {
    rey_scene *scene;
    const Array *steps;
    size_t first;      // step of the shape
    MarkMoves *moves;
    const void *user;
    int32_t shape;
    Array *edges, *marks;
} Marking;

static rey_result push_mark(const Marking *w, int32_t prim, int32_t instance, const double ends[4]) {
    rey_context *ctx = w->scene->ctx;
    if (w->marks->count >= MOST_MARKS) {
        return rey_fail(ctx, REY_ERROR_UNSUPPORTED, "textures jump along more than 2^22 pieces of lines");
    }
    EdgeRecord *e = rey_array_push(ctx, w->edges, sizeof *e, 1);
    MarkRecord *m = e ? rey_array_push(ctx, w->marks, sizeof *m, 1) : NULL;
    if (!m) {
        return REY_ERROR_MEMORY;
    }
    *e = (EdgeRecord){.kind = EDGE_MARK, .shape = w->shape, .instance = instance, .prim = prim,
                      .corner = (int32_t)w->marks->count - 1, .opposite = EDGE_OPEN, .other = EDGE_ANY, .crease = EDGE_CREASE,
                      .last = 1};
    for (int k = 0; k < 4; k++) {
        m->ends[k] = (float)ends[k];
    }
    return REY_OK;
}

// A piece on the shape itself, or on all its instances that move.
static rey_result push_piece(const Marking *w, int32_t prim, const double ends[4]) {
    const SceneView *view = &w->scene->view;
    int32_t group = view->shapes[w->shape].collection;
    if (group < 0) {
        return push_mark(w, prim, 0, ends);
    }
    rey_result result = REY_OK;
    for (int32_t i = 0; i < view->instances_count && result == REY_OK; i++) {
        if (view->instances[i].group == group && w->moves(w->user, w->shape, i)) {
            result = push_mark(w, prim, i, ends);
        }
    }
    return result;
}

// ---- meshes ------------------------------------------------------------------------------------------------------

static void corner_uv(const SceneView *view, const ShapeRecord *shape, int32_t prim, int corner, double uv[2]) {
    int32_t vertex = view->triangles[3 * ((int64_t)shape->triangle + prim) + corner];
    for (int k = 0; k < 2; k++) {
        uv[k] = shape->uvs >= 0 ? (double)view->theta[shape->uvs + 2 * (int64_t)vertex + k] : corner == k + 1;
    }
}

// Where a step with values f at the corners of a triangle is `level`.
static bool cross_triangle(const double f[3], double level, double ends[4]) {
    static const double barycentric[3][2] = {{0, 0}, {1, 0}, {0, 1}};
    int count = 0, on = 0;
    for (int k = 0; k < 3; k++) {
        int next = (k + 1) % 3;
        on += fabs(f[k] - level) < NEARLY;
        if ((f[k] < level) != (f[next] < level)) {
            double t = (level - f[k]) / (f[next] - f[k]);
            for (int c = 0; c < 2; c++) {
                ends[2 * count + c] = barycentric[k][c] + t * (barycentric[next][c] - barycentric[k][c]);
            }
            count++;
        }
    }
    return count == 2 && on < 2;
}

static rey_result mark_triangle(const Marking *w, size_t i, int32_t prim, const double uv[3][2]) {
    const TextureStep *s = &ARRAY_AT(*w->steps, TextureStep, i);
    double f[3], low = INFINITY, high = -INFINITY, ends[4];
    for (int k = 0; k < 3; k++) {
        f[k] = step_at(s, uv[k]);
        low = fmin(low, f[k]);
        high = fmax(high, f[k]);
    }
    low = fmax(ceil(low), s->low);
    high = fmin(floor(high), s->high);
    if (high - low > MOST_MARKS) {
        low = high - MOST_MARKS; // as many as are too many
    }
    rey_result result = REY_OK;
    for (double level = low; level <= high && result == REY_OK; level++) {
        if (cross_triangle(f, level, ends) && !known_before(w->steps, w->first, i, level)) {
            result = push_piece(w, prim, ends);
        }
    }
    return result;
}

static rey_result mark_mesh(const Marking *w, size_t i) {
    const SceneView *view = &w->scene->view;
    const ShapeRecord *shape = view->shapes + w->shape;
    rey_result result = REY_OK;
    for (int32_t prim = 0; prim < shape->triangle_count && result == REY_OK; prim++) {
        double uv[3][2];
        for (int k = 0; k < 3; k++) {
            corner_uv(view, shape, prim, k, uv[k]);
        }
        result = mark_triangle(w, i, prim, uv);
    }
    return result;
}

// ---- round shapes ------------------------------------------------------------------------------------------------

static rey_result mark_line(const Marking *w, const double from[2], const double to[2]) {
    int pieces = (int)ceil(PIECES * hypot(to[0] - from[0], to[1] - from[1]));
    rey_result result = REY_OK;
    for (int i = 0; i < pieces && result == REY_OK; i++) {
        double ends[4];
        for (int k = 0; k < 4; k++) {
            ends[k] = from[k % 2] + (i + k / 2) / (double)pieces * (to[k % 2] - from[k % 2]);
        }
        result = push_piece(w, 0, ends);
    }
    return result;
}

// Where a step is `level` in the unit square.
static bool cross_square(const TextureStep *s, double level, double ends[2][2]) {
    static const double corners[4][2] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
    int count = 0;
    for (int k = 0; k < 4; k++) {
        const double *a = corners[k], *b = corners[(k + 1) % 4];
        double fa = step_at(s, a), fb = step_at(s, b);
        if (fabs(fa - level) < NEARLY && fabs(fb - level) < NEARLY) {
            return false;
        }
        if ((fa < level) != (fb < level) && count < 2) {
            double t = (level - fa) / (fb - fa);
            ends[count][0] = a[0] + t * (b[0] - a[0]);
            ends[count][1] = a[1] + t * (b[1] - a[1]);
            count++;
        }
    }
    return count == 2;
}

static rey_result mark_round(const Marking *w, size_t i) {
    const TextureStep *s = &ARRAY_AT(*w->steps, TextureStep, i);
    if (s->sort == STEP_SEAMS) {
        // Where the angle begins anew: u = 0, and v = 0 on disks.
        bool disk = w->scene->view.shapes[w->shape].kind == SHAPE_DISK;
        return mark_line(w, (double[2]){0, 0}, (double[2]){disk ? 1 : 0, disk ? 0 : 1});
    }
    double low = s->offset + fmin(s->u, 0) + fmin(s->v, 0), high = s->offset + fmax(s->u, 0) + fmax(s->v, 0), ends[2][2];
    low = fmax(ceil(low), s->low);
    high = fmin(floor(high), s->high);
    rey_result result = REY_OK;
    for (double level = low; level <= high && result == REY_OK; level++) {
        if (cross_square(s, level, ends) && !known_before(w->steps, w->first, i, level)) {
            result = mark_line(w, ends[0], ends[1]);
        }
    }
    return result;
}

rey_result rey_marks_find(rey_scene *scene, const Array *steps, MarkMoves *moves, const void *user, Array *edges, Array *marks) {
    const SceneView *view = &scene->view;
    rey_result result = REY_OK;
    Marking w = {.scene = scene, .steps = steps, .moves = moves, .user = user, .shape = -1, .edges = edges, .marks = marks};
    for (size_t i = 0; i < steps->count && result == REY_OK; i++) {
        const TextureStep *s = &ARRAY_AT(*steps, TextureStep, i);
        if (s->shape != w.shape) {
            w.shape = s->shape;
            w.first = i;
        }
        const ShapeRecord *shape = view->shapes + s->shape;
        if (shape->collection < 0 && !moves(user, s->shape, 0)) {
            continue;
        }
        if (shape->kind != SHAPE_MESH) {
            result = s->sort == STEP_TANGENTS ? REY_OK : mark_round(&w, i);
        } else if (s->sort == STEP_LINES) {
            result = mark_mesh(&w, i);
        }
    }
    return result;
}
