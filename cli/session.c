// session.c: contexts and scenes of the subcommands, interruption, progress, and reports.
#include "cli.h"

#include "base/context.h"
#include "base/parallel.h"
#include "io/file.h"
#include "io/mitsuba.h"
#include "render/used.h"

#include <errno.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum { SHOWN_NAMES = 3 }; // of a list

static volatile sig_atomic_t interrupted; // the one thing that a signal handler can reach
static const char *volatile parting;      // and what it says at the first signal, null = nothing

static void on_interrupt(int number) {
    UNUSED(number);
    if (parting && !interrupted) {
        int error = errno;
        ssize_t written = write(STDERR_FILENO, parting, strlen(parting));
        UNUSED(written);
        errno = error;
    }
    interrupted = 1;
}

void cli_say_when_interrupted(const char *words) { parting = words; }

void cli_catch_interrupts(void) {
    struct sigaction action = {.sa_handler = on_interrupt, .sa_flags = (int)SA_RESETHAND};
    sigemptyset(&action.sa_mask);
    sigaction(SIGINT, &action, NULL);
    action.sa_handler = SIG_IGN; // a write past the limit of file sizes fails, and is reported
    sigaction(SIGXFSZ, &action, NULL);
}

void cli_catch_terminations(void) {
    static const int numbers[] = {SIGTERM, SIGHUP}; // a batch system takes the machine away; a terminal is closed
    // Whoever ends a job may say so to it and to its group: the second one is the same request.
    struct sigaction action = {.sa_handler = on_interrupt}, former;
    sigemptyset(&action.sa_mask);
    for (int i = 0; i < COUNT_OF(numbers); i++) {
        if (!sigaction(numbers[i], NULL, &former) && former.sa_handler != SIG_IGN) { // nohup has it ignored
            sigaction(numbers[i], &action, NULL);
        }
    }
}

bool cli_interrupted(void) {
    return interrupted != 0;
}

double cli_seconds_total(void) {
    static double start; // set by the first call, which main makes
    if (start == 0) {
        start = rey_seconds();
    }
    return rey_seconds() - start;
}

Progress cli_progress(const char *label) {
    return (Progress){.label = label, .parts = 1, .visible = isatty(STDERR_FILENO) != 0};
}

bool cli_progress_step(void *user, double fraction) {
    Progress *p = user;
    double now = rey_seconds();
    if (p->start == 0) {
        p->start = now;
        p->shown = now; // short calls show nothing
    }
    if (p->visible && now - p->shown > 0.2) {
        double done = (p->part + fraction) / p->parts;
        fprintf(stderr, "\r\033[K%s %3.0f %%", p->label, 100 * done);
        if (done > 0) {
            fprintf(stderr, "  %.0f s left", (now - p->start) * (1 - done) / done);
        }
        p->shown = now;
    }
    return !cli_interrupted();
}

void cli_progress_end(Progress *progress) {
    if (progress->visible && progress->shown > progress->start) {
        fprintf(stderr, "\r\033[K");
    }
}

void cli_note(const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    fprintf(stderr, "reynolds: ");
    vfprintf(stderr, format, arguments);
    fputc('\n', stderr);
    va_end(arguments);
}

void cli_session_note(Session *session, const char *format, ...) {
    char text[2048];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    cli_note("%s", text);
    char **longer = realloc(session->notes, (size_t)(session->note_count + 1) * sizeof *longer);
    if (longer) { // without memory it was said, at least
        session->notes = longer;
        longer[session->note_count] = strdup(text);
        session->note_count += longer[session->note_count] != NULL;
    }
}

void cli_json_error(const char *message, const char *kind) {
    Json json = json_begin(stdout);
    json_object(&json, NULL);
    json_string(&json, "error", message);
    json_string(&json, "kind", kind);
    json_object_end(&json);
    json_end(&json);
}

void cli_warn_nonfinite(const rey_stats *stats) {
    if (stats->nonfinite > 0) {
        cli_note("warning: %lld sample%s of %lld path%s not finite and left out", (long long)stats->nonfinite,
                 PLURAL(stats->nonfinite), (long long)stats->paths, stats->paths == 1 ? " was" : "s were");
    }
}

static void report(const Options *options, const char *message, rey_result result) {
    cli_note("%s", message);
    if (options->json) {
        cli_json_error(message, rey_result_text(result));
    }
}

