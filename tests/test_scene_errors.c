// test_scene_errors.c: scenes that are wrong, and where and in which words they are refused.
#include "folder.h"
#include "reynolds/reynolds.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

typedef struct Case {
    const char *text; // what stands in the scene, from its second line on
    const char *words;
} Case;

#define INTEGRATOR "<integrator type=\"path\"/>"
#define SENSOR                                                                                                         \
    "<sensor type=\"perspective\"><film type=\"hdrfilm\"><integer name=\"width\" value=\"4\"/>"                         \
    "<integer name=\"height\" value=\"4\"/></film></sensor>"

static char folder[64], path[96];

static int make_folder(void **state) {
    (void)state;
    snprintf(folder, sizeof folder, "/tmp/reynolds_scene_errors_XXXXXX");
    if (!folder_make(folder)) {
        return 1;
    }
    snprintf(path, sizeof path, "%s/scene.xml", folder);
    return 0;
}

static int remove_folder(void **state) {
    (void)state;
    return unlink(path) || rmdir(folder);
}

static rey_result load(rey_context *ctx, const char *text, rey_scene **scene) {
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    fprintf(file, "<scene version=\"3.0.0\">\n%s</scene>\n", text);
    assert_int_equal(fclose(file), 0);
    return rey_scene_load(ctx, path, NULL, 0, scene);
}

static void check_cases(const Case *cases, size_t count) {
    rey_context *ctx = NULL;
    assert_int_equal(rey_context_create(NULL, &ctx), REY_OK);
    int wrong = 0;
    for (size_t i = 0; i < count; i++) {
        rey_scene *scene = NULL;
        rey_result result = load(ctx, cases[i].text, &scene);
        if (result == REY_OK || !strstr(rey_error(ctx), cases[i].words)) {
            print_error("%s\nresult %d: '%s'\nexpected '%s'\n\n", cases[i].text, result, rey_error(ctx),
                        cases[i].words);
            wrong++;
        }
        rey_scene_destroy(scene);
    }
    rey_context_destroy(ctx);
    assert_int_equal(wrong, 0);
}

#define RADIUS(value) "<shape type='sphere'><float name='radius' value='" value "'/></shape>"

static void numbers_are_finite(void **state) {
    (void)state;
    static const Case cases[] = {
        {RADIUS("1e39"), "scene.xml:2:43: bad value '1e39', expected a number up to 3.4e38"},
        {RADIUS("nan"), "scene.xml:2:43: bad value 'nan'"},
        {RADIUS("inf"), "scene.xml:2:43: bad value 'inf'"},
        {RADIUS("-1e400"), "scene.xml:2:43: bad value '-1e400'"},
        {RADIUS(""), "scene.xml:2:43: bad value ''"},
        {"<emitter type='point'><point name='position' x='1' y='1e39' z='0'/></emitter>", "scene.xml:2:52: bad y '1e39'"},
        {"<emitter type='constant'><rgb name='radiance' value='1 nan 1'/></emitter>", "scene.xml:2:47: bad value"},
        {"<emitter type='constant'><spectrum name='radiance' value='400:1 500:1e39'/></emitter>", "bad value '400:1 500"},
        {"<emitter type='constant'><spectrum name='radiance' value='400:3e38 700:3e38'/></emitter>", "is too large"},
        {"<shape type='sphere'><transform name='to_world'><matrix value='1 0 0 0 0 1 0 0 0 0 1 1e39 0 0 0 1'/>"
         "</transform></shape>", "scene.xml:2:57: bad value"},
        {"<shape type='sphere'><transform name='to_world'><scale value='1e30'/><scale value='1e30'/></transform>"
         "</shape>", "the transform overflows"},
    };
    check_cases(cases, sizeof cases / sizeof cases[0]);
}

