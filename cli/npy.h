// npy.h: reads NumPy's .npy arrays.
#pragma once

#include "reynolds/reynolds.h"

// Reads a C-ordered float32 or float64 little-endian array that holds exactly count finite numbers, of any shape.
// The same for the values of a parameter; the array has its shape.
rey_result cli_npy_read_param(rey_context *ctx, const char *path, const rey_param_info *info, float *values);
rey_result cli_npy_read(rey_context *ctx, const char *path, int64_t count, float *values);
