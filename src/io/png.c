// png.c: PNG through libpng: read sample by sample, written by its simplified interface.
#include "io/file.h"
#include "io/image.h"

#include <math.h>
#include <png.h>
#include <setjmp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// What the library's callbacks and the code behind its jump see.
typedef struct Reader {
    rey_context *ctx;
    const char *name;
    const unsigned char *bytes;
    size_t size, at;
    unsigned char *pixels; // width x height, whole rows
    char message[128];
} Reader;

static void on_error(png_structp png, png_const_charp message) {
    Reader *r = png_get_error_ptr(png);
    snprintf(r->message, sizeof r->message, "%s", message);
    png_longjmp(png, 1);
}

static void on_warning(png_structp png, png_const_charp message) {
    UNUSED(png);
    UNUSED(message);
}

static void on_read(png_structp png, png_bytep out, size_t count) {
    Reader *r = png_get_io_ptr(png);
    if (count > r->size - r->at) {
        png_error(png, "the file ends early");
    }
    memcpy(out, r->bytes + r->at, count);
    r->at += count;
}

// channels: of a pixel in the file, one more than in the picture where there is alpha, which is looked at and dropped.
static void take_samples(const unsigned char *pixels, bool wide, int channels, rey_image *out) {
    int64_t count = (int64_t)out->width * out->height * channels;
    float *to = out->data;
    for (int64_t i = 0; i < count; i++) {
        float sample = wide ? (float)(pixels[2 * i] << 8 | pixels[2 * i + 1]) / 65535.0f : (float)pixels[i] / 255.0f;
        if (i % channels < out->channels) {
            *to++ = sample;
        } else {
            out->translucent |= sample < 1;
        }
    }
}

// Everything between the signature and the samples, 8 or 16 bits of each, most significant byte first.
static rey_result read_samples(Reader *r, png_structp png, png_infop info, rey_image *out) {
    double gamma;
    png_read_info(png, info);
    int64_t width = png_get_image_width(png, info), height = png_get_image_height(png, info);
    bool colour = png_get_color_type(png, info) & PNG_COLOR_MASK_COLOR;
    rey_result result = rey_image_check_claim(r->ctx, r->name, width, height, r->size);
    if (result == REY_OK) {
        result = rey_image_new(r->ctx, r->name, width, height, colour ? 3 : 1, out);
    }
    if (result != REY_OK) {
        return result;
    }
    out->srgb = !(png_get_gAMA(png, info, &gamma) && gamma == 1);
    png_set_expand(png);
    int passes = png_set_interlace_handling(png);
    png_read_update_info(png, info);
    size_t row = png_get_rowbytes(png, info);
    r->pixels = rey_alloc_array(r->ctx, (size_t)height, row);
    if (!r->pixels) {
        return REY_ERROR_MEMORY;
    }
    memset(r->pixels, 0, (size_t)height * row);
    for (int pass = 0; pass < passes; pass++) {
        for (int64_t y = 0; y < height; y++) {
            png_read_row(png, r->pixels + (size_t)y * row, NULL);
        }
    }
    png_read_end(png, NULL);
    take_samples(r->pixels, png_get_bit_depth(png, info) == 16, png_get_channels(png, info), out);
    return REY_OK;
}

// The samples as the file encodes them: the simplified interface would take 16 bits for linear and blend alpha.
rey_result rey_png_read(rey_context *ctx, const char *name, const unsigned char *bytes, size_t size, rey_image *out) {
    Reader reader = {.ctx = ctx, .name = name, .bytes = bytes, .size = size};
    png_structp png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &reader, on_error, on_warning);
    png_infop info = png ? png_create_info_struct(png) : NULL;
    rey_result result = REY_ERROR_MEMORY;
    if (!info) {
        png_destroy_read_struct(&png, NULL, NULL);
        return rey_fail(ctx, result, "%s: not enough memory to read it", name);
    }
    png_set_read_fn(png, &reader, on_read);
    if (setjmp(png_jmpbuf(png))) {
        result = rey_fail(ctx, REY_ERROR_FORMAT, "%s: not a whole PNG file: %s", name, reader.message);
    } else {
        result = read_samples(&reader, png, info, out);
    }
    png_destroy_read_struct(&png, &info, NULL);
    rey_free(ctx, reader.pixels);
    return result;
}

