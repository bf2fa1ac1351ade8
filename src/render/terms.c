// terms.c: which terms a selection needs, which exist, and what each brings.
#include "render/terms.h"

#include "bsdf/table.h"
#include "emitter/emitter.h"
#include "render/boundary.h"
#include "render/cuts.h"
#include "render/dropped.h"
#include "render/edge_on.h"
#include "render/endless.h"
#include "render/facing.h"
#include "render/motion.h"
#include "render/particles.h"
#include "render/rims.h"
#include "render/texture_steps.h"
#include "scene/sink.h"

#include <stdio.h>
#include <string.h>

enum { REASON = 3 * OBJECT_NAME };

// What sees lines of textures that move over their surfaces but does not find them, null where nothing does.
static const char *gap_of_lines(const rey_scene *scene) {
    return scene->view.has_media           ? "in participating media, what collisions see of them is not known"
           : rey_particles_alone(scene) ? "light tracing does not find them, the integrator 'path' does"
                                           : NULL;
}

// Why a parameter needs a term, and what keeps it from being computed.
static void term_reason(const rey_scene *scene, const SensorRecord *sensor, int bit, const Param *p, char reason[REASON]) {
    char object[OBJECT_NAME], obstacle[OBJECT_NAME];
    if (bit == REY_TERM_SPECULAR && rey_name_bender(scene, object)) {
        rey_name_obstacle(scene, sensor, obstacle);
        snprintf(reason, REASON, "'%.190s' is a smooth mirror or glass, has a smooth coat or lets a part of the light pass, and "
                                 "the edges that are seen in or through it are not found because of %s", object, obstacle);
    } else if (p->to_uv >= 0 && bit != REY_TERM_TERMINATOR && gap_of_lines(scene)) {
        snprintf(reason, REASON, "%s; %s", gap_of_lines(scene), p->why);
    } else if (bit == REY_TERM_TERMINATOR) {
        snprintf(reason, REASON, "the picture jumps where the normals of maps turn away from the viewer");
    } else if ((p->geometry >= 0 || p->instance >= 0 || p->camera >= 0) && !rey_motion_known(scene, sensor, p)) {
        rey_motion_obstacle(scene, sensor, p, obstacle);
        snprintf(reason, REASON, "%s; %s", obstacle, p->why);
    } else {
        snprintf(reason, REASON, "%s", p->why);
    }
}

// The terms of a parameter's derivative that exist. chains: REY_TERM_SPECULAR where it does, else 0.
static int terms_known(const rey_scene *scene, const rey_render_def *def, int chains, const Param *p) {
    const int still = REY_TERM_INTERIOR | REY_TERM_TERMINATOR; // the latter is looked for on the way
    if (p->geometry >= 0 || p->instance >= 0 || p->camera >= 0) {
        bool known = rey_motion_known(scene, scene->view.sensors + def->sensor, p);
        return known ? still | REY_TERM_PRIMARY | REY_TERM_INDIRECT | chains : 0;
    }
    if (p->normals >= 0) {
        return still | REY_TERM_PRIMARY | REY_TERM_INDIRECT | chains;
    }
    if (p->to_uv >= 0) {
        return gap_of_lines(scene) ? still : still | REY_TERM_PRIMARY | REY_TERM_INDIRECT | chains;
    }
    if (p->moves_rims) {
        return still | REY_TERM_PRIMARY | REY_TERM_INDIRECT | chains;
    }
    return (p->emitter >= 0 ? REY_TERM_INTERIOR | REY_TERM_PRIMARY : still) | REY_TERM_INDIRECT | chains;
}

static bool jumps(const VolumeNode *v) { return v->kind == VOLUME_GRID && v->filter == FILTER_NEAREST; }

