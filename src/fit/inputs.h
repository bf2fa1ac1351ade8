// inputs.h: what a fit began with, as a text of hashes: a resumed fit must not go on with other photographs or another scene.
#pragma once

#include "fit/fit.h"

// A line "HASH what it is" for every target and mask, for every parameter of the job's scene, and for the rest of the scene.
// The views must be loaded; scene: the job's, with the starts of the unknowns.
rey_result rey_fit_inputs(Fit *fit, const rey_scene *scene, char **out);
// Says in `what` which of them changed from one text to the other; false when none did.
bool rey_fit_inputs_differ(const char *before, const char *now, char *what, size_t size);
