// Where rough refraction ends (bsdf/rim.h), in whole renders: derivatives by the index and by a turn of the surface against
// differences of pictures. Without the rim they are off by 4 to 40 %.
#include "rooms.h"

enum { VALUES = 4 * 4 * 3 };

static const float one[1] = {1};

static Room rim_load(const char *path, const rey_define *defines, int count, int lanes) {
    rey_context_def def = rey_default_context_def();
    Room room;
    def.lanes = lanes;
    assert_int_equal(rey_context_create(&def, &room.ctx), REY_OK);
    if (rey_scene_load(room.ctx, path, defines, count, &room.scene) != REY_OK) {
        fail_msg("%s", rey_error(room.ctx));
    }
    return room;
}

static Room rim_open(const char *kind, const char *facets, const char *z, const char *light, const char *integrator,
                     int lanes) {
    const rey_define defines[] = {{"kind", kind}, {"facets", facets}, {"z", z}, {"light", light}, {"integrator", integrator}};
    return rim_load(RENDER_DIR "/rim.xml", defines, COUNT_OF(defines), lanes);
}

static void rim_close(Room room) {
    rey_scene_destroy(room.scene);
    rey_context_destroy(room.ctx);
}

static double mean_of(const float *values) {
    double sum = 0;
    for (int k = 0; k < VALUES; k++) {
        sum += (double)values[k];
    }
    return sum / VALUES;
}

// The mean of the picture where a parameter has its value plus a step along the tangent.
static double picture_at(Room room, int param, const float *value, const float *tangent, double step, int count, int spp) {
    rey_render_def def = rey_default_render_def();
    float image[VALUES], moved[16];
    def.spp = spp;
    for (int k = 0; k < count; k++) {
        moved[k] = value[k] + (float)step * tangent[k];
    }
    assert_int_equal(rey_param_set(room.scene, param, moved, count), REY_OK);
    assert_int_equal(rey_render(room.scene, &def, image, NULL), REY_OK);
    return mean_of(image);
}

// share: of the rim in the derivative, 0: what the term `interior` lacks. Closes the room.
static void check(Room room, const char *label, const char *name, const float *tangent, int count, double share, int spp) {
    rey_render_def def = rey_default_render_def();
    float derivative[VALUES], adjoint[VALUES], value[16];
    double gradient[16], sets[16], product = 0, variance = 0;
    const double step = 0.01;
    int param = rey_param_find(room.scene, name);
    const rey_selection selection = {&param, 1};
    def.spp = spp;
    memcpy(value, rey_param_values(room.scene, param), (size_t)count * sizeof *value);
    if (rey_jvp(room.scene, &def, selection, tangent, derivative, sets, NULL) != REY_OK) {
        fail_msg("%s: %s", label, rey_error(room.ctx));
    }
    for (int k = 0; k < VALUES; k++) {
        adjoint[k] = 1.0f / VALUES;
    }
    assert_int_equal(rey_vjp(room.scene, &def, selection, adjoint, gradient, NULL, NULL), REY_OK);
    double found = mean_of(derivative), lacks = share * found;
    if (share == 0) {
        def.terms = REY_TERM_INTERIOR;
        assert_int_equal(rey_jvp(room.scene, &def, selection, tangent, derivative, NULL, NULL), REY_OK);
        lacks = found - mean_of(derivative);
    }
    def.terms = 0;
    for (int k = 0; k < 16; k++) {
        variance += (sets[k] - found) * (sets[k] - found) / (16 * 15);
        product += k < count ? gradient[k] * (double)tangent[k] : 0;
    }
    double above = picture_at(room, param, value, tangent, step, count, spp);
    double difference = (above - picture_at(room, param, value, tangent, -step, count, spp)) / (2 * step);
    // The differences have noise of their own, as much as that of the derivative.
    double error = sqrt(2 * variance), tolerance = 4 * error + 0.003 * fabs(difference);
    print_message("%s %s: %g, difference %g, error %g\n", label, name, found, difference, error);
    assert_true(fabs(found - difference) <= tolerance);
    assert_true(tolerance < 0.8 * fabs(lacks)); // or a rim that is left out might pass
    assert_true(fabs(product - found) <= 1e-4 * fabs(found));
    rim_close(room);
}

static void check_sky(const char *kind, const char *z, const char *name, const float *tangent, int count, double share, int spp) {
    check(rim_open(kind, "ggx", z, "constant", "path", 0), kind, name, tangent, count, share, spp);
}

