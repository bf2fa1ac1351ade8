// check.c: `reynolds check`: derivatives against correlated finite differences.
//
// For each direction the forward derivative image and the pictures at displaced parameters are rendered with the same
// sample sets. Differences are central with Richardson's extrapolation over h and h/2, (4 D(h/2) - D(h)) / 3, error
// O(h^4); where a bound leaves no room on one side, the one-sided four-point formula of error O(h^3).
#include "cli.h"

#include "base/context.h"
#include "check_stats.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum { POINTS = 4 };

typedef struct Step {
    double h;
    double offsets[POINTS], weights[POINTS]; // difference = sum of weights * picture(theta + offset * direction)
} Step;

typedef struct Check { // one direction
    const char *spec;
    Direction direction;
    Step step;
    CheckResult result;
    double reverse_error; // |reverse - forward| over the mean of |derivative|
    bool passed;
} Check;

typedef struct Work {
    Session session;
    Blocks blocks;
    size_t stride;                   // block means of one set
    double *derivative, *difference; // CHECK_SETS rows of block means
    float *image, *adjoint;
    float *original, *moved; // values of the direction's parameters
    rey_stats stats;
} Work;

// Steps that the bounds of the parameters allow along the direction, forwards (sign 1) or backwards (-1).
static double room(const Work *w, const Direction *d, double sign) {
    double most = INFINITY;
    for (int k = 0; k < d->count; k++) {
        rey_param_info info;
        if (rey_param_get_info(w->session.scene, d->params[k], &info)) {
            continue;
        }
        for (int64_t i = d->offsets[k]; i < d->offsets[k + 1]; i++) {
            double t = sign * (double)d->tangent[i], v = (double)w->original[i];
            if (t > 0) {
                most = fmin(most, ((double)info.high - v) / t);
            } else if (t < 0) {
                most = fmin(most, ((double)info.low - v) / t);
            }
        }
    }
    return fmax(most, 0);
}

// A step that moves the entries by about 10 % of their size (root mean square; at least 0.05, so that black moves too).
// Samples jump where a moved lobe meets an edge, a noise in the differences of variance ~ 1/h that asks for a long
// step; the error of the extrapolated difference, h^4 f^(5) / 480, is still below 1e-4 of f' for f ~ theta^-2.
static double natural_step(const Work *w, const Direction *d) {
    double squares = 0, largest = 0;
    int64_t moved = 0;
    for (int64_t i = 0; i < d->offsets[d->count]; i++) {
        if (d->tangent[i] != 0) {
            squares += (double)w->original[i] * (double)w->original[i];
            largest = fmax(largest, fabs((double)d->tangent[i]));
            moved++;
        }
    }
    double scale = moved ? fmax(sqrt(squares / (double)moved), 0.05) : 1;
    return largest > 0 ? 0.1 * scale / largest : 0;
}

static Step choose_step(const Work *w, const Direction *d) {
    double h = natural_step(w, d);
    double forward = 0.999 * room(w, d, 1), backward = 0.999 * room(w, d, -1);
    double central = fmin(h, fmin(forward, backward));
    if (central >= 0.1 * h) {
        h = central;
        return (Step){.h = h,
                      .offsets = {h / 2, -h / 2, h, -h},
                      .weights = {4 / (3 * h), -4 / (3 * h), -1 / (6 * h), 1 / (6 * h)}};
    }
    double sign = forward >= backward ? 1 : -1;
    h = fmin(h, fmax(forward, backward) / 3);
    double k = sign / h;
    return (Step){
        .h = h, .offsets = {0, sign * h, 2 * sign * h, 3 * sign * h}, .weights = {-11 * k / 6, 3 * k, -1.5 * k, k / 3}};
}

static rey_result set_values(Work *w, const Direction *d, const float *values) {
    for (int k = 0; k < d->count; k++) {
        int64_t start = d->offsets[k];
        rey_result result = rey_param_set(w->session.scene, d->params[k], values + start, d->offsets[k + 1] - start);
        if (result) {
            return result;
        }
    }
    return REY_OK;
}

