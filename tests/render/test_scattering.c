// Multiple scattering against what is known of it: a half-space that scatters evenly [chandrasekhar1960], in values and
// derivatives, and the score of paths, which an independent walk in double finds.
#include "slab.h"

enum { ALBEDOS = 5 };

// Of a half-space lit or seen straight on: the albedo, of light from one direction, and its derivative.
static const double half_albedo[ALBEDOS] = {0.5, 0.8, 0.9, 0.95, 0.99};
static const double half_plane[ALBEDOS] = {0.115226, 0.285255, 0.414947, 0.535541, 0.752721};
static const double half_slope[ALBEDOS] = {0.35472, 0.94797, 1.82418, 3.28121, 10.48765};

// What comes straight back: albedo H(1)^2 / (8 pi) for light of one direction, where the plane's albedo is 1 - sqrt(1 - albedo)
// H(1); and its derivative.
static double back_value(int k, double *slope) {
    const double a = half_albedo[k], root = sqrt(1 - a), h = (1 - half_plane[k]) / root;
    double dh = (h / (2 * root) - half_slope[k]) / root;
    *slope = (h * h + 2 * a * h * dh) / (8 * pi);
    return a * h * h / (8 * pi);
}

// most: relative standard error that is allowed.
static void close_to(const char *what, double albedo, double mean, double error, double expected, double most) {
    print_message("%s, albedo %g: %.6g +- %.2g, expected %.6g\n", what, albedo, mean, error, expected);
    assert_true(fabs(mean - expected) <= 4 * error + 1e-4 * expected && error * sqrt(sample_share()) <= most * expected);
}

// Albedos from..from + 2 in the three channels; dense enough that neither the other side nor the edges are felt. The border is that
// of the medium's own box, or under the sun a surface, behind which light begins to be lost at once.
static void judge_half_space(int from, bool sun, int spp, int slope_spp) {
    static char albedos[64];
    snprintf(albedos, sizeof albedos, "%g, %g, %g", half_albedo[from], half_albedo[from + 1], half_albedo[from + 2]);
    const rey_define defines[MOST_DEFINES] = {{"albedo", albedos},
                                              {sun ? "sun" : "sky", "1"},
                                              {"g", "0"},
                                              {"roulette", "200"},
                                              {"kind", sun ? "homogeneous" : "heterogeneous"},
                                              {"wide", sun ? "1" : "2"},
                                              {"sigma_t", "200, 200, 200"}};
    Room room = slab_open(defines, 2);
    int param = rey_param_find(room.scene, "fog.albedo.value.value");
    const float all[3] = {1, 1, 1};
    double mean[3], error[3], slope[3], slope_error[3];
    mean_of(room, -1, NULL, spp, mean, error);
    mean_of(room, param, all, slope_spp, slope, slope_error);
    for (int c = 0; c < 3; c++) {
        double expected = half_slope[from + c];
        double value = sun ? back_value(from + c, &expected) : half_plane[from + c];
        // Where hardly anything is absorbed, the longest paths bring most of the derivative, and of its noise.
        const bool long_paths = half_albedo[from + c] > 0.98;
        close_to(sun ? "straight back" : "plane", half_albedo[from + c], mean[c], error[c], value, long_paths ? 0.01 : 4e-3);
        const double most = long_paths ? 0.1 : 5e-3;
        close_to(sun ? "straight back, derivative" : "plane, derivative", half_albedo[from + c], slope[c], slope_error[c], expected,
                 most);
    }
    room_close(room);
}

// By reciprocity, a half-space under an even sky shows straight on what it reflects of light that comes straight on.
static void test_half_space(void **state) {
    UNUSED(state);
    judge_half_space(0, false, 4096, 1024);
    judge_half_space(2, false, 4096, 4096);
    judge_half_space(0, true, 2048, 1024);
    judge_half_space(2, true, 2048, 2048);
}

// ---- the score of paths -------------------------------------------------------------------------------------------

enum { WALKS = 1 << 20, MOST_SCATTERINGS = 3 };

typedef struct Score {
    double value, by_sigma, by_albedo, by_g;
} Score;

static double hg(double g, double c) { return (1 - g * g) / (4 * pi * pow(1 + g * g - 2 * g * c, 1.5)); }

static double hg_score(double g, double c) {
    return (g * g * g + g * g * c - 5 * g + 3 * c) / ((1 - g * g) * (1 + g * g - 2 * g * c));
}

// Distance to the side of the cube [-1, 1]^3 from within.
static double way_out(const double *p, const double *d) {
    double least = INFINITY;
    for (int k = 0; k < 3; k++) {
        least = d[k] != 0 ? fmin(least, ((d[k] > 0 ? 1 : -1) - p[k]) / d[k]) : least;
    }
    return least;
}

// Turns d by an angle whose cosine is distributed as the phase function; returns the cosine.
static double scatter(uint64_t *random, double g, double *d) {
    double s = (1 - g * g) / (1 - g + 2 * g * uniform(random)), c = (1 + g * g - s * s) / (2 * g), phi = 2 * pi * uniform(random);
    double x[3] = {fabs(d[0]) < 0.5, fabs(d[0]) >= 0.5, 0}, u[3], v[3], along = x[0] * d[0] + x[1] * d[1], length = 0;
    for (int k = 0; k < 3; k++) {
        u[k] = x[k] - along * d[k];
        length += u[k] * u[k];
    }
    for (int k = 0; k < 3; k++) {
        u[k] /= sqrt(length);
    }
    for (int k = 0; k < 3; k++) {
        int a = (k + 1) % 3, b = (k + 2) % 3;
        v[k] = d[a] * u[b] - d[b] * u[a];
    }
    double sine = sqrt(fmax(1 - c * c, 0));
    for (int k = 0; k < 3; k++) {
        d[k] = c * d[k] + sine * (cos(phi) * u[k] + sin(phi) * v[k]);
    }
    return c;
}

