// views.c: target pictures and masks, and what they must agree with.
#include "fit/carve.h"
#include "io/image.h"
#include "io/mitsuba.h"

#include <math.h>

rey_result rey_view_picture(Fit *fit, JobPlace at, const FitView *view, const char *name, rey_image *image) {
    const char *path = rey_job_path(&fit->job, name);
    rey_result result = path ? rey_image_read(fit->ctx, path, image) : REY_ERROR_MEMORY;
    if (result) {
        return result == REY_ERROR_MEMORY ? result : rey_job_fail_at(&fit->job, at, result, "%s", rey_error(fit->ctx));
    }
    if (image->width != view->width || image->height != view->height) {
        return rey_job_fail_at(&fit->job, at, REY_ERROR_FORMAT, "%s is %d x %d, but sensor %d delivers %d x %d", name,
                               image->width, image->height, view->sensor, view->width, view->height);
    }
    result = rey_image_to_rgb(fit->ctx, name, image);
    return result == REY_ERROR_UNSUPPORTED ? rey_job_fail_at(&fit->job, at, result, "%s", rey_error(fit->ctx)) : result;
}

rey_result rey_view_opaque(Fit *fit, JobPlace at, const FitView *view, const char *name, rey_image *image) {
    rey_result result = rey_view_picture(fit, at, view, name, image);
    return result || !image->translucent
               ? result
               : rey_job_fail_at(&fit->job, at, REY_ERROR_FORMAT, "%s has an alpha below 1, which would be left out, expected a "
                                 "picture without alpha", name);
}

// A weight is one number: of colours, it is not known which of them is meant.
static rey_result check_grey(Fit *fit, const JobView *job_view, const rey_image *image) {
    static const float most_off = 1e-3f; // of the largest channel, for rounding
    for (int64_t i = 0; i < (int64_t)image->width * image->height; i++) {
        const float *rgb = image->data + 3 * i;
        float largest = fmaxf(rgb[0], fmaxf(rgb[1], rgb[2]));
        if (largest - fminf(rgb[0], fminf(rgb[1], rgb[2])) > most_off * fabsf(largest)) {
            return rey_job_fail_at(&fit->job, job_view->mask_at, REY_ERROR_FORMAT,
                                   "%s: the mask is %g %g %g at pixel %d, %d, expected a grey picture: one weight per pixel",
                                   job_view->mask, (double)rgb[0], (double)rgb[1], (double)rgb[2], (int)(i % image->width),
                                   (int)(i / image->width));
        }
    }
    return REY_OK;
}

static rey_result load_mask(Fit *fit, const JobView *job_view, FitView *view) {
    int64_t pixels = (int64_t)view->width * view->height;
    view->mask_sum = (double)pixels;
    if (!job_view->mask) {
        return REY_OK;
    }
    rey_image image = {0};
    rey_result result = rey_view_opaque(fit, job_view->mask_at, view, job_view->mask, &image); // of weights: never decoded
    if (!result) {
        result = check_grey(fit, job_view, &image);
    }
    if (!result) {
        view->mask = rey_alloc_array(fit->ctx, (size_t)pixels, sizeof *view->mask);
        result = view->mask ? REY_OK : REY_ERROR_MEMORY;
    }
    view->mask_sum = 0;
    for (int64_t i = 0; i < pixels && !result; i++) {
        view->mask[i] = image.data[3 * i];
        view->mask_sum += (double)view->mask[i];
        if (!(view->mask[i] >= 0) || !isfinite(view->mask[i])) {
            result = rey_job_fail_at(&fit->job, job_view->mask_at, REY_ERROR_FORMAT,
                                     "%s: the mask holds values below 0 or not finite", job_view->mask);
        }
    }
    if (!result && !(view->mask_sum > 0)) {
        result = rey_job_fail_at(&fit->job, job_view->mask_at, REY_ERROR_FORMAT, "%s: the mask is 0 everywhere",
                                 job_view->mask);
    }
    rey_image_free(fit->ctx, &image);
    return result;
}

