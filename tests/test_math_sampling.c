// Random numbers: uniform, stratified, decorrelated, equal at every width. Microfacet normals and warps: distributed as
// their densities say.
#include "math/leaf_checks.h"
#include "math/microfacet.h"
#include "math/rng.h"
#include "math/warp.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

#include <cmocka.h>

// How many standard deviations chi-square lies above its mean, by the cube-root transformation of Wilson and Hilferty.
// Cells are pooled in order until 5 are expected.
static double chi_square_z(const double *observed, const double *expected, int cells) {
    double chi = 0, o = 0, e = 0;
    int freedom = -1;
    for (int i = 0; i < cells; i++) {
        o += observed[i];
        e += expected[i];
        if (e >= 5 || i == cells - 1) {
            chi += e > 0 ? (o - e) * (o - e) / e : 0;
            freedom++;
            o = e = 0;
        }
    }
    double k = 2.0 / (9 * fmax(freedom, 1));
    return (cbrt(chi / fmax(freedom, 1)) - (1 - k)) / sqrt(k);
}

// ---- random numbers ----------------------------------------------------------------------------------------------

enum { CELLS = 16 };

static SampleKey key_of(uint32_t pixel, uint32_t sample, uint32_t scramble, bool sobol) {
    return (SampleKey){pixel, sample, scramble, sobol};
}

// One number of a family of pairs that must be independent: what varies is said by kind.
static void pair_of(int kind, uint32_t i, bool sobol, double *x, double *y) {
    uint32_t scramble = rng_scramble(0, 0, 0, 0);
    SampleKey a = key_of(i, 0, scramble, sobol), b = a;
    uint32_t da = 0, db = 0;
    Vec2 two;
    switch (kind) {
    case 0: // both numbers of a sample, over pixels
        two = rng_2d(&a, 3);
        *x = two.x;
        *y = two.y;
        return;
    case 1: b.pixel += 1; break;
    case 2: db = 1; break;
    case 3: b.scramble = rng_scramble(1, 0, 0, 0); break;
    case 4: b.scramble = rng_scramble(0, 1, 0, 0); break;
    case 5: // samples of one pixel, two dimensions
        a = key_of(77, i, scramble, sobol);
        b = a;
        db = 1;
        break;
    case 6: // neighbouring pixels, sample by sample
        a = key_of(77, i, scramble, sobol);
        b = key_of(78, i, scramble, sobol);
        break;
    default: // another set, sample by sample
        a = key_of(77, i, scramble, sobol);
        b = key_of(77, i, rng_scramble(0, 1, 0, 0), sobol);
        break;
    }
    *x = rng_1d(&a, da);
    *y = rng_1d(&b, db);
}

static void test_rng_independence(void **state) {
    (void)state;
    enum { COUNT = 1 << 16 };
    for (int kind = 0; kind < 8; kind++) {
        for (int sobol = 0; sobol < 2; sobol++) {
            static double observed[CELLS * CELLS], expected[CELLS * CELLS];
            for (int c = 0; c < CELLS * CELLS; c++) {
                observed[c] = 0;
                expected[c] = (double)COUNT / (CELLS * CELLS);
            }
            for (uint32_t i = 0; i < COUNT; i++) {
                double x, y;
                pair_of(kind, i, sobol, &x, &y);
                assert_true(x >= 0 && x < 1 && y >= 0 && y < 1);
                observed[(int)(x * CELLS) * CELLS + (int)(y * CELLS)] += 1;
            }
            double z = chi_square_z(observed, expected, CELLS * CELLS);
            if (z > 3.5) {
                fail_msg("kind %d sobol %d: chi-square %.1f standard deviations above its mean", kind, sobol, z);
            }
        }
    }
}

