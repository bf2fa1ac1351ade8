// Every allocation of loading and rendering fails in turn: no crash, nothing left behind, the next attempt works.
// Many rounds of load, render, free hold no memory. Values that make no sense are refused.
#include "base/platform.h"
#include "reynolds/reynolds.h"
#include "folder.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

// Every kind of file beside the scene: FOLDER stands for where they are.
static const char scene_text[] =
    "<scene version=\"3.0.0\"><integrator type=\"path\"><integer name=\"max_depth\" value=\"3\"/></integrator>"
    "<sensor type=\"perspective\"><transform name=\"to_world\"><lookat origin=\"0,0,4\" target=\"0,0,0\" up=\"0,1,0\"/>"
    "</transform><film type=\"hdrfilm\"><integer name=\"width\" value=\"6\"/><integer name=\"height\" value=\"6\"/></film>"
    "</sensor><bsdf type=\"roughplastic\" id=\"satin\"/>"
    "<shape type=\"sphere\"><ref id=\"satin\"/></shape>"
    "<shape type=\"shapegroup\" id=\"pair\"><shape type=\"cylinder\"/><shape type=\"sphere\"/></shape>"
    "<shape type=\"instance\"><ref id=\"pair\"/><transform name=\"to_world\"><scale value=\"0.3\"/></transform></shape>"
    "<shape type=\"cube\"><transform name=\"to_world\"><translate z=\"-3\"/></transform>"
    "<bsdf type=\"mask\"><bsdf type=\"diffuse\" id=\"wall\"/></bsdf></shape>"
    "<shape type=\"rectangle\"><transform name=\"to_world\"><translate z=\"5\"/></transform>"
    "<emitter type=\"area\"><rgb name=\"radiance\" value=\"3\"/></emitter></shape>"
    "<shape type=\"bsplinecurve\"><string name=\"filename\" value=\"FOLDER/hair.txt\"/>"
    "<bsdf type=\"principled\"><float name=\"clearcoat\" value=\"0.5\"/><texture type=\"bitmap\" name=\"base_color\">"
    "<string name=\"filename\" value=\"FOLDER/sky.pfm\"/><boolean name=\"raw\" value=\"true\"/></texture></bsdf></shape>"
    "<shape type=\"sdfgrid\"><string name=\"filename\" value=\"FOLDER/ball.vol\"/>"
    "<bsdf type=\"principledthin\"/></shape>"
    "<shape type=\"ply\"><string name=\"filename\" value=\"FOLDER/leaf.ply\"/></shape>"
    "<emitter type=\"envmap\"><string name=\"filename\" value=\"FOLDER/sky.pfm\"/></emitter></scene>";

static const char curve_text[] = "-1 -1 0 0.1\n-0.5 0 0 0.1\n0.5 0 0 0.1\n1 1 0 0.1\n";
static const char mesh_text[] = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
                                "property float z\nproperty float vertex_heat\nelement face 1\n"
                                "property list uchar int vertex_indices\nend_header\n0 0 1 1\n1 0 1 2\n0 1 1 3\n3 0 1 2\n";

enum { PIXELS = 36, SPP = 2 };

// An allocator that counts and, at one call, fails. Each block begins with its size.
typedef struct Meter {
    atomic_long calls, live, fail_at; // fail_at < 0: never
    atomic_long bytes, most;          // held now, and at most
} Meter;

enum { BEFORE = 64 };

static void *meter_alloc(void *user, size_t bytes, size_t alignment) {
    Meter *m = user;
    if (atomic_fetch_add(&m->calls, 1) == atomic_load(&m->fail_at)) {
        return NULL;
    }
    assert_true(alignment <= BEFORE);
    char *memory = aligned_alloc(BEFORE, (bytes + 2 * BEFORE - 1) / BEFORE * BEFORE);
    if (!memory) {
        return NULL;
    }
    *(size_t *)(void *)memory = bytes;
    atomic_fetch_add(&m->live, 1);
    long held = atomic_fetch_add(&m->bytes, (long)bytes) + (long)bytes;
    if (held > atomic_load(&m->most)) { // one thread
        atomic_store(&m->most, held);
    }
    return memory + BEFORE;
}

static void meter_release(void *user, void *memory) {
    Meter *m = user;
    if (memory) {
        char *block = (char *)memory - BEFORE;
        atomic_fetch_sub(&m->live, 1);
        atomic_fetch_sub(&m->bytes, (long)*(size_t *)(void *)block);
        free(block);
    }
}

static char folder[64], scene_path[128];

