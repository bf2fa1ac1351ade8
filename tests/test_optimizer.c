// test_optimizer.c: the steps of optimizers.
#include "fit/lbfgs.h"
#include "fit/optimizer.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { UNKNOWNS = 2 };

// Storage for unknowns of at most two numbers.
typedef struct Numbers {
    float start[UNKNOWNS], value[UNKNOWNS];
    double variable[UNKNOWNS], first[UNKNOWNS], second[UNKNOWNS], average[UNKNOWNS], gradient[UNKNOWNS];
} Numbers;

// The unknowns of `count` items of one number each, kept in n.
static Unknowns unknowns_of(Unknown *items, int count, Numbers *n) {
    return (Unknowns){.items = {items, count, count}, .count = count, .start = n->start, .value = n->value,
                      .variable = n->variable, .first = n->first, .second = n->second, .average = n->average,
                      .gradient = n->gradient};
}

// Minimises (log x - log 0.3)^2-like bowls in every parameterisation; the gradient is that of (x - 0.3)^2.
static void test_optimizers_find_minimum(void **state) {
    UNUSED(state);
    for (int kind = 0; kind < OPTIMIZER_COUNT; kind++) {
        for (int p = 0; p < PARAMETERISATION_RIGID && kind != OPTIMIZER_LBFGS; p++) {
            Unknown item = {.count = 1, .low = 0.01, .high = 1, .parameterisation = (Parameterisation)p};
            Numbers n = {.start = {0.8f}};
            Unknowns u = unknowns_of(&item, 1, &n);
            JobOptimizer o = {.kind = (OptimizerKind)kind,
                              .learning_rate = kind == OPTIMIZER_ADAM ? 0.05 : 0.1,
                              .beta1 = 0.9,
                              .beta2 = 0.99,
                              .epsilon = 1e-12,
                              .momentum = 0.8,
                              .schedule = {.kind = SCHEDULE_COSINE, .end = 0.01, .length = 600}};
            rey_unknowns_begin(&u);
            assert_float_equal((double)n.value[0], 0.8, 1e-6);
            for (int i = 0; i < 600; i++) {
                n.gradient[0] = 2 * ((double)n.value[0] - 0.3);
                rey_optimizer_step(&o, &u, i, 0);
            }
            assert_float_equal((double)n.value[0], 0.3, 2e-3);
            n.gradient[0] = 1e9; // far out of bounds
            rey_optimizer_step(&(JobOptimizer){.kind = OPTIMIZER_SGD, .learning_rate = 1, .schedule = {.length = 1}},
                               &u, 0, 0);
            assert_true(n.value[0] >= 0.01f && n.value[0] <= 0.0101f);
        }
    }
}

// Steps that jump about 0.3 by +-0.1 average out, and the start at 0.8 is forgotten.
static void test_average(void **state) {
    UNUSED(state);
    Unknown item = {.count = 1, .low = 0, .high = 1};
    Numbers n = {.start = {0.8f}};
    Unknowns u = unknowns_of(&item, 1, &n);
    JobOptimizer o = {.kind = OPTIMIZER_SGD, .learning_rate = 1, .average = 4, .schedule = {.length = 1}};
    rey_unknowns_begin(&u);
    for (int i = 0; i < 100; i++) {
        n.gradient[0] = (double)n.value[0] - (i % 2 ? 0.2 : 0.4);
        rey_optimizer_step(&o, &u, i, 0);
    }
    assert_float_equal((double)n.value[0], 0.2, 1e-5);
    rey_unknowns_take_average(&u);
    assert_float_equal((double)n.value[0], 0.3, 0.004);
}


enum { WIDE = 6, PAIRS = 5 };

