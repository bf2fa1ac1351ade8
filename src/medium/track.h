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
enum { MOST_FOCI = 4 };

// Who is tracked through: `scene` decides where collisions happen, and `values` says what extinctions are there. They are the
// same, but for pictures of one scene along the paths of another one; those are `padded`: there collisions happen where the
// deciding scene is empty, too.
typedef struct Track {
    const SceneView *scene, *values;
    const MediumNode *medium;
    const VolumeNode *sigma_t;
    bool padded;
    bool roulette; // walks whose transmittance is small end by chance, and those that go on count more
    const Vec3 *focus; // points of the world near which a part of the collisions is looked for; or null
    int32_t foci;
} Track;

// Transmittances below this play roulette.
#define DIM_TRANSMITTANCE 0.2f

// Of padded walks: the optical depth of a whole walk, and the probability of real collisions, are at least this much. (That of
// others is by the majorants, which must be larger than the extinctions wherever another scene's may be less.)
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

KFN Float uniform_choice(Spec sigma, Spec importance, Float u) {
    Float chosen = sigma.c[0], sum = importance.c[0];
    for (int c = 1; c < SPEC_N; c++) {
        chosen = f_select(m_ge(u, sum), sigma.c[c], chosen);
        sum = sum + importance.c[c];
    }
    return chosen;
}

KFN Float uniform_distance(Float u, Float sigma) { return -f_log(1.0f - u) * f_safe_rcp(sigma); }

// A channel is chosen by importance, and the distance by its extinction; what happens is weighed against all channels.
static NOINLINE Flight uniform_flight(const Track *track, Vec3 d, Float tmax, Spec importance, Mask m, const SampleKey *key,
                                      uint32_t dimension) {
    Vec2 u = rng_2d(key, dimension);
    Spec sigma = uniform_extinction(track->scene, track, d), value = uniform_extinction(track->values, track, d);
    Float chosen = uniform_choice(sigma, importance, u.y), t = uniform_distance(u.x, chosen);
    Flight flight;
    flight.real = m & m_gt(chosen, f_set(0)) & m_lt(t, tmax);
    flight.t = f_select(flight.real, t, tmax);
    Spec passed = uniform_transmittance(sigma, flight.t), density = spec_select(flight.real, spec_mul(sigma, passed), passed);
    passed = uniform_transmittance(value, flight.t);
    Spec what = spec_select(flight.real, spec_mul(value, passed), passed);
    flight.weight = spec_scale(what, f_safe_rcp(spec_dot(importance, density)));
    return flight;
}

// Distances along a ray whose density falls with the square of the distance from a point [kulla2012, section 4.1]: the angles at
// which the point sees them are uniform.
typedef struct Focus {
    Float along, across; // from the ray's origin to the point
    Float first, angle;  // that at which it sees the ray begin, and what the ray spans
} Focus;

KFN Focus focus_look(Vec3 point, Vec3 o, Vec3 d, Float tmax) {
    Vec3 to = v3_sub(point, o);
    Focus f = {.along = v3_dot(to, d)};
    f.across = f_max(v3_length(v3_madd(to, -f.along, d)), f_set(1e-5f));
    f.first = f_atan2(-f.along, f.across);
    Mask ends = m_finite(tmax);
    Float length = f_select(ends, tmax, f_set(1));
    // The difference of two angles would lose its digits.
    f.angle = f_atan2(f.across * length, f.across * f.across - f.along * (length - f.along));
    f.angle = f_select(ends, f.angle, 0.5f * PI - f.first);
    return f;
}

KFN Float focus_distance(const Focus *f, Float u) {
    Float s, c;
    f_sincos(f->first + u * f->angle, &s, &c);
    return f->along + f->across * s * f_safe_rcp(f_max(c, f_set(1e-6f)));
}

KFN Float focus_density(const Focus *f, Float t) {
    Float beside = t - f->along;
    return f->across * f_safe_rcp(f->angle * (f->across * f->across + beside * beside));
}

// The points of a track as a ray sees them, one as likely as another.
typedef struct Foci {
    Focus each[MOST_FOCI];
    int32_t count;
} Foci;

