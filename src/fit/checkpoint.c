// checkpoint.c: little-endian binary: magic, counts, resolved job, hashes of what it read, history, start and value as floats,
// variables, moments and averages as doubles, reference as floats, the state of L-BFGS as doubles, and a 64-bit FNV-1a hash of
// everything before it.
#include "fit/checkpoint.h"

#include "fit/inputs.h"
#include "io/file.h"
#include "io/number.h"

#include <string.h>

static const char MAGIC[8] = {'R', 'E', 'Y', 'F', 'I', 'T', '0', '5'};

typedef struct CheckpointHeader {
    char magic[8];
    uint64_t job_bytes, input_bytes, numbers, extra, rows, width; // extra: numbers of L-BFGS
    uint64_t iteration, converged, meshed, recorded;
    uint64_t job_hash; // of the resolved job
    double seconds;
} CheckpointHeader;

static uint64_t hash_bytes(const void *bytes, size_t size) {
    uint64_t hash = 0xcbf29ce484222325u;
    for (size_t i = 0; i < size; i++) {
        hash = (hash ^ ((const unsigned char *)bytes)[i]) * 0x100000001b3u;
    }
    return hash;
}

// The arrays of numbers, in the file's order.
typedef struct Part {
    void *data;
    size_t bytes;
} Part;
enum { PART_COUNT = 8 };
static void list_parts(const Unknowns *u, Part parts[PART_COUNT]) {
    size_t n = (size_t)u->count;
    parts[0] = (Part){u->start, n * sizeof(float)};
    parts[1] = (Part){u->value, n * sizeof(float)};
    parts[2] = (Part){u->variable, n * sizeof(double)};
    parts[3] = (Part){u->first, n * sizeof(double)};
    parts[4] = (Part){u->second, n * sizeof(double)};
    parts[5] = (Part){u->average, n * sizeof(double)};
    parts[6] = (Part){u->reference, n * sizeof(float)};
    parts[7] = (Part){u->lbfgs, (size_t)u->lbfgs_count * sizeof(double)};
}

static void append(unsigned char *bytes, size_t *at, const void *data, size_t size) {
    if (size) {
        memcpy(bytes + *at, data, size);
    }
    *at += size;
}

rey_result rey_checkpoint_write(const char *path, FitOrigin origin, const Unknowns *u, const FitState *state) {
    Part parts[PART_COUNT];
    list_parts(u, parts);
    size_t job_bytes = strlen(origin.flat), input_bytes = strlen(origin.inputs);
    size_t history = state->history.count * sizeof(double);
    size_t size = sizeof(CheckpointHeader) + job_bytes + input_bytes + history + sizeof(uint64_t);
    for (int i = 0; i < PART_COUNT; i++) {
        size += parts[i].bytes;
    }
    unsigned char *bytes = rey_alloc(u->ctx, size);
    if (!bytes) {
        return REY_ERROR_MEMORY;
    }
    CheckpointHeader header = {.job_bytes = job_bytes,
                               .input_bytes = input_bytes,
                               .numbers = (uint64_t)u->count,
                               .extra = (uint64_t)u->lbfgs_count,
                               .rows = state->history.count / (size_t)state->history_width,
                               .width = (uint64_t)state->history_width,
                               .iteration = (uint64_t)state->iteration,
                               .converged = state->converged,
                               .meshed = (uint64_t)state->meshed,
                               .recorded = (uint64_t)state->recorded,
                               .job_hash = hash_bytes(origin.flat, job_bytes),
                               .seconds = state->seconds};
    memcpy(header.magic, MAGIC, sizeof MAGIC);
    size_t at = 0;
    append(bytes, &at, &header, sizeof header);
    append(bytes, &at, origin.flat, job_bytes);
    append(bytes, &at, origin.inputs, input_bytes);
    append(bytes, &at, state->history.data, history);
    for (int i = 0; i < PART_COUNT; i++) {
        append(bytes, &at, parts[i].data, parts[i].bytes);
    }
    uint64_t hash = hash_bytes(bytes, at);
    append(bytes, &at, &hash, sizeof hash);
    rey_result result = rey_file_write(u->ctx, path, bytes, size);
    rey_free(u->ctx, bytes);
    return result;
}

