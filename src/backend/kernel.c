// kernel.c: all kernels of one SIMD width, compiled once per width. Runs one unit of work: the samples of a tile.
#include "integrator/aov.h"
#include "integrator/film.h"
#include "integrator/lamps.h"
#include "integrator/path_adj.h"
#include "integrator/path_replay.h"
#include "integrator/within.h"
#include "math/colour.h"

// Adds one sample of n channels to the film of the tile.
KFN void film_add(Tracer *t, const FilterTable *filter, int32_t slot, const double *l, int32_t n, double *film) {
    const PathJob *job = t->job;
    int32_t x0 = job->x - job->border, y0 = job->y - job->border;
    int32_t width = job->width + 2 * job->border, height = job->height + 2 * job->border;
    if (t->sensor->filter == FILM_BOX) {
        // A sample counts for the pixel it was drawn in.
        int32_t number = t->ws.pixel[slot], margin = filter_margin(t->sensor), stride = t->sensor->width + 2 * margin;
        double *pixel = film + ((int64_t)(number / stride - margin - y0) * width + number % stride - margin - x0) * n;
        for (int32_t c = 0; c < n; c++) {
            pixel[c] += l[c];
        }
        return;
    }
    float wx[MAX_FOOTPRINT], wy[MAX_FOOTPRINT];
    int32_t first_x, first_y;
    int32_t nx = film_weights(t->sensor, filter, (float)t->ws.film_x[slot], x0, x0 + width, &first_x, wx);
    int32_t ny = film_weights(t->sensor, filter, (float)t->ws.film_y[slot], y0, y0 + height, &first_y, wy);
    enum { BLOCK = 32 };
    double line[BLOCK * MOST_AOV_CHANNELS];
    for (int32_t x = 0; x < nx; x += BLOCK) {
        int32_t numbers = (nx - x < BLOCK ? nx - x : BLOCK) * n;
        for (int32_t k = 0; k < numbers; k++) {
            line[k] = (double)wx[x + k / n] * l[k % n];
        }
        for (int32_t j = 0; j < ny; j++) {
            double *row = film + ((int64_t)(first_y + j - y0) * width + first_x + x - x0) * n;
            for (int32_t k = 0; k < numbers; k++) {
                row[k] += (double)wy[j] * line[k];
            }
        }
    }
}

// Adds alpha of a sample, and its weight.
static void film_add_coverage(Tracer *t, const FilterTable *filter, int32_t slot) {
    const double coverage[2] = {(double)t->ws.coverage[slot], 1};
    film_add(t, filter, slot, coverage, 2, t->job->coverage);
}

// Adds the n numbers of a sample, raised to the power that is asked for.
static void film_add_powers(Tracer *t, const FilterTable *filter, int32_t slot, double *l, int32_t n) {
    for (int32_t power = 1; power < t->job->power; power *= 2) {
        for (int32_t c = 0; c < n; c++) {
            l[c] *= l[c];
        }
    }
    film_add(t, filter, slot, l, n, t->job->powers);
}

// Whether a sample brings nothing for having met only surfaces that let it pass (SceneView.drops). Derivatives: kept.h.
KFN bool film_drops(const Tracer *t, int32_t i) { return t->scene->drops && !t->derivative && t->ws.coverage[i] <= 0; }

// Adds what samples carry across the film (beacon_view.h).
static void film_add_drift(Tracer *t, const FilterTable *filter, int32_t slot) {
    const PathJob *job = t->job;
    int32_t x0 = job->x - job->border, y0 = job->y - job->border;
    int32_t width = job->width + 2 * job->border, height = job->height + 2 * job->border;
    FilmFootprint f;
    film_footprint(t->sensor, filter, (float)t->ws.film_x[slot], (float)t->ws.film_y[slot], x0, y0, x0 + width, y0 + height, &f);
    for (int32_t j = 0; j < f.ny; j++) {
        double *row = job->film + ((int64_t)(f.first_y + j - y0) * width + f.first_x - x0) * SPEC_N;
        for (int32_t k = 0; k < f.nx * SPEC_N; k++) {
            row[k] += (double)(f.by_x[k / SPEC_N] * f.y[j]) * (double)t->ws.adjoint_x[k % SPEC_N][slot] +
                      (double)(f.x[k / SPEC_N] * f.by_y[j]) * (double)t->ws.adjoint_y[k % SPEC_N][slot];
        }
    }
}

