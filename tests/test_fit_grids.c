// test_fit_grids.c: grids of voxels as unknowns: regularisers, resampling, and a small fit from coarse to fine with a view held
// out, resumed with the same bits.
#include "fit_folder.h"
#include "io/vol.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { SIZE = 8, COARSE = 4, FINE = 6, VIEWS = 3 };

static const char *const HEAD =
    "<scene version=\"3.0.0\"><default name=\"file\" value=\"start.vol\"/><integrator type=\"volpath\"><integer name=\"max_depth\" "
    "value=\"4\"/></integrator><shape type=\"cube\" id=\"air\"><bsdf type=\"null\"/><medium name=\"interior\" "
    "type=\"heterogeneous\">"
    "<volume name=\"sigma_t\" type=\"gridvolume\"><string name=\"filename\" value=\"$file\"/><transform name=\"to_world\"><scale "
    "value=\"2\"/><translate value=\"-1\"/></transform></volume><rgb name=\"albedo\" value=\"0.8\"/></medium></shape><emitter "
    "type=\"constant\"><rgb name=\"radiance\" value=\"0.3, 0.4, 0.6\"/></emitter><emitter "
    "type=\"directional\"><vector name=\"direction\" value=\"0, 0.3, -1\"/><rgb name=\"irradiance\" value=\"4\"/></emitter>";
static const char *const SENSOR =
    "<sensor type=\"perspective\"><float name=\"fov\" value=\"38\"/><transform name=\"to_world\"><lookat origin=\"%s\" "
    "target=\"0, 0, 0\" up=\"0, 0, 1\"/></transform><film type=\"hdrfilm\"><integer name=\"width\" value=\"8\"/><integer "
    "name=\"height\" value=\"8\"/><rfilter type=\"box\"/></film></sensor>";
static const char *const JOB =
    "scene: scene.xml\nseed: 3\niterations: 60\nspp: 128\n"
    "views:\n  - {target: target_0.exr}\n  - {target: target_1.exr}\n  - {target: target_2.exr, held_out: true}\n"
    "loss: l2\noptimizer: {type: adam, learning_rate: 0.3, beta2: 0.9, schedule: cosine}\n"
    "levels:\n  - {from: 0, reduce: 2}\n  - {from: 20, resolution: 6}\n"
    "parameters:\n  - {name: air.interior_medium.sigma_t.data, parameterisation: softplus, regularisers: {total_variation: 1e-5, "
    "sparsity: 1e-5}}\n"
    "image_every: 0\nreport_spp: 64\ntruth: {scene: truth.xml}\n";

// A ball of fog beside the middle, or fog everywhere.
static int write_fog(const Fixture *f, const char *name, int n, bool ball) {
    float values[FINE * FINE * FINE];
    char path[128];
    rey_vol vol = {n, n, n, 1, {0, 0, 0, 1, 1, 1}, values};
    for (int i = 0; i < n * n * n; i++) {
        double x = (i % n + 0.5) / n - 0.35, y = (i / n % n + 0.5) / n - 0.5, z = (i / n / n + 0.5) / n - 0.6;
        values[i] = ball ? (float)(4 * exp(-(x * x + y * y + z * z) * 25)) : 0.6f;
    }
    path_of(f, name, path);
    return rey_vol_write(f->ctx, path, &vol);
}

static int write_scene(const Fixture *f, const char *name, const char *file) {
    static const char *const origins[VIEWS] = {"0, -4, 0", "4, 0, 0.5", "3, -3, 1"};
    char text[4096];
    int used = snprintf(text, sizeof text, "%s", HEAD);
    for (int i = 0; i < VIEWS; i++) {
        used += snprintf(text + used, sizeof text - (size_t)used, SENSOR, origins[i]);
    }
    snprintf(text + used, sizeof text - (size_t)used, "</scene>");
    char *value = strstr(text, "start.vol");
    memcpy(value, file, strlen(file)); // of the same length
    return write_text(f, name, text);
}

