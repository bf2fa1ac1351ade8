// particles.c: the pass of light tracing: particles are cut into shards, each with a film of its own that covers the whole
// picture, and the films are added up in the order of the shards.
#include "base/parallel.h"
#include "math/rng.h"
#include "render/particles.h"
#include "render/render_parts.h"
#include "sensor/kinds.h"

#include <string.h>

// Shards of the particles: fixed, so that sums do not depend on the threads. Large pictures have fewer, for memory's sake.
enum { MOST_SHARDS = 8, FEWEST_SHARDS = 2, SHARD_PIXELS = 1 << 25 };

typedef struct Particles {
    Render *r;
    int64_t per_shard, total;
} Particles;

bool rey_traces_particles(const rey_scene *scene) {
    return scene->integrator && strcmp(scene->integrator, "ptracer") == 0;
}

static rey_result check_sensor(rey_scene *scene, const rey_render_def *def) {
    static const char *const names[] = {
#define SENSOR(ENUM, prefix, name) name,
#include "sensor/kinds.inl"
#undef SENSOR
        "batch"};
    int32_t kind = scene->view.sensors[def->sensor].kind;
    if (kind == SENSOR_PERSPECTIVE || kind == SENSOR_ORTHOGRAPHIC) {
        return REY_OK;
    }
    return rey_fail(scene->ctx, REY_ERROR_UNSUPPORTED,
                    "the integrator 'ptracer' connects light to the sensors 'perspective' and 'orthographic', not to '%s'",
                    names[kind]);
}

// One tile that covers the whole picture.
static void plan_whole(FilmPlan *plan) {
    plan->tile = plan->width > plan->height ? plan->width : plan->height;
    plan->columns = plan->rows = 1;
    plan->tile_floats = (int64_t)(plan->width + 2 * plan->border) * (plan->height + 2 * plan->border) * plan->channels;
}

static void particle_unit(void *argument, int64_t shard, int worker) {
    const Particles *particles = argument;
    Render *r = particles->r;
    ParticleJob p = {.job = r->job, .first = shard * particles->per_shard};
    int64_t left = particles->total - p.first;
    p.count = left < particles->per_shard ? left : particles->per_shard;
    p.job.x = r->plan.x;
    p.job.y = r->plan.y;
    p.job.width = r->plan.width;
    p.job.height = r->plan.height;
    p.job.film = r->films + shard * r->plan.tile_floats;
    if (p.count > 0) {
        rey_render_run(r, &p.job, &p, worker);
    }
}

// Adds the shards' films to the first.
static void sum_films(Render *r) {
    for (int32_t s = 1; s < r->shards; s++) {
        const double *film = r->films + s * r->plan.tile_floats;
        for (int64_t i = 0; i < r->plan.tile_floats; i++) {
            r->films[i] += film[i];
        }
    }
}

static rey_result run(Render *r, const rey_render_def *def, double *picture) {
    rey_context *ctx = r->scene->ctx;
    int64_t pixels = (int64_t)r->plan.width * r->plan.height;
    Particles particles = {r, 0, pixels * r->def.spp};
    plan_whole(&r->plan);
    r->shards = (int32_t)(SHARD_PIXELS / pixels);
    r->shards = r->shards > MOST_SHARDS ? MOST_SHARDS : r->shards < FEWEST_SHARDS ? FEWEST_SHARDS : r->shards;
    particles.per_shard = (particles.total + r->shards - 1) / r->shards;
    rey_free(ctx, r->films);
    r->films = rey_alloc_array(ctx, (size_t)r->shards * (size_t)r->plan.tile_floats, sizeof(double));
    for (int i = 0; i < ctx->def.threads && i < r->shards; i++) {
        r->workspaces[i] = r->workspaces[i] ? r->workspaces[i] : rey_alloc(ctx, r->job.workspace_bytes);
        if (!r->workspaces[i]) {
            return REY_ERROR_MEMORY;
        }
    }
    if (!r->films) {
        return REY_ERROR_MEMORY;
    }
    r->job.spp = r->def.spp;
    r->job.scramble = rng_scramble(def->seed, def->set, (uint32_t)def->sensor, 2);
    r->total = r->shards;
    if (r->scene->view.emitters_count > 0) {
        rey_parallel_for(ctx->def.threads, r->shards, particle_unit, &particles);
    }
    sum_films(r);
    rey_film_merge(&r->plan, r->films, r->columns, r->rows, 1.0 / (double)particles.total, picture);
    return REY_OK;
}

rey_result rey_render_particles(rey_scene *scene, const rey_render_def *def, int part, int parts, double *picture,
                                rey_stats *stats) {
    double start = rey_seconds();
    Render r;
    rey_result result = rey_render_begin(&r, scene, def, MODE_PRIMAL, 3);
    r.part = part;
    r.parts = parts;
    if (result == REY_OK) {
        result = check_sensor(scene, def);
    }
    if (result == REY_OK) {
        result = run(&r, def, picture);
    }
    return rey_render_end(&r, result, start, stats);
}
