// irradiancemeter.h: the irradiance that arrives at a shape, from the side of its normals. A position on the film is one
// on the shape, so that pixels divide its area. NOT differentiated: where the shape lies.
#pragma once

#include "math/warp.h"
#include "sensor/pose.h"
#include "shape/shape.h"

// Uniform over the area of a shape. Spheres seen from their centre are sampled so.
static NOINLINE Interaction sensor_shape_point(const SceneView *scene, int32_t id, Vec2 u) {
    const ShapeRecord *shape = scene->shapes + id;
    const float *t = scene->tables + (shape->kind == SHAPE_SPHERE ? shape->table : 0);
    Vec3 centre = shape->kind == SHAPE_SPHERE ? v3(f_set(t[0]), f_set(t[1]), f_set(t[2])) : v3_zero();
    Hit hit = shape_sample(scene, id, centre, u);
    return shape_interaction(scene, shape->kind, shape->flags, &hit);
}

KFN SensorRay irradiancemeter_ray(const SceneView *scene, const SensorRecord *s, Float x, Float y, Vec2 lens) {
    Interaction si = sensor_shape_point(scene, s->shape, (Vec2){x * (1.0f / (real)s->width), y * (1.0f / (real)s->height)});
    Frame frame = frame_from_normal(si.sh.n);
    SensorRay r;
    r.ray.d = frame_to_world(&frame, warp_cosine_hemisphere(lens));
    r.ray.o = interaction_offset(&si, r.ray.d);
    r.ray.tmax = f_set(INFINITY);
    r.weight = f_set(PI); // E = integral of L cos = pi E[L] under the cosine's density
    return r;
}
