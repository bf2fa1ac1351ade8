// table.c: the final table: truth, start, found and error of every unknown. The truth is opened here, after the
// optimisation is over, and nowhere else.
#include "fit/chamfer.h"
#include "fit/fit.h"
#include "fit/pose.h"
#include "io/file.h"
#include "io/mitsuba.h"
#include "render/update.h"

#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

enum { LARGEST_SMALL = 64, WEIGHT_SPP = 16 }; // parameters up to this size are judged by their worst entry

static float *copy_floats(rey_context *ctx, const float *values, int64_t count) {
    float *copy = rey_alloc_array(ctx, (size_t)count, sizeof *copy);
    if (copy) {
        memcpy(copy, values, (size_t)count * sizeof *copy);
    }
    return copy;
}

static bool was_resampled(const Fit *fit, const Unknown *p) {
    bool resampled = false;
    for (int i = 0; i < fit->state.meshed && p->grid.nx; i++) {
        resampled = resampled || fit->job.levels[i].resolution > 0;
    }
    return resampled;
}

enum { ABSORPTION, REDUCED, MEDIUM_ROWS };
static const char *const medium_rows[MEDIUM_ROWS] = {"sigma_a", "reduced_sigma_s"};

// One of the two from all numbers of the unknowns; null when there is no memory.
static float *medium_values(rey_context *ctx, const Scattering *s, const float *values, int which) {
    float *out = rey_alloc_array(ctx, (size_t)s->count, sizeof *out);
    double g = s->g < 0 ? s->known_g : (double)values[s->g];
    for (int64_t i = 0; i < s->count && out; i++) {
        double coefficients[MEDIUM_ROWS];
        rey_scattering_coefficients(s->apart, (double)values[s->first + i], (double)values[s->second + i], g,
                                    &coefficients[ABSORPTION], &coefficients[REDUCED]);
        out[i] = (float)coefficients[which];
    }
    return out;
}

static rey_result add_medium(Fit *fit, const Scattering *s, FitResult *result) {
    const Unknowns *u = &fit->unknowns;
    for (int which = 0; which < MEDIUM_ROWS; which++) {
        FitRow *row = rey_array_push(fit->ctx, &result->rows, sizeof *row, 1);
        size_t size = strlen(s->name) + 32;
        if (!row) {
            return REY_ERROR_MEMORY;
        }
        *row = (FitRow){.name = rey_alloc(fit->ctx, size), .count = s->count, .derived = true};
        if (row->name) {
            snprintf(row->name, size, "%s.%s", s->name, medium_rows[which]);
        }
        row->start = medium_values(fit->ctx, s, u->start, which);
        row->found = medium_values(fit->ctx, s, u->value, which);
        if (!row->name || !row->start || !row->found) {
            return REY_ERROR_MEMORY;
        }
    }
    return REY_OK;
}

rey_result rey_fit_table(Fit *fit, FitResult *result) {
    const Unknowns *u = &fit->unknowns;
    for (size_t k = 0; k < u->items.count; k++) {
        const Unknown *p = &ARRAY_AT(u->items, Unknown, k);
        FitRow *row = rey_array_push(fit->ctx, &result->rows, sizeof *row, 1);
        if (!row) {
            return REY_ERROR_MEMORY;
        }
        *row = (FitRow){.count = p->count,
                        .dims = p->dims,
                        .shape = {p->shape[0], p->shape[1], p->shape[2]},
                        .weighted = p->count > LARGEST_SMALL && !p->vertices};
        row->points[COLUMN_FOUND] = p->vertices ? p->vertices->mesh.point_count : 0;
        row->grid = p->grid.channels;
        for (int64_t i = 0; p->carved && i < p->count; i++) {
            row->carved += p->carved[i];
        }
        bool other = fit->state.meshed && (p->vertices || was_resampled(fit, p)); // the start had other vertices or voxels
        row->name = rey_strdup(fit->ctx, p->name);
        row->start = other ? NULL : copy_floats(fit->ctx, u->start + p->offset, p->count);
        row->found = copy_floats(fit->ctx, u->value + p->offset, p->count);
        if (!row->name || (!row->start && !other) || !row->found) {
            return REY_ERROR_MEMORY;
        }
    }
    rey_result added = REY_OK;
    for (size_t k = 0; k < u->media.count && !added; k++) {
        const Scattering *s = &ARRAY_AT(u->media, Scattering, k);
        added = s->count <= LARGEST_SMALL ? add_medium(fit, s, result) : REY_OK;
    }
    return added;
}

