// chamfer.c: the symmetric mean distance of two surfaces, from points on one to the triangles of the other.
#include "fit/chamfer.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { SAMPLES = 10000, LEAF = 4, STACK = 128 };

typedef struct Node { // leaves hold triangles order[first ..]; others have their children at `first` and `first` + 1
    double low[3], high[3];
    int32_t first, count; // count 0 = inner
} Node;

typedef struct Tree {
    const Triangles *t;
    int32_t *order;
    Node *nodes;
    int32_t node_count;
} Tree;

typedef struct Key {
    double at;
    int32_t triangle;
} Key;

static int compare_keys(const void *a, const void *b) {
    const Key *x = a, *y = b;
    if (x->at < y->at || x->at > y->at) {
        return x->at < y->at ? -1 : 1;
    }
    return (x->triangle > y->triangle) - (x->triangle < y->triangle);
}

static void corners_of(const Triangles *t, int32_t triangle, double p[3][3]) {
    for (int k = 0; k < 9; k++) {
        p[k / 3][k % 3] = (double)t->positions[3 * (int64_t)t->indices[3 * (int64_t)triangle + k / 3] + k % 3];
    }
}

static void bound(const Tree *tree, Node *n) {
    for (int c = 0; c < 3; c++) {
        n->low[c] = INFINITY;
        n->high[c] = -INFINITY;
    }
    for (int32_t i = n->first; i < n->first + n->count; i++) {
        double p[3][3];
        corners_of(tree->t, tree->order[i], p);
        for (int k = 0; k < 9; k++) {
            n->low[k % 3] = fmin(n->low[k % 3], p[k / 3][k % 3]);
            n->high[k % 3] = fmax(n->high[k % 3], p[k / 3][k % 3]);
        }
    }
}

// Halves a node at the median of its triangles' centres along its longest side.
static void split(Tree *tree, int32_t node, Key *keys) {
    Node *n = &tree->nodes[node];
    int axis = 0;
    for (int c = 1; c < 3; c++) {
        axis = n->high[c] - n->low[c] > n->high[axis] - n->low[axis] ? c : axis;
    }
    for (int32_t i = 0; i < n->count; i++) {
        double p[3][3];
        corners_of(tree->t, tree->order[n->first + i], p);
        keys[i] = (Key){p[0][axis] + p[1][axis] + p[2][axis], tree->order[n->first + i]};
    }
    qsort(keys, (size_t)n->count, sizeof *keys, compare_keys);
    for (int32_t i = 0; i < n->count; i++) {
        tree->order[n->first + i] = keys[i].triangle;
    }
    int32_t half = n->count / 2, children = tree->node_count;
    tree->node_count += 2;
    tree->nodes[children] = (Node){.first = n->first, .count = half};
    tree->nodes[children + 1] = (Node){.first = n->first + half, .count = n->count - half};
    bound(tree, &tree->nodes[children]);
    bound(tree, &tree->nodes[children + 1]);
    n->first = children;
    n->count = 0;
}

static rey_result tree_build(rey_context *ctx, const Triangles *t, Tree *tree) {
    size_t count = (size_t)t->triangle_count;
    *tree = (Tree){.t = t};
    tree->order = rey_alloc_array(ctx, count, sizeof *tree->order);
    tree->nodes = rey_alloc_array(ctx, 2 * count + 1, sizeof *tree->nodes);
    Key *keys = rey_alloc_array(ctx, count, sizeof *keys);
    if (!tree->order || !tree->nodes || !keys) {
        rey_free(ctx, keys);
        return REY_ERROR_MEMORY;
    }
    for (size_t i = 0; i < count; i++) {
        tree->order[i] = (int32_t)i;
    }
    tree->nodes[0] = (Node){.count = (int32_t)count};
    tree->node_count = 1;
    bound(tree, &tree->nodes[0]);
    for (int32_t i = 0; i < tree->node_count; i++) {
        if (tree->nodes[i].count > LEAF) {
            split(tree, i, keys);
        }
    }
    rey_free(ctx, keys);
    return REY_OK;
}

