// test_cli.c: the command as a user runs it: exit statuses, where words and data go, and that its numbers agree.
#include "command.h"

#include <math.h>

static void usage_errors_exit_with_two(void **state) {
    Fixture *f = *state;
    static const char *const wrong[] = {"",
                                        "rendr %s",
                                        "render",
                                        "render %s",
                                        "render %s -o a.bmp",
                                        "render %s -o a.exr --spp 0",
                                        "render %s -o a.exr --spp 1.5",
                                        "render %s -o a.exr --spp 16777217",
                                        "grad %s --param x --mode reverse --adjoint nan",
                                        "grad %s --param x --mode reverse --adjoint 1e999",
                                        "grad %s --param red.reflectance.value:add",
                                        "grad %s --param red.reflectance.value:add=",
                                        "grad %s --param red.reflectance.value:file=",
                                        "render %s -o a.exr --ssp 4",
                                        "render %s -o a.exr extra",
                                        "render %s -o",
                                        "render %s -o a.exr -D x",
                                        "render %s -o a.exr --lanes 4",
                                        "render %s -o a.exr --sampler halton",
                                        "render %s -o a.exr --param x",
                                        "grad %s --param rad.reflectance.value",
                                        "convert %s copy.ply",
                                        "render %s -o - --json",
                                        "grad %s",
                                        "grad %s --param x --mode up",
                                        "grad %s --param x --mode reverse",
                                        "grad %s --param x --mode reverse --adjoint 1 -o -",
                                        "grad %s --param x --mode reverse --adjoint 1 -o a.npy",
                                        "grad %s --param x -o folder",
                                        "fit job.yaml --resume --overwrite",
                                        "grad %s --param x --adjoint 1",
                                        "grad %s --param x --terms nothing",
                                        "grad %s --param red.reflectance.value:ad=1",
                                        "check %s",
                                        "render %s -o a.exr --sensor 1",
                                        "render %s -o a.exr --sensor 1 --json",
                                        "grad %s --param x --spp-terms primary",
                                        "grad %s --param x --spp-terms primary=0",
                                        "grad %s --param x --spp-terms interior=4",
                                        "grad %s --param x --spp-terms primary=4,",
                                        "render %s -o a.exr --spp-terms primary=4",
                                        "compare a.exr",
                                        "doctor extra",
                                        "info %s --spp 4",
                                        "render %s -o a.exr --json=1"};
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        expect(f, 2, wrong[i]);
        bool json = strstr(wrong[i], "--json") && !strstr(wrong[i], "--json=");
        assert_true(json == (f->out[0] != 0));
        assert_true(f->words[0] != 0);
    }
    run(f, "rendr %s");
    assert_non_null(strstr(f->words, "'render'"));
    run(f, "render %s -o a.exr --ssp 4");
    assert_non_null(strstr(f->words, "'--spp'"));
}

static void help_and_version(void **state) {
    Fixture *f = *state;
    static const char *const commands[] = {"render", "grad", "check", "fit", "params", "info", "convert", "compare", "doctor"};
    expect(f, 0, "--version");
    assert_int_equal(strncmp(f->out, "reynolds ", 9), 0);
    expect(f, 0, "--help");
    for (size_t i = 0; i < sizeof commands / sizeof commands[0]; i++) {
        char arguments[64];
        assert_non_null(strstr(f->out, commands[i]));
        snprintf(arguments, sizeof arguments, "%s --help", commands[i]);
        int status = run(f, arguments);
        assert_int_equal(status, 0);
        assert_non_null(strstr(f->out, "--json"));
        run(f, "--help");
    }
    expect(f, 0, "help render");
    assert_non_null(strstr(f->out, "reynolds render SCENE"));
    expect(f, 2, "help rendr");
}

static void failures_exit_with_one(void **state) {
    Fixture *f = *state;
    expect(f, 1, "render missing.xml -o a.exr");
    assert_non_null(strstr(f->words, "missing.xml"));
    expect(f, 1, "render missing.xml -o /nonexistent/a.exr"); // found out before the scene is read
    assert_non_null(strstr(f->words, "/nonexistent/a.exr"));
    expect(f, 1, "grad missing.xml --param a --mode reverse --adjoint 1 -o /nonexistent/b");
    assert_non_null(strstr(f->words, "/nonexistent/b"));
    expect(f, 1, "compare a.exr b.exr");
    JsonNode *node = run_json(f, 1, "render missing.xml -o a.exr --json");
    assert_non_null(json_text(node, "error", NULL));
    json_free(node);
    if (access("/dev/full", W_OK) == 0) {
        char command[4096];
        snprintf(command, sizeof command, "'%s' info '%s' >/dev/full 2>words.txt", REYNOLDS_COMMAND, TEST_SCENE);
        assert_int_equal(WEXITSTATUS(system(command)), 1);
    }
}

