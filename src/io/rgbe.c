// rgbe.c: Radiance pictures: three mantissas and a common exponent in four bytes, flat or in runs (Ward, "Real
// Pixels", Graphics Gems II).
#include "io/image.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

// The next line of the header without its end; false when there is none.
static bool next_line(ImageBytes *r, char line[128]) {
    const unsigned char *start = r->bytes + r->at, *end = memchr(start, '\n', r->size - r->at);
    if (!end) {
        return false;
    }
    size_t length = (size_t)(end - start);
    r->at += length + 1;
    length = length < 127 ? length : 127;
    memcpy(line, start, length);
    line[length] = 0;
    rey_image_make_printable(line);
    return true;
}

// Lines up to an empty one, then the size; rows from the top, pixels from the left. What EXPOSURE says of the camera is
// left alone: pixels are what the file holds.
static rey_result read_header(ImageBytes *r, int64_t *width, int64_t *height) {
    char line[128];
    while (next_line(r, line) && line[0]) {
        if (!strncmp(line, "FORMAT=", 7) && strcmp(line + 7, "32-bit_rle_rgbe") != 0) {
            return rey_fail(r->ctx, REY_ERROR_UNSUPPORTED, "%s: format '%s' is not read, expected 32-bit_rle_rgbe",
                            r->name, line + 7);
        }
    }
    long long w = 0, h = 0;
    int used = 0;
    if (!next_line(r, line)) {
        return rey_image_fail(r, "the file ends in its header");
    }
    if (sscanf(line, "-Y %7lld +X %7lld%n", &h, &w, &used) != 2 || line[used]) {
        return rey_image_fail(r, "malformed Radiance header, expected its size as '-Y HEIGHT +X WIDTH'");
    }
    *width = w;
    *height = h;
    return REY_OK;
}

static void decode(const unsigned char in[4], float out[3]) {
    float scale = in[3] ? ldexpf(1, in[3] - (128 + 8)) : 0;
    for (int k = 0; k < 3; k++) {
        out[k] = (float)in[k] * scale;
    }
}

// One channel after the other, each in runs: a count above 128 repeats a byte, another copies bytes.
static rey_result read_runs(ImageBytes *r, unsigned char *row, int64_t width) {
    for (int channel = 0; channel < 4; channel++) {
        for (int64_t x = 0; x < width;) {
            if (r->at + 2 > r->size) {
                return rey_image_fail(r, "the file ends before its pixels");
            }
            int count = r->bytes[r->at++];
            bool repeat = count > 128;
            count = repeat ? count - 128 : count;
            if (count == 0 || x + count > width || (!repeat && r->size - r->at < (size_t)count)) {
                r->at--; // where the run begins
                return rey_image_fail(r, "a run of bytes does not fit its row or the file");
            }
            for (int i = 0; i < count; i++) {
                row[4 * (x + i) + channel] = r->bytes[repeat ? r->at : r->at + (size_t)i];
            }
            r->at += repeat ? 1 : (size_t)count;
            x += count;
        }
    }
    return REY_OK;
}

// Pixels of four bytes; 1 1 1 N repeats the pixel before, N times, and N x 256 times right after another such.
static rey_result read_flat(ImageBytes *r, unsigned char *row, int64_t width) {
    int shift = 0;
    for (int64_t x = 0; x < width;) {
        if (r->size - r->at < 4) {
            return rey_image_fail(r, "the file ends before its pixels");
        }
        const unsigned char *pixel = r->bytes + r->at;
        r->at += 4;
        if (pixel[0] != 1 || pixel[1] != 1 || pixel[2] != 1) {
            memcpy(row + 4 * x, pixel, 4);
            shift = 0;
            x++;
            continue;
        }
        int64_t count = (int64_t)pixel[3] << shift;
        shift += 8;
        if (x == 0 || shift > 24 || count > width - x) {
            r->at -= 4; // where the run stands
            return rey_image_fail(r, "a run of pixels does not fit its row");
        }
        for (int64_t i = 0; i < count; i++, x++) {
            memcpy(row + 4 * x, row + 4 * (x - 1), 4);
        }
    }
    return REY_OK;
}

static rey_result read_row(ImageBytes *r, unsigned char *row, int64_t width) {
    const unsigned char *head = r->bytes + r->at;
    bool runs = r->size - r->at >= 4 && width >= 8 && width < 32768 && head[0] == 2 && head[1] == 2 && head[2] < 128;
    if (!runs) {
        return read_flat(r, row, width);
    }
    if ((head[2] << 8 | head[3]) != width) {
        return rey_image_fail(r, "a row's width is not the picture's");
    }
    r->at += 4;
    return read_runs(r, row, width);
}

rey_result rey_rgbe_read(rey_context *ctx, const char *name, const unsigned char *bytes, size_t size, rey_image *out) {
    ImageBytes r = {.ctx = ctx, .name = name, .bytes = bytes, .size = size};
    int64_t width = 0, height = 0;
    rey_result result = read_header(&r, &width, &height);
    if (result == REY_OK) {
        result = rey_image_check_claim(ctx, name, width, height, size);
    }
    if (result == REY_OK) {
        result = rey_image_new(ctx, name, width, height, 3, out);
    }
    unsigned char *row = result == REY_OK ? rey_alloc_array(ctx, (size_t)width, 4) : NULL;
    if (result == REY_OK && !row) {
        result = REY_ERROR_MEMORY;
    }
    for (int64_t y = 0; y < height && result == REY_OK; y++) {
        result = read_row(&r, row, width);
        for (int64_t x = 0; x < width && result == REY_OK; x++) {
            decode(row + 4 * x, out->data + (y * width + x) * 3);
        }
    }
    rey_free(ctx, row);
    return result;
}
