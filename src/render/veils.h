// veils.h: masks and thin glass that shadow rays pass ('volpath'), and the lights that no path meets by chance behind them.
#pragma once

#include "scene/scene.h"

// Whether the share of the light that passes a function undeviated differs from place to place or from direction to direction.
bool rey_veil_is_uneven(const SceneView *view, int32_t bsdf);
// Whether shadow rays pass such surfaces on their way to such lights.
bool rey_veils_sharp(const SceneView *view);
