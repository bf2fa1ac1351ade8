// Media that are written with sigma_s and sigma_a: what is refused and in which words, what the records say, how parameters are
// named, that the extinction follows them, and that a saved scene shows the same picture to the bit.
#include "io/vol.h"
#include "render/update.h"
#include "scene/absent.h"
#include "folder.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

static char folder[] = "/tmp/reynolds_scattering_XXXXXX";

static void write_vol(rey_context *ctx, const char *name, int nx, int ny, int nz, int channels, float factor) {
    float data[256];
    rey_vol vol = {.nx = nx, .ny = ny, .nz = nz, .channels = channels, .box = {0, 0, 0, 2, 1, 1}, .data = data};
    for (int i = 0; i < nx * ny * nz * channels; i++) {
        data[i] = factor * (float)(i % 7);
    }
    assert_int_equal(rey_vol_write(ctx, name, &vol), REY_OK);
}

static int make_folder(void **state) {
    rey_context *ctx;
    if (rey_context_create(NULL, &ctx) || !folder_make(folder) || chdir(folder)) {
        return -1;
    }
    write_vol(ctx, "dust.vol", 3, 4, 5, 1, 0.3f);
    write_vol(ctx, "soot.vol", 3, 4, 5, 1, 0.1f);
    write_vol(ctx, "ink.vol", 3, 4, 5, 3, 0.1f);
    write_vol(ctx, "small.vol", 3, 4, 4, 1, 0.1f);
    write_vol(ctx, "two.vol", 3, 4, 5, 2, 0.1f);
    *state = ctx;
    return 0;
}

static int remove_folder(void **state) {
    rey_context_destroy(*state);
    return folder_remove(folder);
}

static rey_result load(rey_context *ctx, const char *text, rey_scene **scene) {
    FILE *f = fopen("scene.xml", "w");
    assert_non_null(f);
    fprintf(f, "<scene version='3.0.0'><integrator type='volpath'/><emitter type='constant'/>\n"
               "<sensor type='perspective'><transform name='to_world'>"
               "<lookat origin='0.4, 0.3, 4' target='0.5, 0.5, 0.5' up='0, 1, 0'/></transform>"
               "<film type='hdrfilm'><integer name='width' value='4'/><integer name='height' value='4'/>"
               "<rfilter type='box'/></film></sensor>\n%s\n</scene>\n", text);
    assert_int_equal(fclose(f), 0);
    return rey_scene_load(ctx, "scene.xml", NULL, 0, scene);
}

static rey_scene *must_load(rey_context *ctx, const char *text) {
    rey_scene *scene = NULL;
    if (load(ctx, text, &scene)) {
        fail_msg("%s: %s", text, rey_error(ctx));
    }
    return scene;
}

#define MEDIUM(type, name, radius, body)                                                                               \
    "<medium type='" type "' id='" name "'>" body "</medium><shape type='sphere'><point name='center' value='0.5, 0.5, 0.5'/>" \
    "<float name='radius' value='" radius "'/><bsdf type='null'/><ref name='interior' id='" name "'/></shape>"
#define HETERO(body) MEDIUM("heterogeneous", "fog", "0.5", body)
#define HOMO(body) MEDIUM("homogeneous", "fog", "0.5", body)
#define GRID(slot, file, more)                                                                                         \
    "<volume type='gridvolume' name='" slot "'><string name='filename' value='" file "'/>" more "</volume>"
#define CONSTANT(slot, more) "<volume type='constvolume' name='" slot "'><float name='value' value='0.5'/>" more "</volume>"
#define SHIFT(x) "<transform name='to_world'><translate x='" x "'/></transform>"
#define BOX "<boolean name='use_grid_bbox' value='true'/>"

