// vol.h: grids of numbers in Mitsuba's VOL files: 32-bit floats, half floats and bytes.
#pragma once

#include "base/context.h"

typedef struct rey_vol {
    int32_t nx, ny, nz, channels;
    float box[6]; // corners: lowest, highest
    float *data;  // channel fastest, then x, y, z
} rey_vol;

// Failures: REY_ERROR_IO, REY_ERROR_FORMAT ("FILE: byte OFFSET: ..."), REY_ERROR_MEMORY; *out is then empty.
rey_result rey_vol_read_memory(rey_context *ctx, const char *name, const unsigned char *bytes, size_t size, rey_vol *out);
rey_result rey_vol_write(rey_context *ctx, const char *path, const rey_vol *vol);
void rey_vol_free(rey_context *ctx, rey_vol *vol);

// ---- in parts, for whoever reads large files -----------------------------------------------------------------------

enum { VOL_HEADER = 48 };
enum { VOL_FLOAT = 1, VOL_HALF = 2, VOL_BYTE = 3 };

bool rey_vol_known(const unsigned char *bytes, size_t size); // whether a file begins like one
// The header, of a file of `size` bytes; out->data stays null.
rey_result rey_vol_header(rey_context *ctx, const char *name, const unsigned char *header, size_t size, rey_vol *out,
                          int *encoding);
size_t rey_vol_item(int encoding); // bytes of a value
// Values number first, first + 1, ... from their bytes.
rey_result rey_vol_decode(rey_context *ctx, const char *name, int encoding, const unsigned char *bytes, size_t first,
                          size_t count, float *values);
