// Light tracing against the path tracer: every kind of light, scattering that refracts, shading normals, filters, crops,
// both sensors, hidden lights, depths; and the same bits for any number of threads.
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

enum { SIZE = 12, NUMBERS = SIZE * SIZE * 3, SEEDS = 6, ACROSS = 2, BLOCKS = ACROSS * ACROSS * 3 };

#define PERSPECTIVE                                                                                                    \
    "<sensor type='perspective'><float name='fov' value='45'/><float name='principal_point_offset_x' value='0.1'/>"    \
    "<transform name='to_world'><lookat origin='0.5, 3, 4' target='0, 0.3, 0' up='0, 1, 0'/></transform>"
#define ORTHOGRAPHIC                                                                                                   \
    "<sensor type='orthographic'><transform name='to_world'><scale x='2' y='2'/>"                                      \
    "<lookat origin='0.5, 3, 4' target='0, 0.3, 0' up='0, 1, 0'/></transform>"
#define THINLENS                                                                                                       \
    "<sensor type='thinlens'><float name='fov' value='45'/><float name='aperture_radius' value='0.4'/>"                \
    "<float name='focus_distance' value='4'/>"                                                                         \
    "<transform name='to_world'><lookat origin='0.5, 3, 4' target='0, 0.3, 0' up='0, 1, 0'/></transform>"
#define BOX_FILM                                                                                                       \
    "<film type='hdrfilm'><integer name='width' value='12'/><integer name='height' value='12'/><rfilter type='box'/>"  \
    "</film></sensor>"
#define BATCH "<sensor type='batch'>" PERSPECTIVE BOX_FILM THINLENS BOX_FILM BOX_FILM
#define METER                                                                                                          \
    "<shape type='rectangle'><transform name='to_world'><rotate x='1' angle='40'/><scale value='0.8'/>"                \
    "<translate x='0.2' y='1.2' z='1.5'/></transform><bsdf type='diffuse'/><sensor type='irradiancemeter'>" BOX_FILM "</shape>"
#define CROPPED_FILM                                                                                                   \
    "<film type='hdrfilm'><integer name='width' value='20'/><integer name='height' value='16'/>"                       \
    "<integer name='crop_offset_x' value='5'/><integer name='crop_offset_y' value='2'/>"                               \
    "<integer name='crop_width' value='12'/><integer name='crop_height' value='12'/><rfilter type='gaussian'/></film>" \
    "</sensor>"
#define FLOOR                                                                                                          \
    "<shape type='rectangle'><transform name='to_world'><rotate x='1' angle='-90'/><scale value='3'/></transform>"     \
    "<bsdf type='twosided'><bsdf type='diffuse'><texture name='reflectance' type='checkerboard'/></bsdf></bsdf></shape>"
#define BALL                                                                                                           \
    "<shape type='sphere'><point name='center' x='-0.6' y='0.6' z='0.3'/><float name='radius' value='0.6'/>"          \
    "<bsdf type='roughplastic'><float name='alpha' value='0.3'/></bsdf></shape>"
#define CUBE                                                                                                           \
    "<shape type='cube'><transform name='to_world'><scale value='0.4'/><rotate y='1' angle='30'/>"                     \
    "<translate x='0.9' y='0.4' z='0.6'/></transform><bsdf type='twosided'><bsdf type='roughconductor'>"               \
    "<float name='alpha' value='0.4'/></bsdf></bsdf></shape>"
#define BUBBLE                                                                                                         \
    "<shape type='sphere'><point name='center' x='0.2' y='0.8' z='-0.2'/><float name='radius' value='0.7'/>"          \
    "<bsdf type='roughdielectric'><float name='alpha' value='0.4'/></bsdf></shape>"
#define GLASS                                                                                                          \
    "<shape type='sphere'><point name='center' x='0' y='4.2' z='0'/><float name='radius' value='0.8'/>"               \
    "<bsdf type='dielectric'/></shape>"
#define LAMP                                                                                                           \
    "<shape type='rectangle'><transform name='to_world'><rotate x='1' angle='90'/><scale value='0.8'/>"               \
    "<translate x='0.5' y='2'/></transform><emitter type='area'><rgb name='radiance' value='4 3 2'/></emitter></shape>"

typedef struct Case {
    const char *name, *sensor, *shapes, *lights;
    int spp;
} Case;

