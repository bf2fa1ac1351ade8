// report_views.c: the views of a report: the pictures of start and result, and those on the way.
#include "fit/report_parts.h"

#include "io/mitsuba.h"

#include <math.h>
#include <stdio.h>

static const uint32_t REPORT_SET = 0xfffffff0u; // sample sets that no iteration uses

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

// Of a view that was held out: 10 log10 (largest number of the target)^2 / mean (I - R)^2, behind the mask [dB].
static double peak_to_noise(const FitView *view, const float *image) {
    double off = 0, weights = 0, largest = 0;
    for (int64_t i = 0; i < (int64_t)view->width * view->height * 3; i++) {
        double weight = view->mask ? (double)view->mask[i / 3] : 1;
        if (weight > 0) {
            double r = (double)view->target[i], d = (double)image[i] - r;
            off += weight * d * d;
            weights += weight;
            largest = fmax(largest, r);
        }
    }
    return weights > 0 && largest > 0 && off > 0 ? 10 * log10(largest * largest * weights / off) : 0;
}

static rey_result add_held_out(Fit *fit, int view, const float *image, FitResult *out) {
    if (!fit->job.views[view].held_out) {
        return REY_OK;
    }
    FitHeldOut *held = rey_array_push(fit->ctx, &out->held_out, sizeof *held, 1);
    if (!held) {
        return REY_ERROR_MEMORY;
    }
    *held = (FitHeldOut){view, peak_to_noise(&fit->views[view], image)};
    return REY_OK;
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
    rey_text_add(html, "</div></div>\n");
}

static void strip_figure(Text *html, int width, int height, const unsigned char *png, size_t size,
                         const char *caption) {
    rey_text_add(html, "<figure>");
    rey_report_png(html, caption, png, size, width, height, true);
    rey_text_add(html, "<figcaption>%s</figcaption></figure>", caption);
}

static rey_result strip_end(const FitView *view, const float *image, float exposure, const char *caption, Text *html) {
    unsigned char *png;
    size_t size = 0;
    int width, height;
    rey_result result =
        rey_report_thumbnail(html->ctx, image, view->width, view->height, exposure, &png, &size, &width, &height);
    if (!result) {
        strip_figure(html, width, height, png, size, caption);
    }
    rey_free(html->ctx, png);
    return result;
}

// Start, iterations, result. The pictures on the way are those that the iterations rendered for themselves.
static rey_result strip(Fit *fit, int index, float exposure, const float *start, const float *found, Text *html) {
    const FitView *view = &fit->views[index];
    rey_text_add(html, "<div class=\"strip\">");
    rey_result result = strip_end(view, start, exposure, "start", html);
    bool any = false;
    for (int i = 1; i < fit->state.iteration && !result; i++) {
        unsigned char *png = NULL;
        size_t size = 0;
        if (rey_frame_due(fit, i)) {
            result = rey_frame_read(fit, index, i, &png, &size);
        }
        if (png) {
            char caption[32];
            snprintf(caption, sizeof caption, "%d", i);
            strip_figure(html, 160, 160 * view->height / view->width, png, size, caption);
            any = true;
        }
        rey_free(fit->ctx, png);
    }
    if (!result) {
        result = strip_end(view, found, exposure, "result", html);
    }
    rey_text_add(html, any ? "</div>\n<p class=\"note\">The way: pictures after so many iterations, with the few samples of an "
                             "iteration.</p>\n"
                           : "</div>\n");
    return result;
}

