// frames.c: small pictures of the views while they are fitted, kept as files so that a resumed fit has them, too.
#include "fit/fit.h"
#include "fit/report_parts.h"
#include "io/file.h"

#include <stdio.h>
#include <unistd.h>

bool rey_frame_due(const Fit *fit, int iteration) {
    int epoch = iteration / rey_fit_batches(&fit->job);
    return fit->job.report_spp && epoch && !(epoch & (epoch - 1));
}

static char *frame_path(const Fit *fit, int view, int iteration) {
    char name[64];
    snprintf(name, sizeof name, "frames/view%d_%06d.png", view, iteration);
    return rey_fit_output_path(fit, name);
}

static rey_result write_png(Fit *fit, const char *path, const FitView *view, const float *image) {
    unsigned char *png;
    size_t size;
    int width, height;
    float exposure = rey_report_exposure(fit->ctx, view->target, (int64_t)view->width * view->height);
    rey_result result =
        rey_report_thumbnail(fit->ctx, image, view->width, view->height, exposure, &png, &size, &width, &height);
    if (!result) {
        result = rey_file_write(fit->ctx, path, png, size);
    }
    rey_free(fit->ctx, png);
    return result;
}

rey_result rey_frame_write(Fit *fit, int view, const float *image) {
    char *folder = rey_fit_output_path(fit, "frames"), *path = frame_path(fit, view, fit->state.iteration);
    rey_result result = folder && path ? rey_fit_make_folder(fit->ctx, folder) : REY_ERROR_MEMORY;
    if (!result) {
        result = write_png(fit, path, &fit->views[view], image);
    }
    rey_free(fit->ctx, folder);
    rey_free(fit->ctx, path);
    return result;
}

rey_result rey_frame_read(const Fit *fit, int view, int iteration, unsigned char **bytes, size_t *size) {
    char *path = frame_path(fit, view, iteration);
    rey_result result = path ? REY_OK : REY_ERROR_MEMORY;
    *bytes = NULL;
    if (!result && access(path, R_OK) == 0) {
        result = rey_file_read(fit->ctx, path, bytes, size);
    }
    rey_free(fit->ctx, path);
    return result;
}
