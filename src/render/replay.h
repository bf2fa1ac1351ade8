// replay.h: pictures and derivatives of a scene along the paths of another one (integrator/path_replay.h).
#pragma once

#include "scene/scene.h"

// Of the throughputs of all vertices of a picture's paths, whose weight is what they are in the moved scene over what they were
// in the recording one.
typedef struct ReplayWeights {
    double then, now, square; // sums in the recording scene, in the moved one, and of the latter's square over the former
    double all, within;       // sums of both, over all vertices and over those whose weight is within the range
} ReplayWeights;

// Whether pictures at other values of the parameter can be replayed: nothing moves, no light sample does, nor where rough
// refraction ends (bsdf/rim.h), which recorded paths do not cross.
bool rey_can_replay(const rey_scene *scene, int param);

// Makes the bounds of a scene's extinctions `room` times as large as they need be (1 or more). Where other scenes that are replayed
// have other extinctions, it takes more than 1: under bounds that are the extinction itself paths never pass by, and what would
// pass in other scenes is missing.
void rey_replay_make_room(rey_scene *scene, float room);

// Renders `moved`, a second copy of `scene` whose parameters have other values, along the paths that derivatives of
// `scene` take with the same def. Parameters that move points, lights or silhouettes must be equal in both.
rey_result rey_replay(rey_scene *scene, rey_scene *moved, const rey_render_def *def, float *image, rey_stats *stats);

// The same, and what the paths weigh: adds to *weights, with the range from 1 / within to within.
rey_result rey_replay_weighed(rey_scene *scene, rey_scene *moved, const rey_render_def *def, double within, float *image,
                              ReplayWeights *weights, rey_stats *stats);

// rey_vjp of `moved` along the same paths, for parameters that can be replayed; def asks for one set and REY_ESTIMATOR_SCORE. Where
// extinctions are homogeneous, it is the very derivative of the replayed picture with def's samples, but for rounding.
rey_result rey_replay_vjp(rey_scene *scene, rey_scene *moved, const rey_render_def *def, rey_selection selection,
                          const float *adjoint, double *gradient, rey_stats *stats);
