// live.h: which parts of the scene the selected parameters reach, so that the backward sweep leaves out the others.
#pragma once

#include "integrator/job.h"

// Fills job->live (one LIVE_ mask per group, in `live`, which has room for them) and job->live_lights from the job's
// tables of selected values.
void rey_live_groups(const SceneView *view, PathJob *job, int32_t *live);

// Whether a phase function differs from place to place.
bool rey_phase_varies(const SceneView *view, int32_t id);
