// view.h: where the sensor sees a point, and how fast that place moves on the film when the point does.
#pragma once

#include "integrator/particle.h"

// The sensor, and the place on its lens that a sample looks through.
typedef struct View {
    const Pinhole *pinhole;
    const SensorRecord *sensor;
    Vec2 lens;              // in the unit square, as sensor_ray takes it
    Float lens_x, lens_y;   // in the sensor's space
    real focus;             // distance of what is sharp; 0: everything is
    Vec3 eye;               // the world's point that it looks from; parallel views: the direction that it looks along
} View;

static View view_make(const SceneView *scene, const Pinhole *pinhole, const SensorRecord *s, Vec2 lens) {
    View v = {pinhole, s, lens, f_set(0), f_set(0), 0, pinhole->parallel ? pinhole->axis : pinhole->origin};
    if (s->kind == SENSOR_THINLENS) {
        real radius = (real)scene->theta[s->lens];
        Vec2 at = warp_uniform_disk(lens);
        v.lens_x = radius * at.x;
        v.lens_y = radius * at.y;
        v.focus = (real)scene->theta[s->lens + 1];
        v.eye = pose_point(scene, s, v3(v.lens_x, v.lens_y, f_set(0)));
    }
    return v;
}

KFN Vec3 view_local(const View *v, Vec3 d) {
    const real *r = v->pinhole->to_local;
    return v3(r[0] * d.x + r[1] * d.y + r[2] * d.z, r[3] * d.x + r[4] * d.y + r[5] * d.z,
              r[6] * d.x + r[7] * d.y + r[8] * d.z);
}

// A point as it is seen.
typedef struct Seen {
    Vec3 local;      // in the sensor's space
    Float x, y;      // film position [pixels]
    Vec3 d;          // direction from the sensor to it
    Float distance;  // from the eye, or from the plane of the sensor
    Mask valid;      // between the clip planes
} Seen;

// Film position of a slope (of a position, in parallel views).
KFN void view_film(const View *v, Float sx, Float sy, Float *x, Float *y) {
    const Pinhole *p = v->pinhole;
    *x = ((1.0f - sx / p->tangent) * 0.5f - p->shift_x) * (real)v->sensor->width;
    *y = ((1.0f - sy * p->aspect / p->tangent) * 0.5f - p->shift_y) * (real)v->sensor->height;
}

KFN Seen view_see(const View *v, Vec3 point) {
    Seen s;
    s.local = view_local(v, v3_sub(point, v->pinhole->origin));
    Mask before = m_gt(s.local.z, f_set(0));
    s.valid = before & m_ge(s.local.z, f_set(v->sensor->near_clip)) & m_le(s.local.z, f_set(v->sensor->far_clip));
    Float z = f_select(before, s.local.z, f_set(1));
    if (v->pinhole->parallel) {
        view_film(v, s.local.x, s.local.y, &s.x, &s.y);
        s.d = v->eye;
        s.distance = v3_dot(v3_sub(point, v->pinhole->origin), v->eye);
        return s;
    }
    real blur = v->focus > 0 ? 1 / v->focus : 0;
    view_film(v, (s.local.x - v->lens_x) / z + v->lens_x * blur, (s.local.y - v->lens_y) / z + v->lens_y * blur, &s.x,
              &s.y);
    Vec3 d = v3_sub(point, v->eye);
    s.distance = v3_length(d);
    s.d = v3_scale(d, f_safe_rcp(s.distance));
    return s;
}

// What the film position does when the point moves along d.
KFN Vec2 view_push(const View *v, const Seen *s, Vec3 d) {
    Vec3 l = view_local(v, d);
    const Pinhole *p = v->pinhole;
    Float x = l.x, y = l.y;
    if (!p->parallel) {
        Float r = 1.0f / f_select(s->valid, s->local.z, f_set(1));
        x = (l.x - (s->local.x - v->lens_x) * r * l.z) * r;
        y = (l.y - (s->local.y - v->lens_y) * r * l.z) * r;
    }
    return (Vec2){x * (-0.5f * (real)v->sensor->width / p->tangent),
                  y * (-0.5f * (real)v->sensor->height * p->aspect / p->tangent)};
}

// Closest hits on surfaces that are not, in media, of the kind null: these are passed, and counted in *bounce (null: not asked
// for). viewed: rays that the sensor may have sent out, from which lights may be hidden.
static NOINLINE Hit trace_solid(Tracer *t, const Ray *given, bool viewed, Mask m, Int *bounce) {
    const SceneView *scene = t->scene;
    Ray ray = *given;
    Hit met = {.shape = i_set(-1)};
    for (int i = 0; i < MOST_SURFACES_IN_A_ROW && m_any(m); i++) {
        Hit hit = trace_media(t, &ray, m, false);
        t->job->rays += m_count(m);
        hit = viewed && scene->hide_emitters ? trace_past_emitters(t, ray, m, hit) : hit;
        met = hit_select(m, &hit, &met);
        m = scene->has_media ? null_lanes(scene, hit.shape, m & mi_lt(i_set(-1), hit.shape)) : m_set(false);
        Vec3 o = v3_madd(hit.p, interaction_step(hit.p), ray.d);
        ray.tmax = f_select(m, ray.tmax - v3_dot(v3_sub(o, ray.o), ray.d), ray.tmax);
        ray.o = v3_select(m, o, ray.o);
        if (bounce) {
            *bounce = *bounce + i_select(m, i_set(1), i_set(0));
        }
    }
    return met;
}

// In media, lanes whose way towards the sensor is open; *l becomes what of it arrives there. seen: it is the last one, which leads
// past lights that hide.
static Mask sight_clear(Tracer *t, const Ray *ray, Int medium, Int slot, int32_t bounce, bool seen, Mask m, Spec *l) {
    if (!m_any(m)) {
        return m;
    }
    Mask blocked;
    Fog fog = {medium, stream_key(t, slot, bounce, STREAM_SHADOW), seen && t->scene->hide_emitters, f_set(0)};
    Spec through = walk_transmittance(t, *ray, m_set(true), m, &fog, &blocked, NULL);
    *l = spec_mul(*l, through);
    return m & m_gt(spec_max(through), f_set(0));
}
