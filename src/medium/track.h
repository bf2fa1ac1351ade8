// track.h: free flights and transmittance through a medium: in closed form where it is homogeneous, else by tracking
// tentative collisions under local majorants. Colours are followed together: a collision is real with the mean of the
// channels' extinction over majorant, each counted by its importance and its weight so far, so that the density of a history
// is the mean of the channels' own and no weight exceeds one over the channel's importance [miller2019; kutz2017 section 5].
#pragma once

#include "math/functions.h"
#include "math/rng.h"
#include "medium/flakes.h"
#include "medium/majorant.h"

// Tentative collisions of one walk; what is left is taken to be blocked.
enum { MOST_COLLISIONS = 1 << 16 };

// Who is tracked through: `scene` decides where collisions happen, and `values` says what extinctions are there. They are the
// same, but for pictures of one scene along the paths of another one; those are `padded`: there collisions happen where the
// deciding scene is empty, too.
typedef struct Track {
    const SceneView *scene, *values;
    const MediumNode *medium;
    const VolumeNode *sigma_t;
    bool padded;
    bool roulette; // walks whose transmittance is small end by chance, and those that go on count more
} Track;

// Transmittances below this play roulette.
#define DIM_TRANSMITTANCE 0.2f

// Of padded walks: the optical depth of a whole walk, and the probability of real collisions, are at least this much.
#define PADDED_DEPTH 0.5f
#define PADDED_SHARE 0.05f

// At a point of the space of sigma_t; of media without flakes.
KFN Spec bare_extinction(const SceneView *scene, const Track *t, Vec3 p) {
    return spec_scale(volume_eval(scene, t->sigma_t, p), f_set((real)scene->theta[t->medium->scale]));
}

// Along d at a point of the world; of media of flakes.
static NOINLINE Spec flakes_extinction(const SceneView *scene, const Track *t, Vec3 p, Vec3 d) {
    Spec bare = bare_extinction(scene, t, volume_to_local(scene, t->sigma_t, p, 1));
    return spec_scale(bare, flakes_area(scene, t->medium->flakes, p, d));
}

// Along d at a point of the world.
KFN Spec medium_extinction(const SceneView *scene, const Track *t, Vec3 p, Vec3 d) {
    return t->medium->flakes >= 0 ? flakes_extinction(scene, t, p, d)
                                  : bare_extinction(scene, t, volume_to_local(scene, t->sigma_t, p, 1));
}

// Where a walk along o, d stands; lanes that are nowhere look at o.
KFN Spec walk_extinction(const SceneView *scene, const Track *t, const MajorantWalk *w, Vec3 o, Vec3 d) {
    return t->medium->flakes >= 0 ? flakes_extinction(scene, t, v3_madd(o, f_zero_unless(m_finite(w->t), w->t), d), d)
                                  : bare_extinction(scene, t, majorant_point(w));
}

KFN MajorantWalk track_start(const Track *t, Vec3 o, Vec3 d, Float tmax, Mask m) {
    MajorantWalk w = majorant_start(t->scene, t->medium, t->sigma_t, o, d, tmax, m);
    if (t->padded) {
        w.least = PADDED_DEPTH * f_safe_rcp(w.end - w.t);
    }
    return w;
}

// Optical depth to the next tentative collision.
KFN Float track_depth(Float u) { return -f_log(f_max(1.0f - u, f_set(1e-9f))); }

// Whether all channels are alike, so that weights stay 1. Flakes go the longer way, so that others do not meet them here.
KFN bool track_is_grey(const Track *t) {
    return t->sigma_t->channels == 1 && t->values == t->scene && !t->padded && t->medium->flakes < 0;
}

KFN Float grey_extinction(const Track *t, const MajorantWalk *w) {
    return volume_eval_real(t->scene, t->sigma_t, majorant_point(w)) * (real)t->scene->theta[t->medium->scale];
}

// Homogeneous media, whose flakes are the same everywhere, too.
KFN bool track_is_uniform(const Track *t) {
    bool alike = t->medium->flakes < 0 || !matrix_grid(t->scene, t->medium->flakes);
    return !t->medium->bounded && t->sigma_t->kind == VOLUME_CONSTANT && alike;
}

