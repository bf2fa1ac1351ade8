// test_fit_samples.c: gradients of samples of their own (gradient_spp) have the mean of those of the pictures' samples.
#include "fit_folder.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum { SIZE = 8, NUMBERS = 6 };

// A rough sheet of metal before a painted wall, and a lamp that lights both.
static const char *const SCENE =
    "<scene version=\"3.0.0\"><integrator type=\"path\"><integer name=\"max_depth\" value=\"4\"/></integrator>"
    "<sensor type=\"perspective\"><float name=\"fov\" value=\"50\"/><transform name=\"to_world\"><lookat origin=\"0, -3, 2\" "
    "target=\"0, 0, 0.3\" up=\"0, 0, 1\"/></transform><film type=\"hdrfilm\"><integer name=\"width\" value=\"8\"/><integer "
    "name=\"height\" value=\"8\"/><rfilter type=\"box\"/></film></sensor>"
    "<shape type=\"rectangle\"><bsdf type=\"roughconductor\" id=\"metal\"><float name=\"alpha\" value=\"0.3\"/></bsdf></shape>"
    "<shape type=\"rectangle\"><transform name=\"to_world\"><rotate x=\"1\" angle=\"90\"/><translate y=\"1\"/>"
    "</transform><bsdf type=\"diffuse\" id=\"paint\"><rgb name=\"reflectance\" value=\"%s\"/></bsdf></shape>"
    "<shape type=\"rectangle\"><transform name=\"to_world\"><rotate x=\"1\" angle=\"180\"/><translate z=\"2\"/></transform>"
    "<emitter type=\"area\" id=\"lamp\"><rgb name=\"radiance\" value=\"%s\"/></emitter></shape></scene>";
static const char *const JOB =
    "scene: scene.xml\niterations: 400\nspp: 4\nloss: l2\nviews: [{target: target_0.exr}]\nreport_spp: 0\n"
    "optimizer: {type: sgd, momentum: 0, learning_rate: 0.002}\n"
    "parameters: [paint.reflectance.value, lamp.radiance.value]\n";

static int set_up(void **state) {
    Fixture *f = *state = fixture_make();
    char start[4096], truth[4096];
    snprintf(start, sizeof start, SCENE, "0.3 0.5 0.4", "3 2 4");
    snprintf(truth, sizeof truth, SCENE, "0.6 0.3 0.5", "5 1 6");
    return !f || write_text(f, "job.yaml", JOB) || write_text(f, "scene.xml", start) || write_text(f, "truth.xml", truth) ||
           write_targets_of_truth(f, 1, SIZE, 256);
}

// Where a fit ends whose steps are too short to move anything far: the sum of its gradients.
static void add_gradients(const Fixture *f, const char *gradient_spp, double sum[NUMBERS]) {
    char job[128], folder[128];
    path_of(f, "job.yaml", job);
    path_of(f, gradient_spp, folder);
    FitDef def = {.job_path = job, .overrides = &gradient_spp, .override_count = 1, .output = folder};
    FitResult result;
    if (rey_fit(f->ctx, &def, &result)) {
        fail_msg("%s", rey_error(f->ctx));
    }
    assert_int_equal(result.rows.count, 2);
    for (int k = 0; k < NUMBERS; k++) {
        const FitRow *row = &ARRAY_AT(result.rows, FitRow, k / 3);
        sum[k] = (double)row->found[k % 3] - (double)row->start[k % 3];
    }
    rey_fit_result_free(&result);
}

static void test_same_mean(void **state) {
    double products[NUMBERS], own[NUMBERS];
    add_gradients(*state, "gradient_spp=0", products);
    const char *const spp[] = {"gradient_spp=1", "gradient_spp=6"};
    for (int i = 0; i < COUNT_OF(spp); i++) {
        add_gradients(*state, spp[i], own);
        for (int k = 0; k < NUMBERS; k++) {
            assert_true(fabs(products[k]) > 1e-3);
            assert_float_equal(own[k], products[k], 0.05 * fabs(products[k]));
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_same_mean)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
