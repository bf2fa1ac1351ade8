// edge_pieces.c: sorts edges by a number that those on one line have in common.
#include "shape/edge_pieces.h"

#include "shape/affine.h"
#include "shape/cut.h"

#include <math.h>
#include <stdlib.h>

typedef struct Line {
    double key, second, slack; // slack: by how much the keys of edges on the same line may differ
    double p[3], d[3];   // where it begins, and to its end
    double length, apart; // apart: how far corners may be from each other that are the same
    double least;         // the shortest piece, over the length
    int32_t edge;
} Line;

typedef struct Cut {
    int32_t edge;
    float at, least; // least: cuts closer than this are one
} Cut;

void rey_edge_corners(const SceneView *view, const EdgeRecord *e, double p[3][3]) {
    for (int i = 0; i < 3; i++) {
        rey_cut_corner(view, e->shape, e->prim, (e->corner + i) % 3, p[i]);
        if (view->shapes[e->shape].collection >= 0) {
            rey_affine_point(view->theta + view->instances[e->instance].to_world, p[i], p[i]);
        }
    }
}

bool rey_edge_is_open(const EdgeRecord *e) {
    return e->kind == EDGE_MESH && e->opposite == EDGE_OPEN && e->fan_count == 0;
}

// The key is a sum over the line's point next to the origin and the products of its direction's numbers, which do not tell where on
// it the edge lies, nor which way it runs.
static bool line_of(const SceneView *view, const EdgeRecord *e, int32_t number, Line *line) {
    static const double weights[3] = {0.5377, 0.6119, 0.5800}, others[3] = {-0.6412, 0.2871, 0.7117};
    static const double products[6] = {0.31, 0.47, 0.29, 0.53, 0.41, 0.37};
    double p[3][3], unit[3], largest = 0;
    rey_edge_corners(view, e, p);
    *line = (Line){.edge = number};
    for (int k = 0; k < 3; k++) {
        line->p[k] = p[0][k];
        line->d[k] = p[1][k] - p[0][k];
        largest = fmax(largest, fmax(fabs(p[0][k]), fabs(p[1][k])));
    }
    line->length = sqrt(dot3(line->d, line->d));
    line->apart = CORNER_TOLERANCE * largest;
    if (line->length <= 8 * line->apart) {
        return false;
    }
    line->least = 8 * line->apart / line->length;
    for (int k = 0; k < 3; k++) {
        unit[k] = line->d[k] / line->length;
    }
    double along = dot3(line->p, unit);
    for (int i = 0, at = 0; i < 3; i++) {
        line->key += weights[i] * (line->p[i] - along * unit[i]);
        line->second += others[i] * (line->p[i] - along * unit[i]);
        for (int k = i; k < 3; k++) {
            line->key += largest * products[at++] * unit[i] * unit[k];
        }
    }
    line->slack = 4 * line->apart * (1 + largest / line->length);
    return true;
}

static int compare_lines(const void *a, const void *b) {
    double x = ((const Line *)a)->key, y = ((const Line *)b)->key;
    return (x > y) - (x < y);
}

static int compare_cuts(const void *first, const void *second) {
    const Cut *a = first, *b = second;
    int by = (a->edge > b->edge) - (a->edge < b->edge);
    return by ? by : (a->at > b->at) - (a->at < b->at);
}

// Where a point lies along a line, from 0 to 1; false where it does not lie on it.
static bool place_on(const Line *line, const double p[3], double *at) {
    double to[3], off2 = 0, tolerance = 2 * line->apart;
    for (int k = 0; k < 3; k++) {
        to[k] = p[k] - line->p[k];
    }
    *at = dot3(to, line->d) / (line->length * line->length);
    for (int k = 0; k < 3; k++) {
        double off = to[k] - *at * line->d[k];
        off2 += off * off;
    }
    return off2 <= tolerance * tolerance;
}

