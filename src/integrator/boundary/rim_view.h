// rim_view.h: the rims of rough refraction in the light of a point or of one direction (rim_vertex.h), as the sensor sees them, or
// sees them in smooth mirrors and through smooth glass. There they are curves g = 0 on the film (level_view.h),
//   dI += integral dl f_+ s g' L / |grad g|.
#pragma once

#include "integrator/boundary/level_view.h"

// Keeps the places that those strips find: where on the film, in ws, and in q the strip's number and what the derivative of g there
// is worth.
static void rim_views_find(Tracer *t, const BoundaryJob *b, const Strips *all, int64_t first, const int32_t *kept, int32_t count,
                           Segments *q) {
    q->count = 0;
    for (int32_t i = 0; i < count; i += LANES) {
        strips_number(t, first, kept, i, count);
        Int slot = i_iota() + i;
        SampleKey own = slot_key(t, slot);
        Strip s = strip_sample(all, &own);
        Mask m = level_narrow(t, b, slot, all->end, &s, m_first_n(count - i));
        if (!m_any(m)) {
            continue;
        }
        LevelPlace at;
        Float x = 0.5f * (s.x[0] + s.x[1]), y = 0.5f * (s.y[0] + s.y[1]);
        m = level_place(t, b, all, slot, x, y, true, m, &at);
        Spec lit = rim_lit(t, &at.view.shadow, slot, m);
        lit = t->scene->has_media ? sightline_clear(t, &at.view.line, at.view.level + 1, slot, 0, m, lit) : lit;
        m = m & m_gt(spec_max(lit), f_set(0));
        if (!m_any(m)) {
            continue;
        }
        Float weight = level_again(t, b, all, slot, &at, m) * f_safe_rcp(at.slope) * f_set(1 / all->density);
        Spec l = spec_mul(spec_mul(lit, spec_mul(at.view.through, at.view.arrives)), at.view.rim.value);
        l = spec_scale(l, weight * f_safe_rcp(at.view.probability));
        m = m & m_gt(weight, f_set(0)) & m_finite(spec_sum(l)) & m_gt(spec_max(l), f_set(0));
        f_compress(t->ws.film_x + q->count, x, m);
        f_compress(t->ws.film_y + q->count, y, m);
        spec_compress(q->light, q->count, l, m);
        i_compress(q->number + q->count, i_load(kept + i), m);
        q->count += m_count(m);
    }
}

// Books them. Reverse: the film's adjoint lies in ws.adjoint.
static void rim_views_finish(Tracer *t, const BoundaryJob *b, int64_t first, const Segments *q, Sink *sink) {
    for (int32_t k = 0; k < q->count; k += LANES) {
        Mask m = m_first_n(q->count - k);
        Int slot = i_iota() + k;
        Float x = f_load(t->ws.film_x + k), y = f_load(t->ws.film_y + k);
        LevelView v;
        strips_number(t, first, q->number, k, q->count);
        level_look(t, b, slot, x, y, false, m, &v);
        Spec l = spec_load(q->light, k);
        bool forward = b->job.mode == MODE_FORWARD;
        Float worth = forward ? f_set(1) : spec_dot(l, spec_load(t->ws.adjoint, k));
        m = m & v.rim.m & m_finite(worth);
        level_book(t, b, slot, &v, x, y, worth, sink, m);
        if (forward) {
            spec_store(t->ws.radiance, k, spec_zero_unless(m, spec_scale(l, sink->derivative)));
            sink->derivative = f_set(0);
        }
    }
}
