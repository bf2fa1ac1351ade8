// cli.h: what the subcommands of `reynolds` share: options, the session they open, and how they report.
#pragma once

#include "json.h"
#include "reynolds/reynolds.h"

#include <stdbool.h>
#include <stdint.h>

enum { MOST_SPP = 1 << 24 };        // the library's limit
enum { TERMS_ESTIMATED = 15 | REY_TERM_TERMINATOR }; // REY_TERM_ bits that --terms may ask for
enum { EXIT_OK = 0, EXIT_FAILED = 1, EXIT_USAGE = 2, EXIT_INTERRUPTED = 130 };

// Subcommands: main.c holds one row for each. A command gets its own name as argv[0] and returns the exit status.
typedef enum Command {
    COMMAND_RENDER,
    COMMAND_GRAD,
    COMMAND_CHECK,
    COMMAND_FIT,
    COMMAND_PARAMS,
    COMMAND_INFO,
    COMMAND_CONVERT,
    COMMAND_COMPARE,
    COMMAND_DOCTOR,
    COMMAND_COUNT
} Command;

int cli_render(int argc, char **argv);
int cli_grad(int argc, char **argv);
int cli_check(int argc, char **argv);
int cli_fit(int argc, char **argv);
int cli_params(int argc, char **argv);
int cli_info(int argc, char **argv);
int cli_convert(int argc, char **argv);
int cli_compare(int argc, char **argv);
int cli_doctor(int argc, char **argv);

const char *cli_command_name(Command command);
// Prints the subcommand's usage, its options and its notes.
void cli_command_help(Command command);

/* ---- options ------------------------------------------------------------------------------------------- */

typedef struct Options {
    Command command;
    const char *files[2]; // positional arguments: SCENE, JOB.yaml, or A and B
    int file_count;
    const char *output;  // -o, null when not given
    int spp;             // 0 = the scene's own count
    uint32_t seed;       // default 0
    bool seed_given;     // --seed was on the command line
    int sensor;          // default 0
    const char *sensor_id; // --sensor was no number; else null
    int threads;         // 0 = as many as there are
    int lanes;           // 0 = the widest
    int sampler;         // REY_SAMPLER_*
    int estimator;       // REY_ESTIMATOR_*
    int terms;           // REY_TERM_* bits, 0 = all that are needed
    int primary_spp, indirect_spp; // 0 = as fits spp
    bool reverse;        // --mode reverse
    const char *adjoint; // number or file name
    bool lenient;        // leave out what cannot be read
    bool resume, overwrite, json;
    bool all;            // check every parameter
    double step;         // of differences along the direction, 0 = found by itself
    bool variance;       // write the variance of each pixel's derivative
    rey_define *defines; // -D
    char **define_names; // copies of their names, owned
    int define_count;
    const char **params; // --param
    int param_count;
    const char **sets; // --set key=value
    int set_count;
    const char **loads; // --load FILE.xml or NAME=FILE
    int load_count;
} Options;

// Parses a subcommand's arguments. Returns true when the command should run; otherwise *status is what it should
// return: 0 after --help, 2 after a usage error, which has been printed.
bool cli_options_parse(Command command, int argc, char **argv, Options *options, int *status);
// Whether a subcommand got what it needs; prints the usage error otherwise.
bool cli_options_required(const Options *o);
void cli_options_free(Options *options);
void cli_options_help(Command command); // the list of the options that a subcommand takes

// Prints "reynolds COMMAND: message" and a hint at --help to standard error, with --json an object on standard output
// too; returns EXIT_USAGE.
int cli_usage_error(const Options *options, const char *format, ...) __attribute__((format(printf, 2, 3)));

// Whole-text conversions: false when text is not a number of that kind within the range.
bool cli_parse_integer(const char *text, int64_t low, int64_t high, int64_t *out);
bool cli_parse_number(const char *text, double *out);
// Comma-separated numbers; returns how many were read (at most max), -1 when the text is malformed.
int cli_parse_list(const char *text, int max, double *out);

