// touches.c: pairs of faces in one plane that overlap. Round surfaces touch others in points at most.
#include "shape/touches.h"

#include "shape/pieces.h"
#include "shape/shape.h"

#include <math.h>

// How far apart faces count as touching, over the size of the larger one, and the sine of the angle between them. Rays step over
// surfaces by about as much (shape/interaction.h).
#define TOUCH 1e-4

typedef struct Touches {
    const SceneView *view;
    bool found;
} Touches;

static bool is_border(const void *user, int32_t shape, int32_t instance) {
    const SceneView *view = ((const Touches *)user)->view;
    UNUSED(instance);
    return shape >= 0 && (view->shapes[shape].interior >= 0 || view->shapes[shape].exterior >= 0);
}

// Whether one of b's sides, seen along n, has all of a on its outer side.
static bool parts(const Triangle *a, const Triangle *b, const double n[3]) {
    for (int k = 0; k < 3; k++) {
        double side[3], out[3], inner[3];
        for (int c = 0; c < 3; c++) {
            side[c] = b->p[(k + 1) % 3][c] - b->p[k][c];
            inner[c] = b->p[(k + 2) % 3][c] - b->p[k][c];
        }
        cross3(side, n, out);
        double sign = dot3(out, inner) > 0 ? -1 : 1, nearest = INFINITY;
        for (int i = 0; i < 3; i++) {
            double q[3] = {a->p[i][0] - b->p[k][0], a->p[i][1] - b->p[k][1], a->p[i][2] - b->p[k][2]};
            nearest = fmin(nearest, sign * dot3(out, q));
        }
        if (nearest > -TOUCH * b->size * b->size) {
            return true;
        }
    }
    return false;
}

static bool is_tube(const Pieces *s, const Piece *piece) {
    const int32_t shape = ARRAY_AT(s->bodies, Body, piece->body).shape;
    return shape >= 0 && s->scene->view.shapes[shape].kind == SHAPE_BSPLINE;
}

static rey_result pieces_touch(void *user, int32_t first, int32_t second) {
    Pieces *s = user;
    Touches *touches = (Touches *)(uintptr_t)s->user;
    const Piece *piece[2] = {&ARRAY_AT(s->pieces, Piece, first), &ARRAY_AT(s->pieces, Piece, second)};
    if (touches->found || is_tube(s, piece[0]) || is_tube(s, piece[1])) {
        return REY_OK;
    }
    Triangle a = rey_piece_triangle(s, piece[0]), b = rey_piece_triangle(s, piece[1]);
    double cross[3], far = 0, largest = fmax(a.size, b.size);
    cross3(a.n, b.n, cross);
    for (int k = 0; k < 3; k++) {
        double q[3] = {a.p[k][0] - b.p[0][0], a.p[k][1] - b.p[0][1], a.p[k][2] - b.p[0][2]};
        far = fmax(far, fabs(dot3(b.n, q)));
    }
    bool flat = dot3(cross, cross) < TOUCH * TOUCH && far < TOUCH * largest;
    touches->found = flat && !parts(&a, &b, b.n) && !parts(&b, &a, b.n);
    return REY_OK;
}

rey_result rey_borders_touch(rey_scene *scene, bool *touch) {
    Touches touches = {.view = &scene->view};
    rey_result result = REY_OK;
    bool any = false;
    for (int32_t i = 0; i < (int32_t)scene->view.shapes_count; i++) {
        any |= is_border(&touches, i, 0);
    }
    if (any) {
        Pieces s = {.scene = scene, .moves = is_border, .user = &touches, .margin = (float)TOUCH};
        result = rey_pieces_overlap(&s, pieces_touch);
    }
    *touch = touches.found;
    return result;
}
