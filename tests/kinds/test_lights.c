// Every light: samples against densities, meeting against sampling, adjoints against differences, widths against each
// other.
#include "sphere.h"

#include "emitter/table.h"

#include <stdlib.h>

enum { CASES = 20, SAMPLES = 20000, QUERIES = 64 };

static const KindKernels *const exact = &kind_kernels_double;

typedef struct Seen {
    const KindCase *c;
    double ref[3];
} Seen;

static void light_density(void *user, int n, double (*d)[3], double *pdf) {
    const Seen *x = user;
    LightDraw draw[POINTS] = {{{0}, {0}, {0}, 0, 0, {0}, {0}, 0}};
    assert_true(n <= POINTS);
    for (int i = 0; i < n; i++) {
        memcpy(draw[i].ref, x->ref, sizeof draw[i].ref);
        memcpy(draw[i].d, d[i], sizeof draw[i].d);
    }
    exact->light_pdf(x->c, n, draw);
    for (int i = 0; i < n; i++) {
        pdf[i] = draw[i].valid ? draw[i].pdf : 0;
    }
}

// A reference point at some distance; for spheres sometimes inside.
static void random_reference(Random *r, int light, double ref[3]) {
    double distance = light == LIGHT_SPHERE && uniform(r) < 0.4 ? between(r, 0, 0.28) : between(r, 2.2, 6);
    random_direction(r, ref);
    for (int k = 0; k < 3; k++) {
        ref[k] *= distance;
    }
}

static double check_sampling(const Seen *x, Random *r, int *failures) {
    LightDraw *d = calloc(SAMPLES, sizeof *d), *met = calloc(SAMPLES, sizeof *met);
    assert_true(d && met);
    for (int i = 0; i < SAMPLES; i++) {
        d[i] = (LightDraw){.u = {uniform(r), uniform(r)}};
        memcpy(d[i].ref, x->ref, sizeof d[i].ref);
    }
    exact->light_sample(x->c, SAMPLES, d);
    memcpy(met, d, SAMPLES * sizeof *d);
    exact->light_pdf(x->c, SAMPLES, met);
    int best = -1, counts[CELLS] = {0}, wrong = 0;
    for (int i = 0; i < SAMPLES; i++) {
        if (d[i].valid) {
            best = best < 0 || d[i].pdf > d[best].pdf ? i : best;
            // The direction meets the light where the sample says, up to what is lost at edges.
            bool same = met[i].valid && fabs(met[i].pdf - d[i].pdf) <= 1e-4 * d[i].pdf;
            wrong += !same;
        }
    }
    if (wrong > SAMPLES / 500) {
        print_error("%s: %d samples meet another density\n", rey_emitter_kinds[x->c->emitter.kind].name, wrong);
        *failures += 1;
    }
    double p[CELLS], tail = 1;
    // Slivers seen edge-on are beyond the quadrature; that they are met where they were sampled is checked above.
    if (best >= 0 && d[best].pdf < 20) {
        SphereGrid g = grid_make(d[best].d, 0.05, 0, light_density, (void *)(uintptr_t)x);
        g.edges = x->c->emitter.shape >= 0;
        for (int i = 0; i < SAMPLES; i++) {
            if (d[i].valid) {
                counts[grid_cell(&g, d[i].d)]++;
            }
        }
        grid_probabilities(&g, counts, SAMPLES, p);
        tail = chi_square_test(CELLS, p, counts, SAMPLES);
    }
    free(d);
    free(met);
    return tail;
}

// Lights that every point sees in one direction have no density.
static bool is_delta(int light) {
    return light == LIGHT_POINT || light == LIGHT_SPOT || light == LIGHT_PROJECTOR || light == LIGHT_DIRECTIONAL;
}

static void test_sampling(void **state) {
    UNUSED(state);
    int failures = 0;
    double threshold = sidak(0.01, CASES * LIGHT_COUNT);
    for (int light = 0; light < LIGHT_COUNT; light++) {
        Random r = case_random(light * 1000 + 5);
        for (int n = 0; n < CASES && !is_delta(light); n++) {
            KindCase c;
            case_make_light(&c, &r, light, true);
            Seen x = {&c, {0}};
            random_reference(&r, light, x.ref);
            double p = check_sampling(&x, &r, &failures);
            if (p < threshold) {
                print_error("%s: p = %g, threshold %g, seen from (%g %g %g)\n", light_names[light], p, threshold,
                            x.ref[0], x.ref[1], x.ref[2]);
                failures++;
            }
        }
    }
    assert_int_equal(failures, 0);
}

