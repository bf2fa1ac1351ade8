// Integrators against each other and against closed forms.
#include "reynolds/reynolds.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

enum { SIZE = 12, NUMBERS = SIZE * SIZE * 3, SEEDS = 8, ACROSS = 3, BLOCKS = ACROSS * ACROSS * 3 };

typedef struct Room {
    rey_context *ctx;
    rey_scene *scene;
} Room;

static void ok(Room room, rey_result result) {
    if (result != REY_OK) {
        fail_msg("%s", rey_error(room.ctx));
    }
}

static Room room_open(const char *file, const rey_define *defines, int count) {
    char path[1024];
    Room room;
    snprintf(path, sizeof path, "%s/%s", RENDER_DIR, file);
    assert_int_equal(rey_context_create(NULL, &room.ctx), REY_OK);
    ok(room, rey_scene_load(room.ctx, path, defines, count, &room.scene));
    return room;
}

static void room_close(Room room) {
    rey_scene_destroy(room.scene);
    rey_context_destroy(room.ctx);
}

// Per block and channel: the mean over seeds, and its standard error.
typedef struct Blocks {
    double mean[BLOCKS], error[BLOCKS];
} Blocks;

static Blocks blocks_of(Room room, int spp) {
    static float image[NUMBERS];
    Blocks b = {{0}, {0}};
    double squares[BLOCKS] = {0};
    for (int seed = 0; seed < SEEDS; seed++) {
        rey_render_def def = rey_default_render_def();
        double sums[BLOCKS] = {0};
        def.spp = spp;
        def.seed = (uint32_t)seed;
        ok(room, rey_render(room.scene, &def, image, NULL));
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
    return b;
}

// z-scores of all blocks: the worst and their mean square.
static void same_picture(const char *name, const Blocks *a, const Blocks *b) {
    double worst = 0, square = 0;
    for (int i = 0; i < BLOCKS; i++) {
        double error = hypot(hypot(a->error[i], b->error[i]), 2e-6 * fabs(a->mean[i]) + 1e-9);
        double z = (a->mean[i] - b->mean[i]) / error;
        worst = fmax(worst, fabs(z));
        square += z * z / BLOCKS;
    }
    print_message("%s: worst z %.2f, mean square %.2f\n", name, worst, square);
    assert_true(worst < 5.5 && square < 2.5);
}

// ---- corridor --------------------------------------------------------------------------------------------------------

enum { CORRIDOR = 8 * 8 * 3, DEPTH = 64 };

static void test_corridor(void **state) {
    (void)state;
    static const double glow[] = {1, 0.5, 2}, reflectance[] = {0.95, 0.9, 0.5};
    Room room = room_open("corridor.xml", NULL, 0);
    float image[CORRIDOR], tangent[3] = {1, 1, 1}, derivative[CORRIDOR];
    int param = rey_param_find(room.scene, "mirror.specular_reflectance.value");
    assert_true(param >= 0);
    rey_render_def def = rey_default_render_def();
    def.spp = 16;
    ok(room, rey_render(room.scene, &def, image, NULL));
    def.terms = REY_TERM_INTERIOR;
    ok(room, rey_jvp(room.scene, &def, (rey_selection){&param, 1}, tangent, derivative, NULL, NULL));
    for (int i = 0; i < CORRIDOR; i++) {
        double r = reflectance[i % 3], sum = 0, slope = 0;
        for (int k = 0; k < DEPTH; k++) {
            sum += glow[i % 3] * pow(r, k);
            slope += k > 0 ? glow[i % 3] * k * pow(r, k - 1) : 0;
        }
        assert_true(fabs((double)image[i] - sum) < 1e-4 * sum);
        assert_true(fabs((double)derivative[i] - slope) < 1e-3 * slope);
    }
    room_close(room);
}

// Roulette leaves the mean as it is.
static void test_corridor_roulette(void **state) {
    (void)state;
    rey_define roulette = {"rr_depth", "5"};
    Room room = room_open("corridor.xml", &roulette, 1);
    float image[CORRIDOR];
    rey_render_def def = rey_default_render_def();
    def.spp = 4096;
    ok(room, rey_render(room.scene, &def, image, NULL));
    double sum = 0, mean = 0;
    for (int k = 0; k < DEPTH; k++) {
        sum += pow(0.95, k);
    }
    for (int i = 0; i < CORRIDOR; i += 3) {
        mean += (double)image[i] / (CORRIDOR / 3);
    }
    // One path's standard deviation is below 20: 262144 of them are within 0.2 but for one case in 10^6.
    assert_true(fabs(mean - sum) < 0.2);
    room_close(room);
}

// ---- surfaces that let light through ---------------------------------------------------------------------------------

static void test_through(void **state) {
    (void)state;
    static const rey_define kinds[] = {{"integrator", "path"}, {"integrator", "volpath"}, {"integrator", "volpathmis"}};
    Blocks b[3];
    for (int k = 0; k < 3; k++) {
        Room room = room_open("screens.xml", &kinds[k], 1);
        b[k] = blocks_of(room, 256);
        room_close(room);
    }
    same_picture("path and volpath", &b[0], &b[1]);
    assert_memory_equal(&b[1], &b[2], sizeof b[1]);
    // With one path segment, `path` sees the light itself only where nothing is before it.
    const rey_define one[] = {{"depth", "1"}, {"integrator", "volpath"}}, four[] = {{"depth", "4"}, {"integrator", "path"}};
    Room through = room_open("screens.xml", one, 2), counted = room_open("screens.xml", four, 2);
    const rey_define two[] = {{"depth", "1"}, {"integrator", "path"}};
    Room blocked = room_open("screens.xml", two, 2);
    Blocks seen = blocks_of(through, 64), hidden = blocks_of(blocked, 64), more = blocks_of(counted, 64);
    double sums[3] = {0};
    for (int i = 0; i < BLOCKS; i++) {
        assert_true(seen.mean[i] >= hidden.mean[i] - 5 * seen.error[i]);
        sums[0] += hidden.mean[i];
        sums[1] += seen.mean[i];
        sums[2] += more.mean[i];
    }
    assert_true(sums[0] < 0.99 * sums[1] && sums[1] < sums[2]);
    room_close(through);
    room_close(counted);
    room_close(blocked);
}

static double mean_of(const float *image) {
    double sum = 0;
    for (int i = 0; i < NUMBERS; i++) {
        sum += (double)image[i] / NUMBERS;
    }
    return sum;
}

// The derivative by a screen's opacity includes what its shadow does.
static void test_through_gradient(void **state) {
    (void)state;
    static float image[NUMBERS], adjoint[NUMBERS];
    const rey_define defines[] = {{"integrator", "volpath"}, {"depth", "2"}};
    Room room = room_open("screens.xml", defines, 2);
    int param = rey_param_find(room.scene, "screen.opacity.value");
    rey_selection selection = {&param, 1};
    rey_render_def def = rey_default_render_def();
    double gradient, sets[16], means[2], spread = 0, derivative = 0;
    float one = 1;
    for (int i = 0; i < NUMBERS; i++) {
        adjoint[i] = 1.0f / NUMBERS;
    }
    def.spp = 1024;
    def.terms = REY_TERM_INTERIOR;
    ok(room, rey_vjp(room.scene, &def, selection, adjoint, &gradient, sets, NULL));
    ok(room, rey_jvp(room.scene, &def, selection, &one, image, NULL, NULL));
    derivative = mean_of(image);
    assert_true(fabs(derivative - gradient) < 1e-5 * fabs(gradient));
    for (int k = 0; k < 16; k++) {
        spread += (sets[k] - gradient) * (sets[k] - gradient) / (16 * 15);
    }
    for (int k = 0; k < 2; k++) {
        float value = k ? 0.5f : 0.3f;
        ok(room, rey_param_set(room.scene, param, &value, 1));
        ok(room, rey_render(room.scene, &def, image, NULL));
        means[k] = mean_of(image);
    }
    // With two segments no light passes the screen twice on its way but straight: quadratic, so that this is exact.
    double difference = (means[1] - means[0]) / 0.2;
    print_message("opacity: %.6f +- %.6f, difference %.6f\n", gradient, sqrt(spread), difference);
    assert_true(fabs(gradient - difference) < 5 * sqrt(spread) + 0.01 * fabs(difference));
    assert_true(fabs(gradient) > 0.02);
    // An opaque screen: the light that the shadow rays would find behind it still counts.
    one = 1;
    ok(room, rey_param_set(room.scene, param, &one, 1));
    ok(room, rey_vjp(room.scene, &def, selection, adjoint, &gradient, NULL, NULL));
    float low = 0.9f;
    ok(room, rey_render(room.scene, &def, image, NULL));
    means[1] = mean_of(image);
    ok(room, rey_param_set(room.scene, param, &low, 1));
    ok(room, rey_render(room.scene, &def, image, NULL));
    means[0] = mean_of(image);
    low = 0.95f;
    ok(room, rey_param_set(room.scene, param, &low, 1));
    ok(room, rey_render(room.scene, &def, image, NULL));
    difference = (3 * means[1] - 4 * mean_of(image) + means[0]) / 0.1;
    print_message("opaque: %.6f, difference %.6f\n", gradient, difference);
    assert_true(fabs(gradient - difference) < 0.05 * fabs(difference));
    room_close(room);
}

// ---- split sample counts ---------------------------------------------------------------------------------------------

static void test_split(void **state) {
    (void)state;
    static const struct {
        const char *light, *scatter, *mirror;
    } cases[] = {{"1", "1", "conductor"}, {"4", "1", "conductor"}, {"1", "4", "conductor"}, {"2", "3", "conductor"},
                 {"1", "1", "diffuse"},   {"3", "0", "diffuse"}};
    Blocks b[6];
    double slope[6];
    for (int k = 0; k < 6; k++) {
        static float derivative[NUMBERS];
        const rey_define defines[] = {{"emitter_samples", cases[k].light}, {"bsdf_samples", cases[k].scatter},
                                      {"mirror", cases[k].mirror}};
        Room room = room_open("trio.xml", defines, 3);
        rey_render_def def = rey_default_render_def();
        rey_stats stats;
        int param = rey_param_find(room.scene, "wall.reflectance.value");
        float tangent[3] = {1, 1, 1};
        b[k] = blocks_of(room, 128);
        def.spp = 160;
        ok(room, rey_jvp(room.scene, &def, (rey_selection){&param, 1}, tangent, derivative, NULL, &stats));
        int most = cases[k].light[0] > cases[k].scatter[0] ? cases[k].light[0] : cases[k].scatter[0];
        assert_int_equal(stats.paths, (int64_t)SIZE * SIZE * 160 * (most - '0'));
        slope[k] = mean_of(derivative);
        room_close(room);
    }
    for (int k = 1; k < 4; k++) {
        same_picture("split samples", &b[0], &b[k]);
        assert_true(fabs(slope[k] - slope[0]) < 0.02 * slope[0]);
    }
    same_picture("lights alone", &b[4], &b[5]);
    assert_true(fabs(slope[5] - slope[4]) < 0.03 * slope[4]);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_corridor), cmocka_unit_test(test_corridor_roulette),
                                       cmocka_unit_test(test_through), cmocka_unit_test(test_through_gradient),
                                       cmocka_unit_test(test_split)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