static rey_result push_cut(rey_scene *scene, const Line *line, double at, Array *cuts) {
    if (at < line->least || at > 1 - line->least) {
        return REY_OK;
    }
    Cut *cut = rey_array_push(scene->ctx, cuts, sizeof *cut, 1);
    if (!cut) {
        return REY_ERROR_MEMORY;
    }
    *cut = (Cut){line->edge, (float)at, (float)line->least};
    return REY_OK;
}

// Cuts the first of two lines where the second one begins and ends on it and goes along it.
static rey_result cut_by(rey_scene *scene, const Line *line, const Line *by, Array *cuts) {
    double at[2], end[3];
    for (int k = 0; k < 3; k++) {
        end[k] = by->p[k] + by->d[k];
    }
    if (!place_on(line, by->p, at) || !place_on(line, end, at + 1)) {
        return REY_OK;
    }
    if (fmax(at[0], at[1]) < line->least || fmin(at[0], at[1]) > 1 - line->least) {
        return REY_OK;
    }
    rey_result result = push_cut(scene, line, at[0], cuts);
    return result == REY_OK ? push_cut(scene, line, at[1], cuts) : result;
}

// Short edges do not tell their line as exactly as long ones: of each two, one at least finds the other.
static rey_result find_cuts(rey_scene *scene, const Line *lines, int64_t count, Array *cuts) {
    rey_result result = REY_OK;
    for (int64_t i = 0; i < count; i++) {
        const Line *a = lines + i;
        for (int step = -1; step <= 1; step += 2) {
            for (int64_t k = i + step; k >= 0 && k < count && fabs(lines[k].key - a->key) <= a->slack; k += step) {
                const Line *b = lines + k;
                if (fabs(b->second - a->second) > a->slack) {
                    continue;
                }
                result = result == REY_OK ? cut_by(scene, a, b, cuts) : result;
                result = result == REY_OK ? cut_by(scene, b, a, cuts) : result;
            }
        }
    }
    return result;
}

// Cuts that are the same count once.
static rey_result make_pieces(rey_scene *scene, const Array *cuts, Array *edges) {
    for (size_t i = 0; i < cuts->count; i++) {
        const Cut *cut = &ARRAY_AT(*cuts, Cut, i);
        const EdgeRecord whole = ARRAY_AT(*edges, EdgeRecord, cut->edge);
        const bool again = i > 0 && cut[-1].edge == cut->edge;
        EdgeRecord *last = again ? &ARRAY_AT(*edges, EdgeRecord, edges->count - 1) : &ARRAY_AT(*edges, EdgeRecord, cut->edge);
        if (again && cut->at - last->first <= cut->least) {
            continue;
        }
        last->last = cut->at;
        EdgeRecord *piece = rey_array_push(scene->ctx, edges, sizeof *piece, 1);
        if (!piece) {
            return REY_ERROR_MEMORY;
        }
        *piece = whole;
        piece->first = cut->at;
        piece->last = 1;
    }
    return REY_OK;
}

rey_result rey_edges_cut(rey_scene *scene, bool (*stands)(const SceneView *view, const ShapeRecord *shape), Array *edges) {
    const SceneView *view = &scene->view;
    Line *lines = rey_alloc_array(scene->ctx, edges->count + 1, sizeof *lines);
    rey_result result = lines ? REY_OK : REY_ERROR_MEMORY;
    Array cuts = {0};
    int64_t count = 0;
    for (size_t i = 0; i < edges->count && result == REY_OK; i++) {
        const EdgeRecord *e = &ARRAY_AT(*edges, EdgeRecord, i);
        bool counts = rey_edge_is_open(e) && stands(view, view->shapes + e->shape);
        count += counts && line_of(view, e, (int32_t)i, lines + count);
    }
    if (result == REY_OK) {
        qsort(lines, (size_t)count, sizeof *lines, compare_lines);
        result = find_cuts(scene, lines, count, &cuts);
    }
    if (result == REY_OK && cuts.count > 0) {
        qsort(cuts.data, cuts.count, sizeof(Cut), compare_cuts);
        result = make_pieces(scene, &cuts, edges);
    }
    rey_array_free(scene->ctx, &cuts);
    rey_free(scene->ctx, lines);
    return result;
}
