// test_cli_parts.c: pieces of the command line by themselves: numbers, JSON, statistics, directions.
#include "check.h"
#include "cli.h"
#include "json_read.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

static void numbers_are_all_or_nothing(void **state) {
    (void)state;
    int64_t n = 0;
    double v[4], d = 0;
    assert_true(cli_parse_integer("12", 0, 12, &n) && n == 12);
    assert_false(cli_parse_integer("13", 0, 12, &n));
    assert_false(cli_parse_integer("12x", 0, 20, &n));
    assert_false(cli_parse_integer("", 0, 20, &n));
    assert_false(cli_parse_integer("99999999999999999999", 0, INT64_MAX, &n));
    assert_true(cli_parse_number("-1.5e2", &d) && d == -150);
    assert_false(cli_parse_number("nan", &d));
    assert_false(cli_parse_number("1,2", &d));
    assert_int_equal(cli_parse_list("1,-2,0.5", 4, v), 3);
    assert_true(v[0] == 1 && v[1] == -2 && v[2] == 0.5);
    assert_int_equal(cli_parse_list("1,2,3,4,5", 4, v), -1);
    assert_int_equal(cli_parse_list("1,,2", 4, v), -1);
    assert_int_equal(cli_parse_list("1,2,", 4, v), -1);
}

static JsonNode *parse_text(const char *text) {
    char path[] = "/tmp/reynolds-json-XXXXXX";
    int descriptor = mkstemp(path);
    assert_true(descriptor >= 0);
    assert_int_equal(write(descriptor, text, strlen(text)), (ssize_t)strlen(text));
    close(descriptor);
    JsonNode *node = json_read(path);
    unlink(path);
    return node;
}

static void json_is_escaped_and_exact(void **state) {
    (void)state;
    char *text = NULL;
    size_t size = 0;
    FILE *file = open_memstream(&text, &size);
    Json json = json_begin(file);
    json_object(&json, NULL);
    json_string(&json, "quote\"", "a\\b\n\x01\xff\xc3\xa4");
    json_string(&json, "none", NULL);
    json_number(&json, "third", 1.0 / 3);
    json_number(&json, "nan", NAN);
    json_array(&json, "list");
    json_integer(&json, NULL, INT64_MIN);
    json_bool(&json, NULL, true);
    json_object(&json, NULL);
    json_object_end(&json);
    json_array_end(&json);
    json_object_end(&json);
    json_end(&json);
    fclose(file);
    assert_string_equal(
        text, "{\"quote\\\"\": \"a\\\\b\\n\\u0001\\ufffd\xc3\xa4\", \"none\": null, \"third\": 0.3333333333333333, "
              "\"nan\": null, \"list\": [-9223372036854775808, true, {}]}\n");
    JsonNode *node = parse_text(text);
    assert_true(json_value(node, "third", 0) == 1.0 / 3);
    assert_int_equal(json_get(node, "list")->kind, JSON_ARRAY);
    json_free(node);
    free(text);
}

static void json_reader_refuses_broken_text(void **state) {
    (void)state;
    static const char *const broken[] = {"{", "{\"a\": }", "[1, 2", "{\"a\" 1}", "[1] 2", "\"open", "{1: 2}"};
    for (size_t i = 0; i < sizeof broken / sizeof broken[0]; i++) {
        assert_null(parse_text(broken[i]));
    }
}

static uint32_t random_bits(uint32_t *state) {
    *state = *state * 1664525u + 1013904223u;
    return *state >> 8;
}

// Sum of twelve uniform numbers minus six: near enough normal, variance 1.
static double normal(uint32_t *state) {
    double sum = -6;
    for (int i = 0; i < 12; i++) {
        sum += random_bits(state) / 16777216.0;
    }
    return sum;
}

enum { SIZE = 64, ROW = 64 * CHECK_SERIES };
static const double exact[ROW]; // arithmetic that rounds nothing

// Block means of a derivative and of a difference that is factor times it, with shared and with own noise.
static CheckResult noisy_check(double factor, uint32_t seed) {
    static double derivative[CHECK_SETS * ROW], difference[CHECK_SETS * ROW];
    Blocks blocks = check_blocks(SIZE, SIZE);
    for (int i = 0; i < CHECK_SETS * ROW; i++) {
        double shared = 1 + 0.3 * normal(&seed);
        derivative[i] = shared + 0.02 * normal(&seed);
        difference[i] = factor * shared + 0.02 * normal(&seed);
    }
    return check_compare(&blocks, derivative, difference, difference, exact);
}

