// check_stats.c: the statistics of `reynolds check`.
//
// Derivative and finite difference come from the same sample sets, so the noise that they share cancels in
// d = derivative - difference. The sets are independent: t = mean(d) / sqrt(var(d) / n) follows Student's distribution
// with n - 1 degrees of freedom where the derivative is right, and is turned into a normal z [wallace1959].
#include "check_stats.h"

#include <math.h>
#include <stddef.h>

// Systematic error that a finite difference may have after extrapolation, relative to the blocks' root mean square.
static const double relative_floor = 1e-3;
// Share of the distance between the two orders of difference that the better one may be off by.
static const double truncated = 0.25;
// Share of the mean variance over all blocks in the variance of each.
static const double pooled = 0.25;
// Blocks that vanish up to this many times their rounding are blank: sets reach 1.2 times (all texels of a bump move together).
static const double blank = 2;

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
    bool empty;                           // both vanish in every set, up to rounding
} Sample;

static Sample sample_at(const double *derivative, const double *difference, size_t stride, size_t at, double rounding) {
    Sample s = {.empty = true};
    for (size_t k = 0; k < CHECK_SETS; k++) {
        double a = derivative[k * stride + at], b = difference[k * stride + at];
        s.derivative += a / CHECK_SETS;
        s.difference += b / CHECK_SETS;
        s.empty = s.empty && fabs(a) <= blank * rounding && fabs(b) <= blank * rounding;
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

// Mean squares over the blocks of each series.
typedef struct Squares {
    double signal[CHECK_SERIES], noise[CHECK_SERIES];
} Squares;

static Squares mean_squares(const double *derivative, const double *difference, size_t stride, const double *rounding) {
    Squares q = {{0}, {0}};
    for (size_t at = 0; at < stride; at++) {
        Sample s = sample_at(derivative, difference, stride, at, rounding[at]);
        q.signal[at % CHECK_SERIES] += s.difference * s.difference * CHECK_SERIES / (double)stride;
        q.noise[at % CHECK_SERIES] += s.error * s.error * CHECK_SERIES / (double)stride;
    }
    return q;
}

// Two orders of difference that lie an `apart` of each other's size apart leave the better one an error of about its
// square. That is forgiven below apart_forgiven; more is a step that is too long, if it is not noise.
static const double apart_forgiven = 0.03;

static bool step_matters(const double *difference, const double *rough, size_t stride) {
    double apart = 0, noise = 0, signal = 0;
    for (size_t at = 3; at < stride; at += CHECK_SERIES) {
        Sample s = sample_at(rough, difference, stride, at, 0);
        apart += (s.derivative - s.difference) * (s.derivative - s.difference);
        noise += s.error * s.error;
        signal += s.difference * s.difference;
    }
    return apart > apart_forgiven * apart_forgiven * signal && apart > 4 * noise;
}

static double gap_at(const double *difference, const double *rough, size_t stride, size_t at) {
    double gap = 0;
    for (size_t k = 0; k < CHECK_SETS; k++) {
        gap += (difference[k * stride + at] - rough[k * stride + at]) / CHECK_SETS;
    }
    return fabs(gap);
}

double check_gap(const Blocks *b, const double *derivative, const double *difference, const CheckResult *worst) {
    size_t block = (size_t)worst->worst_y * (size_t)b->nx + (size_t)worst->worst_x;
    size_t at = block * CHECK_SERIES + (size_t)worst->worst_channel, stride = (size_t)b->nx * (size_t)b->ny * CHECK_SERIES;
    return gap_at(derivative, difference, stride, at);
}

// How well the derivative itself is known, whatever noise the difference shares with it: of its mean over the sets' means,
// and of its blocks as relative_error tells it.
static void gradient_noise(const double *derivative, size_t stride, const double *rounding, CheckResult *r) {
    double deviations[CHECK_SETS] = {0}, variance = 0, signal = 0, noise = 0; // of the sets' means
    for (size_t at = 0; at < stride; at++) {
        double block = 0, squares = 0;
        for (size_t k = 0; k < CHECK_SETS; k++) {
            block += derivative[k * stride + at] / CHECK_SETS;
        }
        for (size_t k = 0; k < CHECK_SETS; k++) {
            double d = derivative[k * stride + at] - block;
            squares += d * d / (CHECK_SETS - 1) / CHECK_SETS;
            deviations[k] += at % CHECK_SERIES == 3 ? d * CHECK_SERIES / (double)stride : 0;
        }
        signal += at % CHECK_SERIES == 3 ? 0 : fmax(block * block, rounding[at] * rounding[at]);
        noise += at % CHECK_SERIES == 3 ? 0 : squares;
    }
    for (size_t k = 0; k < CHECK_SETS; k++) {
        variance += deviations[k] * deviations[k] / (CHECK_SETS - 1) / CHECK_SETS;
    }
    r->gradient_standard_error = sqrt(variance);
    r->gradient_relative_error = signal > 0 ? sqrt(noise / signal) : 0;
}

CheckResult check_compare(const Blocks *b, const double *derivative, const double *difference, const double *rough,
                          const double *rounding) {
    size_t count = (size_t)b->nx * (size_t)b->ny, stride = count * CHECK_SERIES;
    CheckResult r = {.step_matters = step_matters(difference, rough, stride)};
    Squares squares = mean_squares(derivative, difference, stride, rounding);
    double signal_squares = squares.signal[0] + squares.signal[1] + squares.signal[2];
    double error_squares = squares.noise[0] + squares.noise[1] + squares.noise[2];
    r.relative_error = signal_squares > 0 ? sqrt(error_squares / signal_squares) : 0;
    double sum = 0, noise = 0, systematic = 0, variance = 0;
    for (size_t at = 0; at < stride; at++) {
        int series = (int)(at % CHECK_SERIES);
        Sample s = sample_at(derivative, difference, stride, at, rounding[at]);
        if (s.empty) {
            continue;
        }
        double gap = gap_at(difference, rough, stride, at);
        double floor = relative_floor * sqrt(squares.signal[series]) + rounding[at] + truncated * gap;
        // Sixteen sets may all miss a block's rare bright samples; the other blocks say how likely those are.
        double error2 = (1 - pooled) * s.error * s.error + pooled * squares.noise[series];
        double error = sqrt(error2 + floor * floor);
        double z = normal_from_t((s.derivative - s.difference) / error, CHECK_SETS - 1);
        if (series == 3) {
            r.derivative += s.derivative / (double)count;
            r.difference += s.difference / (double)count;
            variance += s.error * s.error / (double)(count * count);
            sum += z;
            noise += error2 / (error * error);
            systematic += floor / error;
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
    // Noise is independent from block to block; rounding and truncation may have the same sign everywhere.
    double spread = sqrt(noise + systematic * systematic);
    r.sum_z = spread > 0 ? sum / spread : sum;
    r.standard_error = sqrt(variance);
    gradient_noise(derivative, stride, rounding, &r);
    return r;
}

double check_mean_z(const Blocks *b, const double *rows, double floor) {
    size_t count = (size_t)b->nx * (size_t)b->ny, stride = count * CHECK_SERIES;
    double means[CHECK_SETS] = {0}, mean = 0, squares = 0;
    for (size_t k = 0; k < CHECK_SETS; k++) {
        for (size_t i = 0; i < count; i++) {
            means[k] += rows[k * stride + i * CHECK_SERIES + 3] / (double)count;
        }
        mean += means[k] / CHECK_SETS;
    }
    for (size_t k = 0; k < CHECK_SETS; k++) {
        squares += (means[k] - mean) * (means[k] - mean);
    }
    double error2 = squares / (CHECK_SETS - 1) / CHECK_SETS + floor * floor;
    return error2 > 0 ? normal_from_t(mean / sqrt(error2), CHECK_SETS - 1) : 0;
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
