// jpeg.c: JPEG through libjpeg. Its errors jump back instead of ending the process, and its warnings stay silent.
#include "io/image.h"

#include <setjmp.h>
#include <stdio.h>

#include <jpeglib.h>

typedef struct Errors {
    struct jpeg_error_mgr base;
    jmp_buf back;
    char message[JMSG_LENGTH_MAX];
} Errors;

static void on_error(j_common_ptr jpeg) {
    Errors *e = (Errors *)(void *)jpeg->err;
    e->base.format_message(jpeg, e->message);
    longjmp(e->back, 1);
}

// Replaces the library's own handler, which counts warnings beside printing them.
static void on_message(j_common_ptr jpeg, int level) {
    if (level < 0) {
        jpeg->err->num_warnings++;
    }
}

// A truncated file makes the library invent the rest and warn: that is an error here.
static bool is_damaged(const struct jpeg_decompress_struct *jpeg) {
    return jpeg->err->num_warnings > 0;
}

rey_result rey_jpeg_read(rey_context *ctx, const char *name, const unsigned char *bytes, size_t size, rey_image *out) {
    struct jpeg_decompress_struct jpeg;
    Errors errors;
    unsigned char *volatile row = NULL;
    jpeg.err = jpeg_std_error(&errors.base);
    errors.base.error_exit = on_error;
    errors.base.emit_message = on_message;
    if (setjmp(errors.back)) {
        jpeg_destroy_decompress(&jpeg);
        rey_free(ctx, row);
        return rey_fail(ctx, REY_ERROR_FORMAT, "%s: not a whole JPEG file: %s", name, errors.message);
    }
    jpeg_create_decompress(&jpeg);
    jpeg_mem_src(&jpeg, bytes, size);
    jpeg_read_header(&jpeg, TRUE);
    if (jpeg.num_components > 3) {
        jpeg_destroy_decompress(&jpeg);
        return rey_fail(ctx, REY_ERROR_FORMAT, "%s: the JPEG is in the colours of a printer (CMYK), expected grey or RGB", name);
    }
    jpeg.out_color_space = jpeg.num_components == 1 ? JCS_GRAYSCALE : JCS_RGB;
    jpeg_start_decompress(&jpeg);
    rey_result result = rey_image_check_claim(ctx, name, jpeg.output_width, jpeg.output_height, size);
    if (result == REY_OK) {
        result = rey_image_new(ctx, name, jpeg.output_width, jpeg.output_height, jpeg.output_components, out);
    }
    size_t count = (size_t)jpeg.output_width * (size_t)jpeg.output_components;
    row = result == REY_OK ? rey_alloc(ctx, count) : NULL;
    result = result == REY_OK && !row ? REY_ERROR_MEMORY : result;
    while (result == REY_OK && jpeg.output_scanline < jpeg.output_height && !is_damaged(&jpeg)) {
        float *line = out->data + jpeg.output_scanline * count;
        JSAMPROW rows[1] = {row};
        jpeg_read_scanlines(&jpeg, rows, 1);
        for (size_t i = 0; i < count; i++) {
            line[i] = (float)row[i] / 255.0f;
        }
    }
    if (result == REY_OK && is_damaged(&jpeg)) {
        result = rey_fail(ctx, REY_ERROR_FORMAT, "%s: the JPEG data is damaged or ends early", name);
    }
    out->srgb = true;
    jpeg_destroy_decompress(&jpeg);
    rey_free(ctx, row);
    return result;
}
