// test_fit.c: jobs, losses, optimizers, and whole small fits.
#include "fit/fit.h"
#include "fit/tensorboard.h"
#include "io/file.h"
#include "io/image.h"
#include "folder.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>
#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

typedef struct Fixture {
    rey_context *ctx;
    char folder[64], target[128], target_set[160];
} Fixture;

static const char *const JOB = TEST_DATA_DIR "/jobs/job.yaml";

static int set_up(void **state) {
    Fixture *f = calloc(1, sizeof *f);
    rey_context_def def = rey_default_context_def();
    def.threads = 2;
    rey_scene *scene = NULL;
    float image[32 * 24 * 3];
    if (!f || rey_context_create(&def, &f->ctx)) {
        return 1;
    }
    snprintf(f->folder, sizeof f->folder, "/tmp/reynolds_test_fit_XXXXXX");
    if (!folder_make(f->folder) || rey_scene_load(f->ctx, TEST_DATA_DIR "/jobs/truth.xml", NULL, 0, &scene)) {
        return 1;
    }
    snprintf(f->target, sizeof f->target, "%s/target.exr", f->folder);
    snprintf(f->target_set, sizeof f->target_set, "views.0.target=%s", f->target);
    rey_render_def render = rey_default_render_def();
    render.spp = 1024;
    render.seed = 77;
    if (rey_render(scene, &render, image, NULL) || rey_exr_write(f->ctx, f->target, image, 32, 24, 3, NULL)) {
        return 1;
    }
    rey_scene_destroy(scene);
    *state = f;
    return 0;
}

static int tear_down(void **state) {
    Fixture *f = *state;
    int status = folder_remove(f->folder);
    rey_context_destroy(f->ctx);
    free(f);
    return status;
}

/* ---- jobs ---------------------------------------------------------------------------------------------- */

#define HEAD "scene: a.xml\nviews: [{target: t.exr}]\nparameters: [{name: a}]\n"

static rey_result read_job(Fixture *f, const char *text, const char *set, Job *job) {
    return rey_job_read_memory(f->ctx, "job.yaml", (const unsigned char *)text, strlen(text), &set, set ? 1 : 0, job);
}

static void expect_error(Fixture *f, const char *text, const char *set, const char *words) {
    Job job;
    assert_int_not_equal(read_job(f, text, set, &job), REY_OK);
    rey_job_free(&job);
    if (!strstr(rey_error(f->ctx), words)) {
        fail_msg("expected '%s' in '%s'", words, rey_error(f->ctx));
    }
}

// The kind alone will do where there is nothing else to say.
static void test_job_kinds(void **state) {
    Fixture *f = *state;
    Job job;
    assert_int_equal(read_job(f, HEAD "loss: l2\noptimizer: sgd\n", NULL, &job), REY_OK);
    assert_int_equal(job.loss, LOSS_L2);
    assert_int_equal(job.optimizer.kind, OPTIMIZER_SGD);
    rey_job_free(&job);
    assert_int_equal(read_job(f, HEAD, "optimizer=lbfgs", &job), REY_OK);
    assert_int_equal(job.optimizer.kind, OPTIMIZER_LBFGS);
    rey_job_free(&job);
    expect_error(f, HEAD "optimizer: adan\n", NULL, "job.yaml:4: optimizer: unknown value 'adan', did you mean 'adam'?");
    // a parameter's name, too, may stand alone
    const char *names = "scene: a.xml\nviews: [{target: t.exr}]\nparameters: [a.b, 'c.*']\n";
    assert_int_equal(read_job(f, names, "parameters.1.start=2", &job), REY_OK);
    assert_int_equal(job.parameter_count, 2);
    assert_string_equal(job.parameters[0].name, "a.b");
    assert_string_equal(job.parameters[1].name, "c.*");
    assert_true(job.parameters[1].start_count == 1 && job.parameters[1].start[0] == 2);
    rey_job_free(&job);
}