// One path into the cube from above, lit from above after each of its collisions: every contribution times the sum of the
// derivatives of the logarithms of all its densities.
static Score walk(uint64_t *random, double sigma, double albedo, double g) {
    Score sum = {0}, score = {0};
    double p[3] = {uniform(random) - 0.5, uniform(random) - 0.5, 1}, d[3] = {0, 0, -1}, weight = 1;
    for (int b = 1; b <= MOST_SCATTERINGS; b++) {
        double distance = -log(1 - uniform(random)) / sigma;
        if (distance > way_out(p, d)) {
            break;
        }
        for (int k = 0; k < 3; k++) {
            p[k] += distance * d[k];
        }
        weight *= albedo;
        score.by_sigma += 1 / sigma - distance;
        // Light goes down and is turned towards where the path came from.
        double up = 1 - p[2], c = d[2], l = weight * hg(g, c) * exp(-sigma * up);
        sum.value += l;
        sum.by_sigma += l * (score.by_sigma - up);
        sum.by_albedo += l * b / albedo;
        sum.by_g += l * (score.by_g + hg_score(g, c));
        score.by_g += hg_score(g, scatter(random, g, d));
    }
    return sum;
}

static void test_score(void **state) {
    UNUSED(state);
    const double sigma[3] = {0.4, 0.8, 1.6}, albedo[3] = {0.9, 0.7, 0.5}, g = 0.3, light = 5;
    const rey_define defines[MOST_DEFINES] = {
        {"sigma_t", "0.4, 0.8, 1.6"}, {"albedo", "0.9, 0.7, 0.5"}, {"sun", "5"}, {"depth", "4"}};
    static const char *const params[4] = {NULL, "fog.sigma_t.value.value", "fog.albedo.value.value", "fog.phase_function.g.value"};
    Room room = slab_open(defines, 2);
    double expected[4][3], noise[4][3];
    uint64_t random = 5;
    for (int c = 0; c < 3; c++) {
        double sums[4] = {0}, squares[4] = {0};
        for (int i = 0; i < WALKS; i++) {
            Score s = walk(&random, sigma[c], albedo[c], g);
            const double values[4] = {s.value, s.by_sigma, s.by_albedo, s.by_g};
            for (int k = 0; k < 4; k++) {
                sums[k] += light * values[k];
                squares[k] += light * values[k] * light * values[k];
            }
        }
        for (int k = 0; k < 4; k++) {
            expected[k][c] = sums[k] / WALKS;
            noise[k][c] = (squares[k] / WALKS - expected[k][c] * expected[k][c]) / WALKS;
        }
    }
    for (int k = 0; k < 4; k++) {
        const float all[3] = {1, 1, 1};
        double mean[3], error[3];
        mean_of(room, k ? rey_param_find(room.scene, params[k]) : -1, k ? all : NULL, 2048, mean, error);
        for (int c = 0; c < 3; c++) {
            double off = fabs(mean[c] - expected[k][c]), deviation = sqrt(error[c] * error[c] + noise[k][c]);
            print_message("%-28s %.6g +- %.2g, by its score %.6g +- %.2g\n", k ? params[k] : "radiance", mean[c], error[c],
                          expected[k][c], sqrt(noise[k][c]));
            assert_true(off <= 4.5 * deviation && deviation <= 0.02 * fmax(expected[k][c], expected[0][c]));
        }
    }
    room_close(room);
}

// ---- symmetry ------------------------------------------------------------------------------------------------------

// The gradient of a symmetric scene is symmetric, also in empty voxels.
static void test_symmetry(void **state) {
    UNUSED(state);
    enum { ACROSS = 4, VOXELS = ACROSS * 3 * 4 };
    static float ramp[NUMBERS];
    double gradient[VOXELS], sets[SETS][VOXELS], squares = 0;
    float density[VOXELS];
    Room room = room_open("symmetric.xml", 2, 0);
    int param = rey_param_find(room.scene, "cloud.sigma_t.data");
    assert_true(param >= 0);
    memcpy(density, rey_param_values(room.scene, param), sizeof density);
    for (int i = 0; i < VOXELS; i++) {
        density[i] = density[i % ACROSS < ACROSS / 2 ? i : i + ACROSS - 1 - 2 * (i % ACROSS)];
    }
    ok(room, rey_param_set(room.scene, param, density, VOXELS));
    for (int i = 0; i < NUMBERS; i++) {
        ramp[i] = (float)(i / 3 / SIZE + 6) / NUMBERS; // from row to row
    }
    rey_render_def def = def_make(1024, 3, SETS);
    ok(room, rey_vjp(room.scene, &def, (rey_selection){&param, 1}, ramp, gradient, sets[0], NULL));
    for (int i = 0; i < VOXELS; i++) {
        squares += gradient[i] * gradient[i] / VOXELS;
    }
    for (int i = 0; i < VOXELS; i++) {
        int other = i + ACROSS - 1 - 2 * (i % ACROSS);
        double off = gradient[i] - gradient[other], error2 = 0;
        for (int s = 0; s < SETS; s++) {
            double one = sets[s][i] - sets[s][other] - off;
            error2 += one * one / (SETS * (SETS - 1));
        }
        if (fabs(off) > 5 * sqrt(error2) || sqrt(error2 * sample_share()) > 0.15 * sqrt(squares)) {
            fail_msg("voxel %d: %g, its mirror image %g +- %g of %g", i, gradient[i], gradient[other], sqrt(error2), sqrt(squares));
        }
    }
    room_close(room);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_half_space), cmocka_unit_test(test_score),
                                       cmocka_unit_test(test_symmetry)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
