// unknowns.c: the job's parameters found in the scene, with their bounds.
#include "fit/optimizer.h"
#include "fit/lbfgs.h"
#include "fit/rigid.h"
#include "fit/start.h"
#include "scene/absent.h"
#include "scene/names.h"
#include "sensor/kinds.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum { SHOWN_NAMES = 3 }; // of what a pattern passes over

static const double LOG_FLOOR = 1e-6; // lower bound where a parameter has none and log needs one

// key: what is wrong with a parameter, or does not go with its parameterisation.
static rey_result fail_key(Job *job, const JobParameter *p, const char *key, const char *name, const char *why) {
    return rey_job_fail_at(job, rey_job_place_of(p->node, key, "parameterisation"), REY_ERROR_PARAM, "parameter '%s': %s", name,
                           why);
}

static rey_result fail_name(Job *job, const JobParameter *p, const char *name, const char *why) {
    return rey_job_fail_at(job, rey_job_place_of(p->node, "name", NULL), REY_ERROR_PARAM, "parameter '%s': %s", name, why);
}

// Which numbers are allowed, from the job and from the parameter itself.
static rey_result set_bounds(Job *job, const JobParameter *p, const rey_param_info *info, Unknown *unknown) {
    bool given = !isnan(p->bounds[0]);
    unknown->low = given ? fmax(p->bounds[0], (double)info->low) : (double)info->low;
    unknown->high = given ? fmin(p->bounds[1], (double)info->high) : (double)info->high;
    if (unknown->low > unknown->high) {
        char why[160];
        snprintf(why, sizeof why, "the bounds %g to %g lie outside of the parameter's range, expected some of %g to %g",
                 p->bounds[0], p->bounds[1], (double)info->low, (double)info->high);
        return fail_key(job, p, "bounds", info->name, why);
    }
    if (p->parameterisation == PARAMETERISATION_LOG) {
        if (!(unknown->low > 0)) {
            unknown->low = LOG_FLOOR; // log needs a positive lower bound
        }
        if (!(unknown->high > unknown->low)) {
            return fail_key(job, p, "bounds", info->name, "parameterisation log needs positive bounds");
        }
    }
    if (p->parameterisation == PARAMETERISATION_LOGIT && !(isfinite(unknown->low) && isfinite(unknown->high))) {
        return fail_key(job, p, "bounds", info->name, "parameterisation logit needs bounds: [low, high]");
    }
    return REY_OK;
}

static rey_result add_vertices(Job *job, const rey_scene *scene, const JobParameter *p, Unknown *unknown) {
    const Param *param = &ARRAY_AT(scene->params, Param, unknown->param);
    const ShapeRecord *shape = param->geometry >= 0 ? scene->view.shapes + param->geometry : NULL;
    if (!shape || shape->triangle_count == 0 || param->theta != shape->positions) {
        return fail_key(job, p, "name", unknown->name,
                        "parameterisation laplacian is for vertices of meshes, such as NAME.positions");
    }
    return rey_vertices_create(job->ctx, shape->vertex_count, scene->view.welded + shape->welded, shape->triangle_count,
                               scene->view.triangles + 3 * (int64_t)shape->triangle, p->smoothness, p->regularisers,
                               &unknown->vertices);
}

// Whether a parameter is a grid of voxels, and how large.
static GridSize grid_size(const rey_scene *scene, int param) {
    int32_t texture = ARRAY_AT(scene->params, Param, param).texture;
    const TextureNode *t = texture >= 0 ? scene->view.textures + texture : NULL;
    if (!t || t->kind != TEXTURE_VOLUME) {
        return (GridSize){0};
    }
    const VolumeNode *v = scene->view.volumes + t->volume;
    return (GridSize){v->nx, v->ny, v->nz, v->channels};
}

// Terms that the gradient of a parameter does not have would fit nothing.
static rey_result check_terms(Job *job, const JobParameter *p, const rey_param_info *info) {
    if (!job->terms || (job->terms & info->terms)) {
        return REY_OK;
    }
    char asked[128], expected[128];
    rey_job_terms_text(job->terms, asked, sizeof asked);
    rey_job_terms_text(info->terms & ~REY_TERM_MEDIUM, expected, sizeof expected);
    JobPlace at = rey_job_blame(job->terms_at, rey_job_place_of(p->node, "name", NULL));
    return rey_job_fail_at(job, at, REY_ERROR_PARAM,
                           "terms %s: the gradient of %s has no such term, expected some of %s", asked, info->name, expected);
}

