// loss.c: image losses estimated from two independent halves.
#include "fit/loss.h"

#include <math.h>

typedef struct LossValue {
    double value, da, db; // da is to be pulled back through a
} LossValue;

// log(max(x, 0) + e) and its derivative, 0 below 0.
static double log_of(double x, double epsilon, double *derivative) {
    *derivative = x > 0 ? 1 / (x + epsilon) : 0;
    return log(fmax(x, 0) + epsilon);
}

static LossValue loss_entry(LossKind kind, double epsilon, double a, double b, double r) {
    double weight = 1;
    switch (kind) {
    case LOSS_L1:
        return (LossValue){(fabs(a - r) + fabs(b - r)) / 2, ((b > r) - (b < r)) / 2.0, ((a > r) - (a < r)) / 2.0};
    case LOSS_LOG_L2: {
        double da, db, dr;
        double ea = log_of(a, epsilon, &da) - log_of(r, epsilon, &dr), eb = log_of(b, epsilon, &db);
        eb -= log_of(r, epsilon, &dr);
        return (LossValue){(ea * ea + eb * eb) / 2, eb * db, ea * da};
    }
    case LOSS_RELATIVE_L2:
        weight = 1 / ((fabs(r) + epsilon) * (fabs(r) + epsilon));
        break;
    default:
        break;
    }
    return (LossValue){weight * (a - r) * (b - r), weight * (b - r), weight * (a - r)};
}

double rey_loss(LossKind kind, double epsilon, const LossView *view, const float *a, const float *b, double scale,
                float *adjoint_a, float *adjoint_b) {
    double sum = 0, norm = 1 / (3 * view->mask_sum);
    for (int64_t i = 0; i < 3 * view->pixels; i++) {
        double mask = view->mask ? (double)view->mask[i / 3] : 1;
        adjoint_a[i] = adjoint_b[i] = 0;
        if (mask > 0) { // pixels behind a mask may hold anything, also values that are not numbers
            LossValue l = loss_entry(kind, epsilon, (double)a[i], (double)b[i], (double)view->target[i]);
            sum += mask * l.value;
            adjoint_a[i] = (float)(scale * norm * mask * l.da);
            adjoint_b[i] = (float)(scale * norm * mask * l.db);
        }
    }
    return sum * norm;
}
