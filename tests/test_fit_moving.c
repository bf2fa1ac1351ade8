// test_fit_moving.c: whole small fits of what moves: vertices from coarse to fine, exposures, cameras; resumed with the same bits.
#include "fit/fit.h"
#include "io/file.h"
#include "io/image.h"
#include "folder.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { SIZE = 24, RINGS = 6, SEGMENTS = 9 };

typedef struct Fixture {
    rey_context *ctx;
    char folder[64];
} Fixture;

static const char *const SCENE =
    "<scene version=\"3.0.0\"><integrator type=\"path\"><integer name=\"max_depth\" value=\"2\"/></integrator>"
    "<default name=\"x\" value=\"0\"/>"
    "<sensor type=\"perspective\" id=\"front\"><float name=\"fov\" value=\"40\"/><transform name=\"to_world\"><lookat "
    "origin=\"$x, -4, 0\" target=\"$x, 0, 0\" up=\"0, 0, 1\"/></transform><film type=\"hdrfilm\"><integer name=\"width\" "
    "value=\"24\"/><integer name=\"height\" value=\"24\"/><rfilter type=\"box\"/></film></sensor>"
    "<sensor type=\"perspective\" id=\"side\"><float name=\"fov\" value=\"40\"/><transform name=\"to_world\"><lookat "
    "origin=\"4, 0, 0\" target=\"0, 0, 0\" up=\"0, 0, 1\"/></transform><film type=\"hdrfilm\"><integer name=\"width\" "
    "value=\"24\"/><integer name=\"height\" value=\"24\"/><rfilter type=\"box\"/></film></sensor>"
    "<shape type=\"obj\" id=\"ball\"><string name=\"filename\" value=\"ball.obj\"/><boolean name=\"face_normals\" "
    "value=\"true\"/><bsdf type=\"diffuse\"/></shape>"
    "<emitter type=\"directional\" id=\"sun\"><vector name=\"direction\" value=\"-1, 2, -1\"/><rgb name=\"irradiance\" "
    "value=\"2\"/>"
    "</emitter><emitter type=\"constant\" id=\"sky\"><rgb name=\"radiance\" value=\"0.2\"/></emitter></scene>";

// A ball of rings whose seam in uv has vertices of both sides.
static void write_ball(const Fixture *f) {
    char path[128];
    snprintf(path, sizeof path, "%s/ball.obj", f->folder);
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    for (int ring = 0; ring <= RINGS; ring++) {
        for (int k = 0; k <= SEGMENTS; k++) {
            double height = 3.14159265358979 * ring / RINGS, turn = 2 * 3.14159265358979 * (k % SEGMENTS) / SEGMENTS;
            bool pole = ring % RINGS == 0;
            fprintf(file, "v %.6f %.6f %.6f\nvt %.3f %.3f\n", pole ? 0 : sin(height) * cos(turn),
                    pole ? 0 : sin(height) * sin(turn), cos(height), k / (double)SEGMENTS, ring / (double)RINGS);
        }
    }
    for (int ring = 0; ring < RINGS; ring++) {
        for (int k = 0; k < SEGMENTS; k++) {
            int a = ring * (SEGMENTS + 1) + k + 1, c = a + SEGMENTS + 1;
            if (ring > 0) {
                fprintf(file, "f %d/%d %d/%d %d/%d\n", a, a, c, c, a + 1, a + 1);
            }
            if (ring + 1 < RINGS) {
                fprintf(file, "f %d/%d %d/%d %d/%d\n", a + 1, a + 1, c, c, c + 1, c + 1);
            }
        }
    }
    assert_int_equal(fclose(file), 0);
}

static void write_text(const Fixture *f, const char *name, const char *text) {
    char path[128];
    snprintf(path, sizeof path, "%s/%s", f->folder, name);
    assert_int_equal(rey_file_write(f->ctx, path, text, strlen(text)), REY_OK);
}

