// accel.c: Embree. Two-level form (scene quality LOW over geometry quality MEDIUM), which was measured fastest for a
// few big walls around dense meshes and is the form wanted for meshes that change.
#include "accel/accel.h"

#include "accel/open.h"
#include "base/parallel.h"
#include "shape/shape.h"

#include <embree3/rtcore.h>
#include <stdio.h>
#include <string.h>

static void accel_free(rey_scene *scene) {
    for (int32_t i = 0; scene->embree_groups && i < scene->view.collections; i++) {
        if (scene->embree_groups[i]) {
            rtcReleaseScene(scene->embree_groups[i]);
        }
    }
    for (int32_t i = 0; scene->embree_surfaces && i < scene->view.shapes_count; i++) {
        rey_free(scene->ctx, scene->embree_surfaces[i].voxels);
    }
    rey_free(scene->ctx, scene->embree_surfaces);
    scene->embree_surfaces = NULL;
    rey_free(scene->ctx, scene->embree_groups);
    scene->embree_groups = NULL;
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
enum { HIT_NG = 0, HIT_U = 3, HIT_V = 4, HIT_PRIM = 5, HIT_GEOM = 6, HIT_INST = 7 };

// ---- surfaces that Embree does not know --------------------------------------------------------------------------

// A kind's own intersection: distance between near and far of a ray given in the shape's space, negative for none.
typedef float meet_fn(const Surface *s, unsigned prim, const double o[3], const double d[3], float near, float far);
typedef void bounds_fn(const Surface *s, unsigned prim, float low[3], float high[3]);

static inline void user_bounds(const struct RTCBoundsFunctionArguments *args, bounds_fn *bounds) {
    float low[3], high[3];
    bounds(args->geometryUserPtr, args->primID, low, high);
    for (int k = 0; k < 3; k++) {
        float pad = 1e-6f * (1 + fmaxf(fabsf(low[k]), fabsf(high[k])));
        low[k] -= pad;
        high[k] += pad;
    }
    *args->bounds_o = (struct RTCBounds){low[0], low[1], low[2], 0, high[0], high[1], high[2], 0};
}

// Distance at which ray i of a packet of n meets the surface within its range, negative when it does not.
static inline float user_hit(const Surface *s, unsigned prim, const float *rays, unsigned n, unsigned i, meet_fn *meet) {
    float o[3], d[3];
    double local_o[3], local_d[3];
    for (unsigned k = 0; k < 3; k++) {
        o[k] = rays[(RAY_ORG + k) * n + i];
        d[k] = rays[(RAY_DIR + k) * n + i];
    }
    pose_ray(s->table, o, d, local_o, local_d);
    return meet(s, prim, local_o, local_d, rays[RAY_TNEAR * n + i], rays[RAY_TFAR * n + i]);
}

static inline void user_intersect(const struct RTCIntersectFunctionNArguments *args, meet_fn *meet) {
    unsigned n = args->N;
    float *rays = (float *)args->rayhit, *hits = rays + RAY_FIELDS * n;
    unsigned *ids = (unsigned *)hits;
    for (unsigned i = 0; i < n; i++) {
        float t = args->valid[i] == -1 ? user_hit(args->geometryUserPtr, args->primID, rays, n, i, meet) : -1;
        if (t >= 0) {
            rays[RAY_TFAR * n + i] = t;
            hits[HIT_U * n + i] = hits[HIT_V * n + i] = 0;
            ids[HIT_PRIM * n + i] = args->primID;
            ids[HIT_GEOM * n + i] = args->geomID;
            ids[HIT_INST * n + i] = args->context->instID[0];
        }
    }
}

static inline void user_occluded(const struct RTCOccludedFunctionNArguments *args, meet_fn *meet) {
    unsigned n = args->N;
    float *rays = (float *)args->ray;
    for (unsigned i = 0; i < n; i++) {
        if (args->valid[i] == -1 && user_hit(args->geometryUserPtr, args->primID, rays, n, i, meet) >= 0) {
            rays[RAY_TFAR * n + i] = -INFINITY;
        }
    }
}

// ---- geometries, one form per column of kinds.inl: set_FORM(prefix) fills one in ---------------------------------

#define DEFINE_SPHERE_POINT(prefix)                                                                                    \
    static void prefix##_set(const SceneView *view, const ShapeRecord *shape, RTCGeometry geometry) {                  \
        rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT4, view->tables,               \
                                   (size_t)shape->table * sizeof(float), 4 * sizeof(float), 1);                        \
    }
