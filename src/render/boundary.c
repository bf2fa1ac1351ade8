// boundary.c: the passes over the samples of boundary terms.
#include "render/boundary.h"

#include "base/parallel.h"
#include "bsdf/table.h"
#include "emitter/emitter.h"
#include "emitter/table.h"
#include "render/beacons.h"
#include "render/blame.h"
#include "render/boundary_edges.h"
#include "render/corners.h"
#include "render/light_borders.h"
#include "render/terms.h"
#include "render/texture_steps.h"
#include "scene/sink.h"
#include "sensor/kinds.h"
#include "shape/cut.h"
#include "shape/shape.h"
#include "shape/twins.h"

#include <stdio.h>
#include <string.h>

enum { BOUNDARY_SHARDS = 8, LEAST_SAMPLES = 1024 };

// object: the one of the scene that it is about, null = none.
static rey_result refuse(rey_scene *scene, int term, const char *what, const char *object) {
    return rey_fail(scene->ctx, REY_ERROR_INCOMPLETE,
                    "the term '%s' does not know %s%s%s%s. --terms interior gives the rest", rey_term_name(term), what,
                    object ? " ('" : "", object ? object : "", object ? "')" : "");
}

bool rey_boundary_sees(const SensorRecord *sensor) {
    return sensor->kind == SENSOR_PERSPECTIVE || sensor->kind == SENSOR_THINLENS || sensor->kind == SENSOR_ORTHOGRAPHIC;
}

int rey_boundary_term(int32_t kind) {
    switch (kind) {
    case BOUNDARY_PRIMARY:
    case BOUNDARY_RIM_VIEW:
        return REY_TERM_PRIMARY;
    case BOUNDARY_CHAINED:
    case BOUNDARY_MIRRORED:
    case BOUNDARY_CHAINED_TERMINATOR:
    case BOUNDARY_CHAINED_HORIZON:
    case BOUNDARY_CHAINED_RIM:
        return REY_TERM_SPECULAR;
    case BOUNDARY_FACING:
    case BOUNDARY_FACING_VIEW:
    case BOUNDARY_CHAINED_FACING:
    case BOUNDARY_RIDING_FACING:
        return REY_TERM_TERMINATOR;
    default:
        return REY_TERM_INDIRECT;
    }
}

bool rey_boundary_chained(const SceneView *view) {
    return view->has_media ? rey_bsdfs_used(view, rey_bsdf_mirrors) || rey_boundary_veiled(view)
                           : rey_bsdfs_used(view, rey_bsdf_bends);
}

bool rey_boundary_veiled(const SceneView *view) {
    for (int64_t i = 0; i < view->shapes_count; i++) {
        bool passes = view->has_media && rey_bsdf_passes(view->bsdfs[view->shapes[i].bsdf].kind);
        if (!passes && rey_bsdf_holds(view, view->shapes[i].bsdf, rey_bsdf_opens)) {
            return true;
        }
    }
    return false;
}

ChainObstacle rey_chains_obstacle(const SceneView *view, const SensorRecord *sensor) {
    int32_t texture = -1;
    const char *step = rey_texture_unknown_step(view, REY_TERM_SPECULAR, &texture);
    const char *what = !rey_boundary_sees(sensor)    ? "this sensor"
                       : step                        ? step
                       : !rey_boundary_chained(view) ? "functions that let light pass"
                                                     : NULL;
    if (what) {
        return (ChainObstacle){what, -1, -1, what == step ? texture : -1};
    }
    for (int32_t i = 0; i < (int32_t)view->bsdfs_count; i++) {
        const BsdfNode *node = view->bsdfs + i;
        bool mirror = rey_bsdf_turns(node->kind) && (rey_bsdf_holds(view, i, rey_bsdf_bends) || rey_bsdf_cuts(node));
        if (node->used && mirror) {
            return (ChainObstacle){"the normals of", -1, i, -1};
        }
    }
    return (ChainObstacle){NULL, -1, -1, -1};
}

bool rey_chains_known(const SceneView *view, const SensorRecord *sensor) {
    return !rey_chains_obstacle(view, sensor).what;
}

