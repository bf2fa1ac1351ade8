// render.c: what all calls share, and the drivers of derivatives. They check what was asked, cut it into units of work
// that do not depend on the number of threads, and merge the units' results in a fixed order.
#include "base/parallel.h"
#include "math/rng.h"
#include "render/beacons.h"
#include "render/boundary.h"
#include "render/dropped.h"
#include "render/facing.h"
#include "render/live.h"
#include "render/motion.h"
#include "render/particles.h"
#include "render/render_parts.h"
#include "render/rims.h"
#include "render/shards.h"
#include "render/terms.h"
#include "render/update.h"
#include "scene/sink.h"

#include <string.h>

enum { DEFAULT_SETS = 16 };
enum { MOST_SELECTED = 1 << 30 }; // numbers

rey_render_def rey_default_render_def(void) {
    return (rey_render_def){.size = sizeof(rey_render_def), .sets = DEFAULT_SETS};
}

static void render_free(Render *r) {
    rey_context *ctx = r->scene->ctx;
    for (int i = 0; r->workspaces && i < ctx->def.threads; i++) {
        rey_free(ctx, r->workspaces[i]);
    }
    rey_free(ctx, r->workspaces);
    rey_boundaries_free(r);
    rey_free(ctx, r->films);
    rey_free(ctx, r->powers);
    rey_free(ctx, r->coverage);
    rey_free(ctx, r->gradients);
    rey_free(ctx, r->normal_sums);
    rey_free(ctx, r->columns);
    rey_free(ctx, r->rows);
    rey_free(ctx, r->offsets);
    rey_beacons_end(r);
    rey_free(ctx, r->adjoint);
    rey_free(ctx, r->tangent);
    pthread_mutex_destroy(&r->lock);
}

rey_result rey_render_check(rey_scene *scene, const rey_render_def *def) {
    rey_context *ctx = scene->ctx;
    if (!def || def->size != sizeof *def) {
        return rey_fail(ctx, REY_ERROR_ARGUMENT, "rey_render_def must come from rey_default_render_def");
    }
    if (!scene->integrator) {
        return rey_fail(ctx, REY_ERROR_SCENE, "the scene has no integrator, expected one such as <integrator "
                                              "type=\"path\"/>");
    }
    if (scene->view.sensors_count == 0) {
        return rey_fail(ctx, REY_ERROR_SCENE, "the scene has no sensor to render with");
    }
    if (rey_traces_particles(scene) && scene->view.media_count > 0) {
        return rey_fail(scene->ctx, REY_ERROR_UNSUPPORTED, "'ptracer' knows no participating media, 'volpath' does");
    }
    if (def->sensor < 0 || def->sensor >= scene->view.sensors_count) {
        return rey_fail(ctx, REY_ERROR_ARGUMENT, "sensor %d does not exist: the scene has %d", def->sensor,
                        (int)scene->view.sensors_count);
    }
    if (def->spp < 0 || def->spp > 1 << 24) {
        return rey_fail(ctx, REY_ERROR_ARGUMENT, "spp = %d, expected 1 to %d, or 0 for the scene's own", def->spp, 1 << 24);
    }
    if (def->sets < 1 || def->sets > 4096) {
        return rey_fail(ctx, REY_ERROR_ARGUMENT, "sets = %d, expected 1 to 4096", def->sets);
    }
    if (def->sampler < REY_SAMPLER_DEFAULT || def->sampler > REY_SAMPLER_SOBOL) {
        return rey_fail(ctx, REY_ERROR_ARGUMENT, "sampler = %d is none of REY_SAMPLER_*", def->sampler);
    }
    if (def->terms & ~REY_TERM_ALL) {
        return rey_fail(ctx, REY_ERROR_ARGUMENT, "terms = %d holds bits that are none of REY_TERM_*", def->terms);
    }
    return REY_OK;
}

