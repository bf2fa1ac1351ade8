// perspective.h: the pinhole camera. Looks along local +z, +x is left, +y is up [Mitsuba's convention].
// NOT differentiated: the clip planes.
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

// Accumulates the adjoint d of the slopes (x, y, 1) that perspective_local makes a unit vector of.
KFN void perspective_slopes_adj(const SceneView *scene, const SensorRecord *s, Float x, Float y, Vec3 d, Sink *sink,
                                Mask m) {
    const double per_degree = 0.5 * 3.14159265358979323846 / 180;
    real t = (real)tan(per_degree * (double)scene->theta[s->fov]);
    real rcp = (real)s->height / (real)s->width;
    Float u = x * (1.0f / (real)s->width) + scene->theta[s->principal];
    Float v = y * (1.0f / (real)s->height) + scene->theta[s->principal + 1];
    // slopes = (1 - 2 u) t, (1 - 2 v) t / aspect
    Float dt = (1.0f - 2.0f * u) * d.x + (1.0f - 2.0f * v) * rcp * d.y;
    camera_add(sink, CAMERA_FOV, 0, dt * ((1 + t * t) * (real)per_degree), m);
    camera_add(sink, CAMERA_PRINCIPAL_X, 0, d.x * (-2 * t), m);
    camera_add(sink, CAMERA_PRINCIPAL_Y, 0, d.y * (-2 * t * rcp), m);
}

KFN void perspective_ray_adj(const SceneView *scene, const SensorRecord *s, Float x, Float y, Vec2 lens,
                             const RayAdj *ray, Sink *sink, Mask m) {
    Vec3 local = perspective_local(scene, s, x, y), dlocal = v3_zero(), unused = v3_zero(), dslopes = v3_zero();
    UNUSED(lens);
    pose_ray_adj(scene, s, v3_zero(), local, ray, &unused, &dlocal, sink, m);
    // local = normalize(slopes), slopes.z = 1
    v3_normalize_adj(v3_scale(local, 1.0f / local.z), dlocal, &dslopes);
    perspective_slopes_adj(scene, s, x, y, dslopes, sink, m);
}