// The first 2^k samples, and the next 2^k, have one point in each elementary interval of area 2^-k.
static void test_sobol_elementary_intervals(void **state) {
    (void)state;
    for (uint32_t trial = 0; trial < 30; trial++) {
        for (int k = 0; k <= 10; k++) {
            for (int a = 0; a <= k; a++) {
                for (uint32_t block = 0; block < 2; block++) {
                    char seen[1024] = {0};
                    for (uint32_t i = 0; i < 1u << k; i++) {
                        SampleKey key = key_of(trial * 7919, (block << k) + i, rng_scramble(trial, 0, 0, 0), true);
                        Vec2 u = rng_2d(&key, trial % 5);
                        int cell = (int)(u.x * (float)(1 << a)) << (k - a) | (int)(u.y * (float)(1 << (k - a)));
                        assert_true(++seen[cell] == 1);
                    }
                }
            }
        }
    }
}

// The integral of x y + sin(5 x) over many pixels: unbiased, and far less noisy than independent samples.
static void test_sobol_variance(void **state) {
    (void)state;
    enum { PIXELS = 2000, SAMPLES = 64 };
    double truth = 0.25 + (1 - cos(5.0)) / 5, variance[2], mean[2];
    for (int sobol = 0; sobol < 2; sobol++) {
        double sum = 0, squares = 0;
        for (uint32_t p = 0; p < PIXELS; p++) {
            double pixel = 0;
            for (uint32_t s = 0; s < SAMPLES; s++) {
                SampleKey key = key_of(p, s, rng_scramble(5, 0, 1, 2), sobol);
                Vec2 u = rng_2d(&key, 9);
                pixel += ((double)u.x * (double)u.y + sin(5 * (double)u.x)) / SAMPLES;
            }
            sum += pixel - truth;
            squares += (pixel - truth) * (pixel - truth);
        }
        mean[sobol] = sum / PIXELS;
        variance[sobol] = squares / PIXELS;
        assert_true(fabs(mean[sobol]) < 4 * sqrt(variance[sobol] / PIXELS));
    }
    print_message("variance: independent %.3g, sobol %.3g\n", variance[0], variance[1]);
    assert_true(variance[1] < variance[0] / 100);
}

static void test_rng_widths(void **state) {
    (void)state;
    enum { COUNT = 1000 };
    static float expected[3 * COUNT], got[3 * COUNT];
    for (unsigned trial = 0; trial < 8; trial++) {
        bool sobol = trial & 1;
        leaf_rng_w1(trial * 12345, rng_scramble(trial, 0, 0, 0), trial * 3, sobol, COUNT, expected);
        leaf_rng_double(trial * 12345, rng_scramble(trial, 0, 0, 0), trial * 3, sobol, COUNT, got);
        assert_memory_equal(expected, got, sizeof got);
        if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) {
            leaf_rng_w8(trial * 12345, rng_scramble(trial, 0, 0, 0), trial * 3, sobol, COUNT, got);
            assert_memory_equal(expected, got, sizeof got);
        }
        if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl")) {
            leaf_rng_w16(trial * 12345, rng_scramble(trial, 0, 0, 0), trial * 3, sobol, COUNT, got);
            assert_memory_equal(expected, got, sizeof got);
        }
    }
}

// ---- microfacet normals ------------------------------------------------------------------------------------------

enum { ANGLES = 24, RADII = 16, SUBCELLS = 12, SAMPLES = 60000 };

// Normals on a polar grid in stretched slopes: radius w / (1 - w), w in [0, 1).
static Vec3 normal_at(const Microfacet *mf, double phi, double w, double *jacobian) {
    double radius = w / (1 - w), x = mf->alpha_u * radius * cos(phi), y = mf->alpha_v * radius * sin(phi);
    double z = 1 / sqrt(1 + x * x + y * y);
    // solid angle = z^3 dx dy, dx dy = au av radius dradius dphi, dradius = dw / (1 - w)^2
    *jacobian = z * z * z * mf->alpha_u * mf->alpha_v * radius / ((1 - w) * (1 - w));
    return v3((float)(x * z), (float)(y * z), (float)z);
}
static int cell_of(const Microfacet *mf, Vec3 m) {
    double x = (double)m.x / mf->alpha_u / m.z, y = (double)m.y / mf->alpha_v / m.z;
    double radius = sqrt(x * x + y * y), phi = atan2(y, x);
    phi += phi < 0 ? 6.283185307179586 : 0;
    int a = (int)(phi / 6.283185307179586 * ANGLES), r = (int)(radius / (1 + radius) * RADII);
    return (a < ANGLES ? a : ANGLES - 1) * RADII + (r < RADII ? r : RADII - 1);
}