// Whether lines of textures that a selection moves over their surfaces are known.
static rey_result check_lines(const Render *r, int term) {
    int32_t bsdf, emitter, shape;
    char name[OBJECT_NAME] = "";
    const char *unknown = rey_lines_unknown(&r->scene->view, r->job.to_uv_at, &bsdf, &emitter, &shape);
    if (bsdf >= 0) {
        rey_name_bsdf(r->scene, bsdf, name);
    } else if (emitter >= 0) {
        rey_name_emitter(r->scene, emitter, name);
    } else if (shape >= 0) {
        rey_name_shape(r->scene, shape, name);
    }
    return unknown ? refuse(r->scene, term, unknown, name) : REY_OK;
}

// What `direct` leaves out where one of its numbers of samples is 0, null where that is nothing.
static const char *left_out(const SceneView *view, int term) {
    if (!view->split || term == REY_TERM_PRIMARY) {
        return NULL;
    }
    for (int64_t i = 0; i < view->emitters_count && view->light_samples == 0; i++) {
        if (rey_emitter_kinds[view->emitters[i].kind].form == EMITTER_IS_DELTA) {
            return "that 'direct' without emitter_samples never meets lights at a point or with one direction";
        }
    }
    return view->scatter_samples == 0 && rey_boundary_chained(view)
               ? "that 'direct' without bsdf_samples sees nothing in mirrors and glass"
               : NULL;
}

bool rey_boundary_hides(const SceneView *view, const ShapeRecord *shape) {
    bool passes = view->has_media && rey_bsdf_passes(view->bsdfs[shape->bsdf].kind);
    return !passes && !(shape->flags & SHAPE_UNSEEN);
}

// Of two surfaces in the same place neither is in front: outlines would be counted twice.
static rey_result check_twins(rey_scene *scene, int term) {
    Twin twins[2];
    rey_result result = rey_twins_find(scene, rey_boundary_hides, twins);
    if (result != REY_OK || (twins[0].shape < 0 && twins[0].instance < 0)) {
        return result;
    }
    char text[2 * OBJECT_NAME + 128], names[2][OBJECT_NAME];
    for (int k = 0; k < 2; k++) {
        if (twins[k].shape >= 0) {
            rey_name_shape(scene, twins[k].shape, names[k]);
        } else {
            rey_name_instance(scene, twins[k].instance, names[k]);
        }
    }
    snprintf(text, sizeof text, "surfaces that lie in the same place, as '%s' and '%s' do: one of them would have to go", names[0],
             names[1]);
    return refuse(scene, term, text, NULL);
}

// Whether a term of a selection can be computed; records why not.
static rey_result boundary_check(const Render *r, int term) {
    rey_scene *scene = r->scene;
    const SceneView *view = &scene->view;
    const SensorRecord *sensor = r->plan.sensor;
    char name[OBJECT_NAME];
    if (!rey_boundary_sees(sensor)) {
        return refuse(scene, term, "sensors other than perspective, thinlens and orthographic", NULL);
    }
    const char *lacks = left_out(view, term);
    if (lacks) {
        return refuse(scene, term, lacks, NULL);
    }
    rey_result result = r->lines ? check_lines(r, term) : REY_OK;
    if (result != REY_OK || !(r->job.any_motion || r->job.any_places)) {
        return result;
    }
    int32_t jumps;
    const char *unknown = rey_texture_unknown_step(view, term, &jumps);
    if (unknown) {
        rey_name_texture(scene, jumps, name);
        return refuse(scene, term, unknown, name);
    }
    for (int64_t i = 0; i < view->shapes_count; i++) {
        const ShapeRecord *shape = view->shapes + i;
        bool hides = rey_boundary_hides(view, shape);
        if (hides && (shape->kind == SHAPE_SDFGRID || shape->kind == SHAPE_LINEAR)) {
            rey_name_shape(scene, (int32_t)i, name);
            return refuse(scene, term, "the outlines of polylines and grids of distances", name);
        }
        if (hides && shape->kind == SHAPE_BSPLINE && rey_tube_folds(view, (int32_t)i)) {
            rey_name_shape(scene, (int32_t)i, name);
            return refuse(scene, term, "the outlines of curves that bend more sharply than their radius, and so through themselves",
                          name);
        }
    }
    for (int64_t i = 0; i < view->emitters_count; i++) {
        bool steep = rey_light_is_steep(view, view->emitters + i), moves = r->job.any_motion;
        bool lost = !r->def.terms && !(r->terms & REY_TERM_PRIMARY); // it became abrupt
        bool hard = lost && rey_light_is_abrupt(view, view->emitters + i);
        for (int k = 0; k < MAX_EMITTER_SLOTS; k++) {
            moves |= r->job.place_at[MAX_EMITTER_SLOTS * i + k] >= 0;
        }
        if (moves && (steep || hard)) {
            rey_name_emitter(scene, (int32_t)i, name);
            return refuse(scene, term,
                          hard ? "here the border of the light of spots whose beam_width is their cutoff_angle"
                               : "the border of the light of spots whose beam_width is all but their cutoff_angle",
                          name);
        }
    }
    return REY_OK;
}

