// fuzz.h: what the fuzz targets share: any bytes as a file. Nothing may crash, leak or take long; what is accepted must be
// consistent.
#pragma once

#include "base/context.h"

#include <math.h>
#include <stdlib.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static inline void check(bool holds) {
    if (!holds) {
        abort();
    }
}

static inline void check_floats(const float *values, int64_t count) {
    for (int64_t i = 0; values && i < count; i++) {
        check(isfinite(values[i]));
    }
}
