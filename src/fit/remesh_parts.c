// remesh_parts.c: what is around the points of a mesh that changes.
#include "fit/remesh_parts.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

rey_result rey_remesh_open(Remesh *r, const PointMesh *mesh, const double *points) {
    size_t numbers = 3 * (size_t)mesh->point_count, corners = 3 * (size_t)mesh->triangle_count;
    double *p = rey_array_push(r->ctx, &r->points, sizeof *p, numbers);
    int32_t *t = p ? rey_array_push(r->ctx, &r->triangles, sizeof *t, corners) : NULL;
    if (!t) {
        return REY_ERROR_MEMORY;
    }
    memcpy(p, points, numbers * sizeof *p);
    memcpy(t, mesh->triangles, corners * sizeof *t);
    return rey_remesh_compact(r);
}

void rey_remesh_forget(Remesh *r) {
    void *blocks[] = {r->order, r->first, r->around, r->degree, r->border, r->touched, r->touched_triangle};
    for (int i = 0; i < COUNT_OF(blocks); i++) {
        rey_free(r->ctx, blocks[i]);
    }
    r->order = r->first = r->around = r->degree = NULL;
    r->border = r->touched = r->touched_triangle = NULL;
    rey_point_mesh_free(r->ctx, &r->mesh);
}

double *rey_remesh_point(const Remesh *r, int32_t point) {
    return (double *)r->points.data + 3 * (int64_t)point;
}

int32_t *rey_remesh_triangle(const Remesh *r, int32_t triangle) {
    return (int32_t *)r->triangles.data + 3 * (int64_t)triangle;
}

double rey_remesh_distance(const double *a, const double *b) {
    double x = a[0] - b[0], y = a[1] - b[1], z = a[2] - b[2];
    return sqrt(x * x + y * y + z * z);
}

double rey_remesh_length(const Remesh *r, int32_t a, int32_t b) {
    return rey_remesh_distance(rey_remesh_point(r, a), rey_remesh_point(r, b));
}

bool rey_remesh_joined(const Remesh *r, int32_t a, int32_t b) {
    for (int32_t k = r->first[a]; k < r->first[a + 1]; k++) {
        const int32_t *t = r->mesh.triangles + 3 * (int64_t)r->around[k];
        if (t[0] == b || t[1] == b || t[2] == b) {
            return true;
        }
    }
    return false;
}

void rey_remesh_normal(const double *const p[3], double n[3]) {
    double ab[3], ac[3];
    for (int c = 0; c < 3; c++) {
        ab[c] = p[1][c] - p[0][c];
        ac[c] = p[2][c] - p[0][c];
    }
    for (int c = 0; c < 3; c++) {
        int i = (c + 1) % 3, j = (c + 2) % 3;
        n[c] = ab[i] * ac[j] - ab[j] * ac[i];
    }
}

typedef struct Length {
    double length;
    int32_t edge;
} Length;

static int compare_lengths(const void *a, const void *b) {
    const Length *x = a, *y = b;
    if (x->length < y->length || x->length > y->length) {
        return x->length < y->length ? -1 : 1;
    }
    return (x->edge > y->edge) - (x->edge < y->edge);
}

static rey_result sort_edges(Remesh *r, bool longest_first) {
    int32_t n = r->mesh.edge_count;
    Length *lengths = rey_alloc_array(r->ctx, (size_t)n, sizeof *lengths);
    if (!lengths) {
        return REY_ERROR_MEMORY;
    }
    for (int32_t k = 0; k < n; k++) {
        double length = rey_remesh_length(r, r->mesh.edges[k].a, r->mesh.edges[k].b);
        lengths[k] = (Length){longest_first ? -length : length, k};
    }
    qsort(lengths, (size_t)n, sizeof *lengths, compare_lengths);
    for (int32_t k = 0; k < n; k++) {
        r->order[k] = lengths[k].edge;
    }
    rey_free(r->ctx, lengths);
    return REY_OK;
}

