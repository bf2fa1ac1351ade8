// Several integrators inside of `aov` and `moment`: each renders as if it stood alone, and channels have the names and the order
// that Mitsuba 3.9.1 gives them.
#include "base/parallel.h"
#include "reynolds/reynolds.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#define AOV "<integrator type='aov' name='q'><string name='aovs' value='dd:depth'/>"
#define MOMENT "<integrator type='moment' name='m'>"
#define END "</integrator>"

static const char *const nested[] = {
    "<integrator type='path' name='a'><boolean name='hide_emitters' value='true'/></integrator>",
    "<integrator type='direct' name='b'><integer name='emitter_samples' value='3'/></integrator>",
    "<integrator type='volpath' name='c'><integer name='max_depth' value='4'/></integrator>",
    "<integrator type='depth' name='d'/>",
    "<integrator type='path' name='e'><integer name='max_depth' value='2'/></integrator>",
};
enum { NESTED = sizeof nested / sizeof *nested, QUANTITIES = 4 };

static const char room[] =
    "<medium type='homogeneous' id='fog'><float name='sigma_t' value='0.8'/><float name='albedo' value='0.6'/></medium>"
    "<shape type='rectangle' id='wall'><transform name='to_world'><scale value='2'/><rotate y='1' angle='30'/></transform></shape>"
    "<shape type='sphere'><float name='radius' value='0.7'/><point name='center' x='0.6' y='0' z='1'/><bsdf type='null'/>"
    "<ref name='interior' id='fog'/></shape>"
    "<shape type='sphere'><float name='radius' value='0.4'/><point name='center' x='-0.7' y='0.5' z='1'/>"
    "<emitter type='area'><float name='radiance' value='3'/></emitter></shape>"
    "<shape type='disk'><transform name='to_world'><scale value='0.5'/><translate x='-0.5' y='-0.7' z='1'/></transform>"
    "<bsdf type='mask'><float name='opacity' value='0.4'/><bsdf type='diffuse'/></bsdf></shape>"
    "<emitter type='constant'><rgb name='radiance' value='0.3, 0.5, 0.7'/></emitter>";

// Everything is seen through a crop window and a wide filter, with alpha.
static const char sensor[] =
    "<sensor type='perspective'><float name='fov' value='50'/><transform name='to_world'><lookat origin='0, 0, 5' "
    "target='0, 0, 0' up='0, 1, 0'/></transform><film type='hdrfilm'><integer name='width' value='20'/><integer name='height' "
    "value='16'/><integer name='crop_width' value='13'/><integer name='crop_height' value='11'/><integer name='crop_offset_x' "
    "value='4'/><integer name='crop_offset_y' value='3'/><string name='pixel_format' value='rgba'/></film></sensor>";
enum { PIXELS = 13 * 11, SPP = 8 };

static rey_result load(rey_context *ctx, const char *integrator, const char *rest, rey_scene **scene) {
    char path[64];
    snprintf(path, sizeof path, "/tmp/reynolds_nested_%ld.xml", (long)getpid());
    FILE *f = fopen(path, "w");
    assert_non_null(f);
    fprintf(f, "<scene version='3.0.0'>%s%s</scene>", integrator, rest);
    assert_int_equal(fclose(f), 0);
    rey_result result = rey_scene_load(ctx, path, NULL, 0, scene);
    unlink(path);
    return result;
}

static void ok(rey_context *ctx, rey_result result) {
    if (result) {
        fail_msg("%s", rey_error(ctx));
    }
}

static rey_context *context(int lanes, int threads) {
    rey_context_def def = rey_default_context_def();
    rey_context *ctx;
    def.lanes = lanes;
    def.threads = threads;
    assert_int_equal(rey_context_create(&def, &ctx), REY_OK);
    return ctx;
}

// The picture that a film holds, freed with free.
static float *film_of(rey_context *ctx, const char *integrator, const char *rest, int *channels) {
    rey_scene *scene;
    rey_render_def def = rey_default_render_def();
    def.spp = SPP;
    def.seed = 5;
    ok(ctx, load(ctx, integrator, rest, &scene));
    *channels = rey_film_channel_count(scene, 0);
    float *image = calloc((size_t)*channels * PIXELS, sizeof *image);
    assert_non_null(image);
    ok(ctx, rey_render_film(scene, &def, image, NULL));
    rey_scene_destroy(scene);
    return image;
}

