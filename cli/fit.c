// fit.c: `reynolds fit`: runs a job, shows its progress, and prints what was found.
#include "cli.h"

#include "base/parallel.h"
#include "fit/fit.h"
#include "fit/pose.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { SHOWN_ENTRIES = 3, LINE_SECONDS = 5 };

typedef struct Display {
    bool terminal;
    double shown; // time of the last line [s]
    bool finishing;
    Session *session; // keeps the notes
} Display;

static bool show_progress(void *user, const FitProgress *p) {
    Display *display = user;
    double now = rey_seconds(), wait = display->terminal ? 0.1 : LINE_SECONDS;
    if (p->finishing && (!display->finishing || now - display->shown >= LINE_SECONDS)) {
        fprintf(stderr, "%smaking the table and the report%s", display->finishing ? "" : display->terminal ? "\n" : "",
                display->terminal ? "\r" : "\n");
        display->finishing = true;
        display->shown = now;
    } else if (p->remeshing && now - display->shown >= LINE_SECONDS) {
        fprintf(stderr, "%siteration %d/%d  remeshing%s", display->terminal ? "\r\033[K" : "", p->iteration, p->iterations,
                display->terminal ? "" : "\n");
        display->shown = now;
    } else if (!p->finishing && !p->remeshing && (now - display->shown >= wait || p->iteration == p->iterations)) {
        fprintf(stderr, "%siteration %d/%d  loss %.4g  gradient %.3g  %.0f s left%s",
                display->terminal ? "\r\033[K" : "", p->iteration, p->iterations, p->loss, p->gradient_norm,
                p->seconds_left, display->terminal ? "" : "\n");
        display->shown = now;
    }
    return !cli_interrupted();
}

static void show_note(void *user, const char *words) {
    const Display *display = user;
    cli_session_note(display->session, "%s", words);
}

static void entries_text(const FitRow *row, int column, char *text, size_t size) {
    const float *values = column == COLUMN_TRUTH ? row->truth : column == COLUMN_START ? row->start : row->found;
    text[0] = 0;
    if (rey_fit_row_text(row, column, text, size)) {
        return;
    } else if (!values) {
        snprintf(text, size, "-");
    } else if (row->count > SHOWN_ENTRIES) {
        double mean = 0;
        for (int64_t i = 0; i < row->count; i++) {
            mean += (double)values[i] / (double)row->count;
        }
        snprintf(text, size, "mean %.4g", mean);
    } else {
        for (int64_t i = 0; i < row->count; i++) {
            size_t used = strlen(text);
            snprintf(text + used, size - used, "%s%.4g", i ? " " : "", (double)values[i]);
        }
    }
}

enum { CELLS = 5, CELL_BYTES = 512 }; // parameter, truth, start, found, error

static void error_text(const FitRow *row, char *text, size_t size) {
    if (row->points[COLUMN_TRUTH]) {
        snprintf(text, size, "%.3f %% (Chamfer)", 100 * row->error);
    } else if (row->truth && rey_fit_row_is_pose(row)) {
        snprintf(text, size, "%.2f %% (%.3g away, turned by %.3g deg)", 100 * row->error,
                 rey_pose_distance(row->found, row->truth), rey_pose_turned(row->found, row->truth));
    } else if (row->truth && row->absolute) {
        snprintf(text, size, "%.3g (absolute%s)", row->error, row->weighted ? ", weighted" : "");
    } else if (row->truth) {
        snprintf(text, size, "%.2f %%%s", 100 * row->error, row->weighted ? " (weighted)" : "");
    } else {
        snprintf(text, size, "-");
    }
}

// The cells of one row, of the titles without one.
static void row_cells(const FitRow *row, char cells[CELLS][CELL_BYTES]) {
    static const char *const titles[CELLS] = {"parameter", "truth", "start", "found", "error"};
    for (int c = 0; c < CELLS; c++) {
        snprintf(cells[c], CELL_BYTES, "%s", row && c == 0 ? row->name : titles[c]);
    }
    if (row) {
        entries_text(row, COLUMN_TRUTH, cells[1], CELL_BYTES);
        entries_text(row, COLUMN_START, cells[2], CELL_BYTES);
        entries_text(row, COLUMN_FOUND, cells[3], CELL_BYTES);
        error_text(row, cells[4], CELL_BYTES);
    }
}

