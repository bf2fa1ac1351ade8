// test_remesh.c: remeshing keeps shape and topology and evens out edges; distances of surfaces.
#include "fit/chamfer.h"
#include "fit/remesh.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { RINGS = 24, SEGMENTS = 40, POINTS = 2 + (RINGS - 1) * SEGMENTS, TRIANGLES = 2 * SEGMENTS * (RINGS - 1) };

// A ball of rings, whose triangles are slivers at the poles; one third of it in z for the border of a bowl.
typedef struct Ball {
    rey_context *ctx;
    double points[3 * POINTS];
    int32_t welded[POINTS], indices[3 * TRIANGLES];
    PointMesh mesh;
} Ball;

static int32_t ring_point(int ring, int segment) {
    return ring == 0 ? 0 : ring == RINGS ? 1 : 2 + (ring - 1) * SEGMENTS + segment % SEGMENTS;
}

static void make_ball(Ball *b, int triangles) {
    for (int ring = 0; ring <= RINGS; ring++) {
        for (int k = 0; k < SEGMENTS; k++) {
            double height = 3.14159265358979 * ring / RINGS, turn = 2 * 3.14159265358979 * k / SEGMENTS;
            double *p = b->points + 3 * ring_point(ring, k);
            p[0] = sin(height) * cos(turn);
            p[1] = sin(height) * sin(turn);
            p[2] = cos(height);
        }
    }
    int n = 0;
    for (int ring = 0; ring < RINGS; ring++) {
        for (int k = 0; k < SEGMENTS; k++) {
            int32_t corners[4] = {ring_point(ring, k), ring_point(ring + 1, k), ring_point(ring + 1, k + 1),
                                  ring_point(ring, k + 1)};
            for (int t = 0; t < 2; t++) {
                int32_t triangle[3] = {corners[0], corners[1 + t], corners[2 + t]};
                if (triangle[0] != triangle[1] && triangle[1] != triangle[2] && triangle[2] != triangle[0]) {
                    memcpy(b->indices + n, triangle, sizeof triangle);
                    n += 3;
                }
            }
        }
    }
    assert_int_equal(n, 3 * TRIANGLES);
    for (int32_t i = 0; i < POINTS; i++) {
        b->welded[i] = i;
    }
    rey_context_def def = rey_default_context_def();
    def.threads = 1;
    assert_int_equal(rey_context_create(&def, &b->ctx), REY_OK);
    assert_int_equal(rey_point_mesh_create(b->ctx, POINTS, b->welded, triangles, b->indices, &b->mesh), REY_OK);
}

static void free_ball(Ball *b) {
    rey_point_mesh_free(b->ctx, &b->mesh);
    rey_context_destroy(b->ctx);
}

typedef struct Facts {
    int borders, many; // edges of one triangle, of more than two
    int64_t euler;     // points - edges + triangles
    double shortest, longest, volume;
} Facts;

static Facts facts_of(Ball *b, const rey_mesh *mesh) {
    PointMesh m;
    Facts f = {.shortest = INFINITY};
    int32_t *same = malloc((size_t)mesh->vertex_count * sizeof *same);
    assert_non_null(same);
    for (int64_t i = 0; i < mesh->vertex_count; i++) {
        same[i] = (int32_t)i;
    }
    assert_int_equal(rey_point_mesh_create(b->ctx, (int32_t)mesh->vertex_count, same, (int32_t)mesh->face_count,
                                           (const int32_t *)mesh->faces, &m), REY_OK);
    for (int32_t k = 0; k < m.edge_count; k++) {
        const PointEdge *e = &m.edges[k];
        double square = 0;
        for (int c = 0; c < 3; c++) {
            double d = (double)mesh->positions[3 * e->a + c] - (double)mesh->positions[3 * e->b + c];
            square += d * d;
        }
        f.shortest = fmin(f.shortest, sqrt(square));
        f.longest = fmax(f.longest, sqrt(square));
        f.borders += e->triangle[0] >= 0 && e->triangle[1] < 0;
        f.many += e->triangle[0] < 0;
    }
    for (int64_t t = 0; t < mesh->face_count; t++) {
        const float *p[3];
        for (int c = 0; c < 3; c++) {
            p[c] = mesh->positions + 3 * (int64_t)mesh->faces[3 * t + c];
        }
        for (int c = 0; c < 3; c++) {
            int i = (c + 1) % 3, j = (c + 2) % 3;
            f.volume += (double)p[0][c] * ((double)p[1][i] * (double)p[2][j] - (double)p[1][j] * (double)p[2][i]) / 6;
        }
    }
    f.euler = m.point_count - m.edge_count + m.triangle_count;
    rey_point_mesh_free(b->ctx, &m);
    free(same);
    return f;
}