/* ---- sessions ------------------------------------------------------------------------------------------ */

// Seconds since the process started to run main.
double cli_seconds_total(void);

// SIGINT sets a flag that the progress callbacks read; a second SIGINT ends the process at once.
void cli_catch_interrupts(void);
// SIGTERM and SIGHUP do the same: of commands that look at the flag all the time.
void cli_catch_terminations(void);
// What a signal then says on standard error: what the command still does. Static text.
void cli_say_when_interrupted(const char *words);
bool cli_interrupted(void);

typedef struct Progress {
    const char *label;   // "render"
    double part, parts;  // this call is number `part` of `parts` equal ones
    double start, shown; // times of the first call and of the last line [s]
    bool visible;        // standard error is a terminal
} Progress;
Progress cli_progress(const char *label);
// Fits rey_render_def.progress; user is a Progress. False, which cancels, once the user has interrupted.
bool cli_progress_step(void *user, double fraction);
void cli_progress_end(Progress *progress); // clears the line

typedef struct Session {
    const Options *options;
    rey_context *ctx;
    rey_scene *scene;
    rey_render_def def; // spp, seed, sensor, sampler, terms and progress filled in
    int sensor;
    int width, height;  // of the picture of the sensor
    double load_seconds; // from the file to a scene that can be rendered
    Progress progress;
    char **notes;       // what cli_session_note said, for --json
    int note_count;
    bool made_folder;   // the output's, which goes again if nothing was written into it
} Session;

// Creates the context only (context_open) or the context and the scene too, after a look at whether the output can be
// written. On failure it has reported already,
// *session is closed, and the exit status is returned; EXIT_OK otherwise.
int cli_context_open(const Options *options, Session *session);
int cli_session_open(const Options *options, const char *label, Session *session);
// REY_ERROR_ARGUMENT where the command reads `path`: a result over a texture, a mesh, a tangent or another input would be
// the end of it.
rey_result cli_refuse_input(const Session *session, const char *path);
void cli_session_close(Session *session);
// What --load asks for.
rey_result cli_load_values(const Options *options, rey_context *ctx, rey_scene *scene);
// What a wrong call returns as REY_ERROR_ARGUMENT, the command line's fault, is a usage error; all else a failure.
int cli_report(const Options *options, const rey_context *ctx, rey_result result);

// Reports a failed library call (words on standard error, one object on standard output with --json)
// and returns the exit status for it: 130 when the user interrupted, else 1.
int cli_report_failure(const Options *options, const rey_context *ctx, rey_result result);
// The same for failures of the command itself.
int cli_fail(const Options *options, const char *format, ...) __attribute__((format(printf, 2, 3)));
// {"error": message, "kind": kind} on standard output.
void cli_json_error(const char *message, const char *kind);
// Says so when samples were dropped because they were not finite: the picture is then too dark somewhere.
void cli_warn_nonfinite(const rey_stats *stats);
// Words on standard error, one line.
void cli_note(const char *format, ...) __attribute__((format(printf, 1, 2)));
// The same of a session, kept for "notes" of --json.
void cli_session_note(Session *session, const char *format, ...) __attribute__((format(printf, 2, 3)));
// How many characters of UTF-8 a text has, and the width that makes %-*s of printf fill a column of `width` characters.
int cli_text_width(const char *text);
int cli_pad(const char *text, int width);
// Adds a name to a list, "A, B, C and 2 more"; *count: of those so far. cli_list_end says how many are not shown.
void cli_list_add(char *text, size_t size, int *count, const char *name);
void cli_list_end(char *text, size_t size, int count);
// Says which parameters the session's picture does not depend on, in one line for all of them: a derivative of 0 may be a
// misunderstanding.
rey_result cli_note_unreached(Session *session, const int *params, int count);
// Flushes standard output; EXIT_OK, or EXIT_FAILED and a message when the data could not be written.
int cli_finish_output(void);

