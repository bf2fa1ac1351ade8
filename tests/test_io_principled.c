// Reading of principled surfaces: which parameters there are, and what is refused.
#include "reynolds/reynolds.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

static rey_result load(rey_context *ctx, const char *type, const char *inside, rey_scene **scene) {
    char path[] = "/tmp/reynolds-principled-XXXXXX";
    int descriptor = mkstemp(path);
    assert_true(descriptor >= 0);
    FILE *file = fdopen(descriptor, "w");
    assert_non_null(file);
    fprintf(file,
            "<scene version=\"3.0.0\"><shape type=\"sphere\"><bsdf type=\"%s\" id=\"b\">\n%s</bsdf></shape></scene>",
            type, inside);
    fclose(file);
    rey_result result = rey_scene_load(ctx, path, NULL, 0, scene);
    unlink(path);
    return result;
}

static void test_parameters(void **state) {
    (void)state;
    static const char *const hidden[] = {"b.eta.value", "b.main_specular_sampling_rate", "b.main_specular_sampling_rate.value"};
    rey_context *ctx;
    rey_scene *scene;
    assert_int_equal(rey_context_create(NULL, &ctx), REY_OK);
    assert_int_equal(load(ctx, "principled", "<float name=\"main_specular_sampling_rate\" value=\"0.5\"/>", &scene), REY_OK);
    int at = rey_param_find(scene, "b.specular");
    assert_true(at >= 0);
    assert_true(rey_param_values(scene, at)[0] == 0.5f);
    for (size_t i = 0; i < sizeof hidden / sizeof *hidden; i++) {
        assert_true(rey_param_find(scene, hidden[i]) < 0);
    }
    rey_scene_destroy(scene);
    assert_int_equal(load(ctx, "principled", "<float name=\"eta\" value=\"1.3\"/>", &scene), REY_OK);
    assert_true(rey_param_find(scene, "b.eta.value") >= 0);
    assert_true(rey_param_find(scene, "b.specular") < 0);
    rey_scene_destroy(scene);
    assert_int_equal(load(ctx, "principledthin", "<float name=\"diff_trans\" value=\"2\"/>", &scene), REY_OK);
    at = rey_param_find(scene, "b.eta");
    assert_true(at >= 0);
    assert_true(rey_param_values(scene, at)[0] == 1.5f);
    rey_scene_destroy(scene);
    rey_context_destroy(ctx);
}

static void test_refusals(void **state) {
    (void)state;
    static const struct {
        const char *type, *inside, *message;
    } cases[] = {
        {"principled", "<float name=\"eta\" value=\"1.3\"/><float name=\"specular\" value=\"0.4\"/>", "not both"},
        {"principled", "<float name=\"clearcoat_sampling_rate\" value=\"-1\"/>", "clearcoat_sampling_rate is -1"},
        {"principled", "<float name=\"roughness\" value=\"1.5\"/>", "roughness"},
        {"principled", "<float name=\"diff_trans\" value=\"1\"/>", "diff_trans"},
        {"principledthin", "<float name=\"specular\" value=\"0.4\"/>", "specular"},
        {"principledthin", "<float name=\"diff_trans\" value=\"2.5\"/>", "diff_trans"},
    };
    rey_context *ctx;
    rey_scene *scene;
    assert_int_equal(rey_context_create(NULL, &ctx), REY_OK);
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        assert_int_not_equal(load(ctx, cases[i].type, cases[i].inside, &scene), REY_OK);
        if (!strstr(rey_error(ctx), cases[i].message) || !strstr(rey_error(ctx), ":")) {
            fail_msg("case %d: %s", (int)i, rey_error(ctx));
        }
    }
    rey_context_destroy(ctx);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_parameters), cmocka_unit_test(test_refusals)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
