// vol.c: grids of numbers in Mitsuba's VOL files.
#include "io/vol.h"

#include "io/file.h"

#include <math.h>
#include <string.h>

enum { HEADER = 48 };

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
    memcpy(&value, &bits, sizeof value);
    return value;
}

static rey_result read_header(rey_context *ctx, const char *name, const unsigned char *bytes, size_t size, rey_vol *out) {
    if (size < HEADER || memcmp(bytes, "VOL", 3) != 0) {
        return rey_fail(ctx, REY_ERROR_FORMAT, "%s: byte 0: not a VOL file, expected 'VOL' and a header of %d bytes", name,
                        HEADER);
    }
    if (bytes[3] != 3 || load(bytes + 4) != 1) {
        return rey_fail(ctx, REY_ERROR_FORMAT, "%s: byte 3: version %d, encoding %u, expected version 3, encoding 1", name,
                        bytes[3], (unsigned)load(bytes + 4));
    }
    int64_t n[4], count = 1;
    for (int k = 0; k < 4; k++) {
        n[k] = (int32_t)load(bytes + 8 + 4 * k);
        if (n[k] < 1 || n[k] > 1 << 20 || count > (INT32_MAX / 4) / n[k]) {
            return rey_fail(ctx, REY_ERROR_FORMAT, "%s: byte %d: %lld is no number of %s, expected 1 or more and at most %d "
                            "values in all", name, 8 + 4 * k, (long long)n[k], k < 3 ? "nodes" : "channels", INT32_MAX / 4);
        }
        count *= n[k];
    }
    if ((uint64_t)count * 4 > size - HEADER) {
        return rey_fail(ctx, REY_ERROR_FORMAT, "%s: byte %zu: the file ends inside its data, expected %lld values", name,
                        size, (long long)count);
    }
    *out = (rey_vol){.nx = (int32_t)n[0], .ny = (int32_t)n[1], .nz = (int32_t)n[2], .channels = (int32_t)n[3]};
    for (int k = 0; k < 6; k++) {
        out->box[k] = load_float(bytes + 24 + 4 * k);
        if (!isfinite(out->box[k])) {
            *out = (rey_vol){0};
            return rey_fail(ctx, REY_ERROR_FORMAT, "%s: byte %d: a corner of the box is not finite", name, 24 + 4 * k);
        }
    }
    return REY_OK;
}

rey_result rey_vol_read_memory(rey_context *ctx, const char *name, const unsigned char *bytes, size_t size, rey_vol *out) {
    *out = (rey_vol){0};
    rey_result result = read_header(ctx, name, bytes, size, out);
    if (result != REY_OK) {
        return result;
    }
    size_t count = (size_t)out->nx * (size_t)out->ny * (size_t)out->nz * (size_t)out->channels;
    out->data = rey_alloc_array(ctx, count, sizeof *out->data);
    if (!out->data) {
        return REY_ERROR_MEMORY;
    }
    for (size_t i = 0; i < count; i++) {
        out->data[i] = load_float(bytes + HEADER + 4 * i);
        if (!isfinite(out->data[i])) {
            rey_vol_free(ctx, out);
            return rey_fail(ctx, REY_ERROR_FORMAT, "%s: byte %zu: the value is not finite", name, HEADER + 4 * i);
        }
    }
    return REY_OK;
}

rey_result rey_vol_read(rey_context *ctx, const char *path, rey_vol *out) {
    unsigned char *bytes;
    size_t size;
    *out = (rey_vol){0};
    rey_result result = rey_file_read(ctx, path, &bytes, &size);
    if (result == REY_OK) {
        result = rey_vol_read_memory(ctx, path, bytes, size, out);
        rey_free(ctx, bytes);
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
    unsigned char *bytes = rey_alloc_array(ctx, count + HEADER / 4, 4);
    if (!bytes) {
        return REY_ERROR_MEMORY;
    }
    const int32_t header[5] = {1, vol->nx, vol->ny, vol->nz, vol->channels};
    memcpy(bytes, "VOL\3", 4);
    for (int k = 0; k < 5; k++) {
        store(bytes + 4 + 4 * k, (uint32_t)header[k]);
    }
    store_floats(bytes + 24, vol->box, 6);
    store_floats(bytes + HEADER, vol->data, count);
    rey_result result = rey_file_write(ctx, path, bytes, HEADER + 4 * count);
    rey_free(ctx, bytes);
    return result;
}
