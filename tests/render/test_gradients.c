// Whole renders through the public interface: reverse mode against forward mode for every parameter of the rooms, saved
// scenes, threads, widths, refusals, analytic anchors. Derivatives against differences: test_differences.c.
#include "rooms.h"

#include "math/rng.h"

#include <stdlib.h>

enum { SPP = 32 };

static int all_interior(Room room, int *params) {
    int n = 0;
    for (int i = 0; i < rey_param_count(room.scene); i++) {
        if (has_interior(room, i)) {
            params[n++] = i;
        }
    }
    return n;
}

static void test_reverse_is_forward(void **state) {
    Room room = room_open(*state, 2, 0);
    int params[256], count = all_interior(room, params);
    rey_selection selection = {params, count};
    int64_t size = rey_selection_size(room.scene, selection);
    float *tangent = calloc((size_t)size, sizeof *tangent), *image = calloc(NUMBERS, sizeof *image);
    float *adjoint = calloc(NUMBERS, sizeof *adjoint);
    double *gradient = calloc((size_t)size, sizeof *gradient);
    assert_true(tangent && image && adjoint && gradient);
    uint64_t random = 5;
    for (int i = 0; i < NUMBERS; i++) {
        adjoint[i] = (float)uniform(&random);
    }
    rey_render_def def = def_make(SPP, 3, 4);
    ok(room, rey_vjp(room.scene, &def, selection, adjoint, gradient, NULL, NULL));
    int64_t at = 0;
    const bool alone = strncmp(*state, "media_", 6) == 0; // which border has the path's probe depends on what is selected
    for (int k = 0; k < count; k++) { // one parameter at a time: none hides behind another
        rey_param_info info;
        rey_param_get_info(room.scene, params[k], &info);
        rey_selection one = {params + k, 1};
        double reverse = 0, forward = 0, scale = 0, pixels = 0;
        if (alone) {
            ok(room, rey_vjp(room.scene, &def, one, adjoint, gradient + at, NULL, NULL));
        }
        for (int i = 0; i < info.count; i++) {
            tangent[i] = (float)uniform(&random);
            reverse += (double)tangent[i] * gradient[at + i];
            scale += fabs((double)tangent[i] * gradient[at + i]);
        }
        ok(room, rey_jvp(room.scene, &def, one, tangent, image, NULL, NULL));
        for (int i = 0; i < NUMBERS; i++) {
            forward += (double)image[i] * (double)adjoint[i];
            pixels += fabs((double)image[i] * (double)adjoint[i]);
        }
        if (fabs(forward - reverse) > 1e-4 * fmax(scale, pixels)) { // pixels of both signs may cancel
            fail_msg("%s: forward %.9g, reverse %.9g", info.name, forward, reverse);
        }
        at += info.count;
    }
    free(tangent);
    free(image);
    free(adjoint);
    free(gradient);
    room_close(room);
}

// A scene that is written and read again renders the same bits.
static void test_saved_renders_the_same(void **state) {
    static float image[2][NUMBERS];
    char path[64], data[80], command[200];
    snprintf(path, sizeof path, "/tmp/reynolds_saved_%ld.xml", (long)getpid());
    snprintf(data, sizeof data, "/tmp/reynolds_saved_%ld_data", (long)getpid());
    Room room = room_open(*state, 2, 0), again = {0};
    rey_render_def def = def_make(SPP, 4, 1);
    ok(room, rey_render(room.scene, &def, image[0], NULL));
    ok(room, rey_scene_save(room.scene, path));
    assert_int_equal(rey_context_create(NULL, &again.ctx), REY_OK);
    ok(again, rey_scene_load(again.ctx, path, NULL, 0, &again.scene));
    ok(again, rey_render(again.scene, &def, image[1], NULL));
    room_close(again);
    room_close(room);
    snprintf(command, sizeof command, "rm -rf '%s' '%s'", path, data);
    assert_int_equal(system(command), 0);
    assert_memory_equal(image[0], image[1], sizeof image[0]);
}

// What moves beside smooth mirrors whose normals are a map's is seen in them, which no interior term covers.
static void test_incomplete_is_refused(void **state) {
    UNUSED(state);
    static float image[NUMBERS];
    Room room = room_open("layers.xml", 1, 0);
    int param = rey_param_find(room.scene, "lamp.position");
    float tangent[3] = {1, 0, 0};
    assert_true(param >= 0);
    rey_render_def def = def_make(1, 0, 1);
    ok(room, rey_jvp(room.scene, &def, (rey_selection){&param, 1}, tangent, image, NULL, NULL));
    def.terms = 0;
    assert_int_equal(rey_jvp(room.scene, &def, (rey_selection){&param, 1}, tangent, image, NULL, NULL),
                     REY_ERROR_INCOMPLETE);
    assert_non_null(strstr(rey_error(room.ctx), "specular"));
    room_close(room);
}

