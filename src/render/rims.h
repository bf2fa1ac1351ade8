// rims.h: where rough refraction ends abruptly (bsdf/rim.h), and what is not known of that.
#pragma once

#include "render/blame.h"
#include "scene/scene.h"

// Why a parameter's derivative lacks what moves the ends of refraction; null where it does not. object: the scattering function.
const char *rey_rims_gap(const rey_scene *scene, const Param *p, char object[OBJECT_NAME]);
