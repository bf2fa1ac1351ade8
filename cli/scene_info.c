// scene_info.c: `reynolds params` and `reynolds info`: what a scene holds.
#include "cli.h"

#include "base/context.h"
#include "base/parallel.h"
#include "io/mitsuba.h"
#include "render/term_request.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { SHOWN_VALUES = 16 }; // parameters up to this size are printed in full with --json

typedef struct Range {
    double low, high, mean;
} Range;

static Range value_range(const float *values, int64_t count) {
    Range r = {INFINITY, -INFINITY, 0};
    for (int64_t i = 0; i < count; i++) {
        r.low = fmin(r.low, (double)values[i]);
        r.high = fmax(r.high, (double)values[i]);
        r.mean += (double)values[i] / (double)count;
    }
    return r;
}

// Why `grad` refuses a parameter, by the words that it uses; null where it does not.
static const char *refusal(const Session *s, int param) {
    rey_render_def def = rey_default_render_def();
    return rey_derivative_check(s->scene, &def, (rey_selection){&param, 1}) ? rey_error(s->ctx) : NULL;
}

static void json_param(Json *json, const Session *s, int param) {
    rey_param_info all, *info = &all;
    if (rey_param_get_info(s->scene, param, info) != REY_OK) {
        return;
    }
    const float *values = rey_param_values(s->scene, param);
    Range range = value_range(values, info->count);
    json_object(json, NULL);
    json_string(json, "name", info->name);
    json_string(json, "description", info->description);
    json_string(json, "unit", info->unit);
    json_array(json, "shape");
    for (int i = 0; i < info->dims; i++) {
        json_integer(json, NULL, info->shape[i]);
    }
    json_array_end(json);
    json_integer(json, "count", info->count);
    json_number(json, "low", (double)info->low);
    json_number(json, "high", (double)info->high);
    if (info->dims == 0) {
        json_number(json, "value", (double)values[0]);
    } else if (info->count <= SHOWN_VALUES) {
        json_array(json, "value");
        for (int64_t i = 0; i < info->count; i++) {
            json_number(json, NULL, (double)values[i]);
        }
        json_array_end(json);
    }
    json_number(json, "mean", range.mean);
    json_number(json, "min", range.low);
    json_number(json, "max", range.high);
    cli_json_terms(json, "terms", info->terms & ~REY_TERM_TERMINATOR);
    cli_json_terms(json, "terms_if_met", info->terms & REY_TERM_TERMINATOR);
    json_string(json, "why", info->why);
    json_string(json, "refused", refusal(s, param));
    json_object_end(json);
}

static void shape_text(const rey_param_info *info, char *text, size_t size) {
    snprintf(text, size, "%s", info->dims ? "" : "1");
    for (int i = 0; i < info->dims; i++) {
        size_t used = strlen(text);
        snprintf(text + used, size - used, "%s%lld", i ? "x" : "", (long long)info->shape[i]);
    }
}

static void value_text(const rey_param_info *info, const float *values, char *text, size_t size) {
    text[0] = 0;
    if (info->count > 4) {
        Range range = value_range(values, info->count);
        snprintf(text, size, "mean %.4g", range.mean);
        return;
    }
    for (int64_t i = 0; i < info->count; i++) {
        size_t used = strlen(text);
        snprintf(text + used, size - used, "%s%.5g", i ? ", " : "", (double)values[i]);
    }
}

enum { PARAM_CELLS = 6, CELL_BYTES = 512 };

// Whether there is a gradient. A jump of shading normals is looked for on the way, and may not be met.
static void print_gradient(const Session *s, int param) {
    rey_param_info info = {0};
    const char *refused = refusal(s, param);
    if (refused) {
        printf("refused: %s\n", refused);
        return;
    }
    rey_param_get_info(s->scene, param, &info);
    puts(info.terms & REY_TERM_TERMINATOR ? "complete, unless paths meet the jump of 'terminator'" : "complete");
}