static const char *const render_keys[] = {"seconds",         "seconds_total", "paths",   "rays", "paths_per_second",
                                          "rays_per_second", "peak_rss_mb",   "threads", "lanes",
                                          "load_seconds"};

static void expect_render_keys(const JsonNode *node) {
    for (size_t i = 0; i < sizeof render_keys / sizeof render_keys[0]; i++) {
        if (!(json_value(node, render_keys[i], -1) > 0)) {
            print_error("%s is missing or not positive\n", render_keys[i]);
            fail();
        }
    }
}

static void rendering(void **state) {
    Fixture *f = *state;
    JsonNode *node = run_json(f, 0, "render %s -o a.exr --spp 16 --json -t 1");
    expect_render_keys(node);
    assert_true(json_value(node, "paths", 0) >= 32 * 24 * 16);
    assert_true(json_value(node, "threads", 0) == 1);
    json_free(node);
    expect(f, 0, "render %s -o b.exr --spp 16 -t2");
    assert_string_equal(f->out, "");
    assert_int_equal(system("cmp a.exr b.exr"), 0); // threads change no bit
    expect(f, 0, "render %s -o - -D spp=16");
    assert_int_equal(system("cmp a.exr out.txt"), 0);
    expect(f, 0, "render %s -o c.png --spp 1");
    expect(f, 0, "render %s -o c.npy --spp 1");
    expect(f, 0, "render %s -o d.exr --spp 16 --seed 1");
    assert_int_not_equal(system("cmp -s a.exr d.exr"), 0);
    node = run_json(f, 0, "compare a.exr d.exr --json");
    assert_true(json_value(node, "mse", 0) > 0 && json_value(node, "psnr", 0) > 0);
    assert_true(fabs(json_value(node, "mean_a", 0) / json_value(node, "mean_b", 1) - 1) < 0.1);
    json_free(node);
    node = run_json(f, 0, "compare a.exr b.exr --json");
    assert_true(json_value(node, "mse", 1) == 0);
    assert_int_equal(json_get(node, "psnr")->kind, JSON_NULL);
    json_free(node);
}

#define DIRECTION                                                                                                      \
    "--param red.reflectance.value:add=1,0.5,2 --param metal.alpha.value --param lamp.emitter.radiance.value:add=0.1"

static void forward_and_reverse_agree(void **state) {
    Fixture *f = *state;
    JsonNode *forward = run_json(f, 0, "grad %s " DIRECTION " --spp 64 -o d.exr --json");
    JsonNode *reverse =
        run_json(f, 0, "grad %s " DIRECTION " --spp 64 --mode reverse --adjoint 0.00043402777777 -o g --json");
    double a = json_value(forward, "value", NAN), b = json_value(reverse, "value", NAN);
    expect_render_keys(forward);
    expect_render_keys(reverse);
    assert_true(a != 0 && fabs(a - b) <= 1e-4 * fabs(a));
    assert_true(json_value(forward, "standard_error", 0) > 0);
    assert_true(json_value(forward, "terms.interior", 0) == a);
    assert_true(json_value(forward, "complete", 0) == 1);
    json_free(forward);
    json_free(reverse);
    assert_int_equal(access("g/red.reflectance.value.npy", R_OK), 0);
    reverse = json_read("g/gradient.json");
    assert_true(json_value(reverse, "value", NAN) == b);
    json_free(reverse);
    // A gradient file is a tangent: |g|^2 along itself, which the forward mode must give too.
    expect(f, 0, "grad %s --param red.reflectance.value:file=g/red.reflectance.value.npy --spp 64");
    assert_true(strtod(f->out + strlen("value "), NULL) > 0);
    // An adjoint picture: the mean of I dI, from the rendered picture itself.
    expect(f, 0, "render %s -o a.exr --spp 16");
    expect(f, 0, "grad %s --param red.reflectance.value --spp 16 --mode reverse --adjoint a.exr");
    expect(f, 0, "grad %s --param red.reflectance.value --spp 16 -o d.png");
    assert_non_null(strstr(f->words, "blue"));
}

