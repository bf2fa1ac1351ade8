// Normals that turn away from the viewer are told where a path meets them and the terms that know them are left out, and nowhere
// else; those of maps within maps are refused there; pictures along recorded paths.
#include "render/replay.h"
#include "reynolds/reynolds.h"
#include "../folder.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

enum { SIZE = 16, NUMBERS = SIZE * SIZE * 3, SPP = 32, SETS = 4 };

static const char *const plane_text =
    "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
    "property float nx\nproperty float ny\nproperty float nz\nelement face 2\n"
    "property list uchar int vertex_indices\nend_header\n"
    "-1 -1 0 %s\n1 -1 0 %s\n1 1 0 %s\n-1 1 0 %s\n%s";

typedef struct Stage {
    rey_context *ctx;
    rey_scene *scene;
    char folder[64];
    const char *integrator, *light;
    int depth;
} Stage;

static const char bulb[] = "<emitter type='constant'/>"
                           "<emitter type='point' id='bulb'><point name='position' x='0.3' y='0.2' z='4'/></emitter>";
static const char torch[] = "<emitter type='spot'><float name='cutoff_angle' value='12'/><transform name='to_world'>"
                            "<lookat origin='0.3,0.2,4' target='0,0,0' up='0,1,0'/></transform></emitter>";

static void write_text(const Stage *s, const char *name, const char *text) {
    char path[128];
    snprintf(path, sizeof path, "%s/%s", s->folder, name);
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    fputs(text, file);
    fclose(file);
}

// A plane seen from `origin` under a lamp, with a normal for its vertices and a scattering function.
static void stage_load(const Stage *s, const char *origin, const char *normal, const char *bsdf, bool reversed,
                       rey_scene **out) {
    char ply[1024], xml[4096], path[128];
    snprintf(ply, sizeof ply, plane_text, normal, normal, normal, normal,
             reversed ? "3 2 1 0\n3 3 2 0\n" : "3 0 1 2\n3 0 2 3\n");
    write_text(s, "plane.ply", ply);
    snprintf(xml, sizeof xml,
             "<scene version='3.0.0'><integrator type='%s'><integer name='max_depth' value='%d'/></integrator>"
             "<sensor type='perspective' id='camera'><float name='fov' value='10'/><transform name='to_world'>"
             "<lookat origin='%s' target='0,0,0' up='0,1,0.1'/></transform><film type='hdrfilm'>"
             "<integer name='width' value='%d'/><integer name='height' value='%d'/><rfilter type='box'/></film></sensor>"
             "%s<shape type='ply' id='plane'><string name='filename' value='plane.ply'/>%s</shape></scene>",
             s->integrator, s->depth, origin, SIZE, SIZE, s->light, bsdf);
    write_text(s, "scene.xml", xml);
    snprintf(path, sizeof path, "%s/scene.xml", s->folder);
    if (rey_scene_load(s->ctx, path, NULL, 0, out) != REY_OK) {
        fail_msg("%s", rey_error(s->ctx));
    }
}

static int set_up(void **state) {
    Stage *s = calloc(1, sizeof *s);
    if (!s || rey_context_create(NULL, &s->ctx)) {
        return 1;
    }
    snprintf(s->folder, sizeof s->folder, "/tmp/reynolds_test_terminator_XXXXXX");
    s->integrator = "path";
    s->light = bulb;
    s->depth = 3;
    *state = s;
    return !folder_make(s->folder);
}

static int tear_down(void **state) {
    Stage *s = *state;
    int status = folder_remove(s->folder);
    rey_context_destroy(s->ctx);
    free(s);
    return status;
}

static rey_render_def def_make(int terms) {
    rey_render_def def = rey_default_render_def();
    def.spp = SPP;
    def.sets = SETS;
    def.terms = terms;
    return def;
}

