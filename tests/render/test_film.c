// test_film.c: what films deliver: pixel formats, alpha, filters of any width, and the files that they are written to.
#include "io/image.h"
#include "reynolds/reynolds.h"
#include "../folder.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

enum { EDGE = 12, PIXELS = EDGE * EDGE };

typedef struct Fixture {
    rey_context *ctx;
    char folder[64], path[128];
} Fixture;

static int set_up(void **state) {
    Fixture *f = calloc(1, sizeof *f);
    if (!f || rey_context_create(NULL, &f->ctx)) {
        return 1;
    }
    snprintf(f->folder, sizeof f->folder, "/tmp/reynolds_test_film_XXXXXX");
    *state = f;
    return !folder_make(f->folder);
}

static int tear_down(void **state) {
    Fixture *f = *state;
    int status = folder_remove(f->folder);
    rey_context_destroy(f->ctx);
    free(f);
    return status;
}

// A scene with `film` inside its film and `rest` behind its camera, which sees x and y in [-0.33, 0.33] at z = 0.
static rey_result load(Fixture *f, const char *film, const char *rest, rey_scene **scene) {
    snprintf(f->path, sizeof f->path, "%s/scene.xml", f->folder);
    FILE *file = fopen(f->path, "w");
    assert_non_null(file);
    fprintf(file,
            "<scene version=\"3.0.0\"><integrator type=\"path\"><boolean name=\"hide_emitters\" value=\"$hide\"/></integrator>\n"
            "<sensor type=\"perspective\"><float name=\"fov\" value=\"18.5\"/><transform name=\"to_world\">\n"
            "<lookat origin=\"0,0,2\" target=\"0,0,0\" up=\"0,1,0\"/></transform>\n"
            "<film type=\"hdrfilm\"><integer name=\"width\" value=\"%d\"/><integer name=\"height\" value=\"%d\"/>%s</film>\n"
            "</sensor>%s</scene>\n",
            EDGE, EDGE, film, rest);
    fclose(file);
    rey_define hide = {"hide", "false"};
    return rey_scene_load(f->ctx, f->path, &hide, 1, scene);
}

static rey_scene *load_good(Fixture *f, const char *film, const char *rest) {
    rey_scene *scene = NULL;
    if (load(f, film, rest, &scene)) {
        fail_msg("%s", rey_error(f->ctx));
    }
    return scene;
}

static const char *const lit_scene =
    "<shape type=\"rectangle\"><transform name=\"to_world\"><translate x=\"-1.05\"/></transform><emitter type=\"area\">"
    "<rgb name=\"radiance\" value=\"1,0.5,0.25\"/></emitter></shape>"
    "<shape type=\"rectangle\"><transform name=\"to_world\"><scale value=\"0.1\"/><translate x=\"0.2\"/></transform>"
    "<bsdf type=\"mask\"><float name=\"opacity\" value=\"0.25\"/><bsdf type=\"diffuse\"/></bsdf></shape>";

// Every format against the RGB picture.
static void test_pixel_formats(void **state) {
    static const struct {
        const char *format, *names;
    } cases[] = {{"rgb", "RGB"}, {"RGBA", "RGBA"}, {"luminance", "Y"}, {"luminance_alpha", "YA"}, {"xyz", "XYZ"},
                 {"xyza", "XYZA"}};
    static const double to_xyz[3][3] = {{0.412453, 0.357580, 0.180423}, {0.212671, 0.715160, 0.072169},
                                        {0.019334, 0.119193, 0.950227}};
    Fixture *f = *state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char film[256];
        static float rgb[PIXELS * 3], picture[PIXELS * 4];
        snprintf(film, sizeof film, "<string name=\"pixel_format\" value=\"%s\"/>", cases[i].format);
        rey_scene *scene = load_good(f, film, lit_scene);
        rey_render_def def = rey_default_render_def();
        int n = rey_film_channel_count(scene, 0);
        assert_int_equal(n, strlen(cases[i].names));
        assert_int_equal(rey_render(scene, &def, rgb, NULL), REY_OK);
        assert_int_equal(rey_render_film(scene, &def, picture, NULL), REY_OK);
        for (int c = 0; c < n; c++) {
            char letter = cases[i].names[c];
            assert_int_equal(rey_film_channel_name(scene, 0, c)[0], letter);
            for (int k = 0; k < PIXELS && letter != 'A'; k++) {
                const float *p = rgb + 3 * k;
                const char *at = strchr("RGB", letter);
                int row = letter - 'X';
                double expected = at ? p[at - "RGB"] : to_xyz[row][0] * p[0] + to_xyz[row][1] * p[1] + to_xyz[row][2] * p[2];
                assert_true(fabs((double)picture[k * n + c] - expected) < 1e-6);
            }
        }
        assert_null(rey_film_channel_name(scene, 0, n));
        rey_scene_destroy(scene);
    }
}

