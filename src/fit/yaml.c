// yaml.c: libyaml's events gathered into a tree.
#include "fit/yaml.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <yaml.h>

enum { DEEPEST = 32, MOST_KEYS = 4096 };

typedef struct Reader {
    rey_context *ctx;
    const char *name;
    const unsigned char *bytes; // all of the text
    size_t size;
    const char *override; // "key=value" that the text comes from: lines are 0; null = from a file
    yaml_parser_t parser;
    yaml_event_t event;
} Reader;

static int event_line(const Reader *r) {
    return (int)r->event.start_mark.line + 1;
}

// What is wrong with the text, and where it stands.
static rey_result fail_at(const Reader *r, int line, const char *message) {
    return r->override ? rey_fail(r->ctx, REY_ERROR_ARGUMENT, "--set %.200s: %s", r->override, message)
                       : rey_fail(r->ctx, REY_ERROR_FORMAT, "%s:%d: %s", r->name, line, message);
}

// Whether the indentation of a line, from 0, has a tab, which the format does not allow and no editor shows.
static bool has_tab(const Reader *r, size_t line) {
    const unsigned char *at = r->bytes, *end = r->bytes + r->size;
    for (; at < end && line > 0; at++) {
        line -= *at == '\n';
    }
    for (; at < end && *at == ' '; at++) {
    }
    return at < end && *at == '\t';
}

static rey_result next_event(Reader *r) {
    yaml_event_delete(&r->event);
    if (yaml_parser_parse(&r->parser, &r->event)) {
        return REY_OK;
    }
    memset(&r->event, 0, sizeof r->event);
    if (r->parser.error == YAML_MEMORY_ERROR) {
        return rey_fail_memory(r->ctx, 0);
    }
    const char *problem = r->parser.problem ? r->parser.problem : "malformed YAML";
    size_t line = r->parser.problem_mark.line;
    if (r->parser.error == YAML_READER_ERROR) { // of bytes that are no text there is an offset alone
        line = 0;
        for (size_t i = 0; i < r->parser.problem_offset && i < r->size; i++) {
            line += r->bytes[i] == '\n';
        }
    } else if (has_tab(r, line)) {
        problem = "a tab in the indentation, expected spaces";
    }
    char words[256];
    snprintf(words, sizeof words, r->override ? "the value, which is read as YAML: %s" : "%s", problem);
    return fail_at(r, (int)line + 1, words);
}

static rey_result fail_here(Reader *r, const char *message) {
    return fail_at(r, event_line(r), message);
}

static char *copy_text(rey_context *ctx, const void *bytes, size_t length) {
    char *text = rey_alloc(ctx, length + 1);
    if (text) {
        memcpy(text, bytes, length);
    }
    return text;
}

// A scalar event's text; bytes of value 0 would hide what follows them.
static rey_result scalar_text(Reader *r, char **out) {
    const unsigned char *value = r->event.data.scalar.value;
    size_t length = r->event.data.scalar.length;
    *out = NULL;
    if (memchr(value, 0, length)) {
        return fail_here(r, "a character of value 0 in a text");
    }
    *out = copy_text(r->ctx, value, length);
    return *out ? REY_OK : REY_ERROR_MEMORY;
}

static rey_result read_value(Reader *r, int depth, YamlNode **out);

static rey_result read_entry(Reader *r, YamlNode *parent, int depth, YamlNode **out) {
    char *key = NULL;
    int line = event_line(r);
    *out = NULL;
    if (parent->kind == YAML_MAP) {
        if (r->event.type != YAML_SCALAR_EVENT) {
            return fail_here(r, "expected a key");
        }
        rey_result result = scalar_text(r, &key);
        if (!result && rey_yaml_find(parent, key)) {
            char message[256];
            snprintf(message, sizeof message, "key '%.200s' is given twice", key);
            result = fail_at(r, line, message);
        }
        if (!result) {
            result = next_event(r);
        }
        if (result) {
            rey_free(r->ctx, key);
            return result;
        }
    }
    rey_result result = read_value(r, depth + 1, out);
    if (result) {
        rey_free(r->ctx, key);
        return result;
    }
    (*out)->key = key;
    (*out)->line = r->override ? 0 : line;
    (*out)->set = r->override;
    return REY_OK;
}