// Checks, and plans the film: all that a question about a derivative needs.
static rey_result render_plan(Render *r, rey_scene *scene, const rey_render_def *def, int32_t mode, int32_t channels) {
    *r = (Render){.scene = scene, .parts = 1};
    pthread_mutex_init(&r->lock, NULL);
    rey_result result = rey_render_check(scene, def);
    if (result != REY_OK) {
        return result;
    }
    const SensorRecord *sensor = scene->view.sensors + def->sensor;
    r->def = *def;
    r->def.spp = def->spp ? def->spp : sensor->spp;
    if (scene->view.split) {
        if ((int64_t)r->def.spp * scene->view.split > 1 << 24) {
            return rey_fail(scene->ctx, REY_ERROR_ARGUMENT, "%d samples per pixel of %d each, expected up to %d together",
                            r->def.spp, scene->view.split, 1 << 24);
        }
        r->def.spp *= scene->view.split;
    }
    r->plan = rey_film_plan(sensor, channels);
    r->tiles = r->plan.columns * r->plan.rows;
    r->job = (PathJob){.scene = &scene->view, .sensor = def->sensor, .mode = mode, .border = r->plan.border,
                       .sobol = def->sampler != REY_SAMPLER_INDEPENDENT, .score = def->estimator == REY_ESTIMATOR_SCORE};
    return REY_OK;
}

// Brings the scene up to date and prepares what every mode needs.
rey_result rey_render_begin(Render *r, rey_scene *scene, const rey_render_def *def, int32_t mode, int32_t channels) {
    rey_result result = render_plan(r, scene, def, mode, channels);
    if (result == REY_OK) {
        result = rey_scene_update(scene);
    }
    if (result != REY_OK) {
        return result;
    }
    rey_context *ctx = scene->ctx;
    const SensorRecord *sensor = r->plan.sensor;
    r->backend = rey_backend_cpu(ctx->def.lanes);
    r->columns = rey_alloc_array(ctx, (size_t)sensor->crop_width, sizeof(double));
    r->rows = rey_alloc_array(ctx, (size_t)sensor->crop_height, sizeof(double));
    r->workspaces = rey_alloc_array(ctx, (size_t)ctx->def.threads, sizeof(void *));
    if (!r->columns || !r->rows || !r->workspaces) {
        return REY_ERROR_MEMORY;
    }
    rey_film_norms(&r->plan, r->columns, r->rows);
    size_t bytes = r->backend->workspace_bytes(mode), others = r->backend->boundary_bytes();
    bytes = mode == MODE_PRIMAL || bytes > others ? bytes : others;
    r->job.workspace_bytes = bytes + (size_t)(scene->view.groups_count + scene->view.media_count + 3) * sizeof(int32_t);
    for (int i = 0; i < ctx->def.threads && i < r->tiles; i++) {
        r->workspaces[i] = rey_alloc(ctx, r->job.workspace_bytes);
        if (!r->workspaces[i]) {
            return REY_ERROR_MEMORY;
        }
    }
    if (mode != MODE_REVERSE) {
        r->films = rey_alloc_array(ctx, (size_t)r->tiles * (size_t)r->plan.tile_floats, sizeof(double));
        return r->films ? REY_OK : REY_ERROR_MEMORY;
    }
    return REY_OK;
}

// Tells the caller how far it is; between tiles, and between chunks of tiles that take long.
static bool go_on(void *user) {
    Render *r = user;
    if (r->def.progress && pthread_mutex_trylock(&r->lock) == 0) {
        if (!r->cancelled && !r->def.progress(r->def.user, (r->part + r->done / r->total) / r->parts)) {
            r->cancelled = true;
        }
        pthread_mutex_unlock(&r->lock);
    }
    return !r->cancelled;
}

bool rey_render_run(Render *r, PathJob *job, UnitOfWork unit, int worker) {
    if (!go_on(r)) {
        return false;
    }
    job->workspace = r->workspaces[worker];
    job->go_on = go_on;
    job->user = r;
    job->paths = job->rays = job->nonfinite = job->borders = job->astray = 0;
    job->trace_seconds = 0;
    job->faces = 0;
    double start = rey_thread_seconds(), clock = rey_seconds();
    if (unit.particles) {
        r->backend->run_particles(unit.particles);
    } else if (unit.boundary) {
        r->backend->run_boundary(unit.boundary);
    } else {
        r->backend->run(job);
    }
    double seconds = rey_thread_seconds() - start, passed = rey_seconds() - clock;
    pthread_mutex_lock(&r->lock);
    r->stats.paths += job->paths;
    r->stats.rays += job->rays;
    r->stats.nonfinite += job->nonfinite;
    rey_terms_note(r, job, !unit.particles && !unit.boundary);
    r->stats.trace_seconds += passed > 0 ? job->trace_seconds * seconds / passed : 0; // what the thread worked of it
    r->stats.thread_seconds += seconds;
    r->done += 1;
    pthread_mutex_unlock(&r->lock);
    return !r->cancelled;
}

