// exposure.c: the factor between what is rendered and what a camera recorded, of each view: known, or one of the unknowns.
#include "fit/fit.h"

// The unknown that a view's exposure is, null where it is known.
static const Unknown *exposure_unknown(const Fit *fit, int view) {
    for (size_t k = 0; k < fit->unknowns.items.count; k++) {
        const Unknown *p = &ARRAY_AT(fit->unknowns.items, Unknown, k);
        if (p->param < 0 && p->view == view) {
            return p;
        }
    }
    return NULL;
}

double rey_exposure_of(const Fit *fit, int view, const float *values) {
    const Unknown *p = exposure_unknown(fit, view);
    return p ? (double)values[p->offset] : fit->job.views[view].exposure;
}

void rey_exposure_scale(const Fit *fit, int view, double exposure, float *image) {
    int64_t floats = (int64_t)fit->views[view].width * fit->views[view].height * 3;
    for (int64_t i = 0; i < floats && (exposure < 1 || exposure > 1); i++) {
        image[i] = (float)(exposure * (double)image[i]);
    }
}

// With I' = e I: dI = e dI', de = sum I dI'.
void rey_exposure_adjoint(Fit *fit, int view, double exposure) {
    const Unknown *p = exposure_unknown(fit, view);
    int64_t floats = (int64_t)fit->views[view].width * fit->views[view].height * 3;
    double sum = 0;
    for (int64_t i = 0; i < floats && p; i++) { // a and b hold I'
        sum += (double)fit->a[i] * (double)fit->adjoint_a[i] + (double)fit->b[i] * (double)fit->adjoint_b[i];
    }
    if (p) {
        fit->unknowns.gradient[p->offset] += sum / exposure;
    }
    rey_exposure_scale(fit, view, exposure, fit->adjoint_a);
    rey_exposure_scale(fit, view, exposure, fit->adjoint_b);
}
