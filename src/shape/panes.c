// panes.c: finds flat convex panes among the triangles of meshes, by their borders.
#include "shape/panes.h"

#include "shape/cut.h"
#include "shape/shape.h"

#include <math.h>

// Triangles of a mesh with panes at most; how far from a plane or a line its points may be, over its size; and the width along a
// side in which points stop sliding, over that of the pane.
enum { PANE_TRIANGLES = 128, PANE_UNKNOWN = -2 };
#define PANE_FLAT 1e-5
#define PANE_FADE 0.25

typedef struct Side {
    int32_t from, to; // welded vertices
} Side;

// Sides of triangles, inside on their left; in the end those of one triangle each.
typedef struct Border {
    const float *points;
    Side side[3 * PANE_TRIANGLES];
    int32_t count;
    double normal[3], size;
} Border;

static double unit_between(const float *points, int32_t from, int32_t to, double unit[3]) {
    for (int k = 0; k < 3; k++) {
        unit[k] = (double)points[3 * to + k] - (double)points[3 * from + k];
    }
    double length = sqrt(dot3(unit, unit));
    for (int k = 0; k < 3 && length > 0; k++) {
        unit[k] /= length;
    }
    return length;
}

// How far a point is from a side's line, or by its number along it, in the direction d from where it begins.
static double along(const Border *b, const Side *s, const double d[3], int32_t point) {
    double sum = 0;
    for (int k = 0; k < 3; k++) {
        sum += d[k] * ((double)b->points[3 * point + k] - (double)b->points[3 * s->from + k]);
    }
    return sum;
}

// The unit normal of a triangle, and the length of its longest side from the first corner; false where it is too thin to have one.
static bool triangle_normal(const float *points, const int32_t corner[3], double n[3], double *size) {
    double e[2][3];
    *size = fmax(unit_between(points, corner[0], corner[1], e[0]), unit_between(points, corner[0], corner[2], e[1]));
    cross3(e[0], e[1], n);
    double sine = sqrt(dot3(n, n));
    for (int k = 0; k < 3 && sine > PANE_FLAT; k++) {
        n[k] /= sine;
    }
    return sine > PANE_FLAT;
}

// Adds the sides of triangle `first` and of all behind it in its plane, turned as it is, and gives them this pane.
static void take_plane(const SceneView *view, const ShapeRecord *shape, int32_t first, int32_t pane, int32_t *of, Border *b) {
    const int32_t *welded = view->welded + shape->welded;
    for (int32_t i = first; i < shape->triangle_count; i++) {
        const int32_t *corner = rey_mesh_triangle(view, shape, i);
        double n[3], size;
        bool takes = of[i] == PANE_UNKNOWN && triangle_normal(b->points, corner, n, &size);
        if (takes && i > first) {
            const double far = PANE_FLAT * fmax(b->size, size);
            takes = dot3(n, b->normal) > 1 - PANE_FLAT;
            for (int k = 0; k < 3; k++) {
                takes = takes && fabs(along(b, b->side, b->normal, corner[k])) <= far;
            }
        } else if (takes) {
            memcpy(b->normal, n, sizeof n);
        }
        for (int k = 0; k < 3 && takes; k++) {
            b->side[b->count++] = (Side){welded[corner[k]], welded[corner[(k + 1) % 3]]};
        }
        of[i] = takes ? pane : of[i];
        b->size = takes ? fmax(b->size, size) : b->size;
    }
}

// Leaves the sides that no second triangle has.
static void keep_border(Border *b) {
    int32_t kept = 0;
    bool inner[3 * PANE_TRIANGLES] = {false};
    for (int32_t i = 0; i < b->count; i++) {
        for (int32_t k = 0; k < b->count && !inner[i]; k++) {
            inner[i] = b->side[k].from == b->side[i].to && b->side[k].to == b->side[i].from;
        }
    }
    for (int32_t i = 0; i < b->count; i++) {
        if (!inner[i]) {
            b->side[kept++] = b->side[i];
        }
    }
    b->count = kept;
}

// What side i lies on, as PaneRecord has it; false where the border is not convex there, or runs over it twice. *again: where an
// earlier side lies on it, too.
static bool border_line(const Border *b, int32_t i, float line[4], bool *again) {
    const Side *s = b->side + i;
    const double close = PANE_FLAT * b->size;
    double d[3], in[3], width = 0, low = 0, high = 0, sum = 0, offset = 0;
    unit_between(b->points, s->from, s->to, d);
    cross3(b->normal, d, in);
    *again = false;
    for (int32_t k = 0; k < b->count; k++) {
        const Side *other = b->side + k;
        double from = along(b, s, in, other->from), to = along(b, s, in, other->to), unit[3];
        if (from < -close) {
            return false;
        }
        width = fmax(width, from);
        if (from <= close && to <= close) {
            *again |= k < i;
            low = fmin(low, along(b, s, d, other->from));
            high = fmax(high, along(b, s, d, other->to));
            sum += unit_between(b->points, other->from, other->to, unit);
        }
    }
    for (int k = 0; k < 3; k++) {
        line[k] = (float)(in[k] / (PANE_FADE * width));
        offset -= in[k] / (PANE_FADE * width) * (double)b->points[3 * s->from + k];
    }
    line[3] = (float)offset;
    return width > close && fabs(high - low - sum) <= close;
}

// Whether a plane's triangles are a pane.
static bool pane_of(Border *b, PaneRecord *pane) {
    int sides = 0;
    keep_border(b);
    for (int32_t i = 0; i < b->count; i++) {
        float line[4];
        bool again;
        if (!border_line(b, i, line, &again) || (sides == PANE_SIDES && !again)) {
            return false;
        }
        if (!again) {
            memcpy(pane->side[sides++], line, sizeof line);
        }
    }
    for (int k = sides; k < PANE_SIDES; k++) {
        memcpy(pane->side[k], (float[4]){0, 0, 0, 1}, sizeof pane->side[k]);
    }
    return sides > 0;
}

rey_result rey_panes_find(rey_scene *scene, int32_t id, Array *panes, Array *of) {
    const SceneView *view = &scene->view;
    const ShapeRecord *shape = view->shapes + id;
    int32_t own[PANE_TRIANGLES];
    const int32_t count = shape->triangle_count;
    const size_t before = panes->count;
    if (shape->kind != SHAPE_MESH || (shape->flags & SHAPE_HAS_NORMALS) || count > PANE_TRIANGLES) {
        return REY_OK;
    }
    for (int32_t i = 0; i < count; i++) {
        own[i] = PANE_UNKNOWN;
    }
    for (int32_t i = 0; i < count; i++) {
        Border b = {.points = view->theta + shape->positions};
        PaneRecord pane;
        take_plane(view, shape, i, (int32_t)panes->count, own, &b);
        if (b.count == 0) {
            continue;
        }
        if (!pane_of(&b, &pane)) {
            for (int32_t k = i; k < count; k++) {
                own[k] = own[k] == (int32_t)panes->count ? -1 : own[k];
            }
            continue;
        }
        PaneRecord *kept = rey_array_push(scene->ctx, panes, sizeof *kept, 1);
        if (!kept) {
            return REY_ERROR_MEMORY;
        }
        *kept = pane;
    }
    if (panes->count == before) {
        return REY_OK;
    }
    int32_t *kept = rey_array_push(scene->ctx, of, sizeof *kept, (size_t)count);
    for (int32_t i = 0; i < count && kept; i++) {
        kept[i] = own[i] == PANE_UNKNOWN ? -1 : own[i];
    }
    return kept ? REY_OK : REY_ERROR_MEMORY;
}
