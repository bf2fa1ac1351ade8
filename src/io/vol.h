// vol.h: grids of numbers in Mitsuba's VOL files, version 3, 32-bit floats.
#pragma once

#include "base/context.h"

typedef struct rey_vol {
    int32_t nx, ny, nz, channels;
    float box[6]; // corners: lowest, highest
    float *data;  // channel fastest, then x, y, z
} rey_vol;

// Failures: REY_ERROR_IO, REY_ERROR_FORMAT ("FILE: byte OFFSET: ..."), REY_ERROR_MEMORY; *out is then empty.
rey_result rey_vol_read(rey_context *ctx, const char *path, rey_vol *out);
rey_result rey_vol_read_memory(rey_context *ctx, const char *name, const unsigned char *bytes, size_t size, rey_vol *out);
rey_result rey_vol_write(rey_context *ctx, const char *path, const rey_vol *vol);
void rey_vol_free(rey_context *ctx, rey_vol *vol);
