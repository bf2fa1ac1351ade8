// affine.h: affine matrices, row-major 4 x 4.
#pragma once

#include <stdbool.h>

// Inverse of a row-major affine 4 x 4; false when singular.
bool rey_affine_inverse(const float m[16], double inverse[12]);
void rey_affine_point(const float *m, const double p[3], double out[3]); // m: its first three rows; out may be p
double rey_affine_determinant(const float m[16]);
double rey_matrix_determinant(const double m[16]); // of the upper left 3 x 3
