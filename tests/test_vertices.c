// test_vertices.c: vertices as unknowns: welding, preconditioning, regularisers, remeshing.
#include "fit/optimizer.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { SIDE = 5, POINTS = SIDE * SIDE, SEAM = 3, VERTICES = POINTS + SEAM, TRIANGLES = 2 * (SIDE - 1) * (SIDE - 1) };

// A bumpy sheet of 5 x 5 points, the last three vertices of which are copies of others, as a seam leaves them.
typedef struct Sheet {
    rey_context *ctx;
    float positions[3 * VERTICES];
    int32_t welded[VERTICES], indices[3 * TRIANGLES];
    Vertices *vertices;
} Sheet;

static void make_sheet(Sheet *s, double smoothness, Regularisers weights) {
    const int32_t copied[SEAM] = {7, 12, 17};
    for (int i = 0; i < VERTICES; i++) {
        int at = i < POINTS ? i : copied[i - POINTS];
        double x = at % SIDE, y = at / SIDE;
        s->welded[i] = at;
        s->positions[3 * i] = (float)(x + 0.1 * sin(3.0 * at));
        s->positions[3 * i + 1] = (float)(1.2 * y + 0.1 * cos(5.0 * at));
        s->positions[3 * i + 2] = (float)(0.4 * sin(1.7 * x + y) + 0.1 * sin(11.0 * at));
    }
    int n = 0;
    for (int y = 0; y + 1 < SIDE; y++) {
        for (int x = 0; x + 1 < SIDE; x++) {
            int32_t a = y * SIDE + x, quad[6] = {a, a + 1, a + SIDE, a + 1, a + SIDE + 1, a + SIDE};
            for (int k = 0; k < 6; k++) { // right of the seam its copies stand
                int32_t v = quad[k];
                bool right = x >= 2 && v < POINTS && (v == 7 || v == 12 || v == 17);
                s->indices[n++] = right ? POINTS + (v - 7) / SIDE : v;
            }
        }
    }
    rey_context_def def = rey_default_context_def();
    def.threads = 1;
    assert_int_equal(rey_context_create(&def, &s->ctx), REY_OK);
    assert_int_equal(rey_vertices_create(s->ctx, VERTICES, s->welded, TRIANGLES, s->indices, smoothness, weights,
                                         &s->vertices), REY_OK);
}

static void free_sheet(Sheet *s) {
    rey_vertices_free(s->ctx, s->vertices);
    rey_context_destroy(s->ctx);
}

static void test_points_and_edges(void **state) {
    UNUSED(state);
    Sheet s;
    make_sheet(&s, 1, (Regularisers){0, 0, 0});
    const PointMesh *mesh = &s.vertices->mesh;
    assert_int_equal(mesh->point_count, POINTS);
    assert_int_equal(mesh->edge_count, POINTS + TRIANGLES - 1); // Euler: a disk
    int inside = 0;
    for (int32_t k = 0; k < mesh->edge_count; k++) {
        inside += mesh->edges[k].triangle[1] >= 0;
    }
    assert_int_equal(inside, mesh->edge_count - 4 * (SIDE - 1));
    free_sheet(&s);
}

// M^-1 M = 1, and M itself at one point: 1 + lambda times the number of neighbours, minus lambda for each of them.
static void test_laplacian_solves(void **state) {
    UNUSED(state);
    Sheet s;
    double x[3 * POINTS], u[3 * POINTS], back[3 * POINTS];
    make_sheet(&s, 7, (Regularisers){0, 0, 0});
    for (int i = 0; i < 3 * POINTS; i++) {
        x[i] = sin(i * i);
    }
    rey_laplacian_multiply(s.vertices->laplacian, x, u);
    double expected = x[0] + 7 * (2 * x[0] - x[3] - x[3 * SIDE]); // the first corner has two neighbours
    assert_float_equal(u[0], expected, 1e-12);
    rey_laplacian_solve(s.vertices->laplacian, u, back);
    for (int i = 0; i < 3 * POINTS; i++) {
        assert_float_equal(back[i], x[i], 1e-11);
    }
    free_sheet(&s);
}