// A difference of lower order that is off by a part of each block's value, under noise.
static bool long_step(double apart, double noise, uint32_t seed) {
    static double difference[CHECK_SETS * ROW], rough[CHECK_SETS * ROW];
    Blocks blocks = check_blocks(SIZE, SIZE);
    for (int i = 0; i < CHECK_SETS * ROW; i++) {
        difference[i] = 1;
        rough[i] = 1 + apart + noise * normal(&seed);
    }
    return check_compare(&blocks, difference, difference, rough, exact).step_matters;
}

static void long_steps_are_seen(void **state) {
    (void)state;
    for (uint32_t seed = 1; seed <= 20; seed++) {
        assert_true(long_step(0.1, 0.1, seed));
        assert_false(long_step(0.001, 0.001, seed)); // harmless
        assert_false(long_step(0, 0.5, seed));       // noise
    }
}

// A derivative of some size in each block whose noise the difference shares.
static CheckResult shared_noise(double size, double sign, double noise, uint32_t seed) {
    static double derivative[CHECK_SETS * ROW];
    Blocks blocks = check_blocks(SIZE, SIZE);
    for (int i = 0; i < CHECK_SETS * ROW; i++) {
        derivative[i] = (i / CHECK_SERIES % 2 ? size : sign * size) + noise * normal(&seed);
    }
    return check_compare(&blocks, derivative, derivative, derivative, exact);
}

// The standard error of a mean over 16 sets of 64 blocks is 1/32 of a block's noise.
static void noise_that_is_shared_is_told(void **state) {
    (void)state;
    for (uint32_t seed = 1; seed <= 20; seed++) {
        CheckResult noisy = shared_noise(1, 1, 32, seed), fair = shared_noise(1, 1, 0.2, seed);
        CheckResult apart = shared_noise(1, -1, 0.2, seed);
        assert_true(noisy.relative_error == 0 && noisy.standard_error == 0);
        assert_true(noisy.gradient_standard_error > 0.4 && noisy.gradient_standard_error < 1.8);
        assert_true(fabs(fair.gradient_relative_error - 0.05) < 0.01);
        assert_true(fabs(apart.gradient_relative_error - 0.05) < 0.01); // the mean is 0, the blocks are not
        Check checks[] = {{.result = noisy}, {.result = fair}, {.result = apart}};
        for (int i = 0; i < 3; i++) {
            check_judge(&checks[i], 4, false);
            assert_int_equal(checks[i].verdict, i == 0 ? VERDICT_WEAK : VERDICT_OK);
        }
    }
}

static bool accepted(CheckResult r) {
    return fabs(r.worst_z) <= check_z_threshold(r.tests) && fabs(r.sum_z) < 3;
}

// A derivative of some size in every block where the difference is 0.
static CheckResult unseen(double size, double block_rounding) {
    static double derivative[CHECK_SETS * ROW], difference[CHECK_SETS * ROW], rounding[ROW];
    Blocks blocks = check_blocks(SIZE, SIZE);
    for (int i = 0; i < ROW; i++) {
        rounding[i] = block_rounding;
    }
    for (int i = 0; i < CHECK_SETS * ROW; i++) {
        derivative[i] = size;
    }
    return check_compare(&blocks, derivative, difference, difference, rounding);
}

static void rounding_is_no_derivative(void **state) {
    (void)state;
    assert_int_equal(unseen(1.9e-7, 1e-7).tests, 0);
    CheckResult more = unseen(5e-7, 1e-7), none = unseen(NAN, 1e-7);
    assert_true(more.tests == 3 * SIZE && !accepted(more));
    assert_true(none.tests == 3 * SIZE && !accepted(none));
}

static void statistics_accept_noise_and_refuse_errors(void **state) {
    (void)state;
    int rejected = 0;
    for (uint32_t seed = 1; seed <= 50; seed++) {
        rejected += !accepted(noisy_check(1, seed));
        assert_false(accepted(noisy_check(0, seed)));
        assert_false(accepted(noisy_check(-1, seed)));
        assert_false(accepted(noisy_check(1.03, seed)));
        assert_false(accepted(noisy_check(NAN, seed)));
    }
    assert_in_range(rejected, 0, 3);
    // Two-sided normal quantiles: 1 % for one test, 1 - 0.99^(1/100) for a hundred.
    assert_true(fabs(check_z_threshold(1) - 2.5758) < 1e-3);
    assert_true(fabs(check_z_threshold(100) - 3.8881) < 2e-3);
}

