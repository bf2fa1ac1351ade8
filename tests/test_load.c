// Files that are read ahead by several threads make the same scene, and the same messages, as one after the other; and
// where memory ends nothing is left behind.
#include "base/platform.h"
#include "reynolds/reynolds.h"
#include "folder.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

enum { FILES = 12, PATH_BYTES = 128 };

static char folder[64];

static void write_text(const char *name, const char *text) {
    char path[PATH_BYTES];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    FILE *f = fopen(path, "w");
    assert_non_null(f);
    fputs(text, f);
    assert_int_equal(fclose(f), 0);
}

// Meshes of both text formats and pictures, each different; file `broken` and those a multiple of 5 behind it are not
// what they should be (negative: none).
static void write_scene(int broken) {
    static char scene[FILES * 512];
    size_t used = (size_t)snprintf(scene, sizeof scene, "<scene version=\"3.0.0\">");
    for (int i = 0; i < FILES; i++) {
        char name[32], text[512];
        const char *kinds[] = {"obj", "ply", "pfm"}, *kind = kinds[i % 3];
        snprintf(name, sizeof name, "file%d.%s", i, kind);
        if (i % 3 == 0) {
            snprintf(text, sizeof text, "v 0 0 %d\nv 1 0 0\nv 0 1 0\nv 1 1 0.%d\nf 1 2 3\nf 2 4 3\n", i, i);
        } else if (i % 3 == 1) {
            snprintf(text, sizeof text, "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
                     "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
                     "0 0 %d\n1 0 0\n0 1 0\n3 0 1 2\n", i);
        } else {
            snprintf(text, sizeof text, "Pf\n2 1\n-1\n0.%d0.%d", 10 + i, 30 + i); // texels of any four bytes
        }
        if (broken >= 0 && i >= broken && (i - broken) % 5 == 0) {
            snprintf(text, sizeof text, "nothing of that kind");
        }
        write_text(name, text);
        const char *form = i % 3 == 2 ? "<shape type=\"sphere\"><bsdf type=\"diffuse\"><texture type=\"bitmap\" "
                                        "name=\"reflectance\"><boolean name=\"raw\" value=\"true\"/><string "
                                        "name=\"filename\" value=\"%s\"/></texture></bsdf></shape>"
                                      : "<shape type=\"%s\"><string name=\"filename\" value=\"%s\"/></shape>";
        used += (size_t)(i % 3 == 2 ? snprintf(scene + used, sizeof scene - used, form, name)
                                    : snprintf(scene + used, sizeof scene - used, form, kind, name));
    }
    snprintf(scene + used, sizeof scene - used, "</scene>");
    write_text("scene.xml", scene);
}

static int make_folder(void **state) {
    UNUSED(state);
    snprintf(folder, sizeof folder, "/tmp/reynolds_load_XXXXXX");
    return !folder_make(folder);
}

static int remove_folder(void **state) {
    UNUSED(state);
    return folder_remove(folder);
}

static rey_result load(rey_context *ctx, bool lenient, rey_scene **scene) {
    char path[PATH_BYTES];
    snprintf(path, sizeof path, "%s/scene.xml", folder);
    return (lenient ? rey_scene_load_lenient : rey_scene_load)(ctx, path, NULL, 0, scene);
}

static rey_context *context_of(int threads) {
    rey_context_def def = rey_default_context_def();
    rey_context *ctx = NULL;
    def.threads = threads;
    assert_int_equal(rey_context_create(&def, &ctx), REY_OK);
    return ctx;
}

