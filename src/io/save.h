// save.h: Mitsuba 3 scene files, written.
#pragma once

#include "scene/scene.h"

// Writes the scene with its current values to path, and its data files into a folder beside it.
rey_result rey_mitsuba_save(const rey_scene *scene, const char *path);
