// absent.h: what is said of a parameter that a scene does not have.
#pragma once

#include "scene/scene.h"

enum { ABSENT_BYTES = 768 };

// What follows the name in a message: ": why a shape has none", ", did you mean 'NAME'?", "; there is 'NAME'" of what an
// object has, or nothing.
void rey_param_absent(const rey_scene *scene, const char *name, char text[ABSENT_BYTES]);
