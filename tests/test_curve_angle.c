// test_curve_angle.c: where u begins around a curve, and which way it grows: as in the pictures of the format's renderer.
#define LANES 1
#include "shape/curve.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

static void angles_begin_where_they_should(void **state) {
    // Tangent, and the direction of u = 0 that was measured there.
    static const float cases[][2][3] = {
        {{1, 0, 0}, {0, 1, 0}},
        {{0, 1, 0}, {-1, 0, 0}},
        {{0, 0, 1}, {1, 0, 0}},
        {{0, 0, -1}, {-1, 0, 0}},
        {{-0.632f, -0.726f, -0.269f}, {0.754f, -0.657f, 0}},
        {{0.697f, -0.198f, 0.690f}, {0.273f, 0.962f, 0}},
        {{-0.522f, 0.657f, -0.544f}, {-0.783f, -0.623f, 0}},
    };
    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        Vec3 t = v3_normalize(v3(cases[i][0][0], cases[i][0][1], cases[i][0][2]));
        Vec3 zero = v3(cases[i][1][0], cases[i][1][1], cases[i][1][2]), quarter = v3_cross(t, zero);
        for (int k = 0; k < 16; k++) {
            float angle = (float)(k + 0.25f) * (float)PI / 8;
            Vec3 radial = v3_madd(v3_scale(zero, cosf(angle)), sinf(angle), quarter);
            assert_float_equal(curve_angle(t, radial), angle, 4e-3);
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(angles_begin_where_they_should)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
