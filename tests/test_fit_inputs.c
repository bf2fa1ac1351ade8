// test_fit_inputs.c: a fit goes on with what it began with only, and leaves nothing of an earlier fit in its folder.
#include "fit_folder.h"
#include "fit/inputs.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum { SIZE = 8 };

// A floor with a picture, packed in bytes until it is an unknown, and a wall, under a lamp.
static const char *const SCENE =
    "<scene version=\"3.0.0\"><integrator type=\"path\"><integer name=\"max_depth\" value=\"%d\"/></integrator>"
    "<sensor type=\"perspective\"><float name=\"fov\" value=\"50\"/><transform name=\"to_world\"><lookat origin=\"0, -3, 2\" "
    "target=\"0, 0, 0.3\" up=\"0, 0, 1\"/></transform><film type=\"hdrfilm\"><integer name=\"width\" value=\"8\"/><integer "
    "name=\"height\" value=\"8\"/><rfilter type=\"box\"/></film></sensor>"
    "<shape type=\"rectangle\" id=\"floor\"><bsdf type=\"diffuse\"><texture type=\"bitmap\" name=\"reflectance\"><string "
    "name=\"filename\" value=\"floor.png\"/></texture></bsdf></shape>"
    "<shape type=\"rectangle\" id=\"wall\"><transform name=\"to_world\"><rotate x=\"1\" angle=\"90\"/><translate y=\"1\"/>"
    "</transform><bsdf type=\"diffuse\" id=\"paint\"><rgb name=\"reflectance\" value=\"%s\"/></bsdf></shape>"
    "<shape type=\"rectangle\"><transform name=\"to_world\"><rotate x=\"1\" angle=\"180\"/><translate z=\"2\"/></transform>"
    "<bsdf type=\"diffuse\" id=\"lid\"><rgb name=\"reflectance\" value=\"%s\"/></bsdf>"
    "<emitter type=\"area\"><rgb name=\"radiance\" value=\"3\"/></emitter></shape></scene>";
static const char *const JOB =
    "scene: scene.xml\niterations: 3\nspp: 4\nviews: [{target: target_0.exr, mask: mask.exr}]\nreport_spp: 4\n"
    "parameters: [{name: paint.reflectance.value, learning_rate: 0.05}]\n";

static int write_scene(const Fixture *f, const char *name, int depth, const char *wall, const char *lid) {
    char text[4096];
    snprintf(text, sizeof text, SCENE, depth, wall, lid);
    return write_text(f, name, text);
}

static int write_floor(const Fixture *f, float corner) {
    float image[2 * 2 * 3] = {corner, 0.2f, 0.1f, 0.5f, 0.5f, 0.4f, 0.3f, 0.3f, 0.6f, 0.8f, 0.7f, 0.6f};
    char path[128];
    path_of(f, "floor.png", path);
    return rey_png_write(f->ctx, path, image, 2, 2);
}

static int write_mask(const Fixture *f, float corner) {
    float image[SIZE * SIZE * 3];
    char path[128];
    for (int i = 0; i < SIZE * SIZE * 3; i++) {
        image[i] = i < 3 ? corner : 1;
    }
    path_of(f, "mask.exr", path);
    return rey_exr_write(f->ctx, path, image, SIZE, SIZE, 3, NULL);
}

static int write_all(const Fixture *f) {
    return write_floor(f, 0.9f) || write_scene(f, "scene.xml", 4, "0.3", "0.5") || write_mask(f, 0.5f) ||
           write_scene(f, "truth.xml", 4, "0.7", "0.5") || write_targets_of_truth(f, 1, SIZE, 16);
}

static int set_up(void **state) {
    Fixture *f = *state = fixture_make();
    return !f || write_text(f, "job.yaml", JOB) || write_all(f);
}

static bool stop_at(void *user, const FitProgress *progress) {
    return progress->finishing || progress->iteration < *(const int *)user;
}

enum { ANEW, RESUME, OVERWRITE };
static rey_result run_fit(const Fixture *f, int how, int stop, const char *extra) {
    char job[128], folder[128];
    FitResult result;
    path_of(f, "job.yaml", job);
    path_of(f, "out", folder);
    FitDef def = {.job_path = job, .overrides = &extra, .override_count = extra ? 1 : 0, .output = folder,
                  .resume = how == RESUME, .overwrite = how == OVERWRITE, .progress = stop_at, .user = &stop};
    rey_result code = rey_fit(f->ctx, &def, &result);
    rey_fit_result_free(&result);
    return code;
}

static void expect_run(const Fixture *f, int how) {
    if (run_fit(f, how, 9, NULL)) {
        fail_msg("%s", rey_error(f->ctx));
    }
}

