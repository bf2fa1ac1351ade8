// Every kind of sensor against what it must see, against the pinhole camera, and through a save.
#include "../folder.h"
#include "base/context.h"
#include "reynolds/reynolds.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

enum { PINHOLE, LENS, PLAN, METER, POINT_AFAR, SHAPE_AFAR, SCENE_AFAR, BATCH, IRRADIANCE, SENSORS };
enum { SIZE = 24, MOST = 2 * SIZE * SIZE * 3, SPP = 4096 };

typedef struct Fixture {
    rey_context *ctx;
    rey_scene *scene;
} Fixture;

static int set_up(void **state) {
    Fixture *f = calloc(1, sizeof *f);
    *state = f;
    return !f || rey_context_create(NULL, &f->ctx) || rey_scene_load(f->ctx, RENDER_DIR "/sensors.xml", NULL, 0, &f->scene);
}

static int tear_down(void **state) {
    Fixture *f = *state;
    rey_scene_destroy(f->scene);
    rey_context_destroy(f->ctx);
    free(f);
    return 0;
}

static void render(rey_scene *scene, int sensor, int spp, float *image) {
    rey_render_def def = rey_default_render_def();
    def.sensor = sensor;
    def.spp = spp;
    assert_int_equal(rey_render(scene, &def, image, NULL), REY_OK);
}

// The ground under sun and sky: rho / pi times irradiance. The ball hides up to a percent of the sky.
static double ground(int channel) {
    static const double rho[] = {0.5, 0.6, 0.7}, sun[] = {0.3, 0.4, 0.5}, sky[] = {0.5, 0.4, 0.3};
    return rho[channel] * (0.8 * sun[channel] / 3.14159265358979323846 + sky[channel]);
}

static void expect(const char *what, const float *pixel, double scale, double tolerance) {
    for (int c = 0; c < 3; c++) {
        double expected = scale * ground(c);
        print_message("%s, channel %d: %.5f, expected %.5f\n", what, c, (double)pixel[c], expected);
        assert_true(fabs((double)pixel[c] / expected - 1) < tolerance);
    }
}

static void test_values(void **state) {
    Fixture *f = *state;
    static float image[MOST];
    static const double sky[] = {0.5, 0.4, 0.3};
    render(f->scene, METER, SPP, image);
    expect("radiancemeter", image, 1, 0.01);
    render(f->scene, POINT_AFAR, SPP, image);
    expect("distant, point", image, 1, 0.01);
    render(f->scene, SHAPE_AFAR, SPP, image);
    expect("distant, shape", image, 1, 0.01);
    render(f->scene, IRRADIANCE, SPP, image);
    for (int i = 0; i < 4 * 3; i++) {
        assert_true(fabs((double)image[i] / (3.14159265358979323846 * sky[i % 3]) - 1) < 0.002);
    }
}

// A scene's cross section seen from above: the square ground inside of the bounding sphere's disc, sky around it.
static void test_cross_section(void **state) {
    Fixture *f = *state;
    static const double sky[] = {0.5, 0.4, 0.3};
    float image[3];
    const double half[3] = {5, 5, 10}, ball = 3.14159265358979323846 * 0.36;
    double disc = 3.14159265358979323846 * (half[0] * half[0] + half[1] * half[1] + half[2] * half[2]), share = 100 / disc;
    render(f->scene, SCENE_AFAR, 1 << 16, image);
    for (int c = 0; c < 3; c++) {
        double expected = share * ground(c) + (1 - share) * sky[c];
        print_message("distant, scene: %.4f, expected about %.4f\n", (double)image[c], expected);
        assert_true(fabs((double)image[c] - expected) < 1.5 * ball / disc);
    }
}

static double difference(const float *a, const float *b, int n) {
    double sum = 0, size = 0;
    for (int i = 0; i < n; i++) {
        sum += fabs((double)(a[i] - b[i]));
        size += fabs((double)a[i]);
    }
    return sum / size;
}

