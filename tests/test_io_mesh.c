// test_io_mesh.c: mesh readers on known contents, the writer's round trip, smooth normals, the decimal parser.
#include "base/context.h"
#include "io/decimal.h"
#include "io/file.h"
#include "io/mesh.h"

#include <dirent.h>
#include <math.h>
#include <setjmp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <cmocka.h>

#define MESHES TEST_DATA_DIR "/meshes/"

static int setup(void **state) {
    return rey_context_create(NULL, (rey_context **)state);
}

static int teardown(void **state) {
    rey_context_destroy(*state);
    return 0;
}

static void assert_ok(rey_context *ctx, rey_result result) {
    if (result != REY_OK) {
        fail_msg("%s", rey_error(ctx));
    }
}

static void assert_floats(const float *values, const float *expected, int64_t count) {
    assert_non_null(values);
    for (int64_t i = 0; i < count; i++) {
        if (values[i] != expected[i]) {
            fail_msg("value %lld is %.9g, expected %.9g", (long long)i, (double)values[i], (double)expected[i]);
        }
    }
}

static void assert_indices(const uint32_t *values, const uint32_t *expected, int64_t count) {
    for (int64_t i = 0; i < count; i++) {
        if (values[i] != expected[i]) {
            fail_msg("index %lld is %u, expected %u", (long long)i, values[i], expected[i]);
        }
    }
}

static void assert_bits(const void *a, const void *b, size_t bytes) {
    assert_int_equal(a == NULL, b == NULL);
    if (a) {
        assert_memory_equal(a, b, bytes);
    }
}

static void assert_same_mesh(const rey_mesh *a, const rey_mesh *b) {
    assert_int_equal(a->vertex_count, b->vertex_count);
    assert_int_equal(a->face_count, b->face_count);
    size_t vertices = (size_t)a->vertex_count, faces = (size_t)a->face_count;
    assert_bits(a->positions, b->positions, 12 * vertices);
    assert_bits(a->normals, b->normals, 12 * vertices);
    assert_bits(a->uvs, b->uvs, 8 * vertices);
    assert_bits(a->faces, b->faces, 12 * faces);
    assert_bits(a->position_index, b->position_index, 4 * vertices);
    assert_int_equal(a->attribute_count, b->attribute_count);
    for (int i = 0; i < a->attribute_count; i++) {
        const rey_mesh_attribute *p = &a->attributes[i], *q = &b->attributes[i];
        assert_string_equal(p->name, q->name);
        assert_int_equal(p->per_face, q->per_face);
        assert_int_equal(p->channels, q->channels);
        assert_bits(p->data, q->data, 4 * (size_t)p->channels * (p->per_face ? faces : vertices));
    }
}

static void test_obj_corners_become_vertices(void **state) {
    rey_context *ctx = *state;
    rey_mesh mesh;
    assert_ok(ctx, rey_mesh_read_obj(ctx, MESHES "house.obj", true, &mesh));
    static const float positions[] = {-1, 0, 0, 1, 0,  0, 1, 2, 0, -1, 2,  0, 1, 2,
                                      0,  0, 3, 0, -1, 0, 0, 1, 2, 0,  -1, 2, 0};
    static const float uvs[] = {0, 0.75f, 1, 0.75f, 1, 0, 0, 0, 0, 0, 0.5f, -0.5f, 0, 0, 0, 0, 0, 0};
    static const uint32_t faces[] = {0, 1, 2, 0, 2, 3, 0, 1, 4, 0, 4, 5, 0, 5, 3, 6, 7, 8};
    static const uint32_t welded[] = {0, 1, 2, 3, 2, 5, 0, 2, 3};
    assert_int_equal(mesh.vertex_count, 9);
    assert_int_equal(mesh.face_count, 6);
    assert_floats(mesh.positions, positions, COUNT_OF(positions));
    assert_floats(mesh.uvs, uvs, COUNT_OF(uvs));
    assert_indices(mesh.faces, faces, COUNT_OF(faces));
    assert_indices(mesh.position_index, welded, COUNT_OF(welded));
    for (int i = 0; i < 9; i++) {
        assert_floats(mesh.normals + 3 * i, (const float[]){0, 0, 1}, 3);
    }
    rey_mesh_free(ctx, &mesh);
    assert_ok(ctx, rey_mesh_read_obj(ctx, MESHES "house.obj", false, &mesh));
    assert_true(mesh.uvs[1] == 0.25f && mesh.uvs[11] == 1.5f);
    rey_mesh_free(ctx, &mesh);
    assert_ok(ctx, rey_mesh_read_obj(ctx, MESHES "plain.obj", true, &mesh));
    assert_true(mesh.vertex_count == 3 && mesh.face_count == 1 && !mesh.uvs && !mesh.normals);
    assert_floats(mesh.positions, (const float[]){0, 0, 0, 1, 0, 0, 0, 1, 0}, 9);
    rey_mesh_free(ctx, &mesh);
}

