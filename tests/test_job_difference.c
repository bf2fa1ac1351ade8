// test_job_difference.c: which key of a job changed.
#include "fit/job.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

static void first_difference_is_named(void **state) {
    static const struct {
        const char *a, *b, *key;
    } cases[] = {{"a: 1\nb: 2\nc: 3\n", "a: 1\nb: 4\nc: 3\n", "b"}, {"a: 1\nc: 3\n", "a: 1\nb: 2\nc: 3\n", "b"},
                 {"a: 1\nb: 2\nc: 3\n", "a: 1\nc: 3\n", "b"},       {"a: 1\n", "a: 1\nc: 3\n", "c"},
                 {"b.x: 1\n", "b: 1\nb.x: 1\n", "b"},                {"a: 1\nc: 3\n", "a: 1\nd: 3\n", "c"}};
    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        char key[64];
        assert_true(rey_job_difference(cases[i].a, cases[i].b, key, sizeof key));
        assert_string_equal(key, cases[i].key);
        assert_false(rey_job_difference(cases[i].a, cases[i].a, key, sizeof key));
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(first_difference_is_named)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
