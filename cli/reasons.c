// reasons.c: messages that differ in a parameter's name only are one reason.
#include "reasons.h"

#include <string.h>

// The message with NAME where the parameter's name stands.
static char *without_name(rey_context *ctx, const char *message, const char *name) {
    static const char mark[] = "NAME";
    size_t length = strlen(name), size = strlen(message) + 1;
    for (const char *at = message; length && (at = strstr(at, name)); at += length) {
        size += sizeof mark;
    }
    char *text = rey_alloc(ctx, size), *out = text;
    while (out && *message) {
        bool here = length && !strncmp(message, name, length);
        out += snprintf(out, size - (size_t)(out - text), "%.*s", here ? (int)sizeof mark : 1, here ? mark : message);
        message += here ? length : 1;
    }
    return text;
}

int reasons_add(rey_context *ctx, Reasons *reasons, const char *message, const char *name) {
    char *text = without_name(ctx, message, name);
    for (size_t i = 0; text && i < reasons->items.count; i++) {
        Reason *r = &ARRAY_AT(reasons->items, Reason, i);
        if (!strcmp(r->text, text)) {
            r->count++;
            rey_free(ctx, text);
            return (int)i + 1;
        }
    }
    char *whole = rey_strdup(ctx, message);
    Reason *r = text && whole ? rey_array_push(ctx, &reasons->items, sizeof *r, 1) : NULL;
    if (!r) {
        rey_free(ctx, text);
        rey_free(ctx, whole);
        return 0;
    }
    *r = (Reason){text, whole, 1};
    return (int)reasons->items.count;
}

void reasons_print(FILE *file, const Reasons *reasons, int number) {
    const Reason *r = &ARRAY_AT(reasons->items, Reason, number - 1);
    fprintf(file, "[%d] %s\n", number, r->count > 1 ? r->text : r->whole);
}

void reasons_free(rey_context *ctx, Reasons *reasons) {
    for (size_t i = 0; i < reasons->items.count; i++) {
        rey_free(ctx, ARRAY_AT(reasons->items, Reason, i).text);
        rey_free(ctx, ARRAY_AT(reasons->items, Reason, i).whole);
    }
    rey_array_free(ctx, &reasons->items);
}