// Indices may point to what follows; corners without vn get the smooth normal.
static void test_obj_forward_and_missing_normals(void **state) {
    rey_context *ctx = *state;
    static const char text[] = "f 1//1 2 3\nv 0 0 0\nv 0 2 0\nv 0 0 2\nvn 0 3 0\n";
    rey_mesh mesh;
    assert_ok(ctx, rey_mesh_read_obj_memory(ctx, "a.obj", text, strlen(text), true, &mesh));
    assert_floats(mesh.normals, (const float[]){0, 3, 0, 1, 0, 0, 1, 0, 0}, 9);
    assert_null(mesh.uvs);
    rey_mesh_free(ctx, &mesh);
}

static void check_all_ply(const rey_mesh *mesh) {
    static const float positions[] = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 0, 0, 0};
    static const float normals[] = {0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 1, 0};
    static const float uvs[] = {0, 0, 1, 0, 1, 1, 0, 1, 0.5f, 0.5f};
    static const uint32_t faces[] = {0, 1, 2, 0, 2, 3, 0, 3, 1, 4, 2, 3}, welded[] = {0, 1, 2, 3, 0};
    static const float heat[] = {0.25f, 0.5f, 0.75f, 1, 2};
    static const float tint[] = {1, 0.5f, -0.125f, 0, 1, 0, 0, 0, 1, 1, 1, 1, 1e-20f, 3e30f, 0.1f};
    static const float color[] = {10, 20, 30, 40, 50, 60, 40, 50, 60, 70, 80, 90}, rank[] = {-3, 4, 4, -128};
    static const struct {
        const char *name;
        bool per_face;
        int channels, count;
        const float *data;
    } attributes[] = {
        {"vertex_heat", false, 1, 5, heat},
        {"vertex_tint", false, 3, 15, tint},
        {"face_color", true, 3, 12, color},
        {"face_rank", true, 1, 4, rank},
    };
    assert_int_equal(mesh->vertex_count, 5);
    assert_int_equal(mesh->face_count, 4);
    assert_floats(mesh->positions, positions, COUNT_OF(positions));
    assert_floats(mesh->normals, normals, COUNT_OF(normals));
    assert_floats(mesh->uvs, uvs, COUNT_OF(uvs));
    assert_indices(mesh->faces, faces, COUNT_OF(faces));
    assert_indices(mesh->position_index, welded, COUNT_OF(welded));
    assert_int_equal(mesh->attribute_count, COUNT_OF(attributes));
    for (int i = 0; i < COUNT_OF(attributes); i++) {
        const rey_mesh_attribute *attribute = &mesh->attributes[i];
        assert_string_equal(attribute->name, attributes[i].name);
        assert_int_equal(attribute->per_face, attributes[i].per_face);
        assert_int_equal(attribute->channels, attributes[i].channels);
        assert_floats(attribute->data, attributes[i].data, attributes[i].count);
    }
}

// Positions that differ by rounding are one, also on both sides of a cell's border; others stay apart, however many there are.
static void test_seams_are_welded(void **state) {
    rey_context *ctx = *state;
    enum { RING = 40, COUNT = 3 * RING + 1 };
    rey_mesh mesh = {.vertex_count = COUNT};
    mesh.positions = rey_alloc_array(ctx, 3 * COUNT, sizeof *mesh.positions);
    assert_non_null(mesh.positions);
    for (int i = 0; i < COUNT; i++) {
        float *p = mesh.positions + 3 * i;
        double angle = 6.283185307179586 * (i % RING) / RING, off = i < RING ? 0 : i < 2 * RING ? 1.5e-7 : 3e-6;
        p[0] = (float)(0.85 * cos(angle) + off);
        p[1] = (float)(0.85 * sin(angle) - off);
        p[2] = (float)off;
    }
    mesh.positions[3 * (COUNT - 1)] = 3e9f; // a stray vertex changes nothing
    assert_ok(ctx, rey_mesh_weld(ctx, &mesh));
    for (uint32_t i = 0; i < COUNT; i++) {
        assert_int_equal(mesh.position_index[i], i < 2 * RING ? i % RING : i);
    }
    rey_mesh_free(ctx, &mesh);
}