static NOINLINE Foci foci_look(const Track *track, Vec3 o, Vec3 d, Float tmax) {
    Foci f = {.count = track->foci};
    for (int32_t i = 0; i < f.count; i++) {
        f.each[i] = focus_look(track->focus[i], o, d, tmax);
    }
    return f;
}

KFN Float foci_distance(const Foci *f, Float u) {
    Float part = u * (real)f->count, distance = focus_distance(&f->each[0], f->count > 1 ? part : u);
    for (int32_t i = 1; i < f->count; i++) {
        Float rest = part - (real)i;
        distance = f_select(m_ge(rest, f_set(0)), focus_distance(&f->each[i], rest), distance);
    }
    return f_max(distance, f_set(0));
}

KFN Float foci_density(const Foci *f, Float t) {
    Float density = focus_density(&f->each[0], t);
    for (int32_t i = 1; i < f->count; i++) {
        density = density + focus_density(&f->each[i], t);
    }
    return density * ((real)1 / (real)f->count);
}

// Probability of distances beyond t.
KFN Float foci_beyond(const Foci *f, Float t) {
    Float beyond = f_set(0);
    for (int32_t i = 0; i < f->count; i++) {
        const Focus *one = &f->each[i];
        beyond = beyond + 1.0f - (f_atan2(t - one->along, one->across) - one->first) * f_safe_rcp(one->angle);
    }
    return f_max(beyond, f_set(0)) * ((real)1 / (real)f->count);
}

// The share of flights that look for collisions near the foci: half of those that collide anyway.
KFN Float foci_share(Spec sigma, Spec importance, Float tmax) {
    return 0.5f - 0.5f * spec_dot(importance, uniform_transmittance(sigma, tmax));
}

// As uniform_flight; such flights are weighed by both densities.
static NOINLINE Flight focused_flight(const Track *track, Vec3 o, Vec3 d, Float tmax, Spec importance, Mask m,
                                      const SampleKey *key, uint32_t dimension) {
    Vec2 u = rng_2d(key, dimension);
    Spec sigma = uniform_extinction(track->scene, track, d), value = uniform_extinction(track->values, track, d);
    Float chosen = uniform_choice(sigma, importance, u.y);
    Foci foci = foci_look(track, o, d, tmax);
    Float share = foci_share(sigma, importance, tmax), rest = 1.0f - share;
    Mask near = m_lt(u.x, share);
    Float t = uniform_distance((u.x - share) * f_safe_rcp(rest), chosen);
    Flight flight;
    flight.real = m & (near | (m_gt(chosen, f_set(0)) & m_lt(t, tmax)));
    t = f_select(near, foci_distance(&foci, u.x * f_safe_rcp(share)), t);
    flight.t = f_select(flight.real, f_min(t, tmax), tmax);
    Spec passed = uniform_transmittance(sigma, flight.t);
    Float collided = rest * spec_dot(importance, spec_mul(sigma, passed)) + share * foci_density(&foci, flight.t);
    Float density = f_select(flight.real, collided, rest * spec_dot(importance, passed));
    passed = uniform_transmittance(value, flight.t);
    flight.weight = spec_scale(spec_select(flight.real, spec_mul(value, passed), passed), f_safe_rcp(density));
    return flight;
}

// A tentative collision turns out to be one or not, with probability p: what that makes of a weight, by channel.
KFN Spec collision_weight(Spec weight, Spec sigma, Float majorant, Float p, Mask collided) {
    Spec share = spec_scale(sigma, f_safe_rcp(majorant)), rest = spec_sub(spec_set(f_set(1)), share);
    Float rcp = f_safe_rcp(f_select(collided, p, 1.0f - p));
    return spec_mul(weight, spec_scale(spec_select(collided, share, rest), rcp));
}

