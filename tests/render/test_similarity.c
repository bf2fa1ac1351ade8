// Similarity relations of high order [zhao2014]: with all moments f_n of the phase function, scattering that is rarer by a factor
// alpha looks the same if sigma_s (1 - f_n) does, for n = 1 .. N the better the larger N is. Phase functions of given moments
// are those of largest entropy, exp of a polynomial.
#include "rooms.h"

enum { ORDER = 3, VALUES = 201, STEPS = 2000, SUNS = 4 };

static const double alpha = 0.6, scattering = 3, absorption = 0.05;
static const double across[SUNS] = {0, 0.3, 0.75, 3}; // tangents of the sun's angle

// Legendre polynomials
static double legendre(int n, double x) {
    const double p[ORDER + 1] = {1, x, (3 * x * x - 1) / 2, (5 * x * x - 3) * x / 2};
    return p[n];
}

// 0.9 HG(0.85) + 0.1 HG(-0.4) over the cosine, its integral over which is 1
static double original(double x) {
    const double g[2] = {0.85, -0.4}, share[2] = {0.9, 0.1};
    double sum = 0;
    for (int k = 0; k < 2; k++) {
        sum += share[k] * 0.5 * (1 - g[k] * g[k]) / pow(1 + g[k] * g[k] - 2 * g[k] * x, 1.5);
    }
    return sum;
}

static double original_moment(int n) { return 0.9 * pow(0.85, n) + 0.1 * pow(-0.4, n); }

static double entropy_value(const double *lambda, int order, double x) {
    double sum = 0;
    for (int k = 0; k <= order; k++) {
        sum += lambda[k] * legendre(k, x);
    }
    return exp(sum);
}

// Newton's method for the function whose moments of orders up to `order` are f.
static void find_entropy(const double *f, int order, double *lambda) {
    memset(lambda, 0, (ORDER + 1) * sizeof *lambda);
    lambda[0] = -log(2);
    for (int step = 0; step < 50; step++) {
        double a[ORDER + 1][ORDER + 2] = {{0}}, most = 0;
        for (int i = 0; i < STEPS; i++) {
            double x = -1 + (i + 0.5) * 2 / STEPS, p = entropy_value(lambda, order, x) * 2 / STEPS;
            for (int k = 0; k <= order; k++) {
                for (int l = 0; l <= order; l++) {
                    a[k][l] += p * legendre(k, x) * legendre(l, x);
                }
                a[k][order + 1] += p * legendre(k, x);
            }
        }
        for (int k = 0; k <= order; k++) {
            a[k][order + 1] -= f[k];
        }
        for (int k = 0; k <= order; k++) { // Gauss, of a positive definite matrix
            for (int l = 0; l <= order; l++) {
                double m = l == k ? 0 : a[l][k] / a[k][k];
                for (int j = 0; j <= order + 1; j++) {
                    a[l][j] -= m * a[k][j];
                }
            }
        }
        for (int k = 0; k <= order; k++) {
            double d = a[k][order + 1] / a[k][k];
            lambda[k] -= d;
            most = fmax(most, fabs(d));
        }
        if (most < 1e-10) {
            return;
        }
    }
    fail_msg("no function has these moments");
}

// What is seen of slabs with a phase function, under each of the suns.
static void look(const char *phase, double sigma_s, double *seen) {
    for (int i = 0; i < SUNS; i++) {
        char sigma_t[32], albedo[32], sun[32];
        snprintf(sigma_t, sizeof sigma_t, "%.9g", sigma_s + absorption);
        snprintf(albedo, sizeof albedo, "%.9g", sigma_s / (sigma_s + absorption));
        snprintf(sun, sizeof sun, "%g", across[i]);
        const rey_define defines[] = {{"sigma_t", sigma_t}, {"albedo", albedo}, {"across", sun}, {"phase", phase}};
        float image[3 * 16];
        Room room;
        rey_render_def def = rey_default_render_def();
        def.spp = 32768;
        assert_int_equal(rey_context_create(NULL, &room.ctx), REY_OK);
        ok(room, rey_scene_load(room.ctx, RENDER_DIR "/similarity.xml", defines, COUNT_OF(defines), &room.scene));
        ok(room, rey_render(room.scene, &def, image, NULL));
        seen[i] = 0;
        for (int k = 0; k < 3 * 16; k++) {
            seen[i] += (double)image[k] / (3 * 16);
        }
        room_close(room);
    }
}

static void test_orders(void **state) {
    UNUSED(state);
    static char text[VALUES * 16];
    double truth[SUNS], error[ORDER + 1] = {0};
    size_t used = 0;
    for (int i = 0; i < VALUES; i++) {
        used += (size_t)snprintf(text + used, sizeof text - used, "%s%.7g", i ? ", " : "", original(-1 + 2.0 * i / (VALUES - 1)));
    }
    look(text, scattering, truth);
    for (int order = 1; order <= ORDER; order += ORDER - 1) {
        double f[ORDER + 1], lambda[ORDER + 1], seen[SUNS];
        for (int n = 0; n <= ORDER; n++) {
            f[n] = n ? 1 - (1 - original_moment(n)) / alpha : 1;
        }
        find_entropy(f, order, lambda);
        used = 0;
        for (int i = 0; i < VALUES; i++) {
            used += (size_t)snprintf(text + used, sizeof text - used, "%s%.7g", i ? ", " : "",
                                     entropy_value(lambda, order, -1 + 2.0 * i / (VALUES - 1)));
        }
        look(text, alpha * scattering, seen);
        for (int i = 0; i < SUNS; i++) {
            double off = seen[i] / truth[i] - 1;
            print_message("order %d, sun %g: %.5f for %.5f, %+.1f %%\n", order, across[i], seen[i], truth[i], 100 * off);
            error[order] += off * off / SUNS;
        }
    }
    // 10 and 1.6 %
    assert_true(sqrt(error[1]) > 0.05 && sqrt(error[ORDER]) < 0.025);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_orders)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
