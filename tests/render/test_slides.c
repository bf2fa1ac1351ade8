// The term `interior` of cameras and poses where the surfaces are grids of distances (shape/sdfgrid_move.h) and cones, of
// which no silhouette is seen: against differences of pictures.
#include "rooms.h"

enum { VALUES = 8 * 8 * 3 };

static double mean_of(const float *values) {
    double sum = 0;
    for (int k = 0; k < VALUES; k++) {
        sum += (double)values[k];
    }
    return sum / VALUES;
}

static Room slides_open(const char *kind) {
    const rey_define define = {"kind", kind};
    rey_context_def def = rey_default_context_def();
    Room room;
    assert_int_equal(rey_context_create(&def, &room.ctx), REY_OK);
    if (rey_scene_load(room.ctx, RENDER_DIR "/slides.xml", &define, 1, &room.scene) != REY_OK) {
        fail_msg("%s", rey_error(room.ctx));
    }
    return room;
}

static double picture_at(Room room, int param, const float *value, const float *tangent, double step) {
    rey_render_def def = rey_default_render_def();
    float image[VALUES], moved[16];
    def.spp = 4096;
    for (int k = 0; k < 16; k++) {
        moved[k] = value[k] + (float)step * tangent[k];
    }
    assert_int_equal(rey_param_set(room.scene, param, moved, 16), REY_OK);
    assert_int_equal(rey_render(room.scene, &def, image, NULL), REY_OK);
    return mean_of(image);
}

static void test_interior(void **state) {
    // along x, and a turn about z
    static const float along[16] = {[3] = 1}, turn[16] = {[1] = -1, [4] = 1, [3] = 0.5f, [7] = -0.5f};
    static const struct {
        const char *kind, *name;
        const float *tangent;
    } rows[] = {{"grid", "camera.to_world", along}, {"grid", "hills.to_world", along}, {"grid", "hills.to_world", turn},
                {"instance", "camera.to_world", along}, {"instance", "land.to_world", turn}, {"cone", "camera.to_world", along}};
    (void)state;
    for (size_t i = 0; i < COUNT_OF(rows); i++) {
        Room room = slides_open(rows[i].kind);
        rey_render_def def = rey_default_render_def();
        float derivative[VALUES], adjoint[VALUES], value[16];
        double gradient[16], product = 0;
        const double step = 0.002;
        int param = rey_param_find(room.scene, rows[i].name);
        const rey_selection selection = {&param, 1};
        def.spp = 4096;
        assert_int_equal(rey_jvp(room.scene, &def, selection, rows[i].tangent, derivative, NULL, NULL), REY_ERROR_INCOMPLETE);
        def.terms = REY_TERM_INTERIOR;
        memcpy(value, rey_param_values(room.scene, param), sizeof value);
        if (rey_jvp(room.scene, &def, selection, rows[i].tangent, derivative, NULL, NULL) != REY_OK) {
            fail_msg("%s", rey_error(room.ctx));
        }
        for (int k = 0; k < VALUES; k++) {
            adjoint[k] = 1.0f / VALUES;
        }
        assert_int_equal(rey_vjp(room.scene, &def, selection, adjoint, gradient, NULL, NULL), REY_OK);
        for (int k = 0; k < 16; k++) {
            product += gradient[k] * (double)rows[i].tangent[k];
        }
        double found = mean_of(derivative), above = picture_at(room, param, value, rows[i].tangent, step);
        double difference = (above - picture_at(room, param, value, rows[i].tangent, -step)) / (2 * step);
        print_message("%s %s: %g, difference %g\n", rows[i].kind, rows[i].name, found, difference);
        assert_true(fabs(found - difference) <= 2e-3 * fabs(difference));
        assert_true(fabs(difference) > 0.05);
        assert_true(fabs(product - found) <= 1e-4 * fabs(found));
        rey_scene_destroy(room.scene);
        rey_context_destroy(room.ctx);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_interior)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
