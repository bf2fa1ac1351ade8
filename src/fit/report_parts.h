// report_parts.h: the pieces of report.html.
#pragma once

#include "fit/report.h"
#include "fit/text.h"

// The pictures of every view: target, start, result, difference. Leaves the scene at the result.
rey_result rey_report_views(Fit *fit, Text *html);

// The loss over the iterations, as SVG.
void rey_report_loss(const Fit *fit, Text *html);
// A small curve of the entries of unknown k, whose history starts at `column`; truth may be null.
void rey_report_curve(const Fit *fit, int column, int64_t count, const float *truth, Text *html);

// An <img> of a linear RGB picture, scaled by exposure; title and alternative text from `name`.
rey_result rey_report_image(Text *html, const char *name, const float *rgb, int width, int height, float exposure);
// Factor that brings the brightest percent to white, 1 for pictures that need none.
float rey_report_exposure(rey_context *ctx, const float *rgb, int64_t pixels);

// Style and script.
extern const char rey_report_style[], rey_report_script[];