// Whether the sizes that the header claims make up the file's size exactly.
static bool sizes_agree(const CheckpointHeader *h, size_t size) {
    const uint64_t most = (uint64_t)1 << 40;
    if (h->job_bytes > most || h->input_bytes > most || h->numbers > most ||
        h->extra > most || h->meshed > most || h->recorded > h->iteration || h->rows > most || h->width > 1 << 20) {
        return false;
    }
    uint64_t per_number = 3 * sizeof(float) + 4 * sizeof(double);
    uint64_t expected =
        sizeof *h + h->job_bytes + h->input_bytes + h->rows * h->width * sizeof(double) + h->numbers * per_number +
        h->extra * sizeof(double) + sizeof(uint64_t);
    return expected == size;
}

// The value in the line of a key, "absent" when there is none.
static const char *find_line(const char *text, const char *key) {
    size_t length = strlen(key);
    while (*text) {
        if (!strncmp(text, key, length) && !strncmp(text + length, ": ", 2)) {
            return text + length + 2;
        }
        text += strcspn(text, "\n");
        text += *text != 0;
    }
    return "absent";
}

// A text of a checkpoint, owned.
static char *stored_text(rey_context *ctx, const unsigned char *bytes, uint64_t size) {
    char *text = rey_alloc(ctx, (size_t)size + 1);
    if (text) {
        memcpy(text, bytes, (size_t)size);
    }
    return text;
}

static rey_result check_job(rey_context *ctx, const char *path, const CheckpointHeader *header, const unsigned char *bytes,
                            const char *flat) {
    char *old = stored_text(ctx, bytes + sizeof *header, header->job_bytes);
    if (!old) {
        return REY_ERROR_MEMORY;
    }
    char key[256];
    bool other = rey_job_difference(old, flat, key, sizeof key);
    rey_result result = REY_OK;
    if (other) {
        const char *was = find_line(old, key), *now = find_line(flat, key);
        result = rey_fail(ctx, REY_ERROR_ARGUMENT,
                          "%s is from a different job: '%s' was %.*s and is now %.*s; finish with the old job "
                          "or use another -o",
                          path, key, (int)strcspn(was, "\n"), was, (int)strcspn(now, "\n"), now);
    }
    rey_free(ctx, old);
    return result;
}

static rey_result check_inputs(rey_context *ctx, const char *path, const CheckpointHeader *header, const unsigned char *bytes,
                               const char *inputs) {
    char *old = stored_text(ctx, bytes + sizeof *header + header->job_bytes, header->input_bytes), what[1024];
    if (!old) {
        return REY_ERROR_MEMORY;
    }
    bool other = rey_fit_inputs_differ(old, inputs, what, sizeof what);
    rey_free(ctx, old);
    return other ? rey_fail(ctx, REY_ERROR_PARAM, "%s is from other inputs: %s since; put back what it was, or start "
                            "anew with --overwrite or another -o", path, what)
                 : REY_OK;
}

static rey_result check_origin(rey_context *ctx, const char *path, const CheckpointHeader *header, const unsigned char *bytes,
                               FitOrigin origin) {
    rey_result result = check_job(ctx, path, header, bytes, origin.flat);
    return result || !origin.inputs ? result : check_inputs(ctx, path, header, bytes, origin.inputs);
}

// The header of an undamaged checkpoint.
static rey_result read_header(rey_context *ctx, const char *path, const unsigned char *bytes, size_t size,
                              CheckpointHeader *header) {
    uint64_t hash;
    if (size < sizeof *header + sizeof hash || memcmp(bytes, MAGIC, sizeof MAGIC)) {
        return rey_fail(ctx, REY_ERROR_FORMAT, "%s: no checkpoint that this version of reynolds writes; --overwrite starts anew",
                        path);
    }
    memcpy(header, bytes, sizeof *header);
    memcpy(&hash, bytes + size - sizeof hash, sizeof hash);
    if (!sizes_agree(header, size) || hash != hash_bytes(bytes, size - sizeof hash)) {
        return rey_fail(ctx, REY_ERROR_FORMAT,
                        "%s: damaged checkpoint: its %zu bytes are not those that were written; --overwrite starts anew",
                        path, size);
    }
    return REY_OK;
}

