// test_io_mesh_bad.c: malformed, truncated and hostile mesh files, and every allocation failed in turn.
#include "base/context.h"
#include "io/file.h"
#include "io/mesh.h"

#include <dirent.h>
#include <setjmp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <cmocka.h>
#include <zlib.h>

#define MESHES TEST_DATA_DIR "/meshes/"

static const char *const data_names[] = {"house.obj",   "plain.obj",         "all_ascii.ply",    "all_little.ply",
                                         "all_big.ply", "two_v3.serialized", "two_v4.serialized"};

// An allocator that counts what is held and fails after a number of allocations.
typedef struct Allocations {
    int64_t left; // that succeed; negative: all
    int64_t held;
    size_t largest; // [bytes] asked for at once
} Allocations;

static void *counted_alloc(void *user, size_t bytes, size_t alignment) {
    Allocations *allocations = user;
    allocations->largest = bytes > allocations->largest ? bytes : allocations->largest;
    if (allocations->left == 0) {
        return NULL;
    }
    allocations->left--;
    allocations->held++;
    return aligned_alloc(alignment, (bytes + alignment - 1) / alignment * alignment);
}

static void counted_release(void *user, void *memory) {
    ((Allocations *)user)->held--;
    free(memory);
}

static rey_context *create_context(Allocations *allocations) {
    *allocations = (Allocations){.left = -1};
    rey_context_def def = rey_default_context_def();
    def.alloc = counted_alloc;
    def.release = counted_release;
    def.user = allocations;
    rey_context *ctx = NULL;
    assert_int_equal(rey_context_create(&def, &ctx), REY_OK);
    return ctx;
}

static bool ends_with(const char *name, const char *extension) {
    size_t length = strlen(name);
    return length >= strlen(extension) && strcmp(name + length - strlen(extension), extension) == 0;
}

// Reads from an exact copy on the heap, so that the sanitizer sees every access beyond the end.
static rey_result read_copy(rey_context *ctx, const char *name, const void *bytes, size_t size, rey_mesh *out) {
    unsigned char *copy = malloc(size ? size : 1);
    assert_non_null(copy);
    memcpy(copy, bytes, size);
    rey_result result;
    if (ends_with(name, ".obj")) {
        result = rey_mesh_read_obj_memory(ctx, name, copy, size, true, out);
    } else if (ends_with(name, ".ply")) {
        result = rey_mesh_read_ply_memory(ctx, name, copy, size, true, out);
    } else {
        result = rey_mesh_read_serialized_memory(ctx, name, copy, size, 0, out);
    }
    free(copy);
    return result;
}

static void assert_consistent(const rey_mesh *mesh) {
    assert_true(mesh->vertex_count > 0 && mesh->face_count > 0);
    for (int64_t i = 0; i < 3 * mesh->face_count; i++) {
        assert_true(mesh->faces[i] < mesh->vertex_count);
    }
    for (int64_t i = 0; i < mesh->vertex_count; i++) {
        assert_true(mesh->position_index[i] <= i);
    }
}

static void assert_empty(const rey_mesh *mesh) {
    static const rey_mesh empty;
    assert_memory_equal(mesh, &empty, sizeof empty);
}

static unsigned char *load_data(rey_context *ctx, const char *name, size_t *size) {
    char path[4096];
    snprintf(path, sizeof path, "%s%s", MESHES, name);
    unsigned char *bytes;
    assert_int_equal(rey_file_read(ctx, path, &bytes, size), REY_OK);
    return bytes;
}

typedef struct BadCase {
    const char *name, *text, *message; // the message must contain this
} BadCase;

static void check_cases(const BadCase *cases, int count) {
    Allocations allocations;
    rey_context *ctx = create_context(&allocations);
    for (int i = 0; i < count; i++) {
        rey_mesh mesh;
        memset(&mesh, 255, sizeof mesh);
        rey_result result = read_copy(ctx, cases[i].name, cases[i].text, strlen(cases[i].text), &mesh);
        if (result != REY_ERROR_FORMAT || !strstr(rey_error(ctx), cases[i].message)) {
            fail_msg("case %d: result %d, message '%s', expected '%s'", i, result, rey_error(ctx), cases[i].message);
        }
        assert_empty(&mesh);
        assert_int_equal(allocations.held, 1); // the context itself
    }
    assert_true(allocations.largest < 1 << 20);
    rey_context_destroy(ctx);
}