// The keys that every rendering command reports: times, paths, rays, memory, threads, lanes, notes.
void cli_json_stats(Json *json, const Session *session, const rey_stats *stats);
// "notes": what cli_session_note said.
void cli_json_notes(Json *json, const Session *session);
// "ignored": what a lenient reader left out; nothing when the reader was not lenient.
void cli_json_ignored(Json *json, const Session *session);
void cli_add_stats(rey_stats *sum, const rey_stats *part);
void cli_json_terms(Json *json, const char *key, int terms);
// Names of the terms in bits, joined by commas, into text.
void cli_terms_text(int terms, char *text, size_t size);

/* ---- directions ---------------------------------------------------------------------------------------- */

// One joint direction in parameter space: a tangent vector over the selection of the parameters that it moves.
typedef struct Direction {
    int *params;  // indices, none twice
    char **names; // of the parameters, as they were given first
    int count;
    int64_t *offsets; // count + 1 entries: where each parameter starts in tangent
    float *tangent;
} Direction;

// Builds the sum of the directions of specs, each `NAME[:OP]`. On REY_ERROR_ARGUMENT the text is malformed, or
// names what the scene does not have.
rey_result cli_direction_build(rey_context *ctx, rey_scene *scene, const char *const *specs, int spec_count,
                               Direction *direction);
// Whether a spec without an operation names a pose, of which then all entries move.
bool cli_direction_bare_pose(const rey_scene *scene, const char *spec);
// Length of the NAME part of a spec, and whether the operation behind it can be had of a parameter: without one, of what
// moves nothing.
size_t cli_direction_name_length(const char *spec);
const char *cli_direction_file(const char *spec); // the tangent that a spec reads, or null
bool cli_direction_fits(rey_scene *scene, int param, const char *spec);
// REY_ERROR_ARGUMENT where a direction has none of the terms that are asked for (0 = of all), which it names.
rey_result cli_direction_check_terms(rey_context *ctx, const rey_scene *scene, const Direction *direction, int asked);
// Directions of a session, with failures reported: returns the exit status.
int cli_session_direction(Session *session, const char *const *specs, int spec_count, Direction *direction);
void cli_direction_free(rey_context *ctx, Direction *direction);
rey_selection cli_direction_selection(const Direction *direction);
int cli_direction_terms(const rey_scene *scene, const Direction *direction); // terms that it needs

// Texts of directions in which no name holds a *.
typedef struct Specs {
    char **texts;
    int count;
} Specs;
// What --param says, with patterns written out: a pattern stands for the parameters that fit it and the operation behind
// it. Failures are reported; returns the exit status. --all: every parameter by its name.
int cli_specs_open(Session *session, Specs *specs);
void cli_specs_free(Session *session, Specs *specs);

/* ---- images -------------------------------------------------------------------------------------------- */

typedef enum ImageFormat { IMAGE_EXR, IMAGE_PNG, IMAGE_NPY, IMAGE_UNKNOWN } ImageFormat;
ImageFormat cli_image_format(const char *path); // "-" is EXR on standard output, /dev/null takes it too

// Reads an RGB image of any format that the library knows; *rgb is freed with rey_free. *file, which may be
// null: how it holds them. Words in the context on failure.
typedef struct ImageFile {
    bool encoded;     // as integers in sRGB
    bool translucent; // divided by an alpha, which is left out
} ImageFile;
rey_result cli_read_image(rey_context *ctx, const char *path, int *width, int *height, float **rgb, ImageFile *file);
// Writes height x width x 3 floats by the ending of path. signed_values: PNG becomes blue-white-red over
// [-scale, scale], and *scale (may be null) tells the scale.
rey_result cli_write_image(rey_context *ctx, const char *path, const float *image, int width, int height,
                           bool signed_values, float *scale);
// A film's picture: NPY and EXR files get all channels, the latter as `component` (REY_COMPONENT_*), PNG files the colours
// and alpha.
rey_result cli_write_film(rey_context *ctx, const char *path, const float *film, int width, int height, int channels,
                          const char *const *names, int component);
