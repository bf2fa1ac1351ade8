// fit.c: a fit from the job to the report: opening, optimising, finishing, closing.
#include "fit/carve.h"

#include "base/parallel.h"
#include "fit/inputs.h"
#include "fit/lbfgs.h"
#include "fit/report.h"
#include "fit/reuse.h"
#include "fit/rigid.h"
#include "io/file.h"

#include <limits.h>
#include <locale.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { LOSS_WINDOW = 10 }; // the final loss is a mean over so many iterations

char *rey_fit_output_path(const Fit *fit, const char *name) {
    size_t folder = strlen(fit->output), length = strlen(name);
    char *path = rey_alloc(fit->ctx, folder + length + 2);
    if (path) {
        memcpy(path, fit->output, folder);
        path[folder] = '/';
        memcpy(path + folder + 1, name, length);
    }
    return path;
}

// The job that is written down writes where this fit does, which -o may have moved.
static rey_result resolve_output(Fit *fit) {
    char absolute[PATH_MAX], *kept;
    if (!fit->def->output || !realpath(fit->output, absolute)) {
        return REY_OK;
    }
    kept = rey_job_alloc(&fit->job, strlen(absolute) + 1, 1);
    fit->job.output = kept ? strcpy(kept, absolute) : fit->job.output;
    return kept ? REY_OK : REY_ERROR_MEMORY;
}

static rey_result write_resolved(Fit *fit) {
    char *text = NULL, *path = rey_fit_output_path(fit, "job.resolved.yaml");
    rey_result result = path ? resolve_output(fit) : REY_ERROR_MEMORY;
    if (!result) {
        result = rey_job_yaml(&fit->job, &text);
    }
    if (!result) {
        result = rey_file_write(fit->ctx, path, text, strlen(text));
    }
    rey_free(fit->ctx, text);
    rey_free(fit->ctx, path);
    return result;
}

// A schedule that follows the number of iterations goes on as it began when there are to be more of them.
static rey_result keep_schedule(Fit *fit, const char *checkpoint) {
    JobSchedule *schedule = &fit->job.optimizer.schedule;
    double length;
    rey_result result =
        rey_checkpoint_number(fit->ctx, checkpoint, "optimizer.schedule.length", (double)schedule->length, &length);
    if (!result && !schedule->length_given && length >= 1 && length <= 1e9) {
        schedule->length = (int)length;
        rey_free(fit->ctx, fit->flat);
        fit->flat = NULL;
        result = rey_job_flat(&fit->job, &fit->flat);
    }
    return result;
}

// Which scene the checkpoint's numbers belong to.
static rey_result look_at_checkpoint(Fit *fit) {
    FitState state = {0};
    char *path = rey_fit_output_path(fit, "checkpoint.bin");
    rey_result result = path ? REY_OK : REY_ERROR_MEMORY;
    if (!result && access(path, F_OK) == 0) {
        result = keep_schedule(fit, path);
        if (!result) {
            result = rey_checkpoint_look(fit->ctx, path, (FitOrigin){fit->flat, NULL}, &state);
        }
    }
    fit->state.meshed = state.meshed;
    rey_free(fit->ctx, path);
    return result;
}

// A fit that was killed before its first checkpoint goes on from its start.
static rey_result resume(Fit *fit) {
    char *path = rey_fit_output_path(fit, "checkpoint.bin"), *job = rey_fit_output_path(fit, "job.resolved.yaml");
    rey_result result = path && job ? REY_OK : REY_ERROR_MEMORY;
    if (!result && access(path, F_OK) != 0 && access(job, F_OK) != 0) {
        result = rey_fail(fit->ctx, REY_ERROR_IO, "%s: this folder holds no fit to resume", fit->output);
    }
    if (!result && access(path, F_OK) != 0) {
        result = rey_fit_keep_recovered(fit);
    } else if (!result) {
        result = rey_checkpoint_read(path, (FitOrigin){fit->flat, fit->inputs}, &fit->unknowns, &fit->state);
    }
    rey_free(fit->ctx, path);
    rey_free(fit->ctx, job);
    if (!result) {
        result = rey_unknowns_apply(&fit->unknowns, fit->scene, fit->unknowns.value);
    }
    return result ? result : rey_reuse_resume(fit);
}

static rey_result allocate(Fit *fit) {
    size_t n = (size_t)fit->largest;
    fit->a = rey_alloc_array(fit->ctx, n, sizeof *fit->a);
    fit->b = rey_alloc_array(fit->ctx, n, sizeof *fit->b);
    fit->adjoint_a = rey_alloc_array(fit->ctx, n, sizeof *fit->adjoint_a);
    fit->adjoint_b = rey_alloc_array(fit->ctx, n, sizeof *fit->adjoint_b);
    fit->gradient = rey_alloc_array(fit->ctx, (size_t)fit->unknowns.count, sizeof *fit->gradient);
    return fit->a && fit->b && fit->adjoint_a && fit->adjoint_b && fit->gradient ? REY_OK : REY_ERROR_MEMORY;
}

