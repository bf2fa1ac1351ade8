// kernel_boundary.c: the kernels of the boundary terms of one SIMD width, compiled once per width.
#include "integrator/boundary/indirect.h"
#include "integrator/boundary/mirrored.h"
#include "integrator/boundary/primary.h"
#include "integrator/boundary/rim_view.h"
#include "integrator/boundary/facing_view.h"
#include "integrator/lamps.h"

// Behind the workspace proper: the groups' offsets, and which samples of a chunk are kept.
size_t KNAME(rey_kernel_boundary_bytes)(void) {
    Workspace ws;
    Segments segments;
    return workspace_layout(&ws, NULL, MODE_PRIMAL) + (CHUNK + 2 * LANES) * sizeof(int32_t) + segments_layout(&segments, NULL);
}

static void run_indirect(Indirect *in, Sink *sink, int32_t *begin) {
    const Tracer *t = in->t;
    const int32_t most = in->b->kind == BOUNDARY_INDIRECT ? t->ws.chunk : t->ws.chunk / 2; // terminators take two paths
    for (int64_t at = 0; at < in->b->count && (!t->job->go_on || t->job->go_on(t->job->user)); at += most) {
        int64_t left = in->b->count - at;
        indirect_chunk(in, in->b->first + at, left < most ? (int32_t)left : most, sink, begin);
    }
}

// Reverse: the film's adjoint at the film positions of `count` pairs of paths.
static void pairs_adjoint(const Tracer *t, const BoundaryJob *b, const FilterTable *filter, int32_t count) {
    for (int32_t i = 0; i < count && b->job.mode == MODE_REVERSE; i++) {
        float delta[SPEC_N], x = (float)t->ws.film_x[i], y = (float)t->ws.film_y[i];
        film_worth(t->sensor, filter, b->job.adjoint, x, y, (int32_t)floorf(x), (int32_t)floorf(y), delta);
        for (int c = 0; c < SPEC_N; c++) {
            t->ws.adjoint[c][i] = delta[c] * b->scale;
        }
    }
}

// Forward: what they bring there.
static void pairs_splat(Tracer *t, const BoundaryJob *b, int32_t count) {
    for (int32_t i = 0; i < count && b->job.mode == MODE_FORWARD; i++) {
        double l[SPEC_N];
        for (int c = 0; c < SPEC_N; c++) {
            l[c] = (double)t->ws.radiance[c][i];
        }
        particle_splat(t, (double)t->ws.film_x[i], (double)t->ws.film_y[i], l);
    }
}

// Curves of the film that are looked for, and seen by pairs of paths.
static void run_mirrored(Tracer *t, const BoundaryJob *b, const FilterTable *filter, Sink *sink, Segments *q, int32_t *kept,
                         int32_t *begin) {
    const int32_t most = t->ws.chunk / 2;
    const bool turned = b->kind == BOUNDARY_FACING_VIEW;
    const Strips strips = strips_of(t);
    for (int64_t at = 0; at < b->count && (!t->job->go_on || t->job->go_on(t->job->user)); at += most) {
        int64_t left = b->count - at;
        int32_t count = left < most ? (int32_t)left : most, half;
        if (turned) {
            count = level_strips_find(t, b, &strips, b->first + at, count, kept);
            facing_views_find(t, b, &strips, b->first + at, kept, count, q);
        } else {
            count = strips_find(t, b, &strips, b->first + at, count, kept);
            curves_find(t, b, &strips, b->first + at, kept, count, q);
        }
        if (q->count == 0) {
            continue;
        }
        half = (q->count + LANES - 1) / LANES * LANES;
        curves_start(t, q, b->first + at, half);
        t->on_lines = true;
        path_forward(t, begin);
        t->on_lines = false;
        pairs_adjoint(t, b, filter, q->count);
        (turned ? facing_views_finish : curves_finish)(t, b, q, sink, half);
        pairs_splat(t, b, q->count);
    }
}

