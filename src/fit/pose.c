// pose.c: what people read of a pose: where it is, how it is turned, and its scale.
#include "fit/pose.h"

#include <math.h>
#include <stdio.h>

enum { SIDE = 4 };

static const double degrees = 180 / 3.14159265358979323846;

// Unit columns with the determinant 1, and the factors that were taken out of them.
static void unit_columns(const float *pose, double r[3][3], double lengths[3]) {
    for (int column = 0; column < 3; column++) {
        double square = 0;
        for (int k = 0; k < 3; k++) {
            square += (double)pose[SIDE * k + column] * (double)pose[SIDE * k + column];
        }
        lengths[column] = sqrt(square);
        for (int k = 0; k < 3; k++) {
            r[k][column] = square > 0 ? (double)pose[SIDE * k + column] / lengths[column] : 0;
        }
    }
    double determinant = 0;
    for (int k = 0; k < 3; k++) {
        int a = (k + 1) % 3, b = (k + 2) % 3;
        determinant += r[0][k] * (r[1][a] * r[2][b] - r[1][b] * r[2][a]);
    }
    for (int column = 0; column < 3 && determinant < 0; column++) { // a mirror
        lengths[column] = -lengths[column];
        for (int k = 0; k < 3; k++) {
            r[k][column] = -r[k][column];
        }
    }
}

// The axis times the angle, in degrees: of the quaternion, whose largest part divides the others.
static void rotation_vector(double r[3][3], double out[3]) {
    double trace = r[0][0] + r[1][1] + r[2][2], q[4];
    int most = 3;
    for (int k = 0; k < 3; k++) {
        most = r[k][k] > (most == 3 ? trace : r[most][most]) ? k : most;
    }
    int i = most, j = (most + 1) % 3, k = (most + 2) % 3;
    if (most == 3) {
        q[3] = sqrt(fmax(1 + trace, 0)) / 2;
        for (int c = 0; c < 3; c++) {
            q[c] = (r[(c + 2) % 3][(c + 1) % 3] - r[(c + 1) % 3][(c + 2) % 3]) / (4 * q[3]);
        }
    } else {
        q[i] = sqrt(fmax(1 + r[i][i] - r[j][j] - r[k][k], 0)) / 2;
        q[j] = (r[i][j] + r[j][i]) / (4 * q[i]);
        q[k] = (r[i][k] + r[k][i]) / (4 * q[i]);
        q[3] = (r[k][j] - r[j][k]) / (4 * q[i]);
    }
    double length = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2]), sign = q[3] < 0 ? -1 : 1;
    double angle = 2 * atan2(length, fabs(q[3])) * degrees;
    for (int c = 0; c < 3; c++) {
        out[c] = length > 0 ? sign * angle * q[c] / length : 0;
    }
}

// The same rotation the other way round, where that is closer to the rotation of another pose.
static void turn_towards(const float *near, double turn[3]) {
    double r[3][3], lengths[3], to[3], off = 0, off_other = 0;
    double angle = sqrt(turn[0] * turn[0] + turn[1] * turn[1] + turn[2] * turn[2]), other = 1 - 360 / angle;
    if (!near || !(angle > 0)) {
        return;
    }
    unit_columns(near, r, lengths);
    rotation_vector(r, to);
    for (int k = 0; k < 3; k++) {
        off += (turn[k] - to[k]) * (turn[k] - to[k]);
        off_other += (other * turn[k] - to[k]) * (other * turn[k] - to[k]);
    }
    for (int k = 0; k < 3 && off_other < off; k++) {
        turn[k] *= other;
    }
}

void rey_pose_part(const float *pose, const float *near, PosePart part, double out[3]) {
    double r[3][3], lengths[3];
    unit_columns(pose, r, lengths);
    if (part == POSE_TURN) {
        rotation_vector(r, out);
        turn_towards(near, out);
        return;
    }
    for (int k = 0; k < 3; k++) {
        out[k] = part == POSE_PLACE ? (double)pose[SIDE * k + 3] : lengths[k];
    }
}

// Three numbers without the dust of rounding.
static int put_three(char *text, size_t size, const double *v) {
    double largest = fmax(fabs(v[0]), fmax(fabs(v[1]), fabs(v[2]))), x[3];
    for (int k = 0; k < 3; k++) {
        x[k] = fabs(v[k]) <= 1e-6 * largest ? 0 : v[k];
    }
    return snprintf(text, size, "%.3g %.3g %.3g", x[0], x[1], x[2]);
}

void rey_pose_text(const float *pose, const float *near, char *text, size_t size) {
    const double at[3] = {(double)pose[3], (double)pose[SIDE + 3], (double)pose[2 * SIDE + 3]};
    double r[3][3], lengths[3], turn[3];
    unit_columns(pose, r, lengths);
    rotation_vector(r, turn);
    turn_towards(near, turn);
    char where[48], turned[48], scale[48] = "";
    put_three(where, sizeof where, at);
    put_three(turned, sizeof turned, turn);
    double mean = (lengths[0] + lengths[1] + lengths[2]) / 3;
    double off = fmax(fabs(lengths[0] - mean), fmax(fabs(lengths[1] - mean), fabs(lengths[2] - mean)));
    if (off > 1e-3 * fabs(mean)) {
        int used = snprintf(scale, sizeof scale, ", scale ");
        put_three(scale + used, sizeof scale - (size_t)used, lengths);
    } else if (fabs(mean - 1) > 5e-4) {
        snprintf(scale, sizeof scale, ", scale %.4g", mean);
    }
    snprintf(text, size, "%s, turned %s deg%s", where, turned, scale);
}

// Of R = A B^T, cos = (trace R - 1) / 2.
double rey_pose_turned(const float *a, const float *b) {
    double ra[3][3], rb[3][3], lengths[3], trace = 0;
    unit_columns(a, ra, lengths);
    unit_columns(b, rb, lengths);
    for (int i = 0; i < 9; i++) {
        trace += ra[i / 3][i % 3] * rb[i / 3][i % 3];
    }
    return acos(fmax(-1, fmin(1, (trace - 1) / 2))) * degrees;
}

double rey_pose_distance(const float *a, const float *b) {
    double square = 0;
    for (int k = 0; k < 3; k++) {
        double d = (double)a[SIDE * k + 3] - (double)b[SIDE * k + 3];
        square += d * d;
    }
    return sqrt(square);
}
