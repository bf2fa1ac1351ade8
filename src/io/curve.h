// curve.h: text files of curves.
#pragma once

#include "base/context.h"

typedef struct rey_curves {
    Array points;   // 4 floats each: x y z radius
    Array segments; // int32_t: first control point of each
} rey_curves;

// One control point "x y z radius" per line; empty lines separate curves, each of at least `order` points, of which
// every run of `order` neighbours is a segment. Failures: REY_ERROR_IO, REY_ERROR_FORMAT ("FILE:LINE: ..."),
// REY_ERROR_MEMORY; *out is then empty.
rey_result rey_curves_read(rey_context *ctx, const char *path, int order, rey_curves *out);
rey_result rey_curves_read_memory(rey_context *ctx, const char *name, const char *bytes, size_t size, int order,
                                  rey_curves *out);
void rey_curves_free(rey_context *ctx, rey_curves *curves);

// Writes points that rey_curves_read gives back to the bit.
rey_result rey_curves_write(rey_context *ctx, const char *path, const float *points, const int32_t *segments,
                            int32_t segment_count, int order);