// Adds the chunk's radiances (or derivatives) to the tile's film.
static void film_splat(Tracer *t, const FilterTable *filter, int32_t count) {
    PathJob *job = t->job;
    for (int32_t i = 0; i < count; i++) {
        double l[SPEC_N], sum = 0;
        for (int c = 0; c < SPEC_N; c++) {
            l[c] = film_drops(t, i) ? 0 : (double)t->ws.radiance[c][i];
            sum += l[c];
        }
        if (!(sum - sum == 0)) {
            job->nonfinite++;
            continue;
        }
        film_add(t, filter, i, l, SPEC_N, job->film);
        if (flows_drift(t)) {
            film_add_drift(t, filter, i);
        }
        if (job->coverage) {
            film_add_coverage(t, filter, i);
        }
        if (job->powers) {
            double xyz[SPEC_N] = {rey_xyz_of(l, 0), rey_xyz_of(l, 1), rey_xyz_of(l, 2)};
            film_add_powers(t, filter, i, job->powers_of_xyz ? xyz : l, SPEC_N);
        }
    }
}

static void film_splat_aovs(Tracer *t, const FilterTable *filter, int32_t count) {
    double l[MOST_AOV_CHANNELS];
    int32_t n = 0;
    for (int32_t i = 0; i < t->scene->aov_count; i++) {
        n += aov_components(t->scene->aovs[i]);
    }
    for (int32_t i = 0; i < count; i++) {
        for (int32_t c = 0; c < n; c++) {
            double value = (double)t->ws.channel[c][i];
            l[c] = value - value == 0 ? value : 0;
            t->job->nonfinite += value - value != 0;
        }
        film_add(t, filter, i, l, n, t->job->film);
        if (t->job->coverage) {
            film_add_coverage(t, filter, i);
        }
        if (t->job->powers) {
            film_add_powers(t, filter, i, l, n);
        }
    }
}

static void film_splat_slope(Tracer *t, const FilterTable *filter, int32_t i) {
    float slope[2][SPEC_N];
    film_worth_slope(t->sensor, filter, t->job->adjoint, (float)t->ws.film_x[i], (float)t->ws.film_y[i], slope);
    for (int c = 0; c < SPEC_N; c++) {
        t->ws.adjoint_x[c][i] = slope[0][c];
        t->ws.adjoint_y[c][i] = slope[1][c];
    }
}

// The adjoint of film_splat: what each slot's radiance is worth.
static void film_splat_adj(Tracer *t, const FilterTable *filter, int32_t count) {
    const int32_t margin = filter_margin(t->sensor), stride = t->sensor->width + 2 * margin;
    for (int32_t i = 0; i < count; i++) {
        float delta[SPEC_N];
        film_worth(t->sensor, filter, t->job->adjoint, (float)t->ws.film_x[i], (float)t->ws.film_y[i],
                   t->ws.pixel[i] % stride - margin, t->ws.pixel[i] / stride - margin, delta);
        for (int c = 0; c < SPEC_N; c++) {
            t->ws.adjoint[c][i] = delta[c];
        }
        if (flows_drift(t)) {
            film_splat_slope(t, filter, i);
        }
    }
}

// What the recorded paths bring in the scene that is asked for, or its derivative there. Shadow rays that the sweep has to look at
// anyway are left to it.
static void sweep_moved(Tracer *t, int32_t count) {
    const bool later = t->shadows_later;
    t->shadows_later = later && t->job->mode == MODE_REVERSE && passing_is_live(t);
    t->scene = t->job->moved; // t->deciding stays
    path_replay(t);
    if (t->job->mode == MODE_REVERSE) {
        path_backward(t, count);
    }
    t->scene = t->job->scene;
    t->shadows_later = later;
}