static int write_file(const char *name, const void *bytes, size_t size) {
    char path[128];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    FILE *f = fopen(path, "wb");
    bool good = f && fwrite(bytes, 1, size, f) == size;
    return f && fclose(f) == 0 && good ? 0 : 1;
}

// Distances to a ball of radius 0.3 at 4 x 4 x 4 nodes of the unit cube.
static int write_grid(void) {
    enum { NODES = 4 };
    struct {
        unsigned char magic[4];
        int32_t encoding, nodes[3], channels;
        float box[6], values[NODES * NODES * NODES];
    } grid = {{'V', 'O', 'L', 3}, 1, {NODES, NODES, NODES}, 1, {0, 0, 0, 1, 1, 1}, {0}};
    for (int i = 0; i < NODES * NODES * NODES; i++) {
        float x = (float)(i % NODES) / 3 - 0.5f, y = (float)(i / NODES % NODES) / 3 - 0.5f;
        float z = (float)(i / NODES / NODES) / 3 - 0.5f;
        grid.values[i] = sqrtf(x * x + y * y + z * z) - 0.3f;
    }
    return write_file("ball.vol", &grid, sizeof grid);
}

static int write_sky(void) {
    enum { WIDTH = 4, HEIGHT = 3 };
    static const char header[] = "PF\n4 3\n-1\n";
    float values[WIDTH * HEIGHT * 3];
    char bytes[sizeof header - 1 + sizeof values];
    for (int i = 0; i < WIDTH * HEIGHT * 3; i++) {
        values[i] = 0.1f + 0.02f * (float)i;
    }
    memcpy(bytes, header, sizeof header - 1);
    memcpy(bytes + sizeof header - 1, values, sizeof values);
    return write_file("sky.pfm", bytes, sizeof bytes);
}

static int write_scene(void **state) {
    UNUSED(state);
    static char text[sizeof scene_text + 8 * sizeof folder];
    size_t used = 0;
    snprintf(folder, sizeof folder, "/tmp/reynolds_reliability_XXXXXX");
    if (!folder_make(folder)) {
        return 1;
    }
    for (const char *at = scene_text, *next; *at; at = next) {
        next = strstr(at, "FOLDER");
        size_t n = next ? (size_t)(next - at) : strlen(at);
        memcpy(text + used, at, n);
        used += n;
        used += next ? (size_t)snprintf(text + used, sizeof text - used, "%s", folder) : 0;
        next = next ? next + strlen("FOLDER") : at + n;
    }
    snprintf(scene_path, sizeof scene_path, "%s/scene.xml", folder);
    return write_file("scene.xml", text, used) || write_file("hair.txt", curve_text, strlen(curve_text)) ||
           write_file("leaf.ply", mesh_text, strlen(mesh_text)) || write_grid() || write_sky();
}

static int remove_scene(void **state) {
    UNUSED(state);
    return folder_remove(folder);
}

static rey_context *context_with(Meter *m) {
    rey_context_def def = rey_default_context_def();
    def.threads = 1;
    def.alloc = meter_alloc;
    def.release = meter_release;
    def.user = m;
    rey_context *ctx = NULL;
    assert_int_equal(rey_context_create(&def, &ctx), REY_OK);
    return ctx;
}

// Loads, sets a value, renders, and takes a gradient both ways if wanted.
static rey_result one_round(rey_context *ctx, rey_scene **scene, bool derivatives) {
    float image[PIXELS * 3], values[3] = {0.3f, 0.4f, 0.5f};
    double gradient[3];
    *scene = NULL;
    rey_result result = rey_scene_load(ctx, scene_path, NULL, 0, scene);
    rey_render_def def = rey_default_render_def();
    def.spp = SPP;
    def.sets = 2;
    int param = result == REY_OK ? rey_param_find(*scene, "satin.diffuse_reflectance.value") : -1;
    rey_selection selection = {&param, 1};
    rey_param_info info;
    if (result == REY_OK) {
        result = rey_param_get_info(*scene, param, &info);
    }
    if (result == REY_OK) {
        result = rey_param_set(*scene, param, values, info.count);
    }
    if (result == REY_OK) {
        result = rey_render(*scene, &def, image, NULL);
    }
    if (result == REY_OK && derivatives) {
        result = rey_vjp(*scene, &def, selection, image, gradient, NULL, NULL);
    }
    if (result == REY_OK && derivatives) {
        result = rey_jvp(*scene, &def, selection, values, image, NULL, NULL);
    }
    return result;
}

static rey_result whole_round(rey_context *ctx, rey_scene **scene) { return one_round(ctx, scene, true); }

