// job_check.c: what of a job that reads well does not go together.
#include "fit/job_fields.h"

// Edges are of meshes.
static rey_result check_levels(Job *job) {
    bool meshes = false;
    JobPlace kinds = {0};
    for (int i = 0; i < job->parameter_count; i++) {
        meshes = meshes || job->parameters[i].parameterisation == PARAMETERISATION_LAPLACIAN;
        kinds = rey_job_blame(kinds, rey_job_place_of(job->parameters[i].node, "parameterisation", NULL));
    }
    const YamlNode *levels = rey_yaml_find(job->tree, "levels");
    for (const YamlNode *entry = levels ? levels->child : NULL; entry && !meshes; entry = entry->next) {
        const YamlNode *length = rey_yaml_find(entry, "edge_length");
        if (length) {
            return rey_job_fail_at(job, rey_job_blame(rey_job_place(length), kinds), REY_ERROR_FORMAT,
                                   "edge_length is for parameters of 'parameterisation: laplacian', and the job has none");
        }
    }
    return REY_OK;
}

// Nothing else asks what is seen.
static rey_result check_silhouettes(Job *job) {
    JobPlace at = {0};
    for (int i = 0; i < job->parameter_count; i++) {
        if (job->parameters[i].carve) {
            return REY_OK;
        }
        at = rey_job_blame(at, rey_job_place(rey_yaml_find(job->parameters[i].node, "carve")));
    }
    for (int i = 0; i < job->view_count; i++) {
        if (job->views[i].silhouette) {
            return rey_job_fail_at(job, rey_job_blame(job->views[i].silhouette_at, at), REY_ERROR_FORMAT,
                                   "a silhouette is for parameters with 'carve: true', and the job has none");
        }
    }
    return REY_OK;
}

// Adam alone divides by moments.
static rey_result check_moments(Job *job) {
    for (int i = 0; i < job->parameter_count && job->optimizer.kind != OPTIMIZER_ADAM; i++) {
        const YamlNode *moment = rey_yaml_find(job->parameters[i].node, "moment");
        if (moment) {
            JobPlace kind = rey_job_place_of(rey_yaml_find(job->tree, "optimizer"), "type", NULL);
            return rey_job_fail_at(job, rey_job_blame(rey_job_place(moment), kind), REY_ERROR_FORMAT,
                                   "'moment' is for adam: %s has none", rey_optimizer_name((int)job->optimizer.kind));
        }
    }
    return REY_OK;
}

// A key of an entry (of the job itself, of its optimizer, of a parameter) that lbfgs does not go with.
static rey_result fail_lbfgs(Job *job, const YamlNode *entry, const char *key, const char *why) {
    JobPlace kind = rey_job_place_of(rey_yaml_find(job->tree, "optimizer"), "type", NULL);
    return rey_job_fail_at(job, rey_job_blame(kind, rey_job_place_of(entry, key, NULL)), REY_ERROR_FORMAT, "lbfgs %s", why);
}

// L-BFGS needs one function, and takes its steps by itself.
static rey_result check_lbfgs(Job *job) {
    const YamlNode *optimizer = rey_yaml_find(job->tree, "optimizer");
    if (job->optimizer.kind != OPTIMIZER_LBFGS) {
        return REY_OK;
    }
    if (job->optimizer.schedule.kind != SCHEDULE_CONSTANT) {
        return fail_lbfgs(job, optimizer, "schedule", "finds the lengths of its steps by itself: it has no schedule");
    }
    for (int i = 0; i < job->parameter_count; i++) {
        if (job->parameters[i].parameterisation == PARAMETERISATION_SIMPLEX) {
            return fail_lbfgs(job, job->parameters[i].node, "parameterisation",
                              "does not move what is on a simplex: adam and sgd do");
        }
    }
    if (job->optimizer.average > 0) {
        return fail_lbfgs(job, optimizer, "average", "ends at its best point: it has no average");
    }
    if (job->views_per_iteration && job->views_per_iteration != job->fitted_count) {
        return fail_lbfgs(job, job->tree, "views_per_iteration", "needs all views in every iteration");
    }
    if (job->gradient_spp) {
        return fail_lbfgs(job, job->tree, "gradient_spp",
                          "needs the gradient of the pictures that it compares: it has no gradient_spp");
    }
    return REY_OK;
}

static rey_result check_batches(Job *job) {
    if (job->views_per_iteration <= job->fitted_count) {
        return REY_OK;
    }
    return rey_job_fail(job, rey_yaml_find(job->tree, "views_per_iteration"),
                        "views_per_iteration = %d, but the job has %d view%s%s", job->views_per_iteration, job->fitted_count,
                        PLURAL(job->fitted_count),
                        job->fitted_count == job->view_count ? ""
                        : job->fitted_count == 1             ? " that is not held out"
                                                             : " that are not held out");
}

rey_result rey_job_check(Job *job) {
    rey_result (*const checks[])(Job *job) = {check_levels, check_silhouettes, check_moments, check_lbfgs, check_batches};
    rey_result result = REY_OK;
    for (int i = 0; i < COUNT_OF(checks) && !result; i++) {
        result = checks[i](job);
    }
    return result;
}
