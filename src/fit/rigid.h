// rigid.h: poses that turn, shift and grow without changing shape. Of the 16 variables of a pose the first three are a
// rotation vector [radians], the next three a shift [scene units] and the seventh the logarithm of a scale, all from the
// start; the others stay 0. The linear part A turns about the origin of the pose: A = exp(s) exp([w]) A_start,
// t = t_start + shift.
#pragma once

#include <stdint.h>

enum { RIGID_VARIABLES = 6, SIMILAR_VARIABLES = 7, RIGID_VALUES = 16 };

// value: row-major 4 x 4.
void rey_rigid_pose(const float *start, const double *variable, float *value);
// Replaces the gradient in the 16 values by that in the variables, the scale's among them.
void rey_rigid_gradient(const float *start, const double *variable, double *gradient);
