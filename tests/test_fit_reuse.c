// test_fit_reuse.c: paths that serve several values of the parameters: what they estimate there has the mean of fresh ones, the
// gradient is that of the very estimate, and fits that reuse them keep the range of weights and resume with the same bits.
#include "base/parallel.h"
#include "fit_folder.h"
#include "io/vol.h"
#include "render/replay.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { SIZE = 8, NUMBERS = SIZE * SIZE * 3, CELLS = 4 };

static const char *const SCENE =
    "<scene version=\"3.0.0\"><default name=\"sigma_t\" value=\"0.4, 0.5, 0.7\"/><default name=\"albedo\" value=\"0.7\"/><default "
    "name=\"g\" value=\"0.2\"/><default name=\"integrator\" value=\"volpath\"/><integrator type=\"$integrator\"><integer "
    "name=\"max_depth\" value=\"8\"/></integrator>"
    "<medium type=\"homogeneous\" id=\"fog\"><rgb name=\"sigma_t\" value=\"$sigma_t\"/><rgb name=\"albedo\" "
    "value=\"$albedo\"/><float name=\"scale\" value=\"2\"/><phase type=\"hg\"><float name=\"g\" value=\"$g\"/></phase></medium>"
    "<shape type=\"cube\" id=\"box\"><transform name=\"to_world\"><translate x=\"-1.2\"/></transform><bsdf type=\"null\"/><ref "
    "name=\"interior\" id=\"fog\"/></shape>"
    "<shape type=\"cube\" id=\"air\"><transform name=\"to_world\"><translate x=\"1.2\"/></transform><bsdf type=\"null\"/><medium "
    "name=\"interior\" type=\"heterogeneous\"><volume name=\"sigma_t\" type=\"gridvolume\"><string name=\"filename\" "
    "value=\"air.vol\"/><transform name=\"to_world\"><scale value=\"2\"/><translate x=\"0.2\" y=\"-1\" "
    "z=\"-1\"/></transform></volume>"
    "<rgb name=\"albedo\" value=\"0.8\"/></medium></shape>"
    "<bsdf type=\"diffuse\" id=\"floor\"><rgb name=\"reflectance\" value=\"0.5\"/></bsdf><shape type=\"rectangle\"><transform "
    "name=\"to_world\"><scale value=\"4\"/><rotate x=\"1\" angle=\"-90\"/><translate y=\"-1.1\"/></transform><ref id=\"floor\"/>"
    "</shape><emitter type=\"directional\"><vector name=\"direction\" value=\"1, -0.6, -0.2\"/><rgb name=\"irradiance\" "
    "value=\"5\"/></emitter><emitter type=\"constant\"><rgb name=\"radiance\" value=\"0.3\"/></emitter>"
    "<sensor type=\"perspective\"><float name=\"fov\" value=\"60\"/><transform name=\"to_world\"><lookat origin=\"0, 0.5, 5\" "
    "target=\"0, 0, 0\" up=\"0, 1, 0\"/></transform><film type=\"hdrfilm\"><integer name=\"width\" value=\"8\"/><integer "
    "name=\"height\" value=\"8\"/><rfilter type=\"box\"/></film></sensor></scene>";
// What estimates are of has a ball more, written with what scatters and what absorbs, and a crate that glows, of voxels
// that are all alike.
static const char *const BALL =
    "<scene version=\"3.0.0\"><medium type=\"homogeneous\" id=\"mist\"><rgb name=\"sigma_s\" value=\"2, 1, 1.5\"/><float "
    "name=\"sigma_a\" value=\"0.6\"/></medium><shape type=\"sphere\"><point name=\"center\" value=\"0, 1.5, 0.5\"/><float "
    "name=\"radius\" value=\"0.6\"/><bsdf type=\"null\"/><ref name=\"interior\" id=\"mist\"/></shape>"
    "<medium type=\"heterogeneous\" id=\"glow\"><volume name=\"sigma_t\" type=\"gridvolume\"><string name=\"filename\" "
    "value=\"glow.vol\"/><string name=\"filter_type\" value=\"nearest\"/><transform name=\"to_world\"><scale "
    "value=\"1.5\"/><translate x=\"-0.7\" y=\"-0.9\" z=\"1.5\"/></transform></volume><rgb name=\"albedo\" "
    "value=\"0.6\"/><float name=\"scale\" value=\"2\"/><rgb name=\"emission\" value=\"0.5, 0.3, 0.2\"/></medium><shape "
    "type=\"cube\"><transform name=\"to_world\"><scale value=\"0.75\"/><translate x=\"0.05\" y=\"-0.15\" z=\"2.25\"/>"
    "</transform><bsdf type=\"null\"/><ref name=\"interior\" id=\"glow\"/></shape>"
    "<include filename=\"scene.xml\"/></scene>";