static void test_job_errors(void **state) {
    Fixture *f = *state;
    expect_error(f, HEAD "optimizer:\n  lerning_rate: 3\n", NULL,
                 "job.yaml:5: unknown key 'lerning_rate', did you mean 'learning_rate'?");
    expect_error(f, HEAD "seed: -1\n", NULL, "job.yaml:4: seed = -1, expected 0 to");
    expect_error(f, HEAD "terms: interior,primery\n", NULL,
                 "job.yaml:4: 'primery' is no term; expected some of interior,primary,indirect");
    expect_error(f, HEAD "optimizer:\n  type: adam\n  momentum: 0.9\n", NULL, "job.yaml:6: 'momentum' is a key of sgd; adam has "
                 "learning_rate, beta1, beta2, epsilon, average and schedule");
    expect_error(f, HEAD "optimizer: {memory: 3}\n", NULL, "job.yaml:4: 'memory' is a key of lbfgs; adam has");
    expect_error(f, HEAD "optimizer: {beta1: 0.5, type: sgd}\n", NULL, "'beta1' is a key of adam; sgd has learning_rate, m");
    expect_error(f, HEAD "optimizer: {type: lbfgs}\n", "optimizer.momentum=0", "--set optimizer.momentum=0: 'momentum' is a key of "
                 "sgd; lbfgs has learning_rate and memory");
    expect_error(f, HEAD "iterations: 2.5\n", NULL, "job.yaml:4: iterations = 2.5, expected a whole number");
    expect_error(f, HEAD "iterations: nan\n", NULL, "job.yaml:4: iterations: 'nan', expected a number");
    expect_error(f, HEAD "loss: l3\n", NULL, "job.yaml:4: loss: unknown value 'l3', did you mean");
    expect_error(f, HEAD "loss: l2\nloss: l1\n", NULL, "job.yaml:5: key 'loss' is given twice");
    expect_error(f, HEAD "spp: [1, 2]\n", NULL, "expected a number, or a list of {from: ITERATION, spp: NUMBER}");
    expect_error(f, HEAD "spp: [{from: 0, spp: 4}, {from: 0, spp: 8}]\n", NULL, "from = 0, expected more than in the entry before");
    expect_error(f, HEAD "views_per_iteration: 2\n", NULL, "the job has 1 view");
    expect_error(f, HEAD "defines: {'a b': 1}\n", NULL, "is not a name");
    expect_error(f, "scene: a.xml\n", NULL, "key 'views' is missing");
    expect_error(f, "a: &x 1\n", NULL, "anchors and aliases");
    expect_error(f, "[", NULL, "job.yaml:");
    expect_error(f, "- 1\n", NULL, "expected 'key: value' lines");
    expect_error(f, "", NULL, "key 'scene' is missing");
    expect_error(f, HEAD, "optimizer.lerning_rate=3", "--set optimizer.lerning_rate=3: unknown key 'lerning_rate'");
    expect_error(f, HEAD, "parameters.0.bounds=[1,0]", "--set parameters.0.bounds=[1,0]: bounds: 1 is not below 0");
    expect_error(f, HEAD, "seed=[", "--set seed=[: the value, which is read as YAML: did not find");
    expect_error(f, HEAD, "views.1.weight=2", "--set views.1.weight=2: views: key 'target' is missing");
    expect_error(f, HEAD, "views.0.sensor=[0]", "sensor: a list, expected a number from 0 or an id");
    expect_error(f, "scene: a.xml\nviews:\n  - t.exr\n", NULL, "job.yaml:3: views: 't.exr', expected entries such as {sensor: 0,");
    expect_error(f, "parameters: [[a]]\n", NULL, "job.yaml:1: parameters: a list, expected 'key: value' lines");
    expect_error(f, "parameters: ['']\n", NULL, "job.yaml:1: entry: nothing, expected a text");
    expect_error(f, HEAD, "parameters.2.name=b",
                 "parameters is a list of 1, and '2' is no index of it, expected 0 or 1, which appends");
    expect_error(f, HEAD, "x..y=1", "expected a key whose parts are joined by dots");
    char deep[128];
    memset(deep, '[', sizeof deep - 1);
    deep[sizeof deep - 1] = 0;
    expect_error(f, deep, NULL, "nested too deeply");
}