static const struct {
    const char *text, *words;
} refused[] = {
    {HOMO("<float name='sigma_s' value='1'/><float name='albedo' value='1'/>"), "may be given, not both"},
    {HOMO("<float name='sigma_t' value='1'/><float name='sigma_a' value='1'/>"), "may be given, not both"},
    {HOMO("<float name='sigma_s' value='1'/>"),
     "'sigma_s' is given without 'sigma_a': either both are, 0 where there is none, or 'sigma_t' and 'albedo'"},
    {HETERO(GRID("sigma_a", "soot.vol", "")), "'sigma_a' is given without 'sigma_s'"},
    {HOMO("<rgb name='sigma_s' value='1, -1, 1'/><float name='sigma_a' value='1'/>"), "sigma_s is -1"},
    {HOMO("<float name='sigma_s' value='1'/><float name='sigma_a' value='-2'/>"), "sigma_a is -2"},
    {HOMO(GRID("sigma_s", "dust.vol", "") "<float name='sigma_a' value='1'/>"), "'sigma_s' of a homogeneous medium is a grid"},
    {HOMO("<float name='sigma_s' value='1'/>" GRID("sigma_a", "dust.vol", "")), "'sigma_a' of a homogeneous medium is a grid"},
    {HETERO(GRID("sigma_s", "two.vol", "") "<float name='sigma_a' value='1'/>"), "the grid has 2 channels"},
    {HETERO(GRID("sigma_s", "dust.vol", "") GRID("sigma_a", "small.vol", "")),
     "grids of 3 x 4 x 5 and 3 x 4 x 4 voxels, whose sum is the extinction: expected one resolution"},
    {HETERO(GRID("sigma_s", "dust.vol", "<string name='filter_type' value='nearest'/>") GRID("sigma_a", "soot.vol", "")),
     "have different filter_types"},
    {HETERO(GRID("sigma_s", "dust.vol", "<string name='wrap_mode' value='repeat'/>") GRID("sigma_a", "soot.vol", "")),
     "have different wrap_modes"},
    {HETERO(GRID("sigma_s", "dust.vol", "") GRID("sigma_a", "soot.vol", SHIFT("0.25"))),
     "'sigma_a' stands elsewhere than 'sigma_s', whose sum is the extinction: expected the same to_world"},
    {HETERO(CONSTANT("sigma_s", SHIFT("0.25")) GRID("sigma_a", "soot.vol", "")), "'sigma_a' stands elsewhere than 'sigma_s'"},
    {"<volume type='gridvolume' id='v'><string name='filename' value='small.vol'/></volume>"
     MEDIUM("heterogeneous", "other", "1", "<ref id='v' name='albedo'/>")
     HETERO(GRID("sigma_s", "small.vol", "") "<ref id='v' name='sigma_a'/>"), "'sigma_a' belongs to another object as well"},
    {HETERO("<texture type='checkerboard' name='sigma_s'/><float name='sigma_a' value='1'/>"),
     "the texture of a volume must be one value"},
};

static void test_refusals(void **state) {
    for (int i = 0; i < COUNT_OF(refused); i++) {
        rey_scene *scene = NULL;
        rey_result result = load(*state, refused[i].text, &scene);
        rey_scene_destroy(scene);
        if (result == REY_OK || !strstr(rey_error(*state), refused[i].words)) {
            fail_msg("%s: \"%s\", expected \"%s\"", refused[i].text, result ? rey_error(*state) : "loaded", refused[i].words);
        }
    }
}

static int find(const rey_scene *scene, const char *name) {
    int param = rey_param_find(scene, name);
    if (param < 0) {
        fail_msg("there is no parameter '%s', nearest '%s'", name, rey_param_nearest(scene, name));
    }
    return param;
}

