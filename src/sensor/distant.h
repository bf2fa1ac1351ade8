// distant.h: radiance that leaves the scene in one direction, against local +z: a mean over the scene's cross section, over
// a target shape, or what leaves one point. NOT differentiated: the pose.
#pragma once

#include "math/warp.h"
#include "sensor/irradiancemeter.h"

KFN SensorRay distant_ray(const SceneView *scene, const SensorRecord *s, Float x, Float y, Vec2 lens) {
    UNUSED(x), UNUSED(y);
    real radius = (real)scene->bounds_radius;
    const float *c = scene->bounds_centre;
    SensorRay r;
    r.ray.d = v3_normalize(pose_direction(scene, s, v3(f_set(0), f_set(0), f_set(1))));
    Vec3 target = v3(f_set(s->target[0]), f_set(s->target[1]), f_set(s->target[2]));
    if (s->aim == SENSOR_AIM_SCENE) {
        Vec2 disk = warp_uniform_disk(lens);
        Vec3 across = pose_direction(scene, s, v3(disk.x, disk.y, f_set(0)));
        target = v3_madd(v3(f_set(c[0]), f_set(c[1]), f_set(c[2])), f_set(radius), across);
    } else if (s->aim == SENSOR_AIM_SHAPE) {
        target = sensor_shape_point(scene, s->shape, lens).p;
    }
    // Far enough to start outside of the scene.
    Vec3 to_centre = v3_sub(v3(f_set(c[0]), f_set(c[1]), f_set(c[2])), target);
    Float back = v3_length(to_centre) + radius;
    r.ray.o = v3_madd(target, -back, r.ray.d);
    r.ray.tmax = f_set(INFINITY);
    r.weight = f_set(1);
    return r;
}
