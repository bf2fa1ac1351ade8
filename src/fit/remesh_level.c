// remesh_level.c: levels with meshes and grids of another fineness. What the scene's arrays hold cannot grow: the scene is saved
// with the new ones, and the fit goes on in what that file loads as; a resumed fit begins there.
#include "fit/carve.h"
#include "fit/remesh.h"
#include "io/mitsuba.h"
#include "io/save.h"

#include <stdio.h>
#include <string.h>

enum { ROUNDS = 5 };

static char *level_path(const Fit *fit, int level) {
    char name[32];
    snprintf(name, sizeof name, "level_%d.xml", level);
    return rey_fit_output_path(fit, name);
}

rey_result rey_fit_load_scene(Fit *fit, int meshed, rey_scene **out) {
    rey_context *ctx = fit->ctx;
    if (meshed) {
        char *path = level_path(fit, meshed - 1);
        rey_result result = path ? rey_scene_load(ctx, path, NULL, 0, out) : REY_ERROR_MEMORY;
        rey_free(ctx, path);
        return result;
    }
    const char *scene = rey_job_path(&fit->job, fit->job.scene);
    rey_result result =
        scene ? rey_scene_load(ctx, scene, fit->job.defines.list, fit->job.defines.count, out) : REY_ERROR_MEMORY;
    result = rey_job_named_scene(&fit->job, fit->job.scene_at, &fit->job.defines, result);
    if (!result && !(*out)->integrator) {
        result = rey_fail(ctx, REY_ERROR_SCENE, "%s: the scene has no integrator, expected one such as <integrator type=\"path\"/>",
                          scene);
    }
    if (!result && fit->job.load) {
        const char *values = rey_job_path(&fit->job, fit->job.load);
        result = values ? rey_scene_load_values(*out, values) : REY_ERROR_MEMORY;
        result = rey_job_named_file(&fit->job, fit->job.load_at, result);
    }
    return result;
}

rey_result rey_fit_open_start(Fit *fit, rey_scene **scene, Unknowns *unknowns) {
    rey_result result = rey_fit_load_scene(fit, 0, scene);
    if (!result) {
        result = rey_unknowns_create(&fit->job, *scene, false, unknowns);
    }
    return result ? result : rey_carve(fit, *scene, unknowns);
}

// Whether a mesh, as it is now, can be remeshed as a level says; true for what is none.
static rey_result check_mesh(Fit *fit, int level, const Unknown *p) {
    const JobLevel *l = &fit->job.levels[level];
    if (!p->vertices || !(l->edge_length > 0)) {
        return REY_OK;
    }
    if (fit->scene->view.shapes[ARRAY_AT(fit->scene->params, Param, p->param).geometry].uvs >= 0) {
        return rey_job_fail_at(&fit->job, l->edge_length_at, REY_ERROR_UNSUPPORTED,
                               "%s: levels cannot remesh what has uv coordinates", p->name);
    }
    const PointMesh *mesh = &p->vertices->mesh;
    const double *points = rey_vertices_points(p->vertices, fit->unknowns.value + p->offset);
    double triangles = rey_remesh_estimate(mesh, points, l->edge_length);
    return triangles <= REMESH_LARGEST
               ? REY_OK
               : rey_job_fail_at(&fit->job, l->edge_length_at, REY_ERROR_PARAM,
                                 "level %d: edge_length = %g would make about %.2g triangles of %s, whose area is %g, expected "
                                 "%d or fewer", level, l->edge_length, triangles, p->name, rey_point_mesh_area(mesh, points),
                                 REMESH_LARGEST);
}

rey_result rey_levels_check_meshes(Fit *fit) {
    rey_result result = REY_OK;
    for (int level = fit->state.meshed; level < fit->job.level_count; level++) {
        for (size_t k = 0; k < fit->unknowns.items.count && !result; k++) {
            result = check_mesh(fit, level, &ARRAY_AT(fit->unknowns.items, Unknown, k));
        }
    }
    return result;
}

static bool remeshing_step(void *user) {
    const Fit *fit = user;
    FitProgress progress = {.iteration = fit->state.iteration, .iterations = fit->job.iterations, .remeshing = true};
    return !fit->def->progress || fit->def->progress(fit->def->user, &progress);
}

static rey_result remesh_all(Fit *fit, int level, Array *meshes) {
    const RemeshDef def = {fit->job.levels[level].edge_length, ROUNDS, remeshing_step, fit};
    rey_result result = REY_OK;
    for (size_t k = 0; k < fit->unknowns.items.count && !result; k++) {
        const Unknown *p = &ARRAY_AT(fit->unknowns.items, Unknown, k);
        result = check_mesh(fit, level, p); // the mesh may have grown since the start
        if (result || !p->vertices) {
            continue;
        }
        SavedMesh *saved = rey_array_push(fit->ctx, meshes, sizeof *saved, 1);
        if (!saved) {
            return REY_ERROR_MEMORY;
        }
        saved->shape = ARRAY_AT(fit->scene->params, Param, p->param).geometry;
        const double *points = rey_vertices_points(p->vertices, fit->unknowns.value + p->offset);
        result = rey_remesh(fit->ctx, &p->vertices->mesh, points, def, &saved->mesh);
    }
    return result;
}

