// report.c: report.html from its parts.
#include "fit/report_parts.h"
#include "io/file.h"
#include "io/image.h"

#include <math.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

enum { SHOWN_ENTRIES = 4 };

static void put_entries(Text *html, const FitRow *row, const float *values) {
    if (!values) {
        rey_text_add(html, "&ndash;");
        return;
    }
    if (row->count == 3) {
        float most = fmaxf(1, fmaxf(values[0], fmaxf(values[1], values[2]))); // bright lights keep their hue
        rey_text_add(html, "<span class=\"sw\" style=\"background:rgb(%.0f,%.0f,%.0f)\"></span>",
                     (double)(255 * rey_srgb_encode(fmaxf(values[0] / most, 0))),
                     (double)(255 * rey_srgb_encode(fmaxf(values[1] / most, 0))),
                     (double)(255 * rey_srgb_encode(fmaxf(values[2] / most, 0))));
    }
    for (int64_t i = 0; i < row->count && i < SHOWN_ENTRIES; i++) {
        rey_text_add(html, i ? " &nbsp;%.4g" : "%.4g", (double)values[i]);
    }
    if (row->count > SHOWN_ENTRIES) {
        rey_text_add(html, " &hellip;");
    }
}

// A texture's thumbnail; grey ones are repeated over the channels.
static rey_result put_thumbnail(Text *html, const FitRow *row, const float *values, float exposure) {
    int64_t height = row->shape[0], width = row->shape[1], channels = row->dims == 3 ? row->shape[2] : 1;
    if (!values) {
        rey_text_add(html, "&ndash;");
        return REY_OK;
    }
    if (channels == 3) {
        return rey_report_image(html, row->name, values, (int)width, (int)height, exposure);
    }
    float *rgb = rey_alloc_array(html->ctx, (size_t)(width * height), 3 * sizeof *rgb);
    for (int64_t i = 0; rgb && i < 3 * width * height; i++) {
        rgb[i] = values[i / 3 * channels];
    }
    rey_result result =
        rgb ? rey_report_image(html, row->name, rgb, (int)width, (int)height, exposure) : REY_ERROR_MEMORY;
    rey_free(html->ctx, rgb);
    return result;
}

static bool is_picture(const FitRow *row) {
    return row->dims >= 2 && row->count > HISTORY_LARGEST && row->shape[0] > 1 && row->shape[1] > 1 &&
           row->shape[0] <= IMAGE_LARGEST && row->shape[1] <= IMAGE_LARGEST &&
           (row->dims == 2 || row->shape[2] == 1 || row->shape[2] == 3);
}

static rey_result put_row(Fit *fit, const FitRow *row, int column, Text *html) {
    rey_result result = REY_OK;
    const float *columns[] = {row->truth, row->start, row->found};
    bool picture = is_picture(row), colour = row->dims == 3 && row->shape[2] == 3;
    const float *shown = row->truth ? row->truth : row->found;
    float exposure = picture && colour ? rey_report_exposure(fit->ctx, shown, row->count / 3) : 1;
    rey_text_add(html, "<tr><td><code>");
    rey_text_html(html, row->name);
    rey_text_add(html, "</code>");
    for (int i = 0; i < row->dims && row->count > HISTORY_LARGEST; i++) {
        rey_text_add(html, i ? " &times; %lld" : "<div class=\"note\">%lld", (long long)row->shape[i]);
    }
    rey_text_add(html, row->dims && row->count > HISTORY_LARGEST ? "</div></td>" : "</td>");
    for (int i = 0; i < COUNT_OF(columns) && !result; i++) {
        rey_text_add(html, "<td>");
        if (picture) {
            result = put_thumbnail(html, row, columns[i], exposure);
        } else {
            put_entries(html, row, columns[i]);
        }
        rey_text_add(html, "</td>");
    }
    if (row->truth) {
        rey_text_add(html, "<td class=\"n\">%.2f&thinsp;%%%s</td><td>", 100 * row->error,
                     row->weighted ? "<sup>w</sup>" : "");
    } else {
        rey_text_add(html, "<td class=\"n\">&ndash;</td><td>");
    }
    if (row->count <= HISTORY_LARGEST) {
        rey_report_curve(fit, column, row->count, row->truth, html);
    }
    rey_text_add(html, "</td></tr>\n");
    return result;
}

static rey_result put_table(Fit *fit, const FitResult *out, Text *html) {
    int column = HISTORY_VALUES;
    bool weighted = false;
    rey_result result = REY_OK;
    rey_text_add(html, "<h2>Parameters</h2>\n<div class=\"wide\"><table><thead><tr><th>parameter</th><th>truth</th>"
                       "<th>start</th><th>found</th><th class=\"n\">error</th><th>history, truth dashed</th></tr></thead><tbody>\n");
    for (size_t i = 0; i < out->rows.count && !result; i++) {
        const FitRow *row = &ARRAY_AT(out->rows, FitRow, i);
        result = put_row(fit, row, column, html);
        column += row->count <= HISTORY_LARGEST ? (int)row->count : 0;
        weighted = weighted || (row->weighted && row->truth);
    }
    rey_text_add(html, "</tbody></table></div>\n<p class=\"note\">Error: the largest relative error of an entry.");
    if (weighted) {
        rey_text_add(html, " <sup>w</sup>&thinsp;Mean absolute error over mean, each entry weighted by how much the "
                           "pictures depend on it at the truth.");
    }
    rey_text_add(html, "</p>\n");
    return result;
}

