// test_api.c: the C interface called wrongly: nulls, bad structs, indices that do not exist. Nothing crashes, every
// failing call leaves a message, and a call that succeeds leaves none.
#include "reynolds/reynolds.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>
#include <math.h>

enum { WIDTH = 32, HEIGHT = 24, FLOATS = WIDTH * HEIGHT * 3 };

static rey_context *ctx;
static rey_scene *scene;
static const char *const SCENE = TEST_DATA_DIR "/jobs/truth.xml";

static int open_scene(void **state) {
    (void)state;
    return rey_context_create(NULL, &ctx) || rey_scene_load(ctx, SCENE, NULL, 0, &scene);
}

static int close_scene(void **state) {
    (void)state;
    rey_scene_destroy(scene);
    rey_context_destroy(ctx);
    return 0;
}

#define CALL(expression, code, held)                                                                                   \
    do {                                                                                                               \
        rey_param_set(scene, -1, values, 1);        /* leaves a message of another call */                             \
        rey_result result_ = (expression);                                                                             \
        if (result_ != (code) || ((held) && strstr(rey_error(ctx), "parameter number"))) {                             \
            fail_msg("%s: result %d, expected %d, message '%s'", #expression, result_, code, rey_error(ctx));          \
        }                                                                                                              \
        if ((held) && (rey_error(ctx)[0] != 0) != (result_ != REY_OK)) {                                               \
            fail_msg("%s: result %d, message '%s'", #expression, result_, rey_error(ctx));                             \
        }                                                                                                              \
    } while (0)

static void nulls_are_refused(void **state) {
    (void)state;
    static float image[FLOATS], values[3];
    static double gradient[3];
    const int red = rey_param_find(scene, "red.reflectance.value");
    const rey_selection selection = {&red, 1}, absent = {NULL, 1}, negative = {&red, -1};
    rey_render_def def = rey_default_render_def();
    rey_scene *none = NULL;
    rey_param_info info;
    const rey_result bad = REY_ERROR_ARGUMENT;
    int w = 0, h = 0;
    def.spp = 1;
    assert_true(red >= 0);
    CALL(rey_scene_load(NULL, SCENE, NULL, 0, &none), bad, false);
    CALL(rey_scene_load(ctx, NULL, NULL, 0, &none), bad, true);
    CALL(rey_scene_load(ctx, SCENE, NULL, 1, &none), bad, true);
    CALL(rey_scene_load(ctx, SCENE, NULL, 0, NULL), bad, true);
    CALL(rey_scene_save(NULL, "x.xml"), bad, false);
    CALL(rey_scene_save(scene, NULL), bad, true);
    CALL(rey_scene_film_size(NULL, 0, &w, &h), bad, false);
    CALL(rey_scene_film_size(scene, 0, NULL, &h), bad, true);
    CALL(rey_scene_film_size(scene, 1, &w, &h), bad, true);
    CALL(rey_scene_film_size(scene, 0, &w, &h), REY_OK, true);
    CALL(rey_param_get_info(NULL, red, &info), bad, false);
    CALL(rey_param_get_info(scene, red, NULL), bad, true);
    CALL(rey_param_get_info(scene, red, &info), REY_OK, true);
    CALL(rey_param_set(NULL, red, values, 3), bad, false);
    CALL(rey_param_set(scene, red, NULL, 3), bad, true);
    CALL(rey_param_set(scene, red, values, 2), REY_ERROR_PARAM, true);
    CALL(rey_render(NULL, &def, image, NULL), bad, false);
    CALL(rey_render(scene, NULL, image, NULL), bad, true);
    CALL(rey_render(scene, &def, NULL, NULL), bad, true);
    CALL(rey_render(scene, &def, image, NULL), REY_OK, true);
    CALL(rey_vjp(NULL, &def, selection, image, gradient, NULL, NULL), bad, false);
    CALL(rey_vjp(scene, NULL, selection, image, gradient, NULL, NULL), bad, true);
    CALL(rey_vjp(scene, &def, absent, image, gradient, NULL, NULL), bad, true);
    CALL(rey_vjp(scene, &def, negative, image, gradient, NULL, NULL), bad, true);
    CALL(rey_vjp(scene, &def, selection, NULL, gradient, NULL, NULL), bad, true);
    CALL(rey_vjp(scene, &def, selection, image, NULL, NULL, NULL), bad, true);
    CALL(rey_jvp(NULL, &def, selection, values, image, NULL, NULL), bad, false);
    CALL(rey_jvp(scene, NULL, selection, values, image, NULL, NULL), bad, true);
    CALL(rey_jvp(scene, &def, absent, values, image, NULL, NULL), bad, true);
    CALL(rey_jvp(scene, &def, selection, NULL, image, NULL, NULL), bad, true);
    CALL(rey_jvp(scene, &def, selection, values, NULL, NULL, NULL), bad, true);
    CALL(rey_jvp(scene, &def, selection, values, image, NULL, NULL), REY_OK, true);
    const float infinite[3] = {1, INFINITY, 1};
    CALL(rey_jvp(scene, &def, selection, infinite, image, NULL, NULL), bad, true);
    assert_non_null(strstr(rey_error(ctx), "not finite at entry 1"));
    assert_null(none);
}

static void values_of_nothing(void **state) {
    (void)state;
    const rey_selection absent = {NULL, 3};
    rey_scene_info info;
    rey_scene_destroy(NULL);
    rey_context_destroy(NULL);
    rey_scene_get_info(NULL, &info);
    rey_scene_get_info(scene, NULL);
    assert_int_equal(rey_threads(NULL), 0);
    assert_int_equal(rey_lanes(NULL), 0);
    assert_int_equal(rey_scene_sensor_count(NULL), 0);
    assert_int_equal(rey_scene_note_count(NULL), 0);
    assert_null(rey_scene_note(NULL, 0));
    assert_int_equal(rey_param_count(NULL), 0);
    assert_int_equal(rey_param_find(NULL, "a"), -1);
    assert_int_equal(rey_param_find(scene, NULL), -1);
    assert_null(rey_param_nearest(NULL, "a"));
    assert_null(rey_param_nearest(scene, NULL));
    assert_null(rey_param_values(NULL, 0));
    assert_null(rey_param_values(scene, -1));
    assert_true(rey_selection_size(NULL, absent) == 0);
    assert_true(rey_selection_size(scene, absent) == 0);
    assert_null(rey_term_name(0));
    assert_null(rey_term_name(1024));
    assert_true(rey_error(NULL)[0] != 0);
    assert_true(rey_result_text((rey_result)99)[0] != 0);
}

static void bad_requests_say_what(void **state) {
    (void)state;
    static float image[FLOATS];
    static const struct {
        size_t offset;
        int value;
        const char *words;
    } cases[] = {{offsetof(rey_render_def, terms), 1024, "terms = 1024"},
                 {offsetof(rey_render_def, sensor), 1, "sensor 1 does not exist"},
                 {offsetof(rey_render_def, sensor), -1, "sensor -1 does not exist"},
                 {offsetof(rey_render_def, spp), -1, "spp = -1"},
                 {offsetof(rey_render_def, spp), 1 << 25, "spp = 33554432"},
                 {offsetof(rey_render_def, sampler), 9, "sampler = 9"},
                 {offsetof(rey_render_def, sets), 0, "sets = 0"}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        rey_render_def def = rey_default_render_def();
        memcpy((char *)&def + cases[i].offset, &cases[i].value, sizeof(int));
        assert_int_equal(rey_render(scene, &def, image, NULL), REY_ERROR_ARGUMENT);
        if (!strstr(rey_error(ctx), cases[i].words)) {
            fail_msg("'%s', expected '%s'", rey_error(ctx), cases[i].words);
        }
    }
}

static void contexts_say_why_not(void **state) {
    (void)state;
    rey_context *made = ctx;
    rey_context_def def = rey_default_context_def();
    assert_string_equal(rey_context_problem(NULL), "");
    assert_string_equal(rey_context_problem(&def), "");
    def.lanes = 4;
    assert_non_null(strstr(rey_context_problem(&def), "lanes"));
    assert_int_equal(rey_context_create(&def, &made), REY_ERROR_ARGUMENT);
    assert_null(made);
    def = rey_default_context_def();
    def.threads = -1;
    assert_non_null(strstr(rey_context_problem(&def), "threads"));
    assert_int_equal(rey_context_create(&def, &made), REY_ERROR_ARGUMENT);
    def = rey_default_context_def();
    def.size = 0;
    assert_non_null(strstr(rey_context_problem(&def), "rey_default_context_def"));
    def = rey_default_context_def();
    def.release = NULL;
    assert_int_equal(rey_context_create(&def, &made), REY_ERROR_ARGUMENT);
    assert_int_equal(rey_context_create(NULL, NULL), REY_ERROR_ARGUMENT);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(nulls_are_refused), cmocka_unit_test(values_of_nothing),
                                       cmocka_unit_test(bad_requests_say_what), cmocka_unit_test(contexts_say_why_not)};
    return cmocka_run_group_tests(tests, open_scene, close_scene);
}
