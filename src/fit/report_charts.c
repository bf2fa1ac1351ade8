// report_charts.c: curves of the history as inline SVG.
#include "fit/pose.h"
#include "fit/report_parts.h"

#include <math.h>

enum { WIDE = 460, HIGH = 220, LEFT = 58, TOP = 8, BOTTOM = 36, SPARK_WIDE = 150, SPARK_HIGH = 34, MOST_POINTS = 300 };

typedef struct Chart {
    const Fit *fit;
    int column, count;  // columns of the history; three are red, green and blue
    bool pose;          // the columns are those of a pose, and the three curves those of `part`
    PosePart part;
    int reach;          // above 0, the curve is smoothed over 2 reach + 1 points and the raw one is pale
    const float *truth; // of each column, dashed; may be null
    const char *label;  // what the vertical axis shows
    bool logarithmic;   // low and high are logarithms to base 10 then
    double low, high;
} Chart;

static double cell(const Fit *fit, int64_t row, int column) {
    return ARRAY_AT(fit->state.history, double, (size_t)(row * fit->state.history_width + column));
}

// What curve k shows of a row.
static double value_of(const Chart *c, int64_t row, int k) {
    if (!c->pose) {
        return cell(c->fit, row, c->column + k);
    }
    float pose[16], first[16];
    double three[3];
    for (int i = 0; i < COUNT_OF(pose); i++) {
        pose[i] = (float)cell(c->fit, row, c->column + i);
        first[i] = (float)cell(c->fit, 0, c->column + i);
    }
    rey_pose_part(pose, c->truth ? c->truth : first, c->part, three);
    return three[k];
}

static double truth_of(const Chart *c, int k) {
    double three[3];
    if (!c->pose) {
        return (double)c->truth[k];
    }
    rey_pose_part(c->truth, NULL, c->part, three);
    return three[k];
}

// Mean of a curve over the rows of bin `bin` out of `bins`.
static double bin_mean(const Chart *c, int k, int bin, int bins) {
    int64_t rows = c->fit->state.iteration, first = bin * rows / bins, last = (bin + 1) * rows / bins;
    double sum = 0;
    for (int64_t i = first; i < last; i++) {
        sum += value_of(c, i, k);
    }
    return sum / (double)(last - first);
}

static int bin_count(const Fit *fit, int most) {
    return fit->state.iteration < most ? fit->state.iteration : most;
}

// Mean of the bins around one.
static double smooth(const Chart *c, int k, int bin, int bins, int reach) {
    double sum = 0;
    int count = 0;
    for (int b = bin - reach; b <= bin + reach; b++) {
        if (b >= 0 && b < bins) {
            sum += bin_mean(c, k, b, bins);
            count++;
        }
    }
    return sum / count;
}

static void widen(Chart *c, double value) {
    double at = c->logarithmic ? log10(value) : value;
    if (isfinite(at)) {
        c->low = fmin(c->low, at);
        c->high = fmax(c->high, at);
    }
}

// False when there is nothing that the axis could show.
static bool set_range(Chart *c) {
    int bins = bin_count(c->fit, MOST_POINTS);
    if (bins == 0) {
        return false;
    }
    c->low = INFINITY;
    c->high = -INFINITY;
    for (int k = 0; k < c->count; k++) {
        for (int i = 0; i < bins; i++) {
            widen(c, bin_mean(c, k, i, bins));
        }
        if (c->truth) {
            widen(c, truth_of(c, k));
        }
    }
    if (!(c->high >= c->low)) {
        return false;
    }
    double margin = fmax(0.06 * (c->high - c->low), c->logarithmic ? 0.05 : 1e-3 * fabs(c->high) + 1e-9);
    c->low -= margin;
    c->high += margin;
    return true;
}

// Below the lowest of a logarithmic axis lies what is not positive.
static double y_of(const Chart *c, double value) {
    double at = !c->logarithmic ? value : value > 0 ? log10(value) : c->low;
    return TOP + (HIGH - TOP - BOTTOM) * (c->high - fmin(fmax(at, c->low), c->high)) / (c->high - c->low);
}

static double x_of(const Chart *c, double iteration) {
    return LEFT + (WIDE - LEFT - 10) * iteration / c->fit->state.iteration;
}

static void y_tick(const Chart *c, double value, Text *html) {
    value = value == 0 ? 0 : value; // no -0
    double y = y_of(c, value);
    rey_text_add(html,
                 "<line class=\"grid\" x1=\"%d\" x2=\"%d\" y1=\"%.1f\" y2=\"%.1f\"/>"
                 "<text x=\"%d\" y=\"%.1f\" text-anchor=\"end\">%.4g</text>\n",
                 LEFT, WIDE - 10, y, y, LEFT - 6, y + 4, value);
}

// 1, 2 or 5 times a power of ten: the smallest that cuts the range into at most `most` parts.
static double nice_step(double range, int most) {
    double step = pow(10, floor(log10(range / most)));
    while (range / step > most) {
        double lead = step / pow(10, floor(log10(step) + 1e-9));
        step *= lead > 1.5 && lead < 3 ? 2.5 : 2;
    }
    return step;
}