// Beyond the limits is wrong where noise is small, undecided where it is large, and wrong again where it is plain.
static void verdicts_know_noise(void **state) {
    (void)state;
    static const struct {
        double relative_error, worst_z, sum_z, reverse_error;
        Verdict verdict;
        bool undecided;
    } cases[] = {{0.01, 3, 1, 0, VERDICT_OK, false},      {0.01, 5, 1, 0, VERDICT_WRONG, false},
                 {0.01, 3, 4, 0, VERDICT_WRONG, false},   {0.5, 3, 1, 0, VERDICT_WEAK, false},
                 {0.5, 5, 1, 0, VERDICT_WEAK, true},      {0.5, 3, -4, 0, VERDICT_WEAK, true},
                 {0.5, -7, 1, 0, VERDICT_WRONG, false},   {0.5, NAN, 1, 0, VERDICT_WRONG, false},
                 {NAN, 3, 1, 0, VERDICT_WEAK, false},     {0.5, 5, 1, 1e-3, VERDICT_WRONG, false}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        Check check = {.reverse_error = cases[i].reverse_error,
                       .result = {.tests = 9, .relative_error = cases[i].relative_error, .worst_z = cases[i].worst_z,
                                  .sum_z = cases[i].sum_z}};
        check_judge(&check, 4, false);
        assert_int_equal(check.verdict, cases[i].verdict);
        assert_int_equal(check.undecided, cases[i].undecided);
    }
    Check refused = {.verdict = VERDICT_REFUSED, .result = {.tests = 9, .worst_z = 9}};
    check_judge(&refused, 4, false);
    assert_int_equal(refused.verdict, VERDICT_REFUSED);
}

// Of a derivative of 0 up to rounding the modes' digits need not agree; of a small one they must.
static void vanishing_derivatives_have_no_digits(void **state) {
    (void)state;
    const double rounding = 3e-7 * 0.5 / 0.02;
    Check none = {.reverse_gap = 1.3e-3 * 1.7e-9, .reverse_scale = 1.7e-9}, small = {.reverse_gap = 1e-8, .reverse_scale = 1e-5};
    assert_true(check_reverse_error(&none, 0) > CHECK_REVERSE_TOLERANCE);
    assert_true(check_reverse_error(&none, rounding) < CHECK_REVERSE_TOLERANCE);
    assert_true(check_reverse_error(&small, rounding) > CHECK_REVERSE_TOLERANCE);
    assert_true(check_reverse_error(&(Check){0}, 0) == 0);
}

static void blocks_are_means(void **state) {
    (void)state;
    Blocks blocks = check_blocks(21, 5);
    assert_int_equal(blocks.nx, 8);
    assert_int_equal(blocks.ny, 5);
    float image[21 * 5 * 3];
    for (int i = 0; i < 21 * 5; i++) {
        image[3 * i] = 1;
        image[3 * i + 1] = 2;
        image[3 * i + 2] = 6;
    }
    double sums[8 * 5 * CHECK_SERIES] = {0};
    check_add_blocks(&blocks, image, 0.5, sums);
    for (int i = 0; i < 8 * 5; i++) {
        static const double expected[CHECK_SERIES] = {0.5, 1, 3, 1.5};
        for (int c = 0; c < CHECK_SERIES; c++) {
            assert_true(fabs(sums[i * CHECK_SERIES + c] - expected[c]) < 1e-12);
        }
    }
}

// Messages that differ in the parameter's name alone are one reason, which names it where it holds of one alone.
static void reasons_are_grouped(void **state) {
    (void)state;
    rey_context *ctx;
    Reasons reasons = {0};
    char *text = NULL;
    size_t size = 0;
    assert_int_equal(rey_context_create(NULL, &ctx), REY_OK);
    assert_int_equal(reasons_add(ctx, &reasons, "a.b is stuck: a.b moves", "a.b"), 1);
    assert_int_equal(reasons_add(ctx, &reasons, "c moves nothing", "c"), 2);
    assert_int_equal(reasons_add(ctx, &reasons, "cube is stuck: cube moves", "cube"), 1);
    FILE *file = open_memstream(&text, &size);
    reasons_print(file, &reasons, 1);
    reasons_print(file, &reasons, 2);
    fclose(file);
    assert_string_equal(text, "[1] NAME is stuck: NAME moves\n[2] c moves nothing\n");
    free(text);
    reasons_free(ctx, &reasons);
    rey_context_destroy(ctx);
}

