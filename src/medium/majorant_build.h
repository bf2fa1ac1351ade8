// majorant_build.h: the bounds of a medium's extinction.
#pragma once

#include "medium/medium_node.h"

// Supervoxels of a medium: fills in nx, ny and nz; returns the numbers in `tables` that it needs.
int32_t rey_medium_table_size(const VolumeNode *sigma_t, MediumNode *medium);
// Brings the bounds up to date. In step with the rounding of lookups they are a little larger than the values.
void rey_medium_update(const SceneView *view, const VolumeNode *sigma_t, const MediumNode *medium);
