// job.h: what a fit job file says.
#pragma once

#include "fit/voxels.h"
#include "fit/vertices.h"
#include "fit/yaml.h"

typedef enum LossKind { LOSS_L1, LOSS_L2, LOSS_RELATIVE_L2, LOSS_LOG_L2, LOSS_COUNT } LossKind;
typedef enum OptimizerKind { OPTIMIZER_ADAM, OPTIMIZER_SGD, OPTIMIZER_LBFGS, OPTIMIZER_COUNT } OptimizerKind;
typedef enum ScheduleKind {
    SCHEDULE_CONSTANT,
    SCHEDULE_COSINE,
    SCHEDULE_EXPONENTIAL,
    SCHEDULE_STEP,
    SCHEDULE_COUNT
} ScheduleKind;
typedef enum Parameterisation {
    PARAMETERISATION_IDENTITY,
    PARAMETERISATION_LOG,
    PARAMETERISATION_LOGIT,
    PARAMETERISATION_SOFTPLUS,
    PARAMETERISATION_RIGID, // of poses: a rotation vector and a shift from the start
    PARAMETERISATION_SIMILARITY, // and a scale
    PARAMETERISATION_LAPLACIAN, // of meshes: preconditioned vertices
    PARAMETERISATION_SCATTERING, // of media: absorption, reduced scattering and mean cosine
    PARAMETERISATION_SIMPLEX, // shares whose sum is 1, multiplied by exponentials of gradients
    PARAMETERISATION_COUNT
} Parameterisation;
typedef enum MomentKind { MOMENT_PER_ENTRY, MOMENT_SHARED, MOMENT_UNIFORM, MOMENT_COUNT } MomentKind;

typedef struct JobPlace { // of an entry of the job
    int line;             // 0 = it comes from
    const char *set;      // this override
} JobPlace;

typedef struct JobView {
    int sensor;            // of the scene, unless there is an id
    const char *sensor_id; // id or name of the sensor, null = by number
    const char *target; // picture file
    const char *mask;   // picture file of weights, null = 1 everywhere
    const char *silhouette; // picture file that is above 0 where something is seen, null = none (carve.h)
    double weight;      // of this view in the loss
    double exposure;    // of the target: what is rendered is multiplied with it; the start where it is unknown
    int held_out;       // not fitted: the report says how well it is predicted
    JobPlace sensor_at, target_at, mask_at, silhouette_at;
} JobView;

typedef struct JobParameter {
    const char *name;     // may hold * for any text
    double learning_rate; // 0 = the optimizer's
    double bounds[2];     // NaN = the parameter's own range
    Parameterisation parameterisation;
    MomentKind moment;
    double smoothness;         // of laplacian: lambda
    Regularisers regularisers; // of laplacian
    GridRegularisers grid_regularisers; // of the others, which must be grids if any is above 0
    int carve;              // of grids: what some silhouette sees nothing of stays empty
    int known_g;            // of scattering: the mean cosine stays what it is
    const double *start;    // values, null = none
    int start_count;        // 1 = the same for every entry
    const char *start_file; // picture file, null = none
    const YamlNode *node;   // its entry
} JobParameter;

typedef struct JobSpp { // samples per pixel from this iteration on
    int from, spp;
} JobSpp;

typedef struct JobLevel { // from coarse to fine, from this iteration on
    int from;
    int reduce;         // every picture is so many times smaller in width and height
    double edge_length; // to which meshes are remeshed as it begins [scene units], 0 = they stay
    int resolution;     // cells along the longest axis that grids are resampled to as it begins, 0 = they stay
    JobPlace reduce_at, edge_length_at, resolution_at;
} JobLevel;

typedef struct JobSchedule { // factor of every learning rate at iteration i
    ScheduleKind kind;       // cosine: from 1 to `end` over `length`; exponential: end^(i / length);
    double end;              // step: factor^floor(i / every)
    int length;
    bool length_given; // else it follows the iterations
    double factor;
    int every;
} JobSchedule;

typedef struct JobOptimizer {
    OptimizerKind kind;
    double learning_rate, beta1, beta2, epsilon, momentum;
    double average; // what is found is a mean that weighs iteration t with t^average; 0 = the last iteration's values
    int memory;     // pairs of L-BFGS
    JobSchedule schedule;
} JobOptimizer;

typedef struct JobDefines { // values of $names in a scene file
    rey_define *list;
    JobPlace *at;
    int count;
} JobDefines;