static void expect_refusal(const Fixture *f, int how, const char *words) {
    rey_result code = run_fit(f, how, 9, NULL);
    if (code != REY_ERROR_PARAM || !strstr(rey_error(f->ctx), words)) {
        fail_msg("result %d: '%s', expected '%s'", code, rey_error(f->ctx), words);
    }
}

// Each input in turn is changed after two iterations.
static void test_changed_inputs(void **state) {
    const Fixture *f = *state;
    assert_int_equal(run_fit(f, OVERWRITE, 2, NULL), REY_ERROR_CANCELLED);
    assert_int_equal(write_mask(f, 0.25f), 0);
    expect_refusal(f, RESUME, "checkpoint.bin is from other inputs: mask mask.exr has changed since; put back what it was, or");
    assert_int_equal(write_all(f) || write_floor(f, 0.8f), 0);
    expect_refusal(f, RESUME, "inputs: parameter floor.bsdf.reflectance.data has changed since");
    assert_int_equal(write_all(f) || write_scene(f, "scene.xml", 4, "0.31", "0.5"), 0);
    expect_refusal(f, RESUME, "inputs: parameter wall.bsdf.reflectance.value has changed since"); // where the unknown started
    assert_int_equal(write_all(f) || write_scene(f, "scene.xml", 4, "0.3", "0.4"), 0);
    expect_refusal(f, RESUME, "inputs: parameter shape_2.bsdf.reflectance.value has changed since; put back what it was, or start "
                              "anew with --overwrite or another -o");
    assert_int_equal(write_all(f) || write_scene(f, "scene.xml", 5, "0.3", "0.5"), 0);
    expect_refusal(f, RESUME, "inputs: what is no parameter of the scene has changed since");
    assert_int_equal(write_all(f) || write_scene(f, "truth.xml", 4, "0.6", "0.5") || write_targets_of_truth(f, 1, SIZE, 16), 0);
    expect_refusal(f, RESUME, "inputs: target target_0.exr has changed since");
    expect_refusal(f, ANEW, "target target_0.exr has changed since");
    assert_null(strstr(rey_error(f->ctx), "replaces it"));
    assert_int_equal(write_floor(f, 0.8f) || write_scene(f, "scene.xml", 4, "0.31", "0.4"), 0);
    expect_refusal(f, RESUME, "target target_0.exr has changed, parameter floor.bsdf.reflectance.data has changed, parameter "
                              "wall.bsdf.reflectance.value has changed, and 1 more since");
    assert_int_equal(write_all(f), 0); // other files with what the first ones held
    expect_run(f, RESUME);
}

// The width of the kernels is no input.
static void test_any_lanes(void **state) {
    Fixture *f = *state;
    rey_context_def def = rey_default_context_def();
    rey_context *own = f->ctx;
    def.lanes = 1;
    assert_int_equal(run_fit(f, OVERWRITE, 2, NULL), REY_ERROR_CANCELLED);
    assert_int_equal(rey_context_create(&def, &f->ctx), REY_OK);
    expect_run(f, RESUME);
    rey_context_destroy(f->ctx);
    f->ctx = own;
}

static void test_differences_are_named(void **state) {
    UNUSED(state);
#define TARGET "0000000000000001 target a: b\n"
#define PARAMETER "0000000000000002 parameter x\n"
#define REST "what is no parameter of the scene\n"
    static const char *const before = TARGET PARAMETER "0000000000000003 " REST;
    char what[256];
    assert_false(rey_fit_inputs_differ(before, before, what, sizeof what));
    assert_true(rey_fit_inputs_differ(before, TARGET "0000000000000004 " REST, what, sizeof what));
    assert_string_equal(what, "parameter x is gone");
    assert_true(rey_fit_inputs_differ(before, TARGET "0000000000000005 parameter w\n" PARAMETER "0000000000000004 " REST, what,
                                      sizeof what));
    assert_string_equal(what, "parameter w has come");
}

static bool stands(const Fixture *f, const char *name) {
    char path[128];
    path_of(f, name, path);
    return access(path, F_OK) == 0;
}