// What moves is given whole where all of it is known, else refused whole and given in part; where no part of it is known, it
// is refused too, and no 0 made up.
static void test_motion_is_partial(void **state) {
    UNUSED(state);
    static float image[NUMBERS], tangent[256];
    static const struct {
        const char *room, *name;
        bool known, whole;
    } cases[] = {{"moving_ball.xml", "moving_camera.to_world", true, true},
                 {"moving_ball.xml", "moving_wall.to_world", true, true},
                 {"moving_box.xml", "moving_box.to_world", true, true},
                 {"materials.xml", "spot.position", true, true}, // its shadows are seen in mirrors and through a mask
                 {"shapes.xml", "vine.control_points", true, false},
                 {"shapes.xml", "twig.control_points", false, false},
                 {"shapes.xml", "camera.to_world", true, false}};
    for (int i = 0; i < COUNT_OF(cases); i++) {
        Room room = room_open(cases[i].room, 1, 0);
        int param = rey_param_find(room.scene, cases[i].name);
        assert_true(param >= 0);
        rey_render_def def = def_make(1, 0, 1);
        def.terms = 0;
        rey_selection one = {&param, 1};
        rey_result whole = rey_jvp(room.scene, &def, one, tangent, image, NULL, NULL);
        assert_int_equal(whole, cases[i].whole ? REY_OK : REY_ERROR_INCOMPLETE);
        assert_true(cases[i].whole || strstr(rey_error(room.ctx), cases[i].known ? "term '" : cases[i].name) != NULL);
        def.terms = REY_TERM_INTERIOR;
        rey_result partly = rey_jvp(room.scene, &def, one, tangent, image, NULL, NULL);
        assert_int_equal(partly, cases[i].known ? REY_OK : REY_ERROR_INCOMPLETE);
        const char *error = rey_error(room.ctx);
        bool told = strstr(error, "no term of the gradient") && strstr(error, "does not follow these numbers");
        assert_true(cases[i].known || told);
        room_close(room);
    }
}

static void test_threads_change_nothing(void **state) {
    static float image[3][NUMBERS];
    static double gradient[3][4096];
    for (int k = 0; k < 3; k++) {
        Room room = room_open(*state, k + 1, 0);
        int params[256], count = all_interior(room, params);
        rey_selection selection = {params, count};
        assert_true(rey_selection_size(room.scene, selection) <= 4096);
        rey_render_def def = def_make(16, 9, 4);
        ok(room, rey_render(room.scene, &def, image[k], NULL));
        ok(room, rey_vjp(room.scene, &def, selection, image[0], gradient[k], NULL, NULL));
        room_close(room);
        assert_memory_equal(image[k], image[0], sizeof image[0]);
        assert_memory_equal(gradient[k], gradient[0], sizeof gradient[0]);
    }
}

static void test_widths(void **state) {
    static float image[NUMBERS], first[NUMBERS];
    static const int lanes[] = {1, 8, 16};
    for (int k = 0; k < 3; k++) {
        rey_context_def probe = rey_default_context_def();
        rey_context *ctx;
        probe.lanes = lanes[k];
        if (rey_context_create(&probe, &ctx) != REY_OK) {
            continue; // this machine does not run that width
        }
        rey_context_destroy(ctx);
        Room room = room_open(*state, 2, lanes[k]);
        rey_render_def def = def_make(SPP, 4, 1);
        ok(room, rey_render(room.scene, &def, k ? image : first, NULL));
        room_close(room);
        int different = 0;
        for (int i = 0; i < SIZE * SIZE && k; i++) {
            bool differs = false;
            for (int c = 0; c < 3; c++) {
                differs |= fabsf(image[3 * i + c] - first[3 * i + c]) > 0.01f * fabsf(first[3 * i + c]) + 1e-6f;
            }
            different += differs;
        }
        print_message("width %d: %d of %d pixels differ by more than 1 %%\n", lanes[k], different, SIZE * SIZE);
        assert_true(1000 * different < SIZE * SIZE);
    }
}

static void test_closed_sphere(void **state) {
    UNUSED(state);
    float image[48], tangent[3] = {1, 1, 1}, derivative[48];
    Room room = room_open("closed.xml", 2, 0);
    rey_render_def def = def_make(512, 1, 16);
    ok(room, rey_render(room.scene, &def, image, NULL));
    int param = rey_param_find(room.scene, "inside.reflectance.value");
    assert_true(param >= 0);
    double sets[16], mean = 0, value = 0, square = 0;
    ok(room, rey_jvp(room.scene, &def, (rey_selection){&param, 1}, tangent, derivative, sets, NULL));
    for (int i = 0; i < 48; i++) {
        value += (double)image[i] / 48;
    }
    for (int i = 0; i < 16; i++) {
        mean += sets[i] / 16;
        square += sets[i] * sets[i] / 16;
    }
    double error = sqrt(fmax(square - mean * mean, 0) / 15);
    print_message("closed sphere: value %.5f (2), derivative %.5f +- %.5f (4)\n", value, mean, error);
    room_close(room);
    assert_true(fabs(value - 2) < 0.01);
    assert_true(fabs(mean - 4) < 4 * error + 0.004 && error < 0.05);
}