// Each term's share and its standard error; the shares sum up to the value, in both modes.
static void terms_have_shares(void **state) {
    Fixture *f = *state;
    static const char *const names[] = {"interior", "primary", "indirect"};
    static const char *const modes[] = {"", " --mode reverse --adjoint 0.00043402777777"};
    double shares[2][3];
    for (int mode = 0; mode < 2; mode++) {
        char arguments[256], key[64];
        snprintf(arguments, sizeof arguments, "grad %%s --param ball.to_world:translate=1,0.3,0 --spp 32 --json%s", modes[mode]);
        JsonNode *node = run_json(f, 0, arguments);
        double sum = 0, squares = 0;
        for (int k = 0; k < 3; k++) {
            snprintf(key, sizeof key, "terms.%s", names[k]);
            shares[mode][k] = json_value(node, key, NAN);
            snprintf(key, sizeof key, "terms_standard_error.%s", names[k]);
            double error = json_value(node, key, NAN);
            assert_true(shares[mode][k] != 0 && error > 0);
            sum += shares[mode][k];
            squares += error * error;
        }
        double value = json_value(node, "value", NAN), error = json_value(node, "standard_error", NAN);
        assert_true(fabs(sum - value) <= 1e-9 * fabs(value));
        assert_true(error < 2 * sqrt(squares));
        json_free(node);
    }
    for (int k = 0; k < 3; k++) {
        assert_true(fabs(shares[0][k] - shares[1][k]) <= 1e-4 * (fabs(shares[0][k]) + fabs(shares[0][0])));
    }
    // a term alone is what it is among others
    JsonNode *node = run_json(f, 0, "grad %s --param ball.to_world:translate=1,0.3,0 --spp 32 --json --terms indirect");
    assert_true(fabs(json_value(node, "value", NAN) - shares[0][2]) <= 1e-9 * fabs(shares[0][2]));
    assert_true(json_get(node, "terms.interior") == NULL);
    json_free(node);
}

// Samples of one term for its own noise; the others keep theirs.
static void terms_have_budgets(void **state) {
    Fixture *f = *state;
    JsonNode *few = run_json(f, 0,
                             "grad %s --param ball.to_world:translate=1,0.3,0 --spp 32 --json --spp-terms primary=16,indirect=32");
    JsonNode *many = run_json(
        f, 0, "grad %s --param ball.to_world:translate=1,0.3,0 --spp 32 --json --spp-terms indirect=2048,primary=1024");
    static const char *const bounded[] = {"terms_standard_error.primary", "terms_standard_error.indirect"};
    for (int k = 0; k < 2; k++) {
        double ratio = json_value(few, bounded[k], NAN) / json_value(many, bounded[k], NAN);
        assert_true(ratio > 3 && ratio < 40); // 8 where noise is that of independent samples
    }
    assert_true(json_value(few, "terms.interior", 0) == json_value(many, "terms.interior", 1));
    json_free(few);
    json_free(many);
}

static void incomplete_gradients_are_refused(void **state) {
    Fixture *f = *state;
    expect(f, 1, "grad %s -D ball=veil --param camera.to_world:translate=1,0,0 --spp 16");
    assert_non_null(strstr(f->words, "specular"));
    JsonNode *node = run_json(f, 0, "grad %s --param camera.to_world:translate=1,0,0 --spp 16 --terms interior --json");
    assert_true(json_value(node, "complete", 1) == 0);
    json_free(node);
    node = run_json(f, 0, "grad %s -D ball=glass --param glass.eta.value --spp 16 --terms interior --json");
    assert_true(json_value(node, "complete", 1) == 0);
    json_free(node);
}

static void checks_pass_on_right_gradients(void **state) {
    Fixture *f = *state;
    JsonNode *node =
        run_json(f, 0, "check %s --param red.reflectance.value --param lamp.emitter.radiance.value --spp 64 --json");
    assert_true(json_value(node, "passed", 0) == 1);
    json_free(node);
    // the interior term alone is wrong where refraction moves what is seen
    expect(f, 1, "check %s -D ball=glass --param glass.eta.value --terms interior --spp 1024");
    assert_non_null(strstr(f->out, "WRONG"));
    // too few samples to say anything
    expect(f, 0, "check %s -D ball=glass --param glass.eta.value --terms interior --spp 16 --step 1e-4");
    assert_non_null(strstr(f->out, "weak"));
    expect(f, 2, "check %s --param red.reflectance.value --step 0");
    expect(f, 2, "check %s --param red.reflectance.value --all");
}

