// report_views.c: the pictures of a report, tone-mapped and embedded as PNG.
#include "fit/report_parts.h"
#include "io/image.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { SMALL_PICTURE = 128 }; // pixels across, below which enlarged pixels stay square

static const uint32_t REPORT_SET = 0xfffffff0u; // sample sets that no iteration uses

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

static rey_result embed(Text *html, const char *name, const unsigned char *rgb8, int width, int height) {
    unsigned char *png = NULL;
    size_t size = 0;
    rey_result result = rey_png_encode(html->ctx, rgb8, width, height, &png, &size);
    if (!result) {
        rey_text_add(html, "<img alt=\"");
        rey_text_html(html, name);
        rey_text_add(html, "\" width=\"%d\" height=\"%d\" src=\"data:image/png;base64,", width, height);
        rey_text_base64(html, png, size);
        rey_text_add(html, "\">");
    }
    rey_free(html->ctx, png);
    return result;
}

rey_result rey_report_image(Text *html, const char *name, const float *rgb, int width, int height, float exposure) {
    int64_t pixels = (int64_t)width * height;
    float *scaled = rey_alloc_array(html->ctx, (size_t)pixels * 3, sizeof *scaled);
    unsigned char *rgb8 = rey_alloc_array(html->ctx, (size_t)pixels, 3);
    rey_result result = scaled && rgb8 ? REY_OK : REY_ERROR_MEMORY;
    for (int64_t i = 0; i < 3 * pixels && !result; i++) {
        scaled[i] = exposure * rgb[i];
    }
    if (!result) {
        rey_image_to_srgb8(scaled, pixels, rgb8);
        result = embed(html, name, rgb8, width, height);
    }
    rey_free(html->ctx, scaled);
    rey_free(html->ctx, rgb8);
    return result;
}

// Mean difference over channels: blue where the result is darker than the target, red where it is brighter.
static rey_result difference_image(Text *html, const FitView *view, const float *image, float *scale) {
    int64_t pixels = (int64_t)view->width * view->height;
    float *mean = rey_alloc_array(html->ctx, (size_t)pixels * 2, sizeof *mean), *sorted;
    unsigned char *rgb8 = rey_alloc_array(html->ctx, (size_t)pixels, 3);
    rey_result result = mean && rgb8 ? REY_OK : REY_ERROR_MEMORY;
    if (!result) {
        sorted = mean + pixels;
        for (int64_t i = 0; i < pixels; i++) {
            bool counts = !view->mask || view->mask[i] > 0;
            for (int k = 0; k < 3 && counts; k++) {
                mean[i] += (image[3 * i + k] - view->target[3 * i + k]) / 3;
            }
            sorted[i] = fabsf(mean[i]);
        }
        *scale = fmaxf(quantile(sorted, pixels, 0.995), 1e-9f);
        for (int64_t i = 0; i < pixels; i++) {
            float t = fminf(fmaxf(mean[i] / *scale, -1), 1), fade = 1 - fabsf(t);
            const float full[3] = {t > 0 ? 178 : 33, t > 0 ? 24 : 102, t > 0 ? 43 : 172};
            for (int k = 0; k < 3; k++) {
                rgb8[3 * i + k] = (unsigned char)(full[k] + (247 - full[k]) * fade + 0.5f);
            }
        }
        result = embed(html, "difference", rgb8, view->width, view->height);
    }
    rey_free(html->ctx, mean);
    rey_free(html->ctx, rgb8);
    return result;
}

// Root of sum (I - R)^2 over sum R^2, behind the mask.
static double relative_error(const FitView *view, const float *image) {
    double off = 0, all = 0;
    for (int64_t i = 0; i < (int64_t)view->width * view->height * 3; i++) {
        double weight = view->mask ? (double)view->mask[i / 3] : 1;
        if (weight > 0) {
            double r = (double)view->target[i], d = (double)image[i] - r;
            off += weight * d * d;
            all += weight * r * r;
        }
    }
    return all > 0 ? sqrt(off / all) : 0;
}

