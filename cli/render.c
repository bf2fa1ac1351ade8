// render.c: `reynolds render`.
#include "cli.h"

#include "base/context.h"

#include <math.h>
#include <stdio.h>

static void print_json(const Session *s, const rey_stats *stats) {
    Json json = json_begin(stdout);
    json_object(&json, NULL);
    cli_json_stats(&json, s, stats);
    json_integer(&json, "width", s->width);
    json_integer(&json, "height", s->height);
    json_string(&json, "output", s->options->output);
    cli_json_ignored(&json, s);
    json_object_end(&json);
    json_end(&json);
}

// A black picture of a scene without light is what was asked for, and hardly what was meant.
static void note_darkness(const Session *s, const float *image, int channels) {
    rey_scene_info info;
    rey_scene_get_info(s->scene, &info);
    int64_t count = (int64_t)s->width * s->height * channels;
    bool black = info.emitters == 0;
    for (int64_t i = 0; i < count && black; i++) {
        black = image[i] == 0 || i % channels >= 3;
    }
    if (black) {
        cli_note("the picture is black: the scene has no emitter");
    }
}

// Samples that are not finite are left out; sums of large ones may still be beyond what a picture holds.
static void note_overflow(const Session *s, const float *image, int channels) {
    int64_t count = (int64_t)s->width * s->height * channels, endless = 0;
    for (int64_t i = 0; i < count; i++) {
        endless += i % channels < 3 && !isfinite(image[i]);
    }
    if (endless > 0) {
        cli_note("warning: %lld number%s of the picture %s not finite: more light than 3.4e38", (long long)endless, PLURAL(endless),
                 endless == 1 ? "is" : "are");
    }
}

static rey_result render(Session *s, rey_stats *stats) {
    int channels = rey_film_channel_count(s->scene, s->def.sensor);
    float *image = rey_alloc_array(s->ctx, (size_t)s->width * (size_t)s->height, (size_t)channels * sizeof *image);
    const char **names = rey_alloc_array(s->ctx, (size_t)channels, sizeof *names);
    rey_result result = image && names ? REY_OK : REY_ERROR_MEMORY;
    for (int i = 0; i < channels && names; i++) {
        names[i] = rey_film_channel_name(s->scene, s->def.sensor, i);
    }
    result = result ? result : rey_render_film(s->scene, &s->def, image, stats);
    cli_progress_end(&s->progress);
    if (!result) {
        note_darkness(s, image, channels);
        note_overflow(s, image, channels);
    }
    if (!result && s->options->output) {
        result = cli_write_film(s->ctx, s->options->output, image, s->width, s->height, channels, names,
                                rey_film_component(s->scene, s->def.sensor));
    }
    rey_free(s->ctx, names);
    rey_free(s->ctx, image);
    return result;
}

int cli_render(int argc, char **argv) {
    Options options;
    Session session;
    int status;
    if (!cli_options_parse(COMMAND_RENDER, argc, argv, &options, &status)) {
        return status;
    }
    cli_catch_terminations();
    status = cli_session_open(&options, "render", &session);
    if (!status) {
        rey_stats stats = {0};
        rey_result result = render(&session, &stats);
        cli_warn_nonfinite(&stats);
        if (result) {
            status = cli_report_failure(&options, session.ctx, result);
        } else if (options.json) {
            print_json(&session, &stats);
        } else {
            cli_note("%d x %d pixels, %.3f s, %.2f million paths/s, %.2f million rays/s", session.width, session.height,
                     stats.seconds, (double)stats.paths / stats.seconds / 1e6,
                     (double)stats.rays / stats.seconds / 1e6);
        }
        status = status ? status : cli_finish_output();
        cli_session_close(&session);
    }
    cli_options_free(&options);
    return status;
}
