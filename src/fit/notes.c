// notes.c: what is not wrong with the unknowns of a job and may be a mistake, told before the first iteration.
#include "fit/fit.h"

#include "render/used.h"

#include <stdio.h>
#include <string.h>

static void note(const Fit *fit, const Unknown *p, const char *what) {
    char words[1024];
    snprintf(words, sizeof words, "parameter '%.400s': %s", p->name, what);
    fit->def->note(fit->def->user, words);
}

// Whether an unknown is a pose whose entries move one by one.
static bool is_free_pose(const Fit *fit, const Unknown *p) {
    const char *name = p->param < 0 ? "" : ARRAY_AT(fit->scene->params, Param, p->param).name, *dot = strrchr(name, '.');
    return dot && !strcmp(dot, ".to_world") && p->parameterisation == PARAMETERISATION_IDENTITY;
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

rey_result rey_fit_note_unknowns(const Fit *fit) {
    for (size_t k = 0; k < fit->unknowns.items.count && fit->def->note; k++) {
        const Unknown *p = &ARRAY_AT(fit->unknowns.items, Unknown, k);
        if (is_free_pose(fit, p)) {
            note(fit, p, "the 16 entries of this pose move freely, and shear it; 'parameterisation: rigid' turns and shifts it, "
                         "'similarity' scales it besides");
        }
    }
    return fit->def->note ? note_unreached(fit) : REY_OK;
}
