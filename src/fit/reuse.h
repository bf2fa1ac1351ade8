// reuse.h: paths that serve several iterations: they are recorded at one point of the unknowns, and pictures and gradients at
// others are found along them, each path with the weight that it has there (render/replay.h).
#pragma once

#include "fit/fit.h"

// Refuses unknowns that paths cannot be reused for; loads the scene that paths are recorded in, if the job asks for it.
rey_result rey_reuse_open(Fit *fit);
// Whether, in what was rendered since the last recording or iteration began, weights left the range.
bool rey_reuse_stale(const Fit *fit);
// Before an iteration: records if nothing is, and forgets what the last iteration's paths weighed.
rey_result rey_reuse_begin(Fit *fit);
// Where paths are stale: records anew, at the values of the unknowns, or moves these back to where they are not.
rey_result rey_reuse_renew(Fit *fit);
// After a checkpoint was read: recorded where the former run did.
rey_result rey_reuse_resume(Fit *fit);
// The iteration whose numbers the samples have.
int rey_reuse_iteration(const Fit *fit);
// A picture along the recorded paths.
rey_result rey_reuse_render(Fit *fit, const rey_render_def *def, float *image, rey_stats *stats);
