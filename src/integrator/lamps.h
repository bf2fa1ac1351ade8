// lamps.h: lights at a point within homogeneous media. What the medium scatters beside such a light goes with one over the square
// of the distance to it, of which flights that look for collisions by extinction alone have a variance without limit; so a part of
// them looks for angles to the light that are uniform [kulla2012, section 4.1] (track.h).
#pragma once

#include "integrator/walk.h"

enum { MOST_LAMPS_TRIED = 64 }; // lights that it is asked of in which medium they lie

// The direction in which it is asked.
KFN Vec3 lamp_way(void) { return v3_normalize(v3(f_set(0.37f), f_set(0.21f), f_set(0.9f))); }

// Puts a light of a medium behind those of the same one and before those of others.
static void lamp_keep(Tracer *t, const real p[3], int32_t medium) {
    int32_t at = t->lamp_count++;
    for (; at > 0 && t->lamp_medium[at - 1] > medium; at--) {
        t->lamps[at] = t->lamps[at - 1];
        t->lamp_medium[at] = t->lamp_medium[at - 1];
    }
    t->lamps[at] = v3(f_set(p[0]), f_set(p[1]), f_set(p[2]));
    t->lamp_medium[at] = medium;
}

// Finds the first of them.
static void lamps_find(Tracer *t) {
    const SceneView *scene = t->deciding;
    real places[3][MOST_LAMPS_TRIED + LANES];
    int32_t n = 0;
    t->lamp_count = 0;
    for (int64_t i = 0; i < scene->emitters_count && n < MOST_LAMPS_TRIED && scene->has_media; i++) {
        int32_t at[3];
        if (emitter_place(scene->emitters + i, at)) {
            for (int k = 0; k < 3; k++) {
                places[k][n] = (real)scene->theta[at[k]];
            }
            n++;
        }
    }
    for (int32_t k = 0; k < n; k += LANES) {
        for (int32_t i = n; i < k + LANES; i++) {
            places[0][i] = places[1][i] = places[2][i] = 0;
        }
        Vec3 o = v3(f_load(places[0] + k), f_load(places[1] + k), f_load(places[2] + k));
        Int medium = medium_around(t, o, lamp_way(), m_first_n(n - k));
        for (int32_t i = 0; i < LANES && k + i < n && t->lamp_count < MOST_FOCI; i++) {
            const int32_t id = i_lane(medium, i);
            const real p[3] = {places[0][k + i], places[1][k + i], places[2][k + i]};
            if (id >= 0) {
                lamp_keep(t, p, id);
            }
        }
    }
}
