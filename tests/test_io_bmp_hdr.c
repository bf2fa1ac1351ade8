// test_io_bmp_hdr.c: Windows bitmaps and Radiance pictures: every sort that is read, and broken ones refused; names of channels of
// OpenEXR pictures, and what PFM and NPY say of their numbers.
#include "io_picture.h"

#include <stdio.h>

typedef struct Bytes {
    unsigned char data[4096];
    size_t count;
} Bytes;

static void put(Bytes *b, const void *data, size_t count) {
    assert_true(b->count + count <= sizeof b->data);
    memcpy(b->data + b->count, data, count);
    b->count += count;
}

static void put_number(Bytes *b, uint32_t value, int bytes) {
    for (int i = 0; i < bytes; i++) {
        unsigned char byte = (unsigned char)(value >> 8 * i);
        put(b, &byte, 1);
    }
}

static rey_context *ctx;

static int open_context(void **state) {
    UNUSED(state);
    return rey_context_create(NULL, &ctx) != REY_OK;
}

static int close_context(void **state) {
    UNUSED(state);
    rey_context_destroy(ctx);
    return 0;
}

/* ---- BMP ------------------------------------------------------------------------------------------------------- */

// A header of 40 bytes (12: the old form) with a palette or masks and the pixels behind it.
static void make_bmp(Bytes *b, int header, int width, int height, int bits, int compression, const void *extra,
                     size_t extra_bytes, const void *pixels, size_t pixel_bytes) {
    int number = header == 12 ? 2 : 4;
    b->count = 0;
    put(b, "BM", 2);
    put_number(b, 0, 4);
    put_number(b, 0, 4);
    put_number(b, (uint32_t)(14 + header) + (uint32_t)extra_bytes, 4);
    put_number(b, (uint32_t)header, 4);
    put_number(b, (uint32_t)width, number);
    put_number(b, (uint32_t)height, number);
    put_number(b, 1, 2);
    put_number(b, (uint32_t)bits, 2);
    if (header > 12) {
        put_number(b, (uint32_t)compression, 4);
        put_number(b, (uint32_t)pixel_bytes, 4);
        put_number(b, 0, 4);
        put_number(b, 0, 4);
        put_number(b, bits <= 8 ? (uint32_t)(extra_bytes / 4) : 0, 4);
        put_number(b, 0, 4);
    }
    put(b, extra, extra_bytes);
    put(b, pixels, pixel_bytes);
}

static Bytes file;

static void bitmaps_of_24_and_32_bits(void **state) {
    UNUSED(state);
    static const unsigned char rows[] = {1, 2, 3, 4, 5, 6, 0, 0, 7, 8, 9, 10, 11, 12, 0, 0}; // padded to 4 bytes
    float up[12], down[12];
    static const unsigned char from_bottom[] = {9, 8, 7, 12, 11, 10, 3, 2, 1, 6, 5, 4};
    for (int i = 0; i < 12; i++) {
        up[i] = (float)from_bottom[i] / 255;
        down[(i + 6) % 12] = up[i];
    }
    make_bmp(&file, 40, 2, 2, 24, 0, "", 0, rows, sizeof rows);
    expect_pixels(ctx, file.data, file.count, 2, 2, 3, true, up);
    make_bmp(&file, 40, 2, -2, 24, 0, "", 0, rows, sizeof rows);
    expect_pixels(ctx, file.data, file.count, 2, 2, 3, true, down);
    make_bmp(&file, 12, 2, 2, 24, 0, "", 0, rows, sizeof rows);
    expect_pixels(ctx, file.data, file.count, 2, 2, 3, true, up);
    static const unsigned char deep[] = {1, 2, 3, 99, 4, 5, 6, 0}; // alpha is dropped
    const float colours[] = {3 / 255.f, 2 / 255.f, 1 / 255.f, 6 / 255.f, 5 / 255.f, 4 / 255.f};
    make_bmp(&file, 40, 2, 1, 32, 0, "", 0, deep, sizeof deep);
    expect_pixels(ctx, file.data, file.count, 2, 1, 3, true, colours);
    static const unsigned char masks[] = {0, 255, 0, 0, 0, 0, 255, 0, 0, 0, 0, 255};
    const float turned[] = {2 / 255.f, 3 / 255.f, 99 / 255.f, 5 / 255.f, 6 / 255.f, 0};
    make_bmp(&file, 40, 2, 1, 32, 3, masks, sizeof masks, deep, sizeof deep);
    expect_pixels(ctx, file.data, file.count, 2, 1, 3, true, turned);
}