static bool run_tile(Render *r, PathJob *job, int32_t tile, int worker) {
    Tile t = rey_film_tile(&r->plan, tile);
    job->x = t.x;
    job->y = t.y;
    job->width = t.width;
    job->height = t.height;
    return rey_render_run(r, job, (UnitOfWork){NULL, NULL}, worker);
}

void rey_render_film_unit(void *argument, int64_t item, int worker) {
    Render *r = argument;
    PathJob job = r->job;
    job.film = r->films + item * r->plan.tile_floats;
    job.powers = r->powers ? r->powers + item * r->plan.tile_floats : NULL;
    job.coverage = r->coverage ? r->coverage + item * (r->plan.tile_floats / r->plan.channels * 2) : NULL;
    run_tile(r, &job, (int32_t)item, worker);
}

// A shard is every so many-th tile, run in order by one worker.
static void gradient_unit(void *argument, int64_t item, int worker) {
    Render *r = argument;
    PathJob job = r->job;
    job.gradient = r->gradients + item * r->gradient_size;
    for (int32_t tile = (int32_t)item; tile < r->tiles; tile += r->shards) {
        if (!run_tile(r, &job, tile, worker)) {
            return;
        }
    }
}

rey_result rey_render_end(Render *r, rey_result result, double start, rey_stats *stats) {
    if (result == REY_OK && r->cancelled) {
        result = rey_fail(r->scene->ctx, REY_ERROR_CANCELLED, "cancelled");
    }
    r->stats.seconds = rey_seconds() - start;
    if (stats) {
        *stats = r->stats;
    }
    render_free(r);
    return result;
}

// Adds the films of one pass to a picture of doubles.
static void collect_films(Render *r, int32_t spp, double *picture) {
    rey_film_merge(&r->plan, r->films, r->columns, r->rows, 1.0 / spp, picture);
}

static int64_t picture_floats(const Render *r) {
    return (int64_t)r->plan.sensor->crop_width * r->plan.sensor->crop_height * 3;
}

// ---- derivatives -------------------------------------------------------------------------------------------------

