// Grids of numbers in VOL files: what is read, what is refused and at which byte, and that writing gives the same bits
// back.
#include "io/file.h"
#include "io/grid.h"
#include "io/image.h"
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
    float values[VALUES];
    rey_vol v, again;
    rey_grid grid;
    make_file(bytes);
    assert_int_equal(rey_vol_read_memory(*state, "v", bytes, sizeof bytes, &v), REY_OK);
    check_grid(&v);
    snprintf(path, sizeof path, "/tmp/reynolds_vol_%ld.vol", (long)getpid());
    assert_int_equal(rey_vol_write(*state, path, &v), REY_OK);
    assert_int_equal(rey_grid_open(*state, path, &grid), REY_OK);
    assert_int_equal(rey_grid_count(&grid), VALUES);
    again = (rey_vol){.nx = grid.nx, .ny = grid.ny, .nz = grid.nz, .channels = grid.channels, .data = values};
    memcpy(again.box, grid.box, sizeof again.box);
    assert_int_equal(rey_grid_read(*state, &grid, values), REY_OK);
    rey_grid_close(*state, &grid);
    unlink(path);
    check_grid(&again);
    rey_vol_free(*state, &v);
    assert_int_equal(rey_grid_open(*state, path, &grid), REY_ERROR_IO);
    assert_int_equal(rey_grid_open(*state, "/tmp", &grid), REY_ERROR_IO);
}

// Versions 1 to 3 differ in nothing that is read; half floats and bytes take less room.
static void test_encodings(void **state) {
    static const uint16_t halves[] = {0x3c00, 0xc000, 0x0001, 0x7bff, 0x3555, 0x0000};
    static const float expected[] = {1, -2, 0x1p-24f, 65504, 0x1.554p-2f, 0};
    unsigned char bytes[BYTES];
    rey_vol v;
    for (uint32_t version = 1; version <= 3; version++) {
        make_file(bytes);
        bytes[3] = (unsigned char)version;
        assert_int_equal(rey_vol_read_memory(*state, "v", bytes, sizeof bytes, &v), REY_OK);
        check_grid(&v);
        rey_vol_free(*state, &v);
    }
    put(bytes + 4, VOL_HALF);
    put(bytes + 20, 1);
    for (int i = 0; i < 6; i++) {
        bytes[HEADER + 2 * i] = halves[i] & 255;
        bytes[HEADER + 2 * i + 1] = (unsigned char)(halves[i] >> 8);
    }
    assert_int_equal(rey_vol_read_memory(*state, "v", bytes, HEADER + 12, &v), REY_OK);
    assert_memory_equal(v.data, expected, sizeof expected);
    rey_vol_free(*state, &v);
    assert_int_equal(rey_vol_read_memory(*state, "v", bytes, HEADER + 11, &v), REY_ERROR_FORMAT);
    bytes[HEADER + 1] = 0x7c;
    assert_int_equal(rey_vol_read_memory(*state, "v", bytes, HEADER + 12, &v), REY_ERROR_FORMAT);
    put(bytes + 4, VOL_BYTE);
    bytes[HEADER] = 0;
    bytes[HEADER + 5] = 255;
    assert_int_equal(rey_vol_read_memory(*state, "v", bytes, HEADER + 6, &v), REY_OK);
    assert_true(v.data[0] == 0 && v.data[5] == 1);
    rey_vol_free(*state, &v);
}

