// perspective.h: the pinhole camera. Looks along local +z, +x is left, +y is up [Mitsuba's convention].
// NOT differentiated: pose, field of view, principal point (they move silhouettes across the film).
#pragma once

#include "scene/texture.h"

typedef struct Ray {
    Vec3 o, d;
    Float tmax;
} Ray;

// x, y: position on the full film [pixels].
KFN Ray perspective_ray(const SceneView *scene, const SensorRecord *s, Float x, Float y) {
    const float *m = scene->theta + s->to_world;
    real t = (real)tan(0.5 * 3.14159265358979323846 / 180 * (double)scene->theta[s->fov]);
    real aspect = (real)s->width / (real)s->height;
    Float u = x * (1.0f / (real)s->width) + scene->theta[s->principal];
    Float v = y * (1.0f / (real)s->height) + scene->theta[s->principal + 1];
    Vec3 local = v3_normalize(v3((1.0f - 2.0f * u) * t, (1.0f - 2.0f * v) * (t / aspect), f_set(1)));
    Ray ray;
    ray.d = v3_normalize(v3(m[0] * local.x + m[1] * local.y + m[2] * local.z,
                            m[4] * local.x + m[5] * local.y + m[6] * local.z,
                            m[8] * local.x + m[9] * local.y + m[10] * local.z));
    // Rays start on the near plane and end on the far plane.
    Float slant = 1.0f / local.z;
    ray.o = v3_madd(v3(f_set(m[3]), f_set(m[7]), f_set(m[11])), s->near_clip * slant, ray.d);
    ray.tmax = (s->far_clip - s->near_clip) * slant;
    return ray;
}