// Both views of a ball that is 1.2 times as wide, the second one half as bright.
static void write_targets(const Fixture *f) {
    char path[128];
    rey_scene *scene;
    float image[SIZE * SIZE * 3];
    snprintf(path, sizeof path, "%s/scene.xml", f->folder);
    assert_int_equal(rey_scene_load(f->ctx, path, NULL, 0, &scene), REY_OK);
    int param = rey_param_find(scene, "ball.positions");
    rey_param_info info;
    assert_int_equal(rey_param_get_info(scene, param, &info), REY_OK);
    float *moved = malloc((size_t)info.count * sizeof *moved);
    assert_non_null(moved);
    memcpy(moved, rey_param_values(scene, param), (size_t)info.count * sizeof *moved);
    for (int64_t i = 0; i < info.count; i += 3) {
        moved[i] *= 1.2f;
    }
    assert_int_equal(rey_param_set(scene, param, moved, info.count), REY_OK);
    free(moved);
    for (int v = 0; v < 2; v++) {
        rey_render_def def = rey_default_render_def();
        def.sensor = v;
        def.spp = 256;
        def.seed = 99;
        assert_int_equal(rey_render(scene, &def, image, NULL), REY_OK);
        for (int i = 0; i < SIZE * SIZE * 3 && v; i++) {
            image[i] *= 0.5f;
        }
        snprintf(path, sizeof path, "%s/target_%d.exr", f->folder, v);
        assert_int_equal(rey_exr_write(f->ctx, path, image, SIZE, SIZE, 3, NULL), REY_OK);
    }
    snprintf(path, sizeof path, "%s/truth.xml", f->folder);
    assert_int_equal(rey_scene_save(scene, path), REY_OK);
    rey_scene_destroy(scene);
}

static int set_up(void **state) {
    Fixture *f = calloc(1, sizeof *f);
    rey_context_def def = rey_default_context_def();
    def.threads = 2;
    if (!f || rey_context_create(&def, &f->ctx)) {
        return 1;
    }
    snprintf(f->folder, sizeof f->folder, "/tmp/reynolds_test_moving_XXXXXX");
    if (!folder_make(f->folder)) {
        return 1;
    }
    write_ball(f);
    write_text(f, "scene.xml", SCENE);
    write_targets(f);
    *state = f;
    return 0;
}

static int tear_down(void **state) {
    Fixture *f = *state;
    int status = folder_remove(f->folder);
    rey_context_destroy(f->ctx);
    free(f);
    return status;
}

enum { IN_REMESHING = -2 }; // when to stop, else the iteration, or -1 = never

static bool stop_at(void *user, const FitProgress *progress) {
    const int *at = user;
    return progress->finishing || (progress->remeshing ? *at != IN_REMESHING : *at < 0 || progress->iteration < *at);
}

// Runs a job of this text in a folder of its own.
static rey_result run_job(Fixture *f, const char *text, const char *out, bool resume, int stop, FitResult *result) {
    char job[128], folder[128];
    write_text(f, "job.yaml", text);
    snprintf(job, sizeof job, "%s/job.yaml", f->folder);
    snprintf(folder, sizeof folder, "%s/%s", f->folder, out);
    FitDef def = {.job_path = job, .output = folder, .resume = resume, .progress = stop_at, .user = &stop};
    return rey_fit(f->ctx, &def, result);
}