static const char *const TRUTH =
    "<scene version=\"3.0.0\"><default name=\"sigma_t\" value=\"0.55, 0.6, 0.75\"/><default name=\"albedo\" "
    "value=\"0.85\"/><default name=\"g\" value=\"0.5\"/><include filename=\"scene.xml\"/></scene>";
static const char *const JOB =
    "scene: scene.xml\nseed: 3\niterations: 24\nspp: 32\nviews:\n  - {target: target_0.exr}\nloss: l2\n"
    "optimizer: {type: adam, learning_rate: 0.04, beta2: 0.95}\nreuse: {within: 1.3}\n"
    "parameters:\n  - {name: fog, parameterisation: scattering}\n  - {name: floor.reflectance.value, parameterisation: logit}\n"
    "image_every: 0\nreport_spp: 0\ntruth: {scene: truth.xml}\n";

// The unknowns, and what they are where paths are not recorded, in shares.
static const struct {
    const char *name;
    double factor;
} UNKNOWNS[] = {{"fog.sigma_t.value.value", 1.2},
                {"fog.albedo.value.value", 1.15},
                {"fog.phase_function.g.value", 1.6},
                {"floor.reflectance.value", 0.8},
                {"mist.sigma_s.value", 1.2},
                {"mist.sigma_a.value", 0.75},
                {"air.interior_medium.sigma_t.data", 0.75},
                {"glow.sigma_t.data", 0.8}};
enum { UNKNOWN_COUNT = COUNT_OF(UNKNOWNS), HOMOGENEOUS = 6, MOST_VALUES = 128 };

static int set_up(void **state) {
    Fixture *f = *state = fixture_make();
    float values[CELLS * CELLS * CELLS];
    char path[128];
    rey_vol vol = {CELLS, CELLS, CELLS, 1, {0, 0, 0, 1, 1, 1}, values};
    for (int i = 0; i < COUNT_OF(values); i++) {
        values[i] = 0.6f + 0.3f * (float)sin(i * 1.7);
    }
    if (!f) {
        return 1;
    }
    path_of(f, "air.vol", path);
    if (rey_vol_write(f->ctx, path, &vol)) {
        return 1;
    }
    for (int i = 0; i < COUNT_OF(values); i++) {
        values[i] = 0.8f;
    }
    path_of(f, "glow.vol", path);
    return rey_vol_write(f->ctx, path, &vol) || write_text(f, "scene.xml", SCENE) || write_text(f, "ball.xml", BALL) ||
           write_text(f, "truth.xml", TRUTH) || write_text(f, "job.yaml", JOB) || write_targets_of_truth(f, 1, SIZE, 4096);
}

/* ---- estimates ----------------------------------------------------------------------------------------- */

// Two copies of a scene, of which the second has other values.
typedef struct Pair {
    rey_context *ctx;
    rey_scene *recorded, *moved;
    int params[UNKNOWN_COUNT];
    float adjoint[NUMBERS];
} Pair;

static void pair_set(Pair *p, int unknown, double factor) {
    rey_param_info info;
    float values[MOST_VALUES];
    assert_int_equal(rey_param_get_info(p->recorded, p->params[unknown], &info), REY_OK);
    assert_true(info.count <= MOST_VALUES);
    const float *from = rey_param_values(p->recorded, p->params[unknown]);
    for (int64_t i = 0; i < info.count; i++) {
        values[i] = (float)((double)from[i] * factor);
    }
    assert_int_equal(rey_param_set(p->moved, p->params[unknown], values, info.count), REY_OK);
}

