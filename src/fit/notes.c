// notes.c: what is not wrong with a job and may be a mistake, told before the first iteration.
#include "fit/fit.h"

#include "render/facing.h"
#include "render/used.h"
#include "scene/names.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static void note(const Fit *fit, const Unknown *p, const char *what) {
    char words[1024];
    snprintf(words, sizeof words, "parameter '%.400s': %s", p->name, what);
    fit->def->note(fit->def->user, words);
}

// Whether an unknown is a pose whose entries move one by one.
static bool is_free_pose(const Fit *fit, const Unknown *p) {
    const char *name = p->param < 0 ? "" : ARRAY_AT(fit->scene->params, Param, p->param).name;
    return rey_name_is_pose(name) && p->parameterisation == PARAMETERISATION_IDENTITY;
}

// What no view that is fitted depends on stays where it starts.
static rey_result note_unreached(const Fit *fit) {
    size_t count = fit->scene->params.count;
    bool *any = rey_alloc_array(fit->ctx, count, sizeof *any), *reached = rey_alloc_array(fit->ctx, count, sizeof *reached);
    rey_result result = any && reached ? REY_OK : REY_ERROR_MEMORY;
    for (int v = 0; v < fit->job.view_count && !result; v++) {
        result = fit->job.views[v].held_out ? REY_OK : rey_params_reached(fit->scene, fit->views[v].sensor, reached);
        for (size_t i = 0; i < count && !fit->job.views[v].held_out; i++) {
            any[i] = any[i] || reached[i];
        }
    }
    for (size_t k = 0; k < fit->unknowns.items.count && !result; k++) {
        const Unknown *p = &ARRAY_AT(fit->unknowns.items, Unknown, k);
        if (p->param >= 0 && !any[p->param]) {
            bool camera = ARRAY_AT(fit->scene->params, Param, p->param).camera >= 0;
            note(fit, p, camera ? "no view that is fitted has this sensor, so that its gradient is 0"
                                : "no view that is fitted depends on it, so that its gradient is 0");
        }
    }
    rey_free(fit->ctx, any);
    rey_free(fit->ctx, reached);
    return result;
}

// A relative loss weighs what is black by 1 / epsilon^2, and so what noise there is.
static void note_black(const Fit *fit) {
    int64_t count = 0, black = 0;
    for (int v = 0; v < fit->job.view_count; v++) {
        const FitView *view = fit->views + v;
        for (int64_t i = 0; !fit->job.views[v].held_out && i < (int64_t)view->full_width * view->full_height; i++) {
            const float *rgb = view->full_target + 3 * i;
            bool seen = !view->full_mask || view->full_mask[i] > 0;
            count += seen;
            black += seen && rgb[0] == 0 && rgb[1] == 0 && rgb[2] == 0;
        }
    }
    if (fit->job.loss == LOSS_RELATIVE_L2 && 10 * black > count) {
        char words[256];
        snprintf(words, sizeof words, "%.0f %% of the targets' pixels are black, which 'relative_l2' weighs most: 'l2', 'log_l2' "
                                      "or a mask may lead farther", 100.0 * (double)black / (double)count);
        fit->def->note(fit->def->user, words);
    }
}

// Numbers of a target that no photograph has, and a pixel that alone decides the loss. Held-out views are looked at as well: the
// report judges by them.
static void note_target(const Fit *fit, int number) {
    static const double most_share = 0.9; // of the sum of squares
    const FitView *view = fit->views + number;
    int64_t pixels = (int64_t)view->full_width * view->full_height, negative = 0, brightest = 0;
    double squares = 0, most = 0, top = 0; // of all pixels, of the brightest one, and the largest number there
    for (int64_t i = 0; i < pixels; i++) {
        double own = 0, largest = 0;
        for (int c = 0; c < 3 && (!view->full_mask || view->full_mask[i] > 0); c++) {
            double value = (double)view->full_target[3 * i + c];
            negative += value < 0;
            own += value * value;
            largest = fabs(value) > fabs(largest) ? value : largest;
        }
        squares += own;
        if (own > most) {
            most = own;
            top = largest;
            brightest = i;
        }
    }
    const char *name = fit->job.views[number].target;
    char words[1024];
    if (negative > 0) {
        snprintf(words, sizeof words, "view %d: %lld of the %lld numbers of %.500s are negative, which no light is", number,
                 (long long)negative, (long long)(3 * pixels), name);
        fit->def->note(fit->def->user, words);
    }
    if (pixels > 1 && most > most_share * squares) {
        snprintf(words, sizeof words, "view %d: %.500s is %g at pixel %d, %d, and next to nothing elsewhere: this pixel alone "
                                      "decides an 'l2' loss; a mask leaves it out", number, name, top,
                 (int)(brightest % view->full_width), (int)(brightest / view->full_width));
        fit->def->note(fit->def->user, words);
    }
    if (view->translucent) {
        snprintf(words, sizeof words, "view %d: the colours of %.500s are divided by its alpha, which is left out; an EXR holds "
                                      "what a camera sees", number, name);
        fit->def->note(fit->def->user, words);
    }
}

