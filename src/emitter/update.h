// update.h: what emitters derive from their parameters.
#pragma once

#include "scene/scene.h"

// Numbers that an envmap of that size needs in `tables`: inverse rotation, row masses, masses within rows.
static inline int64_t rey_envmap_table_size(int64_t width, int64_t height) {
    return 9 + (height - 1) + (height - 1) * width;
}

rey_result rey_emitter_update(rey_scene *scene, int32_t emitter);
// Probabilities of choosing each emitter, from the sampling weights in `weight`.
void rey_emitter_weights(rey_scene *scene);
