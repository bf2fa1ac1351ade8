// test_texels.c: bitmaps that lie in 8 or 16 bits until somebody changes them: the same numbers, pictures and gradients to the
// bit as floats, in less memory.
#include "base/parallel.h"
#include "folder.h"
#include "io/image.h"
#include "io/pack.h"
#include "reynolds/reynolds.h"
#include "scene/texels.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

enum { WIDE = 640, HIGH = 480, NUMBERS = WIDE * HIGH * 3, SIDE = 16, PIXELS = SIDE * SIDE * 3 };

static char folder[64], picture[96], scene_path[96];
static float numbers[NUMBERS];

static int make_folder(void **state) {
    (void)state;
    snprintf(folder, sizeof folder, "/tmp/reynolds_texels_XXXXXX");
    return !folder_make(folder);
}

static int remove_folder(void **state) {
    (void)state;
    return unlink(picture) || unlink(scene_path) || rmdir(folder);
}

// A wall with the picture on it, seen from near by, its texels turned and stretched; another one bumps the lower half.
static rey_scene *open_wall(rey_context *ctx, const char *file, const char *more) {
    rey_scene *scene;
    snprintf(picture, sizeof picture, "%s/%s", folder, file);
    snprintf(scene_path, sizeof scene_path, "%s/scene.xml", folder);
    FILE *out = fopen(scene_path, "w");
    assert_non_null(out);
    fprintf(out,
            "<scene version='3.0.0'><integrator type='path'/><sensor type='perspective'><transform name='to_world'>"
            "<lookat origin='0.1,0.2,2' target='0,0,0' up='0,1,0'/></transform><film type='hdrfilm'><integer name='width' "
            "value='%d'/><integer name='height' value='%d'/></film></sensor><bsdf type='diffuse' id='wall'><texture "
            "type='bitmap' name='reflectance'><string name='filename' value='%s'/><transform name='to_uv'><rotate z='1' "
            "angle='20'/></transform>%s</texture></bsdf><shape type='rectangle'><ref id='wall'/></shape>"
            "<emitter type='constant'/></scene>",
            SIDE, SIDE, file, more);
    assert_int_equal(fclose(out), 0);
    if (rey_scene_load(ctx, scene_path, NULL, 0, &scene) != REY_OK) {
        fail_msg("%s", rey_error(ctx));
    }
    return scene;
}

static void render(rey_scene *scene, float *image) {
    rey_render_def def = rey_default_render_def();
    def.spp = 16;
    assert_int_equal(rey_render(scene, &def, image, NULL), REY_OK);
}

static void gradient(rey_scene *scene, int param, double *out) {
    static float ones[PIXELS];
    rey_render_def def = rey_default_render_def();
    def.spp = 16;
    def.terms = REY_TERM_INTERIOR; // where texels jump, to_uv has another one
    for (int i = 0; i < PIXELS; i++) {
        ones[i] = 1 + (float)(i % 7);
    }
    assert_int_equal(rey_vjp(scene, &def, (rey_selection){&param, 1}, ones, out, NULL, NULL), REY_OK);
}

static int64_t bytes_of(const rey_scene *scene) {
    rey_scene_info info;
    rey_scene_get_info(scene, &info);
    return info.bytes;
}

// The same scene with packed texels and with floats: what each number takes, and that nothing else differs.
static void compare_lanes(const char *file, const char *more, int per_number, int lanes) {
    static float packed_image[PIXELS], float_image[PIXELS];
    static double packed_gradient[NUMBERS], float_gradient[NUMBERS];
    char variant[256];
    rey_context *ctx;
    rey_context_def def = rey_default_context_def();
    def.lanes = lanes;
    assert_int_equal(rey_context_create(&def, &ctx), REY_OK);
    snprintf(variant, sizeof variant, "%s<string name='format' value='variant'/>", more);
    rey_scene *floats = open_wall(ctx, file, variant), *packed = open_wall(ctx, file, more);
    int param = rey_param_find(packed, "wall.reflectance.data");
    rey_param_info info;
    assert_int_equal(rey_param_get_info(packed, param, &info), REY_OK);
    int64_t saved = bytes_of(floats) - bytes_of(packed);
    assert_true(llabs(saved - info.count * (4 - per_number)) < info.count / 2); // arrays have some room to spare
    render(floats, float_image);
    render(packed, packed_image);
    assert_memory_equal(packed_image, float_image, sizeof float_image);
    gradient(floats, param, float_gradient);
    gradient(packed, param, packed_gradient);
    assert_memory_equal(packed_gradient, float_gradient, (size_t)info.count * sizeof(double));
    gradient(floats, rey_param_find(floats, "wall.reflectance.to_uv"), float_gradient);
    gradient(packed, rey_param_find(packed, "wall.reflectance.to_uv"), packed_gradient);
    assert_memory_equal(packed_gradient, float_gradient, 9 * sizeof(double));
    // whoever asks for the numbers gets floats, and whoever writes them writes all
    const float *values = rey_param_values(packed, param);
    assert_memory_equal(values, rey_param_values(floats, param), (size_t)info.count * sizeof(float));
    render(packed, packed_image);
    assert_memory_equal(packed_image, float_image, sizeof float_image);
    rey_scene_destroy(packed);
    packed = open_wall(ctx, file, more);
    for (int64_t i = 0; i < info.count; i++) {
        numbers[i] = (float)(i % 11) / 13;
    }
    assert_int_equal(rey_param_set(packed, param, numbers, info.count), REY_OK);
    assert_int_equal(rey_param_set(floats, param, numbers, info.count), REY_OK);
    render(packed, packed_image);
    render(floats, float_image);
    assert_memory_equal(packed_image, float_image, sizeof float_image);
    rey_scene_destroy(packed);
    rey_scene_destroy(floats);
    rey_context_destroy(ctx);
}

