// backend.h: where kernels run: a handful of functions. Nothing outside this folder knows which backend is in use.
#pragma once

#include "integrator/boundary/boundary_job.h"
#include "integrator/particle_job.h"

typedef struct Backend {
    size_t (*workspace_bytes)(int32_t mode); // without the groups' offsets
    void (*run)(PathJob *job);
    void (*run_particles)(ParticleJob *job);
    size_t (*boundary_bytes)(void);
    void (*run_boundary)(BoundaryJob *job);
} Backend;

// The CPU's kernels of a SIMD width: 1, 8 or 16.
const Backend *rey_backend_cpu(int lanes);
