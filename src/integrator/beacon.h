// beacon.h: collisions beside lights at a point, where surfaces, lights or sensors move in media. What such a collision scatters of
// the light goes with one over the square of their distance r. If it rode along with the vertex before it (ride.h), that would
// change with one over the cube, whose integral has no limit; if it stayed with the light, so would what goes with its distance s
// to that vertex. So this part of what leaves it is parted smoothly into chi of it, whose collision moves as the light does, like
// a point of a surface (path_move.h), and 1 - chi, which rides:
//   chi = (1 - r^2 / R^2)^2 s^2 / (r^2 + s^2)   within the ball of radius R around the light, 0 outside;
// each part is differentiated with its share. The balls are such (render/beacons.c) that nothing but even media lies in them.
// Collisions that the sensor sees: beacon_view.h.
#pragma once

#include "integrator/stages.h"

// Numbers of the lights' balls, of which there are some; -1: of lanes that are not in m, and of lights without one.
KFN Int beacon_number(const Tracer *t, Int light, Mask m) {
    return i_select(m, i_gather(t->job->beacon_of, i_select(m, light, i_set(0))), i_set(-1));
}
#define BEACON_FIELD(t, number, field)                                                                                 \
    f_gather(&(t)->job->beacons[0].field, i_max(number, i_set(0)) * (int32_t)(sizeof(Beacon) / sizeof(float)))

// The radii of the balls of the lights of m; lanes without one have the radius 0.
KFN Float beacon_radius(const Tracer *t, Int light, Mask m) {
    if (!t->job->beacons) {
        return f_set(0);
    }
    Int number = beacon_number(t, light, m);
    return f_zero_unless(mi_lt(i_set(-1), number), BEACON_FIELD(t, number, radius));
}

KFN Vec3 beacon_place(const Tracer *t, Int number) {
    return v3(BEACON_FIELD(t, number, x), BEACON_FIELD(t, number, y), BEACON_FIELD(t, number, z));
}

// chi, and its derivatives with respect to r and s.
typedef struct BeaconShare {
    Float chi, by_light, by_vertex;
} BeaconShare;

KFN BeaconShare beacon_share(Float radius, Float r, Float s, Mask m) {
    m = m & m_lt(r, radius) & m_gt(s, f_set(0)) & m_finite(s);
    Float r2 = f_select(m, r * r, f_set(1)), s2 = f_select(m, s * s, f_set(1)), rcp = f_safe_rcp(r2 + s2);
    Float within = 1.0f - r2 * f_safe_rcp(f_select(m, radius * radius, f_set(1)));
    Float inner = within * within, nearer = s2 * rcp;
    Float by_inner = -4.0f * within * r * f_safe_rcp(f_select(m, radius * radius, f_set(1)));
    Float by_light = by_inner * nearer - 2.0f * inner * r * s2 * rcp * rcp;
    return (BeaconShare){f_zero_unless(m, inner * nearer), f_zero_unless(m, by_light),
                         f_zero_unless(m, 2.0f * inner * s * r2 * rcp * rcp)};
}