/* ---- directions on a real scene ------------------------------------------------------------------------------ */

typedef struct Fixture {
    rey_context *ctx;
    rey_scene *scene;
} Fixture;

static int open_scene(void **state) {
    static Fixture fixture;
    *state = &fixture;
    assert_int_equal(rey_context_create(NULL, &fixture.ctx), REY_OK);
    rey_result result = rey_scene_load(fixture.ctx, TEST_SCENE, NULL, 0, &fixture.scene);
    if (result) {
        print_error("%s\n", rey_error(fixture.ctx));
    }
    return result != REY_OK;
}

static int close_scene(void **state) {
    Fixture *f = *state;
    rey_scene_destroy(f->scene);
    rey_context_destroy(f->ctx);
    return 0;
}

static Direction build(Fixture *f, const char *a, const char *b) {
    const char *specs[] = {a, b};
    Direction d;
    rey_result result = cli_direction_build(f->ctx, f->scene, specs, b ? 2 : 1, &d);
    if (result) {
        print_error("%s\n", rey_error(f->ctx));
    }
    assert_int_equal(result, REY_OK);
    return d;
}

static void additions_sum_up(void **state) {
    Fixture *f = *state;
    Direction d = build(f, "red.reflectance.value:add=1,2,3", "metal.alpha.value");
    assert_int_equal(d.count, 2);
    assert_int_equal(d.offsets[2], 4);
    assert_true(d.tangent[0] == 1 && d.tangent[1] == 2 && d.tangent[2] == 3 && d.tangent[3] == 1);
    cli_direction_free(f->ctx, &d);
    d = build(f, "red.reflectance.value:add=1,2,3", "wall.bsdf.reflectance.value:add=-0.5");
    assert_int_equal(d.count, 1);
    assert_true(d.tangent[0] == 0.5f && d.tangent[2] == 2.5f);
    cli_direction_free(f->ctx, &d);
}

static void multiply(const double a[16], const double b[16], double out[16]) {
    for (int i = 0; i < 4; i++) {
        for (int j = 0; j < 4; j++) {
            out[4 * i + j] = 0;
            for (int k = 0; k < 4; k++) {
                out[4 * i + j] += a[4 * i + k] * b[4 * k + j];
            }
        }
    }
}

// Compares the tangent of a to_world parameter with (T(e) M - M) / e, or (M T(e) - M) / e.
static void check_motion(Fixture *f, const char *spec, const double T[16], double e, bool local) {
    Direction d = build(f, spec, NULL);
    const float *values = rey_param_values(f->scene, d.params[0]);
    double M[16], moved[16];
    for (int i = 0; i < 16; i++) {
        M[i] = (double)values[i];
    }
    multiply(local ? M : T, local ? T : M, moved);
    for (int i = 0; i < 16; i++) {
        assert_true(fabs((moved[i] - M[i]) / e - (double)d.tangent[i]) < 1e-5);
    }
    cli_direction_free(f->ctx, &d);
}

static void motions_of_transforms(void **state) {
    Fixture *f = *state;
    const double e = 1e-6, angle = e * 3.14159265358979323846 / 180, c = cos(angle), s = sin(angle);
    const double translation[16] = {1, 0, 0, e, 0, 1, 0, 2 * e, 0, 0, 1, 3 * e, 0, 0, 0, 1};
    check_motion(f, "camera.to_world:translate=1,2,3", translation, e, false);
    check_motion(f, "camera.to_world:local_translate=1,2,3", translation, e, true);
    // about the y axis through (1, 0, 2): p -> R (p - c) + c
    const double rotation[16] = {c, 0, s, 1 - c - 2 * s, 0, 1, 0, 0, -s, 0, c, 2 + s - 2 * c, 0, 0, 0, 1};
    check_motion(f, "camera.to_world:rotate=0,5,0@1,0,2", rotation, e, false);
    const double k = 1 + 0.5 * e;
    const double scaling[16] = {k, 0, 0, 1 - k, 0, k, 0, 0, 0, 0, k, 2 - 2 * k, 0, 0, 0, 1};
    check_motion(f, "camera.to_world:scale=0.5@1,0,2", scaling, e, false);
}

