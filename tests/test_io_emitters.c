// Lights and spectra as scenes write them: what is refused and in which words, which terms parameters ask for, and which
// numbers come of the different ways to write the same light.
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

enum { NUMBERS = 8 * 8 * 3 };

static char path[64];

// Loads a scene of a lit rectangle.
static rey_result load(rey_context *ctx, const char *text, rey_scene **scene) {
    snprintf(path, sizeof path, "/tmp/reynolds_emitters_%ld.xml", (long)getpid());
    FILE *f = fopen(path, "w");
    assert_non_null(f);
    fprintf(f,
            "<scene version='3.0.0'><integrator type='path'/>\n<sensor type='perspective'><film type='hdrfilm'>"
            "<integer name='width' value='8'/><integer name='height' value='8'/></film><transform name='to_world'>"
            "<lookat origin='0, 0, 4' target='0, 0, 0' up='0, 1, 0'/></transform></sensor>"
            "<shape type='rectangle'/>\n%s\n</scene>\n",
            text);
    assert_int_equal(fclose(f), 0);
    rey_result result = rey_scene_load(ctx, path, NULL, 0, scene);
    unlink(path);
    return result;
}

static rey_scene *must_load(rey_context *ctx, const char *text) {
    rey_scene *scene = NULL;
    if (load(ctx, text, &scene)) {
        fail_msg("%s: %s", text, rey_error(ctx));
    }
    return scene;
}

#define POINT(spectrum) "<emitter type='point' id='lamp'><point name='position' value='0.5, 0, 2'/>" spectrum "</emitter>"

static void test_refusals(void **state) {
    (void)state;
    static const struct {
        const char *text, *words;
    } cases[] = {
        {"<emitter type='constant'/><emitter type='envmap'><string name='filename' value='no.exr'/></emitter>", "no.exr"},
        {"<emitter type='constant'/><emitter type='constant'/>", "only one environment emitter"},
        {"<shape type='sphere'><emitter type='spot'/></shape>", "must be an 'area' light, not 'spot'"},
        {"<emitter type='point'><float name='sampling_weight' value='-1'/></emitter>", "sampling_weight is -1"},
        {"<emitter type='point'><point name='position' value='0, 0, 1'/><transform name='to_world'/></emitter>",
         "either 'position' or 'to_world'"},
        {"<emitter type='directional'><vector name='direction' value='0, 0, 0'/></emitter>", "must not be 0"},
        {"<emitter type='directional'><vector name='direction' value='0, 0, 1'/><transform name='to_world'/></emitter>",
         "either 'direction' or 'to_world'"},
        {"<emitter type='spot'><float name='cutoff_angle' value='120'/></emitter>", "cutoff_angle is 120"},
        {"<emitter type='spot'><texture name='beam_width' type='checkerboard'/></emitter>", "must be a number"},
        {"<emitter type='spot'><float name='angle' value='20'/></emitter>", "angle"},
        {"<emitter type='spott'/>", "spot'"},
        {POINT("<spectrum type='blackbody' name='intensity'/>"), "lacks 'temperature'"},
        {POINT("<spectrum type='blackbody' name='intensity'><float name='temperature' value='-3'/></spectrum>"),
         "temperature is -3"},
        {"<bsdf type='diffuse'><spectrum type='blackbody' name='reflectance'><float name='temperature' value='5000'/>"
         "</spectrum></bsdf>",
         "the black body's colour has a channel of"},
        {POINT("<spectrum type='irregular' name='intensity'><string name='values' value='1, 2'/>"
               "<string name='wavelengths' value='400'/></spectrum>"),
         "a spectrum of 2 values at 1 wavelengths, expected two or more values, one for each of its ascending wavelengths"},
        {POINT("<spectrum type='irregular' name='intensity'><string name='values' value='1, x'/>"
               "<string name='wavelengths' value='400, 500'/></spectrum>"),
         "'values' must be numbers"},
        {POINT("<spectrum type='regular' name='intensity'><string name='values' value='1, 2'/></spectrum>"),
         "lacks 'wavelength_min'"},
        {POINT("<spectrum type='d65' name='intensity'><rgb name='color' value='1, 1, 1'/>"
               "<texture type='checkerboard' name='nested'/></spectrum>"),
         "either a 'color' or one texture"},
        {POINT("<texture type='checkerboard' name='intensity'/>"), "'intensity' of 'point' is one colour or spectrum"},
        {"<emitter type='constant'><texture type='checkerboard' name='radiance'/></emitter>", "is one colour or spectrum"},
    };
    rey_context *ctx;
    assert_int_equal(rey_context_create(NULL, &ctx), REY_OK);
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        rey_scene *scene = NULL;
        rey_result result = load(ctx, cases[i].text, &scene);
        if (result == REY_OK || !strstr(rey_error(ctx), cases[i].words)) {
            fail_msg("%s: %d, %s", cases[i].text, (int)result, rey_error(ctx));
        }
        rey_scene_destroy(scene);
    }
    rey_context_destroy(ctx);
}

