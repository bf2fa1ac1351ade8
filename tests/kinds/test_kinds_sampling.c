// Sampling of every kind from the tables: chi-square of smooth lobes, counts of delta lobes, weights, energy,
// reciprocity.
#include "sphere.h"

#include <stdlib.h>

enum { CASES_PER_VARIANT = 5, SAMPLES = 20000, DELTAS = 7 }; // lobes 1 to 7: deltas, those of a blend among them

static const KindKernels *const exact = &kind_kernels_double;

typedef struct Fixed {
    const KindCase *c;
    double wi[3], uv[2];
} Fixed;

static void smooth_density(void *user, int n, double (*d)[3], double *pdf) {
    const Fixed *x = user;
    Query q[POINTS] = {{{0}, {0}, {0}, 0}};
    double f[POINTS][3];
    assert_true(n <= POINTS);
    for (int i = 0; i < n; i++) {
        memcpy(q[i].wi, x->wi, sizeof q[i].wi);
        memcpy(q[i].wo, d[i], sizeof q[i].wo);
        memcpy(q[i].uv, x->uv, sizeof q[i].uv);
    }
    exact->eval(x->c, n, q, f, pdf);
}

typedef struct Samples {
    Draw draw[SAMPLES];
    Query query[SAMPLES];
    double f[SAMPLES][3], pdf[SAMPLES];
} Samples;

static void draw_samples(const Fixed *x, Random *r, Samples *s) {
    for (int i = 0; i < SAMPLES; i++) {
        Draw *d = s->draw + i;
        *d = (Draw){.uv = {x->uv[0], x->uv[1]}, .u1 = uniform(r), .u2 = {uniform(r), uniform(r)}};
        memcpy(d->wi, x->wi, sizeof d->wi);
    }
    exact->sample(x->c, SAMPLES, s->draw);
    for (int i = 0; i < SAMPLES; i++) {
        Query *q = s->query + i;
        *q = (Query){.lobe = s->draw[i].lobe, .uv = {x->uv[0], x->uv[1]}};
        memcpy(q->wi, x->wi, sizeof q->wi);
        memcpy(q->wo, s->draw[i].wo, sizeof q->wo);
    }
    exact->eval(x->c, SAMPLES, s->query, s->f, s->pdf);
}

// Smooth samples of one side of the surface, on a grid around the densest of them.
static int collect(const Fixed *x, const Samples *s, int side, double *p, int *counts) {
    int best = -1;
    for (int i = 0; i < SAMPLES; i++) {
        bool mine = s->draw[i].lobe == 0 && s->pdf[i] > 0 && side * s->draw[i].wo[2] > 0;
        if (mine && (best < 0 || s->pdf[i] > s->pdf[best])) {
            best = i;
        }
    }
    if (best < 0) {
        return 0;
    }
    double narrow = fmin(0.5, 0.3 / sqrt(3.14 * fmax(s->pdf[best], 1)));
    SphereGrid g = grid_make(s->draw[best].wo, narrow, side, smooth_density, (void *)(uintptr_t)x);
    memset(counts, 0, CELLS * sizeof *counts);
    for (int i = 0; i < SAMPLES; i++) {
        int cell = s->draw[i].lobe == 0 && s->pdf[i] > 0 ? grid_cell(&g, s->draw[i].wo) : -1;
        if (cell >= 0) {
            counts[cell]++;
        }
    }
    grid_probabilities(&g, counts, SAMPLES, p);
    return CELLS;
}

// Delta lobes: their probabilities from any sample of each.
static int collect_deltas(const Samples *s, double *p, int *counts) {
    for (int lobe = 1; lobe <= DELTAS; lobe++) {
        p[lobe - 1] = counts[lobe - 1] = 0;
        for (int i = 0; i < SAMPLES; i++) {
            if (s->draw[i].lobe == lobe && s->pdf[i] > 0) {
                p[lobe - 1] = s->pdf[i];
                counts[lobe - 1]++;
            }
        }
    }
    return DELTAS;
}

static double check_distribution(const Fixed *x, const Samples *s) {
    double p[2 * CELLS + DELTAS];
    int counts[2 * CELLS + DELTAS], n = 0;
    n += collect(x, s, 1, p + n, counts + n);
    n += collect(x, s, -1, p + n, counts + n);
    n += collect_deltas(s, p + n, counts + n);
    return chi_square_test(n, p, counts, SAMPLES);
}

// These send back more than they receive where sheen, clearcoat or tints are on, by their definition.
static bool gains_energy(int kind) {
    return strncmp(rey_bsdf_kinds[kind].name, "principled", 10) == 0;
}

// Weights are finite, and their mean, with the compression of radiance undone, is at most 1.
static int check_weights(const Samples *s, bool bounded) {
    double mean[3] = {0}, square[3] = {0};
    int failures = 0;
    for (int i = 0; i < SAMPLES; i++) {
        double e2 = s->draw[i].eta * s->draw[i].eta;
        failures += !(s->pdf[i] >= 0 && isfinite(s->pdf[i]));
        for (int k = 0; k < 3; k++) {
            double w = s->pdf[i] > 0 ? s->f[i][k] / s->pdf[i] * e2 : 0;
            failures += !(w >= 0 && isfinite(w));
            mean[k] += w / SAMPLES;
            square[k] += w * w / SAMPLES;
        }
    }
    for (int k = 0; k < 3; k++) {
        double error = sqrt(fmax(square[k] - mean[k] * mean[k], 0) / SAMPLES);
        if (bounded && mean[k] > 1.004 + 4.5 * error) {
            print_error("energy %g +- %g: ", mean[k], error);
            failures++;
        }
    }
    return failures;
}

