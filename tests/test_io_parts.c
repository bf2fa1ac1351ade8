// test_io_parts.c: an OBJ whose materials have scattering functions of their own.
#include "folder.h"
#include "scene/scene.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

// Before the first usemtl: one triangle; 'oak wood': a quad, with a line that goes on; 'glass': a pentagon and, later,
// a triangle.
static const char object[] = "mtllib nowhere.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv -1 0 0\n# usemtl none\n"
                             "f 1 2 3\nusemtl  oak wood \r\nf 1 2 \\\n3 4\nusemtl glass\nf 1 2 3 4 5 # f 1 2 3\n"
                             "usemtl oak wood\nusemtl glass\nf -1 -2 -3\n";

static char folder[64], scene_path[96], object_path[96];

static int make_files(void **state) {
    (void)state;
    snprintf(folder, sizeof folder, "/tmp/reynolds_parts_XXXXXX");
    if (!folder_make(folder)) {
        return 1;
    }
    snprintf(scene_path, sizeof scene_path, "%s/scene.xml", folder);
    snprintf(object_path, sizeof object_path, "%s/object.obj", folder);
    FILE *file = fopen(object_path, "w");
    return !file || fputs(object, file) < 0 || fclose(file);
}

static int remove_files(void **state) {
    (void)state;
    return unlink(scene_path) || unlink(object_path) || rmdir(folder);
}

static rey_result load(rey_context *ctx, const char *bsdfs, rey_scene **scene) {
    FILE *file = fopen(scene_path, "w");
    assert_non_null(file);
    fprintf(file, "<scene version='3.0.0'>\n<shape type='obj' id='m'><string name='filename' value='object.obj'/>\n%s"
                  "</shape></scene>\n", bsdfs);
    assert_int_equal(fclose(file), 0);
    return rey_scene_load(ctx, scene_path, NULL, 0, scene);
}

#define BSDF(attributes, grey) "<bsdf type='diffuse' " attributes "><rgb name='reflectance' value='" grey "'/></bsdf>"

static float grey_of(const rey_scene *scene, const char *name) {
    int param = rey_param_find(scene, name);
    assert_true(param >= 0);
    return rey_param_values(scene, param)[0];
}

static int64_t count_of(const rey_scene *scene, const char *name) {
    rey_param_info info;
    int param = rey_param_find(scene, name);
    assert_true(param >= 0);
    assert_int_equal(rey_param_get_info(scene, param, &info), REY_OK);
    return info.shape[0];
}

static void parts_by_material(void **state) {
    rey_context *ctx = *state;
    rey_scene *scene = NULL;
    assert_int_equal(load(ctx, BSDF("name='glass'", "0.25") BSDF("", "0.5") BSDF("name='oak wood'", "0.75"), &scene), REY_OK);
    assert_int_equal(scene->view.shapes_count, 3);
    const int64_t triangles[] = {4, 1, 2};
    for (int i = 0; i < 3; i++) {
        assert_int_equal(scene->view.shapes[i].triangle_count, triangles[i]);
        assert_int_equal(scene->view.shapes[i].bsdf, i);
        assert_int_equal(scene->view.shapes[i].group, i);
    }
    assert_true(grey_of(scene, "m.glass.bsdf.reflectance.value") == 0.25f);
    assert_true(grey_of(scene, "m.others.bsdf.reflectance.value") == 0.5f);
    assert_true(grey_of(scene, "m.oak wood.bsdf.reflectance.value") == 0.75f);
    assert_int_equal(count_of(scene, "m.glass.positions"), 5);
    assert_int_equal(count_of(scene, "m.others.positions"), 3);
    assert_int_equal(count_of(scene, "m.oak wood.positions"), 4);
    rey_scene_destroy(scene);
}

// As in version 3 of the format: with one function, or none, materials of the file mean nothing.
static void one_function_is_everywhere(void **state) {
    rey_context *ctx = *state;
    const char *const bsdfs[] = {"", BSDF("", "0.5"), BSDF("name='glass'", "0.5")};
    for (int i = 0; i < 3; i++) {
        rey_scene *scene = NULL;
        assert_int_equal(load(ctx, bsdfs[i], &scene), REY_OK);
        assert_int_equal(scene->view.shapes_count, 1);
        assert_int_equal(scene->view.shapes[0].triangle_count, 7);
        rey_scene_destroy(scene);
    }
}

static void wrong_materials_are_named(void **state) {
    rey_context *ctx = *state;
    const char *const cases[][2] = {
        {BSDF("name='glass'", "0.5") BSDF("name='oak wood'", "0.5"), "no bsdf is named after the material ''"},
        {BSDF("name='glas'", "0.5") BSDF("", "0.5"), "no face of the file has the material 'glas', did you mean 'glass'?"},
    };
    for (int i = 0; i < 2; i++) {
        rey_scene *scene = NULL;
        assert_int_equal(load(ctx, cases[i][0], &scene), REY_ERROR_SCENE);
        if (!strstr(rey_error(ctx), cases[i][1])) {
            fail_msg("'%s', expected '%s'", rey_error(ctx), cases[i][1]);
        }
    }
}

static int new_context(void **state) { return rey_context_create(NULL, (rey_context **)state); }

static int free_context(void **state) {
    rey_context_destroy(*state);
    return 0;
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(parts_by_material, new_context, free_context),
        cmocka_unit_test_setup_teardown(one_function_is_everywhere, new_context, free_context),
        cmocka_unit_test_setup_teardown(wrong_materials_are_named, new_context, free_context),
    };
    return cmocka_run_group_tests(tests, make_files, remove_files);
}
