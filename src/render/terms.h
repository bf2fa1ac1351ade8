// terms.h: which terms the gradient of a selection needs, and what each brings.
#pragma once

#include "render/render_parts.h"

// Refuses parameters whose derivative would lack a term; collects the terms that they need.
rey_result rey_terms_check(rey_scene *scene, const rey_render_def *def, rey_selection selection, int *needed);

// Notes what the paths of a job met; of_film: they began at the sensor.
void rey_terms_note(Render *r, const PathJob *job, bool of_film);

// `result`, unless all went well but paths met what no term covers: then refuses the gradient.
rey_result rey_terms_end(const Render *r, rey_result result, rey_selection selection);

// What is not known of what moves where collisions ride (integrator/ride.h), null where all is.
const char *rey_rides_gap(const SceneView *view);

// Books what has come together in a set since the last call, or since the set began where the term is `interior`, for a
// term. picture: of the forward mode; in reverse mode the shards' gradients count.
void rey_terms_book(Render *r, int set, int term, const double *picture);