static void same_channels(const char *what, const float *a, int stride_a, const float *b, int stride_b, int count) {
    for (int i = 0; i < PIXELS; i++) {
        if (memcmp(a + (ptrdiff_t)i * stride_a, b + (ptrdiff_t)i * stride_b, (size_t)count * sizeof *a) != 0) {
            fail_msg("%s: pixel %d is %.9g, alone %.9g", what, i, (double)a[(ptrdiff_t)i * stride_a],
                     (double)b[(ptrdiff_t)i * stride_b]);
        }
    }
}

static void check_alone(rey_context *ctx, const char *rest, const char *const *inside, int count) {
    char all[2048] = "<integrator type='aov'><string name='aovs' value='dd:depth,nn:sh_normal'/>";
    int channels, one;
    for (int k = 0; k < count; k++) {
        strcat(all, inside[k]);
    }
    strcat(all, END);
    float *together = film_of(ctx, all, rest, &channels);
    assert_int_equal(channels, 4 + 4 * count + QUANTITIES);
    for (int k = 0; k < count; k++) {
        float *alone = film_of(ctx, inside[k], rest, &one);
        assert_int_equal(one, 4);
        same_channels(inside[k], together + 4 + 4 * k, channels, alone, one, 4);
        if (k == 0) {
            same_channels("R G B A", together, channels, alone, one, 4);
        }
        free(alone);
    }
    static const char quantities[] = "<integrator type='aov'><string name='aovs' value='dd:depth,nn:sh_normal'/></integrator>";
    float *alone = film_of(ctx, quantities, rest, &one);
    assert_int_equal(one, 4 + QUANTITIES);
    for (int i = 0; i < PIXELS; i++) { // no colour, and no sky in alpha
        assert_true(alone[i * one] == 0 && alone[i * one + 3] == 0);
    }
    // `direct` with its split draws more samples per pixel, and so do quantities beside it.
    if (strstr(inside[0], "samples") == NULL) {
        same_channels("quantities", together + channels - QUANTITIES, channels, alone + 4, one, QUANTITIES);
    }
    free(alone);
    free(together);
}

// At every width; a sensor of the format's default filter, and a batch with the box filter.
static void test_alone(void **state) {
    (void)state;
    static const int lanes[] = {1, 8, 16};
    static const char pair[] =
        "<sensor type='batch'><sensor type='perspective'><transform name='to_world'><lookat origin='0, 0, 5' target='0, 0, 0' "
        "up='0, 1, 0'/></transform></sensor><sensor type='orthographic'><transform name='to_world'><scale value='2'/><lookat "
        "origin='0, 0, 5' target='0, 0, 0' up='0, 1, 0'/></transform></sensor><film type='hdrfilm'><integer name='width' "
        "value='26'/><integer name='height' value='11'/><string name='pixel_format' value='rgba'/><rfilter type='box'/>"
        "<integer name='crop_width' value='13'/><integer name='crop_offset_x' value='7'/></film></sensor>";
    char rest[4096];
    for (size_t i = 0; i < sizeof lanes / sizeof *lanes && lanes[i] <= rey_widest_lanes(); i++) {
        rey_context *ctx = context(lanes[i], 2);
        snprintf(rest, sizeof rest, "%s%s", sensor, room);
        check_alone(ctx, rest, nested, NESTED);
        snprintf(rest, sizeof rest, "%s%s", pair, room);
        check_alone(ctx, rest, nested, NESTED);
        rey_context_destroy(ctx);
    }
}

// Each of them can be the first; light tracing among them, where no medium is.
static void test_orders(void **state) {
    (void)state;
    const char *order[NESTED], *particles[] = {nested[0], "<integrator type='ptracer' name='p'/>", nested[3]};
    char rest[4096];
    rey_context *ctx = context(0, 3);
    snprintf(rest, sizeof rest, "%s%s", sensor, room);
    for (int first = 0; first < NESTED; first++) {
        for (int k = 0; k < NESTED; k++) {
            order[k] = nested[(first + k) % NESTED];
        }
        check_alone(ctx, rest, order, NESTED);
    }
    snprintf(rest, sizeof rest,
             "%s<shape type='sphere'/><emitter type='point'><point name='position' x='1' y='2' z='4'/></emitter>", sensor);
    check_alone(ctx, rest, particles, 3);
    particles[0] = particles[1], particles[1] = nested[0];
    check_alone(ctx, rest, particles, 3);
    rey_context_destroy(ctx);
}

