// texture_steps.h: which textures of which surfaces jump, and along which lines of uv.
#pragma once

#include "shape/marks.h"

// Appends the steps of all surfaces' textures to `steps`, an Array of TextureStep, by shape.
rey_result rey_texture_steps(rey_scene *scene, Array *steps);
// The same for kernels: an Array of StepRecord, and one of int32_t: of every shape its first step, and of none the end. Both
// stay empty where nothing jumps.
rey_result rey_texture_step_records(rey_scene *scene, Array *records, Array *step_at);
// What of the scene's textures jumps in a way that a boundary term (REY_TERM_) does not know, and *texture, one that does; NULL
// if nothing does.
const char *rey_texture_unknown_step(const SceneView *view, int term, int32_t *texture);