static Pair pair_open(const Fixture *f, int lanes, int threads, const char *integrator) {
    Pair p = {0};
    char path[128];
    rey_context_def def = rey_default_context_def();
    const rey_define define = {"integrator", integrator};
    def.lanes = lanes;
    def.threads = threads;
    path_of(f, "ball.xml", path);
    assert_int_equal(rey_context_create(&def, &p.ctx), REY_OK);
    assert_int_equal(rey_scene_load(p.ctx, path, &define, 1, &p.recorded), REY_OK);
    assert_int_equal(rey_scene_load(p.ctx, path, &define, 1, &p.moved), REY_OK);
    rey_replay_make_room(p.recorded, 2);
    for (int i = 0; i < UNKNOWN_COUNT; i++) {
        p.params[i] = rey_param_find(p.recorded, UNKNOWNS[i].name);
        assert_true(p.params[i] >= 0 && rey_can_replay(p.recorded, p.params[i]));
        pair_set(&p, i, UNKNOWNS[i].factor);
    }
    for (int i = 0; i < NUMBERS; i++) {
        p.adjoint[i] = (float)(1 + 0.8 * sin(i * 0.7)) / NUMBERS;
    }
    return p;
}

static void pair_close(Pair *p) {
    rey_scene_destroy(p->recorded);
    rey_scene_destroy(p->moved);
    rey_context_destroy(p->ctx);
}

static rey_render_def def_of(uint32_t set, int spp) {
    rey_render_def def = rey_default_render_def();
    def.spp = spp;
    def.set = set;
    def.sets = 1;
    def.seed = 5;
    def.estimator = REY_ESTIMATOR_SCORE;
    return def;
}

// What a set of samples estimates: the picture times the adjoint, and that value's derivative, summed over the entries of each
// unknown.
enum { ESTIMATES = 1 + UNKNOWN_COUNT };

static double product(const Pair *p, const float *image) {
    double sum = 0;
    for (int i = 0; i < NUMBERS; i++) {
        sum += (double)(p->adjoint[i] * image[i]);
    }
    return sum;
}

static double replayed(Pair *p, uint32_t set, int spp) {
    float image[NUMBERS];
    rey_render_def def = def_of(set, spp);
    assert_int_equal(rey_replay(p->recorded, p->moved, &def, image, NULL), REY_OK);
    return product(p, image);
}

static void sum_gradient(const Pair *p, const double *gradient, double *out) {
    for (int k = 0; k < UNKNOWN_COUNT; k++) {
        rey_param_info info;
        rey_param_get_info(p->recorded, p->params[k], &info);
        out[k] = 0;
        for (int64_t i = 0; i < info.count; i++) {
            out[k] += *gradient++;
        }
    }
}

static void estimate(Pair *p, bool reused, uint32_t set, int spp, double out[ESTIMATES]) {
    float image[NUMBERS];
    double gradient[UNKNOWN_COUNT * MOST_VALUES];
    rey_render_def def = def_of(set, spp);
    rey_selection all = {p->params, UNKNOWN_COUNT};
    if (reused) {
        out[0] = replayed(p, set, spp);
        assert_int_equal(rey_replay_vjp(p->recorded, p->moved, &def, all, p->adjoint, gradient, NULL), REY_OK);
    } else {
        def.estimator = REY_ESTIMATOR_PROBE;
        assert_int_equal(rey_render(p->moved, &def, image, NULL), REY_OK);
        assert_int_equal(rey_vjp(p->moved, &def, all, p->adjoint, gradient, NULL, NULL), REY_OK);
        out[0] = product(p, image);
    }
    sum_gradient(p, gradient, out + 1);
}

typedef struct Mean {
    double sum[ESTIMATES], square[ESTIMATES];
    int count;
} Mean;

static void mean_add(Mean *m, const double x[ESTIMATES]) {
    m->count++;
    for (int i = 0; i < ESTIMATES; i++) {
        m->sum[i] += x[i];
        m->square[i] += x[i] * x[i];
    }
}

static double mean_of(const Mean *m, int i, double *variance) {
    double mean = m->sum[i] / m->count;
    *variance = (m->square[i] / m->count - mean * mean) / (m->count - 1);
    return mean;
}