KFN Spec uniform_extinction(const SceneView *scene, const Track *t, Vec3 d) {
    return t->medium->flakes >= 0 ? flakes_extinction(scene, t, v3_zero(), d) : bare_extinction(scene, t, v3_zero());
}

KFN Spec uniform_transmittance(Spec sigma, Float t) {
    for (int c = 0; c < SPEC_N; c++) {
        // The distance may be infinite where the extinction is 0.
        Float depth = f_zero_unless(m_gt(sigma.c[c], f_set(0)), sigma.c[c] * t);
        sigma.c[c] = f_exp(-depth);
    }
    return sigma;
}

// Ratio tracking: an unbiased estimate of the transmittance of each channel. Collision number i takes dimension + i.
static NOINLINE Spec track_transmittance(const Track *t, Vec3 o, Vec3 d, Float tmax, Mask m, const SampleKey *key,
                                         uint32_t dimension) {
    if (track_is_uniform(t)) {
        return uniform_transmittance(uniform_extinction(t->values, t, d), tmax);
    }
    MajorantWalk w = track_start(t, o, d, tmax, m);
    Spec transmittance = spec_set(f_set(1));
    SampleKey random = *key;
    random.sobol = false;
    Mask left = w.m;
    const bool grey = track_is_grey(t);
    for (uint32_t i = 0; i < MOST_COLLISIONS && m_any(left); i++) {
        Vec2 u = rng_2d(&random, dimension + i);
        Mask met = majorant_next(t->scene, t->medium, &w, track_depth(u.x), left);
        Float rcp = f_safe_rcp(w.majorant);
        Spec passed;
        if (grey) {
            passed = spec_set(transmittance.c[0] * (1.0f - grey_extinction(t, &w) * rcp));
        } else {
            Spec share = spec_scale(walk_extinction(t->values, t, &w, o, d), rcp);
            passed = spec_mul(transmittance, spec_sub(spec_set(f_set(1)), share));
        }
        if (t->roulette) {
            Float survival = f_min(spec_max(passed) * (1 / DIM_TRANSMITTANCE), f_set(1));
            passed = spec_zero_unless(m_lt(u.y, survival), spec_scale(passed, f_safe_rcp(survival)));
        }
        transmittance = spec_select(met, passed, transmittance);
        left = met & m_ne(spec_max(transmittance), f_set(0));
    }
    return transmittance;
}

typedef struct Flight {
    Float t;     // distance to the collision; of lanes that pass, tmax
    Spec weight; // of what happens: extinction is in it, albedo is not
    Mask real;   // lanes that collided
} Flight;

// A channel is chosen by importance, and the distance by its extinction; what happens is weighed against all channels.
static NOINLINE Flight uniform_flight(const Track *track, Vec3 d, Float tmax, Spec importance, Mask m, const SampleKey *key,
                                      uint32_t dimension) {
    Vec2 u = rng_2d(key, dimension);
    Spec sigma = uniform_extinction(track->scene, track, d), value = uniform_extinction(track->values, track, d);
    Float chosen = sigma.c[0], sum = importance.c[0];
    for (int c = 1; c < SPEC_N; c++) {
        chosen = f_select(m_ge(u.y, sum), sigma.c[c], chosen);
        sum = sum + importance.c[c];
    }
    Flight flight;
    Float t = -f_log(1.0f - u.x) * f_safe_rcp(chosen);
    flight.real = m & m_gt(chosen, f_set(0)) & m_lt(t, tmax);
    flight.t = f_select(flight.real, t, tmax);
    Spec passed = uniform_transmittance(sigma, flight.t), density = spec_select(flight.real, spec_mul(sigma, passed), passed);
    passed = uniform_transmittance(value, flight.t);
    Spec what = spec_select(flight.real, spec_mul(value, passed), passed);
    flight.weight = spec_scale(what, f_safe_rcp(spec_dot(importance, density)));
    return flight;
}

