// report_grids.c: grids of voxels in a report: their means along z, as seen from the side on which y goes up.
#include "fit/report_parts.h"

#include <stdio.h>

enum { AXIS_LARGEST = 1024 };

// Means over z of the first or of three channels; a copy, which the caller frees.
static float *means_of(rey_context *ctx, const FitRow *row, const float *values) {
    int64_t nz = row->shape[0], ny = row->shape[1], nx = row->shape[2] / row->grid;
    float *rgb = rey_alloc_array(ctx, (size_t)(nx * ny), 3 * sizeof *rgb);
    for (int64_t i = 0; rgb && i < 3 * nx * ny; i++) {
        int64_t x = i / 3 % nx, y = ny - 1 - i / 3 / nx, channel = row->grid >= 3 ? i % 3 : 0;
        double sum = 0;
        for (int64_t z = 0; z < nz; z++) {
            sum += (double)values[((z * ny + y) * nx + x) * row->grid + channel];
        }
        rgb[i] = (float)(sum / (double)nz);
    }
    return rgb;
}

static rey_result grid_section(rey_context *ctx, const FitRow *row, Text *html) {
    static const char *const names[COLUMN_COUNT] = {"truth", "start", "found"};
    const float *columns[COLUMN_COUNT] = {row->truth, row->start, row->found};
    int width = (int)(row->shape[2] / row->grid), height = (int)row->shape[1];
    float exposure = 0;
    rey_result result = REY_OK;
    rey_text_add(html, "<section><h3><code>");
    rey_text_html(html, row->name);
    rey_text_add(html, "</code> <span class=\"note\">%d &times; %d &times; %lld, means along z</span></h3>\n<div class=\"four\">",
                 width, height, (long long)row->shape[0]);
    for (int i = 0; i < COLUMN_COUNT && !result; i++) {
        float *rgb = columns[i] ? means_of(ctx, row, columns[i]) : NULL;
        if (rgb) {
            // All of them as bright as the first one, which is the truth where it is known.
            exposure = exposure > 0 ? exposure : rey_report_exposure(ctx, rgb, (int64_t)width * height);
            result = rey_report_figure(html, names[i], rgb, width, height, exposure, names[i]);
        } else if (columns[i]) {
            result = REY_ERROR_MEMORY;
        }
        rey_free(ctx, rgb);
    }
    rey_text_add(html, "</div></section>\n");
    return result;
}

rey_result rey_report_grids(Fit *fit, const FitResult *out, Text *html) {
    rey_result result = REY_OK;
    bool any = false;
    for (size_t i = 0; i < out->rows.count && !result; i++) {
        const FitRow *row = &ARRAY_AT(out->rows, FitRow, i);
        if (row->grid && row->shape[1] <= AXIS_LARGEST && row->shape[2] / row->grid <= AXIS_LARGEST) {
            rey_text_add(html, any ? "" : "<h2>Grids</h2>\n");
            any = true;
            result = grid_section(fit->ctx, row, html);
        }
    }
    return result;
}