static void test_ply_encodings_agree(void **state) {
    rey_context *ctx = *state;
    static const char *const paths[] = {MESHES "all_ascii.ply", MESHES "all_little.ply", MESHES "all_big.ply"};
    rey_mesh meshes[3];
    for (int i = 0; i < 3; i++) {
        assert_ok(ctx, rey_mesh_read_ply(ctx, paths[i], false, &meshes[i]));
        check_all_ply(&meshes[i]);
        assert_same_mesh(&meshes[0], &meshes[i]);
    }
    for (int i = 0; i < 3; i++) {
        rey_mesh_free(ctx, &meshes[i]);
    }
    assert_ok(ctx, rey_mesh_read_ply(ctx, paths[0], true, &meshes[0]));
    assert_floats(meshes[0].uvs, (const float[]){0, 1, 1, 1, 1, 0, 0, 0, 0.5f, 0.5f}, 10);
    rey_mesh_free(ctx, &meshes[0]);
}

static void test_serialized_versions_agree(void **state) {
    rey_context *ctx = *state;
    static const char *const paths[] = {MESHES "two_v3.serialized", MESHES "two_v4.serialized"};
    static const float positions[] = {0, 0, 0, 2, 0, 0, 2, 2, 0, 0, 2, 0.1f};
    rey_mesh squares[2], triangle;
    for (int i = 0; i < 2; i++) {
        assert_ok(ctx, rey_mesh_read_serialized(ctx, paths[i], 0, &squares[i]));
        assert_ok(ctx, rey_mesh_read_serialized(ctx, paths[i], 1, &triangle));
        assert_true(triangle.vertex_count == 3 && triangle.face_count == 1 && triangle.had_face_normals);
        assert_true(!triangle.normals && !triangle.uvs && triangle.attribute_count == 0);
        assert_floats(triangle.positions, positions, 9);
        rey_mesh_free(ctx, &triangle);
        assert_int_equal(rey_mesh_read_serialized(ctx, paths[i], 2, &triangle), REY_ERROR_FORMAT);
        assert_int_equal(rey_mesh_read_serialized(ctx, paths[i], -1, &triangle), REY_ERROR_SCENE);
    }
    assert_same_mesh(&squares[0], &squares[1]);
    assert_floats(squares[0].positions, positions, 12);
    assert_floats(squares[0].uvs, (const float[]){0, 0, 1, 0, 1, 1, 0, 1}, 8);
    assert_indices(squares[0].faces, (const uint32_t[]){0, 1, 2, 0, 2, 3}, 6);
    assert_true(!squares[0].had_face_normals && squares[0].attribute_count == 1);
    assert_string_equal(squares[0].attributes[0].name, "vertex_color");
    assert_floats(squares[0].attributes[0].data, (const float[]){1, 0, 0, 0, 1, 0, 0, 0, 1, 0.5f, 0.5f, 0.5f}, 12);
    rey_mesh_free(ctx, &squares[0]);
    rey_mesh_free(ctx, &squares[1]);
}

// ---- writing -------------------------------------------------------------------------------------------------------

static rey_result read_any(rey_context *ctx, const char *path, int shape_index, rey_mesh *out) {
    const char *extension = strrchr(path, '.');
    if (extension && strcmp(extension, ".obj") == 0) {
        return rey_mesh_read_obj(ctx, path, true, out);
    }
    if (extension && strcmp(extension, ".ply") == 0) {
        return rey_mesh_read_ply(ctx, path, false, out);
    }
    return rey_mesh_read_serialized(ctx, path, shape_index, out);
}

static void check_round_trip(rey_context *ctx, const rey_mesh *mesh) {
    char path[] = "mesh_round_trip_XXXXXX";
    int file = mkstemp(path);
    assert_true(file >= 0);
    close(file);
    rey_mesh again;
    rey_result written = rey_mesh_write_ply(ctx, path, mesh);
    rey_result read = written == REY_OK ? rey_mesh_read_ply(ctx, path, false, &again) : written;
    unlink(path);
    assert_ok(ctx, read);
    assert_same_mesh(mesh, &again);
    rey_mesh_free(ctx, &again);
}

