// test_cli_fit.c: what a fit leaves behind: checkpoints by time, pictures on the way, and a recovered scene that
// `reynolds render` reads back.
#include "command.h"

#include "fit/fit.h"
#include "io/file.h"
#include "io/image.h"

enum { SIDE = 24, PIXELS = SIDE * SIDE, ITERATIONS = 9 };

static void shell(const char *command) {
    if (system(command) != 0) {
        fail_msg("%s", command);
    }
}

// The demo's job in the test's folder, with pictures of SIDE pixels across.
static void copy_demo(Fixture *f) {
    char command[512];
    snprintf(command, sizeof command,
             "[ -d data ] || { ln -s '" EXAMPLE "/data' data && cp '" EXAMPLE "/job.yaml' . &&"
             "for s in scene truth; do sed 's/value=\"256\"/value=\"%d\"/' '" EXAMPLE "'/$s.xml > $s.xml; done; }",
             SIDE);
    shell(command);
    expect(f, 0, "render truth.xml --sensor 0 --spp 16 --seed 9 -o target_0.exr");
    expect(f, 0, "render truth.xml --sensor 1 --spp 16 --seed 9 -o target_1.exr");
    expect(f, 0, "render truth.xml --sensor 2 --spp 16 --seed 9 -o target_2.exr");
}

static rey_result fit_demo(rey_context *ctx, const char *output, bool resume, const char *extra,
                           bool (*progress)(void *, const FitProgress *), FitResult *result) {
    const char *const sets[] = {"iterations=9", "spp=2", "report_spp=2", "image_every=0", "checkpoint_every=0", extra};
    FitDef def = {.job_path = "job.yaml",
                  .overrides = sets,
                  .override_count = extra ? 6 : 5,
                  .output = output,
                  .resume = resume,
                  .progress = progress,
                  .user = (void *)(uintptr_t)output};
    return rey_fit(ctx, &def, result);
}

static rey_context *two_threads(void) {
    rey_context_def def = rey_default_context_def();
    def.threads = 2;
    rey_context *ctx;
    assert_int_equal(rey_context_create(&def, &ctx), REY_OK);
    return ctx;
}

static void require(rey_context *ctx, rey_result result) {
    if (result != REY_OK) {
        fail_msg("%s", rey_error(ctx));
    }
}

static void same_values(const FitResult *a, const FitResult *b) {
    assert_int_equal(a->rows.count, b->rows.count);
    for (size_t i = 0; i < a->rows.count; i++) {
        const FitRow *x = &ARRAY_AT(a->rows, FitRow, i), *y = &ARRAY_AT(b->rows, FitRow, i);
        assert_memory_equal(x->found, y->found, (size_t)x->count * sizeof(float));
    }
}

// The recovered scene, in a process of its own, makes the picture of the start with the found values in it.
static void the_recovered_demo_renders_the_same_bits(void **state) {
    Fixture *f = *state;
    rey_context *ctx = two_threads();
    copy_demo(f);
    FitResult result;
    require(ctx, fit_demo(ctx, "out", false, NULL, NULL, &result));
    assert_int_equal(result.rows.count, 7);
    assert_string_equal(result.scene, "out/recovered.xml");
    rey_scene *scene;
    require(ctx, rey_scene_load(ctx, "scene.xml", NULL, 0, &scene));
    for (size_t i = 0; i < result.rows.count; i++) {
        const FitRow *row = &ARRAY_AT(result.rows, FitRow, i);
        assert_int_not_equal(memcmp(row->found, row->start, (size_t)row->count * sizeof(float)), 0);
        require(ctx, rey_param_set(scene, rey_param_find(scene, row->name), row->found, row->count));
    }
    for (int sensor = 0; sensor < 3; sensor++) {
        static float picture[3 * PIXELS];
        rey_render_def def = rey_default_render_def();
        def.spp = 4;
        def.seed = 5;
        def.sensor = sensor;
        require(ctx, rey_render(scene, &def, picture, NULL));
        char command[128];
        snprintf(command, sizeof command, "render out/recovered.xml --sensor %d --spp 4 --seed 5 -o again.exr", sensor);
        expect(f, 0, command);
        rey_image again;
        require(ctx, rey_image_read(ctx, "again.exr", &again));
        assert_int_equal(again.width * again.height, PIXELS);
        assert_memory_equal(again.data, picture, sizeof picture);
        rey_image_free(ctx, &again);
    }
    rey_scene_destroy(scene);
    rey_fit_result_free(&result);
    rey_context_destroy(ctx);
}

// Copies what a kill after the fifth iteration would leave behind.
static bool keep_after_five(void *output, const FitProgress *progress) {
    if (!progress->finishing && progress->iteration == 5) {
        char command[128];
        snprintf(command, sizeof command, "rm -rf killed && cp -r %s killed", (const char *)output);
        shell(command);
    }
    return true;
}

