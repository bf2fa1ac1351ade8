// test_fit_media.c: small fits of what media are made of: absorption and reduced scattering, and shares of phase functions.
#include "fit_folder.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { SIZE = 8 };

static const char *const SCENE =
    "<scene version=\"3.0.0\"><default name=\"sigma_t\" value=\"0.9\"/><default name=\"albedo\" value=\"0.5\"/><default name=\"g\" "
    "value=\"0\"/><default name=\"weights\" value=\"1, 1, 1\"/><integrator type=\"volpath\"><integer name=\"max_depth\" "
    "value=\"6\"/>"
    "</integrator>"
    "<medium type=\"homogeneous\" id=\"fog\"><rgb name=\"sigma_t\" value=\"$sigma_t\"/><rgb name=\"albedo\" "
    "value=\"$albedo\"/><float "
    "name=\"scale\" value=\"2\"/><phase type=\"hg\"><float name=\"g\" value=\"$g\"/></phase></medium>"
    "<shape type=\"cube\"><transform name=\"to_world\"><translate x=\"-1.2\"/></transform><bsdf type=\"null\"/><ref "
    "name=\"interior\" id=\"fog\"/></shape>"
    "<shape type=\"cube\" id=\"box\"><transform name=\"to_world\"><translate x=\"1.2\"/></transform><bsdf type=\"null\"/><medium "
    "name=\"interior\" type=\"homogeneous\"><rgb name=\"sigma_t\" value=\"0.8\"/><rgb name=\"albedo\" value=\"0.9\"/><phase "
    "type=\"dictionary\"><string name=\"weights\" value=\"$weights\"/><phase type=\"hg\"><float name=\"g\" value=\"-0.5\"/></phase>"
    "<phase type=\"isotropic\"/><phase type=\"hg\"><float name=\"g\" value=\"0.7\"/></phase></phase></medium></shape>"
    "<emitter type=\"directional\"><vector name=\"direction\" value=\"1, -0.3, -0.2\"/><rgb name=\"irradiance\" "
    "value=\"5\"/></emitter>"
    "<sensor type=\"perspective\"><float name=\"fov\" value=\"60\"/><transform name=\"to_world\"><lookat origin=\"0, 0, 5\" "
    "target=\"0, 0, 0\" up=\"0, 1, 0\"/></transform><film type=\"hdrfilm\"><integer name=\"width\" value=\"8\"/><integer "
    "name=\"height\" value=\"8\"/><rfilter type=\"box\"/></film></sensor>"
    "<sensor type=\"perspective\"><float name=\"fov\" value=\"60\"/><transform name=\"to_world\"><lookat origin=\"-4, 1, 3\" "
    "target=\"0, 0, 0\" up=\"0, 1, 0\"/></transform><film type=\"hdrfilm\"><integer name=\"width\" value=\"8\"/><integer "
    "name=\"height\" value=\"8\"/><rfilter type=\"box\"/></film></sensor></scene>";
static const char *const TRUTH =
    "<scene version=\"3.0.0\"><default name=\"sigma_t\" value=\"0.5\"/><default name=\"albedo\" value=\"0.8\"/><default name=\"g\" "
    "value=\"0.4\"/><default name=\"weights\" value=\"0.1, 0.3, 0.6\"/><include filename=\"scene.xml\"/></scene>";
static const char *const JOB =
    "scene: scene.xml\nseed: 3\niterations: 150\nspp: 32\nviews:\n  - {target: target_0.exr}\n  - {target: target_1.exr}\n"
    "loss: l2\noptimizer: {type: adam, learning_rate: 0.1, beta2: 0.95, average: 3, schedule: cosine}\n"
    "parameters:\n  - {name: fog, parameterisation: scattering}\n"
    "  - {name: box.interior_medium.phase_function.weights, parameterisation: simplex}\n"
    "image_every: 0\nreport_spp: 4\ntruth: {scene: truth.xml}\n";

