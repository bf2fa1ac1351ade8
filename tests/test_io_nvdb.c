// NanoVDB files, as its own library wrote them: voxels of every type that is read, compressed and not, and what becomes of
// damaged ones.
#include "io/file.h"
#include "io/grid.h"

#include <blosc.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

enum { NX = 18, NY = 15, NZ = 7, RECORDS = 16 + 176 }; // of the block; bytes before the first grid's name

static int open_context(void **state) { return rey_context_create(NULL, (rey_context **)state) != REY_OK; }

static int close_context(void **state) {
    rey_context_destroy(*state);
    return 0;
}

static void sample_path(const char *name, char path[1024]) { snprintf(path, 1024, "%s/nvdb/%s.nvdb", TEST_DATA_DIR, name); }

// A block of voxels from (-5, 120, 3) to (12, 134, 9), across leaves and nodes, with a hole; outside is 0.
static float block(int x, int y, int z) {
    bool hole = x > 2 && x < 5 && y > 125;
    return hole ? 0 : 0.25f + 0.5f * (0.5f + 0.5f * sinf(0.7f * (float)x + 0.3f * (float)y - 0.5f * (float)z));
}

static void check_block(const float *values, float tolerance) {
    for (int i = 0; i < NX * NY * NZ; i++) {
        float expected = block(i % NX - 5, i / NX % NY + 120, i / NX / NY + 3);
        if (!(fabsf(values[i] - expected) <= (expected == 0 ? 0 : tolerance))) {
            fail_msg("voxel %d is %g, expected %g", i, (double)values[i], (double)expected);
        }
    }
}

static void test_types(void **state) {
    static const struct {
        const char *name;
        float tolerance;
    } cases[] = {{"float", 1e-6f}, {"double", 1e-6f}, {"blosc", 1e-6f}, {"fp4", 0.026f},
                 {"fp8", 1.6e-3f},  {"fp16", 6e-6f},  {"fpn", 1e-2f}};
    static const float box[6] = {-1.75f, 61.75f, 4.25f, 7.25f, 69.25f, 7.75f}; // half a unit a voxel, moved by (1, 2, 3)
    for (int i = 0; i < COUNT_OF(cases); i++) {
        char path[1024];
        float values[NX * NY * NZ];
        rey_grid grid;
        sample_path(cases[i].name, path);
        assert_int_equal(rey_grid_open(*state, path, &grid), REY_OK);
        assert_true(grid.nx == NX && grid.ny == NY && grid.nz == NZ && grid.channels == 1 && grid.placed);
        assert_memory_equal(grid.box, box, sizeof box);
        assert_int_equal(rey_grid_read(*state, &grid, values), REY_OK);
        rey_grid_close(*state, &grid);
        check_block(values, cases[i].tolerance);
    }
}

static void test_vectors(void **state) {
    char path[1024];
    float values[3 * 4 * 2 * 3];
    rey_grid grid;
    sample_path("vec3", path);
    assert_int_equal(rey_grid_open(*state, path, &grid), REY_OK);
    assert_true(grid.nx == 3 && grid.ny == 4 && grid.nz == 2 && grid.channels == 3);
    assert_int_equal(rey_grid_read(*state, &grid, values), REY_OK);
    rey_grid_close(*state, &grid);
    for (int i = 0; i < 24; i++) {
        const float expected[3] = {0.1f * (float)(i % 3), 0.1f * (float)(i / 3 % 4 + 6), 0.1f * (float)(i / 12)};
        for (int c = 0; c < 3; c++) {
            assert_true(fabsf(values[3 * i + c] - expected[c]) < 1e-6f);
        }
    }
}

// The same file without its compression.
static unsigned char *make_plain(rey_context *ctx, size_t *size) {
    char path[1024];
    unsigned char *packed;
    size_t packed_size;
    rey_nvdb nvdb;
    sample_path("float", path);
    assert_int_equal(rey_file_read(ctx, path, &packed, &packed_size), REY_OK);
    assert_int_equal(rey_nvdb_open(ctx, "packed", packed, packed_size, &nvdb), REY_OK);
    size_t grid = nvdb.size, head = RECORDS + 8; // "density" and its end
    unsigned char *plain = malloc(head + grid);
    assert_non_null(plain);
    memcpy(plain, packed, head);
    memcpy(plain + head, nvdb.own, grid);
    plain[14] = 0;
    rey_nvdb_free(ctx, &nvdb);
    rey_free(ctx, packed);
    *size = head + grid;
    return plain;
}

