// test_io_pnm_tga.c: pictures of Netpbm (PGM, PPM, PFM) and Truevision (TGA): every sort that is read, and broken ones refused.
#include "io_picture.h"

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

// Every file that is shorter is refused.
static void expect_cuts(const unsigned char *bytes, size_t count) {
    for (size_t n = 0; n < count; n++) {
        expect_failure(ctx, "test.picture", bytes, n, "test.picture: ");
    }
}

/* ---- Netpbm ---------------------------------------------------------------------------------------------------- */

static void netpbm_of_bytes_and_words(void **state) {
    UNUSED(state);
    static const unsigned char grey[] = "P5\n# from a scanner\n3 2 200\n\0\144\310\1\2\3";
    const float greys[] = {0, 0.5f, 1, 0.005f, 0.01f, 0.015f};
    expect_pixels(ctx, grey, sizeof grey - 1, 3, 2, 1, true, greys);
    expect_cuts(grey, sizeof grey - 1);
    static const unsigned char colour[] = "P6 2#two columns\n1\r\n255\n\377\0\1\2\3\4";
    const float colours[] = {1, 0, 1 / 255.f, 2 / 255.f, 3 / 255.f, 4 / 255.f};
    expect_pixels(ctx, colour, sizeof colour - 1, 2, 1, 3, true, colours);
    expect_cuts(colour, sizeof colour - 1);
    static const unsigned char lines[] = "P5\r\n1 1\r\n255\r\n\377", commented[] = "P5 1 1 255#all of it\n\377";
    expect_pixels(ctx, lines, sizeof lines - 1, 1, 1, 1, true, (float[]){1});
    expect_pixels(ctx, commented, sizeof commented - 1, 1, 1, 1, true, (float[]){1});
    static const unsigned char wide[] = "P6 1 1 65535 \377\377\1\0\0\2"; // most significant byte first
    const float words[] = {1, 256 / 65535.f, 2 / 65535.f};
    expect_pixels(ctx, wide, sizeof wide - 1, 1, 1, 3, true, words);
    expect_cuts(wide, sizeof wide - 1);
}

static void floats_of_both_orders(void **state) {
    UNUSED(state);
    static const unsigned char little[] = "PF\n1 2\n-1.0\n\0\0\200\77\0\0\0\100\0\0\100\100\0\0\200\100\0\0\240\100\0\0\300\100";
    static const unsigned char big[] = "PF\n1 2\n1.0\n\77\200\0\0\100\0\0\0\100\100\0\0\100\200\0\0\100\240\0\0\100\300\0\0";
    const float pixels[] = {4, 5, 6, 1, 2, 3}; // rows from the bottom
    expect_pixels(ctx, little, sizeof little - 1, 1, 2, 3, false, pixels);
    expect_pixels(ctx, big, sizeof big - 1, 1, 2, 3, false, pixels);
    expect_cuts(little, sizeof little - 1);
    static const unsigned char scaled[] = "Pf\n1 1\n2.5e0\n\100\0\0\0";
    expect_pixels(ctx, scaled, sizeof scaled - 1, 1, 1, 1, false, (float[]){5});
}

static void broken_netpbm(void **state) {
    UNUSED(state);
    static const struct {
        const char *text, *words;
    } cases[] = {{"P5 x 2 255\n1234", "byte 3: expected the width in pixels"},
                 {"P5 2 -2 255\n1234", "byte 5: expected the height in pixels"},
                 {"P5 2 2 65536\n1234", "byte 7: expected the largest value, 1 to 65535"},
                 {"P5 2 2 255x1234", "byte 10: expected a blank between the header and the pixels"},
                 {"P5 2 2 255#1234", "byte 15: expected a blank between the header and the pixels"},
                 {"P5 2 2 255\n123", "byte 14: the file ends before its 2 x 2 pixels"},
                 {"P5 2 2 50\n1233", "byte 12: a value is above the largest that the header names"},
                 {"P6 999999999999999999 999999999999999999 255\n1", "expected 1 to 65536 along an edge"},
                 {"P6 99999999999999999999 1 255\n1", "byte 3: expected the width in pixels"},
                 {"PF 1 1 0\n123412341234", "byte 7: expected the scale"},
                 {"PF 1 1 nan\n123412341234", "byte 7: expected the scale"},
                 {"PF 1 1 -1\n12341234123", "byte 21: the file ends before its 1 x 1 pixels"},
                 {"PF4\n1 1\n-1\n1234123412341234", "byte 2: expected a blank behind"},
                 {"P3 1 1 255\n1 2 3", "expected OpenEXR, PNG, JPEG, BMP, TGA, Radiance HDR, PFM, PGM or PPM (binary), or NPY"}};
    for (int i = 0; i < COUNT_OF(cases); i++) {
        expect_failure(ctx, "test.picture", cases[i].text, strlen(cases[i].text), cases[i].words);
    }
}

