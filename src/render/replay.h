// replay.h: the picture of a scene along the paths of another one (integrator/path_replay.h).
#pragma once

#include "scene/scene.h"

// Renders `moved`, a second copy of `scene` whose parameters have other values, along the paths that derivatives of
// `scene` take with the same def. Parameters that move points, lights or silhouettes must be equal in both.
rey_result rey_replay(rey_scene *scene, rey_scene *moved, const rey_render_def *def, float *image, rey_stats *stats);