static rey_result resample_all(Fit *fit, int resolution, Array *grids) {
    for (size_t k = 0; k < fit->unknowns.items.count; k++) {
        const Unknown *p = &ARRAY_AT(fit->unknowns.items, Unknown, k);
        if (!p->grid.nx) {
            continue;
        }
        int32_t volume = fit->scene->view.textures[ARRAY_AT(fit->scene->params, Param, p->param).texture].volume;
        GridSize size = rey_voxels_resized(p->grid, resolution);
        SavedGrid *saved = rey_array_push(fit->ctx, grids, sizeof *saved, 1);
        float *values = saved ? rey_alloc_array(fit->ctx, (size_t)rey_voxels_count(size), sizeof *values) : NULL;
        if (!values) {
            return REY_ERROR_MEMORY;
        }
        *saved = (SavedGrid){volume, size.nx, size.ny, size.nz, values};
        rey_voxels_resample(p->grid, fit->scene->view.volumes[volume].wrap, fit->unknowns.value + p->offset, size, values);
    }
    return REY_OK;
}

// What the unknowns of the new scene share with those of the old one; vertices, and voxels of another number, begin anew.
static void take_state(const Unknowns *from, Unknowns *to) {
    for (size_t k = 0; k < to->items.count; k++) {
        const Unknown *a = &ARRAY_AT(from->items, Unknown, k), *b = &ARRAY_AT(to->items, Unknown, k);
        size_t n = (size_t)b->count;
        ARRAY_AT(to->items, Unknown, k).driven = a->driven;
        if (b->vertices || a->count != b->count) {
            for (int64_t i = b->offset; i < b->offset + b->count; i++) {
                to->average[i] = (double)to->value[i];
            }
            continue;
        }
        memcpy(to->start + b->offset, from->start + a->offset, n * sizeof *to->start);
        memcpy(to->value + b->offset, from->value + a->offset, n * sizeof *to->value);
        memcpy(to->variable + b->offset, from->variable + a->offset, n * sizeof *to->variable);
        memcpy(to->first + b->offset, from->first + a->offset, n * sizeof *to->first);
        memcpy(to->second + b->offset, from->second + a->offset, n * sizeof *to->second);
        memcpy(to->average + b->offset, from->average + a->offset, n * sizeof *to->average);
    }
}

// Goes on in the scene of a level.
static rey_result change_scene(Fit *fit, int level) {
    rey_scene *scene = NULL;
    Unknowns unknowns = {0};
    rey_result result = rey_fit_load_scene(fit, level + 1, &scene);
    if (!result) {
        result = rey_unknowns_create(&fit->job, scene, true, &unknowns);
    }
    if (!result) {
        result = rey_carve(fit, scene, &unknowns);
    }
    double *gradient = result ? NULL : rey_alloc_array(fit->ctx, (size_t)unknowns.count, sizeof *gradient);
    if (!gradient) {
        rey_unknowns_free(&unknowns);
        rey_scene_destroy(scene);
        return result ? result : REY_ERROR_MEMORY;
    }
    take_state(&fit->unknowns, &unknowns);
    rey_unknowns_free(&fit->unknowns);
    rey_scene_destroy(fit->scene);
    rey_free(fit->ctx, fit->gradient);
    fit->scene = scene;
    fit->unknowns = unknowns;
    fit->gradient = gradient;
    fit->state.meshed = level + 1;
    for (int v = 0; v < fit->job.view_count; v++) {
        fit->views[v].full_sensor = scene->view.sensors[fit->views[v].sensor];
    }
    return rey_unknowns_apply(&fit->unknowns, scene, fit->unknowns.value);
}

rey_result rey_levels_remesh(Fit *fit, int level) {
    const JobLevel *l = &fit->job.levels[level];
    Array meshes = {0}, grids = {0};
    char *path = level_path(fit, level);
    rey_result result = path ? REY_OK : REY_ERROR_MEMORY;
    if (!result && l->edge_length > 0) {
        result = remesh_all(fit, level, &meshes);
    }
    if (!result && l->resolution > 0) {
        result = resample_all(fit, l->resolution, &grids);
    }
    if (!result) {
        result = rey_mitsuba_save_parts(fit->scene, path,
                                        (SavedParts){meshes.data, (int)meshes.count, grids.data, (int)grids.count});
    }
    if (!result) {
        result = change_scene(fit, level);
    }
    for (size_t i = 0; i < meshes.count; i++) {
        rey_mesh_free(fit->ctx, &ARRAY_AT(meshes, SavedMesh, i).mesh);
    }
    for (size_t i = 0; i < grids.count; i++) {
        rey_free(fit->ctx, ARRAY_AT(grids, SavedGrid, i).values);
    }
    rey_array_free(fit->ctx, &meshes);
    rey_array_free(fit->ctx, &grids);
    rey_free(fit->ctx, path);
    return result;
}