// Chained Rosenbrock functions: a curved valley with its end at (1, 1, ...). noise: of the value, frozen, as high steps.
static double valley(const double *x, double noise, double *gradient) {
    double value = 0;
    memset(gradient, 0, WIDE * sizeof *gradient);
    for (int i = 0; i + 1 < WIDE; i++) {
        double a = x[i + 1] - x[i] * x[i], b = 1 - x[i];
        value += 100 * a * a + b * b;
        gradient[i + 1] += 200 * a;
        gradient[i] -= 400 * a * x[i] + 2 * b;
    }
    return value * (1 + noise * sin(1e6 * x[0]));
}

// Steps until all of x is within `off` of 1; -1 when that takes too many.
static int steps_to_end(double *state, double noise, double off, double *x) {
    double gradient[WIDE], best[WIDE];
    for (int i = 0; i < 400; i++) {
        double far = 0;
        memcpy(best, x, sizeof best);
        rey_lbfgs_take_best(state, WIDE, best);
        for (int k = 0; k < WIDE; k++) {
            far = fmax(far, fabs(best[k] - 1));
        }
        if (far < off) {
            return i;
        }
        double value = valley(x, noise, gradient);
        rey_lbfgs_step(state, WIDE, PAIRS, value, gradient, x);
    }
    return -1;
}

// L-BFGS comes through the valley, where gradient descent would need thousands of steps; a copied state goes on the same way.
static void test_lbfgs_follows_valley(void **unused) {
    UNUSED(unused);
    size_t bytes = (size_t)rey_lbfgs_numbers(WIDE, PAIRS) * sizeof(double);
    double *state = calloc(1, bytes), *copy = malloc(bytes), *noisy = calloc(1, bytes);
    assert_true(state && copy && noisy);
    double x[WIDE] = {-1.2, 1, -1.2, 1, -1.2, 1}, gradient[WIDE];
    for (int i = 0; i < 7; i++) { // stop in the middle of things
        double value = valley(x, 0, gradient);
        rey_lbfgs_step(state, WIDE, PAIRS, value, gradient, x);
    }
    double y[WIDE];
    memcpy(copy, state, bytes);
    memcpy(y, x, sizeof y);
    int steps = steps_to_end(state, 0, 1e-6, x);
    assert_in_range(steps, 10, 200);
    assert_int_equal(steps_to_end(copy, 0, 1e-6, y), steps);
    assert_memory_equal(x, y, sizeof x);
    double z[WIDE] = {-1.2, 1, -1.2, 1, -1.2, 1};
    assert_in_range(steps_to_end(noisy, 1e-4, 0.02, z), 10, 400);
    free(state);
    free(copy);
    free(noisy);
}

// Estimates that hold near a point alone, each off by an amount of its own: luck in one of them does not end the search.
static void test_lbfgs_leaps(void **unused) {
    UNUSED(unused);
    const double range = 0.2;
    double *state = calloc((size_t)rey_lbfgs_numbers(WIDE, PAIRS), sizeof *state);
    assert_non_null(state);
    double x[WIDE] = {-1.2, 1, -1.2, 1, -1.2, 1}, middle[WIDE], gradient[WIDE], worst = 1;
    memcpy(middle, x, sizeof x);
    int steps = 0, estimates = 0;
    for (; steps < 1000 && worst > 1e-6; steps++) {
        for (bool inside = false; !inside;) {
            inside = true;
            for (int k = 0; k < WIDE; k++) {
                inside = inside && fabs(x[k] - middle[k]) < range;
            }
            if (!inside && rey_lbfgs_leap(state, WIDE, PAIRS, x)) {
                memcpy(middle, x, sizeof x);
                estimates++;
            }
        }
        double value = valley(x, 0, gradient) + sin(3 * estimates);
        rey_lbfgs_step(state, WIDE, PAIRS, value, gradient, x);
        double best[WIDE];
        rey_lbfgs_take_best(state, WIDE, best);
        worst = 0;
        for (int k = 0; k < WIDE; k++) {
            worst = fmax(worst, fabs(best[k] - 1));
        }
    }
    assert_in_range(steps, 10, 500);
    assert_in_range(estimates, 3, steps);
    free(state);
}

