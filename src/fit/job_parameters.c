// job_parameters.c: the unknowns that a job names: bounds, start, parameterisation, regularisers.
#include "fit/job_fields.h"

#include <math.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

NAMES(rey_parameterisation_name, "identity", "log", "logit", "softplus", "rigid", "similarity", "laplacian",
      "scattering", "simplex")
NAMES(rey_moment_name, "per_entry", "shared", "uniform")

static rey_result read_bound(Job *job, const YamlNode *node, double *out) {
    bool text = node->kind == YAML_SCALAR && node->text;
    if (text && (!strcmp(node->text, ".inf") || !strcmp(node->text, "-.inf"))) {
        *out = node->text[0] == '-' ? -INFINITY : INFINITY;
        return REY_OK;
    }
    return rey_job_read_real(job, node, "bounds", -1e30, 1e30, out);
}

static rey_result read_bounds(Job *job, const YamlNode *node, void *target) {
    double *bounds = target;
    if (node->kind != YAML_LIST || rey_yaml_count(node) != 2) {
        return rey_job_fail_kind(job, node, "bounds", "[low, high]");
    }
    rey_result result = read_bound(job, node->child, &bounds[0]);
    if (!result) {
        result = read_bound(job, node->child->next, &bounds[1]);
    }
    if (!result && !(bounds[0] < bounds[1])) {
        result = rey_job_fail(job, rey_job_blamed(node), "bounds: %g is not below %g", bounds[0], bounds[1]);
    }
    return result;
}

static rey_result read_start(Job *job, const YamlNode *node, void *target) {
    JobParameter *parameter = target;
    double value;
    static const char *const infinite[] = {"nan", ".nan", "inf", ".inf", "-inf", "-.inf", "infinity", "-infinity"};
    for (int i = 0; i < COUNT_OF(infinite) && node->kind == YAML_SCALAR && node->text; i++) {
        if (!strcasecmp(node->text, infinite[i])) {
            return rey_job_fail(job, node, "start: %s, expected a finite number; a file of this name is './%s'", node->text,
                                node->text);
        }
    }
    if (node->kind == YAML_SCALAR && !rey_job_is_real(node, &value)) {
        return rey_job_read_text(job, node, &parameter->start_file);
    }
    int count = node->kind == YAML_LIST ? rey_yaml_count(node) : 1;
    if (node->kind == YAML_MAP || count < 1) {
        return rey_job_fail_kind(job, node, "start", "a number, a list of numbers, or a file");
    }
    double *values = rey_job_alloc(job, (size_t)count, sizeof *values);
    rey_result result = values ? REY_OK : REY_ERROR_MEMORY;
    const YamlNode *entry = node->kind == YAML_LIST ? node->child : node;
    for (int i = 0; i < count && !result; i++, entry = entry->next) {
        result = rey_job_read_real(job, entry, "start", -1e30, 1e30, &values[i]);
    }
    parameter->start = values;
    parameter->start_count = count;
    return result;
}

#define WEIGHT(name, member) {.key = #name, .type = FIELD_REAL, .offset = offsetof(JobParameter, member.name), .high = 1e12}
static rey_result read_regularisers(Job *job, const YamlNode *node, void *target) {
    static const Field fields[] = {
        WEIGHT(laplacian, regularisers),
        WEIGHT(edge_length, regularisers),
        WEIGHT(normals, regularisers),
        WEIGHT(total_variation, grid_regularisers),
        WEIGHT(sparsity, grid_regularisers),
        {0},
    };
    return rey_job_read_map(job, node, "regularisers", fields, target);
}
#undef WEIGHT

// Those of meshes are for meshes, those of grids for all others.
static rey_result check_regularisers(Job *job, const YamlNode *node, bool laplacian) {
    static const char *const of_grids[] = {"total_variation", "sparsity"};
    const YamlNode *given = rey_yaml_find(node, "regularisers");
    for (const YamlNode *one = given ? given->child : NULL; one; one = one->next) {
        bool grid = !strcmp(one->key, of_grids[0]) || !strcmp(one->key, of_grids[1]);
        if (grid == laplacian) {
            JobPlace at = rey_job_blame(rey_job_place(one), rey_job_place(rey_yaml_find(node, "parameterisation")));
            return rey_job_fail_at(job, at, REY_ERROR_FORMAT,
                                   laplacian ? "%s is for grids" : "%s is for 'parameterisation: laplacian'", one->key);
        }
    }
    return REY_OK;
}

