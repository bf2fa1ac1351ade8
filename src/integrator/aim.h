// aim.h: directions towards points beside which collisions bring much: the camera that particles look for, and lights at a point
// within homogeneous media (lamps.h). A ray that passes such a point at a distance brings one over that distance, of which
// directions that know nothing of it have a variance without limit: a share of them takes angles to the point that are uniform.
#pragma once

#include "integrator/stages.h"

#define DIMENSION_AIM 0x80000100u

typedef struct Aim {
    const Vec3 *points; // one is as likely as another
    int32_t count;      // 0: nothing is aimed at
    real share;         // of the directions
} Aim;

KFN Aim aim_of(const Tracer *t) {
    return t->focus ? (Aim){t->focus, 1, 0.5f} : (Aim){t->lamps, t->lamp_count, 0.25f};
}

static NOINLINE Float aim_mixture(const Aim *aim, Vec3 p, Vec3 d, Float pdf) {
    Float sum = f_set(0);
    for (int32_t i = 0; i < aim->count; i++) {
        Vec3 axis = v3_normalize(v3_sub(aim->points[i], p));
        Float sine = f_max(v3_length(v3_cross(axis, d)), f_set(1e-6f));
        sum = sum + f_zero_unless(m_gt(v3_dot(axis, d), f_set(0)), INV_PI * INV_PI / sine);
    }
    return f_lerp(pdf, sum * ((real)1 / (real)aim->count), f_set(aim->share));
}

// Density of a direction from p that is chosen with the density pdf where nothing is aimed at.
KFN Float aim_density(const Aim *aim, Vec3 p, Vec3 d, Float pdf) {
    return aim->count == 0 ? pdf : aim_mixture(aim, p, d, pdf);
}

// Turns a share of the directions d of m from p; returns which.
static NOINLINE Mask aim_take(const Aim *aim, Vec3 p, const SampleKey *key, int32_t bounce, Mask m, Vec3 *d) {
    uint32_t at = DIMENSION_AIM + 2 * (uint32_t)bounce;
    Float choice = rng_1d(key, at) * (1 / aim->share);
    Vec2 u = rng_2d(key, at + 1);
    Int chosen = i_from_f(choice * (real)aim->count);
    Vec3 point = aim->points[0];
    for (int32_t i = 1; i < aim->count; i++) {
        point = v3_select(mi_eq(chosen, i_set(i)), aim->points[i], point);
    }
    Float s, c, x, y;
    f_sincos(0.5f * PI * u.x, &s, &c);
    f_sincos(TWO_PI * u.y, &y, &x);
    Frame frame = frame_from_normal(v3_normalize(v3_sub(point, p)));
    m = m & m_lt(choice, f_set(1));
    *d = v3_select(m, frame_to_world(&frame, v3(s * x, s * y, c)), *d);
    return m;
}
