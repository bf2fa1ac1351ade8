// edges.c: which triangles of a mesh share which edges. Vertices at the same position are one (UV seams are no edges).
#include "shape/cut.h"
#include "shape/edge_pieces.h"
#include "shape/marks.h"
#include "shape/shape.h"

#include <stdlib.h>
#include <string.h>

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

static const float *vertex_of(const SceneView *view, const ShapeRecord *shape, int32_t vertex) {
    return view->theta + shape->positions + 3 * (int64_t)vertex;
}

// Whether a triangle's corners lie on one line, as those do that fill what is left between others: no ray meets it.
static bool is_sliver(const SceneView *view, const ShapeRecord *shape, const int32_t *corners) {
    double e[2][3], area2 = 0, longest2 = 0, largest = 0;
    for (int i = 0; i < 3; i++) {
        const float *p = vertex_of(view, shape, corners[i]), *q = vertex_of(view, shape, corners[(i + 1) % 3]);
        double length2 = 0;
        for (int k = 0; k < 3; k++) {
            double d = (double)q[k] - (double)p[k];
            length2 += d * d;
            largest = fmax(largest, fabs((double)p[k]));
            if (i < 2) {
                e[i][k] = d;
            }
        }
        longest2 = fmax(longest2, length2);
    }
    for (int k = 0; k < 3; k++) {
        int i = (k + 1) % 3, j = (k + 2) % 3;
        double n = e[0][i] * e[1][j] - e[0][j] * e[1][i];
        area2 += n * n;
    }
    const double height = CORNER_TOLERANCE * largest;
    return area2 <= height * height * longest2;
}

// Those of slivers have the same end twice.
static void mesh_sides(const SceneView *view, const ShapeRecord *shape, Side *sides) {
    const int32_t *indices = mesh_indices(view, shape), *welded = view->welded + shape->welded;
    for (int32_t i = 0; i < 3 * shape->triangle_count; i++) {
        int32_t a = welded[indices[i]], b = welded[indices[i / 3 * 3 + (i % 3 + 1) % 3]];
        sides[i] = (Side){a < b ? a : b, a < b ? b : a, i};
    }
    for (int32_t t = 0; t < shape->triangle_count; t++) {
        for (int32_t i = 3 * t; i < 3 * t + 3 && is_sliver(view, shape, indices + 3 * t); i++) {
            sides[i].high = sides[i].low;
        }
    }
    qsort(sides, 3 * (size_t)shape->triangle_count, sizeof *sides, compare_sides);
}

// From an edge (at a, along the unit vector e) into a triangle with this third corner: unit, at right angles to the edge.
static void side_direction(const SceneView *view, const ShapeRecord *shape, const float *a, const double e[3], int32_t corner,
                           double out[3]) {
    const float *p = vertex_of(view, shape, corner);
    double along = 0, length = 0;
    for (int k = 0; k < 3; k++) {
        out[k] = (double)p[k] - (double)a[k];
        along += out[k] * e[k];
    }
    for (int k = 0; k < 3; k++) {
        out[k] -= along * e[k];
        length += out[k] * out[k];
    }
    length = sqrt(length);
    for (int k = 0; k < 3; k++) {
        out[k] = length > 0 ? out[k] / length : 0;
    }
}

enum { MOST_SIDES = 16 };

// The triangles around an edge, by their directions: triangles that lie on each other are one.
typedef struct Around {
    double direction[MOST_SIDES][3];
    int32_t side[MOST_SIDES];
    int32_t count;
} Around;

static Around look_around(const SceneView *view, const ShapeRecord *shape, const Side *sides, int32_t count) {
    const int32_t *indices = mesh_indices(view, shape);
    const float *a = vertex_of(view, shape, sides[0].low), *b = vertex_of(view, shape, sides[0].high);
    double e[3], length = 0;
    for (int k = 0; k < 3; k++) {
        e[k] = (double)b[k] - (double)a[k];
        length += e[k] * e[k];
    }
    for (int k = 0; k < 3; k++) {
        e[k] /= sqrt(length);
    }
    Around r = {.count = 0};
    for (int32_t i = 0; i < count && r.count < MOST_SIDES; i++) {
        double d[3];
        int32_t at = sides[i].at;
        side_direction(view, shape, a, e, indices[at / 3 * 3 + (at % 3 + 2) % 3], d);
        bool known = false;
        for (int32_t k = 0; k < r.count; k++) {
            double off = 0;
            for (int c = 0; c < 3; c++) {
                off += (d[c] - r.direction[k][c]) * (d[c] - r.direction[k][c]);
            }
            known |= off < 1e-10;
        }
        if (!known) {
            memcpy(r.direction[r.count], d, sizeof d);
            r.side[r.count++] = i;
        }
    }
    return r;
}