// A key that does not go with the parameterisation.
static rey_result fail_with(Job *job, const YamlNode *entry, const char *key, const char *why) {
    return rey_job_fail_at(job, rey_job_place_of(entry, key, "parameterisation"), REY_ERROR_FORMAT, "%s", why);
}

// What is said of laplacian alone, and what depends on it.
static rey_result finish_parameter(Job *job, const YamlNode *node, JobParameter *p) {
    bool laplacian = p->parameterisation == PARAMETERISATION_LAPLACIAN;
    if (rey_yaml_find(node, "smoothness") && !laplacian) {
        return fail_with(job, node, "smoothness", "smoothness is for 'parameterisation: laplacian'");
    }
    rey_result result = check_regularisers(job, node, laplacian);
    if (result) {
        return result;
    }
    bool scattering = p->parameterisation == PARAMETERISATION_SCATTERING;
    bool simplex = p->parameterisation == PARAMETERISATION_SIMPLEX;
    bool pose = p->parameterisation == PARAMETERISATION_RIGID || p->parameterisation == PARAMETERISATION_SIMILARITY;
    if ((laplacian || scattering || simplex || pose) && !isnan(p->bounds[0])) {
        char why[64];
        snprintf(why, sizeof why, "parameterisation %s has no bounds", rey_parameterisation_name((int)p->parameterisation));
        return fail_with(job, node, "bounds", why);
    }
    if (scattering && rey_yaml_find(node, "start")) {
        return fail_with(job, node, "start", "parameterisation scattering starts with what the scene has");
    }
    if (!scattering && rey_yaml_find(node, "g")) {
        return fail_with(job, node, "g", "g is for 'parameterisation: scattering'");
    }
    if (p->moment == MOMENT_COUNT) {
        p->moment = laplacian ? MOMENT_UNIFORM : simplex ? MOMENT_SHARED : MOMENT_PER_ENTRY;
    }
    return REY_OK;
}

rey_result rey_job_read_parameters(Job *job, const YamlNode *node, void *target) {
    static const char *const of_g[] = {"free", "known", NULL}, *const truths[] = {"false", "true", NULL};
    static const Field fields[] = {
        {.key = "name", .type = FIELD_TEXT, .offset = offsetof(JobParameter, name), .required = true},
        {.key = "learning_rate",
         .type = FIELD_REAL,
         .offset = offsetof(JobParameter, learning_rate),
         .low = 1e-12,
         .high = 1e12},
        {.key = "bounds", .type = FIELD_READER, .offset = offsetof(JobParameter, bounds), .read = read_bounds},
        {.key = "parameterisation",
         .type = FIELD_CHOICE,
         .offset = offsetof(JobParameter, parameterisation),
         .names = rey_parameterisation_name_list},
        {.key = "moment",
         .type = FIELD_CHOICE,
         .offset = offsetof(JobParameter, moment),
         .names = rey_moment_name_list},
        {.key = "start", .type = FIELD_READER, .offset = 0, .read = read_start},
        {.key = "carve", .type = FIELD_CHOICE, .offset = offsetof(JobParameter, carve), .names = truths},
        {.key = "g", .type = FIELD_CHOICE, .offset = offsetof(JobParameter, known_g), .names = of_g},
        {.key = "smoothness", .type = FIELD_REAL, .offset = offsetof(JobParameter, smoothness), .high = 1e9},
        {.key = "regularisers",
         .type = FIELD_READER,
         .read = read_regularisers},
        {0},
    };
    JobParameter **parameters = target;
    void *items = NULL;
    rey_result result = rey_job_open_list(job, node, sizeof **parameters, &items, &job->parameter_count);
    *parameters = items;
    int i = 0;
    for (const YamlNode *entry = node->child; entry && !result; entry = entry->next, i++) {
        (*parameters)[i] = (JobParameter){.bounds = {NAN, NAN}, .moment = MOMENT_COUNT, .smoothness = 19, .node = entry};
        result = entry->kind == YAML_SCALAR // a name alone
                     ? rey_job_read_field(job, fields, entry, (char *)&(*parameters)[i])
                     : rey_job_read_map(job, entry, "parameters", fields, &(*parameters)[i]);
        if (!result) {
            result = finish_parameter(job, entry, &(*parameters)[i]);
        }
    }
    return result;
}