static void run_rim_view(Tracer *t, const BoundaryJob *b, const FilterTable *filter, Sink *sink, Segments *q, int32_t *kept) {
    const int32_t most = t->ws.chunk;
    const Strips strips = strips_of(t);
    for (int64_t at = 0; at < b->count && (!t->job->go_on || t->job->go_on(t->job->user)); at += most) {
        int64_t left = b->count - at;
        int32_t count = level_strips_find(t, b, &strips, b->first + at, left < most ? (int32_t)left : most, kept);
        rim_views_find(t, b, &strips, b->first + at, kept, count, q);
        pairs_adjoint(t, b, filter, q->count);
        rim_views_finish(t, b, b->first + at, q, sink);
        pairs_splat(t, b, q->count);
    }
}

static void run_primary(Tracer *t, const BoundaryJob *b, const Pinhole *pinhole, const FilterTable *filter, Sink *sink,
                        Segments *q, int32_t *kept, int32_t *begin) {
    const int32_t most = t->ws.chunk / 2;
    for (int64_t at = 0; at < b->count && (!t->job->go_on || t->job->go_on(t->job->user)); at += most) {
        int64_t left = b->count - at;
        int32_t count = left < most ? (int32_t)left : most, half;
        int32_t found = primary_find(t, b, pinhole, b->first + at, count, kept, 0);
        half = (found + LANES - 1) / LANES * LANES;
        primary_start(t, b, pinhole, b->first + at, kept, found, half);
        primary_look(t, b, pinhole, q, found, half);
        path_forward(t, begin);
        t->placed = false;
        t->nudge[0] = NULL;
        pairs_adjoint(t, b, filter, found);
        primary_finish(t, b, pinhole, sink, found, half);
        pairs_splat(t, b, found);
    }
}

void KNAME(rey_kernel_boundary)(BoundaryJob *b) {
    // Paths are traced as for a picture; what they bring is contracted here.
    PathJob job = b->job;
    job.mode = MODE_PRIMAL;
    job.coverage = NULL;
    job.any_motion = false;
    Tracer t = {.job = &job, .scene = job.scene, .deciding = job.scene, .sensor = job.scene->sensors + job.sensor};
    size_t bytes = workspace_layout(&t.ws, job.workspace, MODE_PRIMAL);
    bool turns = boundary_is_terminator(b->kind) || boundary_is_horizon(b->kind);
    bool segments = turns || b->kind == BOUNDARY_INDIRECT || b->kind == BOUNDARY_MEETING || boundary_is_paired(b->kind);
    segments |= boundary_is_rim(b->kind);
    Indirect in = {.t = &t, .b = b, .upstream = boundary_has_ways(b) && segments};
    bytes += segments_layout(&in.q, (char *)job.workspace + bytes);
    int32_t *kept = (int32_t *)((char *)job.workspace + bytes), *begin = kept + CHUNK + 2 * LANES;
    FilterTable filter;
    filter_tabulate(t.sensor, &filter);
    Pinhole pinhole = pinhole_make(t.scene, t.sensor);
    Sink sink = sink_of(&b->job);
    in.pinhole = &pinhole;
    in.filter = &filter;
    in.glimpses = (in.upstream || b->kind == BOUNDARY_LINES || b->kind == BOUNDARY_RIM) && b->mirrored;
    in.sink = &sink;
    lamps_find(&t);
    double unused = 0;
    PathJob still = b->job;
    still.texture_at = still.to_uv_at = still.normals_at = still.attribute_at = still.place_at = b->none;
    still.points_at = still.pose_at = still.instance_at = still.camera_at = still.volume_at = b->none;
    still.gradient = &unused;
    still.tangent = NULL;
    b->still = &still;
    if (b->kind == BOUNDARY_MIRRORED || b->kind == BOUNDARY_FACING_VIEW) {
        run_mirrored(&t, b, &filter, &sink, &in.q, kept, begin);
    } else if (b->kind == BOUNDARY_RIM_VIEW) {
        run_rim_view(&t, b, &filter, &sink, &in.q, kept);
    } else if (b->kind == BOUNDARY_PRIMARY) {
        run_primary(&t, b, &pinhole, &filter, &sink, &in.q, kept, begin);
    } else {
        run_indirect(&in, &sink, begin);
    }
    b->still = NULL;
    b->job.paths = job.paths;
    b->job.rays = job.rays;
    b->job.nonfinite = job.nonfinite;
    b->job.trace_seconds = job.trace_seconds;
}
