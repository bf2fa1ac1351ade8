// Gradients that parts of a derivative gather: how many, and what is too large.
#include "render/shards.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

// Each part takes eight bytes per number: at most 1 GiB in all, down to two parts.
static void test_count(void **state) {
    static const struct {
        int64_t numbers;
        int32_t tiles, shards;
    } cases[] = {{0, 100, 8},           {1 << 24, 100, 8}, {(1 << 24) + 1, 100, 4}, {1 << 25, 100, 4}, {(1 << 25) + 1, 100, 2},
                 {(int64_t)1 << 30, 100, 2}, {5, 3, 3},     {(1 << 24) + 1, 3, 3},   {(int64_t)1 << 30, 1, 1}};
    (void)state;
    for (int i = 0; i < COUNT_OF(cases); i++) {
        assert_int_equal(rey_shards_count(cases[i].tiles, cases[i].numbers), cases[i].shards);
    }
}

static void test_too_large(void **state) {
    (void)state;
    rey_context *ctx;
    rey_scene *scene;
    assert_int_equal(rey_context_create(NULL, &ctx), REY_OK);
    assert_int_equal(rey_scene_new(ctx, &scene), REY_OK);
    Render r = {.scene = scene, .tiles = 100, .gradient_size = (int64_t)1 << 42};
    const char *message = "out of memory: a gradient of 4398046511104 numbers takes 70368.7 GB besides its result, ";
    assert_int_equal(rey_shards_begin(&r), REY_ERROR_MEMORY);
    assert_memory_equal(rey_error(ctx), message, strlen(message));
    assert_null(r.gradients);
    rey_scene_destroy(scene);
    rey_context_destroy(ctx);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_count), cmocka_unit_test(test_too_large)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
