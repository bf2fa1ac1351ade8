// bmp.c: Windows bitmaps without compression: palettes of 1, 4 and 8 bits, and 16, 24 and 32 bits per pixel.
#include "io/image.h"

#include <string.h>

enum { FILE_HEADER = 14, CORE_HEADER = 12, INFO_HEADER = 40, PLAIN = 0, BIT_FIELDS = 3, ALPHA_BIT_FIELDS = 6 };

typedef struct Bmp {
    rey_context *ctx;
    const char *name;
    const unsigned char *bytes;
    size_t size;
    int64_t width, height; // height > 0
    bool upward;           // rows from the bottom
    int bits;
    uint32_t mask[3];             // of 16 and 32 bits: red, green, blue
    const unsigned char *palette; // blue, green, red
    int palette_step;
    uint32_t palette_count;
    bool grey;                    // every colour of the palette is grey
    size_t pixels;                // where they begin
} Bmp;

static uint32_t word(const unsigned char *at, int bytes) {
    uint32_t value = 0;
    for (int i = 0; i < bytes; i++) {
        value |= (uint32_t)at[i] << 8 * i;
    }
    return value;
}

static rey_result fail(const Bmp *b, const char *what) {
    return rey_fail(b->ctx, REY_ERROR_FORMAT, "%s: %s", b->name, what);
}

// Masks of channels: those of the file, or 5 bits each and 8 bits each.
static rey_result read_masks(Bmp *b, uint32_t compression) {
    bool given = compression == BIT_FIELDS || compression == ALPHA_BIT_FIELDS;
    for (int c = 0; c < 3; c++) {
        b->mask[c] = b->bits == 16 ? 31u << (10 - 5 * c) : 255u << (16 - 8 * c);
        if (given) { // behind a header of 40 bytes, or the same place within a longer one
            if (FILE_HEADER + INFO_HEADER + 12 > (int64_t)b->size) {
                return fail(b, "the file ends in its header");
            }
            b->mask[c] = word(b->bytes + FILE_HEADER + INFO_HEADER + 4 * c, 4);
        }
        uint32_t run = b->mask[c] ? b->mask[c] / (b->mask[c] & (0u - b->mask[c])) : 0;
        if (run == 0 || (run & (run + 1)) != 0 || (b->bits == 16 && b->mask[c] > 0xffff)) {
            return fail(b, "a channel's mask is not a run of bits within the pixel");
        }
    }
    return REY_OK;
}

static rey_result read_palette(Bmp *b, uint32_t header, uint32_t used) {
    uint32_t most = 1u << b->bits;
    b->palette_step = header == CORE_HEADER ? 3 : 4;
    b->palette_count = used && used < most ? used : most;
    b->palette = b->bytes + FILE_HEADER + header;
    if ((uint64_t)FILE_HEADER + header + (uint64_t)b->palette_count * (uint64_t)b->palette_step > b->size) {
        return fail(b, "the file ends in its palette");
    }
    b->grey = true;
    for (uint32_t i = 0; i < b->palette_count; i++) {
        const unsigned char *c = b->palette + i * (uint32_t)b->palette_step;
        b->grey = b->grey && c[0] == c[1] && c[1] == c[2];
    }
    return REY_OK;
}