static double dot3(const double a[3], const double b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

// Square of the distance to the segment from a on along e.
static double to_segment(const double x[3], const double a[3], const double b[3]) {
    double e[3], d[3], square = 0;
    for (int c = 0; c < 3; c++) {
        e[c] = b[c] - a[c];
        d[c] = x[c] - a[c];
    }
    double length = dot3(e, e), s = length > 0 ? fmax(0, fmin(1, dot3(d, e) / length)) : 0;
    for (int c = 0; c < 3; c++) {
        square += (d[c] - s * e[c]) * (d[c] - s * e[c]);
    }
    return square;
}

// Inside the triangle's prism the distance is that to its plane, elsewhere that to its nearest side.
static double to_triangle(const double x[3], double p[3][3]) {
    double u[3], v[3], d[3];
    for (int c = 0; c < 3; c++) {
        u[c] = p[1][c] - p[0][c];
        v[c] = p[2][c] - p[0][c];
        d[c] = x[c] - p[0][c];
    }
    double uu = dot3(u, u), uv = dot3(u, v), vv = dot3(v, v), du = dot3(d, u), dv = dot3(d, v);
    double area = uu * vv - uv * uv, s = vv * du - uv * dv, t = uu * dv - uv * du;
    if (area > 0 && s >= 0 && t >= 0 && s + t <= area) {
        double square = 0;
        for (int c = 0; c < 3; c++) {
            double off = d[c] - (s * u[c] + t * v[c]) / area;
            square += off * off;
        }
        return square;
    }
    return fmin(to_segment(x, p[0], p[1]), fmin(to_segment(x, p[1], p[2]), to_segment(x, p[2], p[0])));
}

static double to_box(const double x[3], const Node *n) {
    double square = 0;
    for (int c = 0; c < 3; c++) {
        double off = fmax(0, fmax(n->low[c] - x[c], x[c] - n->high[c]));
        square += off * off;
    }
    return square;
}

static double nearest(const Tree *tree, const double x[3]) {
    int32_t stack[STACK], depth = 0;
    double best = INFINITY;
    stack[depth++] = 0;
    while (depth > 0) {
        const Node *n = &tree->nodes[stack[--depth]];
        if (to_box(x, n) >= best) {
            continue;
        }
        for (int32_t i = n->first; i < n->first + n->count; i++) {
            double p[3][3];
            corners_of(tree->t, tree->order[i], p);
            best = fmin(best, to_triangle(x, p));
        }
        if (n->count == 0) { // halves: no deeper than 31; the nearer child comes first
            bool second = to_box(x, &tree->nodes[n->first + 1]) < to_box(x, &tree->nodes[n->first]);
            stack[depth++] = n->first + !second;
            stack[depth++] = n->first + second;
        }
    }
    return sqrt(best);
}

static double area_of(const Triangles *t, int32_t triangle) {
    double p[3][3], n[3];
    corners_of(t, triangle, p);
    for (int c = 0; c < 3; c++) {
        int i = (c + 1) % 3, j = (c + 2) % 3;
        n[c] = (p[1][i] - p[0][i]) * (p[2][j] - p[0][j]) - (p[1][j] - p[0][j]) * (p[2][i] - p[0][i]);
    }
    return sqrt(dot3(n, n));
}

// Mean distance of points on a to the tree's surface: evenly spaced in the running sum of areas, and within triangles by
// the additive recurrence of the golden ratio's relative in two dimensions.
static double mean_distance(const Triangles *a, const Tree *tree) {
    double total = 0, passed = 0, sum = 0;
    int64_t next = 0;
    for (int32_t i = 0; i < a->triangle_count; i++) {
        total += area_of(a, i);
    }
    for (int32_t i = 0; i < a->triangle_count; i++) {
        passed += area_of(a, i);
        for (; next < SAMPLES && ((double)next + 0.5) / SAMPLES * total < passed; next++) {
            double u = fmod(0.7548776662466927 * (double)(next + 1), 1), v = fmod(0.5698402909980532 * (double)(next + 1), 1);
            double p[3][3], x[3];
            corners_of(a, i, p);
            if (u + v > 1) {
                u = 1 - u;
                v = 1 - v;
            }
            for (int c = 0; c < 3; c++) {
                x[c] = p[0][c] + u * (p[1][c] - p[0][c]) + v * (p[2][c] - p[0][c]);
            }
            sum += nearest(tree, x);
        }
    }
    return next ? sum / (double)next : 0;
}

rey_result rey_chamfer(rey_context *ctx, const Triangles *a, const Triangles *b, double *distance) {
    Tree trees[2] = {{.t = NULL}, {.t = NULL}};
    rey_result result = tree_build(ctx, a, &trees[0]);
    if (!result) {
        result = tree_build(ctx, b, &trees[1]);
    }
    *distance = result ? 0 : 0.5 * (mean_distance(a, &trees[1]) + mean_distance(b, &trees[0]));
    for (int i = 0; i < 2; i++) {
        rey_free(ctx, trees[i].order);
        rey_free(ctx, trees[i].nodes);
    }
    return result;
}

double rey_triangles_diagonal(const Triangles *t) {
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY}, square = 0;
    for (int64_t i = 0; i < 3 * t->vertex_count; i++) {
        low[i % 3] = fmin(low[i % 3], (double)t->positions[i]);
        high[i % 3] = fmax(high[i % 3], (double)t->positions[i]);
    }
    for (int c = 0; c < 3; c++) {
        square += (high[c] - low[c]) * (high[c] - low[c]);
    }
    return sqrt(square);
}
