// obj_materials.c: the statements f and usemtl of an OBJ file: a face of n corners makes n - 2 triangles.
#include "io/obj_materials.h"

#include "io/file.h"

#include <string.h>

typedef struct Cursor {
    const char *at, *end;
} Cursor;

static bool is_blank(char c) {
    return c == ' ' || c == '\t' || c == '\r';
}

// Length of a line end that a backslash before it makes a blank, 0 = none here.
static size_t continuation(const Cursor *c) {
    size_t left = (size_t)(c->end - c->at);
    if (left > 1 && c->at[0] == '\\' && c->at[1] == '\n') {
        return 2;
    }
    return left > 2 && c->at[0] == '\\' && c->at[1] == '\r' && c->at[2] == '\n' ? 3 : 0;
}

// The next word of the line; false at its end.
static bool next_word(Cursor *c, const char **word, size_t *length) {
    size_t skip;
    while (c->at < c->end && (is_blank(*c->at) || continuation(c))) {
        skip = continuation(c);
        c->at += skip ? skip : 1;
    }
    *word = c->at;
    while (c->at < c->end && !is_blank(*c->at) && *c->at != '\n' && *c->at != '#' && !continuation(c)) {
        c->at++;
    }
    *length = (size_t)(c->at - *word);
    return *length > 0;
}

static bool is_word(const char *word, size_t length, const char *expected) {
    return length == strlen(expected) && memcmp(word, expected, length) == 0;
}

static void skip_line(Cursor *c) {
    const char *newline = memchr(c->at, '\n', (size_t)(c->end - c->at));
    c->at = newline ? newline + 1 : c->end;
}

static rey_result add_run(rey_context *ctx, Array *runs, int64_t triangle, const char *name, size_t length) {
    ObjRun *run = rey_array_push(ctx, runs, sizeof *run, 1);
    if (!run) {
        return REY_ERROR_MEMORY;
    }
    run->triangle = triangle;
    run->material = rey_alloc(ctx, length + 1);
    if (!run->material) {
        return REY_ERROR_MEMORY;
    }
    memcpy(run->material, name, length);
    return REY_OK;
}

// The name is the rest of the line, without the blanks around it: it may have some inside.
static rey_result read_usemtl(rey_context *ctx, Cursor *c, int64_t triangle, Array *runs) {
    const char *newline = memchr(c->at, '\n', (size_t)(c->end - c->at)), *end = newline ? newline : c->end;
    const char *name = c->at;
    while (name < end && is_blank(*name)) {
        name++;
    }
    while (end > name && is_blank(end[-1])) {
        end--;
    }
    return add_run(ctx, runs, triangle, name, (size_t)(end - name));
}

static rey_result read_statements(rey_context *ctx, Cursor *c, Array *runs) {
    int64_t triangles = 0;
    rey_result result = add_run(ctx, runs, 0, "", 0);
    while (c->at < c->end && result == REY_OK) {
        const char *word;
        size_t length;
        if (next_word(c, &word, &length) && is_word(word, length, "usemtl")) {
            result = read_usemtl(ctx, c, triangles, runs);
        } else if (is_word(word, length, "f")) {
            int64_t corners = 0;
            while (next_word(c, &word, &length)) {
                corners++;
            }
            triangles += corners > 2 ? corners - 2 : 0;
        }
        skip_line(c);
    }
    return result;
}

rey_result rey_obj_materials(rey_context *ctx, const char *path, Array *runs) {
    unsigned char *bytes;
    size_t size;
    *runs = (Array){0};
    rey_result result = rey_file_read(ctx, path, &bytes, &size);
    if (result == REY_OK) {
        Cursor c = {(const char *)bytes, (const char *)bytes + size};
        result = read_statements(ctx, &c, runs);
        rey_free(ctx, bytes);
    }
    return result;
}

void rey_obj_materials_free(rey_context *ctx, Array *runs) {
    for (size_t i = 0; i < runs->count; i++) {
        rey_free(ctx, ARRAY_AT(*runs, ObjRun, i).material);
    }
    rey_array_free(ctx, runs);
}
