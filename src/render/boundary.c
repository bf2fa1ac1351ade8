// boundary.c: the passes over the samples of boundary terms.
#include "render/boundary.h"

#include "base/parallel.h"
#include "emitter/emitter.h"
#include "render/boundary_edges.h"
#include "sensor/kinds.h"
#include "shape/shape.h"

#include <string.h>

enum { BOUNDARY_SHARDS = 8, LEAST_SAMPLES = 1024 };

static rey_result refuse(rey_scene *scene, int term, const char *what) {
    return rey_fail(scene->ctx, REY_ERROR_INCOMPLETE,
                    "the term '%s' does not know %s. --terms interior gives the part without", rey_term_name(term), what);
}

// Jumps of what the camera sees that no edge explains.
static bool has_steps(const SceneView *view) {
    for (int64_t i = 0; i < view->textures_count; i++) {
        const TextureNode *texture = view->textures + i;
        if (texture->kind == TEXTURE_CHECKERBOARD || (texture->kind == TEXTURE_ATTRIBUTE && texture->per_face) ||
            ((texture->kind == TEXTURE_BITMAP || texture->kind == TEXTURE_VOLUME) && texture->filter == FILTER_NEAREST)) {
            return true;
        }
    }
    return false;
}

rey_result rey_boundary_check(rey_scene *scene, const SensorRecord *sensor, int term) {
    const SceneView *view = &scene->view;
    if (sensor->kind != SENSOR_PERSPECTIVE && sensor->kind != SENSOR_THINLENS && sensor->kind != SENSOR_ORTHOGRAPHIC) {
        return refuse(scene, term, "sensors other than perspective, thinlens and orthographic");
    }
    if (term == REY_TERM_PRIMARY && has_steps(view)) {
        return refuse(scene, term, "the jumps of checkerboards, of textures with filter_type=\"nearest\" and of face "
                                   "attributes, and the scene has one of them");
    }
    for (int64_t i = 0; i < view->shapes_count; i++) {
        const ShapeRecord *shape = view->shapes + i;
        if (shape->kind == SHAPE_SDFGRID || shape->kind == SHAPE_BSPLINE || shape->kind == SHAPE_LINEAR) {
            return refuse(scene, term, "the outlines of curves and grids of distances, and the scene has one of them");
        }
        if (shape->collection >= 0 && shape->kind != SHAPE_MESH) {
            return refuse(scene, term, "the outlines of spheres, disks and cylinders in shapegroups, and the scene has one of them");
        }
    }
    for (int64_t i = 0; i < view->emitters_count; i++) {
        if (view->emitters[i].kind == EMITTER_DIRECTIONALAREA) {
            return refuse(scene, term, "the emitter 'directionalarea', and the scene has one of them");
        }
    }
    return REY_OK;
}

void rey_boundary_free(Render *r, BoundaryPlan *plan) {
    rey_context *ctx = r->scene->ctx;
    rey_free(ctx, plan->edges);
    rey_free(ctx, plan->cdf);
    rey_free(ctx, plan->films);
    *plan = (BoundaryPlan){.shards = 0};
}

static rey_result reserve_workspaces(Render *r) {
    for (int i = 0; i < r->scene->ctx->def.threads && i < BOUNDARY_SHARDS; i++) {
        r->workspaces[i] = r->workspaces[i] ? r->workspaces[i] : rey_alloc(r->scene->ctx, r->job.workspace_bytes);
        if (!r->workspaces[i]) {
            return REY_ERROR_MEMORY;
        }
    }
    return REY_OK;
}

rey_result rey_boundary_begin(Render *r, int term, BoundaryPlan *plan) {
    rey_context *ctx = r->scene->ctx;
    *plan = (BoundaryPlan){.film = r->plan};
    rey_film_plan_whole(&plan->film);
    rey_result result = reserve_workspaces(r);
    if (result == REY_OK) {
        result = rey_boundary_edges(r, term == REY_TERM_PRIMARY, plan);
    }
    if (result == REY_OK && r->job.mode == MODE_FORWARD) {
        plan->films = rey_alloc_array(ctx, (size_t)plan->film.tile_floats * BOUNDARY_SHARDS, sizeof(double));
        result = plan->films ? REY_OK : REY_ERROR_MEMORY;
    }
    int32_t edge_count = plan->job.edge_count;
    // A sample of the primary term is two paths, and on a large mesh a fiftieth as noisy as one of the interior.
    int32_t asked = term == REY_TERM_PRIMARY ? r->request.primary_spp : r->request.indirect_spp;
    plan->samples = (int64_t)r->plan.width * r->plan.height * (asked ? asked : r->job.spp) /
                    (asked ? r->def.sets : term == REY_TERM_PRIMARY ? 4 : 1);
    int64_t least = asked ? 1 : LEAST_SAMPLES;
    plan->samples = plan->samples < least ? least : plan->samples;
    plan->job = (BoundaryJob){.job = r->job, .primary = term == REY_TERM_PRIMARY, .edges = plan->edges,
                              .fans = r->fans.data, .cdf = plan->cdf,
                              .edge_count = edge_count,
                              .scale = (float)((double)r->job.spp / (double)plan->samples)};
    plan->job.job.x = r->plan.x;
    plan->job.job.y = r->plan.y;
    plan->job.job.width = r->plan.width;
    plan->job.job.height = r->plan.height;
    return result;
}

typedef struct BoundaryPass {
    Render *r;
    BoundaryPlan *plan;
} BoundaryPass;

static void boundary_unit(void *argument, int64_t shard, int worker) {
    const BoundaryPass *pass = argument;
    const BoundaryPlan *plan = pass->plan;
    BoundaryJob b = plan->job;
    b.job.adjoint = pass->r->job.adjoint;
    b.job.tangent = pass->r->job.tangent;
    // Of whole blocks of segments.
    int64_t per_shard = ((plan->samples + plan->shards - 1) / plan->shards + 15) / 16 * 16;
    b.first = shard * per_shard;
    b.count = plan->samples - b.first < per_shard ? plan->samples - b.first : per_shard;
    if (b.job.mode == MODE_REVERSE) {
        b.job.gradient = pass->r->gradients + shard * pass->r->gradient_size;
    } else {
        b.job.film = plan->films + shard * plan->film.tile_floats;
    }
    if (b.count > 0) {
        rey_render_run(pass->r, &b.job, (UnitOfWork){.boundary = &b}, worker);
    }
}

void rey_boundary_run(Render *r, BoundaryPlan *plan, uint32_t scramble, double *picture) {
    if (plan->job.edge_count == 0) {
        return;
    }
    BoundaryPass pass = {r, plan};
    plan->shards = plan->films ? BOUNDARY_SHARDS : r->shards;
    plan->job.job.scramble = scramble;
    if (plan->films) {
        memset(plan->films, 0, (size_t)plan->film.tile_floats * BOUNDARY_SHARDS * sizeof(double));
    }
    rey_parallel_for(r->scene->ctx->def.threads, plan->shards, boundary_unit, &pass);
    for (int32_t i = 0; i < plan->shards && plan->films; i++) {
        rey_film_merge(&plan->film, plan->films + i * plan->film.tile_floats, r->columns, r->rows,
                       1.0 / (double)plan->samples, picture);
    }
}
