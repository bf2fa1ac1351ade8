// convert.c: `reynolds convert`: a scene written back as one that stands alone.
#include "cli.h"

#include "io/file.h"
#include "io/save.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

static void print_json(const Session *s) {
    Json json = json_begin(stdout);
    json_object(&json, NULL);
    json_string(&json, "output", s->options->files[1]);
    json_integer(&json, "parameters", rey_param_count(s->scene));
    cli_json_ignored(&json, s);
    json_object_end(&json);
    json_end(&json);
}

// OUT.xml, and OUT_data beside it where the scene has meshes or pictures.
static void say_what_was_written(const char *path) {
    char folder[4096];
    snprintf(folder, sizeof folder, "%.*s_data", (int)(strlen(path) - strlen(".xml")), path);
    if (access(folder, F_OK) == 0) {
        cli_note("wrote %s, and its meshes and pictures to %s", path, folder);
    } else {
        cli_note("wrote %s", path);
    }
}

// What was left out may be missed by who reads the scene with less patience.
static rey_result read_back(const Session *s) {
    rey_scene *scene = NULL;
    rey_result result = s->options->lenient ? rey_scene_load(s->ctx, s->options->files[1], NULL, 0, &scene) : REY_OK;
    rey_scene_destroy(scene);
    return result;
}

int cli_convert(int argc, char **argv) {
    Options options;
    Session session;
    int status;
    if (!cli_options_parse(COMMAND_CONVERT, argc, argv, &options, &status)) {
        return status;
    }
    options.output = options.files[1];
    if (rey_file_same(options.files[0], options.files[1])) {
        status = cli_usage_error(&options, "%s is both read and written; name another file for the result", options.files[1]);
        cli_options_free(&options);
        return status;
    }
    status = cli_session_open(&options, "convert", &session);
    if (!status) {
        rey_result result = rey_mitsuba_save_anew(session.scene, options.files[1]);
        if (result) {
            status = cli_report_failure(&options, session.ctx, result);
        } else if ((result = read_back(&session))) {
            cli_note("%s was written, and cannot be read without --lenient:", options.files[1]);
            status = cli_report_failure(&options, session.ctx, result);
        } else if (options.json) {
            print_json(&session);
        } else {
            say_what_was_written(options.files[1]);
        }
        status = status ? status : cli_finish_output();
        cli_session_close(&session);
    }
    cli_options_free(&options);
    return status;
}
