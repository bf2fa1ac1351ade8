// thinlens.h: a camera with a circular aperture; what lies at focus_distance along its axis is sharp [kolb1995 section 2].
// NOT differentiated: as perspective.h.
#pragma once

#include "math/warp.h"
#include "sensor/perspective.h"

KFN SensorRay thinlens_ray(const SceneView *scene, const SensorRecord *s, Float x, Float y, Vec2 lens) {
    real radius = (real)scene->theta[s->lens], focus = (real)scene->theta[s->lens + 1];
    Vec3 pinhole = perspective_local(scene, s, x, y);
    Vec2 at = warp_uniform_disk(lens);
    Vec3 origin = v3(radius * at.x, radius * at.y, f_set(0));
    Vec3 local = v3_normalize(v3_sub(v3_scale(pinhole, focus / pinhole.z), origin));
    SensorRay r;
    r.ray.d = v3_normalize(pose_direction(scene, s, local));
    Float slant = 1.0f / local.z;
    r.ray.o = v3_madd(pose_point(scene, s, origin), s->near_clip * slant, r.ray.d);
    r.ray.tmax = (s->far_clip - s->near_clip) * slant;
    r.weight = f_set(1);
    return r;
}

KFN void thinlens_ray_adj(const SceneView *scene, const SensorRecord *s, Float x, Float y, Vec2 lens, const RayAdj *ray,
                          Sink *sink, Mask m) {
    real radius = (real)scene->theta[s->lens], focus = (real)scene->theta[s->lens + 1];
    Vec3 pinhole = perspective_local(scene, s, x, y), slopes = v3_scale(pinhole, 1.0f / pinhole.z);
    Vec2 at = warp_uniform_disk(lens);
    Vec3 origin = v3(radius * at.x, radius * at.y, f_set(0)), v = v3_sub(v3_scale(slopes, f_set(focus)), origin);
    Vec3 dorigin = v3_zero(), dlocal = v3_zero(), dv = v3_zero();
    pose_ray_adj(scene, s, origin, v3_normalize(v), ray, &dorigin, &dlocal, sink, m);
    // local = normalize(focus slopes - origin)
    v3_normalize_adj(v, dlocal, &dv);
    camera_add(sink, CAMERA_FOCUS, 0, v3_dot(slopes, dv), m);
    perspective_slopes_adj(scene, s, x, y, v3_scale(dv, f_set(focus)), sink, m);
    // origin = radius at
    dorigin = v3_sub(dorigin, dv);
    camera_add(sink, CAMERA_APERTURE, 0, at.x * dorigin.x + at.y * dorigin.y, m);
}
