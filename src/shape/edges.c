// edges.c: which triangles of a mesh share which edges. Vertices at the same position are one (UV seams are no edges).
#include "shape/edges.h"

#include "shape/shape.h"

#include <stdlib.h>

// One side of an edge: its welded ends, and where it comes from.
typedef struct Side {
    int32_t low, high;
    int32_t at; // 3 triangle + corner
} Side;

static int compare_sides(const void *a, const void *b) {
    const Side *x = a, *y = b;
    if (x->low != y->low) {
        return x->low < y->low ? -1 : 1;
    }
    if (x->high != y->high) {
        return x->high < y->high ? -1 : 1;
    }
    return (x->at > y->at) - (x->at < y->at);
}

static const int32_t *mesh_indices(const SceneView *view, const ShapeRecord *shape) {
    return view->triangles + 3 * (int64_t)shape->triangle;
}

static void mesh_sides(const SceneView *view, const ShapeRecord *shape, Side *sides) {
    const int32_t *indices = mesh_indices(view, shape), *welded = view->welded + shape->welded;
    for (int32_t i = 0; i < 3 * shape->triangle_count; i++) {
        int32_t a = welded[indices[i]], b = welded[indices[i / 3 * 3 + (i % 3 + 1) % 3]];
        sides[i] = (Side){a < b ? a : b, a < b ? b : a, i};
    }
    qsort(sides, 3 * (size_t)shape->triangle_count, sizeof *sides, compare_sides);
}

static const float *vertex_of(const SceneView *view, const ShapeRecord *shape, int32_t vertex) {
    return view->theta + shape->positions + 3 * (int64_t)vertex;
}

// Whether two triangles lie in one plane, so that no view makes a silhouette of their edge.
static bool is_flat(const SceneView *view, const ShapeRecord *shape, const int32_t *corners, int32_t opposite) {
    const float *p[4] = {vertex_of(view, shape, corners[0]), vertex_of(view, shape, corners[1]),
                         vertex_of(view, shape, corners[2]), vertex_of(view, shape, opposite)};
    double e[3][3];
    for (int k = 0; k < 3; k++) {
        for (int c = 0; c < 3; c++) {
            e[k][c] = (double)p[k + 1][c] - (double)p[0][c];
        }
    }
    double n[3] = {e[0][1] * e[1][2] - e[0][2] * e[1][1], e[0][2] * e[1][0] - e[0][0] * e[1][2],
                   e[0][0] * e[1][1] - e[0][1] * e[1][0]};
    double volume = n[0] * e[2][0] + n[1] * e[2][1] + n[2] * e[2][2];
    double size = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]) *
                  sqrt(e[2][0] * e[2][0] + e[2][1] * e[2][1] + e[2][2] * e[2][2]);
    return fabs(volume) <= 1e-7 * size;
}

// The edge that `count` sides share.
static EdgeRecord mesh_edge(const SceneView *view, int32_t id, const Side *sides, int32_t count) {
    const ShapeRecord *shape = view->shapes + id;
    const int32_t *indices = mesh_indices(view, shape);
    int32_t prim = sides[0].at / 3, corner = sides[0].at % 3;
    EdgeRecord e = {EDGE_MESH, id, 0, prim, corner, EDGE_OPEN, 1, 0, 1};
    if (count == 2) {
        int32_t other = sides[1].at / 3, corner2 = sides[1].at % 3;
        e.opposite = indices[3 * other + (corner2 + 2) % 3];
        // With vertex normals, shading runs on where both triangles use the same vertices.
        int32_t a = indices[sides[0].at], b = indices[3 * prim + (corner + 1) % 3];
        int32_t c = indices[sides[1].at], d = indices[3 * other + (corner2 + 1) % 3];
        bool same = (a == c && b == d) || (a == d && b == c);
        e.crease = !(same && (shape->flags & SHAPE_HAS_NORMALS));
    } else if (count > 2) {
        e.opposite = EDGE_MANY;
    }
    return e;
}

static rey_result push_edge(rey_scene *scene, Array *edges, EdgeRecord e) {
    const SceneView *view = &scene->view;
    if (view->shapes[e.shape].collection < 0) {
        EdgeRecord *one = rey_array_push(scene->ctx, edges, sizeof e, 1);
        if (one) {
            *one = e;
        }
        return one ? REY_OK : REY_ERROR_MEMORY;
    }
    for (int64_t i = 0; i < view->instances_count; i++) {
        if (view->instances[i].group != view->shapes[e.shape].collection) {
            continue;
        }
        EdgeRecord *one = rey_array_push(scene->ctx, edges, sizeof e, 1);
        if (!one) {
            return REY_ERROR_MEMORY;
        }
        *one = e;
        one->instance = (int32_t)i;
    }
    return REY_OK;
}

static rey_result mesh_edges(rey_scene *scene, int32_t id, Array *edges) {
    const SceneView *view = &scene->view;
    const ShapeRecord *shape = view->shapes + id;
    int32_t n = 3 * shape->triangle_count;
    Side *sides = rey_alloc_array(scene->ctx, (size_t)n + 1, sizeof *sides);
    if (!sides) {
        return REY_ERROR_MEMORY;
    }
    mesh_sides(view, shape, sides);
    rey_result result = REY_OK;
    for (int32_t i = 0, next; i < n && result == REY_OK; i = next) {
        for (next = i + 1; next < n && sides[next].low == sides[i].low && sides[next].high == sides[i].high;) {
            next++;
        }
        EdgeRecord e = mesh_edge(view, id, sides + i, next - i);
        bool flat = e.opposite >= 0 && is_flat(view, shape, mesh_indices(view, shape) + 3 * e.prim, e.opposite);
        // Vertices of a flat edge may move out of its plane, but then both sides turn by as much as nothing.
        if (sides[i].low != sides[i].high && !flat) {
            result = push_edge(scene, edges, e);
        }
    }
    rey_free(scene->ctx, sides);
    return result;
}

// Another curve, in pieces.
static rey_result curve_edges(rey_scene *scene, int32_t id, int32_t kind, int32_t end, Array *edges) {
    const int32_t pieces = kind == EDGE_SIDE ? 8 : 64;
    rey_result result = REY_OK;
    for (int32_t i = 0; i < pieces && result == REY_OK; i++) {
        EdgeRecord e = {kind, id, 0, 0, end, EDGE_OPEN, 1, (float)i / (float)pieces, (float)(i + 1) / (float)pieces};
        result = push_edge(scene, edges, e);
    }
    return result;
}

rey_result rey_edges_find(rey_scene *scene, Array *edges) {
    rey_result result = REY_OK;
    for (int32_t id = 0; id < scene->view.shapes_count && result == REY_OK; id++) {
        const ShapeRecord *shape = scene->view.shapes + id;
        if (shape->flags & SHAPE_UNSEEN) {
            continue;
        }
        switch (shape->kind) {
        case SHAPE_MESH:
            result = mesh_edges(scene, id, edges);
            break;
        case SHAPE_SPHERE:
            result = curve_edges(scene, id, EDGE_OUTLINE, 0, edges);
            break;
        case SHAPE_CYLINDER:
            for (int32_t end = 0; end < 2 && result == REY_OK; end++) {
                result = curve_edges(scene, id, EDGE_SIDE, end, edges);
                result = result == REY_OK ? curve_edges(scene, id, EDGE_RIM, end, edges) : result;
            }
            break;
        case SHAPE_DISK:
            result = curve_edges(scene, id, EDGE_RIM, 0, edges);
            break;
        default:
            break;
        }
    }
    return result;
}
