// endless.h: environments behind fog that has no end. Light samples take the sky to be as far away as the scene is wide, as the
// format has it, and sampled directions do not find it: a vertex gets the part of its light that weights leave to light samples.
#pragma once

#include "render/render_parts.h"

// Why the derivative by a parameter with these REY_TERM_ is not known there, null where it is: it changes these weights.
const char *rey_endless_gap(const SceneView *view, const SensorRecord *sensor, const Param *p, int terms);
