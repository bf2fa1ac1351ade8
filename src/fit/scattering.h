// scattering.h: a medium's extinction, albedo and mean cosine moved along what its pictures depend on: absorption and reduced
// scattering. Far from where light enters, media of equal sigma_a and sigma_s' = (1 - g) sigma_s look alike (the first order of
// similarity [zhao2014]), so that steps in sigma_t and albedo follow a curved valley, and those here a straight one.
#pragma once

#include <stdbool.h>
#include <stdint.h>

// Of one medium, with channels of its two coefficients side by side (arrays of voxels, too), and one g. It has sigma_t and albedo,
// or sigma_a and sigma_s themselves.
//   variables: log sigma_a, log sigma_s', atanh g
typedef struct Scattering {
    const char *name;          // the medium's
    int64_t count;             // of each coefficient
    int64_t first, second, g;  // where sigma_t (or sigma_a), albedo (or sigma_s) and g begin among all numbers; g < 0: it is known
    bool apart;                // sigma_a and sigma_s
    double known_g;
} Scattering;

// From the values that a scene holds to variables, and back; arrays of all numbers.
void rey_scattering_begin(const Scattering *s, const float *value, double *variable);
void rey_scattering_follow(const Scattering *s, const double *variable, float *value);
// Replaces the gradient in the values by that in the variables.
void rey_scattering_gradient(const Scattering *s, const double *variable, double *gradient);

// Absorption and reduced scattering of sigma_t and albedo (apart: of sigma_a and sigma_s), in the units of sigma_t.
void rey_scattering_coefficients(bool apart, double first, double second, double g, double *absorption, double *reduced);