// Whether a parameter is the pose of a camera, which scene files take unstretched only.
static bool is_camera_pose(const rey_scene *scene, int param) {
    const Param *p = &ARRAY_AT(scene->params, Param, param);
    const SceneView *view = &scene->view;
    bool found = false;
    for (int64_t i = 0; i < view->sensors_count + view->batch_sensors_count && p->camera == CAMERA_POSE && !found; i++) {
        const SensorRecord *s = i < view->sensors_count ? view->sensors + i : view->batch_sensors + (i - view->sensors_count);
        found = s->to_world == p->theta && (s->kind == SENSOR_PERSPECTIVE || s->kind == SENSOR_THINLENS);
    }
    return found;
}

static rey_result check_pose(Job *job, const rey_scene *scene, const JobParameter *p, int param, const rey_param_info *info) {
    bool rigid = p->parameterisation == PARAMETERISATION_RIGID, pose = rigid || p->parameterisation == PARAMETERISATION_SIMILARITY;
    if (pose && info->count != RIGID_VALUES) {
        return fail_key(job, p, "name", info->name, "parameterisations rigid and similarity are for poses, such as NAME.to_world");
    }
    return rigid || !is_camera_pose(scene, param)
               ? REY_OK
               : fail_key(job, p, "name", info->name, "a camera turns and moves, but does not scale or shear: expected "
                          "'parameterisation: rigid'");
}

static rey_result add_unknown(Job *job, rey_scene *scene, int param, const JobParameter *p, int job_index,
                              Array *owners, Unknowns *u) {
    rey_param_info info;
    rey_result result = rey_param_get_info(scene, param, &info);
    if (result) {
        return result;
    }
    if (!info.terms) { // whether all terms are there depends on the views: derivatives.c asks for all of them
        return fail_name(job, p, info.name, info.why[0] ? info.why : "it has no derivative");
    }
    result = check_terms(job, p, &info);
    if (result) {
        return result;
    }
    if (p->parameterisation == PARAMETERISATION_SIMPLEX && info.count < 2) {
        return fail_key(job, p, "name", info.name, "parameterisation simplex is for two or more shares");
    }
    result = check_pose(job, scene, p, param, &info);
    if (result) {
        return result;
    }
    for (size_t i = 0; i < u->items.count; i++) {
        if (ARRAY_AT(u->items, Unknown, i).param == param) {
            char why[96];
            snprintf(why, sizeof why, "entry %d of 'parameters' names it already", ARRAY_AT(*owners, int, i));
            return fail_name(job, p, info.name, why);
        }
    }
    bool several = strchr(p->name, '*') || p->parameterisation == PARAMETERISATION_SCATTERING;
    Unknown *unknown = rey_array_push(job->ctx, &u->items, sizeof *unknown, 1);
    int *owner = unknown ? rey_array_push(job->ctx, owners, sizeof *owner, 1) : NULL;
    if (!owner) {
        return REY_ERROR_MEMORY;
    }
    *owner = job_index;
    *unknown = (Unknown){.param = param,
                         .entry = job_index,
                         .name = several ? info.name : p->name, // aliases stay what the job calls them
                         .offset = u->count,
                         .count = info.count,
                         .dims = info.dims,
                         .shape = {info.shape[0], info.shape[1], info.shape[2]},
                         .learning_rate = p->learning_rate,
                         .parameterisation = p->parameterisation,
                         .moment = p->moment,
                         .grid = grid_size(scene, param),
                         .regularisers = p->grid_regularisers};
    u->count += info.count;
    if (!unknown->grid.nx && (p->grid_regularisers.total_variation > 0 || p->grid_regularisers.sparsity > 0)) {
        return fail_key(job, p, "regularisers", info.name, "total_variation and sparsity are for grids of voxels");
    }
    if (p->parameterisation == PARAMETERISATION_LAPLACIAN) {
        result = add_vertices(job, scene, p, unknown);
    }
    return result ? result : set_bounds(job, p, &info, unknown);
}