static void test_job_round_trip(void **state) {
    Fixture *f = *state;
    Job job, again;
    char *flat, *yaml, *flat_again, key[64];
    const char *text = HEAD "defines: {big.xml: 1}\n";
    assert_int_not_equal(read_job(f, text, NULL, &job), REY_OK);
    rey_job_free(&job);
    text = HEAD "defines: {big: 'a: \"b\"'}\nspp: [{from: 0, spp: 4}, {from: 9, spp: 8}]\ngradient_spp: 3\n"
                "optimizer: {type: sgd, schedule: {type: step, every: 7}}\nstop: {window: 5, tolerance: 0.01}\n";
    assert_int_equal(read_job(f, text, "parameters.1={name: b, bounds: [0, .inf], start: [1, 2, 0.1]}", &job), REY_OK);
    job.views[0].sensor_id = "side";
    assert_int_equal(rey_job_flat(&job, &flat), REY_OK);
    assert_int_equal(rey_job_yaml(&job, &yaml), REY_OK);
    if (read_job(f, yaml, NULL, &again)) {
        fail_msg("%s\n%s", rey_error(f->ctx), yaml);
    }
    assert_int_equal(rey_job_flat(&again, &flat_again), REY_OK);
    assert_string_equal(flat, flat_again);
    assert_string_equal(again.views[0].sensor_id, "side");
    assert_int_equal(rey_job_spp_at(&job, 8), 4);
    assert_int_equal(rey_job_spp_at(&job, 9), 8);
    rey_job_free(&again);
    rey_free(f->ctx, flat_again);
    assert_int_equal(read_job(f, yaml, "parameters.1.start.2=0.2", &again), REY_OK);
    assert_int_equal(rey_job_flat(&again, &flat_again), REY_OK);
    assert_true(rey_job_difference(flat, flat_again, key, sizeof key));
    assert_string_equal(key, "parameters.1.start.2");
    rey_job_free(&again);
    rey_job_free(&job);
    rey_free(f->ctx, flat);
    rey_free(f->ctx, flat_again);
    rey_free(f->ctx, yaml);
}

/* ---- parts --------------------------------------------------------------------------------------------- */

// Each adjoint is half of d loss / d half when both halves are the same picture, by central differences.
static void test_loss_derivatives(void **state) {
    UNUSED(state);
    const float target[3] = {0.2f, 0.5f, 1.5f}, mask[1] = {0.7f};
    for (int kind = 0; kind < LOSS_COUNT; kind++) {
        LossView view = {target, mask, 1, 0.7};
        for (int i = 0; i < 3; i++) {
            float image[3] = {0.4f, 0.3f, 1.1f}, da[3], db[3], scratch[3];
            double step = 1e-3;
            rey_loss((LossKind)kind, 0.05, &view, image, image, 1, da, db);
            image[i] += (float)step;
            double more = rey_loss((LossKind)kind, 0.05, &view, image, image, 1, scratch, scratch);
            image[i] -= (float)(2 * step);
            double less = rey_loss((LossKind)kind, 0.05, &view, image, image, 1, scratch, scratch);
            assert_float_equal((double)da[i] + (double)db[i], (more - less) / (2 * step),
                               2e-3 * fabs(more - less) / step + 1e-6);
            assert_true(fabs((double)da[i]) > 1e-3);
        }
    }
}