static void test_index(void **state) {
    (void)state;
    check_sky("glass", "0.7", "glass.eta.value", one, 1, 0.04, 1 << 16);
    check_sky("glass", "-0.7", "glass.eta.value", one, 1, 0.2, 1 << 17);
    check_sky("coat", "0.7", "coat.eta.value", one, 1, 0.12, 1 << 16);
    check_sky("coat", "-0.7", "coat.eta.value", one, 1, 0.24, 1 << 16);
    check_sky("blend", "-0.7", "glass.eta.value", one, 1, 0.2, 1 << 18);
    check(rim_open("coat", "ggx", "0.7", "constant", "direct", 0), "direct", "coat.eta.value", one, 1, 0.12, 1 << 17);
}

// The pane turns about the x axis.
static void test_turn(void **state) {
    const float turn[16] = {0, 0, 0, 0, 0, 0, -50, 0, 0, 50, 0, 0, 0, 0, 0, 0};
    (void)state;
    check_sky("glass", "-0.7", "pane.to_world", turn, 16, 0.045, 1 << 16);
}

// What is seen in the light of a point or of one direction (rim_sharp.xml).
typedef struct SharpView {
    const char *eye, *target, *depth, *back, *front, *away;
} SharpView;

static const SharpView of_pane = {"0.3, -1, -0.3", "0, 0, 0", "2", "chalk", "nothing", "2"};
static const SharpView in_mirror = {"0.4, 1.54, -0.65", "0.4, 2, -0.45", "3", "mirror", "nothing", "2"};
static const SharpView of_floor = {"0.3, -1, -0.3", "0, 0.3, -0.8", "3", "chalk", "nothing", "2"};
static const SharpView veiled_pane = {"0.3, -1, -0.3", "0, 0, 0", "3", "chalk", "veil", "2"};
static const SharpView veiled_floor = {"0.3, -1, -0.3", "0, 0.3, -0.8", "4", "chalk", "veil", "2"};

static const SharpView of_plain_floor = {"0.3, -1, -0.3", "0, 0.3, -0.8", "3", "chalk", "nothing", "3.3"};
static const SharpView of_haze = {"0.3, -1, -0.3", "0.3, 3, -0.33", "3", "chalk", "nothing", "3.3"};
static const SharpView shaded_pane = {"0.3, -1, -0.3", "0, 0, 0", "2", "chalk", "shade", "2"};
static const SharpView shaded_haze = {"0.3, -1, -0.3", "0.3, 3, -0.33", "3", "chalk", "shade", "3.3"};
static const SharpView beside_mirror = {"0.3, 0.5, -0.3", "0.3, 0.9, -0.7", "4", "mirror", "nothing", "2"};

static Room sharp_open(const char *scene, const char *kind, const char *light, const SharpView *view, int lanes) {
    const rey_define defines[] = {{"kind", kind}, {"light", light}, {"eye", view->eye}, {"target", view->target},
                                  {"depth", view->depth}, {"back", view->back}, {"front", view->front},
                                  {"away", view->away}};
    char path[256];
    snprintf(path, sizeof path, RENDER_DIR "/%s.xml", scene);
    return rim_load(path, defines, COUNT_OF(defines), lanes);
}

typedef struct SharpRow {
    const char *kind, *light, *param;
    const SharpView *view;
    const float *tangent;
    int count, spp;
} SharpRow;

static void check_rows(const char *scene, const SharpRow *rows, size_t count) {
    for (size_t i = 0; i < count; i++) {
        Room room = sharp_open(scene, rows[i].kind, rows[i].light, rows[i].view, 0);
        check(room, rows[i].kind, rows[i].param, rows[i].tangent, rows[i].count, 0, rows[i].spp);
    }
}

static const float tilt[12] = {0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1, 0};

// There no sampled direction finds the rim: it lies along curves that the sensor sees, itself or in a mirror, and particles
// carry it from where others see it.
static void test_sharp(void **state) {
    static const float turn[3] = {0, 0.5f, 0};
    static const SharpRow rows[] = {{"glass", "lamp", "glass.eta.value", &of_pane, one, 1, 1 << 15},
                                    {"coat", "lamp", "coat.eta.value", &of_pane, one, 1, 1 << 15},
                                    {"blend", "sun", "glass.eta.value", &of_pane, one, 1, 1 << 15},
                                    {"turned", "lamp", "glass.eta.value", &of_pane, one, 1, 1 << 15},
                                    {"turned", "lamp", "turned.normalmap.value", &of_pane, turn, 3, 1 << 15},
                                    {"glass", "lamp", "pane.normals", &of_pane, tilt, 12, 1 << 15},
                                    {"glass", "sun", "pane.normals", &of_plain_floor, tilt, 12, 1 << 15},
                                    {"glass", "lamp", "glass.eta.value", &in_mirror, one, 1, 1 << 16},
                                    {"coat", "sun", "coat.eta.value", &of_floor, one, 1, 1 << 15},
                                    {"holes", "sun", "glass.eta.value", &of_pane, one, 1, 1 << 15},
                                    {"silvered", "sun", "glass.eta.value", &of_pane, one, 1, 1 << 15},
                                    {"glass", "sun", "glass.eta.value", &veiled_pane, one, 1, 1 << 16},
                                    {"coat", "sun", "coat.eta.value", &veiled_floor, one, 1, 1 << 15}};
    (void)state;
    check_rows("rim_sharp", rows, COUNT_OF(rows));
}