typedef struct Job {
    rey_context *ctx;
    const char *path;   // of the job file
    const char *folder; // that paths are relative to
    const char *scene, *truth_scene, *output;
    const char *load; // scene file whose values the scene gets, or null
    JobPlace folder_at, output_at, scene_at, truth_at, load_at, terms_at;
    JobDefines defines, truth_defines; // the truth gets those of the job where it has none of its own
    uint32_t seed;
    int iterations, views_per_iteration; // 0 = all views
    int checkpoint_every, image_every;   // 0 = never
    double checkpoint_seconds;           // and after so much time, 0 = never
    int report_spp;                      // 0 = no report
    JobSpp *spp;
    int spp_count;
    double reuse_within;    // paths serve several iterations while their weights are within this factor of 1; 0 = each has its own
    double reuse_effective; // and while they are worth at least this share of as many fresh ones
    JobPlace reuse_at;
    int gradient_spp; // of samples of their own that pull the loss's derivative back, 0 = the pictures' samples do
    JobLevel *levels; // none = one level of full pictures
    int level_count;
    JobView *views;
    int view_count;
    int fitted_count; // of those that are not held out
    LossKind loss;
    double loss_epsilon;
    int terms; // REY_TERM_ bits that gradients may be made of; 0 = all that they need, or none at all
    JobOptimizer optimizer;
    JobParameter *parameters;
    int parameter_count;
    int stop_window; // 0 = run through
    double stop_tolerance;
    YamlNode *tree; // owns the texts
    Array memory;   // everything else that was allocated, as pointers
} Job;

// Reads a job with overrides ("key=value"). Errors read "job.yaml:12: ...". The caller frees *job with rey_job_free,
// also after a failure.
rey_result rey_job_read(rey_context *ctx, const char *path, const char *const *overrides, int override_count, Job *job);
void rey_job_free(Job *job);
// The same from memory.
rey_result rey_job_read_memory(rey_context *ctx, const char *path, const unsigned char *bytes, size_t size,
                               const char *const *overrides, int override_count, Job *job);

// Of two places that do not go together the one that an override set, else the first.
JobPlace rey_job_blame(JobPlace first, JobPlace second);
// That of the values of two keys (null: none) of an entry; where it has neither, its own.
JobPlace rey_job_place_of(const YamlNode *entry, const char *key, const char *other);

// Records what is wrong with an entry: "job.yaml:12: ...", of an override "--set key=value: ...", which is no failure of the
// job but of the command (REY_ERROR_ARGUMENT), unless it names a file that cannot be read.
rey_result rey_job_fail_at(const Job *job, JobPlace at, rey_result code, const char *format, ...) PRINTF_LIKE(4, 5);

// Puts the place that named a file before why it could not be read (of an override also before what is wrong in it: it may be
// another kind of file); passes every result on.
rey_result rey_job_named_file(const Job *job, JobPlace at, rey_result result);

// The same for a scene that these defines were given to: one that it never uses, or whose value the message quotes, is told at
// its own place.
rey_result rey_job_named_scene(const Job *job, JobPlace at, const JobDefines *defines, rey_result result);

// Path of a file that the job names; owned by the job, null (and a recorded message) when memory runs out.
const char *rey_job_path(Job *job, const char *name);
// Memory that lives as long as the job.
void *rey_job_alloc(Job *job, size_t count, size_t item_bytes);

// Names of the terms, separated by commas.
void rey_job_terms_text(int terms, char *text, size_t size);

int rey_job_spp_at(const Job *job, int iteration);
int rey_job_level_at(const Job *job, int iteration);

// Names of the enumerations above.
const char *rey_loss_name(int kind);
const char *rey_optimizer_name(int kind);
const char *rey_schedule_name(int kind);
const char *rey_parameterisation_name(int kind);
const char *rey_moment_name(int kind);

/* ---- the resolved job ---------------------------------------------------------------------------------- */

// Every setting that decides the result, one "dotted.key: value" a line, defaults included. Freed with rey_free.
rey_result rey_job_flat(const Job *job, char **out);
// The whole job as a YAML file that reads back as the same job. Freed with rey_free.
rey_result rey_job_yaml(const Job *job, char **out);
// Key of the first line in which two flat texts differ, into key; false when they are the same.
bool rey_job_difference(const char *a, const char *b, char *key, size_t size);