// For a grid of known size, channels may lie side by side along x.
static void test_sizes(void **state) {
    static const float data[24] = {0.5f, 1, 2, [23] = 7};
    static const struct {
        int64_t shape[4];
        int dims;
        const char *words;
    } cases[] = {{{1, 2, 4, 3}, 4, NULL},
                 {{1, 2, 12}, 3, NULL},
                 {{1, 4, 2, 3}, 4, "holds 1 x 4 x 2 x 3 numbers, expected 1 x 2 x 4 x 3 (z, y, x, channels)"},
                 {{2, 1, 12}, 3, "holds 2 x 1 x 12 x 1 numbers"},
                 {{1, 2, 3, 4}, 4, "holds 1 x 2 x 3 x 4 numbers"},
                 {{1, 2, 4, 2}, 4, "holds 1 x 2 x 4 x 2 numbers"}};
    char path[64];
    float values[24];
    snprintf(path, sizeof path, "/tmp/reynolds_vol_%ld.npy", (long)getpid());
    for (int i = 0; i < COUNT_OF(cases); i++) {
        assert_int_equal(rey_npy_write(*state, path, data, cases[i].shape, cases[i].dims), REY_OK);
        rey_result result = rey_grid_read_as(*state, path, (const int32_t[3]){4, 2, 1}, 3, values);
        unlink(path);
        assert_int_equal(result, cases[i].words ? REY_ERROR_PARAM : REY_OK);
        if (cases[i].words) {
            assert_non_null(strstr(rey_error(*state), cases[i].words));
        } else {
            assert_memory_equal(values, data, sizeof data);
        }
    }
    assert_int_equal(rey_grid_read_as(*state, path, (const int32_t[3]){4, 2, 1}, 3, values), REY_ERROR_IO);
}

// Arrays of Z x Y x X, and with channels.
static void test_npy(void **state) {
    static const float data[24] = {0.5f, 1, 2, [23] = 7};
    const int64_t shapes[3][4] = {{2, 3, 4, 0}, {1, 2, 4, 3}, {4, 6, 0, 0}};
    char path[64];
    float values[24];
    rey_grid grid;
    snprintf(path, sizeof path, "/tmp/reynolds_vol_%ld.npy", (long)getpid());
    for (int i = 0; i < 3; i++) {
        int dims = i == 0 ? 3 : i == 1 ? 4 : 2;
        assert_int_equal(rey_npy_write(*state, path, data, shapes[i], dims), REY_OK);
        rey_result result = rey_grid_open(*state, path, &grid);
        unlink(path);
        if (dims == 2) {
            assert_int_equal(result, REY_ERROR_FORMAT);
            assert_non_null(strstr(rey_error(*state), "an array of 2 dimensions and 24 numbers is no grid"));
            continue;
        }
        assert_int_equal(result, REY_OK);
        assert_true(grid.nz == shapes[i][0] && grid.ny == shapes[i][1] && grid.nx == shapes[i][2]);
        assert_true(grid.channels == (i ? 3 : 1) && grid.box[0] == 0 && grid.box[5] == 1);
        assert_int_equal(rey_grid_read(*state, &grid, values), REY_OK);
        rey_grid_close(*state, &grid);
        assert_memory_equal(values, data, sizeof data);
    }
    assert_int_equal(
        rey_file_write(*state, path,
                       "\x93NUMPY\1\0\x4a\0{'descr': '<f4', 'fortran_order': False, 'shape': (1048576, 1048576, 9), }     ", 84),
        REY_OK);
    assert_int_equal(rey_grid_open(*state, path, &grid), REY_ERROR_FORMAT);
    unlink(path);
    assert_non_null(strstr(rey_error(*state), "the file ends before its array of 9895604649984 numbers"));
}

static void test_refused(void **state) {
    static const struct {
        int at; // byte that gets a value
        uint32_t value;
        const char *message;
    } cases[] = {{0, 0, "v: byte 0: not a VOL file"},
                 {4, 4, "v: byte 3: version 3, encoding 4"},
                 {0, 0x044c4f56, "v: byte 3: version 4, encoding 1"},
                 {0, 0x004c4f56, "v: byte 3: version 0, encoding 1"},
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
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_written_is_read), cmocka_unit_test(test_encodings),
                                       cmocka_unit_test(test_npy), cmocka_unit_test(test_sizes), cmocka_unit_test(test_refused),
                                       cmocka_unit_test(test_truncated)};
    return cmocka_run_group_tests(tests, open_context, close_context);
}
