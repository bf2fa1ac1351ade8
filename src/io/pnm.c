// pnm.c: Netpbm's pictures in binary: PGM and PPM of 8 and 16 bits, and PFM, whose floats may have either order of bytes.
#include "io/decimal.h"
#include "io/image.h"
#include "io/number.h"

#include <math.h>
#include <string.h>

// The text of the next number of the header, behind blanks and comments.
static const char *next_number(ImageBytes *p) {
    for (bool comment = false; p->at < p->size; p->at++) {
        const char c = (char)p->bytes[p->at];
        comment = (comment || c == '#') && c != '\n';
        if (!comment && !rey_is_blank(c)) {
            break;
        }
    }
    return (const char *)p->bytes + p->at;
}

static rey_result read_size(ImageBytes *p, int64_t size[2]) {
    if (p->at < p->size && !rey_is_blank((char)p->bytes[p->at]) && p->bytes[p->at] != '#') {
        return rey_image_fail(p, "expected a blank behind 'P5', 'P6', 'Pf' or 'PF'");
    }
    for (int k = 0; k < 2; k++) {
        const char *text = next_number(p), *end = rey_parse_int(text, (const char *)p->bytes + p->size, size + k);
        if (!end || size[k] < 1) {
            return rey_image_fail(p, k ? "expected the height in pixels" : "expected the width in pixels");
        }
        p->at += (size_t)(end - text);
    }
    return REY_OK;
}

// One blank ends the header, or a comment; what follows must be all there. Where it fits, two blanks are the end of a line that a
// text editor or a transfer made of one.
static rey_result make_room(ImageBytes *p, const int64_t size[2], int channels, size_t sample, rey_image *out) {
    const bool comment = p->at < p->size && p->bytes[p->at] == '#';
    while (comment && p->at < p->size && p->bytes[p->at] != '\n') {
        p->at++;
    }
    if (p->at >= p->size || !rey_is_blank((char)p->bytes[p->at])) {
        return rey_image_fail(p, "expected a blank between the header and the pixels");
    }
    p->at++;
    const bool small = size[0] <= IMAGE_LARGEST && size[1] <= IMAGE_LARGEST, line = p->at < p->size && p->bytes[p->at] == '\n';
    const uint64_t needed = small ? (uint64_t)(size[0] * size[1]) * (uint64_t)channels * sample : 0;
    p->at += line && p->bytes[p->at - 1] == '\r' && p->size - p->at == needed + 1;
    if (needed > p->size - p->at) {
        return rey_fail(p->ctx, REY_ERROR_FORMAT, "%s: byte %zu: the file ends before its %lld x %lld pixels", p->name, p->size,
                        (long long)size[0], (long long)size[1]);
    }
    return rey_image_new(p->ctx, p->name, size[0], size[1], channels, out);
}

rey_result rey_pnm_read(rey_context *ctx, const char *name, const unsigned char *bytes, size_t size, rey_image *out) {
    ImageBytes p = {.ctx = ctx, .name = name, .bytes = bytes, .size = size, .at = 2};
    int64_t extent[2], most;
    const int channels = bytes[1] == '6' ? 3 : 1;
    rey_result result = read_size(&p, extent);
    if (result != REY_OK) {
        return result;
    }
    const char *text = next_number(&p), *end = rey_parse_int(text, (const char *)bytes + size, &most);
    if (!end || most < 1 || most > 65535) {
        return rey_image_fail(&p, "expected the largest value, 1 to 65535");
    }
    p.at += (size_t)(end - text);
    const size_t sample = most > 255 ? 2 : 1;
    result = make_room(&p, extent, channels, sample, out);
    const int64_t count = (int64_t)out->width * out->height * channels; // 0 after a failure
    for (int64_t i = 0; i < count; i++, p.at += sample) {
        const int value = sample == 2 ? bytes[p.at] << 8 | bytes[p.at + 1] : bytes[p.at];
        if (value > most) {
            return rey_image_fail(&p, "a value is above the largest that the header names");
        }
        out->data[i] = (float)value / (float)most;
    }
    out->srgb = true;
    return result;
}

rey_result rey_pfm_read(rey_context *ctx, const char *name, const unsigned char *bytes, size_t size, rey_image *out) {
    ImageBytes p = {.ctx = ctx, .name = name, .bytes = bytes, .size = size, .at = 2};
    int64_t extent[2];
    float scale;
    const int channels = bytes[1] == 'F' ? 3 : 1;
    rey_result result = read_size(&p, extent);
    if (result != REY_OK) {
        return result;
    }
    const char *text = next_number(&p), *end = rey_parse_float(text, (const char *)bytes + size, &scale);
    if (!end || scale == 0 || !isfinite(scale)) {
        return rey_image_fail(&p, "expected the scale: below 0 the floats are little-endian, above 0 big-endian");
    }
    p.at += (size_t)(end - text);
    result = make_room(&p, extent, channels, sizeof(float), out);
    const int64_t row = (int64_t)out->width * channels;
    for (int y = out->height - 1; y >= 0 && result == REY_OK; y--) { // rows from the bottom
        for (int64_t i = 0; i < row; i++, p.at += sizeof(float)) {
            uint32_t bits = 0;
            for (int k = 0; k < 4; k++) {
                bits |= (uint32_t)bytes[p.at + (size_t)k] << 8 * (scale < 0 ? k : 3 - k);
            }
            float value;
            memcpy(&value, &bits, sizeof value);
            out->data[y * row + i] = value * fabsf(scale);
        }
    }
    return result;
}
