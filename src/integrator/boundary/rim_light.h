// rim_light.h: the rims of rough refraction in the light of a point or of one direction (rim_vertex.h), as vertices other than the
// camera see them. Particles start on the lights as in light tracing, and leave the surface that they meet along its rim:
//   dI += integral dPhi_x dphi |n_g . v| / |n_g . l| f_+ s g' W
// over the flux that meets the surface and the azimuths of the directions v.
// In media v leads to a collision or to a surface. Segments between surfaces are attached at both ends; collisions ride along with
// what they are seen from (ride.h), in directions that stay, so that x slides over its surface as at the end of a chain.
#pragma once

#include "integrator/boundary/rim_vertex.h"
#include "integrator/particle_start.h"

#define DIMENSION_RIM 0x80000006u

// Particles as they meet surfaces.
typedef struct RimLight {
    RimVertex x;
    Spec flux; // over the density
    Mask m;
} RimLight;

static RimLight rims_shine(Tracer *t, const SampleKey *key, Mask m) {
    const SceneView *scene = t->scene;
    Float choice;
    Vec2 at = rng_2d(key, DIMENSION_EDGE_SEGMENT), way = rng_2d(key, DIMENSION_SEGMENT_END);
    RimLight r = {.flux = spec_zero()};
    Vec3 o = v3_zero(), d = v3(f_set(0), f_set(0), f_set(1));
    m = m & rim_light(scene, key, &r.x.light, &choice);
    for (Mask left = m, mine; m_any(left); left = left & ~mine) {
        int32_t id = i_lane(r.x.light, m_first(left));
        mine = left & mi_eq(r.x.light, i_set(id));
        ParticleStart one = emitter_start(scene, scene->emitters + id, at, way);
        Spec flux = spec_scale(starts_value(scene, r.x.light, mine, one.uv, one.prim), one.factor * f_safe_rcp(choice));
        o = v3_select(mine, one.o, o);
        d = v3_select(mine, one.d, d);
        r.flux = spec_select(mine & one.valid, flux, r.flux);
    }
    m = m & m_gt(spec_max(r.flux), f_set(0)) & m_finite(spec_sum(r.flux));
    Ray ray = {o, d, f_set(INFINITY)};
    Float chance;
    Spec pass; // is part of what arrives from the light
    r.x.hit = veils_meet(t, &ray, key, &chance, &pass, m);
    r.flux = spec_scale(r.flux, chance);
    r.x.light_d = v3_neg(d);
    r.m = m & mi_lt(i_set(-1), r.x.hit.shape);
    Spec value;
    r.x.light_distance = lights_sample(scene, r.x.light, r.m, r.x.hit.p, (Vec2){f_set(0), f_set(0)}, &value).distance;
    return r;
}

// In media: flies from surfaces along `ray` to *near, of segments that are stored next. Returns the lanes whose segments are this
// kind's.
static Mask rims_fly(Tracer *t, const BoundaryJob *job, const Ray *ray, Int slot, Segments *q, Hit *near, Mask m) {
    Int around = medium_around(t, ray->o, ray->d, m);
    SampleKey key = stream_key(t, slot, 0, STREAM_PROBE);
    Leg leg = leg_trace(t, *ray, ray->o, around, &key, m_set(false), m);
    Mask air = mi_lt(i_set(-1), leg.air);
    *near = leg.near;
    if (boundary_is_chained(job->kind)) {
        m = leg.m & (air | m_set(job->chains)); // surfaces may be pieces of chains
    } else {
        m = leg.m & ~(air & m_set(boundary_has_ways(job)));
    }
    segment_keep_leg(around, &leg, q, m);
    return m;
}

// Lets those that meet surfaces of a group leave along the rim, and keeps those that meet something there.
static void rims_leave(Tracer *t, const BoundaryJob *job, const RimLight *in, const SampleKey *key, int32_t group, const Hit *hit,
                       Int number, Mask m, Segments *q) {
    Sink still = sink_of(job->still);
    SurfaceSweep s;
    RimVertex x = in->x;
    x.hit = *hit;
    looked_surface(t, group, hit, m, &s);
    Vec3 wl = frame_to_local(&s.si.sh, x.light_d);
    BsdfSample b = bsdf_sample(&s.call, wl, rng_1d(key, DIMENSION_TURNING_SIDE), rng_2d(key, DIMENSION_RIM));
    m = m & lobe_is(b.lobe, LOBE_RIM);
    if (!m_any(m)) {
        return;
    }
    Float pdf = bsdf_pdf(&s.call, wl, b.wo, b.lobe);
    Vec3 view = frame_to_world(&s.si.sh, b.wo);
    x.d = v3_neg(view);
    x.lobe = b.lobe;
    Rim r = rim_measure(&s, &x, &still, m & m_gt(pdf, f_set(0)));
    r.value = rim_colour(&s, &x, &still, r.m);
    Float weight = f_abs(v3_dot(s.si.ng, view)) * f_safe_rcp(f_abs(v3_dot(s.si.ng, x.light_d)) * pdf);
    Spec l = spec_scale(spec_mul(in->flux, r.value), weight);
    m = r.m & m_finite(spec_sum(l)) & m_gt(spec_max(l), f_set(0));
    if (t->scene->through) { // else they came from there
        Ray shadow;
        shadow_ray(&s.si, x.light_d, x.light_distance, &shadow);
        l = spec_mul(l, rim_lit(t, &shadow, number, m));
        m = m & m_gt(spec_max(l), f_set(0));
    }
    Ray ray = {interaction_offset(&s.si, view), view, f_set(INFINITY)};
    Hit near;
    if (t->scene->has_media) {
        m = rims_fly(t, job, &ray, number, q, &near, m);
    } else {
        t->job->rays += m_count(m);
        near = trace_closest(t->scene, &ray, m, false);
        m = m & mi_lt(i_set(-1), near.shape);
    }
    rims_keep(q, &x, &r, ray.o, &near, l, number, m);
}

// As segments_find.
static void rims_find(Tracer *t, const BoundaryJob *b, int64_t first, int32_t count, Segments *q) {
    q->count = 0;
    for (int32_t i = 0; i < count; i += LANES) {
        batch_numbers(t, i, first);
        SampleKey key = slot_key(t, i_iota() + i);
        RimLight in = rims_shine(t, &key, m_first_n(count - i));
        for (Mask left = in.m; m_any(left);) {
            int32_t id;
            Hit h;
            Mask mine = take_group(t->scene, &in.x.hit, &left, &id, &h);
            if (t->job->live[id] & LIVE_SCATTERING) {
                rims_leave(t, b, &in, &key, id, &h, i_iota() + i, mine, q);
            }
        }
    }
}
