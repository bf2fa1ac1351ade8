// test_job_words.c: what is wrong with a job is told with its line, its key and what was expected.
#include "fit/job.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>
#include <string.h>

#define HEAD "scene: a.xml\nviews: [{target: t.exr}]\nparameters: [{name: a}]\n"

static void expect_error(rey_context *ctx, const char *text, const char *set, const char *words) {
    Job job;
    rey_result result =
        rey_job_read_memory(ctx, "job.yaml", (const unsigned char *)text, strlen(text), &set, set ? 1 : 0, &job);
    rey_job_free(&job);
    if (result == REY_OK || !strstr(rey_error(ctx), words)) {
        fail_msg("result %d, '%s', expected '%s'", result, rey_error(ctx), words);
    }
}

static void test_keys_are_named(void **state) {
    rey_context *ctx = *state;
    static const char *const cases[][2] = {
        {HEAD "views_of: 1\n", "job.yaml:4: unknown key 'views_of', did you mean 'views'?"},
        {HEAD "learning_rate: 1\n", "job.yaml:4: unknown key 'learning_rate', did you mean optimizer.learning_rate?"},
        {"bounds: [0, 1]\n", "job.yaml:1: unknown key 'bounds', did you mean parameters.0.bounds?"},
        {HEAD "stop: {reduce: 1}\n", "job.yaml:4: unknown key 'reduce' in stop, expected one of window, tolerance"},
        {HEAD "loss: {type: l2, x: 1}\n", "job.yaml:4: unknown key 'x' in loss, expected one of type, epsilon"},
        {HEAD "loss: l3\n", "job.yaml:4: loss: unknown value 'l3', did you mean 'l1'?"},
        {HEAD "loss: []\n", "job.yaml:4: loss: an empty list, expected 'key: value' lines"},
        {HEAD "optimizer: {schedule: fast}\n", "job.yaml:4: schedule: unknown value 'fast', expected one of constant, cosine,"},
        {"scene: a\nviews: [{target: t, held_out: yes}]\n",
         "job.yaml:2: held_out: unknown value 'yes', expected one of false, true"},
        {"parameters: [{name: a, bounds: [0, x]}]\n", "job.yaml:1: bounds: 'x', expected a number"},
        {"parameters: [{name: a, bounds: [0, 1e99]}]\n", "job.yaml:1: bounds = 1e+99, expected -1e+30 to 1e+30"},
        {"parameters: [{name: a, start: [0, x]}]\n", "job.yaml:1: start: 'x', expected a number"},
        {HEAD "iterations: 12345678.5\n", "job.yaml:4: iterations = 12345678.5, expected a whole number"},
    };
    for (int i = 0; i < COUNT_OF(cases); i++) {
        expect_error(ctx, cases[i][0], NULL, cases[i][1]);
    }
}

// A key that says nothing to the kind of schedule is a mistake; a constant one has none to be mistaken for.
static void test_keys_of_schedules(void **state) {
    rey_context *ctx = *state;
    expect_error(ctx, HEAD "optimizer: {schedule: {type: cosine, every: 3}}\n", NULL,
                 "job.yaml:4: 'every' is a key of step, not of cosine");
    expect_error(ctx, HEAD "optimizer: {schedule: {end: 0.1, type: step}}\n", NULL,
                 "job.yaml:4: 'end' is a key of cosine and exponential, not of step");
    const char text[] = HEAD "optimizer: {schedule: {type: cosine, end: 0.1}}\n", *set = "optimizer.schedule.type=constant";
    Job job;
    assert_int_equal(rey_job_read_memory(ctx, "job.yaml", (const unsigned char *)text, strlen(text), &set, 1, &job), REY_OK);
    rey_job_free(&job);
}

// Nor does a key do nothing that is for another loss, optimiser or parameter.
static void test_keys_without_effect(void **state) {
    rey_context *ctx = *state;
    static const char *const cases[][3] = {
        {HEAD "loss: {type: l2, epsilon: 0.1}\n", NULL, "job.yaml:4: 'epsilon' is a key of relative_l2 and log_l2, not of l2"},
        {HEAD "loss: {epsilon: 0.1}\n", "loss.type=l1", "--set loss.type=l1: 'epsilon' is a key of relative_l2 and log_l2"},
        {"scene: a\nviews: [{target: t, silhouette: s}]\nparameters: [a]\n", NULL,
         "job.yaml:2: a silhouette is for parameters with 'carve: true', and the job has none"},
        {"scene: a\nviews: [{target: t, silhouette: s}]\nparameters: [{name: a, carve: true}]\n", "parameters.0.carve=false",
         "--set parameters.0.carve=false: a silhouette is for"},
        {"scene: a\nviews: [{target: t}]\nparameters: [{name: a, moment: shared}]\noptimizer: lbfgs\n", NULL,
         "job.yaml:3: 'moment' is for adam: lbfgs has none"},
        {"scene: a\nviews: [{target: t}]\nparameters: [{name: a, moment: shared}]\n", "optimizer.type=sgd",
         "--set optimizer.type=sgd: 'moment' is for adam: sgd has none"},
    };
    for (int i = 0; i < COUNT_OF(cases); i++) {
        expect_error(ctx, cases[i][0], cases[i][1], cases[i][2]);
    }
    // what is written down with its defaults has none of them
    static const char *const kinds[] = {"optimizer=lbfgs", "optimizer=sgd", "loss=l2", "loss=l1"};
    for (int i = 0; i < COUNT_OF(kinds); i++) {
        const char text[] = HEAD;
        char *resolved;
        Job job, again;
        const unsigned char *bytes = (const unsigned char *)text;
        assert_int_equal(rey_job_read_memory(ctx, "job.yaml", bytes, strlen(text), &kinds[i], 1, &job), REY_OK);
        assert_int_equal(rey_job_yaml(&job, &resolved), REY_OK);
        bytes = (const unsigned char *)resolved;
        assert_int_equal(rey_job_read_memory(ctx, "again.yaml", bytes, strlen(resolved), NULL, 0, &again), REY_OK);
        rey_free(ctx, resolved);
        rey_job_free(&again);
        rey_job_free(&job);
    }
}

