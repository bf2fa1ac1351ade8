// fit.h: parameters recovered from images: the loop behind `reynolds fit`.
#pragma once

#include "fit/checkpoint.h"
#include "fit/loss.h"
#include "io/image.h"
#include "scene/scene.h"

typedef struct FitProgress {
    int iteration, iterations; // done, and in all
    double loss, gradient_norm;
    double seconds, seconds_left;
    bool remeshing; // a level's meshes are at work, before its first iteration; what there is of losses and times is 0
    bool finishing; // the iterations are over; table and report are at work
} FitProgress;

typedef struct FitDef {
    const char *job_path;
    const char *const *overrides; // "key=value"
    int override_count;
    const char *output;  // folder, null = the job's
    const char *command; // the command line, for the report; may be null
    bool resume;
    bool overwrite; // start again where the folder holds another fit, or this one unfinished
    bool seed_given; // seed replaces the job's
    uint32_t seed;
    // Called after every iteration, while longer calls render, and while meshes are remeshed; false stops: the iteration is
    // finished, or not begun where meshes were at work, the state saved, and rey_fit returns REY_ERROR_CANCELLED. May be null.
    bool (*progress)(void *user, const FitProgress *progress);
    void (*note)(void *user, const char *words); // what is not wrong and may be a mistake, before the first iteration; may be null
    void *user;
} FitDef;

enum { COLUMN_TRUTH, COLUMN_START, COLUMN_FOUND, COLUMN_COUNT }; // of the final table

typedef struct FitRow { // one unknown, in the final table
    char *name;
    int64_t count;
    int64_t shape[3];
    int dims;
    float *truth, *start, *found; // truth null: not known
    double error;                 // largest relative error of an entry; weighted: see below
    bool absolute;                // the truth is 0 where it is, so that it is no share but the difference itself
    int grid;                     // numbers of each voxel; 0 = no grid
    int64_t carved;               // numbers of voxels that were carved (carve.h)
    bool derived;                 // from other rows: absorption and reduced scattering of a medium; these rows stand last
    int64_t points[COLUMN_COUNT]; // of meshes whose vertices move as a surface, else 0; 0 also where a column has none
    double chamfer[COLUMN_COUNT]; // their mean distances from the truth, over the diagonal of its bounding box
    bool weighted; // mean absolute error over mean, each entry weighted by |d sum(I) / d entry| at the truth
} FitRow;

typedef struct FitHeldOut { // a view that was not fitted
    int view;
    double psnr; // of what the report shows of it [dB]
} FitHeldOut;

typedef struct FitResult {
    rey_context *ctx;
    int iterations;
    bool converged; // by the stop rule
    bool falling;   // the iterations ended while the loss was still falling: more of them find more
    bool rose;      // the loss ended well above where it began: lower the learning rate
    int iterations_before; // of those, done by the runs before
    double seconds_before; // of `seconds`, of the runs before
    double loss;    // of the last iterations, or at the best point: see rey_fit_loss_words; NaN when there was none
    int loss_window; // iterations that it is the mean of; 0 = it is the one at the best point, which L-BFGS ends at
    double seconds; // of all runs
    int64_t numbers; // degrees of freedom: 6 of a rigid pose
    int64_t nonfinite; // samples of this run that were left out because they were not finite; 0 in a healthy fit
    Array rows;                    // FitRow
    Array held_out;                // FitHeldOut; none without a report
    char *output, *report, *scene; // paths; null = not written
    char *note;                    // why the scene was not written, null = it was
    bool bad_override;             // the fit failed, and what is wrong is an override
} FitResult;

// What the loss is: "mean of the last 10 iterations".
void rey_fit_loss_words(const FitResult *result, char *text, size_t size);
rey_result rey_fit(rey_context *ctx, const FitDef *def, FitResult *out);
void rey_fit_result_free(FitResult *result); // also after a failure

/* ---- what the parts of a fit share --------------------------------------------------------------------- */

typedef struct FitView {
    int sensor, width, height; // of the level at work, as all pictures are
    float *target, *mask;      // mask null = 1 everywhere
    double mask_sum, weight;
    int full_width, full_height;
    float *full_target, *full_mask;
    bool translucent; // the target's colours are divided by an alpha (rey_image)
    int32_t *silhouette; // of the full size (carve.h), null = none
    SensorRecord full_sensor;
} FitView;

typedef struct Fit {
    rey_context *ctx;
    const FitDef *def;
    Job job;
    char *flat;   // the resolved job
    char *inputs; // hashes of what it read (inputs.h)
    rey_scene *scene;
    rey_scene *sampling; // whose paths are reused (reuse.h), null = none are
    double outside, effective; // of the pictures of an iteration at worst: throughput whose weight is out of range, and effective
                               // samples, both as shares
    Unknowns unknowns;
    FitView *views;
    int level; // at work, -1 = none yet
    FitState state;
    char *output; // folder
    float *a, *b; // halves of the view at work
    float *adjoint_a, *adjoint_b;
    double *gradient; // of one product
    int64_t largest;  // floats of the largest picture
    struct TensorBoard *board;
    void *metrics;        // FILE *
    double start_seconds; // clock at which this run started, less the time of earlier runs
    int lock;             // descriptor of the locked folder + 1, 0 = none
    int first;            // iteration at which this run started
    double earlier;       // seconds of the runs before
    int saved;            // iteration of the last checkpoint of this run, -1 = none yet
    bool stop;            // the user asked to stop
    int64_t nonfinite;    // samples of the iterations that were left out because they were not finite
} Fit;