static void values_of(rey_scene *scene, const char *name, int count, float *values) {
    rey_param_info info;
    int param = rey_param_find(scene, name);
    if (param < 0) {
        fail_msg("there is no %s", name);
    }
    assert_int_equal(rey_param_get_info(scene, param, &info), REY_OK);
    assert_int_equal(info.count, count);
    memcpy(values, rey_param_values(scene, param), (size_t)count * sizeof *values);
}

static void expect_numbers(rey_context *ctx, const char *text, const char *name, int count, const float *expected) {
    float values[16];
    rey_scene *scene = must_load(ctx, text);
    values_of(scene, name, count, values);
    for (int i = 0; i < count; i++) {
        if (fabsf(values[i] - expected[i]) > 1e-6f * fabsf(expected[i]) + 1e-7f) {
            fail_msg("%s: number %d is %g, expected %g", text, i, (double)values[i], (double)expected[i]);
        }
    }
    rey_scene_destroy(scene);
}

// The same light in other words.
static void test_spectra(void **state) {
    (void)state;
    float pairs[3];
    rey_context *ctx;
    assert_int_equal(rey_context_create(NULL, &ctx), REY_OK);
    rey_scene *scene = must_load(ctx, POINT("<spectrum name='intensity' value='400:1, 500:3, 600:2'/>"));
    values_of(scene, "lamp.intensity", 3, pairs);
    rey_scene_destroy(scene);
    expect_numbers(ctx, POINT("<spectrum type='regular' name='intensity'><float name='wavelength_min' value='400'/>"
                            "<float name='wavelength_max' value='600'/><string name='values' value='1, 3,2'/></spectrum>"),
                 "lamp.intensity", 3, pairs);
    expect_numbers(ctx, POINT("<spectrum type='irregular' name='intensity'><string name='values' value='1 3 2'/>"
                            "<string name='wavelengths' value='400, 500, 600'/></spectrum>"),
                 "lamp.intensity", 3, pairs);
    expect_numbers(ctx, POINT("<spectrum type='d65' name='intensity'/>"), "lamp.intensity", 3, (float[]){1, 1, 1});
    expect_numbers(ctx, POINT("<spectrum type='d65' name='intensity'><float name='scale' value='2'/></spectrum>"),
                 "lamp.intensity", 3, (float[]){2, 2, 2});
    expect_numbers(ctx, POINT("<spectrum type='d65' name='intensity'><rgb name='color' value='1, 2, 3'/></spectrum>"),
                 "lamp.intensity", 3, (float[]){1, 2, 3});
    expect_numbers(ctx, "<shape type='rectangle'><emitter type='area' id='lamp'><spectrum type='d65' name='radiance'>"
                        "<float name='scale' value='2'/><texture type='checkerboard' name='nested'/></spectrum></emitter></shape>",
                 "lamp.radiance.color0", 3, (float[]){0.4f, 0.4f, 0.4f});
    expect_numbers(ctx, POINT("<spectrum type='blackbody' name='intensity'><integer name='temperature' value='4000'/></spectrum>"),
                 "lamp.intensity.temperature", 1, (float[]){4000});
    rey_context_destroy(ctx);
}