// One parameter's cells: name, shape, unit, range, value, terms.
static void param_cells(const Session *s, int param, char cells[PARAM_CELLS][CELL_BYTES]) {
    static const char *const titles[PARAM_CELLS] = {"name", "shape", "unit", "range", "value", "terms"};
    rey_param_info info;
    if (param < 0 || rey_param_get_info(s->scene, param, &info) != REY_OK) {
        for (int c = 0; c < PARAM_CELLS; c++) {
            snprintf(cells[c], CELL_BYTES, "%s", titles[c]);
        }
        return;
    }
    snprintf(cells[0], CELL_BYTES, "%s", info.name);
    shape_text(&info, cells[1], CELL_BYTES);
    snprintf(cells[2], CELL_BYTES, "%s", info.unit[0] ? info.unit : "-");
    snprintf(cells[3], CELL_BYTES, "[%g, %g]", (double)info.low, (double)info.high);
    value_text(&info, rey_param_values(s->scene, param), cells[4], CELL_BYTES);
    cli_terms_text(info.terms & ~REY_TERM_TERMINATOR, cells[5], CELL_BYTES);
}

static void print_params(const Session *s) {
    int count = rey_param_count(s->scene), widths[PARAM_CELLS] = {0};
    char cells[PARAM_CELLS][CELL_BYTES];
    for (int i = -1; i < count; i++) { // the titles first
        param_cells(s, i, cells);
        for (int c = 0; c < PARAM_CELLS; c++) {
            int length = (int)strlen(cells[c]);
            widths[c] = length > widths[c] ? length : widths[c];
        }
    }
    for (int i = -1; i < count; i++) {
        param_cells(s, i, cells);
        for (int c = 0; c < PARAM_CELLS; c++) {
            printf("%-*s  ", widths[c], cells[c]);
        }
        if (i < 0) {
            puts("gradient");
        } else {
            print_gradient(s, i);
        }
    }
}

static void print_params_json(const Session *s) {
    Json json = json_begin(stdout);
    json_object(&json, NULL);
    json_array(&json, "parameters");
    for (int i = 0; i < rey_param_count(s->scene); i++) {
        json_param(&json, s, i);
    }
    json_array_end(&json);
    cli_json_ignored(&json, s);
    json_object_end(&json);
    json_end(&json);
}

// One count of rey_scene_info and what to call it.
typedef struct CountRow {
    const char *name;
    int64_t value;
} CountRow;

enum { COUNT_ROWS = 11 };

static void count_rows(const rey_scene_info *info, CountRow rows[COUNT_ROWS]) {
    const CountRow all[COUNT_ROWS] = {
        {"shapes", info->shapes},         {"triangles", info->triangles},
        {"vertices", info->vertices},     {"instances", info->instances},
        {"bsdfs", info->bsdfs},           {"emitters", info->emitters},
        {"textures", info->textures},     {"sensors", info->sensors},
        {"parameters", info->parameters}, {"parameter_floats", info->parameter_floats},
        {"bytes", info->bytes},
    };
    memcpy(rows, all, sizeof all);
}

// A line for each sort of objects: "bsdf   diffuse 3, plastic 1".
static void print_kinds(const Session *s) {
    Array kinds;
    if (rey_mitsuba_kinds(s->scene, &kinds) != REY_OK) {
        return;
    }
    for (size_t i = 0; i < kinds.count; i++) {
        const KindCount *k = &ARRAY_AT(kinds, KindCount, i);
        if (strcmp(k->tag_name, "integrator") == 0) {
            continue; // has a line of its own
        }
        bool first = i == 0 || k[-1].tag != k->tag, last = i + 1 == kinds.count || k[1].tag != k->tag;
        if (first) {
            printf("%-17s ", k->tag_name);
        }
        printf("%s %d%s", k->type, k->count, last ? "\n" : ", ");
    }
    rey_array_free(s->ctx, &kinds);
}

static void json_kinds(Json *json, const Session *s) {
    Array kinds;
    if (rey_mitsuba_kinds(s->scene, &kinds) != REY_OK) {
        return;
    }
    json_object(json, "kinds");
    for (size_t i = 0; i < kinds.count; i++) {
        const KindCount *k = &ARRAY_AT(kinds, KindCount, i);
        if (i == 0 || k[-1].tag != k->tag) {
            json_object(json, k->tag_name);
        }
        json_integer(json, k->type, k->count);
        if (i + 1 == kinds.count || k[1].tag != k->tag) {
            json_object_end(json);
        }
    }
    json_object_end(json);
    rey_array_free(s->ctx, &kinds);
}

