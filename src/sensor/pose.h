// pose.h: what sensors share: the sample that a kind is given, the ray that it answers with, and poses.
#pragma once

#include "scene/ray.h"
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