static void test_loss_crosses_halves(void **state) {
    UNUSED(state);
    const float target[3] = {0, 0, 0}, a[3] = {1, 1, 1}, b[3] = {3, 3, 3};
    float da[3], db[3];
    LossView view = {target, NULL, 1, 1};
    assert_float_equal(rey_loss(LOSS_L2, 1, &view, a, b, 2, da, db), 3, 1e-12);
    assert_float_equal((double)da[0], 2 * 3.0 / 3, 1e-6); // from b, scaled
    assert_float_equal((double)db[0], 2 * 1.0 / 3, 1e-6);
    const float hole[1] = {0}, nothing[3] = {NAN, NAN, NAN};
    LossView masked = {nothing, hole, 1, 1};
    assert_float_equal(rey_loss(LOSS_L2, 1, &masked, a, b, 1, da, db), 0, 0);
    assert_float_equal((double)da[0], 0, 0);
}

static void test_tensorboard_checksum(void **state) {
    UNUSED(state);
    // CRC-32C of "123456789" is 0xe3069283.
    uint32_t crc = 0xe3069283u;
    assert_int_equal(rey_tensorboard_checksum("123456789", 9), (crc >> 15 | crc << 17) + 0xa282ead8u);
}

/* ---- whole fits ---------------------------------------------------------------------------------------- */

typedef struct Stopper {
    int at; // iteration at which the user interrupts, -1 = never
} Stopper;

static bool stop_at(void *user, const FitProgress *progress) {
    const Stopper *s = user;
    return progress->finishing || s->at < 0 || progress->iteration < s->at;
}

static rey_result run_fit(Fixture *f, const char *out, bool resume, int stop, const char *extra, FitResult *result) {
    char folder[128];
    Stopper stopper = {stop};
    const char *sets[] = {f->target_set, extra};
    snprintf(folder, sizeof folder, "%s/%s", f->folder, out);
    FitDef def = {.job_path = JOB,
                  .overrides = sets,
                  .override_count = extra ? 2 : 1,
                  .output = folder,
                  .resume = resume,
                  .progress = stop_at,
                  .user = &stopper};
    return rey_fit(f->ctx, &def, result);
}

static void test_fit_recovers(void **state) {
    Fixture *f = *state;
    FitResult result;
    if (run_fit(f, "whole", false, -1, NULL, &result)) {
        fail_msg("%s", rey_error(f->ctx));
    }
    assert_int_equal(result.rows.count, 3);
    for (size_t i = 0; i < result.rows.count; i++) {
        const FitRow *row = &ARRAY_AT(result.rows, FitRow, i);
        assert_non_null(row->truth);
        if (row->error > 0.04) {
            fail_msg("%s is off by %g", row->name, row->error);
        }
    }
    assert_non_null(result.report);
    assert_int_equal(access(result.report, R_OK), 0);
    if (result.scene) { // what was written loads and holds what was found
        rey_scene *scene = NULL;
        assert_int_equal(rey_scene_load(f->ctx, result.scene, NULL, 0, &scene), REY_OK);
        const FitRow *row = &ARRAY_AT(result.rows, FitRow, 0);
        int param = rey_param_find(scene, row->name);
        assert_true(param >= 0);
        assert_memory_equal(rey_param_values(scene, param), row->found, (size_t)row->count * sizeof(float));
        rey_scene_destroy(scene);
    }
    rey_fit_result_free(&result);
}

static void read_file(Fixture *f, const char *name, unsigned char **bytes, size_t *size) {
    char path[128];
    snprintf(path, sizeof path, "%s/%s", f->folder, name);
    assert_int_equal(rey_file_read(f->ctx, path, bytes, size), REY_OK);
}

