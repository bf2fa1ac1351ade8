// sensor.h: dispatch over the kinds of sensor, generated from kinds.inl. The kind is uniform over a job, but for batches:
// there each sensor of the batch that the lanes belong to is asked in turn.
#pragma once

#include "sensor/distant.h"
#include "sensor/irradiancemeter.h"
#include "sensor/kinds.h"
#include "sensor/orthographic.h"
#include "sensor/perspective.h"
#include "sensor/radiancemeter.h"
#include "sensor/thinlens.h"

// Whether the kind asks for the pair of random numbers beside the film's.
KFN bool sensor_has_lens(const SensorRecord *s) { return s->kind != SENSOR_PERSPECTIVE && s->kind != SENSOR_ORTHOGRAPHIC; }

KFN SensorRay single_sensor_ray(const SceneView *scene, const SensorRecord *s, Float x, Float y, Vec2 lens) {
    switch (s->kind) {
#define SENSOR(ENUM, prefix, name)                                                                                     \
    case SENSOR_##ENUM:                                                                                                \
        return prefix##_ray(scene, s, x, y, lens);
    default:
#include "sensor/kinds.inl"
#undef SENSOR
    }
}

// Accumulates the adjoint of where the ray goes into the sensor's numbers.
// NOT differentiated: irradiancemeters and distant sensors.
static NOINLINE void single_sensor_ray_adj(const SceneView *scene, const SensorRecord *s, Float x, Float y, Vec2 lens,
                                           const RayAdj *ray, Sink *sink, Mask m) {
    switch (s->kind) {
    case SENSOR_PERSPECTIVE:
        perspective_ray_adj(scene, s, x, y, lens, ray, sink, m);
        break;
    case SENSOR_THINLENS:
        thinlens_ray_adj(scene, s, x, y, lens, ray, sink, m);
        break;
    case SENSOR_ORTHOGRAPHIC:
        orthographic_ray_adj(scene, s, x, y, lens, ray, sink, m);
        break;
    case SENSOR_RADIANCEMETER:
        radiancemeter_ray_adj(scene, s, x, y, lens, ray, sink, m);
        break;
    default:
        break;
    }
}

// The film of a batch is divided into columns of equal width, one per sensor.
KFN Int batch_column(const SensorRecord *s, Float x) {
    real width = (real)s->width / (real)s->batch_count;
    return i_min(i_max(i_from_f(x / width), i_set(0)), i_set(s->batch_count - 1));
}

// Positions on the film of a part.
KFN Vec2 batch_position(const SensorRecord *s, int32_t number, const SensorRecord *part, Float x, Float y) {
    real width = (real)s->width / (real)s->batch_count;
    return (Vec2){(x - (real)number * width) * ((real)part->width / width), y * ((real)part->height / (real)s->height)};
}

static NOINLINE SensorRay batch_ray(const SceneView *scene, const SensorRecord *s, Float x, Float y, Vec2 lens) {
    Int which = batch_column(s, x);
    SensorRay r = {{v3_zero(), v3(f_set(0), f_set(0), f_set(1)), f_set(0)}, f_set(0)};
    for (Mask left = m_set(true), mine; m_any(left); left = left & ~mine) {
        int32_t number = i_lane(which, m_first(left));
        const SensorRecord *part = scene->batch_sensors + s->batch + number;
        mine = left & mi_eq(which, i_set(number));
        Vec2 at = batch_position(s, number, part, x, y);
        SensorRay one = single_sensor_ray(scene, part, at.x, at.y, lens);
        r.ray.o = v3_select(mine, one.ray.o, r.ray.o);
        r.ray.d = v3_select(mine, one.ray.d, r.ray.d);
        r.ray.tmax = f_select(mine, one.ray.tmax, r.ray.tmax);
        r.weight = f_select(mine, one.weight, r.weight);
    }
    return r;
}

// The numbers of each part follow those of the one before (sink->camera_at).
static NOINLINE void batch_ray_adj(const SceneView *scene, const SensorRecord *s, Float x, Float y, Vec2 lens, const RayAdj *ray,
                                   Sink *sink, Mask m) {
    const int32_t *camera_at = sink->camera_at;
    Int which = batch_column(s, x);
    for (Mask left = m, mine; m_any(left); left = left & ~mine) {
        int32_t number = i_lane(which, m_first(left));
        const SensorRecord *part = scene->batch_sensors + s->batch + number;
        mine = left & mi_eq(which, i_set(number));
        Vec2 at = batch_position(s, number, part, x, y);
        sink->camera_at = camera_at + number * CAMERA_NUMBERS;
        single_sensor_ray_adj(scene, part, at.x, at.y, lens, ray, sink, mine);
    }
    sink->camera_at = camera_at;
}

// Accumulates the adjoint of where the ray goes into the numbers of the sensor, or of the batch's.
static void sensor_ray_adj(const SceneView *scene, const SensorRecord *s, Float x, Float y, Vec2 lens, const RayAdj *ray,
                           Sink *sink, Mask m) {
    if (s->kind == SENSOR_BATCH) {
        batch_ray_adj(scene, s, x, y, lens, ray, sink, m);
    } else {
        single_sensor_ray_adj(scene, s, x, y, lens, ray, sink, m);
    }
}

// x, y: position on the full film [pixels]; lens: in the unit square.
KFN SensorRay sensor_ray(const SceneView *scene, const SensorRecord *s, Float x, Float y, Vec2 lens) {
    return s->kind == SENSOR_BATCH ? batch_ray(scene, s, x, y, lens) : single_sensor_ray(scene, s, x, y, lens);
}