static void put_cpu(Text *html) {
    FILE *file = fopen("/proc/cpuinfo", "r");
    char line[512];
    const char *name = NULL;
    while (file && !name && fgets(line, sizeof line, file)) {
        char *colon = strncmp(line, "model name", 10) ? NULL : strchr(line, ':');
        if (colon) {
            colon[1 + strcspn(colon + 1, "\n")] = 0;
            name = colon + 1;
        }
    }
    rey_text_html(html, name ? name : "unknown");
    if (file) {
        fclose(file);
    }
}

static rey_result put_machine(Fit *fit, const FitResult *out, Text *html) {
    char date[64] = "", *job = NULL;
    time_t now = time(NULL);
    struct tm parts;
    if (gmtime_r(&now, &parts)) {
        strftime(date, sizeof date, "%Y-%m-%d %H:%M UTC", &parts);
    }
    rey_text_add(html, "<h2>How it was made</h2>\n<dl><dt>version</dt><dd>Reynolds %s</dd><dt>processor</dt><dd>",
                 rey_version());
    put_cpu(html);
    if (fit->def->command) {
        rey_text_add(html, "</dd><dt>command</dt><dd><code>");
        rey_text_html(html, fit->def->command);
        rey_text_add(html, "</code>");
    }
    rey_text_add(html, "</dd><dt>seed</dt><dd>%u", (unsigned)fit->job.seed);
    rey_text_add(html, "</dd><dt>threads, lanes</dt><dd>%d, %d</dd>", rey_threads(fit->ctx), rey_lanes(fit->ctx));
    rey_text_add(html, "<dt>optimisation</dt><dd>%.1f s, %.3g s an iteration</dd><dt>finished</dt><dd>%s</dd></dl>\n",
                 out->seconds, out->iterations ? out->seconds / out->iterations : 0, date);
    rey_result result = rey_job_yaml(&fit->job, &job);
    if (!result) {
        rey_text_add(html, "<h2>Resolved job</h2>\n<details><summary>every setting, defaults included</summary><pre>");
        rey_text_html(html, job);
        rey_text_add(html, "</pre></details>\n");
    }
    rey_free(fit->ctx, job);
    return result;
}

static void put_head(Fit *fit, const FitResult *out, Text *html) {
    const char *slash = strrchr(fit->job.path, '/'), *scene = strrchr(fit->job.scene, '/');
    rey_text_add(html, "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n"
                       "<meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">\n<title>");
    rey_text_html(html, scene ? scene + 1 : fit->job.scene);
    rey_text_add(html, " &ndash; fit report</title>\n<style>\n");
    rey_text_bytes(html, rey_report_style, strlen(rey_report_style));
    rey_text_add(html, "</style></head><body>\n<h1>Recovering ");
    rey_text_html(html, scene ? scene + 1 : fit->job.scene);
    rey_text_add(html,
                 " from images</h1>\n<p class=\"lead\">%lld unknown numbers in %d parameter%s, from %d view%s: "
                 "%d iterations of %s on the %s loss in %.1f seconds%s. Job ",
                 (long long)out->numbers, (int)out->rows.count, out->rows.count == 1 ? "" : "s", fit->job.view_count,
                 fit->job.view_count == 1 ? "" : "s", out->iterations,
                 fit->job.optimizer.kind == OPTIMIZER_ADAM ? "Adam" : "gradient descent with momentum",
                 fit->job.loss == LOSS_L1            ? "L1"
                 : fit->job.loss == LOSS_L2          ? "L2"
                 : fit->job.loss == LOSS_RELATIVE_L2 ? "relative L2"
                                                     : "log-L2",
                 out->seconds, out->converged ? ", ended by the stop rule" : "");
    rey_text_html(html, slash ? slash + 1 : fit->job.path);
    rey_text_add(html, ".</p>\n");
}

static rey_result put_page(Fit *fit, const FitResult *out, Text *html) {
    put_head(fit, out, html);
    rey_text_add(html, "<h2>Views</h2>\n");
    rey_result result = rey_report_views(fit, html);
    rey_text_add(html, "<h2>Loss</h2>\n");
    rey_report_loss(fit, html);
    if (!result) {
        result = put_table(fit, out, html);
    }
    if (!result) {
        result = put_machine(fit, out, html);
    }
    rey_text_add(html, "<script>\n");
    rey_text_bytes(html, rey_report_script, strlen(rey_report_script));
    rey_text_add(html, "</script>\n</body></html>\n");
    return result;
}

rey_result rey_report_write(Fit *fit, FitResult *out) {
    Text html = {.ctx = fit->ctx};
    char *page = NULL;
    rey_result result = put_page(fit, out, &html);
    if (!result) {
        result = rey_text_take(&html, &page);
    }
    rey_text_free(&html);
    char *path = result ? NULL : rey_fit_output_path(fit, "report.html");
    if (!result) {
        result = path ? rey_file_write(fit->ctx, path, page, strlen(page)) : REY_ERROR_MEMORY;
    }
    rey_free(fit->ctx, page);
    if (result) {
        rey_free(fit->ctx, path);
    } else {
        out->report = path;
    }
    return result;
}
