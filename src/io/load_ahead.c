// load_ahead.c: files read by several threads, before the scene is built from them in the order of the document.
#include "base/parallel.h"
#include "io/load.h"

#include <string.h>

typedef struct LoadJob {
    const rey_xml_node *node;
    FileRequest request;
    rey_context ctx; // with the message of this job
    rey_result result;
    LoadedFile file;
    bool taken;
} LoadJob;

struct LoadAhead {
    Array jobs; // of LoadJob, in the order of the nodes
};

static void run_job(void *argument, int64_t item, int worker) {
    LoadJob *job = (LoadJob *)argument + item;
    UNUSED(worker);
    job->result = load_read(&job->ctx, &job->request, &job->file);
}

// A node whose request makes no sense is left to its turn, which says why.
static rey_result add_job(rey_context *ctx, const rey_xml_document *document, rey_xml_node *node, LoadAhead *ahead) {
    rey_context own = *ctx;
    FileRequest request;
    rey_result result = load_request(&own, document, node, &request);
    LoadJob *job = result == REY_OK ? rey_array_push(ctx, &ahead->jobs, sizeof *job, 1) : NULL;
    if (!job) {
        load_request_free(ctx, &request);
        return result == REY_OK             ? REY_ERROR_MEMORY
               : result == REY_ERROR_MEMORY ? rey_fail(ctx, result, "%s", own.message)
                                            : REY_OK;
    }
    *job = (LoadJob){.node = node, .request = request, .ctx = own};
    return REY_OK;
}

rey_result load_ahead(rey_context *ctx, const rey_xml_document *document, LoadAhead **out) {
    int files = 0, nodes = rey_xml_node_count(document);
    *out = NULL;
    for (int i = 0; i < nodes; i++) {
        files += load_kind(rey_xml_node_at(document, i)) != FILE_NONE;
    }
    if (files < 2 || ctx->def.threads < 2) {
        return REY_OK;
    }
    LoadAhead *ahead = rey_alloc(ctx, sizeof *ahead);
    rey_result result = ahead ? REY_OK : REY_ERROR_MEMORY;
    for (int i = 0; i < nodes && result == REY_OK; i++) {
        rey_xml_node *node = rey_xml_node_at(document, i);
        result = load_kind(node) != FILE_NONE ? add_job(ctx, document, node, ahead) : REY_OK;
    }
    if (result != REY_OK) {
        load_ahead_free(ctx, ahead);
        return result;
    }
    rey_parallel_for(ctx->def.threads, (int64_t)ahead->jobs.count, run_job, ahead->jobs.data);
    *out = ahead;
    return REY_OK;
}

void load_ahead_free(rey_context *ctx, LoadAhead *ahead) {
    for (size_t i = 0; ahead && i < ahead->jobs.count; i++) {
        LoadJob *job = &ARRAY_AT(ahead->jobs, LoadJob, i);
        load_request_free(ctx, &job->request);
        load_free(ctx, &job->file);
    }
    if (ahead) {
        rey_array_free(ctx, &ahead->jobs);
    }
    rey_free(ctx, ahead);
}

static LoadJob *find_job(LoadAhead *ahead, const rey_xml_node *node) {
    size_t low = 0, high = ahead ? ahead->jobs.count : 0;
    while (low < high) {
        size_t middle = low + (high - low) / 2;
        LoadJob *job = &ARRAY_AT(ahead->jobs, LoadJob, middle);
        if (job->node == node) {
            return job;
        }
        if (job->node->index < node->index) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    return NULL;
}

rey_result load_take(rey_context *ctx, const rey_xml_document *document, LoadAhead *ahead, rey_xml_node *node,
                     LoadedFile *out) {
    LoadJob *job = find_job(ahead, node);
    *out = (LoadedFile){0};
    if (job && !job->taken) {
        *out = job->file;
        job->file = (LoadedFile){0};
        job->taken = true;
        return job->result == REY_OK ? REY_OK : rey_fail(ctx, job->result, "%s", job->ctx.message);
    }
    FileRequest request;
    rey_result result = load_request(ctx, document, node, &request);
    if (result == REY_OK) {
        result = load_read(ctx, &request, out);
    }
    load_request_free(ctx, &request);
    return result;
}