// The results of forward and reverse mode for the sum of the parameter's numbers, which must agree.
static rey_result derive(const Stage *s, rey_scene *scene, const char *name, int terms, int *missing) {
    static float image[NUMBERS], adjoint[NUMBERS], tangent[64];
    double gradient[64], forward = 0, reverse = 0;
    int param = rey_param_find(scene, name);
    assert_true(param >= 0);
    rey_selection selection = {&param, 1};
    rey_param_info info;
    assert_int_equal(rey_param_get_info(scene, param, &info), REY_OK);
    int64_t count = rey_selection_size(scene, selection);
    assert_true(count <= 64);
    for (int i = 0; i < 64; i++) {
        tangent[i] = (float)(i % 3) - 0.5F;
    }
    for (int i = 0; i < NUMBERS; i++) {
        adjoint[i] = 1;
    }
    rey_render_def def = def_make(terms);
    rey_stats stats = {0}, reversed = {0};
    rey_result result = rey_jvp(scene, &def, selection, tangent, image, NULL, &stats);
    assert_int_equal(rey_vjp(scene, &def, selection, adjoint, gradient, NULL, &reversed), result);
    assert_int_equal(stats.missing_terms, reversed.missing_terms);
    *missing = stats.missing_terms;
    if (result) {
        assert_int_equal(result, REY_ERROR_INCOMPLETE);
        assert_non_null(strstr(rey_error(s->ctx), "terminator"));
        assert_non_null(strstr(rey_error(s->ctx), info.name));
        return result;
    }
    double size = 0;
    for (int i = 0; i < NUMBERS; i++) {
        forward += (double)image[i];
        size += fabs((double)image[i]);
    }
    for (int64_t i = 0; i < count; i++) {
        reverse += gradient[i] * (double)tangent[i];
    }
    assert_true(size > 0);
    assert_true(fabs(forward - reverse) <= 1e-4 * size);
    return REY_OK;
}

static void test_turned_normals(void **state) {
    const Stage *s = *state;
    static const char twosided[] = "<bsdf type='twosided'><bsdf type='roughconductor'/></bsdf>";
    static const char flat_map[] = "<bsdf type='normalmap' id='map'><rgb name='normalmap' value='0.6,0.5,1'/>"
                                   "<bsdf type='diffuse'/></bsdf>";
    static const char steep_map[] = "<bsdf type='normalmap' id='map'><rgb name='normalmap' value='0.95,0.5,0.6'/>"
                                    "<bsdf type='diffuse'/></bsdf>";
    static const char unflipped_map[] =
        "<bsdf type='normalmap' id='map'><boolean name='flip_invalid_normals' value='false'/>"
        "<rgb name='normalmap' value='0.95,0.5,0.6'/><bsdf type='diffuse'/></bsdf>";
    static const char map_in_map[] = "<bsdf type='normalmap' id='map'><rgb name='normalmap' value='0.95,0.5,0.6'/>"
                                     "<bsdf type='normalmap'><rgb name='normalmap' value='0.6,0.5,1'/><bsdf type='diffuse'/>"
                                     "</bsdf></bsdf>";
    static const struct {
        const char *origin, *normal, *bsdf, *param;
        bool turned, reversed;
    } cases[] = {{"0,0,5", "0 0 1", "<bsdf type='diffuse'/>", "plane.normals", false, false},
                 {"1,0,5", "0.3 0 1", "<bsdf type='diffuse'/>", "plane.normals", false, false},
                 {"1,0,5", "0.3 0 1", "<bsdf type='diffuse'/>", "plane.normals", false, true},
                 {"0,0,5", "0.3 0 1", twosided, "plane.normals", false, false},
                 {"0,0,-5", "0.3 0 1", twosided, "plane.normals", false, false}, // from behind, both face away
                 {"-1.6,0,4.75", "0.9 0 0.3", "<bsdf type='diffuse'/>", "plane.normals", true, false},
                 {"-1.6,0,4.75", "0.9 0 0.3", "<bsdf type='diffuse'/>", "plane.normals", true, true},
                 {"-1.6,0,4.75", "0.9 0 0.3", twosided, "plane.normals", true, false},
                 {"0,0,5", "0 0 1", flat_map, "map.normalmap.value", false, false},
                 {"-1.08,0,4.9", "0 0 1", steep_map, "map.normalmap.value", true, false},
                 {"-1.08,0,4.9", "0 0 1", unflipped_map, "map.normalmap.value", true, false},
                 {"-1.08,0,4.9", "0 0 1", map_in_map, "map.normalmap.value", true, false},
                 {"5,0,1", "0 0 1", steep_map, "map.normalmap.value", false, false}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        rey_scene *scene;
        int missing, expected = cases[i].turned ? REY_TERM_TERMINATOR : 0;
        bool refused = cases[i].bsdf == map_in_map;
        stage_load(s, cases[i].origin, cases[i].normal, cases[i].bsdf, cases[i].reversed, &scene);
        rey_result result = derive(s, scene, cases[i].param, 0, &missing);
        if (result != (refused ? REY_ERROR_INCOMPLETE : REY_OK) || missing != (refused ? expected : 0)) {
            fail_msg("case %d: %s, missing %d: %s", (int)i, rey_result_text(result), missing, rey_error(s->ctx));
        }
        assert_int_equal(derive(s, scene, cases[i].param, REY_TERM_INTERIOR, &missing), REY_OK);
        assert_int_equal(missing, expected);
        rey_scene_destroy(scene);
    }
}

