// test_spectrum.c: spectra to linear sRGB against tabulated values, the text format, named materials.
#include "base/context.h"
#include "io/spectrum.h"

#include <math.h>
#include <setjmp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

static int setup(void **state) {
    return rey_context_create(NULL, (rey_context **)state);
}

static int teardown(void **state) {
    rey_context_destroy(*state);
    return 0;
}

static void assert_rgb(const double rgb[3], double r, double g, double b, double tolerance) {
    if (fabs(rgb[0] - r) > tolerance || fabs(rgb[1] - g) > tolerance || fabs(rgb[2] - b) > tolerance) {
        fail_msg("%.7f %.7f %.7f, expected %g %g %g", rgb[0], rgb[1], rgb[2], r, g, b);
    }
}

// Values computed independently with the documented conversion.
static void test_worked_values(void **state) {
    UNUSED(state);
    const double w[] = {400, 500, 600, 700}, lamp[] = {0, 8, 15.6, 18.4}, weak[] = {0, 0.3, 0.8, 1.1};
    const double ends[] = {400, 700}, grey[] = {0.78, 0.78};
    double rgb[3];
    rey_spectrum_to_rgb(&(rey_spectrum){0, 4, w, lamp}, REY_COLOUR_EMISSION, rgb);
    assert_rgb(rgb, 20.710837, 10.854634, 2.771152, 2e-6);
    rey_spectrum_to_rgb(&(rey_spectrum){0, 4, w, weak}, REY_COLOUR_EMISSION, rgb);
    assert_rgb(rgb, 1.12687, 0.488194, 0.088034, 2e-6);
    rey_spectrum_to_rgb(&(rey_spectrum){0, 2, ends, grey}, REY_COLOUR_REFLECTANCE, rgb);
    assert_rgb(rgb, 0.776367, 0.77981, 0.776029, 2e-6);
    rey_spectrum_to_rgb(&(rey_spectrum){1, 0, NULL, NULL}, REY_COLOUR_EMISSION, rgb);
    assert_rgb(rgb, 1.204794, 0.948291, 0.908916, 1e-9);
    rey_spectrum_to_rgb(&(rey_spectrum){0.3, 0, NULL, NULL}, REY_COLOUR_REFLECTANCE, rgb);
    assert_rgb(rgb, 0.3, 0.3, 0.3, 0);
    rey_spectrum_to_rgb(&(rey_spectrum){3, 0, NULL, NULL}, REY_COLOUR_UNBOUNDED, rgb);
    assert_rgb(rgb, 3, 3, 3, 0);
}

static void test_clipping(void **state) {
    UNUSED(state);
    // A narrow green is outside the sRGB gamut: red would be negative.
    const double green[] = {515, 520, 525}, line[] = {0, 90, 0};
    double rgb[3], open[3];
    rey_spectrum_to_rgb(&(rey_spectrum){0, 3, green, line}, REY_COLOUR_REFLECTANCE, rgb);
    rey_spectrum_to_rgb(&(rey_spectrum){0, 3, green, line}, REY_COLOUR_UNBOUNDED, open);
    assert_true(rgb[0] == 0 && rgb[1] == 1 && open[0] == 0 && open[1] > 1);
    assert_true(rey_luminance((double[]){1, 1, 1}) == 0.212671 + 0.715160 + 0.072169);
}

static void test_tables(void **state) {
    UNUSED(state);
    double xyz[3], sum = 0, under_d65 = 0;
    rey_cie1931(600, xyz);
    assert_rgb(xyz, 1.0622, 0.631, 0.0008, 1e-9);
    assert_true(fabs(rey_d65(456) - 117.49) < 1e-2 && fabs(rey_d65(700) - 71.6091) < 1e-4);
    assert_true(rey_d65(560) == 100 && rey_d65(350) == 0 && rey_d65(840) == 0 && rey_d65(NAN) == 0);
    for (int i = 0; i < 4700; i++) { // midpoint rule
        double w = 360.05 + i * 0.1;
        rey_cie1931(w, xyz);
        sum += xyz[1] * 0.1;
        under_d65 += xyz[1] * rey_d65(w) * REY_D65_SCALE * 0.1;
    }
    assert_true(fabs(sum - 106.857) < 1e-3);
    assert_true(fabs(under_d65 / sum - 1) < 2e-3);
    rey_cie1931(830, xyz);
    assert_true(xyz[1] > 0);
    rey_cie1931(830.001, xyz);
    assert_true(xyz[1] == 0);
}