// Delta tracking where all channels are alike.
static NOINLINE Flight grey_flight(const Track *t, Vec3 o, Vec3 d, Float tmax, Mask m, const SampleKey *key,
                                   uint32_t dimension) {
    SampleKey random = *key;
    random.sobol = false;
    MajorantWalk w = track_start(t, o, d, tmax, m);
    Flight flight = {tmax, spec_set(f_set(1)), m_set(false)};
    Mask left = w.m;
    for (uint32_t i = 0; i < MOST_COLLISIONS && m_any(left); i++) {
        Vec2 u = rng_2d(&random, dimension + i);
        Mask met = majorant_next(t->scene, t->medium, &w, track_depth(u.x), left);
        Mask collided = met & m_lt(u.y * w.majorant, grey_extinction(t, &w));
        flight.t = f_select(collided, w.t, flight.t);
        flight.real = flight.real | collided;
        left = met & ~collided;
    }
    return flight;
}

// Flights that are tracked look for collisions near the foci at tentative collisions of a kind of their own. Of these there are
// `rate` per radian that a focus sees pass, so that one which is near is not passed by chance, and LURED_SHARE of them are real
// wherever something may collide. The extinction knows nothing of that: weights do.
typedef struct Lure {
    Foci foci;
    Float rate;
    Float next[MOST_FOCI]; // distances of the next ones
} Lure;

#define LURED_RATE 0.25f
#define LURED_SHARE 0.5f

// The first tentative collision behind t that focus number k asks for.
KFN Float lure_after(const Lure *l, int32_t k, Float t, Float u) {
    const Focus *f = &l->foci.each[k];
    Float s, c, angle = f_atan2(t - f->along, f->across) + track_depth(u) * f_safe_rcp(l->rate);
    Mask none = m_ge(angle, f_set(0.5f * PI - 1e-4f)) | ~m_gt(l->rate, f_set(0));
    f_sincos(f_select(none, f_set(0), angle), &s, &c);
    return f_select(none, f_set(INFINITY), f_max(f->along + f->across * s / c, t));
}

// The share of such collisions in what collides anyway is that of flights, as far as the bound of the medium knows.
static NOINLINE Lure lure_start(const Track *t, const MajorantWalk *w, Vec3 o, Vec3 d, Float tmax, const SampleKey *key,
                                uint32_t dimension) {
    const MediumNode *medium = t->medium;
    const Float most = table_at(t->scene, i_set(medium->table + medium->nx * medium->ny * medium->nz));
    Float depth = f_zero_unless(m_gt(most, f_set(0)), most * (w->end - w->t));
    Lure l = {.foci = foci_look(t, o, d, tmax), .rate = LURED_RATE * (1.0f - f_exp(-depth))};
    for (int32_t k = 0; k < l.foci.count; k++) {
        l.next[k] = lure_after(&l, k, w->t, rng_1d(key, dimension + (uint32_t)k));
    }
    return l;
}

KFN Float lure_next(const Lure *l) {
    Float next = l->next[0];
    for (int32_t k = 1; k < l->foci.count; k++) {
        next = f_min(next, l->next[k]);
    }
    return next;
}

// How many there are per distance at t. Those that were at t are followed by others.
static NOINLINE Float lure_rate(Lure *l, Float t, const SampleKey *key, uint32_t dimension) {
    Float rate = f_set(0);
    for (int32_t k = 0; k < l->foci.count; k++) {
        const Focus *f = &l->foci.each[k];
        Float beside = t - f->along;
        rate = rate + l->rate * f->across * f_safe_rcp(f->across * f->across + beside * beside);
        Mask passed = m_le(l->next[k], t);
        if (m_any(passed)) {
            l->next[k] = f_select(passed, lure_after(l, k, t, rng_1d(key, dimension + (uint32_t)k)), l->next[k]);
        }
    }
    return rate;
}

