// checkpoint.h: everything that a fit needs to go on as if it had never stopped, in one file.
#pragma once

#include "fit/optimizer.h"

// History: one row of doubles an iteration: loss, gradient norm, factor of the learning rate, seconds since the start,
// then the values of the small parameters.
enum { HISTORY_LOSS, HISTORY_NORM, HISTORY_FACTOR, HISTORY_SECONDS, HISTORY_VALUES };
enum { HISTORY_LARGEST = 16 }; // parameters of up to so many numbers are kept in the history

typedef struct FitState {
    int iteration;  // how many are done
    double seconds; // spent so far, over all runs
    Array history;  // doubles, iteration x history_width
    int history_width;
    int meshed;     // 1 + the level whose scene file holds the meshes, 0 = the job's scene does
    int recorded;   // 1 + the iteration at which the paths at work were recorded, 0 = none are (reuse.h)
    bool converged; // the stop rule has ended the fit
} FitState;

// What a checkpoint was written for.
typedef struct FitOrigin {
    const char *flat;   // the resolved job's flat text
    const char *inputs; // of what it read (inputs.h); null where that is not known yet
} FitOrigin;

// Writes so that the file is complete or the former one.
rey_result rey_checkpoint_write(const char *path, FitOrigin origin, const Unknowns *u, const FitState *state);

// Reads one that was written for the same job and inputs; names what differs otherwise.
rey_result rey_checkpoint_read(const char *path, FitOrigin origin, Unknowns *u, FitState *state);
// The same without the numbers: how far it came.
rey_result rey_checkpoint_look(rey_context *ctx, const char *path, FitOrigin origin, FitState *state);
// The value of a key of the job that it was written for, which is read as a number; `fallback` where there is none.
rey_result rey_checkpoint_number(rey_context *ctx, const char *path, const char *key, double fallback, double *out);