static rey_result render_point(Work *w, const Direction *d, double offset, double weight) {
    for (int64_t i = 0; i < d->offsets[d->count]; i++) {
        w->moved[i] = (float)((double)w->original[i] + offset * (double)d->tangent[i]);
    }
    rey_result result = set_values(w, d, w->moved);
    for (uint32_t set = 0; set < CHECK_SETS && !result; set++) {
        rey_stats stats = {0};
        w->session.def.set = set;
        result = rey_render(w->session.scene, &w->session.def, w->image, &stats);
        if (!result) {
            cli_add_stats(&w->stats, &stats);
            check_add_blocks(&w->blocks, w->image, weight, w->difference + set * w->stride);
            w->session.progress.part++;
        }
    }
    return result;
}

// Reverse mode on the first set must give what forward mode gave: their relative difference.
static rey_result compare_reverse(Work *w, Check *check) {
    const Direction *d = &check->direction;
    size_t count = (size_t)w->session.width * (size_t)w->session.height * 3;
    double forward = 0, absolute = 0, reverse = 0;
    for (size_t i = 0; i < count; i++) {
        forward += (double)w->image[i] / (double)count;
        absolute += fabs((double)w->image[i]) / (double)count;
        w->adjoint[i] = (float)(1 / (double)count);
    }
    int64_t size = d->offsets[d->count];
    double *gradient = rey_alloc_array(w->session.ctx, (size_t)size, sizeof *gradient);
    if (!gradient) {
        return REY_ERROR_MEMORY;
    }
    rey_stats stats = {0};
    rey_result result =
        rey_vjp(w->session.scene, &w->session.def, cli_direction_selection(d), w->adjoint, gradient, NULL, &stats);
    for (int64_t i = 0; i < size; i++) {
        reverse += gradient[i] * (double)d->tangent[i];
    }
    rey_free(w->session.ctx, gradient);
    cli_add_stats(&w->stats, &stats);
    check->reverse_error = absolute > 0 ? fabs(reverse - forward) / absolute : fabs(reverse);
    return result;
}

static rey_result derivatives(Work *w, Check *check) {
    rey_result result = REY_OK;
    for (uint32_t set = 0; set < CHECK_SETS && !result; set++) {
        rey_stats stats = {0};
        w->session.def.set = set;
        result = rey_jvp(w->session.scene, &w->session.def, cli_direction_selection(&check->direction),
                         check->direction.tangent, w->image, NULL, &stats);
        if (!result) {
            cli_add_stats(&w->stats, &stats);
            check_add_blocks(&w->blocks, w->image, 1, w->derivative + set * w->stride);
            w->session.progress.part++;
            result = set == 0 ? compare_reverse(w, check) : REY_OK;
        }
    }
    return result;
}

static double mean_brightness(const Work *w) {
    size_t count = (size_t)w->session.width * (size_t)w->session.height * 3;
    double sum = 0;
    for (size_t i = 0; i < count; i++) {
        sum += fabs((double)w->image[i]) / (double)count;
    }
    return sum;
}

static rey_result check_direction(Work *w, Check *check) {
    const Direction *d = &check->direction;
    for (int k = 0; k < d->count; k++) {
        const float *values = rey_param_values(w->session.scene, d->params[k]);
        memcpy(w->original + d->offsets[k], values, (size_t)(d->offsets[k + 1] - d->offsets[k]) * sizeof(float));
    }
    memset(w->derivative, 0, CHECK_SETS * w->stride * sizeof *w->derivative);
    memset(w->difference, 0, CHECK_SETS * w->stride * sizeof *w->difference);
    check->step = choose_step(w, d);
    if (!(check->step.h > 0)) {
        return rey_fail(w->session.ctx, REY_ERROR_PARAM, "%s: the bounds leave no room to move along this direction",
                        check->spec);
    }
    rey_result result = derivatives(w, check);
    for (int i = 0; i < POINTS && !result; i++) {
        result = render_point(w, d, check->step.offsets[i], check->step.weights[i]);
    }
    double rounding = 3e-7 * mean_brightness(w) / check->step.h; // of float pictures, times the sum of |weights|
    rey_result restored = set_values(w, d, w->original);
    check->result = check_compare(&w->blocks, w->derivative, w->difference, rounding);
    return result ? result : restored;
}