// Coarser, as it is, and finer: a closed surface stays one, its volume hardly changes, and its edges become alike.
static void test_ball_stays_a_ball(void **state) {
    UNUSED(state);
    const double lengths[] = {0.3, 0.15, 0.07};
    for (int i = 0; i < COUNT_OF(lengths); i++) {
        Ball b;
        rey_mesh mesh, again;
        make_ball(&b, TRIANGLES);
        assert_int_equal(rey_remesh(b.ctx, &b.mesh, b.points, (RemeshDef){lengths[i], 5, NULL, NULL}, &mesh), REY_OK);
        Facts f = facts_of(&b, &mesh);
        print_message("edge %g: %d points, edges %.3f to %.3f, volume %.3f\n", lengths[i], (int)mesh.vertex_count, f.shortest,
                      f.longest, f.volume);
        assert_int_equal(f.borders, 0);
        assert_int_equal(f.many, 0);
        assert_int_equal(f.euler, 2);
        assert_true(f.shortest > 0.5 * lengths[i] && f.longest < 1.7 * lengths[i]);
        assert_float_equal(f.volume, 4.18879, 0.2 + lengths[i]);
        // About as many as equilateral triangles of this size would need: points = 4 pi / (sqrt(3) / 2 l^2).
        double expected = 4 * 3.14159265 / (0.8660254 * lengths[i] * lengths[i]);
        assert_true((double)mesh.vertex_count > 0.7 * expected && (double)mesh.vertex_count < 1.5 * expected);
        double estimate = rey_remesh_estimate(&b.mesh, b.points, lengths[i]);
        assert_true((double)mesh.face_count > 0.7 * estimate && (double)mesh.face_count < 1.5 * estimate);
        const RemeshDef same = {lengths[i], 5, NULL, NULL};
        assert_int_equal(rey_remesh(b.ctx, &b.mesh, b.points, same, &again), REY_OK); // to the bit
        assert_int_equal(again.vertex_count, mesh.vertex_count);
        assert_memory_equal(again.positions, mesh.positions, 3 * (size_t)mesh.vertex_count * sizeof(float));
        rey_mesh_free(b.ctx, &mesh);
        rey_mesh_free(b.ctx, &again);
        free_ball(&b);
    }
}

// A bowl keeps its border: every point of it stays where it was.
static void test_border_stays(void **state) {
    UNUSED(state);
    Ball b;
    rey_mesh mesh;
    const int half = SEGMENTS * (RINGS - 1);
    make_ball(&b, half);
    assert_int_equal(rey_remesh(b.ctx, &b.mesh, b.points, (RemeshDef){0.1, 5, NULL, NULL}, &mesh), REY_OK);
    Facts f = facts_of(&b, &mesh);
    assert_int_equal(f.euler, 1);
    assert_int_equal(f.many, 0);
    assert_true(f.borders >= SEGMENTS);
    int found = 0;
    for (int k = 0; k < SEGMENTS; k++) {
        const double *p = b.points + 3 * ring_point(RINGS / 2, k);
        for (int64_t i = 0; i < mesh.vertex_count; i++) {
            double off = 0;
            for (int c = 0; c < 3; c++) {
                off = fmax(off, fabs((double)mesh.positions[3 * i + c] - p[c]));
            }
            found += off < 1e-6;
        }
    }
    assert_int_equal(found, SEGMENTS);
    rey_mesh_free(b.ctx, &mesh);
    free_ball(&b);
}

static bool count_down(void *user) {
    int *left = user;
    return (*left)-- > 0;
}

// It is asked in every pass whether to go on, and leaves nothing behind where not.
static void test_remeshing_is_cancelled(void **state) {
    UNUSED(state);
    Ball b;
    rey_mesh mesh;
    make_ball(&b, TRIANGLES);
    for (int asked = 0; asked < 12; asked += 3) {
        int left = asked;
        assert_int_equal(rey_remesh(b.ctx, &b.mesh, b.points, (RemeshDef){0.07, 5, count_down, &left}, &mesh),
                         REY_ERROR_CANCELLED);
        assert_int_equal(left, -1);
        assert_null(mesh.positions);
    }
    // What is as good as a line has no area: its edges are split all the same.
    for (int i = 0; i < POINTS; i++) {
        b.points[3 * i] = b.points[3 * i + 1] = 0;
    }
    assert_true(rey_remesh_estimate(&b.mesh, b.points, 1e-6) > 1e6);
    free_ball(&b);
}

// A ball against itself, and against one that is larger by a tenth.
static void test_chamfer(void **state) {
    UNUSED(state);
    Ball b;
    float small[3 * POINTS], large[3 * POINTS];
    make_ball(&b, TRIANGLES);
    for (int i = 0; i < 3 * POINTS; i++) {
        small[i] = (float)b.points[i];
        large[i] = (float)(1.1 * b.points[i]);
    }
    const Triangles x = {small, b.indices, POINTS, TRIANGLES}, y = {large, b.indices, POINTS, TRIANGLES};
    double distance;
    assert_int_equal(rey_chamfer(b.ctx, &x, &x, &distance), REY_OK);
    assert_true(distance < 1e-7);
    assert_int_equal(rey_chamfer(b.ctx, &x, &y, &distance), REY_OK);
    assert_float_equal(distance, 0.1, 0.002);
    assert_float_equal(rey_triangles_diagonal(&x), 2 * sqrt(3.0), 0.02);
    free_ball(&b);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_ball_stays_a_ball),
        cmocka_unit_test(test_border_stays),
        cmocka_unit_test(test_remeshing_is_cancelled),
        cmocka_unit_test(test_chamfer),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