bool rey_fit_row_is_pose(const FitRow *row) {
    return row->dims == 2 && row->shape[0] == 4 && row->shape[1] == 4;
}

bool rey_fit_row_text(const FitRow *row, int column, char *text, size_t size) {
    const float *values = column == COLUMN_TRUTH ? row->truth : column == COLUMN_START ? row->start : row->found;
    if (row->points[column]) {
        bool off = row->points[COLUMN_TRUTH] && column != COLUMN_TRUTH;
        snprintf(text, size, off ? "%lld points, %.3g %%" : "%lld points", (long long)row->points[column],
                 100 * row->chamfer[column]);
        return true;
    }
    if (!rey_fit_row_is_pose(row) || !values) {
        return false;
    }
    rey_pose_text(values, row->truth ? row->truth : row->start, text, size);
    return true;
}

// Largest error of an entry over the largest entry: of poses, whose entries belong together.
static double pose_error(const FitRow *row) {
    double worst = 0, largest = 0;
    for (int64_t i = 0; i < row->count; i++) {
        worst = fmax(worst, fabs((double)row->found[i] - (double)row->truth[i]));
        largest = fmax(largest, fabs((double)row->truth[i]));
    }
    return worst / largest;
}

static void set_worst_error(FitRow *row) {
    if (rey_fit_row_is_pose(row)) {
        row->error = pose_error(row);
        return;
    }
    for (int64_t i = 0; i < row->count; i++) {
        double truth = (double)row->truth[i], off = fabs((double)row->found[i] - truth);
        double error = truth != 0 ? off / fabs(truth) : off; // an entry of truth 0 counts absolutely
        row->absolute = error > row->error ? truth == 0 : row->absolute;
        row->error = fmax(row->error, error);
    }
}

static void set_weighted_error(FitRow *row, const double *gradient) {
    double error = 0, mean = 0, weight = 0;
    for (int64_t i = 0; i < row->count; i++) {
        error += fabs(gradient[i]) * fabs((double)row->found[i] - (double)row->truth[i]);
        mean += fabs(gradient[i]) * fabs((double)row->truth[i]);
        weight += fabs(gradient[i]);
    }
    row->absolute = weight > 0 && !(mean > 0);
    row->error = mean > 0 ? error / mean : weight > 0 ? error / weight : 0;
}

static Triangles triangles_of(const rey_scene *scene, int param) {
    const ShapeRecord *shape = scene->view.shapes + ARRAY_AT(scene->params, Param, param).geometry;
    return (Triangles){scene->view.theta + shape->positions, scene->view.triangles + 3 * (int64_t)shape->triangle,
                       shape->vertex_count, shape->triangle_count};
}

static bool has_mesh(const rey_scene *scene, int param) {
    return param >= 0 && ARRAY_AT(scene->params, Param, param).geometry >= 0 &&
           triangles_of(scene, param).triangle_count > 0;
}

