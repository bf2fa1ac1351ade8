// ray.h: a ray, of which nothing is known but where it may go.
#pragma once

#include "math/vec.h"

typedef struct Ray {
    Vec3 o, d;  // d: unit length
    Float tmax;
} Ray;
