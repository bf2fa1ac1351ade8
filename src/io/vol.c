// vol.c: grids of numbers in Mitsuba's VOL files.
#include "io/vol.h"

#include "io/file.h"

#include <math.h>
#include <string.h>

enum { MOST_VALUES = INT32_MAX };

void rey_vol_free(rey_context *ctx, rey_vol *vol) {
    rey_free(ctx, vol->data);
    *vol = (rey_vol){0};
}

static uint32_t load(const unsigned char *at) {
    return (uint32_t)at[0] | (uint32_t)at[1] << 8 | (uint32_t)at[2] << 16 | (uint32_t)at[3] << 24;
}

static float load_float(const unsigned char *at) {
    uint32_t bits = load(at);
    float value;
    memcpy(&value, &bits, sizeof bits);
    return value;
}

// 5 bits of exponent, 10 of mantissa.
static float load_half(const unsigned char *at) {
    uint32_t bits = (uint32_t)at[0] | (uint32_t)at[1] << 8, exponent = bits >> 10 & 31, mantissa = bits & 1023;
    float value = exponent == 31 ? (mantissa ? NAN : INFINITY)
                  : exponent     ? ldexpf((float)(1024 + mantissa), (int)exponent - 25)
                                 : ldexpf((float)mantissa, -24);
    return bits >> 15 ? -value : value;
}

size_t rey_vol_item(int encoding) { return encoding == VOL_FLOAT ? 4 : encoding == VOL_HALF ? 2 : 1; }

bool rey_vol_known(const unsigned char *bytes, size_t size) { return size >= 3 && memcmp(bytes, "VOL", 3) == 0; }

rey_result rey_vol_header(rey_context *ctx, const char *name, const unsigned char *header, size_t size, rey_vol *out,
                          int *encoding) {
    *out = (rey_vol){0};
    if (size < VOL_HEADER || !rey_vol_known(header, size)) {
        return rey_fail(ctx, REY_ERROR_FORMAT, "%s: byte 0: not a VOL file, expected 'VOL' and a header of %d bytes", name,
                        VOL_HEADER);
    }
    uint32_t code = load(header + 4);
    if (header[3] < 1 || header[3] > 3 || code < VOL_FLOAT || code > VOL_BYTE) {
        return rey_fail(ctx, REY_ERROR_FORMAT,
                        "%s: byte 3: version %d, encoding %u, expected version 1 to 3, encoding 1 (float), 2 (half) or 3 "
                        "(byte)", name, header[3], (unsigned)code);
    }
    *encoding = (int)code;
    int64_t n[4], count = 1;
    for (int k = 0; k < 4; k++) {
        n[k] = (int32_t)load(header + 8 + 4 * k);
        if (n[k] < 1 || n[k] > 1 << 20 || count > MOST_VALUES / n[k]) {
            return rey_fail(ctx, REY_ERROR_FORMAT, "%s: byte %d: %lld is no number of %s, expected 1 or more and at most %d "
                            "values in all", name, 8 + 4 * k, (long long)n[k], k < 3 ? "nodes" : "channels", MOST_VALUES);
        }
        count *= n[k];
    }
    if ((uint64_t)count > (size - VOL_HEADER) / rey_vol_item(*encoding)) {
        return rey_fail(ctx, REY_ERROR_FORMAT, "%s: byte %zu: the file ends inside its data, expected %lld values", name,
                        size, (long long)count);
    }
    rey_vol vol = {.nx = (int32_t)n[0], .ny = (int32_t)n[1], .nz = (int32_t)n[2], .channels = (int32_t)n[3]};
    for (int k = 0; k < 6; k++) {
        vol.box[k] = load_float(header + 24 + 4 * k);
        if (!isfinite(vol.box[k])) {
            return rey_fail(ctx, REY_ERROR_FORMAT, "%s: byte %d: a corner of the box is not finite", name, 24 + 4 * k);
        }
    }
    *out = vol;
    return REY_OK;
}

rey_result rey_vol_decode(rey_context *ctx, const char *name, int encoding, const unsigned char *bytes, size_t first,
                          size_t count, float *values) {
    size_t item = rey_vol_item(encoding);
    for (size_t i = 0; i < count; i++) {
        const unsigned char *at = bytes + item * i;
        values[i] = encoding == VOL_FLOAT ? load_float(at) : encoding == VOL_HALF ? load_half(at) : (float)*at / 255;
        if (!isfinite(values[i])) {
            return rey_fail(ctx, REY_ERROR_FORMAT, "%s: byte %zu: the value is not finite", name,
                            VOL_HEADER + item * (first + i));
        }
    }
    return REY_OK;
}

rey_result rey_vol_read_memory(rey_context *ctx, const char *name, const unsigned char *bytes, size_t size, rey_vol *out) {
    int encoding;
    rey_result result = rey_vol_header(ctx, name, bytes, size, out, &encoding);
    if (result != REY_OK) {
        return result;
    }
    size_t count = (size_t)out->nx * (size_t)out->ny * (size_t)out->nz * (size_t)out->channels;
    out->data = rey_alloc_array(ctx, count, sizeof *out->data);
    result = out->data ? rey_vol_decode(ctx, name, encoding, bytes + VOL_HEADER, 0, count, out->data) : REY_ERROR_MEMORY;
    if (result != REY_OK) {
        rey_vol_free(ctx, out);
    }
    return result;
}

static void store(unsigned char *to, uint32_t value) {
    for (int i = 0; i < 4; i++) {
        to[i] = (unsigned char)(value >> (8 * i));
    }
}

static void store_floats(unsigned char *to, const float *values, size_t count) {
    for (size_t i = 0; i < count; i++) {
        uint32_t bits;
        memcpy(&bits, values + i, sizeof bits);
        store(to + 4 * i, bits);
    }
}

rey_result rey_vol_write(rey_context *ctx, const char *path, const rey_vol *vol) {
    size_t count = (size_t)vol->nx * (size_t)vol->ny * (size_t)vol->nz * (size_t)vol->channels;
    unsigned char *bytes = rey_alloc_array(ctx, count + VOL_HEADER / 4, 4);
    if (!bytes) {
        return REY_ERROR_MEMORY;
    }
    const int32_t header[5] = {1, vol->nx, vol->ny, vol->nz, vol->channels};
    memcpy(bytes, "VOL\3", 4);
    for (int k = 0; k < 5; k++) {
        store(bytes + 4 + 4 * k, (uint32_t)header[k]);
    }
    store_floats(bytes + 24, vol->box, 6);
    store_floats(bytes + VOL_HEADER, vol->data, count);
    rey_result result = rey_file_write(ctx, path, bytes, VOL_HEADER + 4 * count);
    rey_free(ctx, bytes);
    return result;
}
