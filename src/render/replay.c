// replay.c: pictures and derivatives along the paths of another scene.
#include "render/replay.h"

#include "base/parallel.h"
#include "math/rng.h"
#include "render/particles.h"
#include "render/render_parts.h"
#include "render/rims.h"
#include "render/update.h"

#include <string.h>

bool rey_can_replay(const rey_scene *scene, int param) {
    const Param *p = &ARRAY_AT(scene->params, Param, param);
    const bool material = p->terms == REY_TERM_INTERIOR && (p->texture >= 0 || p->to_uv >= 0 || p->attribute >= 0);
    return material && !rey_rims_moved_by(scene, p);
}

void rey_replay_make_room(rey_scene *scene, float room) {
    scene->headroom = room;
    memset(scene->dirty_media, 1, (size_t)scene->view.media_count);
    scene->dirty = true;
}

// One tile, with sums of weights of its own.
typedef struct Weighing {
    Render *render;
    double *sums; // WEIGHTS per tile; null = none
} Weighing;

static void replay_unit(void *argument, int64_t item, int worker) {
    const Weighing *w = argument;
    Render *r = w->render;
    Tile tile = rey_film_tile(&r->plan, (int32_t)item);
    PathJob job = r->job;
    job.film = r->films + item * r->plan.tile_floats;
    job.weights = w->sums ? w->sums + item * WEIGHTS : NULL;
    job.x = tile.x;
    job.y = tile.y;
    job.width = tile.width;
    job.height = tile.height;
    rey_render_run(r, &job, (UnitOfWork){NULL, NULL}, worker);
}

static void add_weights(const Weighing *w, ReplayWeights *weights) {
    for (int32_t i = 0; i < w->render->tiles; i++) {
        const double *sums = w->sums + (int64_t)i * WEIGHTS;
        weights->then += sums[WEIGHT_THEN];
        weights->now += sums[WEIGHT_NOW];
        weights->square += sums[WEIGHT_SQUARE];
        weights->all += sums[WEIGHT_ALL];
        weights->within += sums[WEIGHT_WITHIN];
    }
}

rey_result rey_replay_weighed(rey_scene *scene, rey_scene *moved, const rey_render_def *def, double within, float *image,
                              ReplayWeights *weights, rey_stats *stats) {
    double start = rey_seconds(), *picture = NULL;
    int64_t numbers = 0;
    Render r;
    Weighing w = {&r, NULL};
    rey_result result = rey_scene_update(moved);
    if (result != REY_OK) {
        return result;
    }
    result = rey_render_begin(&r, scene, def, MODE_REPLAY, 3);
    if (result == REY_OK && rey_traces_particles(scene)) {
        result = rey_particles_begin(&r, (rey_selection){NULL, 0});
    }
    if (result == REY_OK) {
        numbers = (int64_t)r.plan.sensor->crop_width * r.plan.sensor->crop_height * 3;
        picture = rey_alloc_array(scene->ctx, (size_t)numbers, sizeof *picture);
        w.sums = weights ? rey_alloc_array(scene->ctx, (size_t)r.tiles * WEIGHTS, sizeof *w.sums) : NULL;
        result = picture && (w.sums || !weights) ? REY_OK : REY_ERROR_MEMORY;
    }
    if (result == REY_OK) {
        r.job.moved = &moved->view;
        r.job.within = within;
        r.job.spp = r.def.spp;
        r.job.scramble = rng_scramble(def->seed, def->set, (uint32_t)def->sensor, 0);
        r.total = r.tiles + (r.particles ? rey_particle_shards(&r) : 0);
        rey_parallel_for(scene->ctx->def.threads, r.tiles, replay_unit, &w);
        rey_film_merge(&r.plan, r.films, r.columns, r.rows, 1.0 / r.def.spp, picture);
        if (w.sums) {
            add_weights(&w, weights);
        }
        if (r.particles) {
            result = rey_particles_run(&r, picture);
        }
        for (int64_t i = 0; i < numbers; i++) {
            image[i] = (float)picture[i];
        }
    }
    rey_free(scene->ctx, picture);
    rey_free(scene->ctx, w.sums);
    return rey_render_end(&r, result, start, stats);
}

rey_result rey_replay(rey_scene *scene, rey_scene *moved, const rey_render_def *def, float *image, rey_stats *stats) {
    return rey_replay_weighed(scene, moved, def, 1, image, NULL, stats);
}

rey_result rey_replay_vjp(rey_scene *scene, rey_scene *moved, const rey_render_def *def, rey_selection selection,
                          const float *adjoint, double *gradient, rey_stats *stats) {
    rey_result result = rey_scene_update(moved);
    TermRequest request = {.moved = &moved->view};
    if (result == REY_OK) { // an extinction may have become 0 there
        result = rey_derivative_check(moved, def, selection);
    }
    return result ? result : rey_vjp_terms(scene, def, request, selection, adjoint, gradient, NULL, stats);
}
