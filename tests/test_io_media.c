// Participating media as scenes write them: what is refused and in which words, what the records say, how parameters are
// named, that bounds and poses follow them, and that a saved scene holds what was changed.
#include "io/image.h"
#include "io/vol.h"
#include "render/update.h"
#include "folder.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

static char folder[] = "/tmp/reynolds_media_XXXXXX";

static void write_vol(rey_context *ctx, const char *name, int nx, int ny, int nz, int channels, const float *box) {
    float data[256];
    rey_vol vol = {.nx = nx, .ny = ny, .nz = nz, .channels = channels, .box = {0, 0, 0, 1, 1, 1}, .data = data};
    for (int i = 0; i < nx * ny * nz * channels; i++) {
        data[i] = 0.25f + 0.5f * (float)(i % 7) / 6;
    }
    if (channels == 6) {
        memcpy(data, (const float[6]){1, 1, 0.25f, 0, 0.1f, 0}, sizeof(float[6]));
    }
    if (box) {
        memcpy(vol.box, box, sizeof vol.box);
    }
    assert_int_equal(rey_vol_write(ctx, name, &vol), REY_OK);
}

static int make_folder(void **state) {
    static const float box[6] = {1, 2, 3, 2, 4, 6}, flat[6] = {1, 2, 3, 1, 4, 6};
    static const float data[8] = {0, 1, 2, 3, 4, 5, 6, 7};
    rey_context *ctx;
    if (rey_context_create(NULL, &ctx) || !folder_make(folder) || chdir(folder)) {
        return -1;
    }
    write_vol(ctx, "smoke.vol", 3, 4, 5, 1, box);
    write_vol(ctx, "flat.vol", 2, 2, 2, 1, flat);
    write_vol(ctx, "colours.vol", 2, 2, 2, 3, NULL);
    write_vol(ctx, "two.vol", 2, 2, 2, 2, NULL);
    write_vol(ctx, "flakes.vol", 1, 1, 1, 6, NULL);
    write_vol(ctx, "bad_flakes.vol", 2, 1, 1, 6, NULL);
    assert_int_equal(rey_npy_write(ctx, "dense.npy", data, (const int64_t[3]){2, 2, 2}, 3), REY_OK);
    *state = ctx;
    return 0;
}

static int remove_folder(void **state) {
    rey_context_destroy(*state);
    return folder_remove(folder);
}

#define SENSOR                                                                                                         \
    "<sensor type='perspective' id='eye'><film type='hdrfilm'><integer name='width' value='4'/>"                       \
    "<integer name='height' value='4'/><rfilter type='box'/></film>%s</sensor>"

static rey_result load_with(rey_context *ctx, const char *integrator, const char *in_sensor, const char *text, rey_scene **scene) {
    FILE *f = fopen("scene.xml", "w");
    assert_non_null(f);
    fprintf(f, "<scene version='3.0.0'><integrator type='%s'/>\n" SENSOR "\n%s\n</scene>\n", integrator, in_sensor, text);
    assert_int_equal(fclose(f), 0);
    return rey_scene_load(ctx, "scene.xml", NULL, 0, scene);
}

static rey_scene *must_load(rey_context *ctx, const char *text) {
    rey_scene *scene = NULL;
    if (load_with(ctx, "volpath", "", text, &scene)) {
        fail_msg("%s: %s", text, rey_error(ctx));
    }
    return scene;
}

#define HETERO(body) "<medium type='heterogeneous' id='fog'>" body "</medium>"
#define HOMO(body) "<medium type='homogeneous' id='fog'>" body "</medium>"
#define GRID(slot, file, more)                                                                                         \
    "<volume type='gridvolume' name='" slot "'><string name='filename' value='" file "'/>" more "</volume>"
#define MATRIX(value) "<transform name='to_world'><matrix value='" value "'/></transform>"

