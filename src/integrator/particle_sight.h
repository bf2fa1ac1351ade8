// particle_sight.h: the sensor looked up backwards: where on the film a point of the scene is seen, from which direction,
// and what it is worth there.
#pragma once

#include "integrator/stages.h"
#include "math/warp.h"

// The sensor, ready to be looked up backwards.
typedef struct Pinhole {
    Vec3 origin;
    real to_local[9];       // rows of the inverse of the pose's linear part
    real tangent, aspect, shift_x, shift_y;
    real density;           // pixels per area of the film at depth 1, or of the film in the world
    bool parallel;          // orthographic
    Vec3 axis;              // of an orthographic sensor, unit
} Pinhole;

static void pinhole_invert(const float *m, Pinhole *p, double *det) {
    double a[9];
    for (int i = 0; i < 9; i++) {
        a[i] = (double)m[i / 3 * 4 + i % 3];
    }
    double c[9] = {a[4] * a[8] - a[5] * a[7], a[2] * a[7] - a[1] * a[8], a[1] * a[5] - a[2] * a[4],
                   a[5] * a[6] - a[3] * a[8], a[0] * a[8] - a[2] * a[6], a[2] * a[3] - a[0] * a[5],
                   a[3] * a[7] - a[4] * a[6], a[1] * a[6] - a[0] * a[7], a[0] * a[4] - a[1] * a[3]};
    *det = a[0] * c[0] + a[1] * c[3] + a[2] * c[6];
    for (int i = 0; i < 9; i++) {
        p->to_local[i] = (real)(c[i] / *det);
    }
}

// Sensors without a pinhole, and batches, which have several, get one that nobody looks through.
static Pinhole pinhole_make(const SceneView *scene, const SensorRecord *s) {
    if (s->kind == SENSOR_IRRADIANCEMETER || s->kind == SENSOR_BATCH) {
        return (Pinhole){.tangent = 1, .aspect = 1};
    }
    const float *m = scene->theta + s->to_world;
    Pinhole p = {.origin = v3(f_set(m[3]), f_set(m[7]), f_set(m[11])), .aspect = (real)s->width / (real)s->height};
    double det, pixels = (double)s->width * s->height, aspect = (double)p.aspect;
    pinhole_invert(m, &p, &det);
    p.parallel = s->kind == SENSOR_ORTHOGRAPHIC;
    if (p.parallel) {
        Vec3 x = v3(f_set(m[0]), f_set(m[4]), f_set(m[8])), y = v3(f_set(m[1]), f_set(m[5]), f_set(m[9]));
        p.tangent = 1;
        p.axis = v3_normalize(v3(f_set(m[2]), f_set(m[6]), f_set(m[10])));
        p.density = (real)(pixels * aspect / 4) / f_lane(v3_length(v3_cross(x, y)), 0);
        return p;
    }
    p.tangent = (real)tan(0.5 * 3.14159265358979323846 / 180 * (double)scene->theta[s->fov]);
    p.shift_x = (real)scene->theta[s->principal];
    p.shift_y = (real)scene->theta[s->principal + 1];
    p.density = (real)(pixels * aspect / (4 * (double)p.tangent * (double)p.tangent));
    return p;
}

// How a point is seen: where on the film, from which direction, and the pixels per area of a facing surface there.
typedef struct Sight {
    Float x, y, density, length; // length: of the ray, up to the near plane
    Vec3 d;
    Mask valid;
} Sight;

// Where rays begin, but for the near plane: at a point of the lens, of which only thin lenses have more than one.
KFN Vec3 pinhole_origin(const Pinhole *p, const SceneView *scene, const SensorRecord *s, Vec2 u, Vec3 *on_lens) {
    *on_lens = v3_zero();
    if (s->kind != SENSOR_THINLENS) {
        return p->origin;
    }
    real radius = (real)scene->theta[s->lens];
    Vec2 disk = warp_uniform_disk(u);
    *on_lens = v3(radius * disk.x, radius * disk.y, f_set(0));
    return pose_point(scene, s, *on_lens);
}

// A vector from there in the sensor's space.
KFN Vec3 pinhole_local(const Pinhole *p, Vec3 q) {
    const real *r = p->to_local;
    return v3(r[0] * q.x + r[1] * q.y + r[2] * q.z, r[3] * q.x + r[4] * q.y + r[5] * q.z,
              r[6] * q.x + r[7] * q.y + r[8] * q.z);
}

