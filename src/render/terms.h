// terms.h: which terms the gradient of a selection needs.
#pragma once

#include "scene/scene.h"

// Refuses parameters whose derivative would lack a term; collects the terms that they need.
rey_result rey_terms_check(rey_scene *scene, const rey_render_def *def, rey_selection selection, int *needed);