// Where the values of each texture, to_uv, shape's normals, mesh attribute and emitter's place begin in the compact vectors of the
// selection.
static rey_result map_selection(Render *r, rey_selection selection) {
    const SceneView *view = &r->scene->view;
    int64_t textures = view->textures_count, shapes = view->shapes_count, places = MAX_EMITTER_SLOTS * view->emitters_count;
    enum { PAD = 16 };
    int64_t n = 2 * textures + 3 * shapes + view->instances_count + rey_motion_cameras(r->plan.sensor) + view->attributes_count +
                places + view->volumes_count + view->groups_count + view->media_count + PAD;
    r->offsets = rey_alloc_array(r->scene->ctx, 2 * (size_t)n, sizeof *r->offsets);
    if (!r->offsets) {
        return REY_ERROR_MEMORY;
    }
    memset(r->offsets, 0xff, 2 * (size_t)n * sizeof *r->offsets);
    r->none = r->offsets + n;
    int32_t *texture_at = r->offsets, *to_uv_at = r->offsets + textures, *normals_at = r->offsets + 2 * textures;
    int32_t *attribute_at = normals_at + shapes, *place_at = attribute_at + view->attributes_count;
    r->job.points_at = place_at + places;
    r->job.pose_at = r->job.points_at + shapes;
    r->job.instance_at = r->job.pose_at + shapes;
    r->job.camera_at = r->job.instance_at + view->instances_count;
    r->job.volume_at = r->job.camera_at + rey_motion_cameras(r->plan.sensor);
    r->job.texture_at = texture_at, r->job.to_uv_at = to_uv_at, r->job.normals_at = normals_at;
    r->job.attribute_at = attribute_at, r->job.place_at = place_at;
    int64_t at = 0;
    for (int i = 0; i < selection.count; i++) {
        const Param *p = &ARRAY_AT(r->scene->params, Param, selection.params[i]);
        int32_t *slot = p->texture >= 0   ? &texture_at[p->texture]
                        : p->to_uv >= 0   ? &to_uv_at[p->to_uv]
                        : p->normals >= 0 ? &normals_at[p->normals]
                        : p->attribute >= 0 ? &attribute_at[p->attribute]
                        : p->emitter >= 0 ? &place_at[MAX_EMITTER_SLOTS * p->emitter + p->place]
                        : p->volume >= 0  ? (int32_t *)(uintptr_t)r->job.volume_at + p->volume
                                          : rey_motion_slot(r, p);
        if (slot && *slot >= 0) {
            return rey_fail(r->scene->ctx, REY_ERROR_ARGUMENT, "%s is selected twice", p->name);
        }
        if (slot) {
            *slot = (int32_t)at;
        }
        r->job.any_normals |= p->normals >= 0;
        r->job.any_attributes |= p->attribute >= 0;
        r->job.any_places |= p->emitter >= 0;
        r->job.any_volumes |= p->volume >= 0;
        // What turns mirrored and refracted rays moves what lies behind.
        const int terms = p->emitter < 0 ? p->terms & r->needed : 0;
        bool behind = (terms & REY_TERM_SPECULAR) && (p->to_uv < 0 || (terms & REY_TERM_TERMINATOR));
        r->job.any_motion |= behind || rey_facing_in_media(&r->scene->view, p);
        r->turns_rays |= behind && p->geometry < 0 && p->instance < 0;
        r->job.watch_turned |= (p->terms & REY_TERM_TERMINATOR) != 0;
        at += p->count;
        if (at > MOST_SELECTED) {
            return rey_fail(r->scene->ctx, REY_ERROR_UNSUPPORTED, "more than 2^30 numbers are selected");
        }
    }
    r->selection_size = at;
    rey_motion_settle(r);
    rey_motion_add_normals(r, &at);
    rey_dropped_add_sky(r, &at);
    r->gradient_size = at;
    return at <= INT32_MAX ? REY_OK : rey_fail(r->scene->ctx, REY_ERROR_UNSUPPORTED, "2^31 numbers or more follow the selection");
}

// Samples per pixel of one set; spp is rounded up to a multiple of the sets.
static int32_t set_spp(const Render *r) {
    int32_t split = r->scene->view.split ? r->scene->view.split : 1;
    return (r->def.spp / split + r->def.sets - 1) / r->def.sets * split;
}

static uint32_t set_scramble(const Render *r, int set, uint32_t term) {
    uint32_t number = r->def.sets == 1 ? r->def.set : r->def.set * 0x10001u + (uint32_t)set + 1;
    return rng_scramble(r->def.seed, number, (uint32_t)r->def.sensor, term);
}

static bool selection_given(rey_selection selection) {
    return selection.count == 0 || (selection.count > 0 && selection.params);
}

static rey_result derivative_begin(Render *r, rey_scene *scene, const rey_render_def *def, TermRequest request,
                                   rey_selection selection, int32_t mode) {
    rey_result result = (request.asked ? render_plan : rey_render_begin)(r, scene, def, mode, 3);
    r->request = request, r->job.moved = request.moved;
    const Integrator *first = scene->integrators.count ? &ARRAY_AT(scene->integrators, Integrator, 0) : NULL;
    if (result == REY_OK && (scene->view.colour_is_depth || (first && strcmp(first->name, "aov") == 0))) { // which holds none
        result = rey_fail(scene->ctx, REY_ERROR_UNSUPPORTED, "the integrator '%s' has no derivatives, 'path' has%s",
                          scene->integrator, scene->integrators.count > 1 ? ": of several, put one such first" : "");
    }
    if (result == REY_OK) {
        result = rey_terms_check(scene, def, selection, &r->needed);
    }
    if (result == REY_OK && rey_traces_particles(scene)) {
        result = rey_particles_begin(r, selection);
    }
    result = result == REY_OK ? map_selection(r, selection) : result;
    result = result == REY_OK ? rey_lights_ride(r) : result;
    if (result != REY_OK) {
        return result;
    }
    r->job.veils = scene->view.through && rey_boundary_veiled(&scene->view) && (r->needed & ~REY_TERM_INTERIOR);
    if (!request.asked) {
        rey_live_groups(&scene->view, &r->job, (int32_t *)(uintptr_t)r->job.volume_at + scene->view.volumes_count);
    }
    r->job.spp = set_spp(r);
    r->rims = rey_rims_move(scene, selection);
    r->facing = r->job.watch_turned && !rey_facing_gap(&scene->view, r->plan.sensor) && (!scene->view.has_media || r->job.rides);
    r->terms = (r->needed | REY_TERM_INTERIOR) & (def->terms ? def->terms : ~0);
    return rey_boundaries_begin(r);
}