// Within bounds and with rates of their own; what is found is the best point, not the last trial.
static void test_lbfgs_keeps_bounds(void **unused) {
    UNUSED(unused);
    Unknown items[2] = {{.count = 1, .low = 0.5, .high = 2, .learning_rate = 0.1},
                        {.offset = 1, .count = 1, .low = 0.01, .high = 10, .parameterisation = PARAMETERISATION_LOG}};
    Numbers n = {.start = {1.5f, 8}};
    double *state = calloc((size_t)rey_lbfgs_numbers(2, 4), sizeof *state);
    assert_non_null(state);
    Unknowns u = unknowns_of(items, 2, &n);
    u.lbfgs = state;
    JobOptimizer o = {.kind = OPTIMIZER_LBFGS, .learning_rate = 0.5, .memory = 4, .schedule = {.length = 1}};
    rey_unknowns_begin(&u);
    for (int i = 0; i < 60; i++) { // the least is at (0.3, 0.7), and 0.5 the lowest that is allowed
        double a = (double)n.value[0] - 0.3, b = (double)n.value[1] - 0.7;
        n.gradient[0] = 2 * a;
        n.gradient[1] = 2 * b;
        rey_optimizer_step(&o, &u, i, a * a + b * b);
    }
    rey_optimizer_restart(&o, &u);
    assert_float_equal((double)n.value[0], 0.5, 1e-6);
    assert_float_equal((double)n.value[1], 0.7, 1e-4);
    free(state);
}

/* ---- media --------------------------------------------------------------------------------------------- */

enum { CHANNELS = 3, MEDIUM = 2 * CHANNELS + 1 };

// Some function of extinction, albedo and g, with its gradient.
static double bowl(const double *x, double *gradient) {
    double sum = 0;
    for (int i = 0; i < MEDIUM; i++) {
        double d = x[i] - 0.2 * i, cross = x[(i + 1) % MEDIUM];
        sum += 0.5 * d * d + 0.3 * x[i] * cross;
    }
    for (int i = 0; i < MEDIUM && gradient; i++) {
        gradient[i] = x[i] - 0.2 * i + 0.3 * (x[(i + 1) % MEDIUM] + x[(i + MEDIUM - 1) % MEDIUM]);
    }
    return sum;
}

// What scattering's variables say, in double.
static void medium_of(const Scattering *s, const double *variable, double *x) {
    double g = s->g < 0 ? s->known_g : tanh(variable[s->g]);
    for (int i = 0; i < CHANNELS; i++) {
        double absorption = exp(variable[s->first + i]), scattering = exp(variable[s->second + i]) / (1 - g);
        x[s->first + i] = s->apart ? absorption : absorption + scattering;
        x[s->second + i] = s->apart ? scattering : scattering / (absorption + scattering);
    }
    x[2 * CHANNELS] = g;
}

static void test_scattering(void **unused) {
    UNUSED(unused);
    const Scattering media[4] = {{.count = CHANNELS, .second = CHANNELS, .g = 2 * CHANNELS},
                                 {.count = CHANNELS, .second = CHANNELS, .g = -1, .known_g = 0.6},
                                 {.count = CHANNELS, .second = CHANNELS, .g = 2 * CHANNELS, .apart = true},
                                 {.count = CHANNELS, .second = CHANNELS, .g = -1, .known_g = 0.6, .apart = true}};
    for (int which = 0; which < 4; which++) {
        const Scattering *s = &media[which];
        const float value[MEDIUM] = {5, 3, 0.5f, 0.9f, 0.99f, 0.2f, 0.6f};
        float again[MEDIUM] = {0, 0, 0, 0, 0, 0, 0.6f};
        double variable[MEDIUM] = {0}, x[MEDIUM], gradient[MEDIUM], scratch[MEDIUM];
        rey_scattering_begin(s, value, variable);
        rey_scattering_follow(s, variable, again);
        for (int i = 0; i < MEDIUM; i++) {
            assert_float_equal((double)again[i], (double)value[i], 1e-5);
        }
        medium_of(s, variable, x);
        bowl(x, gradient);
        rey_scattering_gradient(s, variable, gradient);
        for (int i = 0; i < MEDIUM - which % 2; i++) {
            const double held = variable[i], step = 1e-5;
            variable[i] = held + step;
            medium_of(s, variable, scratch);
            double more = bowl(scratch, NULL);
            variable[i] = held - step;
            medium_of(s, variable, scratch);
            double less = bowl(scratch, NULL);
            variable[i] = held;
            assert_float_equal(gradient[i], (more - less) / (2 * step), 1e-6);
            assert_true(fabs(gradient[i]) > 1e-3);
        }
    }
}