static rey_result view_section(Fit *fit, int index, const float *start, const float *found, Text *html) {
    const FitView *view = &fit->views[index];
    float exposure = rey_report_exposure(fit->ctx, view->target, (int64_t)view->width * view->height);
    char caption[112];
    bool held_out = fit->job.views[index].held_out;
    const char *id = rey_mitsuba_sensor_id(fit->scene, view->sensor);
    rey_text_add(html, "<section><h3>View %d%s <span class=\"note\">sensor %d", index, held_out ? ", held out" : "", view->sensor);
    if (id) {
        rey_text_add(html, " \xe2\x80\x98");
        rey_text_html(html, id);
        rey_text_add(html, "\xe2\x80\x99");
    }
    rey_text_add(html, ", %d &times; %d", view->width, view->height);
    if (exposure < 1 || exposure > 1) {
        rey_text_add(html, ", shown at exposure &times;%.3g", (double)exposure);
    }
    rey_text_add(html, "</span></h3>\n");
    comparison(html, index);
    rey_text_add(html, "<div class=\"four\">");
    rey_result result =
        rey_report_figure(html, "target", view->target, view->width, view->height, exposure, "target");
    if (!result) {
        snprintf(caption, sizeof caption, "start, error %.3g&thinsp;%%", 100 * relative_error(view, start));
        result = rey_report_figure(html, "start", start, view->width, view->height, exposure, caption);
    }
    if (!result) {
        int used = snprintf(caption, sizeof caption, "result, error %.3g&thinsp;%%", 100 * relative_error(view, found));
        if (held_out) {
            snprintf(caption + used, sizeof caption - (size_t)used, ", PSNR %.1f&thinsp;dB", peak_to_noise(view, found));
        }
        result = rey_report_figure(html, "result", found, view->width, view->height, exposure, caption);
    }
    if (!result) {
        result = rey_report_difference(html, "result &minus; target", found, view->target, view->mask, view->width,
                                       view->height);
    }
    rey_text_add(html, "</div>\n");
    if (!result) {
        result = strip(fit, index, exposure, start, found, html);
    }
    rey_text_add(html, "</section>\n");
    return result;
}

// Renders every view with the given values, one picture behind the other.
static rey_result render_all(Fit *fit, const float *values, uint32_t set, int spp, float *images) {
    rey_result result = rey_unknowns_apply(&fit->unknowns, fit->scene, values);
    for (int v = 0; v < fit->job.view_count && !result; v++) {
        const FitView *view = &fit->views[v];
        rey_render_def def = rey_fit_finishing_def(fit, view, set, spp);
        result = rey_render(fit->scene, &def, images, NULL);
        rey_exposure_scale(fit, v, rey_exposure_of(fit, v, values), images);
        images += (int64_t)view->width * view->height * 3;
    }
    return result;
}

// A quarter of the samples is enough to see how far off the start is: half of a report's time went into it.
static int start_spp(const Fit *fit) {
    return (fit->job.report_spp + 3) / 4;
}

// With the meshes that the fit began with.
static rey_result render_start(Fit *fit, float *images) {
    if (!fit->state.meshed) {
        return render_all(fit, fit->unknowns.start, REPORT_SET, start_spp(fit), images);
    }
    Fit first = *fit;
    first.scene = NULL;
    first.unknowns = (Unknowns){0};
    rey_result result = rey_fit_open_start(fit, &first.scene, &first.unknowns);
    if (!result) {
        result = render_all(&first, first.unknowns.value, REPORT_SET, start_spp(fit), images);
    }
    rey_unknowns_free(&first.unknowns);
    rey_scene_destroy(first.scene);
    return result;
}

rey_result rey_report_views(Fit *fit, FitResult *out, Text *html) {
    int64_t floats = 0;
    for (int v = 0; v < fit->job.view_count; v++) {
        floats += (int64_t)fit->views[v].width * fit->views[v].height * 3;
    }
    float *start = rey_alloc_array(fit->ctx, (size_t)floats, sizeof *start);
    float *found = rey_alloc_array(fit->ctx, (size_t)floats, sizeof *found);
    rey_result result = start && found ? REY_OK : REY_ERROR_MEMORY;
    if (!result) {
        result = render_start(fit, start);
    }
    if (!result) {
        result = render_all(fit, fit->unknowns.value, REPORT_SET + 1, fit->job.report_spp, found);
    }
    int64_t at = 0;
    for (int v = 0; v < fit->job.view_count && !result; v++) {
        result = add_held_out(fit, v, found + at, out);
        result = result ? result : view_section(fit, v, start + at, found + at, html);
        at += (int64_t)fit->views[v].width * fit->views[v].height * 3;
    }
    rey_text_add(html,
                 "<p class=\"note\">Error of a picture: root of the sum of (I &minus; R)&sup2; over that of R&sup2;, R "
                 "the target, I rendered with %d samples per pixel (the start with %d), whose noise it contains. Differences are "
                 "means of the channels; their scale ends at the 99.5th percentile.%s</p>\n",
                 fit->job.report_spp, start_spp(fit),
                 out->held_out.count ? " PSNR of views that were not fitted: 10 log<sub>10</sub> of the square of the target's "
                                       "largest number over the mean of (I &minus; R)&sup2;." : "");
    rey_free(fit->ctx, start);
    rey_free(fit->ctx, found);
    return result;
}