static void neighbours_are_named(void **state) {
    (void)state;
    static const Case cases[] = {
        {"<shape type='sphere'><float name='radus' value='1'/></shape>",
         "unknown property 'radus' of shape 'sphere', did you mean 'radius'?"},
        {"<shape type='sphere'><point name='centre' value='1'/></shape>", "did you mean 'center'?"},
        {"<shape type='rectangle'><boolean name='flip_normal' value='true'/></shape>", "did you mean 'flip_normals'?"},
        {"<bsdf type='roughconductor'><float name='alpa' value='1'/></bsdf>", "did you mean 'alpha'?"},
        {"<bsdf type='conductor'><string name='material' value='Agg'/></bsdf>", "did you mean 'Ag'?"},
        {"<bsdf type='dielectric'><string name='int_ior' value='bk8'/></bsdf>", "did you mean 'bk7'?"},
        {"<bsdf type='dielectric'><string name='int_ior' value='glas'/></bsdf>", "did you mean 'acrylic glass'?"},
        {"<bsdf type='dielectric'><string name='ext_ior' value='carbn dioxide'/></bsdf>", "did you mean 'carbon dioxide'?"},
        {"<bsdf type='diffuse'><rgb name='reflectanse' value='0.5'/></bsdf>", "did you mean 'reflectance'?"},
        {"<bsdf type='diffuse'><texture type='checkerboard' name='reflectanse'/></bsdf>", "did you mean 'reflectance'?"},
        {"<sensor type='perspective'><float name='fow' value='1'/></sensor>", "did you mean 'fov'?"},
        {"<sensor type='perspective'><film type='hdrfilm'><integer name='with' value='1'/></film></sensor>",
         "did you mean 'width'?"},
        {"<integrator type='path'><integer name='maxdepth' value='1'/></integrator>", "did you mean 'max_depth'?"},
        {"<emitter type='point'><rgb name='intensty' value='1'/></emitter>", "did you mean 'intensity'?"},
        {"<emitter type='constant'><rgb name='radiace' value='1'/></emitter>", "did you mean 'radiance'?"},
        {"<shape type='sphere'><float nane='radius' value='1'/></shape>",
         "scene.xml:2:29: unknown attribute 'nane' of <float>, did you mean 'name'?"},
        {"<shape typ='sphere'/>", "unknown attribute 'typ' of <shape>, did you mean 'type'?"},
        {"<shape type='spere'/>", "did you mean 'sphere'?"},
        {"<shap type='sphere'/>", "did you mean 'shape'?"},
        {"<bsdf type='roughconductor'><string name='distribution' value='gggx'/></bsdf>",
         "expected one of 'beckmann', 'ggx', did you mean 'ggx'?"},
        {"<sensor type='perspective'><string name='fov_axis' value='smaler'/></sensor>", "did you mean 'smaller'?"},
        {"<sensor type='perspective'><film type='hdrfim'/></sensor>", "there is no film 'hdrfim', did you mean 'hdrfilm'?"},
    };
    check_cases(cases, sizeof cases / sizeof cases[0]);
}

// Where nothing is near, what there is is listed; a texture without a name may have been meant for any property.
static void others_are_listed(void **state) {
    (void)state;
    static const Case cases[] = {
        {"<shape type='sphere'><string name='filename' value='a'/></shape>",
         "scene.xml:2:22: unknown property 'filename' of shape 'sphere', expected "},
        {"<bsdf type='diffuse'><float name='xyz' value='1'/></bsdf>", "unknown property 'xyz' of bsdf 'diffuse', expected refl"},
        {"<bsdf type='diffuse'><texture type='checkerboard'/></bsdf>",
         "has no use for the texture 'checkerboard', whose 'name' would say which property it is"},
    };
    check_cases(cases, sizeof cases / sizeof cases[0]);
}

// A wrong value is found where it stands, not where its object begins.
static void values_have_places(void **state) {
    (void)state;
    static const Case cases[] = {
        {"<shape type='sphere'>\n<float name='radius' value='0'/></shape>", "scene.xml:3:1: the radius is 0, expected a"},
        {"<shape type='cube'>\n<transform name='to_world'><scale value='0'/></transform></shape>", "scene.xml:3:1: the shape's"},
        {"<bsdf type='roughconductor'>\n<float name='alpha' value='-1'/></bsdf>", "scene.xml:3:1: alpha is -1, expected a number"},
        {"<sensor type='perspective'>\n<float name='fov' value='200'/></sensor>", "scene.xml:3:1: fov is 200"},
        {"<sensor type='perspective'>\n<float name='near_clip' value='1'/>\n<float name='far_clip' value='1'/></sensor>",
         "scene.xml:4:1: near_clip 1 and far_clip 1"},
        {"<sensor type='perspective'>\n<float name='near_clip' value='1e9'/></sensor>", "scene.xml:2:1: near_clip 1e+09"},
        {"<emitter type='spot'>\n<float name='cutoff_angle' value='200'/></emitter>", "scene.xml:3:1: cutoff_angle is 200"},
        {"<emitter type='constant'>\n<float name='sampling_weight' value='-1'/></emitter>", "scene.xml:3:1: sampling_weight is -1"},
        {"<medium type='homogeneous' id='m'>\n<float name='albedo' value='2'/></medium><shape type='cube'><ref name='interior' "
         "id='m'/></shape>", "scene.xml:3:1: albedo is 2"},
        {"<integrator type='aov'>\n<string name='aovs' value='a:dept'/></integrator>", "scene.xml:3:1: there is no quantity"},
    };
    check_cases(cases, sizeof cases / sizeof cases[0]);
}