// The normals of a light say where it shines: without the boundary terms light samples jump there, also where no path meets the
// light.
static void test_normals_of_lights(void **state) {
    const Stage *s = *state;
    static const char light[] = "<bsdf type='diffuse'><rgb name='reflectance' value='0.3'/></bsdf>"
                                "<emitter type='area'><rgb name='radiance' value='1'/></emitter>";
    rey_scene *scene;
    int missing;
    stage_load(s, "0,0,5", "0 0 1", light, false, &scene);
    assert_int_equal(derive(s, scene, "plane.normals", 0, &missing), REY_OK);
    assert_int_equal(missing, 0);
    assert_int_equal(derive(s, scene, "plane.normals", REY_TERM_INTERIOR, &missing), REY_OK);
    assert_int_equal(missing, REY_TERM_TERMINATOR);
    assert_true(rey_can_replay(scene, rey_param_find(scene, "plane.emitter.radiance.value")));
    assert_false(rey_can_replay(scene, rey_param_find(scene, "plane.normals")));
    rey_scene_destroy(scene);
}

// Other parameters are not refused for normals that turn away.
static void test_other_parameters(void **state) {
    const Stage *s = *state;
    rey_scene *scene;
    int missing;
    stage_load(s, "-5,0,1", "0.9 0 0.3", "<bsdf type='twosided'><bsdf type='diffuse' id='paint'/></bsdf>", false, &scene);
    assert_int_equal(derive(s, scene, "paint.reflectance.value", 0, &missing), REY_OK);
    assert_int_equal(missing, 0);
    rey_scene_destroy(scene);
}

// Particles look at normals of maps and of vertices alike.
static void test_particles_look(void **state) {
    Stage s = *(const Stage *)*state;
    static const char map[] = "<bsdf type='normalmap' id='map'><rgb name='normalmap' value='0.6,0.5,1'/>"
                              "<bsdf type='diffuse'/></bsdf>";
    rey_scene *scene;
    int missing;
    s.integrator = "ptracer";
    s.depth = 2;
    stage_load(&s, "0,0,5", "0.3 0 1", map, false, &scene);
    assert_int_equal(derive(&s, scene, "plane.normals", REY_TERM_INTERIOR, &missing), REY_OK);
    assert_int_equal(missing, 0);
    rey_scene_destroy(scene);
}

// Two by two pixels of three bytes, from the last row up.
static void write_heights(const Stage *s) {
    static const unsigned char heights[2][8] = {{40, 40, 40, 200, 200, 200}, {170, 170, 170, 90, 90, 90}};
    unsigned char bytes[70] = {'B', 'M', 70, [10] = 54, [14] = 40, [18] = 2, [22] = 2, [26] = 1, [28] = 24, [34] = 16};
    char path[128];
    memcpy(bytes + 54, heights, 16);
    snprintf(path, sizeof path, "%s/heights.bmp", s->folder);
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(bytes, 1, sizeof bytes, file), sizeof bytes);
    fclose(file);
}

