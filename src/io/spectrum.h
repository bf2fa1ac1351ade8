// spectrum.h: source spectra (as a scene file writes them) and their conversion to linear sRGB; named materials.
#pragma once

#include "base/context.h"
#include "math/colour.h"

// A spectrum as written: count 0 is the constant `flat`; otherwise count >= 2 pairs with strictly ascending
// wavelengths [nm], linear between them and 0 outside. The arrays belong to whoever made the spectrum.
typedef struct rey_spectrum {
    double flat;
    int count;
    const double *wavelengths, *values;
} rey_spectrum;

// What a colour is for; decides weighting and clipping.
typedef enum rey_colour_use {
    REY_COLOUR_REFLECTANCE, // seen under D65, in [0, 1]
    REY_COLOUR_EMISSION,    // radiance, intensity, irradiance: not weighted by D65, >= 0
    REY_COLOUR_UNBOUNDED    // indices of refraction, roughness: seen under D65, >= 0
} rey_colour_use;

// Linear sRGB of a spectrum. Pairs: 1000 equally spaced wavelengths in 360..830 nm against the CIE 1931 2 degree
// observer. Constants are grey, except for emission, where they are equal-energy white.
void rey_spectrum_to_rgb(const rey_spectrum *spectrum, rey_colour_use use, double rgb[3]);

// The same integral without D65, only clipped to >= 0: measured eta and k of conductors.
void rey_spectrum_to_rgb_unweighted(const rey_spectrum *spectrum, double rgb[3]);

double rey_luminance(const double rgb[3]); // Y of linear sRGB

// Reads a text file of `wavelength value` lines with # comments. *out borrows *storage, which the caller frees with
// rey_free. In the memory form, file is the name in messages.
rey_result rey_spectrum_read(rey_context *ctx, const char *path, rey_spectrum *out, double **storage);
rey_result rey_spectrum_read_memory(rey_context *ctx, const char *file, const char *text, size_t bytes,
                                    rey_spectrum *out, double **storage);

// Index of refraction by name ("bk7"), any case; false when unknown. rey_named_ior_name lists the names, null at the
// end (for rey_nearest_word; user is ignored).
bool rey_named_ior(const char *name, double *ior);
const char *rey_named_ior_name(void *user, int i);

// Complex index of refraction of a conductor in linear sRGB, by the name of its material ("Al"); "none" is the ideal
// mirror (eta 0, k 1). False when unknown.
bool rey_named_metal(const char *name, double eta[3], double k[3]);
const char *rey_named_metal_name(void *user, int i);
