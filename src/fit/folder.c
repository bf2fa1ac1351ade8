// folder.c: the folder that a fit writes into: made, locked, and never taken from an earlier fit unasked.
#include "fit/former.h"
#include "io/file.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

rey_result rey_fit_make_folder(rey_context *ctx, const char *path) {
    char part[4096];
    size_t length = strlen(path);
    if (length >= sizeof part) {
        return rey_fail(ctx, REY_ERROR_IO, "%.64s...: path too long", path);
    }
    for (size_t i = 1; i <= length; i++) {
        if (path[i] == '/' || !path[i]) {
            snprintf(part, sizeof part, "%.*s", (int)i, path);
            if (mkdir(part, 0777) && errno != EEXIST) {
                return rey_fail(ctx, REY_ERROR_IO, "%s: cannot make this folder: %s", part, strerror(errno));
            }
        }
    }
    return REY_OK;
}

// The lock is the system's: it ends with the process, however that ends. Some network file systems have none.
static rey_result lock_folder(Fit *fit) {
    if (fit->def->resume && access(fit->output, F_OK) != 0) {
        return rey_fail(fit->ctx, REY_ERROR_IO, "%s: there is no such folder, and so no fit to resume", fit->output);
    }
    int folder = open(fit->output, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (folder < 0) {
        return rey_fail(fit->ctx, REY_ERROR_IO, "%s: cannot open this folder: %s", fit->output, strerror(errno));
    }
    fit->lock = folder + 1;
    if (flock(folder, LOCK_EX | LOCK_NB) && errno == EWOULDBLOCK) {
        return rey_fail(fit->ctx, REY_ERROR_IO, "%s: another fit is running in this folder, use another -o", fit->output);
    }
    return REY_OK;
}

static rey_result check_outputs(Fit *fit) {
    static const char *const names[] = {"checkpoint.bin", "job.resolved.yaml", "metrics.jsonl", "recovered.xml",
                                        "report.html"};
    rey_result result = REY_OK;
    for (int i = 0; i < COUNT_OF(names) && !result; i++) {
        char *path = rey_fit_output_path(fit, names[i]);
        result = path ? rey_file_check_output(fit->ctx, path) : REY_ERROR_MEMORY;
        rey_free(fit->ctx, path);
    }
    return result;
}

// What the folder holds is not replaced unasked; the message says what it is.
static rey_result refuse_former(Fit *fit, const char *path) {
    FitState state;
    rey_result result = rey_checkpoint_look(fit->ctx, path, (FitOrigin){fit->flat, fit->inputs}, &state);
    if (result == REY_ERROR_MEMORY) {
        return result;
    }
    if (result) {
        char why[1024];
        snprintf(why, sizeof why, "%s", rey_error(fit->ctx));
        return rey_fail(fit->ctx, result, strstr(why, "--overwrite") ? "%s" : "%s; --overwrite replaces it", why);
    }
    if (state.iteration == fit->job.iterations || state.converged) {
        return rey_fail(fit->ctx, REY_ERROR_ARGUMENT, "%s holds this fit, finished; --overwrite starts again, -o writes "
                        "elsewhere", fit->output);
    }
    bool more = state.iteration < fit->job.iterations;
    return rey_fail(fit->ctx, REY_ERROR_ARGUMENT, "%s holds %d iteration%s of this fit; %s--overwrite starts again",
                    fit->output, state.iteration, PLURAL(state.iteration), more ? "--resume continues, " : "");
}

// Files of these names in a folder without a fit are somebody's own.
static rey_result refuse_foreign(Fit *fit) {
    static const char *const names[] = {"metrics.jsonl", "recovered.xml", "report.html"};
    rey_result result = REY_OK;
    for (int i = 0; i < COUNT_OF(names) && !result; i++) {
        char *path = rey_fit_output_path(fit, names[i]);
        bool written = fit->job.report_spp || strcmp(names[i], "report.html") != 0;
        result = path ? REY_OK : REY_ERROR_MEMORY;
        if (path && written && access(path, F_OK) == 0) {
            result = rey_fail(fit->ctx, REY_ERROR_ARGUMENT, "%s is there already, and no fit is in this folder that wrote it; "
                              "--overwrite replaces it, -o writes elsewhere", path);
        }
        rey_free(fit->ctx, path);
    }
    return result;
}

// A fit that failed or was killed before its first checkpoint left nothing to lose; what one recovered is kept.
rey_result rey_fit_keep_recovered(Fit *fit) {
    char *path = rey_fit_output_path(fit, "recovered.xml");
    rey_result result = path ? REY_OK : REY_ERROR_MEMORY;
    if (path && access(path, F_OK) == 0) {
        result = rey_fail(fit->ctx, REY_ERROR_ARGUMENT, "%s holds what a fit recovered, and not its checkpoint.bin; --overwrite "
                          "starts again, -o writes elsewhere", fit->output);
    }
    rey_free(fit->ctx, path);
    return result;
}

static rey_result take_over(Fit *fit) {
    if (fit->def->overwrite) {
        return rey_former_exists(fit) ? rey_former_remove(fit) : REY_OK;
    }
    char *path = rey_fit_output_path(fit, "checkpoint.bin");
    rey_result result = path ? REY_OK : REY_ERROR_MEMORY;
    if (!result && access(path, F_OK) == 0) {
        result = refuse_former(fit, path);
    }
    rey_free(fit->ctx, path);
    if (!result) {
        result = rey_former_exists(fit) ? rey_fit_keep_recovered(fit) : refuse_foreign(fit);
    }
    return !result && rey_former_exists(fit) ? rey_former_remove(fit) : result;
}

rey_result rey_fit_folder_open(Fit *fit) {
    rey_result result = fit->def->resume ? REY_OK : rey_fit_make_folder(fit->ctx, fit->output);
    if (!result) {
        result = lock_folder(fit);
    }
    if (!fit->def->output) { // which is no place of the job
        result = rey_job_named_file(&fit->job, fit->job.output_at, result);
    }
    if (!result) {
        result = rey_former_refuse_inputs(fit);
    }
    if (!result) {
        result = check_outputs(fit);
    }
    return result || fit->def->resume ? result : take_over(fit);
}

void rey_fit_folder_close(Fit *fit) {
    if (fit->lock) {
        close(fit->lock - 1);
    }
    fit->lock = 0;
}