static int set_up(void **state) {
    Fixture *f = *state = fixture_make();
    return !f || write_fog(f, "start.vol", COARSE + 1, false) || write_fog(f, "truth.vol", FINE, true) ||
           write_scene(f, "scene.xml", "start.vol") || write_scene(f, "truth.xml", "truth.vol") || write_text(f, "job.yaml", JOB) ||
           write_targets_of_truth(f, VIEWS, SIZE, 1024);
}

/* ---- parts --------------------------------------------------------------------------------------------- */

// Both regularisers' gradients against differences, on a grid with two channels and a flat axis.
static void test_regularisers(void **state) {
    UNUSED(state);
    const GridSize size = {3, 4, 1, 2};
    float value[24];
    double unused[24] = {0}, gradient[24] = {0};
    for (int i = 0; i < 24; i++) {
        value[i] = (float)(0.3 + sin(i * 1.7) + 0.1 * i);
    }
    GridRegularisers weights[2] = {{.total_variation = 2}, {.sparsity = 3}};
    for (int which = 0; which < 2; which++) {
        memset(gradient, 0, sizeof gradient);
        assert_true(rey_voxels_regularise(size, weights[which], value, gradient) > 0.5);
        for (int i = 0; i < 24; i++) {
            const float held = value[i], step = 1e-3f;
            value[i] = held + step;
            double more = rey_voxels_regularise(size, weights[which], value, unused);
            value[i] = held - step;
            double less = rey_voxels_regularise(size, weights[which], value, unused);
            value[i] = held;
            assert_float_equal(gradient[i], (more - less) / (double)((held + step) - (held - step)), 1e-3);
        }
    }
}

// A ramp has the same total variation on every grid: |slope| but for the last voxels.
static void test_variation_is_of_the_field(void **state) {
    UNUSED(state);
    for (int32_t n = 10; n <= 40; n *= 2) {
        float value[40];
        double unused[40] = {0};
        for (int32_t i = 0; i < n; i++) {
            value[i] = (float)(5 * (i + 0.5) / n);
        }
        assert_float_equal(rey_voxels_regularise((GridSize){n, 1, 1, 1}, (GridRegularisers){.total_variation = 1}, value, unused),
                           5.0 * (n - 1) / n, 1e-4);
    }
}

// Linear fields stay linear away from the border, constants stay what they are; the longest axis gets the resolution.
static void test_resampling(void **state) {
    UNUSED(state);
    GridSize from = {4, 2, 1, 1}, to = rey_voxels_resized(from, 8);
    assert_int_equal(to.nx, 8);
    assert_int_equal(to.ny, 4);
    assert_int_equal(to.nz, 2);
    float value[8], out[64];
    for (int i = 0; i < 8; i++) {
        value[i] = (float)(i % 4 + 0.5);
    }
    rey_voxels_resample(from, WRAP_CLAMP, value, to, out);
    for (int i = 0; i < 64; i++) {
        double x = (i % 8 + 0.5) / 2;
        assert_float_equal((double)out[i], fmin(fmax(x, 0.5), 3.5), 1e-6);
    }
    rey_voxels_resample(from, WRAP_REPEAT, value, to, out);
    assert_float_equal((double)out[0], 0.75 * 0.5 + 0.25 * 3.5, 1e-6);
    rey_voxels_resample(from, WRAP_MIRROR, value, to, out);
    assert_float_equal((double)out[0], 0.5, 1e-6);
    rey_voxels_resample(from, WRAP_CLAMP, value, from, out);
    assert_memory_equal(out, value, sizeof value);
}

/* ---- whole fits ---------------------------------------------------------------------------------------- */

static bool stop_at(void *user, const FitProgress *progress) {
    const int *at = user;
    return progress->finishing || *at < 0 || progress->iteration < *at;
}

static rey_result run_fit(Fixture *f, const char *out, bool resume, int stop, const char *extra, FitResult *result) {
    char folder[128], job[128];
    path_of(f, out, folder);
    path_of(f, "job.yaml", job);
    FitDef def = {.job_path = job, .overrides = &extra, .override_count = extra ? 1 : 0, .output = folder, .resume = resume,
                  .progress = stop_at, .user = &stop};
    return rey_fit(f->ctx, &def, result);
}