// Whether some medium's extinction jumps from voxel to voxel.
static bool has_jumping_media(const SceneView *view) {
    for (int64_t i = 0; i < view->media_count; i++) {
        const MediumNode *medium = view->media + i;
        const TextureNode *flakes = medium->flakes < 0 ? NULL : view->textures + medium->flakes;
        bool found = flakes && flakes->kind == TEXTURE_VOLUME && jumps(view->volumes + flakes->volume);
        if (found || jumps(view->volumes + medium->sigma_t)) {
            return true;
        }
    }
    return false;
}

static bool is_jumping_volume(const SceneView *view, const TextureNode *t) {
    return t->kind == TEXTURE_VOLUME && jumps(view->volumes + t->volume);
}

static const char *gap_of_voxels(const SceneView *view) {
    for (int64_t i = 0; i < view->volumes_count; i++) {
        if (jumps(view->volumes + i)) {
            return "in participating media with filter_type=\"nearest\", rays that move pass jumps from voxel to voxel";
        }
    }
    return NULL;
}

// What is not known of surfaces that move in scenes with media, and of cameras among them, null where all is.
const char *rey_rides_gap(const SceneView *view) {
    for (int64_t i = 0; i < view->shapes_count; i++) {
        const ShapeRecord *shape = view->shapes + i;
        bool passes = rey_bsdf_passes(view->bsdfs[shape->bsdf].kind);
        if (passes && shape->emitter >= 0) {
            return "in scenes with participating media, lights on surfaces of the kind 'null' are passed where something moves";
        }
    }
    return gap_of_voxels(view);
}

// Whether one of the volumes that stand where a parameter says does.
static bool jumps_there(const SceneView *view, const Param *p) {
    for (int64_t i = 0; i < view->volumes_count && p->volume >= 0; i++) {
        if (view->volumes[i].to_world == p->theta && jumps(view->volumes + i)) {
            return true;
        }
    }
    return false;
}

// What of a parameter's derivative is not known because of volumes or media, null where all is.
static const char *gap_in_media(const SceneView *view, const Param *p, int terms) {
    if (jumps_there(view, p)) {
        return "with filter_type=\"nearest\" the volume jumps from voxel to voxel, and with \"trilinear\" it does not";
    }
    if (!view->has_media || rey_moves_border(view, p)) {
        return NULL;
    }
    if (p->camera >= 0) {
        return rey_cameras_glide(view) ? gap_of_voxels(view) : rey_rides_gap(view);
    }
    if (p->geometry >= 0 || p->instance >= 0) {
        return rey_rides_gap(view);
    }
    if (p->emitter < 0 && p->to_uv < 0 && (terms & REY_TERM_SPECULAR)) { // which turns rays at smooth mirrors and glass
        return rey_rides_gap(view);
    }
    if (p->emitter >= 0 && (p->terms & REY_TERM_INDIRECT) && has_jumping_media(view)) {
        return "in participating media with filter_type=\"nearest\", light that moves passes jumps from voxel to voxel";
    }
    return NULL;
}

// What is not known of points that move where surfaces have volumes as textures, null where all is.
static const char *gap_of_lookups(const SceneView *view) {
    for (int32_t i = 0; i < view->bsdfs_count && view->volumes_count > 0; i++) {
        for (int k = 0; k < MAX_SLOTS && view->bsdfs[i].used; k++) {
            if (rey_texture_holds(view, view->bsdfs[i].slot[k], is_jumping_volume)) {
                return "surfaces have volumes of filter_type=\"nearest\" as textures, whose jumps from voxel to "
                       "voxel pass over points that move";
            }
        }
    }
    for (int64_t i = 0; i < view->emitters_count && view->volumes_count > 0; i++) {
        const EmitterRecord *e = view->emitters + i;
        if (e->shape >= 0 && rey_texture_holds(view, e->slot[0], is_jumping_volume)) {
            return "lights have volumes of filter_type=\"nearest\" as radiance, whose jumps from voxel to voxel pass over points "
                   "that move";
        }
    }
    return NULL;
}

