// loss.h: image losses estimated from two independent halves.
#pragma once

#include "fit/job.h"

// One view's loss: mean over channels and masked pixels of l(image, target).
typedef struct LossView {
    const float *target; // pixels x 3
    const float *mask;   // pixels, null = 1 everywhere
    int64_t pixels;
    double mask_sum; // sum of mask, or pixels
} LossView;

// The loss, and d loss / d image times `scale` for each half, both from the other half's picture:
// adjoint_a is built from b and is to be pulled back through a's samples, and the reverse.
// l2, relative_l2: loss = mean of (a - R)(b - R) w, whose expectation is that of the noise-free picture, and whose
// gradient (a - R) db + (b - R) da is unbiased. l1, log_l2: mean of the two halves' losses; biased.
double rey_loss(LossKind kind, double epsilon, const LossView *view, const float *a, const float *b, double scale,
                float *adjoint_a, float *adjoint_b);
