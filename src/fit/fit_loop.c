// fit_loop.c: the optimisation loop.
//
// Every view of an iteration is rendered twice with independently scrambled samples, A and B, of half the samples each.
// With the loss's derivative at one half pulled back through the other, (I_A - R) dI_B + (I_B - R) dI_A, no factor of
// a product shares noise with the other, so that the gradients of the squared losses are unbiased. With gradient_spp
// the sum of both derivatives is pulled back through a third set C, (I_A + I_B - 2 R) dI_C; docs/fit.md compares their noise.
#include "fit/reuse.h"

#include "base/parallel.h"
#include "render/replay.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

// 32 well mixed bits of two words: the finaliser of MurmurHash3, twice.
static uint32_t mix(uint32_t a, uint32_t b) {
    uint32_t x = a * 0x9e3779b9u + b;
    for (int i = 0; i < 2; i++) {
        x = (x ^ (x >> 16)) * 0x85ebca6bu;
        x = (x ^ (x >> 13)) * 0xc2b2ae35u;
        x ^= x >> 16;
    }
    return x;
}

int rey_fit_batches(const Job *job) {
    return job->views_per_iteration ? (job->fitted_count + job->views_per_iteration - 1) / job->views_per_iteration : 1;
}

// The views of one iteration: an epoch goes through all of them in an order of its own, a pure function of the seed,
// and its last batch may be smaller than the others.
static int choose_batch(const Fit *fit, int iteration, int *order) {
    int n = fit->job.fitted_count, m = fit->job.views_per_iteration ? fit->job.views_per_iteration : n, k = 0;
    int batches = rey_fit_batches(&fit->job), epoch = iteration / batches, first = iteration % batches * m;
    for (int i = 0; i < fit->job.view_count; i++) {
        if (!fit->job.views[i].held_out) {
            order[k++] = i;
        }
    }
    if (m == n) {
        return n;
    }
    for (int i = n - 1; i > 0; i--) {
        int j = (int)(((uint64_t)mix(mix(fit->job.seed, (uint32_t)epoch), (uint32_t)i) * (uint64_t)(i + 1)) >> 32);
        int held = order[i];
        order[i] = order[j];
        order[j] = held;
    }
    int count = n - first < m ? n - first : m;
    memmove(order, order + first, (size_t)count * sizeof *order);
    return count;
}

static rey_render_def view_def(const Fit *fit, const FitView *view, uint32_t set, int spp) {
    rey_render_def def = rey_default_render_def();
    def.sensor = view->sensor;
    def.spp = spp;
    def.seed = fit->job.seed;
    def.set = set;
    def.sampler = REY_SAMPLER_SOBOL;
    def.sets = 1;
    def.terms = fit->job.terms;
    return def;
}

static bool finishing_step(void *user, double fraction) {
    const Fit *fit = user;
    FitProgress progress = {.iteration = fit->state.iteration, .iterations = fit->job.iterations, .finishing = true};
    UNUSED(fraction);
    return !fit->def->progress || fit->def->progress(fit->def->user, &progress);
}

rey_render_def rey_fit_finishing_def(Fit *fit, const FitView *view, uint32_t set, int spp) {
    rey_render_def def = view_def(fit, view, set, spp);
    def.progress = finishing_step;
    def.user = fit;
    return def;
}

static rey_result render_half(Fit *fit, const FitView *view, uint32_t set, int spp, float *image) {
    rey_render_def def = view_def(fit, view, set, spp);
    rey_stats stats = {0};
    rey_result result = fit->sampling ? rey_reuse_render(fit, &def, image, &stats) : rey_render(fit->scene, &def, image, &stats);
    fit->nonfinite += stats.nonfinite;
    return result;
}

static const uint32_t FIRST_OF_DERIVATIVES = UINT32_C(1) << 31; // of the sets: those of pictures are 2 per iteration

static rey_result add_product(Fit *fit, const FitView *view, uint32_t set, int spp, const float *adjoint) {
    rey_render_def def = view_def(fit, view, set, spp);
    rey_selection selection = {fit->unknowns.params, fit->unknowns.param_count};
    rey_stats stats = {0};
    def.estimator = fit->sampling ? REY_ESTIMATOR_SCORE : REY_ESTIMATOR_PROBE;
    rey_result result = fit->sampling
                            ? rey_replay_vjp(fit->sampling, fit->scene, &def, selection, adjoint, fit->gradient, &stats)
                            : rey_vjp(fit->scene, &def, selection, adjoint, fit->gradient, NULL, &stats);
    fit->nonfinite += stats.nonfinite;
    const double *from = fit->gradient;
    for (size_t k = 0; k < fit->unknowns.items.count && !result; k++) {
        const Unknown *p = &ARRAY_AT(fit->unknowns.items, Unknown, k);
        for (int64_t i = p->offset; i < p->offset + p->count && p->param >= 0; i++) {
            fit->unknowns.gradient[i] += *from++;
        }
    }
    return result;
}