static void test_bad_obj(void **state) {
    UNUSED(state);
    static const BadCase cases[] = {
        {"a.obj", "", "a.obj:1: the file ends without a face"},
        {"a.obj", "v 0 0 0\nv 1 0 0\n", "a.obj:3: the file ends without a face"},
        {"a.obj", "v 0 0\n", "a.obj:1: v has 2 numbers, expected 3"},
        {"a.obj", "\nv 0 0 x\n", "a.obj:2: 'x' in v is not a number"},
        {"a.obj", "v 0 0 1x\n", "a.obj:1: '1x' in v is not a number"},
        {"a.obj", "v 0 \\\n0 \\\r\n0,5\n", "a.obj:3: '0,5' in v is not a number"},
        {"a.obj", "v 0 nan 0\n", "a.obj:1: 'nan' in v, expected a finite number"},
        {"a.obj", "v 0 -inf 0\n", "a.obj:1: '-inf' in v"},
        {"a.obj", "vt 1e39 0\n", "a.obj:1: '1e39' in vt"},
        {"a.obj", "vn 1 2\n", "a.obj:1: vn has 2 numbers, expected 3"},
        {"a.obj", "v 0 0 0\nf 1 1\n", "a.obj:2: f has 2 corners, expected at least 3"},
        {"a.obj", "v 0 0 0\nf 0 1 1\n", "a.obj:2: v index 0 is out of range, 1 are defined"},
        {"a.obj", "v 0 0 0\nf 1 1 -2\n", "a.obj:2: v index -2 is out of range, 1 are defined"},
        {"a.obj", "v 0 0 0\nf 1 1 2\n\n", "a.obj:2: v index 2 is out of range, the file has 1"},
        {"a.obj", "v 0 0 0\nf 1/1 1 1\n", "a.obj:2: vt index 1 is out of range, the file has 0"},
        {"a.obj", "v 0 0 0\nf 1//3000000000 1 1\n", "a.obj:2: vn index 3000000000 is out of range"},
        {"a.obj", "v 0 0 0\nf 99999999999999999999 1 1\n", "a.obj:2: '99999999999999999999' in f"},
        {"a.obj", "v 0 0 0\nf 1/1/1/1 1 1\nvt 0 0\nvn 0 0 1", "a.obj:2: '1/1/1/1' in f, expected v, v/vt"},
        {"a.obj", "v 0 0 0\nf a b c\n", "a.obj:2: 'a' in f, expected v, v/vt, v//vn or v/vt/vn"},
        {"a.obj", "v 0 0 0\nf 1 1.5 1\n", "a.obj:2: '1.5' in f"},
    };
    check_cases(cases, COUNT_OF(cases));
}

#define PLY "ply\nformat ascii 1.0\n"
#define XYZ "property float x\nproperty float y\nproperty float z\n"
#define LIST "property list uchar int vertex_index\n"
#define SMALL PLY "element vertex 3\n" XYZ "element face 1\n" LIST "end_header\n"

