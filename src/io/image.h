// image.h: pictures in memory, and their readers and writers. Values are interleaved, rows from the top.
#pragma once

#include "base/context.h"

enum { IMAGE_LARGEST = 65536 }; // pixels along one edge

typedef struct rey_image {
    int width, height, channels; // channels: 1 or 3 (alpha is dropped); EXR files without colours: as many as they have
    float *data;                 // width x height x channels
    bool srgb;                   // integers of an sRGB-encoded file, scaled to [0, 1] and not decoded yet
    bool translucent;            // of a PNG with an alpha below 1 somewhere, by which its colours are divided
} rey_image;

// Reads a file by its content: OpenEXR (scanlines or tiles, any compression), PNG, JPEG, BMP (uncompressed), TGA, Radiance
// HDR, PFM, PGM and PPM (binary), NPY (f4 or f8, 2 or 3 dimensions). The caller frees *out with rey_image_free, also after a
// failure.
rey_result rey_image_read(rey_context *ctx, const char *path, rey_image *out);
rey_result rey_image_read_memory(rey_context *ctx, const char *name, const unsigned char *bytes, size_t size,
                                 rey_image *out);
void rey_image_free(rey_context *ctx, rey_image *image);

// A file in memory that is read from front to back.
typedef struct ImageBytes {
    rey_context *ctx;
    const char *name; // for messages
    const unsigned char *bytes;
    size_t size, at;
} ImageBytes;

// Fails with what is wrong at byte `at`.
rey_result rey_image_fail(const ImageBytes *in, const char *what);
// Text of a file that comes into messages: terminals take control characters as orders.
void rey_image_make_printable(char *text);

// Room for a picture; checks its size against IMAGE_LARGEST.
rey_result rey_image_new(rey_context *ctx, const char *name, int64_t width, int64_t height, int channels, rey_image *out);
// Refuses more pixels than any compression packs into `size` bytes, before memory is asked for.
rey_result rey_image_check_claim(rey_context *ctx, const char *name, int64_t width, int64_t height, size_t size);
// Three channels: grey is repeated, channels behind the third are dropped, two are refused.
rey_result rey_image_to_rgb(rey_context *ctx, const char *name, rey_image *image);

float rey_srgb_decode(float encoded); // the exact piecewise curve
float rey_srgb_encode(float linear);
void rey_image_decode_srgb(rey_image *image); // decodes and clears `srgb`

// The formats, from memory; `name` is for messages.
rey_result rey_exr_read(rey_context *ctx, const char *name, const unsigned char *bytes, size_t size, rey_image *out);
rey_result rey_png_read(rey_context *ctx, const char *name, const unsigned char *bytes, size_t size, rey_image *out);
rey_result rey_jpeg_read(rey_context *ctx, const char *name, const unsigned char *bytes, size_t size, rey_image *out);
rey_result rey_bmp_read(rey_context *ctx, const char *name, const unsigned char *bytes, size_t size, rey_image *out);
rey_result rey_rgbe_read(rey_context *ctx, const char *name, const unsigned char *bytes, size_t size, rey_image *out);
rey_result rey_tga_read(rey_context *ctx, const char *name, const unsigned char *bytes, size_t size, rey_image *out);
bool rey_tga_known(const unsigned char *bytes, size_t size);
rey_result rey_pnm_read(rey_context *ctx, const char *name, const unsigned char *bytes, size_t size, rey_image *out);
rey_result rey_pfm_read(rey_context *ctx, const char *name, const unsigned char *bytes, size_t size, rey_image *out);
rey_result rey_npy_read_image(rey_context *ctx, const char *name, const unsigned char *bytes, size_t size,
                              rey_image *out);

// ---- writers: a file appears complete or not at all ------------------------------------------------------------------

// float32, ZIP. names: one per channel, null = R G B (or Y for one).
rey_result rey_exr_write(rey_context *ctx, const char *path, const float *data, int width, int height, int channels,
                         const char *const *names);
// The same with components of another kind: REY_COMPONENT_*.
rey_result rey_exr_write_as(rey_context *ctx, const char *path, const float *data, int width, int height, int channels,
                            const char *const *names, int component);
// 8 bits, sRGB-encoded from linear RGB.
rey_result rey_png_write(rey_context *ctx, const char *path, const float *rgb, int width, int height);
// The same with alpha, by which the colours are multiplied in `rgba` and are not in the file.
rey_result rey_png_write_alpha(rey_context *ctx, const char *path, const float *rgba, int width, int height);
// Mean over channels in blue (negative), white (0), red; *scale is the value of full colour: the 99.5th percentile of
// |value|, or the largest when that is 0.
rey_result rey_png_write_signed(rey_context *ctx, const char *path, const float *rgb, int width, int height,
                                float *scale);
// PNG in memory of 8-bit RGB; the caller frees *bytes with rey_free.
rey_result rey_png_encode(rey_context *ctx, const unsigned char *rgb8, int width, int height, unsigned char **bytes,
                          size_t *size);
// Linear RGB to 8-bit sRGB; out: width x height x 3.
void rey_image_to_srgb8(const float *rgb, int64_t pixels, unsigned char *out);
// float32 array in C order.
rey_result rey_npy_write(rey_context *ctx, const char *path, const float *data, const int64_t *shape, int dims);