#define DEFINE_USER(prefix)                                                                                            \
    static void prefix##_bounds_of(const struct RTCBoundsFunctionArguments *args) { user_bounds(args, prefix##_bounds); } \
    static void prefix##_intersect(const struct RTCIntersectFunctionNArguments *args) {                                \
        user_intersect(args, prefix##_meet);                                                                           \
    }                                                                                                                  \
    static void prefix##_occluded(const struct RTCOccludedFunctionNArguments *args) {                                  \
        user_occluded(args, prefix##_meet);                                                                            \
    }                                                                                                                  \
    static void prefix##_set(const SceneView *view, const ShapeRecord *shape, RTCGeometry geometry) {                  \
        UNUSED(view), UNUSED(shape);                                                                                   \
        rtcSetGeometryBoundsFunction(geometry, prefix##_bounds_of, NULL);                                              \
        rtcSetGeometryIntersectFunction(geometry, prefix##_intersect);                                                 \
        rtcSetGeometryOccludedFunction(geometry, prefix##_occluded);                                                   \
    }
#define SHAPE_MESH_KIND(ENUM, prefix)
#define SHAPE_POSED(ENUM, prefix, form, ...) DEFINE_##form(prefix)
#define SHAPE_CURVE(ENUM, prefix, ...)
#include "shape/kinds.inl"
#undef SHAPE_MESH_KIND
#undef SHAPE_POSED
#undef SHAPE_CURVE

// ---- shapes ------------------------------------------------------------------------------------------------------

static void mesh_set(const SceneView *view, const ShapeRecord *shape, RTCGeometry geometry) {
    // theta and triangles have room behind their ends for Embree's 16-byte loads.
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, view->theta,
                               (size_t)shape->positions * sizeof(float), 3 * sizeof(float), (size_t)shape->vertex_count);
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, view->triangles,
                               (size_t)shape->triangle * 3 * sizeof(int32_t), 3 * sizeof(int32_t),
                               (size_t)shape->triangle_count);
}

// Tubes are seen from outside only: who looks in at an open end looks through, as in other programs of the format.
static void curve_filter(const struct RTCFilterFunctionNArguments *args) {
    unsigned n = args->N;
    const float *rays = (const float *)args->ray, *hits = (const float *)args->hit;
    for (unsigned i = 0; i < n; i++) {
        float cosine = 0;
        for (unsigned k = 0; k < 3; k++) {
            cosine += rays[(RAY_DIR + k) * n + i] * hits[(HIT_NG + k) * n + i];
        }
        args->valid[i] = cosine > 0 ? 0 : args->valid[i];
    }
}

static void curve_set(const SceneView *view, const ShapeRecord *shape, RTCGeometry geometry) {
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT4, view->theta,
                               (size_t)shape->positions * sizeof(float), 4 * sizeof(float), (size_t)shape->vertex_count);
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT, view->segments,
                               (size_t)shape->segment * sizeof(int32_t), sizeof(int32_t), (size_t)shape->segment_count);
    rtcSetGeometryIntersectFilterFunction(geometry, curve_filter);
    rtcSetGeometryOccludedFilterFunction(geometry, curve_filter);
}

typedef struct GeometryForm {
    enum RTCGeometryType type;
    void (*set)(const SceneView *view, const ShapeRecord *shape, RTCGeometry geometry);
} GeometryForm;

static const GeometryForm *geometry_form(int32_t kind) {
    static const GeometryForm forms[] = {
#define SHAPE_MESH_KIND(ENUM, prefix) {RTC_GEOMETRY_TYPE_TRIANGLE, prefix##_set},
#define SHAPE_POSED(ENUM, prefix, form, ...) {RTC_GEOMETRY_TYPE_##form, prefix##_set},
#define SHAPE_CURVE(ENUM, prefix, form, ...) {RTC_GEOMETRY_TYPE_##form, curve_set},
#include "shape/kinds.inl"
#undef SHAPE_MESH_KIND
#undef SHAPE_POSED
#undef SHAPE_CURVE
    };
    return &forms[kind];
}

