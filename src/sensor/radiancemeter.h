// radiancemeter.h: the radiance along one ray, from the origin of its pose along local +z.
#pragma once

#include "sensor/pose.h"

KFN SensorRay radiancemeter_ray(const SceneView *scene, const SensorRecord *s, Float x, Float y, Vec2 lens) {
    UNUSED(x), UNUSED(y), UNUSED(lens);
    SensorRay r;
    r.ray.o = pose_point(scene, s, v3_zero());
    r.ray.d = v3_normalize(pose_direction(scene, s, v3(f_set(0), f_set(0), f_set(1))));
    r.ray.tmax = f_set(INFINITY);
    r.weight = f_set(1);
    return r;
}

KFN void radiancemeter_ray_adj(const SceneView *scene, const SensorRecord *s, Float x, Float y, Vec2 lens,
                               const RayAdj *ray, Sink *sink, Mask m) {
    Vec3 unused = v3_zero();
    UNUSED(x), UNUSED(y), UNUSED(lens);
    pose_ray_adj(scene, s, v3_zero(), v3(f_set(0), f_set(0), f_set(1)), ray, &unused, &unused, sink, m);
}