static rey_result open_job(Fit *fit) {
    const FitDef *def = fit->def;
    rey_result result = rey_job_read(fit->ctx, def->job_path, def->overrides, def->override_count, &fit->job);
    if (result) {
        return result;
    }
    if (def->seed_given) {
        fit->job.seed = def->seed;
    }
    const char *folder = def->output ? def->output : rey_job_path(&fit->job, fit->job.output);
    fit->output = folder ? rey_strdup(fit->ctx, folder) : NULL;
    result = fit->output ? rey_job_flat(&fit->job, &fit->flat) : REY_ERROR_MEMORY;
    if (!result && def->resume) {
        result = look_at_checkpoint(fit);
    }
    if (!result) {
        result = rey_fit_load_scene(fit, fit->state.meshed, &fit->scene);
    }
    return result ? result : rey_fit_check_truth(fit);
}

// A fit that goes on in the scene of a level began in the job's.
static rey_result hash_inputs(Fit *fit) {
    rey_scene *scene = NULL;
    Unknowns unknowns = {0};
    if (!fit->state.meshed) {
        return rey_fit_inputs(fit, fit->scene, &fit->inputs);
    }
    rey_result result = rey_fit_open_start(fit, &scene, &unknowns);
    if (!result) {
        result = rey_fit_inputs(fit, scene, &fit->inputs);
    }
    rey_unknowns_free(&unknowns);
    rey_scene_destroy(scene);
    return result;
}

static rey_result open_fit(Fit *fit) {
    rey_result result = open_job(fit);
    if (!result) {
        result = rey_views_load(fit);
    }
    if (!result) {
        result = rey_unknowns_create(&fit->job, fit->scene, fit->state.meshed != 0, &fit->unknowns);
    }
    if (!result) {
        result = rey_carve(fit, fit->scene, &fit->unknowns);
    }
    if (!result) {
        result = hash_inputs(fit);
    }
    if (!result) {
        result = rey_reuse_open(fit);
    }
    if (!result) {
        result = rey_fit_check_derivatives(fit);
    }
    if (!result) {
        result = rey_fit_notes(fit);
    }
    if (!result) {
        result = allocate(fit);
    }
    if (!result) {
        result = rey_levels_check_grids(fit);
    }
    if (!result) {
        result = rey_levels_check_meshes(fit);
    }
    fit->state.history_width = HISTORY_VALUES;
    for (size_t k = 0; k < fit->unknowns.items.count; k++) {
        int64_t count = ARRAY_AT(fit->unknowns.items, Unknown, k).count;
        fit->state.history_width += count <= HISTORY_LARGEST ? (int)count : 0;
    }
    if (!result) {
        result = rey_fit_folder_open(fit);
    }
    if (!result && fit->def->resume) {
        result = resume(fit);
    }
    if (!result) {
        result = write_resolved(fit);
    }
    fit->first = fit->state.iteration;
    fit->earlier = fit->state.seconds;
    fit->start_seconds = rey_seconds() - fit->state.seconds;
    return result ? result : rey_metrics_open(fit);
}

static void close_fit(Fit *fit) {
    void *blocks[] = {fit->a, fit->b, fit->adjoint_a, fit->adjoint_b, fit->gradient, fit->flat, fit->inputs, fit->output};
    rey_metrics_close(fit);
    rey_fit_folder_close(fit);
    rey_unknowns_free(&fit->unknowns);
    rey_views_free(fit);
    rey_scene_destroy(fit->scene);
    rey_scene_destroy(fit->sampling);
    rey_array_free(fit->ctx, &fit->state.history);
    for (int i = 0; i < COUNT_OF(blocks); i++) {
        rey_free(fit->ctx, blocks[i]);
    }
    rey_job_free(&fit->job);
}

static rey_result save_scene(Fit *fit, FitResult *out) {
    char *path = rey_fit_output_path(fit, "recovered.xml");
    if (!path) {
        return REY_ERROR_MEMORY;
    }
    rey_result result = rey_scene_save(fit->scene, path);
    if (result == REY_ERROR_UNSUPPORTED) { // the numbers are in the checkpoint and in the report all the same
        out->note = rey_strdup(fit->ctx, rey_error(fit->ctx));
        rey_free(fit->ctx, path);
        return out->note ? REY_OK : REY_ERROR_MEMORY;
    }
    out->scene = path;
    return result;
}

// What is shown as the fit's loss. One iteration says little where samples are new in each; L-BFGS keeps its own, and its best.
static void set_loss(const Fit *fit, FitResult *out) {
    int done = fit->state.iteration;
    bool best = fit->job.optimizer.kind == OPTIMIZER_LBFGS && done > 0;
    out->loss_window = best ? 0 : done < LOSS_WINDOW ? done : LOSS_WINDOW;
    out->loss = best   ? rey_lbfgs_best_value(fit->unknowns.lbfgs)
                : done ? rey_fit_mean_loss(&fit->state, done, out->loss_window)
                       : NAN;
}