static void test_threads(void **state) {
    (void)state;
    char text[2048] = MOMENT, rest[4096];
    int channels;
    float *first = NULL;
    for (int k = 0; k < NESTED; k++) {
        strcat(text, nested[k]);
    }
    strcat(text, AOV END END);
    snprintf(rest, sizeof rest, "%s%s", sensor, room);
    for (int threads = 1; threads <= 5; threads += 2) {
        rey_context *ctx = context(0, threads);
        float *image = film_of(ctx, text, rest, &channels);
        assert_int_equal(channels, 4 + 2 * (3 * NESTED + 1 + 3));
        if (first) {
            assert_memory_equal(first, image, (size_t)channels * PIXELS * sizeof *image);
            free(image);
        } else {
            first = image;
        }
        rey_context_destroy(ctx);
    }
    free(first);
}

#define RGBA(name) " " name ".R " name ".G " name ".B " name ".A"
#define XYZ(name) " " name ".X " name ".Y " name ".Z"

// As the films of Mitsuba 3.9.1 list them.
static void test_names(void **state) {
    (void)state;
    static const struct {
        const char *text, *names;
    } cases[] = {
        {AOV "<integrator type='path' name='b'/><integrator type='direct' name='a'/>" END, RGBA("b") RGBA("a") " dd.T"},
        {AOV "<integrator type='path'/><integrator type='depth' name='z'/><integrator type='direct'/>" END,
         RGBA("_arg_0") RGBA("z") RGBA("_arg_1") " dd.T"},
        {MOMENT "<integrator type='path' name='a'/><integrator type='direct' name='b'/>" END,
         XYZ("a") XYZ("b") XYZ("m2_a") XYZ("m2_b")},
        {MOMENT AOV "<integrator type='path' name='a'/><integrator type='direct' name='b'/>" END
                    "<integrator type='path' name='z'/>" END,
         RGBA("q.a") RGBA("q.b") " q.dd.T" XYZ("q") XYZ("z") RGBA("m2_q.a") RGBA("m2_q.b") " m2_q.dd.T" XYZ("m2_q") XYZ("m2_z")},
        {AOV MOMENT "<integrator type='path' name='a'/><integrator type='direct' name='b'/>" END
                    "<integrator type='path' name='z'/>" END,
         RGBA("m") RGBA("z") XYZ("m.a") XYZ("m.b") XYZ("m.m2_a") XYZ("m.m2_b") " dd.T"},
        {AOV AOV "<integrator type='path' name='a'/>" END "<integrator type='path' name='b'/>" END,
         RGBA("q") RGBA("b") RGBA("q.a") " q.dd.T dd.T"},
        {AOV AOV END "<integrator type='path' name='b'/>" END, RGBA("q") RGBA("b") " q.dd.T dd.T"},
        {MOMENT MOMENT "<integrator type='path' name='a'/>" END END,
         XYZ("m.a") XYZ("m.m2_a") XYZ("m") XYZ("m2_m.a") XYZ("m2_m.m2_a") XYZ("m2_m")},
    };
    rey_context *ctx = context(0, 1);
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char names[1024] = "";
        rey_scene *scene;
        ok(ctx, load(ctx, cases[i].text, sensor, &scene));
        for (int c = 3; c < rey_channel_count(scene); c++) {
            strcat(strcat(names, " "), rey_channel_name(scene, c));
        }
        assert_string_equal(names, cases[i].names);
        rey_scene_destroy(scene);
    }
    rey_context_destroy(ctx);
}

