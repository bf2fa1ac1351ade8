// check.c: `reynolds check`: derivatives against correlated finite differences.
//
// For each direction the forward derivative image and the pictures at displaced parameters are rendered with the same
// sample sets. Where nothing moves, a displaced scene is looked at along the paths that the derivative took
// (render/replay.h): choices of lobes, directions and lights stay as they are, so that no flip of a choice is in the
// difference. A density of 0 where the derivative is not would be missing from both; hence the plain quotient is formed
// with fresh paths too. What moves (terms beyond `interior`) is rendered afresh throughout.
// A step (check_step.c) that turns out to be long is halved: when the formula of the next lower order differs by more than
// noise explains. What would be called wrong is looked at twice.
#include "check.h"

#include "base/context.h"
#include "render/facing.h"
#include "render/replay.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

// Of extinctions, beyond the displacements of scenes that are replayed.
#define CHECK_ROOM 1.1f

typedef struct Work {
    Session session;
    rey_scene *displaced;            // a second copy of the scene, whose parameters are moved
    Blocks blocks;
    size_t stride;                   // block means of one set
    double *derivative, *difference, *rough; // CHECK_SETS rows of block means
    double *fresh;                           // the same of the plain quotient, fresh paths minus replayed ones
    double *rounding;                        // one row: what float pictures leave in differences
    float *image, *adjoint;
    float *original, *moved; // values of the direction's parameters
    uint32_t first_set;      // of the sample sets
    Reasons reasons;         // of what was refused so far
    bool refused_named;      // something that was asked for by name was
    rey_stats stats;
} Work;

static rey_result set_values(Work *w, const Direction *d, const float *values) {
    for (int k = 0; k < d->count; k++) {
        int64_t start = d->offsets[k];
        rey_result result = rey_param_set(w->displaced, d->params[k], values + start, d->offsets[k + 1] - start);
        if (result) {
            return result;
        }
    }
    return REY_OK;
}

// One picture of one sample set, into the rows of the formulas.
static rey_result render_set(Work *w, const Check *check, const Step *step, int point, uint32_t set) {
    rey_stats stats = {0};
    const rey_render_def *def = &w->session.def;
    size_t row = set * w->stride;
    w->session.def.set = w->first_set + set;
    rey_result result = check->replays ? rey_replay(w->session.scene, w->displaced, def, w->image, &stats)
                                       : rey_render(w->displaced, def, w->image, &stats);
    if (result) {
        return result;
    }
    cli_add_stats(&w->stats, &stats);
    check_add_blocks(&w->blocks, w->image, step->weights[point], w->difference + row);
    check_add_blocks(&w->blocks, w->image, step->rough[point], w->rough + row);
    if (!check->replays || step->plain[point] == 0) {
        return REY_OK;
    }
    check_add_blocks(&w->blocks, w->image, -step->plain[point], w->fresh + row);
    result = rey_render(w->displaced, def, w->image, &stats);
    cli_add_stats(&w->stats, &stats);
    check_add_blocks(&w->blocks, w->image, step->plain[point], w->fresh + row);
    return result;
}

static rey_result render_point(Work *w, const Check *check, const Step *step, int point) {
    const Direction *d = &check->direction;
    double offset = step->offsets[point];
    for (int64_t i = 0; i < d->offsets[d->count]; i++) {
        w->moved[i] = (float)((double)w->original[i] + offset * (double)d->tangent[i]);
    }
    rey_result result = set_values(w, d, w->moved);
    for (uint32_t set = 0; set < CHECK_SETS && !result; set++) {
        result = render_set(w, check, step, point, set);
        w->session.progress.part++;
    }
    return result;
}

