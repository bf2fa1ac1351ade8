// Scattering functions as scenes write them: what is refused and in which words, and which terms parameters ask for.
#include "reynolds/reynolds.h"
#include "scene/absent.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

static char path[64];

// Loads a scene of one rectangle with these functions and textures.
static rey_result load(rey_context *ctx, const char *text, rey_scene **scene) {
    snprintf(path, sizeof path, "/tmp/reynolds_bsdf_%ld.xml", (long)getpid());
    FILE *f = fopen(path, "w");
    assert_non_null(f);
    fprintf(f, "<scene version='3.0.0'>\n<sensor type='perspective'/>\n%s\n</scene>\n", text);
    assert_int_equal(fclose(f), 0);
    rey_result result = rey_scene_load(ctx, path, NULL, 0, scene);
    unlink(path);
    return result;
}

static void test_refusals(void **state) {
    (void)state;
    static const struct {
        const char *text;
        rey_result result;
        const char *words;
    } cases[] = {
        {"<bsdf type='polarizer'/>", REY_ERROR_UNSUPPORTED, "bsdf 'polarizer' is not supported: light has no polarisation"},
        {"<bsdf type='retarder'/>", REY_ERROR_UNSUPPORTED, "no polarisation"},
        {"<bsdf type='circular'/>", REY_ERROR_UNSUPPORTED, "no polarisation"},
        {"<bsdf type='pplastic'/>", REY_ERROR_UNSUPPORTED, "'roughplastic' is its unpolarised form"},
        {"<bsdf type='measured_polarized'/>", REY_ERROR_UNSUPPORTED, "no polarisation"},
        {"<bsdf type='measured'/>", REY_ERROR_UNSUPPORTED, "measured reflectance data is not read"},
        {"<bsdf type='hair'/>", REY_ERROR_UNSUPPORTED, "no scattering of hair"},
        {"<bsdf type='blendbsdf'><bsdf type='diffuse'/><bsdf type='diffuse'/></bsdf>", REY_ERROR_SCENE, "lacks 'weight'"},
        {"<bsdf type='blendbsdf'><float name='weight' value='0.5'/><bsdf type='diffuse'/></bsdf>", REY_ERROR_SCENE,
         "'blendbsdf' takes 2 nested bsdf, found 1"},
        {"<bsdf type='normalmap'><bsdf type='diffuse'/></bsdf>", REY_ERROR_SCENE, "lacks 'normalmap'"},
        {"<bsdf type='bumpmap'><bsdf type='diffuse'/></bsdf>", REY_ERROR_SCENE, "takes one nested texture, found 0"},
        {"<bsdf type='bumpmap'><texture type='checkerboard' name='a'/><texture type='checkerboard' name='b'/>"
         "<bsdf type='diffuse'/></bsdf>",
         REY_ERROR_SCENE, "takes one nested texture, found 2"},
        {"<bsdf type='twosided'><bsdf type='dielectric'/></bsdf>", REY_ERROR_SCENE, "lets light through"},
        {"<bsdf type='twosided'><bsdf type='diffuse'/><bsdf type='mask'><bsdf type='diffuse'/></bsdf></bsdf>",
         REY_ERROR_SCENE, "lets light through"},
        {"<bsdf type='twosided'><bsdf type='principled'><float name='spec_trans' value='0.5'/></bsdf></bsdf>",
         REY_ERROR_SCENE, "lets light through"},
        {"<bsdf type='twosided'><boolean name='allow_transmission' value='true'/><bsdf type='dielectric'/></bsdf>",
         REY_OK, ""},
        {"<bsdf type='twosided'><bsdf type='principled'/><bsdf type='roughplastic'/></bsdf>", REY_OK, ""},
    };
    rey_context *ctx;
    assert_int_equal(rey_context_create(NULL, &ctx), REY_OK);
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        rey_scene *scene = NULL;
        rey_result result = load(ctx, cases[i].text, &scene);
        if (result != cases[i].result || (result != REY_OK && !strstr(rey_error(ctx), cases[i].words))) {
            fail_msg("%s: %d, %s", cases[i].text, (int)result, rey_error(ctx));
        }
        rey_scene_destroy(scene);
    }
    rey_context_destroy(ctx);
}

static int terms_of(const rey_scene *scene, const char *name) {
    rey_param_info info;
    int param = rey_param_find(scene, name);
    if (param < 0) {
        fail_msg("there is no %s", name);
    }
    assert_int_equal(rey_param_get_info(scene, param, &info), REY_OK);
    return info.terms;
}

