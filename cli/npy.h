// npy.h: reads NumPy's .npy arrays.
#pragma once

#include "reynolds/reynolds.h"

// The shape of a parameter as text: "3x4", "1" of a single number.
void cli_shape_text(const rey_param_info *info, char *text, size_t size);
// Reads a C-ordered float32 or float64 little-endian array of finite numbers: the values of a parameter, of its shape. channels:
// of grids over space (rey_scene_grid_channels); those of Z x Y x (X channels) numbers may be Z x Y x X x channels, too.
rey_result cli_npy_read_param(rey_context *ctx, const char *path, const rey_param_info *info, int channels, float *values);
// The same for a tangent, which may be flat: all numbers in one row.
rey_result cli_npy_read_tangent(rey_context *ctx, const char *path, const rey_param_info *info, int channels, float *values);
