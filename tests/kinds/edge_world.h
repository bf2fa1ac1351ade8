// edge_world.h: one shape of each kind that has edges, for tests of points of edges, in floats of one lane.
#pragma once

#define LANES 1
#include "integrator/boundary/edge.h"
#include "integrator/boundary/view.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>

#include <cmocka.h>

enum { POSITIONS, NORMALS = 12, POSE = 24, INSTANCE = 40, CAMERA = 56, FOV = 72, PRINCIPAL = 73, LENS = 75, CONTROLS = 77,
       NUMBERS = 93 };
enum { INSTANCE_AT = 24, TABLES = 48, ROUNDS = 50 };
enum { MESH, INSTANCED, DISK, CYLINDER, SPHERE, TUBE, SHAPES };

typedef struct World {
    SceneView scene;
    ShapeRecord shapes[SHAPES];
    Group groups[SHAPES];
    InstanceRecord instance;
    SensorRecord sensor;
    EdgeRecord edges[2]; // the second one is looked at
    MeetingRecord meeting;
    BoundaryJob job;
    float theta[NUMBERS], tables[TABLES], spheres[SPHERE_TABLE + TABLES], cdf[2];
    int32_t triangles[6], segments[2];
} World;

// Which shapes move.
static inline const int32_t *world_live(void) {
    static const int32_t live[SHAPES] = {LIVE_MOTION, LIVE_MOTION, LIVE_MOTION};
    return live;
}

// A reverse sink of all numbers of theta; instance_at: where the instance's begin, or -1.
static inline Sink world_sink(double *gradient, const int32_t *instance_at) {
    static const int32_t points_at[SHAPES] = {POSITIONS, POSITIONS, -1, -1, -1, -1};
    static const int32_t normals_at[SHAPES] = {NORMALS, NORMALS, -1, -1, -1, -1}, pose_at[SHAPES] = {-1, -1, POSE, -1, -1, -1};
    static const int32_t camera_at[CAMERA_NUMBERS] = {CAMERA, FOV, PRINCIPAL, PRINCIPAL + 1, -1, -1};
    return (Sink){.gradient = gradient,
                  .points_at = points_at,
                  .normals_at = normals_at,
                  .pose_at = pose_at,
                  .instance_at = instance_at,
                  .camera_at = camera_at,
                  .any_motion = true,
                  .any_camera = true};
}

// Probability of the edge.
#define EDGE_SHARE 0.6f

