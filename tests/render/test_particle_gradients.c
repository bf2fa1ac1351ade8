// Derivatives of light tracing: reverse against forward mode, against differences along the same particles, and against
// the path tracer's; the same bits for any number of threads; what is refused.
#include "render/replay.h"
#include "rooms.h"

#include <stdlib.h>

enum { LARGEST = 1024, SETS = 16 };

// What moves no light, and jumps nowhere in this scene.
static int all_local(Room room, int *params) {
    int n = 0;
    for (int i = 0; i < rey_param_count(room.scene); i++) {
        rey_param_info info;
        rey_param_get_info(room.scene, i, &info);
        if (has_interior(room, i) && !strstr(info.name, "to_world")) {
            params[n++] = i;
        }
    }
    return n;
}

static void random_numbers(float *x, int64_t n, uint64_t random) {
    for (int64_t i = 0; i < n; i++) {
        x[i] = (float)uniform(&random);
    }
}

static void test_reverse_is_forward(void **state) {
    UNUSED(state);
    static float tangent[LARGEST], image[NUMBERS], adjoint[NUMBERS];
    static double gradient[LARGEST];
    Room room = room_open("particles.xml", 2, 0);
    int params[128], count = all_local(room, params);
    rey_selection selection = {params, count};
    assert_true(rey_selection_size(room.scene, selection) <= LARGEST);
    rey_render_def def = def_make(16, 3, 2);
    random_numbers(adjoint, NUMBERS, 5);
    random_numbers(tangent, LARGEST, 6);
    ok(room, rey_vjp(room.scene, &def, selection, adjoint, gradient, NULL, NULL));
    int64_t at = 0;
    for (int k = 0; k < count; k++) {
        rey_param_info info;
        rey_param_get_info(room.scene, params[k], &info);
        double reverse = 0, forward = 0, scale = 0;
        for (int64_t i = at; i < at + info.count; i++) {
            reverse += (double)tangent[i] * gradient[i];
            scale += fabs((double)tangent[i] * gradient[i]);
        }
        ok(room, rey_jvp(room.scene, &def, (rey_selection){params + k, 1}, tangent + at, image, NULL, NULL));
        for (int i = 0; i < NUMBERS; i++) {
            forward += (double)image[i] * (double)adjoint[i];
        }
        if (fabs(forward - reverse) > 1e-4 * scale) {
            fail_msg("%s: forward %.9g, reverse %.9g", info.name, forward, reverse);
        }
        if (!(scale > 0)) {
            fail_msg("%s: the derivative is 0", info.name);
        }
        at += info.count;
    }
    room_close(room);
}

// Sums over the picture, with weights.
static double weighed(const float *image, const float *weights) {
    double sum = 0;
    for (int i = 0; i < NUMBERS; i++) {
        sum += (double)image[i] * (double)weights[i];
    }
    return sum;
}

// Along the same particles nothing jumps, so that differences are as good as their step.
static void test_differences(void **state) {
    UNUSED(state);
    static float tangent[LARGEST], values[LARGEST], image[NUMBERS], weights[NUMBERS];
    Room room = room_open("particles.xml", 2, 0), moved = room_open("particles.xml", 2, 0);
    int params[128], count = all_local(room, params);
    rey_render_def def = def_make(16, 7, 1);
    def.spp = 16; // of fewer, single paths that pass a border show
    random_numbers(weights, NUMBERS, 8);
    random_numbers(tangent, LARGEST, 9);
    for (int k = 0; k < count; k++) {
        rey_param_info info;
        rey_param_get_info(room.scene, params[k], &info);
        if (!rey_can_replay(room.scene, params[k])) {
            continue;
        }
        const float *start = rey_param_values(room.scene, params[k]);
        double quotient[2], scale = 0, weighed_level = 0;
        for (int i = 0; i < info.count; i++) {
            scale = fmax(scale, fabs((double)start[i]));
        }
        // One-sided: many values lie at the end of their range.
        const double h = (strstr(info.name, "to_uv") ? 1e-3 : 0.01) * (scale > 0 ? scale : 1);
        for (int side = 0; side < 2; side++) {
            double level[3];
            for (int j = 0; j < 3; j++) {
                for (int i = 0; i < info.count; i++) {
                    float step = (float)(h * j / (side + 1)) * tangent[i];
                    values[i] = start[i] + (start[i] + 2 * step > info.high ? -step : step);
                }
                ok(moved, rey_param_set(moved.scene, params[k], values, info.count));
                ok(room, rey_replay(room.scene, moved.scene, &def, image, NULL));
                level[j] = weighed(image, weights);
                weighed_level = level[0];
            }
            quotient[side] = (-1.5 * level[0] + 2 * level[1] - 0.5 * level[2]) / (h / (side + 1));
        }
        ok(moved, rey_param_set(moved.scene, params[k], start, info.count));
        float along[LARGEST];
        for (int i = 0; i < info.count; i++) {
            along[i] = start[i] + 2 * (float)h * tangent[i] > info.high ? -tangent[i] : tangent[i];
        }
        ok(room, rey_jvp(room.scene, &def, (rey_selection){params + k, 1}, along, image, NULL, NULL));
        double derivative = weighed(image, weights), expected = (4 * quotient[1] - quotient[0]) / 3;
        double rounding = 1e-6 * weighed_level / h;
        double slack = fabs(quotient[1] - quotient[0]) + 1e-3 * fabs(expected) + rounding;
        if (!(fabs(derivative - expected) <= slack)) {
            fail_msg("%s: derivative %.9g, difference %.9g", info.name, derivative, expected);
        }
    }
    room_close(moved);
    room_close(room);
}

