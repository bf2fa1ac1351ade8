// motion.c: which motions derivatives know, and vertex normals that follow their vertices.
#include "render/motion.h"

#include "bsdf/table.h"
#include "render/boundary.h"
#include "sensor/kinds.h"
#include "shape/normals.h"
#include "shape/shape.h"

#include <stdio.h>

// Sensors whose rays do not depend on surfaces.
static bool ray_is_free(const SceneView *view, const SensorRecord *s) {
    if (s->kind != SENSOR_BATCH) {
        return s->kind != SENSOR_IRRADIANCEMETER && s->kind != SENSOR_DISTANT;
    }
    for (int32_t i = 0; i < s->batch_count; i++) {
        if (!ray_is_free(view, view->batch_sensors + s->batch + i)) {
            return false;
        }
    }
    return true;
}

// Whether the motion of a shape's own numbers is known: of grids of distances, that of their pose.
static bool numbers_move(const SceneView *view, const Param *p) {
    const ShapeRecord *shape = view->shapes + p->geometry;
    return shape_moves(shape->kind) || (shape->kind == SHAPE_SDFGRID && p->theta == shape->to_world);
}

bool rey_motion_known(const rey_scene *scene, const SensorRecord *sensor, const Param *p) {
    const SceneView *view = &scene->view;
    if (!ray_is_free(view, sensor)) {
        return false;
    }
    if (p->geometry >= 0) {
        return numbers_move(view, p);
    }
    return p->instance >= 0 || p->camera >= 0;
}

void rey_motion_obstacle(const rey_scene *scene, const SensorRecord *sensor, const Param *p, char text[OBJECT_NAME]) {
    const SceneView *view = &scene->view;
    char name[OBJECT_NAME];
    if (!ray_is_free(view, sensor)) {
        snprintf(text, OBJECT_NAME, "the rays of this sensor begin or end on surfaces");
    } else if (p->geometry >= 0) {
        rey_name_shape(scene, p->geometry, name);
        snprintf(text, OBJECT_NAME, "the surface of '%.120s' does not follow these numbers yet", name);
    }
}

int32_t rey_camera_theta(const SensorRecord *s, int32_t number) {
    switch (number) {
    case CAMERA_POSE:
        return s->to_world;
    case CAMERA_FOV:
        return s->fov;
    case CAMERA_APERTURE:
        return s->lens;
    case CAMERA_FOCUS:
        return s->lens < 0 ? -1 : s->lens + 1;
    default:
        return s->fov < 0 ? -1 : s->principal + number - CAMERA_PRINCIPAL_X;
    }
}

bool rey_cameras_glide(const SceneView *view) {
    for (int64_t i = 0; i < view->shapes_count && view->has_media; i++) {
        if (view->shapes[i].emitter >= 0 || !rey_bsdf_passes(view->bsdfs[view->shapes[i].bsdf].kind)) {
            return false;
        }
    }
    return view->has_media;
}

static bool only_separates(const SceneView *view, const ShapeRecord *shape) {
    return shape->emitter < 0 && shape_moves(shape->kind) && rey_bsdf_passes(view->bsdfs[shape->bsdf].kind);
}

bool rey_moves_border(const SceneView *view, const Param *p) {
    if (p->geometry >= 0) {
        return view->has_media && only_separates(view, view->shapes + p->geometry);
    }
    bool all = view->has_media && p->instance >= 0;
    for (int64_t i = 0; i < view->shapes_count && all; i++) {
        all = view->shapes[i].collection != view->instances[p->instance].group || only_separates(view, view->shapes + i);
    }
    return all;
}

int32_t rey_motion_cameras(const SensorRecord *s) {
    return CAMERA_NUMBERS * (s->kind == SENSOR_BATCH ? s->batch_count : 1);
}

// The part of a batch whose number a parameter is, 0 of other sensors; -1: it is another sensor's.
static int32_t camera_part(const SceneView *view, const SensorRecord *s, const Param *p) {
    const SensorRecord *parts = s->kind == SENSOR_BATCH ? view->batch_sensors + s->batch : s;
    for (int32_t i = 0; i < rey_motion_cameras(s) / CAMERA_NUMBERS; i++) {
        if (rey_camera_theta(parts + i, p->camera) == p->theta) {
            return i;
        }
    }
    return -1;
}

