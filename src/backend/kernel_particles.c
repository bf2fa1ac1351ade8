// kernel_particles.c: the kernels of light tracing of one SIMD width, compiled once per width.
#include "integrator/particle_adj.h"

// Runs the particles [first, first + count). A chunk whose vertices do not fit the records is run again in halves, as in
// kernel.c.
static void particle_chunk(Tracer *t, const ParticleJob *p, const Pinhole *pinhole, int64_t first, int32_t count,
                           int32_t *begin) {
    PathJob *job = t->job;
    const int64_t paths = job->paths, rays = job->rays;
    particle_start_stage(t, first, count);
    particle_forward(t, pinhole, begin);
    if (t->overflow && count > LANES) {
        job->paths = paths;
        job->rays = rays;
        particle_chunk(t, p, pinhole, first, count / 2, begin);
        particle_chunk(t, p, pinhole, first + count / 2, count - count / 2, begin);
        return;
    }
    switch (job->mode) {
    case MODE_REVERSE:
        particle_backward(t, p->share);
        break;
    case MODE_FORWARD:
        particle_tangent(t);
        break;
    case MODE_REPLAY:
        particle_replay(t);
        break;
    default:
        break;
    }
}

// The groups' offsets lie behind the workspace proper, as in kernel.c.
void KNAME(rey_kernel_particles)(ParticleJob *p) {
    PathJob *job = &p->job;
    Tracer t = {.job = job, .scene = job->scene, .deciding = job->scene, .sensor = job->scene->sensors + job->sensor};
    size_t bytes = workspace_layout(&t.ws, job->workspace, job->mode);
    int32_t *begin = (int32_t *)((char *)job->workspace + bytes);
    Pinhole pinhole = pinhole_make(t.scene, t.sensor);
    t.derivative = mode_records(job->mode);
    t.floor = t.derivative ? DERIVATIVE_FLOOR : 0;
    for (int64_t at = 0; at < p->count && (!job->go_on || job->go_on(job->user)); at += t.ws.chunk) {
        int64_t left = p->count - at;
        particle_chunk(&t, p, &pinhole, p->first + at, left < t.ws.chunk ? (int32_t)left : t.ws.chunk, begin);
    }
}