// Sum over the picture, with the normals moved along a direction.
static double sum_moved(const Stage *s, rey_scene *scene, const rey_render_def *def, int param, const float *direction, float h) {
    static float image[NUMBERS];
    float start[12], moved[12];
    double sum = 0;
    memcpy(start, rey_param_values(scene, param), sizeof start);
    for (int i = 0; i < 12; i++) {
        moved[i] = start[i] + h * direction[i];
    }
    assert_int_equal(rey_param_set(scene, param, moved, 12), REY_OK);
    if (rey_render(scene, def, image, NULL) != REY_OK) {
        fail_msg("%s", rey_error(s->ctx));
    }
    assert_int_equal(rey_param_set(scene, param, start, 12), REY_OK);
    for (int i = 0; i < NUMBERS; i++) {
        sum += (double)image[i];
    }
    return sum;
}

// Vertex normals turn the tangents that slopes of heights stand on, for particles as for paths.
static void test_particles_turn(void **state) {
    Stage s = *(const Stage *)*state;
    static const char bumps[] = "<bsdf type='bumpmap'><texture type='bitmap'><string name='filename' value='heights.bmp'/>"
                                "<boolean name='raw' value='true'/></texture><float name='scale' value='0.5'/>"
                                "<bsdf type='diffuse'/></bsdf>";
    static float adjoint[NUMBERS];
    static const float direction[12] = {1, 0.3F, 0, -0.4F, 0.8F, 0.2F, 0.5F, -0.6F, 0, 0.9F, 0.7F, -0.1F};
    double gradient[2][12], worst = 0, size = 0, along = 0, difference = 0;
    write_heights(&s);
    for (int i = 0; i < NUMBERS; i++) {
        adjoint[i] = 1;
    }
    for (int k = 0; k < 2; k++) {
        rey_scene *scene;
        s.integrator = k ? "ptracer" : "path";
        s.light = torch;
        stage_load(&s, "0,0,5", "0.3 0.2 1", bumps, false, &scene);
        rey_render_def def = def_make(REY_TERM_INTERIOR);
        def.spp = 2048;
        int param = rey_param_find(scene, "plane.normals");
        if (rey_vjp(scene, &def, (rey_selection){&param, 1}, adjoint, gradient[k], NULL, NULL) != REY_OK) {
            fail_msg("%s", rey_error(s.ctx));
        }
        for (int sign = -1; sign <= 1 && k == 0; sign += 2) {
            difference += sign * sum_moved(&s, scene, &def, param, direction, (float)sign * 0.01F) / 0.02;
        }
        rey_scene_destroy(scene);
    }
    for (int i = 0; i < 12; i++) {
        along += gradient[0][i] * (double)direction[i];
        worst = fmax(worst, fabs(gradient[1][i] - gradient[0][i]));
        size = fmax(size, fabs(gradient[0][i]));
    }
    print_message("particles and paths differ by %.3g of %.3g\n", worst, size);
    print_message("derivative %.5g, difference %.5g\n", along, difference);
    assert_true(size > 0 && worst < 2e-3 * size && fabs(along - difference) < 2e-3 * size);
}