static void test_lens(void **state) {
    Fixture *f = *state;
    static float sharp[MOST], blurred[MOST], tiny[MOST];
    int radius = rey_param_find(f->scene, "lens.aperture_radius");
    float small = 1e-6f, large = 0.3f;
    assert_true(radius >= 0);
    render(f->scene, PINHOLE, SPP, sharp);
    render(f->scene, LENS, SPP, blurred);
    assert_int_equal(rey_param_set(f->scene, radius, &small, 1), REY_OK);
    render(f->scene, LENS, SPP, tiny);
    assert_int_equal(rey_param_set(f->scene, radius, &large, 1), REY_OK);
    double far = difference(sharp, blurred, SIZE * SIZE * 3), near = difference(sharp, tiny, SIZE * SIZE * 3);
    print_message("a lens of no aperture differs from a pinhole by %.5f, an open one by %.5f\n", near, far);
    assert_true(near < 0.002 && far > 0.01);
}

static void test_batch(void **state) {
    Fixture *f = *state;
    static float batch[MOST], left[MOST], right[MOST];
    float *const images[] = {batch, left, right};
    const int sensors[] = {BATCH, PINHOLE, PLAN};
    rey_render_def def = rey_default_render_def();
    def.spp = SPP;
    assert_int_equal(rey_render_sensors(f->scene, &def, sensors, 3, images, NULL), REY_OK);
    double sum = 0;
    for (int y = 0; y < SIZE; y++) {
        sum += difference(left + y * SIZE * 3, batch + y * 2 * SIZE * 3, SIZE * 3) / (2 * SIZE);
        sum += difference(right + y * SIZE * 3, batch + (2 * y + 1) * SIZE * 3, SIZE * 3) / (2 * SIZE);
    }
    print_message("a batch differs from its sensors by %.5f\n", sum);
    assert_true(sum < 0.003);
    render(f->scene, PLAN, SPP, left);
    assert_memory_equal(left, right, SIZE * SIZE * 3 * sizeof(float)); // one call or several: the same bits
}

// The derivative by a number of one of a batch's sensors is that sensor's own, in its columns, and 0 in the others. interior only.
static void test_batch_moves(void **state) {
    Fixture *f = *state;
    static float batch[MOST], own[MOST], columns[MOST], nothing[SIZE * 3], adjoint[MOST];
    static const struct {
        const char *batch, *alone;
        int sensor, column, entry;
    } rows[] = {{"both.sensor_0.to_world", "pinhole.to_world", PINHOLE, 0, 3},
                {"both.sensor_1.to_world", "plan.to_world", PLAN, 1, 1},
                {"both.sensor_0.x_fov", "pinhole.x_fov", PINHOLE, 0, 0}};
    for (int i = 0; i < MOST; i++) {
        adjoint[i] = (float)(i % 7) - 2;
    }
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        float tangent[16] = {0};
        double gradient[16], forward = 0, size = 0;
        int part = rey_param_find(f->scene, rows[i].batch), whole = rey_param_find(f->scene, rows[i].alone);
        assert_true(part >= 0 && whole >= 0);
        rey_render_def def = rey_default_render_def();
        def.spp = SPP;
        def.terms = REY_TERM_INTERIOR;
        tangent[rows[i].entry] = 1;
        def.sensor = BATCH;
        assert_int_equal(rey_jvp(f->scene, &def, (rey_selection){&part, 1}, tangent, batch, NULL, NULL), REY_OK);
        assert_int_equal(rey_vjp(f->scene, &def, (rey_selection){&part, 1}, adjoint, gradient, NULL, NULL), REY_OK);
        def.sensor = rows[i].sensor;
        assert_int_equal(rey_jvp(f->scene, &def, (rey_selection){&whole, 1}, tangent, own, NULL, NULL), REY_OK);
        memset(nothing, 0, sizeof nothing);
        for (int y = 0; y < SIZE; y++) {
            const float *row = batch + y * 2 * SIZE * 3;
            memcpy(columns + y * SIZE * 3, row + rows[i].column * SIZE * 3, SIZE * 3 * sizeof *row);
            assert_memory_equal(row + (1 - rows[i].column) * SIZE * 3, nothing, SIZE * 3 * sizeof *row);
        }
        double found = difference(own, columns, SIZE * SIZE * 3);
        memcpy(columns, own, sizeof columns);
        def.seed = 1;
        assert_int_equal(rey_jvp(f->scene, &def, (rey_selection){&whole, 1}, tangent, own, NULL, NULL), REY_OK);
        double noise = difference(own, columns, SIZE * SIZE * 3);
        for (int k = 0; k < 2 * SIZE * SIZE * 3; k++) {
            forward += (double)batch[k] * (double)adjoint[k];
            size += fabs((double)batch[k] * (double)adjoint[k]);
        }
        print_message("%s differs by %.5f, of other seeds by %.5f\n", rows[i].batch, found, noise);
        assert_true(size > 0 && noise < 0.5 && found < 1.5 * noise && fabs(gradient[rows[i].entry] - forward) < 1e-5 * size);
    }
}