// Every pair that is one: numbers, colours above 1, grids of one and three channels, a grid and a number. The grids of `fog` stand
// in one place that is written in two ways. Each is seen between two spheres.
static const char *const everything =
    MEDIUM("homogeneous", "ink", "0.2", "<float name='sigma_s' value='6'/><rgb name='sigma_a' value='2, 6, 0'/>")
    MEDIUM("homogeneous", "air", "0.3", "<integer name='sigma_s' value='0'/><float name='sigma_a' value='0'/>")
    MEDIUM("heterogeneous", "mist", "0.4", CONSTANT("sigma_s", SHIFT("0.25")) CONSTANT("sigma_a", ""))
    HETERO(GRID("sigma_s", "dust.vol", BOX) GRID("sigma_a", "ink.vol", "<transform name='to_world'><scale x='2'/></transform>"))
    MEDIUM("heterogeneous", "haze", "0.6", GRID("sigma_s", "dust.vol", SHIFT("0.5")) "<rgb name='sigma_a' value='0.5, 0, 2'/>")
    MEDIUM("heterogeneous", "smog", "0.7", "<float name='sigma_s' value='2'/>" GRID("sigma_a", "soot.vol",
           "<string name='filter_type' value='nearest'/><string name='wrap_mode' value='mirror'/>"));

static const MediumNode *medium_of(const rey_scene *scene, const char *sigma_s) {
    int32_t texture = ARRAY_AT(scene->params, Param, find(scene, sigma_s)).texture;
    for (int64_t i = 0; i < scene->view.media_count; i++) {
        if (rey_medium_reads(&scene->view, scene->view.media + i, texture)) {
            return scene->view.media + i;
        }
    }
    fail();
    return NULL;
}

static const VolumeNode *sum_of(const rey_scene *scene, const char *sigma_s) {
    return scene->view.volumes + medium_of(scene, sigma_s)->sigma_t;
}

static void test_records(void **state) {
    rey_scene *scene = must_load(*state, everything);
    const SceneView *view = &scene->view;
    assert_int_equal(rey_scene_update(scene), REY_OK);
    const VolumeNode *ink = sum_of(scene, "ink.sigma_s"), *fog = sum_of(scene, "fog.sigma_s.data");
    const VolumeNode *haze = sum_of(scene, "haze.sigma_s.data"), *smog = sum_of(scene, "smog.sigma_s");
    const float *v = view->theta + ink->theta;
    assert_true(ink->kind == VOLUME_CONSTANT && ink->channels == 3 && v[0] == 8 && v[1] == 12 && v[2] == 6);
    const MediumNode *m = medium_of(scene, "fog.sigma_s.data");
    assert_true(m->albedo < 0 && m->bounded && m->nx == 3 && m->ny == 4 && m->nz == 5);
    assert_true(fog->kind == VOLUME_GRID && fog->channels == 3 && fog->nx == 3 && fog->ny == 4 && fog->nz == 5);
    assert_true(fog->to_world == view->volumes[m->sigma_a].to_world && view->theta[fog->to_world] == 2);
    for (int i = 0; i < 60; i++) {
        for (int c = 0; c < 3; c++) {
            float expected = 0.3f * (float)(i % 7);
            assert_true(view->theta[fog->theta + 3 * i + c] == expected + 0.1f * (float)((3 * i + c) % 7));
            assert_true(view->theta[haze->theta + 3 * i + c] == expected + (c == 0 ? 0.5f : c == 1 ? 0 : 2));
        }
        assert_true(view->theta[smog->theta + i] == 2 + 0.1f * (float)(i % 7));
    }
    assert_true(smog->filter == FILTER_NEAREST && smog->wrap == WRAP_MIRROR && smog->channels == 1);
    const VolumeNode *mist = sum_of(scene, "mist.sigma_s.value");
    assert_true(mist->to_world >= 0 && view->theta[mist->to_world + 3] == 0.25f);
    rey_scene_destroy(scene);
}

