// test_scene_names.c: parameters found by name: many of them, several of one name, and after some were taken back.
#include "scene/scene.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>

#include <cmocka.h>

static rey_scene *new_scene(rey_context **ctx) {
    rey_scene *scene = NULL;
    rey_context_def def = rey_default_context_def();
    assert_int_equal(rey_context_create(&def, ctx), REY_OK);
    assert_int_equal(rey_scene_new(*ctx, &scene), REY_OK);
    return scene;
}

static int find(const rey_scene *scene, const char *stem, int i) {
    char name[64];
    snprintf(name, sizeof name, "%s_%d.value", stem, i);
    return rey_param_find(scene, name);
}

static void add(rey_scene *scene, int i) {
    char name[64];
    Param p = {PARAM_DEFAULTS, .count = 1};
    snprintf(name, sizeof name, "shape_%d.value", i);
    assert_int_equal(rey_scene_add_param(scene, name, p), i);
    snprintf(name, sizeof name, "other_%d.value", i);
    assert_int_equal(rey_scene_add_alias(scene, name, i), REY_OK);
}

// A quarter of the names is taken back and replaced, again and again: the rest must stay where it was.
static void test_many_names(void **state) {
    (void)state;
    enum { COUNT = 4000, KEPT = 3000, ROUNDS = 5 };
    rey_context *ctx;
    rey_scene *scene = new_scene(&ctx);
    assert_int_equal(find(scene, "shape", 0), -1);
    for (int i = 0; i < KEPT; i++) {
        add(scene, i);
    }
    for (int round = 0; round < ROUNDS; round++) {
        for (int i = KEPT; i < COUNT; i++) {
            add(scene, i);
        }
        for (int i = 0; i < COUNT; i++) {
            assert_int_equal(find(scene, "shape", i), i);
            assert_int_equal(find(scene, "other", i), i);
        }
        rey_scene_forget_params(scene, KEPT, KEPT);
        for (int i = 0; i < COUNT; i++) {
            assert_int_equal(find(scene, "shape", i), i < KEPT ? i : -1);
            assert_int_equal(find(scene, "other", i), i < KEPT ? i : -1);
        }
    }
    rey_scene_destroy(scene);
    rey_context_destroy(ctx);
}

// The first of several counts, and a parameter's own name before another one's alias.
static void test_equal_names(void **state) {
    (void)state;
    enum { COUNT = 200 };
    rey_context *ctx;
    rey_scene *scene = new_scene(&ctx);
    Param p = {PARAM_DEFAULTS, .count = 1};
    assert_int_equal(rey_scene_add_param(scene, "first", p), 0);
    assert_int_equal(rey_scene_add_alias(scene, "twice", 0), REY_OK);
    assert_int_equal(rey_param_find(scene, "twice"), 0);
    for (int i = 1; i < COUNT; i++) {
        assert_int_equal(rey_scene_add_param(scene, "twice", p), i);
        assert_int_equal(rey_param_find(scene, "twice"), 1);
    }
    rey_scene_forget_params(scene, 2, 1);
    assert_int_equal(rey_param_find(scene, "twice"), 1);
    rey_scene_forget_params(scene, 1, 1);
    assert_int_equal(rey_param_find(scene, "twice"), 0);
    rey_scene_destroy(scene);
    rey_context_destroy(ctx);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_many_names), cmocka_unit_test(test_equal_names)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
