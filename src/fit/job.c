// job.c: job files become Job: every key has one row in a table, so that unknown keys and their neighbours are known.
#include "fit/job_fields.h"

#include "io/file.h"
#include "scene/scene.h"

#include <math.h>
#include <string.h>

NAMES(rey_loss_name, "l1", "l2", "relative_l2", "log_l2")
NAMES(rey_optimizer_name, "adam", "sgd", "lbfgs")
NAMES(rey_schedule_name, "constant", "cosine", "exponential", "step")

// Letters, digits and underscores, the first no digit.
static bool is_name(const char *text) {
    static const char rest[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz_0123456789";
    return *text && !(*text >= '0' && *text <= '9') && !text[strspn(text, rest)];
}

static rey_result read_defines(Job *job, const YamlNode *node, void *target) {
    JobDefines *defines = target;
    if (node->kind != YAML_MAP) {
        bool empty = node->kind == YAML_SCALAR && !(node->text && node->text[0]);
        return empty ? REY_OK : rey_job_fail_kind(job, node, "defines", "'name: value' lines");
    }
    int count = rey_yaml_count(node), i = 0;
    defines->list = rey_job_alloc(job, (size_t)count, sizeof *defines->list);
    defines->at = rey_job_alloc(job, (size_t)count, sizeof *defines->at);
    rey_result result = defines->list && defines->at ? REY_OK : REY_ERROR_MEMORY;
    for (const YamlNode *entry = node->child; entry && !result; entry = entry->next, i++) {
        defines->list[i].name = entry->key;
        defines->at[i] = rey_job_place(entry);
        result = is_name(entry->key) ? rey_job_read_text(job, entry, &defines->list[i].value)
                                     : rey_job_fail(job, entry, "defines: '%s' is not a name, expected letters, digits and _",
                                                  entry->key);
    }
    defines->count = i;
    return result;
}

static rey_result read_spp(Job *job, const YamlNode *node, void *target) {
    static const Field fields[] = {
        {.key = "from", .type = FIELD_INTEGER, .offset = offsetof(JobSpp, from), .high = 1e9, .required = true},
        {.key = "spp",
         .type = FIELD_INTEGER,
         .offset = offsetof(JobSpp, spp),
         .low = 2,
         .high = 65536,
         .required = true},
        {0},
    };
    JobSpp **steps = target;
    if (node->kind == YAML_SCALAR) {
        *steps = rey_job_alloc(job, 1, sizeof **steps);
        job->spp_count = 1;
        return *steps ? rey_job_read_field(job, &fields[1], node, (char *)*steps) : REY_ERROR_MEMORY;
    }
    const YamlNode *odd = node->kind == YAML_LIST ? node->child : node;
    while (odd && odd != node && odd->kind == YAML_MAP) {
        odd = odd->next;
    }
    if (odd) {
        return rey_job_fail_kind(job, odd, "spp", "a number, or a list of {from: ITERATION, spp: NUMBER}");
    }
    void *items;
    rey_result result = rey_job_open_list(job, node, sizeof **steps, &items, &job->spp_count);
    if (result) {
        return result;
    }
    *steps = items;
    int i = 0;
    for (const YamlNode *entry = node->child; entry && !result; entry = entry->next, i++) {
        result = rey_job_read_map(job, entry, "spp", fields, &(*steps)[i]);
        if (!result && (i ? (*steps)[i].from <= (*steps)[i - 1].from : (*steps)[0].from != 0)) {
            result = rey_job_fail_at(job, rey_job_place_of(entry, "from", NULL), REY_ERROR_FORMAT, "from = %d, expected %s",
                                     (*steps)[i].from, i ? "more than in the entry before" : "0 in the first entry");
        }
    }
    return result;
}

static rey_result read_levels(Job *job, const YamlNode *node, void *target) {
    static const Field fields[] = {
        {.key = "from", .type = FIELD_INTEGER, .offset = offsetof(JobLevel, from), .high = 1e9, .required = true},
        {.key = "edge_length", .type = FIELD_REAL, .offset = offsetof(JobLevel, edge_length), .low = 1e-12, .high = 1e12},
        {.key = "reduce", .type = FIELD_INTEGER, .offset = offsetof(JobLevel, reduce), .low = 1, .high = 1024},
        {.key = "resolution", .type = FIELD_INTEGER, .offset = offsetof(JobLevel, resolution), .low = 1, .high = 4096},
        {0},
    };
    JobLevel **levels = target;
    void *items = NULL;
    rey_result result = rey_job_open_list(job, node, sizeof **levels, &items, &job->level_count);
    *levels = items;
    int i = 0;
    for (const YamlNode *entry = node->child; entry && !result; entry = entry->next, i++) {
        (*levels)[i].reduce = 1;
        (*levels)[i].reduce_at = rey_job_place_of(entry, "reduce", NULL);
        (*levels)[i].edge_length_at = rey_job_place_of(entry, "edge_length", NULL);
        (*levels)[i].resolution_at = rey_job_place_of(entry, "resolution", NULL);
        result = rey_job_read_map(job, entry, "levels", fields, &(*levels)[i]);
        if (!result && (i ? (*levels)[i].from <= (*levels)[i - 1].from : (*levels)[0].from != 0)) {
            result = rey_job_fail_at(job, rey_job_place_of(entry, "from", NULL), REY_ERROR_FORMAT, "from = %d, expected %s",
                                     (*levels)[i].from, i ? "more than in the entry before" : "0 in the first entry");
        }
    }
    return result;
}

// By number or by id, as --sensor.
static rey_result read_sensor(Job *job, const YamlNode *node, void *target) {
    static const Field number = {.key = "sensor", .type = FIELD_INTEGER, .offset = offsetof(JobView, sensor), .high = 1e6};
    double value;
    if (rey_job_is_real(node, &value)) {
        return rey_job_read_field(job, &number, node, target);
    }
    bool text = node->kind == YAML_SCALAR && node->text && node->text[0];
    return text ? rey_job_read_text(job, node, &((JobView *)target)->sensor_id)
                : rey_job_fail_kind(job, node, "sensor", "a number from 0 or an id");
}

static rey_result read_views(Job *job, const YamlNode *node, void *target) {
    static const char *const truths[] = {"false", "true", NULL};
    static const Field fields[] = {
        {.key = "sensor", .type = FIELD_READER, .read = read_sensor},
        {.key = "target", .type = FIELD_TEXT, .offset = offsetof(JobView, target), .required = true},
        {.key = "mask", .type = FIELD_TEXT, .offset = offsetof(JobView, mask)},
        {.key = "silhouette", .type = FIELD_TEXT, .offset = offsetof(JobView, silhouette)},
        {.key = "weight", .type = FIELD_REAL, .offset = offsetof(JobView, weight), .low = 1e-9, .high = 1e9},
        {.key = "exposure", .type = FIELD_REAL, .offset = offsetof(JobView, exposure), .low = 1e-9, .high = 1e9},
        {.key = "held_out", .type = FIELD_CHOICE, .offset = offsetof(JobView, held_out), .names = truths},
        {0},
    };
    JobView **views = target;
    void *items = NULL;
    JobPlace held_out = rey_job_place(node);
    rey_result result = rey_job_open_list(job, node, sizeof **views, &items, &job->view_count);
    *views = items;
    int i = 0;
    for (const YamlNode *entry = node->child; entry && !result; entry = entry->next, i++) {
        JobView *view = &(*views)[i];
        *view = (JobView){.sensor = i, .weight = 1, .exposure = 1};
        result = entry->kind == YAML_MAP
                     ? rey_job_read_map(job, entry, "views", fields, view)
                     : rey_job_fail_kind(job, entry, "views", "entries such as {sensor: 0, target: photo.exr}");
        if (!result) {
            view->target_at = rey_job_place(rey_yaml_find(entry, "target"));
            view->sensor_at = rey_job_place_of(entry, "sensor", NULL);
            held_out = rey_job_blame(held_out, rey_job_place_of(entry, "held_out", NULL));
            view->mask_at = rey_job_place(rey_yaml_find(entry, "mask"));
            view->silhouette_at = rey_job_place(rey_yaml_find(entry, "silhouette"));
            job->fitted_count += !view->held_out;
        }
    }
    if (!result && job->fitted_count == 0) {
        return rey_job_fail_at(job, held_out, REY_ERROR_FORMAT, "views: all are held out, expected at least one to fit");
    }
    return result;
}

static rey_result read_loss(Job *job, const YamlNode *node, void *target) {
    static const Field fields[] = {
        {.key = "type", .type = FIELD_CHOICE, .offset = offsetof(Job, loss), .names = rey_loss_name_list},
        {.key = "epsilon", .type = FIELD_REAL, .offset = offsetof(Job, loss_epsilon), .low = 1e-12, .high = 1e6},
        {0},
    };
    UNUSED(target);
    if (node->kind == YAML_SCALAR) {
        return rey_job_read_field(job, fields, node, (char *)job);
    }
    rey_result result = rey_job_read_map(job, node, "loss", fields, job);
    bool has_epsilon = job->loss == LOSS_RELATIVE_L2 || job->loss == LOSS_LOG_L2;
    return result || has_epsilon || !rey_yaml_find(node, "epsilon")
               ? result
               : rey_job_fail_at(job, rey_job_place_of(node, "epsilon", "type"), REY_ERROR_FORMAT,
                                 "'epsilon' is a key of relative_l2 and log_l2, not of %s", rey_loss_name((int)job->loss));
}

// Keys of another kind of schedule, which would be passed over.
static rey_result check_schedule_keys(Job *job, const YamlNode *node, ScheduleKind kind) {
    for (const YamlNode *entry = node->child; entry; entry = entry->next) {
        bool of_falls = !strcmp(entry->key, "end") || !strcmp(entry->key, "length");
        bool of_steps = !strcmp(entry->key, "factor") || !strcmp(entry->key, "every");
        if (kind == SCHEDULE_STEP ? of_falls : kind != SCHEDULE_CONSTANT && of_steps) {
            return rey_job_fail_at(job, rey_job_place_of(node, entry->key, "type"), REY_ERROR_FORMAT,
                                   "'%s' is a key of %s, not of %s", entry->key, of_steps ? "step" : "cosine and exponential",
                                   rey_schedule_name((int)kind));
        }
    }
    return REY_OK;
}

static rey_result read_schedule(Job *job, const YamlNode *node, void *target) {
    static const Field fields[] = {
        {.key = "type",
         .type = FIELD_CHOICE,
         .offset = offsetof(JobSchedule, kind),
         .names = rey_schedule_name_list,
         .required = true},
        {.key = "end", .type = FIELD_REAL, .offset = offsetof(JobSchedule, end), .high = 1},
        {.key = "length", .type = FIELD_INTEGER, .offset = offsetof(JobSchedule, length), .low = 1, .high = 1e9},
        {.key = "factor", .type = FIELD_REAL, .offset = offsetof(JobSchedule, factor), .low = 1e-9, .high = 1},
        {.key = "every", .type = FIELD_INTEGER, .offset = offsetof(JobSchedule, every), .low = 1, .high = 1e9},
        {0},
    };
    if (node->kind == YAML_SCALAR) {
        return rey_job_read_field(job, fields, node, target);
    }
    rey_result result = rey_job_read_map(job, node, "schedule", fields, target);
    return result ? result : check_schedule_keys(job, node, ((const JobSchedule *)target)->kind);
}

// Keys that the optimizer of this kind would pass over. What lbfgs has none of is told where its reason is (check_lbfgs).
static rey_result check_optimizer_keys(Job *job, const YamlNode *node, OptimizerKind kind) {
    static const struct {
        const char *key;
        OptimizerKind owner;
    } owned[] = {{"beta1", OPTIMIZER_ADAM}, {"beta2", OPTIMIZER_ADAM}, {"epsilon", OPTIMIZER_ADAM},
                 {"momentum", OPTIMIZER_SGD}, {"memory", OPTIMIZER_LBFGS}};
    static const char *const keys[] = {"learning_rate, beta1, beta2, epsilon, average and schedule",
                                       "learning_rate, momentum, average and schedule", "learning_rate and memory"};
    for (const YamlNode *entry = node->child; entry; entry = entry->next) {
        for (int i = 0; i < COUNT_OF(owned); i++) {
            if (!strcmp(entry->key, owned[i].key) && kind != owned[i].owner) {
                return rey_job_fail_at(job, rey_job_place_of(node, entry->key, "type"), REY_ERROR_FORMAT,
                                       "'%s' is a key of %s; %s has %s", entry->key, rey_optimizer_name((int)owned[i].owner),
                                       rey_optimizer_name((int)kind), keys[kind]);
            }
        }
    }
    return REY_OK;
}

static rey_result read_optimizer(Job *job, const YamlNode *node, void *target) {
    static const Field fields[] = {
        {.key = "type", .type = FIELD_CHOICE, .offset = offsetof(JobOptimizer, kind), .names = rey_optimizer_name_list},
        {.key = "learning_rate",
         .type = FIELD_REAL,
         .offset = offsetof(JobOptimizer, learning_rate),
         .low = 1e-12,
         .high = 1e12},
        {.key = "beta1", .type = FIELD_REAL, .offset = offsetof(JobOptimizer, beta1), .high = 0.999999},
        {.key = "beta2", .type = FIELD_REAL, .offset = offsetof(JobOptimizer, beta2), .high = 0.99999999},
        {.key = "epsilon", .type = FIELD_REAL, .offset = offsetof(JobOptimizer, epsilon), .low = 1e-30, .high = 1e6},
        {.key = "momentum", .type = FIELD_REAL, .offset = offsetof(JobOptimizer, momentum), .high = 0.999999},
        {.key = "average", .type = FIELD_REAL, .offset = offsetof(JobOptimizer, average), .high = 1e6},
        {.key = "memory", .type = FIELD_INTEGER, .offset = offsetof(JobOptimizer, memory), .low = 1, .high = 64},
        {.key = "schedule", .type = FIELD_READER, .offset = offsetof(JobOptimizer, schedule), .read = read_schedule},
        {0},
    };
    if (node->kind == YAML_SCALAR) {
        return rey_job_read_field(job, fields, node, target);
    }
    rey_result result = rey_job_read_map(job, node, "optimizer", fields, target);
    return result ? result : check_optimizer_keys(job, node, ((const JobOptimizer *)target)->kind);
}

static rey_result read_stop(Job *job, const YamlNode *node, void *target) {
    static const Field fields[] = {
        {.key = "window", .type = FIELD_INTEGER, .offset = offsetof(Job, stop_window), .high = 1e9, .required = true},
        {.key = "tolerance", .type = FIELD_REAL, .offset = offsetof(Job, stop_tolerance), .high = 1},
        {0},
    };
    UNUSED(target);
    return rey_job_read_map(job, node, "stop", fields, job);
}

static rey_result read_reuse(Job *job, const YamlNode *node, void *target) {
    static const Field fields[] = {
        {.key = "within", .type = FIELD_REAL, .offset = offsetof(Job, reuse_within), .low = 1.001, .high = 1e6, .required = true},
        {.key = "effective", .type = FIELD_REAL, .offset = offsetof(Job, reuse_effective), .high = 0.999},
        {0},
    };
    UNUSED(target);
    job->reuse_at = rey_job_place(node);
    return rey_job_read_map(job, node, "reuse", fields, job);
}

static rey_result read_terms(Job *job, const YamlNode *node, void *target) {
    const char *text, *wrong;
    rey_result result = rey_job_read_text(job, node, &text);
    if (result) {
        return result;
    }
    job->terms_at = rey_job_place(node);
    *(int *)target = rey_terms_of(text, &wrong);
    return *(int *)target ? REY_OK
                          : rey_job_fail(job, node, "'%.*s' is no term; expected some of interior,primary,indirect,specular",
                                         (int)strcspn(wrong, ","), wrong);
}

static rey_result read_truth(Job *job, const YamlNode *node, void *target) {
    static const Field fields[] = {
        {.key = "scene", .type = FIELD_TEXT, .offset = offsetof(Job, truth_scene), .required = true},
        {.key = "defines", .type = FIELD_READER, .offset = offsetof(Job, truth_defines), .read = read_defines},
        {0},
    };
    UNUSED(target);
    return rey_job_read_map(job, node, "truth", fields, job);
}

static const Field job_fields[] = {
    {.key = "folder", .type = FIELD_TEXT, .offset = offsetof(Job, folder)},
    {.key = "scene", .type = FIELD_TEXT, .offset = offsetof(Job, scene), .required = true},
    {.key = "load", .type = FIELD_TEXT, .offset = offsetof(Job, load)},
    {.key = "defines", .type = FIELD_READER, .offset = offsetof(Job, defines), .read = read_defines},
    {.key = "output", .type = FIELD_TEXT, .offset = offsetof(Job, output)},
    {.key = "seed", .type = FIELD_SEED, .offset = offsetof(Job, seed), .high = 4294967295.0},
    {.key = "iterations", .type = FIELD_INTEGER, .offset = offsetof(Job, iterations), .high = 1e9},
    {.key = "spp", .type = FIELD_READER, .offset = offsetof(Job, spp), .read = read_spp},
    {.key = "gradient_spp", .type = FIELD_INTEGER, .offset = offsetof(Job, gradient_spp), .high = 65536},
    {.key = "reuse", .type = FIELD_READER, .read = read_reuse},
    {.key = "levels", .type = FIELD_READER, .offset = offsetof(Job, levels), .read = read_levels},
    {.key = "views", .type = FIELD_READER, .offset = offsetof(Job, views), .read = read_views, .required = true},
    {.key = "views_per_iteration", .type = FIELD_INTEGER, .offset = offsetof(Job, views_per_iteration), .high = 1e9},
    {.key = "loss", .type = FIELD_READER, .read = read_loss},
    {.key = "terms", .type = FIELD_READER, .offset = offsetof(Job, terms), .read = read_terms},
    {.key = "optimizer", .type = FIELD_READER, .offset = offsetof(Job, optimizer), .read = read_optimizer},
    {.key = "parameters",
     .type = FIELD_READER,
     .offset = offsetof(Job, parameters),
     .read = rey_job_read_parameters,
     .required = true},
    {.key = "stop", .type = FIELD_READER, .read = read_stop},
    {.key = "checkpoint_every", .type = FIELD_INTEGER, .offset = offsetof(Job, checkpoint_every), .high = 1e9},
    {.key = "checkpoint_seconds", .type = FIELD_REAL, .offset = offsetof(Job, checkpoint_seconds), .high = 1e9},
    {.key = "image_every", .type = FIELD_INTEGER, .offset = offsetof(Job, image_every), .high = 1e9},
    {.key = "report_spp", .type = FIELD_INTEGER, .offset = offsetof(Job, report_spp), .high = 65536},
    {.key = "truth", .type = FIELD_READER, .read = read_truth},
    {0},
};

static rey_result set_defaults(Job *job) {
    const char *slash = strrchr(job->path, '/');
    size_t length = slash ? (size_t)(slash - job->path) + (slash == job->path) : 1;
    char *folder = rey_job_alloc(job, length + 1, 1);
    job->spp = rey_job_alloc(job, 1, sizeof *job->spp);
    if (!folder || !job->spp) {
        return REY_ERROR_MEMORY;
    }
    memcpy(folder, slash ? job->path : ".", length);
    job->folder = folder;
    job->output = "fit";
    job->iterations = 200;
    job->reuse_effective = 0.5;
    job->spp[0].spp = 16;
    job->spp_count = 1;
    job->loss = LOSS_RELATIVE_L2;
    job->loss_epsilon = 0.01;
    job->optimizer = (JobOptimizer){.learning_rate = 0.02,
                                    .beta1 = 0.9,
                                    .beta2 = 0.99,
                                    .epsilon = 1e-12,
                                    .momentum = 0.9,
                                    .memory = 10,
                                    .schedule = {.end = 0.05, .factor = 0.5, .every = 100}};
    job->checkpoint_every = 50;
    job->checkpoint_seconds = 30;
    job->image_every = 50;
    job->report_spp = 64;
    return REY_OK;
}

rey_result rey_job_read_memory(rey_context *ctx, const char *path, const unsigned char *bytes, size_t size,
                               const char *const *overrides, int override_count, Job *job) {
    *job = (Job){.ctx = ctx, .path = path};
    size_t blank = 0;
    while (blank < size && strchr(" \t\r\n\xef\xbb\xbf", bytes[blank]) && bytes[blank]) {
        blank++;
    }
    if (blank < size && bytes[blank] == '<') {
        return rey_fail(ctx, REY_ERROR_FORMAT, "%s: this is XML, as scenes are; expected a job, whose key 'scene' names one", path);
    }
    rey_result result = rey_yaml_read(ctx, path, bytes, size, &job->tree);
    for (int i = 0; i < override_count && !result; i++) {
        result = rey_yaml_override(ctx, job->tree, overrides[i]);
    }
    if (!result) {
        result = set_defaults(job);
    }
    if (!result) {
        result = rey_job_read_map(job, job->tree, "the job", job_fields, job);
    }
    if (!result) {
        const YamlNode *truth = rey_yaml_find(job->tree, "truth");
        job->folder_at = rey_job_place(rey_yaml_find(job->tree, "folder"));
        job->output_at = rey_job_place(rey_yaml_find(job->tree, "output"));
        job->scene_at = rey_job_place(rey_yaml_find(job->tree, "scene"));
        job->load_at = rey_job_place(rey_yaml_find(job->tree, "load"));
        job->truth_at = rey_job_place(truth ? rey_yaml_find(truth, "scene") : NULL);
    }
    job->optimizer.schedule.length_given = job->optimizer.schedule.length != 0;
    if (!result && !job->optimizer.schedule.length) {
        job->optimizer.schedule.length = job->iterations ? job->iterations : 1;
    }
    return result ? result : rey_job_check(job);
}

rey_result rey_job_read(rey_context *ctx, const char *path, const char *const *overrides, int override_count,
                        Job *job) {
    unsigned char *bytes;
    size_t size;
    *job = (Job){.ctx = ctx};
    rey_result result = rey_file_read(ctx, path, &bytes, &size);
    if (!result) {
        result = rey_job_read_memory(ctx, path, bytes, size, overrides, override_count, job);
    }
    rey_free(ctx, bytes);
    return result;
}