static void test_round_trip(void **state) {
    rey_context *ctx = *state;
    static const char *const names[] = {"house.obj", "plain.obj", "all_ascii.ply", "two_v3.serialized"};
    for (int i = 0; i < COUNT_OF(names); i++) {
        char path[1024];
        snprintf(path, sizeof path, "%s%s", MESHES, names[i]);
        rey_mesh mesh;
        assert_ok(ctx, read_any(ctx, path, 0, &mesh));
        check_round_trip(ctx, &mesh);
        rey_mesh_free(ctx, &mesh);
    }
}

static int count_entries(const char *folder) {
    DIR *entries = opendir(folder);
    assert_non_null(entries);
    int count = 0;
    while (readdir(entries)) {
        count++;
    }
    closedir(entries);
    return count;
}

static void test_write_failures(void **state) {
    rey_context *ctx = *state;
    rey_mesh mesh, empty = {0};
    assert_ok(ctx, rey_mesh_read_obj(ctx, MESHES "plain.obj", true, &mesh));
    assert_int_equal(rey_mesh_write_ply(ctx, "a.ply", &empty), REY_ERROR_ARGUMENT);
    assert_int_equal(rey_mesh_write_ply(ctx, "no/such/folder/a.ply", &mesh), REY_ERROR_IO);
    assert_non_null(strstr(rey_error(ctx), "no/such/folder/a.ply"));
    // A folder cannot be replaced by a file: the rename fails and the temporary file must be gone.
    char folder[] = "mesh_write_XXXXXX", target[64];
    assert_non_null(mkdtemp(folder));
    snprintf(target, sizeof target, "%s/a.ply", folder);
    assert_int_equal(mkdir(target, 0700), 0);
    assert_int_equal(rey_mesh_write_ply(ctx, target, &mesh), REY_ERROR_IO);
    int entries = count_entries(folder);
    rmdir(target);
    rmdir(folder);
    assert_int_equal(entries, 3); // a.ply, . and ..
    assert_non_null(rey_mesh_add_attribute(ctx, &mesh, "heat", false, 1));
    assert_int_equal(rey_mesh_write_ply(ctx, "a.ply", &mesh), REY_ERROR_ARGUMENT);
    assert_non_null(strstr(rey_error(ctx), "'heat'"));
    rey_mesh_free(ctx, &mesh);
}

// ---- normals -------------------------------------------------------------------------------------------------------

// Weighting by angle makes a cube's corner normals diagonals however its faces are split, and welding keeps them whole
// though every face has its own vertices.
static void test_cube_normals(void **state) {
    rey_context *ctx = *state;
    static const char text[] = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nv 0 0 1\nv 1 0 1\nv 0 1 1\nv 1 1 1\n"
                               "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvt 0 .5\nvt .5 0\n"
                               "f 1/1 3/1 4/1 2/1\nf 5/2 6/2 8/2 7/2\nf 1/3 2/3 6/3 5/3\n"
                               "f 3/4 7/4 8/4 4/4\nf 1/5 5/5 7/5 3/5\nf 6/6 2/6 4/6 8/6\n";
    rey_mesh mesh;
    assert_ok(ctx, rey_mesh_read_obj_memory(ctx, "cube.obj", text, strlen(text), true, &mesh));
    assert_int_equal(mesh.vertex_count, 24);
    assert_ok(ctx, rey_mesh_compute_normals(ctx, &mesh));
    for (int i = 0; i < 72; i++) {
        double expected = (mesh.positions[i] - 0.5) * 2 / sqrt(3);
        if (fabs(mesh.normals[i] - expected) > 1e-7) {
            fail_msg("normal %d is %g, expected %g", i, (double)mesh.normals[i], expected);
        }
    }
    rey_mesh_free(ctx, &mesh);
}

