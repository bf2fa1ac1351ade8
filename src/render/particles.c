// particles.c: the pass of light tracing: particles are cut into shards, each with a film of its own that covers the whole
// picture, or a gradient, and these are added up in the order of the shards.
#include "render/particles.h"

#include "base/parallel.h"
#include "bsdf/table.h"
#include "emitter/emitter.h"
#include "math/rng.h"
#include "render/blame.h"
#include "render/rims.h"
#include "sensor/kinds.h"

#include <string.h>

// Mixed into the scramble of the pass from the camera.
enum { PARTICLES = 2 };

// Shards of the particles: fixed, so that sums do not depend on the threads. Large pictures have fewer, for memory's sake.
enum { MOST_SHARDS = 8, FEWEST_SHARDS = 2, SHARD_PIXELS = 1 << 25 };

typedef struct Particles {
    Render *r;
    FilmPlan plan;
    uint32_t scramble;
    int64_t per_shard, total;
    double *films;
} Particles;

bool rey_traces_particles(const rey_scene *scene) {
    return scene->view.particles;
}

bool rey_particles_alone(const rey_scene *scene) {
    const SceneView *view = &scene->view;
    bool alone = view->particles && rey_bsdfs_used(view, rey_bsdf_bends);
    for (int64_t i = 0; i < view->emitters_count && view->particles && !alone; i++) {
        alone = view->emitters[i].kind == EMITTER_DIRECTIONALAREA;
    }
    return alone;
}

// Refuses sensors that see one direction only.
static rey_result check_one(rey_context *ctx, const SensorRecord *s) {
    static const char *const names[] = {
#define SENSOR(ENUM, prefix, name) name,
#include "sensor/kinds.inl"
#undef SENSOR
    };
    if (s->kind != SENSOR_RADIANCEMETER && s->kind != SENSOR_DISTANT) {
        return REY_OK;
    }
    return rey_fail(ctx, REY_ERROR_UNSUPPORTED,
                    "the integrator 'ptracer' connects light to points of a sensor, and no light meets the one direction "
                    "of '%s'",
                    names[s->kind]);
}

static rey_result check_sensor(rey_scene *scene, const rey_render_def *def) {
    const SensorRecord *s = scene->view.sensors + def->sensor;
    rey_result result = REY_OK;
    for (int32_t i = 0; i < s->batch_count && s->kind == SENSOR_BATCH && result == REY_OK; i++) {
        result = check_one(scene->ctx, scene->view.batch_sensors + s->batch + i);
    }
    return result == REY_OK && s->kind != SENSOR_BATCH ? check_one(scene->ctx, s) : result;
}

static void particle_unit(void *argument, int64_t shard, int worker) {
    const Particles *particles = argument;
    Render *r = particles->r;
    ParticleJob p = {.job = r->job, .first = shard * particles->per_shard};
    int64_t left = particles->total - p.first;
    p.count = left < particles->per_shard ? left : particles->per_shard;
    p.share = 1.0 / ((double)particles->plan.width * particles->plan.height);
    p.job.scene = &r->scene->view;
    p.job.x = particles->plan.x;
    p.job.y = particles->plan.y;
    p.job.width = particles->plan.width;
    p.job.height = particles->plan.height;
    p.job.scramble = particles->scramble;
    p.job.film = particles->films ? particles->films + shard * particles->plan.tile_floats : NULL;
    p.job.gradient = r->gradients ? r->gradients + shard * r->gradient_size : NULL;
    if (p.count > 0) {
        rey_render_run(r, &p.job, (UnitOfWork){.particles = &p}, worker);
    }
}

// Adds the shards' films to the first.
static void sum_films(const Particles *p, int32_t shards) {
    for (int32_t s = 1; s < shards; s++) {
        const double *film = p->films + s * p->plan.tile_floats;
        for (int64_t i = 0; i < p->plan.tile_floats; i++) {
            p->films[i] += film[i];
        }
    }
}

