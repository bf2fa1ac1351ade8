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

void rey_open_take(SceneView *view) {
    view->open_triangles_count = 0;
    for (int k = 0; k < 3; k++) {
        view->open_low[k] = INFINITY;
        view->open_high[k] = -INFINITY;
    }
    for (int32_t i = 0; i < view->shapes_count && view->open_apart; i++) {
        const ShapeRecord *shape = view->shapes + i;
        for (int32_t t = 0; shape->kind == SHAPE_MESH && rey_is_open(view, shape) && t < shape->triangle_count; t++) {
            OpenTriangle *triangle = view->open_triangles + view->open_triangles_count++;
            *triangle = (OpenTriangle){.shape = i, .prim = t};
            for (int c = 0; c < 9; c++) {
                int32_t corner = view->triangles[3 * ((int64_t)shape->triangle + t) + c / 3];
                float x = view->theta[shape->positions + 3 * corner + c % 3];
                triangle->corner[c / 3][c % 3] = x;
                view->open_low[c % 3] = fminf(view->open_low[c % 3], x);
                view->open_high[c % 3] = fmaxf(view->open_high[c % 3], x);
            }
        }
    }
}
