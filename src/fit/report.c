// report.c: report.html from its parts.
#include "fit/report_parts.h"
#include "io/file.h"

#include <string.h>

static void put_head(Fit *fit, const FitResult *out, Text *html) {
    static const char *const optimizers[] = {"Adam", "gradient descent with momentum", "L-BFGS"};
    const char *slash = strrchr(fit->job.path, '/'), *scene = strrchr(fit->job.scene, '/');
    rey_text_add(html, "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n"
                       "<meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">\n<title>");
    rey_text_html(html, scene ? scene + 1 : fit->job.scene);
    rey_text_add(html, " &ndash; fit report</title>\n<style>\n");
    rey_text_bytes(html, rey_report_style, strlen(rey_report_style));
    rey_text_add(html, "</style></head><body>\n<h1>Recovering ");
    rey_text_html(html, scene ? scene + 1 : fit->job.scene);
    int fitted = 0;
    for (int v = 0; v < fit->job.view_count; v++) {
        fitted += !fit->job.views[v].held_out;
    }
    rey_text_add(html,
                 " from images</h1>\n<p class=\"lead\">%lld unknown number%s in %d parameter%s, from %d view%s: "
                 "%d iteration%s of %s on the %s loss in %.1f seconds%s. Job ",
                 (long long)out->numbers, PLURAL(out->numbers), (int)out->rows.count, PLURAL(out->rows.count), fitted,
                 PLURAL(fitted), out->iterations, PLURAL(out->iterations),
                 optimizers[fit->job.optimizer.kind],
                 fit->job.loss == LOSS_L1            ? "L1"
                 : fit->job.loss == LOSS_L2          ? "L2"
                 : fit->job.loss == LOSS_RELATIVE_L2 ? "relative L2"
                                                     : "log-L2",
                 out->seconds, out->converged ? ", ended by the stop rule" : "");
    rey_text_html(html, slash ? slash + 1 : fit->job.path);
    rey_text_add(html, ".</p>\n");
    if (out->rose) {
        rey_text_add(html, "<p class=\"lead\"><b>The loss rose</b>, to more than twice what it began with: lower the learning "
                           "rate.</p>\n");
    }
    if (out->falling) {
        rey_text_add(html, "<p class=\"lead\"><b>The loss was still falling</b> when the iterations ended: <code>--resume --set "
                           "iterations=%lld</code> goes on from there.</p>\n", 2 * (long long)out->iterations);
    }
}

static rey_result put_page(Fit *fit, FitResult *out, Text *html) {
    put_head(fit, out, html);
    rey_text_add(html, "<h2>Views</h2>\n");
    rey_text_bytes(html, rey_report_controls, strlen(rey_report_controls));
    rey_result result = rey_report_views(fit, out, html);
    if (!result) {
        result = rey_report_textures(fit, out, html);
    }
    if (!result) {
        result = rey_report_grids(fit, out, html);
    }
    if (!result) {
        rey_report_table(fit, out, html);
        rey_report_histories(fit, out, html);
        rey_text_add(html, "<h2>Loss</h2>\n");
        rey_report_loss(fit, out, html);
        result = rey_report_about(fit, out, html);
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
