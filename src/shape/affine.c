// affine.c: affine matrices, row-major 4 x 4.
#include "shape/affine.h"

#include <math.h>

// Of the inverse's numbers: squares of longer vectors are beyond floats.
#define LARGEST 1e17

double rey_affine_determinant(const float m[16]) {
    double a = m[0], b = m[1], c = m[2], d = m[4], e = m[5], f = m[6], g = m[8], h = m[9], i = m[10];
    return a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g);
}

bool rey_affine_inverse(const float m[16], double r[12]) {
    double det = rey_affine_determinant(m);
    if (!(fabs(det) > 1e-300)) {
        return false;
    }
    double s = 1 / det;
    double a = m[0], b = m[1], c = m[2], d = m[4], e = m[5], f = m[6], g = m[8], h = m[9], i = m[10];
    double n[9] = {e * i - f * h, c * h - b * i, b * f - c * e, f * g - d * i, a * i - c * g,
                   c * d - a * f, d * h - e * g, b * g - a * h, a * e - b * d};
    for (int row = 0; row < 3; row++) {
        for (int col = 0; col < 3; col++) {
            r[row * 4 + col] = n[row * 3 + col] * s;
        }
        r[row * 4 + 3] = -(r[row * 4] * m[3] + r[row * 4 + 1] * m[7] + r[row * 4 + 2] * m[11]);
    }
    for (int k = 0; k < 12; k++) {
        if (!(fabs(r[k]) <= LARGEST)) {
            return false;
        }
    }
    return true;
}

double rey_matrix_determinant(const double m[16]) {
    return m[0] * (m[5] * m[10] - m[6] * m[9]) - m[1] * (m[4] * m[10] - m[6] * m[8]) +
           m[2] * (m[4] * m[9] - m[5] * m[8]);
}

void rey_affine_point(const float *m, const double p[3], double out[3]) {
    const double q[3] = {p[0], p[1], p[2]};
    for (int k = 0; k < 3; k++) {
        out[k] = (double)m[4 * k] * q[0] + (double)m[4 * k + 1] * q[1] + (double)m[4 * k + 2] * q[2] + (double)m[4 * k + 3];
    }
}