// Where normals turn away particles have the whole derivative, too: that of paths, which is more than its interior.
static void test_particles_see_turns(void **state) {
    Stage s = *(const Stage *)*state;
    static const char map[] = "<bsdf type='normalmap' id='map'><rgb name='normalmap' value='0.94,0.5,0.6'/>"
                              "<bsdf type='diffuse'/></bsdf>";
    static const char *const integrators[] = {"path", "ptracer", "path"};
    static float adjoint[NUMBERS];
    for (int i = 0; i < NUMBERS; i++) {
        adjoint[i] = 1;
    }
    for (int m = 0; m < 2; m++) {
        double gradient[3][12] = {{0}};
        for (int k = 0; k < 3; k++) {
            rey_scene *scene;
            s.integrator = integrators[k];
            s.light = torch;
            stage_load(&s, m ? "-1.1,0,4.85" : "5,0,1.6", m ? "0 0 1" : "-0.3 0 1", m ? map : "<bsdf type='diffuse'/>", false,
                       &scene);
            rey_render_def def = def_make(k < 2 ? 0 : REY_TERM_INTERIOR);
            def.spp = 256;
            int param = rey_param_find(scene, m ? "map.normalmap.value" : "plane.normals");
            if (rey_vjp(scene, &def, (rey_selection){&param, 1}, adjoint, gradient[k], NULL, NULL) != REY_OK) {
                fail_msg("%s", rey_error(s.ctx));
            }
            rey_scene_destroy(scene);
        }
        print_message("whole %.4g, interior %.4g\n", gradient[0][0], gradient[2][0]);
        assert_memory_equal(gradient[0], gradient[1], sizeof gradient[0]);
        assert_true(fabs(gradient[0][0] - gradient[2][0]) > 0.01 * fabs(gradient[0][0]));
    }
}

// Normals of maps that point into their surface are mirrored, and jump once more where they face away again.
static void test_inward_maps(void **state) {
    const Stage *s = *state;
    static const char *const maps[] = {"0.9,0.5,0.6", "0.9,0.5,0.4"};
    for (int i = 0; i < 4; i++) {
        char bsdf[256];
        rey_scene *scene;
        int missing;
        snprintf(bsdf, sizeof bsdf, "<bsdf type='normalmap' id='map'><rgb name='normalmap' value='%s'/>"
                 "<boolean name='flip_invalid_normals' value='%s'/><bsdf type='diffuse'/></bsdf>", maps[i % 2],
                 i < 2 ? "true" : "false");
        stage_load(s, "1,0,5", "0 0 1", bsdf, false, &scene);
        assert_int_equal(derive(s, scene, "map.normalmap.value", REY_TERM_INTERIOR, &missing), REY_OK);
        rey_result whole = derive(s, scene, "map.normalmap.value", 0, &missing);
        assert_int_equal(whole, i == 1 ? REY_ERROR_INCOMPLETE : REY_OK);
        assert_true(whole == REY_OK || strstr(rey_error(s->ctx), "point into their surfaces"));
        rey_scene_destroy(scene);
    }
}

// Maps without shadowing cut light off at the plane of the surface: what is not known of that is refused by name.
static void test_cut_off(void **state) {
    const Stage *s = *state;
    static const char cut[] = "<bsdf type='normalmap' id='map'><boolean name='use_shadowing_function' value='%s'/>"
                              "<rgb name='normalmap' value='0.6,0.5,1'/>%s</bsdf>";
    static const char paint[] = "<bsdf type='diffuse' id='paint'/>";
    static const struct {
        const char *outer, *inner, *param, *why; // inner: of a map within the first one, or null
    } cases[] = {{"false", NULL, "plane.positions", "along a curve"}, {"false", NULL, "plane.normals", "along a curve"},
                 {"false", NULL, "camera.to_world", "along a curve"}, {"false", NULL, "bulb.position", "along a curve"},
                 {"true", "false", "map.normalmap.value", "another map's"}, {"true", "false", "plane.positions", "another map's"},
                 {"true", "true", "bulb.position", NULL}, {"true", NULL, "plane.positions", NULL},
                 {"false", NULL, "map.normalmap.value", NULL}, {"false", "true", "map.normalmap.value", NULL},
                 {"false", NULL, "paint.reflectance.value", NULL}};
    for (int i = 0; i < COUNT_OF(cases); i++) {
        rey_scene *scene;
        char inner[512], bsdf[1024];
        static float image[NUMBERS], tangent[64] = {1};
        snprintf(inner, sizeof inner, cut, cases[i].inner ? cases[i].inner : "", paint);
        char *id = strstr(inner, "id='map'");
        memcpy(id, "id='mop'", 8);
        snprintf(bsdf, sizeof bsdf, cut, cases[i].outer, cases[i].inner ? inner : paint);
        stage_load(s, "0,0,5", "0.1 0 1", bsdf, false, &scene);
        rey_render_def def = def_make(0);
        int param = rey_param_find(scene, cases[i].param);
        assert_true(param >= 0);
        rey_result result = rey_jvp(scene, &def, (rey_selection){&param, 1}, tangent, image, NULL, NULL);
        if (result != (cases[i].why ? REY_ERROR_INCOMPLETE : REY_OK)) {
            fail_msg("case %d: %s: %s", i, rey_result_text(result), rey_error(s->ctx));
        }
        assert_true(!cases[i].why || strstr(rey_error(s->ctx), cases[i].why));
        def.terms = REY_TERM_INTERIOR;
        assert_int_equal(rey_jvp(scene, &def, (rey_selection){&param, 1}, tangent, image, NULL, NULL), REY_OK);
        rey_scene_destroy(scene);
    }
}