static void test_blackbody(void **state) {
    UNUSED(state);
    assert_true(fabs(rey_blackbody(456, 5000) / 10997.9 - 1) < 1e-5);
    assert_true(fabs(rey_blackbody(700, 5000) / 11812 - 1) < 1e-5);
    assert_true(rey_blackbody(350, 5000) == 0 && rey_blackbody(840, 5000) == 0 && rey_blackbody(500, 0) == 0);
    double cold[3], warm[3], slope[3], more[3], less[3];
    rey_blackbody_to_rgb(2800, 0, 1000, warm, NULL);
    rey_blackbody_to_rgb(6504, 0, 1000, cold, slope);
    assert_true(warm[0] > warm[1] && warm[1] > warm[2] && cold[0] > warm[0]);
    assert_true(fabs(cold[0] / cold[1] - 1.06028) < 1e-4 && fabs(cold[2] / cold[1] - 1.05314) < 1e-4); // close to white
    rey_blackbody_to_rgb(6505, 0, 1000, more, NULL);
    rey_blackbody_to_rgb(6503, 0, 1000, less, NULL);
    for (int c = 0; c < 3; c++) {
        assert_true(fabs((more[c] - less[c]) / 2 / slope[c] - 1) < 1e-6);
    }
    rey_blackbody_to_rgb(900, 0, 1000, warm, slope); // more yellow than sRGB
    assert_true(warm[0] > 0 && slope[0] > 0 && warm[2] == 0 && slope[2] == 0);
    rey_blackbody_to_rgb(5000, 360, 560, less, NULL);
    rey_blackbody_to_rgb(5000, 560.1, 830, more, NULL);
    rey_blackbody_to_rgb(5000, 0, 1000, warm, NULL);
    assert_true(fabs((less[1] + more[1]) / warm[1] - 1) < 1e-12 && less[1] > 0 && more[1] > 0);
    rey_blackbody_to_rgb(0, 0, 1000, warm, slope);
    assert_true(warm[0] == 0 && slope[0] == 0);
}

static void test_materials(void **state) {
    UNUSED(state);
    double ior = 0, eta[3], k[3];
    assert_true(rey_named_ior("BK7", &ior) && ior == 1.5046);
    assert_true(rey_named_ior("carbon dioxide", &ior) && ior == 1.00045);
    assert_false(rey_named_ior("unobtainium", &ior));
    assert_true(rey_named_metal("Au", eta, k) && eta[0] < 0.2 && k[0] > 3);
    assert_true(rey_named_metal("none", eta, k) && eta[0] == 0 && k[2] == 1);
    assert_false(rey_named_metal("au", eta, k));
    assert_string_equal(rey_named_ior_name(NULL, 0), "vacuum");
    assert_string_equal(rey_named_metal_name(NULL, 1), "Ag");
    assert_null(rey_named_metal_name(NULL, 72));
    assert_null(rey_named_ior_name(NULL, 23));
}

// ---- text files --------------------------------------------------------------------------------------------------

static void expect_error(rey_context *ctx, const char *text, const char *message) {
    rey_spectrum s;
    double *storage = NULL;
    assert_int_equal(rey_spectrum_read_memory(ctx, "f", text, strlen(text), &s, &storage), REY_ERROR_FORMAT);
    assert_string_equal(rey_error(ctx), message);
    assert_null(storage);
}

static void test_text(void **state) {
    rey_context *ctx = *state;
    rey_spectrum s;
    double *storage = NULL;
    const char *good = "# a comment that is long enough to exceed the line buffer of the reader, because comments may "
                       "be any length and nobody wants a measured spectrum refused for the length of the credits that "
                       "its makers were proud enough to write above their numbers, which can go on and on and on\n"
                       "  400.5\t1e-1 # end\r\n\n500 2";
    assert_int_equal(rey_spectrum_read_memory(ctx, "f", good, strlen(good), &s, &storage), REY_OK);
    assert_int_equal(s.count, 2);
    assert_true(s.wavelengths[0] == 400.5 && s.values[0] == 0.1 && s.wavelengths[1] == 500 && s.values[1] == 2);
    rey_free(ctx, storage);
    expect_error(ctx, "", "f:1: the spectrum ends after 0 pairs, expected at least 2");
    expect_error(ctx, "400 1\n", "f:2: the spectrum ends after 1 pairs, expected at least 2");
    expect_error(ctx, "400 1\n500\n", "f:2: bad line '500', expected 'wavelength value'");
    expect_error(ctx, "400 1\n500 1 2\n", "f:2: bad line '500 1 2', expected 'wavelength value'");
    expect_error(ctx, "400 1\n500 nan\n", "f:2: bad line '500 nan', expected 'wavelength value'");
    expect_error(ctx, "400 1\n400 1\n", "f:2: wavelength 400 follows 400, expected ascending order");
    assert_int_equal(rey_spectrum_read_memory(ctx, "f", "400 1\n5\0 2", 10, &s, &storage), REY_ERROR_FORMAT);
    assert_int_equal(rey_spectrum_read(ctx, "/nowhere.spd", &s, &storage), REY_ERROR_IO);
    assert_int_equal(rey_spectrum_read(ctx, TEST_DATA_DIR, &s, &storage), REY_ERROR_IO);
}

