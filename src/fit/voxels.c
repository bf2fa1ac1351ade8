// voxels.c: regularisers of grids, and their resampling.
#include "fit/voxels.h"

#include "scene/scene.h"

#include <math.h>

int64_t rey_voxels_count(GridSize size) {
    return (int64_t)size.nx * size.ny * size.nz * size.channels;
}

// The length of the slope at one voxel; along the last voxels of an axis it is 0. Adds weight times its derivative, which
// is 0 where the length is.
static double add_slope(GridSize s, const int32_t at[3], int64_t i, double weight, const float *value, double *gradient) {
    const int32_t n[3] = {s.nx, s.ny, s.nz};
    const int64_t stride[3] = {s.channels, (int64_t)s.channels * s.nx, (int64_t)s.channels * s.nx * s.ny};
    double slope[3] = {0, 0, 0}, square = 0;
    for (int axis = 0; axis < 3; axis++) {
        if (at[axis] + 1 < n[axis]) {
            slope[axis] = n[axis] * ((double)value[i + stride[axis]] - (double)value[i]);
            square += slope[axis] * slope[axis];
        }
    }
    double length = sqrt(square);
    for (int axis = 0; axis < 3 && length > 0; axis++) {
        if (at[axis] + 1 < n[axis]) {
            double g = weight * n[axis] * slope[axis] / length;
            gradient[i + stride[axis]] += g;
            gradient[i] -= g;
        }
    }
    return length;
}

double rey_voxels_regularise(GridSize s, GridRegularisers weights, const float *value, double *gradient) {
    int64_t count = rey_voxels_count(s);
    double variation = 0, sparsity = 0;
    for (int64_t i = 0; i < count && weights.total_variation > 0; i++) {
        int64_t voxel = i / s.channels;
        const int32_t at[3] = {(int32_t)(voxel % s.nx), (int32_t)(voxel / s.nx % s.ny), (int32_t)(voxel / s.nx / s.ny)};
        variation += add_slope(s, at, i, weights.total_variation / (double)count, value, gradient);
    }
    for (int64_t i = 0; i < count && weights.sparsity > 0; i++) {
        sparsity += fabs((double)value[i]);
        // At 0, which often is the lower bound, it keeps what the pictures do not ask for from leaving it.
        gradient[i] += (value[i] < 0 ? -1 : 1) * weights.sparsity / (double)count;
    }
    return (weights.total_variation * variation + weights.sparsity * sparsity) / (double)count;
}

GridSize rey_voxels_resized(GridSize size, int resolution) {
    int32_t *n[3] = {&size.nx, &size.ny, &size.nz};
    double most = fmax(size.nx, fmax(size.ny, size.nz));
    for (int axis = 0; axis < 3; axis++) {
        *n[axis] = (int32_t)fmax(1, floor(*n[axis] * (double)resolution / most + 0.5));
    }
    return size;
}

static int32_t wrap_index(int64_t i, int32_t n, int wrap) {
    if (wrap == WRAP_CLAMP) {
        return (int32_t)(i < 0 ? 0 : i >= n ? n - 1 : i);
    }
    int64_t period = wrap == WRAP_MIRROR ? 2 * (int64_t)n : n;
    i = (i % period + period) % period;
    return (int32_t)(i < n ? i : period - 1 - i);
}

// The two voxels of n beside the centre of voxel i of m, and the weight of the upper one.
static double beside(int32_t i, int32_t m, int32_t n, int wrap, int32_t at[2]) {
    double x = (i + 0.5) / m * n - 0.5, low = floor(x);
    at[0] = wrap_index((int64_t)low, n, wrap);
    at[1] = wrap_index((int64_t)low + 1, n, wrap);
    return x - low;
}

void rey_voxels_resample(GridSize from, int wrap, const float *values, GridSize to, float *out) {
    for (int64_t voxel = 0; voxel < (int64_t)to.nx * to.ny * to.nz; voxel++) {
        int32_t x[2], y[2], z[2];
        double fx = beside((int32_t)(voxel % to.nx), to.nx, from.nx, wrap, x);
        double fy = beside((int32_t)(voxel / to.nx % to.ny), to.ny, from.ny, wrap, y);
        double fz = beside((int32_t)(voxel / to.nx / to.ny), to.nz, from.nz, wrap, z);
        for (int c = 0; c < to.channels; c++) {
            double sum = 0;
            for (int k = 0; k < 8; k++) {
                double weight = (k & 1 ? fx : 1 - fx) * (k & 2 ? fy : 1 - fy) * (k & 4 ? fz : 1 - fz);
                int64_t at = ((int64_t)z[k >> 2] * from.ny + y[k >> 1 & 1]) * from.nx + x[k & 1];
                sum += weight * (double)values[at * from.channels + c];
            }
            out[voxel * to.channels + c] = (float)sum;
        }
    }
}
