// report_parts.h: the pieces of report.html.
#pragma once

#include "fit/report.h"
#include "fit/text.h"

// The pictures of every view: target, start, result, difference, and those on the way. Leaves the scene at the result.
rey_result rey_report_views(Fit *fit, FitResult *out, Text *html);
// Textures and environment maps: truth, start, found, difference.
rey_result rey_report_textures(Fit *fit, const FitResult *out, Text *html);

// Grids of voxels, seen along an axis: truth, start, found.
rey_result rey_report_grids(Fit *fit, const FitResult *out, Text *html);

// Loss and gradient over the iterations; then every small parameter.
void rey_report_loss(const Fit *fit, const FitResult *out, Text *html);
void rey_report_histories(const Fit *fit, const FitResult *out, Text *html);
// Small curves of a row whose columns of the history begin at `column`.
void rey_report_sparkline(const Fit *fit, int column, const FitRow *row, Text *html);

// The table of the parameters, and how the report was made.
void rey_report_table(Fit *fit, const FitResult *out, Text *html);
rey_result rey_report_about(Fit *fit, const FitResult *out, Text *html);

// A figure with a linear RGB picture, scaled by exposure, and a caption in HTML.
rey_result rey_report_figure(Text *html, const char *name, const float *rgb, int width, int height, float exposure,
                             const char *caption);
// A figure with a - b, mean of the channels: blue where a is darker, red where it is brighter, with its colour bar. A
// mask, which may be null, leaves out where it is 0.
rey_result rey_report_difference(Text *html, const char *caption, const float *a, const float *b, const float *mask,
                                 int width, int height);
// Factor that brings the brightest percent to white, 1 for pictures that need none.
float rey_report_exposure(rey_context *ctx, const float *rgb, int64_t pixels);
// A picture of at most 160 pixels a side as PNG, freed with rey_free.
rey_result rey_report_thumbnail(rey_context *ctx, const float *rgb, int width, int height, float exposure,
                                unsigned char **png, size_t *size, int *small_width, int *small_height);
// An <img>, with the smoothness its size asks for; tone: exposure control applies to it.
void rey_report_png(Text *html, const char *name, const unsigned char *png, size_t size, int width, int height,
                    bool tone);

// Style and script.
extern const char rey_report_style[], rey_report_script[], rey_report_controls[];
