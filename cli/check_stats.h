// check_stats.h: z-scores of a derivative against a finite difference, per image block and channel.
#pragma once

#include <stdbool.h>

enum { CHECK_SETS = 16, CHECK_SERIES = 4 }; // series: R, G, B and their mean

// The picture cut into about 8 x 8 blocks.
typedef struct Blocks {
    int width, height; // of the picture
    int nx, ny;
} Blocks;
Blocks check_blocks(int width, int height);

// Adds weight times the block means of image to sums[(y * nx + x) * CHECK_SERIES + series].
void check_add_blocks(const Blocks *blocks, const float *image, double weight, double *sums);

typedef struct CheckResult {
    double derivative, difference; // means over pixels and channels
    double standard_error;         // of derivative - difference
    double relative_error;         // root mean square standard error of the blocks over that of their derivative
    double gradient_standard_error; // of derivative by itself: what it shares with difference is not in standard_error
    double gradient_relative_error; // relative_error of the derivative by itself
    double worst_z;                // of the block and channel with the largest |z|
    int worst_x, worst_y, worst_channel;
    double sum_z; // sum of the blocks' z of the mean channel over its standard deviation
    int tests;    // block and channel tests
    bool step_matters; // the rough difference is away from the other by more than noise, and by more than is forgiven
} CheckResult;

// derivative, difference and rough (a difference of lower order) hold CHECK_SETS rows of ny * nx * CHECK_SERIES block
// means, from the same sample sets. rounding: one such row of absolute errors that float arithmetic leaves in the blocks'
// differences.
CheckResult check_compare(const Blocks *blocks, const double *derivative, const double *difference, const double *rough,
                          const double *rounding);

// How far derivative and difference lie apart in the block and channel that another comparison found the worst.
double check_gap(const Blocks *blocks, const double *derivative, const double *difference, const CheckResult *worst);

// z of the picture's mean of such rows against 0, give or take `floor`.
double check_mean_z(const Blocks *blocks, const double *rows, double floor);

// |z| that one of n tests passes with a probability of 1 % in all (Sidak's correction).
double check_z_threshold(int n);
