// accel.c: Embree. Two-level form (scene quality LOW over geometry quality MEDIUM), which was measured fastest for a
// few big walls around dense meshes and is the form wanted for meshes that change.
#include "accel/accel.h"

#include <embree3/rtcore.h>
#include <stdio.h>
#include <string.h>

static void accel_free(rey_scene *scene) {
    if (scene->view.embree) {
        rtcReleaseScene(scene->view.embree);
    }
    if (scene->embree_device) {
        rtcReleaseDevice(scene->embree_device);
    }
    scene->view.embree = scene->embree_device = NULL;
}

static rey_result check_device(rey_scene *scene) {
    enum RTCError error = rtcGetDeviceError(scene->embree_device);
    if (error == RTC_ERROR_NONE) {
        return REY_OK;
    }
    return rey_fail(scene->ctx, error == RTC_ERROR_OUT_OF_MEMORY ? REY_ERROR_MEMORY : REY_ERROR_UNSUPPORTED,
                    "the ray tracer (Embree) failed with error %d", (int)error);
}

// Embree's C header leaves the accessors of packets of any size to C++. Layout: one row of n entries per field.
enum { RAY_ORG = 0, RAY_TNEAR = 3, RAY_DIR = 4, RAY_TFAR = 8, RAY_FIELDS = 12 };
enum { HIT_U = 3, HIT_V = 4, HIT_PRIM = 5, HIT_GEOM = 6, HIT_INST = 7 };

// ---- disks: user geometry ----------------------------------------------------------------------------------------

static void disk_bounds(const struct RTCBoundsFunctionArguments *args) {
    const float *t = args->geometryUserPtr; // rows of to_world
    float low[3], high[3];
    for (int k = 0; k < 3; k++) {
        float reach = sqrtf(t[4 * k] * t[4 * k] + t[4 * k + 1] * t[4 * k + 1]);
        float pad = 1e-6f * (1 + fabsf(t[4 * k + 3]) + reach);
        low[k] = t[4 * k + 3] - reach - pad;
        high[k] = t[4 * k + 3] + reach + pad;
    }
    *args->bounds_o = (struct RTCBounds){low[0], low[1], low[2], 0, high[0], high[1], high[2], 0};
}

// Distance at which the ray meets the disk, negative when it does not.
static float disk_distance(const float *table, const float o[3], const float d[3]) {
    const float *inverse = table + 12;
    float lo[3], ld[3];
    for (int k = 0; k < 3; k++) {
        lo[k] = inverse[4 * k] * o[0] + inverse[4 * k + 1] * o[1] + inverse[4 * k + 2] * o[2] + inverse[4 * k + 3];
        ld[k] = inverse[4 * k] * d[0] + inverse[4 * k + 1] * d[1] + inverse[4 * k + 2] * d[2];
    }
    if (ld[2] == 0) {
        return -1;
    }
    float t = -lo[2] / ld[2];
    float x = lo[0] + t * ld[0], y = lo[1] + t * ld[1];
    return x * x + y * y <= 1 ? t : -1;
}

// Distance at which ray i of a packet of n meets the disk within its range, negative when it does not.
static float disk_hit(const float *table, const float *rays, unsigned n, unsigned i) {
    float o[3], d[3];
    for (unsigned k = 0; k < 3; k++) {
        o[k] = rays[(RAY_ORG + k) * n + i];
        d[k] = rays[(RAY_DIR + k) * n + i];
    }
    float t = disk_distance(table, o, d);
    return t > rays[RAY_TNEAR * n + i] && t < rays[RAY_TFAR * n + i] ? t : -1;
}

static void disk_intersect(const struct RTCIntersectFunctionNArguments *args) {
    unsigned n = args->N;
    float *rays = (float *)args->rayhit, *hits = rays + RAY_FIELDS * n;
    unsigned *ids = (unsigned *)hits;
    for (unsigned i = 0; i < n; i++) {
        float t = args->valid[i] == -1 ? disk_hit(args->geometryUserPtr, rays, n, i) : -1;
        if (t >= 0) {
            rays[RAY_TFAR * n + i] = t;
            hits[HIT_U * n + i] = hits[HIT_V * n + i] = 0;
            ids[HIT_PRIM * n + i] = 0;
            ids[HIT_GEOM * n + i] = args->geomID;
            ids[HIT_INST * n + i] = args->context->instID[0];
        }
    }
}

static void disk_occluded(const struct RTCOccludedFunctionNArguments *args) {
    unsigned n = args->N;
    float *rays = (float *)args->ray;
    for (unsigned i = 0; i < n; i++) {
        if (args->valid[i] == -1 && disk_hit(args->geometryUserPtr, rays, n, i) >= 0) {
            rays[RAY_TFAR * n + i] = -INFINITY;
        }
    }
}

