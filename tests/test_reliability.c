// Every allocation of loading and rendering fails in turn: no crash, nothing left behind, the next attempt works.
// Many rounds of load, render, free hold no memory. Values that make no sense are refused.
#include "base/platform.h"
#include "reynolds/reynolds.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

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
    "<emitter type=\"constant\"/></scene>";

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

static char scene_path[64];

static int write_scene(void **state) {
    UNUSED(state);
    snprintf(scene_path, sizeof scene_path, "/tmp/reynolds_reliability_%ld.xml", (long)getpid());
    FILE *f = fopen(scene_path, "w");
    if (!f) {
        return 1;
    }
    fputs(scene_text, f);
    return fclose(f);
}

static int remove_scene(void **state) {
    UNUSED(state);
    return unlink(scene_path);
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