/* ---- Truevision ------------------------------------------------------------------------------------------------ */

enum { FROM_RIGHT = 16, FROM_TOP = 32 };

// A header, what is behind it, and the mark of version 2. Returns the number of bytes.
static size_t make_tga(unsigned char *file, int sort, int palette, int palette_bits, int width, int height, int bits, int order,
                       const void *rest, size_t rest_bytes, bool marked) {
    const int numbers[18] = {0, palette > 0, sort, 0, 0, palette, 0, palette_bits, 0, 0, 0, 0, width & 255, width >> 8,
                             height & 255, height >> 8, bits, order};
    unsigned char header[18];
    for (int i = 0; i < COUNT_OF(numbers); i++) {
        header[i] = (unsigned char)numbers[i];
    }
    memcpy(file, header, sizeof header);
    memcpy(file + sizeof header, rest, rest_bytes);
    size_t count = sizeof header + rest_bytes;
    if (marked) {
        memcpy(file + count, "\0\0\0\0\0\0\0\0TRUEVISION-XFILE.", 26);
        count += 26;
    }
    return count;
}

static void truevision_plain(void **state) {
    UNUSED(state);
    unsigned char file[128];
    static const unsigned char pixels[] = {3, 2, 1, 6, 5, 4, 9, 8, 7, 12, 11, 10};
    float top[12], bottom[12], turned[12];
    for (int i = 0; i < 12; i++) {
        top[i] = (float)(i + 1) / 255;
        bottom[(i + 6) % 12] = top[i];
        turned[(1 - i / 3 % 2) * 3 + i % 3 + i / 6 * 6] = top[i];
    }
    size_t count = make_tga(file, 2, 0, 0, 2, 2, 24, FROM_TOP, pixels, sizeof pixels, false);
    expect_pixels(ctx, file, count, 2, 2, 3, true, top);
    expect_cuts(file, count);
    count = make_tga(file, 2, 0, 0, 2, 2, 24, 0, pixels, sizeof pixels, true);
    expect_pixels(ctx, file, count, 2, 2, 3, true, bottom);
    count = make_tga(file, 2, 0, 0, 2, 2, 24, FROM_TOP | FROM_RIGHT, pixels, sizeof pixels, true);
    expect_pixels(ctx, file, count, 2, 2, 3, true, turned);
    const float alpha[] = {1 / 255.f, 2 / 255.f, 3 / 255.f};
    count = make_tga(file, 2, 0, 0, 1, 1, 32, FROM_TOP | 8, (unsigned char[]){3, 2, 1, 77}, 4, false); // alpha is dropped
    expect_pixels(ctx, file, count, 1, 1, 3, true, alpha);
    count = make_tga(file, 2, 0, 0, 2, 1, 16, FROM_TOP, (unsigned char[]){0x1f, 0x7c, 0xe0, 0x03}, 4, false);
    expect_pixels(ctx, file, count, 2, 1, 3, true, (float[]){1, 0, 1, 0, 1, 0});
    count = make_tga(file, 3, 0, 0, 2, 1, 8, FROM_TOP, (unsigned char[]){0, 255}, 2, false);
    expect_pixels(ctx, file, count, 2, 1, 1, true, (float[]){0, 1});
    count = make_tga(file, 3, 0, 0, 2, 1, 16, FROM_TOP | 8, (unsigned char[]){0, 9, 255, 9}, 4, false); // and so with grey
    expect_pixels(ctx, file, count, 2, 1, 1, true, (float[]){0, 1});
    count = make_tga(file, 2, 1, 24, 1, 1, 24, FROM_TOP, (unsigned char[]){7, 7, 7, 3, 2, 1}, 6, false); // its palette is of no use
    expect_pixels(ctx, file, count, 1, 1, 3, true, alpha);
    count = make_tga(file, 1, 2, 24, 2, 1, 16, FROM_TOP, (unsigned char[]){0, 0, 255, 255, 0, 0, 1, 0, 0, 0}, 10, false);
    expect_pixels(ctx, file, count, 2, 1, 3, true, (float[]){0, 0, 1, 1, 0, 0});
    count = make_tga(file, 1, 2, 24, 2, 1, 8, FROM_TOP, (unsigned char[]){0, 0, 255, 255, 0, 0, 1, 0}, 8, false);
    expect_pixels(ctx, file, count, 2, 1, 3, true, (float[]){0, 0, 1, 1, 0, 0});
    expect_cuts(file, count);
}