int cli_report_failure(const Options *options, const rey_context *ctx, rey_result result) {
    if (result == REY_ERROR_CANCELLED && cli_interrupted()) {
        report(options, "interrupted", result);
        return EXIT_INTERRUPTED;
    }
    const char *message = rey_error(ctx);
    report(options, message[0] ? message : rey_result_text(result), result);
    return EXIT_FAILED;
}

int cli_report(const Options *options, const rey_context *ctx, rey_result result) {
    return result == REY_ERROR_ARGUMENT ? cli_usage_error(options, "%s", rey_error(ctx))
                                        : cli_report_failure(options, ctx, result);
}

int cli_fail(const Options *options, const char *format, ...) {
    char message[2048];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(message, sizeof message, format, arguments);
    va_end(arguments);
    report(options, message, REY_ERROR_ARGUMENT);
    return EXIT_FAILED;
}

int cli_finish_output(void) {
    if (fflush(stdout) || ferror(stdout)) {
        cli_note("standard output could not be written");
        return EXIT_FAILED;
    }
    return EXIT_OK;
}

int cli_context_open(const Options *options, Session *session) {
    *session = (Session){.options = options};
    rey_context_def def = rey_default_context_def();
    def.threads = options->threads;
    def.lanes = options->lanes;
    rey_result result = rey_context_create(&def, &session->ctx);
    if (result == REY_ERROR_UNSUPPORTED) {
        return cli_fail(options, "this machine cannot run %d lanes, at most %d", options->lanes, rey_widest_lanes());
    }
    if (result == REY_ERROR_ARGUMENT) {
        return cli_fail(options, "%s", rey_context_problem(&def));
    }
    return result ? cli_fail(options, "%s", rey_result_text(result)) : EXIT_OK;
}

// Whether what comes out can be written, before the work.
static rey_result check_output(Session *s) {
    const Options *o = s->options;
    char path[4096];
    if (!o->output || !strcmp(o->output, "-")) {
        return REY_OK;
    }
    if (!o->reverse) {
        return rey_file_check_output(s->ctx, o->output);
    }
    s->made_folder = mkdir(o->output, 0777) == 0;
    if (!s->made_folder && errno != EEXIST) {
        return rey_fail(s->ctx, REY_ERROR_IO, "%s: cannot make this folder: %s", o->output, strerror(errno));
    }
    snprintf(path, sizeof path, "%s/gradient.json", o->output);
    return rey_file_check_output(s->ctx, path);
}

rey_result cli_refuse_input(const Session *s, const char *path) {
    const Options *o = s->options;
    bool reads = false;
    rey_result result = rey_mitsuba_reads_file(s->scene, path, &reads);
    for (int i = 0; i < o->load_count; i++) {
        const char *equals = strchr(o->loads[i], '=');
        reads = reads || rey_file_same(equals ? equals + 1 : o->loads[i], path);
    }
    for (int i = 0; i < o->param_count; i++) {
        const char *tangent = cli_direction_file(o->params[i]);
        reads = reads || (tangent && rey_file_same(tangent, path));
    }
    reads = reads || (o->adjoint && rey_file_same(o->adjoint, path));
    return result || !reads ? result
                            : rey_fail(s->ctx, REY_ERROR_ARGUMENT, "%s is both read and written; name another file for the result",
                                       path);
}

// By number or by id; the message lists what there is.
static rey_result find_sensor(Session *s, int count) {
    const Options *o = s->options;
    char list[512];
    s->sensor = o->sensor_id ? rey_mitsuba_sensor(s->scene, o->sensor_id) : o->sensor;
    if (count == 0) {
        s->sensor = 0; // that there is none, the size of the film tells
    }
    if (count == 0 || (s->sensor >= 0 && s->sensor < count)) {
        return REY_OK;
    }
    rey_mitsuba_list_sensors(s->scene, list, sizeof list);
    return o->sensor_id ? rey_fail(s->ctx, REY_ERROR_ARGUMENT, "--sensor: the scene has no sensor '%s': %s", o->sensor_id, list)
                        : rey_fail(s->ctx, REY_ERROR_ARGUMENT, "--sensor: the scene has %d sensor%s, counted from 0, got %d: %s",
                                   count, PLURAL(count), o->sensor, list);
}

static bool is_job_name(const char *path) {
    const char *dot = strrchr(path, '.');
    return dot && (!strcmp(dot, ".yaml") || !strcmp(dot, ".yml"));
}

