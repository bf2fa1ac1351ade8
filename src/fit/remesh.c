// remesh.c: isotropic remeshing. A pass changes edges in a fixed order and leaves what an earlier change has touched to the
// next pass, so that neighbourhoods are found once for each pass.
#include "fit/remesh_parts.h"

#include <math.h>
#include <string.h>

enum { MOST_PASSES = 12 };
enum { NEIGHBOURS = 6, BORDER_NEIGHBOURS = 4 };

static void remesh_close(Remesh *r) {
    rey_array_free(r->ctx, &r->points);
    rey_array_free(r->ctx, &r->triangles);
    rey_remesh_forget(r);
}

/* ---- splits -------------------------------------------------------------------------------------------- */

// (p, q, s) with the edge between p and q becomes (p, m, s), and (m, q, s) is added.
static bool split_triangle(Remesh *r, int32_t triangle, const PointEdge *e, int32_t middle) {
    int32_t *t = rey_remesh_triangle(r, triangle);
    for (int k = 0; k < 3; k++) {
        int32_t p = t[k], q = t[(k + 1) % 3], s = t[(k + 2) % 3];
        if ((p == e->a && q == e->b) || (p == e->b && q == e->a)) {
            t[(k + 1) % 3] = middle;
            int32_t *added = rey_array_push(r->ctx, &r->triangles, sizeof *added, 3);
            if (added) {
                added[0] = middle;
                added[1] = q;
                added[2] = s;
            }
            return added != NULL;
        }
    }
    return true;
}

static rey_result split_pass(Remesh *r, double longest, int *changes) {
    rey_result result = rey_remesh_look(r, true);
    for (int32_t k = 0; k < r->mesh.edge_count && !result; k++) {
        const PointEdge *e = &r->mesh.edges[r->order[k]];
        if (!(rey_remesh_length(r, e->a, e->b) > longest) || e->triangle[0] < 0) {
            continue;
        }
        bool busy = r->touched_triangle[e->triangle[0]] || (e->triangle[1] >= 0 && r->touched_triangle[e->triangle[1]]);
        if (busy) {
            continue;
        }
        double *middle = rey_array_push(r->ctx, &r->points, sizeof *middle, 3);
        if (!middle) {
            return REY_ERROR_MEMORY;
        }
        const double *a = rey_remesh_point(r, e->a), *b = rey_remesh_point(r, e->b);
        for (int c = 0; c < 3; c++) {
            middle[c] = 0.5 * (a[c] + b[c]);
        }
        int32_t number = (int32_t)(r->points.count / 3) - 1;
        for (int side = 0; side < 2 && e->triangle[side] >= 0; side++) {
            r->touched_triangle[e->triangle[side]] = true;
            result = split_triangle(r, e->triangle[side], e, number) ? result : REY_ERROR_MEMORY;
        }
        (*changes)++;
    }
    return result;
}

/* ---- collapses ----------------------------------------------------------------------------------------- */

// Whether the triangles at `from` but those at `other`, too, keep their direction and stay small when it moves.
static bool may_move(const Remesh *r, int32_t from, int32_t other, const double to[3], double longest) {
    for (int32_t k = r->first[from]; k < r->first[from + 1]; k++) {
        const int32_t *t = r->mesh.triangles + 3 * (int64_t)r->around[k];
        const double *p[3];
        double before[3], after[3], along = 0, size[2] = {0, 0};
        if (t[0] == other || t[1] == other || t[2] == other) {
            continue;
        }
        for (int c = 0; c < 3; c++) {
            p[c] = rey_remesh_point(r, t[c]);
        }
        rey_remesh_normal(p, before);
        for (int c = 0; c < 3; c++) {
            if (t[c] != from && rey_remesh_distance(rey_remesh_point(r, t[c]), to) > longest) {
                return false;
            }
            p[c] = t[c] == from ? to : p[c];
        }
        rey_remesh_normal(p, after);
        for (int c = 0; c < 3; c++) {
            along += before[c] * after[c];
            size[0] += before[c] * before[c];
            size[1] += after[c] * after[c];
        }
        if (!(along > 0.5 * sqrt(size[0] * size[1]))) {
            return false;
        }
    }
    return true;
}

// Points next to both ends: two, unless the collapse would pinch the surface.
static int common_neighbours(const Remesh *r, int32_t a, int32_t b) {
    int count = 0;
    for (int32_t k = r->first[a]; k < r->first[a + 1]; k++) {
        const int32_t *t = r->mesh.triangles + 3 * (int64_t)r->around[k];
        for (int c = 0; c < 3; c++) { // around an inner point, each neighbour follows it in one triangle
            int32_t next = t[(c + 1) % 3];
            count += t[c] == a && next != b && rey_remesh_joined(r, next, b);
        }
    }
    return count;
}

static bool is_touched(const Remesh *r, int32_t point) {
    for (int32_t k = r->first[point]; k < r->first[point + 1]; k++) {
        const int32_t *t = r->mesh.triangles + 3 * (int64_t)r->around[k];
        if (r->touched[t[0]] || r->touched[t[1]] || r->touched[t[2]]) {
            return true;
        }
    }
    return false;
}