static void test_same_scene(void **state) {
    UNUSED(state);
    write_scene(-1);
    rey_context *one = context_of(1), *four = context_of(4);
    rey_scene *a, *b;
    assert_int_equal(load(one, false, &a), REY_OK);
    assert_int_equal(load(four, false, &b), REY_OK);
    assert_true(rey_param_count(a) >= FILES);
    assert_int_equal(rey_param_count(a), rey_param_count(b));
    for (int i = 0; i < rey_param_count(a); i++) {
        rey_param_info x, y;
        assert_int_equal(rey_param_get_info(a, i, &x), REY_OK);
        assert_int_equal(rey_param_get_info(b, i, &y), REY_OK);
        assert_string_equal(x.name, y.name);
        assert_int_equal(x.count, y.count);
        assert_memory_equal(rey_param_values(a, i), rey_param_values(b, i), (size_t)x.count * sizeof(float));
    }
    rey_scene_destroy(a);
    rey_scene_destroy(b);
    rey_context_destroy(one);
    rey_context_destroy(four);
}

// The message is that of the first broken file in the document, whichever thread fails first.
static void test_same_messages(void **state) {
    UNUSED(state);
    rey_context *one = context_of(1), *four = context_of(4);
    for (int broken = 0; broken < 6; broken++) {
        rey_scene *a, *b;
        char file[32];
        write_scene(broken);
        snprintf(file, sizeof file, "file%d.", broken);
        rey_result result = load(one, false, &a);
        assert_int_not_equal(result, REY_OK);
        assert_non_null(strstr(rey_error(one), file));
        for (int round = 0; round < 4; round++) {
            assert_int_equal(load(four, false, &b), result);
            assert_string_equal(rey_error(one), rey_error(four));
        }
        assert_int_equal(load(one, true, &a), REY_OK);
        assert_int_equal(load(four, true, &b), REY_OK);
        assert_true(rey_scene_ignored_count(a) >= 2);
        assert_int_equal(rey_scene_ignored_count(a), rey_scene_ignored_count(b));
        for (int i = 0; i < rey_scene_ignored_count(a); i++) {
            assert_string_equal(rey_scene_ignored(a, i), rey_scene_ignored(b, i));
        }
        rey_scene_destroy(a);
        rey_scene_destroy(b);
    }
    rey_context_destroy(one);
    rey_context_destroy(four);
}

typedef struct Meter {
    atomic_long calls, live, fail_at;
} Meter;

static void *meter_alloc(void *user, size_t bytes, size_t alignment) {
    Meter *m = user;
    if (atomic_fetch_add(&m->calls, 1) == atomic_load(&m->fail_at)) {
        return NULL;
    }
    void *memory = aligned_alloc(alignment, (bytes + alignment - 1) / alignment * alignment);
    atomic_fetch_add(&m->live, memory != NULL);
    return memory;
}

static void meter_release(void *user, void *memory) {
    atomic_fetch_sub(&((Meter *)user)->live, memory != NULL);
    free(memory);
}

static void test_failing_allocations(void **state) {
    UNUSED(state);
    write_scene(-1);
    Meter m = {.fail_at = -1};
    rey_context_def def = rey_default_context_def();
    rey_context *ctx = NULL;
    def.threads = 2;
    def.alloc = meter_alloc;
    def.release = meter_release;
    def.user = &m;
    assert_int_equal(rey_context_create(&def, &ctx), REY_OK);
    rey_scene *scene;
    long base = m.live, start = m.calls;
    assert_int_equal(load(ctx, false, &scene), REY_OK);
    rey_scene_destroy(scene);
    long calls = m.calls - start;
    for (long k = 0; k < calls; k++) {
        m.fail_at = m.calls + k;
        rey_result result = load(ctx, false, &scene);
        bool reached = m.calls > m.fail_at;
        rey_scene_destroy(scene);
        if (m.live != base || (reached && result != REY_ERROR_MEMORY)) {
            fail_msg("allocation %ld: result %d, %ld blocks left behind", k, (int)result, (long)m.live - base);
        }
    }
    rey_context_destroy(ctx);
    assert_int_equal(m.live, 0);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_same_scene), cmocka_unit_test(test_same_messages),
                                       cmocka_unit_test(test_failing_allocations)};
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