// Where a shape stands: the scene itself, or its shapegroup.
static RTCScene scene_of(const rey_scene *scene, const ShapeRecord *shape) {
    return shape->collection < 0 ? scene->view.embree : scene->embree_groups[shape->collection];
}

// Finds the voxels of a grid that its surface passes.
static rey_result grid_voxels(rey_scene *scene, Surface *s) {
    int64_t cells = 1;
    unsigned active = 0;
    for (int k = 0; k < 3; k++) {
        cells *= (int64_t)s->table[SDFGRID_NODES + k] - 1;
    }
    rey_free(scene->ctx, s->voxels);
    s->voxels = rey_alloc_array(scene->ctx, (size_t)cells, sizeof *s->voxels);
    if (!s->voxels) {
        return REY_ERROR_MEMORY;
    }
    for (int32_t i = 0; i < cells; i++) {
        double corners[8];
        int32_t at[3];
        if (sdfgrid_corners(s, i, corners, at)) {
            s->voxels[active++] = i;
        }
    }
    s->primitives = active;
    return REY_OK;
}

static rey_result set_surface(rey_scene *scene, int32_t id, RTCGeometry geometry) {
    const SceneView *view = &scene->view;
    const ShapeRecord *shape = view->shapes + id;
    Surface *s = scene->embree_surfaces + id;
    if (geometry_form(shape->kind)->type != RTC_GEOMETRY_TYPE_USER) {
        return REY_OK;
    }
    s->table = view->tables + shape->table;
    s->primitives = 1;
    rey_result result = REY_OK;
    if (shape->kind == SHAPE_SDFGRID) {
        s->grid = view->theta + shape->positions;
        result = grid_voxels(scene, s);
    }
    rtcSetGeometryUserPrimitiveCount(geometry, s->primitives);
    rtcSetGeometryUserData(geometry, s);
    return result;
}

// Kernels meet the scene's own spheres themselves where these are few.
static void find_own_spheres(SceneView *view) {
    view->own_spheres_count = 0;
    for (int32_t i = 0; i < view->shapes_count; i++) {
        if (!stands_alone(view->shapes + i)) {
            continue;
        }
        if (view->own_spheres_count == MOST_OWN_SPHERES) {
            view->own_spheres_count = 0;
            return;
        }
        view->own_spheres[view->own_spheres_count++] = i;
    }
}

// Shapes that Embree knows.
static bool is_embrees(const SceneView *view, const ShapeRecord *shape) {
    bool open = view->open_apart && shape->kind == SHAPE_MESH && rey_is_open(view, shape);
    return is_seen(shape) && !(view->own_spheres_count && stands_alone(shape)) && !open;
}

static rey_result add_shape(rey_scene *scene, int32_t id) {
    const SceneView *view = &scene->view;
    const ShapeRecord *shape = view->shapes + id;
    RTCGeometry geometry = rtcNewGeometry(scene->embree_device, geometry_form(shape->kind)->type);
    if (!geometry) {
        return check_device(scene);
    }
    rtcSetGeometryBuildQuality(geometry, RTC_BUILD_QUALITY_MEDIUM);
    geometry_form(shape->kind)->set(view, shape, geometry);
    rey_result result = set_surface(scene, id, geometry);
    rtcCommitGeometry(geometry);
    rtcAttachGeometryByID(scene_of(scene, shape), geometry, (unsigned)id);
    rtcReleaseGeometry(geometry);
    return result == REY_OK ? check_device(scene) : result;
}

// The middle of a sphere, or about that of a mesh.
static void middle_of(const SceneView *view, const ShapeRecord *shape, float p[3]) {
    if (shape->kind == SHAPE_SPHERE) {
        memcpy(p, view->tables + shape->table, 3 * sizeof *p);
        return;
    }
    const int32_t step = 1 + shape->vertex_count / 256;
    for (int k = 0; k < 3; k++) {
        double sum = 0, count = 0;
        for (int64_t v = 0; v < shape->vertex_count; v += step, count++) {
            sum += (double)view->theta[shape->positions + 3 * v + k];
        }
        p[k] = (float)(sum / count);
    }
}

