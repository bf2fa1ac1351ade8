// orthographic.h: parallel rays along local +z; the film spans [-1, 1] in x before to_world scales it.
#pragma once

#include "sensor/pose.h"

KFN SensorRay orthographic_ray(const SceneView *scene, const SensorRecord *s, Float x, Float y, Vec2 lens) {
    UNUSED(lens);
    real aspect = (real)s->width / (real)s->height;
    Float u = x * (1.0f / (real)s->width), v = y * (1.0f / (real)s->height);
    Vec3 along = v3(f_set(0), f_set(0), f_set(1));
    SensorRay r;
    r.ray.o = pose_point(scene, s, v3(1.0f - 2.0f * u, (1.0f - 2.0f * v) * (1.0f / aspect), f_set(s->near_clip)));
    Vec3 d = pose_direction(scene, s, along);
    r.ray.d = v3_normalize(d);
    r.ray.tmax = (s->far_clip - s->near_clip) * v3_length(d);
    r.weight = f_set(1);
    return r;
}

KFN void orthographic_ray_adj(const SceneView *scene, const SensorRecord *s, Float x, Float y, Vec2 lens,
                              const RayAdj *ray, Sink *sink, Mask m) {
    real aspect = (real)s->width / (real)s->height;
    Float u = x * (1.0f / (real)s->width), v = y * (1.0f / (real)s->height);
    Vec3 from = v3(1.0f - 2.0f * u, (1.0f - 2.0f * v) * (1.0f / aspect), f_set(s->near_clip)), unused = v3_zero();
    UNUSED(lens);
    pose_ray_adj(scene, s, from, v3(f_set(0), f_set(0), f_set(1)), ray, &unused, &unused, sink, m);
}