static const Case cases[] = {
    {"area", PERSPECTIVE BOX_FILM, FLOOR BALL CUBE, LAMP, 256},
    {"area, cropped and filtered", PERSPECTIVE CROPPED_FILM, FLOOR BALL CUBE, LAMP, 256},
    {"area, orthographic", ORTHOGRAPHIC BOX_FILM, FLOOR BALL CUBE, LAMP, 256},
    {"textured sphere, refraction", PERSPECTIVE BOX_FILM, FLOOR BUBBLE,
     "<shape type='sphere'><point name='center' x='0.6' y='1.6' z='1'/><float name='radius' value='0.3'/>"
     "<emitter type='area'><texture name='radiance' type='checkerboard'><rgb name='color0' value='9 2 2'/>"
     "<rgb name='color1' value='1 5 9'/></texture></emitter></shape>",
     512},
    {"disk behind smooth glass", PERSPECTIVE BOX_FILM, FLOOR BALL GLASS,
     "<shape type='disk'><transform name='to_world'><rotate x='1' angle='90'/><scale value='1.5'/><translate y='6'/>"
     "</transform><emitter type='area'><rgb name='radiance' value='4 3 2'/></emitter></shape>",
     512},
    {"cylinder", PERSPECTIVE BOX_FILM, FLOOR BALL,
     "<shape type='cylinder'><point name='p0' x='0' y='1' z='1'/><point name='p1' x='1' y='1.5' z='1'/>"
     "<float name='radius' value='0.2'/><emitter type='area'><rgb name='radiance' value='4 3 2'/></emitter></shape>",
     256},
    {"point", PERSPECTIVE BOX_FILM, FLOOR BALL CUBE,
     "<emitter type='point'><point name='position' x='0.3' y='2' z='1'/><rgb name='intensity' value='5 4 3'/></emitter>", 256},
    {"spot", PERSPECTIVE BOX_FILM, FLOOR BALL CUBE,
     "<emitter type='spot'><transform name='to_world'><lookat origin='0.3, 3, 1' target='0, 0, 0' up='0, 0, 1'/>"
     "</transform><rgb name='intensity' value='9 8 7'/><float name='cutoff_angle' value='30'/></emitter>",
     256},
    {"projector", PERSPECTIVE BOX_FILM, FLOOR BALL CUBE,
     "<emitter type='projector'><transform name='to_world'><lookat origin='0.3, 3, 1' target='0, 0, 0' up='0, 0, 1'/>"
     "</transform><float name='fov' value='40'/><rgb name='irradiance' value='3 2 1'/></emitter>",
     256},
    {"directional", PERSPECTIVE BOX_FILM, FLOOR BALL CUBE,
     "<emitter type='directional'><vector name='direction' x='0.3' y='-1' z='-0.4'/><rgb name='irradiance' value='3 2 1'/>"
     "</emitter>",
     256},
    {"area, thin lens", THINLENS BOX_FILM, FLOOR BALL CUBE, LAMP, 256},
    {"area, batch", BATCH, FLOOR BALL CUBE, LAMP, 256},
    {"area, irradiance", "", FLOOR METER BALL CUBE, LAMP, 256},
    {"constant and point", PERSPECTIVE BOX_FILM, FLOOR BALL CUBE,
     "<emitter type='constant'><rgb name='radiance' value='0.5 0.7 1'/></emitter>"
     "<emitter type='point'><point name='position' x='0.3' y='2' z='1'/><rgb name='intensity' value='5 4 3'/></emitter>",
     512},
};

static char path[64];

static rey_scene *load(rey_context *ctx, const char *integrator, const char *options, const Case *c) {
    rey_scene *scene = NULL;
    snprintf(path, sizeof path, "/tmp/reynolds_particles_%ld.xml", (long)getpid());
    FILE *f = fopen(path, "w");
    assert_non_null(f);
    fprintf(f, "<scene version='3.0.0'><integrator type='%s'>%s</integrator>%s%s%s</scene>", integrator, options, c->sensor,
            c->shapes, c->lights);
    assert_int_equal(fclose(f), 0);
    rey_result result = rey_scene_load(ctx, path, NULL, 0, &scene);
    unlink(path);
    if (result) {
        fail_msg("%s: %s", c->name, rey_error(ctx));
    }
    return scene;
}

// Per block and channel: the mean over seeds, and its standard error.
typedef struct Blocks {
    double mean[BLOCKS], error[BLOCKS];
} Blocks;

static Blocks render(const char *integrator, const char *options, const Case *c) {
    static float image[NUMBERS];
    Blocks b = {{0}, {0}};
    double squares[BLOCKS] = {0};
    rey_context *ctx;
    assert_int_equal(rey_context_create(NULL, &ctx), REY_OK);
    rey_scene *scene = load(ctx, integrator, options, c);
    for (int seed = 0; seed < SEEDS; seed++) {
        rey_render_def def = rey_default_render_def();
        rey_stats stats;
        double sums[BLOCKS] = {0};
        def.spp = c->spp;
        def.seed = (uint32_t)seed;
        if (rey_render(scene, &def, image, &stats)) {
            fail_msg("%s: %s", c->name, rey_error(ctx));
        }
        assert_int_equal(stats.nonfinite, 0);
        for (int i = 0; i < NUMBERS; i++) {
            int x = i / 3 % SIZE * ACROSS / SIZE, y = i / 3 / SIZE * ACROSS / SIZE;
            sums[(y * ACROSS + x) * 3 + i % 3] += (double)image[i] * ACROSS * ACROSS / (SIZE * SIZE);
        }
        for (int i = 0; i < BLOCKS; i++) {
            b.mean[i] += sums[i] / SEEDS;
            squares[i] += sums[i] * sums[i] / SEEDS;
        }
    }
    for (int i = 0; i < BLOCKS; i++) {
        b.error[i] = sqrt(fmax(0, squares[i] - b.mean[i] * b.mean[i]) / (SEEDS - 1));
    }
    rey_scene_destroy(scene);
    rey_context_destroy(ctx);
    return b;
}