// With --overwrite nothing that stands in the folder is the former fit's, and what no fit writes stays.
static void test_nothing_stale(void **state) {
    const Fixture *f = *state;
    static const char *const written[] = {"out/report.html", "out/recovered.xml", "out/recovered_data/floor.png",
                                          "out/frames/view0_000001.png", "out/level_0.xml", "out/level_0_data/a&b.ply"};
    static const char *const others[] = {"out/report.htm", "out/recovered_data/mine.txt", "out/frames/mine.png", "out/level_7.xml",
                                         "out/events.out.mine", "out/level_0_data"};
    char path[128];
    assert_int_equal(run_fit(f, OVERWRITE, 9, NULL), REY_OK);
    path_of(f, "out/level_0_data", path);
    assert_int_equal(mkdir(path, 0777), 0);
    assert_int_equal(write_text(f, "out/level_0.xml", "<scene version=\"3.0.0\">\n" // as fits begin them
                                                      "<string name=\"filename\" value=\"level_0_data/a&amp;b.ply\"/>"
                                                      "<string value=\"level_0_data/../../job.yaml\"/>"), 0);
    assert_int_equal(write_text(f, written[5], "ply") || write_text(f, "out/level_0_data/mine", "mine"), 0);
    for (int i = 0; i < COUNT_OF(written); i++) {
        assert_true(stands(f, written[i]));
        assert_int_equal(i < 5 ? write_text(f, others[i], "mine") : 0, 0);
    }
    assert_int_equal(run_fit(f, ANEW, 1, NULL), REY_ERROR_ARGUMENT); // refused: everything stays
    assert_true(stands(f, "out/report.html"));
    assert_int_equal(run_fit(f, OVERWRITE, 1, NULL), REY_ERROR_CANCELLED);
    for (int i = 0; i < COUNT_OF(written); i++) {
        if (stands(f, written[i]) || !stands(f, others[i])) {
            fail_msg("%s stands: %d, %s stands: %d", written[i], stands(f, written[i]), others[i], stands(f, others[i]));
        }
    }
    assert_true(stands(f, "job.yaml") && stands(f, "out/checkpoint.bin") && stands(f, "out/metrics.jsonl"));
    expect_run(f, OVERWRITE);
}

// In a folder that holds no fit, nothing is a fit's.
static void test_foreign_folder(void **state) {
    const Fixture *f = *state;
    char path[128];
    path_of(f, "out", path);
    assert_int_equal(run_fit(f, OVERWRITE, 9, NULL), REY_OK);
    path_of(f, "out/checkpoint.bin", path);
    assert_int_equal(unlink(path), 0);
    for (int how = ANEW; how <= RESUME; how++) { // what it recovered is still a fit's
        assert_int_equal(run_fit(f, how, 9, NULL), REY_ERROR_ARGUMENT);
        assert_non_null(strstr(rey_error(f->ctx), "not its checkpoint.bin"));
    }
    path_of(f, "out/job.resolved.yaml", path);
    assert_int_equal(unlink(path) || write_text(f, "out/events.out.tfevents.1.host", "mine"), 0);
    assert_int_equal(run_fit(f, ANEW, 1, NULL), REY_ERROR_ARGUMENT); // its names are taken
    assert_non_null(strstr(rey_error(f->ctx), "no fit is in this folder that wrote it"));
    assert_true(stands(f, "out/metrics.jsonl") && stands(f, "out/recovered.xml") && !stands(f, "out/job.resolved.yaml"));
    assert_int_equal(run_fit(f, OVERWRITE, 1, NULL), REY_ERROR_CANCELLED);
    assert_true(stands(f, "out/events.out.tfevents.1.host") && stands(f, "out/report.html"));
}

// A fit whose scene is the former result in the same folder would write over its own start.
static void test_own_result_is_no_scene(void **state) {
    const Fixture *f = *state;
    assert_int_equal(run_fit(f, OVERWRITE, 9, NULL), REY_OK);
    static const char *const sets[] = {"scene=out/recovered.xml", "load=out/../out/recovered.xml"};
    for (int i = 0; i < COUNT_OF(sets); i++) {
        assert_int_equal(run_fit(f, OVERWRITE, 1, sets[i]), REY_ERROR_ARGUMENT);
        assert_non_null(strstr(rey_error(f->ctx), "it would be lost"));
        assert_true(stands(f, "out/recovered.xml"));
    }
    // nor is a scene that reads a picture there
    assert_int_equal(write_scene(f, "reads.xml", 4, "0.3", "0.5"), 0);
    char command[256];
    snprintf(command, sizeof command, "sed -i 's:floor.png:out/recovered_data/floor.png:' '%s/reads.xml'", f->folder);
    assert_int_equal(system(command), 0);
    assert_int_equal(run_fit(f, OVERWRITE, 1, "scene=reads.xml"), REY_ERROR_ARGUMENT);
    assert_non_null(strstr(rey_error(f->ctx), "out/recovered_data/floor.png, which the former fit wrote"));
    assert_true(stands(f, "out/recovered_data/floor.png"));
}