rey_result rey_derivative_check(rey_scene *scene, const rey_render_def *def, rey_selection selection) {
    double start = rey_seconds();
    Render r;
    rey_result result = derivative_begin(&r, scene, def, (TermRequest){.asked = true}, selection, MODE_REVERSE);
    return rey_render_end(&r, result, start, NULL);
}

// The boundary terms of one set.
static void run_boundaries(Render *r, int set, double *picture) {
    for (int i = 0; i < BOUNDARY_KINDS; i++) {
        if (r->terms & rey_boundary_term(i)) {
            rey_boundary_run(r, r->boundary + i, set_scramble(r, set, 3 + (uint32_t)i), picture);
        }
        if ((r->terms & rey_boundary_term(i)) && (i + 1 == BOUNDARY_KINDS || rey_boundary_term(i + 1) != rey_boundary_term(i))) {
            rey_terms_book(r, set, rey_boundary_term(i), picture);
        }
    }
}

// The adjoint of the film's sums: of each pixel over samples and filter norm.
static rey_result prepare_adjoint(Render *r, const float *adjoint) {
    const SensorRecord *s = r->plan.sensor;
    r->adjoint = rey_alloc_array(r->scene->ctx, (size_t)picture_floats(r) + 1, sizeof(float));
    if (!r->adjoint) {
        return REY_ERROR_MEMORY;
    }
    for (int64_t i = 0; i < picture_floats(r); i++) {
        int64_t x = i / 3 % s->crop_width, y = i / 3 / s->crop_width;
        r->adjoint[i] = (float)(adjoint[i] / (r->columns[x] * r->rows[y] * set_spp(r)));
        if (!isfinite(r->adjoint[i])) {
            return rey_fail(r->scene->ctx, REY_ERROR_ARGUMENT, "the adjoint image is not finite at pixel %d, %d", (int)x, (int)y);
        }
    }
    r->job.adjoint = r->adjoint;
    return REY_OK;
}

// The tangent, continued behind the selection.
static rey_result prepare_tangent(Render *r, const float *tangent) {
    r->tangent = rey_alloc_array(r->scene->ctx, (size_t)r->gradient_size + 1, sizeof *r->tangent);
    if (!r->tangent) {
        return REY_ERROR_MEMORY;
    }
    for (int64_t i = 0; i < r->selection_size; i++) {
        r->tangent[i] = tangent[i];
        if (!isfinite(tangent[i])) {
            return rey_fail(r->scene->ctx, REY_ERROR_ARGUMENT, "the tangent is not finite at entry %lld", (long long)i);
        }
    }
    r->job.tangent = r->tangent;
    rey_dropped_tangent(r, r->tangent);
    return rey_motion_tangent(r, r->tangent);
}