// Terms that the job leaves out of gradients which need them, in the words of `reynolds grad`.
static void note_terms(const Fit *fit) {
    const char *first = NULL;
    int missing = 0, count = 0;
    for (size_t k = 0; k < fit->unknowns.items.count && fit->job.terms; k++) {
        const Unknown *p = &ARRAY_AT(fit->unknowns.items, Unknown, k);
        int needed = p->param < 0 ? 0 : ARRAY_AT(fit->scene->params, Param, p->param).terms;
        int left = rey_terms_stated(fit->scene, fit->views[0].sensor, needed) & ~fit->job.terms & ~REY_TERM_MEDIUM;
        first = left && !first ? p->name : first;
        missing |= left;
        count += left != 0;
    }
    if (missing) {
        char asked[128], lacks[128], words[1024], more[32] = "";
        rey_job_terms_text(fit->job.terms, asked, sizeof asked);
        rey_job_terms_text(missing, lacks, sizeof lacks);
        if (count > 1) {
            snprintf(more, sizeof more, " and %d more", count - 1);
        }
        snprintf(words, sizeof words, "incomplete on request: 'terms: %s' leaves out %s, which the gradient%s of %.400s%s need%s",
                 asked, lacks, PLURAL(count), first, more, count == 1 ? "s" : "");
        fit->def->note(fit->def->user, words);
    }
}

// A result that a bound holds back may lie beyond it, or say that the scene lacks something.
static void note_bounds(const Fit *fit, const Unknown *p) {
    const float *found = fit->unknowns.value + p->offset;
    int64_t held = 0;
    for (int64_t i = 0; i < p->count; i++) {
        held += found[i] <= (float)p->low || found[i] >= (float)p->high;
    }
    if (held > 0 && p->driven && p->count <= HISTORY_LARGEST) { // of textures' texels, some often are
        char words[256], which[64] = "it";
        if (p->count > 1) {
            snprintf(which, sizeof which, "%lld of its %lld numbers", (long long)held, (long long)p->count);
        }
        snprintf(words, sizeof words, "%s ended at a bound of [%g, %g]", which, p->low, p->high);
        note(fit, p, words);
    }
}

void rey_fit_note_ends(const Fit *fit) {
    for (size_t k = 0; k < fit->unknowns.items.count && fit->def->note && fit->state.iteration > fit->first; k++) {
        const Unknown *p = &ARRAY_AT(fit->unknowns.items, Unknown, k);
        const float *start = fit->unknowns.start + p->offset, *found = fit->unknowns.value + p->offset;
        if (!p->driven && !memcmp(start, found, (size_t)p->count * sizeof *start)) {
            note(fit, p, "its gradient was 0 in every iteration, and it is where it started");
        }
        note_bounds(fit, p);
    }
}

rey_result rey_fit_notes(const Fit *fit) {
    static const double rounding = 1e-4;
    if (!fit->def->note) {
        return REY_OK;
    }
    for (int v = 0; v < fit->job.view_count; v++) {
        note_target(fit, v);
    }
    for (size_t k = 0; k < fit->unknowns.items.count; k++) {
        const Unknown *p = &ARRAY_AT(fit->unknowns.items, Unknown, k);
        if (p->parameterisation == PARAMETERISATION_SIMPLEX && fabs(p->sum - 1) > rounding) {
            char words[128];
            snprintf(words, sizeof words, "the shares of the start summed up to %g, and were divided by that: the sum of a simplex "
                     "is 1", p->sum);
            note(fit, p, words);
        }
        if (is_free_pose(fit, p)) {
            note(fit, p, "the 16 entries of this pose move freely, and shear it; 'parameterisation: rigid' turns and shifts it, "
                         "'similarity' scales it besides");
        }
    }
    note_terms(fit);
    note_black(fit);
    return note_unreached(fit);
}