// splitmix64, between -1 and 1
static inline float uniform(uint64_t *state) {
    uint64_t z = (*state += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return (float)((double)((z ^ (z >> 31)) >> 11) * 0x1p-52 - 1);
}

static inline Vec3 random_vector(uint64_t *random) { return v3(uniform(random), uniform(random), uniform(random)); }

static inline void assert_near(const char *what, double found, double expected, double tolerance) {
    if (!(fabs(found - expected) <= tolerance)) {
        fail_msg("%s: %.7g, expected %.7g", what, found, expected);
    }
}

static inline void assert_near_v3(const char *what, Vec3 found, Vec3 expected, double tolerance) {
    assert_near(what, found.x, expected.x, tolerance);
    assert_near(what, found.y, expected.y, tolerance);
    assert_near(what, found.z, expected.z, tolerance);
}

static inline void world_make(World *w, uint64_t *random) {
    memset(w, 0, sizeof *w);
    for (int i = 0; i < NUMBERS; i++) {
        w->theta[i] = uniform(random);
    }
    for (int k = 0; k < 4; k++) {
        w->theta[NORMALS + 3 * k + 2] += 2;
        for (int i = 0; i < 3; i++) { // poses not too far from the identity
            w->theta[POSE + 16 * i + (k < 3 ? 5 * k : 0)] += k < 3 ? 2.5f : 0;
        }
    }
    for (int i = 0; i < 4; i++) { // control points of a tube that bends and widens
        float *point = w->theta + CONTROLS + 4 * i;
        point[0] = 0.8f * (float)i + 0.1f * point[0];
        point[1] *= 0.2f;
        point[2] *= 0.2f;
        point[3] = 0.3f + 0.1f * point[3];
    }
    assert_true(pose_table(w->theta + POSE, w->tables) && pose_table(w->theta + INSTANCE, w->tables + INSTANCE_AT));
    const float sphere[4] = {uniform(random), uniform(random), uniform(random), 1.2f + 0.5f * uniform(random)};
    memcpy(w->spheres, w->tables, sizeof w->tables);
    memcpy(w->spheres + TABLES, sphere, sizeof sphere);
    const int32_t triangles[6] = {0, 1, 2, 1, 0, 3};
    memcpy(w->triangles, triangles, sizeof triangles);
    const ShapeRecord mesh = {.kind = SHAPE_MESH, .flags = SHAPE_HAS_NORMALS, .triangle_count = 2, .vertex_count = 4,
                              .positions = POSITIONS, .normals = NORMALS, .collection = -1};
    w->shapes[MESH] = w->shapes[INSTANCED] = mesh;
    w->shapes[INSTANCED].collection = 0;
    w->shapes[INSTANCED].flags |= SHAPE_INSTANCED | SHAPE_FLIP_NORMALS;
    w->shapes[DISK] = (ShapeRecord){.kind = SHAPE_DISK, .to_world = POSE, .collection = -1};
    w->shapes[CYLINDER] = (ShapeRecord){.kind = SHAPE_CYLINDER, .to_world = POSE, .collection = -1};
    w->shapes[SPHERE] = (ShapeRecord){.kind = SHAPE_SPHERE, .table = TABLES, .collection = -1};
    w->shapes[TUBE] = (ShapeRecord){.kind = SHAPE_BSPLINE, .positions = CONTROLS, .segment_count = 2, .collection = -1};
    for (int i = 0; i < SHAPES; i++) {
        w->shapes[i].group = i;
        w->groups[i] = (Group){.shape_kind = w->shapes[i].kind, .shape_flags = w->shapes[i].flags, .emitter = -1};
    }
    w->instance = (InstanceRecord){.to_world = INSTANCE, .table = INSTANCE_AT};
    w->edges[1] = (EdgeRecord){.opposite = 3, .other = 1, .first = 0.1f, .last = 0.8f};
    w->cdf[0] = 1 - EDGE_SHARE;
    w->cdf[1] = 1;
    w->job = (BoundaryJob){.edges = w->edges, .meetings = &w->meeting, .cdf = w->cdf, .edge_count = 2};
    w->scene.theta = w->theta;
    w->scene.tables = w->spheres;
    w->scene.shapes = w->shapes;
    w->scene.groups = w->groups;
    w->scene.instances = &w->instance;
    w->scene.triangles = w->triangles;
    w->scene.segments = w->segments;
}

static inline EdgePoint point_of(const World *w, float u, Vec3 eye, bool parallel) {
    return edge_sample(&w->scene, &w->job, (Vec2){0.5f, u}, eye, parallel);
}

// The rate of the point over the parameter is the tangent.
static inline void check_tangent(const World *w, const EdgePoint *e, float u, Vec3 eye, bool parallel) {
    const float h = 0.01f, range = w->edges[1].last - w->edges[1].first;
    Vec3 p[2];
    for (int side = 0; side < 2; side++) {
        p[side] = v3_scale(v3_sub(point_of(w, u + h * (float)(2 - side), eye, parallel).p,
                                  point_of(w, u - h * (float)(2 - side), eye, parallel).p), side ? 8 / (12 * h) : -1 / (12 * h));
    }
    assert_near_v3("tangent", v3_scale(e->tangent, range), v3_add(p[0], p[1]), 1e-3 * (1 + v3_length(e->tangent)));
    assert_near("probability", e->probability, EDGE_SHARE / range, 1e-5);
    assert_near_v3("hit", e->hit.p, e->p, 0);
}

static inline Vec3 towards_eye(Vec3 eye, bool parallel, Vec3 p) {
    return parallel ? v3(-eye.x, -eye.y, -eye.z) : v3(eye.x - p.x, eye.y - p.y, eye.z - p.z);
}

static inline Vec3 vertex(const World *w, int i) {
    return v3(w->theta[3 * i], w->theta[3 * i + 1], w->theta[3 * i + 2]);
}

// Before the point, looking at it.
static inline void place_camera(World *w, bool parallel, Vec3 p, uint64_t *random) {
    Vec3 z = v3_normalize(random_vector(random)), eye = v3_madd(p, -5, z);
    Frame f = frame_from_normal(z);
    const Vec3 columns[4] = {f.s, f.t, z, v3_madd(v3_madd(eye, 0.4f, f.s), -0.3f, f.t)};
    for (int k = 0; k < 4; k++) {
        w->theta[CAMERA + k] = columns[k].x;
        w->theta[CAMERA + 4 + k] = columns[k].y;
        w->theta[CAMERA + 8 + k] = columns[k].z;
    }
    w->theta[FOV] = 60;
    w->theta[PRINCIPAL] = w->theta[PRINCIPAL + 1] = parallel ? 0 : 0.1f;
    w->sensor = (SensorRecord){.kind = parallel ? SENSOR_ORTHOGRAPHIC : SENSOR_PERSPECTIVE, .to_world = CAMERA, .fov = FOV,
                               .principal = PRINCIPAL, .lens = -1, .width = 30, .height = 20, .far_clip = 100};
}
