// start.h: where unknowns start.
#pragma once

#include "fit/optimizer.h"

// p null: what the scene holds, whatever the job says.
rey_result rey_start_set(Job *job, const rey_scene *scene, const JobParameter *p, const Unknown *unknown, float *start);
// A start that would be moved before the first iteration is not what the job asked for, nor one that has no shape.
// kept: it is where an earlier level ended, which may have rounded to a bound.
rey_result rey_start_check(Job *job, const JobParameter *p, const Unknown *unknown, const float *start, bool kept);