static void check_all_lists_every_parameter(void **state) {
    Fixture *f = *state;
    JsonNode *node = run_json(f, 0, "check %s --all --spp 64 --json"), *params = run_json(f, 0, "params %s --json");
    int count = 0, listed = 0, refused = 0, right = 0;
    for (const JsonNode *row = json_get(node, "directions")->first; row; row = row->next) {
        const char *verdict = json_text(row, "verdict", "");
        count++;
        refused += !strcmp(verdict, "refused");
        right += !strcmp(verdict, "ok");
        assert_string_not_equal(verdict, "WRONG");
        // how far away a camera stands says nothing about how far it may turn
        assert_true(strcmp(json_text(row, "param", ""), "camera.to_world") || json_value(row, "step", 1) < 0.0501);
    }
    for (const JsonNode *row = json_get(params, "parameters")->first; row; row = row->next) {
        listed++;
    }
    assert_int_equal(count, listed);
    assert_true(refused > 0 && right > 0);
    json_free(node);
    json_free(params);
}

// The mean over the pixels' variances, and the standard error of the mean, come from the same sets.
static void variances_are_written(void **state) {
    Fixture *f = *state;
    expect(f, 0, "grad %s --param red.reflectance.value --spp 64 -o d.npy --variance");
    expect(f, 0, "compare d_variance.npy d_variance.npy");
    expect(f, 2, "grad %s --param red.reflectance.value --variance");
    expect(f, 2, "grad %s --param red.reflectance.value --mode reverse --adjoint 1 -o g --variance");
}

static void descriptions(void **state) {
    Fixture *f = *state;
    JsonNode *node = run_json(f, 0, "params %s --json");
    const JsonNode *list = json_get(node, "parameters"), *red = NULL;
    for (const JsonNode *p = list->first; p; p = p->next) {
        red = !strcmp(json_text(p, "name", ""), "red.reflectance.value") ? p : red;
    }
    assert_non_null(red);
    assert_true(fabs(json_get(red, "value")->first->number - 0.6) < 1e-6);
    assert_string_equal(json_get(red, "terms")->first->text, "interior");
    json_free(node);
    expect(f, 0, "params %s");
    assert_non_null(strstr(f->out, "metal.alpha.value"));
    node = run_json(f, 0, "info %s --json");
    assert_true(json_value(node, "shapes", 0) == 4);
    assert_string_equal(json_text(node, "integrator", ""), "path");
    assert_true(json_value(node, "kinds.bsdf.diffuse", 0) == 2 && json_value(node, "kinds.bsdf.roughconductor", 0) == 1);
    assert_true(json_value(node, "peak_rss_mb", 0) > 1);
    json_free(node);
    expect(f, 0, "info %s");
    assert_non_null(strstr(f->out, "diffuse 2, roughconductor 1"));
    node = run_json(f, 0, "doctor --json");
    assert_true(json_value(node, "passed", 0) == 1);
    json_free(node);
    expect(f, 0, "doctor");
}

static void interruption_exits_with_130(void **state) {
    (void)state;
    char command[4096];
    snprintf(command, sizeof command,
             "timeout --preserve-status -s INT 1 '%s' render '%s' -o slow.exr --spp 100000 2>words.txt",
             REYNOLDS_COMMAND, TEST_SCENE);
    int status = system(command);
    assert_true(WIFEXITED(status));
    assert_int_equal(WEXITSTATUS(status), 130);
    assert_int_not_equal(access("slow.exr", R_OK), 0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(usage_errors_exit_with_two),     cmocka_unit_test(help_and_version),
        cmocka_unit_test(failures_exit_with_one),         cmocka_unit_test(rendering),
        cmocka_unit_test(forward_and_reverse_agree),      cmocka_unit_test(incomplete_gradients_are_refused),
        cmocka_unit_test(terms_have_shares), cmocka_unit_test(terms_have_budgets),
        cmocka_unit_test(checks_pass_on_right_gradients), cmocka_unit_test(check_all_lists_every_parameter),
        cmocka_unit_test(variances_are_written), cmocka_unit_test(descriptions),
        cmocka_unit_test(interruption_exits_with_130),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