// Runs samples [first, first + count). A chunk whose vertices do not fit the records is run again in halves: samples
// are pure functions of their numbers, so that nothing depends on it.
static void run_chunk(Tracer *t, const FilterTable *filter, int64_t first, int32_t count, int32_t *begin) {
    PathJob before = *t->job;
    camera_stage(t, first, count);
    if (t->job->mode == MODE_AOV) {
        aov_forward(t, begin, count);
        film_splat_aovs(t, filter, count);
        return;
    }
    path_forward(t, begin);
    if (t->overflow && count > LANES) {
        t->job->paths = before.paths;
        t->job->rays = before.rays;
        t->most = count / 2; // so do the next ones, probably
        run_chunk(t, filter, first, count / 2, begin);
        run_chunk(t, filter, first + count / 2, count - count / 2, begin);
        return;
    }
    if (t->derivative) {
        if (t->job->live_extinctions) {
            probe_stage(t, begin, count);
        }
        if (t->job->live_borders) {
            border_stage(t, begin, count);
        }
        if (t->job->corner_at) {
            side_stage(t, begin, corner_push);
        }
        if (t->job->glossy) {
            side_stage(t, begin, glossy_push);
        }
        if (t->scene->drops) {
            kept_stage(t, t->job->moved ? t->job->moved : t->scene, count);
        }
        if (t->job->mode == MODE_REVERSE) {
            film_splat_adj(t, filter, count);
        }
        for (int c = 0; c < SPEC_N; c++) {
            memset(t->ws.radiance[c], 0, (size_t)count * sizeof(real));
            if (flows_drift(t) && t->job->mode == MODE_FORWARD) {
                memset(t->ws.adjoint_x[c], 0, (size_t)count * sizeof(real));
                memset(t->ws.adjoint_y[c], 0, (size_t)count * sizeof(real));
            }
        }
        if (t->job->moved) {
            sweep_moved(t, count);
        } else {
            path_backward(t, count);
        }
    }
    if (t->job->mode != MODE_REVERSE) {
        film_splat(t, filter, count);
    }
}

size_t KNAME(rey_kernel_workspace_bytes)(int32_t mode) {
    Workspace ws;
    return workspace_layout(&ws, NULL, mode);
}

// Whether a derivative is asked for of nothing but materials and what lights send out, none of which asks where it is.
KFN bool materials_stand(const PathJob *job) {
    bool moves = job->any_motion || job->any_places || job->any_normals || job->glides || job->watch_turned || job->watch_smooth;
    return !moves && job->scene->attributes_count == 0 && job->scene->volumes_count == 0;
}

// The groups' offsets lie behind the workspace proper; job->workspace_bytes has room for them.
void KNAME(rey_kernel_run)(PathJob *job) {
    Tracer t = {.job = job, .scene = job->scene, .deciding = job->scene, .sensor = job->scene->sensors + job->sensor};
    size_t bytes = workspace_layout(&t.ws, job->workspace, job->mode);
    int32_t *begin = (int32_t *)((char *)job->workspace + bytes);
    FilterTable filter;
    filter_tabulate(t.sensor, &filter);
    t.derivative = mode_records(job->mode);
    t.floor = t.derivative ? DERIVATIVE_FLOOR : 0;
    t.shadows_later = t.derivative && t.scene->through && (job->moved || passing_is_live(&t));
    const bool plain = t.derivative && !job->moved && !t.scene->through && !t.scene->has_media && !t.scene->drops;
    t.spares = plain && !job->live_lights;
    t.local = plain && materials_stand(job);
    int64_t total = (int64_t)job->width * job->height * job->spp;
    t.most = t.ws.chunk;
    lamps_find(&t);
    if (job->lamp_medium) {
        lights_within(&t, job->lamp_medium);
    }
    Pinhole pinhole;
    if (job->rides && job->beacons && (job->any_camera || job->any_places)) {
        pinhole = pinhole_make(t.scene, t.sensor);
        t.pinhole = &pinhole;
    }
    for (int64_t first = 0, count; first < total && (!job->go_on || job->go_on(job->user)); first += count) {
        count = total - first < t.most ? total - first : t.most;
        run_chunk(&t, &filter, first, (int32_t)count, begin);
    }
}
