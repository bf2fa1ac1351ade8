// grid.h: fields over space from files, by what they begin with: VOL and NPY. Values are read straight to where they are
// wanted, so that large grids need no room twice.
#pragma once

#include "base/context.h"

typedef struct rey_grid {
    int32_t nx, ny, nz, channels; // channel fastest, then x, y, z
    float box[6];                 // corners that the file gives, the unit cube where it gives none
    const char *path;             // lives as long as the caller's
    int file, format, encoding;   // encoding: as of VOL files
    size_t data;                  // offset of the first value
} rey_grid;

// Reads the header. The path must outlive the grid; the caller closes it. Failures: REY_ERROR_IO, REY_ERROR_FORMAT,
// REY_ERROR_MEMORY; *out needs no closing then.
rey_result rey_grid_open(rey_context *ctx, const char *path, rey_grid *out);
int64_t rey_grid_count(const rey_grid *grid); // at most 2^31 - 1
// All values, each of them finite.
rey_result rey_grid_read(rey_context *ctx, const rey_grid *grid, float *values);
void rey_grid_close(rey_grid *grid);
