// scattering.h: a medium's extinction, albedo and mean cosine moved along what its pictures depend on: absorption and reduced
// scattering. Far from where light enters, media of equal sigma_a and sigma_s' = (1 - g) sigma_s look alike (the first order of
// similarity [zhao2014]), so that steps in sigma_t and albedo follow a curved valley, and those here a straight one.
#pragma once

#include <stdbool.h>
#include <stdint.h>

// Of one medium, with channels of sigma_t and albedo side by side (arrays of voxels, too), and one g.
//   variables: log sigma_a, log sigma_s', atanh g
typedef struct Scattering {
    const char *name;           // the medium's
    int64_t count;              // of sigma_t and of albedo
    int64_t sigma_t, albedo, g; // where they begin among all numbers; g < 0: it is known
    double known_g;
} Scattering;

// From the values that a scene holds to variables, and back; arrays of all numbers.
void rey_scattering_begin(const Scattering *s, const float *value, double *variable);
void rey_scattering_follow(const Scattering *s, const double *variable, float *value);
// Replaces the gradient in the values by that in the variables.
void rey_scattering_gradient(const Scattering *s, const double *variable, double *gradient);

// Absorption and reduced scattering, in the units of sigma_t.
void rey_scattering_coefficients(double sigma_t, double albedo, double g, double *absorption, double *reduced);
