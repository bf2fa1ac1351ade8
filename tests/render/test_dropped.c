// What `path` drops with hidden emitters, and what of its derivative is refused. test_differences dropped.xml has the rest.
#include "reynolds/reynolds.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

enum { PIXELS = 4 * 4, NUMBERS = PIXELS * 3 };

#define SKY "<emitter type='constant'/>"
#define BULB "<emitter type='point'><point name='position' x='0' y='0' z='-2'/></emitter>"
#define NEXT_WALL(z)                                                                                                   \
    "</shape><shape type='rectangle'><transform name='to_world'><scale value='50'/><rotate y='1' angle='180'/>"            \
    "<translate z='" z "'/></transform>"

typedef struct Wall {
    rey_context *ctx;
    rey_scene *scene;
} Wall;

// A wall under lights before a camera of 4 x 4 pixels. With further walls behind it, roulette plays from the first vertex on.
static Wall wall_open(const char *integrator, const char *lights, const char *function) {
    char path[64];
    Wall wall;
    snprintf(path, sizeof path, "/tmp/reynolds_dropped_%ld.xml", (long)getpid());
    FILE *f = fopen(path, "w");
    assert_non_null(f);
    fprintf(f,
            "<scene version='3.0.0'><integrator type='%s'><boolean name='hide_emitters' value='true'/>"
            "%s</integrator><sensor type='perspective'><film type='hdrfilm'><integer name='width' value='4'/>"
            "<integer name='height' value='4'/></film></sensor>%s"
            "<shape type='rectangle' id='wall'><transform name='to_world'><scale value='50'/><rotate y='1' angle='180'/>"
            "<translate z='3'/></transform>%s</shape></scene>",
            integrator, strstr(function, NEXT_WALL("4")) ? "<integer name='rr_depth' value='1'/>" : "", lights, function);
    assert_int_equal(fclose(f), 0);
    assert_int_equal(rey_context_create(NULL, &wall.ctx), REY_OK);
    if (rey_scene_load(wall.ctx, path, NULL, 0, &wall.scene) != REY_OK) {
        fail_msg("%s", rey_error(wall.ctx));
    }
    unlink(path);
    return wall;
}

static void wall_close(Wall wall) {
    rey_scene_destroy(wall.scene);
    rey_context_destroy(wall.ctx);
}

static void near(const char *what, double found, double expected, double tolerance) {
    if (!(fabs(found - expected) <= tolerance)) {
        fail_msg("%s: %g, expected %g", what, found, expected);
    }
}

// The mean of the picture, and its derivatives by numbers of a parameter that all move alike; reverse mode agrees.
static double slope_of(Wall wall, const char *name, int count, int spp, double *mean) {
    const float ones[3] = {1, 1, 1};
    float image[NUMBERS], derivative[NUMBERS];
    double gradient[3], product = 0, sum = 0, slope = 0;
    rey_render_def def = rey_default_render_def();
    def.spp = spp;
    int param = rey_param_find(wall.scene, name);
    const rey_selection selection = {&param, 1};
    assert_true(param >= 0);
    assert_int_equal(rey_render(wall.scene, &def, image, NULL), REY_OK);
    assert_int_equal(rey_jvp(wall.scene, &def, selection, ones, derivative, NULL, NULL), REY_OK);
    assert_int_equal(rey_vjp(wall.scene, &def, selection, derivative, gradient, NULL, NULL), REY_OK);
    *mean = 0;
    for (int k = 0; k < NUMBERS; k++) {
        *mean += (double)image[k] / NUMBERS;
        slope += (double)derivative[k] / NUMBERS;
        sum += (double)derivative[k] * (double)derivative[k];
    }
    for (int k = 0; k < count; k++) {
        product += gradient[k];
    }
    near(name, product, sum, 1e-4 * sum);
    return slope;
}

#define NET(opacity) "<bsdf type='mask' id='net'><float name='opacity' value='" opacity "'/><bsdf type='diffuse' id='grey'/></bsdf>"

// `path` drops what a path brought that met only surfaces that let it pass, as the format's renderer does: 0.702 of the light
// of a mask of opacity 0.4 under a sky remains there. `volpath` drops nothing, and `direct` shows the sky behind. As far as
// light from the mask goes, pictures are proportional to its reflectance.
static void test_light(void **state) {
    static const char *const names[] = {"path", "volpath", "direct", "path"};
    double mean[4], slope[4];
    (void)state;
    for (int i = 0; i < 4; i++) {
        Wall wall = wall_open(names[i], SKY, i < 3 ? NET("0.4") : NET("1"));
        slope[i] = 0.5 * slope_of(wall, "grey.reflectance.value", 3, 4096, mean + i);
        wall_close(wall);
    }
    near("volpath", mean[1], 0.2, 0.002);
    near("path", mean[0] / mean[1], 0.702, 0.005);
    near("direct", mean[2], 0.8, 0.005);
    near("slope of path", slope[0] / mean[0], 1, 0.01);
    near("slope of volpath", slope[1], 0.2, 0.002);
    near("slope of direct", slope[2], 0.2, 0.002);
    near("slope of path, closed", slope[3], 0.5, 0.005);
}

