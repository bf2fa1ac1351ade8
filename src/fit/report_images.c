// report_images.c: pictures of a report, tone-mapped and embedded as PNG.
#include "fit/report_parts.h"
#include "io/image.h"

#include <math.h>
#include <stdlib.h>

enum { THUMBNAIL = 160, COARSE = 100 }; // pictures narrower than COARSE show their pixels

static int compare_floats(const void *a, const void *b) {
    float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

// The given quantile of an array, which is sorted by it.
static float quantile(float *values, int64_t count, double share) {
    qsort(values, (size_t)count, sizeof *values, compare_floats);
    return values[(int64_t)(share * (double)(count - 1))];
}

float rey_report_exposure(rey_context *ctx, const float *rgb, int64_t pixels) {
    float *brightest = rey_alloc_array(ctx, (size_t)pixels, sizeof *brightest);
    if (!brightest) {
        return 1; // only a picture's look depends on it
    }
    for (int64_t i = 0; i < pixels; i++) {
        float most = fmaxf(rgb[3 * i], fmaxf(rgb[3 * i + 1], rgb[3 * i + 2]));
        brightest[i] = isfinite(most) ? most : 0;
    }
    float white = quantile(brightest, pixels, 0.99);
    rey_free(ctx, brightest);
    return white > 0 && (white < 0.3f || white > 1.2f) ? 0.95f / white : 1;
}

void rey_report_png(Text *html, const char *name, const unsigned char *png, size_t size, int width, int height,
                    bool tone) {
    rey_text_add(html, "<img alt=\"");
    rey_text_html(html, name);
    rey_text_add(html, "\" class=\"%s%s\" width=\"%d\" height=\"%d\" src=\"data:image/png;base64,", tone ? "tone" : "",
                 width < COARSE ? " coarse" : "", width, height);
    rey_text_base64(html, png, size);
    rey_text_add(html, "\">");
}

static rey_result encode(rey_context *ctx, const float *rgb, int width, int height, float exposure,
                         unsigned char **png, size_t *size) {
    int64_t pixels = (int64_t)width * height;
    float *scaled = rey_alloc_array(ctx, (size_t)pixels * 3, sizeof *scaled);
    unsigned char *rgb8 = rey_alloc_array(ctx, (size_t)pixels, 3);
    rey_result result = scaled && rgb8 ? REY_OK : REY_ERROR_MEMORY;
    *png = NULL;
    for (int64_t i = 0; i < 3 * pixels && !result; i++) {
        scaled[i] = exposure * rgb[i];
    }
    if (!result) {
        rey_image_to_srgb8(scaled, pixels, rgb8);
        result = rey_png_encode(ctx, rgb8, width, height, png, size);
    }
    rey_free(ctx, scaled);
    rey_free(ctx, rgb8);
    return result;
}

rey_result rey_report_figure(Text *html, const char *name, const float *rgb, int width, int height, float exposure,
                             const char *caption) {
    unsigned char *png;
    size_t size = 0;
    rey_result result = encode(html->ctx, rgb, width, height, exposure, &png, &size);
    if (!result) {
        rey_text_add(html, "<figure>");
        rey_report_png(html, name, png, size, width, height, true);
        rey_text_add(html, "<figcaption>%s</figcaption></figure>\n", caption);
    }
    rey_free(html->ctx, png);
    return result;
}

rey_result rey_report_thumbnail(rey_context *ctx, const float *rgb, int width, int height, float exposure,
                                unsigned char **png, size_t *size, int *small_width, int *small_height) {
    int largest = width > height ? width : height, step = (largest + THUMBNAIL - 1) / THUMBNAIL;
    int w = (width + step - 1) / step, h = (height + step - 1) / step;
    float *small = rey_alloc_array(ctx, (size_t)w * (size_t)h, 3 * sizeof *small);
    rey_result result = small ? REY_OK : REY_ERROR_MEMORY;
    for (int64_t i = 0; i < (int64_t)w * h && !result; i++) { // means of step x step pixels
        int x0 = (int)(i % w) * step, y0 = (int)(i / w) * step, count = 0;
        for (int y = y0; y < y0 + step && y < height; y++) {
            for (int x = x0; x < x0 + step && x < width; x++, count++) {
                for (int k = 0; k < 3; k++) {
                    small[3 * i + k] += rgb[3 * ((int64_t)y * width + x) + k];
                }
            }
        }
        for (int k = 0; k < 3; k++) {
            small[3 * i + k] /= (float)count;
        }
    }
    *png = NULL;
    if (!result) {
        result = encode(ctx, small, w, h, exposure, png, size);
    }
    *small_width = w;
    *small_height = h;
    rey_free(ctx, small);
    return result;
}

// Blue, white, red for t in -1 to 1.
static void diverging(float t, unsigned char rgb8[3]) {
    const float full[3] = {t > 0 ? 178 : 33, t > 0 ? 24 : 102, t > 0 ? 43 : 172};
    for (int k = 0; k < 3; k++) {
        rgb8[k] = (unsigned char)(full[k] + (247 - full[k]) * (1 - fabsf(t)) + 0.5f);
    }
}

static rey_result put_difference(Text *html, const char *caption, const unsigned char *rgb8, int width, int height,
                                 double scale) {
    unsigned char *png = NULL;
    size_t size = 0;
    rey_result result = rey_png_encode(html->ctx, rgb8, width, height, &png, &size);
    if (!result) {
        rey_text_add(html, "<figure>");
        rey_report_png(html, "difference", png, size, width, height, false);
        rey_text_add(html,
                     "<div class=\"bar\"></div><div class=\"ends\"><span>&minus;%.2g</span><span>0</span>"
                     "<span>+%.2g</span></div><figcaption>%s</figcaption></figure>\n",
                     scale, scale, caption);
    }
    rey_free(html->ctx, png);
    return result;
}

rey_result rey_report_difference(Text *html, const char *caption, const float *a, const float *b, const float *mask,
                                 int width, int height) {
    int64_t pixels = (int64_t)width * height;
    float *mean = rey_alloc_array(html->ctx, (size_t)pixels * 2, sizeof *mean), *sorted;
    unsigned char *rgb8 = rey_alloc_array(html->ctx, (size_t)pixels, 3);
    rey_result result = mean && rgb8 ? REY_OK : REY_ERROR_MEMORY;
    if (!result) {
        sorted = mean + pixels;
        for (int64_t i = 0; i < pixels; i++) {
            for (int k = 0; k < 3 && (!mask || mask[i] > 0); k++) {
                mean[i] += (a[3 * i + k] - b[3 * i + k]) / 3;
            }
            sorted[i] = fabsf(mean[i]);
        }
        float scale = fmaxf(quantile(sorted, pixels, 0.995), 1e-9f);
        for (int64_t i = 0; i < pixels; i++) {
            diverging(fminf(fmaxf(mean[i] / scale, -1), 1), rgb8 + 3 * i);
        }
        result = put_difference(html, caption, rgb8, width, height, (double)scale);
    }
    rey_free(html->ctx, mean);
    rey_free(html->ctx, rgb8);
    return result;
}
