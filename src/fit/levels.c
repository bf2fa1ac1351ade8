// levels.c: from coarse to fine. On a level that reduces by r, targets are means over r x r pixels, weighted by their masks,
// and the sensors' films shrink with them. Their filter is a box then: what a mean over pixels is, but for the blur of the
// target's own filter, which is narrow against such pixels.
#include "fit/fit.h"

#include <string.h>

int rey_job_level_at(const Job *job, int iteration) {
    int level = 0;
    for (int i = 1; i < job->level_count && job->levels[i].from <= iteration; i++) {
        level = i;
    }
    return level;
}

rey_result rey_levels_check(Fit *fit, const JobView *job_view, const FitView *view) {
    const SensorRecord *s = fit->scene->view.sensors + view->sensor;
    for (int i = 0; i < fit->job.level_count; i++) {
        int r = fit->job.levels[i].reduce;
        JobPlace at = rey_job_blame(fit->job.levels[i].reduce_at, job_view->sensor_at);
        if (s->width % r || s->height % r || s->crop_x % r || s->crop_y % r || view->width % r || view->height % r) {
            return rey_job_fail_at(&fit->job, at, REY_ERROR_FORMAT,
                                   "level %d reduces by %d, but sensor %d has %d x %d pixels, expected multiples of %d", i,
                                   r, view->sensor, view->width, view->height, r);
        }
        if (r > 1 && s->batch_count) {
            return rey_job_fail_at(&fit->job, at, REY_ERROR_UNSUPPORTED,
                                   "sensor %d is a batch, which levels do not reduce", view->sensor);
        }
    }
    return REY_OK;
}

static bool is_unknown(const Fit *fit, int32_t texture) {
    for (size_t k = 0; k < fit->unknowns.items.count; k++) {
        const Unknown *p = &ARRAY_AT(fit->unknowns.items, Unknown, k);
        if (p->param >= 0 && ARRAY_AT(fit->scene->params, Param, p->param).texture == texture) {
            return true;
        }
    }
    return false;
}

// Whether a grid's sum with another one is an extinction, and that one would keep its resolution.
static bool leaves_behind(const Fit *fit, const Unknown *p) {
    const SceneView *view = &fit->scene->view;
    int32_t texture = ARRAY_AT(fit->scene->params, Param, p->param).texture;
    for (int64_t i = 0; i < view->media_count; i++) {
        const MediumNode *medium = view->media + i;
        for (int k = 0; k < 2 && medium->sigma_s >= 0; k++) {
            const VolumeNode *own = view->volumes + (k ? medium->sigma_a : medium->sigma_s);
            const VolumeNode *other = view->volumes + (k ? medium->sigma_s : medium->sigma_a);
            if (own->texture == texture && other->kind == VOLUME_GRID && !is_unknown(fit, other->texture)) {
                return true;
            }
        }
    }
    return false;
}

rey_result rey_levels_check_grids(Fit *fit) {
    bool grids = false, levels = false;
    JobPlace at = {0};
    for (int i = 0; i < fit->job.level_count; i++) {
        levels = levels || fit->job.levels[i].resolution > 0;
        at = fit->job.levels[i].resolution > 0 ? rey_job_blame(at, fit->job.levels[i].resolution_at) : at;
    }
    for (size_t k = 0; k < fit->unknowns.items.count && levels; k++) {
        const Unknown *p = &ARRAY_AT(fit->unknowns.items, Unknown, k);
        grids = grids || p->grid.nx;
        if (p->grid.nx && leaves_behind(fit, p)) {
            return rey_job_fail_at(&fit->job, at, REY_ERROR_PARAM,
                                   "levels with a 'resolution' would leave the other one of sigma_s and sigma_a behind %s: "
                                   "expected both among the 'parameters'", p->name);
        }
        for (int i = -1; i < fit->job.level_count && p->grid.nx; i++) {
            int resolution = i < 0 ? 0 : fit->job.levels[i].resolution;
            int64_t count = rey_voxels_count(resolution > 0 ? rey_voxels_resized(p->grid, resolution) : p->grid);
            if (count <= HISTORY_LARGEST || count > INT32_MAX) {
                return rey_job_fail_at(&fit->job, at, REY_ERROR_PARAM,
                                       "levels with a 'resolution' make %s a grid of %lld numbers, expected %d or more", p->name,
                                       (long long)count, HISTORY_LARGEST + 1);
            }
        }
    }
    return grids || !levels ? REY_OK
                            : rey_job_fail_at(&fit->job, at, REY_ERROR_PARAM,
                                              "levels have a 'resolution', which is for grids, and the job has none");
}

// One pixel of a reduced view from r x r of the full one, from (x, y) on.
static void reduce_pixel(const FitView *view, int x, int y, int r, float *target, float *mask) {
    double sum[3] = {0, 0, 0}, weight = 0;
    for (int i = 0; i < r * r; i++) {
        int64_t at = (int64_t)(y + i / r) * view->full_width + x + i % r;
        double m = view->full_mask ? (double)view->full_mask[at] : 1;
        weight += m;
        for (int c = 0; c < 3 && m > 0; c++) { // behind a mask may stand anything
            sum[c] += m * (double)view->full_target[3 * at + c];
        }
    }
    for (int c = 0; c < 3; c++) {
        target[c] = weight > 0 ? (float)(sum[c] / weight) : 0;
    }
    if (mask) {
        *mask = (float)(weight / (r * r));
    }
}

static void reduce_view(FitView *view, int r) {
    view->width = view->full_width / r;
    view->height = view->full_height / r;
    if (r == 1) { // to the bit
        size_t pixels = (size_t)view->width * (size_t)view->height;
        memcpy(view->target, view->full_target, 3 * pixels * sizeof *view->target);
    }
    view->mask_sum = 0;
    for (int64_t i = 0; i < (int64_t)view->width * view->height; i++) {
        if (r > 1) {
            reduce_pixel(view, (int)(i % view->width) * r, (int)(i / view->width) * r, r, view->target + 3 * i,
                         view->mask ? view->mask + i : NULL);
        } else if (view->mask) {
            view->mask[i] = view->full_mask[i];
        }
        view->mask_sum += view->mask ? (double)view->mask[i] : 1;
    }
}

static void reduce_sensor(SensorRecord *s, int r) {
    s->width /= r;
    s->height /= r;
    s->crop_x /= r;
    s->crop_y /= r;
    s->crop_width /= r;
    s->crop_height /= r;
    if (r > 1) {
        s->filter = FILM_BOX;
        s->filter_radius = 0.5f;
    }
}

void rey_levels_reduce(Fit *fit, int r) {
    for (int v = 0; v < fit->job.view_count; v++) {
        FitView *view = &fit->views[v];
        SensorRecord *s = fit->scene->view.sensors + view->sensor;
        *s = view->full_sensor;
        reduce_sensor(s, r);
        reduce_view(view, r);
    }
}

rey_result rey_levels_enter(Fit *fit, int level) {
    const JobLevel *l = fit->job.level_count ? &fit->job.levels[level] : NULL;
    rey_result result = REY_OK;
    if (l && (l->edge_length > 0 || l->resolution > 0) && fit->state.meshed != level + 1) {
        rey_levels_reduce(fit, 1);
        result = rey_levels_remesh(fit, level);
    }
    fit->level = level;
    rey_levels_reduce(fit, l ? l->reduce : 1);
    return result;
}