// Under a bulb alone a mask brings o^2: what it reflects, as often as it is kept. Under a sky what scattered rays meet is
// always kept: f (o w + 1 - w), with w = a^2 / (a^2 + s^2), a = 1 / (4 pi) and s = o cos / pi, summed over directions below.
static void test_opacity(void **state) {
    static const char *const opacities[] = {"0", "0.3", "0.99", "1"};
    (void)state;
    for (int i = 0; i < 4; i++) {
        const double o = (double)(i == 1 ? 0.3 : i == 2 ? 0.99 : i == 3), pi = acos(-1);
        char function[256];
        double mean, again;
        snprintf(function, sizeof function, NET("%s"), opacities[i]);
        Wall bulb = wall_open("path", BULB, function), sky = wall_open("path", SKY, function);
        Wall closed = wall_open("path", BULB, NET("1"));
        double full, expected = 0, slope = 0;
        slope_of(closed, "grey.reflectance.value", 3, 4096, &full);
        near("under a bulb", slope_of(bulb, "net.opacity.value", 1, 4096, &mean), 2 * o * full, 0.01 * full);
        near("under a bulb, mean", mean, o * o * full, 0.01 * full);
        enum { STEPS = 2000 };
        for (int k = 0; k < STEPS; k++) {
            double z = (k + 0.5) / STEPS, a = 1 / (4 * pi), s = o * z / pi, w = a * a / (a * a + s * s);
            double dw = -2 * a * a * s * z / pi / ((a * a + s * s) * (a * a + s * s));
            expected += z / STEPS * o * (o * w + 1 - w);
            slope += z / STEPS * (o * w + 1 - w + o * w + o * (o - 1) * dw);
        }
        near("under a sky", slope_of(sky, "net.opacity.value", 1, 4096, &again), slope, 0.02);
        near("under a sky, mean", again, expected, 0.01);
        wall_close(bulb);
        wall_close(sky);
        wall_close(closed);
    }
}

// Three nets and a wall behind each other, the first one lit: of what it reflects, o A, as much is kept as paths scatter later on,
// K_k = o + (1 - o) 0.95 K_(k+1), where roulette takes a twentieth at each vertex.
static void test_stack(void **state) {
    static const char *const opacities[] = {"0.02", "0.3", "0.98"};
    double full;
    (void)state;
    Wall closed = wall_open("path", BULB, NET("1"));
    slope_of(closed, "grey.reflectance.value", 3, 4096, &full);
    wall_close(closed);
    for (int i = 0; i < 3; i++) {
        double o = i == 0 ? 0.02 : i == 1 ? 0.3 : 0.98, kept = 1, dkept = 0, mean;
        char function[2048];
        snprintf(function, sizeof function, NET("%s") NEXT_WALL("4") "<ref id='net'/>" NEXT_WALL("5") "<ref id='net'/>"
                 NEXT_WALL("6") "<bsdf type='diffuse'/>", opacities[i]);
        for (int k = 0; k < 3; k++) {
            dkept = 1 - 0.95 * kept + (1 - o) * 0.95 * dkept;
            kept = o + (1 - o) * 0.95 * kept;
        }
        Wall wall = wall_open("path", BULB, function);
        near("stack", slope_of(wall, "net.opacity.value", 1, 65536, &mean), full * (kept + o * dkept), 0.02 * full);
        near("stack, mean", mean, full * o * kept, 0.01 * full);
        wall_close(wall);
    }
}

// The derivative of the mean by one number of a parameter against differences of pictures.
static void density_agrees(const char *lights, const char *function, const char *name, int number, float step, double least) {
    Wall wall = wall_open("path", lights, function);
    static float tangent[256], image[NUMBERS];
    float values[256];
    rey_render_def def = rey_default_render_def();
    def.spp = 1 << 16;
    int param = rey_param_find(wall.scene, name);
    const rey_selection selection = {&param, 1};
    assert_true(param >= 0);
    rey_param_info info;
    assert_int_equal(rey_param_get_info(wall.scene, param, &info), REY_OK);
    memcpy(values, rey_param_values(wall.scene, param), (size_t)info.count * sizeof *values);
    memset(tangent, 0, sizeof tangent);
    tangent[number] = 1;
    def.terms = REY_TERM_INTERIOR;
    double slope = 0, difference = 0;
    if (rey_jvp(wall.scene, &def, selection, tangent, image, NULL, NULL) != REY_OK) {
        fail_msg("%s", rey_error(wall.ctx));
    }
    for (int k = 0; k < NUMBERS; k++) {
        slope += (double)image[k] / NUMBERS;
    }
    static const struct {
        float at;
        double weight;
    } rule[4] = {{-2, 1.0 / 12}, {-1, -8.0 / 12}, {1, 8.0 / 12}, {2, -1.0 / 12}};
    const float start = values[number];
    for (int i = 0; i < 4; i++) {
        values[number] = start + rule[i].at * step;
        assert_int_equal(rey_param_set(wall.scene, param, values, info.count), REY_OK);
        assert_int_equal(rey_render(wall.scene, &def, image, NULL), REY_OK);
        for (int k = 0; k < NUMBERS; k++) {
            difference += rule[i].weight * (double)image[k] / NUMBERS / (double)step;
        }
    }
    if (getenv("REYNOLDS_TEST_VERBOSE")) {
        print_message("%-40s %.5f, differences %.5f\n", name, slope, difference);
    }
    assert_true(fabs(difference) > 10 * least);
    near(name, slope, difference, least);
    wall_close(wall);
}