static void print_table(const FitResult *result) {
    char cells[CELLS][CELL_BYTES];
    int widths[CELLS] = {0};
    for (size_t i = 0; i < 2 * (result->rows.count + 1); i++) { // first how wide the columns are
        size_t row = i % (result->rows.count + 1);
        row_cells(row ? &ARRAY_AT(result->rows, FitRow, row - 1) : NULL, cells);
        for (int c = 0; c < CELLS; c++) {
            int width = cli_text_width(cells[c]);
            if (i == row) {
                widths[c] = width > widths[c] ? width : widths[c];
            } else {
                bool last = c + 1 == CELLS;
                printf("%-*s%s", last ? 0 : cli_pad(cells[c], widths[c]), cells[c], last ? "\n" : "  ");
            }
        }
    }
}

static void json_values(Json *json, const char *key, const FitRow *row, const float *values) {
    if (!values || row->count > HISTORY_LARGEST) {
        return;
    }
    json_array(json, key);
    for (int64_t i = 0; i < row->count; i++) {
        json_number(json, NULL, (double)values[i]);
    }
    json_array_end(json);
}

static const char *measure_of(const FitRow *row) {
    if (row->points[COLUMN_TRUTH]) {
        return "chamfer";
    }
    if (row->weighted) {
        return row->absolute ? "weighted_absolute" : "weighted_mean";
    }
    return row->absolute ? "largest_absolute" : "largest_relative";
}

static void print_json(const FitResult *result, const Session *session) {
    Json json = json_begin(stdout);
    char words[64];
    json_object(&json, NULL);
    json_integer(&json, "iterations", result->iterations);
    json_bool(&json, "converged", result->converged);
    json_bool(&json, "still_falling", result->falling);
    json_bool(&json, "rose", result->rose);
    json_integer(&json, "iterations_before", result->iterations_before);
    json_number(&json, "seconds_before", result->seconds_before);
    json_number(&json, "loss", result->loss);
    rey_fit_loss_words(result, words, sizeof words);
    json_string(&json, "loss_is", result->iterations ? words : NULL);
    json_number(&json, "seconds", result->seconds);
    json_number(&json, "seconds_total", cli_seconds_total());
    json_number(&json, "peak_rss_mb", (double)rey_peak_rss() / 1e6);
    json_integer(&json, "threads", rey_threads(result->ctx));
    json_integer(&json, "lanes", rey_lanes(result->ctx));
    json_integer(&json, "numbers", result->numbers);
    json_integer(&json, "nonfinite", result->nonfinite);
    json_array(&json, "parameters");
    for (size_t i = 0; i < result->rows.count; i++) {
        const FitRow *row = &ARRAY_AT(result->rows, FitRow, i);
        json_object(&json, NULL);
        json_string(&json, "name", row->name);
        json_integer(&json, "count", row->count);
        json_integer(&json, "carved", row->carved);
        json_values(&json, "truth", row, row->truth);
        json_values(&json, "start", row, row->start);
        json_values(&json, "found", row, row->found);
        bool mesh = row->points[COLUMN_TRUTH] != 0;
        json_number(&json, "error", row->truth || mesh ? row->error : (double)NAN);
        json_string(&json, "measure", measure_of(row));
        if (row->truth && rey_fit_row_is_pose(row)) {
            json_number(&json, "distance", rey_pose_distance(row->found, row->truth));
            json_number(&json, "angle", rey_pose_turned(row->found, row->truth));
        }
        if (mesh) {
            json_number(&json, "start_error", row->chamfer[COLUMN_START]);
        }
        json_object_end(&json);
    }
    json_array_end(&json);
    json_array(&json, "held_out");
    for (size_t i = 0; i < result->held_out.count; i++) {
        const FitHeldOut *held = &ARRAY_AT(result->held_out, FitHeldOut, i);
        json_object(&json, NULL);
        json_integer(&json, "view", held->view);
        json_number(&json, "psnr", held->psnr);
        json_object_end(&json);
    }
    json_array_end(&json);
    cli_json_notes(&json, session);
    json_string(&json, "output", result->output);
    json_string(&json, "report", result->report);
    json_string(&json, "scene", result->scene);
    json_object_end(&json);
    json_end(&json);
}

