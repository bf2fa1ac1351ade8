// far.h: what comes along boundary segments from their far sides: paths that begin there, by their number of segments.
#pragma once

#include "integrator/boundary/lines.h"
#include "integrator/boundary/meeting.h"
#include "integrator/boundary/riding.h"
#include "integrator/boundary/rim_light.h"
#include "integrator/film.h"

typedef struct Indirect {
    Tracer *t;
    const BoundaryJob *b;
    const Pinhole *pinhole;
    const FilterTable *filter;
    Segments q;
    bool upstream;  // near points may move with what lies further towards the sensor
    bool glimpses;  // the sensor sees smooth mirrors or glass
    Sink *sink;
} Indirect;

static void slot_numbers(Tracer *t, const Segments *q, int64_t first) {
    for (int32_t k = 0; k < q->count; k++) {
        slot_number(t, k, first + q->number[k]);
    }
}

static int32_t far_half(const Segments *q) { return (q->count + LANES - 1) / LANES * LANES; }

// Starts paths along those segments that end on no light, nor beside one.
static void far_start(Tracer *t, const Segments *q) {
    int32_t *slots = t->ws.order, n = 0;
    for (int32_t k = 0; k < q->count; k++) {
        slots[n] = k;
        n += q->lit[k] != 1 && q->lit[k] != SEGMENT_BESIDE;
    }
    for (int32_t k = 0; k < n; k += LANES) {
        Mask m = m_first_n(n - k);
        Int slot = i_select(m, i_load(slots + k), i_set(slots[k]));
        Ray ray = {LOAD_V3(*q, ox, oy, oz, slot), LOAD_V3(*q, dx, dy, dz, slot), f_zero_unless(m, f_set(INFINITY))};
        path_begin(t, k, slot, &ray, f_set(1));
        if (t->scene->has_media) {
            i_store(t->ws.paths[0].medium + k, i_gather(q->medium, slot));
        }
    }
    t->active = n;
}

// Fills the rungs: radiance that arrives along the segments.
static void far_paths(Indirect *in, int32_t *begin) {
    Tracer *t = in->t;
    Segments *q = &in->q;
    int32_t kind = in->b->kind;
    t->placed = boundary_is_terminator(kind) || kind == BOUNDARY_MEETING || kind == BOUNDARY_LINES;
    if (boundary_is_terminator(kind)) {
        turning_start(t, q, far_half(q));
    } else if (kind == BOUNDARY_MEETING) {
        meetings_start(t, q);
    } else if (kind == BOUNDARY_LINES) {
        lines_start(t, q, far_half(q));
    } else if (boundary_is_paired(kind)) {
        chained_start(t, q, far_half(q));
    } else {
        far_start(t, q);
    }
    for (int c = 0; c < SPEC_N; c++) {
        memset(t->ws.radiance[c], 0, CHUNK * sizeof(real));
    }
    for (int32_t k = 0; k < t->active; k += LANES) { // they do not come from the sensor, from which lights may be hidden
        f_store(t->ws.paths[0].pdf + k, f_set(PDF_DELTA));
    }
    t->current = 0;
    t->record_count = t->batch_count = 0;
    t->overflow = false;
    t->first_bounce = 1;
    t->rungs = q->rungs;
    int32_t depth = t->scene->max_depth;
    t->rungs_kept = 0;
    t->rung_count = depth > 0 && depth <= MOST_RUNGS ? depth - 1 : 1;
    for (int32_t i = 0; i < MOST_RUNGS * SPEC_N; i++) {
        memset(q->rungs[i], 0, (size_t)(t->placed || boundary_is_paired(kind) ? 2 * far_half(q) : q->count) * sizeof(real));
    }
    t->sent = q->sent;
    t->brought = q->brought;
    for (int c = 0; c < SPEC_N; c++) {
        memset(q->sent[c], 0, CHUNK * sizeof(real));
        memset(q->brought[c], 0, CHUNK * sizeof(real));
    }
    t->job->paths += t->active;
    if (in->upstream) {
        t->fork = &q->fork;
        memset(q->fork.way, 0, CHUNK * sizeof(int32_t));
        for (int c = 0; c < SPEC_N; c++) {
            memset(q->fork.air[c], 0, CHUNK * sizeof(real));
            memset(q->fork.first[c], 0, CHUNK * sizeof(real));
        }
    }
    path_forward(t, begin);
    t->fork = NULL;
    t->first_bounce = 0;
    t->placed = false;
    t->nudge[0] = NULL;
    t->rungs = NULL;
}

// The number of segments that paths may have that are continued by particles that reach the sensor after `depth` further
// vertices, less 1; -1: all that there are.
KFN Int far_rung(const Indirect *in, Int depth) {
    const int32_t most = in->t->scene->max_depth;
    Int rung = i_set(most - 2) - depth;
    Mask kept = m_set(most > 0 && most <= MOST_RUNGS) & mi_lt(rung, i_set(in->t->rungs_kept)); // ended paths bring no more
    return i_select(kept & mi_lt(i_set(-1), rung), rung, i_set(-1));
}