int32_t *rey_motion_slot(Render *r, const Param *p) {
    const SceneView *view = &r->scene->view;
    PathJob *job = &r->job;
    bool *moves = rey_moves_border(view, p) ? &job->any_borders : &job->any_motion;
    if (p->geometry >= 0) {
        bool pose = p->theta == view->shapes[p->geometry].to_world;
        *moves = true;
        return (int32_t *)(uintptr_t)(pose ? job->pose_at : job->points_at) + p->geometry;
    }
    if (p->instance >= 0) {
        *moves = true;
        return (int32_t *)(uintptr_t)job->instance_at + p->instance;
    }
    int32_t part = p->camera >= 0 ? camera_part(view, r->plan.sensor, p) : -1;
    if (part >= 0) {
        *(rey_cameras_glide(view) ? &job->glides : &job->any_motion) = true;
        job->any_camera = true;
        return (int32_t *)(uintptr_t)job->camera_at + part * CAMERA_NUMBERS + p->camera;
    }
    return NULL;
}

static bool normals_follow(const Render *r, int64_t shape) {
    return r->job.points_at[shape] >= 0 && (r->scene->view.shapes[shape].flags & SHAPE_SMOOTH_NORMALS);
}

void rey_motion_settle(Render *r) {
    const SceneView *view = &r->scene->view;
    const bool turns = r->job.any_normals && rey_turning_known(view, r->plan.sensor);
    r->job.rides = view->has_media && (r->job.any_motion || turns);
    int32_t *volume_at = (int32_t *)(uintptr_t)r->job.volume_at;
    for (int64_t i = 0; i < view->volumes_count && r->job.any_volumes; i++) {
        for (int64_t k = 0; k < view->volumes_count && view->volumes[i].to_world >= 0; k++) {
            bool same = view->volumes[k].to_world == view->volumes[i].to_world;
            volume_at[i] = same && volume_at[k] >= 0 ? volume_at[k] : volume_at[i];
        }
    }
}

void rey_motion_add_normals(Render *r, int64_t *size) {
    const SceneView *view = &r->scene->view;
    for (int64_t i = 0; i < view->shapes_count; i++) {
        if (normals_follow(r, i) && r->job.normals_at[i] < 0) {
            ((int32_t *)(uintptr_t)r->job.normals_at)[i] = (int32_t)*size;
            *size += 3 * (int64_t)view->shapes[i].vertex_count;
        }
    }
}

static MeshView mesh_of(const SceneView *view, const ShapeRecord *shape) {
    return (MeshView){view->theta + shape->positions, (const uint32_t *)view->triangles + 3 * (size_t)shape->triangle,
                      (const uint32_t *)view->welded + shape->welded, shape->vertex_count, shape->triangle_count};
}

// The sums that the followers' normals are made of, one mesh behind the other; they stay the same for all sets.
static rey_result find_normal_sums(Render *r) {
    const SceneView *view = &r->scene->view;
    size_t n = 0;
    for (int64_t i = 0; i < view->shapes_count; i++) {
        n += normals_follow(r, i) ? 3 * (size_t)view->shapes[i].vertex_count : 0;
    }
    r->normal_sums = rey_alloc_array(r->scene->ctx, n + 1, sizeof *r->normal_sums);
    double *at = r->normal_sums;
    for (int64_t i = 0; i < view->shapes_count && at; i++) {
        if (normals_follow(r, i)) {
            MeshView mesh = mesh_of(view, view->shapes + i);
            rey_normal_sums(&mesh, at);
            at += 3 * mesh.vertex_count;
        }
    }
    return r->normal_sums ? REY_OK : REY_ERROR_MEMORY;
}

rey_result rey_motion_gradient(Render *r, double *gradient) {
    const SceneView *view = &r->scene->view;
    rey_result result = r->normal_sums ? REY_OK : find_normal_sums(r);
    const double *sums = r->normal_sums;
    for (int64_t i = 0; i < view->shapes_count && result == REY_OK; i++) {
        if (normals_follow(r, i)) {
            MeshView mesh = mesh_of(view, view->shapes + i);
            result = rey_normals_adj(r->scene->ctx, &mesh, sums, gradient + r->job.normals_at[i],
                                     gradient + r->job.points_at[i]);
            sums += 3 * mesh.vertex_count;
        }
    }
    return result;
}

rey_result rey_motion_tangent(const Render *r, float *tangent) {
    const SceneView *view = &r->scene->view;
    for (int64_t i = 0; i < view->shapes_count; i++) {
        if (!normals_follow(r, i)) {
            continue;
        }
        MeshView mesh = mesh_of(view, view->shapes + i);
        rey_result result = rey_normals_tangent(r->scene->ctx, &mesh, tangent + r->job.points_at[i],
                                                tangent + r->job.normals_at[i]);
        if (result != REY_OK) {
            return result;
        }
    }
    return REY_OK;
}