// Reverse mode on the first set must give what forward mode gave: their difference, relative to what is summed up. Where
// the numbers' shares cancel (all texels of a bump together move nothing), that is the sum of their sizes: what is left is
// rounding.
static rey_result compare_reverse(Work *w, Check *check) {
    const Direction *d = &check->direction;
    size_t count = (size_t)w->session.width * (size_t)w->session.height * 3;
    double forward = 0, absolute = 0, reverse = 0, parts = 0;
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
        parts += fabs(gradient[i] * (double)d->tangent[i]);
    }
    rey_free(w->session.ctx, gradient);
    cli_add_stats(&w->stats, &stats);
    check->reverse_gap = fabs(reverse - forward);
    check->reverse_scale = fmax(absolute, parts);
    return result;
}

static rey_result derivatives(Work *w, Check *check) {
    rey_result result = REY_OK;
    for (uint32_t set = 0; set < CHECK_SETS && !result; set++) {
        rey_stats stats = {0};
        w->session.def.set = w->first_set + set;
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

// The differences of one step.
static rey_result differences(Work *w, Check *check, const Step *step) {
    memset(w->difference, 0, CHECK_SETS * w->stride * sizeof *w->difference);
    memset(w->rough, 0, CHECK_SETS * w->stride * sizeof *w->rough);
    memset(w->fresh, 0, CHECK_SETS * w->stride * sizeof *w->fresh);
    rey_result result = REY_OK;
    for (int i = 0; i < CHECK_POINTS && !result; i++) {
        result = render_point(w, check, step, i);
    }
    const double share = 3e-7 / step->h; // of float pictures, times the sum of |weights|
    const double rounding = share * mean_brightness(w);
    memset(w->rounding, 0, w->stride * sizeof *w->rounding);
    check_add_blocks(&w->blocks, w->image, share, w->rounding);
    for (size_t i = 0; i < w->stride; i++) { // bright blocks round more
        w->rounding[i] = fmax(w->rounding[i], rounding);
    }
    check->result = check_compare(&w->blocks, w->derivative, w->difference, w->rough, w->rounding);
    check->fresh_z = check->replays ? check_mean_z(&w->blocks, w->fresh, rounding) : 0;
    check->reverse_error = check_reverse_error(check, rounding);
    return result;
}

static bool agrees(const CheckResult *r) {
    return fabs(r->worst_z) <= check_z_threshold(r->tests) && fabs(r->sum_z) < CHECK_SUM_Z;
}

// A difference that crosses kinks (texels' edges, a beam's border, triangles that turn away from a light) is off in a few
// blocks whatever its order. Where an eighth of the step agrees, or an eighth of that, that was it. In noise a short step
// agrees with anything: there it must close most of the worst block's gap, too.
static rey_result try_short_steps(Work *w, Check *check, bool central) {
    CheckResult first = check->result;
    double fresh_z = check->fresh_z, h = check->step.h;
    bool stands = agrees(&first);
    if (stands || w->session.options->step > 0) {
        return REY_OK;
    }
    double gap = check_gap(&w->blocks, w->derivative, w->difference, &first);
    rey_result result = REY_OK;
    for (int i = 0; i < CHECK_SHORTENINGS && !stands && !result; i++) {
        h /= 8;
        Step step = central ? check_central_step(h) : check_one_sided_step(h, check->step.offsets[1] > 0 ? 1 : -1);
        result = differences(w, check, &step);
        check->doubtful |= agrees(&check->result);
        stands = agrees(&check->result) &&
                 (check->result.relative_error <= CHECK_WEAK ||
                  check_gap(&w->blocks, w->derivative, w->difference, &first) < 0.25 * gap);
        if (stands) {
            check->step = step;
        }
    }
    if (!stands) {
        check->result = first;
        check->fresh_z = fresh_z;
    }
    return result;
}

// Where the picture has a corner (a weight that is clamped at exactly 1), each side has a slope of its own, and the
// derivative is that of one of them.
static rey_result try_one_side(Work *w, Check *check, bool central) {
    CheckResult first = check->result;
    double fresh_z = check->fresh_z, h = check->step.h / 8;
    rey_result result = REY_OK;
    for (double sign = -1; sign <= 1 && central && !agrees(&check->result) && !result; sign += 2) {
        Step step = check_one_sided_step(h, sign);
        if (first.relative_error > CHECK_WEAK || w->session.options->step > 0) {
            return REY_OK;
        }
        result = differences(w, check, &step);
        check->kink = agrees(&check->result) && check->result.relative_error <= CHECK_WEAK;
    }
    if (!check->kink) {
        check->result = first;
        check->fresh_z = fresh_z;
    }
    return result;
}

// Puts the values back; what failed before keeps its words.
static rey_result restore(Work *w, const Direction *d, rey_result result) {
    char message[2048];
    snprintf(message, sizeof message, "%s", rey_error(w->session.ctx));
    rey_result restored = set_values(w, d, w->original);
    return result ? rey_fail(w->session.ctx, result, "%s", message) : restored;
}

// Derivative and difference of 16 sample sets, from a step on.
static rey_result attempt(Work *w, Check *check) {
    const Direction *d = &check->direction;
    memset(w->derivative, 0, CHECK_SETS * w->stride * sizeof *w->derivative);
    rey_result result = derivatives(w, check);
    bool central = check->step.offsets[0] != 0;
    check->doubtful = false;
    if (!result) {
        result = differences(w, check, &check->step);
    }
    for (int i = 0; i < CHECK_HALVINGS && !result && check->result.step_matters && !w->session.options->step; i++) {
        double h = check->step.h / 2, sign = check->step.offsets[1] > 0 ? 1 : -1;
        check->step = central ? check_central_step(h) : check_one_sided_step(h, sign);
        result = differences(w, check, &check->step);
    }
    if (!result) {
        result = try_short_steps(w, check, central);
    }
    if (!result && !agrees(&check->result)) {
        result = try_one_side(w, check, central);
    }
    return restore(w, d, result);
}

// Sixteen sets that miss rare bright samples are alike, and wrong alike: what would be called wrong is looked at again
// with other sets and four times the samples, and with sixteen times where short steps agree in what noise they have. An error
// stays.
static rey_result try_again(Work *w, Check *check) {
    const int spp = w->session.def.spp;
    rey_result result = REY_OK;
    for (int more = 4; more <= 16 && spp <= MOST_SPP / more && !result; more *= 4) {
        double reverse_error = check->reverse_error;
        if ((agrees(&check->result) && fabs(check->fresh_z) <= CHECK_FRESH_Z) || (more > 4 && !check->doubtful)) {
            break;
        }
        w->first_set += CHECK_SETS;
        w->session.def.spp = more * spp;
        result = attempt(w, check);
        check->reverse_error = fmax(check->reverse_error, reverse_error);
    }
    w->first_set = 0;
    w->session.def.spp = spp;
    return result;
}

static rey_result check_direction(Work *w, Check *check) {
    const Direction *d = &check->direction;
    for (int k = 0; k < d->count; k++) {
        const float *values = rey_param_values(w->session.scene, d->params[k]);
        memcpy(w->original + d->offsets[k], values, (size_t)(d->offsets[k + 1] - d->offsets[k]) * sizeof(float));
    }
    rey_result result = check_find_step(&w->session, w->original, check);
    if (!result) {
        result = attempt(w, check);
    }
    return result ? result : try_again(w, check);
}

// Whether a parameter is checked because it was asked for by name, not by --all or a pattern.
static bool is_named(const Options *o, const char *spec) {
    bool named = false;
    for (int i = 0; i < o->param_count; i++) {
        named = named || strcmp(o->params[i], spec) == 0;
    }
    return named;
}

// What cannot be checked is listed, and the others are checked; alone: there are none.
static rey_result check_or_refuse(Work *w, Check *check, bool alone) {
    const Options *o = w->session.options;
    rey_result result = cli_direction_check_terms(w->session.ctx, w->session.scene, &check->direction, o->terms);
    bool lacking = result != REY_OK;
    result = lacking ? result : check_direction(w, check);
    if ((is_named(o, check->spec) && alone) || (!lacking && result != REY_ERROR_INCOMPLETE && result != REY_ERROR_PARAM)) {
        return result;
    }
    w->refused_named |= is_named(o, check->spec);
    check->verdict = VERDICT_REFUSED;
    check->refusal = rey_strdup(w->session.ctx, rey_error(w->session.ctx));
    return check->refusal ? REY_OK : REY_ERROR_MEMORY;
}

static void work_free(Work *w) {
    rey_context *ctx = w->session.ctx;
    void *arrays[] = {w->derivative, w->difference, w->rough, w->fresh, w->rounding, w->image, w->adjoint, w->original, w->moved};
    for (int i = 0; i < COUNT_OF(arrays); i++) {
        rey_free(ctx, arrays[i]);
    }
    reasons_free(ctx, &w->reasons);
    rey_scene_destroy(w->displaced);
}

static rey_result work_prepare(Work *w, int64_t largest) {
    Session *s = &w->session;
    size_t floats = (size_t)s->width * (size_t)s->height * 3;
    w->blocks = check_blocks(s->width, s->height);
    w->stride = (size_t)w->blocks.nx * (size_t)w->blocks.ny * CHECK_SERIES;
    w->derivative = rey_alloc_array(s->ctx, w->stride, CHECK_SETS * sizeof *w->derivative);
    w->difference = rey_alloc_array(s->ctx, w->stride, CHECK_SETS * sizeof *w->difference);
    w->rough = rey_alloc_array(s->ctx, w->stride, CHECK_SETS * sizeof *w->rough);
    w->fresh = rey_alloc_array(s->ctx, w->stride, CHECK_SETS * sizeof *w->fresh);
    w->rounding = rey_alloc_array(s->ctx, w->stride, sizeof *w->rounding);
    w->image = rey_alloc_array(s->ctx, floats, sizeof *w->image);
    w->adjoint = rey_alloc_array(s->ctx, floats, sizeof *w->adjoint);
    w->original = rey_alloc_array(s->ctx, (size_t)largest, sizeof *w->original);
    w->moved = rey_alloc_array(s->ctx, (size_t)largest, sizeof *w->moved);
    bool good = w->derivative && w->difference && w->rough && w->fresh && w->rounding && w->image && w->adjoint &&
                w->original && w->moved;
    const Options *o = s->options;
    rey_result (*load)(rey_context *, const char *, const rey_define *, int, rey_scene **) =
        o->lenient ? rey_scene_load_lenient : rey_scene_load;
    rey_result result = good ? load(s->ctx, o->files[0], o->defines, o->define_count, &w->displaced) : REY_ERROR_MEMORY;
    return result ? result : cli_load_values(o, s->ctx, w->displaced);
}

static bool can_replay(const Work *w, const Direction *d) {
    bool can = true;
    for (int k = 0; k < d->count; k++) {
        can = can && rey_can_replay(w->session.scene, d->params[k]);
    }
    return can;
}

static bool is_partial(const Work *w, const Check *check) {
    return w->session.options->all && check->left_out;
}

// What the picture does not depend on, of all directions together.
static int note_unreached(Work *w, const Check *checks, int count) {
    Array params = {0};
    rey_result result = REY_OK;
    for (int i = 0; i < count && !result; i++) {
        const Direction *d = &checks[i].direction;
        int *slots = rey_array_push(w->session.ctx, &params, sizeof *slots, (size_t)d->count);
        result = slots ? REY_OK : REY_ERROR_MEMORY;
        for (int k = 0; k < d->count && slots; k++) {
            slots[k] = d->params[k];
        }
    }
    result = result ? result : cli_note_unreached(&w->session, params.data, (int)params.count);
    rey_array_free(w->session.ctx, &params);
    return result ? cli_report_failure(w->session.options, w->session.ctx, result) : EXIT_OK;
}

static int build_directions(Work *w, const Specs *specs, Check *checks) {
    for (int i = 0; i < specs->count; i++) {
        checks[i].spec = specs->texts[i];
        int status = cli_session_direction(&w->session, &checks[i].spec, 1, &checks[i].direction);
        if (status) {
            return status;
        }
        checks[i].replays = can_replay(w, &checks[i].direction);
        int asked = w->session.options->terms;
        int needed = rey_terms_stated(w->session.scene, w->session.sensor,
                                      cli_direction_terms(w->session.scene, &checks[i].direction));
        checks[i].left_out = asked ? needed & ~asked : 0;
    }
    return note_unreached(w, checks, specs->count);
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
    s->progress.parts = (double)count * CHECK_SETS * (1 + CHECK_POINTS);
    rey_replay_make_room(s->scene, CHECK_ROOM);
    rey_result result = work_prepare(w, largest);
    int tests = 0;
    for (int i = 0; i < count && !result; i++) {
        result = check_or_refuse(w, &checks[i], count == 1);
        tests += checks[i].result.tests;
        if (!result && count > 1) {
            int most = count * w->blocks.nx * w->blocks.ny * CHECK_SERIES;
            cli_progress_end(&s->progress);
            result = check_print_ready(s->ctx, &checks[i], i == 0, check_z_threshold(tests), check_z_threshold(most),
                                       is_partial(w, &checks[i]), &w->reasons);
        }
    }
    cli_progress_end(&s->progress);
    return result;
}

static void judge(const Work *w, Check *checks, int count, double *threshold) {
    int tests = 0;
    for (int i = 0; i < count; i++) {
        tests += checks[i].result.tests;
    }
    *threshold = check_z_threshold(tests);
    for (int i = 0; i < count; i++) {
        check_judge(&checks[i], *threshold, is_partial(w, &checks[i]));
    }
}

static int report_checks(const Options *options, Work *w, Check *checks, int count) {
    double threshold;
    bool wrong = false;
    rey_result result = REY_OK;
    judge(w, checks, count, &threshold);
    for (int i = 0; i < count; i++) {
        wrong |= checks[i].verdict == VERDICT_WRONG;
    }
    if (wrong && options->step > 0) {
        cli_session_note(&w->session, "the differences are over the step that --step asks for, which may be what is wrong; without "
                         "it the step is found");
    }
    if (options->json) {
        check_print_json(&w->session, &w->stats, checks, count, threshold);
    } else {
        result = check_print_table(w->session.ctx, checks, count, threshold);
    }
    int status = result ? cli_report_failure(options, w->session.ctx, result) : cli_finish_output();
    return status ? status : wrong || w->refused_named ? EXIT_FAILED : EXIT_OK;
}

static int run_checks(const Options *options, Work *w) {
    Specs specs;
    int status = cli_specs_open(&w->session, &specs);
    if (status) {
        return status;
    }
    Check *checks = rey_alloc_array(w->session.ctx, (size_t)specs.count, sizeof *checks);
    status = checks ? build_directions(w, &specs, checks) : EXIT_OK;
    rey_result result = !checks ? REY_ERROR_MEMORY : status ? REY_OK : check_all(w, checks, specs.count);
    if (result) {
        status = cli_report_failure(options, w->session.ctx, result);
    } else if (!status) {
        status = report_checks(options, w, checks, specs.count);
    }
    for (int i = 0; i < specs.count && checks; i++) {
        cli_direction_free(w->session.ctx, &checks[i].direction);
        rey_free(w->session.ctx, checks[i].refusal);
    }
    rey_free(w->session.ctx, checks);
    cli_specs_free(&w->session, &specs);
    return status;
}

int cli_check(int argc, char **argv) {
    Options options;
    Work work = {0};
    int status;
    if (!cli_options_parse(COMMAND_CHECK, argc, argv, &options, &status)) {
        return status;
    }
    cli_catch_terminations();
    status = cli_session_open(&options, "check", &work.session);
    if (!status) {
        status = run_checks(&options, &work);
        work_free(&work);
        cli_session_close(&work.session);
    }
    cli_options_free(&options);
    return status;
}