// What the score function cannot do for a parameter's derivative, null where it can (REY_ESTIMATOR_SCORE).
static const char *gap_of_score(const SceneView *view, const Param *p) {
    if (view->has_media && (p->volume >= 0 || rey_moves_border(view, p) || p->camera >= 0)) {
        return "the score function has none of media that move, nor of cameras in them; the default estimator has it";
    }
    for (int64_t i = 0; i < view->media_count; i++) {
        const MediumNode *medium = view->media + i;
        const VolumeNode *v = view->volumes + medium->sigma_t;
        bool read = rey_medium_reads(view, medium, p->texture) || p->theta == medium->scale;
        bool empty = read && view->theta[medium->scale] <= 0;
        int64_t count = v->kind == VOLUME_GRID ? (int64_t)v->nx * v->ny * v->nz * v->channels : v->channels;
        for (int64_t k = 0; k < count && read && !empty; k++) {
            empty = view->theta[v->theta + k] <= 0;
        }
        if (empty) {
            return "the score function has none where an extinction is 0, because nothing collides there; the default "
                   "estimator has it";
        }
    }
    return NULL;
}

static rey_result check_edge_on(rey_scene *scene, const SensorRecord *sensor, const Param *p) {
    char text[2 * OBJECT_NAME];
    return rey_moves_edge_on(scene, sensor, p, text)
               ? rey_fail(scene->ctx, REY_ERROR_INCOMPLETE,
                          "the gradient of %s does not exist yet in this place: %s, so that none crosses it, and what its motion "
                          "does to them jumps. Turned or moved by a thousandth, it exists", p->name, text)
               : REY_OK;
}

static rey_result check_cuts(rey_scene *scene, const SensorRecord *sensor, const Param *p) {
    char object[OBJECT_NAME];
    const char *gap = rey_cuts_gap(scene, sensor, p, object);
    return gap ? rey_fail(scene->ctx, REY_ERROR_INCOMPLETE,
                          "the gradient of %s needs a part of the term 'indirect' that does not exist yet: normal and bump maps "
                          "whose use_shadowing_function is off ('%s') %s. --terms interior gives the part that does", p->name,
                          object, gap)
               : REY_OK;
}

static rey_result check_rims(rey_scene *scene, const SensorRecord *sensor, const Param *p) {
    char object[OBJECT_NAME];
    const char *gap = rey_rims_gap(scene, sensor, p, object);
    return gap ? rey_fail(scene->ctx, REY_ERROR_INCOMPLETE,
                          "the gradient of %s is not complete: the refraction of '%s' ends abruptly where its "
                          "facets are seen edge-on, and %s. --terms interior gives the part that exists", p->name, object, gap)
               : REY_OK;
}

// Terms that are asked for by name must exist.
static rey_result check_asked(rey_scene *scene, const rey_render_def *def, int chains, rey_selection selection) {
    const int turned = rey_terms_stated(scene, def->sensor, REY_TERM_TERMINATOR);
    int wrong = def->terms & ~(REY_TERM_INTERIOR | REY_TERM_PRIMARY | REY_TERM_INDIRECT | chains | turned), bit = wrong & -wrong;
    if (bit == REY_TERM_SPECULAR && selection.count > 0) {
        char reason[REASON];
        const Param *p = &ARRAY_AT(scene->params, Param, selection.params[0]);
        term_reason(scene, scene->view.sensors + def->sensor, bit, p, reason);
        return rey_fail(scene->ctx, REY_ERROR_UNSUPPORTED, "the term 'specular' does not cover this yet: %s", reason);
    }
    return wrong ? rey_fail(scene->ctx, REY_ERROR_UNSUPPORTED, "the term '%s' does not exist yet", rey_term_name(bit)) : REY_OK;
}