// The job that a fit writes down goes on where that fit wrote, which is not where its own job says.
static void test_resolved_output(void **state) {
    const Fixture *f = *state;
    char job[128];
    FitResult result;
    int stop = 9;
    assert_int_equal(run_fit(f, OVERWRITE, 2, "output=elsewhere"), REY_ERROR_CANCELLED);
    path_of(f, "out/job.resolved.yaml", job);
    FitDef def = {.job_path = job, .resume = true, .progress = stop_at, .user = &stop};
    assert_int_equal(rey_fit(f->ctx, &def, &result), REY_OK);
    assert_int_equal(result.iterations_before, 2);
    assert_non_null(strstr(result.output, "/out"));
    rey_fit_result_free(&result);
    assert_true(stands(f, "out/report.html") && !stands(f, "elsewhere"));
}

// A view's sensor by the name of its parameters; an id is looked up in the same way, in the truth, too.
static void test_sensor_by_name(void **state) {
    const Fixture *f = *state;
    char path[128], other[128], command[400];
    path_of(f, "scene.xml", path);
    path_of(f, "named.xml", other);
    snprintf(command, sizeof command, "sed 's/sensor type=.perspective./& id=\"front\"/' '%s' > '%s'", path, other);
    assert_int_equal(system(command), 0);
    assert_int_equal(run_fit(f, OVERWRITE, 1, "views.0.sensor=sensor_0"), REY_ERROR_CANCELLED);
    assert_int_equal(run_fit(f, RESUME, 9, "views.0.sensor=sensor_0"), REY_OK);
    static const char named[] = "scene: named.xml\niterations: 1\nspp: 4\nviews: [{sensor: front, target: target_0.exr}]\n"
                                "parameters: [paint.reflectance.value]\ntruth: {scene: truth.xml}\n";
    assert_int_equal(write_text(f, "job.yaml", named), 0);
    assert_int_equal(run_fit(f, OVERWRITE, 9, "truth.scene=named.xml"), REY_OK);
    assert_int_equal(run_fit(f, OVERWRITE, 9, NULL), REY_ERROR_SCENE);
    assert_non_null(strstr(rey_error(f->ctx), "job.yaml:6: truth.xml: sensor 0 is not 'front' as in the scene: 0 has no id"));
    assert_int_equal(write_text(f, "job.yaml", JOB), 0);
}

// A weight is one number, and an alpha is none: neither colours nor what alpha cuts out are masks.
static void test_masks_are_weights(void **state) {
    const Fixture *f = *state;
    float green[SIZE * SIZE * 3] = {0}, half[SIZE * SIZE * 4], grey[SIZE * SIZE * 3];
    char path[128];
    for (int i = 0; i < SIZE * SIZE; i++) {
        green[3 * i + 1] = i > SIZE; // nothing in the first row, and at the next one's begin
        for (int c = 0; c < 4; c++) {
            half[4 * i + c] = i % SIZE < SIZE / 2;
        }
        for (int c = 0; c < 3; c++) {
            grey[3 * i + c] = 0.5f + 1e-5f * (float)c;
        }
    }
    path_of(f, "green.exr", path);
    assert_int_equal(rey_exr_write(f->ctx, path, green, SIZE, SIZE, 3, NULL), REY_OK);
    path_of(f, "grey.exr", path);
    assert_int_equal(rey_exr_write(f->ctx, path, grey, SIZE, SIZE, 3, NULL), REY_OK);
    path_of(f, "half.png", path);
    assert_int_equal(rey_png_write_alpha(f->ctx, path, half, SIZE, SIZE), REY_OK);
    static const char *const cases[][2] = {
        {"views.0.mask=green.exr", "--set views.0.mask=green.exr: green.exr: the mask is 0 1 0 at pixel 1, 1, expected a grey "
                                   "picture: one weight per pixel"},
        {"views.0.mask=half.png", "half.png has an alpha below 1, which would be left out, expected a picture without alpha"},
    };
    for (int i = 0; i < COUNT_OF(cases); i++) {
        assert_int_equal(run_fit(f, OVERWRITE, 1, cases[i][0]), REY_ERROR_ARGUMENT);
        if (!strstr(rey_error(f->ctx), cases[i][1])) {
            fail_msg("'%s', expected '%s'", rey_error(f->ctx), cases[i][1]);
        }
    }
    assert_int_equal(run_fit(f, OVERWRITE, 1, "views.0.mask=grey.exr"), REY_ERROR_CANCELLED); // but for rounding
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_changed_inputs),         cmocka_unit_test(test_any_lanes),
        cmocka_unit_test(test_differences_are_named),  cmocka_unit_test(test_nothing_stale),
        cmocka_unit_test(test_foreign_folder),         cmocka_unit_test(test_own_result_is_no_scene),
        cmocka_unit_test(test_resolved_output),        cmocka_unit_test(test_sensor_by_name),
        cmocka_unit_test(test_masks_are_weights),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