static void comparison(Text *html, int view) {
    static const char *const names[] = {"target", "start", "result", "difference"};
    rey_text_add(html,
                 "<div class=\"view\"><div class=\"slide\"><img alt=\"\"><img alt=\"\"><i></i></div>"
                 "<input type=\"range\" min=\"0\" max=\"100\" step=\"0.1\" aria-label=\"view %d: divide\">"
                 "<div class=\"ends\">",
                 view);
    for (int side = 0; side < 2; side++) {
        rey_text_add(html, "<select aria-label=\"%s picture\">", side ? "right" : "left");
        for (int i = 0; i < COUNT_OF(names); i++) {
            rey_text_add(html, "<option%s>%s</option>", i == (side ? 0 : 2) ? " selected" : "", names[i]);
        }
        rey_text_add(html, "</select>");
    }
    rey_text_add(html, "</div><label class=\"stops\">exposure <input type=\"range\" min=\"-4\" max=\"4\" step=\"0.5\" "
                       "value=\"0\"> <output>0</output> stops</label></div>\n");
}

static rey_result view_section(Fit *fit, int index, const float *start, const float *result_image, Text *html) {
    const FitView *view = &fit->views[index];
    float exposure = rey_report_exposure(fit->ctx, view->target, (int64_t)view->width * view->height), scale = 0;
    rey_text_add(html, view->width < SMALL_PICTURE ? "<section class=\"small\">" : "<section>");
    rey_text_add(html, "<h3>View %d <span class=\"note\">sensor %d, %d &times; %d", index, view->sensor,
                 view->width, view->height);
    if (exposure < 1 || exposure > 1) {
        rey_text_add(html, ", shown at exposure &times;%.3g", (double)exposure);
    }
    rey_text_add(html, "</span></h3>\n");
    comparison(html, index);
    rey_text_add(html, "<div class=\"four\"><figure>");
    rey_result result = rey_report_image(html, "target", view->target, view->width, view->height, exposure);
    rey_text_add(html, "<figcaption>target</figcaption></figure><figure>");
    if (!result) {
        result = rey_report_image(html, "start", start, view->width, view->height, exposure);
    }
    rey_text_add(html, "<figcaption>start, relative error %.3g %%</figcaption></figure><figure>",
                 100 * relative_error(view, start));
    if (!result) {
        result = rey_report_image(html, "result", result_image, view->width, view->height, exposure);
    }
    rey_text_add(html, "<figcaption>result, relative error %.3g %%</figcaption></figure><figure>",
                 100 * relative_error(view, result_image));
    if (!result) {
        result = difference_image(html, view, result_image, &scale);
    }
    rey_text_add(html, "<figcaption>result &minus; target, mean of the channels<span class=\"bar\">&minus;%.2g<i></i>+%.2g"
                       "</span></figcaption></figure></div></section>\n",
                 (double)scale, (double)scale);
    return result;
}

// Renders every view with the given values, one picture behind the other.
static rey_result render_all(Fit *fit, const float *values, uint32_t set, float *images) {
    rey_result result = rey_unknowns_apply(&fit->unknowns, fit->scene, values);
    for (int v = 0; v < fit->job.view_count && !result; v++) {
        const FitView *view = &fit->views[v];
        rey_render_def def = rey_fit_finishing_def(fit, view, set, fit->job.report_spp);
        result = rey_render(fit->scene, &def, images, NULL);
        images += (int64_t)view->width * view->height * 3;
    }
    return result;
}

rey_result rey_report_views(Fit *fit, Text *html) {
    int64_t floats = 0;
    for (int v = 0; v < fit->job.view_count; v++) {
        floats += (int64_t)fit->views[v].width * fit->views[v].height * 3;
    }
    float *start = rey_alloc_array(fit->ctx, (size_t)floats, sizeof *start);
    float *found = rey_alloc_array(fit->ctx, (size_t)floats, sizeof *found);
    rey_result result = start && found ? REY_OK : REY_ERROR_MEMORY;
    if (!result) {
        result = render_all(fit, fit->unknowns.start, REPORT_SET, start);
    }
    if (!result) {
        result = render_all(fit, fit->unknowns.value, REPORT_SET + 1, found);
    }
    int64_t at = 0;
    for (int v = 0; v < fit->job.view_count && !result; v++) {
        result = view_section(fit, v, start + at, found + at, html);
        at += (int64_t)fit->views[v].width * fit->views[v].height * 3;
    }
    rey_free(fit->ctx, start);
    rey_free(fit->ctx, found);
    return result;
}