// Every entry of the gradient, with its standard error, for light carried either way.
static void test_path_gradient(void **state) {
    UNUSED(state);
    static const char *const files[] = {"particles.xml", "particles_path.xml"};
    static float adjoint[NUMBERS];
    static double gradient[2][LARGEST], sets[SETS * LARGEST], error2[2][LARGEST];
    int64_t size = 0;
    Room room = {0};
    random_numbers(adjoint, NUMBERS, 10);
    for (int k = 0; k < 2; k++) {
        room = room_open(files[k], 2, 0);
        int params[128], count = all_local(room, params);
        rey_selection selection = {params, count};
        size = rey_selection_size(room.scene, selection);
        rey_render_def def = def_make(64 * SETS, 23, SETS);
        def.sampler = REY_SAMPLER_INDEPENDENT; // sets are then independent numbers
        ok(room, rey_vjp(room.scene, &def, selection, adjoint, gradient[k], sets, NULL));
        for (int64_t i = 0; i < size; i++) {
            error2[k][i] = 0;
            for (int s = 0; s < SETS; s++) {
                double d = sets[s * size + i] - gradient[k][i];
                error2[k][i] += d * d / (SETS * (SETS - 1));
            }
        }
        room_close(room);
    }
    double worst = 0, square = 0;
    int judged = 0;
    for (int64_t i = 0; i < size; i++) {
        // What few particles bring has no error to speak of: texels of the sky behind everything.
        if (fabs(gradient[1][i]) < 0.3) {
            continue;
        }
        double z = (gradient[0][i] - gradient[1][i]) / sqrt(error2[0][i] + error2[1][i] + 1e-12);
        worst = fmax(worst, fabs(z));
        square += z * z;
        judged++;
    }
    print_message("%d of %d entries: worst z %.2f, mean square %.2f\n", judged, (int)size, worst, square / judged);
    assert_true(judged > 150 && worst < 5.5 && square < 2 * judged);
}

static void test_threads(void **state) {
    UNUSED(state);
    static float adjoint[NUMBERS], tangent[LARGEST], image[3][NUMBERS];
    static double gradient[3][LARGEST];
    random_numbers(adjoint, NUMBERS, 12);
    random_numbers(tangent, LARGEST, 13);
    for (int k = 0; k < 3; k++) {
        Room room = room_open("particles.xml", 2 * k + 1, 0);
        int params[128], count = all_local(room, params);
        rey_selection selection = {params, count};
        rey_render_def def = def_make(8, 14, 2);
        ok(room, rey_vjp(room.scene, &def, selection, adjoint, gradient[k], NULL, NULL));
        ok(room, rey_jvp(room.scene, &def, selection, tangent, image[k], NULL, NULL));
        room_close(room);
        assert_memory_equal(gradient[k], gradient[0], sizeof gradient[0]);
        assert_memory_equal(image[k], image[0], sizeof image[0]);
    }
}

