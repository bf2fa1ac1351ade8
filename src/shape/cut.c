// cut.c: round surfaces are cut into triangles to find where they may meet. Those of tubes are outside of them.
#include "shape/cut.h"

#include "shape/affine.h"
#include "shape/shape.h"

#include <math.h>

enum { AROUND = 64, STACKS = 32, TUBE_AROUND = 16, TUBE_STACKS = 4 };
#define PHASE 0.2931 // of the angle between nodes around an axis, by which they are turned
#define TUBE_ROOM 1.0195911582083184 // over the radius: 1 / cos(pi / TUBE_AROUND), so that triangles enclose the tube

int32_t rey_cut_triangles(const SceneView *view, int32_t id) {
    const ShapeRecord *shape = view->shapes + id;
    switch (shape->kind) {
    case SHAPE_MESH:
        return shape->triangle_count;
    case SHAPE_SPHERE:
        return 2 * AROUND * STACKS;
    case SHAPE_CYLINDER:
        return 2 * AROUND;
    case SHAPE_DISK:
        return AROUND;
    case SHAPE_BSPLINE:
        return REY_TUBE_PIECES; // of a segment
    default:
        return 0;
    }
}

// Node (column, row) of the grid of a round shape, in its own space; the last column is the first again. It is turned, lest its
// lines lie in planes that scenes have, as that of a floor through a ball's middle: what lies in a plane does not pass through it.
static void round_node(int32_t kind, int32_t column, int32_t row, double p[3]) {
    const double pi = 3.14159265358979323846;
    double phi = 2 * pi * (column % AROUND + PHASE) / AROUND, x = cos(phi), y = sin(phi);
    double theta = kind == SHAPE_SPHERE ? pi * row / STACKS : 0;
    double wide = kind == SHAPE_CYLINDER ? 1 : kind == SHAPE_DISK ? row : sin(theta);
    p[0] = wide * x;
    p[1] = wide * y;
    p[2] = kind == SHAPE_SPHERE ? cos(theta) : kind == SHAPE_CYLINDER ? row : 0;
    if (kind == SHAPE_SPHERE) { // by 42 degrees about (0.54, 0.42, 0.73)
        const double turn[3][3] = {{0.8148065504726645, -0.4342694728670573, 0.3840576912946876},
                                   {0.5516924615942082, 0.7843761712696736, -0.2835303330588294},
                                   {-0.1781171331651183, 0.4429041057385851, 0.8786980368664447}};
        const double q[3] = {p[0], p[1], p[2]};
        for (int k = 0; k < 3; k++) {
            p[k] = dot3(turn[k], q);
        }
    }
}

// The columns and rows of the corners of both triangles of a cell.
static const int32_t cell_corners[2][3][2] = {{{0, 0}, {0, 1}, {1, 1}}, {{0, 0}, {1, 1}, {1, 0}}};

static void round_corner(const SceneView *view, const ShapeRecord *shape, int32_t triangle, int k, double p[3]) {
    int32_t cell = shape->kind == SHAPE_DISK ? triangle : triangle / 2, column = cell % AROUND, row = cell / AROUND;
    bool second = shape->kind != SHAPE_DISK && triangle % 2 == 1;
    const int32_t *at = cell_corners[second][k];
    double own[3];
    round_node(shape->kind, column + at[0], row + at[1], own);
    if (shape->kind == SHAPE_SPHERE) {
        const float *t = view->tables + shape->table;
        for (int c = 0; c < 3; c++) {
            p[c] = (double)t[c] + (double)t[3] * own[c];
        }
    } else {
        rey_affine_point(view->theta + shape->to_world, own, p);
    }
}

// Unit vector along v less its part along the unit vector t.
static void across_of(const double v[3], const double t[3], double out[3]) {
    double along = dot3(v, t), length2 = 0;
    for (int k = 0; k < 3; k++) {
        out[k] = v[k] - along * t[k];
        length2 += out[k] * out[k];
    }
    for (int k = 0; k < 3; k++) {
        out[k] = length2 > 0 ? out[k] / sqrt(length2) : 0;
    }
}

static CurvePoint tube_at(const SceneView *view, int32_t id, int32_t segment, float u) {
    Hit hit = {.shape = id, .prim = segment, .u = u};
    return bspline_point(view, &hit);
}

bool rey_tube_folds(const SceneView *view, int32_t id) {
    for (int32_t i = 0; i < 8 * view->shapes[id].segment_count; i++) {
        CurvePoint at = tube_at(view, id, i / 8, 0.125f * (float)(i % 8) + 0.0625f);
        float speed = v3_length(at.c1);
        if (speed * speed * speed < at.r * v3_length(v3_cross(at.c1, at.c2))) {
            return true;
        }
    }
    return false;
}

