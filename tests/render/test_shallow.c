// Gradients of what moves where paths end before shadows, without colour, and without light samples.
#include "reynolds/reynolds.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

enum { NUMBERS = 16 * 16 * 3, POSE = 16 };

static const char stage[] =
    "<sensor type='perspective'><transform name='to_world'><lookat origin='0,2,4' target='0,0,0' up='0,1,0'/></transform>"
    "<film type='hdrfilm'><integer name='width' value='16'/><integer name='height' value='16'/></film></sensor>"
    "<emitter type='point'><point name='position' x='1' y='3' z='2'/></emitter><emitter type='constant'/>"
    "<shape type='rectangle'><transform name='to_world'><rotate x='1' angle='-90'/><scale value='2'/></transform></shape>"
    "<shape type='sphere' id='ball'><float name='radius' value='0.4'/></shape>";

// A mirror over a bright spot of a rectangle that the camera sees beside it and in it, across its diagonal.
static const char mirror[] =
    "<sensor type='perspective'><float name='fov' value='50'/><film type='hdrfilm'><integer name='width' value='16'/>"
    "<integer name='height' value='16'/></film>"
    "<transform name='to_world'><lookat origin='0.3,-0.5,0.5' target='0.3,0.5,0.6' up='0,0,1'/></transform></sensor>"
    "<emitter type='point'><point name='position' x='0.4' y='0.5' z='0.15'/></emitter>"
    "<shape type='rectangle'><transform name='to_world'><scale value='50'/></transform></shape>"
    "<shape type='sphere' id='ball'><transform name='to_world'><scale value='0.4'/><translate x='0.3' y='0.6' z='0.7'/></transform>"
    "<bsdf type='conductor'><string name='material' value='none'/></bsdf></shape>";

// The derivative as the ball moves along x, or what refuses it.
static rey_result move(const char *integrator, const char *objects, int terms, float *derivative, char *message, size_t size) {
    char path[64];
    rey_context *ctx;
    rey_scene *scene;
    const float tangent[POSE] = {[3] = 1};
    rey_render_def def = rey_default_render_def();
    def.spp = 64;
    def.terms = terms;
    snprintf(path, sizeof path, "/tmp/reynolds_shallow_%ld.xml", (long)getpid());
    FILE *f = fopen(path, "w");
    assert_non_null(f);
    fprintf(f, "<scene version='3.0.0'>%s%s</scene>", integrator, objects);
    assert_int_equal(fclose(f), 0);
    assert_int_equal(rey_context_create(NULL, &ctx), REY_OK);
    assert_int_equal(rey_scene_load(ctx, path, NULL, 0, &scene), REY_OK);
    unlink(path);
    int param = rey_param_find(scene, "ball.to_world");
    assert_true(param >= 0);
    rey_result result = rey_jvp(scene, &def, (rey_selection){&param, 1}, tangent, derivative, NULL, NULL);
    snprintf(message, size, "%s", result ? rey_error(ctx) : "");
    rey_scene_destroy(scene);
    rey_context_destroy(ctx);
    return result;
}

// Paths of one segment see no shadows: the ball only hides the sky.
static void test_depths(void **state) {
    static const char *const names[] = {"path", "volpath"};
    (void)state;
    for (int k = 0; k < 8; k++) {
        float derivative[NUMBERS];
        char integrator[128], message[512];
        double size = 0;
        int depth = k % 4;
        snprintf(integrator, sizeof integrator, "<integrator type='%s'><integer name='max_depth' value='%d'/></integrator>",
                 names[k / 4], depth);
        assert_int_equal(move(integrator, stage, REY_TERM_INDIRECT, derivative, message, sizeof message), REY_OK);
        for (int i = 0; i < NUMBERS; i++) {
            size += (double)derivative[i] * (double)derivative[i];
        }
        assert_true(depth < 2 ? size <= 0 : size > 0);
    }
}

// Nothing jumps between two triangles of one plane, as those of a rectangle: where an outline squeezes them together in a mirror,
// the difference of both sides was up to 3 % of the derivative, 0.2 % here.
static void test_diagonals(void **state) {
    static const char path[] = "<integrator type='path'><integer name='max_depth' value='3'/></integrator>";
    static const int terms[] = {REY_TERM_INTERIOR, REY_TERM_SPECULAR};
    double sums[2] = {0, 0};
    (void)state;
    for (int k = 0; k < 2; k++) {
        float derivative[NUMBERS];
        char message[512];
        assert_int_equal(move(path, mirror, terms[k], derivative, message, sizeof message), REY_OK);
        for (int i = 0; i < NUMBERS; i++) {
            sums[k] += (double)derivative[i];
        }
    }
    print_message("interior %g, specular %g\n", sums[0], sums[1]);
    assert_true(fabs(sums[1]) < 1e-4 * fabs(sums[0]));
}

static void test_refusals(void **state) {
    static const struct {
        const char *integrator, *words;
    } rows[] = {{"<integrator type='aov'><string name='aovs' value='d:depth'/></integrator>", "has no derivatives"},
                {"<integrator type='moment'><integrator type='aov'><string name='aovs' value='d:depth'/></integrator></integrator>",
                 "has no derivatives"},
                {"<integrator type='direct'><integer name='emitter_samples' value='0'/></integrator>", "without emitter_samples"}};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        float derivative[NUMBERS];
        char message[512];
        assert_int_not_equal(move(rows[i].integrator, stage, 0, derivative, message, sizeof message), REY_OK);
        assert_non_null(strstr(message, rows[i].words));
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_depths), cmocka_unit_test(test_diagonals),
                                       cmocka_unit_test(test_refusals)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