// Embree ends the process where rays begin too far away; what is beyond is refused, also where a parameter moves there.
static void far_places_are_refused(void **state) {
    (void)state;
    static const Case cases[] = {
        {"<sensor type='perspective'><transform name='to_world'><translate x='1e19'/></transform></sensor>",
         "scene.xml: sensor_0.to_world has a number beyond 1e+17: that is too far away for rays"},
        {"<emitter type='point'><point name='position' x='-1e38'/></emitter>", "emitter_0.position has a number beyond 1e+17"},
        {"<shape type='sphere'><point name='center' z='1e20'/></shape>", "shape_0.to_world has a number beyond 1e+17"},
        {"<shape type='shapegroup' id='g'><shape type='cube'><transform name='to_world'><scale value='1e12'/></transform></shape>"
         "</shape><shape type='instance'><ref id='g'/><transform name='to_world'><scale value='1.5e6'/></transform></shape>",
         "the scene reaches farther than 1e+18"},
    };
    check_cases(cases, sizeof cases / sizeof cases[0]);
    rey_context *ctx = NULL;
    rey_scene *scene = NULL;
    rey_render_def def = rey_default_render_def();
    float image[4 * 4 * 3], position[3] = {0, 0, 5}, far[3] = {0, 0, 3e18f};
    def.spp = 1;
    assert_int_equal(rey_context_create(NULL, &ctx), REY_OK);
    static const char text[] = "<integrator type='ptracer'/>" SENSOR "<emitter type='point'/><shape type='cube'/>";
    assert_int_equal(load(ctx, text, &scene), REY_OK);
    int param = rey_param_find(scene, "emitter_0.position");
    assert_int_equal(rey_param_set(scene, param, far, 3), REY_OK);
    assert_int_equal(rey_render(scene, &def, image, NULL), REY_ERROR_PARAM);
    assert_int_equal(rey_render(scene, &def, image, NULL), REY_ERROR_PARAM); // nothing was taken as done
    assert_int_equal(rey_param_set(scene, param, position, 3), REY_OK);
    assert_int_equal(rey_render(scene, &def, image, NULL), REY_OK);
    rey_scene_destroy(scene);
    rey_context_destroy(ctx);
}

// Lines of textures are counted one by one, which at 1e30 would have no end.
static void far_textures_are_refused(void **state) {
    (void)state;
    static const char *const shapes[] = {"rectangle", "sphere"};
    rey_context *ctx = NULL;
    assert_int_equal(rey_context_create(NULL, &ctx), REY_OK);
    for (size_t i = 0; i < sizeof shapes / sizeof shapes[0]; i++) {
        rey_scene *scene = NULL;
        rey_render_def def = rey_default_render_def();
        char text[1024];
        float image[4 * 4 * 3], tangent[16] = {[3] = 1};
        def.spp = 1;
        snprintf(text, sizeof text, INTEGRATOR SENSOR "<emitter type='constant'/><shape type='%s' id='wall'><bsdf type='diffuse'>"
                 "<texture type='checkerboard' name='reflectance'><transform name='to_uv'><translate y='1e30'/></transform>"
                 "</texture></bsdf></shape>", shapes[i]);
        assert_int_equal(load(ctx, text, &scene), REY_OK);
        int param = rey_param_find(scene, "wall.to_world");
        assert_int_equal(rey_jvp(scene, &def, (rey_selection){&param, 1}, tangent, image, NULL, NULL), REY_ERROR_UNSUPPORTED);
        if (!strstr(rey_error(ctx), "too far away to be found: wall.bsdf.reflectance.to_uv has numbers beyond 1e+12")) {
            fail_msg("%s", rey_error(ctx));
        }
        rey_scene_destroy(scene);
    }
    rey_context_destroy(ctx);
}