// The found values of an interrupted and resumed fit are those of an uninterrupted one, bit for bit.
static void test_fit_resumes(void **state) {
    Fixture *f = *state;
    FitResult whole, part;
    assert_int_equal(run_fit(f, "a", false, -1, "iterations=30", &whole), REY_OK);
    assert_int_equal(run_fit(f, "b", false, 13, "iterations=30", &part), REY_ERROR_CANCELLED);
    rey_fit_result_free(&part);
    assert_int_equal(run_fit(f, "b", true, -1, "iterations=30", &part), REY_OK);
    assert_int_equal(whole.rows.count, part.rows.count);
    for (size_t i = 0; i < whole.rows.count; i++) {
        const FitRow *a = &ARRAY_AT(whole.rows, FitRow, i), *b = &ARRAY_AT(part.rows, FitRow, i);
        assert_memory_equal(a->found, b->found, (size_t)a->count * sizeof(float));
        assert_memory_equal(a->start, b->start, (size_t)a->count * sizeof(float));
        assert_true(memcmp(a->found, a->start, (size_t)a->count * sizeof(float)) != 0);
    }
    unsigned char *bytes;
    size_t size, lines = 0;
    read_file(f, "b/metrics.jsonl", &bytes, &size);
    for (size_t i = 0; i < size; i++) {
        lines += bytes[i] == '\n';
    }
    assert_int_equal(lines, 30);
    rey_free(f->ctx, bytes);
    rey_fit_result_free(&whole);
    rey_fit_result_free(&part);
    assert_int_equal(run_fit(f, "b", true, -1, "seed=4", &part), REY_ERROR_ARGUMENT);
    assert_non_null(strstr(rey_error(f->ctx), "'seed'"));
    rey_fit_result_free(&part);
}

static void test_damaged_checkpoint(void **state) {
    Fixture *f = *state;
    FitResult result;
    unsigned char *bytes;
    size_t size;
    char path[128];
    assert_int_equal(run_fit(f, "c", false, 2, "iterations=9", &result), REY_ERROR_CANCELLED);
    rey_fit_result_free(&result);
    read_file(f, "c/checkpoint.bin", &bytes, &size);
    snprintf(path, sizeof path, "%s/c/checkpoint.bin", f->folder);
    bytes[size / 2] ^= 1;
    assert_int_equal(rey_file_write(f->ctx, path, bytes, size), REY_OK);
    assert_int_equal(run_fit(f, "c", true, -1, "iterations=9", &result), REY_ERROR_FORMAT);
    rey_fit_result_free(&result);
    for (size_t cut = 0; cut < size; cut += size / 7 + 1) {
        assert_int_equal(rey_file_write(f->ctx, path, bytes, cut), REY_OK);
        assert_int_equal(run_fit(f, "c", true, -1, "iterations=9", &result), REY_ERROR_FORMAT);
        rey_fit_result_free(&result);
    }
    rey_free(f->ctx, bytes);
}

// Defines are for the job's scene; a truth that is wrong loses neither the recovered scene nor the report.
static void test_truth_loses_nothing(void **state) {
    Fixture *f = *state;
    FitResult result;
    char path[160], truth[192];
    snprintf(truth, sizeof truth, "truth.scene=%s/plain.xml", f->folder);
    snprintf(path, sizeof path, "%s/plain.xml", f->folder);
    rey_scene *scene = NULL; // saved, the truth holds numbers and uses no define
    assert_int_equal(rey_scene_load(f->ctx, TEST_DATA_DIR "/jobs/truth.xml", NULL, 0, &scene), REY_OK);
    assert_int_equal(rey_scene_save(scene, path), REY_OK);
    rey_scene_destroy(scene);
    const char *sets[] = {f->target_set, "defines.alpha=0.3", "iterations=2", "report_spp=4", truth};
    char folder[128];
    snprintf(folder, sizeof folder, "%s/t", f->folder);
    FitDef def = {.job_path = JOB, .overrides = sets, .override_count = COUNT_OF(sets), .output = folder};
    if (rey_fit(f->ctx, &def, &result)) {
        fail_msg("%s", rey_error(f->ctx));
    }
    assert_non_null(ARRAY_AT(result.rows, FitRow, 0).truth);
    rey_fit_result_free(&result);

    const char *own[] = {f->target_set, "truth.scene=" TEST_DATA_DIR "/jobs/start.xml", "truth.defines.light=7", "iterations=1",
                         "report_spp=0"};
    def.overrides = own; // defines of its own
    snprintf(folder, sizeof folder, "%s/v", f->folder);
    if (rey_fit(f->ctx, &def, &result)) {
        fail_msg("%s", rey_error(f->ctx));
    }
    assert_float_equal((double)ARRAY_AT(result.rows, FitRow, 1).truth[0], 7, 1e-6);
    rey_fit_result_free(&result);

    own[2] = "truth.defines.lihgt=7";
    snprintf(folder, sizeof folder, "%s/w", f->folder);
    assert_int_equal(rey_fit(f->ctx, &def, &result), REY_ERROR_ARGUMENT);
    assert_non_null(strstr(rey_error(f->ctx), "--set truth.defines.lihgt=7: "));
    rey_fit_result_free(&result);

    def.overrides = sets;
    snprintf(folder, sizeof folder, "%s/u", f->folder);
    assert_int_equal(truncate(path, 40), 0); // what is in the truth is looked at in the end
    assert_int_equal(rey_fit(f->ctx, &def, &result), REY_ERROR_FORMAT);
    assert_non_null(strstr(rey_error(f->ctx), "plain.xml"));
    assert_non_null(result.scene);
    assert_non_null(result.report);
    assert_int_equal(access(result.scene, R_OK), 0);
    assert_int_equal(access(result.report, R_OK), 0);
    rey_fit_result_free(&result);
}

