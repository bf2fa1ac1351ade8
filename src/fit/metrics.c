// metrics.c: one JSON object an iteration in metrics.jsonl, and the same in a TensorBoard event file.
#include "fit/fit.h"
#include "fit/tensorboard.h"
#include "fit/text.h"
#include "io/file.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

// Bytes of the first `lines` lines; of all when there are fewer.
static size_t lines_length(const unsigned char *bytes, size_t size, int lines) {
    size_t at = 0;
    for (int i = 0; i < lines && at < size; i++) {
        const unsigned char *end = memchr(bytes + at, '\n', size - at);
        if (!end) {
            break; // a line that was cut off
        }
        at = (size_t)(end - bytes) + 1;
    }
    return at;
}

// A resumed fit drops what was written after its checkpoint, for it will come again.
static rey_result truncate_metrics(Fit *fit, const char *path) {
    unsigned char *bytes;
    size_t size;
    if (!fit->state.iteration) {
        return REY_OK;
    }
    if (access(path, F_OK) != 0) {
        char words[4096];
        snprintf(words, sizeof words, "%.3900s is gone, and with it the losses of the first %d iterations: it begins anew", path,
                 fit->state.iteration);
        if (fit->def->note) {
            fit->def->note(fit->def->user, words);
        }
        return REY_OK;
    }
    rey_result result = rey_file_read(fit->ctx, path, &bytes, &size);
    if (!result) {
        result = rey_file_write(fit->ctx, path, bytes, lines_length(bytes, size, fit->state.iteration));
    }
    rey_free(fit->ctx, bytes);
    return result;
}

rey_result rey_metrics_open(Fit *fit) {
    char *path = rey_fit_output_path(fit, "metrics.jsonl");
    rey_result result = path ? truncate_metrics(fit, path) : REY_ERROR_MEMORY;
    if (!result) {
        fit->metrics = fopen(path, fit->state.iteration ? "ab" : "wb");
        if (!fit->metrics) {
            result = rey_fail(fit->ctx, REY_ERROR_IO, "%s: cannot open for writing: %s", path, strerror(errno));
        }
    }
    rey_free(fit->ctx, path);
    return result ? result : rey_tensorboard_open(fit->ctx, fit->output, fit->state.iteration, &fit->board);
}

static void put_values(Fit *fit, Text *t) {
    const Unknowns *u = &fit->unknowns;
    bool first = true;
    for (size_t k = 0; k < u->items.count; k++) {
        const Unknown *p = &ARRAY_AT(u->items, Unknown, k);
        if (p->count > HISTORY_LARGEST) {
            continue;
        }
        rey_text_add(t, first ? "" : ",");
        rey_text_json(t, p->name);
        rey_text_add(t, p->count > 1 ? ":[" : ":");
        for (int64_t i = 0; i < p->count; i++) {
            rey_text_add(t, i ? "," : "");
            rey_text_number(t, (double)u->value[p->offset + i]);
        }
        rey_text_add(t, p->count > 1 ? "]" : "");
        first = false;
    }
}

static rey_result put_scalars(Fit *fit, int64_t step, const double *row) {
    static const struct {
        int column;
        const char *tag;
    } tags[] = {{HISTORY_LOSS, "loss"}, {HISTORY_NORM, "gradient_norm"}, {HISTORY_FACTOR, "learning_rate_factor"}};
    rey_result result = REY_OK;
    for (int i = 0; i < COUNT_OF(tags) && !result; i++) {
        result = rey_tensorboard_scalar(fit->board, step, tags[i].tag, row[tags[i].column]);
    }
    for (size_t k = 0; k < fit->unknowns.items.count && !result; k++) {
        const Unknown *p = &ARRAY_AT(fit->unknowns.items, Unknown, k);
        for (int64_t i = 0; i < p->count && p->count <= HISTORY_LARGEST && !result; i++) {
            char tag[512];
            snprintf(tag, sizeof tag, p->count > 1 ? "parameters/%.480s/%lld" : "parameters/%.480s", p->name,
                     (long long)i);
            result = rey_tensorboard_scalar(fit->board, step, tag, (double)fit->unknowns.value[p->offset + i]);
        }
    }
    return result;
}

rey_result rey_metrics_row(Fit *fit, const int *batch, int batch_count) {
    int64_t step = fit->state.iteration - 1;
    const double *row = (const double *)fit->state.history.data + step * fit->state.history_width;
    Text t = {.ctx = fit->ctx};
    rey_text_add(&t, "{\"iteration\":%lld,\"loss\":", (long long)step);
    rey_text_number(&t, row[HISTORY_LOSS]);
    rey_text_add(&t, ",\"gradient_norm\":");
    rey_text_number(&t, row[HISTORY_NORM]);
    rey_text_add(&t, ",\"learning_rate_factor\":");
    rey_text_number(&t, row[HISTORY_FACTOR]);
    rey_text_add(&t, ",\"spp\":%d,\"seconds\":", rey_job_spp_at(&fit->job, (int)step));
    rey_text_number(&t, floor(1000 * row[HISTORY_SECONDS]) / 1000);
    if (fit->sampling) {
        rey_text_add(&t, ",\"recorded\":%d,\"outside\":", fit->state.recorded - 1);
        rey_text_number(&t, fit->outside);
        rey_text_add(&t, ",\"effective\":");
        rey_text_number(&t, fit->effective);
    }
    rey_text_add(&t, ",\"views\":[");
    for (int i = 0; i < batch_count; i++) {
        rey_text_add(&t, "%s%d", i ? "," : "", batch[i]);
    }
    rey_text_add(&t, "],\"parameters\":{");
    put_values(fit, &t);
    rey_text_add(&t, "}}\n");
    char *line;
    rey_result result = rey_text_take(&t, &line);
    if (!result && (fputs(line, fit->metrics) < 0 || fflush(fit->metrics))) {
        result = rey_fail(fit->ctx, REY_ERROR_IO, "%s/metrics.jsonl: cannot write: %s", fit->output, strerror(errno));
    }
    rey_free(fit->ctx, line);
    return result ? result : put_scalars(fit, step, row);
}

rey_result rey_metrics_image(Fit *fit, int view, const float *image) {
    char tag[64];
    snprintf(tag, sizeof tag, "views/%d", view);
    return rey_tensorboard_image(fit->board, fit->state.iteration, tag, image, fit->views[view].width,
                                 fit->views[view].height);
}

void rey_metrics_close(Fit *fit) {
    if (fit->metrics) {
        fclose(fit->metrics);
        fit->metrics = NULL;
    }
    rey_tensorboard_close(fit->board);
    fit->board = NULL;
}