static const struct {
    const char *text, *words;
} refused[] = {
    {"<medium type='homogenous'/>", "there is no medium 'homogenous', did you mean 'homogeneous'?"},
    {HOMO("<rgb name='sigma_t' value='2, 1, 1'/>"), "scene.xml:3"},
    {HOMO("<float name='sigma_t' value='-1'/>"), "sigma_t is -1"},
    {HOMO("<float name='albedo' value='1.5'/>"), "albedo is 1.5"},
    {HOMO("<float name='scale' value='-2'/>"), "scale is -2"},
    {HOMO("<float name='sigma_x' value='1'/>"), "unknown property 'sigma_x'"},
    {HOMO(GRID("sigma_t", "smoke.vol", "")), "'sigma_t' of a homogeneous medium is a grid"},
    {HOMO(GRID("albedo", "dense.npy", "")), "the volume holds 2, expected numbers in [0, 1]: share of the extinction"},
    {HOMO("<phase type='hg'/><phase type='hg'/>"), "a medium can have one phase function"},
    {HOMO("<phase type='hgg'/>"), "there is no phase 'hgg', did you mean 'hg'?"},
    {HOMO("<phase type='hg'><float name='g' value='1'/></phase>"), "g is 1"},
    {HOMO("<phase type='blendphase'><phase type='hg'/><phase type='isotropic'/></phase>"), "lacks 'weight'"},
    {HOMO("<phase type='blendphase'><float name='weight' value='0.5'/><phase type='hg'/></phase>"),
     "'blendphase' takes 2 nested phase functions, found 1"},
    {HOMO("<phase type='tabphase'/>"), "lacks 'values'"},
    {HOMO("<phase type='tabphase'><string name='values' value='1'/></phase>"), "expected two or more"},
    {HOMO("<phase type='tabphase'><string name='values' value='0, 0'/></phase>"), "not all 0"},
    {HOMO("<phase type='tabphase'><string name='values' value='1, -1, 3'/></phase>"), "number 2 of 'values' is -1"},
    {HOMO("<phase type='tabphase'><string name='values' value='1, b'/></phase>"), "must be numbers"},
    {HOMO("<phase type='sggx'/>"), "lacks 'S'"},
    {HOMO("<phase type='sggx'><string name='S' value='1, 1, 1, 0, 0'/></phase>"), "'S' holds 5 numbers, expected 6"},
    {HOMO("<phase type='sggx'><string name='S' value='1, 1, 1, 2, 0, 0'/></phase>"), "not positive definite"},
    {HOMO("<phase type='sggx'>" GRID("S", "smoke.vol", "") "</phase>"), "'S' has 1 channels, expected a grid of 6"},
    {HOMO("<phase type='sggx'>" GRID("S", "bad_flakes.vol", "") "</phase>"), "'S' is not positive definite"},
    {HOMO("<phase type='blendphase'>" GRID("weight", "colours.vol", "") "<phase type='hg'/><phase type='hg'/></phase>"),
     "'weight' of a phase function must be a number or a volume of numbers"},
    {HOMO("<phase type='dictionary'/>"), "lacks 'weights'"},
    {HOMO("<phase type='dictionary'><string name='weights' value='1, 2'/><phase type='hg'/></phase>"),
     "'dictionary' has 2 weights for 1 nested phase functions"},
    {HOMO("<phase type='dictionary'><string name='weights' value='0'/><phase type='hg'/></phase>"), "not all 0"},
    {"<bsdf type='diffuse'><texture type='volume' name='reflectance'/></bsdf>", "takes one nested volume, found none"},
    {"<bsdf type='diffuse'><texture type='volume' name='reflectance'>" GRID("v", "dense.npy", "") "</texture></bsdf>",
     "the volume holds 2, expected numbers in [0, 1]"},
    {"<bsdf type='diffuse'><texture type='volume' name='reflectance'>" GRID("v", "flakes.vol", "") "</texture></bsdf>",
     "the volume of a texture has 6 channels"},
    {"<bsdf type='bumpmap'><texture type='volume'>" GRID("v", "smoke.vol", "") "</texture><bsdf type='diffuse'/></bsdf>",
     "the texture of 'bumpmap' cannot be a volume"},
    {"<shape type='sphere'><emitter type='directionalarea'><texture type='volume' name='radiance'>" GRID("v", "smoke.vol", "")
     "</texture></emitter></shape>", "'radiance' of 'directionalarea' cannot be a volume"},
    {"<emitter type='spot'><texture type='volume' name='texture'>" GRID("v", "smoke.vol", "") "</texture></emitter>",
     "'texture' of 'spot' cannot be a volume"},
    {HETERO(GRID("sigma_t", "no.vol", "")), "no.vol"},
    {HETERO(GRID("sigma_t", "scene.xml", "")), "scene.xml: byte 0: not a VOL file, nor NanoVDB or .npy"},
    {HETERO(GRID("sigma_t", "two.vol", "")), "the grid has 2 channels, expected 1, 3 or 6"},
    {HETERO(GRID("sigma_t", "flakes.vol", "")), "'sigma_t' has 6 channels, expected 1 or 3"},
    {HETERO(GRID("sigma_t", "smoke.vol", "<string name='filter_type' value='cubic'/>")), "'nearest', 'trilinear'"},
    {HETERO(GRID("sigma_t", "smoke.vol", MATRIX("1 0 0 0 0 1 0 0 0 0 0 0 0 0 0 1"))), "to_world cannot be inverted"},
    {HETERO(GRID("sigma_t", "flat.vol", "<boolean name='use_grid_bbox' value='true'/>")),
     "to_world with the box of its file cannot be inverted"},
    {HETERO("<volume type='gridvolume' name='sigma_t'/>"), "filename"},
    {HETERO("<volume type='gridvolum' name='sigma_t'/>"), "did you mean 'gridvolume'?"},
    {HETERO("<texture type='checkerboard' name='sigma_t'/>"), "the texture of a volume must be one value"},
    {"<shape type='sphere'><medium type='homogeneous'/></shape>", "has no use for the medium 'homogeneous'"},
    {"<bsdf type='null' id='b'/><shape type='sphere'><ref id='b' name='interior'/></shape>",
     "'interior' must be a medium, not a bsdf"},
};

