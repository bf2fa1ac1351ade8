// params.c: `reynolds params`: every parameter of a scene, and whether it has a gradient.
#include "cli.h"
#include "npy.h"
#include "reasons.h"

#include "render/facing.h"
#include "render/term_request.h"
#include "render/update.h"
#include "render/used.h"

#include <math.h>
#include <stdio.h>
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

typedef struct Listing {
    Session *session;
    bool *shown, *used; // per parameter of the scene
    bool *complete;     // has a gradient, per parameter that is shown
    Reasons reasons;    // of what is refused
} Listing;

static int terms_stated(const Listing *l, const rey_param_info *info) {
    return rey_terms_stated(l->session->scene, l->session->sensor, info->terms);
}

// Why `grad` refuses a parameter, by the words that it uses; null where it does not.
static const char *refusal(const Listing *l, int param) {
    rey_render_def def = rey_default_render_def();
    if (l->complete[param]) {
        return NULL;
    }
    return rey_derivative_check(l->session->scene, &def, (rey_selection){&param, 1}) ? rey_error(l->session->ctx) : NULL;
}

// A question costs a walk through the scene, and what is complete together is so alone: one for all of a scene in which nothing is
// refused, and halves of those that are not complete together.
static void find_complete(Listing *l, const int *params, int count) {
    rey_render_def def = rey_default_render_def();
    bool complete = rey_derivative_check(l->session->scene, &def, (rey_selection){params, count}) == REY_OK;
    for (int i = 0; i < count && complete; i++) {
        l->complete[params[i]] = true;
    }
    if (!complete && count > 1) {
        find_complete(l, params, count / 2);
        find_complete(l, params + count / 2, count - count / 2);
    }
}

static rey_result find_all_complete(Listing *l) {
    rey_scene *scene = l->session->scene;
    int *params = rey_alloc_array(l->session->ctx, (size_t)rey_param_count(scene), sizeof *params), count = 0;
    for (int i = 0; i < rey_param_count(scene) && params; i++) {
        if (l->shown[i]) {
            params[count++] = i;
        }
    }
    if (count > 0) {
        find_complete(l, params, count);
    }
    rey_free(l->session->ctx, params);
    return params ? REY_OK : REY_ERROR_MEMORY;
}