// Two triangles in one plane, one on each side: no view makes a silhouette of their edge.
static bool is_flat(const Around *r) {
    double off = 0;
    for (int k = 0; k < 3 && r->count == 2; k++) {
        double sum = r->direction[0][k] + r->direction[1][k];
        off += sum * sum;
    }
    return r->count == 2 && off < 1e-13;
}

// The edge that `count` sides share.
static rey_result mesh_edge(rey_scene *scene, int32_t id, const Side *sides, int32_t count, const Around *r, Array *fans,
                            EdgeRecord *e) {
    const SceneView *view = &scene->view;
    const ShapeRecord *shape = view->shapes + id;
    const int32_t *indices = mesh_indices(view, shape);
    *e = (EdgeRecord){.kind = EDGE_MESH, .shape = id, .prim = sides[0].at / 3, .corner = sides[0].at % 3,
                      .opposite = EDGE_OPEN, .other = count > 1 ? EDGE_ANY : EDGE_NONE, .crease = EDGE_CREASE, .last = 1};
    if (r->count > 1) {
        int32_t at = sides[r->side[1]].at, other = at / 3;
        e->opposite = indices[3 * other + (at % 3 + 2) % 3];
        if (count == 2) {
            e->other = other;
            // With vertex normals, scattering runs on where both triangles use the same vertices.
            int32_t a = indices[sides[0].at], b = indices[3 * e->prim + (e->corner + 1) % 3];
            int32_t c = indices[at], d = indices[3 * other + (at % 3 + 1) % 3];
            bool same = (a == c && b == d) || (a == d && b == c);
            e->crease = same && (shape->flags & SHAPE_HAS_NORMALS) ? EDGE_SOFT : EDGE_CREASE;
        }
    }
    e->fan = (int32_t)fans->count;
    for (int32_t i = 2; i < r->count; i++) {
        int32_t *vertex = rey_array_push(scene->ctx, fans, sizeof *vertex, 1), at = sides[r->side[i]].at;
        if (!vertex) {
            return REY_ERROR_MEMORY;
        }
        *vertex = indices[at / 3 * 3 + (at % 3 + 2) % 3];
        e->fan_count++;
    }
    return REY_OK;
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

// The uv of the ends of an edge as one of the triangles there has them, in the order of the welded vertices.
static void side_uv(const SceneView *view, const ShapeRecord *shape, const Side *side, double uv[2][2]) {
    const int32_t *indices = mesh_indices(view, shape), *welded = view->welded + shape->welded;
    int32_t prim = side->at / 3, corners[2] = {side->at % 3, (side->at % 3 + 1) % 3};
    for (int k = 0; k < 2; k++) {
        int32_t vertex = indices[3 * prim + corners[k]];
        int end = welded[vertex] == side->low ? 0 : 1;
        for (int c = 0; c < 2; c++) {
            uv[end][c] = shape->uvs >= 0 ? (double)view->theta[shape->uvs + 2 * (int64_t)vertex + c] : corners[k] == c + 1;
        }
    }
}

// How points of a triangle move with u and v, as interactions have it, and its unit normal.
static void triangle_frame(const SceneView *view, const ShapeRecord *shape, int32_t prim, double moves[2][3], double n[3]) {
    const int32_t *corners = mesh_indices(view, shape) + 3 * (int64_t)prim;
    const float *p[3], *uv[3] = {NULL, NULL, NULL};
    double by[2][2] = {{1, 0}, {0, 1}}, e[2][3], size = 0; // by: of u and v, of the two edges
    for (int k = 0; k < 3; k++) {
        p[k] = vertex_of(view, shape, corners[k]);
        uv[k] = shape->uvs >= 0 ? view->theta + shape->uvs + 2 * (int64_t)corners[k] : NULL;
    }
    if (uv[0]) {
        double u1 = (double)uv[1][0] - (double)uv[0][0], u2 = (double)uv[2][0] - (double)uv[0][0];
        double v1 = (double)uv[1][1] - (double)uv[0][1], v2 = (double)uv[2][1] - (double)uv[0][1], det = u1 * v2 - v1 * u2;
        if (fabs(det) > 1e-20) {
            by[0][0] = v2 / det, by[0][1] = -v1 / det;
            by[1][0] = -u2 / det, by[1][1] = u1 / det;
        }
    }
    for (int k = 0; k < 3; k++) {
        e[0][k] = (double)p[1][k] - (double)p[0][k];
        e[1][k] = (double)p[2][k] - (double)p[0][k];
        for (int i = 0; i < 2; i++) {
            moves[i][k] = by[i][0] * e[0][k] + by[i][1] * e[1][k];
        }
    }
    for (int k = 0; k < 3; k++) {
        int i = (k + 1) % 3, j = (k + 2) % 3;
        n[k] = e[0][i] * e[1][j] - e[0][j] * e[1][i];
        size += n[k] * n[k];
    }
    for (int k = 0; k < 3; k++) {
        n[k] = size > 0 ? n[k] / sqrt(size) : 0;
    }
}

static double distance(const double a[3], const double b[3]) {
    const double d[3] = {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
    return sqrt(dot3(d, d));
}

// Whether the tangents of two triangles differ by more than the angle between them explains.
static bool tangents_jump(const SceneView *view, const ShapeRecord *shape, const Side *a, const Side *b) {
    double moves[2][2][3], n[2][3];
    for (int i = 0; i < 2; i++) {
        triangle_frame(view, shape, (i ? b : a)->at / 3, moves[i], n[i]);
        double size = sqrt(dot3(moves[i][0], moves[i][0]));
        for (int k = 0; k < 3; k++) {
            moves[i][0][k] = size > 0 ? moves[i][0][k] / size : 0;
        }
    }
    return distance(moves[0][0], moves[1][0]) > 2 * distance(n[0], n[1]) + 1e-4;
}

// Whether points move with u and v otherwise on one of two triangles than on the other, along the surface.
static bool frames_jump(const SceneView *view, const ShapeRecord *shape, const Side *a, const Side *b) {
    double moves[2][2][3], n[2][3];
    triangle_frame(view, shape, a->at / 3, moves[0], n[0]);
    triangle_frame(view, shape, b->at / 3, moves[1], n[1]);
    for (int i = 0; i < 2; i++) {
        double between[3], up[3];
        for (int k = 0; k < 3; k++) {
            between[k] = moves[0][i][k] - moves[1][i][k];
            up[k] = n[0][k] + n[1][k];
        }
        double along = dot3(between, up), across2 = dot3(between, between) - along * along / fmax(dot3(up, up), 1e-30);
        if (across2 > 1e-8 * dot3(moves[0][i], moves[0][i])) {
            return true;
        }
    }
    return false;
}

// Whether the textures of a shape, whose steps begin at number `first`, jump along an edge.
static bool texture_jumps(const SceneView *view, const Array *steps, size_t first, const Side *sides, const Around *r) {
    const int32_t id = first < steps->count ? ARRAY_AT(*steps, TextureStep, first).shape : -1;
    if (id < 0 || r->count < 2) {
        return false;
    }
    double uv[2][2][2];
    side_uv(view, view->shapes + id, sides + r->side[0], uv[0]);
    side_uv(view, view->shapes + id, sides + r->side[1], uv[1]);
    for (size_t i = first; i < steps->count && ARRAY_AT(*steps, TextureStep, i).shape == id; i++) {
        int32_t sort = ARRAY_AT(*steps, TextureStep, i).sort;
        const Side *a = sides + r->side[0], *b = sides + r->side[1];
        bool turns = sort == STEP_TANGENTS && tangents_jump(view, view->shapes + id, a, b);
        turns |= sort == STEP_FRAMES && frames_jump(view, view->shapes + id, a, b);
        if (turns || sort == STEP_FACES || (sort == STEP_SEAMS && memcmp(uv[0], uv[1], sizeof uv[0]) != 0)) {
            return true;
        }
    }
    return rey_step_along(steps, first, uv[0][0], uv[0][1]) || rey_step_along(steps, first, uv[1][0], uv[1][1]);
}

static rey_result mesh_edges(rey_scene *scene, int32_t id, const Array *steps, size_t first, Array *edges, Array *fans) {
    const SceneView *view = &scene->view;
    const ShapeRecord *shape = view->shapes + id;
    const int32_t n = 3 * shape->triangle_count;
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
        if (sides[i].low == sides[i].high) {
            continue;
        }
        Around around = look_around(view, shape, sides + i, next - i);
        bool jumps = texture_jumps(view, steps, first, sides + i, &around);
        if (jumps || !is_flat(&around)) {
            EdgeRecord e;
            result = mesh_edge(scene, id, sides + i, next - i, &around, fans, &e);
            e.crease = jumps ? EDGE_STEP : e.crease;
            result = result == REY_OK ? push_edge(scene, edges, e) : result;
        }
    }
    rey_free(scene->ctx, sides);
    return result;
}

// Triangles whose shading normals may turn away from a viewer.
static rey_result mesh_terminators(rey_scene *scene, int32_t id, Array *edges) {
    const SceneView *view = &scene->view;
    const ShapeRecord *shape = view->shapes + id;
    rey_result result = REY_OK;
    for (int32_t i = 0; i < shape->triangle_count && (shape->flags & SHAPE_HAS_NORMALS) && result == REY_OK; i++) {
        if (is_sliver(view, shape, mesh_indices(view, shape) + 3 * (int64_t)i)) {
            continue;
        }
        EdgeRecord e = {.kind = EDGE_TERMINATOR, .shape = id, .prim = i, .opposite = EDGE_OPEN,
                        .other = EDGE_ANY, .crease = EDGE_CREASE,
                        .last = 1};
        result = push_edge(scene, edges, e);
    }
    return result;
}

// A curve of a round shape, in pieces.
static rey_result round_edges(rey_scene *scene, int32_t id, int32_t kind, int32_t end, Array *edges) {
    const int32_t pieces = kind == EDGE_SIDE || scene->view.shapes[id].collection >= 0 ? 8 : 64;
    rey_result result = REY_OK;
    for (int32_t i = 0; i < pieces && result == REY_OK; i++) {
        EdgeRecord e = {.kind = kind, .shape = id, .corner = end, .opposite = EDGE_OPEN, .other = EDGE_ANY, .crease = EDGE_CREASE,
                        .first = (float)i / (float)pieces, .last = (float)(i + 1) / (float)pieces};
        result = push_edge(scene, edges, e);
    }
    return result;
}

// Both sides of every segment of a B-spline curve, and the circles where control points do not go on.
static rey_result tube_edges(rey_scene *scene, int32_t id, Array *edges) {
    const ShapeRecord *shape = scene->view.shapes + id;
    const int32_t *first = scene->view.segments + shape->segment;
    rey_result result = REY_OK;
    for (int32_t i = 0; i < shape->segment_count; i++) {
        bool begins = i == 0 || first[i - 1] + 1 != first[i], last = i + 1 == shape->segment_count || first[i + 1] != first[i] + 1;
        for (int32_t k = 0; k < 4 && result == REY_OK; k++) {
            EdgeRecord e = {.kind = k < 2 ? EDGE_TUBE : EDGE_TUBE_END, .shape = id, .prim = i, .corner = k % 2,
                            .opposite = EDGE_OPEN, .other = EDGE_ANY, .crease = EDGE_CREASE, .last = 1};
            result = k < 2 || (k == 2 ? begins : last) ? push_edge(scene, edges, e) : REY_OK;
        }
    }
    return result;
}

rey_result rey_edges_find(rey_scene *scene, const Array *steps, Array *edges, Array *fans) {
    rey_result result = REY_OK;
    size_t step = 0;
    for (int32_t id = 0; id < scene->view.shapes_count && result == REY_OK; id++) {
        const ShapeRecord *shape = scene->view.shapes + id;
        while (step < steps->count && ARRAY_AT(*steps, TextureStep, step).shape < id) {
            step++;
        }
        bool own = step < steps->count && ARRAY_AT(*steps, TextureStep, step).shape == id;
        if (shape->flags & SHAPE_UNSEEN) {
            continue;
        }
        switch (shape->kind) {
        case SHAPE_MESH:
            result = mesh_edges(scene, id, steps, own ? step : steps->count, edges, fans);
            result = result == REY_OK ? mesh_terminators(scene, id, edges) : result;
            break;
        case SHAPE_SPHERE:
            result = round_edges(scene, id, EDGE_OUTLINE, 0, edges);
            break;
        case SHAPE_CYLINDER:
            for (int32_t end = 0; end < 2 && result == REY_OK; end++) {
                result = round_edges(scene, id, EDGE_SIDE, end, edges);
                result = result == REY_OK ? round_edges(scene, id, EDGE_RIM, end, edges) : result;
            }
            break;
        case SHAPE_DISK:
            result = round_edges(scene, id, EDGE_RIM, 0, edges);
            break;
        case SHAPE_BSPLINE:
            result = tube_edges(scene, id, edges);
            break;
        default:
            break;
        }
    }
    return result;
}
