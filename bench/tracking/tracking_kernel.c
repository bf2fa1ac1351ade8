// tracking_kernel.c: delta tracking alone, compiled once per width.
#include "medium/track.h"
#include "math/warp.h"

#include "tracking.h"

typedef struct Shot {
    SampleKey key;
    Vec3 o, d;
} Shot;

static Shot shoot(int32_t first) {
    Shot s = {.key = {.pixel = (UInt)(i_iota() + first), .sample = u_set(0), .scramble = 1}};
    Vec2 a = rng_2d(&s.key, 0), b = rng_2d(&s.key, 1), c = rng_2d(&s.key, 2);
    s.d = warp_uniform_sphere(c);
    s.o = v3_madd(v3(a.x, a.y, b.x), f_set(-2), s.d);
    return s;
}

static Track tracked(const SceneView *scene, const MediumNode *medium) {
    return (Track){.scene = scene, .values = scene, .medium = medium, .sigma_t = scene->volumes + medium->sigma_t};
}

enum { FIRST_DIMENSION = 8 };

void KNAME(track)(const SceneView *scene, const MediumNode *medium, bool through, int32_t rays, TrackingCount *count) {
    const Track t = tracked(scene, medium);
    const Float far = f_set(INFINITY);
    const Mask all = m_set(true);
    for (int32_t i = 0; i < rays; i += LANES) {
        Shot s = shoot(i);
        count->rays += LANES;
        if (through) {
            count->passed += f_sum(track_transmittance(&t, s.o, s.d, far, all, &s.key, FIRST_DIMENSION).c[0], all);
        } else {
            Spec importance = spec_set(f_set(1.0f / SPEC_N));
            Flight flight = track_flight(&t, s.o, s.d, far, importance, all, &s.key, FIRST_DIMENSION);
            count->passed += LANES - m_count(flight.real);
        }
    }
}

void KNAME(count)(const SceneView *scene, const MediumNode *medium, bool through, int32_t rays, TrackingCount *count) {
    const Track t = tracked(scene, medium);
    for (int32_t i = 0; i < rays; i += LANES) {
        Shot s = shoot(i);
        MajorantWalk w = track_start(&t, s.o, s.d, f_set(INFINITY), m_set(true));
        Int cells = w.ahead[0] + w.ahead[1] + w.ahead[2] + 1;
        Float passed = f_set(1);
        Mask left = w.m;
        for (uint32_t k = 0; m_any(left); k++) {
            Vec2 u = rng_2d(&s.key, FIRST_DIMENSION + k);
            Mask met = majorant_next(scene, medium, &w, track_depth(u.x), left);
            Float share = grey_extinction(&t, &w) * f_safe_rcp(w.majorant);
            Float rest = through ? 1.0f - share : f_select(m_lt(u.y, share), f_set(0), f_set(1));
            count->lookups += m_count(met);
            passed = f_select(met, passed * rest, passed);
            left = met & m_gt(passed, f_set(0));
        }
        cells = cells - w.ahead[0] - w.ahead[1] - w.ahead[2];
        count->cells += (int64_t)f_sum(f_from_i(cells), m_set(true));
        count->passed += f_sum(passed, m_set(true));
        count->rays += LANES;
    }
}