static rey_result read_container(Reader *r, int depth, YamlNode *node) {
    yaml_event_type_t end = node->kind == YAML_MAP ? YAML_MAPPING_END_EVENT : YAML_SEQUENCE_END_EVENT;
    if (depth >= DEEPEST) {
        return fail_here(r, "nested too deeply");
    }
    YamlNode **tail = &node->child;
    for (int count = 0;; count++) {
        rey_result result = next_event(r);
        if (result || r->event.type == end) {
            return result;
        }
        if (node->kind == YAML_MAP && count >= MOST_KEYS) { // each is compared with those before it
            return fail_here(r, "too many keys");
        }
        result = read_entry(r, node, depth, tail);
        if (result) {
            return result;
        }
        tail = &(*tail)->next;
    }
}

// Reads the value that the current event begins.
static rey_result read_value(Reader *r, int depth, YamlNode **out) {
    const yaml_event_t *event = &r->event;
    if (event->type == YAML_ALIAS_EVENT || (event->type == YAML_SCALAR_EVENT && event->data.scalar.anchor) ||
        (event->type == YAML_SEQUENCE_START_EVENT && event->data.sequence_start.anchor) ||
        (event->type == YAML_MAPPING_START_EVENT && event->data.mapping_start.anchor)) {
        return fail_here(r, "anchors and aliases are not supported");
    }
    YamlNode *node = rey_alloc(r->ctx, sizeof *node);
    if (!node) {
        return REY_ERROR_MEMORY;
    }
    node->line = r->override ? 0 : event_line(r);
    node->set = r->override;
    rey_result result;
    switch (event->type) {
    case YAML_SCALAR_EVENT:
        result = scalar_text(r, &node->text);
        break;
    case YAML_SEQUENCE_START_EVENT:
        node->kind = YAML_LIST;
        result = read_container(r, depth, node);
        break;
    case YAML_MAPPING_START_EVENT:
        node->kind = YAML_MAP;
        result = read_container(r, depth, node);
        break;
    default:
        result = fail_here(r, "expected a value");
    }
    if (result) {
        rey_yaml_free(r->ctx, node);
        return result;
    }
    *out = node;
    return REY_OK;
}

static rey_result read_document(Reader *r, YamlNode **out) {
    rey_result result = next_event(r); // stream start
    if (!result) {
        result = next_event(r);
    }
    if (!result && r->event.type == YAML_STREAM_END_EVENT) {
        *out = rey_alloc(r->ctx, sizeof **out);
        if (!*out) {
            return REY_ERROR_MEMORY;
        }
        (*out)->kind = r->override ? YAML_SCALAR : YAML_MAP;
        (*out)->line = 1;
        return REY_OK;
    }
    if (!result) {
        result = next_event(r); // past the document's start
    }
    if (!result) {
        result = read_value(r, 0, out);
    }
    if (!result) {
        result = next_event(r); // document end
    }
    if (!result) {
        result = next_event(r);
    }
    if (!result && r->event.type != YAML_STREAM_END_EVENT) {
        result = fail_here(r, "more than one document");
    }
    return result;
}

static rey_result read_text(rey_context *ctx, const char *name, const char *override, const unsigned char *bytes, size_t size,
                            YamlNode **out) {
    Reader r = {.ctx = ctx, .name = name, .override = override, .bytes = bytes, .size = size};
    *out = NULL;
    if (!yaml_parser_initialize(&r.parser)) {
        return rey_fail_memory(ctx, sizeof r.parser);
    }
    yaml_parser_set_input_string(&r.parser, bytes, size);
    rey_result result = read_document(&r, out);
    yaml_event_delete(&r.event);
    yaml_parser_delete(&r.parser);
    if (result) {
        rey_yaml_free(ctx, *out);
        *out = NULL;
    }
    return result;
}

rey_result rey_yaml_read(rey_context *ctx, const char *name, const unsigned char *bytes, size_t size, YamlNode **out) {
    return read_text(ctx, name, NULL, bytes, size, out);
}

void rey_yaml_free(rey_context *ctx, YamlNode *node) {
    while (node) {
        YamlNode *next = node->next;
        rey_yaml_free(ctx, node->child); // at most DEEPEST deep, and overrides add as deep as their own text
        rey_free(ctx, node->key);
        rey_free(ctx, node->text);
        rey_free(ctx, node);
        node = next;
    }
}

YamlNode *rey_yaml_find(const YamlNode *map, const char *key) {
    for (YamlNode *node = map->child; node; node = node->next) {
        if (node->key && !strcmp(node->key, key)) {
            return node;
        }
    }
    return NULL;
}

