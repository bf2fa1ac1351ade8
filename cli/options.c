// options.c: the values of the command line's options, and the parser that walks it.
#include "options_rows.h"

#include "base/context.h"
#include "scene/scene.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

int cli_usage_error(const Options *options, const char *format, ...) {
    const char *command = cli_command_name(options->command);
    char message[1024];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(message, sizeof message, format, arguments);
    va_end(arguments);
    fprintf(stderr, "reynolds %s: %s\nTry 'reynolds %s --help'.\n", command, message, command);
    if (options->json) {
        cli_json_error(message, "usage");
    }
    return EXIT_USAGE;
}

static bool parse_terms(Options *o, const char *text) {
    char all[128], unknown[128];
    const char *wrong;
    int terms = rey_terms_of(text, &wrong);
    cli_terms_text(TERMS_ESTIMATED, all, sizeof all);
    if (!terms) {
        cli_usage_error(o, "--terms: '%.*s' is none of %s", (int)strcspn(wrong, ","), wrong, all);
        return false;
    }
    if (terms & ~TERMS_ESTIMATED) {
        cli_terms_text(terms & ~TERMS_ESTIMATED, unknown, sizeof unknown);
        cli_usage_error(o, "--terms: '%s' does not exist by itself yet, expected some of %s", unknown, all);
        return false;
    }
    o->terms |= terms;
    return true;
}

static bool parse_load(Options *o, const char *text) {
    static const char *const pictures[] = {".npy", ".exr", ".png", ".jpg", ".jpeg", ".hdr", ".pfm", ".bmp"};
    const char *equals = strchr(text, '='), *dot = strrchr(text, '.');
    if (!text[0] || equals == text) { // that a file is missing is told with the name that it is of
        cli_usage_error(o, "--load: expected FILE.xml or NAME=FILE, got '%s'", text);
        return false;
    }
    for (size_t i = 0; i < sizeof pictures / sizeof *pictures && !equals && dot; i++) {
        if (!strcasecmp(dot, pictures[i])) {
            cli_usage_error(o, "--load: whose values are in '%s'? expected NAME=%s", text, text);
            return false;
        }
    }
    o->loads[o->load_count++] = text;
    return true;
}

static bool parse_define(Options *o, const char *text) {
    const char *equals = strchr(text, '=');
    if (!equals || equals == text) {
        cli_usage_error(o, "-D: expected key=value, got '%s'", text);
        return false;
    }
    char *name = strndup(text, (size_t)(equals - text));
    if (!name) {
        cli_usage_error(o, "out of memory");
        return false;
    }
    o->define_names[o->define_count] = name;
    o->defines[o->define_count++] = (rey_define){.name = name, .value = equals + 1};
    return true;
}

// Sets *target to the index of value among the null-terminated choices.
static bool parse_choice(const Options *o, const char *option, const char *value, const char *const *choices,
                         int *target) {
    for (int i = 0; choices[i]; i++) {
        if (!strcmp(value, choices[i])) {
            *target = i;
            return true;
        }
    }
    char list[128] = "";
    for (int i = 0; choices[i]; i++) {
        size_t used = strlen(list);
        snprintf(list + used, sizeof list - used, "%s%s", i ? ", " : "", choices[i]);
    }
    cli_usage_error(o, "%s: '%s' is none of %s", option, value, list);
    return false;
}

static bool parse_count(const Options *o, const char *option, const char *value, int64_t low, int64_t high,
                        int *target) {
    int64_t number;
    if (!cli_parse_integer(value, low, high, &number)) {
        cli_usage_error(o, "%s: expected a whole number from %lld to %lld, got '%s'", option, (long long)low,
                        (long long)high, value);
        return false;
    }
    *target = (int)number;
    return true;
}