// A texture that stands by itself has the range of what refers to it, the narrower one of two.
static void test_ranges(void **state) {
    (void)state;
    static const char text[] = "<texture type='checkerboard' id='shared'/>"
                               "<bsdf type='diffuse' id='paint'><ref name='reflectance' id='shared'/></bsdf>"
                               "<bsdf type='blendbsdf' id='mix'><ref name='weight' id='shared'/><bsdf type='diffuse'/>"
                               "<bsdf type='diffuse'/></bsdf>"
                               "<texture type='checkerboard' id='free'/>"
                               "<bsdf type='bumpmap' id='bumpy'><ref id='free'/><bsdf type='diffuse'/></bsdf>";
    rey_context *ctx;
    rey_scene *scene;
    assert_int_equal(rey_context_create(NULL, &ctx), REY_OK);
    assert_int_equal(load(ctx, text, &scene), REY_OK);
    rey_param_info info;
    assert_int_equal(rey_param_get_info(scene, rey_param_find(scene, "shared.color0.value"), &info), REY_OK);
    assert_true(info.low == 0 && info.high == 1);
    assert_int_equal(rey_param_get_info(scene, rey_param_find(scene, "free.color0.value"), &info), REY_OK);
    assert_true(info.low < 0 && info.high > 1);
    rey_scene_destroy(scene);
    rey_context_destroy(ctx);
}

// A texture that colours one function and turns the normal of another one asks for what both of them need.
static void test_terms(void **state) {
    (void)state;
    enum { TURNS = REY_TERM_INTERIOR | REY_TERM_TERMINATOR };
    rey_context *ctx;
    rey_scene *scene;
    assert_int_equal(rey_context_create(NULL, &ctx), REY_OK);
    assert_int_equal(load(ctx,
                          "<texture type='checkerboard' id='shared'/><texture type='checkerboard' id='alone'/>"
                          "<bsdf type='diffuse' id='paint'><ref name='reflectance' id='shared'/></bsdf>"
                          "<bsdf type='diffuse' id='wash'><ref name='reflectance' id='alone'/></bsdf>"
                          "<bsdf type='bumpmap' id='bumpy'><ref id='shared'/><bsdf type='diffuse' id='inner'/></bsdf>"
                          "<bsdf type='normalmap' id='turned'><rgb name='normalmap' value='0.5,0.5,1'/>"
                          "<bsdf type='thindielectric' id='glass'/></bsdf>",
                          &scene),
                     REY_OK);
    assert_int_equal(terms_of(scene, "shared.color0.value"), TURNS);
    assert_int_equal(terms_of(scene, "alone.color0.value"), REY_TERM_INTERIOR);
    assert_int_equal(terms_of(scene, "bumpy.scale.value"), TURNS);
    assert_int_equal(terms_of(scene, "turned.normalmap.value"), TURNS | REY_TERM_INDIRECT | REY_TERM_SPECULAR); // over glass
    assert_int_equal(terms_of(scene, "inner.reflectance.value"), REY_TERM_INTERIOR);
    assert_int_equal(terms_of(scene, "glass.eta.value"), REY_TERM_INTERIOR);
    rey_scene_destroy(scene);
    rey_context_destroy(ctx);
}

// Where a texture has no transform of its coordinates, the way to make one a parameter is named; it changes nothing.
static void test_to_uv(void **state) {
    (void)state;
    rey_context *ctx = NULL;
    rey_scene *scene = NULL;
    char text[ABSENT_BYTES];
    static const char *const textures[] = {"<texture type='checkerboard' id='tiles'/>",
                                           "<texture type='checkerboard' id='tiles'><transform name='to_uv'/></texture>"};
    assert_int_equal(rey_context_create(NULL, &ctx), REY_OK);
    for (int i = 0; i < 2; i++) {
        char scene_text[512];
        snprintf(scene_text, sizeof scene_text, "%s<bsdf type='diffuse' id='paint'><ref name='reflectance' id='tiles'/></bsdf>"
                 "<bsdf type='diffuse' id='plain'/>", textures[i]);
        assert_int_equal(load(ctx, scene_text, &scene), REY_OK);
        assert_int_equal(rey_param_find(scene, "tiles.to_uv") >= 0, i);
        if (i == 0) {
            rey_param_absent(scene, "tiles.to_uv", text);
            assert_non_null(strstr(text, "<transform name=\"to_uv\"/>"));
            rey_param_absent(scene, "plain.to_uv", text); // a function has none
            assert_null(strstr(text, "<transform"));
        }
        rey_scene_destroy(scene);
    }
    rey_context_destroy(ctx);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_refusals), cmocka_unit_test(test_ranges),
                                       cmocka_unit_test(test_terms), cmocka_unit_test(test_to_uv)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
