// tracking.h: what the tracking benchmark does once for every width.
#pragma once

#include "scene/scene.h"

typedef struct TrackingCount {
    int64_t rays, lookups, cells; // lookups of the grid; supervoxels that rays stood in
    double passed;                // the sum of what passes of the rays
} TrackingCount;

// Rays from outside towards random points of the unit cube, in random directions: to their first collision (delta tracking), or
// through all of it (ratio tracking). count_w does what track_w does, by steps of its own that are counted.
typedef void tracking_fn(const SceneView *scene, const MediumNode *medium, bool through, int32_t rays, TrackingCount *count);
tracking_fn track_w1, track_w8, track_w16, count_w1, count_w8, count_w16;