// Where rays may look for what parts media (medium_around).
static void find_beacons(SceneView *view) {
    view->beacons_count = 0;
    for (int64_t i = 0; i < view->shapes_count && view->has_media && view->beacons_count < MOST_BEACONS; i++) {
        const ShapeRecord *shape = view->shapes + i;
        const Group *group = view->groups + shape->group;
        bool has_middle = shape->kind == SHAPE_SPHERE || (shape->kind == SHAPE_MESH && shape->vertex_count > 0);
        bool placed = is_seen(shape) && shape->collection < 0 && has_middle;
        if (placed && (group->interior >= 0 || group->exterior >= 0)) {
            middle_of(view, shape, view->beacons[view->beacons_count++]);
        }
    }
}

static void set_bounds(rey_scene *scene) {
    SceneView *view = &scene->view;
    struct RTCBounds b = {0};
    rtcGetSceneBounds(view->embree, &b);
    b.lower_x = fminf(b.lower_x, view->open_low[0]);
    b.lower_y = fminf(b.lower_y, view->open_low[1]);
    b.lower_z = fminf(b.lower_z, view->open_low[2]);
    b.upper_x = fmaxf(b.upper_x, view->open_high[0]);
    b.upper_y = fmaxf(b.upper_y, view->open_high[1]);
    b.upper_z = fmaxf(b.upper_z, view->open_high[2]);
    for (int32_t i = 0; i < view->own_spheres_count; i++) {
        const float *s = view->tables + view->shapes[view->own_spheres[i]].table;
        b.lower_x = fminf(b.lower_x, s[0] - s[3]);
        b.lower_y = fminf(b.lower_y, s[1] - s[3]);
        b.lower_z = fminf(b.lower_z, s[2] - s[3]);
        b.upper_x = fmaxf(b.upper_x, s[0] + s[3]);
        b.upper_y = fmaxf(b.upper_y, s[1] + s[3]);
        b.upper_z = fmaxf(b.upper_z, s[2] + s[3]);
    }
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
    int available = rey_available_threads(), asked = scene->ctx->def.threads;
    snprintf(options, sizeof options, "threads=%d", asked < available ? asked : available);
    scene->accel_free = accel_free;
    scene->embree_device = rtcNewDevice(options);
    if (!scene->embree_device) {
        int error = (int)rtcGetDeviceError(NULL);
        bool memory = error == RTC_ERROR_OUT_OF_MEMORY;
        return rey_fail(scene->ctx, memory ? REY_ERROR_MEMORY : REY_ERROR_UNSUPPORTED,
                        "the ray tracer (Embree) could not be started, error %d%s", error, memory ? ": out of memory" : "");
    }
    scene->view.embree = rtcNewScene(scene->embree_device);
    if (!scene->view.embree) {
        return check_device(scene);
    }
    find_own_spheres(&scene->view);
    rey_open_find(&scene->view);
    // Rays look for what lies in the borders of media (trace_others).
    enum RTCSceneFlags flags = scene->view.has_media ? RTC_SCENE_FLAG_CONTEXT_FILTER_FUNCTION : RTC_SCENE_FLAG_NONE;
    rtcSetSceneFlags(scene->view.embree, flags);
    // One structure over all boxes is better than a fast one where there are many instances.
    rtcSetSceneBuildQuality(scene->view.embree,
                            scene->view.instances_count ? RTC_BUILD_QUALITY_MEDIUM : RTC_BUILD_QUALITY_LOW);
    scene->embree_groups = rey_alloc_array(scene->ctx, (size_t)scene->view.collections + 1, sizeof(void *));
    scene->embree_surfaces = rey_alloc_array(scene->ctx, (size_t)scene->view.shapes_count + 1, sizeof(Surface));
    if (!scene->embree_groups || !scene->embree_surfaces) {
        return REY_ERROR_MEMORY;
    }
    for (int32_t i = 0; i < scene->view.collections; i++) {
        scene->embree_groups[i] = rtcNewScene(scene->embree_device);
        if (!scene->embree_groups[i]) {
            return check_device(scene);
        }
        // Rays come from far away in the units of an instance: without this they slip between its triangles.
        rtcSetSceneFlags(scene->embree_groups[i], flags | RTC_SCENE_FLAG_ROBUST);
    }
    return REY_OK;
}

