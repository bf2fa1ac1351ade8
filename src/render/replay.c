// replay.c: pictures along the paths of another scene.
#include "render/replay.h"

#include "base/parallel.h"
#include "math/rng.h"
#include "render/particles.h"
#include "render/render_parts.h"
#include "render/update.h"

bool rey_can_replay(const rey_scene *scene, int param) {
    const Param *p = &ARRAY_AT(scene->params, Param, param);
    return p->terms == REY_TERM_INTERIOR && (p->texture >= 0 || p->to_uv >= 0 || p->attribute >= 0);
}

rey_result rey_replay(rey_scene *scene, rey_scene *moved, const rey_render_def *def, float *image, rey_stats *stats) {
    double start = rey_seconds(), *picture = NULL;
    int64_t numbers = 0;
    Render r;
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
        result = picture ? REY_OK : REY_ERROR_MEMORY;
    }
    if (result == REY_OK) {
        r.job.moved = &moved->view;
        r.job.spp = r.def.spp;
        r.job.scramble = rng_scramble(def->seed, def->set, (uint32_t)def->sensor, 0);
        r.total = r.tiles + (r.particles ? rey_particle_shards(&r) : 0);
        rey_parallel_for(scene->ctx->def.threads, r.tiles, rey_render_film_unit, &r);
        rey_film_merge(&r.plan, r.films, r.columns, r.rows, 1.0 / r.def.spp, picture);
        if (r.particles) {
            result = rey_particles_run(&r, picture);
        }
        for (int64_t i = 0; i < numbers; i++) {
            image[i] = (float)picture[i];
        }
    }
    rey_free(scene->ctx, picture);
    return rey_render_end(&r, result, start, stats);
}
