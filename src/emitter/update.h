// update.h: what emitters derive from their parameters.
#pragma once

#include "scene/scene.h"

rey_result rey_emitter_update(rey_scene *scene, int32_t emitter);
// Probabilities of choosing each emitter, from the sampling weights in `weight`, and the families.
void rey_emitter_weights(rey_scene *scene);