static void work_free(Work *w) {
    rey_context *ctx = w->session.ctx;
    void *arrays[] = {w->derivative, w->difference, w->image, w->adjoint, w->original, w->moved};
    for (int i = 0; i < COUNT_OF(arrays); i++) {
        rey_free(ctx, arrays[i]);
    }
}

static rey_result work_prepare(Work *w, int64_t largest) {
    Session *s = &w->session;
    size_t floats = (size_t)s->width * (size_t)s->height * 3;
    w->blocks = check_blocks(s->width, s->height);
    w->stride = (size_t)w->blocks.nx * (size_t)w->blocks.ny * CHECK_SERIES;
    w->derivative = rey_alloc_array(s->ctx, w->stride, CHECK_SETS * sizeof *w->derivative);
    w->difference = rey_alloc_array(s->ctx, w->stride, CHECK_SETS * sizeof *w->difference);
    w->image = rey_alloc_array(s->ctx, floats, sizeof *w->image);
    w->adjoint = rey_alloc_array(s->ctx, floats, sizeof *w->adjoint);
    w->original = rey_alloc_array(s->ctx, (size_t)largest, sizeof *w->original);
    w->moved = rey_alloc_array(s->ctx, (size_t)largest, sizeof *w->moved);
    bool good = w->derivative && w->difference && w->image && w->adjoint && w->original && w->moved;
    return good ? REY_OK : REY_ERROR_MEMORY;
}

static int build_directions(Work *w, Check *checks, int count) {
    for (int i = 0; i < count; i++) {
        checks[i].spec = w->session.options->params[i];
        int status = cli_session_direction(&w->session, &checks[i].spec, 1, &checks[i].direction);
        if (status) {
            return status;
        }
    }
    return EXIT_OK;
}

static rey_result check_all(Work *w, Check *checks, int count) {
    Session *s = &w->session;
    int64_t largest = 0;
    for (int i = 0; i < count; i++) {
        int64_t size = checks[i].direction.offsets[checks[i].direction.count];
        largest = size > largest ? size : largest;
    }
    rey_scene_info info;
    rey_scene_get_info(s->scene, &info);
    int spp = s->options->spp ? s->options->spp : info.sample_count;
    s->def.spp = spp > CHECK_SETS ? spp / CHECK_SETS : 1;
    s->def.sets = 1;
    s->progress.parts = (double)count * CHECK_SETS * (1 + POINTS);
    rey_result result = work_prepare(w, largest);
    for (int i = 0; i < count && !result; i++) {
        result = check_direction(w, &checks[i]);
    }
    cli_progress_end(&s->progress);
    return result;
}

// Forward and reverse mode sum the same samples in float in another order.
static const double reverse_tolerance = 1e-4;

static bool judge(Check *checks, int count, double *threshold) {
    int tests = 0;
    bool passed = true;
    for (int i = 0; i < count; i++) {
        tests += checks[i].result.tests;
    }
    *threshold = check_z_threshold(tests);
    for (int i = 0; i < count; i++) {
        const CheckResult *r = &checks[i].result;
        checks[i].passed =
            fabs(r->worst_z) <= *threshold && fabs(r->sum_z) < 3 && checks[i].reverse_error <= reverse_tolerance;
        passed = passed && checks[i].passed;
    }
    return passed;
}

