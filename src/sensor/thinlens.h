// thinlens.h: a camera with a circular aperture; what lies at focus_distance along its axis is sharp [kolb1995 section 2].
// NOT differentiated: as perspective.h, and the lens.
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
