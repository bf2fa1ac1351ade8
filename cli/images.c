// images.c: pictures in and out of the subcommands.
#include "cli.h"

#include "base/context.h"
#include "io/image.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <unistd.h>

ImageFormat cli_image_format(const char *path) {
    static const char *const endings[] = {".exr", ".png", ".npy"};
    size_t length = strlen(path);
    if (!strcmp(path, "-") || !strcmp(path, "/dev/null")) {
        return IMAGE_EXR;
    }
    for (int i = 0; i < IMAGE_UNKNOWN; i++) {
        if (length > 4 && !strcasecmp(path + length - 4, endings[i])) {
            return (ImageFormat)i;
        }
    }
    return IMAGE_UNKNOWN;
}

rey_result cli_read_image(rey_context *ctx, const char *path, int *width, int *height, float **rgb, ImageFile *file) {
    rey_image image = {0};
    rey_result result = rey_image_read(ctx, path, &image);
    result = result ? result : rey_image_to_rgb(ctx, path, &image);
    if (!result) {
        if (file) {
            *file = (ImageFile){image.srgb, image.translucent};
        }
        if (image.srgb) {
            rey_image_decode_srgb(&image);
        }
        size_t count = (size_t)image.width * (size_t)image.height * 3;
        *width = image.width;
        *height = image.height;
        *rgb = rey_alloc_array(ctx, count, sizeof **rgb);
        result = *rgb ? REY_OK : REY_ERROR_MEMORY;
        if (!result) {
            memcpy(*rgb, image.data, count * sizeof **rgb);
        }
    }
    rey_image_free(ctx, &image);
    return result;
}

// Copies a file to standard output.
static rey_result copy_to_output(rey_context *ctx, const char *path) {
    char buffer[1 << 16];
    size_t n;
    FILE *file = fopen(path, "rb");
    if (!file) {
        return rey_fail(ctx, REY_ERROR_IO, "%s: %s", path, strerror(errno));
    }
    while ((n = fread(buffer, 1, sizeof buffer, file)) > 0 && fwrite(buffer, 1, n, stdout) == n) {
    }
    bool good = !ferror(file) && !ferror(stdout) && fflush(stdout) == 0;
    fclose(file);
    return good ? REY_OK : rey_fail(ctx, REY_ERROR_IO, "standard output could not be written");
}

// An EXR needs to seek, so it goes through a temporary file.
static rey_result write_exr_to_output(rey_context *ctx, const float *image, int width, int height, int channels,
                                      const char *const *names, int component) {
    const char *folder = getenv("TMPDIR");
    char path[4096];
    snprintf(path, sizeof path, "%s/reynolds-XXXXXX", folder && folder[0] ? folder : "/tmp");
    int descriptor = mkstemp(path);
    if (descriptor < 0) {
        return rey_fail(ctx, REY_ERROR_IO, "%s: %s", path, strerror(errno));
    }
    close(descriptor);
    rey_result result = rey_exr_write_as(ctx, path, image, width, height, channels, names, component);
    result = result ? result : copy_to_output(ctx, path);
    unlink(path);
    return result;
}

rey_result cli_write_image(rey_context *ctx, const char *path, const float *image, int width, int height,
                           bool signed_values, float *scale) {
    int64_t shape[3] = {height, width, 3};
    if (!strcmp(path, "-")) {
        return write_exr_to_output(ctx, image, width, height, 3, NULL, REY_COMPONENT_FLOAT32);
    }
    switch (cli_image_format(path)) {
    case IMAGE_PNG:
        return signed_values ? rey_png_write_signed(ctx, path, image, width, height, scale)
                             : rey_png_write(ctx, path, image, width, height);
    case IMAGE_NPY:
        return rey_npy_write(ctx, path, image, shape, 3);
    default:
        return rey_exr_write(ctx, path, image, width, height, 3, NULL);
    }
}

static int film_colours(const char *const *names) {
    return names[0][0] == 'Y' ? 1 : 3;
}

static bool has_alpha(int channels, const char *const *names) {
    int colours = film_colours(names);
    return channels > colours && !strcmp(names[colours], "A");
}

// Linear RGB and alpha, 1 where the film has none, of a film's picture.
static void film_rgba(const float *film, int channels, const char *const *names, float rgba[4]) {
    static const float rows[3][3] = {{3.240479f, -1.537150f, -0.498535f}, {-0.969256f, 1.875991f, 0.041556f},
                                     {0.055648f, -0.204043f, 1.057311f}}; // of CIE XYZ
    int colours = film_colours(names);
    for (int c = 0; c < 3; c++) {
        rgba[c] = colours == 1          ? film[0]
                  : names[0][0] == 'X' ? rows[c][0] * film[0] + rows[c][1] * film[1] + rows[c][2] * film[2]
                                        : film[c];
    }
    rgba[3] = has_alpha(channels, names) ? film[colours] : 1;
}

static rey_result write_film_png(rey_context *ctx, const char *path, const float *film, int width, int height,
                                 int channels, const char *const *names) {
    size_t pixels = (size_t)width * (size_t)height;
    float *image = rey_alloc_array(ctx, pixels, 4 * sizeof *image), rgba[4];
    if (!image) {
        return REY_ERROR_MEMORY;
    }
    bool alpha = has_alpha(channels, names);
    size_t kept = alpha ? 4 : 3;
    for (size_t i = 0; i < pixels; i++) {
        film_rgba(film + i * (size_t)channels, channels, names, rgba);
        memcpy(image + kept * i, rgba, kept * sizeof *rgba);
    }
    rey_result result = alpha ? rey_png_write_alpha(ctx, path, image, width, height)
                              : rey_png_write(ctx, path, image, width, height);
    rey_free(ctx, image);
    return result;
}

rey_result cli_write_film(rey_context *ctx, const char *path, const float *film, int width, int height, int channels,
                          const char *const *names, int component) {
    int64_t shape[3] = {height, width, channels};
    if (!strcmp(path, "-")) {
        return write_exr_to_output(ctx, film, width, height, channels, names, component);
    }
    switch (cli_image_format(path)) {
    case IMAGE_PNG:
        return write_film_png(ctx, path, film, width, height, channels, names);
    case IMAGE_NPY:
        return rey_npy_write(ctx, path, film, shape, 3);
    default:
        return rey_exr_write_as(ctx, path, film, width, height, channels, names, component);
    }
}
