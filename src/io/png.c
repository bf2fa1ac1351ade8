// png.c: PNG through libpng's simplified interface.
#include "io/file.h"
#include "io/image.h"

#include <math.h>
#include <png.h>
#include <stdlib.h>
#include <string.h>

rey_result rey_png_read(rey_context *ctx, const char *name, const unsigned char *bytes, size_t size, rey_image *out) {
    png_image png = {.version = PNG_IMAGE_VERSION};
    if (!png_image_begin_read_from_memory(&png, bytes, size)) {
        return rey_fail(ctx, REY_ERROR_FORMAT, "%s: %s", name, png.message);
    }
    bool wide = png.format & PNG_FORMAT_FLAG_LINEAR, colour = png.format & PNG_FORMAT_FLAG_COLOR;
    int channels = colour ? 3 : 1;
    rey_result result = rey_image_new(ctx, name, png.width, png.height, channels, out);
    // 16-bit files come out linear, 8-bit ones encoded. Alpha is asked for, so that nothing is blended, and dropped.
    png.format = (colour ? PNG_FORMAT_RGBA : PNG_FORMAT_GA) | (wide ? PNG_FORMAT_FLAG_LINEAR : 0);
    size_t count = PNG_IMAGE_SIZE(png) / (wide ? 2 : 1);
    void *pixels = result == REY_OK ? rey_alloc_array(ctx, count, wide ? 2 : 1) : NULL;
    if (!pixels) {
        png_image_free(&png);
        return result == REY_OK ? REY_ERROR_MEMORY : result;
    }
    if (!png_image_finish_read(&png, NULL, pixels, 0, NULL)) {
        result = rey_fail(ctx, REY_ERROR_FORMAT, "%s: %s", name, png.message);
    }
    int64_t n = (int64_t)out->width * out->height;
    for (int64_t i = 0; i < n && result == REY_OK; i++) {
        for (int c = 0; c < channels; c++) {
            int64_t at = i * (channels + 1) + c;
            float alpha = wide ? (float)((uint16_t *)pixels)[i * (channels + 1) + channels] / 65535.0f : 1;
            out->data[i * channels + c] = wide ? (float)((uint16_t *)pixels)[at] / 65535.0f / fmaxf(alpha, 1e-6f)
                                               : (float)((uint8_t *)pixels)[at] / 255.0f;
            if (wide) { // the library premultiplied and decoded; the picture keeps the file's encoding
                out->data[i * channels + c] = rey_srgb_encode(fminf(out->data[i * channels + c], 1));
            }
        }
    }
    out->srgb = true;
    rey_free(ctx, pixels);
    png_image_free(&png);
    return result;
}

rey_result rey_png_encode(rey_context *ctx, const unsigned char *rgb8, int width, int height, unsigned char **bytes,
                          size_t *size) {
    png_image png = {.version = PNG_IMAGE_VERSION, .width = (png_uint_32)width, .height = (png_uint_32)height,
                     .format = PNG_FORMAT_RGB};
    png_alloc_size_t length = PNG_IMAGE_PNG_SIZE_MAX(png);
    *bytes = rey_alloc(ctx, length);
    if (!*bytes) {
        return REY_ERROR_MEMORY;
    }
    if (!png_image_write_to_memory(&png, *bytes, &length, 0, rgb8, 0, NULL)) {
        rey_free(ctx, *bytes);
        *bytes = NULL;
        return rey_fail(ctx, REY_ERROR_MEMORY, "a PNG could not be encoded: %s", png.message);
    }
    *size = length;
    return REY_OK;
}

static rey_result write_rgb8(rey_context *ctx, const char *path, const unsigned char *rgb8, int width, int height) {
    unsigned char *bytes = NULL;
    size_t size = 0;
    rey_result result = rey_png_encode(ctx, rgb8, width, height, &bytes, &size);
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
    rey_result result = write_rgb8(ctx, path, rgb8, width, height);
    rey_free(ctx, rgb8);
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
    rey_result result = write_rgb8(ctx, path, rgb8, width, height);
    rey_free(ctx, rgb8);
    rey_free(ctx, sorted);
    return result;
}
