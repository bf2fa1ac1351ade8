// derivatives.c: whether the unknowns have the gradients that a fit needs, asked before the first iteration.
#include "fit/fit.h"

#include "render/term_request.h"
#include "render/update.h"

#include <stdio.h>
#include <string.h>

// What a view cannot do for a parameter, in the words of `reynolds grad`, at its entry of the job.
static rey_result refuse(const Fit *fit, const Unknown *unknown, rey_result result) {
    char why[1024];
    snprintf(why, sizeof why, "%s", rey_error(fit->ctx));
    if (result == REY_ERROR_MEMORY) {
        return result;
    }
    JobPlace at = rey_job_place_of(fit->job.parameters[unknown->entry].node, "name", NULL);
    return rey_job_fail_at(&fit->job, at, REY_ERROR_PARAM, "parameter '%s': %s%s", unknown->name, why,
                           strstr(why, "--terms interior") ? " (in a job, 'terms: interior')" : "");
}

static rey_result check_view(Fit *fit, int view) {
    rey_render_def def = rey_default_render_def();
    def.sensor = fit->views[view].sensor;
    def.terms = fit->job.terms;
    def.estimator = fit->job.reuse_within > 0 ? REY_ESTIMATOR_SCORE : REY_ESTIMATOR_PROBE;
    rey_selection all = {fit->unknowns.params, fit->unknowns.param_count};
    if (!all.count || rey_derivative_check(fit->scene, &def, all) == REY_OK) {
        return REY_OK;
    }
    for (size_t k = 0; k < fit->unknowns.items.count; k++) {
        const Unknown *p = &ARRAY_AT(fit->unknowns.items, Unknown, k);
        rey_result result = p->param < 0 ? REY_OK : rey_derivative_check(fit->scene, &def, (rey_selection){&p->param, 1});
        if (result) {
            return refuse(fit, p, result);
        }
    }
    return rey_derivative_check(fit->scene, &def, all); // only together
}

rey_result rey_fit_check_derivatives(Fit *fit) {
    rey_result result = rey_scene_update(fit->scene);
    for (int v = 0; v < fit->job.view_count && !result; v++) {
        bool asked = fit->job.views[v].held_out;
        for (int w = 0; w < v && !asked; w++) {
            asked = !fit->job.views[w].held_out && fit->views[w].sensor == fit->views[v].sensor;
        }
        result = asked ? REY_OK : check_view(fit, v);
    }
    return result;
}
