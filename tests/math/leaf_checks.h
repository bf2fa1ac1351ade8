// leaf_checks.h: the list of leaf functions that are checked generically, as maps from a few numbers to a few numbers.
// The kernels behind it (leaf_kernels.c) are compiled in double and in float at every width.
#pragma once

#include <stdbool.h>

enum { LEAF_MAX = 12 }; // most inputs or outputs of a leaf

// value tolerances: |float - double| <= relative * |double| + absolute.
typedef struct LeafInfo {
    const char *name;
    int inputs, outputs;
    bool has_adjoint;
    double relative, absolute;
    double adjoint_relative; // of the largest adjoint entry
} LeafInfo;

#define LEAVES(L)                                                                                                      \
    L(DIELECTRIC, fresnel_dielectric, 2, 2, true, 1e-5, 1e-6, 5e-5)                                                    \
    L(CONDUCTOR, fresnel_conductor, 7, 3, true, 4e-6, 2e-7, 5e-5)                                                      \
    L(DIFFUSE_REFLECTANCE, fresnel_diffuse_reflectance, 1, 1, true, 1e-5, 1e-6, 1e-4)                                  \
    L(SCHLICK, schlick_weight, 1, 1, true, 1e-5, 1e-7, 1e-5)                                                           \
    L(D_GGX, microfacet_D_ggx, 5, 1, true, 2e-6, 1e-20, 4e-6)                                                          \
    L(D_BECKMANN, microfacet_D_beckmann, 5, 1, true, 5e-6, 1e-7, 1e-5)                                                 \
    L(G1_GGX, smith_G1_ggx, 5, 1, true, 1e-6, 1e-8, 3e-6)                                                              \
    L(G1_BECKMANN, smith_G1_beckmann, 5, 1, true, 1e-6, 1e-8, 4e-3)                                                    \
    L(AREA_GGX, microfacet_projected_area_ggx, 5, 1, false, 1e-6, 0, 0)                                                \
    L(AREA_BECKMANN, microfacet_projected_area_beckmann, 5, 1, false, 1e-6, 2e-7, 0)                                   \
    L(SAMPLE_GGX, microfacet_sample_ggx, 7, 3, false, 2e-5, 2e-5, 0)                                                   \
    L(SAMPLE_BECKMANN, microfacet_sample_beckmann, 7, 3, false, 2e-5, 2e-5, 0)                                         \
    L(SAMPLE_ALL_GGX, microfacet_sample_all_ggx, 4, 3, false, 1e-5, 2e-5, 0)                                           \
    L(SAMPLE_ALL_BECKMANN, microfacet_sample_all_beckmann, 4, 3, false, 1e-5, 2e-5, 0)                                 \
    L(EXP, f_exp, 1, 1, false, 1e-6, 0, 0)                                                                             \
    L(LOG, f_log, 1, 1, false, 1e-6, 0, 0)                                                                             \
    L(SINCOS, f_sincos, 1, 2, false, 0, 1.2e-7, 0)                                                                     \
    L(ATAN2, f_atan2, 2, 1, false, 0, 4e-7, 0)                                                                         \
    L(ACOS, f_acos, 1, 1, false, 0, 4e-7, 0)                                                                           \
    L(ERFINV, f_erfinv, 1, 1, false, 1e-5, 1e-7, 0)                                                                    \
    L(ERF, f_erf, 1, 1, false, 2e-6, 3e-7, 0)                                                                          \
    L(CROSS, v3_cross, 6, 3, true, 1e-6, 1e-6, 2e-6)                                                                   \
    L(NORMALIZE, v3_normalize, 3, 3, true, 1e-6, 1e-7, 1e-5)                                                           \
    L(TO_LOCAL, frame_to_local, 12, 3, true, 1e-6, 1e-6, 2e-6)

#define LEAF_ENUM(id, name, ...) LEAF_##id,
enum { LEAVES(LEAF_ENUM) LEAF_COUNT };
#undef LEAF_ENUM

#define LEAF_INFO(id, name, ...) {#name, __VA_ARGS__},
static const LeafInfo leaf_info[LEAF_COUNT] = {LEAVES(LEAF_INFO)};
#undef LEAF_INFO

// Evaluates leaf at count inputs, [count][LEAF_MAX] numbers in and out; adj accumulates into din from dout.
typedef void leaf_value_fn(int leaf, int count, const double *in, double *out);
typedef void leaf_adj_fn(int leaf, int count, const double *in, const double *dout, double *din);
// Bits of rng_2d and rng_1d as three floats each, for samples 0 .. count - 1 of one pixel.
typedef void leaf_rng_fn(unsigned pixel, unsigned scramble, unsigned dimension, bool sobol, int count, float *out);

leaf_value_fn leaf_value_double, leaf_value_w1, leaf_value_w8, leaf_value_w16;
leaf_adj_fn leaf_adj_double, leaf_adj_w1, leaf_adj_w8, leaf_adj_w16;
leaf_rng_fn leaf_rng_double, leaf_rng_w1, leaf_rng_w8, leaf_rng_w16;