static void test_bad_ply(void **state) {
    UNUSED(state);
    static const BadCase cases[] = {
        {"a.ply", "", "a.ply:1: not a PLY file"},
        {"a.ply", "obj\n", "a.ply:1: not a PLY file"},
        {"a.ply", "ply\nformat ascii 1.0", "a.ply:2: the file ends inside the header"},
        {"a.ply", "ply\nformat ascii 2.0\n", "a.ply:2: format 'ascii 2.0', expected"},
        {"a.ply", "ply\nend_header\n", "a.ply:2: the header has no format line"},
        {"a.ply", PLY "element vertex many\n", "a.ply:3: 'many' is not an element count"},
        {"a.ply", PLY "element vertex -1\n", "a.ply:3: '-1' is not an element count"},
        {"a.ply", PLY "element vertex 1\nelement vertex 1\n", "a.ply:4: element 'vertex' appears twice"},
        {"a.ply", PLY "property float x\n", "a.ply:3: property before the first element"},
        {"a.ply", PLY "element vertex 3\nproperty real x\n", "a.ply:4: unknown property type 'real'"},
        {"a.ply", PLY "element vertex 3\nproperty float \n", "a.ply:4: property without a name"},
        {"a.ply", PLY "element face 3\nproperty list float int a\n", "a.ply:4: the length of a list has a floating"},
        {"a.ply", PLY "surprise\n", "a.ply:3: unknown header line 'surprise'"},
        {"a.ply", PLY "element vertex 3\n" XYZ "end_header\n", "a.ply:8: the header has no element face"},
        {"a.ply", PLY "element face 3\n" LIST "end_header\n", "a.ply:6: the header has no element vertex"},
        {"a.ply", PLY "element vertex 3\n" XYZ "element face 0\n" LIST "end_header\n",
         "a.ply:10: the mesh has no faces"},
        {"a.ply", PLY "element vertex 0\n" XYZ "element face 1\n" LIST "end_header\n",
         "a.ply:10: the mesh has no vert"},
        {"a.ply", PLY "element vertex 3000000000\n" XYZ "element face 1\n" LIST "end_header\n0 0 0 0",
         "a.ply:10: element 'vertex' has 3000000000 items of at least 6 bytes, but only 7 bytes are left"},
        {"a.ply", PLY "element vertex 1\n" XYZ "element face 999999999999999999\n" LIST "end_header\n0 0 0 0",
         "a.ply:10: element 'face' has 999999999999999999 items"},
        {"a.ply",
         PLY "element vertex 1\nproperty float x\nproperty float y\nelement face 1\n" LIST "end_header\n0 0 3 0",
         "a.ply:9: element vertex has no coordinates"},
        {"a.ply",
         PLY "element vertex 1\n" XYZ "element face 1\nproperty list uchar float vertex_index\nend_header\n"
             "0 0 0 3 0 0 0\n",
         "a.ply:10: element face has no indices"},
        {"a.ply", PLY "element vertex 1\n" XYZ "element face 1\nproperty int vertex_index\nend_header\n0 0 0 3",
         "a.ply:10: element face has no indices"},
        {"a.ply",
         PLY "element vertex 1\n" XYZ "property float a_x\nproperty float b_x\nproperty float a_0\n"
             "element face 1\n" LIST "end_header\n0 0 0 1 1 1 3 0 0 0\n",
         "a.ply:13: attribute 'vertex_a' appears twice"},
        {"a.ply", SMALL "0 0 0\n0 0 0\n0 nan 0\n3 0 1 2\n", "a.ply:12: vertex 2: property y is nan, expected a finite"},
        {"a.ply", SMALL "0 0 0\n0 0 0\n0 0 1e60\n3 0 1 2\n", "a.ply:12: vertex 2: property z is inf"},
        {"a.ply", SMALL "0 0 0\n0 zero 0\n0 0 0\n3 0 1 2\n", "a.ply:11: 'zero', expected a number"},
        {"a.ply", SMALL "0 0 0\n0 0 0\n0 0 0\n3 0 1 3\n",
         "a.ply:13: face 0: vertex index 3 is out of range, expected 0 to 2"},
        {"a.ply", SMALL "0 0 0\n0 0 0\n0 0 0\n3 0 1 -1\n", "a.ply:13: face 0: vertex index -1 is out of range"},
        {"a.ply", SMALL "0 0 0\n0 0 0\n0 0 0\n3 0 1 1.5\n", "a.ply:13: '1.5', expected an integer"},
        {"a.ply", SMALL "0 0 0\n0 0 0\n0 0 0\n2 0 1 1\n", "a.ply:13: face 0 has 2 corners, expected at least 3"},
        {"a.ply", SMALL "0 0 0\n0 0 0\n0 0 0\n4 0 1 2\n", "a.ply:14: the file ends inside its data"},
        {"a.ply", SMALL "0 0 0\n0 0 0\n0 0 0\n2000000000 0 1 1\n",
         "a.ply:13: a list of 2000000000 values does not fit"},
    };
    check_cases(cases, COUNT_OF(cases));
}

static void test_bad_binary_ply(void **state) {
    UNUSED(state);
    Allocations allocations;
    rey_context *ctx = create_context(&allocations);
    size_t size;
    unsigned char *bytes = load_data(ctx, "all_little.ply", &size);
    rey_mesh mesh;
    memset(bytes + size - 13, 255, 4); // the last face: 4 indices bytes before its rank and pair
    assert_int_equal(read_copy(ctx, "a.ply", bytes, size, &mesh), REY_ERROR_FORMAT);
    char expected[200];
    snprintf(expected, sizeof expected, "a.ply: byte %zu: face 2: vertex index 4294967295 is out of range", size - 9);
    assert_non_null(strstr(rey_error(ctx), expected));
    rey_free(ctx, bytes);
    assert_int_equal(allocations.held, 1);
    rey_context_destroy(ctx);
}