// No value without density, and no value that is not finite, in any direction.
static int check_support(const Fixed *x, Random *r) {
    int failures = 0;
    for (int i = 0; i < 400; i++) {
        double d[1][3], f[1][3], pdf;
        random_direction(r, d[0]);
        Query q = {.uv = {x->uv[0], x->uv[1]}};
        memcpy(q.wi, x->wi, sizeof q.wi);
        memcpy(q.wo, d[0], sizeof q.wo);
        exact->eval(x->c, 1, &q, f, &pdf);
        for (int k = 0; k < 3; k++) {
            failures += !(isfinite(f[0][k]) && f[0][k] >= 0 && (f[0][k] == 0 || pdf > 0));
        }
    }
    if (failures) {
        print_error("%d values without density: ", failures);
    }
    return failures;
}

// f(wi, wo) e^2 / |cos_o| = f(wo, wi) / |cos_i| for smooth lobes, e the index of wo's side over that of wi's.
static int check_reciprocity(const Fixed *x, const Samples *s) {
    // Transmission through the thin sheet is cut by a rule that treats wi and wo differently, by its definition.
    bool one_sided = strcmp(rey_bsdf_kinds[x->c->bsdfs[x->c->root].kind].name, "principledthin") == 0;
    int failures = 0;
    if (case_turns(x->c)) { // reciprocal neither in the cosine nor in the shadowing
        return 0;
    }
    for (int i = 0; i < SAMPLES; i += 37) {
        const Draw *d = s->draw + i;
        if (d->lobe != 0 || s->pdf[i] <= 0 || fabs(d->wo[2]) < 1e-6 || (one_sided && d->wi[2] * d->wo[2] < 0)) {
            continue;
        }
        Query q = s->query[i];
        double f[1][3], pdf;
        memcpy(q.wi, d->wo, sizeof q.wi);
        memcpy(q.wo, d->wi, sizeof q.wo);
        exact->eval(x->c, 1, &q, f, &pdf);
        for (int k = 0; k < 3; k++) {
            double a = s->f[i][k] * d->eta * d->eta / fabs(d->wo[2]), b = f[0][k] / fabs(d->wi[2]);
            failures += fabs(a - b) > 1e-7 * (a + b);
        }
    }
    if (failures) {
        print_error("%d pairs are not reciprocal: ", failures);
    }
    return failures;
}

static void test_every_kind(void **state) {
    UNUSED(state);
    int failures = 0, tests = 0;
    double worst = 1;
    Samples *s = calloc(1, sizeof *s);
    assert_non_null(s);
    for (int kind = 0; kind < rey_bsdf_kind_count; kind++) {
        tests += CASES_PER_VARIANT * case_variants(kind);
    }
    double threshold = sidak(0.01, tests);
    for (int kind = 0; kind < rey_bsdf_kind_count; kind++) {
        Random r = case_random(kind * 1000 + 7);
        for (int n = 0; n < CASES_PER_VARIANT * case_variants(kind); n++) {
            KindCase c;
            case_make(&c, &r, kind, n % case_variants(kind), n % 3 == 2);
            c.floor = n % 2 ? 0.05 : 0;
            Fixed x = {&c, {0}, {uniform(&r), uniform(&r)}};
            random_direction(&r, x.wi);
            draw_samples(&x, &r, s);
            double p = check_distribution(&x, s);
            int here = check_weights(s, !gains_energy(kind)) + check_support(&x, &r) + check_reciprocity(&x, s);
            if (p < threshold) {
                print_error("chi-square: p = %g, threshold %g: ", p, threshold);
                here++;
            }
            if (here) {
                Query q = s->query[0];
                case_print(&c, &q);
            }
            worst = fmin(worst, p);
            failures += here;
        }
    }
    free(s);
    print_message("smallest p of %d: %g\n", tests, worst);
    assert_int_equal(failures, 0);
}

// The principled surface keeps energy where it is metal, and where it is clear glass without tint, sheen and coat; the
// sheet where all is transmitted diffusely.
static void test_principled_energy(void **state) {
    UNUSED(state);
    int failures = 0;
    Random r = {11};
    Samples *s = calloc(1, sizeof *s);
    assert_non_null(s);
    for (int n = 0; n < 16; n++) {
        KindCase c;
        int kind = rey_bsdf_kind_find(n < 12 ? "principled" : "principledthin");
        case_make(&c, &r, kind, n % case_variants(kind), false);
        case_set(&c, "clearcoat", 0);
        case_set(&c, "spec_tint", 0);
        case_set(&c, "sheen", 0);
        case_set(&c, "metallic", n < 6);
        case_set(&c, "spec_trans", n >= 6 && n < 12);
        case_set(&c, "diff_trans", 2);
        Fixed x = {&c, {0}, {0, 0}};
        random_direction(&r, x.wi);
        draw_samples(&x, &r, s);
        int here = check_weights(s, true);
        if (here) {
            case_print(&c, s->query);
        }
        failures += here;
    }
    free(s);
    assert_int_equal(failures, 0);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_every_kind), cmocka_unit_test(test_principled_energy)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
