// cpu.c: picks the kernels of a SIMD width at run time.
#include "backend/backend.h"

#define KERNELS(width)                                                                                                 \
    {rey_kernel_workspace_bytes_##width, rey_kernel_run_##width, rey_kernel_particles_##width,                         \
     rey_kernel_boundary_bytes_##width, rey_kernel_boundary_##width}

const Backend *rey_backend_cpu(int lanes) {
    static const Backend widths[] = {
        KERNELS(w1),
#if REYNOLDS_WIDEST >= 8
        KERNELS(w8),
#endif
#if REYNOLDS_WIDEST >= 16
        KERNELS(w16),
#endif
    };
    return &widths[lanes / 8];
}