// Means over recordings: of the picture and of every gradient, along paths that were recorded elsewhere, and along fresh ones.
static void expect_unbiased(const Fixture *f, const char *integrator, int lanes, float headroom) {
    enum { RECORDINGS = 48, SPP = 256 };
    Pair p = pair_open(f, lanes, 2, integrator);
    rey_replay_make_room(p.recorded, headroom);
    Mean reused = {0}, fresh = {0}, unmoved = {0};
    for (uint32_t set = 0; set < RECORDINGS; set++) {
        double x[ESTIMATES];
        estimate(&p, true, set, SPP, x);
        mean_add(&reused, x);
        estimate(&p, false, 1000 + set, SPP, x);
        mean_add(&fresh, x);
    }
    rey_scene *moved = p.moved;
    p.moved = p.recorded;
    for (uint32_t set = 0; set < RECORDINGS; set++) {
        double x[ESTIMATES];
        estimate(&p, false, 2000 + set, SPP, x);
        mean_add(&unmoved, x);
    }
    p.moved = moved;
    double furthest = 0;
    for (int i = 0; i < ESTIMATES; i++) {
        double v, w, u, a = mean_of(&reused, i, &v), b = mean_of(&fresh, i, &w), c = mean_of(&unmoved, i, &u);
        const char *what = i ? UNKNOWNS[i - 1].name : "picture";
        bool vacuum = !strcmp(integrator, "path") && i && strcmp(what, "floor.reflectance.value");
        if (!(fabs(a - b) <= 4.5 * sqrt(v + w)) || (!vacuum && !(fabs(b) > 4 * sqrt(w)))) {
            fail_msg("%s, %s: reused %g +- %g, fresh %g +- %g", integrator, what, a, sqrt(v), b, sqrt(w));
        }
        furthest = fmax(furthest, fabs(b - c) / sqrt(u + w));
    }
    assert_true(furthest > 20); // the two points are not alike
    pair_close(&p);
}

static void test_unbiased(void **state) { expect_unbiased(*state, "volpath", 0, 2); }

// As `check` does. With bounds that are the extinctions themselves, all tentative collisions would be real.
static void test_unbiased_with_little_room(void **state) { expect_unbiased(*state, "volpath", 0, 1.1f); }

static void test_unbiased_without_media(void **state) { expect_unbiased(*state, "path", rey_widest_lanes() < 8 ? 1 : 8, 2); }

// Of what is homogeneous, the gradient is the derivative of the estimate with the same samples, not only in the mean.
static void test_gradient_is_of_the_estimate(void **state) {
    const double step = 1.6e-2; // of smaller ones the rounding of pictures is a part
    const int lanes[] = {1, 8, 16};
    for (int w = 0; w < COUNT_OF(lanes) && lanes[w] <= rey_widest_lanes(); w++) {
        Pair p = pair_open(*state, lanes[w], 2, "volpath");
        double x[ESTIMATES], gradient[UNKNOWN_COUNT * MOST_VALUES];
        rey_render_def def = def_of(7, 32);
        rey_selection all = {p.params, UNKNOWN_COUNT};
        assert_int_equal(rey_replay_vjp(p.recorded, p.moved, &def, all, p.adjoint, gradient, NULL), REY_OK);
        const double *g = gradient;
        for (int k = 0; k < HOMOGENEOUS; k++) {
            rey_param_info info;
            rey_param_get_info(p.recorded, p.params[k], &info);
            const float *from = rey_param_values(p.recorded, p.params[k]);
            double along = 0; // the derivative with respect to the factor
            for (int64_t i = 0; i < info.count; i++) {
                along += *g++ * (double)from[i];
            }
            pair_set(&p, k, UNKNOWNS[k].factor + step);
            x[0] = replayed(&p, 7, 32);
            pair_set(&p, k, UNKNOWNS[k].factor - step);
            x[1] = replayed(&p, 7, 32);
            pair_set(&p, k, UNKNOWNS[k].factor);
            double difference = (x[0] - x[1]) / (2 * step);
            if (!(fabs(difference - along) <= 2e-3 * fabs(difference)) || !(fabs(difference) > 1e-4)) {
                fail_msg("lanes %d, %s: difference %.8g, gradient %.8g", lanes[w], UNKNOWNS[k].name, difference, along);
            }
        }
        pair_close(&p);
    }
}

