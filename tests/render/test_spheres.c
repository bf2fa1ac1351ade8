// A few spheres are met by the kernels, many by Embree: the same picture either way, at every width. Spheres stay round where their
// pose stretches them, and so do their textures.
#include "base/context.h"
#include "base/parallel.h"
#include "reynolds/reynolds.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <unistd.h>

#include <cmocka.h>

enum { SIZE = 32, NUMBERS = 3 * SIZE * SIZE, BEYOND = 40 };

// A room inside a sphere, with spheres of glass, metal and light that stand on and in its floor.
static const char scene_head[] =
    "<scene version='3.0.0'><integrator type='path'><integer name='max_depth' value='6'/></integrator>"
    "<sensor type='perspective'><float name='fov' value='50'/>"
    "<transform name='to_world'><lookat origin='0, -6, 3' target='0, 0, 1' up='0, 0, 1'/></transform>"
    "<film type='hdrfilm'><integer name='width' value='32'/><integer name='height' value='32'/><rfilter type='box'/></film>"
    "</sensor>"
    "<shape type='sphere'><float name='radius' value='12'/><bsdf type='twosided'><bsdf type='diffuse'/></bsdf></shape>"
    "<shape type='rectangle'><transform name='to_world'><scale value='9'/></transform><bsdf type='diffuse'/></shape>"
    "<shape type='sphere'><point name='center' x='-1.5' z='1'/><bsdf type='dielectric'/></shape>"
    "<shape type='sphere'><point name='center' x='1.2' z='0.4'/><bsdf type='roughconductor'/></shape>"
    "<shape type='sphere'><point name='center' y='1' z='4'/><float name='radius' value='0.5'/>"
    "<emitter type='area'><rgb name='radiance' value='9, 8, 7'/></emitter></shape>";

// The scene that is written so far.
static void render(const char *path, int lanes, float image[NUMBERS]) {
    rey_context_def context = rey_default_context_def();
    rey_context *ctx;
    rey_scene *scene;
    rey_render_def def = rey_default_render_def();
    def.spp = 64;
    context.lanes = lanes;
    assert_int_equal(rey_context_create(&context, &ctx), REY_OK);
    if (rey_scene_load(ctx, path, NULL, 0, &scene)) {
        fail_msg("%s", rey_error(ctx));
    }
    assert_int_equal(rey_render(scene, &def, image, NULL), REY_OK);
    rey_scene_destroy(scene);
    rey_context_destroy(ctx);
    unlink(path);
}

// more: further spheres beyond the room, which nobody sees.
static void render_room(const char *path, int more, int lanes, float image[NUMBERS]) {
    FILE *f = fopen(path, "w");
    assert_non_null(f);
    fputs(scene_head, f);
    for (int i = 0; i < more; i++) {
        fprintf(f, "<shape type='sphere'><point name='center' x='%d' z='40'/></shape>", 3 * i);
    }
    fputs("</scene>", f);
    assert_int_equal(fclose(f), 0);
    render(path, lanes, image);
}

static void test_stretched(void **state) {
    static const char *const scales[] = {"0.8, 0.8, 0.8", "0.8, 1.3, 0.5"};
    static float pictures[2][NUMBERS];
    char path[64];
    UNUSED(state);
    snprintf(path, sizeof path, "/tmp/reynolds_stretched_%ld.xml", (long)getpid());
    for (int i = 0; i < COUNT_OF(scales); i++) {
        FILE *f = fopen(path, "w");
        assert_non_null(f);
        fputs(scene_head, f);
        fprintf(f, "<shape type='sphere'><transform name='to_world'><scale value='%s'/><rotate x='1' y='0.4' z='0.2' angle='50'/>"
                "<translate y='-1' z='2'/></transform><bsdf type='diffuse'><texture type='checkerboard' name='reflectance'>"
                "<transform name='to_uv'><scale x='7' y='5'/></transform></texture></bsdf></shape></scene>", scales[i]);
        assert_int_equal(fclose(f), 0);
        render(path, 0, pictures[i]);
    }
    int different = 0;
    for (int i = 0; i < NUMBERS; i++) {
        different += fabsf(pictures[1][i] - pictures[0][i]) > 0.01f * fabsf(pictures[0][i]);
    }
    print_message("stretched: %d of %d numbers differ by 1 %%\n", different, NUMBERS);
    assert_true(100 * different < NUMBERS);
}

static void test_spheres(void **state) {
    static float own[NUMBERS], embrees[NUMBERS];
    static const int lanes[] = {1, 8, 16};
    char path[64];
    UNUSED(state);
    snprintf(path, sizeof path, "/tmp/reynolds_spheres_%ld.xml", (long)getpid());
    for (int k = 0; k < COUNT_OF(lanes) && lanes[k] <= rey_widest_lanes(); k++) {
        render_room(path, 0, lanes[k], own);
        render_room(path, BEYOND, lanes[k], embrees);
        int different = 0;
        double sum = 0, other = 0;
        for (int i = 0; i < NUMBERS; i++) {
            different += fabsf(own[i] - embrees[i]) > 0.01f * fabsf(embrees[i]);
            sum += (double)own[i];
            other += (double)embrees[i];
        }
        print_message("width %d: means %.6f and %.6f, %d of %d numbers differ by 1 %%\n", lanes[k], sum / NUMBERS, other / NUMBERS,
                      different, NUMBERS);
        assert_true(other > 0.01 * NUMBERS);
        assert_true(fabs(sum / other - 1) < 1e-3);
        assert_true(100 * different < 5 * NUMBERS);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_spheres), cmocka_unit_test(test_stretched)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