static rey_result decode(const char *path, FitOrigin origin, const unsigned char *bytes, size_t size, Unknowns *u,
                         FitState *state) {
    CheckpointHeader header;
    rey_result result = read_header(u->ctx, path, bytes, size, &header);
    if (!result) {
        result = check_origin(u->ctx, path, &header, bytes, origin);
    }
    if (result) {
        return result;
    }
    if (header.numbers != (uint64_t)u->count || header.extra != (uint64_t)u->lbfgs_count ||
        header.width != (uint64_t)state->history_width ||
        header.rows != header.iteration || header.rows > INT32_MAX) {
        return rey_fail(u->ctx, REY_ERROR_FORMAT, "%s: made for %llu numbers, but the scene now has %lld", path,
                        (unsigned long long)header.numbers, (long long)u->count);
    }
    size_t at = sizeof header + (size_t)(header.job_bytes + header.input_bytes), cells = (size_t)(header.rows * header.width);
    state->history.count = 0;
    double *history = rey_array_push(u->ctx, &state->history, sizeof *history, cells ? cells : 1);
    if (!history) {
        return REY_ERROR_MEMORY;
    }
    state->history.count = cells;
    memcpy(history, bytes + at, cells * sizeof *history);
    at += cells * sizeof *history;
    Part parts[PART_COUNT];
    list_parts(u, parts);
    for (int i = 0; i < PART_COUNT; i++) {
        memcpy(parts[i].data, bytes + at, parts[i].bytes);
        at += parts[i].bytes;
    }
    state->iteration = (int)header.iteration;
    state->seconds = header.seconds;
    state->converged = header.converged != 0;
    state->meshed = (int)header.meshed;
    state->recorded = (int)header.recorded;
    return REY_OK;
}

rey_result rey_checkpoint_read(const char *path, FitOrigin origin, Unknowns *u, FitState *state) {
    unsigned char *bytes;
    size_t size;
    rey_result result = rey_file_read(u->ctx, path, &bytes, &size);
    if (!result) {
        result = decode(path, origin, bytes, size, u, state);
    }
    rey_free(u->ctx, bytes);
    return result;
}

rey_result rey_checkpoint_look(rey_context *ctx, const char *path, FitOrigin origin, FitState *state) {
    unsigned char *bytes;
    size_t size;
    CheckpointHeader header = {.iteration = 0};
    rey_result result = rey_file_read(ctx, path, &bytes, &size);
    if (!result) {
        result = read_header(ctx, path, bytes, size, &header);
    }
    if (!result) {
        result = check_origin(ctx, path, &header, bytes, origin);
    }
    rey_free(ctx, bytes);
    *state = (FitState){.iteration = (int)header.iteration, .seconds = header.seconds, .converged = header.converged,
                        .meshed = (int)header.meshed};
    return result;
}

rey_result rey_checkpoint_number(rey_context *ctx, const char *path, const char *key, double fallback, double *out) {
    unsigned char *bytes;
    size_t size;
    CheckpointHeader header;
    *out = fallback;
    rey_result result = rey_file_read(ctx, path, &bytes, &size);
    if (!result) {
        result = read_header(ctx, path, bytes, size, &header);
    }
    char *text = result ? NULL : stored_text(ctx, bytes + sizeof header, header.job_bytes);
    if (text) {
        const char *end;
        double value;
        if (rey_parse_real(find_line(text, key), &end, &value)) {
            *out = value;
        }
    } else if (!result) {
        result = REY_ERROR_MEMORY;
    }
    rey_free(ctx, text);
    rey_free(ctx, bytes);
    return result;
}
