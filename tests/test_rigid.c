// Poses that turn and shift (fit/rigid.h).
#include "fit/pose.h"
#include "fit/rigid.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

// The gradient in a rotation vector and a shift against differences, near no turn and far from it; lengths stay, but for the scale.
static void test_rigid_poses(void **state) {
    (void)state;
    const float start[RIGID_VALUES] = {0.5f, -1, 0.2f, 3, 0.7f, 1.1f, 0.4f, -2, 0.1f, 0.3f, 2, 1, 0, 0, 0, 1};
    const double places[][SIMILAR_VARIABLES] = {
        {0}, {1e-6, 2e-6, -1e-6}, {0.7, -1.9, 0.4, 2, -1, 5}, {0.7, -1.9, 0.4, 2, -1, 5, -0.4}};
    for (int place = 0; place < 4; place++) {
        double variable[RIGID_VALUES] = {0}, gradient[RIGID_VALUES], weights[RIGID_VALUES];
        memcpy(variable, places[place], sizeof places[place]);
        for (int i = 0; i < RIGID_VALUES; i++) {
            weights[i] = gradient[i] = sin(3 * i + 1.0);
        }
        rey_rigid_gradient(start, variable, gradient);
        for (int k = 0; k < SIMILAR_VARIABLES; k++) {
            double quotient = 0;
            const double h = 1e-2;
            for (int sign = -1; sign <= 1; sign += 2) {
                float value[RIGID_VALUES];
                double moved[RIGID_VALUES];
                memcpy(moved, variable, sizeof moved);
                moved[k] += sign * h;
                rey_rigid_pose(start, moved, value);
                for (int i = 0; i < RIGID_VALUES; i++) {
                    quotient += weights[i] * (double)value[i] * sign / (2 * h);
                }
                double squares[2] = {0, 0};
                for (int i = 0; i < 3; i++) {
                    squares[0] += (double)value[4 * i + 1] * (double)value[4 * i + 1];
                    squares[1] += (double)start[4 * i + 1] * (double)start[4 * i + 1];
                }
                double scale = exp(moved[RIGID_VARIABLES]);
                assert_float_equal(squares[0], scale * scale * squares[1], 1e-5);
            }
            assert_float_equal(gradient[k], quotient, 1e-3 * (1 + fabs(quotient)));
        }
        assert_true(gradient[7] == 0 && gradient[15] == 0);
    }
}

// A pose in words, from a rotation vector, a place and a scale; half a turn and a mirror are no special cases.
static void test_words(void **state) {
    (void)state;
    static const struct {
        double turn[3], scale;
        const char *words;
    } cases[] = {{{0, 0, 0}, 1, "1 2 3, turned 0 0 0 deg"},
                 {{0, 30, 0}, 1, "1 2 3, turned 0 30 0 deg"},
                 {{-20, 0, 10}, 2, "1 2 3, turned -20 0 10 deg, scale 2"},
                 {{0, 0, 180}, 1, "1 2 3, turned 0 0 180 deg"},
                 {{0, 179, 0}, 0.5, "1 2 3, turned 0 179 0 deg, scale 0.5"},
                 {{100, 100, -60}, 1, "1 2 3, turned 100 100 -60 deg"},
                 {{0, 0, 40}, -1, "1 2 3, turned 0 0 40 deg, scale -1"}};
    const float unit[RIGID_VALUES] = {1, 0, 0, 1, 0, 1, 0, 2, 0, 0, 1, 3, 0, 0, 0, 1};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        double variable[RIGID_VALUES] = {0}, size = fabs(cases[i].scale);
        float pose[RIGID_VALUES];
        char text[128];
        for (int k = 0; k < 3; k++) {
            variable[k] = cases[i].turn[k] * 3.14159265358979323846 / 180;
        }
        variable[RIGID_VARIABLES] = log(size);
        rey_rigid_pose(unit, variable, pose);
        for (int k = 0; k < 12; k++) {
            pose[k] = k % 4 == 3 || cases[i].scale > 0 ? pose[k] : -pose[k];
        }
        rey_pose_text(pose, NULL, text, sizeof text);
        assert_string_equal(text, cases[i].words);
        double angle = sqrt(cases[i].turn[0] * cases[i].turn[0] + cases[i].turn[1] * cases[i].turn[1] +
                            cases[i].turn[2] * cases[i].turn[2]);
        assert_float_equal(rey_pose_turned(unit, pose), angle, 0.1);
        assert_float_equal(rey_pose_distance(unit, pose), 0, 1e-6);
    }
    const float stretched[RIGID_VALUES] = {2, 0, 0, 4, 0, 1, 0, 2, 0, 0, 3, 7};
    char text[128];
    rey_pose_text(stretched, NULL, text, sizeof text);
    assert_string_equal(text, "4 2 7, turned 0 0 0 deg, scale 2 1 3");
    assert_float_equal(rey_pose_distance(unit, stretched), 5, 1e-6);
}

// Beyond half a turn, a rotation is told as the one that it is compared with, and not by its axis turned over.
static void test_words_of_half_turns(void **state) {
    (void)state;
    static const struct {
        double turn[3], near[3];
        const char *words[2]; // by itself, and near the other one
    } cases[] = {{{0, 181, 0}, {0, 178, 0}, {"0 -179 0", "0 181 0"}},
                 {{0, -181, 11}, {0, 178, -11}, {"0 178 -10.8", "0 178 -10.8"}},
                 {{0, 0, 30}, {0, 0, 40}, {"0 0 30", "0 0 30"}},
                 {{0, 0, 0}, {0, 0, 179}, {"0 0 0", "0 0 0"}}};
    const float unit[RIGID_VALUES] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        double variable[2][RIGID_VALUES] = {{0}, {0}};
        float pose[RIGID_VALUES], near[RIGID_VALUES];
        for (int k = 0; k < 3; k++) {
            variable[0][k] = cases[i].turn[k] * 3.14159265358979323846 / 180;
            variable[1][k] = cases[i].near[k] * 3.14159265358979323846 / 180;
        }
        rey_rigid_pose(unit, variable[0], pose);
        rey_rigid_pose(unit, variable[1], near);
        for (int k = 0; k < 2; k++) {
            char text[128], expected[128];
            rey_pose_text(pose, k ? near : NULL, text, sizeof text);
            snprintf(expected, sizeof expected, "0 0 0, turned %s deg", cases[i].words[k]);
            assert_string_equal(text, expected);
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_rigid_poses), cmocka_unit_test(test_words),
                                       cmocka_unit_test(test_words_of_half_turns)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