// Room for the pictures of levels.
static rey_result keep_full(Fit *fit, const JobView *job_view, FitView *view) {
    size_t pixels = (size_t)view->width * (size_t)view->height;
    view->full_width = view->width;
    view->full_height = view->height;
    view->full_sensor = fit->scene->view.sensors[view->sensor];
    view->full_mask = view->mask;
    view->mask = view->full_mask ? rey_alloc_array(fit->ctx, pixels, sizeof *view->mask) : NULL;
    view->target = rey_alloc_array(fit->ctx, pixels, 3 * sizeof *view->target);
    bool had = view->target && (view->mask || !view->full_mask);
    return had ? rey_levels_check(fit, job_view, view) : REY_ERROR_MEMORY;
}

// The sensor that a view names, and the size of its film. Where there is none of that name, the message says which there are.
static rey_result find_sensor(Fit *fit, const JobView *job_view, FitView *view) {
    char list[512];
    view->sensor = job_view->sensor_id ? rey_mitsuba_sensor(fit->scene, job_view->sensor_id) : job_view->sensor;
    if (rey_scene_film_size(fit->scene, view->sensor, &view->width, &view->height) == REY_OK) {
        return REY_OK;
    }
    rey_mitsuba_list_sensors(fit->scene, list, sizeof list);
    return job_view->sensor_id && list[0]
               ? rey_job_fail_at(&fit->job, job_view->sensor_at, REY_ERROR_FORMAT, "the scene has no sensor '%.100s': %s",
                                 job_view->sensor_id, list)
               : rey_job_fail_at(&fit->job, job_view->sensor_at, REY_ERROR_FORMAT, list[0] ? "%s: %s" : "%s",
                                 rey_error(fit->ctx), list);
}

static rey_result load_view(Fit *fit, const JobView *job_view, FitView *view) {
    *view = (FitView){.weight = job_view->weight};
    rey_result result = find_sensor(fit, job_view, view);
    if (result) {
        return result;
    }
    rey_image image = {0};
    result = rey_view_picture(fit, job_view->target_at, view, job_view->target, &image);
    if (!result) {
        result = load_mask(fit, job_view, view);
    }
    if (!result) {
        result = rey_silhouette_load(fit, job_view, view);
    }
    int64_t floats = (int64_t)view->width * view->height * 3;
    if (!result && image.srgb) {
        rey_image_decode_srgb(&image);
    }
    for (int64_t i = 0; i < floats && !result; i++) {
        if (!isfinite(image.data[i]) && (!view->mask || view->mask[i / 3] > 0)) {
            result = rey_job_fail_at(&fit->job, job_view->target_at, REY_ERROR_FORMAT,
                                     "%s holds a value that is not finite at pixel %d, %d", job_view->target,
                                     (int)(i / 3 % view->width), (int)(i / 3 / view->width));
        }
    }
    if (!result) {
        view->full_target = image.data; // from here on the view's
        view->translucent = image.translucent;
        image.data = NULL;
        result = keep_full(fit, job_view, view);
        fit->largest = floats > fit->largest ? floats : fit->largest;
    }
    rey_image_free(fit->ctx, &image);
    return result;
}

rey_result rey_views_load(Fit *fit) {
    fit->views = rey_alloc_array(fit->ctx, (size_t)fit->job.view_count, sizeof *fit->views);
    rey_result result = fit->views ? REY_OK : REY_ERROR_MEMORY;
    for (int i = 0; i < fit->job.view_count && !result; i++) {
        result = load_view(fit, &fit->job.views[i], &fit->views[i]);
    }
    if (!result) {
        rey_levels_reduce(fit, 1);
    }
    return result;
}

void rey_views_free(Fit *fit) {
    for (int i = 0; fit->views && i < fit->job.view_count; i++) {
        rey_free(fit->ctx, fit->views[i].target);
        rey_free(fit->ctx, fit->views[i].mask);
        rey_free(fit->ctx, fit->views[i].full_target);
        rey_free(fit->ctx, fit->views[i].full_mask);
        rey_free(fit->ctx, fit->views[i].silhouette);
    }
    rey_free(fit->ctx, fit->views);
    fit->views = NULL;
}
