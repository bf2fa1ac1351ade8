// carve.c: voxels against silhouettes. A voxel is held against the rectangle of pixels around its corners, so that more is kept
// than the visual hull, never less.
#include "fit/carve.h"

#include "medium/majorant_build.h"
#include "render/projection.h"
#include "sensor/kinds.h"

#include <math.h>
#include <string.h>

static const double SLACK = 1e-3; // pixels, for rounding

static JobPlace carve_place(const Fit *fit, const Unknown *p) {
    return rey_job_place_of(fit->job.parameters[p->entry].node, "carve", "name");
}

static bool carves(const Fit *fit, const Unknown *p) { return p->param >= 0 && fit->job.parameters[p->entry].carve; }

rey_result rey_silhouette_load(Fit *fit, const JobView *job_view, FitView *view) {
    if (!job_view->silhouette) {
        return REY_OK;
    }
    const SensorRecord *s = fit->scene->view.sensors + view->sensor;
    rey_image image = {0};
    if (s->kind != SENSOR_PERSPECTIVE && s->kind != SENSOR_ORTHOGRAPHIC) {
        return rey_job_fail_at(&fit->job, job_view->silhouette_at, REY_ERROR_UNSUPPORTED,
                               "silhouettes are of perspective and orthographic sensors, and sensor %d is another one",
                               view->sensor);
    }
    rey_result result = rey_view_opaque(fit, job_view->silhouette_at, view, job_view->silhouette, &image);
    if (result) {
        rey_image_free(fit->ctx, &image);
        return result;
    }
    int64_t stride = view->width + 1;
    view->silhouette = rey_alloc_array(fit->ctx, (size_t)(stride * (view->height + 1)), sizeof *view->silhouette);
    for (int64_t y = 0; view->silhouette && y < view->height; y++) {
        int32_t row = 0;
        for (int64_t x = 0; x < view->width; x++) {
            const float *rgb = image.data + 3 * (y * view->width + x);
            row += rgb[0] > 0 || rgb[1] > 0 || rgb[2] > 0;
            view->silhouette[(y + 1) * stride + x + 1] = view->silhouette[y * stride + x + 1] + row;
        }
    }
    rey_image_free(fit->ctx, &image);
    if (!view->silhouette) {
        return REY_ERROR_MEMORY;
    }
    return view->silhouette[stride * (view->height + 1) - 1] > 0
               ? REY_OK
               : rey_job_fail_at(&fit->job, job_view->silhouette_at, REY_ERROR_FORMAT, "%s: the silhouette is 0 everywhere",
                                 job_view->silhouette);
}

// Whether a view sees nothing where points with these corners are.
static bool sees_nothing(const FitView *view, const SensorRecord *s, const Projection *film, double corners[8][3]) {
    double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY}, reach = (double)s->filter_radius + SLACK;
    int64_t stride = view->full_width + 1;
    for (int k = 0; k < 8; k++) {
        double local[3], at[2];
        rey_to_sensor(film, corners[k], local);
        if (!(local[2] > film->near)) {
            return false; // before the picture, or through it
        }
        rey_to_film(film, local, at);
        for (int i = 0; i < 2; i++) {
            low[i] = fmin(low[i], at[i]);
            high[i] = fmax(high[i], at[i]);
        }
    }
    // Pixels whose centres are nearer than the filter reaches.
    double x0 = floor(low[0] - reach - 0.5) + 1 - s->crop_x, x1 = ceil(high[0] + reach - 0.5) - s->crop_x;
    double y0 = floor(low[1] - reach - 0.5) + 1 - s->crop_y, y1 = ceil(high[1] + reach - 0.5) - s->crop_y;
    if (!(x0 >= 0 && y0 >= 0 && x1 <= view->full_width && y1 <= view->full_height)) {
        return false;
    }
    const int32_t *top = view->silhouette + (int64_t)y0 * stride, *bottom = view->silhouette + (int64_t)y1 * stride;
    return bottom[(int64_t)x1] - bottom[(int64_t)x0] - top[(int64_t)x1] + top[(int64_t)x0] == 0;
}

// The corners of what the value of a voxel has a part in: of trilinear interpolation half a voxel more on each side.
static void voxel_corners(const SceneView *view, const VolumeNode *v, const int64_t at[3], double corners[8][3]) {
    const int32_t n[3] = {v->nx, v->ny, v->nz};
    const double more = v->filter == FILTER_NEAREST ? 0 : 0.5;
    const float *m = v->to_world >= 0 ? view->theta + v->to_world : NULL;
    for (int k = 0; k < 8; k++) {
        double q[3];
        for (int i = 0; i < 3; i++) {
            bool upper = k >> i & 1;
            q[i] = fmin(fmax((double)at[i] + (upper ? 1 + more : -more), 0), n[i]) / n[i];
        }
        for (int i = 0; i < 3; i++) {
            corners[k][i] = m ? (double)m[4 * i] * q[0] + (double)m[4 * i + 1] * q[1] + (double)m[4 * i + 2] * q[2] +
                                    (double)m[4 * i + 3]
                              : q[i];
        }
    }
}

