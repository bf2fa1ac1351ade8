// mitsuba.h: Mitsuba 3 scene files.
#pragma once

#include "scene/scene.h"

enum {
    LOAD_SPARE = 1,  // defines that the scene never uses are no error
    LOAD_LENIENT = 2 // nor is what cannot be read: it is left out, and listed in `ignored`
};

// Loads a scene; derived data is still to be brought up to date. The caller owns *out.
rey_result rey_mitsuba_load(rey_context *ctx, const char *path, const rey_define *defines, int define_count, int flags,
                            rey_scene **out);

// Of char *: what a lenient reader left out, and why.
const Array *rey_mitsuba_ignored(const rey_scene *scene);
