// io_picture.h: what the tests of picture readers share.
#pragma once

#include "io/image.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

// Reads an exact copy on the heap, so that the sanitizer sees every access beyond the end.
static inline rey_result read_copy(rey_context *ctx, const char *name, const void *bytes, size_t count, rey_image *out) {
    unsigned char *copy = malloc(count ? count : 1);
    assert_non_null(copy);
    memcpy(copy, bytes, count);
    rey_result result = rey_image_read_memory(ctx, name, copy, count, out);
    free(copy);
    return result;
}

static inline void expect_pixels(rey_context *ctx, const void *bytes, size_t count, int width, int height, int channels, bool srgb,
                                 const float *pixels) {
    rey_image image;
    if (read_copy(ctx, "good", bytes, count, &image)) {
        fail_msg("%s", rey_error(ctx));
    }
    assert_int_equal(image.width, width);
    assert_int_equal(image.height, height);
    assert_int_equal(image.channels, channels);
    assert_int_equal(image.srgb, srgb);
    for (int i = 0; i < width * height * channels; i++) {
        assert_float_equal((double)image.data[i], (double)pixels[i], 1e-6);
    }
    rey_image_free(ctx, &image);
}

// Refused with a message that begins with the name and has the words.
static inline void expect_failure(rey_context *ctx, const char *name, const void *bytes, size_t count, const char *words) {
    rey_image image;
    rey_result result = read_copy(ctx, name, bytes, count, &image);
    if (result == REY_OK || image.data || strncmp(rey_error(ctx), name, strlen(name)) != 0 || !strstr(rey_error(ctx), words)) {
        fail_msg("%s, %zu bytes: result %d, '%s', expected '%s'", name, count, result, rey_error(ctx), words);
    }
}
