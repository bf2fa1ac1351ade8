// dropped.h: what of a derivative is not known where `path` drops light (SceneView.drops).
#pragma once

#include "scene/scene.h"

// Why the derivative by a parameter with these REY_TERM_ is not known, null where it is.
const char *rey_dropped_gap(const SceneView *view, const Param *p, int terms);
