// rims.h: where rough refraction ends abruptly (bsdf/rim.h), and what is not known of that.
#pragma once

#include "render/blame.h"
#include "scene/scene.h"

// Whether a selection moves them where no sampled direction finds them.
bool rey_rims_move(const rey_scene *scene, rey_selection selection);
// Whether a parameter moves any.
bool rey_rims_moved_by(const rey_scene *scene, const Param *p);
// Why a parameter's derivative lacks what moves the ends of refraction; null where it does not. object: the scattering function.
const char *rey_rims_gap(const rey_scene *scene, const SensorRecord *sensor, const Param *p, char object[OBJECT_NAME]);