// ---- tables made by others ---------------------------------------------------------------------------------------

static char *facts_path(char *buffer, size_t bytes, const char *name) {
    const char *folder = getenv("REYNOLDS_CONFORMANCE_DIR");
    snprintf(buffer, bytes, "%s/%s", folder ? folder : PROJECT_DIR "/../shared/conformance", name);
    return buffer;
}

static char *load_text(const char *path) {
    FILE *stream = fopen(path, "rb");
    if (!stream) {
        return NULL;
    }
    char *text = calloc(1, 1 << 16);
    size_t got = fread(text, 1, (1 << 16) - 1, stream);
    fclose(stream);
    assert_true(got < (1 << 16) - 1);
    return text;
}

// The number of the array after `"key":` from `from` on; advances.
static const char *read_three(const char *from, const char *key, double out[3]) {
    const char *at = strstr(from, key);
    assert_non_null(at);
    at = strchr(at, '[') + 1;
    for (int i = 0; i < 3; i++) {
        char *end;
        out[i] = strtod(at, &end);
        at = end + strspn(end, ", \n\r\t");
    }
    return at;
}

static void test_metal_facts(void **state) {
    UNUSED(state);
    char path[4096];
    char *text = load_text(facts_path(path, sizeof path, "facts/rgb_from_spectra.json"));
    if (!text) {
        print_message("skipped: no file %s\n", path);
        skip();
    }
    const char *metals = strstr(text, "\"metals\"");
    assert_non_null(metals);
    const char *name;
    for (int i = 1; (name = rey_named_metal_name(NULL, i)); i++) {
        char key[64];
        double eta[3], k[3], expected_eta[3], expected_k[3];
        snprintf(key, sizeof key, "\"%s\"", name);
        const char *at = strstr(metals, key);
        assert_non_null(at);
        at = read_three(at, "\"eta\"", expected_eta);
        read_three(at, "\"k\"", expected_k);
        assert_true(rey_named_metal(name, eta, k));
        assert_rgb(eta, expected_eta[0], expected_eta[1], expected_eta[2], 1e-6);
        assert_rgb(k, expected_k[0], expected_k[1], expected_k[2], 1e-6);
    }
    free(text);
}

// Measured aluminium, from its file: the conversion reproduces the table.
static void test_metal_spectra(void **state) {
    rey_context *ctx = *state;
    static const char *const names[] = {"data/ior/Al.eta.spd", "data/ior/Al.k.spd"};
    double table[2][3];
    assert_true(rey_named_metal("Al", table[0], table[1]));
    for (int i = 0; i < 2; i++) {
        char path[4096];
        rey_spectrum s;
        double *storage, rgb[3];
        if (rey_spectrum_read(ctx, facts_path(path, sizeof path, names[i]), &s, &storage)) {
            print_message("skipped: no file %s\n", path);
            skip();
        }
        rey_spectrum_to_rgb_unweighted(&s, rgb);
        assert_rgb(rgb, table[i][0], table[i][1], table[i][2], 1e-4);
        rey_free(ctx, storage);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_worked_values), cmocka_unit_test(test_clipping),
        cmocka_unit_test(test_tables),        cmocka_unit_test(test_blackbody),
        cmocka_unit_test(test_materials),     cmocka_unit_test_setup_teardown(test_text, setup, teardown),
        cmocka_unit_test(test_metal_facts),   cmocka_unit_test_setup_teardown(test_metal_spectra, setup, teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
