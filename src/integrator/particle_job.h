// particle_job.h: one unit of light tracing: a range of the particles.
#pragma once

#include "integrator/job.h"

typedef struct ParticleJob {
    PathJob job;            // its tile is all of the film; film: sums of filter weight times flux per pixel
    int64_t first, count;   // of the particles, in their numbering
    double share;           // of the film's adjoint that a particle's flux has: 1 / pixels
} ParticleJob;

// The kernels of every width.
#define PARTICLE_ENTRY(lanes) void rey_kernel_particles_w##lanes(ParticleJob *job);
PARTICLE_ENTRY(1)
PARTICLE_ENTRY(8)
PARTICLE_ENTRY(16)