static void test_parameters(void **state) {
    static const struct {
        const char *name;
        int count;
    } expected[] = {{"ink.sigma_s", 1},        {"ink.sigma_s.value", 1},   {"ink.sigma_s.value.value", 1},
                    {"ink.sigma_a.value", 3},  {"mist.sigma_a.value", 1},  {"mist.sigma_s.to_world", 16},
                    {"fog.sigma_s.data", 60},  {"fog.sigma_a.data", 180},  {"fog.sigma_s.to_world", 16},
                    {"haze.sigma_a.value", 3}, {"smog.sigma_a.data", 60},  {"smog.sigma_a.to_world", 16}};
    rey_scene *scene = must_load(*state, everything);
    for (int i = 0; i < COUNT_OF(expected); i++) {
        rey_param_info info;
        assert_int_equal(rey_param_get_info(scene, find(scene, expected[i].name), &info), REY_OK);
        assert_int_equal(info.count, expected[i].count);
        assert_int_equal(info.terms, REY_TERM_INTERIOR);
        assert_true(info.count == 16 || (info.low == 0 && strcmp(info.unit, "1/scene unit") == 0));
    }
    // One place has one parameter.
    assert_int_equal(find(scene, "fog.sigma_s.to_world"), find(scene, "fog.sigma_a.to_world"));
    // What a medium does not have is named.
    static const char *const absent[] = {"fog.sigma_t.data", "ink.albedo"};
    char text[ABSENT_BYTES];
    for (int i = 0; i < COUNT_OF(absent); i++) {
        assert_true(rey_param_find(scene, absent[i]) < 0);
        rey_param_absent(scene, absent[i], text);
        assert_string_equal(text, ": this medium is written with sigma_s and sigma_a");
    }
    rey_scene_destroy(scene);
    scene = must_load(*state, HOMO("<float name='sigma_t' value='1'/>"));
    rey_param_absent(scene, "fog.sigma_s.value", text);
    assert_string_equal(text, ": this medium is written with sigma_t and albedo");
    rey_scene_destroy(scene);
}