static void y_axis(const Chart *c, Text *html) {
    if (!c->logarithmic) {
        double step = nice_step(c->high - c->low, 5);
        for (double k = ceil(c->low / step); k * step <= c->high; k++) {
            y_tick(c, k * step, html);
        }
        return;
    }
    static const int parts[] = {1, 2, 5};
    int every = 1 + (int)((c->high - c->low) / 6);
    for (int decade = (int)floor(c->low); decade <= (int)ceil(c->high); decade++) {
        for (int p = 0; p < (c->high - c->low < 1.7 ? 3 : 1); p++) {
            double value = parts[p] * pow(10, decade);
            if (log10(value) >= c->low && log10(value) <= c->high && decade % every == 0) {
                y_tick(c, value, html);
            }
        }
    }
}

static void axes(const Chart *c, Text *html) {
    y_axis(c, html);
    double step = fmax(nice_step(c->fit->state.iteration, 5), 1);
    for (double i = 0; i <= c->fit->state.iteration; i += step) {
        rey_text_add(html, "<text x=\"%.1f\" y=\"%d\" text-anchor=\"middle\">%.0f</text>", x_of(c, i), HIGH - BOTTOM + 15,
                     i);
    }
    rey_text_add(html,
                 "<text x=\"%d\" y=\"%d\" text-anchor=\"middle\">iteration</text>"
                 "<line class=\"axis\" x1=\"%d\" x2=\"%d\" y1=\"%d\" y2=\"%d\"/>\n",
                 LEFT + (WIDE - LEFT - 10) / 2, HIGH - 4, LEFT, WIDE - 10, HIGH - BOTTOM, HIGH - BOTTOM);
}

// One curve has the accent's colour, three those of their channels, others one of as many hues.
static void put_class(Text *html, const char *name, const char *property, int count, int k) {
    if (count == 3) {
        rey_text_add(html, " class=\"%s c%d\"", name, k);
    } else if (count > 1) {
        rey_text_add(html, " class=\"%s\" style=\"%s:hsl(%d,60%%,%d%%)\"", name, property, 360 * k / count, k % 2 ? 60 : 40);
    } else {
        rey_text_add(html, " class=\"%s\"", name);
    }
}

static void curve(const Chart *c, int k, int reach, const char *style, Text *html) {
    int bins = bin_count(c->fit, MOST_POINTS);
    rey_text_add(html, "<polyline");
    put_class(html, style, "stroke", c->count, k);
    rey_text_add(html, " points=\"");
    for (int i = 0; i < bins; i++) {
        rey_text_add(html, "%.1f,%.1f ", x_of(c, c->fit->state.iteration * (i + 0.5) / bins),
                     y_of(c, smooth(c, k, i, bins, reach)));
    }
    rey_text_add(html, "\"/>\n");
}

static void legend(const Chart *c, Text *html) {
    static const char *const channels[] = {"red", "green", "blue"}, *const axes_names[] = {"x", "y", "z"};
    static const char *const parts[] = {", position", ", rotation: axis times angle [deg]", ", scale"};
    rey_text_add(html, "<figcaption>");
    rey_text_html(html, c->label);
    rey_text_add(html, "%s", c->pose ? parts[c->part] : "");
    rey_text_add(html, c->logarithmic ? ", logarithmic scale" : "");
    for (int k = 0; k < c->count && c->count > 1; k++) {
        rey_text_add(html, " <b");
        put_class(html, "key", "border-color", c->count, k);
        if (c->count == 3) {
            rey_text_add(html, "></b>%s", c->pose ? axes_names[k] : channels[k]);
        } else {
            rey_text_add(html, "></b>%d", k);
        }
    }
    if (c->reach) {
        rey_text_add(html, " <b class=\"key pale\"></b>each iteration <b class=\"key\"></b>running mean");
    }
    rey_text_add(html, c->truth ? " <b class=\"key dash\"></b>truth</figcaption></figure>\n" : "</figcaption></figure>\n");
}

static void put_chart(Chart *c, Text *html) {
    if (!set_range(c)) {
        rey_text_add(html, "<p class=\"note\">No iteration had a %s", c->logarithmic ? "positive " : "");
        rey_text_html(html, c->label);
        rey_text_add(html, ".</p>\n");
        return;
    }
    rey_text_add(html, "<figure class=\"chart\"><svg viewBox=\"0 0 %d %d\" role=\"img\" aria-label=\"", WIDE, HIGH);
    rey_text_html(html, c->label);
    rey_text_add(html, "\">\n");
    axes(c, html);
    for (int k = 0; k < c->count; k++) {
        if (c->truth) {
            double y = y_of(c, truth_of(c, k));
            rey_text_add(html, "<line");
            put_class(html, "truth", "stroke", c->count, k);
            rey_text_add(html, " x1=\"%d\" x2=\"%d\" y1=\"%.1f\" y2=\"%.1f\"/>", LEFT, WIDE - 10, y, y);
        }
        if (c->reach) {
            curve(c, k, 0, "raw", html);
        }
        curve(c, k, c->reach, "line", html);
    }
    rey_text_add(html, "</svg>");
    legend(c, html);
}

