// options_rows.c: the table of the options, what --help says of them, and which one an argument is.
#include "options_rows.h"

#include "base/context.h"

#include <stdio.h>
#include <string.h>

enum {
    RENDERS = 1 << COMMAND_RENDER | 1 << COMMAND_GRAD | 1 << COMMAND_CHECK,
    FITS = 1 << COMMAND_FIT,
    READS = 1 << COMMAND_PARAMS | 1 << COMMAND_INFO | 1 << COMMAND_CONVERT,
    GRADS = 1 << COMMAND_GRAD,
    CHECKS = 1 << COMMAND_CHECK,
    LISTS = 1 << COMMAND_PARAMS,
    DOCTOR = 1 << COMMAND_DOCTOR,
    EVERY = (1 << COMMAND_COUNT) - 1
};

static const OptionRow option_rows[] = {
    {OPTION_OUTPUT, 'o', NULL, "OUT", 1 << COMMAND_RENDER, "file by ending (.exr .png .npy), - for standard output"},
    {OPTION_OUTPUT, 'o', NULL, "OUT", GRADS, "forward mode: the derivative image (.exr .png .npy, or -); reverse: a folder"},
    {OPTION_OUTPUT, 'o', NULL, "DIR", FITS, "folder for everything that the fit writes (default: the job's)"},
    {OPTION_PARAM, 0, "param", "P", GRADS | CHECKS, "NAME[:OP]: a direction (see below); may be repeated"},
    {OPTION_PARAM, 0, "param", "NAME", LISTS, "these parameters only; * stands for any text; may be repeated"},
    {OPTION_MODE, 0, "mode", "forward|reverse", GRADS, "which way to differentiate (default forward)"},
    {OPTION_ADJOINT, 0, "adjoint", "A", GRADS, "reverse mode: a number, or a picture (any format) of the image's size"},
    {OPTION_TERMS, 0, "terms", "T,...", GRADS | CHECKS, "these terms only (interior,primary,indirect,specular,terminator)"},
    {OPTION_SPP_TERMS, 0, "spp-terms", "T=N,...", GRADS, "samples per pixel of primary and indirect (default: by --spp)"},
    {OPTION_ALL, 0, "all", NULL, CHECKS, "every parameter of the scene, instead of --param"},
    {OPTION_ESTIMATOR, 0, "estimator", "probe|score", GRADS | CHECKS, "how extinctions are differentiated (default probe)"},
    {OPTION_STEP, 0, "step", "H", CHECKS, "step of the differences along the direction (default: found by itself)"},
    {OPTION_VARIANCE, 0, "variance", NULL, GRADS, "forward mode: also write the variance of each pixel, to OUT_variance"},
    {OPTION_SET, 0, "set", "key=value", FITS, "change an entry of the job; may be repeated"},
    {OPTION_RESUME, 0, "resume", NULL, FITS, "continue from the last checkpoint"},
    {OPTION_OVERWRITE, 0, "overwrite", NULL, FITS, "start again where the folder holds another or an unfinished fit"},
    {OPTION_SPP, 0, "spp", "N", RENDERS, "samples per pixel (default: the scene's)"},
    {OPTION_SPP, 0, "spp", "N", FITS, "samples per pixel of an iteration (default: the job's)"},
    {OPTION_SEED, 0, "seed", "N", RENDERS, "seed of the random numbers (default 0)"},
    {OPTION_SEED, 0, "seed", "N", FITS, "seed of the random numbers (default: the job's)"},
    {OPTION_SENSOR, 0, "sensor", "K|ID", RENDERS, "which sensor: its number, from 0, or its id"},
    {OPTION_SAMPLER, 0, "sampler", "independent|sobol", RENDERS, "how samples are placed (default sobol)"},
    {OPTION_DEFINE, 'D', NULL, "key=value", RENDERS | READS | FITS, "value of $key in the scene; may be repeated"},
    {OPTION_THREADS, 't', "threads", "N", RENDERS | FITS | READS | DOCTOR, "worker threads (default: all that are allowed)"},
    {OPTION_LANES, 0, "lanes", "1|8|16", RENDERS | FITS | READS | DOCTOR, "SIMD width (default: the widest)"},
    {OPTION_LOAD, 0, "load", "FILE.xml|NAME=FILE", RENDERS | READS,
     "values of parameters, by name: from a saved scene, or of one from a picture or .npy; may be repeated"},
    {OPTION_LOAD, 0, "load", "FILE.xml", FITS, "values of parameters, by name, from a saved scene"},
    {OPTION_LENIENT, 0, "lenient", NULL, RENDERS | READS, "leave out what cannot be read, and list it"},
    {OPTION_JSON, 0, "json", NULL, EVERY, "print one JSON object on standard output"},
    {OPTION_HELP, 'h', "help", NULL, EVERY, "print this text"},
};
enum { OPTION_ROW_COUNT = sizeof option_rows / sizeof option_rows[0] };

