// scene_info.c: `reynolds info`: what a scene holds.
#include "cli.h"

#include "base/context.h"
#include "base/parallel.h"
#include "io/mitsuba.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

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

// What a scene lacks to make a picture that is not black.
typedef struct Lack {
    const char *name, *words;
} Lack;
enum { MOST_LACKS = 4 };
static int find_lacks(const rey_scene_info *info, Lack lacks[MOST_LACKS]) {
    const struct {
        bool lacks;
        Lack lack;
    } all[MOST_LACKS] = {
        {!info->integrator[0], {"integrator", "no integrator, such as <integrator type=\"path\"/>: nothing can be rendered"}},
        {!info->sensors, {"sensor", "no sensor, such as <sensor type=\"perspective\">: nothing can be rendered"}},
        {!info->shapes && !info->instances, {"shape", "no shape"}},
        {!info->emitters, {"emitter", "no emitter: without light, pictures are black unless a medium glows"}},
    };
    int count = 0;
    for (int i = 0; i < MOST_LACKS; i++) {
        if (all[i].lacks) {
            lacks[count++] = all[i].lack;
        }
    }
    return count;
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
    if (info.shapes > 0) {
        printf("%-17s %g %g %g to %g %g %g\n", "bounds", info.bounds[0], info.bounds[1], info.bounds[2], info.bounds[3],
               info.bounds[4], info.bounds[5]);
    }
    if (info.integrator[0]) {
        printf("%-17s %s, max_depth %d, rr_depth %d\n", "integrator", info.integrator, info.max_depth, info.rr_depth);
    }
    if (info.sensors > 0) {
        printf("%-17s %d\n", "samples per pixel", info.sample_count);
    }
    for (int i = 0; i < rey_scene_sensor_count(s->scene); i++) {
        int width, height;
        if (rey_scene_film_size(s->scene, i, &width, &height) == REY_OK) {
            const char *id = rey_mitsuba_sensor_id(s->scene, i);
            char name[256];
            snprintf(name, sizeof name, "sensor %d%s%s%s", i, id ? " '" : "", id ? id : "", id ? "'" : "");
            printf("%-*s %d x %d pixels,", cli_pad(name, 17), name, width, height);
            for (int c = 0; c < rey_film_channel_count(s->scene, i); c++) {
                printf(" %s", rey_film_channel_name(s->scene, i, c));
            }
            printf("\n");
        }
    }
    Lack lacks[MOST_LACKS];
    int lack_count = find_lacks(&info, lacks);
    for (int i = 0; i < lack_count; i++) {
        printf("missing: %s\n", lacks[i].words);
    }
    for (int i = 0; i < rey_scene_note_count(s->scene); i++) {
        printf("note: %s\n", rey_scene_note(s->scene, i));
    }
}

static void json_missing(Json *json, const rey_scene_info *info) {
    Lack lacks[MOST_LACKS];
    int count = find_lacks(info, lacks);
    json_array(json, "missing");
    for (int i = 0; i < count; i++) {
        json_string(json, NULL, lacks[i].name);
    }
    json_array_end(json);
}

static void json_sensors(Json *json, const Session *s) {
    json_array(json, "films");
    for (int i = 0; i < rey_scene_sensor_count(s->scene); i++) {
        int width = 0, height = 0;
        rey_scene_film_size(s->scene, i, &width, &height);
        json_array(json, NULL);
        json_integer(json, NULL, width);
        json_integer(json, NULL, height);
        json_array_end(json);
    }
    json_array_end(json);
    json_array(json, "film_channels");
    for (int i = 0; i < rey_scene_sensor_count(s->scene); i++) {
        json_array(json, NULL);
        for (int c = 0; c < rey_film_channel_count(s->scene, i); c++) {
            json_string(json, NULL, rey_film_channel_name(s->scene, i, c));
        }
        json_array_end(json);
    }
    json_array_end(json);
    json_array(json, "sensor_ids");
    for (int i = 0; i < rey_scene_sensor_count(s->scene); i++) {
        json_string(json, NULL, rey_mitsuba_sensor_id(s->scene, i));
    }
    json_array_end(json);
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
    for (int i = 0; i < 6 && info.shapes > 0; i++) {
        json_number(&json, NULL, info.bounds[i]);
    }
    json_array_end(&json);
    json_string(&json, "integrator", info.integrator[0] ? info.integrator : NULL);
    json_number(&json, "max_depth", info.integrator[0] ? info.max_depth : (double)NAN);
    json_number(&json, "rr_depth", info.integrator[0] ? info.rr_depth : (double)NAN);
    json_array(&json, "channels");
    for (int i = 0; i < rey_channel_count(s->scene); i++) {
        json_string(&json, NULL, rey_channel_name(s->scene, i));
    }
    json_array_end(&json);
    json_number(&json, "sample_count", info.sensors ? info.sample_count : (double)NAN);
    json_missing(&json, &info);
    json_sensors(&json, s);
    json_array(&json, "notes");
    for (int i = 0; i < rey_scene_note_count(s->scene); i++) {
        json_string(&json, NULL, rey_scene_note(s->scene, i));
    }
    json_array_end(&json);
    cli_json_ignored(&json, s);
    json_object_end(&json);
    json_end(&json);
}

int cli_info(int argc, char **argv) {
    Options options;
    Session session;
    int status;
    if (!cli_options_parse(COMMAND_INFO, argc, argv, &options, &status)) {
        return status;
    }
    status = cli_session_open(&options, "info", &session);
    if (!status) {
        (options.json ? print_info_json : print_info)(&session);
        cli_session_close(&session);
        status = cli_finish_output();
    }
    cli_options_free(&options);
    return status;
}