static void same_picture(const char *name, const Blocks *a, const Blocks *b) {
    double worst = 0, square = 0, sum = 0;
    for (int i = 0; i < BLOCKS; i++) {
        // Quasi-random points of six seeds: errors of less than 0.2 % are not told apart.
        double error = hypot(hypot(a->error[i], b->error[i]), 1e-3 * fabs(a->mean[i]) + 1e-9);
        double z = (a->mean[i] - b->mean[i]) / error;
        worst = fmax(worst, fabs(z));
        square += z * z / BLOCKS;
        sum += a->mean[i] / BLOCKS;
    }
    print_message("%s: mean %.4f, worst z %.2f, mean square %.2f\n", name, sum, worst, square);
    assert_true(sum > 0.01);
    assert_true(worst < 6 && square < 4);
}

static void test_lights(void **state) {
    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        Blocks a = render("path", "", &cases[i]), b = render("ptracer", "", &cases[i]);
        same_picture(cases[i].name, &a, &b);
    }
}

static void test_depths(void **state) {
    (void)state;
    static const char *const options[] = {
        "<integer name='max_depth' value='1'/>", "<integer name='max_depth' value='2'/>",
        "<integer name='max_depth' value='3'/>",
        "<integer name='max_depth' value='4'/><boolean name='hide_emitters' value='true'/>",
        "<integer name='max_depth' value='0'/>"};
    for (size_t i = 0; i < sizeof options / sizeof *options; i++) {
        Blocks a = render("path", options[i], &cases[3]), b = render("ptracer", options[i], &cases[3]);
        if (i == 4) {
            assert_memory_equal(a.mean, b.mean, sizeof a.mean);
        } else {
            same_picture(options[i], &a, &b);
        }
    }
}

// A beam along the normal, which paths from the camera cannot find: its flux arrives on the floor.
static void test_beam(void **state) {
    (void)state;
    static const Case beam = {"beam", ORTHOGRAPHIC BOX_FILM,
                              "<shape type='rectangle'><transform name='to_world'><rotate x='1' angle='-90'/>"
                              "<scale value='30'/></transform></shape>",
                              "<shape type='rectangle'><transform name='to_world'><rotate x='1' angle='90'/>"
                              "<scale value='6'/><translate y='5'/></transform><emitter type='directionalarea'>"
                              "<rgb name='radiance' value='3 2 1'/></emitter></shape>",
                              512};
    Blocks b = render("ptracer", "<integer name='max_depth' value='2'/>", &beam);
    for (int i = 0; i < BLOCKS; i++) {
        double expected = (3 - i % 3) * 0.5 / 3.14159265358979;
        assert_true(fabs(b.mean[i] - expected) < 0.04 * expected);
    }
}

static void test_threads(void **state) {
    (void)state;
    static float images[3][NUMBERS];
    static const int threads[] = {1, 2, 7};
    for (int k = 0; k < 3; k++) {
        rey_context_def context = rey_default_context_def();
        rey_render_def def = rey_default_render_def();
        rey_context *ctx;
        context.threads = threads[k];
        assert_int_equal(rey_context_create(&context, &ctx), REY_OK);
        rey_scene *scene = load(ctx, "ptracer", "", &cases[1]);
        def.spp = 16;
        assert_int_equal(rey_render(scene, &def, images[k], NULL), REY_OK);
        rey_scene_destroy(scene);
        rey_context_destroy(ctx);
        assert_memory_equal(images[0], images[k], sizeof images[0]);
    }
}

// A sensor with a single direction has no point to connect to.
static void test_refusal(void **state) {
    (void)state;
    static const Case ray = {"ray",
                             "<sensor type='radiancemeter'><film type='hdrfilm'><integer name='width' value='1'/>"
                             "<integer name='height' value='1'/><rfilter type='box'/></film></sensor>",
                             FLOOR, LAMP, 1};
    static float image[NUMBERS];
    rey_context *ctx;
    rey_render_def def = rey_default_render_def();
    assert_int_equal(rey_context_create(NULL, &ctx), REY_OK);
    rey_scene *scene = load(ctx, "ptracer", "", &ray);
    assert_int_equal(rey_render(scene, &def, image, NULL), REY_ERROR_UNSUPPORTED);
    assert_non_null(strstr(rey_error(ctx), "'radiancemeter'"));
    rey_scene_destroy(scene);
    rey_context_destroy(ctx);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_lights), cmocka_unit_test(test_depths), cmocka_unit_test(test_beam),
                                       cmocka_unit_test(test_threads), cmocka_unit_test(test_refusal)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
