// report_table.c: truth, start, found and error of every parameter, with its curve.
#include "fit/pose.h"
#include "fit/report_parts.h"
#include "io/image.h"

#include <math.h>
#include <string.h>

enum { SHOWN_ENTRIES = 4 };

// A colour as it looks; bright lights keep their hue.
static void put_swatch(Text *html, const double rgb[3]) {
    double most = fmax(1, fmax(rgb[0], fmax(rgb[1], rgb[2])));
    rey_text_add(html, "<span class=\"sw\" style=\"background:rgb(%.0f,%.0f,%.0f)\"></span>",
                 (double)(255 * rey_srgb_encode((float)fmax(rgb[0] / most, 0))),
                 (double)(255 * rey_srgb_encode((float)fmax(rgb[1] / most, 0))),
                 (double)(255 * rey_srgb_encode((float)fmax(rgb[2] / most, 0))));
}

// Few entries one by one, of many the mean: of the channels where they are colours.
static void put_entries(Text *html, const FitRow *row, int column) {
    const float *values = column == COLUMN_TRUTH ? row->truth : column == COLUMN_START ? row->start : row->found;
    char text[128];
    if (rey_fit_row_text(row, column, text, sizeof text)) {
        for (char *at = text, *end; at; at = end) { // place, rotation and scale below each other
            end = strstr(at, ", ");
            if (end) {
                *end = 0;
                end += 2;
            }
            rey_text_html(html, at);
            rey_text_add(html, end ? ",<br>" : "");
        }
        return;
    }
    if (!values) {
        rey_text_add(html, "&ndash;");
        return;
    }
    bool few = row->count <= SHOWN_ENTRIES, colours = row->count == 3 || (row->dims == 3 && row->shape[2] == 3);
    int64_t shown = few ? row->count : colours ? 3 : 1;
    double mean[SHOWN_ENTRIES] = {0};
    for (int64_t i = 0; i < row->count; i++) {
        mean[i % shown] += (double)values[i] * (double)shown / (double)row->count;
    }
    if (colours) {
        put_swatch(html, mean);
    }
    rey_text_add(html, few ? "" : "mean ");
    for (int64_t i = 0; i < shown; i++) {
        rey_text_add(html, i ? " %.4g" : "%.4g", mean[i]);
    }
}

static void put_row(Fit *fit, const FitRow *row, int column, Text *html) {
    rey_text_add(html, "<tr><td><code>");
    rey_text_html(html, row->name);
    rey_text_add(html, "</code>");
    for (int i = 0; i < row->dims && row->count > HISTORY_LARGEST; i++) {
        rey_text_add(html, i ? " &times; %lld" : "<div class=\"note\">%lld", (long long)row->shape[i]);
    }
    rey_text_add(html, row->dims && row->count > HISTORY_LARGEST ? "</div></td>" : "</td>");
    for (int i = 0; i < COLUMN_COUNT; i++) {
        rey_text_add(html, "<td class=\"v\">");
        put_entries(html, row, i);
        rey_text_add(html, "</td>");
    }
    if (row->truth && rey_fit_row_is_pose(row)) {
        rey_text_add(html, "<td class=\"n\">%.2f&thinsp;%%<div class=\"note\">%.3g away, turned by %.3g&deg;</div></td><td>",
                     100 * row->error, rey_pose_distance(row->found, row->truth), rey_pose_turned(row->found, row->truth));
    } else if (row->truth && row->absolute) {
        rey_text_add(html, "<td class=\"n\">%.3g%s<div class=\"note\">absolute</div></td><td>", row->error,
                     row->weighted ? "<sup>w</sup>" : "");
    } else if (row->truth || row->points[COLUMN_TRUTH]) {
        rey_text_add(html, row->points[COLUMN_TRUTH] ? "<td class=\"n\">%.3f&thinsp;%%%s</td><td>"
                                                     : "<td class=\"n\">%.2f&thinsp;%%%s</td><td>",
                     100 * row->error, row->weighted ? "<sup>w</sup>" : row->points[COLUMN_TRUTH] ? "<sup>c</sup>" : "");
    } else {
        rey_text_add(html, "<td class=\"n\">&ndash;</td><td>");
    }
    if (row->count <= HISTORY_LARGEST && !row->derived) {
        rey_report_sparkline(fit, column, row, html);
    }
    rey_text_add(html, "</td></tr>\n");
}

// What the marks and numbers of the table mean, of those that it has.
static void put_notes(const FitResult *out, Text *html) {
    bool entries = false, weighted = false, poses = false, judged_poses = false, meshes = false, dashed = false;
    for (size_t i = 0; i < out->rows.count; i++) {
        const FitRow *row = &ARRAY_AT(out->rows, FitRow, i);
        bool pose = rey_fit_row_is_pose(row), mesh = row->points[COLUMN_FOUND] != 0;
        poses |= pose;
        judged_poses |= pose && row->truth;
        meshes |= mesh && row->points[COLUMN_TRUTH];
        weighted |= row->weighted && row->truth;
        entries |= row->truth && !pose && !mesh && !row->weighted;
        dashed |= out->iterations && row->truth && row->count <= HISTORY_LARGEST && !row->derived;
    }
    if (!entries && !weighted && !poses && !meshes) {
        return;
    }
    rey_text_add(html, "<p class=\"note\">");
    if (entries) {
        rey_text_add(html, "Error: the largest relative error of an entry, absolute where the truth is 0. ");
    }
    if (weighted) {
        rey_text_add(html, "<sup>w</sup>&thinsp;Mean absolute error over mean, each entry weighted by how much the pictures "
                           "depend on it at the truth. ");
    }
    if (poses) {
        rey_text_add(html, "Poses: position, rotation as axis times angle, scale%s. ",
                     judged_poses ? "; their error is that of an entry over the largest" : "");
    }
    if (meshes) {
        rey_text_add(html, "<sup>c</sup>&thinsp;Meshes: the Chamfer distance from the truth (the mean of the mean distances "
                           "from either surface to the other) over the diagonal of its bounding box. ");
    }
    rey_text_add(html, dashed ? "Dashed: the truth.</p>\n" : "</p>\n");
}

void rey_report_table(Fit *fit, const FitResult *out, Text *html) {
    int column = HISTORY_VALUES;
    rey_text_add(html, "<h2>Parameters</h2>\n<div class=\"wide\"><table><thead><tr><th>parameter</th><th>truth</th>"
                       "<th>start</th><th>found</th><th class=\"n\">error</th><th>history</th></tr></thead><tbody>\n");
    for (size_t i = 0; i < out->rows.count; i++) {
        const FitRow *row = &ARRAY_AT(out->rows, FitRow, i);
        put_row(fit, row, column, html);
        column += row->count <= HISTORY_LARGEST ? (int)row->count : 0;
    }
    rey_text_add(html, "</tbody></table></div>\n");
    put_notes(out, html);
}
