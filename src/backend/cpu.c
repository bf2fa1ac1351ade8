// cpu.c: picks the kernels of a SIMD width at run time.
#include "backend/backend.h"

const Backend *rey_backend_cpu(int lanes) {
    static const Backend w1 = {rey_kernel_workspace_bytes_w1, rey_kernel_run_w1, rey_kernel_particles_w1,
                               rey_kernel_boundary_bytes_w1, rey_kernel_boundary_w1};
    static const Backend w8 = {rey_kernel_workspace_bytes_w8, rey_kernel_run_w8, rey_kernel_particles_w8,
                               rey_kernel_boundary_bytes_w8, rey_kernel_boundary_w8};
    static const Backend w16 = {rey_kernel_workspace_bytes_w16, rey_kernel_run_w16, rey_kernel_particles_w16,
                                rey_kernel_boundary_bytes_w16, rey_kernel_boundary_w16};
    return lanes == 16 ? &w16 : lanes == 8 ? &w8 : &w1;
}
