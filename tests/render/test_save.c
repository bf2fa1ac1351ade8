// test_save.c: a scene that is saved and loaded again renders the same picture, bit for bit.
#include "io/image.h"
#include "../folder.h"

#include <dirent.h>
#include <setjmp.h>
#include <stdbool.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

enum { NUMBERS = 24 * 24 * 3 };

typedef struct Fixture {
    rey_context *ctx;
    char folder[64], texels[128], sky[128];
} Fixture;

static int set_up(void **state) {
    Fixture *f = calloc(1, sizeof *f);
    float texels[4 * 3 * 3], sky[8 * 5 * 3];
    for (int i = 0; i < 4 * 3 * 3; i++) {
        texels[i] = 0.2f + (float)(i * 7 % 36) / 60;
    }
    for (int i = 0; i < 8 * 5 * 3; i++) {
        sky[i] = 0.1f + (float)(i * 11 % 120) / 200;
    }
    if (!f || rey_context_create(NULL, &f->ctx)) {
        return 1;
    }
    snprintf(f->folder, sizeof f->folder, "/tmp/reynolds_test_save_XXXXXX");
    if (!folder_make(f->folder)) {
        return 1;
    }
    snprintf(f->texels, sizeof f->texels, "%s/texels.exr", f->folder);
    snprintf(f->sky, sizeof f->sky, "%s/sky.exr", f->folder);
    *state = f;
    return rey_exr_write(f->ctx, f->texels, texels, 4, 3, 3, NULL) || rey_exr_write(f->ctx, f->sky, sky, 8, 5, 3, NULL);
}

static int tear_down(void **state) {
    Fixture *f = *state;
    int status = folder_remove(f->folder);
    rey_context_destroy(f->ctx);
    free(f);
    return status;
}

static rey_scene *load(Fixture *f, const char *path, int define_count) {
    rey_define defines[] = {{"texels", f->texels}, {"sky", f->sky}};
    rey_scene *scene = NULL;
    if (rey_scene_load(f->ctx, path, defines, define_count, &scene)) {
        fail_msg("%s", rey_error(f->ctx));
    }
    return scene;
}

static void render(Fixture *f, rey_scene *scene, float picture[NUMBERS]) {
    rey_render_def def = rey_default_render_def();
    int width, height;
    def.spp = 4;
    assert_int_equal(rey_scene_film_size(scene, 0, &width, &height), REY_OK);
    assert_int_equal(width * height * 3, NUMBERS);
    if (rey_render(scene, &def, picture, NULL)) {
        fail_msg("%s", rey_error(f->ctx));
    }
}

// Gives every parameter the values that it has: what is saved then comes from them, and not from the document.
static void touch_all(Fixture *f, rey_scene *scene) {
    for (int i = 0; i < rey_param_count(scene); i++) {
        rey_param_info info;
        assert_int_equal(rey_param_get_info(scene, i, &info), REY_OK);
        char pose[256];
        const char *dot = strrchr(info.name, '.');
        snprintf(pose, sizeof pose, "%.*s.to_world", (int)(dot - info.name), info.name);
        if (strcmp(dot, ".positions") == 0 && rey_param_find(scene, pose) >= 0) {
            continue; // a rectangle's vertices follow its pose
        }
        if (rey_param_set(scene, i, rey_param_values(scene, i), info.count)) {
            fail_msg("%s", rey_error(f->ctx));
        }
    }
}

static void expect_same_parameters(rey_scene *a, rey_scene *b) {
    assert_int_equal(rey_param_count(a), rey_param_count(b));
    for (int i = 0; i < rey_param_count(a); i++) {
        rey_param_info x, y;
        assert_int_equal(rey_param_get_info(a, i, &x) | rey_param_get_info(b, i, &y), REY_OK);
        assert_string_equal(x.name, y.name);
        assert_int_equal(x.count, y.count);
        assert_memory_equal(rey_param_values(a, i), rey_param_values(b, i), (size_t)x.count * sizeof(float));
    }
}

