// kernel_particles.c: the kernels of light tracing of one SIMD width, compiled once per width.
#include "integrator/particle.h"

// The groups' offsets lie behind the workspace proper, as in kernel.c.
void KNAME(rey_kernel_particles)(ParticleJob *p) {
    PathJob *job = &p->job;
    Tracer t = {.job = job, .scene = job->scene, .sensor = job->scene->sensors + job->sensor};
    size_t bytes = workspace_layout(&t.ws, job->workspace, MODE_PRIMAL);
    int32_t *begin = (int32_t *)((char *)job->workspace + bytes);
    Pinhole pinhole = pinhole_make(t.scene, t.sensor);
    for (int64_t at = 0; at < p->count && (!job->go_on || job->go_on(job->user)); at += t.ws.chunk) {
        int64_t left = p->count - at;
        particle_start_stage(&t, p->first + at, left < t.ws.chunk ? (int32_t)left : t.ws.chunk);
        particle_forward(&t, &pinhole, begin);
    }
}
