// Grids of numbers in VOL files: what is read, what is refused and at which byte, and that writing gives the same bits
// back.
#include "io/vol.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

enum { HEADER = 48, VALUES = 12, BYTES = HEADER + 4 * VALUES };

static int open_context(void **state) { return rey_context_create(NULL, (rey_context **)state) != REY_OK; }

static int close_context(void **state) {
    rey_context_destroy(*state);
    return 0;
}

static void put(unsigned char *at, uint32_t value) {
    for (int i = 0; i < 4; i++) {
        at[i] = (unsigned char)(value >> (8 * i));
    }
}

static void put_float(unsigned char *at, float value) {
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    put(at, bits);
}

// 2 x 3 x 1 nodes of 2 channels, values 0.5, 1.5, ...
static void make_file(unsigned char *bytes) {
    static const uint32_t header[5] = {1, 2, 3, 1, 2};
    memcpy(bytes, "VOL\3", 4);
    for (int i = 0; i < 5; i++) {
        put(bytes + 4 + 4 * i, header[i]);
    }
    for (int i = 0; i < 6; i++) {
        put_float(bytes + 24 + 4 * i, (float)i);
    }
    for (int i = 0; i < VALUES; i++) {
        put_float(bytes + HEADER + 4 * i, (float)i + 0.5f);
    }
}

static void check_grid(const rey_vol *v) {
    assert_true(v->nx == 2 && v->ny == 3 && v->nz == 1 && v->channels == 2);
    assert_true(v->box[0] == 0 && v->box[5] == 5);
    assert_true(v->data[0] == 0.5f && v->data[VALUES - 1] == 11.5f);
}

static void test_written_is_read(void **state) {
    unsigned char bytes[BYTES];
    char path[64];
    rey_vol v, again;
    make_file(bytes);
    assert_int_equal(rey_vol_read_memory(*state, "v", bytes, sizeof bytes, &v), REY_OK);
    check_grid(&v);
    snprintf(path, sizeof path, "/tmp/reynolds_vol_%ld.vol", (long)getpid());
    assert_int_equal(rey_vol_write(*state, path, &v), REY_OK);
    assert_int_equal(rey_vol_read(*state, path, &again), REY_OK);
    unlink(path);
    check_grid(&again);
    rey_vol_free(*state, &v);
    rey_vol_free(*state, &again);
    assert_int_equal(rey_vol_read(*state, path, &v), REY_ERROR_IO);
}

static void test_refused(void **state) {
    static const struct {
        int at; // byte that gets a value
        uint32_t value;
        const char *message;
    } cases[] = {{0, 0, "v: byte 0: not a VOL file"},
                 {4, 3, "v: byte 3: version 3, encoding 3"},
                 {8, 0, "v: byte 8: 0 is no number of nodes"},
                 {12, UINT32_MAX, "v: byte 12: -1 is no number of nodes"},
                 {16, 1u << 20, "v: byte 96: the file ends inside its data"},
                 {20, 1u << 30, "v: byte 20: 1073741824 is no number of channels"},
                 {24, 0x7fc00000, "v: byte 24: a corner of the box is not finite"},
                 {44, 0x7f800000, "v: byte 44: a corner of the box is not finite"},
                 {HEADER + 8, 0xff800000, "v: byte 56: the value is not finite"}};
    for (int i = 0; i < COUNT_OF(cases); i++) {
        unsigned char bytes[BYTES];
        rey_vol v;
        make_file(bytes);
        put(bytes + cases[i].at, cases[i].value);
        assert_int_equal(rey_vol_read_memory(*state, "v", bytes, sizeof bytes, &v), REY_ERROR_FORMAT);
        assert_null(v.data);
        if (strncmp(rey_error(*state), cases[i].message, strlen(cases[i].message)) != 0) {
            fail_msg("%s, expected %s", rey_error(*state), cases[i].message);
        }
    }
}

static void test_truncated(void **state) {
    unsigned char bytes[BYTES];
    make_file(bytes);
    for (size_t size = 0; size < sizeof bytes; size++) {
        unsigned char *part = malloc(size + 1); // no longer than what is read, for the sanitizer
        rey_vol v;
        assert_non_null(part);
        memcpy(part, bytes, size);
        assert_int_equal(rey_vol_read_memory(*state, "v", part, size, &v), REY_ERROR_FORMAT);
        assert_null(v.data);
        free(part);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_written_is_read), cmocka_unit_test(test_refused),
                                       cmocka_unit_test(test_truncated)};
    return cmocka_run_group_tests(tests, open_context, close_context);
}