// d (w . value) / d variable by differences: values are linear in the variables.
static void test_gradient_of_variables(void **state) {
    UNUSED(state);
    Sheet s;
    double variable[3 * VERTICES], gradient[3 * VERTICES], weights[3 * VERTICES];
    float value[3 * VERTICES];
    make_sheet(&s, 3, (Regularisers){0, 0, 0});
    s.positions[3 * POINTS] += 0.25f; // a start that tears the seam is sewn
    rey_vertices_begin(s.vertices, s.positions, variable);
    rey_vertices_follow(s.vertices, variable, value);
    for (int i = 0; i < 3 * VERTICES; i++) {
        assert_float_equal((double)value[i], (double)s.positions[i], 1e-5);
        weights[i] = gradient[i] = cos(2 * i + 1.0);
    }
    rey_vertices_gradient(s.vertices, gradient);
    for (int i = 0; i < 3 * VERTICES; i++) {
        double quotient = 0, held = variable[i];
        for (int sign = -1; sign <= 1; sign += 2) {
            variable[i] = held + sign * 0.5;
            rey_vertices_follow(s.vertices, variable, value);
            for (int k = 0; k < 3 * VERTICES; k++) {
                quotient += sign * weights[k] * (double)value[k];
                assert_true(value[k] == value[3 * s.welded[k / 3] + k % 3]);
            }
        }
        variable[i] = held;
        assert_float_equal(gradient[i], quotient, 2e-5);
        assert_true(i < 3 * POINTS || gradient[i] == 0);
    }
    free_sheet(&s);
}

// Each regulariser alone: its gradient against differences, and its value where that is known.
static void test_regularisers(void **state) {
    UNUSED(state);
    const Regularisers alone[] = {{2, 0, 0}, {0, 2, 0}, {0, 0, 2}};
    for (int r = 0; r < 3; r++) {
        Sheet s;
        double variable[3 * VERTICES], gradient[3 * VERTICES] = {0}, scratch[3 * VERTICES];
        make_sheet(&s, 0, alone[r]);
        rey_vertices_begin(s.vertices, s.positions, variable);
        assert_true(rey_vertices_regularise(s.vertices, s.positions, gradient) > 1e-3);
        for (int i = 0; i < 3 * POINTS; i++) {
            double quotient = 0;
            float held = s.positions[i];
            const float h = 1.0f / 256;
            for (int sign = -1; sign <= 1; sign += 2) {
                s.positions[i] = held + (float)sign * h;
                quotient += sign * rey_vertices_regularise(s.vertices, s.positions, scratch) / (2 * (double)h);
            }
            s.positions[i] = held;
            assert_float_equal(gradient[i], quotient, 2e-4 * (1 + fabs(quotient)));
        }
        for (int i = 0; i < 3 * VERTICES; i++) { // a flat sheet has equal normals
            s.positions[i] = i % 3 == 2 ? 0 : s.positions[i];
        }
        double flat = rey_vertices_regularise(s.vertices, s.positions, scratch);
        assert_true(r == 2 ? fabs(flat) < 1e-12 : flat > 1e-3);
        free_sheet(&s);
    }
}

// Uniform Adam takes the gradient's own direction: entries keep their proportions, the largest moves by the rate.
static void test_uniform_steps(void **state) {
    UNUSED(state);
    Unknown item = {.count = 3, .low = -INFINITY, .high = INFINITY, .moment = MOMENT_UNIFORM};
    float start[3] = {0, 0, 0}, value[3];
    double variable[3], first[3] = {0}, second[3] = {0}, average[3] = {0}, gradient[3] = {4, -1, 0.5};
    Unknowns u = {.items = {&item, 1, 1}, .count = 3, .start = start, .value = value, .variable = variable,
                  .first = first, .second = second, .average = average, .gradient = gradient};
    JobOptimizer o = {.kind = OPTIMIZER_ADAM, .learning_rate = 0.1, .beta1 = 0.9, .beta2 = 0.99, .schedule = {.length = 1}};
    rey_unknowns_begin(&u);
    rey_optimizer_step(&o, &u, 0, 0);
    assert_float_equal((double)value[0], -0.1, 1e-6);
    assert_float_equal((double)value[1], 0.025, 1e-6);
    assert_float_equal((double)value[2], -0.0125, 1e-6);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_points_and_edges),   cmocka_unit_test(test_laplacian_solves),
        cmocka_unit_test(test_gradient_of_variables), cmocka_unit_test(test_regularisers),
        cmocka_unit_test(test_uniform_steps),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
