// test_io_image.c: pictures written and read again, files of every sample type, and broken files refused by name.
#include "io/file.h"
#include "io_picture.h"

#include <math.h>
#include <stdio.h>
#include <unistd.h>

#include <jpeglib.h>
#include <png.h>
#include <zlib.h>

enum { W = 5, H = 3, LARGEST_FILE = 1 << 16 };

typedef struct Bytes {
    unsigned char data[LARGEST_FILE];
    size_t count;
} Bytes;

static void put(Bytes *b, const void *data, size_t count) {
    assert_true(b->count + count <= LARGEST_FILE);
    memcpy(b->data + b->count, data, count);
    b->count += count;
}

static rey_context *context(void) {
    rey_context *ctx = NULL;
    assert_int_equal(rey_context_create(NULL, &ctx), REY_OK);
    return ctx;
}

static void expect_read(rey_context *ctx, const Bytes *b, int channels, rey_image *out) {
    if (read_copy(ctx, "good", b->data, b->count, out) != REY_OK) {
        fail_msg("%s", rey_error(ctx));
    }
    assert_int_equal(out->width, W);
    assert_int_equal(out->height, H);
    assert_int_equal(out->channels, channels);
}

/* ---- files of every sort, made here ------------------------------------------------------------------------ */

enum { EXR_UINT, EXR_HALF, EXR_FLOAT };

static void put_attribute(Bytes *b, const char *name, const char *type, const void *data, int size) {
    put(b, name, strlen(name) + 1);
    put(b, type, strlen(type) + 1);
    put(b, &size, 4);
    put(b, data, (size_t)size);
}

// Uncompressed scanlines of channels in the order of their names [openexr file layout]. Sample i of channel c is
// i + 100 c, which all types hold exactly.
static void make_exr(Bytes *b, const char *const *names, const int *types, int channels, int width, int height) {
    static const uint16_t halves[] = {0x0000, 0x3c00, 0x4000, 0x4200, 0x4400, 0x4500, 0x4600, 0x4700,
                                      0x4800, 0x4880, 0x4900, 0x4980, 0x4a00, 0x4a80, 0x4b00};
    Bytes list = {.count = 0};
    int window[4] = {0, 0, width - 1, height - 1};
    float one = 1, centre[2] = {0, 0};
    b->count = 0;
    put(b, "\x76\x2f\x31\x01\x02\0\0\0", 8);
    for (int c = 0; c < channels; c++) {
        int rest[4] = {types[c], 0, 1, 1};
        put(&list, names[c], strlen(names[c]) + 1);
        put(&list, rest, sizeof rest);
    }
    put(&list, "", 1);
    put_attribute(b, "channels", "chlist", list.data, (int)list.count);
    put_attribute(b, "compression", "compression", "\0", 1);
    put_attribute(b, "dataWindow", "box2i", window, 16);
    put_attribute(b, "displayWindow", "box2i", window, 16);
    put_attribute(b, "lineOrder", "lineOrder", "\0", 1);
    put_attribute(b, "pixelAspectRatio", "float", &one, 4);
    put_attribute(b, "screenWindowCenter", "v2f", centre, 8);
    put_attribute(b, "screenWindowWidth", "float", &one, 4);
    put(b, "", 1);
    int row = 0;
    for (int c = 0; c < channels; c++) {
        row += W * (types[c] == EXR_HALF ? 2 : 4);
    }
    for (int y = 0; y < H; y++) {
        uint64_t at = b->count + (uint64_t)(8 * (H - y)) + (uint64_t)(y * (8 + row));
        put(b, &at, 8);
    }
    for (int y = 0; y < H; y++) {
        put(b, &y, 4);
        put(b, &row, 4);
        for (int i = 0; i < W * channels; i++) {
            int c = i / W, value = y * W + i % W + (types[c] == EXR_HALF ? 0 : 100 * c);
            float real = (float)value;
            put(b, types[c] == EXR_HALF ? (const void *)&halves[value] : types[c] == EXR_UINT ? (const void *)&value
                                                                                              : (const void *)&real,
                types[c] == EXR_HALF ? 2 : 4);
        }
    }
}

static void png_out(png_structp png, png_bytep data, png_size_t count) { put(png_get_io_ptr(png), data, count); }
static void png_flush_nothing(png_structp png) { UNUSED(png); }