static void print_table(const Check *checks, int count, double threshold, bool passed) {
    printf("%-36s %13s %13s %9s %8s %7s %6s %9s  %s\n", "direction", "derivative", "difference", "error/rms", "worst z",
           "block", "sum z", "reverse", "verdict");
    for (int i = 0; i < count; i++) {
        const CheckResult *r = &checks[i].result;
        char block[32];
        snprintf(block, sizeof block, "%d,%d %c", r->worst_x, r->worst_y, "RGB"[r->worst_channel]);
        printf("%-36s %13.6g %13.6g %8.2f%% %8.2f %7s %6.2f %9.1e  %s\n", checks[i].spec, r->derivative, r->difference,
               100 * r->relative_error, r->worst_z, block, r->sum_z, checks[i].reverse_error,
               !checks[i].passed ? "WRONG"
               : r->tests        ? "ok"
                                 : "no effect");
    }
    printf("%s: |z| of every block and channel up to %.2f, |sum z| / sqrt(n) below 3, reverse = forward to %g\n",
           passed ? "passed" : "FAILED", threshold, reverse_tolerance);
}

static void print_json(const Work *w, const Check *checks, int count, double threshold, bool passed) {
    Json json = json_begin(stdout);
    json_object(&json, NULL);
    json_bool(&json, "passed", passed);
    json_number(&json, "z_threshold", threshold);
    cli_json_stats(&json, &w->session, &w->stats);
    json_array(&json, "directions");
    for (int i = 0; i < count; i++) {
        const CheckResult *r = &checks[i].result;
        json_object(&json, NULL);
        json_string(&json, "param", checks[i].spec);
        json_bool(&json, "passed", checks[i].passed);
        json_number(&json, "derivative", r->derivative);
        json_number(&json, "difference", r->difference);
        json_number(&json, "standard_error", r->standard_error);
        json_number(&json, "relative_error", r->relative_error);
        json_number(&json, "worst_z", r->worst_z);
        json_array(&json, "worst_block");
        json_integer(&json, NULL, r->worst_x);
        json_integer(&json, NULL, r->worst_y);
        json_integer(&json, NULL, r->worst_channel);
        json_array_end(&json);
        json_number(&json, "sum_z", r->sum_z);
        json_integer(&json, "tests", r->tests);
        json_number(&json, "step", checks[i].step.h);
        json_number(&json, "reverse_error", checks[i].reverse_error);
        json_object_end(&json);
    }
    json_array_end(&json);
    json_object_end(&json);
    json_end(&json);
}

static int run_checks(const Options *options, Work *w) {
    int count = options->param_count;
    Check *checks = rey_alloc_array(w->session.ctx, (size_t)count, sizeof *checks);
    int status = checks ? build_directions(w, checks, count) : EXIT_OK;
    rey_result result = !checks ? REY_ERROR_MEMORY : status ? REY_OK : check_all(w, checks, count);
    if (result) {
        status = cli_report_failure(options, w->session.ctx, result);
    } else if (!status) {
        double threshold;
        bool passed = judge(checks, count, &threshold);
        if (options->json) {
            print_json(w, checks, count, threshold, passed);
        } else {
            print_table(checks, count, threshold, passed);
        }
        status = cli_finish_output();
        status = status ? status : passed ? EXIT_OK : EXIT_FAILED;
    }
    for (int i = 0; i < count && checks; i++) {
        cli_direction_free(w->session.ctx, &checks[i].direction);
    }
    rey_free(w->session.ctx, checks);
    return status;
}

int cli_check(int argc, char **argv) {
    Options options;
    Work work = {0};
    int status;
    if (!cli_options_parse(COMMAND_CHECK, argc, argv, &options, &status)) {
        return status;
    }
    status = cli_session_open(&options, "check", &work.session);
    if (!status) {
        status = run_checks(&options, &work);
        work_free(&work);
        cli_session_close(&work.session);
    }
    cli_options_free(&options);
    return status;
}
