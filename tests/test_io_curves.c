// Text files of curves: what is read, what is refused and with which line, and that writing gives the same bits back.
#include "io/curve.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

static int open_context(void **state) { return rey_context_create(NULL, (rey_context **)state) != REY_OK; }

static int close_context(void **state) {
    rey_context_destroy(*state);
    return 0;
}

static void test_read(void **state) {
    static const char text[] = "\n0 0 0 .1\n1 0 0 .2 9\r\n1 1 0 .3\n2 2 2 .4\n3 3 3 .5\n \t\n\n4 0 0 0\n5 0 0 1\n6 0 0 1\n7 0 0 1";
    static const int32_t four[] = {0, 1, 5}, two[] = {0, 1, 2, 3, 5, 6, 7};
    rey_curves c;
    assert_int_equal(rey_curves_read_memory(*state, "c", text, sizeof text - 1, 4, &c), REY_OK);
    assert_int_equal(c.points.count, 9);
    assert_int_equal(c.segments.count, 3);
    assert_memory_equal(c.segments.data, four, sizeof four);
    assert_true(((float *)c.points.data)[7] == 0.2f);
    rey_curves_free(*state, &c);
    assert_int_equal(rey_curves_read_memory(*state, "c", text, sizeof text - 1, 2, &c), REY_OK);
    assert_memory_equal(c.segments.data, two, sizeof two);
    rey_curves_free(*state, &c);
}

static void test_written_is_read(void **state) {
    static const float points[] = {0.1f, 1e-30f, -3, 1, 1, 2, 3, 0, 1e20f, 1, 1, 1, 4, 4, 4, 4, 5, 6, 7, 8};
    static const int32_t segments[] = {0, 1, 3};
    char path[64];
    rey_curves c;
    snprintf(path, sizeof path, "/tmp/reynolds_curves_%ld.txt", (long)getpid());
    assert_int_equal(rey_curves_write(*state, path, points, segments, 3, 2), REY_OK);
    assert_int_equal(rey_curves_read(*state, path, 2, &c), REY_OK);
    unlink(path);
    assert_int_equal(c.points.count, 5);
    assert_memory_equal(c.points.data, points, sizeof points);
    assert_memory_equal(c.segments.data, segments, sizeof segments);
    rey_curves_free(*state, &c);
}

static void test_refused(void **state) {
    static const struct {
        const char *text, *message;
    } cases[] = {{"", "c: the file has no curves"},
                 {"\n\n", "c: the file has no curves"},
                 {"0 0 0 1\n1 0 0 1\n\n0 0 0 1", "c:3: a curve of 2 control points, expected at least 4"},
                 {"0 0 0 1\n1 0 0 1\n2 0 0 1\n", "c:3: a curve of 3 control points"},
                 {"0 0 0 1\n1 0 0\n", "c:2: expected 'x y z radius'"},
                 {"0 0 0 -1\n", "c:1: expected 'x y z radius'"},
                 {"0 0 nan 1\n", "c:1: expected"},
                 {"0 0 1e99 1\n", "c:1: expected"},
                 {"0 0 0 1x\n", "c:1: expected"},
                 {"# comment\n", "c:1: expected"}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        rey_curves c;
        assert_int_equal(rey_curves_read_memory(*state, "c", cases[i].text, strlen(cases[i].text), 4, &c), REY_ERROR_FORMAT);
        assert_null(c.points.data);
        assert_non_null(strstr(rey_error(*state), cases[i].message));
    }
    rey_curves c;
    assert_int_equal(rey_curves_read(*state, "/nowhere/c.txt", 4, &c), REY_ERROR_IO);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_read), cmocka_unit_test(test_written_is_read),
                                       cmocka_unit_test(test_refused)};
    return cmocka_run_group_tests(tests, open_context, close_context);
}
