// former.c: what an earlier fit left in a folder. A report or a recovered scene that stays there would be taken for the new fit's.
#include "fit/former.h"

#include "io/file.h"
#include "io/mitsuba.h"

#include <dirent.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static bool has_file(const Fit *fit, const char *name) {
    char path[4096];
    return (size_t)snprintf(path, sizeof path, "%s/%s", fit->output, name) < sizeof path && access(path, F_OK) == 0;
}

bool rey_former_exists(const Fit *fit) {
    return has_file(fit, "checkpoint.bin") || has_file(fit, "job.resolved.yaml");
}

// Does a name match a pattern, in which # stands for digits and a * at the end for anything?
static bool matches(const char *name, const char *pattern) {
    for (; *pattern; pattern++) {
        if (*pattern == '*') {
            return true;
        }
        if (*pattern == '#') {
            size_t digits = strspn(name, "0123456789");
            if (!digits) {
                return false;
            }
            name += digits;
        } else if (*name++ != *pattern) {
            return false;
        }
    }
    return !*name;
}

// Removes the files of a folder whose names match.
static void remove_files(const char *path, const char *pattern) {
    DIR *folder = opendir(path);
    const struct dirent *entry;
    while (folder && (entry = readdir(folder))) {
        if (matches(entry->d_name, pattern)) {
            unlinkat(dirfd(folder), entry->d_name, 0); // of folders it leaves what they are
        }
    }
    if (folder) {
        closedir(folder);
    }
}

// The character that a text of XML begins with, and its length.
static char xml_character(const char *text, size_t *length) {
    static const struct {
        const char *text;
        char character;
    } escapes[] = {{"&amp;", '&'}, {"&lt;", '<'}, {"&gt;", '>'}, {"&quot;", '"'}, {"&apos;", '\''}};
    for (int i = 0; i < COUNT_OF(escapes); i++) {
        *length = strlen(escapes[i].text);
        if (!strncmp(text, escapes[i].text, *length)) {
            return escapes[i].character;
        }
    }
    *length = 1;
    return *text;
}

// Removes what a scene that a fit saved keeps in its folder of meshes and pictures: the files that it names, and no others.
static void remove_data(const Fit *fit, const char *data, const char *text) {
    char mark[64], name[512], path[4096];
    snprintf(mark, sizeof mark, "\"%s/", data);
    for (const char *at = text; (at = strstr(at, mark));) {
        size_t used = 0, length;
        for (at += strlen(mark); *at && *at != '"' && used + 1 < sizeof name; at += length) {
            name[used++] = xml_character(at, &length);
        }
        name[used] = 0;
        if (*at == '"' && !strchr(name, '/') &&
            (size_t)snprintf(path, sizeof path, "%s/%s/%s", fit->output, data, name) < sizeof path) {
            unlink(path);
        }
    }
    if ((size_t)snprintf(path, sizeof path, "%s/%s", fit->output, data) < sizeof path) {
        rmdir(path); // stays where there is anything else
    }
}

static rey_result remove_scene(Fit *fit, const char *stem) {
    char name[64], data[64];
    unsigned char *bytes = NULL;
    size_t size;
    snprintf(name, sizeof name, "%s.xml", stem);
    snprintf(data, sizeof data, "%s_data", stem);
    char *path = rey_fit_output_path(fit, name);
    rey_result result = path ? REY_OK : REY_ERROR_MEMORY;
    if (!result && access(path, R_OK) == 0) {
        result = rey_file_read(fit->ctx, path, &bytes, &size);
    }
    // As fits write it: another is somebody's own.
    static const char beginning[] = "<scene version=\"3.0.0\">\n";
    if (!result && bytes && !strncmp((const char *)bytes, beginning, sizeof beginning - 1)) {
        remove_data(fit, data, (const char *)bytes);
        unlink(path);
    }
    rey_free(fit->ctx, bytes);
    rey_free(fit->ctx, path);
    return result;
}

static rey_result remove_levels(Fit *fit) {
    DIR *folder = opendir(fit->output);
    const struct dirent *entry;
    rey_result result = REY_OK;
    while (folder && !result && (entry = readdir(folder))) {
        if (matches(entry->d_name, "level_#.xml") && strlen(entry->d_name) < 32) {
            char stem[32];
            snprintf(stem, sizeof stem, "%.*s", (int)(strlen(entry->d_name) - 4), entry->d_name);
            result = remove_scene(fit, stem);
        }
    }
    if (folder) {
        closedir(folder);
    }
    return result;
}

// Is a path that the job names that of a scene that fits write into the folder?
static bool is_result(Fit *fit, const char *name) {
    char path[PATH_MAX], folder[PATH_MAX];
    const char *given = name ? rey_job_path(&fit->job, name) : NULL;
    if (!given || !realpath(given, path) || !realpath(fit->output, folder)) {
        return false;
    }
    size_t length = strlen(folder);
    return !strncmp(path, folder, length) && path[length] == '/' &&
           (matches(path + length + 1, "recovered.xml") || matches(path + length + 1, "level_#.xml"));
}

rey_result rey_former_refuse_inputs(Fit *fit) {
    const Job *job = &fit->job;
    const struct {
        const char *name;
        JobPlace at;
    } scenes[] = {{job->scene, job->scene_at}, {job->load, job->load_at}, {job->truth_scene, job->truth_at}};
    for (int i = 0; i < COUNT_OF(scenes); i++) {
        if (is_result(fit, scenes[i].name)) {
            return rey_job_fail_at(job, scenes[i].at, REY_ERROR_PARAM, "%s is what a fit into %s writes: it would be lost; copy it "
                                   "with 'reynolds convert', or use another -o", scenes[i].name, fit->output);
        }
    }
    return REY_OK;
}

// The start is read again for the table and the report, with its meshes and pictures.
static rey_result refuse_data(Fit *fit) {
    static const char *const names[] = {"recovered_data/", "level_"};
    char folder[PATH_MAX], beginning[PATH_MAX + 32], *file = NULL;
    rey_result result = REY_OK;
    for (int i = 0; i < COUNT_OF(names) && !result && realpath(fit->output, folder); i++) {
        snprintf(beginning, sizeof beginning, "%s/%s", folder, names[i]);
        result = rey_mitsuba_reads(fit->scene, beginning, &file);
        if (file) {
            result = rey_job_fail_at(&fit->job, fit->job.scene_at, REY_ERROR_PARAM, "%s reads %s, which the former fit wrote and "
                                     "--overwrite removes; copy the scene with 'reynolds convert', or use another -o",
                                     fit->job.scene, file);
        }
        rey_free(fit->ctx, file);
        file = NULL;
    }
    return result;
}

rey_result rey_former_remove(Fit *fit) {
    static const char *const files[] = {"report.html", "metrics.jsonl", "events.out.tfevents.#.*"};
    char *frames = rey_fit_output_path(fit, "frames");
    rey_result result = frames ? refuse_data(fit) : REY_ERROR_MEMORY;
    if (!result) {
        result = remove_scene(fit, "recovered");
    }
    if (!result) {
        result = remove_levels(fit);
    }
    if (!result) {
        remove_files(frames, "view#_#.png");
        rmdir(frames);
        for (int i = 0; i < COUNT_OF(files); i++) {
            remove_files(fit->output, files[i]);
        }
        remove_files(fit->output, "checkpoint.bin"); // last; job.resolved.yaml is replaced next, and may be the job that was read
    }
    rey_free(fit->ctx, frames);
    return result;
}