// The extinction, its bounds and its place follow.
static void test_update(void **state) {
    rey_scene *scene = must_load(*state, everything);
    const SceneView *view = &scene->view;
    const MediumNode *m = medium_of(scene, "smog.sigma_s");
    const float three = 3, *sum = view->theta + view->volumes[m->sigma_t].theta;
    float values[60] = {0}, pose[16] = {4, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
    assert_int_equal(rey_scene_update(scene), REY_OK);
    assert_int_equal(rey_param_set(scene, find(scene, "smog.sigma_s"), &three, 1), REY_OK);
    assert_int_equal(rey_scene_update(scene), REY_OK);
    assert_true(sum[0] == 3 && sum[6] == 3 + 0.1f * 6);
    values[59] = 10;
    assert_int_equal(rey_param_set(scene, find(scene, "smog.sigma_a.data"), values, 60), REY_OK);
    assert_int_equal(rey_scene_update(scene), REY_OK);
    assert_true(sum[0] == 3 && sum[6] == 3 && sum[59] == 13);
    assert_true(view->tables[m->table] >= 3 && view->tables[m->table] < 3.001f);
    assert_true(view->tables[m->table + 59] >= 13 && view->tables[m->table + 59] < 13.001f);
    assert_int_equal(rey_param_set(scene, find(scene, "fog.sigma_a.to_world"), pose, 16), REY_OK);
    assert_int_equal(rey_scene_update(scene), REY_OK);
    const MediumNode *fog = medium_of(scene, "fog.sigma_s.data");
    assert_true(view->tables[view->volumes[fog->sigma_s].table] == 0.25f);
    assert_true(view->tables[view->volumes[fog->sigma_a].table] == 0.25f);
    rey_scene_destroy(scene);
}

static void picture_of(rey_scene *scene, float image[4 * 4 * 3]) {
    rey_render_def def = rey_default_render_def();
    def.spp = 64;
    if (rey_render(scene, &def, image, NULL) != REY_OK) {
        fail_msg("%s", rey_error(scene->ctx));
    }
}

// The same medium written with sigma_t and albedo, where that can say it: numbers, and grids with nearest voxels.
static void test_pictures(void **state) {
#define NEAREST "<string name='filter_type' value='nearest'/>"
    static const char *const pairs[][2] = {
        {HOMO("<float name='sigma_s' value='3'/><rgb name='sigma_a' value='1, 0, 3'/>"),
         HOMO("<volume type='constvolume' name='sigma_t'><rgb name='value' value='4, 3, 6'/></volume>"
              "<rgb name='albedo' value='0.75, 1, 0.5'/>")},
        {HETERO(GRID("sigma_s", "dust.vol", NEAREST) GRID("sigma_a", "soot.vol", NEAREST)),
         HETERO(GRID("sigma_t", "sum.vol", NEAREST) "<float name='albedo' value='0.75'/>")},
        {HETERO(GRID("sigma_s", "dust.vol", NEAREST) "<float name='sigma_a' value='0.5'/>"),
         HETERO(GRID("sigma_t", "more.vol", NEAREST) GRID("albedo", "ratio.vol", NEAREST))}};
    float more[60], ratio[60];
    for (int i = 0; i < 60; i++) {
        more[i] = 0.3f * (float)(i % 7) + 0.5f;
        ratio[i] = 0.3f * (float)(i % 7) / more[i];
    }
    rey_vol vol = {.nx = 3, .ny = 4, .nz = 5, .channels = 1, .box = {0, 0, 0, 1, 1, 1}, .data = more};
    assert_int_equal(rey_vol_write(*state, "more.vol", &vol), REY_OK);
    vol.data = ratio;
    assert_int_equal(rey_vol_write(*state, "ratio.vol", &vol), REY_OK);
    write_vol(*state, "sum.vol", 3, 4, 5, 1, 0.4f);
    for (int i = 0; i < COUNT_OF(pairs); i++) {
        float image[2][4 * 4 * 3];
        for (int k = 0; k < 2; k++) {
            rey_scene *scene = must_load(*state, pairs[i][k]);
            picture_of(scene, image[k]);
            rey_scene_destroy(scene);
        }
        for (int k = 0; k < 4 * 4 * 3; k++) {
            assert_float_equal((double)image[0][k], (double)image[1][k], 1e-5);
        }
    }
}

// Each parameter of a medium with other values, alone and together.
static void test_round_trip(void **state) {
    float before[4 * 4 * 3];
    for (int only = -2; ; only++) { // -2: none, -1: all
        rey_scene *scene = must_load(*state, everything), *again = NULL;
        int count = rey_param_count(scene);
        for (int i = 0; i < count && only != -2; i++) {
            rey_param_info info;
            float values[256];
            assert_int_equal(rey_param_get_info(scene, i, &info), REY_OK);
            memcpy(values, rey_param_values(scene, i), (size_t)info.count * sizeof(float));
            for (int64_t k = 0; k < (info.count == 16 ? 12 : info.count); k++) {
                values[k] = 1.5f * values[k] + (info.count == 16 ? 0 : 0.01f);
            }
            if (strstr(info.name, "sigma") && (only == -1 || only == i)) {
                assert_int_equal(rey_param_set(scene, i, values, info.count), REY_OK);
            }
        }
        if (rey_scene_save(scene, "saved.xml") || rey_scene_load(*state, "saved.xml", NULL, 0, &again)) {
            fail_msg("parameter %d: %s", only, rey_error(*state));
        }
        float one[4 * 4 * 3], other[4 * 4 * 3];
        picture_of(scene, one);
        picture_of(again, other);
        assert_memory_equal(one, other, sizeof one);
        if (only == -2) {
            memcpy(before, one, sizeof before);
        } else if (only < 0 || strstr(ARRAY_AT(scene->params, Param, only).name, "sigma")) {
            assert_memory_not_equal(one, before, sizeof one);
        }
        assert_int_equal(rey_param_count(again), count);
        rey_scene_destroy(scene);
        rey_scene_destroy(again);
        if (only + 1 == count) {
            return;
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_refusals),   cmocka_unit_test(test_records),
                                       cmocka_unit_test(test_parameters), cmocka_unit_test(test_update),
                                       cmocka_unit_test(test_pictures),   cmocka_unit_test(test_round_trip)};
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