// ---- shapes ------------------------------------------------------------------------------------------------------

static void set_mesh(const SceneView *view, const ShapeRecord *shape, RTCGeometry geometry) {
    // theta and triangles have room behind their ends for Embree's 16-byte loads.
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, view->theta,
                               (size_t)shape->positions * sizeof(float), 3 * sizeof(float), (size_t)shape->vertex_count);
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, view->triangles,
                               (size_t)shape->triangle * 3 * sizeof(int32_t), 3 * sizeof(int32_t),
                               (size_t)shape->triangle_count);
}

static rey_result add_shape(rey_scene *scene, int32_t id) {
    const SceneView *view = &scene->view;
    const ShapeRecord *shape = view->shapes + id;
    enum RTCGeometryType type = shape->kind == SHAPE_MESH     ? RTC_GEOMETRY_TYPE_TRIANGLE
                                : shape->kind == SHAPE_SPHERE ? RTC_GEOMETRY_TYPE_SPHERE_POINT
                                                              : RTC_GEOMETRY_TYPE_USER;
    RTCGeometry geometry = rtcNewGeometry(scene->embree_device, type);
    if (!geometry) {
        return check_device(scene);
    }
    rtcSetGeometryBuildQuality(geometry, RTC_BUILD_QUALITY_MEDIUM);
    if (shape->kind == SHAPE_MESH) {
        set_mesh(view, shape, geometry);
    } else if (shape->kind == SHAPE_SPHERE) {
        rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT4, view->tables,
                                   (size_t)shape->table * sizeof(float), 4 * sizeof(float), 1);
    } else {
        rtcSetGeometryUserPrimitiveCount(geometry, 1);
        rtcSetGeometryUserData(geometry, view->tables + shape->table);
        rtcSetGeometryBoundsFunction(geometry, disk_bounds, NULL);
        rtcSetGeometryIntersectFunction(geometry, disk_intersect);
        rtcSetGeometryOccludedFunction(geometry, disk_occluded);
    }
    rtcCommitGeometry(geometry);
    rtcAttachGeometryByID(view->embree, geometry, (unsigned)id);
    rtcReleaseGeometry(geometry);
    return check_device(scene);
}

static void set_bounds(rey_scene *scene) {
    SceneView *view = &scene->view;
    struct RTCBounds b = {0};
    rtcGetSceneBounds(view->embree, &b);
    if (view->shapes_count == 0 || !(b.lower_x <= b.upper_x)) {
        b = (struct RTCBounds){-1, -1, -1, 0, 1, 1, 1, 0};
    }
    float half[3] = {0.5f * (b.upper_x - b.lower_x), 0.5f * (b.upper_y - b.lower_y), 0.5f * (b.upper_z - b.lower_z)};
    view->bounds_centre[0] = b.lower_x + half[0];
    view->bounds_centre[1] = b.lower_y + half[1];
    view->bounds_centre[2] = b.lower_z + half[2];
    view->bounds_radius = fmaxf(1e-3f, sqrtf(half[0] * half[0] + half[1] * half[1] + half[2] * half[2]));
    view->bounds_half[0] = half[0];
    view->bounds_half[1] = half[1];
    view->bounds_half[2] = half[2];
}

static rey_result accel_create(rey_scene *scene) {
    char options[64];
    snprintf(options, sizeof options, "threads=%d", scene->ctx->def.threads);
    scene->accel_free = accel_free;
    scene->embree_device = rtcNewDevice(options);
    if (!scene->embree_device) {
        return rey_fail(scene->ctx, REY_ERROR_UNSUPPORTED, "the ray tracer (Embree) could not be started, error %d",
                        (int)rtcGetDeviceError(NULL));
    }
    scene->view.embree = rtcNewScene(scene->embree_device);
    if (!scene->view.embree) {
        return check_device(scene);
    }
    rtcSetSceneBuildQuality(scene->view.embree, RTC_BUILD_QUALITY_LOW);
    return REY_OK;
}

rey_result rey_accel_update(rey_scene *scene) {
    bool fresh = !scene->view.embree, changed = fresh;
    rey_result result = fresh ? accel_create(scene) : REY_OK;
    for (int32_t i = 0; i < scene->view.shapes_count && result == REY_OK; i++) {
        if (fresh) {
            result = add_shape(scene, i);
        } else if (scene->dirty_shapes[i]) {
            RTCGeometry geometry = rtcGetGeometry(scene->view.embree, (unsigned)i);
            rtcUpdateGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0);
            rtcCommitGeometry(geometry);
            changed = true;
            result = check_device(scene);
        }
    }
    if (result == REY_OK && changed) {
        rtcCommitScene(scene->view.embree);
        result = check_device(scene);
        set_bounds(scene);
    }
    return result;
}