static void test_refusals(void **state) {
    for (int i = 0; i < COUNT_OF(refused); i++) {
        rey_scene *scene = NULL;
        rey_result result = load_with(*state, "volpath", "", refused[i].text, &scene);
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

static const char *const everything =
    HETERO("<float name='scale' value='3'/>" GRID("sigma_t", "smoke.vol", MATRIX("2 0 0 1 0 4 0 0 0 0 1 0 0 0 0 1"))
           GRID("albedo", "colours.vol", "<string name='wrap_mode' value='mirror'/><string name='filter_type' value='nearest'/>")
           "<rgb name='emission' value='0.25, 0.5, 0.125'/>"
           "<phase type='blendphase'><float name='weight' value='0.25'/><phase type='tabphase'>"
           "<string name='values' value='1 2, 3'/></phase><phase type='blendphase'><float name='weight' value='0.5'/>"
           "<phase type='hg'><float name='g' value='-0.5'/></phase><phase type='sggx'>" GRID("S", "flakes.vol", "")
           "</phase></phase></phase>")
    "<medium type='homogeneous' id='dust'><phase type='dictionary'><string name='weights' value='1, 2, 5'/>"
    "<phase type='hg'/><phase type='rayleigh'/><phase type='blendphase'>" GRID("weight", "smoke.vol", "")
    "<phase type='hg'/><phase type='isotropic'/></phase></phase></medium>"
    "<bsdf type='diffuse' id='marble'><texture type='volume' name='reflectance'>" GRID("v", "colours.vol", "") "</texture></bsdf>"
    "<medium type='homogeneous' id='milk'><rgb name='sigma_t' value='0.5, 0.25, 1'/></medium>"
    "<shape type='sphere' id='ball'><bsdf type='null'/><ref name='interior' id='fog'/><ref name='exterior' id='milk'/></shape>"
    "<shape type='cube' id='box'><bsdf type='null'/><medium name='interior' type='homogeneous'><phase type='rayleigh'/>"
    "</medium></shape>";

static void test_records(void **state) {
    rey_scene *scene = NULL;
    assert_int_equal(load_with(*state, "volpath", "<ref id='milk'/>", everything, &scene), REY_OK);
    const SceneView *view = &scene->view;
    assert_int_equal(view->media_count, 4);
    int milk = view->sensors[0].medium, fog = view->shapes[0].interior;
    assert_int_equal(view->shapes[0].exterior, milk);
    assert_int_equal(view->shapes[1].exterior, -1);
    const Group *g = view->groups + view->shapes[0].group;
    assert_true(g->interior == fog && g->exterior == milk && view->has_media);
    const MediumNode *m = view->media + fog, *homogeneous = view->media + milk;
    assert_true(m->bounded && !homogeneous->bounded && homogeneous->emission < 0);
    assert_true(view->theta[m->scale] == 3 && view->theta[homogeneous->scale] == 1);
    const VolumeNode *v = view->volumes + m->sigma_t, *albedo = view->volumes + m->albedo;
    assert_true(v->kind == VOLUME_GRID && v->nx == 3 && v->ny == 4 && v->nz == 5 && v->channels == 1);
    assert_true(v->filter == FILTER_BILINEAR && v->wrap == WRAP_CLAMP && view->theta[v->theta + 6] == 0.75f);
    assert_true(albedo->channels == 3 && albedo->filter == FILTER_NEAREST && albedo->wrap == WRAP_MIRROR);
    const VolumeNode *colour = view->volumes + homogeneous->sigma_t, *grey = view->volumes + homogeneous->albedo;
    assert_true(colour->kind == VOLUME_CONSTANT && colour->channels == 3 && view->theta[colour->theta + 1] == 0.25f);
    assert_true(grey->channels == 1 && view->theta[grey->theta] == 0.75f);
    assert_true(view->theta[view->volumes[m->emission].theta + 2] == 0.125f);
    const PhaseNode *list = view->phases + view->media[2].phase, *second = view->phases + list->child[1];
    const PhaseNode *third = view->phases + second->child[1];
    assert_true(view->phases[list->child[0]].kind == 1 && view->phases[second->child[0]].kind == 2 && third->child[1] < 0);
    assert_int_equal(view->textures[view->phases[third->child[0]].slot[0]].kind, TEXTURE_VOLUME);
    assert_true(m->sigma_s < 0 && homogeneous->sigma_a < 0);
    const PhaseNode *blend = view->phases + m->phase, *table = view->phases + blend->child[0];
    const PhaseNode *flakes = view->phases + view->phases[blend->child[1]].child[1];
    assert_int_equal(view->textures[table->slot[0]].width, 3);
    assert_true(view->theta[view->textures[flakes->slot[0]].theta + 2] == 0.25f);
    assert_true(m->flakes < 0); // they only scatter
    float rows[12] = {0};
    assert_int_equal(rey_scene_update(scene), REY_OK);
    memcpy(rows, view->tables + v->table, sizeof rows);
    assert_true(rows[0] == 0.5f && rows[3] == -0.5f && rows[5] == 0.25f && rows[10] == 1);
    assert_true(view->tables[table->table] == 3 / 8.0f && view->tables[table->table + 1] == 1);
    rey_scene_destroy(scene);
}

// The medium of a sensor; integrators that see none; what cannot be rendered yet.
static void test_use(void **state) {
    rey_scene *scene = NULL;
    assert_int_equal(load_with(*state, "path", "", everything, &scene), REY_OK);
    assert_false(scene->view.has_media);
    assert_int_equal(rey_scene_note_count(scene), 1);
    assert_non_null(strstr(rey_scene_note(scene, 0), "scene.xml:1: 'path' sees no participating media: 'volpath' does"));
    rey_scene_destroy(scene);
    assert_int_equal(load_with(*state, "volpathmis", "<medium type='homogeneous'/>", "", &scene), REY_OK);
    assert_true(scene->view.has_media && scene->view.sensors[0].medium == 0);
    find(scene, "eye.medium.sigma_t.value.value");
    rey_scene_destroy(scene);
    scene = must_load(*state, HOMO("<phase type='sggx'>" GRID("S", "flakes.vol", "") "</phase>"));
    assert_int_equal(scene->view.media[0].flakes, scene->view.phases[scene->view.media[0].phase].slot[0]);
    rey_scene_destroy(scene);
    scene = must_load(*state, HOMO(""));
    assert_true(scene->view.media[0].flakes < 0);
    assert_false(scene->view.has_media);
    rey_scene_destroy(scene);
}

static void test_parameters(void **state) {
    static const struct {
        const char *name;
        int count;
    } expected[] = {
        {"fog.scale", 1},
        {"fog.sigma_t.data", 60},
        {"fog.sigma_t.to_world", 16},
        {"ball.interior_medium.sigma_t.data", 60},
        {"fog.albedo.data", 24},
        {"fog.emission.value.value", 3},
        {"fog.phase_function.weight", 1},
        {"fog.phase_function.phase_0.values", 3},
        {"fog.phase_function.phase_1.phase_0.g", 1},
        {"fog.phase_function.phase_1.phase_1.S.data", 6},
        {"dust.phase_function.weights", 3},
        {"dust.phase_function.phase_2.weight.data", 60},
        {"dust.phase_function.phase_0.g", 1},
        {"marble.reflectance.volume.data", 24},
        {"milk.sigma_t.value.value", 3},
        {"milk.sigma_t", 3},
        {"milk.albedo.value.value", 1},
        {"box.interior_medium.albedo.value.value", 1},
    };
    rey_scene *scene = must_load(*state, everything);
    for (int i = 0; i < COUNT_OF(expected); i++) {
        rey_param_info info;
        assert_int_equal(rey_param_get_info(scene, find(scene, expected[i].name), &info), REY_OK);
        assert_int_equal(info.count, expected[i].count);
        assert_int_equal(info.terms, REY_TERM_INTERIOR);
        assert_true(strstr(expected[i].name, "albedo") ? info.low == 0 && info.high == 1 : true);
    }
    float too_much = 1.5f;
    assert_int_equal(rey_param_set(scene, find(scene, "milk.albedo"), &too_much, 1), REY_ERROR_PARAM);
    rey_scene_destroy(scene);
}

// Bounds and poses follow what they are made of.
static void test_update(void **state) {
    rey_scene *scene = must_load(*state, everything);
    const SceneView *view = &scene->view;
    const MediumNode *m = view->media + view->shapes[0].interior;
    assert_int_equal(rey_scene_update(scene), REY_OK);
    assert_true(m->nx == 3 && m->ny == 4 && m->nz == 5);
    float values[60] = {0}, scale = 2, before = view->tables[m->table];
    assert_true(before >= 3 * 0.75f && before < 3 * 0.7501f);
    values[59] = 10;
    assert_int_equal(rey_param_set(scene, find(scene, "fog.sigma_t.data"), values, 60), REY_OK);
    assert_int_equal(rey_scene_update(scene), REY_OK);
    assert_true(view->tables[m->table] == 0 && view->tables[m->table + 59] >= 30 && view->tables[m->table + 59] < 30.01f);
    assert_int_equal(rey_param_set(scene, find(scene, "fog.scale"), &scale, 1), REY_OK);
    assert_int_equal(rey_scene_update(scene), REY_OK);
    assert_true(view->tables[m->table + 59] >= 20 && view->tables[m->table + 59] < 20.01f);
    float pose[16] = {4, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
    assert_int_equal(rey_param_set(scene, find(scene, "fog.sigma_t.to_world"), pose, 16), REY_OK);
    assert_int_equal(rey_scene_update(scene), REY_OK);
    assert_true(view->tables[view->volumes[m->sigma_t].table] == 0.25f);
    pose[0] = 0;
    assert_int_equal(rey_param_set(scene, find(scene, "fog.sigma_t.to_world"), pose, 16), REY_OK);
    assert_int_equal(rey_scene_update(scene), REY_ERROR_PARAM);
    rey_scene_destroy(scene);
    // The box of the file is part of the pose.
    scene = must_load(*state, HETERO(GRID("sigma_t", "smoke.vol", "<boolean name='use_grid_bbox' value='true'/>"
                                                                  MATRIX("0 -2 0 0 1 0 0 0 0 0 1 0 0 0 0 1"))));
    const float *placed = rey_param_values(scene, find(scene, "fog.sigma_t.to_world"));
    const float rows[12] = {0, -4, 0, -4, 1, 0, 0, 1, 0, 0, 3, 3};
    assert_memory_equal(placed, rows, sizeof rows);
    rey_scene_destroy(scene);
}

// Grids of other files: NanoVDB with its own box, and arrays where an sdfgrid wants its nodes.
static void test_other_files(void **state) {
    static const float rows[12] = {9, 0, 0, -1.75f, 0, 7.5f, 0, 61.75f, 0, 0, 3.5f, 4.25f};
    rey_scene *scene = must_load(*state, HETERO(GRID("sigma_t", TEST_DATA_DIR "/nvdb/float.nvdb",
                                                     "<boolean name='use_grid_bbox' value='true'/>"))
                                         "<shape type='sdfgrid' id='blob'><string name='filename' value='dense.npy'/></shape>");
    const VolumeNode *v = scene->view.volumes + scene->view.media[0].sigma_t;
    assert_true(v->nx == 18 && v->ny == 15 && v->nz == 7);
    assert_memory_equal(scene->view.theta + v->to_world, rows, sizeof rows);
    assert_true(rey_param_values(scene, find(scene, "blob.grid"))[7] == 7);
    rey_scene_destroy(scene);
}

// Under a white sky a diffuse surface shows its reflectance: of the voxels that it lies in. What moves it is refused.
static void test_texture(void **state) {
    static const char *const text =
        "<emitter type='constant'><rgb name='radiance' value='1, 1, 1'/></emitter>"
        "<shape type='rectangle' id='card'><transform name='to_world'><scale value='0.5'/><translate x='0.5' y='0.5' z='0.25'/>"
        "</transform><bsdf type='diffuse'><texture type='volume' name='reflectance'>"
        GRID("v", "colours.vol", "<string name='filter_type' value='nearest'/>") "</texture></bsdf></shape>";
    static const char *const look = "<float name='fov' value='20.61'/><transform name='to_world'>"
                                    "<lookat origin='0.5, 0.5, 3' target='0.5, 0.5, 0' up='0, 1, 0'/></transform>";
    rey_scene *scene = NULL;
    float image[4 * 4 * 3];
    double gradient[24];
    rey_render_def def = rey_default_render_def();
    def.spp = 256;
    assert_int_equal(load_with(*state, "path", look, text, &scene), REY_OK);
    assert_int_equal(rey_render(scene, &def, image, NULL), REY_OK);
    for (int i = 0; i < 48; i++) {
        int c = i % 3, x = i / 3 % 4, y = 3 - i / 12, voxel = y / 2 * 2 + x / 2;
        float expected = 0.25f + 0.5f * (float)((3 * voxel + c) % 7) / 6;
        if (!(fabsf(image[i] - expected) < 0.04f)) {
            fail_msg("pixel %d, %d is %g, expected %g", x, y, (double)image[i], (double)expected);
        }
    }
    int data = find(scene, "card.bsdf.reflectance.volume.data"), card = find(scene, "card.to_world");
    int place = find(scene, "card.bsdf.reflectance.volume.to_world");
    rey_selection selection = {&data, 1};
    for (int i = 0; i < 48; i++) {
        image[i] = 1;
    }
    assert_int_equal(rey_vjp(scene, &def, selection, image, gradient, NULL, NULL), REY_OK);
    for (int i = 0; i < 24; i++) { // four pixels see each voxel of the lower layer
        double expected = i < 12 ? 4 : 0;
        if (!(fabs(gradient[i] - expected) <= 0.05 * expected)) {
            fail_msg("the derivative by number %d is %g, expected %g", i, gradient[i], expected);
        }
    }
    selection.params = &card;
    assert_int_equal(rey_vjp(scene, &def, selection, image, gradient, NULL, NULL), REY_ERROR_INCOMPLETE);
    assert_non_null(strstr(rey_error(*state), "surfaces have volumes of filter_type=\"nearest\" as textures"));
    selection.params = &place;
    assert_int_equal(rey_vjp(scene, &def, selection, image, gradient, NULL, NULL), REY_ERROR_INCOMPLETE);
    rey_scene_destroy(scene);
}

static void assert_same(rey_scene *a, rey_scene *b) {
    assert_int_equal(rey_param_count(a), rey_param_count(b));
    for (int i = 0; i < rey_param_count(a); i++) {
        rey_param_info info;
        assert_int_equal(rey_param_get_info(a, i, &info), REY_OK);
        int other = find(b, info.name);
        if (memcmp(rey_param_values(a, i), rey_param_values(b, other), (size_t)info.count * sizeof(float)) != 0) {
            fail_msg("%s differs", info.name);
        }
    }
}

// Every parameter with other values, alone and together, comes back from the file.
static void test_round_trip(void **state) {
    for (int only = -2; ; only++) { // -2: none, -1: all
        rey_scene *scene = must_load(*state, everything), *again = NULL;
        if (only == rey_param_count(scene)) {
            rey_scene_destroy(scene);
            break;
        }
        for (int i = 0; i < rey_param_count(scene) && only != -2; i++) {
            rey_param_info info;
            float values[256];
            assert_int_equal(rey_param_get_info(scene, i, &info), REY_OK);
            memcpy(values, rey_param_values(scene, i), (size_t)info.count * sizeof(float));
            for (int64_t k = 0; k < (info.count == 16 ? 12 : info.count); k++) {
                values[k] = info.high <= 1 ? 0.5f * values[k] + 0.1f : 1.5f * values[k] + 0.01f;
            }
            bool fixed = strncmp(info.name, "ball", 4) == 0 || strncmp(info.name, "box", 3) == 0 ||
                         strncmp(info.name, "eye", 3) == 0;
            if ((only == -1 && !fixed) || (only == i && (!fixed || strstr(info.name, "medium")))) {
                assert_int_equal(rey_param_set(scene, i, values, info.count), REY_OK);
            }
        }
        if (rey_scene_save(scene, "saved.xml") || rey_scene_load(*state, "saved.xml", NULL, 0, &again)) {
            fail_msg("parameter %d: %s", only, rey_error(*state));
        }
        assert_same(scene, again);
        rey_scene_destroy(scene);
        rey_scene_destroy(again);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_refusals), cmocka_unit_test(test_records),
                                       cmocka_unit_test(test_use),      cmocka_unit_test(test_parameters),
                                       cmocka_unit_test(test_update),   cmocka_unit_test(test_other_files),
                                       cmocka_unit_test(test_texture),
                                       cmocka_unit_test(test_round_trip)};
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