static void expect_alpha(Fixture *f, const char *rest, double left, double centre, double right) {
    static float picture[PIXELS * 4];
    rey_scene *scene = load_good(f, "<string name=\"pixel_format\" value=\"rgba\"/><rfilter type=\"box\"/>", rest);
    rey_render_def def = rey_default_render_def();
    def.spp = 1024;
    assert_int_equal(rey_render_film(scene, &def, picture, NULL), REY_OK);
    const float *row = picture + EDGE * EDGE / 2 * 4;
    const double found[3] = {(double)row[3], (double)row[4 * (EDGE / 2) + 3], (double)row[4 * 9 + 3]};
    const double expected[3] = {left, centre, right};
    for (int i = 0; i < 3; i++) {
        assert_true(fabs(found[i] - expected[i]) < 0.005);
    }
    rey_scene_destroy(scene);
}

// 1 at lights and under a sky, the opacity at masks, 0 where nothing is.
static void test_alpha(void **state) {
    Fixture *f = *state;
    char rest[2048];
    expect_alpha(f, lit_scene, 1, 0, 0.25);
    snprintf(rest, sizeof rest, "%s<emitter type=\"constant\"/>", lit_scene);
    expect_alpha(f, rest, 1, 1, 1);
}

static const char *const filters[] = {
    "<rfilter type=\"box\"/>",
    "<rfilter type=\"tent\"><float name=\"radius\" value=\"3\"/></rfilter>",
    "<rfilter type=\"gaussian\"><float name=\"stddev\" value=\"0.5\"/></rfilter>",
    "<rfilter type=\"gaussian\"><float name=\"stddev\" value=\"18.5\"/></rfilter>",
    "<rfilter type=\"gaussian\"><float name=\"stddev\" value=\"4\"/></rfilter><boolean name=\"sample_border\" value=\"true\"/>",
    "<rfilter type=\"mitchell\"/>",
    "<rfilter type=\"catmullrom\"/><boolean name=\"sample_border\" value=\"true\"/>",
    "<rfilter type=\"lanczos\"/>",
};

// A constant stays one under every filter, and forward and reverse agree with it: the picture is linear in the radiance.
static void test_filters(void **state) {
    Fixture *f = *state;
    static float picture[PIXELS * 3], derivative[PIXELS * 3], adjoint[PIXELS * 3];
    for (size_t i = 0; i < sizeof filters / sizeof *filters; i++) {
        rey_scene *scene = load_good(f, filters[i],
                                     "<emitter type=\"constant\" id=\"sky\"><float name=\"radiance\" value=\"2\"/></emitter>");
        rey_render_def def = rey_default_render_def();
        int param = rey_param_find(scene, "sky.radiance.value");
        rey_selection selection = {&param, 1};
        assert_true(param >= 0);
        float one[3] = {1, 1, 1};
        double gradient[3], sum = 0;
        int64_t size = rey_selection_size(scene, selection);
        def.spp = strstr(filters[i], "\"4\"") ? 16 : 512;
        def.sets = 1;
        assert_int_equal(rey_render(scene, &def, picture, NULL), REY_OK);
        assert_int_equal(rey_jvp(scene, &def, selection, one, derivative, NULL, NULL), REY_OK);
        for (int k = 0; k < PIXELS * 3; k++) {
            assert_true(fabsf(picture[k] - 2) < 0.02f);
            assert_true(fabsf(derivative[k] - 1) < 0.01f);
            adjoint[k] = 1 + (float)(k % 7);
            sum += (double)(adjoint[k] * derivative[k]);
        }
        assert_int_equal(rey_vjp(scene, &def, selection, adjoint, gradient, NULL, NULL), REY_OK);
        for (int64_t k = 0; k < size; k++) {
            sum -= gradient[k];
        }
        assert_true(fabs(sum) < 1e-3 * PIXELS);
        rey_scene_destroy(scene);
    }
}