// What an adjoint is of: df . radiance + dd . direction. moves: the sample follows the light, and so does where the light
// of an environment is read along a direction.
static double objective(const KindCase *c, const LightDraw *draw, const Adjoint *a, bool moves) {
    LightDraw d = *draw;
    if (moves && (c->emitter.shape >= 0 || rey_emitter_kinds[c->emitter.kind].form == EMITTER_IS_DELTA)) {
        exact->light_sample(c, 1, &d);
    } else if (moves) {
        exact->light_pdf(c, 1, &d);
    }
    exact->light_eval(c, 1, &d);
    double sum = 0;
    for (int k = 0; k < 3; k++) {
        sum += a->df[k] * d.radiance[k] + (moves ? a->dwo[k] * d.d[k] : 0);
    }
    return sum;
}

// Difference quotient by one entry of theta, and how far that of twice the step lies; false where the function has a kink
// or a jump.
static bool quotient_of(KindCase *c, const LightDraw *d, const Adjoint *a, int i, bool moves, double *quotient,
                        double *truncation) {
    const double h = 5e-6, x = c->theta[i];
    double f[5];
    for (int k = 0; k < 5; k++) {
        c->theta[i] = x + (k - 2) * h;
        case_update_light(c);
        f[k] = objective(c, d, a, moves);
    }
    c->theta[i] = x;
    case_update_light(c);
    *quotient = (f[3] - f[1]) / (2 * h);
    // A kink beside x puts half of its turn into the quotient, and the second difference shows it.
    *truncation = fabs((f[4] - f[0]) / (4 * h) - *quotient) + fabs(f[3] - 2 * f[2] + f[1]) / (2 * h);
    return fabs(f[4] - 2 * f[2] + f[0]) <= 2e-3 * h * (fabs(*quotient) + 1);
}

static bool entry_moves(const KindCase *c, int i) {
    bool moves = false;
    for (int k = 0; k < MAX_EMITTER_SLOTS; k++) {
        const EmitterKind *kind = rey_emitter_kinds + c->emitter.kind;
        int n = k < kind->param_count && kind->params[k].type == EMITTER_PARAM_POSITION ? 3 : 12;
        moves |= (c->emitter.places >> k & 1) && i >= c->emitter.slot[k] && i < c->emitter.slot[k] + n;
    }
    return moves;
}

typedef struct Coverage {
    double largest[MAX_EMITTER_SLOTS], place;
    int compared, kinks;
} Coverage;

static int check_adjoint(KindCase *c, const LightDraw *d, Random *r, Coverage *covered) {
    Adjoint a = {.df = {between(r, -1, 1), between(r, -1, 1), between(r, -1, 1)},
                 .dwo = {between(r, -1, 1), between(r, -1, 1), between(r, -1, 1)}},
            forward = a;
    double gradient[CASE_THETA] = {0}, tangent[CASE_THETA], along = 0, size = 1e-30;
    bool moves = c->emitter.places != 0;
    (moves ? exact->light_move_adj : exact->light_adj)(c, 1, d, &a, gradient, NULL);
    int failures = 0;
    for (int i = 0; i < c->theta_count; i++) {
        tangent[i] = between(r, -1, 1);
        along += tangent[i] * gradient[i];
        size += fabs(tangent[i] * gradient[i]);
        double quotient, truncation;
        bool place = entry_moves(c, i);
        if (c->owner[i] < 0 && !place) {
            continue;
        }
        if (!quotient_of(c, d, &a, i, place, &quotient, &truncation)) {
            covered->kinks++;
            continue;
        }
        covered->compared++;
        if (fabs(quotient - gradient[i]) > 1e-6 * fabs(quotient) + 1e-7 + truncation) {
            print_error("%s entry %d: adjoint %.12g, difference %.12g\n", rey_emitter_kinds[c->emitter.kind].name, i, gradient[i],
                        quotient);
            failures++;
        }
        double *largest = place ? &covered->place : &covered->largest[c->owner[i]];
        *largest = fmax(*largest, fabs(gradient[i]));
    }
    (moves ? exact->light_move_adj : exact->light_adj)(c, 1, d, &forward, NULL, tangent);
    if (fabs(forward.forward - along) > 1e-12 * size) {
        print_error("forward %.12g, reverse %.12g\n", forward.forward, along);
        failures++;
    }
    return failures;
}