static rey_result read_bytes(rey_context *ctx, const unsigned char *bytes, size_t size, float *values) {
    rey_nvdb nvdb;
    rey_result result = rey_nvdb_open(ctx, "v", bytes, size, &nvdb);
    if (result == REY_OK) {
        result = nvdb.nx * nvdb.ny * nvdb.nz * nvdb.channels == NX * NY * NZ ? rey_nvdb_read(ctx, "v", &nvdb, values) : REY_OK;
        rey_nvdb_free(ctx, &nvdb);
    }
    return result;
}

static void test_plain(void **state) {
    float values[NX * NY * NZ];
    size_t size;
    unsigned char *plain = make_plain(*state, &size);
    assert_int_equal(read_bytes(*state, plain, size, values), REY_OK);
    check_block(values, 1e-6f);
    for (size_t part = 0; part < size - 64; part += part < 1024 ? 7 : 20011) { // no longer than what is read, for the sanitizer
        unsigned char *cut = malloc(part + 1);
        assert_non_null(cut);
        memcpy(cut, plain, part);
        assert_int_not_equal(read_bytes(*state, cut, part, values), REY_OK);
        free(cut);
    }
    free(plain);
}

static void store_size(unsigned char *at, size_t value) {
    for (int i = 0; i < 8; i++) {
        at[i] = (unsigned char)(value >> (8 * i));
    }
}

// The file with its grid in three Blosc chunks, of which the second is made as asked; begins[i]: where the size of chunk i stands.
static unsigned char *make_chunks(rey_context *ctx, const char *codec, int shuffle, size_t begins[4]) {
    enum { HEAD = RECORDS + 8, CHUNKS = 3 };
    size_t size, at = HEAD;
    unsigned char *plain = make_plain(ctx, &size), *packed = malloc(size + CHUNKS * (8 + BLOSC_MAX_OVERHEAD));
    assert_non_null(packed);
    memcpy(packed, plain, HEAD);
    packed[14] = 2;
    const size_t from[CHUNKS + 1] = {HEAD, HEAD + 1000, HEAD + (size - HEAD) / 2, size};
    for (int i = 0; i < CHUNKS; i++) {
        size_t length = from[i + 1] - from[i], room = length + BLOSC_MAX_OVERHEAD;
        int got = blosc_compress_ctx(i == 0 ? 0 : 9, i == 1 ? shuffle : 1, sizeof(float), length, plain + from[i], packed + at + 8,
                                     room, i == 1 ? codec : BLOSC_LZ4_COMPNAME, 1 << 18, 1);
        assert_true(got > 0);
        begins[i] = at;
        store_size(packed + at, (size_t)got);
        at += 8 + (size_t)got;
    }
    begins[CHUNKS] = at;
    free(plain);
    return packed;
}

static void test_chunks(void **state) {
    static const char *const codecs[] = {BLOSC_LZ4_COMPNAME, BLOSC_BLOSCLZ_COMPNAME, BLOSC_ZLIB_COMPNAME, BLOSC_ZSTD_COMPNAME};
    for (int i = 0; i < COUNT_OF(codecs); i++) {
        float values[NX * NY * NZ] = {0};
        size_t begins[4];
        unsigned char *packed = make_chunks(*state, codecs[i], i % 3, begins);
        assert_int_equal(read_bytes(*state, packed, begins[3], values), REY_OK);
        check_block(values, 1e-6f);
        free(packed);
    }
}

