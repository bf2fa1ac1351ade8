// Whole renders through the public interface: every parameter of a room with every kind, forward mode per image block
// against correlated finite differences; reverse against forward; threads; widths; analytic anchors.
#include "io/image.h"
#include "math/rng.h"
#include "reynolds/reynolds.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

enum { SIZE = 24, NUMBERS = SIZE * SIZE * 3, SPP = 32, SEEDS = 12, BLOCKS_ACROSS = 3, BLOCKS = 9, LARGEST = 1024 };

typedef struct Room {
    rey_context *ctx;
    rey_scene *scene;
} Room;

static char texels_path[64], sky_path[64];

// splitmix64
static double uniform(uint64_t *state) {
    uint64_t z = (*state += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return (double)((z ^ (z >> 31)) >> 11) * 0x1p-53;
}

static int write_pictures(void **state) {
    UNUSED(state);
    rey_context *ctx;
    float texels[4 * 3 * 3], sky[8 * 5 * 3];
    uint64_t random = 1;
    for (int i = 0; i < COUNT_OF(texels); i++) {
        texels[i] = (float)(0.2 + 0.6 * uniform(&random));
    }
    for (int i = 0; i < COUNT_OF(sky); i++) {
        sky[i] = (float)(0.1 + 0.6 * uniform(&random));
    }
    snprintf(texels_path, sizeof texels_path, "/tmp/reynolds_texels_%ld.exr", (long)getpid());
    snprintf(sky_path, sizeof sky_path, "/tmp/reynolds_sky_%ld.exr", (long)getpid());
    rey_result result = rey_context_create(NULL, &ctx);
    if (result == REY_OK) {
        result = rey_exr_write(ctx, texels_path, texels, 4, 3, 3, NULL);
    }
    if (result == REY_OK) {
        result = rey_exr_write(ctx, sky_path, sky, 8, 5, 3, NULL);
    }
    rey_context_destroy(ctx);
    return result != REY_OK;
}

static int remove_pictures(void **state) {
    UNUSED(state);
    unlink(texels_path);
    unlink(sky_path);
    return 0;
}

static Room room_open(const char *file, int threads, int lanes) {
    char path[1024];
    snprintf(path, sizeof path, "%s/%s", RENDER_DIR, file);
    rey_define defines[] = {{"texels", texels_path}, {"sky", sky_path}};
    rey_context_def def = rey_default_context_def();
    def.threads = threads;
    def.lanes = lanes;
    Room room;
    assert_int_equal(rey_context_create(&def, &room.ctx), REY_OK);
    bool pictures = strcmp(file, "shapes.xml") != 0 && strcmp(file, "closed.xml") != 0 && strcmp(file, "disc.xml") != 0;
    if (rey_scene_load(room.ctx, path, defines, pictures ? 2 : 0, &room.scene) != REY_OK) {
        fail_msg("%s", rey_error(room.ctx));
    }
    return room;
}

static void room_close(Room room) {
    rey_scene_destroy(room.scene);
    rey_context_destroy(room.ctx);
}

static rey_render_def def_make(int spp, uint32_t seed, int sets) {
    rey_render_def def = rey_default_render_def();
    def.spp = spp;
    def.seed = seed;
    def.sets = sets;
    def.terms = REY_TERM_INTERIOR;
    return def;
}

static void ok(Room room, rey_result result) {
    if (result != REY_OK) {
        fail_msg("%s", rey_error(room.ctx));
    }
}

// Mean over pixels and channels of each block.
static void blocks_of(const float *image, double *blocks) {
    enum { ACROSS = SIZE / BLOCKS_ACROSS };
    memset(blocks, 0, BLOCKS * sizeof *blocks);
    for (int i = 0; i < SIZE * SIZE; i++) {
        int block = i / SIZE / ACROSS * BLOCKS_ACROSS + i % SIZE / ACROSS;
        for (int c = 0; c < 3; c++) {
            blocks[block] += (double)image[3 * i + c] / (3.0 * ACROSS * ACROSS);
        }
    }
}

// Renders the scene moved by theta along the direction.
static void moved(Room room, int param, const float *start, const float *tangent, int count, double theta,
                  uint32_t seed, double *blocks) {
    static float image[NUMBERS];
    float values[LARGEST];
    for (int i = 0; i < count; i++) {
        values[i] = start[i] + (float)(theta * (double)tangent[i]);
    }
    rey_render_def def = def_make(SPP, seed, 1);
    ok(room, rey_param_set(room.scene, param, values, count));
    ok(room, rey_render(room.scene, &def, image, NULL));
    blocks_of(image, blocks);
}

typedef struct Sum {
    double n, mean, m2;
} Sum;

static void sum_add(Sum *s, double x) {
    double d = x - s->mean;
    s->n++;
    s->mean += d / s->n;
    s->m2 += d * (x - s->mean);
}

// The statistic of a difference of means, made normal [wallace1959].
static double z_of(const Sum *a, const Sum *b) {
    double error2 = a->m2 / (a->n - 1) / a->n + b->m2 / (b->n - 1) / b->n, difference = a->mean - b->mean;
    double floor = 1e-5 * (fabs(a->mean) + fabs(b->mean)) + 1e-7;
    error2 += floor * floor;
    double t2 = difference * difference / error2, degrees = a->n - 1;
    double z = sqrt(degrees * log1p(t2 / degrees)) * (8 * degrees + 1) / (8 * degrees + 3);
    return difference < 0 ? -z : z;
}

typedef struct Score {
    double sum, worst;
    int n;
} Score;

// How far parameters are moved, and on which side when they are at the end of their range.
static double step_of(const rey_param_info *info, const float *start, int *side) {
    double largest = 0;
    bool at_low = false, at_high = false;
    for (int i = 0; i < info->count; i++) {
        largest = fmax(largest, fabs((double)start[i]));
        at_low |= start[i] - 0.02f * fabsf(start[i]) <= info->low;
        at_high |= start[i] + 0.02f * fabsf(start[i]) >= info->high;
    }
    *side = at_low ? 1 : at_high ? -1 : 0;
    if (info->count == 16) {
        return 0.01; // radians
    }
    // Texture coordinates move over texels' edges, where values have kinks.
    return (strstr(info->name, "to_uv") ? 0.001 : 0.02) * (largest > 0 ? largest : 1);
}

// A direction in which the parameter moves: positive numbers, or a turn of a pose.
static void fill_tangent(const rey_param_info *info, const float *start, uint64_t *random, float *tangent) {
    for (int i = 0; i < info->count; i++) {
        tangent[i] = (float)(0.5 + 0.5 * uniform(random));
    }
    if (info->count != 16) {
        return;
    }
    const float w[3] = {tangent[0], tangent[1], tangent[2]};
    for (int column = 0; column < 4; column++) {
        for (int row = 0; row < 3; row++) {
            int next = (row + 1) % 3, last = (row + 2) % 3;
            tangent[4 * row + column] = w[next] * start[4 * last + column] - w[last] * start[4 * next + column];
        }
    }
    memset(tangent + 12, 0, 4 * sizeof *tangent);
}

static void check_param(Room room, int param, Score *score) {
    static float derivative[NUMBERS];
    rey_param_info info;
    rey_param_get_info(room.scene, param, &info);
    assert_true(info.count <= LARGEST);
    float start[LARGEST], tangent[LARGEST];
    uint64_t random = (uint64_t)param + 77;
    memcpy(start, rey_param_values(room.scene, param), (size_t)info.count * sizeof *start);
    int side, count = (int)info.count;
    double h = step_of(&info, start, &side);
    fill_tangent(&info, start, &random, tangent);
    Sum forward[BLOCKS] = {{0}}, differences[BLOCKS] = {{0}};
    for (uint32_t seed = 0; seed < SEEDS; seed++) {
        double a[BLOCKS], b[BLOCKS], c[BLOCKS];
        if (side) {
            moved(room, param, start, tangent, count, 0, seed, a);
            moved(room, param, start, tangent, count, side * h, seed, b);
            moved(room, param, start, tangent, count, 2 * side * h, seed, c);
        } else {
            moved(room, param, start, tangent, count, -h, seed, a);
            moved(room, param, start, tangent, count, h, seed, b);
        }
        ok(room, rey_param_set(room.scene, param, start, count));
        for (int i = 0; i < BLOCKS; i++) {
            sum_add(differences + i, side ? side * (-3 * a[i] + 4 * b[i] - c[i]) / (2 * h) : (b[i] - a[i]) / (2 * h));
        }
        rey_render_def def = def_make(SPP, seed + 1000, 1);
        ok(room, rey_jvp(room.scene, &def, (rey_selection){&param, 1}, tangent, derivative, NULL, NULL));
        blocks_of(derivative, a);
        for (int i = 0; i < BLOCKS; i++) {
            sum_add(forward + i, a[i]);
        }
    }
    double largest = 0, worst = 0;
    for (int i = 0; i < BLOCKS; i++) {
        double z = z_of(forward + i, differences + i);
        largest = fmax(largest, fabs(forward[i].mean));
        worst = fabs(z) > fabs(worst) ? z : worst;
        score->sum += z;
        score->n++;
    }
    score->worst = fmax(score->worst, fabs(worst));
    if (fabs(worst) > 4) {
        print_message("%-40s largest block %10.3g, worst z %6.2f\n", info.name, largest, worst);
    }
}

static bool has_interior(const Room room, int param) {
    rey_param_info info;
    rey_param_get_info(room.scene, param, &info);
    // Of the rooms' normals only the lantern's turn away from the camera.
    int jumps = strncmp(info.name, "lantern.", 8) == 0 ? 0 : REY_TERM_TERMINATOR;
    // Nothing stands in the way of lights with this name.
    int shadows = strncmp(info.name, "moving_", 7) == 0 ? REY_TERM_INDIRECT : 0;
    return (info.terms & ~jumps & ~shadows) == REY_TERM_INTERIOR;
}

static void test_differences(void **state) {
    Room room = room_open(*state, 2, 0);
    Score score = {0};
    for (int i = 0; i < rey_param_count(room.scene); i++) {
        if (has_interior(room, i)) {
            check_param(room, i, &score);
        }
    }
    double p = erfc(score.worst / sqrt(2)), threshold = -expm1(log1p(-0.01) / score.n);
    print_message("%d blocks, largest |z| %.2f, sum / sqrt(n) %.2f\n", score.n, score.worst,
                  score.sum / sqrt(score.n));
    room_close(room);
    assert_true(p > threshold);
    assert_true(fabs(score.sum) / sqrt(score.n) < 3);
}

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
    for (int k = 0; k < count; k++) { // one parameter at a time: none hides behind another
        rey_param_info info;
        rey_param_get_info(room.scene, params[k], &info);
        rey_selection one = {params + k, 1};
        double reverse = 0, forward = 0, scale = 0;
        for (int i = 0; i < info.count; i++) {
            tangent[i] = (float)uniform(&random);
            reverse += (double)tangent[i] * gradient[at + i];
            scale += fabs((double)tangent[i] * gradient[at + i]);
        }
        ok(room, rey_jvp(room.scene, &def, one, tangent, image, NULL, NULL));
        for (int i = 0; i < NUMBERS; i++) {
            forward += (double)image[i] * (double)adjoint[i];
        }
        if (fabs(forward - reverse) > 1e-4 * scale) {
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
    snprintf(command, sizeof command, "rm -r '%s' '%s'", path, data);
    assert_int_equal(system(command), 0);
    assert_memory_equal(image[0], image[1], sizeof image[0]);
}

// The index of smooth glass turns rays, which no interior term covers.
static void test_incomplete_is_refused(void **state) {
    UNUSED(state);
    static float image[NUMBERS];
    Room room = room_open("materials.xml", 1, 0);
    int param = rey_param_find(room.scene, "glass.eta.value");
    float tangent = 1;
    assert_true(param >= 0);
    rey_render_def def = def_make(1, 0, 1);
    ok(room, rey_jvp(room.scene, &def, (rey_selection){&param, 1}, &tangent, image, NULL, NULL));
    def.terms = 0;
    assert_int_equal(rey_jvp(room.scene, &def, (rey_selection){&param, 1}, &tangent, image, NULL, NULL),
                     REY_ERROR_INCOMPLETE);
    assert_non_null(strstr(rey_error(room.ctx), "specular"));
    room_close(room);
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
        ONE_ROOM(test, "layers.xml"), ONE_ROOM(test, "lights.xml")

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_closed_sphere),        cmocka_unit_test(test_disc_irradiance),
        cmocka_unit_test(test_attached_variance),    cmocka_unit_test(test_difference_noise),
        cmocka_unit_test(test_incomplete_is_refused), EVERY_ROOM(test_saved_renders_the_same),
        EVERY_ROOM(test_threads_change_nothing),
        EVERY_ROOM(test_widths),                     EVERY_ROOM(test_reverse_is_forward),
        EVERY_ROOM(test_differences)};
    return cmocka_run_group_tests(tests, write_pictures, remove_pictures);
}
