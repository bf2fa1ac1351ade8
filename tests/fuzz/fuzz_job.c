// fuzz_job.c: any bytes as a job file. Nothing may crash, leak or take long; an accepted job must read back as itself.
#include "base/context.h"
#include "fit/job.h"

#include <stdlib.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void check(bool holds) {
    if (!holds) {
        abort();
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    rey_context *ctx;
    if (rey_context_create(NULL, &ctx)) {
        return 0;
    }
    Job job, again;
    if (rey_job_read_memory(ctx, "job.yaml", data, size, NULL, 0, &job) == REY_OK) {
        char *yaml = NULL, *flat = NULL, *flat_again = NULL;
        check(rey_job_yaml(&job, &yaml) == REY_OK && rey_job_flat(&job, &flat) == REY_OK);
        check(rey_job_read_memory(ctx, "job.yaml", (const unsigned char *)yaml, strlen(yaml), NULL, 0, &again) == REY_OK);
        check(rey_job_flat(&again, &flat_again) == REY_OK && strcmp(flat, flat_again) == 0);
        rey_job_free(&again);
        rey_free(ctx, yaml);
        rey_free(ctx, flat);
        rey_free(ctx, flat_again);
    } else {
        check(rey_error(ctx)[0]);
    }
    rey_job_free(&job);
    rey_context_destroy(ctx);
    return 0;
}