// Slopes of the film's directions and of the rays from a point of a lens differ by a constant, so that both kinds of sensor see
// the same density.
KFN Sight camera_look(const Pinhole *p, const SceneView *scene, const SensorRecord *s, Vec3 point, Vec2 u) {
    Vec3 on_lens, q = v3_sub(point, pinhole_origin(p, scene, s, u, &on_lens)), local = pinhole_local(p, q);
    const real rcp_focus = s->kind == SENSOR_THINLENS ? 1 / (real)scene->theta[s->lens + 1] : 0;
    Mask inside = m_ge(local.z, f_set(s->near_clip)) & m_le(local.z, f_set(s->far_clip));
    Float z = f_select(inside, local.z, f_set(1)), rcp = 1.0f / (p->parallel ? f_set(1) : z);
    Float distance2 = v3_dot(q, q), distance = f_sqrt(distance2);
    Float x = local.x * rcp + on_lens.x * rcp_focus, y = local.y * rcp + on_lens.y * rcp_focus;
    Sight e;
    e.x = ((1.0f - x / p->tangent) * 0.5f - p->shift_x) * (real)s->width;
    e.y = ((1.0f - y * p->aspect / p->tangent) * 0.5f - p->shift_y) * (real)s->height;
    if (p->parallel) {
        e.d = v3_neg(p->axis);
        e.length = (z - s->near_clip) * (v3_dot(q, p->axis) / z);
        e.density = f_set(p->density);
    } else {
        // A pixel's solid angle is its area at depth 1 times the cube of the cosine; and the surface is that far away.
        Float cosine = z / f_select(inside, distance, f_set(1));
        e.d = v3_scale(q, -f_safe_rcp(distance));
        e.length = distance - s->near_clip / cosine;
        e.density = p->density * f_safe_rcp(cosine * cosine * cosine * distance2);
    }
    e.valid = inside;
    return e;
}

// How where a point is seen changes as it moves: gradients of x and y, and of the density's logarithm.
typedef struct SightSlope {
    Vec3 x, y, density;
} SightSlope;

static NOINLINE SightSlope camera_slope(const Pinhole *p, const SceneView *scene, const SensorRecord *s, Vec3 point, Vec2 u) {
    Vec3 on_lens, q = v3_sub(point, pinhole_origin(p, scene, s, u, &on_lens)), local = pinhole_local(p, q), row[3];
    for (int i = 0; i < 3; i++) {
        row[i] = v3(f_set(p->to_local[3 * i]), f_set(p->to_local[3 * i + 1]), f_set(p->to_local[3 * i + 2]));
    }
    const real per_x = (real)-0.5 * (real)s->width / p->tangent, per_y = (real)-0.5 * (real)s->height * p->aspect / p->tangent;
    if (p->parallel) {
        return (SightSlope){v3_scale(row[0], f_set(per_x)), v3_scale(row[1], f_set(per_y)), v3_zero()};
    }
    // (x, y) = (local.x, local.y) / z, and density = length / z^3
    Float rcp = f_safe_rcp(local.z);
    return (SightSlope){v3_scale(v3_madd(row[0], -local.x * rcp, row[2]), per_x * rcp),
                        v3_scale(v3_madd(row[1], -local.y * rcp, row[2]), per_y * rcp),
                        v3_madd(v3_scale(q, f_safe_rcp(v3_dot(q, q))), -3.0f * rcp, row[2])};
}

// By a point on the sensor's shape, whose area the pixels divide: E = integral of L cos.
static NOINLINE Sight meter_look(const SceneView *scene, const SensorRecord *s, Vec3 point, Vec2 u) {
    Interaction si = sensor_shape_point(scene, s->shape, u);
    Vec3 q = v3_sub(point, si.p);
    Float distance2 = v3_dot(q, q), cosine;
    Sight e;
    e.length = f_sqrt(distance2);
    e.d = v3_scale(q, -f_safe_rcp(e.length));
    cosine = -v3_dot(e.d, si.sh.n);
    e.x = u.x * (real)s->width;
    e.y = u.y * (real)s->height;
    e.density = (real)s->width * (real)s->height * cosine * f_safe_rcp(distance2);
    e.valid = m_gt(cosine, f_set(1e-6f)) & m_gt(distance2, f_set(0));
    return e;
}

KFN Sight single_look(const Pinhole *p, const SceneView *scene, const SensorRecord *s, Vec3 point, Vec2 u) {
    return s->kind == SENSOR_IRRADIANCEMETER ? meter_look(scene, s, point, u) : camera_look(p, scene, s, point, u);
}

// One of a batch's sensors, chosen by `choice`; each fills some columns of the film.
static NOINLINE Sight batch_look(const SceneView *scene, const SensorRecord *s, Vec3 point, Float choice, Vec2 u) {
    const int32_t n = s->batch_count;
    const real width = (real)s->width / (real)n;
    Int which = i_min(i_from_f(choice * (real)n), i_set(n - 1));
    Sight e = {f_set(0), f_set(0), f_set(0), f_set(0), v3_zero(), m_set(false)};
    for (Mask left = m_set(true), mine; m_any(left); left = left & ~mine) {
        int32_t number = i_lane(which, m_first(left));
        const SensorRecord *part = scene->batch_sensors + s->batch + number;
        const real scale_x = width / (real)part->width, scale_y = (real)s->height / (real)part->height;
        Pinhole p = pinhole_make(scene, part);
        mine = left & mi_eq(which, i_set(number));
        Sight one = single_look(&p, scene, part, point, u);
        Mask on_film = m_ge(one.x, f_set(0)) & m_lt(one.x, f_set((real)part->width)) & m_ge(one.y, f_set(0)) &
                       m_lt(one.y, f_set((real)part->height));
        e.x = f_select(mine, (real)number * width + one.x * scale_x, e.x);
        e.y = f_select(mine, one.y * scale_y, e.y);
        // The share of a film is stretched, and one sensor stands for all.
        e.density = f_select(mine, one.density * (scale_x * scale_y * (real)n), e.density);
        e.length = f_select(mine, one.length, e.length);
        e.d = v3_select(mine, one.d, e.d);
        e.valid = e.valid | (mine & one.valid & on_film);
    }
    return e;
}
