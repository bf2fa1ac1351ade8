// majorant_build.h: the bounds of a medium's extinction.
#pragma once

#include "scene/scene.h"

// Supervoxels per axis at most, as measured: with 16 a walk through a peaked cloud of 128^3 voxels looks up 5 of them where a
// global majorant needs 76.
enum { MOST_SUPERVOXELS = 16 };

// Supervoxels of a medium: fills in nx, ny and nz; returns the numbers in `tables` that it needs.
int32_t rey_medium_table_size(const VolumeNode *sigma_t, MediumNode *medium);
// Whether a grid goes on beyond its cube with what lies within: where it repeats, and the box along the world's axes is larger.
bool rey_volume_goes_on(const SceneView *view, const VolumeNode *v);
// Brings the bounds up to date, `room` times (1 at least) as large as the values. In step with the rounding of lookups they are
// a little larger still.
void rey_medium_update(const SceneView *view, const VolumeNode *sigma_t, const MediumNode *medium, float room);
