// scattering.c: absorption, reduced scattering and mean cosine as variables.
#include "fit/scattering.h"

#include <math.h>

static const double LEAST = 1e-9;     // coefficients whose logarithm is asked for
static const double MOST_COSINE = 0.998; // of g and of -g: sigma_s is sigma_s' over 1 - g

static double cosine_of(const Scattering *s, const double *variable) {
    return s->g < 0 ? s->known_g : fmin(fmax(tanh(variable[s->g]), -MOST_COSINE), MOST_COSINE);
}

void rey_scattering_coefficients(bool apart, double first, double second, double g, double *absorption, double *reduced) {
    *absorption = apart ? first : first * (1 - second);
    *reduced = (apart ? second : first * second) * (1 - g);
}

void rey_scattering_begin(const Scattering *s, const float *value, double *variable) {
    double g = s->g < 0 ? s->known_g : fmin(fmax((double)value[s->g], -MOST_COSINE), MOST_COSINE);
    for (int64_t i = 0; i < s->count; i++) {
        double absorption, reduced;
        rey_scattering_coefficients(s->apart, (double)value[s->first + i], (double)value[s->second + i], g, &absorption, &reduced);
        variable[s->first + i] = log(fmax(absorption, LEAST));
        variable[s->second + i] = log(fmax(reduced, LEAST));
    }
    if (s->g >= 0) {
        variable[s->g] = atanh(g);
    }
}

void rey_scattering_follow(const Scattering *s, const double *variable, float *value) {
    double g = cosine_of(s, variable);
    for (int64_t i = 0; i < s->count; i++) {
        double absorption = exp(variable[s->first + i]), scattering = exp(variable[s->second + i]) / (1 - g);
        value[s->first + i] = (float)(s->apart ? absorption : absorption + scattering);
        value[s->second + i] = (float)(s->apart ? scattering : scattering / (absorption + scattering));
    }
    if (s->g >= 0) {
        value[s->g] = (float)g;
    }
}

void rey_scattering_gradient(const Scattering *s, const double *variable, double *gradient) {
    double g = cosine_of(s, variable), dg = 0;
    for (int64_t i = 0; i < s->count; i++) {
        double absorption = exp(variable[s->first + i]), scattering = exp(variable[s->second + i]) / (1 - g);
        double sum = absorption + scattering, d_absorption = gradient[s->first + i], d_scattering = gradient[s->second + i];
        if (!s->apart) { // sigma_t = a + s, albedo = s / (a + s)
            double dt = d_absorption, da = d_scattering;
            d_absorption = dt - da * scattering / (sum * sum);
            d_scattering = dt + da * absorption / (sum * sum);
        }
        gradient[s->first + i] = absorption * d_absorption;
        gradient[s->second + i] = scattering * d_scattering;
        dg += d_scattering * scattering / (1 - g); // s = s' / (1 - g)
    }
    if (s->g >= 0) {
        gradient[s->g] = (1 - g * g) * (gradient[s->g] + dg);
    }
}