static void print_info(const Session *s) {
    rey_scene_info info;
    rey_scene_get_info(s->scene, &info);
    CountRow rows[COUNT_ROWS];
    count_rows(&info, rows);
    for (int i = 0; i < COUNT_ROWS; i++) {
        printf("%-17s %lld\n", rows[i].name, (long long)rows[i].value);
    }
    printf("%-17s %.1f\n", "peak_rss_mb", (double)rey_peak_rss() / 1e6);
    print_kinds(s);
    printf("%-17s %g %g %g to %g %g %g\n", "bounds", info.bounds[0], info.bounds[1], info.bounds[2], info.bounds[3],
           info.bounds[4], info.bounds[5]);
    printf("%-17s %s, max_depth %d, rr_depth %d\n", "integrator", info.integrator, info.max_depth, info.rr_depth);
    printf("%-17s %d\n", "samples per pixel", info.sample_count);
    for (int i = 0; i < rey_scene_sensor_count(s->scene); i++) {
        int width, height;
        if (rey_scene_film_size(s->scene, i, &width, &height) == REY_OK) {
            printf("sensor %-10d %d x %d pixels\n", i, width, height);
        }
    }
    for (int i = 0; i < rey_scene_note_count(s->scene); i++) {
        printf("note: %s\n", rey_scene_note(s->scene, i));
    }
}

static void print_info_json(const Session *s) {
    rey_scene_info info;
    rey_scene_get_info(s->scene, &info);
    CountRow rows[COUNT_ROWS];
    count_rows(&info, rows);
    Json json = json_begin(stdout);
    json_object(&json, NULL);
    for (int i = 0; i < COUNT_ROWS; i++) {
        json_integer(&json, rows[i].name, rows[i].value);
    }
    json_number(&json, "load_seconds", s->load_seconds);
    json_number(&json, "peak_rss_mb", (double)rey_peak_rss() / 1e6);
    json_kinds(&json, s);
    json_array(&json, "bounds");
    for (int i = 0; i < 6; i++) {
        json_number(&json, NULL, info.bounds[i]);
    }
    json_array_end(&json);
    json_string(&json, "integrator", info.integrator);
    json_integer(&json, "max_depth", info.max_depth);
    json_integer(&json, "rr_depth", info.rr_depth);
    json_integer(&json, "sample_count", info.sample_count);
    json_array(&json, "films");
    for (int i = 0; i < rey_scene_sensor_count(s->scene); i++) {
        int width = 0, height = 0;
        rey_scene_film_size(s->scene, i, &width, &height);
        json_array(&json, NULL);
        json_integer(&json, NULL, width);
        json_integer(&json, NULL, height);
        json_array_end(&json);
    }
    json_array_end(&json);
    json_array(&json, "notes");
    for (int i = 0; i < rey_scene_note_count(s->scene); i++) {
        json_string(&json, NULL, rey_scene_note(s->scene, i));
    }
    json_array_end(&json);
    cli_json_ignored(&json, s);
    json_object_end(&json);
    json_end(&json);
}

static int describe(Command command, int argc, char **argv, void (*print)(const Session *),
                    void (*print_as_json)(const Session *)) {
    Options options;
    Session session;
    int status;
    if (!cli_options_parse(command, argc, argv, &options, &status)) {
        return status;
    }
    status = cli_session_open(&options, cli_command_name(command), &session);
    if (!status) {
        (options.json ? print_as_json : print)(&session);
        cli_session_close(&session);
        status = cli_finish_output();
    }
    cli_options_free(&options);
    return status;
}

int cli_params(int argc, char **argv) {
    return describe(COMMAND_PARAMS, argc, argv, print_params, print_params_json);
}

int cli_info(int argc, char **argv) {
    return describe(COMMAND_INFO, argc, argv, print_info, print_info_json);
}
