// options_required.c: which options and files a subcommand needs, and which of them exclude each other.
#include "cli.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <unistd.h>

static bool is_nonfinite(const char *text) {
    char *end;
    double value = strtod(text, &end);
    return end != text && !*end && !isfinite(value);
}

static const char *missing_file(Command command, int given) {
    switch (command) {
    case COMMAND_FIT:
        return "JOB.yaml is missing";
    case COMMAND_CONVERT:
        return given ? "OUT.xml is missing" : "IN and OUT.xml are missing";
    case COMMAND_COMPARE:
        return given ? "B is missing" : "A and B are missing";
    default:
        return "SCENE is missing";
    }
}

static bool is_scene_name(const char *path) {
    size_t length = strlen(path);
    return length > 4 && !strcasecmp(path + length - 4, ".xml");
}

// Whether a file that the subcommand reads is called "-".
static bool reads_dash(const Options *o) {
    bool second = o->command == COMMAND_COMPARE && o->file_count > 1;
    return o->file_count > 0 && (!strcmp(o->files[0], "-") || (second && !strcmp(o->files[1], "-")));
}

// A name that -D gives twice, null when there is none.
static const char *defined_twice(const Options *o) {
    for (int i = 0; i < o->define_count; i++) {
        for (int k = 0; k < i; k++) {
            if (!strcmp(o->defines[i].name, o->defines[k].name)) {
                return o->defines[i].name;
            }
        }
    }
    return NULL;
}

bool cli_options_required(const Options *o) {
    static const int needed[COMMAND_COUNT] = {1, 1, 1, 1, 1, 1, 2, 2, 0};
    Command c = o->command;
    if (o->output && !o->output[0]) {
        cli_usage_error(o, "-o: the name is empty");
    } else if (o->file_count < needed[c]) {
        cli_usage_error(o, "%s", missing_file(c, o->file_count));
    } else if (reads_dash(o)) {
        cli_usage_error(o, "'-': %s are read from files; standard input is /dev/stdin%s",
                        c == COMMAND_COMPARE ? "pictures" : c == COMMAND_FIT ? "jobs" : "scenes",
                        c == COMMAND_COMPARE ? "" : ", and paths inside it must then be absolute");
    } else if (o->all && o->param_count) {
        cli_usage_error(o, "--all and --param: give one of them");
    } else if ((c == COMMAND_GRAD || c == COMMAND_CHECK) && !o->param_count && !o->all) {
        cli_usage_error(o, "--param %sis missing", c == COMMAND_CHECK ? "or --all " : "");
    } else if (o->variance && (o->reverse || !o->output || !strcmp(o->output, "-"))) {
        cli_usage_error(o, "--variance is of forward mode and needs -o with the name of a file");
    } else if (c == COMMAND_GRAD && o->reverse && (!o->adjoint || !o->adjoint[0])) {
        cli_usage_error(o, "--mode reverse needs --adjoint");
    } else if (c == COMMAND_GRAD && o->reverse && is_nonfinite(o->adjoint)) {
        cli_usage_error(o, "--adjoint: '%s' is not a finite number; a file of that name is ./%s", o->adjoint, o->adjoint);
    } else if (c == COMMAND_GRAD && !o->reverse && o->adjoint) {
        cli_usage_error(o, "--adjoint needs --mode reverse");
    } else if (((c == COMMAND_GRAD && o->reverse) || c == COMMAND_FIT) && o->output && !strcmp(o->output, "-")) {
        cli_usage_error(o, "%s writes a folder, -o - is not one", c == COMMAND_FIT ? "a fit" : "reverse mode");
    } else if (c == COMMAND_GRAD && o->reverse && o->output && cli_image_format(o->output) != IMAGE_UNKNOWN) {
        cli_usage_error(o, "reverse mode writes a folder of .npy files, -o %s names a picture", o->output);
    } else if ((c == COMMAND_RENDER || (c == COMMAND_GRAD && !o->reverse)) && o->output &&
               cli_image_format(o->output) == IMAGE_UNKNOWN) {
        cli_usage_error(o, "-o: '%s' ends in none of .exr, .png, .npy", o->output);
    } else if (c == COMMAND_FIT && (o->load_count > 1 || (o->load_count && strchr(o->loads[0], '=')))) {
        cli_usage_error(o, "--load: a fit takes one saved scene; `start` of its parameters takes files");
    } else if (defined_twice(o)) {
        cli_usage_error(o, "-D: '%s' is defined twice", defined_twice(o));
    } else if (o->resume && o->overwrite) {
        cli_usage_error(o, "--resume continues and --overwrite starts again: give one of them");
    } else if (c == COMMAND_CONVERT && !strcmp(o->files[1], "-")) {
        cli_usage_error(o, "a scene is written with its meshes and pictures, which standard output cannot hold; name a file");
    } else if (c == COMMAND_CONVERT && !is_scene_name(o->files[1])) {
        cli_usage_error(o, "'%s' ends in none of .xml", o->files[1]);
    } else if (c == COMMAND_RENDER && !o->output && !o->json) {
        cli_usage_error(o, "-o OUT is missing");
    } else if (o->json && o->output && !strcmp(o->output, "-")) {
        cli_usage_error(o, "--json and -o - both want standard output");
    } else if (o->output && !strcmp(o->output, "-") && isatty(STDOUT_FILENO)) {
        cli_usage_error(o, "-o -: standard output is a terminal, and EXR files are binary; send it elsewhere, as with > out.exr");
    } else {
        return true;
    }
    return false;
}
