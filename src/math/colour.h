// colour.h: wavelengths [nm] to linear sRGB: the CIE 1931 2 degree observer, standard illuminant D65, black bodies.
#pragma once

#include "base/platform.h"

// A component of the CIE XYZ colour of linear sRGB, white D65; component 1 is the luminance.
static const double rey_xyz_rows[3][3] = {
    {0.412453, 0.357580, 0.180423}, {0.212671, 0.715160, 0.072169}, {0.019334, 0.119193, 0.950227}};
static inline double rey_xyz_of(const double rgb[3], int component) {
    const double *row = rey_xyz_rows[component];
    return row[0] * rgb[0] + row[1] * rgb[1] + row[2] * rgb[2];
}

// CIE 1931 2 degree colour matching functions at a wavelength, linear between 5 nm steps, 0 outside 360..830.
void rey_cie1931(double wavelength, double xyz[3]);
// Relative power of CIE illuminant D65 (100 at 560 nm), 0 outside 360..830 nm. Times REY_D65_SCALE it has Y = 1.
double rey_d65(double wavelength);
#define REY_D65_SCALE (1.0 / 98.99741751876255)
// Spectral radiance of a black body of that temperature [K], in kW m^-2 sr^-1 um^-1 (= W m^-2 sr^-1 nm^-1), 0 outside
// 360..830 nm.
double rey_blackbody(double wavelength, double temperature);

// Number i of so many equally spaced wavelengths in 360..830 nm.
double rey_colour_wavelength(int i, int count);
// Adds the share of one of them to the colour of a spectrum; value: the spectrum's there.
void rey_colour_add(double xyz[3], double wavelength, double value, int count);
void rey_xyz_to_rgb(const double xyz[3], double rgb[3]);

// Linear sRGB of a black body's emission between two wavelengths, no channel below 0, and its derivative with respect
// to the temperature. slope may be null.
void rey_blackbody_to_rgb(double temperature, double shortest, double longest, double rgb[3], double slope[3]);
