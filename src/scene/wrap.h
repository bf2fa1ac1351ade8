// wrap.h: indices of texels and voxels beyond the border.
#pragma once

#include "math/vec.h"
#include "scene/scene.h"

// Texel index under the wrap mode; n is the number of texels along the axis.
KFN Int texture_wrap(Int i, int32_t n, int32_t wrap) {
    if (wrap == WRAP_CLAMP) {
        return i_max(i_min(i, i_set(n - 1)), i_set(0));
    }
    int32_t period = wrap == WRAP_MIRROR ? 2 * n : n;
    Int q = i_from_f(f_floor(f_from_i(i) * (1.0f / (real)period) + 0.5f / (real)period));
    i = i - q * period;
    i = i_max(i_min(i, i_set(period - 1)), i_set(0)); // guards the rounding of q
    if (wrap == WRAP_MIRROR) {
        i = i_select(mi_lt(i, i_set(n)), i, 2 * n - 1 - i);
    }
    return i;
}