// Sample s of the file (alpha included) is 3 s + 1, or 1000 s + 7 with 16 bits; linear: says gamma 1.
static void make_png(Bytes *b, int type, int channels, int bits, bool linear) {
    png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, NULL, NULL, NULL);
    png_infop info = png_create_info_struct(png);
    assert_non_null(info);
    b->count = 0;
    png_set_write_fn(png, b, png_out, png_flush_nothing);
    png_set_IHDR(png, info, W, H, bits, type, PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    if (linear) {
        png_set_gAMA(png, info, 1.0);
    }
    png_write_info(png, info);
    for (int y = 0; y < H; y++) {
        unsigned char row[W * 4 * 2];
        for (int i = 0; i < W * channels; i++) {
            int s = y * W * channels + i, value = 1000 * s + 7;
            if (bits == 8) {
                row[i] = (unsigned char)(3 * s + 1);
            } else {
                row[2 * i] = (unsigned char)(value >> 8);
                row[2 * i + 1] = (unsigned char)(value & 255);
            }
        }
        png_write_row(png, row);
    }
    png_write_end(png, NULL);
    png_destroy_write_struct(&png, &info);
}

static void make_jpeg(Bytes *b, int channels) {
    struct jpeg_compress_struct jpeg;
    struct jpeg_error_mgr errors;
    unsigned char *memory = NULL, row[W * 4];
    unsigned long size = 0;
    jpeg.err = jpeg_std_error(&errors);
    jpeg_create_compress(&jpeg);
    jpeg_mem_dest(&jpeg, &memory, &size);
    jpeg.image_width = W;
    jpeg.image_height = H;
    jpeg.input_components = channels;
    jpeg.in_color_space = channels == 4 ? JCS_CMYK : channels == 3 ? JCS_RGB : JCS_GRAYSCALE;
    jpeg_set_defaults(&jpeg);
    jpeg_set_quality(&jpeg, 100, TRUE);
    jpeg_start_compress(&jpeg, TRUE);
    for (int i = 0; i < W * channels; i++) {
        row[i] = (unsigned char)(channels == 1 ? 120 : 60 + 60 * (i % 3));
    }
    for (int y = 0; y < H; y++) {
        JSAMPROW rows[1] = {row};
        jpeg_write_scanlines(&jpeg, rows, 1);
    }
    jpeg_finish_compress(&jpeg);
    jpeg_destroy_compress(&jpeg);
    b->count = 0;
    put(b, memory, size);
    free(memory);
}

static void make_pfm(Bytes *b, bool colour) {
    b->count = 0;
    put(b, colour ? "PF\n5 3\n-1\n" : "Pf\n5 3\n-1\n", 10);
    for (int i = 0; i < W * H * (colour ? 3 : 1); i++) {
        float value = (float)i;
        put(b, &value, 4);
    }
}

static void make_npy(Bytes *b, const char *header, int item) {
    unsigned char head[10] = {0x93, 'N', 'U', 'M', 'P', 'Y', 1, 0, (unsigned char)strlen(header), 0};
    b->count = 0;
    put(b, head, 10);
    put(b, header, strlen(header));
    for (int i = 0; i < W * H * 2; i++) {
        float narrow = (float)i;
        double wide = i;
        put(b, item == 4 ? (const void *)&narrow : (const void *)&wide, (size_t)item);
    }
}

/* ---- what must be read ----------------------------------------------------------------------------------------- */
static Bytes file; // large: not on the stack

static void test_exr_types(void **state) {
    UNUSED(state);
    static const char *const names[] = {"A", "B", "G", "R"}, *const others[] = {"depth", "id"};
    static const char *const layered[] = {"left.B", "left.G", "left.R", "right.Z"}, *const grey[] = {"A", "Y"};
    rey_context *ctx = context();
    for (int type = EXR_UINT; type <= EXR_FLOAT; type++) {
        int types[] = {EXR_HALF, type, type, type};
        rey_image image;
        make_exr(&file, names, types, 4, W, H);
        expect_read(ctx, &file, 3, &image); // R G B, whatever their order in the file; alpha is dropped
        for (int i = 0; i < W * H * 3; i++) {
            int channel = 3 - i % 3;
            assert_float_equal(image.data[i], (i / 3 + (type == EXR_HALF ? 0 : 100 * channel)), 0);
        }
        assert_false(image.srgb);
        rey_image_free(ctx, &image);
        make_exr(&file, layered, types, 4, W, H);
        expect_read(ctx, &file, 3, &image);
        rey_image_free(ctx, &image);
        make_exr(&file, grey, types, 2, W, H);
        expect_read(ctx, &file, 1, &image);
        assert_float_equal(image.data[7], 7 + (type == EXR_HALF ? 0 : 100), 0);
        rey_image_free(ctx, &image);
        make_exr(&file, others, types, 2, W, H);
        expect_read(ctx, &file, 2, &image);
        rey_image_free(ctx, &image);
    }
    rey_context_destroy(ctx);
}