static void json_param(Json *json, const Listing *l, int param) {
    rey_param_info all, *info = &all;
    if (rey_param_get_info(l->session->scene, param, info) != REY_OK) {
        return;
    }
    const float *values = rey_param_values(l->session->scene, param);
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
    int stated = terms_stated(l, info);
    cli_json_terms(json, "terms", stated);
    cli_json_terms(json, "terms_if_met", info->terms & ~stated);
    json_string(json, "why", info->why);
    json_bool(json, "used", l->used[param]);
    json_string(json, "refused", refusal(l, param));
    json_object_end(json);
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

enum { PARAM_CELLS = 7, CELL_BYTES = 512 };

// Whether there is a gradient. A jump of shading normals is looked for on the way, and may not be met.
static void gradient_text(Listing *l, int param, char text[CELL_BYTES]) {
    rey_param_info info = {.name = ""};
    rey_param_get_info(l->session->scene, param, &info);
    const char *refused = refusal(l, param);
    if (refused) {
        snprintf(text, CELL_BYTES, "refused [%d]%s", reasons_add(l->session->ctx, &l->reasons, refused, info.name),
                 l->used[param] ? "" : ", unused");
    } else if (!l->used[param]) {
        snprintf(text, CELL_BYTES, "unused: nothing in the scene refers to it, and its derivative is 0");
    } else {
        snprintf(text, CELL_BYTES, "complete%s",
                 info.terms & ~terms_stated(l, &info) ? ", unless paths meet the jump of 'terminator'" : "");
    }
}

// One parameter's cells: name, shape, unit, range, value, terms, gradient.
static void param_cells(Listing *l, int param, char cells[PARAM_CELLS][CELL_BYTES]) {
    static const char *const titles[PARAM_CELLS] = {"name", "shape", "unit", "range", "value", "terms", "gradient"};
    const Session *s = l->session;
    rey_param_info info;
    if (param < 0 || rey_param_get_info(s->scene, param, &info) != REY_OK) {
        for (int c = 0; c < PARAM_CELLS; c++) {
            snprintf(cells[c], CELL_BYTES, "%s", titles[c]);
        }
        return;
    }
    snprintf(cells[0], CELL_BYTES, "%s", info.name);
    cli_shape_text(&info, cells[1], CELL_BYTES);
    snprintf(cells[2], CELL_BYTES, "%s", info.unit[0] ? info.unit : "-");
    snprintf(cells[3], CELL_BYTES, "[%g, %g]", (double)info.low, (double)info.high);
    value_text(&info, rey_param_values(s->scene, param), cells[4], CELL_BYTES);
    cli_terms_text(terms_stated(l, &info), cells[5], CELL_BYTES);
    gradient_text(l, param, cells[6]);
}

// A row in memory, so that a table is as wide as its widest cell.
typedef struct Row {
    char *cells[PARAM_CELLS];
} Row;

static rey_result add_row(Listing *l, int param, Array *rows) {
    char cells[PARAM_CELLS][CELL_BYTES];
    Row *row = rey_array_push(l->session->ctx, rows, sizeof *row, 1);
    param_cells(l, param, cells);
    for (int c = 0; c < PARAM_CELLS && row; c++) {
        row->cells[c] = rey_strdup(l->session->ctx, cells[c]);
        if (!row->cells[c]) {
            return REY_ERROR_MEMORY;
        }
    }
    return row ? REY_OK : REY_ERROR_MEMORY;
}

static void print_rows(const Array *rows) {
    int widths[PARAM_CELLS] = {0};
    for (size_t i = 0; i < rows->count; i++) {
        for (int c = 0; c < PARAM_CELLS; c++) {
            int width = cli_text_width(ARRAY_AT(*rows, Row, i).cells[c]);
            widths[c] = width > widths[c] ? width : widths[c];
        }
    }
    for (size_t i = 0; i < rows->count; i++) {
        for (int c = 0; c < PARAM_CELLS; c++) {
            const char *cell = ARRAY_AT(*rows, Row, i).cells[c];
            bool last = c + 1 == PARAM_CELLS;
            printf("%-*s%s", last ? 0 : cli_pad(cell, widths[c]), cell, last ? "\n" : "  ");
        }
    }
}

static rey_result print_table(Listing *l) {
    Array rows = {0};
    rey_result result = REY_OK;
    for (int i = -1; i < rey_param_count(l->session->scene) && !result; i++) { // the titles first
        result = i < 0 || l->shown[i] ? add_row(l, i, &rows) : REY_OK;
    }
    if (!result) {
        print_rows(&rows);
    }
    for (int i = 1; i <= (int)l->reasons.items.count && !result; i++) {
        fputs(i == 1 ? "\n" : "", stdout);
        reasons_print(stdout, &l->reasons, i);
    }
    for (size_t i = 0; i < rows.count; i++) {
        for (int c = 0; c < PARAM_CELLS; c++) {
            rey_free(l->session->ctx, ARRAY_AT(rows, Row, i).cells[c]);
        }
    }
    rey_array_free(l->session->ctx, &rows);
    return result;
}

static rey_result print_json(Listing *l) {
    Json json = json_begin(stdout);
    json_object(&json, NULL);
    json_array(&json, "parameters");
    for (int i = 0; i < rey_param_count(l->session->scene); i++) {
        if (l->shown[i]) {
            json_param(&json, l, i);
        }
    }
    json_array_end(&json);
    cli_json_ignored(&json, l->session);
    json_object_end(&json);
    json_end(&json);
    return REY_OK;
}

// Which parameters --param names; all of them without it.
static int choose(Listing *l) {
    Session *s = l->session;
    Specs specs;
    Direction named = {0};
    int status = cli_specs_open(s, &specs);
    if (!status && specs.count) {
        status = cli_session_direction(s, (const char *const *)specs.texts, specs.count, &named);
    }
    for (int i = 0; i < rey_param_count(s->scene) && !status; i++) {
        l->shown[i] = specs.count == 0;
    }
    for (int i = 0; i < named.count && !status; i++) {
        l->shown[named.params[i]] = true;
    }
    cli_direction_free(s->ctx, &named);
    cli_specs_free(s, &specs);
    return status;
}

static int list(Session *session) {
    size_t count = (size_t)rey_param_count(session->scene);
    Listing l = {.session = session};
    l.shown = rey_alloc_array(session->ctx, count, sizeof *l.shown);
    l.used = rey_alloc_array(session->ctx, count, sizeof *l.used);
    l.complete = rey_alloc_array(session->ctx, count, sizeof *l.complete);
    rey_result result = l.shown && l.used && l.complete ? rey_params_used(session->scene, l.used) : REY_ERROR_MEMORY;
    int status = result ? EXIT_OK : choose(&l);
    if (!result && !status) {
        result = rey_scene_update(session->scene);
    }
    if (!result && !status) {
        result = find_all_complete(&l);
    }
    if (!result && !status) {
        result = (session->options->json ? print_json : print_table)(&l);
    }
    status = result ? cli_report_failure(session->options, session->ctx, result) : status;
    reasons_free(session->ctx, &l.reasons);
    rey_free(session->ctx, l.shown);
    rey_free(session->ctx, l.used);
    rey_free(session->ctx, l.complete);
    return status ? status : cli_finish_output();
}

int cli_params(int argc, char **argv) {
    Options options;
    Session session;
    int status;
    if (!cli_options_parse(COMMAND_PARAMS, argc, argv, &options, &status)) {
        return status;
    }
    status = cli_session_open(&options, "params", &session);
    if (!status) {
        status = list(&session);
        cli_session_close(&session);
    }
    cli_options_free(&options);
    return status;
}