// What the paths in the slots brought.
KFN Spec far_reflected(const Indirect *in, Int slot, Int depth) {
    Int rung = far_rung(in, depth);
    Spec l = spec_gather(in->t->ws.radiance, slot);
    for (Mask left = mi_lt(i_set(-1), rung), mine; m_any(left); left = left & ~mine) {
        int32_t one = i_lane(rung, m_first(left));
        mine = left & mi_eq(rung, i_set(one));
        l = spec_select(mine, spec_gather(in->q.rungs + one * SPEC_N, slot), l);
    }
    return l;
}

// What they brought along chains that begin at their first vertices; in media, what is scattered or sent out before the
// first surface.
KFN Spec far_chain(const Indirect *in, Int slot, Int depth) {
    const Fork *fork = &in->q.fork;
    Int way = i_gather(fork->way, slot);
    Mask single = mi_eq(far_rung(in, depth), i_set(0)); // of which only what lets them pass makes chains
    Spec all = far_reflected(in, slot, depth);
    Spec first = spec_select(single, spec_gather(in->q.sent, slot), spec_gather(fork->first, slot));
    Spec chain = spec_zero_unless(mi_eq(way, i_set(FORK_CHAIN)), spec_sub(all, first));
    return spec_select(mi_eq(way, i_set(FORK_AIR)), all, spec_add(spec_gather(fork->air, slot), chain));
}

// What the surfaces that they meet first emit: what they brought with one segment, less what media sent out.
KFN Spec far_emitted(const Indirect *in, Int slot) {
    Spec first = spec_gather(in->q.sent, slot);
    return in->upstream && in->t->scene->has_media ? spec_sub(first, spec_gather(in->q.fork.air, slot)) : first;
}

// What jumps at an edge along a chain: everything, if the near point is part of it. What far points on the lit side emit is
// for segments that end on lights.
KFN Spec far_jump(const Indirect *in, Int slot, Int depth) {
    const Segments *q = &in->q;
    Int other = slot + far_half(q);
    Int kind = i_gather(q->lit, slot);
    Mask lit = mi_eq(kind, i_set(1)), full = mi_eq(i_gather(q->full, slot), i_set(1));
    Spec l = spec_gather(q->light, slot), emitted = spec_zero_unless(mi_eq(kind, i_set(0)), far_emitted(in, slot));
    Spec all = spec_sub(far_reflected(in, slot, depth), emitted), chain = far_chain(in, slot, depth);
    if (!boundary_is_horizon(in->b->kind)) { // whose samples are of one side
        all = spec_sub(all, far_reflected(in, other, depth));
        chain = spec_sub(chain, far_chain(in, other, depth));
    }
    Spec jump = spec_mul(l, spec_select(full, all, chain));
    // Collisions beside lights are a segment more.
    Mask beside = mi_eq(kind, i_set(SEGMENT_BESIDE));
    jump = spec_select(beside, spec_zero_unless(depth_allows(in->t->scene, depth + 3), l), jump);
    return spec_select(lit, spec_zero_unless(full, l), jump);
}

// Radiance along the segments of particles that reach the sensor after `depth` further vertices. Silhouettes leave out what the far
// points emit: that is for segments that end on lights.
KFN Spec far_radiance(const Indirect *in, Int slot, Int depth) {
    const Segments *q = &in->q;
    Spec l = spec_gather(q->light, slot), reflected = far_reflected(in, slot, depth);
    Int other = slot + far_half(q);
    if (boundary_is_rim(in->b->kind)) { // which has a segment more
        Mask full = mi_eq(i_gather(q->full, slot), i_set(1)) | m_set(in->b->kind == BOUNDARY_RIM);
        return spec_zero_unless(full & depth_allows(in->t->scene, depth + 3), l);
    }
    if (boundary_is_chained(in->b->kind)) {
        return far_jump(in, slot, depth);
    }
    if (in->upstream) { // what comes along chains is for those
        reflected = spec_sub(reflected, far_chain(in, slot, depth));
    }
    switch (in->b->kind) {
    case BOUNDARY_TERMINATOR:
    case BOUNDARY_FACING:
        reflected = in->upstream ? spec_add(reflected, far_chain(in, other, depth)) : reflected;
        return spec_sub(reflected, far_reflected(in, other, depth));
    case BOUNDARY_LINES:
        return spec_sub(reflected, far_reflected(in, other, depth));
    case BOUNDARY_HORIZON:
    case BOUNDARY_CUT:
    case BOUNDARY_MEETING:
        return reflected;
    default:
        reflected = spec_mul(l, spec_sub(reflected, far_emitted(in, slot)));
        return spec_select(mi_eq(i_gather(q->lit, slot), i_set(1)), l, reflected);
    }
}

// ---- towards the sensor ------------------------------------------------------------------------------------------