// views.I.exposure: one number, no parameter of the scene.
static rey_result add_exposure(Job *job, int view, const char *name, int index, Array *owners, Unknowns *u) {
    const JobParameter *p = &job->parameters[index];
    const rey_param_info info = {.name = name, .low = 0, .high = INFINITY};
    if (p->parameterisation >= PARAMETERISATION_RIGID) {
        return fail_key(job, p, "name", name, "an exposure is one number, of parameterisation identity, log or logit");
    }
    for (size_t i = 0; i < u->items.count; i++) {
        const Unknown *other = &ARRAY_AT(u->items, Unknown, i);
        if (other->param < 0 && other->view == view) {
            return fail_name(job, p, name, "an earlier entry of 'parameters' names it already");
        }
    }
    Unknown *unknown = rey_array_push(job->ctx, &u->items, sizeof *unknown, 1);
    int *owner = unknown ? rey_array_push(job->ctx, owners, sizeof *owner, 1) : NULL;
    if (!owner) {
        return REY_ERROR_MEMORY;
    }
    *owner = index;
    *unknown = (Unknown){.param = -1, .view = view, .entry = index, .name = name, .offset = u->count, .count = 1,
                         .learning_rate = p->learning_rate, .parameterisation = p->parameterisation, .moment = p->moment};
    u->count++;
    return set_bounds(job, p, &info, unknown);
}

// The exposures that a name matches; *found says whether there are any.
static rey_result match_exposures(Job *job, int index, Array *owners, Unknowns *u, bool *found) {
    rey_result result = REY_OK;
    *found = false;
    for (int v = 0; v < job->view_count && !result; v++) {
        char name[40];
        snprintf(name, sizeof name, "views.%d.exposure", v);
        if (strncmp(job->parameters[index].name, "views.", 6) || !rey_name_matches(job->parameters[index].name, name) ||
            job->views[v].held_out) {
            continue;
        }
        char *owned = rey_job_alloc(job, sizeof name, 1);
        *found = true;
        result = owned ? add_exposure(job, v, strcpy(owned, name), index, owners, u) : REY_ERROR_MEMORY;
    }
    return result;
}

// What a medium's parameter is to scattering: sigma_t or sigma_a, albedo or sigma_s, g. *apart: whether it is one of sigma_a and
// sigma_s, which stand in two rows of the names.
enum { SCATTERING_FIRST, SCATTERING_SECOND, SCATTERING_G, SCATTERING_ROLES };
static int scattering_role(const char *medium, const char *name, bool *apart) {
    size_t length = strlen(medium);
    if (strncmp(name, medium, length) || name[length] != '.') {
        return -1;
    }
    static const char *const endings[][SCATTERING_ROLES] = {{"sigma_t.value.value", "albedo.value.value", "phase_function.g.value"},
                                                            {"sigma_t.data", "albedo.data", "phase_function.g.value"},
                                                            {"sigma_a.value.value", "sigma_s.value.value", ""},
                                                            {"sigma_a.data", "sigma_s.data", ""}};
    for (int i = 0; i < COUNT_OF(endings) * SCATTERING_ROLES; i++) {
        if (!strcmp(name + length + 1, endings[i / SCATTERING_ROLES][i % SCATTERING_ROLES])) {
            *apart = *apart || i / SCATTERING_ROLES >= 2;
            return i % SCATTERING_ROLES;
        }
    }
    return -1;
}

