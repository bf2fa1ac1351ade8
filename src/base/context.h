// context.h: the context that every call works in: allocator, options and the last failure's message.
#pragma once

#include "base/platform.h"
#include "reynolds/reynolds.h"

#include <stdarg.h>

struct rey_context {
    rey_context_def def; // as given, with threads and lanes resolved
    char message[2048];
};

// Records a message and returns the code, so that a failure reads `return rey_fail(ctx, REY_ERROR_IO, ...)`.
rey_result rey_fail(rey_context *ctx, rey_result code, const char *format, ...) PRINTF_LIKE(3, 4);
rey_result rey_fail_memory(rey_context *ctx, size_t bytes);
// Public functions begin here: forgets the message of an earlier call, and refuses a null context or, when `all` is
// false, arguments that must not be null.
rey_result rey_begin(rey_context *ctx, bool all);

// Zeroed, 64-byte aligned memory from the context's allocator; null (and a recorded message) on failure.
// bytes 0 returns a valid pointer. rey_free accepts null.
void *rey_alloc(rey_context *ctx, size_t bytes);
void *rey_alloc_array(rey_context *ctx, size_t count, size_t item_bytes); // checks the product for overflow
void rey_free(rey_context *ctx, void *memory);
char *rey_strdup(rey_context *ctx, const char *text);

// Growable array of any item type: `Array a = {0}; T *p = rey_array_push(ctx, &a, sizeof(T), n);`
typedef struct Array {
    void *data;
    size_t count, capacity; // in items
} Array;
// Appends n zeroed items and returns the first of them; null on failure, with the array unchanged.
void *rey_array_push(rey_context *ctx, Array *array, size_t item_bytes, size_t n);
void rey_array_free(rey_context *ctx, Array *array);
#define ARRAY_AT(array, T, i) (((T *)(array).data)[i])

// Levenshtein distance, for "did you mean".
int rey_edit_distance(const char *a, const char *b);
// The candidate closest to word, null when none is reasonably close. next(user, i) returns the i-th or null at the end.
const char *rey_nearest_word(const char *word, const char *(*next)(void *user, int i), void *user);