// Start and result of a mesh against the truth's, whatever their vertices.
static rey_result judge_mesh(Fit *fit, rey_scene *truth, FitRow *row) {
    int param = rey_param_find(truth, row->name);
    rey_scene *start = NULL;
    Unknowns unknowns = {0};
    rey_result result = rey_fit_open_start(fit, &start, &unknowns);
    if (!result && has_mesh(truth, param)) {
        const Triangles meshes[COLUMN_COUNT] = {triangles_of(truth, param),
                                                triangles_of(start, rey_param_find(start, row->name)),
                                                triangles_of(fit->scene, rey_param_find(fit->scene, row->name))};
        double diagonal = rey_triangles_diagonal(&meshes[COLUMN_TRUTH]);
        row->points[COLUMN_TRUTH] = meshes[COLUMN_TRUTH].vertex_count;
        for (int c = COLUMN_START; c < COLUMN_COUNT && !result; c++) {
            double distance;
            result = rey_chamfer(fit->ctx, &meshes[COLUMN_TRUTH], &meshes[c], &distance);
            row->chamfer[c] = diagonal > 0 ? distance / diagonal : distance;
        }
        row->error = row->chamfer[COLUMN_FOUND];
    }
    for (size_t k = 0; k < unknowns.items.count && !result; k++) {
        const Unknown *p = &ARRAY_AT(unknowns.items, Unknown, k);
        row->points[COLUMN_START] = strcmp(p->name, row->name) ? row->points[COLUMN_START] : p->vertices->mesh.point_count;
    }
    rey_unknowns_free(&unknowns);
    rey_scene_destroy(start);
    return result;
}

static const float *values_of(const rey_scene *scene, const char *medium, const char *ending, int64_t count) {
    char name[1024];
    rey_param_info info;
    snprintf(name, sizeof name, "%s.%s", medium, ending);
    int param = rey_param_find(scene, name);
    return param < 0 || rey_param_get_info(scene, param, &info) || info.count != count ? NULL : rey_param_values(scene, param);
}

// The truth of a row that follows from others; none where the truth has another number of coefficients.
static rey_result judge_derived(Fit *fit, const rey_scene *truth, FitRow *row) {
    for (size_t k = 0; k < fit->unknowns.media.count; k++) {
        const Scattering *s = &ARRAY_AT(fit->unknowns.media, Scattering, k);
        size_t length = strlen(s->name);
        const float *first = values_of(truth, s->name, "sigma_t.value.value", row->count);
        const float *second = values_of(truth, s->name, "albedo.value.value", row->count);
        const float *g = values_of(truth, s->name, "phase_function.g.value", 1);
        const bool apart = !first; // whatever the fitted scene has
        first = apart ? values_of(truth, s->name, "sigma_a.value.value", row->count) : first;
        second = apart ? values_of(truth, s->name, "sigma_s.value.value", row->count) : second;
        if (strncmp(row->name, s->name, length) || row->name[length] != '.' || !first || !second) {
            continue;
        }
        int which = !strcmp(row->name + length + 1, medium_rows[REDUCED]);
        row->truth = rey_alloc_array(fit->ctx, (size_t)row->count, sizeof *row->truth);
        if (!row->truth) {
            return REY_ERROR_MEMORY;
        }
        for (int64_t i = 0; i < row->count; i++) {
            double coefficients[MEDIUM_ROWS];
            rey_scattering_coefficients(apart, (double)first[i], (double)second[i], g ? (double)*g : 0,
                                        &coefficients[ABSORPTION], &coefficients[REDUCED]);
            row->truth[i] = (float)coefficients[which];
        }
        set_worst_error(row);
        return REY_OK;
    }
    return REY_OK;
}

// The truth has nothing to compare a row with: so many numbers, 0 = none of this name.
static void note_uncompared(const Fit *fit, const FitRow *row, int64_t count) {
    char words[512];
    if (rey_param_find(fit->scene, row->name) < 0 || !fit->def->note) {
        return; // exposures are no parameters of scenes
    }
    if (count) {
        snprintf(words, sizeof words, "parameter '%.300s': the truth has %lld numbers there, and not %lld: its error is not known",
                 row->name, (long long)count, (long long)row->count);
    } else {
        snprintf(words, sizeof words, "parameter '%.300s': the truth has none of this name: its error is not known", row->name);
    }
    fit->def->note(fit->def->user, words);
}

static rey_result judge_row(Fit *fit, rey_scene *truth, FitRow *row) {
    int param = rey_param_find(truth, row->name); // none of an exposure's name
    rey_param_info info;
    if (row->derived) {
        return judge_derived(fit, truth, row);
    }
    if (row->points[COLUMN_FOUND]) {
        return judge_mesh(fit, truth, row);
    }
    if (param < 0 || rey_param_get_info(truth, param, &info) || info.count != row->count) {
        note_uncompared(fit, row, param < 0 ? 0 : info.count);
        return REY_OK;
    }
    row->truth = copy_floats(fit->ctx, rey_param_values(truth, param), row->count);
    if (!row->truth) {
        return REY_ERROR_MEMORY;
    }
    if (!row->weighted) { // weigh_rows follows
        set_worst_error(row);
    }
    return REY_OK;
}

