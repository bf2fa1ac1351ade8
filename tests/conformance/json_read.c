// json_read.c: recursive-descent JSON reader (RFC 8259; \u escapes outside ASCII become '?').
#include "json_read.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MAX_DEPTH = 64 };

typedef struct Reader {
    const char *s;
    int depth;
} Reader;

static JsonNode *read_value(Reader *r);

static void skip_space(Reader *r) {
    r->s += strspn(r->s, " \t\r\n");
}

static bool accept(Reader *r, const char *word) {
    size_t n = strlen(word);
    if (strncmp(r->s, word, n)) {
        return false;
    }
    r->s += n;
    return true;
}

// Reads a string whose opening quote is next; null when it is malformed.
static char *read_text(Reader *r) {
    static const char escapes[] = "\"\\/bfnrt", meanings[] = "\"\\/\b\f\n\r\t";
    if (!accept(r, "\"")) {
        return NULL;
    }
    char *text = malloc(strlen(r->s) + 1), *out = text;
    while (text && *r->s && *r->s != '"') {
        if (*r->s != '\\') {
            *out++ = *r->s++;
            continue;
        }
        r->s++;
        const char *escape = *r->s ? strchr(escapes, *r->s) : NULL;
        if (escape) {
            *out++ = meanings[escape - escapes];
            r->s++;
        } else if (*r->s == 'u' && strlen(r->s) > 4) {
            char digits[5] = {r->s[1], r->s[2], r->s[3], r->s[4], 0};
            long code = strtol(digits, NULL, 16);
            *out++ = code > 0 && code < 128 ? (char)code : '?';
            r->s += 5;
        } else {
            break;
        }
    }
    if (!text || !accept(r, "\"")) {
        free(text);
        return NULL;
    }
    *out = 0;
    return text;
}

static bool read_children(Reader *r, JsonNode *parent, const char *end) {
    JsonNode **tail = &parent->first;
    skip_space(r);
    if (accept(r, end)) {
        return true;
    }
    do {
        char *key = NULL;
        skip_space(r);
        if (parent->kind == JSON_OBJECT) {
            key = read_text(r);
            skip_space(r);
            if (!key || !accept(r, ":")) {
                free(key);
                return false;
            }
        }
        JsonNode *child = read_value(r);
        if (!child) {
            free(key);
            return false;
        }
        child->key = key;
        *tail = child;
        tail = &child->next;
        skip_space(r);
    } while (accept(r, ","));
    return accept(r, end);
}

static bool read_into(Reader *r, JsonNode *node) {
    char *end;
    if (accept(r, "{")) {
        node->kind = JSON_OBJECT;
        return read_children(r, node, "}");
    }
    if (accept(r, "[")) {
        node->kind = JSON_ARRAY;
        return read_children(r, node, "]");
    }
    if (*r->s == '"') {
        node->kind = JSON_STRING;
        node->text = read_text(r);
        return node->text != NULL;
    }
    if (accept(r, "true") || accept(r, "false")) {
        node->kind = JSON_BOOL;
        node->number = r->s[-2] == 'u';
        return true;
    }
    if (accept(r, "null")) {
        return true;
    }
    node->kind = JSON_NUMBER;
    node->number = strtod(r->s, &end);
    bool good = end != r->s;
    r->s = end;
    return good;
}

static JsonNode *read_value(Reader *r) {
    JsonNode *node = calloc(1, sizeof *node);
    skip_space(r);
    r->depth++;
    bool good = node && r->depth < MAX_DEPTH && read_into(r, node);
    r->depth--;
    if (!good) {
        json_free(node);
        return NULL;
    }
    return node;
}

static char *read_whole(const char *path) {
    FILE *file = fopen(path, "rb");
    if (!file) {
        return NULL;
    }
    char *text = NULL;
    long size = fseek(file, 0, SEEK_END) ? -1 : ftell(file);
    if (size >= 0 && !fseek(file, 0, SEEK_SET)) {
        text = calloc((size_t)size + 1, 1);
        if (text && fread(text, 1, (size_t)size, file) != (size_t)size) {
            free(text);
            text = NULL;
        }
    }
    fclose(file);
    return text;
}

JsonNode *json_read(const char *path) {
    char *text = read_whole(path);
    if (!text) {
        fprintf(stderr, "%s: cannot be read\n", path);
        return NULL;
    }
    Reader reader = {.s = text};
    JsonNode *node = read_value(&reader);
    skip_space(&reader);
    if (!node || *reader.s) {
        fprintf(stderr, "%s: malformed JSON at byte %ld\n", path, (long)(reader.s - text));
        json_free(node);
        node = NULL;
    }
    free(text);
    return node;
}

void json_free(JsonNode *node) {
    while (node) {
        JsonNode *next = node->next;
        json_free(node->first);
        free(node->key);
        free(node->text);
        free(node);
        node = next;
    }
}

static const JsonNode *find_child(const JsonNode *object, const char *key, size_t length) {
    for (const JsonNode *child = object ? object->first : NULL; child; child = child->next) {
        if (child->key && strlen(child->key) == length && !strncmp(child->key, key, length)) {
            return child;
        }
    }
    return NULL;
}

const JsonNode *json_get(const JsonNode *object, const char *key) {
    return find_child(object, key, strlen(key));
}

const JsonNode *json_path(const JsonNode *object, const char *path) {
    while (object) {
        size_t length = strcspn(path, ".");
        object = find_child(object, path, length);
        if (!path[length]) {
            break;
        }
        path += length + 1;
    }
    return object;
}

const char *json_text(const JsonNode *object, const char *path, const char *fallback) {
    const JsonNode *node = json_path(object, path);
    return node && node->kind == JSON_STRING ? node->text : fallback;
}

double json_value(const JsonNode *object, const char *path, double fallback) {
    const JsonNode *node = json_path(object, path);
    return node && (node->kind == JSON_NUMBER || node->kind == JSON_BOOL) ? node->number : fallback;
}
