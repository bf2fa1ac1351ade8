// Smooth normals that follow their vertices: adjoint and motion against differences of fourth order, on meshes with seams,
// thin faces and faces without area.
#include "shape/normals.h"

#include "reynolds/reynolds.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include <cmocka.h>

enum { VERTICES = 8, FACES = 7, NUMBERS = 3 * VERTICES };

// A fan around vertex 0, whose twin is vertex 7; the last face has no area.
static const uint32_t faces[3 * FACES] = {0, 1, 2, 0, 2, 3, 7, 3, 4, 0, 4, 5, 7, 5, 1, 1, 6, 2, 6, 6, 3};
static const uint32_t welded[VERTICES] = {0, 1, 2, 3, 4, 5, 6, 0};

// splitmix64, between -1 and 1
static double uniform(uint64_t *state) {
    uint64_t z = (*state += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return (double)((z ^ (z >> 31)) >> 11) * 0x1p-52 - 1;
}

// A bent disk of random corners, in multiples of 2^-12: steps of that size are exact.
static void make_positions(uint64_t *random, float *p) {
    for (int i = 0; i < VERTICES; i++) {
        double angle = 6.283185307179586 * (i - 1) / 5, r = i % 7 == 0 ? 0 : i == 6 ? 2 : 1;
        double at[3] = {r * cos(angle), r * sin(angle), 0};
        for (int k = 0; k < 3; k++) {
            p[3 * i + k] = (float)(floor(4096 * (at[k] + 0.3 * uniform(random))) / 4096);
        }
    }
    for (int k = 0; k < 3; k++) {
        p[21 + k] = p[k];
    }
}

// The unit normals of all vertices.
static void normals_of(const float *p, double *normals) {
    double sums[NUMBERS];
    MeshView mesh = {p, faces, welded, VERTICES, FACES};
    rey_normal_sums(&mesh, sums);
    for (int i = 0; i < VERTICES; i++) {
        const double *s = sums + 3 * welded[i];
        double length = sqrt(s[0] * s[0] + s[1] * s[1] + s[2] * s[2]);
        for (int k = 0; k < 3; k++) {
            normals[3 * i + k] = s[k] / length;
        }
    }
}

// Derivative of all normals as position number `at` moves; the twin stays where it is.
static void difference(const float *p, int at, double *out) {
    static const double weights[5] = {1 / 12.0, -8 / 12.0, 0, 8 / 12.0, -1 / 12.0};
    for (int i = 0; i < NUMBERS; i++) {
        out[i] = 0;
    }
    for (int step = -2; step <= 2; step++) {
        float moved[NUMBERS];
        double normals[NUMBERS];
        for (int i = 0; i < NUMBERS; i++) {
            moved[i] = p[i] + (i == at ? (float)step * 0x1p-12f : 0);
        }
        normals_of(moved, normals);
        for (int i = 0; i < NUMBERS; i++) {
            out[i] += weights[step + 2] * normals[i] * 0x1p12;
        }
    }
}

static void test_normals(void **state) {
    (void)state;
    rey_context *ctx;
    uint64_t random = 3;
    assert_int_equal(rey_context_create(NULL, &ctx), REY_OK);
    for (int round = 0; round < 20; round++) {
        float p[NUMBERS], moves[NUMBERS], found[NUMBERS];
        double sums[NUMBERS], slopes[NUMBERS][NUMBERS], dnormals[NUMBERS], dpositions[NUMBERS] = {0};
        make_positions(&random, p);
        MeshView mesh = {p, faces, welded, VERTICES, FACES};
        rey_normal_sums(&mesh, sums);
        for (int i = 0; i < NUMBERS; i++) {
            moves[i] = (float)uniform(&random);
            dnormals[i] = uniform(&random);
            difference(p, i, slopes[i]);
        }
        assert_int_equal(rey_normals_adj(ctx, &mesh, sums, dnormals, dpositions), REY_OK);
        assert_int_equal(rey_normals_tangent(ctx, &mesh, moves, found), REY_OK);
        for (int i = 0; i < NUMBERS; i++) {
            double back = 0, ahead = 0;
            for (int k = 0; k < NUMBERS; k++) {
                back += dnormals[k] * slopes[i][k];
                ahead += (double)moves[k] * slopes[k][i];
            }
            if (fabs(dpositions[i] - back) > 1e-6 * (1 + fabs(back))) {
                fail_msg("adjoint of position %d: %.9g, expected %.9g", i, dpositions[i], back);
            }
            if (fabs((double)found[i] - ahead) > 1e-6 * (1 + fabs(ahead))) {
                fail_msg("motion of normal %d: %.9g, expected %.9g", i, (double)found[i], ahead);
            }
        }
    }
    rey_context_destroy(ctx);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_normals)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
