// voxels.h: grids of numbers as unknowns: what keeps them smooth and empty, and their resampling between levels.
#pragma once

#include "base/context.h"

typedef struct GridSize {
    int32_t nx, ny, nz, channels; // channel fastest, then x, y, z
} GridSize;

// Weights of the regularisers, for n voxels times channels:
//   total_variation  mean of |(nx d_x, ny d_y, nz d_z)|, with d the differences to the next voxel along each axis: the same
//                    for the same field on a finer grid
//   sparsity         mean of |value|
typedef struct GridRegularisers {
    double total_variation, sparsity;
} GridRegularisers;

int64_t rey_voxels_count(GridSize size);
// The weighted sum of the regularisers; adds its gradient in the values.
double rey_voxels_regularise(GridSize size, GridRegularisers weights, const float *value, double *gradient);

// The size whose longest axis has `resolution` voxels, the others in proportion.
GridSize rey_voxels_resized(GridSize size, int resolution);
// Values of a field that is linear between the centres of voxels, at other centres; wrap as of bitmaps.
void rey_voxels_resample(GridSize from, int wrap, const float *values, GridSize to, float *out);