void rey_report_loss(const Fit *fit, const FitResult *out, Text *html) {
    int reach = bin_count(fit, MOST_POINTS) / 50, negative = 0;
    Chart loss = {.fit = fit, .column = HISTORY_LOSS, .count = 1, .reach = reach, .label = "loss", .logarithmic = true};
    Chart norm = {.fit = fit,
                  .column = HISTORY_NORM,
                  .count = 1,
                  .reach = reach,
                  .label = "norm of the gradient",
                  .logarithmic = true};
    for (int i = 0; i < fit->state.iteration; i++) {
        negative += cell(fit, i, HISTORY_LOSS) <= 0;
    }
    rey_text_add(html, "<div class=\"charts\">");
    put_chart(&loss, html);
    put_chart(&norm, html);
    rey_text_add(html, "</div>\n");
    if (out->iterations) {
        char words[64];
        rey_fit_loss_words(out, words, sizeof words);
        rey_text_add(html, "<p class=\"note\">Loss %.4g, %s.</p>\n", out->loss, words);
    }
    if (negative) {
        rey_text_add(html,
                     "<p class=\"note\">In %d of %d iterations the loss, an unbiased estimate, was not positive; they "
                     "lie on the lower edge.</p>\n",
                     negative, fit->state.iteration);
    }
}

static bool wants_logarithm(const Chart *c) {
    double low = INFINITY, high = 0;
    for (int k = 0; k < c->count; k++) {
        for (int i = 0; i < c->fit->state.iteration; i++) {
            low = fmin(low, value_of(c, i, k));
            high = fmax(high, value_of(c, i, k));
        }
    }
    return low > 0 && high > 8 * low;
}

// What moves of a pose: a rigid one keeps its scale.
static void put_pose(Chart *c, Text *html) {
    c->pose = true;
    c->count = 3;
    for (c->part = 0; c->part < POSE_PARTS; c->part++) {
        double low = INFINITY, high = 0;
        for (int i = 0; i < c->fit->state.iteration * 3 && c->part == POSE_SCALE; i++) {
            double first = value_of(c, 0, i % 3), factor = first != 0 ? value_of(c, i / 3, i % 3) / first : 1;
            low = fmin(low, factor);
            high = fmax(high, factor);
        }
        if (c->part != POSE_SCALE || high - low > 1e-4) {
            put_chart(c, html);
        }
    }
}

void rey_report_histories(const Fit *fit, const FitResult *out, Text *html) {
    int column = HISTORY_VALUES;
    rey_text_add(html, "<div class=\"charts\">");
    for (size_t i = 0; i < out->rows.count; i++) {
        const FitRow *row = &ARRAY_AT(out->rows, FitRow, i);
        if (row->count > HISTORY_LARGEST || row->derived) {
            continue;
        }
        Chart chart = {
            .fit = fit, .column = column, .count = (int)row->count, .truth = row->truth, .label = row->name};
        if (rey_fit_row_is_pose(row)) {
            put_pose(&chart, html);
        } else {
            chart.logarithmic = wants_logarithm(&chart);
            put_chart(&chart, html);
        }
        column += (int)row->count;
    }
    rey_text_add(html, "</div>\n");
}

void rey_report_sparkline(const Fit *fit, int column, const FitRow *row, Text *html) {
    int bins = bin_count(fit, SPARK_WIDE);
    bool pose = rey_fit_row_is_pose(row); // of which it shows the place
    const float *truth = row->truth;
    Chart c = {.fit = fit, .column = column, .count = pose ? 3 : (int)row->count, .truth = truth, .pose = pose};
    if (!set_range(&c)) {
        return;
    }
    double per_y = (SPARK_HIGH - 4) / (c.high - c.low);
    rey_text_add(html, "<svg width=\"%d\" height=\"%d\" role=\"img\" aria-label=\"history\">", SPARK_WIDE, SPARK_HIGH);
    for (int k = 0; k < c.count; k++) {
        if (truth) {
            double y = 2 + per_y * (c.high - truth_of(&c, k));
            rey_text_add(html, "<line");
            put_class(html, "truth", "stroke", c.count, k);
            rey_text_add(html, " x1=\"0\" x2=\"%d\" y1=\"%.1f\" y2=\"%.1f\"/>", SPARK_WIDE, y, y);
        }
        rey_text_add(html, "<polyline");
        put_class(html, "line", "stroke", c.count, k);
        rey_text_add(html, " points=\"");
        for (int i = 0; i < bins; i++) {
            rey_text_add(html, "%.1f,%.1f ", SPARK_WIDE * (i + 0.5) / bins,
                         2 + per_y * (c.high - bin_mean(&c, k, i, bins)));
        }
        rey_text_add(html, "\"/>");
    }
    rey_text_add(html, "</svg>");
}