// Path of a file in the output folder; freed with rey_free.
char *rey_fit_output_path(const Fit *fit, const char *name);
rey_result rey_fit_make_folder(rey_context *ctx, const char *path);
// Makes the folder, locks it against other fits, and refuses to replace an earlier fit unasked.
rey_result rey_fit_folder_open(Fit *fit);
// An error where the folder holds what a fit recovered.
rey_result rey_fit_keep_recovered(Fit *fit);
void rey_fit_folder_close(Fit *fit);
// How table and report render a view; the user may cancel.
rey_render_def rey_fit_finishing_def(Fit *fit, const FitView *view, uint32_t set, int spp);

// The iterations that are left, with checkpoints; records REY_ERROR_CANCELLED when the user stops it.
rey_result rey_fit_optimise(Fit *fit);
// Whether the loss fell from the last tenth but one to the last tenth of the iterations, by more than its noise.
bool rey_fit_falling(const Fit *fit);
// Whether the last losses are more than twice the first one, as they are of steps that are too long.
bool rey_fit_rose(const Fit *fit);
double rey_fit_mean_loss(const FitState *state, int end, int count); // of the `count` iterations before `end`
int rey_fit_batches(const Job *job); // iterations in which every view has its turn once

// Small pictures on the way, for the report: in epochs 1, 2, 4, 8... one of each view, frames/viewV_ITERATION.png.
bool rey_frame_due(const Fit *fit, int iteration);
rey_result rey_frame_write(Fit *fit, int view, const float *image);
// The picture of iteration `iteration`; *bytes is null where there is none. Freed with rey_free.
rey_result rey_frame_read(const Fit *fit, int view, int iteration, unsigned char **bytes, size_t *size);

rey_result rey_views_load(Fit *fit);
// A picture of a view's size, as R G B.
rey_result rey_view_picture(Fit *fit, JobPlace at, const FitView *view, const char *name, rey_image *image);
// The same of masks and silhouettes, which are refused with an alpha: what it cuts out would count.
rey_result rey_view_opaque(Fit *fit, JobPlace at, const FitView *view, const char *name, rey_image *image);
void rey_views_free(Fit *fit);

// Levels (levels.c): whether a view can be reduced as the job says; the pictures and films of a level.
rey_result rey_levels_check(Fit *fit, const JobView *job_view, const FitView *view);
// Whether there are grids where levels have a resolution.
rey_result rey_levels_check_grids(Fit *fit);
// Whether meshes can be remeshed as the levels that are left say (remesh_level.c).
rey_result rey_levels_check_meshes(Fit *fit);
rey_result rey_levels_enter(Fit *fit, int level);
void rey_levels_reduce(Fit *fit, int r);
// Remeshes and resamples as the level says, and goes on in a scene that holds the new meshes and grids (remesh_level.c).
rey_result rey_levels_remesh(Fit *fit, int level);
// The job's scene, or that of a level: see FitState.meshed.
rey_result rey_fit_load_scene(Fit *fit, int meshed, rey_scene **out);

// Whether the truth of the job, if it has one, is a file that can be read, which is all of it that is looked at before the end.
rey_result rey_fit_check_truth(Fit *fit);

// Whether every fitted view has the gradients of all unknowns (derivatives.c).
rey_result rey_fit_check_derivatives(Fit *fit);

// Notes unknowns on which no fitted view depends, poses that may shear, terms that are left out, and odd targets (notes.c).
rey_result rey_fit_notes(const Fit *fit);
// After the last iteration: unknowns whose gradient was never anything but 0, and those that a bound holds back.
void rey_fit_note_ends(const Fit *fit);

// Exposures (exposure.c): of a view, given the unknowns' values; a picture times it; the adjoints of the view at work pulled
// back through that, with the gradient of an unknown exposure.
double rey_exposure_of(const Fit *fit, int view, const float *values);
void rey_exposure_scale(const Fit *fit, int view, double exposure, float *image);
void rey_exposure_adjoint(Fit *fit, int view, double exposure);

// metrics.jsonl and the TensorBoard file. open truncates to the iterations that are done.
rey_result rey_metrics_open(Fit *fit);
rey_result rey_metrics_row(Fit *fit, const int *batch, int batch_count);
rey_result rey_metrics_image(Fit *fit, int view, const float *image);
void rey_metrics_close(Fit *fit);

// Fills result->rows with starts and found values.
rey_result rey_fit_table(Fit *fit, FitResult *result);
// What a column of the table says of a pose (4 x 4, see pose.h) and of a mesh. False for other parameters.
bool rey_fit_row_text(const FitRow *row, int column, char *text, size_t size);
bool rey_fit_row_is_pose(const FitRow *row);
// The scene and the values that the fit began with.
rey_result rey_fit_open_start(Fit *fit, rey_scene **scene, Unknowns *unknowns);
// Adds truths and errors to the rows: opens the truth when the job names one, whose values nothing sees before.
rey_result rey_fit_judge(Fit *fit, FitResult *result);
