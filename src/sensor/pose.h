// pose.h: what sensors share: the sample that a kind is given, the ray that it answers with, and poses.
#pragma once

#include "scene/ray.h"
#include "scene/sink.h"
#include "scene/texture.h"

typedef struct SensorRay {
    Ray ray;
    Float weight; // what the radiance along the ray is worth
} SensorRay;

// A direction of the sensor's space in the world.
KFN Vec3 pose_direction(const SceneView *scene, const SensorRecord *s, Vec3 v) {
    const float *m = scene->theta + s->to_world;
    return v3(m[0] * v.x + m[1] * v.y + m[2] * v.z, m[4] * v.x + m[5] * v.y + m[6] * v.z,
              m[8] * v.x + m[9] * v.y + m[10] * v.z);
}

KFN Vec3 pose_point(const SceneView *scene, const SensorRecord *s, Vec3 v) {
    const float *m = scene->theta + s->to_world;
    return v3_add(v3(f_set(m[3]), f_set(m[7]), f_set(m[11])), pose_direction(scene, s, v));
}

// ---- adjoints: a kind's prefix_ray_adj accumulates those of the ray's origin and direction into the sink ----------

KFN void camera_add(Sink *sink, int number, int i, Float d, Mask m) {
    if (sink->camera_at[number] >= 0) {
        sink_add_uniform(sink, sink->camera_at[number] + i, d, m);
    }
}

KFN void pose_direction_adj(const SceneView *scene, const SensorRecord *s, Vec3 v, Vec3 d, Vec3 *dv, Sink *sink, Mask m) {
    const float *a = scene->theta + s->to_world;
    const Float from[3] = {v.x, v.y, v.z}, to[3] = {d.x, d.y, d.z};
    for (int i = 0; i < 9; i++) {
        camera_add(sink, CAMERA_POSE, 4 * (i / 3) + i % 3, to[i / 3] * from[i % 3], m);
    }
    *dv = v3_add(*dv, v3(a[0] * d.x + a[4] * d.y + a[8] * d.z, a[1] * d.x + a[5] * d.y + a[9] * d.z,
                         a[2] * d.x + a[6] * d.y + a[10] * d.z));
}

KFN void pose_point_adj(const SceneView *scene, const SensorRecord *s, Vec3 v, Vec3 d, Vec3 *dv, Sink *sink, Mask m) {
    const Float to[3] = {d.x, d.y, d.z};
    for (int i = 0; i < 3; i++) {
        camera_add(sink, CAMERA_POSE, 4 * i + 3, to[i], m);
    }
    pose_direction_adj(scene, s, v, d, dv, sink, m);
}

// What arrives at `target`, where the ray meets a surface: adjoint of the ray's position there and of its direction.
typedef struct RayAdj {
    Vec3 target, position, direction;
} RayAdj;

// The ray is o + t normalize(M v), o the sensor's point `from`: accumulates the adjoints of both and of M.
KFN void pose_ray_adj(const SceneView *scene, const SensorRecord *s, Vec3 from, Vec3 v, const RayAdj *ray, Vec3 *dfrom,
                      Vec3 *dv, Sink *sink, Mask m) {
    Vec3 o = pose_point(scene, s, from), dd = v3_zero();
    Float t = v3_length(v3_sub(ray->target, o));
    v3_normalize_adj(pose_direction(scene, s, v), v3_madd(ray->direction, t, ray->position), &dd);
    pose_direction_adj(scene, s, v, dd, dv, sink, m);
    pose_point_adj(scene, s, from, ray->position, dfrom, sink, m);
}
