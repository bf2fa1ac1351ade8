// check_stats.c: the statistics of `reynolds check`.
//
// Derivative and finite difference come from the same sample sets, so the noise that they share cancels in d =
// derivative
// - difference. The sets are independent: t = mean(d) / sqrt(var(d) / n) follows Student's distribution with n - 1
// degrees of freedom where the derivative is right, and is turned into a normal z [wallace1959].
#include "check_stats.h"

#include <math.h>
#include <stddef.h>

// Systematic error that a finite difference may have after extrapolation, relative to the blocks' root mean square.
static const double relative_floor = 1e-3;

Blocks check_blocks(int width, int height) {
    return (Blocks){.width = width, .height = height, .nx = width < 8 ? width : 8, .ny = height < 8 ? height : 8};
}

void check_add_blocks(const Blocks *b, const float *image, double weight, double *sums) {
    for (int y = 0; y < b->height; y++) {
        int row = (int)((long long)y * b->ny / b->height);
        int y0 = (row * b->height + b->ny - 1) / b->ny, y1 = ((row + 1) * b->height + b->ny - 1) / b->ny;
        for (int x = 0; x < b->width; x++) {
            int column = (int)((long long)x * b->nx / b->width);
            int x0 = (column * b->width + b->nx - 1) / b->nx, x1 = ((column + 1) * b->width + b->nx - 1) / b->nx;
            double w = weight / ((double)(x1 - x0) * (y1 - y0));
            const float *pixel = image + ((size_t)y * (size_t)b->width + (size_t)x) * 3;
            double *block = sums + ((size_t)row * (size_t)b->nx + (size_t)column) * CHECK_SERIES;
            for (int c = 0; c < 3; c++) {
                block[c] += w * (double)pixel[c];
                block[3] += w * (double)pixel[c] / 3;
            }
        }
    }
}

typedef struct Sample {                   // one block and series over the sets
    double derivative, difference, error; // means, and the standard error of their difference
    bool empty;                           // both vanish in every set
} Sample;

static Sample sample_at(const double *derivative, const double *difference, size_t stride, size_t at) {
    Sample s = {.empty = true};
    for (size_t k = 0; k < CHECK_SETS; k++) {
        double a = derivative[k * stride + at], b = difference[k * stride + at];
        s.derivative += a / CHECK_SETS;
        s.difference += b / CHECK_SETS;
        s.empty = s.empty && a == 0 && b == 0;
    }
    double squares = 0;
    for (size_t k = 0; k < CHECK_SETS; k++) {
        double d = derivative[k * stride + at] - difference[k * stride + at] - (s.derivative - s.difference);
        squares += d * d;
    }
    s.error = sqrt(squares / (CHECK_SETS - 1) / CHECK_SETS);
    return s;
}

// Normal deviate with the tail probability of Student's t with nu degrees of freedom [wallace1959].
static double normal_from_t(double t, double nu) {
    double z = (8 * nu + 1) / (8 * nu + 3) * sqrt(nu * log1p(t * t / nu));
    return t < 0 ? -z : z;
}

CheckResult check_compare(const Blocks *b, const double *derivative, const double *difference, double rounding) {
    CheckResult r = {0};
    size_t count = (size_t)b->nx * (size_t)b->ny, stride = count * CHECK_SERIES;
    double squares[CHECK_SERIES] = {0}, error_squares = 0, signal_squares = 0;
    for (size_t at = 0; at < stride; at++) {
        Sample s = sample_at(derivative, difference, stride, at);
        squares[at % CHECK_SERIES] += s.difference * s.difference / (double)count;
        error_squares += s.error * s.error;
        signal_squares += s.difference * s.difference;
    }
    r.relative_error = signal_squares > 0 ? sqrt(error_squares / signal_squares) : 0;
    double sum = 0, variance = 0;
    int blocks = 0;
    for (size_t at = 0; at < stride; at++) {
        int series = (int)(at % CHECK_SERIES);
        Sample s = sample_at(derivative, difference, stride, at);
        if (s.empty) {
            continue;
        }
        double floor = relative_floor * sqrt(squares[series]) + rounding;
        double t = (s.derivative - s.difference) / sqrt(s.error * s.error + floor * floor);
        double z = normal_from_t(t, CHECK_SETS - 1);
        if (series == 3) {
            r.derivative += s.derivative / (double)count;
            r.difference += s.difference / (double)count;
            variance += s.error * s.error / (double)(count * count);
            sum += z;
            blocks++;
            continue;
        }
        r.tests++;
        if (!isnan(r.worst_z) && !(fabs(z) <= fabs(r.worst_z))) { // a z that is not a number is the worst
            size_t block = at / CHECK_SERIES;
            r.worst_z = z;
            r.worst_x = (int)(block % (size_t)b->nx);
            r.worst_y = (int)(block / (size_t)b->nx);
            r.worst_channel = series;
        }
    }
    r.sum_z = blocks ? sum / sqrt(blocks) : 0;
    r.standard_error = sqrt(variance);
    return r;
}

double check_z_threshold(int n) {
    double level = -expm1(log(0.99) / (n > 0 ? n : 1)); // 1 - 0.99^(1/n)
    double low = 0, high = 40;
    for (int i = 0; i < 100; i++) {
        double middle = 0.5 * (low + high);
        if (erfc(middle / 1.4142135623730951) > level) {
            low = middle;
        } else {
            high = middle;
        }
    }
    return high;
}