// Cut anywhere, or with bytes of a chunk's size, of its header or of its data changed.
static void test_damaged_chunks(void **state) {
    static const struct {
        int chunk;
        size_t at;      // from where its size stands
        uint32_t value; // four bytes
        const char *message;
    } cases[] = {{0, 0, 0, "v: the compressed grid is damaged after 0 of "},
                 {1, 0, 7, "v: the compressed grid is damaged after 1000 of "},
                 {1, 4, 1, "v: the file ends inside its compressed grid of "},
                 {1, 8, 0xffffffff, "v: the compressed grid is damaged after 1000 of "},  // version and flags
                 {1, 12, 0, "v: the compressed grid is damaged after 1000 of "},          // bytes in it
                 {1, 12, 0x7fffff00, "v: the compressed grid is damaged after 1000 of "},
                 {2, 12, 16, "v: the compressed grid is damaged after "},                 // fewer than there are
                 {1, 16, 0x7fffffff, "v: the compressed grid is damaged after 1000 of "}, // bytes in a block
                 {1, 20, 1, "v: the compressed grid is damaged after 1000 of "},          // compressed bytes
                 {1, 24, 0x7fffffff, "v: the compressed grid is damaged after 1000 of "}}; // where its first block begins
    float values[NX * NY * NZ];
    size_t begins[4];
    unsigned char *packed = make_chunks(*state, BLOSC_LZ4_COMPNAME, 1, begins);
    for (int i = 0; i < COUNT_OF(cases); i++) {
        unsigned char before[4], *at = packed + begins[cases[i].chunk] + cases[i].at;
        memcpy(before, at, 4);
        for (int k = 0; k < 4; k++) {
            at[k] = (unsigned char)(cases[i].value >> (8 * k));
        }
        rey_result result = read_bytes(*state, packed, begins[3], values);
        if (result == REY_OK || strncmp(rey_error(*state), cases[i].message, strlen(cases[i].message)) != 0) {
            fail_msg("case %d: %s, expected %s", i, result ? rey_error(*state) : "read", cases[i].message);
        }
        memcpy(at, before, 4);
    }
    for (size_t part = RECORDS + 8; part < begins[3]; part += 97) { // no longer than what is read, for the sanitizer
        unsigned char *cut = malloc(part);
        assert_non_null(cut);
        memcpy(cut, packed, part);
        assert_int_not_equal(read_bytes(*state, cut, part, values), REY_OK);
        assert_non_null(strstr(rey_error(*state), "v: the file ends inside its compressed grid of "));
        free(cut);
    }
    packed[16 + 7] = 1; // a grid of 2^56 bytes and more
    assert_int_equal(read_bytes(*state, packed, begins[3], values), REY_ERROR_FORMAT);
    assert_non_null(strstr(rey_error(*state), "v: the file ends inside its compressed grid of "));
    free(packed);
}

static void test_refused(void **state) {
    enum { GRID = RECORDS + 8, TREE = GRID + 672, ROOT = TREE + 64 };
    static const struct {
        size_t at; // byte that gets a value of four
        uint32_t value;
        const char *message;
    } cases[] = {{0, 0, "v: not a NanoVDB file"},
                 {8, 33u << 21, "v: version 33 with 1 grids, expected version 32"},
                 {12, 0, "v: version 32 with 0 grids"},
                 {12, 0x20001, "v: the file ends inside its compressed grid"},
                 {12, 0x70001, "v: the grid is compressed in way 7, expected none (0), zip (1) or Blosc (2)"},
                 {16 + 136, UINT32_MAX, "v: the file ends inside the records"},
                 {GRID, 0, "v: the file ends inside its grid"},
                 {GRID + 636, 4, "v: the voxels are of type 4, expected float"},
                 {TREE + 24, UINT32_MAX, "v: the file ends inside its grid"},
                 {ROOT, 13, "v: the box of the grid has 0 voxels along axis 0"},
                 {ROOT + 20, 1048577, "v: 283115250 voxels in a grid of"},
                 {ROOT + 12, 0x7fffffff, "v: the box of the grid has"},
                 {ROOT + 24, UINT32_MAX, "v: a node of the grid lies outside"},
                 {ROOT + 64 + 8, 0x70000000, "v: a node of the grid lies outside"}};
    float values[NX * NY * NZ];
    size_t size;
    unsigned char *plain = make_plain(*state, &size);
    for (int i = 0; i < COUNT_OF(cases); i++) {
        unsigned char before[4];
        memcpy(before, plain + cases[i].at, 4);
        for (int k = 0; k < 4; k++) {
            plain[cases[i].at + (size_t)k] = (unsigned char)(cases[i].value >> (8 * k));
        }
        rey_result result = read_bytes(*state, plain, size, values);
        if (result == REY_OK || strncmp(rey_error(*state), cases[i].message, strlen(cases[i].message)) != 0) {
            fail_msg("case %d: %s, expected %s", i, result ? rey_error(*state) : "read", cases[i].message);
        }
        memcpy(plain + cases[i].at, before, 4);
    }
    assert_int_equal(read_bytes(*state, plain, size, values), REY_OK);
    // Without the root's tiles there is the background alone.
    const float background = 2, strange = NAN;
    memset(plain + ROOT + 24, 0, 4);
    memcpy(plain + ROOT + 28, &background, 4);
    assert_int_equal(read_bytes(*state, plain, size, values), REY_OK);
    assert_true(values[0] == 2 && values[NX * NY * NZ - 1] == 2);
    memcpy(plain + ROOT + 28, &strange, 4);
    assert_int_equal(read_bytes(*state, plain, size, values), REY_ERROR_FORMAT);
    assert_string_equal(rey_error(*state), "v: voxel -5, 120, 3 is not finite");
    free(plain);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_types), cmocka_unit_test(test_vectors),
                                       cmocka_unit_test(test_plain), cmocka_unit_test(test_chunks),
                                       cmocka_unit_test(test_damaged_chunks), cmocka_unit_test(test_refused)};
    return cmocka_run_group_tests(tests, open_context, close_context);
}