// Repeated voxels have a part beyond the other side of the grid, too; mirrored ones next to themselves. Around a cube that is
// turned, the medium's box holds more of both.
static bool is_wrapped(const SceneView *view, const VolumeNode *v, const int64_t at[3]) {
    const int32_t n[3] = {v->nx, v->ny, v->nz};
    bool border = false;
    for (int i = 0; i < 3; i++) {
        border = border || at[i] == 0 || at[i] == n[i] - 1;
    }
    return (border && v->wrap == WRAP_REPEAT) || rey_volume_goes_on(view, v);
}

// Marks what one view sees nothing of; returns how many voxels are new among them.
static int64_t carve_by(const rey_scene *scene, const FitView *view, const VolumeNode *v, int channels, unsigned char *carved) {
    const SensorRecord *s = scene->view.sensors + view->sensor;
    FilmPlan plan = rey_film_plan(s, 3);
    Projection film = rey_projection_of(&scene->view, &plan);
    int64_t count = 0, voxels = (int64_t)v->nx * v->ny * v->nz;
    for (int64_t i = 0; i < voxels; i++) {
        const int64_t at[3] = {i % v->nx, i / v->nx % v->ny, i / v->nx / v->ny};
        double corners[8][3];
        if (carved[i * channels] || is_wrapped(&scene->view, v, at)) {
            continue;
        }
        voxel_corners(&scene->view, v, at, corners);
        if (sees_nothing(view, s, &film, corners)) {
            memset(carved + i * channels, 1, (size_t)channels);
            count++;
        }
    }
    return count;
}

// What would leave the hull behind.
static rey_result check_still(Fit *fit, const rey_scene *scene, const Unknowns *u, const Unknown *p) {
    for (size_t k = 0; k < u->items.count; k++) {
        const Unknown *other = &ARRAY_AT(u->items, Unknown, k);
        const Param *param = other->param >= 0 ? &ARRAY_AT(scene->params, Param, other->param) : NULL;
        if (param && (param->camera >= 0 || param->volume >= 0)) {
            return rey_job_fail_at(&fit->job, carve_place(fit, p), REY_ERROR_PARAM,
                                   "parameter '%s': carve needs cameras and grids that stand still, and '%s' is unknown", p->name,
                                   other->name);
        }
    }
    return REY_OK;
}

static rey_result carve_grid(Fit *fit, const rey_scene *scene, Unknowns *u, Unknown *p) {
    const SceneView *view = &scene->view;
    const VolumeNode *v = view->volumes + view->textures[ARRAY_AT(scene->params, Param, p->param).texture].volume;
    int64_t voxels = (int64_t)v->nx * v->ny * v->nz, carved = 0, views = 0;
    p->carved = rey_alloc_array(u->ctx, (size_t)p->count, sizeof *p->carved);
    if (!p->carved) {
        return REY_ERROR_MEMORY;
    }
    for (int i = 0; i < fit->job.view_count; i++) {
        if (fit->views[i].silhouette && !fit->job.views[i].held_out) {
            carved += carve_by(scene, fit->views + i, v, p->grid.channels, p->carved);
            views++;
        }
    }
    JobPlace at = carve_place(fit, p);
    if (views == 0) {
        return rey_job_fail_at(&fit->job, at, REY_ERROR_PARAM, "parameter '%s': carve needs views with a 'silhouette'", p->name);
    }
    if (carved == voxels) {
        return rey_job_fail_at(&fit->job, at, REY_ERROR_PARAM, "parameter '%s': no voxel is left: of each, some silhouette sees "
                               "nothing", p->name);
    }
    const float empty = (float)(isfinite(p->low) ? p->low : fmin(0, p->high));
    for (int64_t i = 0; i < p->count; i++) {
        u->start[p->offset + i] = p->carved[i] ? empty : u->start[p->offset + i];
    }
    return REY_OK;
}

rey_result rey_carve(Fit *fit, rey_scene *scene, Unknowns *u) {
    bool any = false;
    for (size_t k = 0; k < u->items.count; k++) {
        Unknown *p = &ARRAY_AT(u->items, Unknown, k);
        if (!carves(fit, p)) {
            continue;
        }
        rey_result result = p->grid.nx ? check_still(fit, scene, u, p)
                                       : rey_job_fail_at(&fit->job, carve_place(fit, p), REY_ERROR_PARAM,
                                                         "parameter '%s': carve is for grids of voxels", p->name);
        if (!result) {
            result = carve_grid(fit, scene, u, p);
        }
        if (result) {
            return result;
        }
        any = true;
    }
    if (!any) {
        return REY_OK;
    }
    rey_unknowns_begin(u);
    return rey_unknowns_apply(u, scene, u->value);
}