static void test_fit_grows(void **state) {
    Fixture *f = *state;
    FitResult whole, part;
    if (run_fit(f, "a", false, -1, NULL, &whole)) {
        fail_msg("%s", rey_error(f->ctx));
    }
    const FitRow *row = &ARRAY_AT(whole.rows, FitRow, 0);
    assert_int_equal(row->count, FINE * FINE * FINE);
    assert_null(row->start); // it had other voxels
    double sum[2] = {0, 0}; // two pictures leave much open, but not where the ball is
    int count[2] = {0, 0};
    for (int64_t i = 0; i < row->count; i++) {
        assert_true(row->found[i] >= 0);
        sum[row->truth[i] > 1] += (double)row->found[i];
        count[row->truth[i] > 1]++;
    }
    assert_in_range(count[1], 4, 20);
    assert_true(sum[1] / count[1] > 5 * sum[0] / count[0]);
    assert_int_equal(whole.held_out.count, 1);
    assert_int_equal(ARRAY_AT(whole.held_out, FitHeldOut, 0).view, 2);
    if (ARRAY_AT(whole.held_out, FitHeldOut, 0).psnr < 28) {
        fail_msg("PSNR %g", ARRAY_AT(whole.held_out, FitHeldOut, 0).psnr);
    }
    assert_int_equal(access(whole.report, R_OK), 0);
    for (int stop = 19; stop < 32; stop += 12) { // before and after the grid grew
        assert_int_equal(run_fit(f, stop < 20 ? "b" : "c", false, stop, NULL, &part), REY_ERROR_CANCELLED);
        rey_fit_result_free(&part);
        assert_int_equal(run_fit(f, stop < 20 ? "b" : "c", true, -1, NULL, &part), REY_OK);
        assert_memory_equal(ARRAY_AT(part.rows, FitRow, 0).found, row->found, (size_t)row->count * sizeof(float));
        rey_fit_result_free(&part);
    }
    rey_scene *scene = NULL;
    assert_int_equal(rey_scene_load(f->ctx, whole.scene, NULL, 0, &scene), REY_OK);
    assert_memory_equal(rey_param_values(scene, rey_param_find(scene, row->name)), row->found, (size_t)row->count * sizeof(float));
    rey_scene_destroy(scene);
    rey_fit_result_free(&whole);
}

// What is held out is not fitted: with only the others' pictures the same bits come out, whatever its target shows.
static void test_held_out_does_not_count(void **state) {
    Fixture *f = *state;
    FitResult a, b;
    assert_int_equal(run_fit(f, "d", false, -1, "iterations=30", &a), REY_OK);
    const char *sets[] = {"views.2.target=target_0.exr", "iterations=30"};
    char job[128], folder[128];
    path_of(f, "job.yaml", job);
    path_of(f, "e", folder);
    FitDef def = {.job_path = job, .overrides = sets, .override_count = 2, .output = folder};
    assert_int_equal(rey_fit(f->ctx, &def, &b), REY_OK);
    assert_memory_equal(ARRAY_AT(a.rows, FitRow, 0).found, ARRAY_AT(b.rows, FitRow, 0).found,
                        (size_t)ARRAY_AT(a.rows, FitRow, 0).count * sizeof(float));
    assert_true(fabs(ARRAY_AT(a.held_out, FitHeldOut, 0).psnr - ARRAY_AT(b.held_out, FitHeldOut, 0).psnr) > 0.1);
    rey_fit_result_free(&a);
    rey_fit_result_free(&b);
}

// A silhouette of the left half of the picture, one row at the bottom excepted: (x, y from the top).
static bool is_inside(int x, int y) { return x < SIZE / 2 && y < SIZE - 1; }

static int write_silhouette(const Fixture *f) {
    char path[128];
    float rgb[SIZE * SIZE * 3];
    for (int i = 0; i < SIZE * SIZE; i++) { // from the bottom up
        rgb[3 * i] = rgb[3 * i + 1] = rgb[3 * i + 2] = (float)is_inside(i % SIZE, SIZE - 1 - i / SIZE);
    }
    path_of(f, "half.pfm", path);
    FILE *file = fopen(path, "wb");
    if (!file || fprintf(file, "PF\n%d %d\n-1.0\n", SIZE, SIZE) < 0 || fwrite(rgb, sizeof rgb, 1, file) != 1) {
        return -1;
    }
    return fclose(file);
}