static rey_result match_medium(Job *job, rey_scene *scene, int index, Array *owners, Unknowns *u) {
    const JobParameter *p = &job->parameters[index];
    int64_t offsets[SCATTERING_ROLES] = {-1, -1, -1}, counts[SCATTERING_ROLES] = {0};
    Scattering s = {.name = p->name};
    for (int i = 0; i < rey_param_count(scene); i++) {
        rey_param_info info;
        rey_result result = rey_param_get_info(scene, i, &info);
        int role = result ? -1 : scattering_role(p->name, info.name, &s.apart);
        if (role == SCATTERING_G && p->known_g) {
            s.known_g = (double)rey_param_values(scene, i)[0];
        } else if (role >= 0) {
            offsets[role] = u->count;
            counts[role] = info.count;
            result = add_unknown(job, scene, i, p, index, owners, u);
        }
        if (result) {
            return result;
        }
    }
    if (offsets[SCATTERING_FIRST] < 0 || counts[SCATTERING_FIRST] != counts[SCATTERING_SECOND]) {
        return fail_key(job, p, "name", p->name, "parameterisation scattering is for media, such as NAME.interior_medium, whose "
                                        "sigma_t and albedo, or sigma_s and sigma_a, have as many numbers");
    }
    s.count = counts[SCATTERING_FIRST];
    s.first = offsets[SCATTERING_FIRST];
    s.second = offsets[SCATTERING_SECOND];
    s.g = offsets[SCATTERING_G];
    Scattering *kept = rey_array_push(job->ctx, &u->media, sizeof *kept, 1);
    if (!kept) {
        return REY_ERROR_MEMORY;
    }
    *kept = s;
    return REY_OK;
}

// A view's exposure that match_exposures does not offer.
static rey_result fail_exposure(Job *job, const JobParameter *p, int view) {
    char why[160];
    if (view >= 0 && view < job->view_count) {
        snprintf(why, sizeof why, "view %d is held out: nothing that is fitted tells its exposure; its entry of 'views' can", view);
    } else {
        snprintf(why, sizeof why, "the job has no view %d, expected %s%d", view, job->view_count > 1 ? "0 to " : "",
                 job->view_count - 1);
    }
    return fail_name(job, p, p->name, why);
}

// A pattern that passes over all that it matches; passed: the names of some of them, of `count`.
static rey_result fail_pattern(Job *job, const JobParameter *p, const char *passed, int count) {
    char why[1024], more[32] = "";
    if (count == 0) {
        return fail_name(job, p, p->name, "matches no parameter of the scene; 'reynolds params' lists them");
    }
    if (count > SHOWN_NAMES) {
        snprintf(more, sizeof more, " and %d more", count - SHOWN_NAMES);
    }
    snprintf(why, sizeof why, "matches only %s%s, which move%s things or ha%s no derivative: a pattern passes over those; name "
             "them one by one", passed, more, count == 1 ? "s" : "", count == 1 ? "s" : "ve");
    return fail_name(job, p, p->name, why);
}

static rey_result match_parameter(Job *job, rey_scene *scene, int index, Array *owners, Unknowns *u) {
    const JobParameter *p = &job->parameters[index];
    if (p->parameterisation == PARAMETERISATION_SCATTERING) {
        return match_medium(job, scene, index, owners, u);
    }
    size_t before = u->items.count;
    bool exposures;
    rey_result result = match_exposures(job, index, owners, u, &exposures);
    if (result || exposures) {
        return result;
    }
    int view, end = 0;
    if (sscanf(p->name, "views.%d.exposure%n", &view, &end) == 1 && end && !p->name[end]) {
        return fail_exposure(job, p, view);
    }
    if (!strchr(p->name, '*')) {
        int param = rey_param_find(scene, p->name);
        if (param < 0) {
            char absent[ABSENT_BYTES], why[ABSENT_BYTES + 32];
            rey_param_absent(scene, p->name, absent);
            snprintf(why, sizeof why, "the scene has none of this name%s", absent);
            return fail_name(job, p, p->name, why);
        }
        return add_unknown(job, scene, param, p, index, owners, u);
    }
    char passed[512] = "";
    int passed_count = 0;
    const char **names = rey_params_matching(scene, p->name);
    result = names ? REY_OK : REY_ERROR_MEMORY;
    for (int i = 0; i < rey_param_count(scene) && !result; i++) { // a glob passes over what moves or cannot be differentiated
        rey_param_info info;
        result = rey_param_get_info(scene, i, &info);
        if (result || !names[i]) {
            continue;
        }
        if (rey_param_stays(scene, i) && !rey_name_is_pose(info.name)) {
            result = add_unknown(job, scene, i, p, index, owners, u);
        } else if (passed_count++ < SHOWN_NAMES) {
            size_t used = strlen(passed);
            snprintf(passed + used, sizeof passed - used, "%s%s", used ? ", " : "", info.name);
        }
    }
    rey_free(job->ctx, names);
    return result || u->items.count > before ? result : fail_pattern(job, p, passed, passed_count);
}

