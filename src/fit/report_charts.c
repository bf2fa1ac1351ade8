// report_charts.c: curves as inline SVG.
#include "fit/report_parts.h"

#include <math.h>

enum { WIDE = 880, HIGH = 240, LEFT = 56, BOTTOM = 34, SPARK_WIDE = 150, SPARK_HIGH = 34, SPARK_LABEL = 48, MOST_POINTS = 440 };

static double cell(const Fit *fit, int64_t row, int column) {
    return ARRAY_AT(fit->state.history, double, (size_t)(row * fit->state.history_width + column));
}

// Mean of a column over the rows of bin `bin` out of `bins`.
static double bin_mean(const Fit *fit, int column, int bin, int bins) {
    int64_t rows = fit->state.iteration, first = bin * rows / bins, last = (bin + 1) * rows / bins;
    double sum = 0;
    for (int64_t i = first; i < last; i++) {
        sum += cell(fit, i, column);
    }
    return sum / (double)(last - first);
}

typedef struct Axis {
    double low, high; // logarithms to base 10
} Axis;

static double loss_y(Axis axis, double loss) {
    return (HIGH - BOTTOM) * (axis.high - log10(loss)) / (axis.high - axis.low);
}

// One curve of the loss, smoothed over 2 * reach + 1 bins. Estimates of a small loss can be negative: they are left
// out.
static void loss_curve(const Fit *fit, Axis axis, int bins, int reach, const char *style, Text *html) {
    rey_text_add(html, "<polyline class=\"%s\" points=\"", style);
    for (int i = 0; i < bins; i++) {
        double sum = 0;
        int count = 0;
        for (int k = i - reach; k <= i + reach; k++) {
            if (k >= 0 && k < bins) {
                sum += bin_mean(fit, HISTORY_LOSS, k, bins);
                count++;
            }
        }
        if (sum > 0) {
            double y = fmin(fmax(loss_y(axis, sum / count), 0), HIGH - BOTTOM);
            rey_text_add(html, "%.1f,%.1f ", LEFT + (WIDE - LEFT) * (i + 0.5) / bins, y);
        }
    }
    rey_text_add(html, "\"/>\n");
}

static void loss_axes(const Fit *fit, Axis axis, Text *html) {
    static const int parts[] = {1, 2, 5};
    bool few = axis.high - axis.low < 1.5;
    for (int decade = (int)floor(axis.low); decade <= (int)ceil(axis.high); decade++) {
        for (int p = 0; p < (few ? 3 : 1); p++) {
            double value = parts[p] * pow(10, decade);
            if (log10(value) < axis.low - 1e-9 || log10(value) > axis.high + 1e-9) {
                continue;
            }
            double y = loss_y(axis, value);
            rey_text_add(html, "<line class=\"grid\" x1=\"%d\" x2=\"%d\" y1=\"%.1f\" y2=\"%.1f\"/>", LEFT, WIDE, y, y);
            rey_text_add(html, "<text x=\"%d\" y=\"%.1f\" text-anchor=\"end\">%.3g</text>\n", LEFT - 8, y + 4, value);
        }
    }
    for (int i = 0; i <= 4; i++) {
        rey_text_add(html, "<text x=\"%d\" y=\"%d\" text-anchor=\"%s\">%d</text>", LEFT + (WIDE - LEFT) * i / 4,
                     HIGH - BOTTOM + 17,
                     i == 4 ? "end"
                     : i    ? "middle"
                            : "start",
                     fit->state.iteration * i / 4);
    }
    rey_text_add(html, "<text x=\"%d\" y=\"%d\" text-anchor=\"middle\">iteration</text>\n", LEFT + (WIDE - LEFT) / 2,
                 HIGH - 2);
}