// A tentative collision turns out to be one or not, with probability p: what that makes of a weight, by channel.
KFN Spec collision_weight(Spec weight, Spec sigma, Float majorant, Float p, Mask collided) {
    Spec share = spec_scale(sigma, f_safe_rcp(majorant)), rest = spec_sub(spec_set(f_set(1)), share);
    Float rcp = f_safe_rcp(f_select(collided, p, 1.0f - p));
    return spec_mul(weight, spec_scale(spec_select(collided, share, rest), rcp));
}

// Delta tracking where all channels are alike.
static NOINLINE Flight grey_flight(const Track *t, Vec3 o, Vec3 d, Float tmax, Mask m, const SampleKey *random,
                                   uint32_t dimension) {
    MajorantWalk w = track_start(t, o, d, tmax, m);
    Flight flight = {tmax, spec_set(f_set(1)), m_set(false)};
    Mask left = w.m;
    for (uint32_t i = 0; i < MOST_COLLISIONS && m_any(left); i++) {
        Vec2 u = rng_2d(random, dimension + i);
        Mask met = majorant_next(t->scene, t->medium, &w, track_depth(u.x), left);
        Mask collided = met & m_lt(u.y * w.majorant, grey_extinction(t, &w));
        flight.t = f_select(collided, w.t, flight.t);
        flight.real = flight.real | collided;
        left = met & ~collided;
    }
    return flight;
}

// Delta tracking to the next real collision. Collision number i takes dimension + i. importance: shares of the channels,
// which sum up to 1.
static NOINLINE Flight track_flight(const Track *t, Vec3 o, Vec3 d, Float tmax, Spec importance, Mask m, const SampleKey *key,
                                    uint32_t dimension) {
    if (track_is_uniform(t)) {
        return uniform_flight(t, d, tmax, importance, m, key, dimension);
    }
    SampleKey random = *key;
    random.sobol = false;
    if (track_is_grey(t)) {
        return grey_flight(t, o, d, tmax, m, &random, dimension);
    }
    MajorantWalk w = track_start(t, o, d, tmax, m);
    Flight flight = {tmax, spec_set(f_set(1)), m_set(false)};
    Spec weight = flight.weight; // in the deciding scene
    Mask left = w.m;
    for (uint32_t i = 0; i < MOST_COLLISIONS && m_any(left); i++) {
        Vec2 u = rng_2d(&random, dimension + i);
        Mask met = majorant_next(t->scene, t->medium, &w, track_depth(u.x), left);
        Spec sigma = walk_extinction(t->scene, t, &w, o, d), counts = spec_mul(importance, weight);
        Float real_share = spec_dot(counts, sigma) * f_safe_rcp(spec_sum(counts) * w.majorant);
        real_share = f_clamp(real_share, f_set(t->padded ? PADDED_SHARE : 0), f_set(1));
        Mask collided = met & m_lt(u.y, real_share);
        weight = spec_select(met, collision_weight(weight, sigma, w.majorant, real_share, collided), weight);
        if (t->values == t->scene) {
            flight.weight = weight;
        } else {
            Spec value = walk_extinction(t->values, t, &w, o, d);
            Spec other = collision_weight(flight.weight, value, w.majorant, real_share, collided);
            flight.weight = spec_select(met, other, flight.weight);
        }
        flight.t = f_select(collided, w.t, flight.t);
        flight.real = flight.real | collided;
        left = met & ~collided;
    }
    return flight;
}

// What a flight that gets as far as `far` weighs there. It is the same flight: its random numbers are those of track_flight.
static NOINLINE Spec track_weight(const Track *t, Vec3 o, Vec3 d, Float far, Spec importance, Mask m, const SampleKey *key,
                                  uint32_t dimension) {
    if (track_is_uniform(t)) {
        Spec density = uniform_transmittance(uniform_extinction(t->scene, t, d), far);
        Spec passed = uniform_transmittance(uniform_extinction(t->values, t, d), far);
        return spec_scale(passed, f_safe_rcp(spec_dot(importance, density)));
    }
    if (track_is_grey(t)) {
        return spec_set(f_set(1));
    }
    return track_flight(t, o, d, far, importance, m, key, dimension).weight;
}
