// Adjoints of every kind from the tables: against central differences in double, forward against reverse, and
// positive density wherever a derivative is not zero. The name of a kind as an argument tests that one only.
#include "cases.h"
#include "scene/kind.h"

#include <stdlib.h>

enum { CASES = 300, QUERIES = 12 };

static const KindKernels *const exact = &kind_kernels_double;

static bool turns(const Query *q) { return (q->lobe & 3) == LOBE_REFLECT || (q->lobe & 3) == LOBE_TRANSMIT; }

// The direction of a delta lobe follows from wi and the parameters.
static void follow(const KindCase *c, Query *q, double u1) {
    Draw d = {.wi = {q->wi[0], q->wi[1], q->wi[2]}, .uv = {q->uv[0], q->uv[1]}, .u1 = u1, .u2 = {0.5, 0.5}};
    exact->sample(c, 1, &d);
    if (d.lobe == q->lobe) {
        memcpy(q->wo, d.wo, sizeof d.wo);
    }
}

// df . f at one query, turn . wo of delta lobes, and dpdf times the density.
static double objective(const KindCase *c, const Query *query, const Adjoint *a) {
    double f[1][3], pdf, sum = 0;
    Query q = *query;
    if (turns(&q)) {
        follow(c, &q, a->u1);
    }
    exact->eval(c, 1, &q, f, &pdf);
    for (int k = 0; k < 3; k++) {
        sum += a->df[k] * f[0][k] + a->turn[k] * q.wo[k];
    }
    return a->dpdf != 0 ? sum + a->dpdf * pdf : sum;
}

// Difference quotient of fourth order; side -1 or 1 stays on that side of x.
static double difference(const KindCase *c, const Query *q, const Adjoint *a, double *x, double h, int side) {
    static const double central[5] = {1, -8, 0, 8, -1}, one_sided[5] = {-25, 48, -36, 16, -3};
    double start = *x, sum = 0;
    for (int i = 0; i < 5; i++) {
        double weight = side ? one_sided[i] * side : central[i];
        *x = start + (side ? side * i : i - 2) * h;
        sum += weight != 0 ? weight * objective(c, q, a) : 0;
    }
    *x = start;
    return sum / (12 * h);
}

// By how much values change when directions, uv and surface move by a few roundings: narrow lobes amplify those.
static double rounding_noise(KindCase *c, const Query *q, const Adjoint *a, Random *r) {
    double value = objective(c, q, a), noise = 1e-14 * fabs(value);
    for (int i = 0; i < 12; i++) {
        Query moved = *q;
        double surface[3];
        memcpy(surface, c->surface, sizeof surface);
        for (int k = 0; k < 3; k++) {
            c->surface[k] *= case_turns(c) ? 1 + between(r, -1e-15, 1e-15) : 1;
            moved.wi[k] *= 1 + between(r, -1e-15, 1e-15);
            moved.wo[k] *= 1 + between(r, -1e-15, 1e-15);
        }
        moved.uv[0] += between(r, -1e-15, 1e-15);
        moved.uv[1] += between(r, -1e-15, 1e-15);
        noise = fmax(noise, 12 * fabs(objective(c, &moved, a) - value));
        memcpy(c->surface, surface, sizeof surface);
    }
    return noise;
}

// At the end of a range the derivative may be infinite (a root, a jump): quotients grow as the step shrinks.
static bool diverges(const KindCase *c, const Query *q, const Adjoint *a, double *x, double scale, int side) {
    double last = 0;
    for (double h = 1e-3; h > 1e-9; h *= 0.1) {
        double quotient = fabs(difference(c, q, a, x, h * scale, side));
        if (!(quotient > 2 * last)) {
            return false;
        }
        last = quotient;
    }
    return true;
}

// The adjoint d matches the difference quotient for some step: large steps cross kinks, small ones drown in rounding.
static bool matches(const KindCase *c, const Query *q, const Adjoint *a, double *x, double d, double low,
                    double high, double rounding) {
    int side = *x <= low ? 1 : *x >= high ? -1 : 0;
    double scale = fabs(*x) > 0.01 ? fabs(*x) : 0.01, last = 0;
    for (double h = 1e-2; h > 1e-11; h *= 0.1) {
        double quotient = difference(c, q, a, x, h * scale, side);
        double noise = rounding / (h * scale), tolerance = 1e-5 * fmax(fabs(quotient), fabs(d)) + noise;
        // At the end of a range the value itself may jump (the tint of black): J / h is in the quotients then.
        double beside = (10 * last - quotient) / 9;
        if (fabs(quotient - d) <= tolerance || (side && h < 5e-3 && fabs(beside - d) <= tolerance)) {
            return true;
        }
        last = quotient;
    }
    if (side && isfinite(d) && diverges(c, q, a, x, scale, side)) {
        return true;
    }
    print_error("adjoint %.9g, differences", d);
    for (double h = 1e-3; h > 1e-9; h *= 0.1) {
        print_error(" %.9g", difference(c, q, a, x, h * scale, side));
    }
    print_error(" at %g\n", *x);
    return false;
}

// Half of the directions are sampled, the others anything.
static Query random_query(const KindCase *c, Random *r) {
    Query q = {.uv = {between(r, -1.5, 2.5), between(r, -1.5, 2.5)}};
    random_direction(r, q.wi);
    random_direction(r, q.wo);
    if (uniform(r) < 0.7) {
        Draw d = {.uv = {q.uv[0], q.uv[1]}, .u1 = uniform(r), .u2 = {uniform(r), uniform(r)}};
        memcpy(d.wi, q.wi, sizeof d.wi);
        exact->sample(c, 1, &d);
        if (d.wo[2] != 0) { // useless samples are marked with 0, where values jump
            memcpy(q.wo, d.wo, sizeof d.wo);
            q.lobe = d.lobe;
        }
    }
    return q;
}