static void test_failing_allocations(void **state) {
    UNUSED(state);
    Meter m = {.fail_at = -1};
    rey_context *ctx = context_with(&m);
    long base = m.live, start = m.calls;
    rey_scene *scene;
    assert_int_equal(whole_round(ctx, &scene), REY_OK);
    rey_scene_destroy(scene);
    assert_int_equal(m.live, base);
    long calls = m.calls - start;
    print_message("%ld allocations\n", calls);
    for (long k = 0; k < calls; k++) {
        m.fail_at = m.calls + k;
        rey_result result = whole_round(ctx, &scene);
        bool reached = m.calls > m.fail_at;
        m.fail_at = -1;
        rey_scene_destroy(scene);
        if (m.live != base || (reached && result == REY_OK)) {
            fail_msg("allocation %ld: result %d, %ld blocks left behind", k, (int)result, (long)m.live - base);
        }
        if (k % 16 == 0) { // the context is as good as new
            assert_int_equal(whole_round(ctx, &scene), REY_OK);
            rey_scene_destroy(scene);
        }
    }
    rey_context_destroy(ctx);
    assert_int_equal(m.live, 0);
}

static void test_many_rounds(void **state) {
    UNUSED(state);
    Meter m = {.fail_at = -1};
    rey_context *ctx = context_with(&m);
    long base = m.live, bytes = m.bytes, most = 0;
    for (int i = 0; i < 1000; i++) {
        rey_scene *scene;
        m.most = 0;
        assert_int_equal(one_round(ctx, &scene, i % 8 == 0), REY_OK);
        rey_scene_destroy(scene);
        assert_int_equal(m.live, base);
        assert_int_equal(m.bytes, bytes);
        most = i == 0 ? m.most : most;
        assert_true(m.most <= most); // no round needs more than the first
    }
    rey_context_destroy(ctx);
    print_message("1000 rounds, each holding at most %ld bytes\n", most);
    assert_int_equal(m.live, 0);
    assert_int_equal(m.bytes, 0);
}

static void test_absurd_values(void **state) {
    UNUSED(state);
    Meter m = {.fail_at = -1};
    rey_context *ctx = context_with(&m);
    rey_scene *scene;
    assert_int_equal(whole_round(ctx, &scene), REY_OK);
    for (int i = 0; i < rey_param_count(scene); i++) {
        rey_param_info info;
        assert_int_equal(rey_param_get_info(scene, i, &info), REY_OK);
        float *before = malloc((size_t)info.count * sizeof *before), *values = malloc((size_t)info.count * sizeof *values);
        assert_true(before && values);
        memcpy(before, rey_param_values(scene, i), (size_t)info.count * sizeof *before);
        const float absurd[] = {NAN, INFINITY, -INFINITY, info.low - 1, info.high + 1};
        for (int k = 0; k < COUNT_OF(absurd); k++) {
            memcpy(values, before, (size_t)info.count * sizeof *before);
            values[info.count - 1] = absurd[k];
            if (isfinite(absurd[k]) && absurd[k] >= info.low && absurd[k] <= info.high) {
                continue;
            }
            assert_int_equal(rey_param_set(scene, i, values, info.count), REY_ERROR_PARAM);
            assert_memory_equal(rey_param_values(scene, i), before, (size_t)info.count * sizeof *before);
        }
        assert_int_equal(rey_param_set(scene, i, before, info.count + 1), REY_ERROR_PARAM);
        free(before);
        free(values);
    }
    float image[PIXELS * 3];
    rey_render_def def = rey_default_render_def();
    def.sensor = 5;
    assert_int_equal(rey_render(scene, &def, image, NULL), REY_ERROR_ARGUMENT);
    def = rey_default_render_def();
    def.spp = -1;
    assert_int_equal(rey_render(scene, &def, image, NULL), REY_ERROR_ARGUMENT);
    def = rey_default_render_def();
    def.sets = 0;
    assert_int_equal(rey_render(scene, &def, image, NULL), REY_ERROR_ARGUMENT);
    assert_int_equal(rey_param_set(scene, -1, image, 1), REY_ERROR_ARGUMENT);
    assert_int_equal(rey_param_set(scene, rey_param_count(scene), image, 1), REY_ERROR_ARGUMENT);
    rey_scene_destroy(scene);
    rey_context_destroy(ctx);
    assert_int_equal(m.live, 0);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_failing_allocations), cmocka_unit_test(test_many_rounds),
                                       cmocka_unit_test(test_absurd_values)};
    return cmocka_run_group_tests(tests, write_scene, remove_scene);
}