// Voxels of which the silhouette's view sees nothing inside of it stay empty, also those of the finer level, and no others are:
// where a dense voxel by itself changes that view's picture says which.
static void test_carving(void **state) {
    Fixture *f = *state;
    const char *sets[] = {"views.0.silhouette=half.pfm", "parameters.0.carve=true", "iterations=22", "report_spp=0"};
    char job[128], folder[128], path[128];
    float picture[SIZE * SIZE * 3], empty[SIZE * SIZE * 3], values[FINE * FINE * FINE] = {0};
    FitResult result;
    path_of(f, "job.yaml", job);
    path_of(f, "g", folder);
    FitDef def = {.job_path = job, .overrides = sets, .override_count = 4, .output = folder};
    assert_int_equal(write_silhouette(f), 0);
    path_of(f, "half.png", path); // what an alpha cuts out is no silhouette
    assert_int_equal(rey_png_write_alpha(f->ctx, path, (float[SIZE * SIZE * 4]){1, 1, 1, 1}, SIZE, SIZE), REY_OK);
    sets[0] = "views.0.silhouette=half.png";
    assert_int_equal(rey_fit(f->ctx, &def, &result), REY_ERROR_ARGUMENT);
    assert_non_null(strstr(rey_error(f->ctx), "half.png has an alpha below 1"));
    rey_fit_result_free(&result);
    sets[0] = "views.0.silhouette=half.pfm";
    if (rey_fit(f->ctx, &def, &result)) {
        fail_msg("%s", rey_error(f->ctx));
    }
    const FitRow *row = &ARRAY_AT(result.rows, FitRow, 0);
    rey_scene *scene = NULL;
    assert_int_equal(rey_scene_load(f->ctx, result.scene, NULL, 0, &scene), REY_OK);
    int param = rey_param_find(scene, row->name), kept = 0;
    rey_render_def of = rey_default_render_def();
    of.spp = 16;
    assert_int_equal(rey_param_set(scene, param, values, row->count), REY_OK);
    assert_int_equal(rey_render(scene, &of, empty, NULL), REY_OK);
    for (int64_t i = 0; i < row->count; i++) {
        bool carved = row->found[i] < 1e-5f, inside = false;
        values[i] = 1e4f;
        assert_int_equal(rey_param_set(scene, param, values, row->count), REY_OK);
        assert_int_equal(rey_render(scene, &of, picture, NULL), REY_OK);
        values[i] = 0;
        for (int k = 0; k < SIZE * SIZE; k++) {
            inside |= is_inside(k % SIZE, k / SIZE) && fabsf(picture[3 * k] - empty[3 * k]) > 1e-4f;
        }
        assert_false(carved && inside);
        kept += !carved && !inside;
    }
    // Rectangles of pixels around voxels keep some more.
    assert_in_range(row->carved, FINE * FINE, FINE * FINE * FINE / 2);
    assert_in_range(kept, 0, FINE);
    rey_scene_destroy(scene);
    rey_fit_result_free(&result);
}

// The scene with grids of what scatters and what absorbs.
static void write_pair(const Fixture *f) {
    static const char *const grid =
        "<volume name=\"%s\" type=\"gridvolume\"><string name=\"filename\" value=\"start.vol\"/><transform name=\"to_world\">"
        "<scale value=\"2\"/><translate value=\"-1\"/></transform></volume>";
    char text[8192], path[128];
    int used = (int)(strstr(HEAD, "<volume") - HEAD);
    memcpy(text, HEAD, (size_t)used);
    used += snprintf(text + used, sizeof text - (size_t)used, grid, "sigma_s");
    used += snprintf(text + used, sizeof text - (size_t)used, grid, "sigma_a");
    used += snprintf(text + used, sizeof text - (size_t)used, "%s", strstr(HEAD, "</medium>"));
    for (int i = 0; i < VIEWS; i++) {
        used += snprintf(text + used, sizeof text - (size_t)used, SENSOR, i ? "4, 0, 0.5" : "0, -4, 0");
    }
    snprintf(text + used, sizeof text - (size_t)used, "</scene>");
    path_of(f, "pair.xml", path);
    assert_int_equal(write_text(f, "pair.xml", text), REY_OK);
}