static void truevision_in_runs(void **state) {
    UNUSED(state);
    unsigned char file[256];
    // Three of one colour over the end of a row, then two of their own; the last row is another run.
    static const unsigned char packets[] = {0x82, 3, 2, 1, 0x00, 6, 5, 4, 0x81, 9, 8, 7};
    const float colours[] = {1, 2, 3, 1, 2, 3, 1, 2, 3, 4, 5, 6, 7, 8, 9, 7, 8, 9};
    float pixels[18];
    for (int i = 0; i < 18; i++) {
        pixels[i] = colours[i] / 255;
    }
    size_t count = make_tga(file, 10, 0, 0, 2, 3, 24, FROM_TOP, packets, sizeof packets, false);
    expect_pixels(ctx, file, count, 2, 3, 3, true, pixels);
    expect_cuts(file, count);
    file[18] = 0x83; // a run of four where two pixels are left
    file[14] = 1;
    expect_failure(ctx, "test.picture", file, count, "the last run goes on behind the last pixel");
    static const unsigned char raw[] = {0x02, 10, 20, 30, 0x80, 40};
    count = make_tga(file, 11, 0, 0, 4, 1, 8, FROM_TOP, raw, sizeof raw, true);
    expect_pixels(ctx, file, count, 4, 1, 1, true, (float[]){10 / 255.f, 20 / 255.f, 30 / 255.f, 40 / 255.f});
    static const unsigned char indices[] = {0, 0, 255, 255, 0, 0, 0x83, 1};
    count = make_tga(file, 9, 2, 24, 2, 2, 8, FROM_TOP, indices, sizeof indices, false);
    expect_pixels(ctx, file, count, 2, 2, 3, true, (float[]){0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1});
}

static void broken_truevision(void **state) {
    UNUSED(state);
    static const struct {
        int sort, palette, width, height, bits;
        const char *rest;
        bool marked;
        const char *words;
    } cases[] = {{2, 0, 2, 2, 24, "12345678901", false, "byte 27: the file ends before its pixels"},
                 {32, 0, 2, 2, 24, "", true, "byte 2: expected a picture with a palette (1), of colours (2) or grey (3)"},
                 {2, 0, 2, 2, 12, "", true,
                  "byte 16: expected 8 or 16 bits for each pixel of grey and palettes, and 15, 16, 24 or 32"},
                 {1, 0, 2, 2, 8, "", true, "byte 2: expected a picture with a palette"},
                 {1, 1, 1, 1, 8, "\1\2\3\7", false, "byte 21: a pixel is beyond the palette"},
                 {1, 200, 1, 1, 8, "\1\2\3\7", false, "the file ends in its header"},
                 {10, 0, 65535, 65535, 24, "\377\1\2\3", false, "claims 65535 x 65535 pixels in 22 bytes"},
                 {2, 0, 0, 4, 24, "", true, "the picture is 0 x 4, expected 1 to 65536 along an edge"}};
    unsigned char file[128];
    for (int i = 0; i < COUNT_OF(cases); i++) {
        size_t count = make_tga(file, cases[i].sort, cases[i].palette, cases[i].palette ? 24 : 0, cases[i].width, cases[i].height,
                                cases[i].bits, 0, cases[i].rest, strlen(cases[i].rest), cases[i].marked);
        expect_failure(ctx, "test.picture", file, count, cases[i].words);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(netpbm_of_bytes_and_words), cmocka_unit_test(floats_of_both_orders), cmocka_unit_test(broken_netpbm),
        cmocka_unit_test(truevision_plain),          cmocka_unit_test(truevision_in_runs),    cmocka_unit_test(broken_truevision)};
    return cmocka_run_group_tests_name("io_pnm_tga", tests, open_context, close_context);
}
