// A parameter's version decides what derived data is rebuilt: exactly what depends on it.
#include "base/context.h"
#include "render/update.h"
#include "scene/scene.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

typedef struct Marks {
    int shapes, instances, bsdfs, emitters;
} Marks;

static int count(const uint8_t *flags, int64_t n) {
    int marked = 0;
    for (int64_t i = 0; i < n; i++) {
        marked += flags[i] != 0;
    }
    return marked;
}

// Sets the parameter to its own values, or does not; returns what is marked, and brings the scene up to date.
static Marks marks_after(rey_scene *scene, const char *name) {
    int param = name ? rey_param_find(scene, name) : -1;
    if (name) {
        assert_true(param >= 0);
        const Param *p = &ARRAY_AT(scene->params, Param, param);
        assert_int_equal(rey_param_set(scene, param, scene->view.theta + p->theta, p->count), REY_OK);
    }
    rey_scene_mark_changes(scene);
    const SceneView *view = &scene->view;
    Marks marks = {count(scene->dirty_shapes, view->shapes_count), count(scene->dirty_instances, view->instances_count),
                   count(scene->dirty_bsdfs, view->bsdfs_count), count(scene->dirty_emitters, view->emitters_count)};
    assert_int_equal(rey_scene_update(scene), REY_OK);
    assert_false(scene->dirty);
    return marks;
}

typedef struct Case {
    const char *name;
    Marks expected;
} Case;

static void check_changes(const char *path, const rey_define *defines, int defines_count, const Case *cases, int n) {
    rey_context *ctx;
    rey_scene *scene;
    assert_int_equal(rey_context_create(NULL, &ctx), REY_OK);
    if (rey_scene_load(ctx, path, defines, defines_count, &scene)) {
        fail_msg("%s", rey_error(ctx));
    }
    assert_int_equal(rey_scene_update(scene), REY_OK);
    for (int i = 0; i < n; i++) {
        Marks marks = marks_after(scene, cases[i].name);
        print_message("%s: %d shapes, %d instances, %d scattering functions, %d emitters\n",
                      cases[i].name ? cases[i].name : "nothing", marks.shapes, marks.instances, marks.bsdfs, marks.emitters);
        assert_memory_equal(&marks, &cases[i].expected, sizeof marks);
    }
    rey_scene_destroy(scene);
    rey_context_destroy(ctx);
}

static void test_changes(void **state) {
    static const Case shapes[] = {{NULL, {0, 0, 0, 0}},
                                  {"quilt.positions", {1, 0, 0, 0}},
                                  {"pipe.to_world", {1, 0, 0, 0}},
                                  {"left.to_world", {0, 1, 0, 0}},
                                  {"wall.bsdf.reflectance.value", {0, 0, 0, 0}},
                                  {NULL, {0, 0, 0, 0}}};
    static const Case materials[] = {{"shape_5.bsdf.alpha.value", {0, 0, 1, 0}}, {"sky.data", {0, 0, 0, 1}}};
    static const rey_define images[] = {{"texels", RENDER_DIR "/../data/image/zip.exr"},
                                        {"sky", RENDER_DIR "/../data/image/zip.exr"}};
    UNUSED(state);
    check_changes(RENDER_DIR "/shapes.xml", NULL, 0, shapes, COUNT_OF(shapes));
    check_changes(RENDER_DIR "/materials.xml", images, COUNT_OF(images), materials, COUNT_OF(materials));
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_changes)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
