// gather.h: between the queries of tests, one after another in memory, and the lanes of kernels. The file that includes
// it says how many queries there are (n) and which is the first of this batch (first).
#pragma once

#include "math/vec.h"

// Entry k of lane l is item (first + l), the last one repeated past the end.
#define AT(lane) (first + (lane) < n ? first + (lane) : n - 1)
#define GATHER(target, expression)                                                                                     \
    do {                                                                                                               \
        real gathered_[LANES];                                                                                         \
        for (int lane = 0; lane < LANES; lane++) {                                                                     \
            gathered_[lane] = (real)(expression);                                                                      \
        }                                                                                                              \
        (target) = f_load(gathered_);                                                                                  \
    } while (0)
#define GATHER3(target, field)                                                                                         \
    do {                                                                                                               \
        GATHER((target).x, (field)[0]);                                                                                \
        GATHER((target).y, (field)[1]);                                                                                \
        GATHER((target).z, (field)[2]);                                                                                \
    } while (0)

static void put3(double *to, Vec3 v, int lane) {
    to[0] = (double)f_lane(v.x, lane);
    to[1] = (double)f_lane(v.y, lane);
    to[2] = (double)f_lane(v.z, lane);
}