// What moves surfaces, the sensor and lights, and what turns mirrors, moves it, too.
static void test_moves(void **state) {
    static const float shift[12] = {0, 1, 0.3f, 0, 1, 0.3f, 0, 1, 0.3f, 0, 1, 0.3f}, place[3] = {1, 0.3f, 0.5f};
    static const float nod[12] = {0, 0, 0.3f, 0, 0, 0.3f, 0, 0, 0.3f, 0, 0, 0.3f};
    static const float more[12] = {0, 0, 3, 0, 0, 3, 0, 0, 3, 0, 0, 3}; // differences of small steps are noisy there
    static const float along[16] = {[3] = 1, [7] = 0.5f}, up[16] = {[11] = 1}, swing[16] = {[2] = 0.3f, [6] = 0.5f, [10] = -0.5f};
    static const SharpRow rows[] = {{"glass", "lamp", "pane.positions", &of_pane, shift, 12, 1 << 15},
                                    {"coat", "lamp", "sensor_0.to_world", &of_pane, along, 16, 1 << 15},
                                    {"glass", "lamp", "light.position", &of_pane, place, 3, 1 << 15},
                                    {"glass", "sun", "light.to_world", &of_plain_floor, swing, 16, 1 << 15},
                                    {"glass", "sun", "floor.to_world", &of_plain_floor, up, 16, 1 << 15},
                                    {"coat", "sun", "sensor_0.to_world", &of_plain_floor, along, 16, 1 << 15},
                                    {"glass", "lamp", "back.normals", &in_mirror, nod, 12, 1 << 14},
                                    {"glass", "sun", "back.positions", &in_mirror, shift, 12, 1 << 15},
                                    {"glass", "lamp", "back.normals", &beside_mirror, more, 12, 1 << 16}};
    (void)state;
    check_rows("rim_sharp", rows, COUNT_OF(rows));
}

// In haze collisions see it, too. Masks may shade it there: they let light pass to surfaces.
static void test_haze(void **state) {
    static const float shift[16] = {[7] = 1, [11] = 0.3f}, along[16] = {[3] = 1, [7] = 0.5f}, place[3] = {1, 0.3f, 0.5f};
    static const float swing[16] = {[2] = 0.3f, [6] = 0.5f, [10] = -0.5f};
    static const float nod[16] = {[6] = -3, [9] = 3};
    static const SharpRow rows[] = {{"glass", "lamp", "glass.eta.value", &of_pane, one, 1, 1 << 15},
                                    {"glass", "lamp", "glass.eta.value", &in_mirror, one, 1, 1 << 15},
                                    {"glass", "lamp", "pane.to_world", &of_pane, shift, 16, 1 << 15},
                                    {"coat", "lamp", "sensor_0.to_world", &of_pane, along, 16, 1 << 15},
                                    {"glass", "lamp", "light.position", &of_pane, place, 3, 1 << 15},
                                    {"coat", "sun", "coat.eta.value", &of_haze, one, 1, 1 << 15},
                                    {"glass", "sun", "light.to_world", &of_haze, swing, 16, 1 << 15},
                                    {"coat", "sun", "pane.to_world", &of_haze, nod, 16, 1 << 17},
                                    {"coat", "sun", "sensor_0.to_world", &of_haze, along, 16, 1 << 15},
                                    {"glass", "lamp", "glass.eta.value", &shaded_pane, one, 1, 1 << 15},
                                    {"coat", "sun", "coat.eta.value", &shaded_haze, one, 1, 1 << 16}};
    (void)state;
    check_rows("rim_haze", rows, COUNT_OF(rows));
}

static double derivative_of(Room room, const char *name, int spp) {
    rey_render_def def = rey_default_render_def();
    float derivative[VALUES];
    int param = rey_param_find(room.scene, name);
    def.spp = spp;
    assert_int_equal(rey_jvp(room.scene, &def, (rey_selection){&param, 1}, one, derivative, NULL, NULL), REY_OK);
    rim_close(room);
    return mean_of(derivative);
}