// Two grids whose sum is an extinction grow together, or not at all.
static void test_pair(void **state) {
    Fixture *f = *state;
    const char *sets[] = {"scene=pair.xml", "iterations=25", "parameters=[{name: air.interior_medium.sigma_s.data}]"};
    char job[128], folder[128];
    FitResult result;
    write_pair(f);
    path_of(f, "job.yaml", job);
    path_of(f, "p", folder);
    FitDef def = {.job_path = job, .overrides = sets, .override_count = COUNT_OF(sets), .output = folder};
    assert_int_equal(rey_fit(f->ctx, &def, &result), REY_ERROR_PARAM);
    assert_non_null(strstr(rey_error(f->ctx), "would leave the other one of sigma_s and sigma_a behind"));
    rey_fit_result_free(&result);
    sets[2] = "parameters=[{name: air.interior_medium.sigma_*.data, parameterisation: softplus}]";
    if (rey_fit(f->ctx, &def, &result)) {
        fail_msg("%s", rey_error(f->ctx));
    }
    assert_int_equal(result.rows.count, 2);
    rey_scene *scene = NULL;
    assert_int_equal(rey_scene_load(f->ctx, result.scene, NULL, 0, &scene), REY_OK);
    for (int i = 0; i < 2; i++) {
        const FitRow *row = &ARRAY_AT(result.rows, FitRow, i);
        assert_int_equal(row->count, FINE * FINE * FINE);
        assert_memory_equal(rey_param_values(scene, rey_param_find(scene, row->name)), row->found,
                            (size_t)row->count * sizeof(float));
    }
    rey_scene_destroy(scene);
    rey_fit_result_free(&result);
}

static void test_errors(void **state) {
    Fixture *f = *state;
    static const char *const cases[][2] = {
        {"levels.1.resolution=2", "a grid of 8 numbers, expected 17 or more"},
        {"parameters.0={name: air.interior_medium.albedo.value.value}", "levels have a 'resolution', which is for grids"},
        {"parameters.0={name: air.interior_medium.albedo.value.value, regularisers: {sparsity: 1}}", "are for grids of voxels"},
        {"parameters.0.regularisers.normals=1", "normals is for 'parameterisation: laplacian'"},
        {"views=[{target: target_0.exr, held_out: true}]", "all are held out"},
        {"parameters.0.start=truth.vol", "truth.vol holds 6 x 6 x 6 x 1 numbers, expected 5 x 5 x 5 x 1 (z, y, x, channels)"},
        {"parameters.0.start=target_0.exr", "not a VOL file"},
        {"parameters.0.carve=true", "carve needs views with a 'silhouette'"},
        {"parameters=[{name: air.interior_medium.albedo.value.value, carve: true}]", "carve is for grids of voxels"},
        {"views.0.silhouette=half.pfm", "a silhouette is for parameters with 'carve: true', and the job has none"},
        {"views.0.held_out=maybe", "unknown value 'maybe'"},
        {"views_per_iteration=3", "the job has 2 views that are not held out"},
        {"parameters.1.name=views.2.exposure", "view 2 is held out"},
    };
    for (int i = 0; i < COUNT_OF(cases); i++) {
        FitResult result;
        rey_result code = run_fit(f, "f", false, 1, cases[i][0], &result);
        rey_fit_result_free(&result);
        if (!code || code == REY_ERROR_CANCELLED || !strstr(rey_error(f->ctx), cases[i][1])) {
            fail_msg("%s: expected '%s' in '%s'", cases[i][0], cases[i][1], rey_error(f->ctx));
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_regularisers),
        cmocka_unit_test(test_variation_is_of_the_field),
        cmocka_unit_test(test_resampling),
        cmocka_unit_test(test_fit_grows),
        cmocka_unit_test(test_held_out_does_not_count),
        cmocka_unit_test(test_carving),
        cmocka_unit_test(test_pair),
        cmocka_unit_test(test_errors),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