// Three iterations, no report, into the folder d.
static rey_result run_short(Fixture *f, bool resume, bool overwrite, int stop, const char *extra, FitResult *result) {
    char folder[128];
    Stopper stopper = {stop};
    const char *sets[] = {f->target_set, "iterations=3", "spp=2", "report_spp=0", extra};
    snprintf(folder, sizeof folder, "%s/d", f->folder);
    FitDef def = {.job_path = JOB,
                  .overrides = sets,
                  .override_count = extra ? 5 : 4,
                  .output = folder,
                  .resume = resume,
                  .overwrite = overwrite,
                  .progress = stop_at, .user = &stopper};
    return rey_fit(f->ctx, &def, result);
}

static void expect_refusal(Fixture *f, const char *extra, bool resume, const char *words) {
    FitResult result;
    rey_result code = run_short(f, resume, false, 1, extra, &result);
    rey_fit_result_free(&result);
    if (code == REY_OK || code == REY_ERROR_CANCELLED || !strstr(rey_error(f->ctx), words)) {
        fail_msg("result %d: '%s', expected '%s'", code, rey_error(f->ctx), words);
    }
}

static void expect_run(Fixture *f, bool resume, bool overwrite, const char *extra) {
    FitResult result;
    rey_result code = run_short(f, resume, overwrite, -1, extra, &result);
    rey_fit_result_free(&result);
    if (code) {
        fail_msg("%s", rey_error(f->ctx));
    }
}

// Nobody loses an earlier fit unasked, and two fits in one folder do not mix.
static void test_folder_is_kept(void **state) {
    Fixture *f = *state;
    FitResult result;
    char folder[128], path[160];
    assert_int_equal(run_short(f, false, false, 2, NULL, &result), REY_ERROR_CANCELLED);
    rey_fit_result_free(&result);
    expect_refusal(f, NULL, false, "holds 2 iterations of this fit; --resume continues, --overwrite");
    expect_refusal(f, "seed=5", false, "--overwrite replaces it");
    expect_run(f, true, false, NULL);
    expect_refusal(f, NULL, false, "holds this fit, finished; --overwrite");
    expect_run(f, true, false, "iterations=5"); // more of them, on the schedule that it had
    expect_run(f, false, true, NULL);
    snprintf(folder, sizeof folder, "%s/d", f->folder);
    int other = open(folder, O_RDONLY | O_DIRECTORY);
    assert_true(other >= 0);
    assert_int_equal(flock(other, LOCK_EX | LOCK_NB), 0);
    expect_refusal(f, NULL, false, "another fit is running");
    expect_refusal(f, NULL, true, "another fit is running");
    close(other);
    expect_run(f, false, true, "seed=5");
    snprintf(path, sizeof path, "%s/e/recovered.xml", f->folder); // found out before the work, not after it
    snprintf(folder, sizeof folder, "%s/e", f->folder);
    assert_int_equal(mkdir(folder, 0777) || mkdir(path, 0777), 0);
    assert_int_equal(run_fit(f, "e", false, 1, NULL, &result), REY_ERROR_IO);
    assert_non_null(strstr(rey_error(f->ctx), "is a folder"));
    rey_fit_result_free(&result);
    assert_int_equal(rmdir(path), 0);
}

