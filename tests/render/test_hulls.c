// Few surfaces that let light pass, such as hulls of media, are met by the kernels, many by Embree; paths pass the former without a
// stage of their own: the same picture and the same derivative either way, at every width.
#include "base/parallel.h"
#include "rooms.h"

enum { SEEDS = 6, BEYOND = 12 };

// Two media, one within the other's hull, that send out light and are seen through panes of nothing, on a floor beside a ball.
static const char scene_head[] =
    "<scene version='3.0.0'><integrator type='volpath'><integer name='max_depth' value='6'/></integrator>"
    "<sensor type='perspective'><float name='fov' value='45'/>"
    "<transform name='to_world'><lookat origin='0, -6, 2.5' target='0, 0, 1' up='0, 0, 1'/></transform>"
    "<film type='hdrfilm'><integer name='width' value='24'/><integer name='height' value='24'/><rfilter type='box'/></film>"
    "</sensor>"
    "<bsdf type='null' id='nothing'/>"
    "<medium type='homogeneous' id='fog'><rgb name='sigma_t' value='0.5, 0.7, 0.9'/><rgb name='albedo' value='0.9, 0.8, 0.7'/>"
    "<rgb name='emission' value='0.02, 0.05, 0.1'/></medium>"
    "<medium type='homogeneous' id='milk'><float name='sigma_t' value='2'/><float name='albedo' value='0.95'/></medium>"
    "<shape type='cube'><transform name='to_world'><scale value='1.2, 1, 0.9'/><rotate x='1' y='0.3' angle='20'/>"
    "<translate y='0.5' z='1.2'/></transform><ref id='nothing'/><ref name='interior' id='fog'/></shape>"
    "<shape type='cube'><transform name='to_world'><scale value='0.4'/><rotate z='1' angle='30'/><translate x='0.3' y='0.5' "
    "z='1.2'/></transform><ref id='nothing'/><ref name='interior' id='milk'/><ref name='exterior' id='fog'/></shape>"
    "<shape type='sphere'><float name='radius' value='0.6'/><point name='center' x='-1.4' y='-0.8' z='0.6'/></shape>"
    "<shape type='rectangle'><transform name='to_world'><scale value='8'/></transform></shape>"
    "<shape type='rectangle'><transform name='to_world'><scale value='0.7'/><rotate x='1' angle='180'/><translate z='4'/>"
    "</transform><emitter type='area'><rgb name='radiance' value='9, 8, 7'/></emitter></shape>"
    "<emitter type='constant'><float name='radiance' value='0.2'/></emitter>";

// panes: how many lie before the camera; more: how many further ones lie beyond the room, where nobody looks.
static Room hulls_open(int panes, int more, int lanes) {
    static char pane[5 + BEYOND][192];
    const char *texts[8 + BEYOND] = {scene_head};
    int count = 1;
    for (int i = 0; i < panes + more; i++) {
        snprintf(pane[i], sizeof pane[i], "<shape type='rectangle'><transform name='to_world'><rotate x='1' angle='80'/><translate "
                 "y='%g' z='%d'/></transform><ref id='nothing'/></shape>", -3.5 + 0.2 * i, i < panes ? 2 : -60);
        texts[count++] = pane[i];
    }
    texts[count] = "</scene>";
    return room_of(texts, 2, lanes, NULL, 0);
}

// Means over the picture's thirds of what it shows and of its derivative in the fog's extinction, and their errors.
enum { PARTS = 3, SEEN = 2 * PARTS };
static void look(Room room, double mean[SEEN], double error2[SEEN]) {
    static float image[NUMBERS], tangent[NUMBERS];
    double square[SEEN] = {0};
    int param = rey_param_find(room.scene, "fog.sigma_t.value.value");
    assert_true(param >= 0);
    memset(mean, 0, SEEN * sizeof *mean);
    for (uint32_t seed = 1; seed <= SEEDS; seed++) {
        double one[SEEN] = {0};
        rey_render_def def = def_make(128, seed, 1);
        const float one_each[3] = {1, 1, 1};
        ok(room, rey_render(room.scene, &def, image, NULL));
        ok(room, rey_jvp(room.scene, &def, (rey_selection){&param, 1}, one_each, tangent, NULL, NULL));
        for (int i = 0; i < NUMBERS; i++) {
            int part = i * PARTS / NUMBERS;
            one[part] += (double)image[i] * PARTS / NUMBERS;
            one[PARTS + part] += (double)tangent[i] * PARTS / NUMBERS;
        }
        for (int i = 0; i < SEEN; i++) {
            mean[i] += one[i] / SEEDS;
            square[i] += one[i] * one[i] / SEEDS;
        }
    }
    for (int i = 0; i < SEEN; i++) {
        error2[i] = fmax(square[i] - mean[i] * mean[i], 0) / (SEEDS - 1);
    }
}

static void compare(int panes, int lanes, int more, const double mean[SEEN], const double error2[SEEN]) {
    double other[SEEN], others2[SEEN];
    Room room = hulls_open(panes, more, lanes);
    look(room, other, others2);
    room_close(room);
    for (int i = 0; i < SEEN; i++) {
        double error = sqrt(error2[i] + others2[i]);
        print_message("width %d, %d panes and %d beyond, %s %d: %.5f for %.5f +- %.5f\n", lanes, panes, more,
                      i < PARTS ? "picture" : "derivative", i % PARTS, other[i], mean[i], error);
        assert_true(fabs(other[i]) > 20 * error * sqrt(sample_share()));
        assert_true(fabs(other[i] - mean[i]) < 5 * error); // of 36 numbers with 10 degrees of freedom
    }
}

// Five panes are more than a path passes at once.
static void test_hulls(void **state) {
    static const int lanes[] = {1, 8, 16};
    double mean[SEEN], error2[SEEN];
    UNUSED(state);
    Room room = hulls_open(0, BEYOND, lanes[0]);
    look(room, mean, error2);
    room_close(room);
    for (int k = 0; k < COUNT_OF(lanes) && lanes[k] <= rey_widest_lanes(); k++) {
        compare(0, lanes[k], 0, mean, error2);
        compare(5, lanes[k], 0, mean, error2);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_hulls)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