// Control points move as positions do, also where there are four of them; their radii grow where they are scaled.
static void motions_of_control_points(void **state) {
    Fixture strand = *(Fixture *)*state;
    assert_int_equal(rey_scene_load(strand.ctx, TEST_STRAND, NULL, 0, &strand.scene), REY_OK);
    const char *const specs[] = {"strand.control_points:translate=1,2,3", "strand.control_points:scale=0.5@1,0,2",
                                 "strand.control_points:rotate=0,0,1@1,0,0"};
    const float radian = 3.14159265f / 180;
    for (int i = 0; i < 3; i++) {
        Direction d = build(&strand, specs[i], NULL);
        const float *p = rey_param_values(strand.scene, d.params[0]);
        for (int k = 0; k < 16; k += 4) {
            const float expected[3][4] = {{1, 2, 3, 0},
                                          {0.5f * (p[k] - 1), 0.5f * p[k + 1], 0.5f * (p[k + 2] - 2), 0.5f * p[k + 3]},
                                          {-radian * p[k + 1], radian * (p[k] - 1), 0, 0}};
            for (int c = 0; c < 4; c++) {
                assert_float_equal(d.tangent[k + c], expected[i][c], 1e-6);
            }
        }
        cli_direction_free(strand.ctx, &d);
    }
    const char *local = "strand.control_points:local_translate=1,2,3";
    Direction d;
    assert_int_equal(cli_direction_build(strand.ctx, strand.scene, &local, 1, &d), REY_ERROR_ARGUMENT);
    rey_scene_destroy(strand.scene);
}

static void malformed_directions_are_refused(void **state) {
    Fixture *f = *state;
    static const char *const malformed[] = {"red.reflectance.value:ad=1",
                                            "red.reflectance.value:add",
                                            "red.reflectance.value:add=x",
                                            "red.reflectance.value:add=1,2",
                                            "red.reflectance.value:translate=1,0,0",
                                            "camera.to_world:rotate=0,0,0",
                                            "camera.to_world:translate=1,2",
                                            "camera.to_world:translate=1,2,3@0,0,0",
                                            "camera.to_world:scale=1@0,0",
                                            "red.reflectance.value:add=1,2,inf",
                                            "red.reflectance.value:add=1e39",
                                            "camera.to_world:translate=0,-1e39,0"};
    for (size_t i = 0; i < sizeof malformed / sizeof malformed[0]; i++) {
        Direction d;
        assert_int_equal(cli_direction_build(f->ctx, f->scene, &malformed[i], 1, &d), REY_ERROR_ARGUMENT);
    }
    assert_non_null(strstr(rey_error(f->ctx), "number 7 of the direction is -inf, expected numbers up to 3.4e38"));
    const char *unknown = "rad.reflectance.value", *missing = "red.reflectance.value:file=/nonexistent.npy";
    Direction d;
    assert_int_equal(cli_direction_build(f->ctx, f->scene, &unknown, 1, &d), REY_ERROR_ARGUMENT);
    assert_non_null(strstr(rey_error(f->ctx), "red.reflectance.value"));
    assert_int_equal(cli_direction_build(f->ctx, f->scene, &missing, 1, &d), REY_ERROR_IO);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(numbers_are_all_or_nothing),
        cmocka_unit_test(json_is_escaped_and_exact),
        cmocka_unit_test(json_reader_refuses_broken_text),
        cmocka_unit_test(long_steps_are_seen), cmocka_unit_test(statistics_accept_noise_and_refuse_errors),
        cmocka_unit_test(blocks_are_means), cmocka_unit_test(vanishing_derivatives_have_no_digits),
        cmocka_unit_test(noise_that_is_shared_is_told),
        cmocka_unit_test(rounding_is_no_derivative),
        cmocka_unit_test(verdicts_know_noise), cmocka_unit_test(reasons_are_grouped),
        cmocka_unit_test_setup_teardown(additions_sum_up, open_scene, close_scene),
        cmocka_unit_test_setup_teardown(motions_of_control_points, open_scene, close_scene),
        cmocka_unit_test_setup_teardown(motions_of_transforms, open_scene, close_scene),
        cmocka_unit_test_setup_teardown(malformed_directions_are_refused, open_scene, close_scene),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