void rey_report_loss(const Fit *fit, Text *html) {
    int rows = fit->state.iteration, bins = rows < MOST_POINTS ? rows : MOST_POINTS;
    Axis axis = {INFINITY, -INFINITY};
    for (int i = 0; i < bins; i++) {
        double loss = bin_mean(fit, HISTORY_LOSS, i, bins);
        if (loss > 0) {
            axis.low = fmin(axis.low, log10(loss));
            axis.high = fmax(axis.high, log10(loss));
        }
    }
    if (!(axis.high >= axis.low)) {
        rey_text_add(html, "<p class=\"note\">No iteration had a positive loss.</p>\n");
        return;
    }
    axis.low -= 0.08;
    axis.high += 0.08;
    rey_text_add(html, "<svg viewBox=\"0 0 %d %d\" width=\"100%%\" role=\"img\" aria-label=\"loss\">\n", WIDE, HIGH);
    loss_axes(fit, axis, html);
    loss_curve(fit, axis, bins, 0, "raw", html);
    loss_curve(fit, axis, bins, bins / 60, "line", html);
    rey_text_add(html, "<line class=\"raw\" x1=\"%d\" x2=\"%d\" y1=\"12\" y2=\"12\"/><text x=\"%d\" y=\"16\">each "
                       "iteration&rsquo;s estimate</text><line class=\"line\" x1=\"%d\" x2=\"%d\" y1=\"28\" y2=\"28\"/>"
                       "<text x=\"%d\" y=\"32\">running mean</text>\n",
                 WIDE - 190, WIDE - 165, WIDE - 158, WIDE - 190, WIDE - 165, WIDE - 158);
    rey_text_add(html, "</svg>\n");
}

void rey_report_curve(const Fit *fit, int column, int64_t count, const float *truth, Text *html) {
    int rows = fit->state.iteration, bins = rows < SPARK_WIDE ? rows : SPARK_WIDE;
    double low = INFINITY, high = -INFINITY;
    for (int64_t k = 0; k < count; k++) {
        for (int i = 0; i < bins; i++) {
            double value = bin_mean(fit, column + (int)k, i, bins);
            low = fmin(low, value);
            high = fmax(high, value);
        }
        if (truth) {
            low = fmin(low, (double)truth[k]);
            high = fmax(high, (double)truth[k]);
        }
    }
    double range = high > low ? high - low : 1;
    rey_text_add(html, "<svg width=\"%d\" height=\"%d\" viewBox=\"0 0 %d %d\" role=\"img\" aria-label=\"history\">",
                 SPARK_WIDE + SPARK_LABEL, SPARK_HIGH, SPARK_WIDE + SPARK_LABEL, SPARK_HIGH);
    rey_text_add(html, "<line class=\"grid\" x1=\"0\" x2=\"%d\" y1=\"%d\" y2=\"%d\"/><text x=\"%d\" y=\"9\">%.3g</text>"
                       "<text x=\"%d\" y=\"%d\">%.3g</text>",
                 SPARK_WIDE, SPARK_HIGH - 1, SPARK_HIGH - 1, SPARK_WIDE + 5, high, SPARK_WIDE + 5, SPARK_HIGH, low);
    for (int64_t k = 0; k < count; k++) {
        if (truth) {
            double y = 2 + (SPARK_HIGH - 4) * (high - (double)truth[k]) / range;
            rey_text_add(html, "<line class=\"truth\" x1=\"0\" x2=\"%d\" y1=\"%.1f\" y2=\"%.1f\"/>", SPARK_WIDE, y, y);
        }
        rey_text_add(html, count == 3 ? "<polyline class=\"line c%d\" points=\"" : "<polyline class=\"line\" points=\"",
                     (int)k);
        for (int i = 0; i < bins; i++) {
            double y = 2 + (SPARK_HIGH - 4) * (high - bin_mean(fit, column + (int)k, i, bins)) / range;
            rey_text_add(html, "%.1f,%.1f ", SPARK_WIDE * (i + 0.5) / bins, y);
        }
        rey_text_add(html, "\"/>");
    }
    rey_text_add(html, "</svg>");
}