// The scene with what scatters and what absorbs in the place of what the fog's extinction is told by.
static int write_pair(const Fixture *f) {
    const char *first = strstr(SCENE, "<rgb name=\"sigma_t\" value=\"$sigma_t\"/>"), *rest = strstr(SCENE, "<float name=\"scale\"");
    char text[8192];
    if (!first || !rest) {
        return -1;
    }
    snprintf(text, sizeof text, "%.*s<rgb name=\"sigma_s\" value=\"0.45\"/><rgb name=\"sigma_a\" value=\"0.45\"/>%s",
             (int)(first - SCENE), SCENE, rest);
    return write_text(f, "pair.xml", text);
}

static int set_up(void **state) {
    Fixture *f = *state = fixture_make();
    return !f || write_text(f, "scene.xml", SCENE) || write_pair(f) || write_text(f, "truth.xml", TRUTH) ||
           write_text(f, "job.yaml", JOB) || write_targets_of_truth(f, 2, SIZE, 4096);
}

static rey_result run_fit(Fixture *f, const char *out, const char *extra, FitResult *result) {
    char folder[128], job[128];
    snprintf(folder, sizeof folder, "%s/%s", f->folder, out);
    snprintf(job, sizeof job, "%s/job.yaml", f->folder);
    FitDef def = {.job_path = job, .overrides = &extra, .override_count = extra ? 1 : 0, .output = folder, .overwrite = true};
    return rey_fit(f->ctx, &def, result);
}

static const FitRow *row_of(const FitResult *result, const char *name) {
    for (size_t i = 0; i < result->rows.count; i++) {
        if (!strcmp(ARRAY_AT(result->rows, FitRow, i).name, name)) {
            return &ARRAY_AT(result->rows, FitRow, i);
        }
    }
    fail_msg("no row %s", name);
    return NULL;
}

static void expect_close(const FitResult *result, const char *name, double limit) {
    const FitRow *row = row_of(result, name);
    assert_non_null(row->truth);
    if (!(row->error <= limit)) {
        fail_msg("%s is off by %g", name, row->error);
    }
}

// Rows that follow from others have the truth, too; shares have the sum 1.
static void test_fit_media(void **state) {
    Fixture *f = *state;
    FitResult result;
    if (run_fit(f, "a", NULL, &result)) {
        fail_msg("%s", rey_error(f->ctx));
    }
    assert_int_equal(result.rows.count, 6);
    assert_non_null(row_of(&result, "fog.phase_function.g.value")->truth);
    expect_close(&result, "fog.sigma_a", 0.1);
    expect_close(&result, "fog.reduced_sigma_s", 0.1);
    const FitRow *absorption = row_of(&result, "fog.sigma_a"), *reduced = row_of(&result, "fog.reduced_sigma_s");
    assert_float_equal((double)absorption->truth[0], 0.1, 1e-5);
    assert_float_equal((double)reduced->truth[1], 0.24, 1e-5);
    assert_float_equal((double)absorption->start[0], 0.45, 1e-5);
    const FitRow *weights = row_of(&result, "box.interior_medium.phase_function.weights");
    const double cosine[3] = {-0.5, 0, 0.7};
    double sum = 0, mean = 0;
    for (int i = 0; i < 3; i++) {
        sum += (double)weights->found[i];
        mean += (double)weights->found[i] * cosine[i];
    }
    assert_float_equal(sum, 1, 1e-4);
    assert_float_equal(mean, 0.37, 0.04);
    rey_fit_result_free(&result);
}

