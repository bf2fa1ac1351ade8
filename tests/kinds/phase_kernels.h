// phase_kernels.h: what the tests of phase functions share: small cases held in double, and the kernels on them, compiled
// in float at every width and in double throughout.
#pragma once

#include "scene/scene.h"

enum { PHASE_NODES = 8, PHASE_TEXTURES = 8, PHASE_THETA = 256 };

typedef struct PhaseCase {
    int32_t root, node_count, texture_count, theta_count;
    PhaseNode nodes[PHASE_NODES];
    TextureNode textures[PHASE_TEXTURES];
    VolumeNode volumes[PHASE_TEXTURES]; // of textures that are grids
    double theta[PHASE_THETA], tables[PHASE_THETA];
    double floor;
} PhaseCase;

typedef struct PhaseQuery {
    double wi[3], wo[3], uv[2];
    double f, pdf; // out
} PhaseQuery;

typedef struct PhaseDraw {
    double wi[3], uv[2], u1, u2[2];
    double wo[3]; // out
} PhaseDraw;

// Adjoint of one query: df in; the others out.
typedef struct PhaseAdjoint {
    double df, dwi[3], dwo[3];
    double forward; // along `tangent`
} PhaseAdjoint;

typedef struct PhaseKernels {
    const char *name;
    void (*eval)(const PhaseCase *c, int n, PhaseQuery *q);
    void (*sample)(const PhaseCase *c, int n, PhaseDraw *d);
    // Reverse when gradient is not null (theta_count numbers, added to), and forward along tangent when that is not.
    void (*adj)(const PhaseCase *c, int n, const PhaseQuery *q, PhaseAdjoint *a, double *gradient, const double *tangent);
} PhaseKernels;

extern const PhaseKernels phase_kernels_double, phase_kernels_w1, phase_kernels_w8, phase_kernels_w16;