static void test_bad_serialized(void **state) {
    UNUSED(state);
    Allocations allocations;
    rey_context *ctx = create_context(&allocations);
    rey_mesh mesh;
    assert_int_equal(read_copy(ctx, "a.serialized", "\x1c\x04\x05\0", 4, &mesh), REY_ERROR_UNSUPPORTED);
    assert_non_null(strstr(rey_error(ctx), "a.serialized: byte 2: serialized version 5 is not supported"));
    assert_int_equal(read_copy(ctx, "a.serialized", "PK\x03\x04", 4, &mesh), REY_ERROR_FORMAT);
    assert_non_null(strstr(rey_error(ctx), "a.serialized: byte 0: not a serialized mesh: 0x4b50, expected 0x041c"));
    assert_int_equal(read_copy(ctx, "a.serialized", "\x1c\x04\x04\0abcdefgh", 12, &mesh), REY_ERROR_FORMAT);
    assert_non_null(strstr(rey_error(ctx), "the compressed data are damaged (incorrect header check)"));
    static const unsigned char none[5];
    assert_int_equal(rey_mesh_read_serialized_memory(ctx, "a.serialized", none, 0, 0, &mesh), REY_ERROR_FORMAT);
    assert_non_null(strstr(rey_error(ctx), "a.serialized: byte 0: the file ends"));
    // A list of more meshes than the file could hold, and offsets beyond it.
    size_t size;
    unsigned char *bytes = load_data(ctx, "two_v4.serialized", &size);
    memset(bytes + size - 12, 255, 8);
    assert_int_equal(rey_mesh_read_serialized_memory(ctx, "a.serialized", bytes, size, 1, &mesh), REY_ERROR_FORMAT);
    assert_non_null(strstr(rey_error(ctx), "offset 18446744073709551615 of mesh 1 is out of range"));
    memset(bytes + size - 4, 255, 4);
    assert_int_equal(rey_mesh_read_serialized_memory(ctx, "a.serialized", bytes, size, 1, &mesh), REY_ERROR_FORMAT);
    assert_non_null(strstr(rey_error(ctx), "a list of 4294967295 meshes does not fit the file"));
    rey_free(ctx, bytes);
    // A list that is cut off is told, too, where the first mesh is asked for, which is read without it.
    bytes = load_data(ctx, "two_v4.serialized", &size);
    const struct {
        size_t cut;
        const char *message;
    } cuts[] = {{20, "meshes does not fit the file, which ends without its list or within it"},
                {4, "byte 117: the file ends without the list of its meshes, or within it"},
                {0, "byte 101: no mesh begins at offset 1 of mesh 0: the list of meshes is damaged"}};
    bytes[size - 20] = 1; // of mesh 0
    for (int i = 0; i < COUNT_OF(cuts); i++) {
        assert_int_equal(read_copy(ctx, "a.serialized", bytes, size - cuts[i].cut, &mesh), REY_ERROR_FORMAT);
        if (!strstr(rey_error(ctx), cuts[i].message)) {
            fail_msg("'%s', expected '%s'", rey_error(ctx), cuts[i].message);
        }
    }
    rey_free(ctx, bytes);
    assert_int_equal(allocations.held, 1);
    rey_context_destroy(ctx);
}

