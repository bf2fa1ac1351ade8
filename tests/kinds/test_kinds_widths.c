// Every kernel width gives the same values, densities, samples and adjoints: within 2e-5 of each other (adjoints about
// turned normals: 8e-5), or within what rounding the inputs to float does to the exact value, measured in double, where
// that is more (narrow lobes, cancellation).
#include "cases.h"

enum { CASES = 300, N = 33, INPUTS = 8, NUMBERS = 13, NUDGES = 6, SHIFTS = 12 }; // N: no multiple of a width

static const KindKernels *const exact = &kind_kernels_double;
static const KindKernels *const widths[] = {&kind_kernels_w1, &kind_kernels_w8, &kind_kernels_w16};

// All numbers of one query: value, density, adjoints of directions and uv, forward derivative.
static void run(const KindKernels *k, const KindCase *c, const Query *q, const double *tangent,
                double (*out)[NUMBERS]) {
    double f[N][3], pdf[N];
    Adjoint a[N];
    k->eval(c, N, q, f, pdf);
    for (int i = 0; i < N; i++) {
        a[i] = (Adjoint){.df = {0.3, -0.5, 0.8}};
    }
    k->adj(c, N, q, a, NULL, tangent);
    for (int i = 0; i < N; i++) {
        double numbers[NUMBERS] = {f[i][0],      f[i][1],     f[i][2],     pdf[i],      a[i].dwi[0],
                                   a[i].dwi[1],  a[i].dwi[2], a[i].dwo[0], a[i].dwo[1], a[i].dwo[2],
                                   a[i].duv[0],  a[i].duv[1], a[i].forward};
        memcpy(out[i], numbers, sizeof numbers);
    }
}

static double nudge(Random *r, double x) {
    return x * (1 + between(r, -2.4e-7, 2.4e-7)) + between(r, -6e-8, 6e-8);
}

// At the end of its range a value moves inwards: all texels of 1 are a little less than 1 once their weights are rounded.
static double nudge_within(Random *r, double x, double low, double high) {
    double d = x * between(r, -2e-7, 2e-7);
    return x + d < low || x + d > high ? fmin(fmax(x - d, low), high) : x + d;
}

// Where a direction grazes a turned surface, beyond which the value jumps, derivatives are differences of terms as large
// as f / cos in the turned frame, which is not known here: they may be anything.
static void free_grazing(const KindCase *c, Random r, const Query *q, double (*exactly)[NUMBERS],
                         double (*moved)[NUMBERS]) {
    for (int k = 0; k < SHIFTS && case_turns(c); k++) {
        Query at[N];
        double f[N][3], pdf[N];
        memcpy(at, q, sizeof at);
        for (int i = 0; i < N; i++) {
            for (int j = 0; j < 3; j++) {
                at[i].wi[j] += between(&r, -5e-4, 5e-4);
                at[i].wo[j] += between(&r, -5e-4, 5e-4);
            }
        }
        exact->eval(c, N, at, f, pdf);
        for (int i = 0; i < N; i++) {
            double here = exactly[i][0] + exactly[i][1] + exactly[i][2], there = f[i][0] + f[i][1] + f[i][2];
            bool jumps = fabs(there - here) > 0.5 * fmax(there, here);
            for (int j = 4; j < NUMBERS && jumps; j++) {
                moved[i][j] = INFINITY;
            }
        }
    }
}

// How far the numbers move when inputs and parameters move by float roundings; infinite where a jump is near.
static void measure_conditioning(const KindCase *c, Random *r, const Query *q, const double *tangent,
                                 double (*exactly)[NUMBERS], double (*moved)[NUMBERS]) {
    double out[N][NUMBERS];
    memset(moved, 0, N * sizeof *moved);
    for (int k = 0; k < NUDGES; k++) {
        KindCase near = *c;
        Query at[N];
        for (int i = 0; i < c->theta_count; i++) {
            near.theta[i] = nudge_within(r, c->theta[i], c->low[i], c->high[i]);
        }
        for (int i = 0; i < N; i++) {
            at[i] = q[i];
            for (int j = 0; j < 3; j++) {
                at[i].wi[j] = nudge(r, q[i].wi[j]);
                at[i].wo[j] = nudge(r, q[i].wo[j]);
            }
            at[i].uv[0] = nudge(r, q[i].uv[0]);
            at[i].uv[1] = nudge(r, q[i].uv[1]);
        }
        run(exact, &near, at, tangent, out);
        for (int i = 0; i < N; i++) {
            for (int j = 0; j < NUMBERS; j++) {
                moved[i][j] = fmax(moved[i][j], fabs(out[i][j] - exactly[i][j]));
            }
        }
    }
    free_grazing(c, *r, q, exactly, moved);
}

static double to_float(double x) {
    return (double)(float)x;
}

static void random_queries(const KindCase *c, Random *r, Query *q) {
    for (int i = 0; i < N; i++) {
        q[i] = (Query){.uv = {to_float(between(r, -1, 2)), to_float(between(r, -1, 2))}};
        random_direction(r, q[i].wi);
        random_direction(r, q[i].wo);
        Draw d = {.uv = {q[i].uv[0], q[i].uv[1]}, .u1 = uniform(r), .u2 = {uniform(r), uniform(r)}};
        memcpy(d.wi, q[i].wi, sizeof d.wi);
        exact->sample(c, 1, &d);
        if (i % 3 && d.wo[2] != 0) {
            memcpy(q[i].wo, d.wo, sizeof d.wo);
            q[i].lobe = d.lobe;
        }
        for (int j = 0; j < 3; j++) {
            q[i].wi[j] = to_float(q[i].wi[j]);
            q[i].wo[j] = to_float(q[i].wo[j]);
        }
    }
}

