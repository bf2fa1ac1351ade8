// Transmittance of rough interfaces: against plain averages over sampled normals, and its derivatives against differences.
#define REAL_DOUBLE
#include "math/microfacet.h"
#include "math/rough_transmittance.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>

#include <cmocka.h>

// The definition: an average over a grid of n x n sample numbers.
static double average(bool transmit, const Microfacet *mf, double eta, double mu, int n) {
    Vec3 wi = v3(sqrt(1 - mu * mu), 0, mu);
    double sum = 0;
    for (int i = 0; i < n * n; i++) {
        Vec3 m = microfacet_sample(mf, wi, (i % n + 0.5) / n, (i / n + 0.5) / n);
        double cos_t, eta_it, eta_ti, f = fresnel_dielectric(v3_dot(wi, m), eta, &cos_t, &eta_it, &eta_ti);
        Vec3 wo = transmit ? refract(wi, m, cos_t, eta_ti) : reflect(wi, m);
        if (transmit ? wo.z < 0 && f < 1 : wo.z > 0) {
            sum += (transmit ? 1 - f : f) * smith_G1(mf, wo, m);
        }
    }
    return sum / ((double)n * n);
}

static const double alphas[] = {1e-4, 0.01, 0.1, 0.4, 1};
static const double etas[] = {1.05, 1.5, 2.5, 0.95, 1 / 1.5, 0.4};
static const double cosines[] = {1e-4, 0.05, 0.3, 0.74, 0.99, 1};

static void test_values(void **state) {
    (void)state;
    double worst = 0, sum = 0;
    int count = 0;
    for (int ggx = 0; ggx < 2; ggx++) {
        for (int a = 0; a < COUNT_OF(alphas); a++) {
            Microfacet mf = microfacet_make(ggx, true, alphas[a], alphas[a]);
            for (int e = 0; e < COUNT_OF(etas); e++) {
                for (int c = 0; c < COUNT_OF(cosines); c++) {
                    double t = rey_rough_transmittance_at(ggx, alphas[a], etas[e], cosines[c]).value;
                    double r = rey_rough_reflectance_at(ggx, alphas[a], etas[e], cosines[c]).value;
                    double error_t = fabs(t - average(true, &mf, etas[e], cosines[c], 96));
                    double error_r = fabs(r - average(false, &mf, etas[e], cosines[c], 96));
                    worst = fmax(worst, fmax(error_t, error_r));
                    sum += error_t + error_r;
                    count += 2;
                    if (error_t > 6e-3 || error_r > 6e-3) { // the averages converge slowly at the critical angle
                        fail_msg("ggx %d alpha %g eta %g mu %g: transmittance %.6f off by %.1e, reflectance %.6f off by %.1e", ggx,
                                 alphas[a], etas[e], cosines[c], t, error_t, r, error_r);
                    }
                }
            }
        }
    }
    print_message("differences from the sampled averages: largest %.1e, mean %.1e\n", worst, sum / count);
    assert_true(sum / count < 3e-4);
}

typedef RoughValue value_fn(bool ggx, double alpha, double eta, double mu);

static void check_derivatives(value_fn *fn, const char *name, bool ggx, double alpha, double eta, double mu) {
    RoughValue v = fn(ggx, alpha, eta, mu);
    double ha = 1e-5 * alpha, he = 1e-6;
    double by_alpha = (fn(ggx, alpha + ha, eta, mu).value - fn(ggx, alpha - ha, eta, mu).value) / (2 * ha);
    double by_eta = (fn(ggx, alpha, eta + he, mu).value - fn(ggx, alpha, eta - he, mu).value) / (2 * he);
    if (fabs(by_alpha - v.by_alpha) * alpha > 1e-6 * (1 + fabs(by_alpha) * alpha) ||
        fabs(by_eta - v.by_eta) > 1e-6 * (1 + fabs(by_eta))) {
        fail_msg("%s, ggx %d alpha %g eta %g mu %g: by alpha %.8g, difference %.8g; by eta %.8g, difference %.8g", name, ggx,
                 alpha, eta, mu, v.by_alpha, by_alpha, v.by_eta, by_eta);
    }
}

static void test_derivatives(void **state) {
    (void)state;
    // away from alphas, indices and cosines at which a node sits on a kink
    for (int ggx = 0; ggx < 2; ggx++) {
        for (int a = 1; a < COUNT_OF(alphas); a++) {
            for (int e = 0; e < COUNT_OF(etas); e++) {
                for (int c = 1; c < COUNT_OF(cosines); c++) {
                    double alpha = alphas[a] * 0.97, mu = cosines[c] * 0.983;
                    check_derivatives(rey_rough_transmittance_at, "transmittance", ggx, alpha, etas[e], mu);
                    check_derivatives(rey_rough_reflectance_at, "reflectance", ggx, alpha, etas[e], mu);
                }
            }
        }
    }
}

static void test_table(void **state) {
    (void)state;
    float t[2][64], by_alpha[64], by_eta[64], unused[64];
    double internal[2][2], da, de, skip1, skip2;
    const double steps[2] = {-1e-3, 1e-3};
    for (int ggx = 0; ggx < 2; ggx++) {
        for (int i = 0; i < 2; i++) {
            rey_rough_transmittance(ggx, 0.2 + steps[i], 1.5, t[i], unused, unused, &internal[0][i], &skip1, &skip2);
            rey_rough_transmittance(ggx, 0.2, 1.5 + steps[i], unused, unused, unused, &internal[1][i], &skip1, &skip2);
        }
        double value;
        rey_rough_transmittance(ggx, 0.2, 1.5, unused, by_alpha, by_eta, &value, &da, &de);
        assert_true(fabs((internal[0][1] - internal[0][0]) / 2e-3 - da) < 1e-3 * fabs(da));
        assert_true(fabs((internal[1][1] - internal[1][0]) / 2e-3 - de) < 1e-3 * fabs(de));
        double sum = 0;
        Microfacet mf = microfacet_make(ggx, true, 0.2, 0.2);
        for (int i = 0; i < 64; i++) {
            double mu = fmax(i / 63.0, 1e-6);
            assert_true(fabs(((double)t[1][i] - (double)t[0][i]) / 2e-3 - (double)by_alpha[i]) < 2e-3);
            assert_true(by_alpha[i] != 0 && by_eta[i] != 0);
            sum += average(false, &mf, 1 / 1.5, mu, 32) * mu * 2 / 64;
        }
        if (fabs(value - sum) > 1e-3) {
            fail_msg("internal reflectance %.6f, by sampled averages %.6f", value, sum);
        }
    }
    // As the surface becomes smooth: the coat of index 1.5 with the sum over the nodes of the exact F.
    double sum = 0, value, cos_t, eta_it, eta_ti;
    rey_rough_transmittance(true, 1e-4, 1.5, t[0], by_alpha, by_eta, &value, &da, &de);
    for (int i = 0; i < 64; i++) {
        double mu = fmax(i / 63.0, 1e-6);
        sum += fresnel_dielectric(mu, 1 / 1.5, &cos_t, &eta_it, &eta_ti) * mu * 2 / 64;
        if (i > 4) {
            double f = fresnel_dielectric(mu, 1.5, &cos_t, &eta_it, &eta_ti);
            assert_true(fabs((double)t[0][i] - (1 - f)) < 1e-3);
        }
    }
    assert_true(fabs(value - sum) < 1e-3);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_values),
        cmocka_unit_test(test_derivatives),
        cmocka_unit_test(test_table),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