static rey_result load_scene(Session *s) {
    const Options *o = s->options;
    rey_result result = check_output(s);
    if (result) {
        return result;
    }
    double start = rey_seconds();
    result = (o->lenient ? rey_scene_load_lenient : rey_scene_load)(s->ctx, o->files[0], o->defines, o->define_count,
                                                                    &s->scene);
    s->load_seconds = rey_seconds() - start;
    if (!result && o->output && strcmp(o->output, "-") != 0 && !o->reverse) {
        result = cli_refuse_input(s, o->output);
    } else if (result == REY_ERROR_FORMAT && is_job_name(o->files[0])) {
        char why[1024];
        snprintf(why, sizeof why, "%s", rey_error(s->ctx));
        result = rey_fail(s->ctx, result, "%s; jobs are for 'reynolds fit'", why);
    }
    if (result) {
        return result;
    }
    result = cli_load_values(o, s->ctx, s->scene);
    if (result) {
        return result;
    }
    for (int i = 0; i < rey_scene_ignored_count(s->scene); i++) {
        cli_note("ignored: %s", rey_scene_ignored(s->scene, i));
    }
    for (int i = 0; i < rey_scene_note_count(s->scene); i++) {
        const char *note = rey_scene_note(s->scene, i);
        bool derivative = o->command == COMMAND_GRAD || o->command == COMMAND_CHECK;
        if (o->command != COMMAND_INFO &&
            (!strncmp(note, "warning: ", 9) || (derivative && !strncmp(note, "derivatives: ", 13)))) {
            cli_session_note(s, "%s", note);
        }
    }
    rey_scene_info info;
    rey_scene_get_info(s->scene, &info);
    if (o->command != COMMAND_RENDER && o->command != COMMAND_GRAD && o->command != COMMAND_CHECK) {
        return REY_OK;
    }
    if (!info.integrator[0]) {
        return rey_fail(s->ctx, REY_ERROR_SCENE,
                        "%s: the scene has no integrator, expected one such as <integrator type=\"path\"/>", o->files[0]);
    }
    result = find_sensor(s, (int)info.sensors);
    return result ? result : rey_scene_film_size(s->scene, s->sensor, &s->width, &s->height);
}

int cli_session_open(const Options *options, const char *label, Session *session) {
    int status = cli_context_open(options, session);
    if (status) {
        return status;
    }
    rey_result result = load_scene(session);
    if (result || cli_interrupted()) {
        status = cli_interrupted() ? cli_report_failure(options, session->ctx, REY_ERROR_CANCELLED)
                                   : cli_report(options, session->ctx, result);
        cli_session_close(session);
        return status;
    }
    session->progress = cli_progress(label);
    rey_render_def def = rey_default_render_def();
    def.spp = options->spp;
    def.seed = options->seed;
    def.sensor = session->sensor;
    def.sampler = options->sampler;
    def.estimator = options->estimator;
    def.terms = options->terms;
    def.progress = cli_progress_step;
    def.user = &session->progress;
    session->def = def;
    return EXIT_OK;
}

void cli_session_close(Session *session) {
    if (session->made_folder) {
        rmdir(session->options->output); // fails, as it should, where there is anything in it
    }
    rey_scene_destroy(session->scene);
    rey_context_destroy(session->ctx);
    for (int i = 0; i < session->note_count; i++) {
        free(session->notes[i]);
    }
    free(session->notes);
    session->scene = NULL;
    session->ctx = NULL;
    session->notes = NULL;
    session->note_count = 0;
    session->made_folder = false;
}

void cli_list_add(char *text, size_t size, int *count, const char *name) {
    size_t used = strlen(text);
    if ((*count)++ < SHOWN_NAMES) {
        snprintf(text + used, size - used, "%s%s", used ? ", " : "", name);
    }
}

void cli_list_end(char *text, size_t size, int count) {
    size_t used = strlen(text);
    if (count > SHOWN_NAMES) {
        snprintf(text + used, size - used, " and %d more", count - SHOWN_NAMES);
    }
}

