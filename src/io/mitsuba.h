// mitsuba.h: Mitsuba 3 scene files.
#pragma once

#include "scene/scene.h"

// Loads a scene; derived data is still to be brought up to date. The caller owns *out. spare: defines that the scene
// never uses are no error.
rey_result rey_mitsuba_load(rey_context *ctx, const char *path, const rey_define *defines, int define_count, bool spare,
                            rey_scene **out);
