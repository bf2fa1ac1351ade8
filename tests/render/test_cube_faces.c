// Each face of a cube shows a picture of 2 x 2 texels (0.1, 0.3; 0.5, 0.8) the way round that the format defines.
#include "base/context.h"
#include "io/image.h"
#include "reynolds/reynolds.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <unistd.h>

#include <cmocka.h>

static void test_cube_faces(void **state) {
    static const struct {
        const char *at, *up;
        double seen[4];
    } faces[] = {{"5, 0, 0", "0, 0, 1", {0.1, 0.3, 0.5, 0.8}},  {"-5, 0, 0", "0, 0, 1", {0.8, 0.5, 0.3, 0.1}},
                 {"0, 5, 0", "0, 0, 1", {0.1, 0.3, 0.5, 0.8}},  {"0, -5, 0", "0, 0, 1", {0.3, 0.8, 0.1, 0.5}},
                 {"0, 0, 5", "0, 1, 0", {0.3, 0.8, 0.1, 0.5}},  {"0, 0, -5", "0, 1, 0", {0.5, 0.1, 0.8, 0.3}}};
    static const float texels[12] = {0.1f, 0.1f, 0.1f, 0.3f, 0.3f, 0.3f, 0.5f, 0.5f, 0.5f, 0.8f, 0.8f, 0.8f};
    UNUSED(state);
    char picture[64];
    snprintf(picture, sizeof picture, "/tmp/reynolds_cube_%ld.exr", (long)getpid());
    rey_context *ctx;
    assert_int_equal(rey_context_create(NULL, &ctx), REY_OK);
    assert_int_equal(rey_exr_write(ctx, picture, texels, 2, 2, 3, NULL), REY_OK);
    for (int f = 0; f < COUNT_OF(faces); f++) {
        rey_define defines[] = {{"at", faces[f].at}, {"up", faces[f].up}, {"picture", picture}};
        rey_scene *scene;
        float image[12];
        rey_render_def def = rey_default_render_def();
        def.spp = 256;
        if (rey_scene_load(ctx, RENDER_DIR "/cube.xml", defines, COUNT_OF(defines), &scene)) {
            fail_msg("%s", rey_error(ctx));
        }
        assert_int_equal(rey_render(scene, &def, image, NULL), REY_OK);
        rey_scene_destroy(scene);
        for (int i = 0; i < 4; i++) {
            assert_true(fabs((double)image[3 * i] - faces[f].seen[i]) < 0.03);
        }
    }
    unlink(picture);
    rey_context_destroy(ctx);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_cube_faces)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
