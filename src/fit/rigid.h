// rigid.h: poses that turn and shift without changing shape. Of the 16 variables of a pose the first three are a rotation
// vector [radians] and the next three a shift [scene units], both from the start; the others stay 0. The linear part A
// turns about the origin of the pose: A = exp([w]) A_start, t = t_start + shift.
#pragma once

#include <stdint.h>

enum { RIGID_VARIABLES = 6, RIGID_VALUES = 16 };

// value: row-major 4 x 4.
void rey_rigid_pose(const float *start, const double *variable, float *value);
// Replaces the gradient in the 16 values by that in the variables.
void rey_rigid_gradient(const float *start, const double *variable, double *gradient);
