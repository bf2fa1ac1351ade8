// shared.c: sorts edges by where they are, along a direction that few of them are at right angles to.
#include "shape/shared.h"

#include "shape/affine.h"
#include "shape/edge_pieces.h"
#include "shape/shape.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

// How far apart what is the same may be, over the size of its numbers.
#define SHARED_TOLERANCE 4e-6

// A straight edge or an ellipse, whichever way it is run through: its middle, and the sum of d d' over its half axes d.
typedef struct Curve {
    double key, middle[3];
    float moment[6], tolerance, size;
    int32_t edge, corner;
    SharedSide side;
} Curve;

static const double along[3] = {0.5377, 0.6119, 0.5800};

static void add_moment(Curve *c, const double d[3]) {
    for (int i = 0, at = 0; i < 3; i++) {
        for (int k = i; k < 3; k++) {
            c->moment[at++] += (float)(d[i] * d[k]);
        }
        c->size = fmaxf(c->size, (float)fabs(d[i]));
    }
}

static void to_world(const SceneView *view, const EdgeRecord *e, double p[3]) {
    if (view->shapes[e->shape].collection >= 0) {
        rey_affine_point(view->theta + view->instances[e->instance].to_world, p, p);
    }
}

static void straight(const SceneView *view, const EdgeRecord *e, Curve *c) {
    double p[3][3], half[3];
    rey_edge_corners(view, e, p);
    for (int k = 0; k < 3; k++) {
        double whole = p[1][k] - p[0][k];
        c->middle[k] = p[0][k] + 0.5 * (double)(e->first + e->last) * whole;
        half[k] = 0.5 * (double)(e->last - e->first) * whole;
        c->side.side[k] = (float)(p[2][k] - p[0][k]);
    }
    add_moment(c, half);
    c->side.prim = e->prim;
}

static void rim(const SceneView *view, const EdgeRecord *e, Curve *c) {
    const ShapeRecord *shape = view->shapes + e->shape;
    double p[4][3], d[3]; // the middle, and one from there along each axis
    for (int i = 0; i < 4; i++) {
        double local[3] = {i == 1, i == 2, (e->corner > 0) + (i == 3)};
        rey_affine_point(view->theta + shape->to_world, local, p[i]);
        to_world(view, e, p[i]);
    }
    memcpy(c->middle, p[0], sizeof c->middle);
    for (int i = 1; i < 3; i++) {
        for (int k = 0; k < 3; k++) {
            d[k] = p[i][k] - p[0][k];
        }
        add_moment(c, d);
    }
    c->side.radial = shape->kind == SHAPE_DISK;
    for (int k = 0; k < 3; k++) {
        double axis = (e->corner > 0 ? -1 : 1) * (p[3][k] - p[0][k]);
        c->side.side[k] = (float)(c->side.radial ? p[0][k] : axis);
    }
}

static int compare_keys(const void *a, const void *b) {
    double x = ((const Curve *)a)->key, y = ((const Curve *)b)->key;
    return (x > y) - (x < y);
}

static int compare_rims(const void *first, const void *second) {
    const Curve *a = first, *b = second;
    int by = (a->side.shape > b->side.shape) - (a->side.shape < b->side.shape);
    by = by ? by : (a->side.instance > b->side.instance) - (a->side.instance < b->side.instance);
    return by ? by : (a->corner > b->corner) - (a->corner < b->corner);
}

// Whether two surfaces end along the same curve.
static bool share(const Curve *a, const Curve *b) {
    bool same = a->side.shape != b->side.shape || a->side.instance != b->side.instance || a->side.prim != b->side.prim;
    for (int i = 0; i < 3 && same; i++) {
        same = fabs(a->middle[i] - b->middle[i]) <= (double)a->tolerance;
    }
    for (int i = 0; i < 6 && same; i++) {
        same = fabsf(a->moment[i] - b->moment[i]) <= 4 * a->tolerance * a->size;
    }
    return same;
}