// Adds one view's share of the gradient; *loss is its loss. Nothing where reused paths turn out to be stale.
static rey_result add_view(Fit *fit, int index, int batch_count, double *loss) {
    const FitView *view = &fit->views[index];
    int iteration = rey_reuse_iteration(fit), spp = (rey_job_spp_at(&fit->job, fit->state.iteration) + 1) / 2; // of each half
    bool frozen = fit->job.optimizer.kind == OPTIMIZER_LBFGS; // it needs one function, noise included
    uint32_t set_a = frozen ? 0 : 2 * (uint32_t)iteration, set_b = set_a + 1;
    rey_result result = render_half(fit, view, set_a, spp, fit->a);
    if (!result && !rey_reuse_stale(fit)) {
        result = render_half(fit, view, set_b, spp, fit->b);
    }
    if (result || rey_reuse_stale(fit)) {
        return result;
    }
    double exposure = rey_exposure_of(fit, index, fit->unknowns.value);
    rey_exposure_scale(fit, index, exposure, fit->a);
    rey_exposure_scale(fit, index, exposure, fit->b);
    LossView loss_view = {view->target, view->mask, (int64_t)view->width * view->height, view->mask_sum};
    *loss = view->weight / batch_count *
            rey_loss(fit->job.loss, fit->job.loss_epsilon, &loss_view, fit->a, fit->b, view->weight / batch_count,
                     fit->adjoint_a, fit->adjoint_b);
    rey_exposure_adjoint(fit, index, exposure);
    if (fit->job.gradient_spp) {
        for (int64_t i = 0; i < 3 * loss_view.pixels; i++) {
            fit->adjoint_a[i] += fit->adjoint_b[i];
        }
        return add_product(fit, view, FIRST_OF_DERIVATIVES + (uint32_t)iteration, fit->job.gradient_spp, fit->adjoint_a);
    }
    result = add_product(fit, view, set_a, spp, fit->adjoint_a);
    return result ? result : add_product(fit, view, set_b, spp, fit->adjoint_b);
}

static rey_result add_history(Fit *fit, double loss, double norm) {
    double *row = rey_array_push(fit->ctx, &fit->state.history, sizeof *row, (size_t)fit->state.history_width);
    if (!row) {
        return REY_ERROR_MEMORY;
    }
    row[HISTORY_LOSS] = loss;
    row[HISTORY_NORM] = norm;
    row[HISTORY_FACTOR] = rey_schedule_factor(&fit->job.optimizer.schedule, fit->state.iteration);
    row[HISTORY_SECONDS] = rey_seconds() - fit->start_seconds;
    row += HISTORY_VALUES;
    for (size_t k = 0; k < fit->unknowns.items.count; k++) {
        const Unknown *p = &ARRAY_AT(fit->unknowns.items, Unknown, k);
        for (int64_t i = 0; i < p->count && p->count <= HISTORY_LARGEST; i++) {
            *row++ = (double)fit->unknowns.value[p->offset + i];
        }
    }
    return REY_OK;
}

// Pictures of another size or with other samples make another function of the unknowns.
static rey_result begin_iteration(Fit *fit) {
    const Job *job = &fit->job;
    int i = fit->state.iteration, level = rey_job_level_at(job, i);
    bool changed = i && (level != rey_job_level_at(job, i - 1) || rey_job_spp_at(job, i) != rey_job_spp_at(job, i - 1));
    rey_result result = REY_OK;
    if (changed) {
        rey_optimizer_restart(&job->optimizer, &fit->unknowns);
        result = rey_unknowns_apply(&fit->unknowns, fit->scene, fit->unknowns.value);
    }
    if (!result && level != fit->level) {
        result = rey_levels_enter(fit, level);
    }
    return result;
}

// The first parameter with a number that is not finite; its value after the step, or its gradient.
static const Unknown *find_infinite(const Unknowns *u, bool gradient, double *number) {
    for (size_t k = 0; k < u->items.count; k++) {
        const Unknown *p = &ARRAY_AT(u->items, Unknown, k);
        for (int64_t i = p->offset; i < p->offset + p->count; i++) {
            *number = gradient ? u->gradient[i] : (double)u->value[i];
            if (!isfinite(*number)) {
                return p;
            }
        }
    }
    return NULL;
}