// Uncompressed deflate blocks let the test say what is inside: huge counts fail before any array is allocated.
static void test_serialized_contents(void **state) {
    UNUSED(state);
    static const struct {
        uint32_t flags, vertices, faces, index;
        float last;
        const char *message;
    } cases[] = {
        {0x1000, 3, 1, 3, 0, "vertex index 3 of face 0 is out of range, expected 0 to 2"},
        {0x1000, 0xFFFFFFFF, 1, 0, 0, "4294967295 vertices and 1 triangles do not fit the"},
        {0x1000, 3, 0x7FFFFFFF, 0, 0, "3 vertices and 2147483647 triangles do not fit the"},
        {0x1000, 0, 1, 0, 0, "the mesh has no vertices"},
        {0x1000, 3, 0, 0, 0, "the mesh has no faces"},
        {0x3000, 3, 1, 0, 0, "the flags 0x3000 ask for both float and double"},
        {0x1000, 3, 1, 0, 1.0f / 0.0f, "positions of vertex 2 are not finite"},
        {0x1000, 3, 1, 0, 1, "damaged at their end (incorrect data check)"},
        {0x1001, 3, 1, 0, 1, "the compressed data end early, expected normals"},
    };
    Allocations allocations;
    rey_context *ctx = create_context(&allocations);
    for (int i = 0; i < COUNT_OF(cases); i++) {
        unsigned char file[128] = {0x1c, 4, 3, 0, 0x78, 1, 1, 68, 0, 255 - 68, 255};
        const uint32_t counts[] = {cases[i].flags, cases[i].vertices, 0, cases[i].faces, 0};
        memcpy(file + 11, counts, 20);
        memcpy(file + 31 + 32, &cases[i].last, 4);
        memcpy(file + 31 + 36 + 8, &cases[i].index, 4);
        bool damaged = strstr(cases[i].message, "incorrect") != NULL;
        uLong checksum = adler32(1, file + 11, 68) + damaged;
        for (int k = 0; k < 4; k++) {
            file[11 + 68 + k] = (unsigned char)(checksum >> (24 - 8 * k));
        }
        rey_mesh mesh;
        rey_result result = read_copy(ctx, "a.serialized", file, sizeof file, &mesh);
        if (result != REY_ERROR_FORMAT || !strstr(rey_error(ctx), cases[i].message)) {
            fail_msg("case %d: result %d, message '%s', expected '%s'", i, result, rey_error(ctx), cases[i].message);
        }
        assert_int_equal(allocations.held, 1);
    }
    assert_true(allocations.largest < 1 << 20);
    rey_context_destroy(ctx);
}

// Every beginning of every file. Those that lose data must fail; text may lose its last characters unnoticed.
static void test_truncated(void **state) {
    UNUSED(state);
    for (int i = 0; i < COUNT_OF(data_names); i++) {
        Allocations allocations;
        rey_context *ctx = create_context(&allocations);
        size_t size;
        unsigned char *bytes = load_data(ctx, data_names[i], &size);
        bool serialized = ends_with(data_names[i], ".serialized");
        bool text = ends_with(data_names[i], ".obj") || strstr(data_names[i], "ascii");
        rey_mesh mesh;
        for (size_t length = 0; length < size; length++) {
            rey_result result = read_copy(ctx, data_names[i], bytes, length, &mesh);
            if (result == REY_OK) {
                assert_true(text && (ends_with(data_names[i], ".obj") || length + 1 >= size));
                assert_consistent(&mesh);
                rey_mesh_free(ctx, &mesh);
            } else {
                assert_int_equal(result, REY_ERROR_FORMAT);
                assert_non_null(strstr(rey_error(ctx), data_names[i]));
                assert_empty(&mesh);
            }
            assert_int_equal(allocations.held, 2); // the context and the bytes
            if (serialized && length < size) {     // the second shape needs the list at the end
                result = rey_mesh_read_serialized_memory(ctx, data_names[i], bytes, length, 1, &mesh);
                assert_int_equal(result, REY_ERROR_FORMAT);
            }
        }
        rey_free(ctx, bytes);
        rey_context_destroy(ctx);
    }
}

// A few thousand damaged copies of every file, the same in each run.
static void test_damaged(void **state) {
    UNUSED(state);
    uint32_t random = 1;
    for (int i = 0; i < COUNT_OF(data_names); i++) {
        Allocations allocations;
        rey_context *ctx = create_context(&allocations);
        size_t size;
        unsigned char *bytes = load_data(ctx, data_names[i], &size);
        for (int round = 0; round < 2000; round++) {
            size_t at[3];
            unsigned char before[3];
            for (int k = 0; k < 3; k++) {
                random = random * 1664525 + 1013904223;
                at[k] = (random >> 8) % size;
                before[k] = bytes[at[k]];
                bytes[at[k]] = k ? (unsigned char)(before[k] + k) : (unsigned char)(random >> 4);
            }
            rey_mesh mesh;
            if (read_copy(ctx, data_names[i], bytes, size, &mesh) == REY_OK) {
                assert_consistent(&mesh);
                rey_mesh_free(ctx, &mesh);
            }
            assert_int_equal(allocations.held, 2);
            for (int k = 2; k >= 0; k--) {
                bytes[at[k]] = before[k];
            }
        }
        rey_free(ctx, bytes);
        rey_context_destroy(ctx);
    }
}