static void print_words(const FitResult *result) {
    char words[64];
    print_table(result);
    printf("\n%lld unknown%s, %d iteration%s%s, ", (long long)result->numbers, PLURAL(result->numbers), result->iterations,
           PLURAL(result->iterations), result->converged ? " (converged)" : "");
    if (result->seconds_before > 0) {
        printf("%.1f s in this run, %.1f s in all runs", cli_seconds_total(), result->seconds_before + cli_seconds_total());
    } else {
        printf("%.1f s (%.1f s in all)", result->seconds, cli_seconds_total());
    }
    if (result->iterations) {
        rey_fit_loss_words(result, words, sizeof words);
        printf(", loss %.4g (%s)\n", result->loss, words);
    } else {
        printf(", no loss: nothing was rendered\n");
    }
    if (result->nonfinite) {
        cli_note("warning: %lld sample%s not finite and left out of losses and gradients", (long long)result->nonfinite,
                 result->nonfinite == 1 ? " was" : "s were");
    }
    for (size_t i = 0; i < result->rows.count; i++) {
        const FitRow *row = &ARRAY_AT(result->rows, FitRow, i);
        if (row->carved) {
            printf("%s: %lld of %lld numbers lie outside of a silhouette and stay empty\n", row->name, (long long)row->carved,
                   (long long)row->count);
        }
    }
    for (size_t i = 0; i < result->held_out.count; i++) {
        const FitHeldOut *held = &ARRAY_AT(result->held_out, FitHeldOut, i);
        printf("view %d, held out: PSNR %.1f dB\n", held->view, held->psnr);
    }
    if (result->report) {
        printf("report  %s\n", result->report);
    }
    if (result->scene) {
        printf("scene   %s\n", result->scene);
    } else if (result->note) {
        cli_note("the recovered scene was not written: %s", result->note);
    }
}

// What a user would not guess from the table.
static void print_end(const FitResult *result, bool resumed) {
    fflush(stdout); // these words stand below the table
    int done = result->iterations;
    if (resumed && done == result->iterations_before && result->converged) {
        cli_note("nothing was left to do: the stop rule has ended this fit after %d iteration%s; table and report are made again",
                 done, PLURAL(done));
    } else if (resumed && done == result->iterations_before) {
        cli_note("nothing was left to do: %d iteration%s done already, --set iterations=N with a larger N asks for more; table "
                 "and report are made again", done, done == 1 ? " was" : "s were");
    }
    if (result->rose) {
        cli_note("warning: the loss rose to more than twice what it began with: lower the learning rate");
    }
    if (result->falling) {
        cli_note("the loss was still falling when the iterations ended: --resume --set iterations=%lld goes on from there",
                 2 * (long long)done);
    }
}

static void free_overrides(char **texts, int count) {
    for (int i = 0; i < count && texts; i++) {
        free(texts[i]);
    }
    free(texts);
}

// PREFIX NAME="VALUE", owned; null when there is no memory.
static char *entry_text(const char *prefix, const char *name, const char *value) {
    size_t size = strlen(prefix) + strlen(name) + 2 * strlen(value) + 8;
    char *text = malloc(size);
    int at = text ? snprintf(text, size, "%s%s=\"", prefix, name) : 0;
    for (const char *c = value; text && *c; c++) {
        if (*c == '"' || *c == '\\') {
            text[at++] = '\\';
        }
        text[at++] = *c;
    }
    if (text) {
        memcpy(text + at, "\"", 2);
    }
    return text;
}

// -D, --load and --spp are entries of the job, as --set would write them. Returns the overrides, owned with their texts; null when
// there is no memory.
static char **job_overrides(const Options *o, int *count) {
    char **texts = calloc((size_t)(o->set_count + o->define_count + 2), sizeof *texts);
    bool whole = texts != NULL;
    int n = 0;
    if (o->load_count && whole) { // relative to the job's folder where a job says it, to the current one here
        char *absolute = realpath(o->loads[0], NULL);
        whole = (texts[n++] = entry_text("", "load", absolute ? absolute : o->loads[0])) != NULL;
        free(absolute);
    }
    for (int i = 0; i < o->set_count && whole; i++) {
        whole = (texts[n++] = strdup(o->sets[i])) != NULL;
    }
    for (int i = 0; i < o->define_count && whole; i++) {
        whole = (texts[n++] = entry_text("defines.", o->defines[i].name, o->defines[i].value)) != NULL;
    }
    if (o->spp && whole) {
        char text[32];
        snprintf(text, sizeof text, "spp=%d", o->spp);
        whole = (texts[n++] = strdup(text)) != NULL;
    }
    *count = n;
    if (!whole) {
        free_overrides(texts, n);
        return NULL;
    }
    return texts;
}