static void bitmaps_of_16_bits_and_palettes(void **state) {
    UNUSED(state);
    static const unsigned char five[] = {0x1f, 0x7c, 0xe0, 0x03}; // magenta, green
    const float colours[] = {1, 0, 1, 0, 1, 0};
    make_bmp(&file, 40, 2, 1, 16, 0, "", 0, five, sizeof five);
    expect_pixels(ctx, file.data, file.count, 2, 1, 3, true, colours);
    static const unsigned char palette[] = {10, 20, 30, 0, 40, 50, 60, 0}, grey[] = {10, 10, 10, 0, 255, 255, 255, 0};
    static const unsigned char eight[] = {1, 0, 0, 0}, four[] = {0x10, 0, 0, 0}, one[] = {0x80, 0, 0, 0};
    const float painted[] = {60 / 255.f, 50 / 255.f, 40 / 255.f, 30 / 255.f, 20 / 255.f, 10 / 255.f};
    const float plain[] = {1, 10 / 255.f};
    make_bmp(&file, 40, 2, 1, 8, 0, palette, sizeof palette, eight, 4);
    expect_pixels(ctx, file.data, file.count, 2, 1, 3, true, painted);
    make_bmp(&file, 40, 2, 1, 4, 0, palette, sizeof palette, four, 4);
    expect_pixels(ctx, file.data, file.count, 2, 1, 3, true, painted);
    make_bmp(&file, 40, 2, 1, 1, 0, grey, sizeof grey, one, 4);
    expect_pixels(ctx, file.data, file.count, 2, 1, 1, true, plain);
    static const unsigned char beyond[] = {2, 0, 0, 0};
    make_bmp(&file, 40, 2, 1, 8, 0, palette, sizeof palette, beyond, 4);
    expect_failure(ctx, "test.picture", file.data, file.count, "beyond the palette");
}

static void broken_bitmaps(void **state) {
    UNUSED(state);
    static const unsigned char rows[] = {1, 2, 3, 0}, no_mask[12] = {0}, holes[12] = {5, 0, 0, 0, 8, 0, 0, 0, 16};
    make_bmp(&file, 40, 1, 1, 24, 0, "", 0, rows, sizeof rows);
    for (size_t count = 0; count < file.count; count++) {
        expect_failure(ctx, "test.picture", file.data, count, "test.picture");
    }
    make_bmp(&file, 40, 1, 1, 8, 1, "", 0, rows, sizeof rows);
    expect_failure(ctx, "test.picture", file.data, file.count, "compression 1");
    make_bmp(&file, 40, 1, 1, 7, 0, "", 0, rows, sizeof rows);
    expect_failure(ctx, "test.picture", file.data, file.count, "bits per pixel");
    make_bmp(&file, 40, 0, 1, 24, 0, "", 0, rows, sizeof rows);
    expect_failure(ctx, "test.picture", file.data, file.count, "0 x 1");
    make_bmp(&file, 40, 60000, 60000, 24, 0, "", 0, rows, sizeof rows);
    expect_failure(ctx, "test.picture", file.data, file.count, "ends before its 60000 x 60000 pixels");
    make_bmp(&file, 40, INT32_MAX, INT32_MIN, 32, 0, "", 0, rows, sizeof rows);
    expect_failure(ctx, "test.picture", file.data, file.count, "ends before");
    make_bmp(&file, 40, 1, 1, 32, 3, no_mask, sizeof no_mask, rows, sizeof rows);
    expect_failure(ctx, "test.picture", file.data, file.count, "mask");
    make_bmp(&file, 40, 1, 1, 16, 3, holes, sizeof holes, rows, sizeof rows);
    expect_failure(ctx, "test.picture", file.data, file.count, "mask");
    make_bmp(&file, 40, 1, 1, 8, 0, "", 0, rows, sizeof rows);
    expect_failure(ctx, "test.picture", file.data, file.count, "palette");
}

/* ---- Radiance -------------------------------------------------------------------------------------------------- */

static void make_hdr(Bytes *b, const char *header, const void *pixels, size_t count) {
    b->count = 0;
    put(b, header, strlen(header));
    put(b, pixels, count);
}

