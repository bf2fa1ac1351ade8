// replay.h: the picture of a scene along the paths of another one (integrator/path_replay.h).
#pragma once

#include "scene/scene.h"

// Whether pictures at other values of the parameter can be replayed: nothing moves, and no light sample does.
bool rey_can_replay(const rey_scene *scene, int param);

// Renders `moved`, a second copy of `scene` whose parameters have other values, along the paths that derivatives of
// `scene` take with the same def. Parameters that move points, lights or silhouettes must be equal in both.
rey_result rey_replay(rey_scene *scene, rey_scene *moved, const rey_render_def *def, float *image, rey_stats *stats);