static bool have_workspaces(Render *r, int32_t shards) {
    rey_context *ctx = r->scene->ctx;
    for (int i = 0; i < ctx->def.threads && i < shards; i++) {
        r->workspaces[i] = r->workspaces[i] ? r->workspaces[i] : rey_alloc(ctx, r->job.workspace_bytes);
        if (!r->workspaces[i]) {
            return false;
        }
    }
    return true;
}

int32_t rey_particle_shards(const Render *r) {
    int64_t shards = SHARD_PIXELS / ((int64_t)r->plan.width * r->plan.height);
    return shards > MOST_SHARDS ? MOST_SHARDS : shards < FEWEST_SHARDS ? FEWEST_SHARDS : (int32_t)shards;
}

rey_result rey_particles_run(Render *r, double *picture) {
    rey_context *ctx = r->scene->ctx;
    Particles particles = {.r = r, .plan = r->plan, .scramble = rng_mix(r->job.scramble, PARTICLES)};
    int32_t shards = r->gradients ? r->shards : rey_particle_shards(r);
    rey_film_plan_whole(&particles.plan);
    particles.total = (int64_t)r->plan.width * r->plan.height * r->job.spp;
    particles.per_shard = (particles.total + shards - 1) / shards;
    if (!have_workspaces(r, shards)) {
        return REY_ERROR_MEMORY;
    }
    if (picture) {
        particles.films = rey_alloc_array(ctx, (size_t)shards * (size_t)particles.plan.tile_floats, sizeof(double));
        if (!particles.films) {
            return REY_ERROR_MEMORY;
        }
    }
    if (r->scene->view.emitters_count > 0) {
        rey_parallel_for(ctx->def.threads, shards, particle_unit, &particles);
    }
    if (picture) {
        sum_films(&particles, shards);
        rey_film_merge(&particles.plan, particles.films, r->columns, r->rows, 1.0 / (double)particles.total, picture);
        rey_free(ctx, particles.films);
    }
    return REY_OK;
}

// A parameter of a selection that moves the places that particles are connected through, or what jumps there; null: none does.
// jumps: where shading normals turn away counts, too.
static const Param *moving(const rey_scene *scene, rey_selection selection, bool jumps) {
    for (int i = 0; i < selection.count; i++) {
        const Param *p = &ARRAY_AT(scene->params, Param, selection.params[i]);
        const bool stays = p->texture >= 0 || p->to_uv >= 0 || p->attribute >= 0 || p->normals >= 0;
        const bool turns = jumps && (p->normals >= 0 || (p->terms & REY_TERM_TERMINATOR));
        const bool crosses = p->to_uv >= 0 && (p->terms & REY_TERM_PRIMARY);
        if (!stays || turns || crosses || rey_rims_moved_by(scene, p)) {
            return p;
        }
    }
    return NULL;
}

rey_result rey_particles_begin(Render *r, rey_selection selection) {
    rey_scene *scene = r->scene;
    int32_t depth = scene->view.max_depth;
    rey_result result = check_sensor(scene, &r->def);
    const Param *p = moving(scene, selection, r->def.terms != REY_TERM_INTERIOR);
    if (result == REY_OK && p && rey_particles_alone(scene)) {
        result = rey_fail(scene->ctx, REY_ERROR_INCOMPLETE,
                          "the gradient of %s needs how places move that light tracing reaches, or how normals turn away there, "
                          "which is known where paths from the sensor find the same light: not beside smooth mirrors and glass, "
                          "masks and 'directionalarea'. 'path' has it", p->name);
    }
    if (!p && (depth < 0 || depth > 1)) {
        r->particles = true;
        r->lights = scene->view;
        r->lights.max_depth = 1;
        r->job.scene = &r->lights;
    }
    return result;
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
        r.total = rey_particle_shards(&r);
        r.job.spp = r.def.spp;
        r.job.scramble = rng_scramble(def->seed, def->set, (uint32_t)def->sensor, 0);
        result = rey_particles_run(&r, picture);
    }
    return rey_render_end(&r, result, start, stats);
}