static void check_microfacet(const Microfacet *mf, Vec3 wi, uint32_t seed) {
    static double observed[ANGLES * RADII], expected[ANGLES * RADII];
    double total = 0;
    for (int c = 0; c < ANGLES * RADII; c++) {
        observed[c] = expected[c] = 0;
        for (int s = 0; s < SUBCELLS * SUBCELLS; s++) {
            double phi = (c / RADII + (s / SUBCELLS + 0.5) / SUBCELLS) / ANGLES * 6.283185307179586;
            double w = (c % RADII + (s % SUBCELLS + 0.5) / SUBCELLS) / RADII, jacobian;
            Vec3 m = normal_at(mf, phi, w, &jacobian);
            expected[c] += microfacet_pdf(mf, wi, m) * jacobian * 6.283185307179586 * SAMPLES /
                           (ANGLES * RADII * SUBCELLS * SUBCELLS);
        }
        total += expected[c] / SAMPLES;
    }
    for (uint32_t i = 0; i < SAMPLES; i++) {
        SampleKey key = key_of(seed, i, 1, false);
        Vec2 u = rng_2d(&key, 0);
        Vec3 m = microfacet_sample(mf, wi, u.x, u.y);
        assert_true(fabsf(v3_length(m) - 1) < 1e-5f && m.z >= 0);
        observed[cell_of(mf, m)] += 1;
    }
    double z = chi_square_z(observed, expected, ANGLES * RADII);
    if (fabs(total - 1) > 2e-3 || z > 4) {
        fail_msg("ggx %d visible %d alpha %g %g wi.z %g: density integrates to %.5f, chi-square %.1f deviations above", mf->ggx,
                 mf->sample_visible, (double)mf->alpha_u, (double)mf->alpha_v, (double)wi.z, total, z);
    }
}

static void test_microfacet_sampling(void **state) {
    (void)state;
    const float alphas[][2] = {{0.1f, 0.1f}, {0.5f, 0.5f}, {0.05f, 0.6f}, {1, 1}, {0.001f, 0.001f}};
    const float cosines[] = {1, 0.7f, 0.1f, 0.01f};
    uint32_t seed = 0;
    for (int kind = 0; kind < 4; kind++) {
        for (int a = 0; a < COUNT_OF(alphas); a++) {
            for (int c = 0; c < (kind & 2 ? COUNT_OF(cosines) : 1); c++) {
                Microfacet mf = microfacet_make(kind & 1, kind & 2, alphas[a][0], alphas[a][1]);
                float s = sqrtf(1 - cosines[c] * cosines[c]);
                check_microfacet(&mf, v3(s * 0.6f, s * -0.8f, cosines[c]), seed++);
            }
        }
    }
}

// The Beckmann root finder against the equation that it solves, up to the ends of its range.
static void test_beckmann_slope(void **state) {
    (void)state;
    for (int i = 0; i <= 50; i++) {
        for (int j = 0; j <= 200; j++) {
            double theta = 1.5707963 * i / 50, u = j == 0 ? 1e-6 : j == 200 ? 1 - 1e-6 : j / 200.0;
            double c = (double)(float)cos(theta), s = sqrt(1 - c * c), a = s > 1e-9 ? fmin(c / s, 9) : 9;
            double x = (double)microfacet_beckmann_slope((float)s, (float)c, (float)u);
            double area = c * (1 + erf(a)) + s * exp(-a * a) / sqrt(3.14159265358979);
            double below = c * (1 + erf(x)) + s * exp(-x * x) / sqrt(3.14159265358979);
            if (!(fabs(below / area - (double)(float)u) < 2e-5)) {
                fail_msg("theta %g u %g: slope %g covers %g", theta, u, x, below / area);
            }
        }
    }
}