static rey_result encode(rey_context *ctx, const unsigned char *pixels, png_uint_32 format, int width, int height,
                         unsigned char **bytes, size_t *size) {
    png_image png = {.version = PNG_IMAGE_VERSION, .width = (png_uint_32)width, .height = (png_uint_32)height,
                     .format = format};
    png_alloc_size_t length = PNG_IMAGE_PNG_SIZE_MAX(png);
    *bytes = rey_alloc(ctx, length);
    if (!*bytes) {
        return REY_ERROR_MEMORY;
    }
    if (!png_image_write_to_memory(&png, *bytes, &length, 0, pixels, 0, NULL)) {
        rey_free(ctx, *bytes);
        *bytes = NULL;
        return rey_fail(ctx, REY_ERROR_MEMORY, "a PNG could not be encoded: %s", png.message);
    }
    *size = length;
    return REY_OK;
}

rey_result rey_png_encode(rey_context *ctx, const unsigned char *rgb8, int width, int height, unsigned char **bytes,
                          size_t *size) {
    return encode(ctx, rgb8, PNG_FORMAT_RGB, width, height, bytes, size);
}

static rey_result write_pixels(rey_context *ctx, const char *path, const unsigned char *pixels, png_uint_32 format,
                               int width, int height) {
    unsigned char *bytes = NULL;
    size_t size = 0;
    rey_result result = encode(ctx, pixels, format, width, height, &bytes, &size);
    if (result == REY_OK) {
        result = rey_file_write(ctx, path, bytes, size);
    }
    rey_free(ctx, bytes);
    return result;
}

rey_result rey_png_write(rey_context *ctx, const char *path, const float *rgb, int width, int height) {
    int64_t pixels = (int64_t)width * height;
    unsigned char *rgb8 = rey_alloc_array(ctx, (size_t)pixels, 3);
    if (!rgb8) {
        return REY_ERROR_MEMORY;
    }
    rey_image_to_srgb8(rgb, pixels, rgb8);
    rey_result result = write_pixels(ctx, path, rgb8, PNG_FORMAT_RGB, width, height);
    rey_free(ctx, rgb8);
    return result;
}

rey_result rey_png_write_alpha(rey_context *ctx, const char *path, const float *rgba, int width, int height) {
    int64_t pixels = (int64_t)width * height;
    unsigned char *rgba8 = rey_alloc_array(ctx, (size_t)pixels, 4);
    if (!rgba8) {
        return REY_ERROR_MEMORY;
    }
    for (int64_t i = 0; i < pixels; i++) {
        float alpha = fminf(fmaxf(rgba[4 * i + 3], 0), 1), rgb[3];
        for (int c = 0; c < 3; c++) {
            rgb[c] = alpha > 0 ? rgba[4 * i + c] / alpha : 0;
        }
        rey_image_to_srgb8(rgb, 1, rgba8 + 4 * i);
        rgba8[4 * i + 3] = (unsigned char)(255 * alpha + 0.5f);
    }
    rey_result result = write_pixels(ctx, path, rgba8, PNG_FORMAT_RGBA, width, height);
    rey_free(ctx, rgba8);
    return result;
}

static int compare_floats(const void *a, const void *b) {
    float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

rey_result rey_png_write_signed(rey_context *ctx, const char *path, const float *rgb, int width, int height,
                                float *scale) {
    int64_t pixels = (int64_t)width * height;
    unsigned char *rgb8 = rey_alloc_array(ctx, (size_t)pixels, 3);
    float *sorted = rey_alloc_array(ctx, (size_t)pixels, sizeof *sorted);
    if (!rgb8 || !sorted) {
        rey_free(ctx, rgb8);
        rey_free(ctx, sorted);
        return REY_ERROR_MEMORY;
    }
    for (int64_t i = 0; i < pixels; i++) {
        sorted[i] = fabsf(rgb[3 * i] + rgb[3 * i + 1] + rgb[3 * i + 2]) / 3;
    }
    qsort(sorted, (size_t)pixels, sizeof *sorted, compare_floats);
    float full = sorted[(int64_t)(0.995 * (double)(pixels - 1))];
    full = full > 0 ? full : sorted[pixels - 1];
    for (int64_t i = 0; i < pixels; i++) {
        float v = (rgb[3 * i] + rgb[3 * i + 1] + rgb[3 * i + 2]) / 3;
        float t = full > 0 ? fmaxf(-1, fminf(1, v / full)) : 0;
        // White at 0, towards a red (0.70, 0.09, 0.11) or a blue (0.13, 0.25, 0.68).
        static const float red[3] = {0.70f, 0.09f, 0.11f}, blue[3] = {0.13f, 0.25f, 0.68f};
        for (int c = 0; c < 3; c++) {
            float end = t > 0 ? red[c] : blue[c];
            rgb8[3 * i + c] = (unsigned char)(255 * (1 + fabsf(t) * (end - 1)) + 0.5f);
        }
    }
    *scale = full;
    rey_result result = write_pixels(ctx, path, rgb8, PNG_FORMAT_RGB, width, height);
    rey_free(ctx, rgb8);
    rey_free(ctx, sorted);
    return result;
}