static void test_png_types(void **state) {
    UNUSED(state);
    static const struct {
        int type, channels, colours;
    } kinds[] = {{PNG_COLOR_TYPE_GRAY, 1, 1}, {PNG_COLOR_TYPE_GRAY_ALPHA, 2, 1}, {PNG_COLOR_TYPE_RGB, 3, 3},
                 {PNG_COLOR_TYPE_RGB_ALPHA, 4, 3}};
    rey_context *ctx = context();
    for (int k = 0; k < COUNT_OF(kinds) * 4; k++) {
        int channels = kinds[k / 4].channels, colours = kinds[k / 4].colours, bits = k & 1 ? 16 : 8;
        rey_image image;
        make_png(&file, kinds[k / 4].type, channels, bits, k & 2);
        expect_read(ctx, &file, colours, &image);
        assert_int_equal(image.srgb, !(k & 2));
        for (int i = 0; i < W * H * colours; i++) { // the file's own numbers: no gamma, alpha not blended
            int s = i / colours * channels + i % colours;
            double expected = bits == 8 ? (3 * s + 1) % 256 / 255.0 : (1000 * s + 7) % 65536 / 65535.0;
            assert_float_equal(image.data[i], expected, 1e-6);
        }
        rey_image_free(ctx, &image);
    }
    rey_context_destroy(ctx);
}

static void test_jpeg_types(void **state) {
    UNUSED(state);
    rey_context *ctx = context();
    rey_image image;
    for (int channels = 1; channels <= 3; channels += 2) {
        make_jpeg(&file, channels);
        expect_read(ctx, &file, channels, &image);
        assert_true(image.srgb);
        for (int i = 0; i < W * H * channels; i++) {
            assert_float_equal(image.data[i], (channels == 1 ? 120 : 60 + 60 * (i % 3)) / 255.0, 0.012);
        }
        rey_image_free(ctx, &image);
    }
    make_jpeg(&file, 4);
    expect_failure(ctx, "printed.picture", file.data, file.count, "CMYK");
    rey_context_destroy(ctx);
}

static void test_raw_types(void **state) {
    UNUSED(state);
    rey_context *ctx = context();
    rey_image image;
    for (int colour = 0; colour < 2; colour++) {
        make_pfm(&file, colour);
        expect_read(ctx, &file, colour ? 3 : 1, &image);
        assert_float_equal(image.data[0], (H - 1) * W * image.channels, 0); // rows from the bottom
        rey_image_free(ctx, &image);
    }
    for (int item = 4; item <= 8; item += 4) {
        make_npy(&file, item == 4 ? "{'descr': '<f4', 'fortran_order': False, 'shape': (3, 5, 2), }"
                                  : "{'descr': '<f8', 'fortran_order': False, 'shape': (3, 5, 2), }", item);
        expect_read(ctx, &file, 2, &image);
        for (int i = 0; i < W * H * 2; i++) {
            assert_float_equal(image.data[i], i, 0);
        }
        rey_image_free(ctx, &image);
    }
    rey_context_destroy(ctx);
}

static void test_round_trips(void **state) {
    UNUSED(state);
    static const char *const names[] = {"a_view_with_a_name_of_many_characters.R", "a_view_with_a_name_of_many_characters.G",
                                        "a_view_with_a_name_of_many_characters.B"};
    static const char *const twice[] = {"view.R", "view.R", "view.B"};
    char path[64];
    float data[W * H * 3];
    rey_image image;
    rey_context *ctx = context();
    for (int i = 0; i < COUNT_OF(data); i++) {
        data[i] = (float)(i * 37 % 45) / 44;
    }
    data[4] = 1e-30f;
    data[5] = -7;
    data[6] = 1e30f;
    for (int k = 0; k < 5; k++) {
        static const char *const endings[] = {"exr", "exr", "exr", "npy", "png"};
        int channels = k == 1 ? 1 : 3;
        snprintf(path, sizeof path, "/tmp/reynolds_image_%ld.%s", (long)getpid(), endings[k]);
        rey_result result = k < 3    ? rey_exr_write(ctx, path, data, W, H, channels, k == 2 ? names : NULL)
                            : k == 3 ? rey_npy_write(ctx, path, data, (int64_t[]){H, W, 3}, 3)
                                     : rey_png_write(ctx, path, data, W, H);
        assert_int_equal(result, REY_OK);
        assert_int_equal(rey_image_read(ctx, path, &image), REY_OK);
        assert_int_equal(image.channels, channels);
        assert_int_equal(image.width, W);
        for (int i = 0; i < W * H * channels; i++) {
            if (k < 4) {
                assert_memory_equal(image.data + i, data + i, sizeof *data);
            } else {
                float clamped = fminf(fmaxf(data[i], 0), 1);
                assert_float_equal(image.data[i], rey_srgb_encode(clamped), 0.51 / 255);
            }
        }
        rey_image_free(ctx, &image);
        unlink(path);
    }
    assert_int_equal(rey_exr_write(ctx, "twice.exr", data, W, H, 3, twice), REY_ERROR_FORMAT); // and does not wait for itself
    assert_non_null(strstr(rey_error(ctx), "twice.exr: cannot be written: "));
    assert_int_not_equal(access("twice.exr", F_OK), 0);
    rey_context_destroy(ctx);
}

