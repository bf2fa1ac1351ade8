// values.h: the values of one scene's parameters for another scene, by name.
#pragma once

#include "scene/scene.h"

// Vertices follow poses and normals follow vertices, so that the scene is to be brought up to date in between.
typedef enum ValuesPhase { VALUES_POSES, VALUES_VERTICES, VALUES_REST, VALUES_PHASES } ValuesPhase;

// Every parameter of `from` must be one of the scene, of the same shape; path names `from` in messages.
rey_result rey_values_check(const rey_scene *scene, const rey_scene *from, const char *path);
// Sets those that differ.
rey_result rey_values_copy(rey_scene *scene, const rey_scene *from, const char *path, ValuesPhase phase);