// The scene and the last checkpoint keep what was found before.
static rey_result check_finite(Fit *fit, double loss, double norm) {
    double number;
    bool gradient = !isfinite(loss) || !isfinite(norm);
    const Unknown *p = find_infinite(&fit->unknowns, gradient, &number);
    if (!p && !gradient) {
        return REY_OK;
    }
    number = p ? number : loss;
    double rate = p && p->learning_rate > 0 ? p->learning_rate : fit->job.optimizer.learning_rate;
    char what[256] = "the loss", kept[64] = "";
    if (p) {
        snprintf(what, sizeof what, "%s'%.150s'", gradient ? "the gradient of " : "", p->name);
    }
    if (fit->saved > 0) {
        snprintf(kept, sizeof kept, "; checkpoint.bin keeps iteration %d", fit->saved);
    }
    return rey_fail(fit->ctx, REY_ERROR_PARAM, "%s: the fit diverges at iteration %d: %s becomes %g, expected a finite number; "
                    "lower the learning rate, which is %g%s", fit->job.path, fit->state.iteration, what, number, rate, kept);
}

// Gradient and loss of a batch of views; unfinished where reused paths turn out to be stale.
static rey_result add_views(Fit *fit, const int *order, int count, double *loss) {
    memset(fit->unknowns.gradient, 0, (size_t)fit->unknowns.count * sizeof *fit->unknowns.gradient);
    *loss = 0;
    bool show = fit->job.image_every && fit->state.iteration % fit->job.image_every == 0;
    bool frame = rey_frame_due(fit, fit->state.iteration);
    for (int k = 0; k < count; k++) {
        const FitView *view = &fit->views[order[k]];
        double part = 0;
        rey_result result = add_view(fit, order[k], count, &part);
        if (result || rey_reuse_stale(fit)) {
            return result;
        }
        for (int64_t i = 0; (show || frame) && i < (int64_t)view->width * view->height * 3; i++) {
            fit->a[i] = 0.5f * (fit->a[i] + fit->b[i]);
        }
        if (show) {
            result = rey_metrics_image(fit, order[k], fit->a);
        }
        if (!result && frame) {
            result = rey_frame_write(fit, order[k], fit->a);
        }
        if (result) {
            return result;
        }
        *loss += part;
    }
    return REY_OK;
}

static void mark_driven(Unknowns *u) {
    for (size_t k = 0; k < u->items.count; k++) {
        Unknown *p = &ARRAY_AT(u->items, Unknown, k);
        for (int64_t i = p->offset; i < p->offset + p->count && !p->driven; i++) {
            p->driven = u->gradient[i] != 0;
        }
    }
}

static rey_result iterate(Fit *fit, int *order) {
    int count = choose_batch(fit, fit->state.iteration, order);
    double loss = 0;
    rey_result result = begin_iteration(fit);
    if (!result) {
        result = rey_reuse_begin(fit);
    }
    if (!result) {
        result = add_views(fit, order, count, &loss);
    }
    while (!result && rey_reuse_stale(fit)) {
        result = rey_reuse_renew(fit);
        result = result ? result : add_views(fit, order, count, &loss);
    }
    if (result) {
        return result;
    }
    loss += rey_unknowns_regularise(&fit->unknowns);
    rey_unknowns_hold(&fit->unknowns);
    mark_driven(&fit->unknowns);
    double norm = rey_optimizer_step(&fit->job.optimizer, &fit->unknowns, fit->state.iteration, loss);
    result = check_finite(fit, loss, norm);
    if (!result) {
        result = add_history(fit, loss, norm);
    }
    if (!result) {
        result = rey_unknowns_apply(&fit->unknowns, fit->scene, fit->unknowns.value);
    }
    fit->state.iteration++;
    return result ? result : rey_metrics_row(fit, order, count);
}

double rey_fit_mean_loss(const FitState *state, int end, int count) {
    double sum = 0;
    for (int i = end - count; i < end; i++) {
        sum += ARRAY_AT(state->history, double, (size_t)i *(size_t)state->history_width + HISTORY_LOSS) / count;
    }
    return sum;
}

// Square of the standard error of the mean of `count` losses before `end`.
static double loss_variance(const FitState *state, int end, int count) {
    double mean = rey_fit_mean_loss(state, end, count), sum = 0;
    for (int i = end - count; i < end; i++) {
        double off = ARRAY_AT(state->history, double, (size_t)i *(size_t)state->history_width + HISTORY_LOSS) - mean;
        sum += off * off;
    }
    return sum / (count - 1) / count;
}

enum { SHORTEST = 5 }; // of windows of losses

