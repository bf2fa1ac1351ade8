// test_cli_edges.c: what users do at the edges: strange outputs, broken options, signals, unequal pictures.
#include "command.h"

static void outputs_may_be_devices(void **state) {
    Fixture *f = *state;
    expect(f, 0, "render %s -o /dev/null --spp 1");
    expect(f, 0, "render %s -o a.exr --spp 1");
    assert_int_equal(system("test -c /dev/null"), 0);
    assert_int_equal(system("ln -s real.exr link.exr"), 0);
    expect(f, 0, "render %s -o link.exr --spp 1");
    assert_int_equal(system("test -L link.exr && cmp -s real.exr a.exr"), 0);
}

// A closed terminal is an interrupt: the fit saves and can be resumed.
static void hangups_stop_fits(void **state) {
    (void)state;
    char command[4096];
    snprintf(command, sizeof command, "'%s' render '%s/truth.xml' -o target.exr --spp 16 2>words.txt",
             REYNOLDS_COMMAND, TEST_JOBS);
    assert_int_equal(system(command), 0);
    snprintf(command, sizeof command,
             "timeout --preserve-status -s HUP 1 '%s' fit '%s/job.yaml' --set views.0.target=$PWD/target.exr --set "
             "iterations=1000000 -o fit >out.txt 2>words.txt",
             REYNOLDS_COMMAND, TEST_JOBS);
    int status = system(command);
    assert_true(WIFEXITED(status));
    assert_int_equal(WEXITSTATUS(status), 130);
    assert_int_equal(access("fit/checkpoint.bin", R_OK), 0);
}

// -D and --spp of a fit are entries of its job.
static void fits_take_the_common_options(void **state) {
    (void)state;
    char command[4096];
    snprintf(command, sizeof command,
             "'%s' render '%s/truth.xml' -o target.exr --spp 16 2>words.txt && '%s' fit '%s/job.yaml' --set "
             "views.0.target=$PWD/target.exr --set iterations=2 -o short -D 'red=0.2, 0.3, 0.4' --spp 8 >out.txt 2>words.txt"
             " && grep -q 'red: .0.2, 0.3, 0.4.' short/job.resolved.yaml && grep -q 'spp: 8' short/job.resolved.yaml",
             REYNOLDS_COMMAND, TEST_JOBS, REYNOLDS_COMMAND, TEST_JOBS);
    assert_int_equal(system(command), 0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(outputs_may_be_devices),
        cmocka_unit_test(hangups_stop_fits),
        cmocka_unit_test(fits_take_the_common_options),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
