// ends.h: what moves the ends of rough refraction (rim.h).
#pragma once

#include "bsdf/table.h"

// Whether a function refracts into directions that end abruptly, itself or inside.
bool rey_bsdf_ends_within(const SceneView *view, int32_t bsdf);
// Whether a parameter of the function moves them: an index, or the normals of a map around it. turned: it moves their frame.
bool rey_bsdf_ends_move(const SceneView *view, int32_t bsdf, const Param *p, bool turned);
