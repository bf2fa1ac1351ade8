// open.c: which surfaces that let light pass Embree does not know.
#include "accel/open.h"

#include <math.h>

bool rey_is_open(const SceneView *view, const ShapeRecord *shape) {
    return is_seen(shape) && view->bsdfs[shape->bsdf].transmits;
}

// Kernels meet surfaces that let light pass themselves where shadow rays do pass them and they are few: meshes, beside own spheres.
void rey_open_find(SceneView *view) {
    int64_t triangles = 0, shapes = 0;
    for (int64_t i = 0; i < view->shapes_count && view->through; i++) {
        const ShapeRecord *shape = view->shapes + i;
        if (!rey_is_open(view, shape)) {
            continue;
        }
        bool own = view->own_spheres_count && stands_alone(shape);
        bool few = own || (shape->kind == SHAPE_MESH && shape->collection < 0);
        triangles += own ? 0 : few ? shape->triangle_count : MOST_OPEN_TRIANGLES + 1;
        shapes++;
    }
    view->open_apart = shapes > 0 && triangles <= MOST_OPEN_TRIANGLES;
}

static int32_t corner_number(SceneView *view, const float *p) {
    for (int32_t i = 0; i < view->open_corners_count; i++) {
        const float *q = view->open_corners[i];
        if (q[0] == p[0] && q[1] == p[1] && q[2] == p[2]) {
            return i;
        }
    }
    for (int k = 0; k < 3; k++) {
        view->open_corners[view->open_corners_count][k] = p[k];
        view->open_low[k] = fminf(view->open_low[k], p[k]);
        view->open_high[k] = fmaxf(view->open_high[k], p[k]);
    }
    return view->open_corners_count++;
}

// The way from one corner to another (OpenTriangle).
static int32_t way_number(SceneView *view, int32_t from, int32_t to) {
    for (int32_t i = 0; i < view->open_edges_count; i++) {
        const int32_t *edge = view->open_edges[i];
        bool along = edge[0] == from && edge[1] == to;
        if (along || (edge[0] == to && edge[1] == from)) {
            return along ? 2 * i : 2 * i + 1;
        }
    }
    view->open_edges[view->open_edges_count][0] = from;
    view->open_edges[view->open_edges_count][1] = to;
    return 2 * view->open_edges_count++;
}

static void take_triangle(SceneView *view, int32_t id, const ShapeRecord *shape, int32_t prim) {
    OpenTriangle *triangle = view->open_triangles + view->open_triangles_count++;
    triangle->shape = id;
    triangle->prim = prim;
    float p[3][3];
    int32_t number[3];
    for (int i = 0; i < 3; i++) {
        int32_t corner = view->triangles[3 * ((int64_t)shape->triangle + prim) + i];
        for (int k = 0; k < 3; k++) {
            p[i][k] = (float)view->theta[shape->positions + 3 * corner + k];
        }
        number[i] = corner_number(view, p[i]);
    }
    triangle->corner = number[0];
    for (int i = 0; i < 3; i++) {
        int a = (i + 1) % 3, b = (i + 2) % 3;
        triangle->way[i] = way_number(view, number[i], number[a]);
        double across = ((double)p[1][a] - p[0][a]) * ((double)p[2][b] - p[0][b]);
        triangle->normal[i] = (float)(across - ((double)p[1][b] - p[0][b]) * ((double)p[2][a] - p[0][a]));
    }
}

void rey_open_take(SceneView *view) {
    view->open_triangles_count = view->open_corners_count = view->open_edges_count = 0;
    for (int k = 0; k < 3; k++) {
        view->open_low[k] = INFINITY;
        view->open_high[k] = -INFINITY;
    }
    for (int32_t i = 0; i < view->shapes_count && view->open_apart; i++) {
        const ShapeRecord *shape = view->shapes + i;
        for (int32_t t = 0; shape->kind == SHAPE_MESH && rey_is_open(view, shape) && t < shape->triangle_count; t++) {
            take_triangle(view, i, shape, t);
        }
    }
}