// ---- warps -------------------------------------------------------------------------------------------------------

// Counts of a fine regular grid of inputs over equally likely cells of the outputs.
static void check_warp(const char *name, Vec3 (*warp)(Vec2), double (*uniform)(Vec3)) {
    enum { GRID = 1024, BINS = 8 };
    static int count[BINS][BINS];
    memset(count, 0, sizeof count);
    for (int i = 0; i < GRID * GRID; i++) {
        Vec3 v = warp((Vec2){((float)(i % GRID) + 0.5f) / GRID, ((float)(i / GRID) + 0.5f) / GRID});
        double phi = atan2(v.y, v.x) / 6.283185307179586 + 0.5;
        int a = (int)(phi * BINS), b = (int)(uniform(v) * BINS);
        count[a < BINS ? a : BINS - 1][b < 0 ? 0 : b < BINS ? b : BINS - 1]++;
    }
    for (int i = 0; i < BINS * BINS; i++) {
        double share = (double)count[i / BINS][i % BINS] * BINS * BINS / (GRID * GRID);
        if (fabs(share - 1) > 0.03) {
            fail_msg("%s: cell %d holds %.4f of its share", name, i, share);
        }
    }
}
static Vec3 disk(Vec2 u) { return v3(warp_uniform_disk(u).x, warp_uniform_disk(u).y, 0); }
static Vec3 disk_polar(Vec2 u) { return v3(warp_uniform_disk_polar(u).x, warp_uniform_disk_polar(u).y, 0); }
static Vec3 sphere(Vec2 u) { return warp_uniform_sphere(u); }
static Vec3 hemisphere(Vec2 u) { return warp_uniform_hemisphere(u); }
static Vec3 cone(Vec2 u) { return warp_uniform_cone(u, 0.8f); }
static Vec3 cosine_hemisphere(Vec2 u) { return warp_cosine_hemisphere(u); }
static double by_radius(Vec3 v) { return (double)(v.x * v.x + v.y * v.y); }
static double by_sphere(Vec3 v) { return 0.5 * (1 - (double)v.z); }
static double by_hemisphere(Vec3 v) { return 1 - (double)v.z; }
static double by_cone(Vec3 v) { return (1 - (double)v.z) / 0.2; }

static void test_warp_distributions(void **state) {
    (void)state;
    check_warp("disk", disk, by_radius);
    check_warp("disk_polar", disk_polar, by_radius);
    check_warp("sphere", sphere, by_sphere);
    check_warp("hemisphere", hemisphere, by_hemisphere);
    check_warp("cone", cone, by_cone);
    check_warp("cosine_hemisphere", cosine_hemisphere, by_radius);
    // densities: 1 over the measure of a cell of equal shares
    assert_true(fabsf(warp_uniform_sphere_pdf() * 4 * PI - 1) < 1e-6f);
    assert_true(fabsf(warp_uniform_hemisphere_pdf(v3(0, 0.8f, 0.6f)) * 2 * PI - 1) < 1e-6f);
    assert_true(warp_uniform_hemisphere_pdf(v3(0, 0.8f, -0.6f)) == 0);
    assert_true(fabsf(warp_uniform_cone_pdf(v3(0, 0.6f, 0.8f), 0.75f) * 2 * PI * 0.25f - 1) < 1e-6f);
    assert_true(warp_uniform_cone_pdf(v3(0, 0.8f, 0.6f), 0.75f) == 0);
    assert_true(fabsf(warp_cosine_hemisphere_pdf(v3(0, 0.8f, 0.6f)) * PI - 0.6f) < 1e-6f);
    assert_true(warp_cosine_hemisphere_pdf(v3(0, 0.8f, -0.6f)) == 0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_rng_independence), cmocka_unit_test(test_sobol_elementary_intervals),
        cmocka_unit_test(test_sobol_variance),   cmocka_unit_test(test_rng_widths),
        cmocka_unit_test(test_microfacet_sampling), cmocka_unit_test(test_beckmann_slope),
        cmocka_unit_test(test_warp_distributions),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
