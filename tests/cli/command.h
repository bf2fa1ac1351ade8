// command.h: runs the command in a folder of its own and keeps what it says.
#pragma once

#include "json_read.h"
#include "../folder.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

enum { OUTPUT_BYTES = 1 << 17 };

typedef struct Fixture {
    char folder[64];
    char out[OUTPUT_BYTES], words[OUTPUT_BYTES]; // of the latest command
} Fixture;

static inline int make_folder(void **state) {
    static Fixture fixture;
    snprintf(fixture.folder, sizeof fixture.folder, "/tmp/reynolds-test-XXXXXX");
    *state = &fixture;
    return !folder_make(fixture.folder) || chdir(fixture.folder);
}

static inline int remove_folder(void **state) {
    Fixture *f = *state;
    return chdir("/") || folder_remove(f->folder);
}

static inline void read_text(const char *path, char *text) {
    FILE *file = fopen(path, "rb");
    assert_non_null(file);
    text[fread(text, 1, OUTPUT_BYTES - 1, file)] = 0;
    fclose(file);
}

// Runs `reynolds ARGUMENTS` in the test's folder and returns the exit status; %s in arguments is the scene.
static inline int run(Fixture *f, const char *arguments) {
    char command[4096], filled[2048];
    snprintf(filled, sizeof filled, arguments, TEST_SCENE);
    snprintf(command, sizeof command, "'%s' %s >out.txt 2>words.txt", REYNOLDS_COMMAND, filled);
    int status = system(command);
    read_text("out.txt", f->out);
    read_text("words.txt", f->words);
    if (!WIFEXITED(status)) {
        return -1;
    }
    return WEXITSTATUS(status);
}

static inline void expect(Fixture *f, int status, const char *arguments) {
    int found = run(f, arguments);
    if (found != status) {
        print_error("reynolds %s: exit %d, expected %d\n%s\n", arguments, found, status, f->words);
    }
    assert_int_equal(found, status);
}

// The same, with words on standard error.
static inline void expect_words(Fixture *f, int status, const char *arguments, const char *words) {
    expect(f, status, arguments);
    if (!strstr(f->words, words)) {
        fail_msg("reynolds %s: '%s', expected '%s'", arguments, f->words, words);
    }
}

// The same, with words on either.
static inline void expect_said(Fixture *f, int status, const char *arguments, const char *words) {
    expect(f, status, arguments);
    if (!strstr(f->words, words) && !strstr(f->out, words)) {
        fail_msg("reynolds %s: '%s%s', expected '%s'", arguments, f->out, f->words, words);
    }
}

static inline void write_words(const char *path, const char *words) {
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    fputs(words, file);
    assert_int_equal(fclose(file), 0);
}

static inline JsonNode *run_json(Fixture *f, int status, const char *arguments) {
    expect(f, status, arguments);
    JsonNode *node = json_read("out.txt");
    assert_non_null(node);
    assert_int_equal(node->kind, JSON_OBJECT);
    return node;
}