// Rows of noise that compresses a little: some of their streams are exactly as long as the raw rows, which readers would
// take for raw data if they were written.
static void test_exr_barely_compressible(void **state) {
    UNUSED(state);
    enum { WIDEST = 24 };
    static const char path[] = "test_io_image_noise.exr";
    rey_context *ctx = context();
    float data[WIDEST * 3];
    uint32_t random = 1;
    for (int round = 0; round < 250; round++) {
        int width = 1 + round % WIDEST, noisy = round / WIDEST * 3;
        for (int i = 0; i < width * 3; i++) {
            random = random * 1664525u + 1013904223u;
            data[i] = (int)(random >> 16) % 30 < noisy ? (float)(random >> 8) / 16777216.0f : 0.5f;
        }
        rey_image image;
        assert_int_equal(rey_exr_write(ctx, path, data, width, 1, 3, NULL), REY_OK);
        if (rey_image_read(ctx, path, &image) != REY_OK) {
            fail_msg("round %d: %s", round, rey_error(ctx));
        }
        assert_memory_equal(image.data, data, (size_t)width * 3 * sizeof *data);
        rey_image_free(ctx, &image);
    }
    unlink(path);
    rey_context_destroy(ctx);
}

/* ---- what must be refused ------------------------------------------------------------------------------------- */

static void make_sort(int sort) {
    static const char *const rgb[] = {"B", "G", "R"};
    static const int types[] = {EXR_FLOAT, EXR_FLOAT, EXR_FLOAT};
    switch (sort) {
    case 0: make_exr(&file, rgb, types, 3, W, H); break;
    case 1: make_png(&file, PNG_COLOR_TYPE_RGB, 3, 8, false); break;
    case 2: make_jpeg(&file, 3); break;
    case 3: make_pfm(&file, true); break;
    default: make_npy(&file, "{'descr': '<f4', 'fortran_order': False, 'shape': (3, 5, 2), }", 4); break;
    }
}

static void test_truncated(void **state) {
    UNUSED(state);
    rey_context *ctx = context();
    for (int sort = 0; sort < 5; sort++) {
        make_sort(sort);
        size_t needed = sort == 2 ? file.count - 2 : file.count; // all but the end mark of a JPEG
        for (size_t count = 0; count < needed; count++) {
            char words[64] = ""; // with its first bytes it is an EXR file
            if (sort == 0 && count >= 16) {
                snprintf(words, sizeof words, "cut off after %zu bytes: ", count);
            }
            expect_failure(ctx, "short.picture", file.data, count, words);
        }
    }
    rey_context_destroy(ctx);
}

// What is wrong in the middle of a whole file was not cut off.
static void test_damaged(void **state) {
    UNUSED(state);
    rey_context *ctx = context();
    make_sort(0);
    memset(file.data + file.count - 2 * (8 + 12 * W), 0xff, 8); // number and size of the line before the last
    expect_failure(ctx, "whole.picture", file.data, file.count, ": damaged: ");
    rey_context_destroy(ctx);
}

static void test_wrong_magic(void **state) {
    UNUSED(state);
    rey_context *ctx = context();
    for (int sort = 0; sort < 5; sort++) {
        make_sort(sort);
        file.data[0] ^= 0x55;
        expect_failure(ctx, "strange.picture", file.data, file.count, "expected OpenEXR, PNG, JPEG, BMP, TGA, ");
    }
    rey_image image;
    assert_int_not_equal(rey_image_read(ctx, "/nowhere/at_all.exr", &image), REY_OK);
    assert_non_null(strstr(rey_error(ctx), "/nowhere/at_all.exr"));
    rey_context_destroy(ctx);
}