static void compare(const char *file, const char *more, int per_number) {
    const int widest = rey_widest_lanes();
    for (int lanes = 1; lanes <= widest; lanes = lanes == 1 ? 8 : 2 * lanes) {
        compare_lanes(file, more, per_number, lanes);
    }
    unlink(picture);
}

static void write_picture(const char *file, float (*number)(int64_t)) {
    rey_context *ctx;
    snprintf(picture, sizeof picture, "%s/%s", folder, file);
    assert_int_equal(rey_context_create(NULL, &ctx), REY_OK);
    for (int64_t i = 0; i < NUMBERS; i++) {
        numbers[i] = number(i);
    }
    rey_result result = strstr(file, ".png") ? rey_png_write(ctx, picture, numbers, WIDE, HIGH)
                                             : rey_exr_write(ctx, picture, numbers, WIDE, HIGH, 3, NULL);
    assert_int_equal(result, REY_OK);
    rey_context_destroy(ctx);
}

static float level(int64_t i) { return (float)(i * 37 % 256) / 255.0f; }
// Every mantissa and exponent that a half has up to 1, and those below 2^-14.
static float half(int64_t i) { return ldexpf((float)(i * 29 % 2048), -(int)(i % 14)) / 2048; }
static float any(int64_t i) { return (float)(i % 1000) / 1001; }

static void bytes(void **state) {
    (void)state;
    write_picture("a.png", level);
    compare("a.png", "", 1);
    write_picture("b.png", level);
    compare("b.png", "<boolean name='raw' value='true'/><string name='filter_type' value='nearest'/>", 1);
    write_picture("c.exr", level);
    compare("c.exr", "<string name='wrap_mode' value='mirror'/>", 1);
}

static void halves(void **state) {
    (void)state;
    write_picture("a.exr", half);
    compare("a.exr", "", 2);
}

static void others_stay(void **state) {
    (void)state;
    write_picture("z.exr", any);
    compare("z.exr", "", 4);
    write_picture("z.exr", any); // for remove_folder
}

// Every half there is, but for infinities.
static void every_half(void **state) {
    (void)state;
    rey_context *ctx;
    assert_int_equal(rey_context_create(NULL, &ctx), REY_OK);
    enum { FINITE = 31 * 1024 };
    rey_image image;
    PackedImage packed;
    for (int sign = -1; sign <= 1; sign += 2) {
        assert_int_equal(rey_image_new(ctx, "halves", FINITE, 1, 1, &image), REY_OK);
        for (int i = 0; i < FINITE; i++) {
            int exponent = i / 1024, mantissa = i % 1024 + (exponent ? 1024 : 0);
            image.data[i] = (float)sign * ldexpf((float)mantissa, (exponent ? exponent : 1) - 25);
        }
        assert_int_equal(rey_image_pack(ctx, &image, false, &packed), REY_OK);
        assert_int_equal(packed.storage, TEXELS_HALF);
        assert_null(image.data);
        for (int i = 0; i < FINITE; i++) {
            int bits = packed.bytes[2 * i] | packed.bytes[2 * i + 1] << 8;
            assert_int_equal(bits & 0x7fff, i);
            assert_int_equal(bits >> 15, sign < 0);
        }
        rey_free(ctx, packed.bytes);
    }
    static const float never[] = {65536, INFINITY, NAN, 1.0001f, 1e-9f, 0.1f};
    for (size_t i = 0; i < sizeof never / sizeof never[0]; i++) {
        assert_int_equal(rey_image_new(ctx, "no half", 1, 1, 1, &image), REY_OK);
        image.data[0] = never[i];
        assert_int_equal(rey_image_pack(ctx, &image, false, &packed), REY_OK);
        assert_true(!packed.bytes && image.data);
        rey_image_free(ctx, &image);
    }
    rey_context_destroy(ctx);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(bytes), cmocka_unit_test(halves), cmocka_unit_test(others_stay),
                                       cmocka_unit_test(every_half)};
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