// As many as fit into a picture: they are counted where references multiply them, too.
static void test_many(void **state) {
    (void)state;
    enum { FIT = 59, ROOM = 64 };
    static char text[ROOM * 80];
    rey_context *ctx = context(0, 1);
    rey_scene *scene;
    for (int n = FIT; n <= FIT + 2; n++) {
        strcpy(text, AOV);
        for (int k = 0; k < n; k++) {
            sprintf(text + strlen(text), "<integrator type='path' name='p%d'/>", k);
        }
        strcat(text, END);
        rey_result result = load(ctx, text, sensor, &scene);
        assert_int_equal(result, n == FIT ? REY_OK : REY_ERROR_UNSUPPORTED);
        if (result) {
            assert_non_null(strstr(rey_error(ctx), n == FIT + 1 ? "make more than 240 channels" : "more than 60 integrators"));
        } else {
            assert_int_equal(rey_channel_count(scene), 3 + 4 * FIT + 1);
            rey_scene_destroy(scene);
        }
    }
    strcpy(text, MOMENT "<integrator type='path' name='a' id='i0'/>");
    for (int k = 0; k < 20; k++) {
        sprintf(text + strlen(text),
                "<integrator type='aov' name='w%d' id='i%d'><string name='aovs' value='dd:depth'/><ref name='x' id='i%d'/>"
                "<ref name='y' id='i%d'/></integrator>", k, k + 1, k, k);
    }
    strcat(text, END);
    assert_int_equal(load(ctx, text, sensor, &scene), REY_ERROR_UNSUPPORTED);
    assert_non_null(strstr(rey_error(ctx), "more than 60 integrators"));
    rey_context_destroy(ctx);
}

// A surface that lets half of a sky pass, behind a hole: what one path brings is one of two numbers.
static const char coin[] =
    "<shape type='rectangle'><transform name='to_world'><scale value='50'/><translate z='-1'/></transform><bsdf type='mask'>"
    "<float name='opacity' value='0.5'/><bsdf type='diffuse'><rgb name='reflectance' value='0 0 0'/></bsdf></bsdf></shape>"
    "<emitter type='constant'><rgb name='radiance' value='2 1 0.5'/></emitter><sensor type='orthographic'>"
    "<transform name='to_world'><lookat origin='0, 0, 2' target='0, 0, 0' up='0, 1, 0'/></transform><film type='hdrfilm'>"
    "<integer name='width' value='4'/><integer name='height' value='4'/></film></sensor>";
enum { COIN_PIXELS = 16 };

static void test_powers(void **state) {
    (void)state;
    static const double rows[3][3] = {
        {0.412453, 0.357580, 0.180423}, {0.212671, 0.715160, 0.072169}, {0.019334, 0.119193, 0.950227}};
    static const double depth = 2.99; // less the near plane
    double xyz[3], grey[3];
    for (int c = 0; c < 3; c++) {
        xyz[c] = 2 * rows[c][0] + rows[c][1] + 0.5 * rows[c][2];
        grey[c] = depth * (rows[c][0] + rows[c][1] + rows[c][2]);
    }
    const struct {
        const char *name;
        double expected;
    } cases[] = {
        {"R", 1}, {"q.X", xyz[0] / 2}, {"q.p.R", 1}, {"q.p.G", 0.5}, {"q.p.A", 1}, {"q.dd.T", depth}, {"m2_q.p.R", 2},
        {"m2_q.p.B", 0.125}, {"m2_q.p.A", 1}, {"m2_q.dd.T", depth * depth}, {"m2_q.Y", xyz[1] * xyz[1] / 2}, {"z.Z", grey[2]},
        {"m2_z.Z", grey[2] * grey[2]}, {"n.s.X", xyz[0] / 2}, {"n.m2_s.X", xyz[0] * xyz[0] / 2},
        {"m2_n.m2_s.X", pow(xyz[0], 4) / 2}, {"m2_n.s.Z", xyz[2] * xyz[2] / 2}, {"n.m2_t.Y", grey[1] * grey[1]},
        {"m2_n.m2_t.Y", pow(grey[1], 4)}, {"n.X", xyz[0] / 2}, {"m2_n.Z", xyz[2] * xyz[2] / 2},
    };
    rey_context *ctx = context(0, 2);
    rey_scene *scene;
    rey_render_def def = rey_default_render_def();
    def.spp = 4096;
    ok(ctx, load(ctx, MOMENT AOV "<integrator type='path' name='p'/>" END "<integrator type='depth' name='z'/>"
                      "<integrator type='moment' name='n'><integrator type='path' name='s'/><integrator type='depth' name='t'/>"
                      END END, coin, &scene));
    int channels = rey_channel_count(scene);
    float *image = calloc((size_t)channels * COIN_PIXELS, sizeof *image);
    assert_non_null(image);
    ok(ctx, rey_render_channels(scene, &def, image, NULL));
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        int c = 0;
        while (c < channels && strcmp(rey_channel_name(scene, c), cases[k].name) != 0) {
            c++;
        }
        assert_true(c < channels);
        for (int i = 0; i < COIN_PIXELS; i++) {
            double found = (double)image[i * channels + c], expected = cases[k].expected;
            if (!(fabs(found - expected) < 0.025 * expected)) {
                fail_msg("%s: %g, expected %g", cases[k].name, found, expected);
            }
        }
    }
    free(image);
    rey_scene_destroy(scene);
    rey_context_destroy(ctx);
}

