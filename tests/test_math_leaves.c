// Leaf functions: adjoints against central differences in double, and float at every width against double.
#include "math/leaf_checks.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

enum { POINTS = 4000 };

typedef struct Random {
    uint64_t state;
} Random;

// splitmix64, independent of the library's own generator.
static double uniform(Random *r) {
    uint64_t z = (r->state += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return (double)((z ^ (z >> 31)) >> 11) * 0x1p-53;
}
static double between(Random *r, double low, double high) { return low + (high - low) * uniform(r); }
static double log_between(Random *r, double low, double high) { return exp(between(r, log(low), log(high))); }

// A unit vector with cosine z; a fifth of the cosines are grazing.
static void direction(Random *r, double low, double *v) {
    double z = uniform(r) < 0.2 ? log_between(r, 1e-4, 1e-1) : between(r, 1e-3, 1);
    if (low < 0 && uniform(r) < 0.5) {
        z = -z;
    }
    double phi = between(r, 0, 6.283185307179586), s = sqrt(1 - z * z);
    v[0] = s * cos(phi);
    v[1] = s * sin(phi);
    v[2] = z;
}
static double roughness(Random *r) {
    double u = uniform(r);
    return u < 0.1 ? 1e-3 : u < 0.2 ? 1 : log_between(r, 1e-3, 1);
}

// A normal with random stretched slopes up to a few units: where the density is not negligible.
static void likely_normal(Random *r, const double *alpha, double *m) {
    double t = between(r, 0, 2.5), phi = between(r, 0, 6.283185307179586);
    double x = alpha[0] * t * cos(phi), y = alpha[1] * t * sin(phi), n = 1 / sqrt(1 + x * x + y * y);
    m[0] = x * n;
    m[1] = y * n;
    m[2] = n;
}

// The functions of numbers.
static void random_number(int leaf, Random *r, double *x) {
    switch (leaf) {
    case LEAF_EXP: x[0] = between(r, -85, 85); break;
    case LEAF_LOG: x[0] = log_between(r, 1e-37, 1e37); break;
    case LEAF_SINCOS: x[0] = between(r, -1, 1) * log_between(r, 0.1, 8000); break;
    case LEAF_ATAN2:
        x[0] = between(r, -1, 1);
        x[1] = between(r, -1, 1) * log_between(r, 1e-3, 1e3);
        break;
    case LEAF_ACOS: x[0] = between(r, -1, 1); break;
    case LEAF_ERFINV: x[0] = uniform(r) < 0.5 ? between(r, -1, 1) : 1 - log_between(r, 1e-6, 1); break;
    default: x[0] = between(r, -5, 5); break; // LEAF_ERF
    }
}

// Microfacets: roughness, then directions or random numbers.
static void random_microfacet(int leaf, Random *r, double *x, double *scale) {
    x[0] = roughness(r);
    x[1] = roughness(r);
    switch (leaf) {
    case LEAF_SAMPLE_ALL_GGX:
    case LEAF_SAMPLE_ALL_BECKMANN:
        x[2] = between(r, 0, 0.999);
        x[3] = uniform(r);
        break;
    case LEAF_D_GGX:
    case LEAF_D_BECKMANN:
        scale[0] = x[0];
        scale[1] = x[1];
        likely_normal(r, x, x + 2);
        scale[2] = x[0] * x[4];
        scale[3] = x[1] * x[4];
        scale[4] = x[4];
        break;
    default:
        scale[0] = x[0];
        scale[1] = x[1];
        direction(r, leaf == LEAF_G1_GGX || leaf == LEAF_G1_BECKMANN ? -1 : 1, x + 2);
        scale[4] = fabs(x[4]);
        scale[2] = scale[3] = 0.1;
        x[5] = between(r, 0.001, 0.999);
        x[6] = between(r, 0.001, 0.999);
        break;
    }
}

// One random input of a leaf, and for each number the length over which the function varies.
static void random_input(int leaf, Random *r, double *x, double *scale) {
    for (int j = 0; j < LEAF_MAX; j++) {
        x[j] = 0;
        scale[j] = 1;
    }
    double v[3];
    switch (leaf) {
    case LEAF_DIELECTRIC:
        direction(r, -1, v);
        x[0] = v[2];
        x[1] = uniform(r) < 0.3 ? between(r, 0.4, 0.95) : between(r, 1.05, 2.5);
        scale[0] = fabs(x[0]);
        break;
    case LEAF_CONDUCTOR:
        direction(r, 1, v);
        x[0] = v[2];
        scale[0] = fmin(x[0], 500 * (1 - x[0])); // the difference must stay below 1
        for (int j = 1; j < 7; j++) {
            scale[j] = x[j] = log_between(r, 0.03, 8);
        }
        break;
    case LEAF_DIFFUSE_REFLECTANCE:
        x[0] = uniform(r) < 0.5 ? between(r, 0.15, 0.99) : between(r, 1.01, 5);
        break;
    case LEAF_SCHLICK:
        x[0] = between(r, -0.2, 1.2);
        scale[0] = fabs(1 - x[0]);
        break;
    case LEAF_CROSS:
    case LEAF_NORMALIZE:
    case LEAF_TO_LOCAL:
        for (int j = 0; j < leaf_info[leaf].inputs; j++) {
            x[j] = between(r, 0.2, 1) * (uniform(r) < 0.5 ? -1 : 1);
        }
        break;
    case LEAF_EXP:
    case LEAF_LOG:
    case LEAF_SINCOS:
    case LEAF_ATAN2:
    case LEAF_ACOS:
    case LEAF_ERFINV:
    case LEAF_ERF:
        random_number(leaf, r, x);
        break;
    default:
        random_microfacet(leaf, r, x, scale);
        break;
    }
    for (int j = 0; j < LEAF_MAX; j++) {
        x[j] = (double)(float)x[j]; // exact in both precisions
    }
}

// dout . (leaf(x + h e_j) - leaf(x - h e_j)) / (2 h)
static double difference(int leaf, const double *x, const double *dout, int j, double h) {
    double in[2][LEAF_MAX], out[2][LEAF_MAX], sum = 0;
    memcpy(in[0], x, sizeof in[0]);
    memcpy(in[1], x, sizeof in[1]);
    in[0][j] -= h;
    in[1][j] += h;
    leaf_value_double(leaf, 2, in[0], out[0]);
    for (int k = 0; k < leaf_info[leaf].outputs; k++) {
        sum += dout[k] * (out[1][k] - out[0][k]);
    }
    return sum / (in[1][j] - in[0][j]);
}

// How many random adjoints: a leaf with many inputs must not change the cases of the others.
static int drawn(const LeafInfo *info) {
    return info->inputs > 8 ? LEAF_MAX : 8;
}

static void check_adjoint(int leaf) {
    const LeafInfo *info = &leaf_info[leaf];
    Random r = {(uint64_t)leaf + 1};
    int compared = 0, skipped = 0, nonzero[LEAF_MAX] = {0};
    for (int i = 0; i < POINTS; i++) {
        double x[LEAF_MAX], scale[LEAF_MAX], dout[LEAF_MAX] = {0}, out[LEAF_MAX];
        double start[LEAF_MAX] = {0}, din[LEAF_MAX] = {0}, size = 0;
        random_input(leaf, &r, x, scale);
        leaf_value_double(leaf, 1, x, out);
        for (int k = 0; k < info->outputs; k++) {
            dout[k] = between(&r, -1, 1);
            size += fabs(dout[k] * out[k]);
        }
        for (int j = 0; j < drawn(info); j++) {
            start[j] = din[j] = between(&r, -1, 1); // adjoints accumulate
        }
        leaf_adj_double(leaf, 1, x, dout, din);
        for (int j = 0; j < info->inputs; j++) {
            double h = 1e-3 * scale[j];
            double coarse = difference(leaf, x, dout, j, h), fine = difference(leaf, x, dout, j, 0.5 * h);
            double expected = (4 * fine - coarse) / 3, got = din[j] - start[j];
            if (fabs(fine - coarse) > 1e-4 * (fabs(fine) + size / scale[j])) {
                skipped++; // the differences straddle a kink or a singularity
                continue;
            }
            compared++;
            nonzero[j] += fabs(got) > 1e-3 * size / scale[j];
            double allowed = 1e-6 * fabs(expected) + 1e-7 * size / scale[j] + 1e-14 * fabs(start[j]);
            if (fabs(got - expected) > allowed) {
                fail_msg("%s, input %d at (%g %g %g %g %g): adjoint %.10g, central difference %.10g", info->name, j, x[0],
                         x[1], x[2], x[3], x[4], got, expected);
            }
        }
    }
    if (skipped * 20 > compared) {
        fail_msg("%s: %d of %d differences were not usable", info->name, skipped, compared + skipped);
    }
    for (int j = 0; j < info->inputs; j++) {
        if (nonzero[j] < POINTS / 50) {
            fail_msg("%s: the derivative with respect to input %d is hardly ever non-zero", info->name, j);
        }
    }
}

static void test_adjoints(void **state) {
    (void)state;
    for (int leaf = 0; leaf < LEAF_COUNT; leaf++) {
        if (leaf_info[leaf].has_adjoint) {
            check_adjoint(leaf);
        }
    }
}

static void check_width(int leaf, leaf_value_fn *value, leaf_adj_fn *adj, const char *width) {
    static double in[POINTS][LEAF_MAX], dout[POINTS][LEAF_MAX], out[2][POINTS][LEAF_MAX], din[2][POINTS][LEAF_MAX];
    const LeafInfo *info = &leaf_info[leaf];
    Random r = {(uint64_t)leaf + 100};
    double scale[LEAF_MAX], worst = 0, worst_adj = 0;
    for (int i = 0; i < POINTS; i++) {
        random_input(leaf, &r, in[i], scale);
        for (int j = 0; j < LEAF_MAX; j++) {
            dout[i][j] = j < drawn(info) ? (double)(float)between(&r, -1, 1) : 0;
            din[0][i][j] = din[1][i][j] = 0;
        }
    }
    leaf_value_double(leaf, POINTS, in[0], out[0][0]);
    value(leaf, POINTS, in[0], out[1][0]);
    leaf_adj_double(leaf, POINTS, in[0], dout[0], din[0][0]);
    adj(leaf, POINTS, in[0], dout[0], din[1][0]);
    for (int i = 0; i < POINTS; i++) {
        double size = 1e-30;
        for (int j = 0; j < info->inputs; j++) {
            size = fmax(size, fabs(din[0][i][j]));
        }
        for (int j = 0; j < info->outputs; j++) {
            double error = fabs(out[1][i][j] - out[0][i][j]);
            double allowed = info->relative * fabs(out[0][i][j]) + info->absolute;
            worst = fmax(worst, error / allowed);
            if (!(error <= allowed)) {
                fail_msg("%s, %s, output %d at (%.9g %.9g %.9g %.9g %.9g %.9g %.9g): %.9g, in double %.9g", info->name, width,
                         j, in[i][0], in[i][1], in[i][2], in[i][3], in[i][4], in[i][5], in[i][6], out[1][i][j], out[0][i][j]);
            }
        }
        for (int j = 0; j < info->inputs && info->has_adjoint; j++) {
            double error = fabs(din[1][i][j] - din[0][i][j]);
            worst_adj = fmax(worst_adj, error / (info->adjoint_relative * size));
            if (!(error <= info->adjoint_relative * size)) {
                fail_msg("%s, %s, adjoint of input %d at (%.9g %.9g %.9g %.9g %.9g): %.9g, in double %.9g", info->name, width, j,
                         in[i][0], in[i][1], in[i][2], in[i][3], in[i][4], din[1][i][j], din[0][i][j]);
            }
        }
    }
    print_message("%-40s %-9s errors over allowed: value %.3f adjoint %.3f\n", info->name, width, worst, worst_adj);
}

static void check_width_all(leaf_value_fn *value, leaf_adj_fn *adj, const char *width) {
    for (int leaf = 0; leaf < LEAF_COUNT; leaf++) {
        check_width(leaf, value, adj, width);
    }
}
static void test_width_1(void **state) {
    (void)state;
    check_width_all(leaf_value_w1, leaf_adj_w1, "width 1");
}
static void test_width_8(void **state) {
    (void)state;
    if (!__builtin_cpu_supports("avx2") || !__builtin_cpu_supports("fma")) {
        skip();
    }
    check_width_all(leaf_value_w8, leaf_adj_w8, "width 8");
}
static void test_width_16(void **state) {
    (void)state;
    if (!__builtin_cpu_supports("avx512f") || !__builtin_cpu_supports("avx512vl")) {
        skip();
    }
    check_width_all(leaf_value_w16, leaf_adj_w16, "width 16");
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_adjoints),
        cmocka_unit_test(test_width_1),
        cmocka_unit_test(test_width_8),
        cmocka_unit_test(test_width_16),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
