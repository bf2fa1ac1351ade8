// used.h: which parameters a picture can depend on at all: those of objects that something in the scene refers to.
#pragma once

#include "scene/scene.h"

// used: one entry per parameter. Whether a camera, a light, an instance or a visible shape has it or leads to it.
rey_result rey_params_used(rey_scene *scene, bool *used);
// The same of the picture of one sensor, which no number of another one changes.
rey_result rey_params_reached(rey_scene *scene, int sensor, bool *reached);