static bool parse_spp_terms(Options *o, const char *text) {
    for (const char *s = text;; s++) {
        size_t name = strcspn(s, "=,"), length = strcspn(s, ",");
        int *target = !strncmp(s, "primary", name) && name == 7    ? &o->primary_spp
                      : !strncmp(s, "indirect", name) && name == 8 ? &o->indirect_spp
                                                                   : NULL;
        char number[32] = "";
        if (s[name] == '=') {
            snprintf(number, sizeof number, "%.*s", (int)(length - name - 1), s + name + 1);
        }
        if (!target) {
            cli_usage_error(o, "--spp-terms: expected primary=N or indirect=N, got '%.*s'", (int)length, s);
            return false;
        }
        if (!parse_count(o, "--spp-terms", number, 1, MOST_SPP, target)) {
            return false;
        }
        s += length;
        if (!*s) {
            return true;
        }
    }
}

static bool parse_seed(Options *o, const char *value) {
    int64_t number;
    if (!cli_parse_integer(value, 0, UINT32_MAX, &number)) {
        cli_usage_error(o, "--seed: expected a whole number from 0 to %u, got '%s'", UINT32_MAX, value);
        return false;
    }
    o->seed = (uint32_t)number;
    o->seed_given = true;
    return true;
}

static bool parse_set(Options *o, const char *value) {
    const char *equals = strchr(value, '=');
    if (!equals || equals == value) {
        cli_usage_error(o, "--set: expected key=value, got '%s'", value);
        return false;
    }
    o->sets[o->set_count++] = value;
    return true;
}

static bool parse_output(Options *o, const char *value) {
    if (*value == '=') {
        cli_usage_error(o, "-o%s: a name follows without '='", value);
        return false;
    }
    if (o->output) {
        cli_usage_error(o, "-o is given twice, with '%s' and '%s'", o->output, value);
        return false;
    }
    o->output = value;
    return true;
}

static bool parse_step(Options *o, const char *value) {
    char *end;
    o->step = strtod(value, &end);
    if (end == value || *end || !(o->step > 0) || !isfinite(o->step)) {
        cli_usage_error(o, "--step: expected a positive number, got '%s'", value);
        return false;
    }
    return true;
}

static bool parse_lanes(Options *o, const char *value) {
    static const char *const widths[] = {"1", "8", "16", NULL};
    static const int width_values[] = {1, 8, 16};
    int choice = 0;
    bool known = parse_choice(o, "--lanes", value, widths, &choice);
    o->lanes = width_values[choice];
    return known;
}

// Options without a value.
static void apply_switch(Options *o, OptionId id) {
    switch (id) {
    case OPTION_ALL:
        o->all = true;
        break;
    case OPTION_VARIANCE:
        o->variance = true;
        break;
    case OPTION_RESUME:
        o->resume = true;
        break;
    case OPTION_OVERWRITE:
        o->overwrite = true;
        break;
    case OPTION_LENIENT:
        o->lenient = true;
        break;
    case OPTION_JSON:
        o->json = true;
        break;
    default:
        break;
    }
}

static bool apply_option(Options *o, const OptionRow *row, const char *value) {
    static const char *const samplers[] = {"independent", "sobol", NULL}, *const modes[] = {"forward", "reverse", NULL};
    static const char *const estimators[] = {"probe", "score", NULL}; // in the order of REY_ESTIMATOR_*
    int choice = 0;
    bool known;
    switch (row->id) {
    case OPTION_OUTPUT:
        return parse_output(o, value);
    case OPTION_SPP:
        return parse_count(o, "--spp", value, 1, MOST_SPP, &o->spp);
    case OPTION_SEED:
        return parse_seed(o, value);
    case OPTION_SENSOR:
        o->sensor_id = value[0] && !strchr("+-.0123456789", value[0]) ? value : NULL;
        return o->sensor_id || parse_count(o, "--sensor", value, 0, INT32_MAX, &o->sensor);
    case OPTION_DEFINE:
        return parse_define(o, value);
    case OPTION_THREADS:
        return parse_count(o, "--threads (without it: all that the machine allows)", value, 1, 4096, &o->threads);
    case OPTION_LANES:
        return parse_lanes(o, value);
    case OPTION_SAMPLER:
        known = parse_choice(o, "--sampler", value, samplers, &choice);
        o->sampler = choice == 0 ? REY_SAMPLER_INDEPENDENT : REY_SAMPLER_SOBOL;
        return known;
    case OPTION_ESTIMATOR:
        return parse_choice(o, "--estimator", value, estimators, &o->estimator);
    case OPTION_PARAM:
        o->params[o->param_count++] = value;
        return true;
    case OPTION_MODE:
        known = parse_choice(o, "--mode", value, modes, &choice);
        o->reverse = choice == 1;
        return known;
    case OPTION_ADJOINT:
        o->adjoint = value;
        return true;
    case OPTION_TERMS:
        return parse_terms(o, value);
    case OPTION_SPP_TERMS:
        return parse_spp_terms(o, value);
    case OPTION_STEP:
        return parse_step(o, value);
    case OPTION_LOAD:
        return parse_load(o, value);
    case OPTION_SET:
        return parse_set(o, value);
    default:
        apply_switch(o, row->id);
        return true;
    }
}