void cli_options_help(Command command) {
    printf("\nOptions:\n");
    for (int i = 0; i < OPTION_ROW_COUNT; i++) {
        const OptionRow *row = &option_rows[i];
        if (row->commands >> command & 1) {
            char text[64] = "    ";
            if (row->letter) {
                snprintf(text, sizeof text, "-%c%s", row->letter, row->name ? ", " : "");
            }
            size_t used = strlen(text);
            snprintf(text + used, sizeof text - used, "%s%s%s%s", row->name ? "--" : "", row->name ? row->name : "",
                     row->argument ? " " : "", row->argument ? row->argument : "");
            printf("  %-32s %s\n", text, row->help);
        }
    }
}

static const char *option_name_at(void *user, int i) {
    int command = *(const Command *)user;
    for (int row = 0; row < OPTION_ROW_COUNT; row++) {
        if (option_rows[row].name && option_rows[row].commands >> command & 1 && i-- == 0) {
            return option_rows[row].name;
        }
    }
    return NULL;
}

// Whether a row has this long name, or (null) this letter.
static bool is_called(const OptionRow *row, const char *name, size_t length, char letter) {
    return name ? row->name && strlen(row->name) == length && !strncmp(row->name, name, length) : row->letter == letter;
}

static const OptionRow *find_row(Command command, const char *name, size_t length, char letter) {
    for (int i = 0; i < OPTION_ROW_COUNT; i++) {
        if (is_called(&option_rows[i], name, length, letter) && option_rows[i].commands >> command & 1) {
            return &option_rows[i];
        }
    }
    return NULL;
}

// An option that this subcommand does not have: others may, or it is misspelled.
static void fail_unknown(const Options *o, const char *text, const char *name, size_t length) {
    char word[64], takers[128] = "";
    int commands = 0, last = 0;
    for (int i = 0; i < OPTION_ROW_COUNT; i++) {
        commands |= is_called(&option_rows[i], name, length, text[1]) ? option_rows[i].commands : 0;
    }
    for (int c = 0; c < COMMAND_COUNT; c++) {
        last = commands >> c & 1 ? c : last;
    }
    for (int c = 0; c < COMMAND_COUNT; c++) {
        size_t used = strlen(takers);
        if (commands >> c & 1) {
            snprintf(takers + used, sizeof takers - used, "%s%s", !used ? "" : c == last ? " and " : ", ",
                     cli_command_name((Command)c));
        }
    }
    snprintf(word, sizeof word, "%.*s", (int)length, name ? name : "");
    const char *nearest = name ? rey_nearest_word(word, option_name_at, (void *)(uintptr_t)&o->command) : NULL;
    if (takers[0]) {
        cli_usage_error(o, "'%.*s' is an option of %s, not of %s", name ? (int)length + 2 : 2, text, takers,
                        cli_command_name(o->command));
    } else if (nearest) {
        cli_usage_error(o, "unknown option '--%s', did you mean '--%s'?", word, nearest);
    } else {
        cli_usage_error(o, "unknown option '%.*s'", name ? (int)length + 2 : (int)strlen(text), text);
    }
}

const OptionRow *options_match(const Options *o, const char *text, const char **attached) {
    bool spelled = text[1] == '-';
    const char *name = spelled ? text + 2 : NULL;
    size_t length = spelled ? strcspn(name, "=") : 0;
    const OptionRow *row = find_row(o->command, name, length, text[1]);
    *attached = NULL;
    if (!row) {
        fail_unknown(o, text, name, length);
        return NULL;
    }
    if (!spelled && text[2] && !row->argument) {
        cli_usage_error(o, "option '-%c' takes no value", text[1]);
        return NULL;
    }
    *attached = spelled ? (name[length] == '=' ? name + length + 1 : NULL) : text[2] ? text + 2 : NULL;
    return row;
}
