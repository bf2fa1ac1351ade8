// light_borders.h: where the light of lamps ends abruptly in the air.
#pragma once

#include "scene/scene.h"

// Appends the sides of the frustums of projectors to `borders`, an Array of LightBorder (shape/meetings.h), as far as the scene
// goes: of those whose outermost texels are not black.
rey_result rey_light_borders(rey_scene *scene, Array *borders);
// Whether a light ends abruptly elsewhere.
bool rey_light_is_abrupt(const SceneView *view, const EmitterRecord *e);