// What the fuzzers found worth keeping: accepted or refused, but never more.
static void check_corpus(const char *extension) {
    Allocations allocations;
    rey_context *ctx = create_context(&allocations);
    char folder[1024], name[32];
    snprintf(folder, sizeof folder, "%scorpus/%s", MESHES, extension);
    snprintf(name, sizeof name, "a.%s", extension);
    DIR *listing = opendir(folder);
    assert_non_null(listing);
    int found = 0;
    for (struct dirent *entry; (entry = readdir(listing));) {
        if (entry->d_name[0] != '.') {
            char file[1400];
            snprintf(file, sizeof file, "corpus/%s/%s", extension, entry->d_name);
            size_t size;
            unsigned char *bytes = load_data(ctx, file, &size);
            rey_mesh mesh;
            if (read_copy(ctx, name, bytes, size, &mesh) == REY_OK) {
                assert_consistent(&mesh);
                rey_mesh_free(ctx, &mesh);
            }
            rey_free(ctx, bytes);
            assert_int_equal(allocations.held, 1);
            found++;
        }
    }
    closedir(listing);
    assert_true(found >= 50);
    rey_context_destroy(ctx);
}

static void test_corpus(void **state) {
    UNUSED(state);
    check_corpus("obj");
    check_corpus("ply");
    check_corpus("serialized");
}

// Reading, normals and writing with the first, second, ... allocation failing, until one run needs no more.
static void test_failing_allocations(void **state) {
    UNUSED(state);
    for (int i = 0; i < COUNT_OF(data_names); i++) {
        Allocations allocations;
        rey_context *ctx = create_context(&allocations);
        char path[1024];
        snprintf(path, sizeof path, "%s%s", MESHES, data_names[i]);
        rey_result result = REY_ERROR_MEMORY;
        for (int64_t succeed = 0; result != REY_OK; succeed++) {
            assert_true(succeed < 1000);
            allocations.left = succeed;
            rey_mesh mesh;
            if (ends_with(path, ".obj")) {
                result = rey_mesh_read_obj(ctx, path, true, &mesh);
            } else if (ends_with(path, ".ply")) {
                result = rey_mesh_read_ply(ctx, path, true, &mesh);
            } else {
                result = rey_mesh_read_serialized(ctx, path, 0, &mesh);
            }
            if (result == REY_OK) {
                result = rey_mesh_compute_normals(ctx, &mesh);
                result = result == REY_OK ? rey_mesh_write_ply(ctx, "mesh_allocations.ply", &mesh) : result;
            } else {
                assert_empty(&mesh);
            }
            rey_mesh_free(ctx, &mesh);
            assert_true(result == REY_OK || result == REY_ERROR_MEMORY);
            assert_true(result == REY_OK || strstr(rey_error(ctx), "out of memory"));
            assert_int_equal(allocations.held, 1);
            assert_true(result == REY_OK || access("mesh_allocations.ply", F_OK) != 0);
        }
        unlink("mesh_allocations.ply");
        rey_context_destroy(ctx);
    }
}

static void test_unreadable_files(void **state) {
    UNUSED(state);
    Allocations allocations;
    rey_context *ctx = create_context(&allocations);
    rey_mesh mesh;
    assert_int_equal(rey_mesh_read_obj(ctx, MESHES "none.obj", true, &mesh), REY_ERROR_IO);
    assert_non_null(strstr(rey_error(ctx), "none.obj: cannot open: No such file"));
    assert_empty(&mesh);
    assert_int_equal(rey_mesh_read_ply(ctx, MESHES, true, &mesh), REY_ERROR_IO);
    assert_non_null(strstr(rey_error(ctx), "is a directory, expected a file"));
    assert_int_equal(rey_mesh_read_serialized(ctx, "/dev/null", 0, &mesh), REY_ERROR_IO);
    assert_non_null(strstr(rey_error(ctx), "is a device"));
    assert_int_equal(allocations.held, 1);
    rey_context_destroy(ctx);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_bad_obj),
        cmocka_unit_test(test_bad_ply),
        cmocka_unit_test(test_bad_binary_ply),
        cmocka_unit_test(test_bad_serialized),
        cmocka_unit_test(test_serialized_contents),
        cmocka_unit_test(test_truncated),
        cmocka_unit_test(test_damaged),
        cmocka_unit_test(test_corpus),
        cmocka_unit_test(test_failing_allocations),
        cmocka_unit_test(test_unreadable_files),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