// Parameters of the truth whose rows are weighted, each once, and where its numbers begin.
typedef struct Weighing {
    int *params;
    int64_t *offsets; // one more than params
    int *of_row;      // per row the number of its parameter, -1 = not weighted
    int count;
    double *gradient, *sum; // d sum(I) / d entry of one view, and of all
} Weighing;

static void choose_weighed(const rey_scene *truth, const FitResult *out, Weighing *w) {
    for (size_t i = 0; i < out->rows.count; i++) {
        const FitRow *row = &ARRAY_AT(out->rows, FitRow, i);
        int param = row->weighted && row->truth ? rey_param_find(truth, row->name) : -1, k = 0;
        while (k < w->count && w->params[k] != param) {
            k++;
        }
        w->of_row[i] = param < 0 ? -1 : k;
        if (param >= 0 && k == w->count) {
            w->params[w->count++] = param;
            w->offsets[w->count] = w->offsets[k] + row->count;
        }
    }
}

// |d sum(I) / d entry| over all views: one reverse pass per view has the derivatives of all of them.
static rey_result find_weights(Fit *fit, rey_scene *truth, const float *ones, Weighing *w) {
    size_t size = (size_t)w->offsets[w->count];
    w->gradient = rey_alloc_array(fit->ctx, size, sizeof *w->gradient);
    w->sum = rey_alloc_array(fit->ctx, size, sizeof *w->sum);
    rey_result result = w->gradient && w->sum ? REY_OK : REY_ERROR_MEMORY;
    for (int v = 0; v < fit->job.view_count && w->count && !result; v++) {
        rey_render_def def = rey_fit_finishing_def(fit, &fit->views[v], 0, WEIGHT_SPP);
        result = rey_vjp(truth, &def, (rey_selection){w->params, w->count}, ones, w->gradient, NULL, NULL);
        for (size_t i = 0; i < size && !result; i++) {
            w->sum[i] += w->gradient[i];
        }
    }
    return result;
}

static rey_result weigh_rows(Fit *fit, rey_scene *truth, const float *ones, FitResult *out) {
    size_t rows = out->rows.count;
    Weighing w = {.params = rey_alloc_array(fit->ctx, rows, sizeof *w.params),
                  .offsets = rey_alloc_array(fit->ctx, rows + 1, sizeof *w.offsets),
                  .of_row = rey_alloc_array(fit->ctx, rows, sizeof *w.of_row)};
    rey_result result = w.params && w.offsets && w.of_row ? REY_OK : REY_ERROR_MEMORY;
    if (!result) {
        choose_weighed(truth, out, &w);
        result = find_weights(fit, truth, ones, &w);
    }
    for (size_t i = 0; i < rows && !result; i++) {
        FitRow *row = &ARRAY_AT(out->rows, FitRow, i);
        if (w.of_row[i] >= 0) {
            set_weighted_error(row, w.sum + w.offsets[w.of_row[i]]);
        }
    }
    void *const arrays[] = {w.params, w.offsets, w.of_row, w.gradient, w.sum};
    for (int k = 0; k < COUNT_OF(arrays); k++) {
        rey_free(fit->ctx, arrays[k]);
    }
    return result;
}

// The truth's pictures have the views' sizes, or the weights would be those of other pictures.
static rey_result check_films(Fit *fit, const rey_scene *truth) {
    for (int v = 0; v < fit->job.view_count; v++) {
        const FitView *view = &fit->views[v];
        const char *id = fit->job.views[v].sensor_id;
        int width, height;
        if (id && rey_mitsuba_sensor(truth, id) != view->sensor) {
            char list[512];
            rey_mitsuba_list_sensors(truth, list, sizeof list);
            return rey_job_fail_at(&fit->job, fit->job.truth_at, REY_ERROR_SCENE,
                                   "%s: sensor %d is not '%.100s' as in the scene: %s", fit->job.truth_scene, view->sensor, id,
                                   list);
        }
        rey_result result = rey_scene_film_size(truth, view->sensor, &width, &height);
        if (result) {
            return result;
        }
        if (width != view->full_width || height != view->full_height) {
            return rey_job_fail_at(&fit->job, fit->job.truth_at, REY_ERROR_SCENE,
                                   "%s: sensor %d delivers %d x %d, the scene's %d x %d", fit->job.truth_scene, view->sensor,
                                   width, height, view->full_width, view->full_height);
        }
    }
    return REY_OK;
}

