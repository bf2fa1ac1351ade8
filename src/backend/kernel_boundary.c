// kernel_boundary.c: the kernels of the boundary terms of one SIMD width, compiled once per width.
#include "integrator/boundary/indirect.h"
#include "integrator/boundary/primary.h"

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

static void run_primary(Tracer *t, const BoundaryJob *b, const Pinhole *pinhole, const FilterTable *filter, Sink *sink,
                        int32_t *kept, int32_t *begin) {
    const int32_t most = t->ws.chunk / 2;
    for (int64_t at = 0; at < b->count && (!t->job->go_on || t->job->go_on(t->job->user)); at += most) {
        int64_t left = b->count - at;
        int32_t count = left < most ? (int32_t)left : most, half;
        int32_t found = primary_find(t, b, pinhole, b->first + at, count, kept, 0);
        half = (found + LANES - 1) / LANES * LANES;
        primary_start(t, b, pinhole, b->first + at, kept, found, half);
        primary_look(t, b, pinhole, found, half);
        path_forward(t, begin);
        t->placed = false;
        for (int32_t i = 0; i < found && b->job.mode == MODE_REVERSE; i++) {
            float delta[SPEC_N], x = (float)t->ws.film_x[i], y = (float)t->ws.film_y[i];
            film_worth(t->sensor, filter, b->job.adjoint, x, y, (int32_t)floorf(x), (int32_t)floorf(y), delta);
            for (int c = 0; c < SPEC_N; c++) {
                t->ws.adjoint[c][i] = delta[c] * b->scale;
            }
        }
        primary_finish(t, b, pinhole, sink, found, half);
        for (int32_t i = 0; i < found && b->job.mode == MODE_FORWARD; i++) {
            double l[SPEC_N];
            for (int c = 0; c < SPEC_N; c++) {
                l[c] = (double)t->ws.radiance[c][i];
            }
            particle_splat(t, (double)t->ws.film_x[i], (double)t->ws.film_y[i], l);
        }
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
    bool segments = b->kind == BOUNDARY_INDIRECT || b->kind == BOUNDARY_CHAINED;
    Indirect in = {.t = &t, .b = b, .upstream = b->chains && segments};
    bytes += segments_layout(&in.q, (char *)job.workspace + bytes);
    int32_t *kept = (int32_t *)((char *)job.workspace + bytes), *begin = kept + CHUNK + 2 * LANES;
    FilterTable filter;
    filter_tabulate(t.sensor, &filter);
    Pinhole pinhole = pinhole_make(t.scene, t.sensor);
    Sink sink = sink_of(&b->job);
    in.pinhole = &pinhole;
    in.filter = &filter;
    if (b->kind == BOUNDARY_PRIMARY) {
        run_primary(&t, b, &pinhole, &filter, &sink, kept, begin);
    } else {
        run_indirect(&in, &sink, begin);
    }
    b->job.paths = job.paths;
    b->job.rays = job.rays;
    b->job.nonfinite = job.nonfinite;
    b->job.trace_seconds = job.trace_seconds;
}