static bool add_file(Options *o, const char *text) {
    static const int most[COMMAND_COUNT] = {1, 1, 1, 1, 1, 1, 2, 2, 0};
    if (o->file_count >= most[o->command]) {
        Command c = o->command;
        bool result = cli_image_format(text) != IMAGE_UNKNOWN && (c == COMMAND_RENDER || c == COMMAND_GRAD);
        bool params = c == COMMAND_GRAD || c == COMMAND_CHECK || c == COMMAND_PARAMS;
        cli_usage_error(o, "unexpected argument '%s'%s", text,
                        result   ? "; -o names the result"
                        : params ? "; --param names a parameter"
                                 : "");
        return false;
    }
    if (!text[0]) {
        cli_usage_error(o, "the name of a file is empty");
        return false;
    }
    o->files[o->file_count++] = text;
    return true;
}

static bool parse_arguments(Options *o, int argc, char **argv, bool *help) {
    bool only_files = false;
    for (int i = 1; i < argc; i++) {
        const char *text = argv[i];
        if (only_files || text[0] != '-' || !text[1]) {
            if (!add_file(o, text)) {
                return false;
            }
            continue;
        }
        if (!strcmp(text, "--")) {
            only_files = true;
            continue;
        }
        const char *value;
        const OptionRow *row = options_match(o, text, &value);
        if (!row) {
            return false;
        }
        if (row->id == OPTION_HELP) {
            *help = true;
            return true;
        }
        if (row->argument && !value) {
            if (++i == argc) {
                cli_usage_error(o, "option '%s' needs a value (%s)", text, row->argument);
                return false;
            }
            value = argv[i];
        } else if (!row->argument && value) {
            cli_usage_error(o, "option '--%s' takes no value", row->name);
            return false;
        }
        if (!apply_option(o, row, value)) {
            return false;
        }
    }
    return true;
}

bool cli_options_parse(Command command, int argc, char **argv, Options *options, int *status) {
    *options = (Options){.command = command};
    *status = EXIT_USAGE;
    size_t most = (size_t)argc + 1;
    options->defines = calloc(most, sizeof *options->defines);
    options->define_names = calloc(most, sizeof *options->define_names);
    options->params = calloc(most, sizeof *options->params);
    options->sets = calloc(most, sizeof *options->sets);
    options->loads = calloc(most, sizeof *options->loads);
    bool help = false;
    for (int i = 1; i < argc && strcmp(argv[i], "--"); i++) { // errors before it are to be told as JSON, too
        options->json = options->json || !strcmp(argv[i], "--json");
    }
    if (!options->defines || !options->define_names || !options->params || !options->sets || !options->loads) {
        cli_note("out of memory");
        *status = EXIT_FAILED;
    } else if (parse_arguments(options, argc, argv, &help)) {
        if (help) {
            cli_command_help(command);
            *status = cli_finish_output();
        } else if (cli_options_required(options)) {
            *status = EXIT_OK;
            return true;
        }
    }
    cli_options_free(options);
    return false;
}

void cli_options_free(Options *options) {
    for (int i = 0; i < options->define_count; i++) {
        free(options->define_names[i]);
    }
    free(options->define_names);
    free(options->defines);
    free(options->params);
    free(options->sets);
    free(options->loads);
    *options = (Options){.command = options->command};
}
