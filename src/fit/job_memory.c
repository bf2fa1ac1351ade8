// job_memory.c: what a job owns, its paths, places of its entries, and its schedule of samples.
#include "fit/job.h"

#include <stdio.h>
#include <string.h>

void *rey_job_alloc(Job *job, size_t count, size_t item_bytes) {
    void *memory = rey_alloc_array(job->ctx, count, item_bytes);
    void **slot = memory ? rey_array_push(job->ctx, &job->memory, sizeof(void *), 1) : NULL;
    if (!slot) {
        rey_free(job->ctx, memory);
        return NULL;
    }
    *slot = memory;
    return memory;
}

void rey_job_free(Job *job) {
    if (!job->ctx) {
        return;
    }
    for (size_t i = 0; i < job->memory.count; i++) {
        rey_free(job->ctx, ARRAY_AT(job->memory, void *, i));
    }
    rey_array_free(job->ctx, &job->memory);
    rey_yaml_free(job->ctx, job->tree);
    *job = (Job){0};
}

rey_result rey_job_fail_at(const Job *job, JobPlace at, rey_result code, const char *format, ...) {
    char message[1600]; // what is told may be the context's own message
    if (code == REY_ERROR_IO) { // a file that is not where the paths begin
        at = rey_job_blame(at, job->folder_at);
    }
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(message, sizeof message, format, arguments);
    va_end(arguments);
    return at.line ? rey_fail(job->ctx, code, "%s:%d: %s", job->path, at.line, message)
                   : rey_fail(job->ctx, code == REY_ERROR_IO ? code : REY_ERROR_ARGUMENT, "--set %.200s: %s", at.set, message);
}

rey_result rey_job_named_file(const Job *job, JobPlace at, rey_result result) {
    char why[1600];
    snprintf(why, sizeof why, "%s", rey_error(job->ctx));
    return result == REY_ERROR_IO && (at.line || at.set) ? rey_job_fail_at(job, at, result, "%s", why)
           : result == REY_ERROR_FORMAT && at.set ? rey_fail(job->ctx, result, "--set %.200s: %s", at.set, why)
                                                  : result;
}

rey_result rey_job_named_scene(const Job *job, JobPlace at, const JobDefines *defines, rey_result result) {
    char quoted[128];
    for (int i = 0; i < defines->count && result; i++) {
        bool unused = result == REY_ERROR_ARGUMENT;
        snprintf(quoted, sizeof quoted, unused ? "the parameter '%.100s'" : "'%.100s'",
                 unused ? defines->list[i].name : defines->list[i].value);
        if (result != REY_ERROR_MEMORY && result != REY_ERROR_IO && strstr(rey_error(job->ctx), quoted)) {
            return rey_job_fail_at(job, defines->at[i], REY_ERROR_SCENE, "%s", rey_error(job->ctx));
        }
    }
    return rey_job_named_file(job, at, result);
}

const char *rey_job_path(Job *job, const char *name) {
    if (name[0] == '/' || !strcmp(job->folder, ".")) {
        return name;
    }
    size_t folder = strlen(job->folder), length = strlen(name);
    char *path = rey_job_alloc(job, folder + length + 2, 1);
    if (path) {
        memcpy(path, job->folder, folder);
        path[folder] = '/';
        memcpy(path + folder + 1, name, length);
    }
    return path;
}

int rey_job_spp_at(const Job *job, int iteration) {
    int spp = job->spp[0].spp;
    for (int i = 0; i < job->spp_count && job->spp[i].from <= iteration; i++) {
        spp = job->spp[i].spp;
    }
    return spp;
}