// Where two indices of refraction agree there is no interface, and on either side of that a reflection begins at grazing angles.
static const char *gap_of_index(const SceneView *view, const Param *p) {
    for (int64_t i = 0; i < view->bsdfs_count && p->texture >= 0; i++) {
        const BsdfNode *bsdf = view->bsdfs + i;
        const BsdfKind *kind = rey_bsdf_kinds + bsdf->kind;
        for (int k = 0; k < kind->param_count; k++) {
            bool index = kind->params[k].type == PARAM_IOR || kind->params[k].type == PARAM_SMOOTH_IOR;
            if (index && bsdf->slot[k] == p->texture && view->theta[view->textures[p->texture].theta] == 1) {
                return "int_ior and ext_ior agree, so that there is no interface, on either side of that a reflection begins at "
                       "grazing angles, and the slopes differ. Where the two differ by a thousandth, it exists";
            }
        }
    }
    return NULL;
}

// What is not known of a parameter's derivative whatever terms are asked for, null where there is no such thing.
static const char *find_gap(const SceneView *view, const rey_render_def *def, const Param *p, int terms, const char *lookups) {
    const char *gap = rey_dropped_gap(view, p, terms);
    if (gap) {
        return gap;
    }
    gap = def->estimator == REY_ESTIMATOR_SCORE ? gap_of_score(view, p) : NULL;
    gap = gap ? gap : gap_of_index(view, p);
    gap = gap ? gap : gap_in_media(view, p, terms);
    gap = gap ? gap : rey_spots_gap(view, p);
    gap = gap ? gap : rey_endless_gap(view, view->sensors + def->sensor, p, terms);
    bool points = p->geometry >= 0 || p->instance >= 0 || p->camera >= 0 ||
                  (p->emitter < 0 && p->to_uv < 0 && (terms & REY_TERM_SPECULAR));
    return gap || !points || rey_moves_border(view, p) ? gap : lookups;
}

// The terms that a parameter needs. Vertex normals of meshes that are no mirrors or glass turn away behind those, too; where that
// is not known, paths look out for it instead (boundary.c).
static int terms_needed(const SceneView *view, int chains, const Param *p) {
    const bool known = chains && !view->drops && !(view->has_media && rey_rides_gap(view));
    const bool watched = p->normals >= 0 && !rey_bsdf_holds(view, view->shapes[p->normals].bsdf, rey_bsdf_mirrors);
    return watched && !known ? p->terms & ~REY_TERM_SPECULAR : p->terms;
}

// Refuses parameters whose derivative would lack a term; collects the terms that they need.
rey_result rey_terms_check(rey_scene *scene, const rey_render_def *def, rey_selection selection, int *needed) {
    if (def->estimator != REY_ESTIMATOR_PROBE && def->estimator != REY_ESTIMATOR_SCORE) {
        return rey_fail(scene->ctx, REY_ERROR_ARGUMENT, "estimator = %d is none of REY_ESTIMATOR_*", def->estimator);
    }
    const int chains = rey_chains_known(&scene->view, scene->view.sensors + def->sensor) ? REY_TERM_SPECULAR : 0;
    const char *lookups = gap_of_lookups(&scene->view);
    for (int i = 0; i < selection.count; i++) {
        rey_param_info info;
        rey_result result = rey_param_get_info(scene, selection.params[i], &info);
        if (result != REY_OK) {
            return result;
        }
        if (!info.terms) {
            return rey_fail(scene->ctx, REY_ERROR_PARAM, "%s is not differentiable: %s", info.name, info.why);
        }
        const Param *p = &ARRAY_AT(scene->params, Param, selection.params[i]);
        const int terms = terms_needed(&scene->view, chains, p);
        const char *gap = find_gap(&scene->view, def, p, terms, lookups);
        if (gap) {
            return rey_fail(scene->ctx, REY_ERROR_INCOMPLETE, "no term of the gradient of %s exists yet: %s", info.name, gap);
        }
        result = check_edge_on(scene, scene->view.sensors + def->sensor, p);
        if (result != REY_OK) {
            return result;
        }
        result = def->terms ? REY_OK : check_rims(scene, scene->view.sensors + def->sensor, p);
        if (result != REY_OK) {
            return result;
        }
        result = def->terms ? REY_OK : check_cuts(scene, scene->view.sensors + def->sensor, p);
        if (result != REY_OK) {
            return result;
        }
        int known = terms_known(scene, def, chains, p);
        int missing = terms & ~known;
        bool interior = known & REY_TERM_INTERIOR;
        int bit = missing & -missing;
        char reason[REASON];
        if (missing) {
            term_reason(scene, scene->view.sensors + def->sensor, bit, p, reason);
        }
        if (missing && !def->terms) {
            return rey_fail(scene->ctx, REY_ERROR_INCOMPLETE,
                            "the gradient of %s needs the term '%s', which does not cover this yet: %s%s", info.name,
                            rey_term_name(bit), reason, interior ? ". --terms interior gives the part that does" : "");
        }
        if (missing && !interior) {
            return rey_fail(scene->ctx, REY_ERROR_INCOMPLETE, "no term of the gradient of %s exists yet: %s", info.name,
                            reason);
        }
        *needed |= terms;
    }
    if (selection.count > 0 && def->terms && !(def->terms & *needed)) {
        return rey_fail(scene->ctx, REY_ERROR_INCOMPLETE, "the gradient of %s has none of the terms that are asked for",
                        ARRAY_AT(scene->params, Param, selection.params[0]).name);
    }
    return check_asked(scene, def, chains, selection);
}