static void test_degenerate_normals(void **state) {
    rey_context *ctx = *state;
    static const char text[] = "ply\nformat ascii 1.0\nelement vertex 6\nproperty float x\nproperty float y\n"
                               "property float z\nelement face 3\nproperty list uchar int vertex_index\nend_header\n"
                               "0 0 0 1e-30 0 0 0 0 1e-30 0 0 3e38 9 9 9 1e-30 0 -0\n"
                               "3 0 2 1 3 0 2 3 3 0 0 1\n";
    rey_mesh mesh;
    assert_ok(ctx, rey_mesh_read_ply_memory(ctx, "a.ply", text, strlen(text), false, &mesh));
    assert_ok(ctx, rey_mesh_compute_normals(ctx, &mesh));
    static const float expected[] = {0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 0, 1, 0, 0, 1, 0, 1, 0};
    assert_floats(mesh.normals, expected, COUNT_OF(expected));
    rey_mesh_free(ctx, &mesh);
    double normal[3], angles[3];
    assert_true(rey_face_normal((const float[]){0, 0, 0}, (const float[]){1, 0, 0}, (const float[]){0, sqrtf(3), 0},
                                normal, angles));
    assert_true(normal[0] == 0 && normal[1] == 0 && normal[2] == 1);
    assert_true(fabs(angles[0] - M_PI / 2) < 1e-6 && fabs(angles[1] - M_PI / 3) < 1e-6);
    assert_true(fabs(angles[2] - M_PI / 6) < 1e-6);
}

// ---- numbers -------------------------------------------------------------------------------------------------------

static void check_number(const char *text) {
    float value = -1, expected = strtof(text, NULL);
    const char *end = text + strlen(text);
    if (rey_parse_float(text, end, &value) != end || memcmp(&value, &expected, sizeof value) != 0) {
        fail_msg("'%s' reads as %.9g, expected %.9g", text, (double)value, (double)expected);
    }
}

static const char *const numbers[] = {
    "0", "-0", "+1", "1.", ".5", "-.5e+3", "1e5", "1E-5", "3.4028235e38", "3.4028236e38", "1e39", "-1e400",
    "1.17549435e-38", "1e-45", "7e-46", "1e-400", "0e999999999999", "16777217", "16777217.0000000000000000000001",
    "16777216.9999999999999999999999", "0.000000000000000000000000000000000000000000001", "00000000000000000000001",
    "123456789012345678901234567890", "9007199791611905", "9007199791611904", "8589973000.00000000000000000001",
    "1.000000059604644775390625", "100000000000000000000000000000000000000000000000000000000000e-59", "inf", "-inf"};

static void test_numbers_round_like_the_c_library(void **state) {
    UNUSED(state);
    for (int i = 0; i < COUNT_OF(numbers); i++) {
        check_number(numbers[i]);
    }
    char middle[400]; // between 1 and the next float; the digit after many zeros decides
    snprintf(middle, sizeof middle, "1.000000059604644775390625%0200d", 0);
    check_number(middle);
    middle[strlen(middle) - 1] = '1';
    check_number(middle);
    uint64_t random = 1;
    static const char *const formats[] = {"%.9g", "%.6f", "%.17g", "%.3e", "%.12f", "%.7g"};
    for (int i = 0; i < 60000; i++) {
        random = random * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
        uint32_t bits = (uint32_t)(random >> 32);
        float number;
        memcpy(&number, &bits, sizeof number);
        if (isfinite(number)) {
            char text[400];
            double shown = number;
            if (i % 3 == 0) { // the middle between two floats, or next to it
                shown = (shown + (double)nextafterf(number, INFINITY)) / 2;
                shown = i % 2 ? nextafter(shown, 0) : shown;
                shown = isfinite(shown) ? shown : 1;
            }
            snprintf(text, sizeof text, i % 3 == 0 ? "%.60g" : formats[i % 6], shown);
            check_number(text);
        }
    }
    float value;
    static const char *const others[] = {"", "-", "+", ".", "e5", "x", "-.", "in", "--1"};
    for (int i = 0; i < COUNT_OF(others); i++) {
        assert_null(rey_parse_float(others[i], others[i] + strlen(others[i]), &value));
    }
    const char *text = "1e+"; // the exponent is not one: the number ends before it
    assert_ptr_equal(rey_parse_float(text, text + 3, &value), text + 1);
    assert_ptr_equal(rey_parse_float("12345", text, &value), NULL);
}

// ---- meshes made by others -----------------------------------------------------------------------------------------