static void what_is_missing_is_named(void **state) {
    (void)state;
    static const Case cases[] = {
        {"<bsdf type='phong'/>", "bsdf 'phong' is not supported: 'roughplastic' and 'principled' are its nearest kinds"},
        {"<bsdf type='ward'/>", "'ward' is not supported"},
        {"<bsdf type='roughdiffuse'/>", "'roughdiffuse' is not supported: 'diffuse' is its limit of no roughness"},
        {"<integrator type='bdpt'/>", "'bdpt' is not supported: 'path' renders the same light"},
        {"<emitter type='sunsky'/>", "'sunsky' is not supported"},
        {"<sensor type='spherical'/>", "'spherical' is not supported"},
        {"<film type='specfilm'/>", "a film cannot stand at the top level"},
        {"<sensor type='perspective'><film type='specfilm'/></sensor>", "'specfilm' is not supported"},
    };
    check_cases(cases, sizeof cases / sizeof cases[0]);
}

static void root_is_a_scene(void **state) {
    (void)state;
    static const Case cases[] = {
        {"<html><body/></html>", "scene.xml:1:1: the root element is <html>, expected <scene version="},
        {"<bsdf version='3.0.0' type='diffuse'/>", "scene.xml:1:1: the root element is <bsdf>, expected <scene>"},
    };
    rey_context *ctx = NULL;
    assert_int_equal(rey_context_create(NULL, &ctx), REY_OK);
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        rey_scene *scene = NULL;
        FILE *file = fopen(path, "w");
        assert_non_null(file);
        fputs(cases[i].text, file);
        assert_int_equal(fclose(file), 0);
        assert_int_equal(rey_scene_load(ctx, path, NULL, 0, &scene), REY_ERROR_SCENE);
        if (!strstr(rey_error(ctx), cases[i].words)) {
            fail_msg("'%s', expected '%s'", rey_error(ctx), cases[i].words);
        }
    }
    rey_context_destroy(ctx);
}

#define TWOSIDED(nested) "<bsdf type='twosided'>" nested "</bsdf>"

static void twosided_is_opaque(void **state) {
    (void)state;
    static const Case cases[] = {
        {TWOSIDED("<bsdf type='dielectric'/>"), "lets light through"},
        {TWOSIDED("<bsdf type='thindielectric'/>"), "lets light through"},
        {TWOSIDED("<bsdf type='roughdielectric'/>"), "lets light through"},
        {TWOSIDED("<bsdf type='null'/>"), "lets light through"},
        {TWOSIDED("<bsdf type='diffuse'/><bsdf type='dielectric'/>"), "lets light through"},
        {TWOSIDED("<bsdf type='mask'><bsdf type='diffuse'/></bsdf>"), "lets light through"},
        {TWOSIDED("<bsdf type='blendbsdf'><float name='weight' value='0.5'/><bsdf type='diffuse'/><bsdf "
                  "type='dielectric'/></bsdf>"), "lets light through"},
        {TWOSIDED("<bsdf type='bumpmap'><texture type='checkerboard'/><bsdf type='dielectric'/></bsdf>"),
         "lets light through"},
        {"<bsdf type='dielectric' id='glass'/>" TWOSIDED("<ref id='glass'/>"), "lets light through"},
        {"<bsdf type='mask' id='net'><bsdf type='diffuse'/></bsdf>" TWOSIDED("<ref id='net'/>"), "lets light through"},
        {TWOSIDED("<bsdf type='principled'><float name='spec_trans' value='0.5'/></bsdf>"), "lets light through"},
        {TWOSIDED("<bsdf type='principledthin'/>"), "lets light through"},
    };
    check_cases(cases, sizeof cases / sizeof cases[0]);
}

// A scene without a camera or an integrator may be looked at, but not rendered.
static void incomplete_scenes_do_not_render(void **state) {
    (void)state;
    static const Case cases[] = {{SENSOR, "no integrator"}, {INTEGRATOR, "no sensor"}};
    rey_context *ctx = NULL;
    assert_int_equal(rey_context_create(NULL, &ctx), REY_OK);
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        rey_scene *scene = NULL;
        float image[4 * 4 * 3];
        rey_render_def def = rey_default_render_def();
        assert_int_equal(load(ctx, cases[i].text, &scene), REY_OK);
        assert_int_equal(rey_render(scene, &def, image, NULL), REY_ERROR_SCENE);
        if (!strstr(rey_error(ctx), cases[i].words)) {
            fail_msg("'%s', expected '%s'", rey_error(ctx), cases[i].words);
        }
        rey_scene_destroy(scene);
    }
    rey_context_destroy(ctx);
}

