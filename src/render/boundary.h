// boundary.h: drivers of the boundary terms: which curves matter, how often each is sampled, and the passes over them.
#pragma once

#include "render/render_parts.h"

// Whether a term of a selection can be computed; records why not.
rey_result rey_boundary_check(rey_scene *scene, const SensorRecord *sensor, int term);
// Prepares a term after the selection is mapped; rey_boundary_free follows in any case.
rey_result rey_boundary_begin(Render *r, int term, BoundaryPlan *plan);
void rey_boundary_free(Render *r, BoundaryPlan *plan);
// Runs the samples of one set. Reverse: adds to r->gradients. Forward: adds to the picture.
void rey_boundary_run(Render *r, BoundaryPlan *plan, uint32_t scramble, double *picture);