// Stopped and resumed, a job finds the same bits.
static void expect_same_when_resumed(Fixture *f, const char *text, int stop, const FitResult *whole) {
    FitResult part;
    assert_int_equal(run_job(f, text, "part", false, stop, &part), REY_ERROR_CANCELLED);
    rey_fit_result_free(&part);
    if (run_job(f, text, "part", true, -1, &part)) {
        fail_msg("%s", rey_error(f->ctx));
    }
    assert_int_equal(whole->rows.count, part.rows.count);
    for (size_t i = 0; i < part.rows.count; i++) {
        const FitRow *a = &ARRAY_AT(whole->rows, FitRow, i), *b = &ARRAY_AT(part.rows, FitRow, i);
        assert_int_equal(a->count, b->count);
        assert_memory_equal(a->found, b->found, (size_t)a->count * sizeof(float));
    }
    rey_fit_result_free(&part);
    char folder[128];
    snprintf(folder, sizeof folder, "%s/part", f->folder);
    assert_int_equal(folder_remove(folder), 0);
}

#define VIEWS "scene: scene.xml\nviews: [{target: target_0.exr}, {target: target_1.exr}]\nloss: l2\nreport_spp: 0\n"

// A ball that grows wider, seen by two cameras of which one is half as bright. The seam stays closed.
static void test_vertices_and_exposure(void **state) {
    Fixture *f = *state;
    FitResult result;
    const char *text = VIEWS
        "iterations: 90\nspp: 16\nlevels: [{from: 0, reduce: 2}, {from: 50, reduce: 1}]\n"
        "optimizer: {learning_rate: 0.06, beta2: 0.9, schedule: cosine, average: 2}\nparameters:\n"
        "  - {name: ball.positions, parameterisation: laplacian, smoothness: 4, regularisers: {edge_length: 0.00001, "
        "normals: 0.00001, laplacian: 0.00001}}\n"
        "  - {name: views.1.exposure, parameterisation: log, learning_rate: 0.05, start: 0.6}\n";
    if (run_job(f, text, "vertices", false, -1, &result)) {
        fail_msg("%s", rey_error(f->ctx));
    }
    const FitRow *ball = &ARRAY_AT(result.rows, FitRow, 0), *exposure = &ARRAY_AT(result.rows, FitRow, 1);
    double wide = 0, deep = 0, high = 0;
    for (int64_t i = 0; i < ball->count; i += 3) {
        wide = fmax(wide, fabs((double)ball->found[i]));
        deep = fmax(deep, fabs((double)ball->found[i + 1]));
        high = fmax(high, fabs((double)ball->found[i + 2]));
        for (int64_t k = 0; k < i; k += 3) {
            bool same = !memcmp(ball->start + i, ball->start + k, 3 * sizeof(float));
            assert_true(!same || !memcmp(ball->found + i, ball->found + k, 3 * sizeof(float)));
        }
    }
    print_message("half axes %.3f %.3f %.3f, exposure %.3f\n", wide, deep, high, (double)exposure->found[0]);
    assert_float_equal(wide, 1.2, 0.05);
    assert_float_equal(deep, 1, 0.08);
    assert_float_equal(high, 1, 0.05);
    assert_float_equal((double)exposure->found[0], 0.5, 0.02);
    expect_same_when_resumed(f, text, 53, &result);
    rey_fit_result_free(&result);
}

// A scene whose ball has no seam.
static void write_plain(const Fixture *f) {
    char command[256];
    snprintf(command, sizeof command, "sed -e '/^vt/d' -e 's|/[0-9]*||g' %s/ball.obj > %s/plain.obj && sed 's/ball.obj/plain.obj/' "
             "%s/scene.xml > %s/plain.xml", f->folder, f->folder, f->folder, f->folder);
    assert_int_equal(system(command), 0);
}

#define PLAIN_VIEWS "scene: plain.xml\nviews: [{target: target_0.exr}, {target: target_1.exr}]\nloss: l2\n"
#define PLAIN_BALL "parameters:\n  - {name: ball.positions, parameterisation: laplacian, smoothness: 4}\n"

