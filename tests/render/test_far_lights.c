// Shadow rays leave the surface by a distance that grows with the coordinates; the light must arrive whole all the same.
#include "base/context.h"
#include "reynolds/reynolds.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>

#include <cmocka.h>

enum { WIDTH = 4, NUMBERS = WIDTH * WIDTH * 3 };

static double receiver_radiance(const char *lamp, const char *x, const char *h) {
    rey_context *ctx;
    rey_scene *scene;
    float image[NUMBERS];
    rey_define defines[] = {{"lamp", lamp}, {"x", x}, {"h", h}};
    rey_render_def def = rey_default_render_def();
    def.spp = 1024;
    assert_int_equal(rey_context_create(NULL, &ctx), REY_OK);
    rey_result result = rey_scene_load(ctx, RENDER_DIR "/far_light.xml", defines, COUNT_OF(defines), &scene);
    if (result) {
        fail_msg("%s", rey_error(ctx));
    }
    assert_int_equal(rey_render(scene, &def, image, NULL), REY_OK);
    double mean = 0;
    for (int i = 0; i < NUMBERS; i++) {
        mean += (double)image[i] / NUMBERS;
    }
    rey_scene_destroy(scene);
    rey_context_destroy(ctx);
    return mean;
}

static void test_far_lights(void **state) {
    static const struct {
        const char *lamp, *x, *h;
        double expected;
    } cases[] = {
        {"sphere", "0", "0.6", 0.25},        {"sphere", "20", "0.6", 0.25},       {"sphere", "20", "1.6", 0.03515625},
        {"sphere", "200", "0.6", 0.25},      {"disk", "0", "0.6", 0.2},           {"disk", "20", "0.6", 0.2},
        {"disk", "20", "1.6", 0.0339622642}, {"disk", "200", "1.6", 0.0339622642}};
    UNUSED(state);
    for (int i = 0; i < COUNT_OF(cases); i++) {
        double found = receiver_radiance(cases[i].lamp, cases[i].x, cases[i].h);
        print_message("%s at x = %s, h = %s: %.5f, expected %.5f\n", cases[i].lamp, cases[i].x, cases[i].h, found,
                      cases[i].expected);
        assert_true(fabs(found / cases[i].expected - 1) < 0.005);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_far_lights)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
