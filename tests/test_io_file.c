// test_io_file.c: files written whole: through links, into pipes and devices, past limits, under long names.
#include "io/file.h"
#include "io/file_stale.h"
#include "folder.h"

#include <errno.h>
#include <fcntl.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

typedef struct Fixture {
    rey_context *ctx;
    char folder[64];
} Fixture;

static int set_up(void **state) {
    static Fixture f;
    *state = &f;
    snprintf(f.folder, sizeof f.folder, "/tmp/reynolds_test_file_XXXXXX");
    return rey_context_create(NULL, &f.ctx) || !folder_make(f.folder) || chdir(f.folder);
}

static int tear_down(void **state) {
    Fixture *f = *state;
    rey_context_destroy(f->ctx);
    return chdir("/") || folder_remove(f->folder);
}

static void expect_content(Fixture *f, const char *path, const char *text) {
    unsigned char *bytes;
    size_t size;
    assert_int_equal(rey_file_read(f->ctx, path, &bytes, &size), REY_OK);
    assert_string_equal((const char *)bytes, text);
    rey_free(f->ctx, bytes);
}

static void expect_write(Fixture *f, const char *path, const char *text) {
    if (rey_file_check_output(f->ctx, path) || rey_file_write(f->ctx, path, text, strlen(text))) {
        fail_msg("%s", rey_error(f->ctx));
    }
}

// Both the question beforehand and the writing refuse; nothing is left in the folder.
static void expect_refusal(Fixture *f, const char *path, const char *words) {
    assert_int_equal(rey_file_check_output(f->ctx, path), REY_ERROR_IO);
    assert_int_equal(rey_file_write(f->ctx, path, "x", 1), REY_ERROR_IO);
    if (!strstr(rey_error(f->ctx), words)) {
        fail_msg("'%s', expected '%s'", rey_error(f->ctx), words);
    }
}

static void links_stay_links(void **state) {
    Fixture *f = *state;
    struct stat status;
    assert_int_equal(mkdir("far", 0777), 0);
    assert_int_equal(symlink("far/file", "link"), 0);
    expect_write(f, "link", "one"); // leads to nothing yet
    expect_write(f, "link", "two");
    assert_int_equal(lstat("link", &status), 0);
    assert_true(S_ISLNK(status.st_mode));
    expect_content(f, "far/file", "two");
    assert_int_equal(symlink("circle", "circle"), 0);
    expect_refusal(f, "circle", "Too many levels");
}

static void devices_and_pipes_are_written(void **state) {
    Fixture *f = *state;
    struct stat before, after;
    assert_int_equal(stat("/dev/null", &before), 0);
    expect_write(f, "/dev/null", "nothing");
    assert_int_equal(stat("/dev/null", &after), 0);
    assert_true(S_ISCHR(after.st_mode) && before.st_ino == after.st_ino);
    assert_int_equal(mkfifo("pipe", 0600), 0);
    pid_t child = fork();
    if (child == 0) {
        char text[8] = "";
        int file = open("pipe", O_RDONLY);
        _exit(file < 0 || read(file, text, 4) != 4 || strcmp(text, "fifo"));
    }
    int code = -1;
    expect_write(f, "pipe", "fifo");
    assert_int_equal(waitpid(child, &code, 0), child);
    assert_int_equal(code, 0);
    if (access("/dev/full", W_OK) == 0) {
        assert_int_equal(rey_file_write(f->ctx, "/dev/full", "x", 1), REY_ERROR_IO);
        assert_non_null(strstr(rey_error(f->ctx), "No space left"));
    }
}

static void names_may_be_long(void **state) {
    Fixture *f = *state;
    char name[257];
    memset(name, 'n', 255);
    name[255] = 0;
    expect_write(f, name, "long");
    expect_content(f, name, "long");
    name[255] = 'n';
    name[256] = 0;
    expect_refusal(f, name, "too long");
}

static void wrong_places_are_refused(void **state) {
    Fixture *f = *state;
    assert_int_equal(mkdir("folder", 0777), 0);
    expect_refusal(f, "", "empty");
    expect_refusal(f, "folder", "is a folder");
    expect_refusal(f, "new/", "names a folder");
    expect_refusal(f, "nowhere/file", "No such file");
}

static void modes_are_those_of_other_files(void **state) {
    Fixture *f = *state;
    struct stat status;
    mode_t former = umask(027);
    expect_write(f, "modes", "1");
    umask(former);
    assert_int_equal(stat("modes", &status), 0);
    assert_int_equal(status.st_mode & 0777, 0640);
    assert_int_equal(chmod("modes", 0604), 0);
    expect_write(f, "modes", "2");
    assert_int_equal(stat("modes", &status), 0);
    assert_int_equal(status.st_mode & 0777, 0604);
}

// The limit's signal must not end the program, the former file stays, and no temporary one does.
static void make_empty(const char *path) {
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    assert_int_equal(fclose(file), 0);
}

// What a killed process left is removed; what another one, or one of another machine, may be writing is not.
static void what_the_killed_left_is_removed(void **state) {
    Fixture *f = *state;
    char stale[256], own[256], foreign[256], output[256], name[64];
    pid_t child = fork();
    if (child == 0) {
        _exit(0);
    }
    int status;
    assert_true(child > 0 && waitpid(child, &status, 0) == child);
    rey_file_temporary_name(name, sizeof name, 7);
    snprintf(own, sizeof own, "%s/%s", f->folder, name);
    char *process = strchr(name + strlen(".reynolds-"), '-');
    assert_non_null(process);
    snprintf(stale, sizeof stale, "%s/%.*s-%lx-7", f->folder, (int)(process - name), name, (long)child);
    snprintf(foreign, sizeof foreign, "%s/.reynolds-0-%lx-7", f->folder, (long)child);
    snprintf(output, sizeof output, "%s/picture.exr", f->folder);
    make_empty(stale);
    make_empty(own);
    make_empty(foreign);
    assert_int_equal(rey_file_check_output(f->ctx, output), REY_OK);
    assert_int_not_equal(access(stale, F_OK), 0);
    assert_int_equal(access(own, F_OK), 0);
    assert_int_equal(access(foreign, F_OK), 0);
    assert_int_equal(unlink(own) | unlink(foreign), 0);
}

static void limits_are_errors(void **state) {
    Fixture *f = *state;
    expect_write(f, "limited", "former");
    pid_t child = fork();
    if (child == 0) {
        struct rlimit limit = {1000, 1000};
        static char bytes[2000];
        setrlimit(RLIMIT_FSIZE, &limit);
        rey_result result = rey_file_write(f->ctx, "limited", bytes, sizeof bytes);
        _exit(result == REY_ERROR_IO && strstr(rey_error(f->ctx), "too large") ? 0 : 1);
    }
    int code = -1;
    assert_int_equal(waitpid(child, &code, 0), child);
    assert_int_equal(code, 0);
    expect_content(f, "limited", "former");
    assert_int_equal(system("test -z \"$(ls -A | grep '^[.]reynolds')\""), 0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(links_stay_links),         cmocka_unit_test(devices_and_pipes_are_written),
        cmocka_unit_test(names_may_be_long),        cmocka_unit_test(wrong_places_are_refused),
        cmocka_unit_test(modes_are_those_of_other_files), cmocka_unit_test(limits_are_errors),
        cmocka_unit_test(what_the_killed_left_is_removed)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
