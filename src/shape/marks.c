// marks.c: cuts the lines along which textures jump into pieces, one per triangle of a mesh, many per line of a round surface.
// Each place is part of one piece at most, since a jump must not count twice: lines that two steps share are the first
// one's, those along a triangle's sides belong to the mesh's edges, and those along the ends of uv to rims and seams. Where to_uv
// moves them, both triangles have half of them.
#include "shape/marks.h"

#include "shape/shape.h"

#include <math.h>
#include <string.h>

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

// Whether an earlier step of the same shape jumps along the line on which step number i is `level`. *parts: one of both may leave
// the other behind.
static bool known_before(const Array *steps, size_t first, size_t i, double level, bool *parts) {
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
            *parts = s->at != t->at;
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
    bool selected;     // some step of the shape is
    Array *edges, *marks;
} Marking;

// Whether the line of step number i is one of an earlier step, too.
static rey_result look_before(const Marking *w, size_t i, double level, bool *known) {
    bool parts = false;
    *known = known_before(w->steps, w->first, i, level, &parts);
    return !parts ? REY_OK
                  : rey_fail(w->scene->ctx, REY_ERROR_INCOMPLETE,
                             "two textures of one surface (shape number %d) jump along the same line, and where to_uv moves one of "
                             "them alone the picture has no derivative. --terms interior gives the rest", (int)w->shape);
}

static rey_result push_mark(const Marking *w, const TextureStep *s, bool half, int32_t prim, int32_t instance,
                            const double ends[4]) {
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
    m->u = (float)s->u;
    m->v = (float)s->v;
    m->scale = (float)(half ? 0.5 * s->scale : s->scale);
    m->at = s->at;
    m->half = half;
    return REY_OK;
}

// A piece on the shape itself, or on all its instances, where they or the step's lines move.
static rey_result push_piece(const Marking *w, size_t i, bool half, int32_t prim, const double ends[4]) {
    const SceneView *view = &w->scene->view;
    const TextureStep *s = &ARRAY_AT(*w->steps, TextureStep, i);
    int32_t group = view->shapes[w->shape].collection;
    if (group < 0) {
        bool moves = s->at >= 0 || w->moves(w->user, w->shape, 0);
        return moves ? push_mark(w, s, half, prim, 0, ends) : REY_OK;
    }
    rey_result result = REY_OK;
    for (int32_t k = 0; k < view->instances_count && result == REY_OK; k++) {
        if (view->instances[k].group == group && (s->at >= 0 || w->moves(w->user, w->shape, k))) {
            result = push_mark(w, s, half, prim, k, ends);
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

// Where a selected step is `level` along sides of a triangle: their ends with the triangle on the left.
static rey_result mark_sides(const Marking *w, size_t i, int32_t prim, const double f[3], double level) {
    static const double corners[4][2] = {{0, 0}, {1, 0}, {0, 1}, {0, 0}};
    rey_result result = REY_OK;
    for (int k = 0; k < 3 && result == REY_OK; k++) {
        if (fabs(f[k] - level) < NEARLY && fabs(f[(k + 1) % 3] - level) < NEARLY) {
            result = push_piece(w, i, true, prim, (double[4]){corners[k][0], corners[k][1], corners[k + 1][0], corners[k + 1][1]});
        }
    }
    return result;
}

// The whole numbers of a range, or as many of them as are too many.
static void whole_levels(const TextureStep *s, double *low, double *high) {
    *low = fmax(ceil(*low - NEARLY), s->low);
    *high = fmin(floor(*high + NEARLY), s->high);
    if (*high - *low > MOST_MARKS) {
        *low = *high - MOST_MARKS;
    }
}

static rey_result mark_triangle(const Marking *w, size_t i, int32_t prim, const double uv[3][2]) {
    const TextureStep *s = &ARRAY_AT(*w->steps, TextureStep, i);
    double f[3], low = INFINITY, high = -INFINITY, ends[4];
    for (int k = 0; k < 3; k++) {
        f[k] = step_at(s, uv[k]);
        low = fmin(low, f[k]);
        high = fmax(high, f[k]);
    }
    whole_levels(s, &low, &high);
    rey_result result = REY_OK;
    for (double level = low; level <= high && result == REY_OK; level++) {
        bool known;
        result = look_before(w, i, level, &known);
        if (result == REY_OK && !known && cross_triangle(f, level, ends)) {
            result = push_piece(w, i, false, prim, ends);
        } else if (result == REY_OK && !known && s->at >= 0) {
            result = mark_sides(w, i, prim, f, level);
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

static rey_result mark_line(const Marking *w, size_t number, bool half, const double from[2], const double to[2]) {
    int pieces = (int)ceil(PIECES * hypot(to[0] - from[0], to[1] - from[1]));
    rey_result result = REY_OK;
    for (int i = 0; i < pieces && result == REY_OK; i++) {
        double ends[4];
        for (int k = 0; k < 4; k++) {
            ends[k] = from[k % 2] + (i + k / 2) / (double)pieces * (to[k % 2] - from[k % 2]);
        }
        result = push_piece(w, number, half, 0, ends);
    }
    return result;
}

bool rey_step_across(const TextureStep *s, double level, double ends[2][2], int *side) {
    static const double corners[4][2] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
    int count = 0;
    *side = -1;
    for (int k = 0; k < 4; k++) {
        const double *a = corners[k], *b = corners[(k + 1) % 4];
        double fa = step_at(s, a), fb = step_at(s, b);
        if (fabs(fa - level) < NEARLY && fabs(fb - level) < NEARLY) {
            memcpy(ends[0], a, sizeof ends[0]);
            memcpy(ends[1], b, sizeof ends[1]);
            *side = k;
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
        return mark_line(w, i, false, (double[2]){0, 0}, (double[2]){disk ? 1 : 0, disk ? 0 : 1});
    }
    double low = s->offset + fmin(s->u, 0) + fmin(s->v, 0), high = s->offset + fmax(s->u, 0) + fmax(s->v, 0), ends[2][2];
    whole_levels(s, &low, &high);
    rey_result result = REY_OK;
    for (double level = low; level <= high && result == REY_OK; level++) {
        bool known;
        int side;
        result = look_before(w, i, level, &known);
        if (result == REY_OK && !known && rey_step_across(s, level, ends, &side)) {
            result = mark_line(w, i, false, ends[0], ends[1]);
        } else if (result == REY_OK && !known && s->at >= 0 && side >= 0) {
            result = mark_line(w, i, true, ends[0], ends[1]);
        }
    }
    return result;
}

static bool any_selected(const Array *steps, size_t first, int32_t shape) {
    bool selected = false;
    for (size_t i = first; i < steps->count && ARRAY_AT(*steps, TextureStep, i).shape == shape; i++) {
        selected |= ARRAY_AT(*steps, TextureStep, i).at >= 0;
    }
    return selected;
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
            w.selected = any_selected(steps, i, s->shape);
        }
        const ShapeRecord *shape = view->shapes + s->shape;
        if (shape->collection < 0 && !w.selected && !moves(user, s->shape, 0)) {
            continue;
        }
        if (shape->kind != SHAPE_MESH) {
            result = s->sort == STEP_TANGENTS || s->sort == STEP_FRAMES ? REY_OK : mark_round(&w, i);
        } else if (s->sort == STEP_LINES) {
            result = mark_mesh(&w, i);
        }
    }
    return result;
}