// Instances are numbered behind the shapes.
static unsigned instance_number(const rey_scene *scene, int32_t id) {
    return (unsigned)(scene->view.shapes_count + id);
}

static void place_instance(rey_scene *scene, int32_t id, RTCGeometry geometry) {
    const SceneView *view = &scene->view;
    rtcSetGeometryTransform(geometry, 0, RTC_FORMAT_FLOAT3X4_ROW_MAJOR, view->tables + view->instances[id].table);
    rtcCommitGeometry(geometry);
}

static rey_result add_instance(rey_scene *scene, int32_t id) {
    RTCGeometry geometry = rtcNewGeometry(scene->embree_device, RTC_GEOMETRY_TYPE_INSTANCE);
    if (!geometry) {
        return check_device(scene);
    }
    rtcSetGeometryInstancedScene(geometry, scene->embree_groups[scene->view.instances[id].group]);
    place_instance(scene, id, geometry);
    rtcAttachGeometryByID(scene->view.embree, geometry, instance_number(scene, id));
    rtcReleaseGeometry(geometry);
    return check_device(scene);
}

static rey_result update_shapes(rey_scene *scene, bool fresh, bool *groups_changed, bool *changed) {
    rey_result result = REY_OK;
    for (int32_t i = 0; i < scene->view.shapes_count && result == REY_OK; i++) {
        const ShapeRecord *shape = scene->view.shapes + i;
        if (!is_embrees(&scene->view, shape)) {
            *changed |= scene->dirty_shapes[i];
            continue;
        }
        if (fresh) {
            result = add_shape(scene, i);
        } else if (scene->dirty_shapes[i]) {
            RTCGeometry geometry = rtcGetGeometry(scene_of(scene, shape), (unsigned)i);
            if (geometry_form(shape->kind)->type != RTC_GEOMETRY_TYPE_USER) {
                rtcUpdateGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0);
            }
            result = set_surface(scene, i, geometry);
            rtcCommitGeometry(geometry);
            result = result == REY_OK ? check_device(scene) : result;
            *changed = true;
        }
        *groups_changed |= shape->collection >= 0 && (fresh || scene->dirty_shapes[i]);
    }
    return result;
}

static rey_result update_instances(rey_scene *scene, bool fresh, bool groups_changed, bool *changed) {
    rey_result result = REY_OK;
    for (int32_t i = 0; i < scene->view.collections && groups_changed; i++) {
        rtcCommitScene(scene->embree_groups[i]);
    }
    for (int32_t i = 0; i < scene->view.instances_count && result == REY_OK; i++) {
        if (fresh) {
            result = add_instance(scene, i);
        } else if (groups_changed || scene->dirty_instances[i]) {
            place_instance(scene, i, rtcGetGeometry(scene->view.embree, instance_number(scene, i)));
            result = check_device(scene);
            *changed = true;
        }
    }
    return result;
}

rey_result rey_accel_update(rey_scene *scene) {
    bool fresh = !scene->view.embree, changed = fresh, groups_changed = false;
    rey_result result = fresh ? accel_create(scene) : REY_OK;
    if (result == REY_OK) {
        result = update_shapes(scene, fresh, &groups_changed, &changed);
    }
    if (result == REY_OK) {
        result = update_instances(scene, fresh, groups_changed, &changed);
    }
    if (result == REY_OK && changed) {
        rtcCommitScene(scene->view.embree);
        result = check_device(scene);
        rey_open_take(&scene->view);
        set_bounds(scene);
        find_beacons(&scene->view);
    }
    if (result != REY_OK && fresh) {
        accel_free(scene); // the next attempt starts anew
    }
    return result;
}