static void test_saved(void **state) {
    Fixture *f = *state;
    static float before[MOST], after[MOST];
    char folder[] = "/tmp/reynolds_sensors_XXXXXX", path[64];
    rey_scene *again;
    assert_true(folder_make(folder));
    snprintf(path, sizeof path, "%s/saved.xml", folder);
    assert_int_equal(rey_scene_save(f->scene, path), REY_OK);
    if (rey_scene_load(f->ctx, path, NULL, 0, &again)) {
        fail_msg("%s", rey_error(f->ctx));
    }
    assert_int_equal(rey_scene_sensor_count(again), SENSORS);
    for (int sensor = 0; sensor < SENSORS; sensor++) {
        int width, height;
        assert_int_equal(rey_scene_film_size(again, sensor, &width, &height), REY_OK);
        render(f->scene, sensor, 4, before);
        render(again, sensor, 4, after);
        assert_memory_equal(before, after, (size_t)(width * height * 3) * sizeof(float));
    }
    rey_scene_destroy(again);
    assert_int_equal(folder_remove(folder), 0);
}

#define CAMERA "<sensor type=\"perspective\"/>"
#define FIVE CAMERA CAMERA CAMERA CAMERA CAMERA

static void test_refused(void **state) {
    static const char *const cases[][2] = {
        {"<sensor type=\"thinlens\"/>", "needs its aperture_radius"},
        {"<sensor type=\"perspective\"><transform name=\"to_world\"><scale value=\"2\"/></transform></sensor>", "not scale"},
        {"<sensor type=\"distant\"/>", "expected 1 x 1"},
        {"<sensor type=\"irradiancemeter\"/>", "inside of a shape"},
        {"<sensor type=\"batch\"/>", "a batch without sensors, expected one or more"},
        {"<sensor type=\"batch\">" FIVE "</sensor>", "a batch of 5 sensors has a film 768 pixels wide, expected a multiple"},
        {"<sensor type=\"radiancemeter\"><vector name=\"direction\" x=\"0\" y=\"0\" z=\"0\"/></sensor>", "must not be 0"},
        {"<shape type=\"sphere\"><sensor type=\"perspective\"/></shape>", "must be an irradiancemeter"},
        {"<sensor type=\"perspectve\"/>", "perspective"}};
    Fixture *f = *state;
    char path[64];
    snprintf(path, sizeof path, "/tmp/reynolds_sensor_%ld.xml", (long)getpid());
    for (int i = 0; i < COUNT_OF(cases); i++) {
        FILE *file = fopen(path, "w");
        rey_scene *scene = NULL;
        assert_non_null(file);
        fprintf(file, "<scene version=\"3.0.0\"><integrator type=\"path\"/>%s</scene>", cases[i][0]);
        fclose(file);
        assert_int_not_equal(rey_scene_load(f->ctx, path, NULL, 0, &scene), REY_OK);
        print_message("%s\n", rey_error(f->ctx));
        assert_non_null(strstr(rey_error(f->ctx), cases[i][1]));
        assert_non_null(strstr(rey_error(f->ctx), path));
    }
    unlink(path);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_values), cmocka_unit_test(test_cross_section),
                                       cmocka_unit_test(test_lens),   cmocka_unit_test(test_batch),
                                       cmocka_unit_test(test_batch_moves),
                                       cmocka_unit_test(test_saved),  cmocka_unit_test(test_refused)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