static void test_fit_errors(void **state) {
    Fixture *f = *state;
    static const char *const cases[][2] = {
        {"parameters.0.name=red.reflectanse.value", "did you mean 'red.reflectance.value'?"},
        {"parameters.2.parameterisation=rigid", "are for poses"},
        {"parameters.0.parameterisation=laplacian", "has no bounds"},
        {"parameters.0.smoothness=3", "smoothness is for 'parameterisation: laplacian'"},
        {"parameters.3.name=red.*", "entry 0 of 'parameters' names it already"},
        {"parameters.3.name=floor.bsdf.*", "entry 0 of 'parameters' names it already"}, // by its further name
        {"parameters.3.name=camera.to_world", "a camera turns and moves, but does not scale or shear"},
        {"parameters.3.name=nothing*", "matches no parameter of the scene"},
        {"parameters.0.start=[1, 2]", "start holds 2 numbers"},
        {"parameters.1.start=0", "entry 0 starts at 0, expected a number above 0: 'parameterisation: log'"},
        {"parameters.0.start=1", "entry 0 starts at 1, expected a number between 0 and 1: 'parameterisation: logit'"},
        {"parameters.2.start=1.5", "entry 0 starts at 1.5, outside of its bounds"},
        {"parameters.0.bounds=[0, 0.01]", "outside of its bounds 0 to 0.01"},
        {"terms=primary", "--set terms=primary: terms primary: the gradient of red.reflectance.value has no such term, "
                          "expected some of interior"},
        {"views.0.weight=0", "weight = 0, expected 1e-09 to"},
        {"views.0.sensor=3", "sensor 3 does not exist: the scene has 1, counted from 0: 0 is 'camera'"},
        {"views.0.sensor=cam", "--set views.0.sensor=cam: the scene has no sensor 'cam': 0 is 'camera'"},
        {"views.0.mask=nowhere.png", "nowhere.png"},
        {"truth.scene=nowhere.xml", "nowhere.xml"},
    };
    for (int i = 0; i < COUNT_OF(cases); i++) {
        FitResult result;
        rey_result code = run_fit(f, "e", false, 1, cases[i][0], &result);
        rey_fit_result_free(&result);
        assert_int_not_equal(code, REY_OK);
        if (!strstr(rey_error(f->ctx), cases[i][1])) {
            fail_msg("expected '%s' in '%s'", cases[i][1], rey_error(f->ctx));
        }
    }
}

int main(int argc, char **argv) {
    cmocka_set_skip_filter(argc > 1 ? argv[1] : NULL); // tests to leave out
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_job_kinds),
        cmocka_unit_test(test_job_errors),
        cmocka_unit_test(test_job_round_trip),
        cmocka_unit_test(test_loss_derivatives),
        cmocka_unit_test(test_loss_crosses_halves),
        cmocka_unit_test(test_tensorboard_checksum),
        cmocka_unit_test(test_fit_recovers),
        cmocka_unit_test(test_fit_resumes),
        cmocka_unit_test(test_damaged_checkpoint),
        cmocka_unit_test(test_truth_loses_nothing),
        cmocka_unit_test(test_folder_is_kept),
        cmocka_unit_test(test_fit_errors),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