// The same samples at every width.
static void test_widths(void **state) {
    static const char *const kinds[] = {"glass", "coat"}, *const names[] = {"glass.eta.value", "coat.eta.value"};
    (void)state;
    Room any = rim_open("glass", "ggx", "0.7", "constant", "path", 0);
    const int widest = rey_lanes(any.ctx);
    rim_close(any);
    for (int i = 0; i < 2; i++) {
        double first = 0, seen = 0, carried = 0, flown = 0;
        for (int lanes = 1; lanes <= widest; lanes = lanes == 1 ? 8 : 2 * lanes) {
            double found = derivative_of(rim_open(kinds[i], "ggx", "-0.7", "constant", "path", lanes), names[i], 4096);
            double view = derivative_of(sharp_open("rim_sharp", kinds[i], "lamp", &in_mirror, lanes), names[i], 1024);
            double lit = derivative_of(sharp_open("rim_sharp", kinds[i], "sun", &of_floor, lanes), names[i], 1024);
            double hazy = derivative_of(sharp_open("rim_haze", kinds[i], "sun", &of_haze, lanes), names[i], 1024);
            first = lanes == 1 ? found : first;
            seen = lanes == 1 ? view : seen;
            carried = lanes == 1 ? lit : carried;
            flown = lanes == 1 ? hazy : flown;
            assert_true(fabs(found - first) < 1e-3 * fabs(first));
            assert_true(fabs(view - seen) < 0.02 * fabs(seen)); // strips end elsewhere by rounding, and are looked for again
            assert_true(fabs(lit - carried) < 1e-3 * fabs(carried));
            assert_true(fabs(hazy - flown) < 0.02 * fabs(flown));
        }
    }
}

static rey_result derive(Room room, const char *name) {
    rey_render_def def = rey_default_render_def();
    double gradient[16];
    float adjoint[VALUES] = {0};
    int param = rey_param_find(room.scene, name);
    assert_true(param >= 0);
    def.spp = 16;
    return rey_vjp(room.scene, &def, (rey_selection){&param, 1}, adjoint, gradient, NULL, NULL);
}

// What would be incomplete is refused, and nothing else.
static void test_refused(void **state) {
    static const struct {
        const char *kind, *facets, *light, *integrator, *param, *expected;
    } rows[] = {{"glass", "ggx", "directional", "path", "glass.eta.value", NULL},
                {"coat", "ggx", "directional", "direct", "coat.eta.value", NULL},
                {"blend", "ggx", "directional", "path", "pane.to_world", NULL},
                {"glass", "ggx", "directional", "path", "emitter_0.to_world", NULL},
                {"glass", "ggx", "directional", "volpath", "pane.to_world", NULL},
                {"glass", "ggx", "constant", "ptracer", "pane.to_world", NULL},
                {"glass", "ggx", "directional", "volpath", "glass.eta.value", NULL},
                {"glass", "ggx", "constant", "ptracer", "glass.eta.value", NULL},
                {"glass", "ggx", "directional", "path", "glass.alpha_u.value", NULL},
                {"glass", "beckmann", "directional", "path", "glass.eta.value", NULL},
                {"glass", "ggx", "constant", "path", "glass.eta.value", NULL}};
    (void)state;
    for (size_t i = 0; i < COUNT_OF(rows); i++) {
        Room room = rim_open(rows[i].kind, rows[i].facets, "0.7", rows[i].light, rows[i].integrator, 0);
        rey_result result = derive(room, rows[i].param);
        if (!rows[i].expected && result != REY_OK) {
            fail_msg("row %zu: %s", i, rey_error(room.ctx));
        }
        if (rows[i].expected && (result != REY_ERROR_INCOMPLETE || !strstr(rey_error(room.ctx), rows[i].expected))) {
            fail_msg("row %zu: %d '%s'", i, (int)result, rey_error(room.ctx));
        }
        rim_close(room);
    }
}

// Arguments: what the names of tests begin with.
int main(int argc, char **argv) {
    struct CMUnitTest tests[] = {cmocka_unit_test(test_index), cmocka_unit_test(test_turn),   cmocka_unit_test(test_sharp),
                                 cmocka_unit_test(test_moves), cmocka_unit_test(test_haze),  cmocka_unit_test(test_widths),
                                 cmocka_unit_test(test_refused)};
    size_t count = tests_asked(tests, COUNT_OF(tests), argc, argv);
    return _cmocka_run_group_tests("rim", tests, count, NULL, NULL);
}
