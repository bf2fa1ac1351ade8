// rigid.c: rotations by their exponential map. exp([w + dw]) = exp([J dw]) exp([w]) to first order, J the left Jacobian
// of the rotation group [chirikjian2012].
#include "fit/rigid.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

// R = 1 + a [w] + b [w]^2, J = 1 + b [w] + c [w]^2.
typedef struct Rotation {
    double r[3][3], j[3][3];
} Rotation;

static Rotation rotation_of(const double w[3]) {
    double angle2 = w[0] * w[0] + w[1] * w[1] + w[2] * w[2], angle = sqrt(angle2);
    bool small = angle < 1e-4; // the series are exact to rounding there
    double a = small ? 1 - angle2 / 6 : sin(angle) / angle;
    double b = small ? 0.5 - angle2 / 24 : (1 - cos(angle)) / angle2;
    double c = small ? 1 / 6.0 - angle2 / 120 : (angle - sin(angle)) / (angle2 * angle);
    const double cross[3][3] = {{0, -w[2], w[1]}, {w[2], 0, -w[0]}, {-w[1], w[0], 0}};
    Rotation q;
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++) {
            double square = w[i] * w[k] - (i == k ? angle2 : 0);
            q.r[i][k] = (i == k) + a * cross[i][k] + b * square;
            q.j[i][k] = (i == k) + b * cross[i][k] + c * square;
        }
    }
    return q;
}

void rey_rigid_pose(const float *start, const double *variable, float *value) {
    Rotation q = rotation_of(variable);
    double scale = exp(variable[RIGID_VARIABLES]);
    memcpy(value, start, RIGID_VALUES * sizeof *value);
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++) {
            value[4 * i + k] = (float)(scale * (q.r[i][0] * (double)start[k] + q.r[i][1] * (double)start[4 + k] +
                                                q.r[i][2] * (double)start[8 + k]));
        }
        value[4 * i + 3] = (float)((double)start[4 * i + 3] + variable[3 + i]);
    }
}

void rey_rigid_gradient(const float *start, const double *variable, double *gradient) {
    Rotation q = rotation_of(variable);
    float value[RIGID_VALUES];
    double turn[3] = {0, 0, 0}, out[RIGID_VALUES] = {0};
    rey_rigid_pose(start, variable, value);
    // dA = A ds + [u] A, u = J dw: the derivative in u is the sum over the columns of column x gradient.
    for (int column = 0; column < 3; column++) {
        for (int i = 0; i < 3; i++) {
            out[RIGID_VARIABLES] += (double)value[4 * i + column] * gradient[4 * i + column];
            int j = (i + 1) % 3, k = (i + 2) % 3;
            turn[i] += (double)value[4 * j + column] * gradient[4 * k + column] -
                       (double)value[4 * k + column] * gradient[4 * j + column];
        }
    }
    for (int i = 0; i < 3; i++) {
        out[i] = q.j[0][i] * turn[0] + q.j[1][i] * turn[1] + q.j[2][i] * turn[2];
        out[3 + i] = gradient[4 * i + 3];
    }
    memcpy(gradient, out, sizeof out);
}