static void test_filters_refused(void **state) {
    static const char *const wrong[] = {
        "<rfilter type=\"tent\"><float name=\"radius\" value=\"0\"/></rfilter>",
        "<rfilter type=\"gaussian\"><float name=\"stddev\" value=\"-1\"/></rfilter>",
        "<rfilter type=\"gaussian\"><float name=\"stddev\" value=\"65\"/></rfilter>",
        "<rfilter type=\"lanczos\"><integer name=\"lobes\" value=\"0\"/></rfilter>",
        "<rfilter type=\"mitchell\"><float name=\"A\" value=\"1\"/></rfilter>",
        "<string name=\"pixel_format\" value=\"cmyk\"/>",
        "<string name=\"component_format\" value=\"float64\"/>",
    };
    Fixture *f = *state;
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        rey_scene *scene = NULL;
        assert_int_not_equal(load(f, wrong[i], "", &scene), REY_OK);
        assert_null(scene);
    }
}

// Components and pixel formats survive saving; files of type rgbe and pfm overrule them.
static void test_formats_kept(void **state) {
    Fixture *f = *state;
    char copy[128];
    snprintf(copy, sizeof copy, "%s/copy.xml", f->folder);
    rey_scene *scene = load_good(f,
                                 "<string name=\"pixel_format\" value=\"xyza\"/><string name=\"component_format\" "
                                 "value=\"float16\"/><rfilter type=\"gaussian\"><float name=\"stddev\" value=\"4\"/></rfilter>",
                                 lit_scene);
    rey_scene *again = NULL;
    static float before[PIXELS * 4], after[PIXELS * 4];
    rey_render_def def = rey_default_render_def();
    assert_int_equal(rey_scene_save(scene, copy), REY_OK);
    assert_int_equal(rey_scene_load(f->ctx, copy, NULL, 0, &again), REY_OK);
    assert_int_equal(rey_film_component(again, 0), REY_COMPONENT_FLOAT16);
    assert_int_equal(rey_film_channel_count(again, 0), 4);
    assert_int_equal(rey_render_film(scene, &def, before, NULL), REY_OK);
    assert_int_equal(rey_render_film(again, &def, after, NULL), REY_OK);
    assert_memory_equal(before, after, sizeof before);
    rey_scene_destroy(scene);
    rey_scene_destroy(again);
    scene = load_good(f, "<string name=\"pixel_format\" value=\"xyza\"/><string name=\"file_format\" value=\"rgbe\"/>", "");
    assert_int_equal(rey_film_channel_count(scene, 0), 3);
    assert_int_equal(rey_film_component(scene, 0), REY_COMPONENT_FLOAT32);
    assert_int_equal(rey_film_channel_count(scene, 1), 0);
    assert_int_equal(rey_film_component(scene, 1), -1);
    rey_scene_destroy(scene);
}

// Half floats keep 11 bits; X Y Z are read as the colours that they are.
static void test_files(void **state) {
    static const char *const xyz[] = {"X", "Y", "Z"};
    static const float tolerance[] = {1.0f / 2048, 1e-6f};
    Fixture *f = *state;
    char path[128];
    float data[4 * 3] = {0.95047f, 1, 1.08883f, 0.412453f, 0.212671f, 0.019334f, 0.1f, 0.1f, 0.1f, 3, 2, 1};
    snprintf(path, sizeof path, "%s/film.exr", f->folder);
    for (int component = REY_COMPONENT_FLOAT16; component <= REY_COMPONENT_FLOAT32; component++) {
        rey_image image = {0};
        assert_int_equal(rey_exr_write_as(f->ctx, path, data, 2, 2, 3, NULL, component), REY_OK);
        assert_int_equal(rey_image_read(f->ctx, path, &image), REY_OK);
        for (int k = 0; k < 12; k++) {
            assert_true(fabsf(image.data[k] - data[k]) <= tolerance[component] * data[k]);
        }
        rey_image_free(f->ctx, &image);
    }
    rey_image image = {0};
    assert_int_equal(rey_exr_write_as(f->ctx, path, data, 2, 2, 3, xyz, REY_COMPONENT_FLOAT32), REY_OK);
    assert_int_equal(rey_image_read(f->ctx, path, &image), REY_OK);
    assert_int_equal(image.channels, 3);
    const float expected[6] = {1, 1, 1, 1, 0, 0};
    for (int k = 0; k < 6; k++) {
        assert_true(fabsf(image.data[k] - expected[k]) < 1e-3f);
    }
    rey_image_free(f->ctx, &image);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_pixel_formats), cmocka_unit_test(test_alpha),        cmocka_unit_test(test_filters),
        cmocka_unit_test(test_filters_refused), cmocka_unit_test(test_formats_kept), cmocka_unit_test(test_files),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