#define HDR(size) "#?RADIANCE\n# a comment\nEXPOSURE=2\nFORMAT=32-bit_rle_rgbe\n\n" size "\n"

static void flat_pictures(void **state) {
    UNUSED(state);
    static const unsigned char pixels[] = {128, 64, 32, 129, 255, 0, 1, 128, 10, 20, 30, 0};
    const float colours[] = {1, 0.5f, 0.25f, 255 / 256.f, 0, 1 / 256.f, 0, 0, 0};
    make_hdr(&file, HDR("-Y 1 +X 3"), pixels, sizeof pixels);
    expect_pixels(ctx, file.data, file.count, 3, 1, 3, false, colours);
    static const unsigned char repeated[] = {128, 64, 32, 129, 1, 1, 1, 1};
    const float same[] = {1, 0.5f, 0.25f, 1, 0.5f, 0.25f};
    make_hdr(&file, "#?RGBE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n", repeated, sizeof repeated);
    expect_pixels(ctx, file.data, file.count, 2, 1, 3, false, same);
}

static void pictures_in_runs(void **state) {
    UNUSED(state);
    // Eight pixels: red is a run of 8, green two runs, blue copies bytes, the exponent is a run.
    static const unsigned char row[] = {2,   2, 0, 8, 136, 128, 132, 64, 132, 32, 8, 0, 1, 2, 3, 4, 5, 6, 7, 136, 129};
    float colours[2 * 8 * 3];
    for (int i = 0; i < 16; i++) {
        colours[3 * i] = 1;
        colours[3 * i + 1] = i % 8 < 4 ? 0.5f : 0.25f;
        colours[3 * i + 2] = (float)(i % 8) / 128;
    }
    make_hdr(&file, HDR("-Y 2 +X 8"), row, sizeof row);
    put(&file, row, sizeof row);
    expect_pixels(ctx, file.data, file.count, 8, 2, 3, false, colours);
    for (size_t count = 12; count < file.count; count++) {
        expect_failure(ctx, "test.picture", file.data, count, "test.picture");
    }
    unsigned char wrong[sizeof row];
    memcpy(wrong, row, sizeof row);
    wrong[4] = 137; // a run of 9
    make_hdr(&file, HDR("-Y 1 +X 8"), wrong, sizeof wrong);
    expect_failure(ctx, "test.picture", file.data, file.count, "byte 72: a run of bytes does not fit");
    wrong[4] = 0; // a run of nothing
    make_hdr(&file, HDR("-Y 1 +X 8"), wrong, sizeof wrong);
    expect_failure(ctx, "test.picture", file.data, file.count, "a run of bytes does not fit");
    make_hdr(&file, HDR("-Y 1 +X 9"), row, sizeof row);
    expect_failure(ctx, "test.picture", file.data, file.count, "width is not the picture's");
}

static void broken_radiance(void **state) {
    UNUSED(state);
    static const unsigned char first[] = {1, 1, 1, 1}, long_run[] = {5, 5, 5, 5, 1, 1, 1, 9};
    make_hdr(&file, HDR("-Y 1 +X 1"), first, sizeof first);
    expect_failure(ctx, "test.picture", file.data, file.count, "a run of pixels does not fit");
    make_hdr(&file, HDR("-Y 1 +X 2"), long_run, sizeof long_run);
    expect_failure(ctx, "test.picture", file.data, file.count, "a run of pixels does not fit");
    make_hdr(&file, HDR("+Y 1 +X 1"), first, sizeof first);
    expect_failure(ctx, "test.picture", file.data, file.count, "'-Y HEIGHT +X WIDTH'");
    make_hdr(&file, HDR("-Y 60000 +X 60000"), first, sizeof first);
    expect_failure(ctx, "test.picture", file.data, file.count, "claims 60000 x 60000 pixels");
    make_hdr(&file, "#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n-Y 1 +X 1\n", first, sizeof first);
    expect_failure(ctx, "test.picture", file.data, file.count, "32-bit_rle_xyze");
    make_hdr(&file, "#?RADIANCE\nFORMAT=\033[31mred\n\n-Y 1 +X 1\n", first, sizeof first);
    expect_failure(ctx, "test.picture", file.data, file.count, "'?[31mred'"); // terminals take the first character as an order
    make_hdr(&file, HDR("-Y 0 +X 1"), first, sizeof first);
    expect_failure(ctx, "test.picture", file.data, file.count, "0");
}

