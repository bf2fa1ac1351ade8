// quadric.h: values of a meeting's surfaces, in doubles.
#pragma once

#include "shape/meetings.h"

// f at a point, and its gradient.
static inline double quadric_at(const Quadric *q, const float p[3], double gradient[3]) {
    static const int entry[3][3] = {{0, 5, 4}, {5, 1, 3}, {4, 3, 2}};
    double y[3], value = (double)q->constant;
    for (int i = 0; i < 3; i++) {
        y[i] = (double)p[i] - (double)q->centre[i];
    }
    for (int i = 0; i < 3; i++) {
        double row = 0;
        for (int k = 0; k < 3; k++) {
            row += (double)q->matrix[entry[i][k]] * y[k];
        }
        gradient[i] = row + (double)q->linear[i];
        value += y[i] * (0.5 * row + (double)q->linear[i]);
    }
    return value;
}