// Along the recorded paths light scales with the reflectance exactly, and roughness gives what fresh paths give.
static void test_replay(void **state) {
    const Stage *s = *state;
    static float same[NUMBERS], brighter[NUMBERS], fresh[NUMBERS], replayed[NUMBERS];
    static const char rough[] = "<bsdf type='roughconductor' id='paint'><float name='alpha' value='0.4'/>"
                                "<rgb name='specular_reflectance' value='0.4,0.3,0.2'/></bsdf>";
    rey_scene *scene, *moved;
    stage_load(s, "0,-3,5", "0 0 1", rough, false, &scene);
    stage_load(s, "0,-3,5", "0 0 1", rough, false, &moved);
    rey_render_def def = def_make(0);
    def.spp = 256;
    int colour = rey_param_find(moved, "paint.specular_reflectance.value"), alpha = rey_param_find(moved, "paint.alpha.value");
    assert_true(colour >= 0 && alpha >= 0);
    const float bright[] = {0.8F, 0.6F, 0.4F}, dim[] = {0.4F, 0.3F, 0.2F}, other_alpha = 0.45F;
    assert_int_equal(rey_replay(scene, moved, &def, same, NULL), REY_OK);
    assert_int_equal(rey_param_set(moved, colour, bright, 3), REY_OK);
    assert_int_equal(rey_replay(scene, moved, &def, brighter, NULL), REY_OK);
    assert_int_equal(rey_param_set(moved, colour, dim, 3), REY_OK);
    assert_int_equal(rey_param_set(moved, alpha, &other_alpha, 1), REY_OK);
    assert_int_equal(rey_replay(scene, moved, &def, replayed, NULL), REY_OK);
    assert_int_equal(rey_render(moved, &def, fresh, NULL), REY_OK);
    double changed = 0, sum = 0, fresh_sum = 0, replayed_sum = 0;
    for (int i = 0; i < NUMBERS; i++) {
        assert_true(fabsf(brighter[i] - 2 * same[i]) <= 1e-5F * brighter[i]);
        changed += fabs((double)replayed[i] - (double)same[i]);
        sum += (double)same[i];
        fresh_sum += (double)fresh[i];
        replayed_sum += (double)replayed[i];
    }
    assert_true(sum > 0 && changed > 1e-3 * sum);
    assert_true(fabs(replayed_sum - fresh_sum) < 3e-3 * fresh_sum);
    rey_scene_destroy(scene);
    rey_scene_destroy(moved);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_turned_normals), cmocka_unit_test(test_normals_of_lights),
                                       cmocka_unit_test(test_other_parameters), cmocka_unit_test(test_cut_off),
                                       cmocka_unit_test(test_particles_look), cmocka_unit_test(test_particles_turn),
                                       cmocka_unit_test(test_particles_see_turns), cmocka_unit_test(test_inward_maps),
                                       cmocka_unit_test(test_replay)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
