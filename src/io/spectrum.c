// spectrum.c: source spectra to linear sRGB, the text format of spectra, named materials.
#include "io/spectrum.h"

#include "io/file.h"
#include "io/number.h"
#include "math/colour.h"

#include <math.h>
#include <string.h>
#include <strings.h>

enum { SAMPLES = 1000 };

double rey_luminance(const double rgb[3]) {
    return rey_xyz_of(rgb, 1);
}

// Linear between the pairs, 0 outside. *at is where the last look-up ended; wavelengths must not decrease between
// calls.
static double pair_value(const rey_spectrum *s, double wavelength, int *at) {
    if (wavelength < s->wavelengths[0] || wavelength > s->wavelengths[s->count - 1]) {
        return 0;
    }
    while (*at < s->count - 2 && s->wavelengths[*at + 1] <= wavelength) {
        ++*at;
    }
    double t = (wavelength - s->wavelengths[*at]) / (s->wavelengths[*at + 1] - s->wavelengths[*at]);
    return s->values[*at] * (1 - t) + s->values[*at + 1] * t;
}

static void clip(double rgb[3], double high) {
    for (int i = 0; i < 3; i++) {
        rgb[i] = rgb[i] > 0 ? (rgb[i] < high ? rgb[i] : high) : 0;
    }
}

static void integrate(const rey_spectrum *s, bool under_d65, double rgb[3]) {
    double xyz[3] = {0};
    int at = 0;
    for (int i = 0; i < SAMPLES; i++) {
        double wavelength = rey_colour_wavelength(i, SAMPLES);
        double value = pair_value(s, wavelength, &at);
        rey_colour_add(xyz, wavelength, under_d65 ? value * rey_d65(wavelength) * REY_D65_SCALE : value, SAMPLES);
    }
    rey_xyz_to_rgb(xyz, rgb);
}

void rey_spectrum_to_rgb(const rey_spectrum *s, rey_colour_use use, double rgb[3]) {
    if (s->count > 0) {
        integrate(s, use != REY_COLOUR_EMISSION, rgb);
        clip(rgb, use == REY_COLOUR_REFLECTANCE ? 1 : INFINITY);
    } else if (use == REY_COLOUR_EMISSION) {
        const double equal_energy[3] = {s->flat, s->flat, s->flat};
        rey_xyz_to_rgb(equal_energy, rgb);
    } else {
        rgb[0] = rgb[1] = rgb[2] = s->flat;
    }
}

void rey_spectrum_to_rgb_unweighted(const rey_spectrum *s, double rgb[3]) {
    if (s->count > 0) {
        integrate(s, false, rgb);
        clip(rgb, INFINITY);
    } else {
        rgb[0] = rgb[1] = rgb[2] = s->flat;
    }
}

// ---- text files --------------------------------------------------------------------------------------------------

// One line without its end: blank, comment or two numbers (stored, *pairs counted up). False when it is none of these.
static bool read_line(const char *line, double *pair, size_t *pairs) {
    while (rey_is_blank(*line)) {
        line++;
    }
    if (*line == '\0' || *line == '#') {
        return true;
    }
    for (int i = 0; i < 2; i++) {
        if (!rey_parse_single(line, &line, &pair[i]) || (*line && !rey_is_blank(*line))) {
            return false;
        }
        while (rey_is_blank(*line)) {
            line++;
        }
    }
    ++*pairs;
    return *line == '\0' || *line == '#';
}

static size_t count_lines(const char *text, size_t bytes) {
    size_t lines = 1;
    for (size_t i = 0; i < bytes; i++) {
        lines += text[i] == '\n';
    }
    return lines;
}

