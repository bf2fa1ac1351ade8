// beacon_view.h: what the sensor sees of collisions beside lights at a point, where such a light moves, or the sensor. At a fixed
// position of the film such a collision rides with the sensor's ray (ride.h), and what it scatters of the light changes with one
// over the cube of their distance. With D the motion of the light beyond that of what the sensor sees where the light is, a flow
// that moves collisions by kappa D takes what they scatter along. It is added as a whole: by the divergence theorem
//   integral of div (F kappa D) = integral of F (kappa D . grad log F + D . grad kappa) = 0,
// F what a collision brings to the film, per volume, wherever kappa ends before F jumps. With f the position on the film,
//   kappa = b((f_x - l_x) / u) b((f_y - l_y) / v) (1 - r^2 / R^2)^2,   b(s) = (1 - s^2)^2,
// l that of the light, u and v up to the border of the pixel where the filter is a box, and no farther than the film is sampled,
// and than where something hides what is seen of the ball (render/beacons.c): the wider, the less noise. F grows with the density
// of the film's positions per volume, and with the filter.
#pragma once

#include "integrator/beacon.h"
#include "integrator/carried.h"
#include "integrator/particle_sight.h"

// What of a collision's light sample moves with its light: kappa or chi, its gradient, and kappa or chi times that of the
// logarithm of the density of vertices per volume, together.
typedef struct BeaconFlow {
    Float share, rcp;           // rcp: one over the distance that the ray turns about
    Vec3 slope, film_x, film_y; // film: gradients of the position on the film
    Mask first;                 // lanes that the sensor sees
} BeaconFlow;

// Whether what flows carry across the film is worth more or less there: the box filter's weights do not change within pixels.
KFN bool flows_drift(const Tracer *t) { return t->pinhole && t->sensor->filter != FILM_BOX; }

KFN Vec2 slot_lens(const Tracer *t, Int slot) {
    SampleKey key = slot_key(t, slot);
    return sample_lens(t, &key);
}

// b along one axis of the film, and its derivative by x, where [low, low + width) is sampled.
KFN Float beacon_window(Float x, Float light, Float reach, bool box, int32_t low, int32_t width, Float *slope) {
    Float away = x - light, before = f_min(reach, light - (real)low), behind = f_min(reach, (real)(low + width) - light);
    if (box) {
        Float pixel = light - f_floor(light);
        before = f_min(before, pixel);
        behind = f_min(behind, 1.0f - pixel);
    }
    Float wide = f_select(m_lt(away, f_set(0)), before, behind);
    Mask within = m_lt(f_abs(away), wide) & m_gt(f_min(before, behind), f_set(0));
    Float s = away * f_safe_rcp(f_select(within, wide, f_set(1))), inner = 1.0f - s * s;
    *slope = f_zero_unless(within, -4.0f * s * inner * f_safe_rcp(f_select(within, wide, f_set(1))));
    return f_zero_unless(within, inner * inner);
}

// One over the distance of points that the sensor sees from the end that their rays turn about as they move; 0 of parallel rays.
KFN Float beacon_turn(const Tracer *t, Vec3 p, Vec2 lens) {
    Vec3 on_lens, from = pinhole_origin(t->pinhole, t->scene, t->sensor, lens, &on_lens);
    return t->pinhole->parallel ? f_set(0) : f_safe_rcp(v3_length(v3_sub(p, from)));
}

// The flow of collisions at p that the sensor sees beside their lights.
static NOINLINE BeaconFlow beacon_view(const Tracer *t, Int light, Int slot, Vec3 p, Mask m) {
    BeaconFlow flow = {f_set(0), f_set(0), v3_zero(), v3_zero(), v3_zero(), m};
    Int number = beacon_number(t, light, m);
    Float radius = BEACON_FIELD(t, number, radius), reach = BEACON_FIELD(t, number, reach);
    Vec3 centre = beacon_place(t, number), away = v3_sub(p, centre);
    Float r2 = v3_dot(away, away);
    m = m & mi_lt(i_set(-1), number) & m_gt(reach, f_set(0)) & m_lt(r2, radius * radius);
    if (!m_any(m)) {
        return flow;
    }
    Vec2 lens = slot_lens(t, slot);
    Sight seen = camera_look(t->pinhole, t->scene, t->sensor, centre, lens);
    SightSlope by = camera_slope(t->pinhole, t->scene, t->sensor, p, lens);
    const bool box = t->sensor->filter == FILM_BOX;
    Float slope_x, slope_y, rcp = f_safe_rcp(f_select(m, radius * radius, f_set(1))), inner = 1.0f - r2 * rcp;
    const PathJob *job = t->job;
    Float x = beacon_window(real_gather(t->ws.film_x, slot), seen.x, reach, box, job->seen_x, job->seen_width, &slope_x);
    Float y = beacon_window(real_gather(t->ws.film_y, slot), seen.y, reach, box, job->seen_y, job->seen_height, &slope_y);
    m = m & seen.valid;
    Float ball = inner * inner, share = x * y * ball;
    Vec3 slope = v3_madd(v3_scale(by.density, share), -4.0f * x * y * inner * rcp, away);
    slope = v3_madd(v3_madd(slope, slope_x * y * ball, by.x), x * slope_y * ball, by.y);
    flow.share = f_zero_unless(m, share);
    flow.rcp = beacon_turn(t, p, lens);
    flow.slope = v3_select(m, slope, v3_zero());
    flow.film_x = v3_select(m, by.x, v3_zero());
    flow.film_y = v3_select(m, by.y, v3_zero());
    return flow;
}

// Accumulates the adjoint d of D: of the lights' positions, and in the lanes of `seen` of the sensor.
static NOINLINE void beacon_flow_adj(const Tracer *t, Int light, Int slot, Vec3 d, Mask seen, Sink *sink, Mask m) {
    m = m & m_finite(v3_dot(d, d));
    if (!m_any(m & m_gt(v3_dot(d, d), f_set(0)))) {
        return;
    }
    Vec3 place = beacon_place(t, beacon_number(t, light, m));
    if (sink->any_places) {
        // As the light's direction and distance from a point next to it have it.
        Vec3 up = v3(f_set(0), f_set(0), f_set(1));
        LightMove move = light_move_zero();
        move.d = d;
        move.distance = v3_dot(d, up);
        lights_move_adj(t->scene, i_select(m, light, i_set(0)), m, v3_sub(place, up), up, f_set(1), &move, sink);
    }
    if (sink->any_camera && m_any(seen & m)) {
        Vec2 lens = slot_lens(t, slot);
        Sight at = camera_look(t->pinhole, t->scene, t->sensor, place, lens);
        RayAdj ray = {place, v3_neg(d), v3_zero()};
        sensor_ray_adj(t->scene, t->sensor, at.x, at.y, lens, &ray, sink, seen & m);
    }
}
