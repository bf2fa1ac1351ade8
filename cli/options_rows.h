// options_rows.h: the command line's options, a row for each.
#pragma once

#include "cli.h"

typedef enum OptionId {
    OPTION_OUTPUT,
    OPTION_SPP,
    OPTION_SEED,
    OPTION_SENSOR,
    OPTION_DEFINE,
    OPTION_THREADS,
    OPTION_LANES,
    OPTION_SAMPLER,
    OPTION_PARAM,
    OPTION_MODE,
    OPTION_ESTIMATOR,
    OPTION_ADJOINT,
    OPTION_TERMS,
    OPTION_SPP_TERMS,
    OPTION_ALL,
    OPTION_STEP,
    OPTION_VARIANCE,
    OPTION_SET,
    OPTION_RESUME,
    OPTION_OVERWRITE,
    OPTION_LENIENT,
    OPTION_LOAD,
    OPTION_JSON,
    OPTION_HELP
} OptionId;

typedef struct OptionRow {
    OptionId id;
    char letter;          // short form, 0 when there is none
    const char *name;     // long form, null when there is none
    const char *argument; // placeholder, null for a switch
    int commands;         // bits of the subcommands that take it
    const char *help;
} OptionRow;

// The row of an argument that begins with a dash, and the value that is attached to it ("--spp=4", "-t4"), null where none
// is. Null after a usage error, which has been printed.
const OptionRow *options_match(const Options *o, const char *text, const char **attached);