void rey_fit_loss_words(const FitResult *result, char *text, size_t size) {
    if (result->loss_window > 1) {
        snprintf(text, size, "mean of the last %d iterations", result->loss_window);
    } else {
        snprintf(text, size, "%s", result->loss_window ? "of the last iteration" : "of the best point, which was taken");
    }
}

// Rotation, shift and scale are what a pose of 16 entries is free to do.
static int64_t degrees_of_freedom(const Unknowns *u) {
    int64_t count = 0;
    for (size_t k = 0; k < u->items.count; k++) {
        const Unknown *p = &ARRAY_AT(u->items, Unknown, k);
        count += p->parameterisation == PARAMETERISATION_RIGID        ? RIGID_VARIABLES
                 : p->parameterisation == PARAMETERISATION_SIMILARITY ? SIMILAR_VARIABLES
                                                                      : p->count;
    }
    return count;
}

static rey_result finish(Fit *fit, FitResult *out) {
    out->iterations = fit->state.iteration;
    out->converged = fit->state.converged;
    out->falling = rey_fit_falling(fit);
    out->rose = rey_fit_rose(fit);
    out->iterations_before = fit->first;
    out->seconds_before = fit->earlier;
    out->seconds = fit->state.seconds;
    out->numbers = degrees_of_freedom(&fit->unknowns);
    out->nonfinite = fit->nonfinite;
    set_loss(fit, out);
    out->output = rey_strdup(fit->ctx, fit->output);
    rey_result result = out->output ? REY_OK : REY_ERROR_MEMORY;
    if (!result && fit->job.optimizer.average > 0 && fit->state.iteration > 0) {
        rey_unknowns_take_average(&fit->unknowns);
        result = rey_unknowns_apply(&fit->unknowns, fit->scene, fit->unknowns.value);
    }
    if (!result && fit->job.optimizer.kind == OPTIMIZER_LBFGS && fit->state.iteration > 0) {
        rey_optimizer_restart(&fit->job.optimizer, &fit->unknowns);
        result = rey_unknowns_apply(&fit->unknowns, fit->scene, fit->unknowns.value);
    }
    rey_levels_reduce(fit, 1);
    rey_fit_note_ends(fit);
    if (!result) {
        result = save_scene(fit, out);
    }
    if (!result) {
        result = rey_fit_table(fit, out);
    }
    if (result) {
        return result;
    }
    // A truth that cannot be opened is an error, and the report of what was found is written all the same.
    char *wrong = NULL;
    rey_result judged = rey_fit_judge(fit, out);
    if (judged) {
        wrong = rey_strdup(fit->ctx, rey_error(fit->ctx));
    }
    if (fit->job.report_spp && judged != REY_ERROR_CANCELLED) {
        result = rey_report_write(fit, out);
    }
    if (judged && !result) {
        result = wrong ? rey_fail(fit->ctx, judged, "%s; what was found is written all the same", wrong) : judged;
    }
    rey_free(fit->ctx, wrong);
    return result;
}

rey_result rey_fit(rey_context *ctx, const FitDef *def, FitResult *out) {
    Fit fit = {.ctx = ctx, .def = def, .level = -1};
    *out = (FitResult){.ctx = ctx};
    locale_t plain = newlocale(LC_ALL_MASK, "C", (locale_t)0); // files hold decimal points, whatever the host has set
    locale_t host = plain ? uselocale(plain) : (locale_t)0;
    rey_result result = open_fit(&fit);
    if (!result) {
        result = rey_fit_optimise(&fit);
    }
    if (!result) {
        result = finish(&fit, out);
        if (result == REY_ERROR_CANCELLED) {
            rey_fail(ctx, result, "stopped before the report was written; --resume writes it");
        }
    }
    out->bad_override = result == REY_ERROR_ARGUMENT;
    close_fit(&fit);
    if (plain) {
        uselocale(host);
        freelocale(plain);
    }
    return result;
}

void rey_fit_result_free(FitResult *result) {
    for (size_t i = 0; i < result->rows.count; i++) {
        FitRow *row = &ARRAY_AT(result->rows, FitRow, i);
        void *blocks[] = {row->name, row->truth, row->start, row->found};
        for (int k = 0; k < COUNT_OF(blocks); k++) {
            rey_free(result->ctx, blocks[k]);
        }
    }
    rey_array_free(result->ctx, &result->rows);
    rey_array_free(result->ctx, &result->held_out);
    char *texts[] = {result->output, result->report, result->scene, result->note};
    for (int k = 0; k < COUNT_OF(texts); k++) {
        rey_free(result->ctx, texts[k]);
    }
    *result = (FitResult){0};
}