// Delta tracking in colour, with foci, and along the paths of another scene; of a flight towards tmax, no farther than `far`.
static NOINLINE Flight colour_flight(const Track *t, Vec3 o, Vec3 d, Float far, Float tmax, Spec importance, Mask m,
                                     const SampleKey *key, uint32_t dimension) {
    SampleKey random = *key;
    random.sobol = false;
    MajorantWalk w = track_start(t, o, d, tmax, m);
    const bool lured = t->foci > 0;
    SampleKey own = random; // of the foci's collisions: other walks take numbers of `random` right behind this one's
    uint32_t lures = dimension;
    Lure lure;
    if (lured) {
        own.scramble = rng_mix(random.scramble, 0x6c757265u);
        lure = lure_start(t, &w, o, d, tmax, &own, lures);
    }
    w.end = f_min(w.end, far);
    w.m = w.m & m_lt(w.t, w.end);
    Flight flight = {far, spec_set(f_set(1)), m_set(false)};
    Spec weight = flight.weight; // in the deciding scene
    Mask left = w.m;
    for (uint32_t i = 0; i < MOST_COLLISIONS && m_any(left); i++) {
        Vec2 u = rng_2d(&random, dimension + i);
        Mask met = lured ? majorant_until(t->scene, t->medium, &w, track_depth(u.x), lure_next(&lure), left)
                         : majorant_next(t->scene, t->medium, &w, track_depth(u.x), left);
        Spec sigma = walk_extinction(t->scene, t, &w, o, d), counts = spec_mul(importance, weight);
        Float tentative = w.majorant, more = f_set(0);
        if (lured) {
            lures += MOST_FOCI;
            more = lure_rate(&lure, w.t, &own, lures);
            tentative = tentative + more;
            more = f_zero_unless(m_gt(w.majorant, f_set(0)), LURED_SHARE * more);
        }
        Float sum = spec_sum(counts), real_share = (spec_dot(counts, sigma) + more * sum) * f_safe_rcp(sum * tentative);
        real_share = f_clamp(real_share, f_set(t->padded ? PADDED_SHARE : 0), f_set(1));
        Mask collided = met & m_lt(u.y, real_share);
        weight = spec_select(met, collision_weight(weight, sigma, tentative, real_share, collided), weight);
        if (t->values == t->scene) {
            flight.weight = weight;
        } else {
            Spec value = walk_extinction(t->values, t, &w, o, d);
            Spec other = collision_weight(flight.weight, value, tentative, real_share, collided);
            flight.weight = spec_select(met, other, flight.weight);
        }
        flight.t = f_select(collided, w.t, flight.t);
        flight.real = flight.real | collided;
        left = met & ~collided;
    }
    return flight;
}

// The flight to the next real collision. Collision number i takes dimension + i. importance: shares of the channels, which sum up
// to 1.
static NOINLINE Flight track_flight(const Track *t, Vec3 o, Vec3 d, Float tmax, Spec importance, Mask m, const SampleKey *key,
                                    uint32_t dimension) {
    if (track_is_uniform(t)) {
        return t->foci > 0 ? focused_flight(t, o, d, tmax, importance, m, key, dimension)
                           : uniform_flight(t, d, tmax, importance, m, key, dimension);
    }
    return track_is_grey(t) && t->foci == 0 ? grey_flight(t, o, d, tmax, m, key, dimension)
                            : colour_flight(t, o, d, tmax, tmax, importance, m, key, dimension);
}

// What a flight towards tmax that gets as far as `far` weighs there. It is the same flight: its random numbers are those of
// track_flight.
static NOINLINE Spec track_weight(const Track *t, Vec3 o, Vec3 d, Float far, Float tmax, Spec importance, Mask m,
                                  const SampleKey *key, uint32_t dimension) {
    if (track_is_uniform(t)) {
        Spec sigma = uniform_extinction(t->scene, t, d), passed = uniform_transmittance(uniform_extinction(t->values, t, d), far);
        Float density = spec_dot(importance, uniform_transmittance(sigma, far));
        if (t->foci > 0) {
            Foci foci = foci_look(t, o, d, tmax);
            density = f_lerp(density, foci_beyond(&foci, far), foci_share(sigma, importance, tmax));
        }
        return spec_scale(passed, f_safe_rcp(density));
    }
    if (track_is_grey(t) && t->foci == 0) {
        return spec_set(f_set(1));
    }
    return colour_flight(t, o, d, far, tmax, importance, m, key, dimension).weight;
}