// Half of the film sees a surface. Alpha is what Mitsuba 3.9.1 gives: of the sky and of what scatters; of surfaces alone for
// `direct` and `depth`; of nothing without a path.
static void test_alpha(void **state) {
    (void)state;
    static const char inside[] =
        AOV "<integrator type='path' name='a'/><integrator type='path' name='h'><boolean name='hide_emitters' value='true'/>"
            "</integrator><integrator type='direct' name='b'/><integrator type='depth' name='z'/><integrator type='path' name='n'>"
            "<integer name='max_depth' value='0'/></integrator>" END;
    enum { A = 3, H = 7, B = 11, Z = 15, N = 19, CHANNELS = 3 + 5 * 4 + 1 }; // the first ones counted behind R G B
    rey_context *ctx = context(0, 1);
    for (int k = 0; k < 4; k++) {
        bool sky = k & 1, passes = k & 2;
        float image[16 * CHANNELS];
        char rest[2048];
        int seen = 0;
        rey_scene *scene;
        rey_render_def def = rey_default_render_def();
        def.spp = SPP;
        snprintf(rest, sizeof rest,
                 "<shape type='rectangle'><transform name='to_world'><translate x='1'/></transform><bsdf type='%s'/></shape>%s"
                 "<sensor type='orthographic'><transform name='to_world'><lookat origin='0, 0, 2' target='0, 0, 0' up='0, 1, 0'/>"
                 "</transform><film type='hdrfilm'><integer name='width' value='4'/><integer name='height' value='4'/><rfilter "
                 "type='box'/></film></sensor>",
                 passes ? "null" : "diffuse", sky ? "<emitter type='constant'/>" : "");
        ok(ctx, load(ctx, inside, rest, &scene));
        assert_int_equal(rey_channel_count(scene), CHANNELS);
        ok(ctx, rey_render_channels(scene, &def, image, NULL));
        for (int i = 0; i < 16; i++) {
            const float *alpha = image + i * CHANNELS + 3;
            float surface = alpha[Z];
            seen += surface == 1;
            assert_true(surface == 0 || surface == 1);
            assert_true(alpha[A] == (sky ? 1 : passes ? 0 : surface) && alpha[H] == (passes ? 0 : surface));
            assert_true(alpha[B] == surface && alpha[N] == 0);
        }
        assert_int_equal(seen, 8);
        rey_scene_destroy(scene);
    }
    rey_context_destroy(ctx);
}

