// npy.h: NumPy's arrays of 32 and 64 bit floats, in parts.
#pragma once

#include "base/context.h"

enum { NPY_MOST_DIMS = 4 };

typedef struct rey_npy {
    int64_t shape[NPY_MOST_DIMS], count; // C order
    int dims, item;                      // item: bytes of a number, 4 or 8
    size_t data;                         // offset of the first one
} rey_npy;

// The header, of a file of `size` bytes of which `head_size` are at hand.
rey_result rey_npy_header(rey_context *ctx, const char *name, const unsigned char *head, size_t head_size, size_t size,
                          rey_npy *out);
// Numbers first, first + 1, ... from their bytes; each must be finite.
rey_result rey_npy_decode(rey_context *ctx, const char *name, int item, const unsigned char *bytes, size_t first,
                          size_t count, float *values);