// Three channels 1, 2, 3 under names in this order are read as so many, with `first` in the first.
static void expect_channels(const char *const names[3], int component, int channels, float first) {
    static const char path[] = "test_io_names.exr";
    float data[2 * 5 * 3];
    rey_image image;
    for (int i = 0; i < COUNT_OF(data); i++) {
        data[i] = (float)(i % 3 + 1);
    }
    assert_int_equal(rey_exr_write_as(ctx, path, data, 5, 2, 3, names, component), REY_OK);
    assert_int_equal(rey_image_read(ctx, path, &image), REY_OK);
    assert_int_equal(image.channels, channels);
    for (int i = 0; i < 2 * 5; i++) {
        assert_float_equal(image.data[i * channels], first, 0);
    }
    rey_image_free(ctx, &image);
    remove(path);
}

// Channels that nobody asks for, before the one that is, or in a fast routine of the library's; and other names of colours.
static void names_of_channels(void **state) {
    UNUSED(state);
    static const int components[] = {REY_COMPONENT_FLOAT16, REY_COMPONENT_FLOAT32};
    for (int i = 0; i < COUNT_OF(components); i++) {
        expect_channels((const char *const[]){"A", "Y", "Z"}, components[i], 1, 2);
        expect_channels((const char *const[]){"Y", "u", "v"}, components[i], 1, 1);
        expect_channels((const char *const[]){"b", "g", "r"}, components[i], 3, 3);
        expect_channels((const char *const[]){"d.b", "d.g", "d.r"}, components[i], 3, 3);
        expect_channels((const char *const[]){"blue", "green", "red"}, components[i], 3, 3);
    }
}

// Grey would be read of what has colours, and the first of two channels may be anything.
static void channels_that_are_no_colours(void **state) {
    UNUSED(state);
    static const char path[] = "test_io_chroma.exr", *const chroma[] = {"Y", "RY", "BY"}, *const two[] = {"G", "R"};
    const float data[2 * 3] = {1, 2, 3, 4, 5, 6};
    rey_image image;
    assert_int_equal(rey_exr_write(ctx, path, data, 2, 1, 3, chroma), REY_OK);
    assert_int_equal(rey_image_read(ctx, path, &image), REY_ERROR_UNSUPPORTED);
    assert_non_null(strstr(rey_error(ctx), "test_io_chroma.exr: luminance and chroma (Y, RY, BY) are not read"));
    assert_int_equal(rey_exr_write(ctx, path, data, 3, 1, 2, two), REY_OK);
    assert_int_equal(rey_image_read(ctx, path, &image), REY_OK);
    assert_int_equal(rey_image_to_rgb(ctx, path, &image), REY_ERROR_UNSUPPORTED);
    assert_non_null(strstr(rey_error(ctx), "test_io_chroma.exr: two channels are no colour"));
    rey_image_free(ctx, &image);
    remove(path);
}

static void scales_and_records(void **state) {
    UNUSED(state);
    static const char header[] = "{'descr': [('a', '<f4'), ('b', '<f4')], 'fortran_order': False, 'shape': (1, 2), }";
    const float stored[] = {1, -3, 0.5f, 4}, expected[] = {2.5f, -7.5f, 1.25f, 10};
    file.count = 0;
    put(&file, "Pf\n4 1\n-2.5\n", 12);
    put(&file, stored, sizeof stored);
    expect_pixels(ctx, file.data, file.count, 4, 1, 1, false, expected);
    file.count = 0;
    put(&file, "\x93NUMPY\x01", 8);
    put_number(&file, sizeof header - 1, 2);
    put(&file, header, sizeof header - 1);
    put(&file, stored, sizeof stored);
    expect_failure(ctx, "test.picture", file.data, file.count, "C-ordered");
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(bitmaps_of_24_and_32_bits), cmocka_unit_test(bitmaps_of_16_bits_and_palettes),
        cmocka_unit_test(broken_bitmaps),            cmocka_unit_test(flat_pictures),
        cmocka_unit_test(pictures_in_runs),          cmocka_unit_test(broken_radiance),
        cmocka_unit_test(names_of_channels),         cmocka_unit_test(scales_and_records),
        cmocka_unit_test(channels_that_are_no_colours),
    };
    return cmocka_run_group_tests(tests, open_context, close_context);
}
