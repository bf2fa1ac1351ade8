// carve.h: space carving from masks: voxels that some view sees nothing of stay empty. What is left encloses the visual hull
// [laurentini1994].
#pragma once

#include "fit/fit.h"

// What a view sees, as sums of the pixels that see something over all pixels above and to the left: (width + 1) x (height + 1).
rey_result rey_silhouette_load(Fit *fit, const JobView *job_view, FitView *view);

// Of the unknowns that the job carves: marks the voxels of which no pixel of some fitted view sees anything, and gives these
// their lowest value, also in the scene. Voxels that a view sees in part, or not at all, are up to the others.
rey_result rey_carve(Fit *fit, rey_scene *scene, Unknowns *u);