static void touch_around(Remesh *r, int32_t point) {
    for (int32_t k = r->first[point]; k < r->first[point + 1]; k++) {
        const int32_t *t = r->mesh.triangles + 3 * (int64_t)r->around[k];
        r->touched[t[0]] = r->touched[t[1]] = r->touched[t[2]] = true;
    }
}

static rey_result collapse_pass(Remesh *r, double shortest, double longest, int *changes) {
    rey_result result = rey_remesh_look(r, false);
    for (int32_t k = 0; k < r->mesh.edge_count && !result; k++) {
        const PointEdge *e = &r->mesh.edges[r->order[k]];
        if (!(rey_remesh_length(r, e->a, e->b) < shortest)) {
            break; // the shortest come first
        }
        if (r->border[e->a] || r->border[e->b] || is_touched(r, e->a) || is_touched(r, e->b) ||
            common_neighbours(r, e->a, e->b) != 2) {
            continue;
        }
        double *a = rey_remesh_point(r, e->a), to[3];
        const double *b = rey_remesh_point(r, e->b);
        for (int c = 0; c < 3; c++) {
            to[c] = 0.5 * (a[c] + b[c]);
        }
        if (!may_move(r, e->a, e->b, to, longest) || !may_move(r, e->b, e->a, to, longest)) {
            continue;
        }
        touch_around(r, e->a);
        touch_around(r, e->b);
        memcpy(a, to, sizeof to);
        for (int32_t i = r->first[e->b]; i < r->first[e->b + 1]; i++) { // triangles with two equal corners go
            int32_t *t = rey_remesh_triangle(r, r->around[i]);
            for (int c = 0; c < 3; c++) {
                t[c] = t[c] == e->b ? e->a : t[c];
            }
        }
        (*changes)++;
    }
    return result ? result : rey_remesh_compact(r);
}

/* ---- flips --------------------------------------------------------------------------------------------- */

static int strain(const Remesh *r, int32_t point, int change) {
    int off = r->degree[point] + change - (r->border[point] ? BORDER_NEIGHBOURS : NEIGHBOURS);
    return off * off;
}

// Whether (a, b, c) and (b, a, d) may become (c, d, b) and (d, c, a): no triangle turns over, and none was sharp to the other.
static bool flip_keeps_shape(const Remesh *r, const int32_t v[4]) {
    const double *p[4];
    double n[4][3];
    for (int k = 0; k < 4; k++) {
        p[k] = rey_remesh_point(r, v[k]);
    }
    const double *const old_1[3] = {p[0], p[1], p[2]}, *const old_2[3] = {p[1], p[0], p[3]};
    const double *const new_1[3] = {p[2], p[3], p[1]}, *const new_2[3] = {p[3], p[2], p[0]};
    rey_remesh_normal(old_1, n[0]);
    rey_remesh_normal(old_2, n[1]);
    rey_remesh_normal(new_1, n[2]);
    rey_remesh_normal(new_2, n[3]);
    for (int i = 0; i < 4; i++) {
        for (int j = 0; j < i; j++) {
            double along = 0, sizes[2] = {0, 0};
            for (int c = 0; c < 3; c++) {
                along += n[i][c] * n[j][c];
                sizes[0] += n[i][c] * n[i][c];
                sizes[1] += n[j][c] * n[j][c];
            }
            if (!(along > 0.7 * sqrt(sizes[0] * sizes[1]))) {
                return false;
            }
        }
    }
    return true;
}

static int32_t third(const int32_t *t, int32_t a, int32_t b) {
    return t[0] != a && t[0] != b ? t[0] : t[1] != a && t[1] != b ? t[1] : t[2];
}

static rey_result flip_pass(Remesh *r, int *changes) {
    rey_result result = rey_remesh_look(r, true);
    for (int32_t k = 0; k < r->mesh.edge_count && !result; k++) {
        const PointEdge *e = &r->mesh.edges[r->order[k]];
        if (e->triangle[1] < 0) {
            continue;
        }
        int32_t *t = rey_remesh_triangle(r, e->triangle[0]), *u = rey_remesh_triangle(r, e->triangle[1]);
        bool forward = (t[0] == e->a && t[1] == e->b) || (t[1] == e->a && t[2] == e->b) || (t[2] == e->a && t[0] == e->b);
        int32_t a = forward ? e->a : e->b, b = forward ? e->b : e->a;
        const int32_t v[4] = {a, b, third(t, a, b), third(u, a, b)};
        bool busy = r->touched[v[0]] || r->touched[v[1]] || r->touched[v[2]] || r->touched[v[3]];
        int gain = strain(r, a, 0) + strain(r, b, 0) + strain(r, v[2], 0) + strain(r, v[3], 0) - strain(r, a, -1) -
                   strain(r, b, -1) - strain(r, v[2], 1) - strain(r, v[3], 1);
        if (busy || gain <= 0 || v[2] == v[3] || rey_remesh_joined(r, v[2], v[3]) || !flip_keeps_shape(r, v)) {
            continue;
        }
        for (int c = 0; c < 4; c++) {
            touch_around(r, v[c]);
        }
        memcpy(t, (const int32_t[3]){v[2], v[3], b}, 3 * sizeof *t);
        memcpy(u, (const int32_t[3]){v[3], v[2], a}, 3 * sizeof *u);
        (*changes)++;
    }
    return result;
}

