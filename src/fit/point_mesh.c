// point_mesh.c: meshes as points, triangles and edges.
#include "fit/point_mesh.h"

#include <math.h>
#include <stdlib.h>

typedef struct Side { // of a triangle
    int32_t a, b, triangle;
} Side;

static int compare_sides(const void *left, const void *right) {
    const Side *x = left, *y = right;
    if (x->a != y->a) {
        return x->a < y->a ? -1 : 1;
    }
    if (x->b != y->b) {
        return x->b < y->b ? -1 : 1;
    }
    return (x->triangle > y->triangle) - (x->triangle < y->triangle);
}

static void number_points(PointMesh *m, const int32_t *welded) {
    for (int32_t v = 0; v < m->vertex_count; v++) {
        if (welded[v] == v) {
            m->vertex[m->point_count] = v;
            m->point[v] = m->point_count++;
        } else {
            m->point[v] = m->point[welded[v]];
        }
    }
}

static void join_sides(const Side *sides, int32_t count, PointMesh *m) {
    for (int32_t i = 0, end; i < count; i = end) {
        end = i + 1;
        while (end < count && sides[end].a == sides[i].a && sides[end].b == sides[i].b) {
            end++;
        }
        if (sides[i].a == sides[i].b) {
            continue; // of a triangle without area
        }
        PointEdge *e = &m->edges[m->edge_count++];
        *e = (PointEdge){sides[i].a, sides[i].b, {-1, -1}};
        for (int32_t k = 0; k < end - i && end - i <= 2; k++) {
            e->triangle[k] = sides[i + k].triangle;
        }
    }
}

static rey_result find_edges(rey_context *ctx, PointMesh *m) {
    size_t count = 3 * (size_t)m->triangle_count;
    Side *sides = rey_alloc_array(ctx, count, sizeof *sides);
    m->edges = rey_alloc_array(ctx, count, sizeof *m->edges);
    if (!sides || !m->edges) {
        rey_free(ctx, sides);
        return REY_ERROR_MEMORY;
    }
    for (size_t i = 0; i < count; i++) {
        int32_t a = m->triangles[i], b = m->triangles[i / 3 * 3 + (i + 1) % 3];
        sides[i] = (Side){a < b ? a : b, a < b ? b : a, (int32_t)(i / 3)};
    }
    qsort(sides, count, sizeof *sides, compare_sides);
    join_sides(sides, (int32_t)count, m);
    rey_free(ctx, sides);
    return REY_OK;
}

rey_result rey_point_mesh_create(rey_context *ctx, int32_t vertex_count, const int32_t *welded, int32_t triangle_count,
                                 const int32_t *indices, PointMesh *out) {
    *out = (PointMesh){.vertex_count = vertex_count, .triangle_count = triangle_count};
    if (triangle_count > INT32_MAX / 3) {
        return rey_fail(ctx, REY_ERROR_UNSUPPORTED, "a mesh of %d triangles, expected at most %d", (int)triangle_count,
                        INT32_MAX / 3);
    }
    out->point = rey_alloc_array(ctx, (size_t)vertex_count, sizeof *out->point);
    out->vertex = rey_alloc_array(ctx, (size_t)vertex_count, sizeof *out->vertex);
    out->triangles = rey_alloc_array(ctx, 3 * (size_t)triangle_count, sizeof *out->triangles);
    if (!out->point || !out->vertex || !out->triangles) {
        return REY_ERROR_MEMORY;
    }
    number_points(out, welded);
    for (int32_t i = 0; i < 3 * triangle_count; i++) {
        out->triangles[i] = out->point[indices[i]];
    }
    return find_edges(ctx, out);
}

double rey_point_mesh_area(const PointMesh *mesh, const double *points) {
    double area = 0;
    for (int32_t i = 0; i < mesh->triangle_count; i++) {
        const int32_t *t = mesh->triangles + 3 * (int64_t)i;
        double ab[3], ac[3], square = 0;
        for (int c = 0; c < 3; c++) {
            ab[c] = points[3 * t[1] + c] - points[3 * t[0] + c];
            ac[c] = points[3 * t[2] + c] - points[3 * t[0] + c];
        }
        for (int c = 0; c < 3; c++) {
            double across = ab[(c + 1) % 3] * ac[(c + 2) % 3] - ab[(c + 2) % 3] * ac[(c + 1) % 3];
            square += across * across;
        }
        area += sqrt(square) / 2;
    }
    return area;
}

void rey_point_mesh_free(rey_context *ctx, PointMesh *mesh) {
    rey_free(ctx, mesh->point);
    rey_free(ctx, mesh->vertex);
    rey_free(ctx, mesh->triangles);
    rey_free(ctx, mesh->edges);
    *mesh = (PointMesh){0};
}
