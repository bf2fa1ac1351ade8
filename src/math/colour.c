// colour.c: the observer, the illuminant, and the light of black bodies.
#include "math/colour.h"

#include <math.h>

enum { SHORTEST = 360, LONGEST = 830, STEP = 5, ENTRIES = (LONGEST - SHORTEST) / STEP + 1 };

static const double observer[ENTRIES][4] = {
#include "math/colour_tables.inl"
};

// Integral of the y curve over the range, by which a spectrum of 1 has Y = 1.
static const double y_integral = 106.7502593994140625;

static const double xyz_to_rgb[3][3] = {
    {3.240479, -1.537150, -0.498535}, {-0.969256, 1.875991, 0.041556}, {0.055648, -0.204043, 1.057311}};

// Planck's law, CODATA 2018 constants.
static const double planck_h = 6.62607015e-34, light_c = 299792458, boltzmann_k = 1.380649e-23;

static double table_value(double wavelength, int column) {
    if (!(wavelength >= SHORTEST && wavelength <= LONGEST)) {
        return 0;
    }
    double position = (wavelength - SHORTEST) / STEP;
    int i = (int)position < ENTRIES - 2 ? (int)position : ENTRIES - 2;
    double t = position - i;
    return observer[i][column] * (1 - t) + observer[i + 1][column] * t;
}

void rey_cie1931(double wavelength, double xyz[3]) {
    for (int i = 0; i < 3; i++) {
        xyz[i] = table_value(wavelength, i);
    }
}

double rey_d65(double wavelength) {
    return table_value(wavelength, 3);
}

// h c / (lambda k T)
static double planck_exponent(double metres, double temperature) {
    return planck_h * light_c / (metres * boltzmann_k * temperature);
}

// L = 2 h c^2 / lambda^5 / (exp(x) - 1)
double rey_blackbody(double wavelength, double temperature) {
    if (!(wavelength >= SHORTEST && wavelength <= LONGEST) || !(temperature > 0)) {
        return 0;
    }
    double metres = wavelength * 1e-9;
    double per_metre = 2 * planck_h * light_c * light_c / pow(metres, 5) / expm1(planck_exponent(metres, temperature));
    return per_metre * 1e-9;
}

double rey_colour_wavelength(int i, int count) {
    return SHORTEST + (LONGEST - SHORTEST) * (i / (double)(count - 1));
}

void rey_colour_add(double xyz[3], double wavelength, double value, int count) {
    double weight = value * (LONGEST - SHORTEST) / (y_integral * count), cmf[3];
    rey_cie1931(wavelength, cmf);
    for (int i = 0; i < 3; i++) {
        xyz[i] += weight * cmf[i];
    }
}

void rey_xyz_to_rgb(const double xyz[3], double rgb[3]) {
    for (int i = 0; i < 3; i++) {
        rgb[i] = xyz_to_rgb[i][0] * xyz[0] + xyz_to_rgb[i][1] * xyz[1] + xyz_to_rgb[i][2] * xyz[2];
    }
}

void rey_blackbody_to_rgb(double temperature, double shortest, double longest, double rgb[3], double slope[3]) {
    enum { SAMPLES = 1000 };
    double xyz[3] = {0}, slope_xyz[3] = {0}, unused[3];
    slope = slope ? slope : unused;
    for (int i = 0; i < SAMPLES; i++) {
        double wavelength = rey_colour_wavelength(i, SAMPLES), value = rey_blackbody(wavelength, temperature);
        if (!(value > 0) || wavelength < shortest || wavelength > longest) {
            continue;
        }
        // dL/dT = L x / T exp(x) / (exp(x) - 1)
        double x = planck_exponent(wavelength * 1e-9, temperature);
        rey_colour_add(xyz, wavelength, value, SAMPLES);
        rey_colour_add(slope_xyz, wavelength, value * x / temperature / -expm1(-x), SAMPLES);
    }
    rey_xyz_to_rgb(xyz, rgb);
    rey_xyz_to_rgb(slope_xyz, slope);
    for (int c = 0; c < 3; c++) {
        slope[c] = rgb[c] > 0 ? slope[c] : 0;
        rgb[c] = rgb[c] > 0 ? rgb[c] : 0;
    }
}
