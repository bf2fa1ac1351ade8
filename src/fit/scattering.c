// scattering.c: absorption, reduced scattering and mean cosine as variables.
#include "fit/scattering.h"

#include <math.h>

static const double LEAST = 1e-9;     // coefficients whose logarithm is asked for
static const double MOST_COSINE = 0.998; // of g and of -g: sigma_s is sigma_s' over 1 - g

static double cosine_of(const Scattering *s, const double *variable) {
    return s->g < 0 ? s->known_g : fmin(fmax(tanh(variable[s->g]), -MOST_COSINE), MOST_COSINE);
}

void rey_scattering_coefficients(double sigma_t, double albedo, double g, double *absorption, double *reduced) {
    *absorption = sigma_t * (1 - albedo);
    *reduced = sigma_t * albedo * (1 - g);
}

void rey_scattering_begin(const Scattering *s, const float *value, double *variable) {
    double g = s->g < 0 ? s->known_g : fmin(fmax((double)value[s->g], -MOST_COSINE), MOST_COSINE);
    for (int64_t i = 0; i < s->count; i++) {
        double absorption, reduced;
        rey_scattering_coefficients((double)value[s->sigma_t + i], (double)value[s->albedo + i], g, &absorption, &reduced);
        variable[s->sigma_t + i] = log(fmax(absorption, LEAST));
        variable[s->albedo + i] = log(fmax(reduced, LEAST));
    }
    if (s->g >= 0) {
        variable[s->g] = atanh(g);
    }
}

void rey_scattering_follow(const Scattering *s, const double *variable, float *value) {
    double g = cosine_of(s, variable);
    for (int64_t i = 0; i < s->count; i++) {
        double absorption = exp(variable[s->sigma_t + i]), scattering = exp(variable[s->albedo + i]) / (1 - g);
        value[s->sigma_t + i] = (float)(absorption + scattering);
        value[s->albedo + i] = (float)(scattering / (absorption + scattering));
    }
    if (s->g >= 0) {
        value[s->g] = (float)g;
    }
}

void rey_scattering_gradient(const Scattering *s, const double *variable, double *gradient) {
    double g = cosine_of(s, variable), dg = 0;
    for (int64_t i = 0; i < s->count; i++) {
        double absorption = exp(variable[s->sigma_t + i]), scattering = exp(variable[s->albedo + i]) / (1 - g);
        double sum = absorption + scattering;
        double dt = gradient[s->sigma_t + i], da = gradient[s->albedo + i];
        // sigma_t = a + s, albedo = s / (a + s)
        double d_scattering = dt + da * absorption / (sum * sum);
        gradient[s->sigma_t + i] = absorption * (dt - da * scattering / (sum * sum));
        gradient[s->albedo + i] = scattering * d_scattering;
        dg += d_scattering * scattering / (1 - g); // s = s' / (1 - g)
    }
    if (s->g >= 0) {
        gradient[s->g] = (1 - g * g) * (gradient[s->g] + dg);
    }
}
