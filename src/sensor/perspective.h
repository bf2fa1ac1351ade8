// perspective.h: the pinhole camera. Looks along local +z, +x is left, +y is up [Mitsuba's convention].
// NOT differentiated: pose, field of view, principal point (they move silhouettes across the film).
#pragma once

#include "sensor/pose.h"

// Direction of a position on the film, in the camera's space.
KFN Vec3 perspective_local(const SceneView *scene, const SensorRecord *s, Float x, Float y) {
    real t = (real)tan(0.5 * 3.14159265358979323846 / 180 * (double)scene->theta[s->fov]);
    real aspect = (real)s->width / (real)s->height;
    Float u = x * (1.0f / (real)s->width) + scene->theta[s->principal];
    Float v = y * (1.0f / (real)s->height) + scene->theta[s->principal + 1];
    return v3_normalize(v3((1.0f - 2.0f * u) * t, (1.0f - 2.0f * v) * (t / aspect), f_set(1)));
}

KFN SensorRay perspective_ray(const SceneView *scene, const SensorRecord *s, Float x, Float y, Vec2 lens) {
    UNUSED(lens);
    const float *m = scene->theta + s->to_world;
    Vec3 local = perspective_local(scene, s, x, y);
    SensorRay r;
    r.ray.d = v3_normalize(pose_direction(scene, s, local));
    // Rays start on the near plane and end on the far plane.
    Float slant = 1.0f / local.z;
    r.ray.o = v3_madd(v3(f_set(m[3]), f_set(m[7]), f_set(m[11])), s->near_clip * slant, r.ray.d);
    r.ray.tmax = (s->far_clip - s->near_clip) * slant;
    r.weight = f_set(1);
    return r;
}