// Similar media have the same two coefficients.
static void test_similarity(void **unused) {
    UNUSED(unused);
    double a[2], b[2], c[2];
    rey_scattering_coefficients(false, 5, 0.9, 0.8, &a[0], &a[1]); // sigma_a 0.5, sigma_s 4.5
    rey_scattering_coefficients(false, 1.4, 0.9 / 1.4, 0, &b[0], &b[1]); // sigma_a 0.5, sigma_s 0.9
    rey_scattering_coefficients(true, 0.5, 4.5, 0.8, &c[0], &c[1]);
    for (int i = 0; i < 2; i++) {
        assert_float_equal(a[i], b[i], 1e-12);
        assert_float_equal(a[i], c[i], 1e-12);
    }
}

// Shares stay shares; those that began at 0 come back.
static void test_simplex(void **unused) {
    UNUSED(unused);
    enum { SHARES = 4 };
    const double truth[SHARES] = {0.1, 0, 0.6, 0.3};
    for (int kind = 0; kind < OPTIMIZER_LBFGS; kind++) {
        float start[SHARES] = {2, 4, 0, 2}, value[SHARES];
        double numbers[5][SHARES] = {{0}};
        Unknown item = {.count = SHARES, .low = 0, .high = INFINITY, .parameterisation = PARAMETERISATION_SIMPLEX,
                        .moment = MOMENT_SHARED};
        Unknowns u = {.items = {&item, 1, 1}, .count = SHARES, .start = start, .value = value, .variable = numbers[0],
                      .first = numbers[1], .second = numbers[2], .average = numbers[3], .gradient = numbers[4]};
        JobOptimizer o = {.kind = (OptimizerKind)kind, .learning_rate = kind == OPTIMIZER_ADAM ? 0.1 : 0.5, .beta1 = 0.9,
                          .beta2 = 0.9, .epsilon = 1e-12, .schedule = {.kind = SCHEDULE_COSINE, .end = 0.01, .length = 800}};
        rey_unknowns_begin(&u);
        assert_float_equal((double)value[1], 0.5, 1e-5);
        for (int i = 0; i < 800; i++) {
            double sum = 0;
            for (int k = 0; k < SHARES; k++) {
                u.gradient[k] = 2 * ((double)value[k] - truth[k]) + 3; // the 3 is no change
                sum += (double)value[k];
            }
            assert_float_equal(sum, 1, 1e-5);
            rey_optimizer_step(&o, &u, i, 0);
        }
        for (int k = 0; k < SHARES; k++) {
            assert_float_equal((double)value[k], truth[k], 0.01);
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_scattering),
        cmocka_unit_test(test_similarity),
        cmocka_unit_test(test_simplex),
        cmocka_unit_test(test_optimizers_find_minimum),
        cmocka_unit_test(test_average),
        cmocka_unit_test(test_lbfgs_follows_valley),
        cmocka_unit_test(test_lbfgs_leaps),
        cmocka_unit_test(test_lbfgs_keeps_bounds),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