static void test_disc_irradiance(void **state) {
    UNUSED(state);
    float image[48];
    Room room = room_open("disc.xml", 2, 0);
    rey_render_def def = def_make(4096, 1, 1);
    ok(room, rey_render(room.scene, &def, image, NULL));
    double value = 0;
    for (int i = 0; i < 48; i++) {
        value += (double)image[i] / 48 * 3.14159265358979323846;
    }
    print_message("disc: E %.5f (1.570796)\n", value);
    room_close(room);
    assert_true(fabs(value - 1.570796) < 0.003);
}

// A7: x = u^(1 / (1 + pi)) has density (1 + pi) x^pi; the derivative of f / p of a moving sample has mean 0 and variance
// 80 / 27 at pi = 1/2, while the detached derivative of f = 1 is exactly 0.
static void test_attached_variance(void **state) {
    UNUSED(state);
    double mean = 0, square = 0, pi = 0.5;
    int n = 1 << 20;
    for (int i = 0; i < n; i++) {
        SampleKey key = {.pixel = 0, .sample = (UInt)i, .scramble = 7, .sobol = false};
        // The fourth moment is infinite: u = v^6 with weight 6 v^5 samples the tail.
        double v = (double)rng_1d(&key, 0) + 0x1p-25, weight = 6 * pow(v, 5), u = pow(v, 6), x = pow(u, 1 / (1 + pi));
        // f / p = x^-pi / (1 + pi), dx / dpi = -x log(u) / (1 + pi)^2
        double d_dpi = -pow(x, -pi) / (1 + pi) * (log(x) + 1 / (1 + pi));
        double d_dx = -pi * pow(x, -pi - 1) / (1 + pi), dx_dpi = -x * log(u) / ((1 + pi) * (1 + pi));
        double d = d_dpi + d_dx * dx_dpi;
        mean += weight * d / n;
        square += weight * d * d / n;
    }
    assert_true(fabs(mean) < 0.01);
    assert_true(fabs(square - mean * mean - 80.0 / 27) < 0.05);
}

// A8: differences of a step, f = [u < 1/2], N samples a side: variance 1 / (8 e^2 N) with independent seeds, about
// 1 / (2 e N) with the same ones.
static void test_difference_noise(void **state) {
    UNUSED(state);
    enum { TRIALS = 2000, N = 200 };
    double e = 0.02, square[2] = {0};
    for (int t = 0; t < TRIALS; t++) {
        for (int common = 0; common < 2; common++) {
            double d = 0;
            for (int i = 0; i < N; i++) {
                SampleKey key = {.pixel = (UInt)t, .sample = (UInt)i, .scramble = 7, .sobol = false};
                double above = (double)rng_1d(&key, 0) < 0.5 + e;
                double below = (double)rng_1d(&key, common ? 0 : 1) < 0.5 - e;
                d += (above - below) / (2 * e) / N;
            }
            square[common] += (d - 1) * (d - 1) / TRIALS;
        }
    }
    assert_true(fabs(square[0] * 8 * e * e * N - 1) < 0.15);
    assert_true(fabs(square[1] * 2 * e * N - 1) < 0.2);
}

// One test per room: every material, every shape.
#define ONE_ROOM(test, file) {#test " " file, test, NULL, NULL, (void *)(uintptr_t)(file)}
#define EVERY_ROOM(test)                                                                                               \
    ONE_ROOM(test, "materials.xml"), ONE_ROOM(test, "shapes.xml"), ONE_ROOM(test, "principled.xml"),                 \
        ONE_ROOM(test, "layers.xml"), ONE_ROOM(test, "lights.xml"), ONE_ROOM(test, "tiles.xml"), \
        ONE_ROOM(test, "edges.xml"), ONE_ROOM(test, "moving_ball.xml"), ONE_ROOM(test, "moving_box.xml"), \
        ONE_ROOM(test, "moving_dome.xml"), ONE_ROOM(test, "moving_disk.xml"), ONE_ROOM(test, "fog.xml"), \
        ONE_ROOM(test, "smoke.xml"), ONE_ROOM(test, "media_pair.xml"), ONE_ROOM(test, "dropped.xml"),                     \
        ONE_ROOM(test, "sieve.xml"), ONE_ROOM(test, "glowing.xml"), ONE_ROOM(test, "glowing_round.xml")

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_closed_sphere),        cmocka_unit_test(test_disc_irradiance),
        cmocka_unit_test(test_attached_variance),    cmocka_unit_test(test_difference_noise),
        cmocka_unit_test(test_incomplete_is_refused), cmocka_unit_test(test_motion_is_partial),
        EVERY_ROOM(test_saved_renders_the_same),
        EVERY_ROOM(test_threads_change_nothing),
        EVERY_ROOM(test_widths),                     EVERY_ROOM(test_reverse_is_forward)};
    return cmocka_run_group_tests(tests, write_pictures, remove_pictures);
}