rey_result rey_vjp_terms(rey_scene *scene, const rey_render_def *def, TermRequest request, rey_selection selection,
                         const float *adjoint, double *gradient, double *set_gradients, rey_stats *stats) {
    double start = rey_seconds();
    Render r;
    rey_result result = rey_begin(scene ? scene->ctx : NULL, adjoint && gradient && selection_given(selection));
    if (result != REY_OK) {
        return result;
    }
    result = derivative_begin(&r, scene, def, request, selection, MODE_REVERSE);
    if (result == REY_OK) {
        result = prepare_adjoint(&r, adjoint);
    }
    if (result == REY_OK) {
        result = rey_shards_begin(&r);
    }
    if (result == REY_OK) {
        memset(gradient, 0, (size_t)r.selection_size * sizeof *gradient); // which may take memory, too
        result = rey_shards_fit(&r);
    }
    if (result == REY_OK && request.values) {
        result = prepare_tangent(&r, request.direction);
    }
    if (result == REY_OK) {
        r.total = (r.tiles + (r.particles ? r.shards : 0.0)) * def->sets;
        for (int set = 0; set < def->sets && !r.cancelled && result == REY_OK; set++) {
            memset(r.gradients, 0, (size_t)r.gradient_size * (size_t)r.shards * sizeof *r.gradients);
            r.job.scramble = set_scramble(&r, set, def->sets > 1);
            if (r.terms & REY_TERM_INTERIOR) {
                rey_parallel_for(scene->ctx->def.threads, r.shards, gradient_unit, &r);
                result = r.particles ? rey_particles_run(&r, NULL) : REY_OK;
            }
            rey_terms_book(&r, set, REY_TERM_INTERIOR, NULL);
            run_boundaries(&r, set, NULL);
            result = result == REY_OK ? rey_shards_sum(&r) : result;
            for (int64_t i = 0; i < r.selection_size && result == REY_OK; i++) {
                gradient[i] += r.gradients[i] / def->sets;
                if (set_gradients) {
                    set_gradients[set * r.selection_size + i] = r.gradients[i];
                }
            }
            if (request.set_done && result == REY_OK) {
                request.set_done(request.user, set, r.gradients);
            }
        }
    }
    result = rey_terms_end(&r, result, selection);
    return rey_render_end(&r, result, start, stats);
}

rey_result rey_jvp_terms(rey_scene *scene, const rey_render_def *def, TermRequest request, rey_selection selection,
                         const float *tangent, float *derivative, double *set_values, rey_stats *stats) {
    double start = rey_seconds();
    Render r;
    double *pictures = NULL;
    rey_result result = rey_begin(scene ? scene->ctx : NULL, tangent && derivative && selection_given(selection));
    if (result != REY_OK) {
        return result;
    }
    result = derivative_begin(&r, scene, def, request, selection, MODE_FORWARD);
    int64_t n = 0;
    if (result == REY_OK) {
        n = picture_floats(&r);
        pictures = rey_alloc_array(scene->ctx, 2 * (size_t)n, sizeof *pictures);
        result = pictures ? prepare_tangent(&r, tangent) : REY_ERROR_MEMORY;
    }
    if (result == REY_OK) {
        double *sum = pictures, *one = pictures + n;
        r.total = (r.tiles + (r.particles ? (double)rey_particle_shards(&r) : 0)) * def->sets;
        for (int set = 0; set < def->sets && !r.cancelled && result == REY_OK; set++) {
            memset(one, 0, (size_t)n * sizeof *one);
            memset(r.films, 0, (size_t)r.tiles * (size_t)r.plan.tile_floats * sizeof *r.films);
            r.job.scramble = set_scramble(&r, set, def->sets > 1);
            if (r.terms & REY_TERM_INTERIOR) {
                rey_parallel_for(scene->ctx->def.threads, r.tiles, rey_render_film_unit, &r);
            }
            collect_films(&r, r.job.spp, one);
            result = r.particles && (r.terms & REY_TERM_INTERIOR) ? rey_particles_run(&r, one) : result;
            rey_terms_book(&r, set, REY_TERM_INTERIOR, one);
            run_boundaries(&r, set, one);
            double mean = 0;
            for (int64_t i = 0; i < n; i++) {
                sum[i] += one[i] / def->sets;
                mean += one[i] / (double)n;
            }
            if (set_values) {
                set_values[set] = mean;
            }
        }
        for (int64_t i = 0; i < n; i++) {
            derivative[i] = (float)sum[i];
        }
    }
    rey_free(scene->ctx, pictures);
    result = rey_terms_end(&r, result, selection);
    return rey_render_end(&r, result, start, stats);
}