// Appends the others that end where number i of the sorted curves does.
static rey_result find_others(rey_scene *scene, const Curve *curves, int64_t count, int64_t i, EdgeRecord *e, Array *sides) {
    e->sides = (int32_t)sides->count;
    e->side_count = 0;
    for (int step = -1; step <= 1; step += 2) {
        for (int64_t k = i + step; k >= 0 && k < count; k += step) {
            if (fabs(curves[k].key - curves[i].key) > 2 * (double)curves[i].tolerance) {
                break;
            }
            if (share(curves + i, curves + k)) {
                SharedSide *one = rey_array_push(scene->ctx, sides, sizeof *one, 1);
                if (!one) {
                    return REY_ERROR_MEMORY;
                }
                *one = curves[k].side;
                e->side_count++;
            }
        }
    }
    return REY_OK;
}

// Of an open edge of a mesh, or of the first piece of a rim; false for others.
static bool curve_of(const SceneView *view, const EdgeRecord *e, Curve *c) {
    bool open = rey_edge_is_open(e);
    if (!open && !(e->kind == EDGE_RIM && e->first <= 0)) {
        return false;
    }
    *c = (Curve){.corner = e->corner, .side = {.shape = e->shape, .instance = e->instance}};
    (open ? straight : rim)(view, e, c);
    double largest = (double)c->size;
    for (int k = 0; k < 3; k++) {
        c->key += along[k] * c->middle[k];
        largest = fmax(largest, fabs(c->middle[k]));
    }
    c->tolerance = (float)(SHARED_TOLERANCE * largest);
    return true;
}

// The other pieces of rims.
static void spread_rims(const Array *edges, Curve *curves, int64_t count) {
    int64_t rims = 0;
    for (int64_t i = 0; i < count; i++) {
        if (ARRAY_AT(*edges, EdgeRecord, curves[i].edge).kind == EDGE_RIM) {
            curves[rims++] = curves[i];
        }
    }
    qsort(curves, (size_t)rims, sizeof *curves, compare_rims);
    for (size_t i = 0; i < edges->count && rims > 0; i++) {
        EdgeRecord *e = &ARRAY_AT(*edges, EdgeRecord, i);
        Curve key = {.corner = e->corner, .side = {.shape = e->shape, .instance = e->instance}};
        const Curve *of = e->kind == EDGE_RIM ? bsearch(&key, curves, (size_t)rims, sizeof key, compare_rims) : NULL;
        if (of) {
            const EdgeRecord *first = &ARRAY_AT(*edges, EdgeRecord, of->edge);
            e->sides = first->sides;
            e->side_count = first->side_count;
        }
    }
}

rey_result rey_edges_share(rey_scene *scene, bool (*stands)(const SceneView *view, const ShapeRecord *shape), Array *edges,
                           Array *sides) {
    const SceneView *view = &scene->view;
    rey_result result = rey_edges_cut(scene, stands, edges);
    Curve *curves = rey_alloc_array(scene->ctx, edges->count + 1, sizeof *curves);
    result = curves ? result : REY_ERROR_MEMORY;
    int64_t count = 0;
    for (size_t i = 0; i < edges->count && result == REY_OK; i++) {
        const EdgeRecord *e = &ARRAY_AT(*edges, EdgeRecord, i);
        if (stands(view, view->shapes + e->shape) && curve_of(view, e, curves + count)) {
            curves[count++].edge = (int32_t)i;
        }
    }
    if (result == REY_OK) {
        qsort(curves, (size_t)count, sizeof *curves, compare_keys);
    }
    for (int64_t i = 0; i < count && result == REY_OK; i++) {
        result = find_others(scene, curves, count, i, &ARRAY_AT(*edges, EdgeRecord, curves[i].edge), sides);
    }
    if (result == REY_OK) {
        spread_rims(edges, curves, count);
    }
    rey_free(scene->ctx, curves);
    return result;
}
