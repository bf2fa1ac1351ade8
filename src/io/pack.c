// pack.c: pictures whose numbers fit into 8 or 16 bits each, without loss.
#include "io/pack.h"

#include "scene/texels.h"

#include <math.h>
#include <string.h>

static bool pack_bytes(const float *from, int64_t count, unsigned char *to) {
    float levels[256];
    for (int i = 0; i < 256; i++) {
        levels[i] = (float)i / 255.0f;
    }
    for (int64_t i = 0; i < count; i++) {
        if (!(from[i] >= 0 && from[i] <= 1) || signbit(from[i])) { // -0 is another number
            return false;
        }
        int level = (int)(from[i] * 255 + 0.5f);
        if (levels[level] != from[i]) {
            return false;
        }
        to[i] = (unsigned char)level;
    }
    return true;
}

// binary16: a sign, 5 bits of exponent, 10 of mantissa; below 2^-14 without a leading one. Not of infinities.
static bool pack_half(float value, uint32_t *half) {
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    int exponent = (int)(bits >> 23 & 255) - 112;
    uint32_t mantissa = bits & 0x7fffff, sign = bits >> 16 & 0x8000;
    if (exponent >= 31) {
        return false;
    }
    if (exponent > 0) {
        *half = sign | (uint32_t)exponent << 10 | mantissa >> 13;
        return (mantissa & 0x1fff) == 0;
    }
    int shift = 14 - exponent;
    if (value == 0 || shift > 24) {
        *half = sign;
        return value == 0;
    }
    mantissa |= 0x800000;
    *half = sign | mantissa >> shift;
    return (mantissa & ((1u << shift) - 1)) == 0;
}

static bool pack_halves(const float *from, int64_t count, unsigned char *to) {
    for (int64_t i = 0; i < count; i++) {
        uint32_t half;
        if (!pack_half(from[i], &half)) {
            return false;
        }
        to[2 * i] = (unsigned char)half;
        to[2 * i + 1] = (unsigned char)(half >> 8);
    }
    return true;
}

rey_result rey_image_pack(rey_context *ctx, rey_image *image, bool srgb, PackedImage *out) {
    int64_t count = (int64_t)image->width * image->height * image->channels;
    *out = (PackedImage){.bytes = rey_alloc_array(ctx, (size_t)count, 1), .storage = srgb ? TEXELS_SRGB : TEXELS_BYTE};
    if (!out->bytes) {
        return REY_ERROR_MEMORY;
    }
    bool packed = pack_bytes(image->data, count, out->bytes);
    if (!packed) {
        rey_free(ctx, out->bytes);
        out->bytes = NULL;
    }
    if (!packed && !srgb) {
        *out = (PackedImage){.bytes = rey_alloc_array(ctx, (size_t)count, 2), .storage = TEXELS_HALF};
        if (!out->bytes) {
            return REY_ERROR_MEMORY;
        }
        packed = pack_halves(image->data, count, out->bytes);
    }
    if (packed) {
        rey_free(ctx, image->data);
        image->data = NULL;
        return REY_OK;
    }
    rey_free(ctx, out->bytes);
    *out = (PackedImage){0};
    return REY_OK;
}

void rey_pack_levels(float *levels) {
    for (int i = 0; i < 256; i++) {
        levels[LEVELS_BYTE + i] = (float)i / 255.0f;
        levels[LEVELS_SRGB + i] = rey_srgb_decode(levels[LEVELS_BYTE + i]);
    }
}
