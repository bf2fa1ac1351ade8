// corners.c: sides of triangles that lie in other triangles, and triangles that pass through each other.
#include "shape/corners.h"

#include "shape/pieces.h"
#include "shape/shape.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define CORNER_TOUCH 1e-5 // of the smaller triangle's size
#define CORNER_STEEP 2.0  // of a lens on a wall that is high enough
#define CORNER_FLAT 1e-2  // height of a wall over its length below which there is none

// Meshes of more triangles are not looked through for corners of their own: most of those are not among the longest, and the light
// of each triangle's neighbours changes little over it.
enum { MOST_ITSELF = 64 };

// Of one viewer, the longest ones: it looks at all of them at each of its points.
enum { MOST_CORNERS = 32 };

// Where a triangle passes through the plane of another one, or a side of it lies in that plane: two points.
static bool reaches(const Triangle *a, const Triangle *b, double touch, double points[2][3]) {
    int count = 0, apart = 0;
    for (int k = 0; k < 3; k++) {
        double q[3] = {a->p[k][0] - b->p[0][0], a->p[k][1] - b->p[0][1], a->p[k][2] - b->p[0][2]};
        if (fabs(dot3(b->n, q)) < touch) {
            memcpy(points[count < 2 ? count : 1], a->p[k], sizeof a->p[k]);
            count++;
        } else {
            apart++;
        }
    }
    return (count == 2 && apart == 1) || rey_triangle_passes(a, b, touch, points);
}

// The heights of a triangle's corners over another one's plane: the largest on one side.
static double rises(const Triangle *a, const Triangle *b, double side, const double up[3]) {
    double most = 0;
    for (int k = 0; k < 3; k++) {
        double q[3] = {a->p[k][0] - b->p[0][0], a->p[k][1] - b->p[0][1], a->p[k][2] - b->p[0][2]};
        most = fmax(most, side * dot3(b->n, q) / fabs(dot3(b->n, up)));
    }
    return most;
}

// What triangle a of the viewer sees of triangle b, number prim, of the wall beside the line on which they meet.
static rey_result push_corner(Pieces *s, const Body *viewer, const Triangle *a, const Body *wall, int32_t prim, const Triangle *b,
                              double ends[2][3]) {
    double along[3], up[3], length = 0;
    for (int c = 0; c < 3; c++) {
        along[c] = ends[1][c] - ends[0][c];
    }
    length = sqrt(dot3(along, along));
    for (int c = 0; c < 3; c++) {
        along[c] /= length;
    }
    cross3(b->n, along, up);
    for (int side = -1; side <= 1; side += 2) {
        double upwards = side * (dot3(up, a->n) > 0 ? 1 : -1), height = rises(b, a, side, up);
        if (height < CORNER_FLAT * length) {
            continue;
        }
        CornerRecord *c = rey_array_push(s->scene->ctx, s->found, sizeof *c, 1);
        if (!c) {
            return REY_ERROR_MEMORY;
        }
        *c = (CornerRecord){.viewer = viewer->shape, .wall = wall->shape, .prim = prim, .length = (float)length,
                            .steep = (float)fmin(CORNER_STEEP, 4 * height / length)};
        for (int k = 0; k < 3; k++) {
            c->origin[k] = (float)ends[0][k];
            c->along[k] = (float)along[k];
            c->up[k] = (float)(upwards * up[k]);
            c->normal[k] = (float)(side * a->n[k]);
        }
    }
    return REY_OK;
}

static rey_result corners_overlap(void *user, int32_t first, int32_t second) {
    Pieces *s = user;
    const Piece *piece[2] = {&ARRAY_AT(s->pieces, Piece, first), &ARRAY_AT(s->pieces, Piece, second)};
    const Body *body[2] = {&ARRAY_AT(s->bodies, Body, piece[0]->body), &ARRAY_AT(s->bodies, Body, piece[1]->body)};
    const SceneView *view = &s->scene->view;
    bool flat = true;
    for (int i = 0; i < 2 && flat; i++) {
        const ShapeRecord *shape = view->shapes + body[i]->shape;
        flat = shape->collection < 0 && shape->emitter < 0 && !(shape->flags & SHAPE_HAS_NORMALS);
    }
    Triangle t[2];
    double ends[2][3];
    if (!flat) {
        return REY_OK;
    }
    t[0] = rey_piece_triangle(s, piece[0]);
    t[1] = rey_piece_triangle(s, piece[1]);
    if (!rey_triangles_meet(t, t + 1, reaches, CORNER_TOUCH, ends)) {
        return REY_OK;
    }
    rey_result result = push_corner(s, body[0], t, body[1], piece[1]->triangle, t + 1, ends);
    return result == REY_OK ? push_corner(s, body[1], t + 1, body[0], piece[0]->triangle, t, ends) : result;
}

// Those of a viewer together, its own last, the longest first.
static int compare_corners(const void *a, const void *b) {
    const CornerRecord *x = a, *y = b;
    if (x->viewer != y->viewer) {
        return x->viewer < y->viewer ? -1 : 1;
    }
    const bool own[2] = {x->wall == x->viewer, y->wall == y->viewer};
    if (own[0] != own[1]) {
        return own[0] ? 1 : -1;
    }
    return x->length != y->length ? (x->length > y->length ? -1 : 1) : memcmp(x, y, sizeof *x);
}

rey_result rey_corners_find(rey_scene *scene, MeetingMoves *moves, const void *user, Array *corners) {
    Pieces s = {.scene = scene, .moves = moves, .user = user, .itself = MOST_ITSELF, .meshes = true, .margin = 1e-5f,
                .found = corners};
    rey_result result = rey_pieces_overlap(&s, corners_overlap);
    if (result != REY_OK || corners->count == 0) {
        return result;
    }
    CornerRecord *all = corners->data;
    qsort(all, corners->count, sizeof *all, compare_corners);
    size_t kept = 0;
    for (size_t i = 0; i < corners->count; i++) {
        if (kept < MOST_CORNERS || all[kept - MOST_CORNERS].viewer != all[i].viewer) {
            all[kept++] = all[i];
        }
    }
    corners->count = kept;
    return REY_OK;
}