static void expect_same_way(Fixture *f, const char *path, int define_count, bool touched) {
    static float before[NUMBERS], after[NUMBERS];
    char copy[128];
    snprintf(copy, sizeof copy, "%s/copy.xml", f->folder);
    rey_scene *scene = load(f, path, define_count), *again;
    render(f, scene, before);
    if (touched) {
        touch_all(f, scene);
    }
    if (rey_scene_save(scene, copy)) {
        fail_msg("%s", rey_error(f->ctx));
    }
    again = load(f, copy, 0);
    render(f, again, after);
    if (!touched) { // a constant's parameter may be named otherwise when an object has become a value
        expect_same_parameters(scene, again);
    }
    rey_scene_destroy(scene);
    rey_scene_destroy(again);
    assert_memory_equal(before, after, sizeof before);
}

static void expect_same(Fixture *f, const char *path, int define_count) {
    expect_same_way(f, path, define_count, false);
    expect_same_way(f, path, define_count, true);
}

static void rooms_come_back(void **state) {
    Fixture *f = *state;
    expect_same(f, RENDER_DIR "/materials.xml", 2);
    expect_same(f, RENDER_DIR "/shapes.xml", 0);
    expect_same(f, RENDER_DIR "/principled.xml", 2);
    expect_same(f, RENDER_DIR "/layers.xml", 2);
}

// A frontal wall and a mesh; what stands in %s differs from case to case.
static void expect_wall_same(Fixture *f, const char *texture, const char *mesh) {
    char path[128];
    snprintf(path, sizeof path, "%s/wall.xml", f->folder);
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    fprintf(file,
            "<scene version=\"3.0.0\"><integrator type=\"path\"/><sensor type=\"perspective\">"
            "<transform name=\"to_world\"><lookat origin=\"0, 0, 5\" target=\"0, 0, 0\" up=\"0, 1, 0\"/></transform>"
            "<film type=\"hdrfilm\"><integer name=\"width\" value=\"24\"/><integer name=\"height\" value=\"24\"/></film>"
            "</sensor><emitter type=\"constant\"/><shape type=\"rectangle\"><bsdf type=\"diffuse\">%s</bsdf></shape>"
            "<shape type=\"ply\"><string name=\"filename\" value=\"" RENDER_DIR "/quilt.ply\"/>%s</shape></scene>",
            texture, mesh);
    assert_int_equal(fclose(file), 0);
    expect_same(f, path, 0);
}

static void texture_poses_come_back(void **state) {
    static const char pose[] = "<transform name=\"to_uv\"><matrix value=\"3 0.5 0 0.3  -0.2 2 0 0.6  0 0 1 0  0 0 0 1\"/>"
                               "</transform></texture>";
    Fixture *f = *state;
    char text[512];
    snprintf(text, sizeof text, "<texture type=\"checkerboard\" name=\"reflectance\">%s", pose);
    expect_wall_same(f, text, "");
    snprintf(text, sizeof text, "<texture type=\"bitmap\" name=\"reflectance\"><string name=\"filename\" value=\"%s\"/>%s",
             f->texels, pose);
    expect_wall_same(f, text, "");
}

static void mesh_flags_come_back(void **state) {
    Fixture *f = *state;
    expect_wall_same(f, "", "<boolean name=\"face_normals\" value=\"true\"/>");
    expect_wall_same(f, "", "<boolean name=\"face_normals\" value=\"false\"/>");
    expect_wall_same(f, "", "<boolean name=\"flip_normals\" value=\"true\"/><bsdf type=\"diffuse\"/>");
    expect_wall_same(f, "", "<boolean name=\"flip_tex_coords\" value=\"true\"/>"
                            "<transform name=\"to_world\"><scale x=\"-1\" y=\"0.5\"/></transform>");
}

// A scene of a camera and `body`.
static rey_scene *small_scene(Fixture *f, const char *body) {
    char path[128];
    snprintf(path, sizeof path, "%s/small.xml", f->folder);
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    fprintf(file, "<scene version=\"3.0.0\"><integrator type=\"path\"/><sensor type=\"perspective\">"
                  "<transform name=\"to_world\"><lookat origin=\"0, 0, 5\" target=\"0, 0, 0\" up=\"0, 1, 0\"/></transform>"
                  "<film type=\"hdrfilm\"><integer name=\"width\" value=\"24\"/><integer name=\"height\" value=\"24\"/></film>"
                  "</sensor>%s</scene>", body);
    assert_int_equal(fclose(file), 0);
    return load(f, path, 0);
}