int rey_yaml_count(const YamlNode *node) {
    int count = 0;
    for (const YamlNode *entry = node->child; entry; entry = entry->next) {
        count++;
    }
    return count;
}

/* ---- overrides ----------------------------------------------------------------------------------------- */

// The place of one path component below node, with an empty node made there when there is none.
static rey_result step_into(rey_context *ctx, YamlNode *node, const char *part, const char *assignment,
                            YamlNode **out) {
    YamlNode **place = &node->child;
    bool number = *part && !part[strspn(part, "0123456789")];
    if (node->kind == YAML_SCALAR && node->text && node->text[0]) {
        // "loss: l2" is short for "loss: {type: l2}", and an entry "- a" of a list for "- {name: a}".
        YamlNode *type = rey_alloc(ctx, sizeof *type);
        char *key = type ? rey_strdup(ctx, node->key ? "type" : "name") : NULL;
        if (!key) {
            rey_free(ctx, type);
            return REY_ERROR_MEMORY;
        }
        *type = (YamlNode){.line = node->line, .set = node->set, .key = key, .text = node->text};
        node->text = NULL;
        node->child = type;
        node->kind = YAML_MAP;
    }
    if (node->kind == YAML_SCALAR && number) { // the first entry of what was not there
        node->kind = YAML_LIST;
    }
    if (node->kind == YAML_LIST) {
        long index = strtol(part, NULL, 10);
        int count = rey_yaml_count(node);
        if (!number || index > count) {
            return rey_fail(ctx, REY_ERROR_ARGUMENT, "--set %.200s: %.100s is a list of %d, and '%.100s' is no index of it, "
                            "expected %s%d, which appends an entry", assignment, node->key ? node->key : "this", count, part,
                            count == 0 ? "" : count == 1 ? "0 or " : "0 to ", count);
        }
        for (long i = 0; i < index; i++) {
            place = &(*place)->next;
        }
    } else {
        node->kind = YAML_MAP; // an empty scalar ("views:") can become one
        while (*place && strcmp((*place)->key, part)) {
            place = &(*place)->next;
        }
    }
    if (!*place) {
        YamlNode *made = rey_alloc(ctx, sizeof *made);
        if (made) {
            made->set = assignment;
        }
        if (made && node->kind == YAML_MAP) {
            made->key = rey_strdup(ctx, part);
        }
        if (!made || (node->kind == YAML_MAP && !made->key)) {
            rey_free(ctx, made);
            return REY_ERROR_MEMORY;
        }
        *place = made;
    }
    *out = *place;
    return REY_OK;
}

static rey_result override_path(rey_context *ctx, YamlNode *root, char *path, const char *assignment, YamlNode **out) {
    YamlNode *node = root;
    int depth = 0;
    for (char *part = path; part; depth++) {
        char *dot = strchr(part, '.');
        if (dot) {
            *dot = 0;
        }
        if (!*part || depth >= DEEPEST) {
            return rey_fail(ctx, REY_ERROR_ARGUMENT, "--set %.200s: expected a key whose parts are joined by dots, such as "
                            "optimizer.learning_rate or views.0.weight", assignment);
        }
        rey_result result = step_into(ctx, node, part, assignment, &node);
        if (result) {
            return result;
        }
        part = dot ? dot + 1 : NULL;
    }
    *out = node;
    return REY_OK;
}

rey_result rey_yaml_override(rey_context *ctx, YamlNode *root, const char *assignment) {
    const char *equals = strchr(assignment, '=');
    if (!equals) {
        return rey_fail(ctx, REY_ERROR_ARGUMENT, "--set %.200s: expected key=value", assignment);
    }
    YamlNode *value, *node = NULL;
    rey_result result = read_text(ctx, "", assignment, (const unsigned char *)equals + 1, strlen(equals + 1), &value);
    if (result) {
        return result;
    }
    char *path = copy_text(ctx, assignment, (size_t)(equals - assignment));
    result = path ? override_path(ctx, root, path, assignment, &node) : REY_ERROR_MEMORY;
    rey_free(ctx, path);
    if (!result) { // the node keeps its key and its place; what it held is freed with `value`
        YamlNode held = *node;
        node->kind = value->kind;
        node->line = 0;
        node->set = assignment;
        node->text = value->text;
        node->child = value->child;
        value->text = held.text;
        value->child = held.child;
    }
    rey_yaml_free(ctx, value);
    return result;
}