// Every parameter of the kind must have been seen to matter.
static int check_coverage(const KindCase *c, const Coverage *covered) {
    const EmitterKind *kind = rey_emitter_kinds + c->emitter.kind;
    int failures = 0;
    for (int i = 0; i < kind->param_count; i++) {
        bool place = kind->params[i].type >= EMITTER_PARAM_POSITION;
        if ((place ? covered->place : covered->largest[i]) == 0) {
            print_error("%s: the derivative by %s is never different from 0\n", kind->name, kind->params[i].name);
            failures++;
        }
    }
    if (covered->kinks > covered->compared / 20) {
        print_error("%s: %d of %d differences were not smooth\n", kind->name, covered->kinks, covered->compared);
        failures++;
    }
    return failures;
}

static void test_adjoints(void **state) {
    UNUSED(state);
    int failures = 0;
    for (int light = 0; light < LIGHT_COUNT; light++) {
        Random r = case_random(light * 1000 + 9);
        Coverage covered = {0};
        KindCase c;
        for (int n = 0; n < 4 * CASES; n++) {
            case_make_light(&c, &r, light, n % 2 == 1);
            for (int i = 0; i < QUERIES; i++) {
                LightDraw d = {.u = {uniform(&r), uniform(&r)}};
                random_reference(&r, light, d.ref);
                exact->light_sample(&c, 1, &d);
                if (d.valid || !is_delta(light)) {
                    failures += check_adjoint(&c, &d, &r, &covered);
                }
            }
        }
        failures += check_coverage(&c, &covered);
    }
    assert_int_equal(failures, 0);
}

static void test_widths(void **state) {
    UNUSED(state);
    static const KindKernels *const widths[] = {&kind_kernels_w1, &kind_kernels_w8, &kind_kernels_w16};
    int failures = 0, width_count = case_width_count();
    for (int light = 0; light < LIGHT_COUNT; light++) {
        Random r = case_random(light * 1000 + 11);
        int different = 0, n = 33;
        for (int k = 0; k < 4 * CASES; k++) {
            KindCase c;
            LightDraw d[3][33];
            case_make_light(&c, &r, light, true);
            for (int i = 0; i < n; i++) {
                LightDraw one = {.u = {(double)(float)uniform(&r), (double)(float)uniform(&r)}};
                random_reference(&r, light, one.ref);
                d[0][i] = d[1][i] = d[2][i] = one;
            }
            for (int w = 0; w < width_count; w++) {
                widths[w]->light_sample(&c, n, d[w]);
                widths[w]->light_eval(&c, n, d[w]);
                for (int i = 0; i < n; i++) {
                    const LightDraw *a = &d[w][i], *b = &d[0][i];
                    bool same = a->valid == b->valid && fabs(a->pdf - b->pdf) <= 2e-4 * fabs(b->pdf) + 1e-6;
                    for (int j = 0; j < 3; j++) {
                        same &= fabs(a->d[j] - b->d[j]) <= 1e-5;
                        same &= fabs(a->radiance[j] - b->radiance[j]) <= 2e-4 * fabs(b->radiance[j]) + 1e-4;
                    }
                    different += !same;
                }
            }
        }
        // A sample may fall into the neighbouring texel or triangle, or miss a grazing light.
        if (different > 4 * CASES * n / 200) {
            print_error("%s: %d samples differ\n", light_names[light], different);
            failures++;
        }
    }
    assert_int_equal(failures, 0);
}

// The name of a test as an argument runs that one only.
int main(int argc, char **argv) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_sampling), cmocka_unit_test(test_adjoints),
                                       cmocka_unit_test(test_widths)};
    if (argc > 1) {
        cmocka_set_test_filter(argv[1]);
    }
    return cmocka_run_group_tests(tests, NULL, NULL);
}
