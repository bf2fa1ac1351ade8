// optimizer.h: the unknowns of a fit and the steps that move them.
#pragma once

#include "fit/job.h"
#include "fit/scattering.h"

typedef struct Unknown { // one parameter of the scene, or of a view
    int param;           // its index; -1 = the exposure of a view
    int view;            // that one
    int entry;           // of the job's parameters: the one that chose it
    const char *name;
    int64_t offset, count; // place in the arrays of Unknowns
    int dims;
    int64_t shape[3];
    double learning_rate; // 0 = the optimizer's
    double low, high;
    Parameterisation parameterisation;
    MomentKind moment;
    Vertices *vertices; // of laplacian, owned; else null
    GridSize grid;      // of grids, else all 0
    GridRegularisers regularisers;
    double sum;         // of a simplex, of the start as it was given: shares are divided by it
    bool driven;        // its gradient was not 0 in some iteration of this run
    unsigned char *carved; // 1 for entries that stay what they are (carve.h), owned; null = none do
} Unknown;

typedef struct Unknowns {
    rey_context *ctx;
    Array items;            // Unknown
    Array media;            // Scattering: of those whose parameterisation it is
    int *params;            // indices of those that are the scene's, for rey_selection
    int param_count;
    int64_t count;          // numbers in all
    float *start, *value;   // as the scene holds them
    float *reference;       // where the paths at work were recorded (reuse.h)
    double *variable;       // what the optimizer moves: x, log x, or logit of x's place within the bounds
    double *first, *second; // moments; SGD uses the first as its velocity
    double *average;        // of the values over the iterations, see JobOptimizer
    double *gradient;       // d loss / d value
    double *lbfgs;          // its state, null for other optimizers
    int64_t lbfgs_count;
} Unknowns;

// Finds the job's parameters in the scene, gives the scene their start values, and clears the moments. keep: the start is
// what the scene holds, whatever the job says.
rey_result rey_unknowns_create(Job *job, rey_scene *scene, bool keep, Unknowns *out);
// Fills variable and value from start, which moves inside its bounds.
void rey_unknowns_begin(Unknowns *u);
void rey_unknowns_free(Unknowns *u);
// Gives the scene the values.
rey_result rey_unknowns_apply(const Unknowns *u, rey_scene *scene, const float *values);

double rey_schedule_factor(const JobSchedule *schedule, int iteration);

// Adds the regularisers' gradients to u->gradient; returns their sum.
double rey_unknowns_regularise(Unknowns *u);
// What was carved has no gradient.
void rey_unknowns_hold(Unknowns *u);
// One step along u->gradient at iteration i (from 0); loss: where the gradient was taken.
// Returns the gradient's Euclidean norm in the variables.
double rey_optimizer_step(const JobOptimizer *optimizer, Unknowns *u, int iteration, double loss);
// The loss is another function from here on, or there are no more iterations: L-BFGS goes back to its best point.
void rey_optimizer_restart(const JobOptimizer *optimizer, Unknowns *u);
// The loss is not known at the value but by other samples (rey_lbfgs_leap). False: the value has come nearer instead.
bool rey_optimizer_leap(const JobOptimizer *optimizer, Unknowns *u);
// Puts the average into value, for good: called when the optimisation is over.
void rey_unknowns_take_average(Unknowns *u);
