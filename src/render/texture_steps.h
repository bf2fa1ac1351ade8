// texture_steps.h: which textures of which surfaces jump, and along which lines of uv.
#pragma once

#include "shape/marks.h"

// Appends the steps of all surfaces' textures to `steps`, an Array of TextureStep, by shape. to_uv_at: of every texture, where its
// to_uv begins in the selection, -1 = it is not selected.
rey_result rey_texture_steps(rey_scene *scene, const int32_t *to_uv_at, Array *steps);
// Appends the lines of the picture of a light that is no surface, over the unit square. No shape has them.
rey_result rey_light_steps(rey_scene *scene, int32_t texture, Array *steps);
// A step as kernels read it.
StepRecord rey_step_record(const TextureStep *s);
// The same as the first for kernels: an Array of StepRecord, and one of int32_t: of every shape its first step, and of none the
// end. Both stay empty where nothing jumps.
rey_result rey_texture_step_records(rey_scene *scene, const int32_t *to_uv_at, Array *records, Array *step_at);
// Why the derivative by a parameter is not known beside spots whose textures jump, null where it is.
const char *rey_spots_gap(const SceneView *view, const Param *p);
// Whether a selection moves lines along which textures jump, by their to_uv.
bool rey_lines_selected(const SceneView *view, const int32_t *to_uv_at);
// Where it does in a way that is not known, and the object: of one sort, -1 = none;
// NULL if nowhere.
const char *rey_lines_unknown(const SceneView *view, const int32_t *to_uv_at, int32_t *bsdf, int32_t *emitter, int32_t *shape);
// What of the scene's textures jumps in a way that a boundary term (REY_TERM_) does not know, and *texture, one that does; NULL
// if nothing does.
const char *rey_texture_unknown_step(const SceneView *view, int term, int32_t *texture);