// Renders the same when it has been saved with a parameter's new values.
static void expect_kept(Fixture *f, const char *body, const char *name, const float *values, int count) {
    static float before[NUMBERS], after[NUMBERS];
    char copy[128];
    snprintf(copy, sizeof copy, "%s/copy.xml", f->folder);
    rey_scene *scene = small_scene(f, body);
    assert_int_equal(rey_param_set(scene, rey_param_find(scene, name), values, count), REY_OK);
    render(f, scene, before);
    assert_int_equal(rey_scene_save(scene, copy), REY_OK);
    rey_scene_destroy(scene);
    scene = load(f, copy, 0);
    render(f, scene, after);
    rey_scene_destroy(scene);
    assert_memory_equal(before, after, sizeof before);
}

static const char ball[] = "<shape type=\"sphere\" id=\"ball\"/><emitter type=\"constant\"/>";

// What a file says nothing of, and what then depends on a number that changes, keeps its value: the beam of a spot. The last row
// of a pose has no effect.
static void changes_come_back(void **state) {
    const float wider = 40, pose[16] = {0.5f, 0, 0, 1, 0, 0.5f, 0, 0, 0, 0, 0.5f, 0, 0.1f, 0, 0.2f, 1.5f};
    expect_kept(*state, "<shape type=\"rectangle\"/><emitter type=\"spot\" id=\"spot\"><float name=\"cutoff_angle\" value=\"25\"/>"
                        "<transform name=\"to_world\"><lookat origin=\"0, 0, 2\" target=\"0, 0, 0\" up=\"0, 1, 0\"/></transform>"
                        "</emitter>", "spot.cutoff_angle.value", &wider, 1);
    expect_kept(*state, ball, "ball.to_world", pose, 16);
}