static void folders_are_listed_once(void **state) {
    (void)state;
    rey_context *ctx = NULL;
    rey_scene *scene = NULL;
    assert_int_equal(rey_context_create(NULL, &ctx), REY_OK);
    assert_int_not_equal(load(ctx, "<path value='.'/><path value='.'/><shape type='obj'><string name='filename' "
                                   "value='nowhere.obj'/></shape>", &scene), REY_OK);
    const char *first = strstr(rey_error(ctx), folder), *listed = strstr(rey_error(ctx), "looked in");
    assert_non_null(first);
    assert_non_null(listed);
    first = strstr(listed, folder);
    assert_non_null(first);
    assert_null(strstr(first + 1, folder));
    rey_context_destroy(ctx);
}

// A define may be empty: where a text is wanted it is one, where a number is wanted that is what is missing.
static void defines_may_be_empty(void **state) {
    (void)state;
    rey_context *ctx = NULL;
    rey_scene *scene = NULL;
    const rey_define define = {"x", ""};
    assert_int_equal(rey_context_create(NULL, &ctx), REY_OK);
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    fprintf(file, "<scene version='3.0.0'>\n<shape type='sphere'><float name='radius' value='$x'/></shape></scene>");
    assert_int_equal(fclose(file), 0);
    assert_int_equal(rey_scene_load(ctx, path, &define, 1, &scene), REY_ERROR_SCENE);
    if (!strstr(rey_error(ctx), "scene.xml:2:43: bad value '', expected a number")) {
        fail_msg("%s", rey_error(ctx));
    }
    rey_context_destroy(ctx);
}

// What is wrong with a file that a scene names is told with the place that names it.
static void files_are_told_by_their_place(void **state) {
    (void)state;
    char empty[96], words[3][256], texts[3][512];
    snprintf(empty, sizeof empty, "%s/empty", folder);
    FILE *file = fopen(empty, "w");
    assert_non_null(file);
    fclose(file);
    snprintf(texts[0], sizeof texts[0], "<bsdf type='diffuse'>\n<texture type='bitmap' name='reflectance'>\n<string "
                                        "name='filename' value='empty'/></texture></bsdf>");
    snprintf(words[0], sizeof words[0], "scene.xml:4:1: %s: not a picture that can be read", empty);
    snprintf(texts[1], sizeof texts[1], "<shape type='ply'><string name='filename' value='empty'/></shape>");
    snprintf(words[1], sizeof words[1], "scene.xml:2:19: %s:", empty);
    snprintf(texts[2], sizeof texts[2], "<emitter type='constant'>\n<spectrum name='radiance' filename='empty'/></emitter>");
    snprintf(words[2], sizeof words[2], "scene.xml:3:1: %s:", empty);
    const Case cases[] = {{texts[0], words[0]}, {texts[1], words[1]}, {texts[2], words[2]}};
    check_cases(cases, 3);
    unlink(empty);
    rey_context *ctx;
    rey_scene *scene;
    assert_int_equal(rey_context_create(NULL, &ctx), REY_OK);
    assert_int_equal(rey_scene_load(ctx, "/none/such.xml", NULL, 0, &scene), REY_ERROR_IO);
    assert_string_equal(rey_error(ctx), "/none/such.xml: cannot open the scene: No such file or directory");
    assert_int_equal(rey_scene_load(ctx, folder, NULL, 0, &scene), REY_ERROR_IO);
    assert_non_null(strstr(rey_error(ctx), ": cannot open the scene: not a file"));
    rey_context_destroy(ctx);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(numbers_are_finite),
        cmocka_unit_test(neighbours_are_named),
        cmocka_unit_test(others_are_listed),
        cmocka_unit_test(values_have_places),
        cmocka_unit_test(far_places_are_refused),
        cmocka_unit_test(far_textures_are_refused),
        cmocka_unit_test(what_is_missing_is_named),
        cmocka_unit_test(root_is_a_scene),
        cmocka_unit_test(twosided_is_opaque),
        cmocka_unit_test(incomplete_scenes_do_not_render),
        cmocka_unit_test(folders_are_listed_once),
        cmocka_unit_test(defines_may_be_empty),
        cmocka_unit_test(files_are_told_by_their_place),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