// What moves is derived along paths from the camera, which find the same light.
static void test_moves(void **state) {
    UNUSED(state);
    static const char *const names[] = {"bulb.position", "sun.to_world", "sky.to_world", "metal.to_world", "camera.to_world"};
    static const char *const files[] = {"particles.xml", "particles_path.xml"};
    static float adjoint[NUMBERS];
    random_numbers(adjoint, NUMBERS, 15);
    for (int i = 0; i < COUNT_OF(names); i++) {
        double gradient[2][16] = {{0}};
        for (int k = 0; k < 2; k++) {
            Room room = room_open(files[k], 2, 0);
            rey_render_def def = def_make(16, 16, 2);
            int param = rey_param_find(room.scene, names[i]);
            assert_true(param >= 0);
            ok(room, rey_vjp(room.scene, &def, (rey_selection){&param, 1}, adjoint, gradient[k], NULL, NULL));
            room_close(room);
        }
        assert_memory_equal(gradient[0], gradient[1], sizeof gradient[0]);
    }
}

// And agrees with differences of the pictures that particles make.
static void test_moving_light(void **state) {
    UNUSED(state);
    enum { PICTURES_SPP = 4096 };
    static float weights[NUMBERS], image[2][NUMBERS];
    const float step = 0.1f;
    float place[3];
    double gradient[3], sets[SETS * 3], variance = 0;
    Room room = room_open("particles.xml", 2, 0);
    int param = rey_param_find(room.scene, "bulb.position");
    rey_render_def def = def_make(256 * SETS, 17, SETS);
    for (int i = 0; i < NUMBERS; i++) {
        weights[i] = i / 3 % SIZE < SIZE / 2 ? 1.0f : 0.2f;
    }
    def.terms = 0;
    ok(room, rey_vjp(room.scene, &def, (rey_selection){&param, 1}, weights, gradient, sets, NULL));
    for (int s = 0; s < SETS; s++) {
        variance += (sets[3 * s] - gradient[0]) * (sets[3 * s] - gradient[0]) / (SETS * (SETS - 1));
    }
    memcpy(place, rey_param_values(room.scene, param), sizeof place);
    place[0] -= step;
    for (int side = 0; side < 2; side++, place[0] += 2 * step) {
        ok(room, rey_param_set(room.scene, param, place, 3));
        rey_render_def picture = rey_default_render_def();
        picture.spp = PICTURES_SPP;
        ok(room, rey_render(room.scene, &picture, image[side], NULL));
    }
    double difference = (weighed(image[1], weights) - weighed(image[0], weights)) / (2 * (double)step);
    print_message("bulb.position: %g +- %g, difference %g\n", gradient[0], sqrt(variance), difference);
    assert_true(fabs(gradient[0] - difference) < 4 * sqrt(2 * variance) + 0.02 * fabs(difference));
    assert_true(fabs(difference) > 10 * sqrt(variance));
    room_close(room);
}

// Where light tracing finds light that such paths do not, it decides which places particles reach.
static void test_places_are_refused(void **state) {
    UNUSED(state);
    static float adjoint[NUMBERS];
    double gradient[16];
    Room room = room_open("particles_beam.xml", 1, 0);
    rey_render_def def = def_make(1, 0, 1);
    static const char *const names[] = {"bulb.position", "sun.to_world", "sky.to_world"};
    for (int i = 0; i < COUNT_OF(names); i++) {
        int param = rey_param_find(room.scene, names[i]);
        assert_true(param >= 0);
        assert_int_equal(rey_vjp(room.scene, &def, (rey_selection){&param, 1}, adjoint, gradient, NULL, NULL),
                         REY_ERROR_INCOMPLETE);
        assert_non_null(strstr(rey_error(room.ctx), "light tracing"));
    }
    room_close(room);
}

// Arguments: what the names of tests begin with.
int main(int argc, char **argv) {
    struct CMUnitTest tests[] = {cmocka_unit_test(test_reverse_is_forward), cmocka_unit_test(test_differences),
                                       cmocka_unit_test(test_path_gradient), cmocka_unit_test(test_threads),
                                       cmocka_unit_test(test_moves), cmocka_unit_test(test_moving_light),
                                       cmocka_unit_test(test_places_are_refused)};
    size_t count = tests_asked(tests, COUNT_OF(tests), argc, argv);
    return _cmocka_run_group_tests("particle_gradients", tests, count, write_pictures, remove_pictures);
}