static void tube_box(const SceneView *view, int32_t id, int32_t segment, double room, double low[3], double high[3]) {
    const ShapeRecord *shape = view->shapes + id;
    const float *p = view->theta + shape->positions + 4 * (int64_t)view->segments[shape->segment + segment];
    const int points = shape->kind == SHAPE_LINEAR ? LINEAR_POINTS : BSPLINE_POINTS;
    for (int k = 0; k < 3; k++) {
        low[k] = INFINITY;
        high[k] = -INFINITY;
        for (int i = 0; i < points; i++) {
            low[k] = fmin(low[k], (double)p[4 * i + k] - room * (double)p[4 * i + 3]);
            high[k] = fmax(high[k], (double)p[4 * i + k] + room * (double)p[4 * i + 3]);
        }
    }
}

void rey_tube_box(const SceneView *view, int32_t id, int32_t segment, double low[3], double high[3]) {
    tube_box(view, id, segment, 1, low, high);
}

void rey_cut_box(const SceneView *view, int32_t id, int32_t segment, double low[3], double high[3]) {
    tube_box(view, id, segment, TUBE_ROOM, low, high);
    for (int k = 0; k < 3; k++) { // rings lean out of it
        double room = 0.03 * (high[k] - low[k]);
        low[k] -= room;
        high[k] += room;
    }
}

static void tangent_of(const CurvePoint *at, double t[3]) {
    Vec3 tangent = v3_normalize(at->c1);
    t[0] = (double)tangent.x;
    t[1] = (double)tangent.y;
    t[2] = (double)tangent.z;
}

// The segment before or after one of the same strand, -1 = none.
static int32_t next_segment(const SceneView *view, const ShapeRecord *shape, int32_t segment, int step) {
    const int32_t *first = view->segments + shape->segment, next = segment + step;
    return next >= 0 && next < shape->segment_count && first[next] - first[segment] == step ? next : -1;
}

// Of a tube's triangle: nodes around the axis count from a vector that goes along it without turning about it. Rings lean a little,
// but for those at open ends, lest they lie in planes that scenes have.
static void tube_corner(const SceneView *view, int32_t id, int32_t triangle, int corner, double p[3]) {
    const double pi = 3.14159265358979323846, lean[3] = {0.062, -0.035, 0.071};
    const int32_t cell = triangle % REY_TUBE_PIECES / 2, *at = cell_corners[triangle % 2][corner];
    const int32_t column = cell % TUBE_AROUND + at[0], row = cell / TUBE_AROUND + at[1];
    const double phi = 2 * pi * (column + PHASE) / TUBE_AROUND;
    int32_t segment = triangle / REY_TUBE_PIECES;
    double t[3], e[3], f[3], way[3];
    CurvePoint axis = tube_at(view, id, segment, 0);
    tangent_of(&axis, t);
    const double least[3] = {fabs(t[0]) < 0.5, fabs(t[0]) >= 0.5, 0};
    across_of(least, t, e);
    for (int32_t i = 1; i <= row; i++) {
        axis = tube_at(view, id, segment, (float)i / TUBE_STACKS);
        tangent_of(&axis, t);
        across_of(e, t, e);
    }
    cross3(t, e, f);
    for (int k = 0; k < 3; k++) {
        way[k] = cos(phi) * e[k] + sin(phi) * f[k];
    }
    double u = (row + dot3(lean, way)) / TUBE_STACKS;
    const int step = row == 0 ? -1 : row == TUBE_STACKS, beyond = u < 0 ? -1 : u > 1;
    const int32_t next = step ? next_segment(view, view->shapes + id, segment, step) : segment;
    if (next >= 0) {
        axis = tube_at(view, id, beyond ? next : segment, (float)(u - beyond));
    }
    const double c[3] = {(double)axis.c.x, (double)axis.c.y, (double)axis.c.z}, wide = TUBE_ROOM * (double)axis.r;
    for (int k = 0; k < 3; k++) {
        p[k] = c[k] + wide * way[k];
    }
}

const int32_t *rey_mesh_triangle(const SceneView *view, const ShapeRecord *shape, int32_t triangle) {
    return view->triangles + 3 * ((int64_t)shape->triangle + triangle);
}

void rey_cut_corner(const SceneView *view, int32_t id, int32_t triangle, int k, double p[3]) {
    const ShapeRecord *shape = view->shapes + id;
    if (shape->kind == SHAPE_MESH) {
        const float *own = view->theta + shape->positions + 3 * (int64_t)rey_mesh_triangle(view, shape, triangle)[k];
        for (int c = 0; c < 3; c++) {
            p[c] = (double)own[c];
        }
    } else if (shape->kind == SHAPE_BSPLINE) {
        tube_corner(view, id, triangle, k, p);
    } else {
        round_corner(view, shape, triangle, k, p);
    }
}