static int first_iteration;

static bool note_first(void *output, const FitProgress *progress) {
    (void)output;
    first_iteration = first_iteration ? first_iteration : progress->iteration;
    return true;
}

// With an interval of next to nothing every iteration is saved, and a killed fit goes on from the last of them.
static void a_killed_fit_loses_the_interval(void **state) {
    Fixture *f = *state;
    rey_context *ctx = two_threads();
    copy_demo(f);
    FitResult whole, rest;
    require(ctx, fit_demo(ctx, "timed", false, "checkpoint_seconds=1e-9", keep_after_five, &whole));
    assert_int_equal(access("killed/checkpoint.bin", R_OK), 0);
    assert_int_not_equal(access("killed/recovered.xml", R_OK), 0);
    first_iteration = 0;
    require(ctx, fit_demo(ctx, "killed", true, "checkpoint_seconds=1e-9", note_first, &rest));
    assert_int_equal(first_iteration, 5); // the fifth was lost, no more
    same_values(&whole, &rest);
    rey_fit_result_free(&rest);
    rey_fit_result_free(&whole);
    shell("test $(wc -l < killed/metrics.jsonl) -eq 9");
    // Without an interval nothing is saved before the end.
    require(ctx, fit_demo(ctx, "untimed", false, "checkpoint_seconds=0", keep_after_five, &whole));
    rey_fit_result_free(&whole);
    assert_int_not_equal(access("killed/checkpoint.bin", R_OK), 0);
    assert_int_equal(access("untimed/checkpoint.bin", R_OK), 0);
    rey_context_destroy(ctx);
}

// Iterations 1, 2, 4 and 8 of each view are kept as pictures, also over a stop; none without a report.
static void frames_are_kept(void **state) {
    Fixture *f = *state;
    rey_context *ctx = two_threads();
    copy_demo(f);
    FitResult result;
    require(ctx, fit_demo(ctx, "filmed", false, NULL, NULL, &result));
    rey_fit_result_free(&result);
    int kept = 0;
    for (int view = 0; view < 3; view++) {
        for (int iteration = 0; iteration < ITERATIONS; iteration++) {
            char path[64];
            snprintf(path, sizeof path, "filmed/frames/view%d_%06d.png", view, iteration);
            bool due = iteration == 1 || iteration == 2 || iteration == 4 || iteration == 8;
            assert_int_equal(access(path, R_OK) == 0, due);
            if (due) {
                rey_image image;
                require(ctx, rey_image_read(ctx, path, &image));
                assert_true(image.width == SIDE && image.height == SIDE);
                rey_image_free(ctx, &image);
                kept++;
            }
        }
    }
    assert_int_equal(kept, 12);
    shell("cmp -s filmed/frames/view0_000001.png filmed/frames/view0_000008.png && exit 1 || exit 0");
    require(ctx, fit_demo(ctx, "quiet", false, "report_spp=0", NULL, &result));
    rey_fit_result_free(&result);
    assert_int_not_equal(access("quiet/frames", R_OK), 0);
    rey_context_destroy(ctx);
}

// A step to infinity ends the fit with the parameter, the iteration and what to do; a checkpoint from before stays.
static void divergence_is_explained(void **state) {
    Fixture *f = *state;
    const char *fit = "fit far.yaml --set iterations=9 --set spp=4 --set checkpoint_every=1 --set image_every=0 --set "
                      "optimizer.beta1=0 --set 'parameters=[{name: lamp.emitter.radiance.value, parameterisation: log, "
                      "start: %s, learning_rate: 1e12}]' -o far_%s";
    char arguments[512];
    shell("cp '" TEST_JOBS "'/*.xml . && cp '" TEST_JOBS "/job.yaml' far.yaml");
    expect(f, 0, "render truth.xml -o target.exr --spp 16");
    snprintf(arguments, sizeof arguments, fit, "1", "up"); // the first step leads up
    expect(f, 1, arguments);
    assert_non_null(strstr(f->words, "far.yaml: the fit diverges at iteration 0: 'lamp.emitter.radiance.value' becomes inf, "
                                     "expected a finite number; lower the learning rate, which is 1e+12\n"));
    assert_int_not_equal(access("far_up/checkpoint.bin", F_OK), 0);
    snprintf(arguments, sizeof arguments, fit, "99", "down"); // and here down to the bound, and up from there
    expect(f, 1, arguments);
    assert_non_null(strstr(f->words, "diverges at iteration 1: "));
    assert_non_null(strstr(f->words, "; checkpoint.bin keeps iteration 1\n"));
    assert_int_equal(access("far_down/checkpoint.bin", F_OK), 0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_recovered_demo_renders_the_same_bits),
        cmocka_unit_test(a_killed_fit_loses_the_interval),
        cmocka_unit_test(frames_are_kept),
        cmocka_unit_test(divergence_is_explained),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