// By so many standard errors.
static bool rose_by(const Fit *fit, double errors) {
    int n = fit->state.iteration, window = n / 10 > SHORTEST ? n / 10 : SHORTEST;
    if (n < 2 * window || fit->job.level_count) { // levels have losses of their own
        return false;
    }
    double now = rey_fit_mean_loss(&fit->state, n, window), first = rey_fit_mean_loss(&fit->state, 1, 1);
    return now > fmax(2 * first, 0) + errors * sqrt(loss_variance(&fit->state, n, window));
}

bool rey_fit_rose(const Fit *fit) { return rose_by(fit, 3); }

bool rey_fit_falling(const Fit *fit) {
    int n = fit->state.iteration, window = n / 10 > SHORTEST ? n / 10 : SHORTEST;
    if (fit->state.converged || n < 2 * window) {
        return false;
    }
    double now = rey_fit_mean_loss(&fit->state, n, window), before = rey_fit_mean_loss(&fit->state, n - window, window);
    double noise = sqrt(loss_variance(&fit->state, n, window) + loss_variance(&fit->state, n - window, window));
    return before - now > fmax(3 * noise, 0.05 * fabs(now));
}

// Stop rule: the mean loss of the last window is not lower than that of the window before by the tolerance.
static bool has_converged(const Fit *fit) {
    int n = fit->state.iteration, window = fit->job.stop_window;
    if (!window || n < 2 * (int64_t)window || n % window) {
        return false;
    }
    double now = rey_fit_mean_loss(&fit->state, n, window), before = rey_fit_mean_loss(&fit->state, n - window, window);
    return before - now < fit->job.stop_tolerance * fabs(before) && !rose_by(fit, 1);
}

static rey_result save(Fit *fit) {
    fit->state.seconds = rey_seconds() - fit->start_seconds;
    char *path = rey_fit_output_path(fit, "checkpoint.bin");
    FitOrigin origin = {fit->flat, fit->inputs};
    rey_result result = path ? rey_checkpoint_write(path, origin, &fit->unknowns, &fit->state) : REY_ERROR_MEMORY;
    rey_free(fit->ctx, path);
    return result;
}

// By count or by time, whichever comes first: what a kill costs is bounded for slow iterations, too.
static bool checkpoint_due(const Fit *fit, double saved_at) {
    const Job *job = &fit->job;
    return (job->checkpoint_every && fit->state.iteration % job->checkpoint_every == 0) ||
           (job->checkpoint_seconds > 0 && rey_seconds() - saved_at >= job->checkpoint_seconds);
}

static bool report_progress(Fit *fit, double run_start, int first) {
    if (!fit->def->progress) {
        return true;
    }
    const double *row = fit->state.history.count ? (const double *)fit->state.history.data + fit->state.history.count -
                                                       fit->state.history_width
                                                 : NULL;
    int done = fit->state.iteration - first, left = fit->job.iterations - fit->state.iteration;
    double now = rey_seconds();
    FitProgress progress = {.iteration = fit->state.iteration,
                            .iterations = fit->job.iterations,
                            .loss = row ? row[HISTORY_LOSS] : 0,
                            .gradient_norm = row ? row[HISTORY_NORM] : 0,
                            .seconds = now - fit->start_seconds,
                            .seconds_left = done ? (now - run_start) / done * left : 0};
    return fit->def->progress(fit->def->user, &progress);
}

rey_result rey_fit_optimise(Fit *fit) {
    int *order = rey_alloc_array(fit->ctx, (size_t)fit->job.view_count, sizeof *order);
    rey_result result = order ? REY_OK : REY_ERROR_MEMORY;
    double run_start = rey_seconds();
    double saved_at = run_start;
    int first = fit->state.iteration;
    fit->saved = -1;
    while (!result && !fit->stop && !fit->state.converged && fit->state.iteration < fit->job.iterations) {
        result = iterate(fit, order);
        if (result == REY_ERROR_CANCELLED) { // in the remeshing of a level: the iteration has not begun
            fit->stop = true;
            result = REY_OK;
        } else if (!result) {
            fit->state.converged = has_converged(fit);
            fit->stop = !report_progress(fit, run_start, first);
            if (checkpoint_due(fit, saved_at)) {
                result = save(fit);
                fit->saved = fit->state.iteration;
                saved_at = rey_seconds();
            }
        }
    }
    rey_free(fit->ctx, order);
    if (!result && fit->saved != fit->state.iteration) {
        result = save(fit);
    }
    if (!result && fit->stop && fit->state.iteration < fit->job.iterations) {
        result = rey_fail(fit->ctx, REY_ERROR_CANCELLED, "stopped after iteration %d; --resume continues",
                          fit->state.iteration);
    }
    return result;
}
