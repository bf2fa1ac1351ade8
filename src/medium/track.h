// track.h: free flights and transmittance through a medium by tracking tentative collisions under local majorants.
// Colours are followed together: a collision is real with the mean of the channels' extinction over majorant, each counted
// by its weight so far, so that the densities of a history are the mean of the channels' own and no weight exceeds their
// number [miller2019; kutz2017 section 5].
#pragma once

#include "math/rng.h"
#include "medium/majorant.h"

// Tentative collisions of one walk; what is left is taken to be blocked.
enum { MOST_COLLISIONS = 1 << 16 };

KFN Spec medium_extinction(const SceneView *scene, const MediumNode *medium, const VolumeNode *sigma_t,
                           const MajorantWalk *w) {
    return spec_scale(volume_eval(scene, sigma_t, majorant_point(w)), f_set((real)scene->theta[medium->scale]));
}

// Optical depth to the next tentative collision.
KFN Float track_depth(const SampleKey *key, uint32_t dimension) {
    return -f_log(f_max(1.0f - rng_1d(key, dimension), f_set(1e-9f)));
}

// Ratio tracking: an unbiased estimate of the transmittance of each channel. Collision number i takes dimension + i.
static NOINLINE Spec track_transmittance(const SceneView *scene, const MediumNode *medium, const VolumeNode *sigma_t, Vec3 o,
                                         Vec3 d, Float tmax, Mask m, const SampleKey *key, uint32_t dimension) {
    MajorantWalk w = majorant_start(scene, medium, sigma_t, o, d, tmax, m);
    Spec transmittance = spec_set(f_set(1));
    Mask left = w.m;
    for (uint32_t i = 0; i < MOST_COLLISIONS && m_any(left); i++) {
        Mask met = majorant_next(scene, medium, &w, track_depth(key, dimension + i), left);
        Spec share = spec_scale(medium_extinction(scene, medium, sigma_t, &w), f_safe_rcp(w.majorant));
        Spec passed = spec_mul(transmittance, spec_sub(spec_set(f_set(1)), share));
        transmittance = spec_select(met, passed, transmittance);
        left = met & m_gt(spec_max(transmittance), f_set(0));
    }
    return transmittance;
}

typedef struct Flight {
    Float t;     // distance to the collision
    Spec weight; // of what happens: extinction is in it, albedo is not
    Spec sigma;  // extinction at the collision
    Mask real;   // lanes that collided; the others pass tmax
} Flight;

// Delta tracking to the next real collision. Collision number i takes dimension + 2 i and the next.
static NOINLINE Flight track_flight(const SceneView *scene, const MediumNode *medium, const VolumeNode *sigma_t, Vec3 o, Vec3 d,
                                    Float tmax, Mask m, const SampleKey *key, uint32_t dimension) {
    MajorantWalk w = majorant_start(scene, medium, sigma_t, o, d, tmax, m);
    Flight flight = {tmax, spec_set(f_set(1)), spec_zero(), m_set(false)};
    Mask left = w.m;
    for (uint32_t i = 0; i < MOST_COLLISIONS && m_any(left); i++) {
        Mask met = majorant_next(scene, medium, &w, track_depth(key, dimension + 2 * i), left);
        Spec sigma = medium_extinction(scene, medium, sigma_t, &w);
        Spec share = spec_scale(sigma, f_safe_rcp(w.majorant)), rest = spec_sub(spec_set(f_set(1)), share);
        Float p = f_clamp(spec_dot(flight.weight, share) * f_safe_rcp(spec_sum(flight.weight)), f_set(0), f_set(1));
        Mask collided = met & m_lt(rng_1d(key, dimension + 2 * i + 1), p);
        Spec hit = spec_scale(spec_mul(flight.weight, share), f_safe_rcp(p));
        Spec missed = spec_scale(spec_mul(flight.weight, rest), f_safe_rcp(1.0f - p));
        flight.weight = spec_select(collided, hit, spec_select(met, missed, flight.weight));
        flight.sigma = spec_select(collided, sigma, flight.sigma);
        flight.t = f_select(collided, w.t, flight.t);
        flight.real = flight.real | collided;
        left = met & ~collided;
    }
    return flight;
}