// Whether something moves, and not only normals of maps turn.
static bool selection_moves(const Render *r, rey_selection selection) {
    int terms = 0;
    for (int i = 0; i < selection.count; i++) {
        terms |= ARRAY_AT(r->scene->params, Param, selection.params[i]).terms;
    }
    return terms & (REY_TERM_PRIMARY | REY_TERM_INDIRECT | REY_TERM_SPECULAR);
}

// Whether lights on surfaces move, or the sensor does.
static bool hidden_lights_move(const Render *r) {
    const SceneView *view = &r->scene->view;
    bool moves = r->job.any_camera;
    for (int64_t i = 0; i < view->shapes_count; i++) {
        moves |= view->shapes[i].emitter >= 0 && (r->job.live[view->shapes[i].group] & LIVE_MOTION);
    }
    return moves;
}

void rey_terms_note(Render *r, const PathJob *job, bool of_film) {
    r->faces |= job->faces;
    r->borders += of_film ? job->borders : 0;
    r->astray += of_film ? job->astray : 0;
    bool turned = (r->faces & FACES_BOTH) == FACES_BOTH || (r->faces & FACES_INWARD);
    bool mirrored = (r->faces & CAMERA_MIRRORED) && !(r->terms & REY_TERM_SPECULAR);
    r->stats.missing_terms = (turned ? REY_TERM_TERMINATOR : 0) | (mirrored ? REY_TERM_SPECULAR : 0);
}

// Rays slip through between faces, and past borders that are nearer than their steps: of borders that agree, fewer than one in so
// many, and these come by chance.
enum { BORDERS_PER_SLIP = 200, CHANCE_SLIPS = 10 };