// A known g is no unknown, and counts for reduced scattering.
static void test_known_g(void **state) {
    Fixture *f = *state;
    FitResult result;
    assert_int_equal(run_fit(f, "b", "parameters=[{name: fog, parameterisation: scattering, g: known}]", &result), REY_OK);
    assert_int_equal(result.rows.count, 4);
    const FitRow *sigma_t = row_of(&result, "fog.sigma_t.value.value"), *albedo = row_of(&result, "fog.albedo.value.value");
    const FitRow *reduced = row_of(&result, "fog.reduced_sigma_s");
    assert_float_equal((double)reduced->found[0], (double)(sigma_t->found[0] * albedo->found[0]), 1e-5); // g is 0 in this scene
    rey_fit_result_free(&result);
}

// A medium that has these coefficients itself moves along the same variables.
static void test_pair(void **state) {
    Fixture *f = *state;
    FitResult result;
    if (run_fit(f, "c", "scene=pair.xml", &result)) {
        fail_msg("%s", rey_error(f->ctx));
    }
    assert_int_equal(result.rows.count, 6);
    expect_close(&result, "fog.sigma_a", 0.1);
    expect_close(&result, "fog.reduced_sigma_s", 0.1);
    const FitRow *absorption = row_of(&result, "fog.sigma_a"), *own = row_of(&result, "fog.sigma_a.value.value");
    assert_float_equal((double)absorption->truth[0], 0.1, 1e-5);
    assert_float_equal((double)absorption->start[0], 0.45, 1e-5);
    assert_memory_equal(absorption->found, own->found, 3 * sizeof(float));
    rey_fit_result_free(&result);
}

static void keep_words(void *user, const char *words) { snprintf(user, 512, "%s", words); }

// Shares that do not sum up to 1 are divided by their sum, which is told.
static void test_shares_are_scaled(void **state) {
    Fixture *f = *state;
    for (int i = 0; i < 2; i++) {
        char job[128], folder[128], words[512] = "";
        const char *sets[] = {i ? "parameters.1.start=[0.25,0.25,0.5]" : "parameters.1.start=[1,1,2]", "iterations=0",
                              "report_spp=0"};
        FitResult result;
        path_of(f, "job.yaml", job);
        path_of(f, "scaled", folder);
        FitDef def = {.job_path = job, .overrides = sets, .override_count = COUNT_OF(sets), .output = folder, .overwrite = true,
                      .note = keep_words, .user = words};
        if (rey_fit(f->ctx, &def, &result)) {
            fail_msg("%s", rey_error(f->ctx));
        }
        assert_float_equal((double)row_of(&result, "box.interior_medium.phase_function.weights")->start[0], 0.25, 1e-6);
        rey_fit_result_free(&result);
        const char *expected = "parameter 'box.interior_medium.phase_function.weights': the shares of the start summed up to 4";
        assert_true(i ? !strstr(words, "shares") : strstr(words, expected) != NULL);
    }
}

static void test_errors(void **state) {
    Fixture *f = *state;
    static const char *const cases[][2] = {
        {"parameters.0.name=fog.albedo", "scattering is for media, such as"},
        {"parameters.0.bounds=[0, 1]", "parameterisation scattering has no bounds"},
        {"parameters.0.start=1", "parameterisation scattering starts with what the scene has"},
        {"parameters.1.g=known", "g is for 'parameterisation: scattering'"},
        {"parameters.1.name=fog.scale.value", "simplex is for two or more shares"},
        {"optimizer={type: lbfgs}", "lbfgs does not move what is on a simplex"},
        {"parameters.2.name=fog.albedo.value.value", "entry 0 of 'parameters' names it already"},
    };
    for (int i = 0; i < COUNT_OF(cases); i++) {
        FitResult result;
        rey_result code = run_fit(f, "c", cases[i][0], &result);
        rey_fit_result_free(&result);
        if (!code || !strstr(rey_error(f->ctx), cases[i][1])) {
            fail_msg("%s: expected '%s' in '%s'", cases[i][0], cases[i][1], rey_error(f->ctx));
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_fit_media),
        cmocka_unit_test(test_known_g),
        cmocka_unit_test(test_pair),
        cmocka_unit_test(test_shares_are_scaled),
        cmocka_unit_test(test_errors),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