// The same for every width, but for rounding, and the same bits for any number of threads; weights, too.
static void test_widths_and_threads(void **state) {
    double first[ESTIMATES], other[ESTIMATES];
    ReplayWeights weights[4] = {{0}};
    const int widest = rey_widest_lanes(), lanes[] = {1, widest < 8 ? 1 : 8, widest, widest}, threads[] = {1, 1, 1, 3};
    for (int w = 0; w < COUNT_OF(lanes); w++) {
        Pair p = pair_open(*state, lanes[w], threads[w], "volpath");
        float image[NUMBERS];
        rey_render_def def = def_of(3, 16);
        assert_int_equal(rey_replay_weighed(p.recorded, p.moved, &def, 1.5, image, &weights[w], NULL), REY_OK);
        estimate(&p, true, 3, 16, other);
        for (int i = 0; i < ESTIMATES && w > 0; i++) {
            assert_true(fabs(other[i] - first[i]) <= (w == 3 ? 0 : 2e-3) * fabs(first[i]));
        }
        memcpy(first, other, sizeof first);
        pair_close(&p);
    }
    assert_memory_equal(&weights[2], &weights[3], sizeof weights[2]);
    assert_float_equal(weights[0].now / weights[2].now, 1, 2e-3);
    assert_float_equal(weights[0].square / weights[2].square, 1, 2e-3);
    double effective = weights[0].now * weights[0].now / (weights[0].then * weights[0].square);
    double within = weights[0].within / weights[0].all;
    assert_true(effective > 0.3 && effective < 0.98 && within > 0.3 && within < 0.98);
}

// Where they were recorded, all paths weigh 1.
static void test_weights_at_home(void **state) {
    Pair p = pair_open(*state, 0, 2, "volpath");
    for (int i = 0; i < UNKNOWN_COUNT; i++) {
        pair_set(&p, i, 1);
    }
    float image[NUMBERS];
    ReplayWeights w = {0};
    rey_render_def def = def_of(3, 16);
    assert_int_equal(rey_replay_weighed(p.recorded, p.moved, &def, 1.001, image, &w, NULL), REY_OK);
    assert_float_equal(w.within / w.all, 1, 1e-12);
    assert_float_equal(w.now * w.now / (w.then * w.square), 1, 1e-6);
    pair_close(&p);
}

/* ---- fits ---------------------------------------------------------------------------------------------- */

static bool stop_at(void *user, const FitProgress *progress) { return progress->iteration != *(const int *)user; }

// extra: further fields of the job, up to a null.
static rey_result run_fit_with(Fixture *f, const char *out, bool resume, int stop, const char *const *extra, FitResult *result) {
    char folder[128], job[128];
    path_of(f, out, folder);
    path_of(f, "job.yaml", job);
    FitDef def = {.job_path = job, .overrides = extra, .output = folder, .resume = resume, .overwrite = !resume,
                  .progress = stop_at, .user = &stop};
    while (extra[def.override_count]) {
        def.override_count++;
    }
    return rey_fit(f->ctx, &def, result);
}

static rey_result run_fit(Fixture *f, const char *out, bool resume, int stop, const char *extra, FitResult *result) {
    const char *const one[] = {extra, NULL};
    return run_fit_with(f, out, resume, stop, one, result);
}

// Keys of every line of metrics.jsonl; returns how many lines there are.
enum { MOST_ROWS = 64 };
typedef struct Row {
    int recorded;
    double loss, norm, outside, effective;
} Row;

static double number_of(const char *line, const char *key) {
    const char *at = strstr(line, key);
    assert_non_null(at);
    return strtod(at + strlen(key), NULL);
}

static int read_rows(const Fixture *f, const char *out, Row rows[MOST_ROWS]) {
    char name[64], path[128], line[2048];
    int count = 0;
    snprintf(name, sizeof name, "%s/metrics.jsonl", out);
    path_of(f, name, path);
    FILE *file = fopen(path, "r");
    assert_non_null(file);
    while (count < MOST_ROWS && fgets(line, sizeof line, file)) {
        rows[count++] = (Row){(int)number_of(line, "\"recorded\":"), number_of(line, "\"loss\":"),
                              number_of(line, "\"gradient_norm\":"), number_of(line, "\"outside\":"),
                              number_of(line, "\"effective\":")};
    }
    fclose(file);
    return count;
}

// Paths serve several iterations, but none whose weights are out of range.
static void test_range_is_kept(void **state) {
    Fixture *f = *state;
    FitResult result;
    Row rows[MOST_ROWS];
    assert_int_equal(run_fit(f, "a", false, -1, NULL, &result), REY_OK);
    rey_fit_result_free(&result);
    int count = read_rows(f, "a", rows), recordings = 0;
    assert_int_equal(count, 24);
    for (int i = 0; i < count; i++) {
        recordings += rows[i].recorded == i;
        assert_true(rows[i].recorded <= i && (i == 0 || rows[i].recorded >= rows[i - 1].recorded));
        assert_true(rows[i].outside <= 0.01 && rows[i].effective >= 0.5);
    }
    assert_true(rows[0].recorded == 0 && recordings >= 2 && recordings <= count / 2);
}

