// image.c: pictures: detection by content, memory, sRGB.
#include "io/image.h"

#include "io/file.h"

#include <math.h>
#include <string.h>

void rey_image_free(rey_context *ctx, rey_image *image) {
    rey_free(ctx, image->data);
    *image = (rey_image){0};
}

rey_result rey_image_fail(const ImageBytes *in, const char *what) {
    return rey_fail(in->ctx, REY_ERROR_FORMAT, "%s: byte %zu: %s", in->name, in->at, what);
}

void rey_image_make_printable(char *text) {
    for (char *c = text; *c; c++) {
        *c = *c < ' ' || *c > '~' ? '?' : *c;
    }
}

rey_result rey_image_new(rey_context *ctx, const char *name, int64_t width, int64_t height, int channels,
                         rey_image *out) {
    if (width < 1 || height < 1 || width > IMAGE_LARGEST || height > IMAGE_LARGEST || width * height > INT32_MAX / 2) {
        return rey_fail(ctx, REY_ERROR_FORMAT, "%s: the picture is %lld x %lld, expected 1 to %d along an edge", name,
                        (long long)width, (long long)height, IMAGE_LARGEST);
    }
    *out = (rey_image){.width = (int)width, .height = (int)height, .channels = channels};
    out->data = rey_alloc_array(ctx, (size_t)(width * height) * (size_t)channels, sizeof *out->data);
    return out->data ? REY_OK : REY_ERROR_MEMORY;
}

rey_result rey_image_check_claim(rey_context *ctx, const char *name, int64_t width, int64_t height, size_t size) {
    // Deflate packs at most 8300 one-bit pixels into a byte, JPEG and OpenEXR fewer but for a file's fixed parts.
    if (width > 0 && height > 0 && width <= IMAGE_LARGEST && height <= IMAGE_LARGEST &&
        (uint64_t)(width * height) / 16384 > size) {
        return rey_fail(ctx, REY_ERROR_FORMAT, "%s: claims %lld x %lld pixels in %zu bytes", name, (long long)width,
                        (long long)height, size);
    }
    return REY_OK;
}

rey_result rey_image_read_memory(rey_context *ctx, const char *name, const unsigned char *bytes, size_t size,
                                 rey_image *out) {
    static const struct {
        const char *magic;
        size_t length;
        rey_result (*read)(rey_context *, const char *, const unsigned char *, size_t, rey_image *);
    } formats[] = {{"\x76\x2f\x31\x01", 4, rey_exr_read}, {"\x89PNG", 4, rey_png_read},
                   {"\xff\xd8\xff", 3, rey_jpeg_read},     {"PF", 2, rey_pfm_read},
                   {"Pf", 2, rey_pfm_read},                {"BM", 2, rey_bmp_read},
                   {"#?", 2, rey_rgbe_read},               {"\x93NUMPY", 6, rey_npy_read_image},
                   {"P5", 2, rey_pnm_read},                {"P6", 2, rey_pnm_read}};
    *out = (rey_image){0};
    rey_result (*read)(rey_context *, const char *, const unsigned char *, size_t, rey_image *) =
        rey_tga_known(bytes, size) ? rey_tga_read : NULL;
    for (int i = 0; i < COUNT_OF(formats); i++) {
        if (size > formats[i].length && memcmp(bytes, formats[i].magic, formats[i].length) == 0) {
            read = formats[i].read;
        }
    }
    if (!read) {
        return rey_fail(ctx, REY_ERROR_FORMAT,
                        "%s: not a picture that can be read, expected OpenEXR, PNG, JPEG, BMP, TGA, Radiance HDR, PFM, PGM or "
                        "PPM (binary), or NPY", name);
    }
    rey_result result = read(ctx, name, bytes, size, out);
    if (result != REY_OK) {
        rey_image_free(ctx, out);
    }
    return result;
}

rey_result rey_image_read(rey_context *ctx, const char *path, rey_image *out) {
    unsigned char *bytes = NULL;
    size_t size = 0;
    *out = (rey_image){0};
    rey_result result = rey_file_read(ctx, path, &bytes, &size);
    if (result == REY_OK) {
        result = rey_image_read_memory(ctx, path, bytes, size, out);
    }
    rey_free(ctx, bytes);
    return result;
}

rey_result rey_image_to_rgb(rey_context *ctx, const char *name, rey_image *image) {
    if (image->channels == 3) {
        return REY_OK;
    }
    if (image->channels == 2) {
        return rey_fail(ctx, REY_ERROR_UNSUPPORTED, "%s: two channels are no colour, expected one (grey), or red, green and blue",
                        name);
    }
    int64_t pixels = (int64_t)image->width * image->height;
    float *rgb = rey_alloc_array(ctx, (size_t)pixels * 3, sizeof *rgb);
    if (!rgb) {
        return REY_ERROR_MEMORY;
    }
    for (int64_t i = 0; i < pixels * 3; i++) {
        int channel = image->channels >= 3 ? (int)(i % 3) : 0;
        rgb[i] = image->data[i / 3 * image->channels + channel];
    }
    rey_free(ctx, image->data);
    image->data = rgb;
    image->channels = 3;
    return REY_OK;
}

float rey_srgb_decode(float x) {
    return x <= 0.04045f ? x / 12.92f : powf((x + 0.055f) / 1.055f, 2.4f);
}

float rey_srgb_encode(float x) {
    return x <= 0.0031308f ? 12.92f * x : 1.055f * powf(x, 1 / 2.4f) - 0.055f;
}

// Most pictures have 8 bits a sample, so that a table knows all values.
void rey_image_decode_srgb(rey_image *image) {
    enum { LEVELS = 256 };
    int64_t count = (int64_t)image->width * image->height * image->channels;
    float encoded[LEVELS], decoded[LEVELS];
    for (int i = 0; i < LEVELS; i++) {
        encoded[i] = (float)i / 255.0f;
        decoded[i] = rey_srgb_decode(encoded[i]);
    }
    for (int64_t i = 0; i < count; i++) {
        float x = image->data[i];
        int level = x >= 0 && x <= 1 ? (int)(x * 255 + 0.5f) : 0;
        image->data[i] = x == encoded[level] ? decoded[level] : rey_srgb_decode(x);
    }
    image->srgb = false;
}

void rey_image_to_srgb8(const float *rgb, int64_t pixels, unsigned char *out) {
    for (int64_t i = 0; i < pixels * 3; i++) {
        float x = rgb[i] > 0 ? rgb[i] : 0; // NaN becomes 0
        out[i] = (unsigned char)(255 * rey_srgb_encode(x < 1 ? x : 1) + 0.5f);
    }
}