// Derivatives are those of the first one's picture.
static void test_first(void **state) {
    (void)state;
    enum { NUMBERS = 3 * PIXELS };
    static float adjoint[NUMBERS];
    char texts[3][1024], rest[4096];
    double gradient[3][3];
    rey_context *ctx = context(0, 2);
    snprintf(texts[0], sizeof texts[0], "%s", nested[4]);
    snprintf(texts[1], sizeof texts[1], AOV "%s%s" END, nested[4], nested[1]);
    snprintf(texts[2], sizeof texts[2], AOV "%s%s" END, nested[3], nested[4]);
    snprintf(rest, sizeof rest, "%s%s", sensor, room);
    for (int i = 0; i < NUMBERS; i++) {
        adjoint[i] = (float)(i % 7) / NUMBERS;
    }
    for (int k = 0; k < 3; k++) {
        rey_scene *scene;
        rey_render_def def = rey_default_render_def();
        def.spp = SPP;
        ok(ctx, load(ctx, texts[k], rest, &scene));
        int param = rey_param_find(scene, "wall.bsdf.reflectance.value");
        assert_true(param >= 0);
        const char *note = rey_scene_note(scene, 0);
        for (int i = 0; note && strncmp(note, "derivatives: ", 13) != 0; i++) {
            note = rey_scene_note(scene, i);
        }
        assert_int_equal(note != NULL, k > 0);
        float *image = calloc((size_t)rey_channel_count(scene) * PIXELS, sizeof *image);
        assert_non_null(image);
        ok(ctx, rey_render_channels(scene, &def, image, NULL)); // leaves the first one at work
        free(image);
        rey_result result = rey_vjp(scene, &def, (rey_selection){&param, 1}, adjoint, gradient[k], NULL, NULL);
        if (k == 2) {
            assert_int_equal(result, REY_ERROR_UNSUPPORTED);
            assert_non_null(strstr(rey_error(ctx), "'depth' has no derivatives, 'path' has: of several, put one such first"));
        } else {
            ok(ctx, result);
            assert_true(gradient[k][0] > 0 && memcmp(gradient[0], gradient[k], sizeof gradient[0]) == 0);
        }
        rey_scene_destroy(scene);
    }
    rey_context_destroy(ctx);
}

// A scene that is written and read again makes the same picture; a lenient reader puts the usual integrator in the place of all.
static void test_kept(void **state) {
    (void)state;
    char text[2048] = AOV, rest[4096], path[64], folder[64];
    int channels, count;
    rey_context *ctx = context(0, 2);
    rey_scene *scene, *again;
    for (int k = 0; k < NESTED; k++) {
        strcat(text, nested[k]);
    }
    strcat(text, MOMENT "<integrator type='path' name='s'/>" END END);
    snprintf(rest, sizeof rest, "%s%s", sensor, room);
    float *before = film_of(ctx, text, rest, &channels);
    ok(ctx, load(ctx, text, rest, &scene));
    snprintf(path, sizeof path, "/tmp/reynolds_nested_copy_%ld.xml", (long)getpid());
    snprintf(folder, sizeof folder, "/tmp/reynolds_nested_copy_%ld_data", (long)getpid());
    ok(ctx, rey_scene_save(scene, path));
    ok(ctx, rey_scene_load(ctx, path, NULL, 0, &again));
    unlink(path);
    rmdir(folder);
    rey_render_def def = rey_default_render_def();
    def.spp = SPP;
    def.seed = 5;
    assert_int_equal(rey_film_channel_count(again, 0), channels);
    float *after = calloc((size_t)channels * PIXELS, sizeof *after);
    assert_non_null(after);
    ok(ctx, rey_render_film(again, &def, after, NULL));
    assert_memory_equal(before, after, (size_t)channels * PIXELS * sizeof *after);
    rey_scene_destroy(scene);
    rey_scene_destroy(again);
    free(before);
    free(after);
    snprintf(text, sizeof text, AOV "%s<integrator type='stokes' name='k'/>" END, nested[1]);
    FILE *f = fopen(path, "w");
    assert_non_null(f);
    fprintf(f, "<scene version='3.0.0'>%s%s</scene>", text, rest);
    assert_int_equal(fclose(f), 0);
    ok(ctx, rey_scene_load_lenient(ctx, path, NULL, 0, &scene));
    unlink(path);
    assert_int_equal(rey_scene_ignored_count(scene), 1);
    assert_int_equal(rey_channel_count(scene), 3);
    after = calloc(4 * PIXELS, sizeof *after);
    assert_non_null(after);
    ok(ctx, rey_render_film(scene, &def, after, NULL));
    before = film_of(ctx, "<integrator type='path'/>", rest, &count);
    assert_memory_equal(before, after, 4 * PIXELS * sizeof *after);
    free(before);
    free(after);
    rey_scene_destroy(scene);
    rey_context_destroy(ctx);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_alone), cmocka_unit_test(test_orders), cmocka_unit_test(test_threads),
                                       cmocka_unit_test(test_names), cmocka_unit_test(test_many),
                                       cmocka_unit_test(test_powers), cmocka_unit_test(test_alpha), cmocka_unit_test(test_first),
                                       cmocka_unit_test(test_kept)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