rey_result rey_fit_check_truth(Fit *fit) {
    if (!fit->job.truth_scene) {
        return REY_OK;
    }
    const char *path = rey_job_path(&fit->job, fit->job.truth_scene);
    size_t size;
    int file;
    rey_result result = path ? rey_file_open(fit->ctx, path, &file, &size) : REY_ERROR_MEMORY;
    if (!result) {
        close(file);
    }
    return rey_job_named_file(&fit->job, fit->job.truth_at, result);
}

// The job's defines are those of its scene: the truth need not use them. Its own it must.
static rey_result load_truth(Fit *fit, rey_scene **out) {
    const char *path = rey_job_path(&fit->job, fit->job.truth_scene);
    bool own = fit->job.truth_defines.count > 0;
    const JobDefines *defines = own ? &fit->job.truth_defines : &fit->job.defines;
    rey_result result = path ? rey_mitsuba_load(fit->ctx, path, defines->list, defines->count, own ? 0 : LOAD_SPARE, out)
                             : REY_ERROR_MEMORY;
    return rey_job_named_scene(&fit->job, fit->job.truth_at, defines, result);
}

// Whether a row's truth is its start, but for rounding; false where one of them is not known.
static bool starts_true(const FitRow *row) {
    static const double rounding = 1e-5;
    double largest = 0, off = 0;
    if (row->points[COLUMN_TRUTH]) {
        return row->chamfer[COLUMN_START] <= rounding;
    }
    for (int64_t i = 0; i < row->count && row->truth && row->start; i++) {
        largest = fmax(largest, fabs((double)row->truth[i]));
        off = fmax(off, fabs((double)row->truth[i] - (double)row->start[i]));
    }
    return row->truth && row->start && off <= rounding * largest;
}

// A truth that is the start is mostly one that has got the defines of the start.
static void note_same(const Fit *fit, const FitResult *out) {
    int known = 0, same = 0;
    for (size_t i = 0; i < out->rows.count; i++) {
        const FitRow *row = &ARRAY_AT(out->rows, FitRow, i);
        known += row->truth || row->points[COLUMN_TRUTH];
        same += starts_true(row);
    }
    if (known && same == known && fit->def->note) {
        bool inherited = fit->job.defines.count && !fit->job.truth_defines.count;
        fit->def->note(fit->def->user, inherited ? "all values of the truth equal the start: it got the job's 'defines'; does it "
                                                   "need 'truth.defines' of its own?"
                                                 : "all values of the truth equal the start");
    }
}

rey_result rey_fit_judge(Fit *fit, FitResult *out) {
    if (!fit->job.truth_scene) {
        return REY_OK;
    }
    rey_scene *truth = NULL;
    float *ones = rey_alloc_array(fit->ctx, (size_t)fit->largest, sizeof *ones);
    rey_result result = ones ? load_truth(fit, &truth) : REY_ERROR_MEMORY;
    if (!result) {
        result = rey_scene_update(truth);
    }
    for (int64_t i = 0; ones && i < fit->largest; i++) {
        ones[i] = 1;
    }
    if (!result) {
        result = check_films(fit, truth);
    }
    for (size_t i = 0; i < out->rows.count && !result; i++) {
        result = judge_row(fit, truth, &ARRAY_AT(out->rows, FitRow, i));
    }
    if (!result) {
        note_same(fit, out);
        result = weigh_rows(fit, truth, ones, out);
    }
    rey_free(fit->ctx, ones);
    rey_scene_destroy(truth);
    return result;
}