// Fills wavelengths and values, each with room for every line of the text.
static rey_result read_pairs(rey_context *ctx, const char *file, const char *text, size_t bytes, double *wavelengths,
                             double *values, size_t *pairs) {
    char line[256];
    int number = 1;
    for (size_t at = 0; at < bytes; number++) {
        const char *end = memchr(text + at, '\n', bytes - at);
        size_t length = end ? (size_t)(end - (text + at)) : bytes - at;
        size_t shown = length < sizeof line - 1 ? length : sizeof line - 1;
        memcpy(line, text + at, shown);
        line[shown] = '\0';
        double pair[2];
        size_t before = *pairs;
        bool comment = line[strspn(line, " \t\r")] == '#';
        if (!comment && (shown < length || strlen(line) != shown || !read_line(line, pair, pairs))) {
            return rey_fail(ctx, REY_ERROR_FORMAT, "%s:%d: bad line '%.60s', expected 'wavelength value'", file, number,
                            line);
        }
        if (*pairs > before) {
            wavelengths[before] = pair[0];
            values[before] = pair[1];
            if (before > 0 && !(pair[0] > wavelengths[before - 1])) {
                return rey_fail(ctx, REY_ERROR_FORMAT, "%s:%d: wavelength %g follows %g, expected ascending order",
                                file, number, pair[0], wavelengths[before - 1]);
            }
        }
        at += length + 1;
    }
    return *pairs >= 2
               ? REY_OK
               : rey_fail(ctx, REY_ERROR_FORMAT, "%s:%d: the spectrum ends after %zu pairs, expected at least 2", file,
                          number, *pairs);
}

rey_result rey_spectrum_read_memory(rey_context *ctx, const char *file, const char *text, size_t bytes,
                                    rey_spectrum *out, double **storage) {
    *out = (rey_spectrum){0};
    *storage = NULL;
    size_t lines = count_lines(text, bytes), pairs = 0;
    if (lines > INT32_MAX) {
        return rey_fail(ctx, REY_ERROR_FORMAT, "%s: %zu lines are too many for a spectrum", file, lines);
    }
    double *data = rey_alloc_array(ctx, lines * 2, sizeof(double));
    if (!data) {
        return REY_ERROR_MEMORY;
    }
    rey_result result = read_pairs(ctx, file, text, bytes, data, data + lines, &pairs);
    if (result) {
        rey_free(ctx, data);
        return result;
    }
    *storage = data;
    *out = (rey_spectrum){.count = (int)pairs, .wavelengths = data, .values = data + lines};
    return REY_OK;
}

rey_result rey_spectrum_read(rey_context *ctx, const char *path, rey_spectrum *out, double **storage) {
    *out = (rey_spectrum){0};
    *storage = NULL;
    unsigned char *text = NULL;
    size_t bytes = 0;
    rey_result result = rey_file_read(ctx, path, &text, &bytes);
    if (!result) {
        result = rey_spectrum_read_memory(ctx, path, (const char *)text, bytes, out, storage);
    }
    rey_free(ctx, text);
    return result;
}

// ---- named materials ---------------------------------------------------------------------------------------------

static const struct {
    const char *name;
    double ior;
} iors[] = {
#include "io/named_ior.inl"
};

static const struct {
    const char *name;
    double eta[3], k[3];
} metals[] = {
    {"none", {0, 0, 0}, {1, 1, 1}}, // ideal mirror
#include "io/metals.inl"
};

bool rey_named_ior(const char *name, double *ior) {
    for (int i = 0; i < COUNT_OF(iors); i++) {
        if (strcasecmp(name, iors[i].name) == 0) {
            *ior = iors[i].ior;
            return true;
        }
    }
    return false;
}

const char *rey_named_ior_name(void *user, int i) {
    UNUSED(user);
    return i < COUNT_OF(iors) ? iors[i].name : NULL;
}

bool rey_named_metal(const char *name, double eta[3], double k[3]) {
    for (int i = 0; i < COUNT_OF(metals); i++) {
        if (strcmp(name, metals[i].name) == 0) {
            memcpy(eta, metals[i].eta, sizeof metals[i].eta);
            memcpy(k, metals[i].k, sizeof metals[i].k);
            return true;
        }
    }
    return false;
}

const char *rey_named_metal_name(void *user, int i) {
    UNUSED(user);
    return i < COUNT_OF(metals) ? metals[i].name : NULL;
}