static rey_result allocate(const Job *job, Unknowns *u) {
    size_t n = (size_t)u->count;
    u->params = rey_alloc_array(u->ctx, u->items.count, sizeof *u->params);
    u->start = rey_alloc_array(u->ctx, n, sizeof *u->start);
    u->value = rey_alloc_array(u->ctx, n, sizeof *u->value);
    u->reference = rey_alloc_array(u->ctx, n, sizeof *u->reference);
    u->variable = rey_alloc_array(u->ctx, n, sizeof *u->variable);
    u->first = rey_alloc_array(u->ctx, n, sizeof *u->first);
    u->second = rey_alloc_array(u->ctx, n, sizeof *u->second);
    u->average = rey_alloc_array(u->ctx, n, sizeof *u->average);
    u->gradient = rey_alloc_array(u->ctx, n, sizeof *u->gradient);
    if (job->optimizer.kind == OPTIMIZER_LBFGS) {
        u->lbfgs_count = rey_lbfgs_numbers(u->count, job->optimizer.memory);
    }
    u->lbfgs = rey_alloc_array(u->ctx, (size_t)u->lbfgs_count, sizeof *u->lbfgs);
    bool had = u->params && u->start && u->value && u->reference && u->variable && u->first && u->second &&
               u->average && u->gradient && u->lbfgs;
    return had ? REY_OK : REY_ERROR_MEMORY;
}

rey_result rey_unknowns_create(Job *job, rey_scene *scene, bool keep, Unknowns *u) {
    Array owners = {0}; // for every unknown the index of the job's entry that chose it
    *u = (Unknowns){.ctx = job->ctx};
    rey_result result = REY_OK;
    for (int i = 0; i < job->parameter_count && !result; i++) {
        result = match_parameter(job, scene, i, &owners, u);
    }
    if (!result) {
        result = allocate(job, u);
    }
    for (size_t i = 0; i < u->items.count && !result; i++) {
        Unknown *unknown = &ARRAY_AT(u->items, Unknown, i);
        if (unknown->param >= 0) {
            u->params[u->param_count++] = unknown->param;
        }
        const JobParameter *p = &job->parameters[ARRAY_AT(owners, int, i)];
        result = rey_start_set(job, scene, keep ? NULL : p, unknown, u->start + unknown->offset);
        if (!result) {
            result = rey_start_check(job, p, unknown, u->start + unknown->offset, keep);
        }
        for (int64_t k = 0; k < unknown->count && p->parameterisation == PARAMETERISATION_SIMPLEX; k++) {
            unknown->sum += (double)u->start[unknown->offset + k];
        }
    }
    rey_array_free(job->ctx, &owners);
    if (!result) {
        rey_unknowns_begin(u);
        result = rey_unknowns_apply(u, scene, u->value);
    }
    return result;
}

void rey_unknowns_free(Unknowns *u) {
    if (u->ctx) {
        void *blocks[] = {u->params, u->start, u->value, u->reference, u->variable, u->first, u->second, u->average,
                          u->gradient, u->lbfgs};
        for (int i = 0; i < COUNT_OF(blocks); i++) {
            rey_free(u->ctx, blocks[i]);
        }
        for (size_t i = 0; i < u->items.count; i++) {
            rey_vertices_free(u->ctx, ARRAY_AT(u->items, Unknown, i).vertices);
            rey_free(u->ctx, ARRAY_AT(u->items, Unknown, i).carved);
        }
        rey_array_free(u->ctx, &u->items);
        rey_array_free(u->ctx, &u->media);
        *u = (Unknowns){0};
    }
}

rey_result rey_unknowns_apply(const Unknowns *u, rey_scene *scene, const float *values) {
    rey_result result = REY_OK;
    for (size_t i = 0; i < u->items.count && !result; i++) {
        const Unknown *p = &ARRAY_AT(u->items, Unknown, i);
        result = p->param < 0 ? REY_OK : rey_param_set(scene, p->param, values + p->offset, p->count);
    }
    return result;
}
