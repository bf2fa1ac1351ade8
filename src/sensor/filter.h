// filter.h: reconstruction filters of the film, in one dimension; a pixel's weight is the product of two.
#pragma once

#include "scene/scene.h"

// Mitchell and Netravali's family of cubics [mitchell1988 eq. 8].
static inline float filter_cubic(float b, float c, float x) {
    if (x < 1) {
        return ((12 - 9 * b - 6 * c) * x * x * x + (-18 + 12 * b + 6 * c) * x * x + (6 - 2 * b)) / 6;
    }
    if (x < 2) {
        return ((-b - 6 * c) * x * x * x + (6 * b + 30 * c) * x * x + (-12 * b - 48 * c) * x + (8 * b + 24 * c)) / 6;
    }
    return 0;
}

static inline float filter_sinc(float x) {
    float y = 3.14159265f * x;
    return x < 1e-5f ? 1 : sinf(y) / y;
}

// Weight at distance x from the pixel's centre [pixels].
static inline float filter_eval(const SensorRecord *s, float x) {
    x = fabsf(x);
    switch (s->filter) {
    case FILM_BOX:
        return x <= 0.5f ? 1 : 0;
    case FILM_TENT:
        return fmaxf(0, 1 - x / s->filter_radius);
    case FILM_GAUSSIAN: // shifted so that it ends at 0 at four standard deviations
        return fmaxf(0, expf(-x * x / (2 * s->filter_a * s->filter_a)) - expf(-8));
    case FILM_LANCZOS:
        return x < s->filter_radius ? filter_sinc(x) * filter_sinc(x / s->filter_radius) : 0;
    default:
        return filter_cubic(s->filter_a, s->filter_b, x);
    }
}

// Room around the film in the numbers of pixels: samples may be drawn as far beyond it as the filter reaches.
static inline int32_t filter_margin(const SensorRecord *s) {
    return s->filter_radius > 60 ? MOST_FILTER_RADIUS + 64 : 64;
}

// Pixels whose centre lies within the filter of position x: first and, exclusive, last.
static inline void filter_range(const SensorRecord *s, float x, int32_t *first, int32_t *last) {
    *first = (int32_t)ceilf(x - 0.5f - s->filter_radius);
    *last = (int32_t)floorf(x - 0.5f + s->filter_radius) + 1;
}
