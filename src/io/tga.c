// tga.c: Truevision's pictures: grey, colours and palettes of 8 to 32 bits, plain and run-length encoded. Only files of version 2
// have a mark, at their end; those of version 1 are known by a header without contradictions.
#include "io/image.h"

#include <string.h>

enum { HEADER = 18, FOOTER = 26, PALETTE = 1, COLOUR = 2, GREY = 3, RUNS = 8 };

typedef struct Tga {
    ImageBytes in;
    const unsigned char *palette;
    int sort, bits, colour_bits; // of a pixel, and of a colour in it or in the palette
    int64_t first, colours;      // of the palette
    int left;                    // pixels of the packet that are still to come; 0 without packets
    bool raw;                    // the packet has a value for each of its pixels, not one for all
} Tga;

static int word(const unsigned char *at) { return at[0] | at[1] << 8; }

static bool colour_known(int bits) { return bits == 15 || bits == 16 || bits == 24 || bits == 32; }

bool rey_tga_known(const unsigned char *bytes, size_t size) {
    static const char mark[] = "TRUEVISION-XFILE.";
    if (size < HEADER) {
        return false;
    }
    if (size >= HEADER + FOOTER && memcmp(bytes + size - sizeof mark, mark, sizeof mark) == 0) {
        return true;
    }
    const int sort = bytes[2] & ~RUNS, bits = bytes[16];
    const bool mapped = sort == PALETTE && bytes[1] == 1 && (bits == 8 || bits == 16) && word(bytes + 5) > 0;
    const bool grey = sort == GREY && (bits == 8 || bits == 16);
    const bool palette = bytes[1] == 0 || (bytes[1] == 1 && colour_known(bytes[7])); // of no use to colours
    const bool sort_known = mapped || (palette && (grey || (sort == COLOUR && colour_known(bits))));
    return sort_known && (bytes[17] & 0xc0) == 0 && word(bytes + 12) > 0 && word(bytes + 14) > 0;
}

static rey_result read_header(Tga *t) {
    const unsigned char *h = t->in.bytes;
    t->sort = h[2] & ~RUNS;
    t->bits = h[16];
    const bool mapped = t->sort == PALETTE;
    t->colour_bits = mapped ? h[7] : t->bits;
    t->in.at = 2;
    if (t->sort < PALETTE || t->sort > GREY || (mapped && h[1] != 1)) {
        return rey_image_fail(&t->in, "expected a picture with a palette (1), of colours (2) or grey (3), or the same in runs "
                                       "(9, 10, 11)");
    }
    t->in.at = 16;
    const bool narrow = t->bits == 8 || t->bits == 16; // grey with alpha, and large palettes, have 16 bits
    if (t->sort == GREY ? !narrow : !colour_known(t->colour_bits) || (mapped && !narrow)) {
        return rey_image_fail(&t->in, "expected 8 or 16 bits for each pixel of grey and palettes, and 15, 16, 24 or 32 for each "
                                       "colour");
    }
    t->in.at = HEADER + (size_t)h[0];
    if (h[1] == 1) { // a palette may be there unused
        t->first = word(h + 3);
        t->colours = word(h + 5);
        t->palette = h + t->in.at;
        t->in.at += (size_t)t->colours * (size_t)((h[7] + 7) / 8);
    }
    return t->in.at <= t->in.size ? REY_OK : rey_image_fail(&t->in, "the file ends in its header");
}

static void colour_of(const unsigned char *at, int bits, float rgb[3]) {
    for (int c = 0; c < 3; c++) { // blue comes first
        rgb[c] = bits > 16 ? (float)at[2 - c] / 255 : (float)(word(at) >> (10 - 5 * c) & 31) / 31;
    }
}

// The next pixel, from its packet where the picture is in runs.
static rey_result next_pixel(Tga *t, float rgb[3]) {
    const size_t step = (size_t)(t->bits + 7) / 8;
    const bool runs = t->in.bytes[2] & RUNS;
    if (runs && t->left == 0 && t->in.at < t->in.size) {
        t->left = (t->in.bytes[t->in.at] & 127) + 1;
        t->raw = !(t->in.bytes[t->in.at++] & 128);
    }
    if (step > t->in.size - t->in.at) {
        return rey_image_fail(&t->in, "the file ends before its pixels");
    }
    const unsigned char *pixel = t->in.bytes + t->in.at;
    if (t->sort == GREY) {
        rgb[0] = (float)pixel[0] / 255;
    } else if (t->sort == PALETTE) {
        const int64_t index = (t->bits == 16 ? word(pixel) : pixel[0]) - t->first;
        if (index < 0 || index >= t->colours) {
            return rey_image_fail(&t->in, "a pixel is beyond the palette");
        }
        colour_of(t->palette + index * ((t->colour_bits + 7) / 8), t->colour_bits, rgb);
    } else {
        colour_of(pixel, t->bits, rgb);
    }
    t->left -= runs;
    t->in.at += t->raw || t->left == 0 ? step : 0;
    return REY_OK;
}

rey_result rey_tga_read(rey_context *ctx, const char *name, const unsigned char *bytes, size_t size, rey_image *out) {
    enum { FROM_RIGHT = 16, FROM_TOP = 32 };
    Tga t = {.in = {.ctx = ctx, .name = name, .bytes = bytes, .size = size}};
    const int64_t width = word(bytes + 12), height = word(bytes + 14);
    rey_result result = read_header(&t);
    const int channels = t.sort == GREY ? 1 : 3;
    result = result != REY_OK ? result : rey_image_check_claim(ctx, name, width, height, size);
    result = result != REY_OK ? result : rey_image_new(ctx, name, width, height, channels, out);
    for (int64_t i = 0; i < width * height && result == REY_OK; i++) {
        const int64_t x = bytes[17] & FROM_RIGHT ? width - 1 - i % width : i % width;
        const int64_t y = bytes[17] & FROM_TOP ? i / width : height - 1 - i / width;
        float rgb[3] = {0};
        result = next_pixel(&t, rgb);
        memcpy(out->data + (y * width + x) * channels, rgb, (size_t)channels * sizeof *rgb);
    }
    out->srgb = true;
    return result == REY_OK && t.left > 0 ? rey_image_fail(&t.in, "the last run goes on behind the last pixel") : result;
}