// A ball without a seam, remeshed on its way, seen through another exposure: the state of what is no mesh goes on, and a fit
// that is stopped just before or after the change finds the same bits.
static void test_remeshed_on_the_way(void **state) {
    Fixture *f = *state;
    FitResult result;
    write_plain(f);
    const char *text = PLAIN_VIEWS "report_spp: 2\n"
        "iterations: 60\nspp: 8\nlevels: [{from: 0, reduce: 2}, {from: 20, reduce: 2, edge_length: 0.35}, {from: 40}]\n"
        "optimizer: {learning_rate: 0.06, beta2: 0.9, average: 4}\n" PLAIN_BALL
        "  - {name: views.1.exposure, parameterisation: log, learning_rate: 0.05, start: 0.6}\ntruth: {scene: truth.xml}\n";
    if (run_job(f, text, "remeshed", false, -1, &result)) {
        fail_msg("%s", rey_error(f->ctx));
    }
    const FitRow *ball = &ARRAY_AT(result.rows, FitRow, 0);
    print_message("points %d to %d, %.2f %% to %.2f %%\n", (int)ball->points[COLUMN_START], (int)ball->points[COLUMN_FOUND],
                  100 * ball->chamfer[COLUMN_START], 100 * ball->chamfer[COLUMN_FOUND]);
    assert_true(ball->points[COLUMN_FOUND] > 1.5 * (double)ball->points[COLUMN_START]);
    assert_true(ball->chamfer[COLUMN_FOUND] < 0.7 * ball->chamfer[COLUMN_START]);
    assert_non_null(result.report);
    const int stops[] = {20, 21, 43, IN_REMESHING};
    for (int i = 0; i < COUNT_OF(stops); i++) {
        expect_same_when_resumed(f, text, stops[i], &result);
    }
    rey_fit_result_free(&result);
}

// A fit that is stopped while meshes are remeshed has not begun the level: L-BFGS has gone back to its best point, and does so
// once.
static void test_remeshing_is_stopped(void **state) {
    Fixture *f = *state;
    FitResult result;
    write_plain(f);
    const char *text = PLAIN_VIEWS "report_spp: 0\niterations: 12\nspp: 4\n"
                       "levels: [{from: 0, reduce: 2}, {from: 6, edge_length: 0.5}]\n"
                       "optimizer: {type: lbfgs, learning_rate: 0.03}\n"
                       PLAIN_BALL
                       "  - {name: views.1.exposure, parameterisation: log, start: 0.6}\n";
    if (run_job(f, text, "stopped", false, -1, &result)) {
        fail_msg("%s", rey_error(f->ctx));
    }
    expect_same_when_resumed(f, text, IN_REMESHING, &result);
    rey_fit_result_free(&result);
}

// Edges that would make too many triangles are refused before the first iteration, whatever level they are of, and leave no folder.
static void test_tiny_edges_are_refused(void **state) {
    Fixture *f = *state;
    FitResult result;
    char path[128];
    write_plain(f);
    rey_result code = run_job(f, PLAIN_VIEWS PLAIN_BALL "levels:\n  - {from: 0, reduce: 2}\n  - {from: 20, edge_length: 1e-6}\n",
                              "tiny", false, 1, &result);
    rey_fit_result_free(&result);
    assert_int_equal(code, REY_ERROR_PARAM);
    if (!strstr(rey_error(f->ctx), "job.yaml:8: level 1: edge_length = 1e-06 would make about 2.") ||
        !strstr(rey_error(f->ctx), "e+13 triangles of ball.positions, whose area is ") ||
        !strstr(rey_error(f->ctx), ", expected 4194304 or fewer")) {
        fail_msg("%s", rey_error(f->ctx));
    }
    snprintf(path, sizeof path, "%s/tiny", f->folder);
    assert_int_not_equal(access(path, F_OK), 0);
}