// What a scene file could not say.
static void impossible_shapes_are_refused(void **state) {
    static float picture[NUMBERS], points[1024];
    const float mirrored[16] = {-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
    Fixture *f = *state;
    rey_render_def def = rey_default_render_def();
    rey_scene *scene = small_scene(f, ball);
    assert_int_equal(rey_param_set(scene, rey_param_find(scene, "ball.to_world"), mirrored, 16), REY_OK);
    assert_int_equal(rey_render(scene, &def, picture, NULL), REY_ERROR_SCENE);
    assert_non_null(strstr(rey_error(f->ctx), "mirror image"));
    rey_scene_destroy(scene);
    scene = small_scene(f, "<emitter type=\"constant\"/><shape type=\"bsplinecurve\" id=\"vine\">"
                           "<string name=\"filename\" value=\"" RENDER_DIR "/vine.txt\"/></shape>");
    int param = rey_param_find(scene, "vine.control_points");
    rey_param_info info;
    assert_int_equal(rey_param_get_info(scene, param, &info), REY_OK);
    assert_true(info.count <= 1024);
    memcpy(points, rey_param_values(scene, param), (size_t)info.count * sizeof *points);
    points[3] = -0.1f;
    assert_int_equal(rey_param_set(scene, param, points, info.count), REY_OK);
    assert_int_equal(rey_render(scene, &def, picture, NULL), REY_ERROR_SCENE);
    assert_non_null(strstr(rey_error(f->ctx), "expected one >= 0"));
    rey_scene_destroy(scene);
}

// Moves every parameter a little.
static void change_all(Fixture *f, rey_scene *scene) {
    static float values[1 << 16];
    for (int i = 0; i < rey_param_count(scene); i++) {
        rey_param_info info;
        assert_int_equal(rey_param_get_info(scene, i, &info), REY_OK);
        char pose[256];
        const char *dot = strrchr(info.name, '.');
        snprintf(pose, sizeof pose, "%.*s.to_world", (int)(dot - info.name), info.name);
        bool follows = strcmp(dot, ".positions") == 0 && rey_param_find(scene, pose) >= 0;
        if (follows || strcmp(dot, ".normals") == 0 || info.count > 1 << 16) {
            continue;
        }
        memcpy(values, rey_param_values(scene, i), (size_t)info.count * sizeof *values);
        bool posed = strcmp(dot, ".to_world") == 0 || strcmp(dot, ".to_uv") == 0;
        for (int64_t k = 0; k < info.count; k++) {
            values[k] += posed ? (k == 3 ? 0.01f : 0) : 0.97f * values[k] >= info.low ? -0.03f * values[k] : 0;
        }
        if (rey_param_set(scene, i, values, info.count)) {
            fail_msg("%s", rey_error(f->ctx));
        }
    }
}

// What was saved loads by name into the scene that it came from.
static void expect_values(Fixture *f, const char *path, int define_count) {
    static float original[NUMBERS], before[NUMBERS], after[NUMBERS];
    char copy[128];
    snprintf(copy, sizeof copy, "%s/copy.xml", f->folder);
    rey_scene *scene = load(f, path, define_count);
    render(f, scene, original);
    change_all(f, scene);
    if (rey_scene_save(scene, copy)) {
        fail_msg("%s", rey_error(f->ctx));
    }
    rey_scene *saved = load(f, copy, 0);
    render(f, saved, before);
    rey_scene *again = load(f, path, define_count);
    if (rey_scene_load_values(again, copy)) {
        fail_msg("%s", rey_error(f->ctx));
    }
    render(f, again, after);
    rey_scene_destroy(scene);
    rey_scene_destroy(saved);
    rey_scene_destroy(again);
    assert_memory_not_equal(original, before, sizeof before);
    assert_memory_equal(before, after, sizeof before);
}

// Normals that follow vertices are written as these have them, whether or not the scene was rendered since they moved.
static void moved_vertices_take_their_normals_along(void **state) {
    static float values[1 << 16], before[NUMBERS], after[NUMBERS];
    Fixture *f = *state;
    char copy[128];
    snprintf(copy, sizeof copy, "%s/copy.xml", f->folder);
    rey_scene *scene = load(f, RENDER_DIR "/moving_dome.xml", 1);
    rey_param_info info;
    int param = rey_param_find(scene, "moving_dome.positions");
    assert_int_equal(rey_param_get_info(scene, param, &info), REY_OK);
    assert_true(info.count <= COUNT_OF(values));
    for (int64_t k = 0; k < info.count; k++) {
        values[k] = rey_param_values(scene, param)[k] * (k % 3 ? 1 : 1.4f);
    }
    for (int rendered = 0; rendered < 2; rendered++) {
        assert_int_equal(rey_param_set(scene, param, values, info.count), REY_OK);
        if (rendered) {
            render(f, scene, before);
        }
        if (rey_scene_save(scene, copy)) {
            fail_msg("%s", rey_error(f->ctx));
        }
        render(f, scene, before);
        rey_scene *again = load(f, copy, 0);
        render(f, again, after);
        rey_scene_destroy(again);
        assert_memory_equal(before, after, sizeof before);
        values[0] += 0.01f;
    }
    rey_scene_destroy(scene);
}

static void values_load_by_name(void **state) {
    Fixture *f = *state;
    expect_values(f, RENDER_DIR "/materials.xml", 2);
    expect_values(f, RENDER_DIR "/shapes.xml", 0);
    expect_values(f, RENDER_DIR "/principled.xml", 2);
    expect_values(f, RENDER_DIR "/layers.xml", 2);
}

// What does not fit is refused before anything is changed.
static void wrong_values_are_refused(void **state) {
    static const char *const texts[] = {
        "<bsdf type='diffuse' id='wall'><rgb name='reflectance' value='0.3'/></bsdf><bsdf type='diffuse' id='wal'/>",
        "<bsdf type='roughconductor' id='wall'/>",
        ("<bsdf type='diffuse' id='wall'><texture type='bitmap' name='reflectance'><string name='filename' "
         "value='texels.exr'/></texture></bsdf>"),
        "<texture type='bitmap' id='wall'><string name='filename' value='texels.exr'/></texture>",
    };
    static const char *const words[] = {
        "wrong.xml: the scene has no parameter 'wal.reflectance.value', which this file has, did you mean 'wall.refl",
        "the scene has no parameter 'wall.", "the scene has no parameter 'wall.reflectance.data'",
        "wrong.xml: 'wall.data' has the shape 3x4x3, expected 5x8x3 as in the scene"};
    Fixture *f = *state;
    char path[128], wrong[128];
    snprintf(path, sizeof path, "%s/own.xml", f->folder);
    snprintf(wrong, sizeof wrong, "%s/wrong.xml", f->folder);
    for (int i = 0; i < 4; i++) {
        FILE *file = fopen(path, "w"), *other = fopen(wrong, "w");
        assert_true(file && other);
        fprintf(file, "<scene version='3.0.0'>%s</scene>",
                i < 3 ? "<bsdf type='diffuse' id='wall'/>"
                      : "<texture type='bitmap' id='wall'><string name='filename' value='sky.exr'/></texture>");
        fprintf(other, "<scene version='3.0.0'>%s</scene>", texts[i]);
        assert_int_equal(fclose(file) | fclose(other), 0);
        rey_scene *scene = load(f, path, 0);
        assert_int_equal(rey_scene_load_values(scene, wrong), REY_ERROR_PARAM);
        if (!strstr(rey_error(f->ctx), words[i])) {
            fail_msg("'%s', expected '%s'", rey_error(f->ctx), words[i]);
        }
        assert_true(rey_param_values(scene, 0)[0] != 0.3f);
        rey_scene_destroy(scene);
    }
}

static int count_files(const char *folder) {
    int count = 0;
    DIR *list = opendir(folder);
    assert_non_null(list);
    for (struct dirent *entry; (entry = readdir(list));) {
        count += entry->d_name[0] != '.';
    }
    closedir(list);
    return count;
}

// Two textures, one file; an alias; names and files that want escapes; saved over itself.
static void files_are_written_once(void **state) {
    Fixture *f = *state;
    char path[128], copy[128], data[128];
    snprintf(path, sizeof path, "%s/two.xml", f->folder);
    snprintf(copy, sizeof copy, "%s/once &amp; $.xml", f->folder);
    snprintf(data, sizeof data, "%s/once &amp; $_data", f->folder);
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    fprintf(file, "<scene version=\"3.0.0\"><bsdf type=\"diffuse\" id=\"a&amp;b\"><texture type=\"bitmap\" name=\"reflectance\">"
                  "<string name=\"filename\" value=\"%s\"/></texture></bsdf><alias id=\"a&amp;b\" as=\"wall\"/>"
                  "<shape type=\"rectangle\"><ref id=\"wall\"/></shape><shape type=\"sphere\"><bsdf type=\"diffuse\">"
                  "<texture type=\"bitmap\" name=\"reflectance\"><string name=\"filename\" value=\"%s\"/></texture>"
                  "</bsdf></shape></scene>",
            f->texels, f->texels);
    assert_int_equal(fclose(file), 0);
    rey_scene *scene = load(f, path, 0), *again;
    assert_int_equal(rey_scene_save(scene, copy), REY_OK);
    assert_int_equal(count_files(data), 1);
    again = load(f, copy, 0);
    expect_same_parameters(scene, again);
    assert_true(rey_param_find(again, "a&b.reflectance.data") >= 0);
    assert_int_equal(rey_scene_save(again, copy), REY_OK);
    assert_int_equal(count_files(data), 1);
    rey_scene_destroy(again);
    again = load(f, copy, 0);
    expect_same_parameters(scene, again);
    rey_scene_destroy(scene);
    rey_scene_destroy(again);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(rooms_come_back),
        cmocka_unit_test(texture_poses_come_back),
        cmocka_unit_test(mesh_flags_come_back),
        cmocka_unit_test(changes_come_back), cmocka_unit_test(impossible_shapes_are_refused),
        cmocka_unit_test(files_are_written_once),
        cmocka_unit_test(moved_vertices_take_their_normals_along), cmocka_unit_test(values_load_by_name),
        cmocka_unit_test(wrong_values_are_refused),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
