// facing_view.h: where normals of maps turn away from the sensor: curves F = 0 on the film (level_view.h, facing.h), seen by two
// paths on both sides of them,
//   dI += integral dl f (L+ - L-) F' / |grad F|.
#pragma once

#include "integrator/boundary/level_view.h"

// As curves_find: leaves in q the ends of the strips (o, d) and what they are worth (behind).
static void facing_views_find(Tracer *t, const BoundaryJob *b, const Strips *all, int64_t first, const int32_t *kept, int32_t count,
                              Segments *q) {
    q->count = 0;
    for (int32_t i = 0; i < count; i += LANES) {
        strips_number(t, first, kept, i, count);
        Int slot = i_iota() + i;
        SampleKey own = slot_key(t, slot);
        Strip s = strip_sample(all, &own);
        LevelPlace at;
        Mask m = level_narrow(t, b, slot, all->end, &s, m_first_n(count - i));
        m = level_place(t, b, all, slot, 0.5f * (s.x[0] + s.x[1]), 0.5f * (s.y[0] + s.y[1]), false, m, &at);
        if (!m_any(m)) {
            continue;
        }
        Float weight = level_again(t, b, all, slot, &at, m) * f_set(1 / all->density) * f_safe_rcp(at.view.probability);
        m = m & m_gt(weight, f_set(0)) & m_finite(weight);
        strip_keep(&s, weight, strip_apart(all), i_load(kept + i), q, m);
    }
}

// As curves_finish, of paths that curves_start began.
static void facing_views_finish(Tracer *t, const BoundaryJob *b, const Segments *q, Sink *sink, int32_t half) {
    const Strips all = strips_of(t);
    for (int32_t k = 0; k < q->count; k += LANES) {
        Strip s = strip_load(q, k);
        LevelPlace at;
        Int slot = i_iota() + k;
        Float x = 0.5f * (s.x[0] + s.x[1]), y = 0.5f * (s.y[0] + s.y[1]);
        Mask m = level_place(t, b, &all, slot, x, y, false, m_first_n(q->count - k), &at);
        Mask up = m_gt((s.x[1] - s.x[0]) * at.nx + (s.y[1] - s.y[0]) * at.ny, f_set(0)); // F grows towards the second end
        Spec jump = spec_sub(spec_load(t->ws.radiance, k), spec_load(t->ws.radiance, half + k));
        Float worth = f_select(up, f_set(-1), f_set(1)) * f_load(q->behind + k) * f_safe_rcp(at.slope);
        if (b->job.mode == MODE_REVERSE) {
            worth = worth * spec_dot(jump, spec_load(t->ws.adjoint, k));
        }
        m = m & m_finite(worth) & m_finite(spec_sum(jump));
        level_book(t, b, slot, &at.view, x, y, worth, sink, m);
        if (b->job.mode == MODE_FORWARD) {
            spec_store(t->ws.radiance, k, spec_zero_unless(m, spec_scale(jump, sink->derivative)));
            sink->derivative = f_set(0);
        }
    }
}