static void conformance_folder(char *path, size_t size) {
    const char *given = getenv("REYNOLDS_CONFORMANCE_DIR");
    snprintf(path, size, "%s", given ? given : PROJECT_DIR "/../shared/conformance");
}

static int check_folder(rey_context *ctx, const char *folder) {
    DIR *entries = opendir(folder);
    int found = 0;
    for (struct dirent *entry; entries && (entry = readdir(entries));) {
        char path[4096];
        int length = snprintf(path, sizeof path, "%s/%s", folder, entry->d_name);
        struct stat status;
        if (entry->d_name[0] == '.' || length >= (int)sizeof path || stat(path, &status) != 0) {
            continue;
        }
        const char *extension = strrchr(entry->d_name, '.');
        if (S_ISDIR(status.st_mode)) {
            found += check_folder(ctx, path);
        } else if (extension && (strcmp(extension, ".obj") == 0 || strcmp(extension, ".ply") == 0 ||
                                 strcmp(extension, ".serialized") == 0)) {
            rey_mesh mesh;
            assert_ok(ctx, read_any(ctx, path, 0, &mesh));
            check_round_trip(ctx, &mesh);
            assert_ok(ctx, rey_mesh_compute_normals(ctx, &mesh));
            rey_mesh_free(ctx, &mesh);
            found++;
        }
    }
    if (entries) {
        closedir(entries);
    }
    return found;
}

static void test_conformance_meshes(void **state) {
    rey_context *ctx = *state;
    char folder[1024];
    conformance_folder(folder, sizeof folder);
    struct stat status;
    if (stat(folder, &status) != 0) {
        skip();
    }
    assert_true(check_folder(ctx, folder) >= 30);
    static const struct {
        const char *path;
        int shape_index;
        int64_t vertices, faces;
        int attributes;
        bool normals, uvs;
    } known[] = {
        {"common/meshes/bunny.ply", 0, 35947, 69451, 0, false, false},
        {"common/meshes/teapot.ply", 0, 1177, 2256, 0, false, false},
        {"common/meshes/rectangle.obj", 0, 4, 2, 0, false, true},
        {"tests/ply/rectangle_normals_uv.ply", 0, 4, 2, 0, true, true},
        {"tests/obj/rectangle_normals_uv.obj", 0, 4, 2, 0, true, true},
        {"tests/serialized/rectangle_normals_uv.serialized", 0, 4, 2, 0, true, true},
        {"tests/scenes/mesh_attributes/meshes/sphere_attribute.ply", 0, 1192, 528, 3, true, true},
        {"common/meshes/matpreview.serialized", 0, 289, 512, 0, true, true},
        {"common/meshes/matpreview.serialized", 1, 2078, 3936, 0, true, true},
        {"common/meshes/matpreview.serialized", 2, 29439, 57152, 0, true, true},
    };
    for (int i = 0; i < COUNT_OF(known); i++) {
        char path[2048];
        snprintf(path, sizeof path, "%s/data/%s", folder, known[i].path);
        rey_mesh mesh;
        assert_ok(ctx, read_any(ctx, path, known[i].shape_index, &mesh));
        bool same = mesh.vertex_count == known[i].vertices && mesh.face_count == known[i].faces &&
                    mesh.attribute_count == known[i].attributes && known[i].normals == (mesh.normals != NULL) &&
                    known[i].uvs == (mesh.uvs != NULL);
        if (!same) {
            fail_msg("%s: %lld vertices, %lld faces, %d attributes, normals %d, uvs %d", path,
                     (long long)mesh.vertex_count, (long long)mesh.face_count, mesh.attribute_count, !!mesh.normals,
                     !!mesh.uvs);
        }
        rey_mesh_free(ctx, &mesh);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_obj_corners_become_vertices),
        cmocka_unit_test(test_obj_forward_and_missing_normals),
cmocka_unit_test(test_seams_are_welded),
        cmocka_unit_test(test_ply_encodings_agree),
        cmocka_unit_test(test_serialized_versions_agree),
        cmocka_unit_test(test_round_trip),
        cmocka_unit_test(test_write_failures),
        cmocka_unit_test(test_cube_normals),
        cmocka_unit_test(test_degenerate_normals),
        cmocka_unit_test(test_numbers_round_like_the_c_library),
        cmocka_unit_test(test_conformance_meshes),
    };
    return cmocka_run_group_tests(tests, setup, teardown);
}