// Finds a number that samples the query's lobe, and so do its neighbours; none where the lobe brings nothing.
static bool find_u1(const KindCase *c, const Query *q, Adjoint *a) {
    enum { STEPS = 400 };
    double f[1][3], pdf;
    exact->eval(c, 1, q, f, &pdf);
    for (int i = 0, in_a_row = 0; i < STEPS && pdf > 0; i++) {
        Draw d = {.wi = {q->wi[0], q->wi[1], q->wi[2]}, .uv = {q->uv[0], q->uv[1]}, .u1 = (i + 0.5) / STEPS};
        exact->sample(c, 1, &d);
        in_a_row = d.lobe == q->lobe && d.wo[2] != 0 ? in_a_row + 1 : 0;
        a->u1 = in_a_row == 3 ? (i - 0.5) / STEPS : a->u1;
        if (in_a_row == 3) {
            return true;
        }
    }
    return false;
}

// Of the value, or of the density in the smooth lobe.
static int check_query(KindCase *c, Random *r, bool density, double *largest) {
    Query q = random_query(c, r);
    Adjoint a = {.df = {between(r, -1, 1), between(r, -1, 1), between(r, -1, 1)}};
    if (density) {
        a = (Adjoint){.dpdf = between(r, -1, 1)};
        q.lobe = LOBE_SMOOTH;
    }
    bool mirrored = turns(&q) && find_u1(c, &q, &a);
    for (int k = 0; k < 3 && mirrored; k++) {
        a.turn[k] = between(r, -1, 1);
    }
    double gradient[CASE_THETA] = {0}, tangent[CASE_THETA], f[1][3], pdf, along = 0, size = 0;
    exact->adj(c, 1, &q, &a, gradient, NULL);
    bool any = false;
    // Densities may be as good as 0, or be no function at all of what lies inside.
    double rounding = fmax(rounding_noise(c, &q, &a, r), density ? 1e-17 : 0);
    int failures = 0;
    for (int i = 0; i < c->theta_count; i++) {
        if (!matches(c, &q, &a, c->theta + i, gradient[i], c->low[i], c->high[i], rounding)) {
            print_error("parameter entry %d of slot %d: ", i, (int)c->owner[i]);
            failures++;
        }
        if (c->owner[i] >= 0) {
            largest[c->owner[i]] = fmax(largest[c->owner[i]], fabs(gradient[i]));
        }
        any |= gradient[i] != 0;
        tangent[i] = between(r, -1, 1);
        along += tangent[i] * gradient[i];
        size += fabs(tangent[i] * gradient[i]);
    }
    struct { double *x, d; } others[] = {{&q.wi[0], a.dwi[0]}, {&q.wi[1], a.dwi[1]}, {&q.wi[2], a.dwi[2]},
                                         {&q.wo[0], a.dwo[0]}, {&q.wo[1], a.dwo[1]}, {&q.wo[2], a.dwo[2]},
                                         {&q.uv[0], a.duv[0]}, {&q.uv[1], a.duv[1]},
                                         {&c->surface[0], a.dsurface[0]}, {&c->surface[1], a.dsurface[1]},
                                         {&c->surface[2], a.dsurface[2]}};
    for (int i = 0; i < COUNT_OF(others); i++) {
        bool follows = turns(&q) && i >= 3 && i < 6;
        if (!follows && !matches(c, &q, &a, others[i].x, others[i].d, -INFINITY, INFINITY, rounding)) {
            print_error("%s[%d]: ", i < 3 ? "wi" : i < 6 ? "wo" : i < 8 ? "uv" : "surface", i < 6 ? i % 3 : (i - 6) % 2);
            failures++;
        }
    }
    Adjoint forward = a;
    exact->adj(c, 1, &q, &forward, NULL, tangent);
    if (fabs(forward.forward - along) > 1e-12 * size + (density ? 1e-15 : 0)) {
        print_error("forward %.12g, reverse %.12g: ", forward.forward, along);
        failures++;
    }
    exact->eval(c, 1, &q, f, &pdf);
    if (any && !density && pdf <= 0) {
        print_error("a derivative without density: ");
        failures++;
    }
    if (failures) {
        case_print(c, &q);
    }
    return failures;
}

// *state: only kinds whose name begins so, null = all.
static void test_every_kind(void **state) {
    const char *only = *state ? *state : "";
    int failures = 0;
    for (int kind = 0; kind < rey_bsdf_kind_count; kind++) {
        const BsdfKind *k = rey_bsdf_kinds + kind;
        if (strncmp(k->name, only, strlen(only)) != 0) {
            continue;
        }
        Random r = case_random(kind * 1000 + 1);
        double largest[MAX_SLOTS] = {0}, of_density[MAX_SLOTS] = {0};
        int here = 0;
        for (int n = 0; n < CASES && here < 5; n++) {
            KindCase c;
            case_make(&c, &r, kind, n % case_variants(kind), n % 2 == 1);
            for (int i = 0; i < QUERIES && here < 5; i++) {
                c.floor = 0.05;
                here += check_query(&c, &r, false, largest);
                c.floor = 0;
                here += check_query(&c, &r, true, of_density);
            }
        }
        for (int i = 0; i < k->param_count; i++) {
            if (largest[i] == 0 && k->params[i].type != PARAM_RATE) {
                print_error("%s: the derivative with respect to %s is never different from 0\n", k->name,
                            k->params[i].name);
                here++;
            }
        }
        failures += here;
    }
    assert_int_equal(failures, 0);
}

int main(int argc, char **argv) {
    const struct CMUnitTest tests[] = {cmocka_unit_test_prestate(test_every_kind, argc > 1 ? argv[1] : NULL)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