// An entry of what is no map or list was made by the override.
static void test_overrides_are_blamed(void **state) {
    rey_context *ctx = *state;
    expect_error(ctx, HEAD, "scene.a=1", "--set scene.a=1: scene: a map, expected a text");
    expect_error(ctx, HEAD, "views.0.target.b=1", "--set views.0.target.b=1: target: a map, expected a text");
    expect_error(ctx, HEAD "iterations: 3\n", "iterations.0=1", "--set iterations.0=1: iterations: a map, expected a number");
    expect_error(ctx, HEAD "optimizer: {schedule: {type: cosine}}\n", "optimizer.schedule.type.x=1",
                 "--set optimizer.schedule.type.x=1: type: a map, expected one of constant, cosine, exponential, step");
}

// Of two keys that do not go together, the override is to blame; without one the key is.
static void test_overrides_among_others(void **state) {
    rey_context *ctx = *state;
    static const char *const cases[][3] = {
        {HEAD, "views.0.held_out=true", "--set views.0.held_out=true: views: all are held out"},
        {HEAD "spp: 4\n", "spp.0.spp=8", "--set spp.0.spp=8: spp: a map, expected a number, or a list"},
        {HEAD "spp: [{from: 0, spp: 4}]\n", "spp.0.from=3", "--set spp.0.from=3: from = 3, expected 0 in the first entry"},
        {HEAD "optimizer: {beta1: 0.5}\n", "optimizer.type=sgd", "--set optimizer.type=sgd: 'beta1' is a key of adam"},
        {HEAD "optimizer: {schedule: {type: step, every: 3}}\n", "optimizer.schedule.type=cosine",
         "--set optimizer.schedule.type=cosine: 'every' is a key of step, not of cosine"},
        {HEAD "optimizer: {average: 1}\n", "optimizer.type=lbfgs", "--set optimizer.type=lbfgs: lbfgs ends at its best point"},
        {HEAD "optimizer: lbfgs\n", "gradient_spp=2", "--set gradient_spp=2: lbfgs needs the gradient"},
        {HEAD "optimizer: lbfgs\ngradient_spp: 2\n", NULL, "job.yaml:4: lbfgs needs the gradient"},
        {HEAD, "levels.0={from: 0, edge_length: 1}", "--set levels.0={from: 0, edge_length: 1}: edge_length is for parameters"},
        {"parameters: [{name: a, smoothness: 3, parameterisation: laplacian}]\n", "parameters.0.parameterisation=log",
         "--set parameters.0.parameterisation=log: smoothness is for 'parameterisation: laplacian'"},
        {"parameters: [{name: a, bounds: [0, 1], parameterisation: rigid}]\n", NULL,
         "job.yaml:1: parameterisation rigid has no bounds"},
        {"parameters: [{name: a, parameterisation: similarity}]\n", "parameters.0.bounds=[0,1]",
         "--set parameters.0.bounds=[0,1]: parameterisation similarity has no bounds"},
        {HEAD, "iterations=", "--set iterations=: iterations: nothing, expected a number"},
        {HEAD, "optimizer=", "--set optimizer=: optimizer: nothing, expected one of adam, sgd, lbfgs"},
        {HEAD, "iterations={", "--set iterations={: the value, which is read as YAML: "},
        {HEAD, "views.target=t", "--set views.target=t: views is a list of 1, and 'target' is no index of it, expected 0 or 1"},
        {HEAD, "levels.1.from=3", "levels is a list of 0, and '1' is no index of it, expected 0, which appends an entry"},
    };
    for (int i = 0; i < COUNT_OF(cases); i++) {
        expect_error(ctx, cases[i][0], cases[i][1], cases[i][2]);
    }
    const char text[] = HEAD, *set = "levels.0={from: 0, reduce: 2}"; // the first entry makes the list
    Job job;
    assert_int_equal(rey_job_read_memory(ctx, "job.yaml", (const unsigned char *)text, strlen(text), &set, 1, &job), REY_OK);
    assert_int_equal(job.level_count, 1);
    rey_job_free(&job);
}

// What is no text at all is found by its offset.
static void test_bytes_have_lines(void **state) {
    expect_error(*state, HEAD "a: \xff\n", NULL, "job.yaml:4: invalid leading UTF-8 octet");
    expect_error(*state, HEAD "\na: \x01\n", NULL, "job.yaml:5: control characters are not allowed");
}

static int set_up(void **state) {
    rey_context *ctx = NULL;
    rey_result result = rey_context_create(NULL, &ctx);
    *state = ctx;
    return result != REY_OK;
}

static int tear_down(void **state) {
    rey_context_destroy(*state);
    return 0;
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_keys_are_named),
        cmocka_unit_test(test_keys_of_schedules),
        cmocka_unit_test(test_keys_without_effect),
        cmocka_unit_test(test_overrides_are_blamed),
        cmocka_unit_test(test_overrides_among_others),
        cmocka_unit_test(test_bytes_have_lines),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