// Sum of the sizes of what the forward derivative adds up: its terms may cancel.
static void sum_of_parts(const KindCase *c, const Query *q, const double *tangent, double *sums) {
    for (int i = 0; i < N; i++) {
        Adjoint a = {.df = {0.3, -0.5, 0.8}};
        double gradient[CASE_THETA] = {0};
        exact->adj(c, 1, q + i, &a, gradient, NULL);
        sums[i] = 0;
        for (int k = 0; k < c->theta_count; k++) {
            sums[i] += fabs(gradient[k] * tangent[k]);
        }
    }
}

static int check_values(const KindCase *c, Random *r, int width_count) {
    static const char *const names[NUMBERS] = {"f.r",   "f.g",   "f.b",   "pdf",   "dwi.x", "dwi.y",  "dwi.z",
                                               "dwo.x", "dwo.y", "dwo.z", "duv.x", "duv.y", "forward"};
    Query q[N];
    double tangent[CASE_THETA], exactly[N][NUMBERS], moved[N][NUMBERS], out[3][N][NUMBERS], sums[N];
    random_queries(c, r, q);
    for (int i = 0; i < CASE_THETA; i++) {
        tangent[i] = to_float(between(r, -1, 1));
    }
    run(exact, c, q, tangent, exactly);
    measure_conditioning(c, r, q, tangent, exactly, moved);
    sum_of_parts(c, q, tangent, sums);
    for (int w = 0; w < width_count; w++) {
        run(widths[w], c, q, tangent, out[w]);
    }
    int failures = 0;
    bool turns = case_turns(c);
    // Turning directions into another frame rounds them several times.
    double roundings = turns ? 80 : 8, relative = turns ? 8e-5 : 2e-5;
    for (int i = 0; i < N; i++) {
        for (int j = 0; j < NUMBERS; j++) {
            // Components of one adjoint cancel against each other: the largest sets the scale.
            int first = j < 3 ? 0 : j < 4 ? 3 : j < 7 ? 4 : j < 10 ? 7 : j < 12 ? 10 : 12;
            int last = j < 3 ? 3 : j < 4 ? 4 : j < 7 ? 7 : j < 10 ? 10 : j < 12 ? 12 : 13;
            double scale = 0, free_play = 0;
            for (int k = first; k < last; k++) {
                scale = fmax(scale, fabs(exactly[i][k]));
                free_play = fmax(free_play, moved[i][k]);
            }
            if (first == 4) { // the terms of dwi are of the size of f / cos_i, and may cancel
                scale = fmax(scale, (fabs(exactly[i][0]) + fabs(exactly[i][1]) + fabs(exactly[i][2])) / fabs(q[i].wi[2]));
            }
            if (first == 10) { // equal texels, and the channels of a grey tint, cancel but for their rounding
                free_play += 1e-12 * sums[i] + 1e-5 * (fabs(exactly[i][0]) + fabs(exactly[i][1]) + fabs(exactly[i][2]));
            }
            if (first == 7 && turns) { // and so of dwo, by the shadowing
                scale = fmax(scale, (fabs(exactly[i][0]) + fabs(exactly[i][1]) + fabs(exactly[i][2])) / fabs(q[i].wo[2]));
            }
            if (first == 12) {
                scale = sums[i];
            }
            // The derivative of a turned normal is of the size of those of the directions, and may cancel in its texture.
            for (int k = 4; k < 10 && first >= 10 && turns; k++) {
                scale = fmax(scale, 8 * fabs(exactly[i][k]));
            }
            double tolerance = (j < 4 ? 2e-5 : relative) * scale + roundings * free_play + 1e-12;
            for (int w = 0; w < width_count; w++) {
                if (!(fabs(out[w][i][j] - out[0][i][j]) <= tolerance) ||
                    !(fabs(out[w][i][j] - exactly[i][j]) <= tolerance)) {
                    print_error("%s at width %d: %.9g, width 1 %.9g, double %.12g, tolerance %g: ", names[j],
                                widths[w]->lanes, out[w][i][j], out[0][i][j], exactly[i][j], tolerance);
                    case_print(c, q + i);
                    failures++;
                }
            }
        }
    }
    return failures;
}

// Samples: few may differ, where a choice between lobes falls the other way.
static int check_samples(const KindCase *c, Random *r, int width_count) {
    Draw d[3][N];
    int different = 0;
    for (int i = 0; i < N; i++) {
        Draw one = {.u1 = to_float(uniform(r)), .u2 = {to_float(uniform(r)), to_float(uniform(r))}};
        random_direction(r, one.wi);
        d[0][i] = d[1][i] = d[2][i] = one;
    }
    for (int w = 0; w < width_count; w++) {
        widths[w]->sample(c, N, d[w]);
        for (int i = 0; i < N; i++) {
            bool same = d[w][i].lobe == d[0][i].lobe;
            for (int k = 0; k < 3; k++) {
                same &= fabs(d[w][i].wo[k] - d[0][i].wo[k]) <= 1e-4;
            }
            different += !same;
        }
    }
    if (different > 2) {
        print_error("%d samples differ: ", different);
        case_print(c, NULL);
    }
    return different > 2;
}

static void test_every_kind(void **state) {
    UNUSED(state);
    int failures = 0, width_count = case_width_count();
    for (int kind = 0; kind < rey_bsdf_kind_count; kind++) {
        Random r = case_random(kind * 1000 + 3);
        int here = 0;
        for (int n = 0; n < CASES && here < 5; n++) {
            KindCase c;
            case_make(&c, &r, kind, n % case_variants(kind), n % 2 == 1);
            c.floor = to_float(0.05);
            here += check_values(&c, &r, width_count);
            here += check_samples(&c, &r, width_count);
        }
        failures += here;
    }
    assert_int_equal(failures, 0);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_every_kind)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
