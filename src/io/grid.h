// grid.h: fields over space from files, by what they begin with: VOL, NPY and NanoVDB. Values are read straight to
// where they are wanted, so that large grids need no room twice (trees are at hand as a whole while they are read).
#pragma once

#include "io/nvdb.h"

typedef struct rey_grid {
    int32_t nx, ny, nz, channels; // channel fastest, then x, y, z
    bool placed;                  // the file gives a box along the axes
    float box[6];                 // its corners, the unit cube where it gives none
    const char *path;             // lives as long as the caller's
    int file, format, encoding;   // encoding: as of VOL files
    size_t data;                  // offset of the first value
    unsigned char *bytes;         // NanoVDB: the file
    rey_nvdb nvdb;
} rey_grid;

// Reads the header. The path must outlive the grid; the caller closes it. Failures: REY_ERROR_IO, REY_ERROR_FORMAT,
// REY_ERROR_MEMORY; *out needs no closing then.
rey_result rey_grid_open(rey_context *ctx, const char *path, rey_grid *out);
int64_t rey_grid_count(const rey_grid *grid); // at most 2^31 - 1
// All values, each of them finite.
rey_result rey_grid_read(rey_context *ctx, const rey_grid *grid, float *values);
// The values of a file for a grid of that size. Of files without channels, those of a voxel may lie side by side along x:
// Z x Y x (X channels). Failures: those of opening and reading, REY_ERROR_PARAM where the size is another one.
rey_result rey_grid_read_as(rey_context *ctx, const char *path, const int32_t size[3], int32_t channels, float *values);
void rey_grid_close(rey_context *ctx, rey_grid *grid);
