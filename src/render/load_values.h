// load_values.h: a scene gets the values that its parameters have in another scene file.
#pragma once

#include "scene/scene.h"

// By name; mostly the file is one that rey_scene_save wrote after this scene was changed, which then renders the same
// bits. Parameters that the file lacks keep their values; one that the scene lacks, or of another shape, is
// REY_ERROR_PARAM, and nothing is changed.
rey_result rey_scene_load_values(rey_scene *scene, const char *path);