static void find_neighbours(Remesh *r) {
    const PointMesh *m = &r->mesh;
    for (int32_t i = 0; i < 3 * m->triangle_count; i++) {
        r->first[m->triangles[i] + 1]++;
    }
    for (int32_t i = 0; i < m->point_count; i++) {
        r->first[i + 1] += r->first[i];
        r->degree[i] = r->first[i]; // where its next triangle goes
    }
    for (int32_t i = 0; i < 3 * m->triangle_count; i++) {
        r->around[r->degree[m->triangles[i]]++] = i / 3;
    }
    memset(r->degree, 0, (size_t)m->point_count * sizeof *r->degree);
    for (int32_t k = 0; k < m->edge_count; k++) {
        const PointEdge *e = &m->edges[k];
        r->degree[e->a]++;
        r->degree[e->b]++;
        if (e->triangle[1] < 0) {
            r->border[e->a] = r->border[e->b] = true;
        }
    }
}

rey_result rey_remesh_look(Remesh *r, bool longest_first) {
    size_t points = r->points.count / 3, triangles = r->triangles.count / 3;
    if (points > INT32_MAX / 16 || triangles > INT32_MAX / 16) {
        return rey_fail(r->ctx, REY_ERROR_UNSUPPORTED, "remeshing has come to %lld triangles: the edge length is too small",
                        (long long)triangles);
    }
    if (r->def.go_on && !r->def.go_on(r->def.user)) {
        return rey_fail(r->ctx, REY_ERROR_CANCELLED, "remeshing was cancelled");
    }
    rey_remesh_forget(r);
    int32_t *same = rey_alloc_array(r->ctx, points, sizeof *same);
    for (size_t i = 0; same && i < points; i++) {
        same[i] = (int32_t)i;
    }
    rey_result result = same ? rey_point_mesh_create(r->ctx, (int32_t)points, same, (int32_t)triangles, r->triangles.data,
                                                     &r->mesh)
                             : REY_ERROR_MEMORY;
    rey_free(r->ctx, same);
    r->order = rey_alloc_array(r->ctx, (size_t)r->mesh.edge_count, sizeof *r->order);
    r->first = rey_alloc_array(r->ctx, points + 1, sizeof *r->first);
    r->around = rey_alloc_array(r->ctx, 3 * triangles, sizeof *r->around);
    r->degree = rey_alloc_array(r->ctx, points, sizeof *r->degree);
    r->border = rey_alloc_array(r->ctx, points, sizeof *r->border);
    r->touched = rey_alloc_array(r->ctx, points, sizeof *r->touched);
    r->touched_triangle = rey_alloc_array(r->ctx, triangles, sizeof *r->touched_triangle);
    bool had = r->order && r->first && r->around && r->degree && r->border && r->touched && r->touched_triangle;
    if (result || !had) {
        return result ? result : REY_ERROR_MEMORY;
    }
    find_neighbours(r);
    return sort_edges(r, longest_first);
}

rey_result rey_remesh_compact(Remesh *r) {
    size_t points = r->points.count / 3, kept = 0, count = 0;
    int32_t *number = rey_alloc_array(r->ctx, points, sizeof *number), *t = r->triangles.data;
    double *p = r->points.data;
    if (!number) {
        return REY_ERROR_MEMORY;
    }
    for (size_t i = 0; i + 2 < r->triangles.count; i += 3) {
        if (t[i] != t[i + 1] && t[i + 1] != t[i + 2] && t[i + 2] != t[i]) {
            memmove(t + kept, t + i, 3 * sizeof *t);
            kept += 3;
        }
    }
    r->triangles.count = kept;
    for (size_t i = 0; i < kept; i++) {
        number[t[i]] = 1;
    }
    for (size_t i = 0; i < points; i++) {
        if (number[i]) {
            memmove(p + 3 * count, p + 3 * i, 3 * sizeof *p);
            number[i] = (int32_t)count++;
        }
    }
    r->points.count = 3 * count;
    for (size_t i = 0; i < kept; i++) {
        t[i] = number[t[i]];
    }
    rey_free(r->ctx, number);
    return REY_OK;
}