static void put_big_endian(unsigned char *at, uint32_t value, int bytes) {
    for (int i = 0; i < bytes; i++) {
        at[i] = (unsigned char)(value >> 8 * (bytes - 1 - i));
    }
}

static void test_huge_counts(void **state) {
    UNUSED(state);
    static const char *const rgb[] = {"B", "G", "R"};
    static const int types[] = {EXR_FLOAT, EXR_FLOAT, EXR_FLOAT};
    rey_context *ctx = context();
    make_exr(&file, rgb, types, 3, 30000, 30000);
    expect_failure(ctx, "huge.exr", file.data, file.count, "");
    make_exr(&file, rgb, types, 3, INT32_MAX, 2);
    expect_failure(ctx, "huge.exr", file.data, file.count, "");
    make_sort(1);
    put_big_endian(file.data + 16, 30000, 4);
    put_big_endian(file.data + 20, 30000, 4);
    uint32_t sum = (uint32_t)crc32(0, file.data + 12, 17);
    put_big_endian(file.data + 29, sum, 4);
    expect_failure(ctx, "huge.png", file.data, file.count, "claims 30000 x 30000 pixels");
    make_sort(2);
    for (size_t i = 2; i + 9 < file.count; i++) {
        if (file.data[i] == 0xff && file.data[i + 1] == 0xc0) {
            put_big_endian(file.data + i + 5, 30000, 2);
            put_big_endian(file.data + i + 7, 30000, 2);
            break;
        }
    }
    expect_failure(ctx, "huge.jpg", file.data, file.count, "claims 30000 x 30000 pixels");
    file.count = 0;
    put(&file, "PF 60000 60000 -1\n1234", 22);
    expect_failure(ctx, "huge.pfm", file.data, file.count, "ends before its 60000 x 60000 pixels");
    make_npy(&file, "{'descr': '<f4', 'fortran_order': False, 'shape': (60000, 60000), }", 4);
    expect_failure(ctx, "huge.npy", file.data, file.count, "ends before its array");
    make_npy(&file, "{'descr': '<f4', 'fortran_order': False, 'shape': (9223372036854775807, 3), }", 4);
    expect_failure(ctx, "huge.npy", file.data, file.count, "ends before its array");
    make_npy(&file, "{'descr': '<f4', 'fortran_order': True, 'shape': (3, 5), }", 4);
    expect_failure(ctx, "turned.npy", file.data, file.count, "C-ordered");
    rey_context_destroy(ctx);
}

// 8-bit values go by a table, others by the curve: the same bits.
static void test_srgb_table(void **state) {
    enum { BYTES = 256, WORDS = 65536, COUNT = BYTES + WORDS + 2 };
    UNUSED(state);
    rey_context *ctx = context();
    rey_image image;
    assert_int_equal(rey_image_new(ctx, "picture", COUNT, 1, 1, &image), REY_ERROR_FORMAT);
    assert_int_equal(rey_image_new(ctx, "picture", COUNT / 2, 2, 1, &image), REY_OK);
    for (int i = 0; i < COUNT; i++) {
        image.data[i] = i < BYTES           ? (float)i / 255.0f
                        : i < BYTES + WORDS ? (float)(i - BYTES) / 65535.0f
                                            : 3.0f * (float)(i - COUNT + 1);
    }
    float *encoded = malloc(COUNT * sizeof *encoded);
    assert_non_null(encoded);
    memcpy(encoded, image.data, COUNT * sizeof *encoded);
    rey_image_decode_srgb(&image);
    for (int i = 0; i < COUNT; i++) {
        float wanted = rey_srgb_decode(encoded[i]);
        assert_memory_equal(&image.data[i], &wanted, sizeof wanted);
    }
    free(encoded);
    rey_image_free(ctx, &image);
    rey_context_destroy(ctx);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_exr_types),   cmocka_unit_test(test_png_types), cmocka_unit_test(test_jpeg_types),
        cmocka_unit_test(test_raw_types),   cmocka_unit_test(test_round_trips), cmocka_unit_test(test_truncated),
        cmocka_unit_test(test_damaged),
        cmocka_unit_test(test_wrong_magic), cmocka_unit_test(test_huge_counts),
        cmocka_unit_test(test_exr_barely_compressible), cmocka_unit_test(test_srgb_table)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