/* ---- relaxation ---------------------------------------------------------------------------------------- */

// Every inner point goes to the mean of its neighbours, but for what of that leaves the surface: x' = q + n (n . (x - q)).
static rey_result relax(Remesh *r) {
    rey_result result = rey_remesh_look(r, true);
    size_t numbers = r->points.count;
    double *moved = result ? NULL : rey_alloc_array(r->ctx, numbers, sizeof *moved);
    if (!moved) {
        return result ? result : REY_ERROR_MEMORY;
    }
    memcpy(moved, r->points.data, numbers * sizeof *moved);
    for (int32_t i = 0; i < r->mesh.point_count; i++) {
        double q[3] = {0, 0, 0}, n[3] = {0, 0, 0}, square = 0, along = 0;
        const double *x = rey_remesh_point(r, i);
        int32_t count = r->first[i + 1] - r->first[i];
        for (int32_t k = r->first[i]; k < r->first[i + 1] && !r->border[i]; k++) {
            const int32_t *t = r->mesh.triangles + 3 * (int64_t)r->around[k];
            const double *p[3];
            double normal[3];
            for (int c = 0; c < 3; c++) {
                p[c] = rey_remesh_point(r, t[c]);
            }
            rey_remesh_normal(p, normal);
            for (int c = 0; c < 3; c++) { // each neighbour stands in two triangles
                n[c] += normal[c];
                q[c] += (p[0][c] + p[1][c] + p[2][c] - x[c]) / (2.0 * count);
            }
        }
        for (int c = 0; c < 3; c++) {
            square += n[c] * n[c];
            along += n[c] * (x[c] - q[c]);
        }
        for (int c = 0; c < 3 && square > 0; c++) {
            moved[3 * i + c] = q[c] + n[c] * along / square;
        }
    }
    memcpy(r->points.data, moved, numbers * sizeof *moved);
    rey_free(r->ctx, moved);
    return REY_OK;
}

static rey_result round_of(Remesh *r, double edge_length) {
    double longest = edge_length * 4 / 3, shortest = edge_length * 4 / 5;
    rey_result result = REY_OK;
    int changes = 1;
    for (int pass = 0; pass < MOST_PASSES && changes && !result; pass++) {
        changes = 0;
        result = split_pass(r, longest, &changes);
    }
    changes = 1;
    for (int pass = 0; pass < MOST_PASSES && changes && !result; pass++) {
        changes = 0;
        result = collapse_pass(r, shortest, longest, &changes);
    }
    changes = 1;
    for (int pass = 0; pass < MOST_PASSES && changes && !result; pass++) {
        changes = 0;
        result = flip_pass(r, &changes);
    }
    return result ? result : relax(r);
}

static rey_result take_mesh(Remesh *r, rey_mesh *out) {
    size_t points = r->points.count, corners = r->triangles.count;
    *out = (rey_mesh){.vertex_count = (int64_t)(points / 3), .face_count = (int64_t)(corners / 3)};
    out->positions = rey_alloc_array(r->ctx, points, sizeof *out->positions);
    out->faces = rey_alloc_array(r->ctx, corners, sizeof *out->faces);
    if (!out->positions || !out->faces) {
        return REY_ERROR_MEMORY;
    }
    for (size_t i = 0; i < points; i++) {
        out->positions[i] = (float)ARRAY_AT(r->points, double, i);
    }
    for (size_t i = 0; i < corners; i++) {
        out->faces[i] = (uint32_t)ARRAY_AT(r->triangles, int32_t, i);
    }
    return rey_mesh_weld(r->ctx, out);
}

double rey_remesh_estimate(const PointMesh *mesh, const double *points, double edge_length) {
    double split = 0;
    for (int32_t k = 0; k < mesh->edge_count; k++) {
        double length = rey_remesh_distance(points + 3 * mesh->edges[k].a, points + 3 * mesh->edges[k].b);
        split += length > edge_length * 4 / 3 ? length : 0;
    }
    double equilateral = sqrt(3) / 4 * edge_length * edge_length;
    return fmax(rey_point_mesh_area(mesh, points) / equilateral, split / edge_length);
}

rey_result rey_remesh(rey_context *ctx, const PointMesh *mesh, const double *points, RemeshDef def, rey_mesh *out) {
    Remesh r = {.ctx = ctx, .def = def};
    *out = (rey_mesh){0};
    rey_result result = rey_remesh_open(&r, mesh, points);
    for (int i = 0; i < def.rounds && !result; i++) {
        result = round_of(&r, def.edge_length);
    }
    if (!result) {
        result = take_mesh(&r, out);
    }
    remesh_close(&r);
    if (result) {
        rey_mesh_free(ctx, out);
    }
    return result;
}
