// context.c: context life cycle, failures, memory, nearest words.
#include "base/context.h"

#include "base/parallel.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>

// Large blocks come from the system, which hands out zeroed pages as they are touched: the scratch memory of a render is
// sized for its longest paths and mostly stays untouched. Sanitizers watch the heap alone, so they get no large blocks.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
static const size_t LARGE_BLOCK = SIZE_MAX;
#else
static const size_t LARGE_BLOCK = 1 << 20;
#endif

// Every block begins with a header.
enum { HEADER_BYTES = 64 };

typedef struct BlockHeader {
    size_t mapped; // bytes from the system; 0 = from the heap
} BlockHeader;

static void *default_alloc(void *user, size_t bytes, size_t alignment) {
    UNUSED(user);
    if (alignment > HEADER_BYTES || bytes > SIZE_MAX / 2) {
        return NULL;
    }
    size_t size = (bytes + 2 * HEADER_BYTES - 1) / HEADER_BYTES * HEADER_BYTES;
    char *block;
    if (bytes >= LARGE_BLOCK) {
        block = mmap(NULL, size, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
        block = block == MAP_FAILED ? NULL : block;
    } else {
        block = aligned_alloc(HEADER_BYTES, size);
    }
    if (!block) {
        return NULL;
    }
    ((BlockHeader *)(void *)block)->mapped = bytes >= LARGE_BLOCK ? size : 0;
    return block + HEADER_BYTES;
}

static void default_release(void *user, void *memory) {
    UNUSED(user);
    if (!memory) {
        return;
    }
    char *block = (char *)memory - HEADER_BYTES;
    size_t mapped = ((BlockHeader *)(void *)block)->mapped;
    if (mapped) {
        munmap(block, mapped);
    } else {
        free(block);
    }
}

rey_context_def rey_default_context_def(void) {
    return (rey_context_def){.size = sizeof(rey_context_def), .alloc = default_alloc, .release = default_release};
}

static bool known_lanes(int lanes) {
    return lanes == 0 || lanes == 1 || lanes == 8 || lanes == 16;
}

const char *rey_context_problem(const rey_context_def *def) {
    if (!def) {
        return "";
    }
    if (def->size != sizeof *def) {
        return "rey_context_def must come from rey_default_context_def";
    }
    if (!def->alloc || !def->release) {
        return "alloc and release must both be given";
    }
    if (def->threads < 0) {
        return "threads must be at least 0";
    }
    if (!known_lanes(def->lanes)) {
        return "lanes must be 0, 1, 8 or 16";
    }
    return def->lanes > rey_widest_lanes() ? "this machine does not run so many lanes" : "";
}

rey_result rey_context_create(const rey_context_def *def, rey_context **out) {
    if (!out) {
        return REY_ERROR_ARGUMENT;
    }
    *out = NULL;
    rey_context_def d = def ? *def : rey_default_context_def();
    if (rey_context_problem(&d)[0]) {
        return d.size == sizeof d && known_lanes(d.lanes) && d.lanes > rey_widest_lanes() ? REY_ERROR_UNSUPPORTED
                                                                                         : REY_ERROR_ARGUMENT;
    }
    d.lanes = d.lanes ? d.lanes : rey_widest_lanes();
    d.threads = rey_useful_threads(d.threads);
    rey_context *ctx = d.alloc(d.user, sizeof *ctx, 64);
    if (!ctx) {
        return REY_ERROR_MEMORY;
    }
    memset(ctx, 0, sizeof *ctx);
    ctx->def = d;
    *out = ctx;
    return REY_OK;
}

void rey_context_destroy(rey_context *ctx) {
    if (ctx) {
        ctx->def.release(ctx->def.user, ctx);
    }
}

const char *rey_error(const rey_context *ctx) {
    return ctx ? ctx->message : "there is no context; rey_context_problem says why one cannot be created";
}

int rey_threads(const rey_context *ctx) {
    return ctx ? ctx->def.threads : 0;
}

int rey_lanes(const rey_context *ctx) {
    return ctx ? ctx->def.lanes : 0;
}

const char *rey_version(void) {
    return REY_VERSION;
}

const char *rey_result_text(rey_result result) {
    static const char *const texts[] = {
#define RESULT_TEXT(name, text) text,
        REY_RESULTS(RESULT_TEXT)
#undef RESULT_TEXT
    };
    return (unsigned)result < REY_RESULT_COUNT ? texts[result] : "unknown result";
}

rey_result rey_fail(rey_context *ctx, rey_result code, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(ctx->message, sizeof ctx->message, format, arguments);
    va_end(arguments);
    return code;
}

rey_result rey_begin(rey_context *ctx, bool all) {
    if (!ctx) {
        return REY_ERROR_ARGUMENT;
    }
    ctx->message[0] = 0;
    return all ? REY_OK : rey_fail(ctx, REY_ERROR_ARGUMENT, "an argument is null that must not be");
}

rey_result rey_fail_memory(rey_context *ctx, size_t bytes) {
    return rey_fail(ctx, REY_ERROR_MEMORY, "out of memory: %zu bytes could not be had", bytes);
}

void *rey_alloc(rey_context *ctx, size_t bytes) {
    size_t size = bytes ? bytes : 1;
    void *memory = size <= SIZE_MAX / 2 ? ctx->def.alloc(ctx->def.user, size, 64) : NULL;
    if (!memory) {
        rey_fail_memory(ctx, size);
        return NULL;
    }
    if (ctx->def.alloc != default_alloc || size < LARGE_BLOCK) {
        memset(memory, 0, size);
    }
    return memory;
}

void *rey_alloc_array(rey_context *ctx, size_t count, size_t item_bytes) {
    if (item_bytes && count > SIZE_MAX / 4 / item_bytes) {
        rey_fail_memory(ctx, SIZE_MAX);
        return NULL;
    }
    return rey_alloc(ctx, count * item_bytes);
}

void rey_free(rey_context *ctx, void *memory) {
    if (memory) {
        ctx->def.release(ctx->def.user, memory);
    }
}

char *rey_strdup(rey_context *ctx, const char *text) {
    size_t bytes = strlen(text) + 1;
    char *copy = rey_alloc(ctx, bytes);
    if (copy) {
        memcpy(copy, text, bytes);
    }
    return copy;
}

void *rey_array_push(rey_context *ctx, Array *array, size_t item_bytes, size_t n) {
    if (n > array->capacity - array->count) {
        size_t capacity = array->capacity + array->capacity / 2;
        if (capacity < array->count + n) {
            capacity = array->count + n;
        }
        if (capacity < 8) {
            capacity = 8;
        }
        void *grown = rey_alloc_array(ctx, capacity, item_bytes);
        if (!grown) {
            return NULL;
        }
        if (array->count) {
            memcpy(grown, array->data, array->count * item_bytes);
        }
        rey_free(ctx, array->data);
        array->data = grown;
        array->capacity = capacity;
    } else if (n) {
        memset((char *)array->data + array->count * item_bytes, 0, n * item_bytes);
    }
    void *first = (char *)array->data + array->count * item_bytes;
    array->count += n;
    return first;
}

void rey_array_free(rey_context *ctx, Array *array) {
    rey_free(ctx, array->data);
    *array = (Array){0};
}

int rey_edit_distance(const char *a, const char *b) {
    enum { LONGEST = 128 };
    int row[LONGEST + 1];
    int na = (int)strlen(a), nb = (int)strlen(b);
    if (na > LONGEST || nb > LONGEST) {
        return LONGEST;
    }
    for (int j = 0; j <= nb; j++) {
        row[j] = j;
    }
    for (int i = 1; i <= na; i++) {
        int diagonal = row[0];
        row[0] = i;
        for (int j = 1; j <= nb; j++) {
            int best = diagonal + (a[i - 1] != b[j - 1]);
            diagonal = row[j];
            best = row[j] + 1 < best ? row[j] + 1 : best;
            best = row[j - 1] + 1 < best ? row[j - 1] + 1 : best;
            row[j] = best;
        }
    }
    return row[nb];
}

// Of a name of several words, "acrylic glass", one may be meant: the distance to the nearest of them, or to the whole.
static int name_distance(const char *word, const char *name) {
    int nearest = rey_edit_distance(word, name);
    for (const char *at = strchr(name, ' ') ? name : NULL; at; at = strchr(at, ' ')) {
        char part[160];
        at += *at == ' ';
        snprintf(part, sizeof part, "%.*s", (int)strcspn(at, " "), at);
        int distance = rey_edit_distance(word, part);
        nearest = distance < nearest ? distance : nearest;
    }
    return nearest;
}

const char *rey_nearest_word(const char *word, const char *(*next)(void *user, int i), void *user) {
    const char *nearest = NULL;
    int limit = (int)strlen(word) / 2 + 1;
    for (int i = 0;; i++) {
        const char *candidate = next(user, i);
        if (!candidate) {
            return nearest;
        }
        int distance = name_distance(word, candidate);
        if (distance < limit) {
            limit = distance;
            nearest = candidate;
        }
    }
}