rey_result cli_note_unreached(Session *s, const int *params, int count) {
    size_t all = (size_t)rey_param_count(s->scene);
    bool *used = rey_alloc_array(s->ctx, all, sizeof *used), *reached = rey_alloc_array(s->ctx, all, sizeof *reached);
    rey_result result = used && reached ? rey_params_used(s->scene, used) : REY_ERROR_MEMORY;
    char unused[768] = "", elsewhere[768] = "";
    int unused_count = 0, elsewhere_count = 0;
    result = result ? result : rey_params_reached(s->scene, s->sensor, reached);
    for (int i = 0; i < count && !result; i++) {
        rey_param_info info;
        result = rey_param_get_info(s->scene, params[i], &info);
        if (!result && !used[params[i]]) {
            cli_list_add(unused, sizeof unused, &unused_count, info.name);
        } else if (!result && !reached[params[i]]) {
            cli_list_add(elsewhere, sizeof elsewhere, &elsewhere_count, info.name);
        }
    }
    cli_list_end(unused, sizeof unused, unused_count);
    cli_list_end(elsewhere, sizeof elsewhere, elsewhere_count);
    if (!result && unused_count) {
        cli_session_note(s, "nothing in the scene uses %s: %s 0", unused,
                         unused_count == 1 ? "its derivative is" : "their derivatives are");
    }
    if (!result && elsewhere_count) {
        const char *id = rey_mitsuba_sensor_id(s->scene, s->sensor);
        cli_session_note(s, "the picture of sensor %d%s%s%s does not depend on %s, which belong%s to another sensor: %s 0; "
                         "--sensor chooses", s->sensor, id ? " ('" : "", id ? id : "", id ? "')" : "", elsewhere,
                         elsewhere_count == 1 ? "s" : "", elsewhere_count == 1 ? "its derivative is" : "their derivatives are");
    }
    rey_free(s->ctx, used);
    rey_free(s->ctx, reached);
    return result;
}

int cli_session_direction(Session *session, const char *const *specs, int spec_count, Direction *direction) {
    rey_result result = cli_direction_build(session->ctx, session->scene, specs, spec_count, direction);
    if (!result && !session->options->all) {
        result = cli_direction_check_terms(session->ctx, session->scene, direction, session->options->terms);
    }
    if (!result && session->options->command == COMMAND_GRAD) {
        result = cli_note_unreached(session, direction->params, direction->count);
    }
    bool notes = !session->options->all && session->options->command != COMMAND_PARAMS;
    for (int i = 0; i < spec_count && !result && notes; i++) {
        if (cli_direction_bare_pose(session->scene, specs[i])) {
            cli_session_note(session, "%s moves all entries of the matrix; :translate=x,y,z, :rotate=ax,ay,az@cx,cy,cz and "
                             ":scale=S@cx,cy,cz move what it places", specs[i]);
        }
    }
    return result ? cli_report(session->options, session->ctx, result) : EXIT_OK;
}

void cli_add_stats(rey_stats *sum, const rey_stats *part) {
    sum->seconds += part->seconds;
    sum->trace_seconds += part->trace_seconds;
    sum->thread_seconds += part->thread_seconds;
    sum->paths += part->paths;
    sum->rays += part->rays;
    sum->nonfinite += part->nonfinite;
    sum->missing_terms |= part->missing_terms;
}

void cli_json_ignored(Json *json, const Session *session) {
    if (!session->options->lenient) {
        return;
    }
    json_array(json, "ignored");
    for (int i = 0; i < rey_scene_ignored_count(session->scene); i++) {
        json_string(json, NULL, rey_scene_ignored(session->scene, i));
    }
    json_array_end(json);
}

void cli_json_notes(Json *json, const Session *session) {
    json_array(json, "notes");
    for (int i = 0; i < session->note_count; i++) {
        json_string(json, NULL, session->notes[i]);
    }
    json_array_end(json);
}

void cli_json_stats(Json *json, const Session *session, const rey_stats *stats) {
    double seconds = stats->seconds;
    json_number(json, "seconds", seconds);
    json_number(json, "seconds_total", cli_seconds_total());
    json_number(json, "load_seconds", session->load_seconds);
    json_integer(json, "paths", stats->paths);
    json_integer(json, "rays", stats->rays);
    json_number(json, "paths_per_second", seconds > 0 ? (double)stats->paths / seconds : 0);
    json_number(json, "rays_per_second", seconds > 0 ? (double)stats->rays / seconds : 0);
    json_number(json, "trace_share", stats->thread_seconds > 0 ? stats->trace_seconds / stats->thread_seconds : 0);
    json_number(json, "peak_rss_mb", (double)rey_peak_rss() / 1e6);
    json_integer(json, "threads", rey_threads(session->ctx));
    json_integer(json, "lanes", rey_lanes(session->ctx));
    json_integer(json, "nonfinite", stats->nonfinite);
    cli_json_notes(json, session);
}