// The weights of MIS, on which the picture depends here, follow what decides the densities: directions, colours of coats,
// turned normals.
static void test_densities(void **state) {
#define HOLED(function) "<bsdf type='mask' id='net'><float name='opacity' value='0.3'/>" function "</bsdf>"
    (void)state;
    density_agrees(SKY, HOLED("<bsdf type='roughconductor' id='in'><float name='alpha' value='0.3'/></bsdf>"), "in.alpha.value", 0,
                   0.02f, 0.004);
    density_agrees(SKY, HOLED("<bsdf type='roughplastic' id='in'><float name='alpha' value='0.2'/></bsdf>"), "in.alpha.value", 0,
                   0.02f, 0.002);
    density_agrees(SKY, HOLED("<bsdf type='plastic' id='in'/>"), "in.diffuse_reflectance.value", 0, 0.05f, 0.002);
    density_agrees(SKY, HOLED("<bsdf type='normalmap' id='map'><rgb name='normalmap' value='0.7, 0.5, 0.8'/>"
                              "<bsdf type='roughconductor'><float name='alpha' value='0.3'/></bsdf></bsdf>"),
                   "map.normalmap.value", 0, 0.02f, 0.005);
}

#define HILL(angle)                                                                                                    \
    "</shape><shape type='obj' id='hill'><string name='filename' value='" RENDER_DIR "/hill.obj'/><transform name='to_world'>"  \
    "<rotate y='1' angle='" angle "'/><translate z='2.5'/></transform><bsdf type='twosided'><bsdf type='diffuse'/></bsdf>"

// What thin glass lets pass and what moves is refused, and vertex normals where they turn away from the camera.
static void test_refusals(void **state) {
#define METAL "<bsdf type='roughconductor' id='metal'><float name='alpha' value='0.3'/></bsdf>"
    static const struct {
        const char *lights, *function, *param;
        rey_result expected;
    } rows[] = {{SKY, "<bsdf type='mask'>" METAL "</bsdf>", "metal.alpha.value", REY_OK},
                {SKY, "<bsdf type='mask'>" METAL "</bsdf>", "metal.eta.value", REY_OK},
                {SKY, "<bsdf type='mask'>" METAL "</bsdf>", "metal.specular_reflectance.value", REY_OK},
                {BULB, "<bsdf type='mask'>" METAL "</bsdf>", "metal.alpha.value", REY_OK},
                {SKY, METAL, "metal.alpha.value", REY_OK},
                {SKY, NET("0.5") HILL("180"), "hill.normals", REY_OK},
                {SKY, NET("0.5") HILL("268"), "hill.normals", REY_ERROR_INCOMPLETE},
                {SKY, NET("0.5"), "wall.to_world", REY_ERROR_INCOMPLETE},
                {SKY, "<bsdf type='mask' id='net'><float name='opacity' value='0.5'/><bsdf type='thindielectric'/></bsdf>",
                 "net.opacity.value", REY_ERROR_INCOMPLETE},
                {SKY, "<bsdf type='blendbsdf' id='mix'><float name='weight' value='0.5'/><bsdf type='null'/><bsdf type='plastic' "
                      "id='coat'/></bsdf>", "coat.diffuse_reflectance.value", REY_OK},
                {SKY, "<bsdf type='blendbsdf' id='mix'><float name='weight' value='0.5'/><bsdf type='null'/><bsdf type='plastic' "
                      "id='coat'/></bsdf>", "mix.weight.value", REY_OK}};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        Wall wall = wall_open("path", rows[i].lights, rows[i].function);
        float image[NUMBERS] = {0};
        double gradient[64];
        rey_render_def def = rey_default_render_def();
        def.spp = 16;
        int param = rey_param_find(wall.scene, rows[i].param);
        const rey_selection selection = {&param, 1};
        assert_true(param >= 0);
        assert_int_equal(rey_vjp(wall.scene, &def, selection, image, gradient, NULL, NULL), rows[i].expected);
        const char *words = strstr(rows[i].param, "normals") ? "shading normals" : "hide_emitters";
        assert_true(rows[i].expected == REY_OK || strstr(rey_error(wall.ctx), words));
        wall_close(wall);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_light), cmocka_unit_test(test_opacity), cmocka_unit_test(test_stack),
                                       cmocka_unit_test(test_densities), cmocka_unit_test(test_refusals)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
