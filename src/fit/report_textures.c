// report_textures.c: textures and environment maps of a report.
#include "fit/report_parts.h"

#include <stdio.h>

enum { TEXTURE_LARGEST = 1024 };

static bool is_texture(const FitRow *row) {
    return !row->points[COLUMN_FOUND] && !row->grid && row->dims >= 2 && row->count > HISTORY_LARGEST &&
           row->shape[0] > 1 && row->shape[1] > 1 &&
           row->shape[0] <= TEXTURE_LARGEST && row->shape[1] <= TEXTURE_LARGEST &&
           (row->dims == 2 || row->shape[2] == 1 || row->shape[2] == 3);
}

// Three channels for every texel: a copy, which the caller frees.
static float *rgb_of(rey_context *ctx, const FitRow *row, const float *values) {
    int64_t channels = row->dims == 3 ? row->shape[2] : 1, texels = row->shape[0] * row->shape[1];
    float *rgb = values ? rey_alloc_array(ctx, (size_t)texels, 3 * sizeof *rgb) : NULL;
    for (int64_t i = 0; rgb && i < 3 * texels; i++) {
        rgb[i] = values[channels == 3 ? i : i / 3];
    }
    return rgb;
}

static rey_result texture_section(const FitRow *row, float *const rgb[3], Text *html) {
    static const char *const names[] = {"truth", "start", "found"};
    int width = (int)row->shape[1], height = (int)row->shape[0];
    float exposure = rey_report_exposure(html->ctx, rgb[0] ? rgb[0] : rgb[2], (int64_t)width * height);
    char caption[96];
    rey_result result = REY_OK;
    rey_text_add(html, "<section><h3><code>");
    rey_text_html(html, row->name);
    rey_text_add(html, "</code> <span class=\"note\">%d &times; %d", width, height);
    if (exposure < 1 || exposure > 1) {
        rey_text_add(html, ", shown at exposure &times;%.3g", (double)exposure);
    }
    rey_text_add(html, "</span></h3>\n<div class=\"four\">");
    for (int i = 0; i < COUNT_OF(names) && !result; i++) {
        snprintf(caption, sizeof caption, i == 2 && row->truth ? "%s, error %.2f&thinsp;%%" : "%s", names[i],
                 100 * row->error);
        result = rgb[i] ? rey_report_figure(html, names[i], rgb[i], width, height, exposure, caption) : REY_OK;
    }
    if (!result) {
        result = rey_report_difference(html, rgb[0] ? "found &minus; truth" : "found &minus; start", rgb[2],
                                       rgb[0] ? rgb[0] : rgb[1], NULL, width, height);
    }
    rey_text_add(html, "</div></section>\n");
    return result;
}

rey_result rey_report_textures(Fit *fit, const FitResult *out, Text *html) {
    rey_result result = REY_OK;
    bool any = false;
    for (size_t i = 0; i < out->rows.count && !result; i++) {
        const FitRow *row = &ARRAY_AT(out->rows, FitRow, i);
        if (!is_texture(row)) {
            continue;
        }
        rey_text_add(html, any ? "" : "<h2>Textures</h2>\n");
        any = true;
        float *rgb[3] = {rgb_of(fit->ctx, row, row->truth), rgb_of(fit->ctx, row, row->start),
                         rgb_of(fit->ctx, row, row->found)};
        result = (rgb[0] || !row->truth) && rgb[1] && rgb[2] ? texture_section(row, rgb, html) : REY_ERROR_MEMORY;
        for (int k = 0; k < COUNT_OF(rgb); k++) {
            rey_free(fit->ctx, rgb[k]);
        }
    }
    return result;
}
