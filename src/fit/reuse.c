// reuse.c: paths recorded at one point of the unknowns and reweighted at others [gkioulekas2013].
#include "fit/reuse.h"

#include "render/particles.h"
#include "render/replay.h"

#include <math.h>
#include <stdio.h>

static const double MOST_OUTSIDE = 0.01; // of the throughput, along vertices whose weight is out of range
static const double MOST_HEADROOM = 4;   // tracking takes so many times as many steps

static rey_result refuse(const Fit *fit, const Unknown *p, const char *why) {
    JobPlace at = rey_job_blame(rey_job_place_of(fit->job.parameters[p->entry].node, "name", NULL), fit->job.reuse_at);
    return rey_job_fail_at(&fit->job, at, REY_ERROR_PARAM, "reuse: parameter '%s' %s", p->name, why);
}

// Whether it is an extinction that steps may make 0, where nothing collides.
static bool may_vanish(const rey_scene *scene, const Unknown *p) {
    const SceneView *view = &scene->view;
    const int64_t theta = ARRAY_AT(scene->params, Param, p->param).theta;
    bool extinction = false;
    for (int64_t i = 0; i < view->media_count; i++) {
        const MediumNode *medium = view->media + i;
        extinction |= theta == medium->scale;
        extinction |= rey_medium_reads(view, medium, ARRAY_AT(scene->params, Param, p->param).texture);
    }
    bool positive = p->low > 0 || p->parameterisation == PARAMETERISATION_SCATTERING;
    return extinction && !positive;
}

static rey_result check(const Fit *fit) {
    const Job *job = &fit->job;
    if (job->level_count) {
        return rey_job_fail_at(job, job->reuse_at, REY_ERROR_PARAM, "reuse: paths are not reused between levels; expected a job "
                               "without 'levels'");
    }
    if (rey_traces_particles(fit->scene) || fit->scene->view.drops) {
        return rey_job_fail_at(job, job->reuse_at, REY_ERROR_PARAM, "reuse: paths of %s are not reused; 'volpath' has such",
                               rey_traces_particles(fit->scene) ? "'ptracer'" : "'path' with hide_emitters");
    }
    for (size_t k = 0; k < fit->unknowns.items.count; k++) {
        const Unknown *p = &ARRAY_AT(fit->unknowns.items, Unknown, k);
        if (p->param < 0) { // an exposure
            continue;
        }
        if (!rey_can_replay(fit->scene, p->param)) {
            return refuse(fit, p, "decides where paths go or what they can see, so that they cannot be reused when it changes; "
                                  "expected numbers of materials, media and lights that move nothing, nor ends of refraction");
        }
        if (may_vanish(fit->scene, p)) {
            return refuse(fit, p, "may become 0, where no path collides; expected 'parameterisation: log', or bounds above 0");
        }
    }
    return REY_OK;
}

rey_result rey_reuse_open(Fit *fit) {
    if (!(fit->job.reuse_within > 0)) {
        return REY_OK;
    }
    rey_result result = check(fit);
    if (!result) {
        result = rey_fit_load_scene(fit, 0, &fit->sampling);
    }
    if (!result) { // of the media that change, from then on
        fit->sampling->headroom = (float)fmin(fit->job.reuse_within, MOST_HEADROOM);
    }
    return result;
}

bool rey_reuse_stale(const Fit *fit) {
    bool older = fit->sampling && fit->state.recorded <= fit->state.iteration; // where they are recorded, all weights are 1
    return older && (fit->outside > MOST_OUTSIDE || fit->effective < fit->job.reuse_effective);
}

static void forget(Fit *fit) {
    fit->outside = 0;
    fit->effective = 1;
}

// At the values of the unknowns.
static rey_result record(Fit *fit) {
    Unknowns *u = &fit->unknowns;
    for (int64_t i = 0; i < u->count; i++) {
        u->reference[i] = u->value[i];
    }
    fit->state.recorded = fit->state.iteration + 1;
    forget(fit);
    return rey_unknowns_apply(u, fit->sampling, u->reference);
}

rey_result rey_reuse_begin(Fit *fit) {
    forget(fit);
    return fit->sampling && !fit->state.recorded ? record(fit) : REY_OK;
}

rey_result rey_reuse_renew(Fit *fit) {
    bool anew = rey_optimizer_leap(&fit->job.optimizer, &fit->unknowns);
    rey_result result = rey_unknowns_apply(&fit->unknowns, fit->scene, fit->unknowns.value);
    forget(fit);
    return result || !anew ? result : record(fit);
}

rey_result rey_reuse_resume(Fit *fit) {
    bool recorded = fit->sampling && fit->state.recorded;
    return recorded ? rey_unknowns_apply(&fit->unknowns, fit->sampling, fit->unknowns.reference) : REY_OK;
}

int rey_reuse_iteration(const Fit *fit) { return fit->sampling ? fit->state.recorded - 1 : fit->state.iteration; }

rey_result rey_reuse_render(Fit *fit, const rey_render_def *def, float *image, rey_stats *stats) {
    ReplayWeights w = {0};
    rey_result result = rey_replay_weighed(fit->sampling, fit->scene, def, fit->job.reuse_within, image, &w, stats);
    if (!result && w.all > 0) {
        double effective = w.square > 0 ? w.now * w.now / (w.then * w.square) : 0;
        fit->outside = fmax(fit->outside, 1 - w.within / w.all);
        fit->effective = fmin(fit->effective, effective);
    }
    return result;
}