// L-BFGS ends at its best point, and goes on from a checkpoint with the same bits, in the middle of a search, too.
static void test_lbfgs_recovers_light(void **state) {
    Fixture *f = *state;
    FitResult result;
    const char *text = VIEWS "iterations: 36\nspp: 16\noptimizer: {type: lbfgs, learning_rate: 0.5, memory: 4}\n"
                             "load: truth.xml\nparameters:\n"
                             "  - {name: sun.irradiance.value, parameterisation: log, start: 0.5}\n"
                             "  - {name: sky.radiance.value, start: 0.7}\n"
                             "  - {name: views.1.exposure, start: 2}\n";
    if (run_job(f, text, "lights", false, -1, &result)) {
        fail_msg("%s", rey_error(f->ctx));
    }
    const double truth[] = {2, 0.2, 0.5};
    for (int k = 0; k < 3; k++) {
        const FitRow *row = &ARRAY_AT(result.rows, FitRow, k);
        print_message("%s %.4f\n", row->name, (double)row->found[0]);
        assert_float_equal((double)row->found[0], truth[k], 0.02 * truth[k]);
    }
    for (int stop = 3; stop < 9; stop += 5) {
        expect_same_when_resumed(f, text, stop, &result);
    }
    rey_fit_result_free(&result);
}

static void test_level_errors(void **state) {
    Fixture *f = *state;
    static const char *const cases[][2] = {
        {"levels: [{from: 0, reduce: 5}]\nparameters: [{name: ball.positions}]\n", "expected multiples of 5"},
        {"levels: [{from: 1, reduce: 2}]\nparameters: [{name: ball.positions}]\n", "from = 1, expected 0 in the first entry"},
        {"levels: [{from: 0, edge_length: 1}]\nparameters: [{name: ball.positions}]\n", "the job has none"},
        {"levels: [{from: 0, edge_length: 1}]\niterations: 1\nparameters: [{name: ball.positions, parameterisation: laplacian}]\n",
         "cannot remesh what has uv coordinates"},
        {"parameters: [{name: views.2.exposure}]\n", "the job has no view 2, expected 0 to 1"},
        {"parameters: [{name: views.1.exposure, parameterisation: rigid}]\n", "an exposure is one number"},
        {"parameters: [{name: views.1.exposure}, {name: 'views.*'}]\n", "names it already"},
        {"optimizer: {type: lbfgs, schedule: cosine}\nparameters: [{name: ball.positions}]\n", "it has no schedule"},
        {"gradient_spp: 2\noptimizer: {type: lbfgs}\nparameters: [{name: ball.positions}]\n", "no gradient_spp"},
        {"views_per_iteration: 1\noptimizer: {type: lbfgs}\nparameters: [{name: ball.positions}]\n", "all views"},
        {"parameters: [{name: ball.positions, parameterisation: laplacian, regularisers: {length: 1}}]\n", "unknown key"},
        {"parameters:\n  - {name: ball.positions, parameterisation: laplacian, start: 0}\n",
         "job.yaml:7: parameter 'ball.positions': its start is a mesh without area: all of its triangles are lines or points"},
        {"parameters: [{name: front.to_world, parameterisation: rigid, start: 0}]\n",
         "job.yaml:6: parameter 'front.to_world': its start cannot be inverted, expected a pose"},
    };
    for (int i = 0; i < COUNT_OF(cases); i++) {
        char text[1024];
        FitResult result;
        snprintf(text, sizeof text, VIEWS "%s%s", strstr(cases[i][0], "iterations") ? "" : "iterations: 0\n",
                 cases[i][0]);
        rey_result code = run_job(f, text, "errors", false, -1, &result);
        rey_fit_result_free(&result);
        if (!code || !strstr(rey_error(f->ctx), cases[i][1])) {
            fail_msg("expected '%s' in '%s'", cases[i][1], rey_error(f->ctx));
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_vertices_and_exposure),
        cmocka_unit_test(test_remeshed_on_the_way),
        cmocka_unit_test(test_remeshing_is_stopped),
        cmocka_unit_test(test_tiny_edges_are_refused),
        cmocka_unit_test(test_lbfgs_recovers_light),
        cmocka_unit_test(test_level_errors),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
