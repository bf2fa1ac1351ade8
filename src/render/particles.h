// particles.h: the pass of light tracing. Private to src/render.
#pragma once

#include "scene/scene.h"

// Whether the scene's integrator is `ptracer`.
bool rey_traces_particles(const rey_scene *scene);
// Adds what light tracing finds, all paths of at least two segments, to a picture of 3 channels.
rey_result rey_render_particles(rey_scene *scene, const rey_render_def *def, int part, int parts, double *picture,
                                rey_stats *stats);