void rey_boundaries_free(Render *r) {
    rey_context *ctx = r->scene->ctx;
    for (int i = 0; i < BOUNDARY_KINDS; i++) {
        BoundaryPlan *plan = r->boundary + i;
        rey_free(ctx, plan->edges);
        rey_free(ctx, plan->cdf);
        rey_free(ctx, plan->films);
        rey_array_free(ctx, &plan->steps);
        rey_array_free(ctx, &plan->step_at);
        rey_array_free(ctx, &plan->beams);
    }
    rey_array_free(ctx, &r->edges);
    rey_array_free(ctx, &r->fans);
    rey_array_free(ctx, &r->sides);
    rey_array_free(ctx, &r->meetings);
    rey_array_free(ctx, &r->marks);
    rey_array_free(ctx, &r->corners);
    rey_free(ctx, r->corner_at);
    rey_array_free(ctx, &r->pane_records);
    rey_array_free(ctx, &r->pane_of);
    rey_free(ctx, r->pane_at);
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

// Samples of one set. By default, for one of the interior's: a sample of the primary term is two paths, and on a large mesh a
// fiftieth as noisy; what happens where normals turn away is smaller than what happens at silhouettes.
static int64_t sample_count(const Render *r, int32_t kind) {
    static const int64_t share[BOUNDARY_KINDS] = {[BOUNDARY_PRIMARY] = 4, [BOUNDARY_INDIRECT] = 1,
                                                  [BOUNDARY_TERMINATOR] = 4, [BOUNDARY_HORIZON] = 4, [BOUNDARY_MEETING] = 4,
                                                  [BOUNDARY_CHAINED] = 1, [BOUNDARY_MIRRORED] = 1, [BOUNDARY_CUT] = 1,
                                                  [BOUNDARY_LINES] = 1, [BOUNDARY_RIDING] = 1, [BOUNDARY_CHAINED_TERMINATOR] = 4,
                                                  [BOUNDARY_CHAINED_HORIZON] = 4, [BOUNDARY_RIDING_TERMINATOR] = 4,
                                                  [BOUNDARY_RIDING_HORIZON] = 4, [BOUNDARY_RIM] = 1, [BOUNDARY_RIM_VIEW] = 1,
                                                  [BOUNDARY_CHAINED_RIM] = 1, [BOUNDARY_FACING] = 4,
                                                  [BOUNDARY_FACING_VIEW] = 1, [BOUNDARY_CHAINED_FACING] = 4,
                                                  [BOUNDARY_RIDING_FACING] = 4, [BOUNDARY_RIDING_RIM] = 1};
    int32_t asked = rey_boundary_term(kind) == REY_TERM_PRIMARY ? r->request.primary_spp : r->request.indirect_spp;
    int64_t pixels = (int64_t)r->plan.width * r->plan.height, least = asked ? 1 : LEAST_SAMPLES;
    int64_t part = kind == BOUNDARY_PRIMARY && asked ? 1 : share[kind];
    int64_t count = asked ? pixels * asked / (part * r->def.sets) : pixels * r->job.spp / part;
    return count < least ? least : count;
}

// What is seen along chains of lines on the ends of their surfaces is taken for the surfaces' edges.
static rey_result check_halves(const Render *r) {
    for (size_t i = 0; i < r->marks.count; i++) {
        if (ARRAY_AT(r->marks, MarkRecord, i).half) {
            return refuse(r->scene, REY_TERM_SPECULAR,
                          "lines along which textures jump that lie on edges of their surfaces, where to_uv moves them off these. "
                          "Beside the edges they are known",
                          NULL);
        }
    }
    return REY_OK;
}

// Whether the selection moves a light that ends abruptly.
static bool beams_move(const Render *r, const BoundaryPlan *plan) {
    bool moves = false;
    for (size_t i = 0; i < plan->beams.count; i++) {
        moves |= rey_light_moves(r, ARRAY_AT(plan->beams, BeamRecord, i).light);
    }
    return moves;
}

static rey_result boundary_begin(Render *r, int32_t kind, BoundaryPlan *plan) {
    rey_context *ctx = r->scene->ctx;
    *plan = (BoundaryPlan){.film = r->plan};
    rey_film_plan_whole(&plan->film);
    rey_result result = reserve_workspaces(r);
    if (result == REY_OK && kind == BOUNDARY_MIRRORED) { // it looks for edges where they are seen
        result = rey_texture_step_records(r->scene, r->job.to_uv_at, &plan->steps, &plan->step_at);
        result = result == REY_OK ? rey_beam_records(r->scene, &plan->steps, &plan->beams) : result;
        result = result == REY_OK ? check_halves(r) : result;
    } else if (result == REY_OK && !boundary_is_rim(kind) && kind != BOUNDARY_FACING_VIEW) {
        result = rey_boundary_edges(r, kind, plan);
    }
    if (result == REY_OK && r->job.mode == MODE_FORWARD) {
        plan->films = rey_alloc_array(ctx, (size_t)plan->film.tile_floats * BOUNDARY_SHARDS, sizeof(double));
        result = plan->films ? REY_OK : REY_ERROR_MEMORY;
    }
    // In media only edges are known; what else there is does not depend on lights, and is refused where surfaces move.
    bool rides = r->job.rides, known = kind == BOUNDARY_INDIRECT || !r->scene->view.has_media;
    bool chains = rey_chains_known(&r->scene->view, r->plan.sensor);
    known |= rides && (kind == BOUNDARY_PRIMARY || kind == BOUNDARY_TERMINATOR || kind == BOUNDARY_HORIZON);
    known |= rides && (kind == BOUNDARY_MEETING || kind == BOUNDARY_FACING);
    int32_t edge_count = (boundary_is_riding(kind) ? rides : known) ? plan->job.edge_count : 0;
    if (kind == BOUNDARY_MIRRORED) {
        edge_count = (r->job.any_motion || r->lines || (!r->scene->view.has_media && beams_move(r, plan))) && chains;
    }
    edge_count = kind == BOUNDARY_FACING_VIEW ? 1 : edge_count;
    edge_count = kind == BOUNDARY_CHAINED_FACING && !rey_boundary_chained(&r->scene->view) ? 0 : edge_count;
    const int32_t depth = r->scene->view.max_depth;
    if (boundary_is_rim(kind)) { // `direct` without emitter_samples meets no such lights
        bool lit = !r->scene->view.split || r->scene->view.light_samples > 0, deep = depth < 0 || depth > 2;
        bool media = r->scene->view.has_media, ways = rides || rey_boundary_chained(&r->scene->view);
        bool apart = ways && (r->job.any_motion || r->job.any_places); // what keeps its direction is seen by a kind of its own
        bool mine = kind == BOUNDARY_CHAINED_RIM ? apart && !media : kind != BOUNDARY_RIDING_RIM || (apart && media);
        edge_count = lit && mine && (deep || kind == BOUNDARY_RIM_VIEW);
    }
    const bool passes = kind == BOUNDARY_MIRRORED && r->job.veils; // what the sensor meets may be behind them
    if (kind != BOUNDARY_PRIMARY && !passes && depth >= 0 && depth < 2) { // paths end where the sensor meets a surface
        edge_count = 0;
    }
    plan->samples = sample_count(r, kind);
    plan->job = (BoundaryJob){.job = r->job, .kind = kind, .edges = plan->edges,
                              .fans = r->fans.data, .sides = r->sides.data, .meetings = r->meetings.data,
                              .marks = r->marks.data, .cdf = plan->cdf,
                              .steps = plan->steps.data, .step_at = plan->step_at.data,
                              .beams = plan->beams.data, .beam_count = (int32_t)plan->beams.count,
                              .edge_count = edge_count, .round = plan->job.round, .none = r->none,
                              .everywhere = r->turns_rays || r->lines || beams_move(r, plan), .lines = r->lines,
                              .chains = boundary_is_rim(kind) ? rey_boundary_chained(&r->scene->view) : chains,
                              .scale = (float)((double)r->job.spp / (double)plan->samples)};
    plan->job.job.x = r->plan.x;
    plan->job.job.y = r->plan.y;
    plan->job.job.width = r->plan.width;
    plan->job.job.height = r->plan.height;
    return result;
}

// Where the boundary terms are not computed, paths look out for shading normals that turn away. Indices of refraction, and lights
// that collisions ride with, move nothing that the sensor sees itself.
static void watch_smooth_normals(Render *r, bool look_out) {
    const SceneView *view = &r->scene->view;
    const int both = (r->needed & REY_TERM_PRIMARY) | REY_TERM_INDIRECT;
    bool whole = (r->terms & both) == both || (!r->def.terms && (r->terms & REY_TERM_SPECULAR));
    r->job.watch_smooth = (r->job.any_normals || r->job.any_motion) && (look_out || !whole);
    for (int64_t i = 0; i < view->shapes_count && r->job.watch_smooth; i++) {
        if (r->job.normals_at[i] >= 0 && view->shapes[i].emitter >= 0) {
            // A light's normals say into which directions it shines: light samples jump where none of its points is met.
            r->faces = FACES_ALIKE | FACES_AWAY;
        }
    }
}

bool rey_turning_known(const SceneView *view, const SensorRecord *sensor) {
    const bool known = !view->has_media || !rey_rides_gap(view);
    return known && !rey_boundary_chained(view) && rey_boundary_sees(sensor) && !view->drops;
}

rey_result rey_boundaries_begin(Render *r) {
    r->lines = rey_lines_selected(&r->scene->view, r->job.to_uv_at);
    bool moves = r->job.any_motion || r->job.any_places || r->lines;
    rey_result result = rey_check_clipped_media(r);
    result = result == REY_OK ? rey_beacons_begin(r) : result;
    bool look_out = !moves && !r->def.terms && !rey_turning_known(&r->scene->view, r->plan.sensor); // paths do, instead
    if (look_out && !r->rims) {
        r->terms &= REY_TERM_INTERIOR | REY_TERM_TERMINATOR;
    }
    bool twins_sought = !(r->job.any_motion || r->job.any_places);
    for (int i = 0; i < BOUNDARY_KINDS && result == REY_OK; i++) {
        bool facing = boundary_is_facing(i) || i == BOUNDARY_FACING_VIEW;
        bool selected = facing ? r->facing : boundary_is_rim(i) ? r->rims : moves || (r->job.any_normals && !look_out);
        if ((r->terms & rey_boundary_term(i)) && selected) {
            bool check = moves || !rey_boundary_sees(r->plan.sensor);
            result = check ? boundary_check(r, rey_boundary_term(i)) : REY_OK;
            if (result == REY_OK && !twins_sought) {
                result = check_twins(r->scene, rey_boundary_term(i));
                twins_sought = true;
            }
            result = result == REY_OK && !r->request.asked ? boundary_begin(r, i, r->boundary + i) : result;
        }
    }
    r->job.watch_inward = r->job.watch_turned;
    r->job.watch_turned &= !(r->facing && (r->terms & REY_TERM_TERMINATOR));
    watch_smooth_normals(r, look_out);
    return result == REY_OK ? rey_corners_begin(r) : result;
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
    b.job.panes = pass->r->job.panes;
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
    // The interior's paths have found out whether the sensor sees mirrors and glass.
    bool may = !(r->terms & REY_TERM_INTERIOR) || (r->faces & CAMERA_MIRRORED) || r->lines || r->rims || r->facing;
    plan->job.mirrored = plan->job.chains && !r->particles && may;
    if (plan->job.edge_count == 0 || (plan->job.kind == BOUNDARY_MIRRORED && !plan->job.mirrored)) {
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