static rey_result read_header(Bmp *b) {
    if (b->size < FILE_HEADER + CORE_HEADER) {
        return fail(b, "the file ends in its header");
    }
    uint32_t header = word(b->bytes + FILE_HEADER, 4), compression = PLAIN, used = 0;
    const unsigned char *at = b->bytes + FILE_HEADER + 4;
    b->pixels = word(b->bytes + 10, 4);
    if ((header != CORE_HEADER && header < INFO_HEADER) || header > 1024 || FILE_HEADER + header > b->size) {
        return fail(b, "malformed BMP header");
    }
    int planes_at = header == CORE_HEADER ? 4 : 8;
    b->width = header == CORE_HEADER ? (int64_t)word(at, 2) : (int32_t)word(at, 4);
    b->height = header == CORE_HEADER ? (int64_t)word(at + 2, 2) : (int32_t)word(at + 4, 4);
    b->bits = (int)word(at + planes_at + 2, 2);
    if (header != CORE_HEADER) {
        compression = word(at + 12, 4);
        used = word(at + 28, 4);
    }
    b->upward = b->height > 0;
    b->height = b->upward ? b->height : -b->height;
    bool deep = b->bits == 16 || b->bits == 32;
    if (compression != PLAIN && !(deep && (compression == BIT_FIELDS || compression == ALPHA_BIT_FIELDS))) {
        return rey_fail(b->ctx, REY_ERROR_UNSUPPORTED, "%s: compression %u of BMP is not read, expected none", b->name,
                        compression);
    }
    if (deep) {
        return read_masks(b, compression);
    }
    if (b->bits == 1 || b->bits == 4 || b->bits == 8) {
        return read_palette(b, header, used);
    }
    return b->bits == 24 ? REY_OK : fail(b, "malformed BMP header: expected 1, 4, 8, 16, 24 or 32 bits per pixel");
}

static float masked(uint32_t pixel, uint32_t mask) {
    uint32_t low = mask & (0u - mask);
    return (float)((double)((pixel & mask) / low) / (double)(mask / low));
}

// One pixel's red, green and blue; false when it is beyond the palette.
static bool read_pixel(const Bmp *b, const unsigned char *row, int64_t x, float rgb[3]) {
    const unsigned char *c = row + x * 3;
    if (b->bits == 16 || b->bits == 32) {
        uint32_t pixel = word(row + x * (b->bits / 8), b->bits / 8);
        for (int k = 0; k < 3; k++) {
            rgb[k] = masked(pixel, b->mask[k]);
        }
        return true;
    }
    if (b->bits < 16) {
        int per_byte = 8 / b->bits, shift = 8 - b->bits * (int)(x % per_byte + 1);
        uint32_t index = (uint32_t)row[x / per_byte] >> shift & ((1u << b->bits) - 1);
        if (index >= b->palette_count) {
            return false;
        }
        c = b->palette + index * (uint32_t)b->palette_step;
    }
    for (int k = 0; k < 3; k++) {
        rgb[k] = (float)c[2 - k] / 255;
    }
    return true;
}

rey_result rey_bmp_read(rey_context *ctx, const char *name, const unsigned char *bytes, size_t size, rey_image *out) {
    Bmp b = {.ctx = ctx, .name = name, .bytes = bytes, .size = size};
    rey_result result = read_header(&b);
    if (result != REY_OK) {
        return result;
    }
    uint64_t row_bytes = ((uint64_t)(b.width > 0 ? b.width : 0) * (uint64_t)b.bits + 31) / 32 * 4;
    if (b.width > 0 && (b.pixels > size || (size - b.pixels) / row_bytes < (uint64_t)b.height)) {
        return rey_fail(ctx, REY_ERROR_FORMAT, "%s: the file ends before its %lld x %lld pixels", name,
                        (long long)b.width, (long long)b.height);
    }
    int channels = b.grey ? 1 : 3;
    result = rey_image_new(ctx, name, b.width, b.height, channels, out);
    for (int64_t y = 0; y < b.height && result == REY_OK; y++) {
        const unsigned char *row = bytes + b.pixels + (uint64_t)(b.upward ? b.height - 1 - y : y) * row_bytes;
        for (int64_t x = 0; x < b.width; x++) {
            float rgb[3];
            if (!read_pixel(&b, row, x, rgb)) {
                return fail(&b, "a pixel is beyond the palette");
            }
            memcpy(out->data + (y * b.width + x) * channels, rgb, (size_t)channels * sizeof *rgb);
        }
    }
    out->srgb = true;
    return result;
}
