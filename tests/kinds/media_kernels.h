// media_kernels.h: what the tests of volumes and of tracking share, compiled as phase_kernels.h says.
#pragma once

#include "scene/scene.h"

// MEDIA_POSE, MEDIA_PLACE: where to_world lies in theta, and its inverse in the tables.
enum { MEDIA_THETA = 1024, MEDIA_POSE = MEDIA_THETA - 16, MEDIA_TABLES = 256, MEDIA_PLACE = MEDIA_TABLES - 12 };

typedef struct MediaCase {
    int32_t theta_count;
    VolumeNode sigma_t, grid; // grid: of matrices
    TextureNode flakes;       // texture 0
    MediumNode medium;
    double theta[MEDIA_THETA], tables[MEDIA_TABLES];
} MediaCase;

typedef struct MediaLookup {
    double p[3], df[3];
    double value[3], dp[3], forward; // out
} MediaLookup;

typedef struct MediaRay {
    double o[3], d[3], tmax;
    uint32_t sample;
    double transmittance[3], t, weight[3]; // out
    int32_t collided;
    double bound, sigma; // where the extinction came closest to its bound along the way; not of all rays
} MediaRay;

// The area that flakes show to w at p, and the adjoint d of it.
typedef struct MediaFlakes {
    double p[3], w[3], d;
    double area, dp[3], dw[3], forward; // out
} MediaFlakes;

typedef struct MediaKernels {
    void (*eval)(const MediaCase *c, int n, MediaLookup *q);
    void (*adj)(const MediaCase *c, int n, MediaLookup *q, double *gradient, const double *tangent);
    void (*flakes)(const MediaCase *c, int n, MediaFlakes *q, double *gradient, const double *tangent);
    void (*track)(const MediaCase *c, int n, MediaRay *r);
} MediaKernels;

extern const MediaKernels media_kernels_double, media_kernels_w1, media_kernels_w8, media_kernels_w16;
