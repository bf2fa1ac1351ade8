// sum.h: the extinction of media that are written with what scatters and what absorbs.
#pragma once

#include "scene/scene.h"

// The values of sigma_t, where it is the sum of sigma_s and sigma_a. Grids of one size, filter, wrap and place have the sum of
// their fields between voxels, too, when voxels are summed.
void rey_medium_sum(const SceneView *view, const MediumNode *medium);