static void render(rey_context *ctx, rey_scene *scene, float *image) {
    rey_render_def def = rey_default_render_def();
    def.spp = 4;
    if (rey_render(scene, &def, image, NULL)) {
        fail_msg("%s", rey_error(ctx));
    }
}

// A temperature that is set afterwards is one that was read.
static void test_temperatures(void **state) {
    (void)state;
    static float read[NUMBERS], set[NUMBERS], before[NUMBERS];
    const float hot = 5000;
    rey_context *ctx;
    assert_int_equal(rey_context_create(NULL, &ctx), REY_OK);
    rey_scene *scene = must_load(
        ctx, POINT("<spectrum type='blackbody' name='intensity'><float name='temperature' value='5000'/></spectrum>"));
    render(ctx, scene, read);
    rey_scene_destroy(scene);
    scene = must_load(ctx,
                      POINT("<spectrum type='blackbody' name='intensity'><float name='temperature' value='3000'/></spectrum>"));
    render(ctx, scene, before);
    assert_int_equal(rey_param_set(scene, rey_param_find(scene, "lamp.intensity.temperature"), &hot, 1), REY_OK);
    render(ctx, scene, set);
    rey_scene_destroy(scene);
    rey_context_destroy(ctx);
    assert_memory_equal(read, set, sizeof read);
    assert_true(before[NUMBERS / 2] > 0 && before[NUMBERS / 2] < read[NUMBERS / 2]);
}

static void expect_terms(rey_scene *scene, const char *name, int terms, const char *why) {
    rey_param_info info;
    int param = rey_param_find(scene, name);
    if (param < 0) {
        fail_msg("there is no %s", name);
    }
    assert_int_equal(rey_param_get_info(scene, param, &info), REY_OK);
    if (info.terms != terms || !strstr(info.why, why)) {
        fail_msg("%s: terms %d, %s", name, (int)info.terms, info.why);
    }
}

static void test_terms(void **state) {
    (void)state;
    enum { MOVES = REY_TERM_INTERIOR | REY_TERM_INDIRECT, JUMPS = MOVES | REY_TERM_PRIMARY };
    static const char shadows[] = "moving a light moves its shadows", border[] = "border of the beam is a jump";
    rey_context *ctx;
    assert_int_equal(rey_context_create(NULL, &ctx), REY_OK);
    rey_scene *scene = must_load(ctx, POINT("") "<emitter type='spot' id='soft'/>"
                                                "<emitter type='spot' id='hard'><float name='cutoff_angle' value='30'/>"
                                                "<float name='beam_width' value='30'/></emitter>"
                                                "<emitter type='directional' id='sun'/><emitter type='projector' id='slide'/>"
                                                "<emitter type='spot' id='chequered'><texture type='checkerboard' name='texture'/>"
                                                "</emitter>");
    expect_terms(scene, "lamp.intensity", REY_TERM_INTERIOR, "");
    expect_terms(scene, "lamp.position", MOVES, shadows);
    expect_terms(scene, "soft.to_world", MOVES, shadows);
    expect_terms(scene, "soft.cutoff_angle", REY_TERM_INTERIOR, "");
    expect_terms(scene, "soft.beam_width", REY_TERM_INTERIOR, "");
    expect_terms(scene, "hard.cutoff_angle", JUMPS, border);
    expect_terms(scene, "hard.beam_width", JUMPS, border);
    expect_terms(scene, "hard.intensity", REY_TERM_INTERIOR, "");
    expect_terms(scene, "hard.to_world", JUMPS, border);
    expect_terms(scene, "chequered.to_world", JUMPS, "the texture, which jumps");
    expect_terms(scene, "sun.to_world", MOVES, shadows);
    expect_terms(scene, "slide.to_world", JUMPS, "border of the picture");
    expect_terms(scene, "slide.x_fov", JUMPS, "border of the picture");
    expect_terms(scene, "slide.scale", REY_TERM_INTERIOR, "");
    rey_scene_destroy(scene);
    rey_context_destroy(ctx);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_refusals),
        cmocka_unit_test(test_spectra),
        cmocka_unit_test(test_temperatures),
        cmocka_unit_test(test_terms),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