// A stop in the middle of what one recording serves, and one that L-BFGS goes on from.
static void test_resumes(void **state) {
    Fixture *f = *state;
    const char *const optimizers[] = {NULL, "optimizer={type: lbfgs, learning_rate: 0.1}"};
    for (int k = 0; k < COUNT_OF(optimizers); k++) {
        FitResult whole, part, rest;
        Row rows[MOST_ROWS], again[MOST_ROWS];
        assert_int_equal(run_fit(f, "b", false, -1, optimizers[k], &whole), REY_OK);
        int count = read_rows(f, "b", rows), stop = 1;
        while (stop + 1 < count && rows[stop].recorded != rows[stop - 1].recorded) {
            stop++;
        }
        assert_true(stop + 1 < count); // iteration `stop` has the paths of the one before it
        assert_int_equal(run_fit(f, "c", false, stop, optimizers[k], &part), REY_ERROR_CANCELLED);
        assert_int_equal(run_fit(f, "c", true, -1, optimizers[k], &rest), REY_OK);
        assert_int_equal(read_rows(f, "c", again), count);
        for (int i = 0; i < count; i++) {
            assert_true(rows[i].loss == again[i].loss && rows[i].recorded == again[i].recorded);
        }
        for (size_t i = 0; i < whole.rows.count; i++) {
            const FitRow *a = &ARRAY_AT(whole.rows, FitRow, i), *b = &ARRAY_AT(rest.rows, FitRow, i);
            assert_memory_equal(a->found, b->found, (size_t)a->count * sizeof *a->found);
        }
        rey_fit_result_free(&whole);
        rey_fit_result_free(&part);
        rey_fit_result_free(&rest);
    }
}

// What L-BFGS follows is a function and its gradient, of which nothing is left in the end. (With few samples the estimate of a loss
// has no minimum: two sets of paths may differ from the picture in opposite ways.)
static void test_converges(void **state) {
    Fixture *f = *state;
    FitResult result;
    Row rows[MOST_ROWS];
    static const char *const extra[] = {"optimizer={type: lbfgs, learning_rate: 0.1}", "spp=1024", NULL};
    assert_int_equal(run_fit_with(f, "e", false, -1, extra, &result), REY_OK);
    rey_fit_result_free(&result);
    const Row *last = rows + read_rows(f, "e", rows) - 1;
    assert_true(last->loss < 0.5 * rows[0].loss);
    assert_true(last->norm < 0.01 * rows[0].norm);
}

static void test_errors(void **state) {
    Fixture *f = *state;
    static const char *const cases[][2] = {
        {"parameters=[box.to_world]", "'box.to_world' decides where paths go"},
        {"parameters=[fog.sigma_t.value.value]", "'fog.sigma_t.value.value' may become 0, where no path collides"},
        {"parameters=[{name: air.interior_medium.sigma_t.data, parameterisation: softplus}]", "may become 0"},
        {"levels=[{from: 0, reduce: 2}]", "reuse: paths are not reused between levels"},
        {"defines.integrator=ptracer", "paths of 'ptracer' are not reused"},
        {"reuse=2", "expected 'key: value' lines"},
        {"reuse={effective: 0.3}", "key 'within' is missing"},
        {"reuse.within=1", "within = 1, expected 1.001 to 1000000"},
        {"reuse.effective=1", "effective = 1, expected 0 to 0.999"},
        {"reuse.withn=2", "did you mean 'within'"},
    };
    for (int i = 0; i < COUNT_OF(cases); i++) {
        FitResult result;
        rey_result code = run_fit(f, "d", false, -1, cases[i][0], &result);
        rey_fit_result_free(&result);
        if (!code || !strstr(rey_error(f->ctx), cases[i][1])) {
            fail_msg("%s: expected '%s' in '%s'", cases[i][0], cases[i][1], rey_error(f->ctx));
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_unbiased),
        cmocka_unit_test(test_unbiased_with_little_room),
        cmocka_unit_test(test_unbiased_without_media),
        cmocka_unit_test(test_gradient_is_of_the_estimate),
        cmocka_unit_test(test_widths_and_threads),
        cmocka_unit_test(test_weights_at_home),
        cmocka_unit_test(test_range_is_kept),
        cmocka_unit_test(test_resumes),
        cmocka_unit_test(test_converges),
        cmocka_unit_test(test_errors),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