rey_result rey_terms_end(const Render *r, rey_result result, rey_selection selection) {
    if (result == REY_OK && (r->faces & LIGHT_HIDDEN) && hidden_lights_move(r)) {
        return rey_fail(r->scene->ctx, REY_ERROR_INCOMPLETE,
                        "the gradient of lights that hide (hide_emitters) within a participating medium, and of cameras that look "
                        "past them, does not exist yet: what the medium scatters jumps where the camera's ray passes such a light");
    }
    const bool points = r->job.any_motion || r->job.any_places || r->job.glides; // not normals alone
    if (result == REY_OK && (r->faces & LIGHT_WITHIN) && selection_moves(r, selection) && points) {
        return rey_fail(r->scene->ctx, REY_ERROR_INCOMPLETE,
                        "the gradient of lights at a point that lie within a participating medium, and of cameras and surfaces "
                        "that move beside them, does not exist yet here: points next to a light, from which its light is "
                        "scattered, must move as it does. Known are lights that hang free in a medium, in scenes without "
                        "smooth mirrors, glass, masks, or maps without a shadowing function (docs/media.md)");
    }
    if (result == REY_OK && r->astray > CHANCE_SLIPS + r->borders / BORDERS_PER_SLIP &&
        (selection_moves(r, selection) || r->job.live_borders)) {
        return rey_fail(r->scene->ctx, REY_ERROR_INCOMPLETE,
                        "the gradient of what moves does not exist where media overlap or their borders do not agree: of %lld "
                        "borders that paths met, %lld name another medium on that side than the paths came through. A shape "
                        "within a medium names it with <ref name=\"exterior\" id=\"...\"/>, a sensor with <ref id=\"...\"/>",
                        (long long)r->borders, (long long)r->astray);
    }
    int missing = r->stats.missing_terms & REY_TERM_TERMINATOR, bit = missing & -missing;
    if (result != REY_OK || r->def.terms || !missing) {
        return result;
    }
    const Param *p = NULL;
    for (int i = 0; i < selection.count && (!p || !(p->terms & bit)); i++) {
        const Param *one = &ARRAY_AT(r->scene->params, Param, selection.params[i]);
        p = !p || (one->terms & ~REY_TERM_INTERIOR) ? one : p;
    }
    if (r->faces & FACES_INWARD) {
        return rey_fail(r->scene->ctx, REY_ERROR_INCOMPLETE,
                        "the gradient of %s needs a part of the term '%s' that does not exist yet: normals of maps point into "
                        "their surfaces (z below 0, or bumps too steep for the surface's own normals), are turned round there, "
                        "and jump once more. --terms interior gives the part that does", p ? p->name : "", rey_term_name(bit));
    }
    const char *gap = rey_facing_gap(&r->scene->view, r->plan.sensor);
    gap = !gap && r->scene->view.has_media && !r->job.rides ? "in participating media where no surface moves" : gap;
    return rey_fail(r->scene->ctx, REY_ERROR_INCOMPLETE,
                    "the gradient of %s needs the term '%s', which is not known %s: paths met shading normals that face the viewer "
                    "as the surface does and others that do not, and the picture jumps between them. --terms interior gives the "
                    "part that does exist", p ? p->name : "", rey_term_name(bit), gap ? gap : "here");
}

void rey_terms_book(Render *r, int set, int term, const double *picture) {
    if (!r->request.values) {
        return;
    }
    double sum = 0;
    if (picture) {
        int64_t n = (int64_t)r->plan.sensor->crop_width * r->plan.sensor->crop_height * 3;
        for (int64_t i = 0; i < n; i++) {
            sum += picture[i] / (double)n;
        }
    } else {
        for (int32_t k = 0; k < r->shards; k++) {
            for (int64_t i = 0; i < r->gradient_size; i++) {
                sum += r->gradients[k * r->gradient_size + i] * (double)r->tangent[i];
            }
        }
    }
    double *values = r->request.values[set];
    if (term == REY_TERM_INTERIOR) {
        r->booked = 0;
        memset(values, 0, TERM_COUNT * sizeof *values);
    }
    int index = 0;
    for (; term >> index > 1; index++) {
    }
    values[index] += sum - r->booked; // terms may have several parts
    r->booked = sum;
}

rey_result rey_jvp(rey_scene *scene, const rey_render_def *def, rey_selection selection, const float *tangent,
                   float *derivative, double *set_values, rey_stats *stats) {
    return rey_jvp_terms(scene, def, (TermRequest){0}, selection, tangent, derivative, set_values, stats);
}

rey_result rey_vjp(rey_scene *scene, const rey_render_def *def, rey_selection selection, const float *adjoint,
                   double *gradient, double *set_gradients, rey_stats *stats) {
    return rey_vjp_terms(scene, def, (TermRequest){0}, selection, adjoint, gradient, set_gradients, stats);
}