// The command line, with what a shell would split in quotes.
static char *command_text(int argc, char **argv) {
    size_t size = sizeof "reynolds";
    for (int i = 0; i < argc; i++) {
        size += 4 * strlen(argv[i]) + 3;
    }
    char *text = malloc(size);
    size_t at = text ? (size_t)snprintf(text, size, "reynolds") : 0;
    for (int i = 0; text && i < argc; i++) {
        const char *c = argv[i];
        bool plain = c[0] && !c[strcspn(c, " \t\n'\"$&|;<>()*?[]{}\\`!#~")];
        text[at++] = ' ';
        if (plain) {
            at += (size_t)snprintf(text + at, size - at, "%s", c);
            continue;
        }
        text[at++] = '\'';
        for (; *c; c++) { // a quote ends the quoted text, stands by itself, and begins another
            at += (size_t)snprintf(text + at, size - at, *c == '\'' ? "'\\''" : "%c", *c);
        }
        text[at++] = '\'';
        text[at] = '\0';
    }
    return text;
}

// An entry that -D, --load or --spp stands for is told as what the user wrote.
static void name_option(const Options *o, rey_context *ctx, rey_result code, const char *entry) {
    char message[2048], prefix[256], option[512] = "";
    snprintf(message, sizeof message, "%s", rey_error(ctx));
    int length = snprintf(prefix, sizeof prefix, "--set %.200s: ", entry);
    if (strncmp(message, prefix, (size_t)length)) {
        return;
    }
    if (!strncmp(entry, "load=", 5) && o->load_count) {
        snprintf(option, sizeof option, "--load %s", o->loads[0]);
    }
    for (int i = 0; i < o->define_count && !strncmp(entry, "defines.", 8); i++) {
        size_t name = strlen(o->defines[i].name);
        if (!strncmp(entry + 8, o->defines[i].name, name) && entry[8 + name] == '=') {
            snprintf(option, sizeof option, "-D %s=%s", o->defines[i].name, o->defines[i].value);
        }
    }
    if (!strncmp(entry, "spp=", 4) && o->spp) {
        snprintf(option, sizeof option, "--spp %d", o->spp);
    }
    if (option[0]) {
        rey_fail(ctx, code, "%s: %s", option, message + length);
    }
}

static int run(const Options *options, Session *session, const char *command) {
    int override_count = 0;
    char **overrides = job_overrides(options, &override_count);
    if (!overrides) {
        return cli_fail(options, "out of memory");
    }
    Display display = {.terminal = isatty(STDERR_FILENO) != 0, .shown = rey_seconds(), .session = session};
    FitDef def = {.job_path = options->files[0],
                  .overrides = (const char *const *)overrides,
                  .override_count = override_count,
                  .output = options->output,
                  .command = command,
                  .resume = options->resume,
                  .overwrite = options->overwrite,
                  .seed_given = options->seed_given,
                  .seed = options->seed,
                  .progress = show_progress,
                  .note = show_note,
                  .user = &display};
    FitResult result;
    rey_result code = rey_fit(session->ctx, &def, &result);
    int status = EXIT_OK;
    for (int i = 0; i < override_count && code; i++) { // those of --set come in between: their texts are the user's own
        bool set = false;
        for (int k = 0; k < options->set_count; k++) {
            set = set || !strcmp(overrides[i], options->sets[k]);
        }
        if (!set) {
            name_option(options, session->ctx, code, overrides[i]);
        }
    }
    if (display.terminal) {
        fprintf(stderr, "\r\033[K");
    }
    if (code == REY_ERROR_CANCELLED) {
        cli_note("%s", rey_error(session->ctx));
        if (options->json) {
            cli_json_error(rey_error(session->ctx), rey_result_text(code));
        }
        status = EXIT_INTERRUPTED;
    } else if (result.bad_override) {
        status = cli_usage_error(options, "%s", rey_error(session->ctx));
    } else if (code) {
        status = cli_report_failure(options, session->ctx, code);
    } else {
        if (options->json) {
            print_json(&result, session);
        } else {
            print_words(&result);
        }
        print_end(&result, options->resume);
        status = cli_finish_output();
    }
    rey_fit_result_free(&result);
    free_overrides(overrides, override_count);
    return status;
}

int cli_fit(int argc, char **argv) {
    Options options;
    Session session;
    int status;
    if (!cli_options_parse(COMMAND_FIT, argc, argv, &options, &status)) {
        return status;
    }
    cli_catch_terminations();
    cli_say_when_interrupted("\nreynolds: finishing what is at work, then saving; a second Ctrl-C ends at once\n");
    status = cli_context_open(&options, &session);
    if (!status) {
        char *command = command_text(argc, argv);
        status = run(&options, &session, command);
        free(command);
        cli_session_close(&session);
    }
    cli_options_free(&options);
    return status;
}
