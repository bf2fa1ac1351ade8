// json_read.h: a small JSON reader for the test data.
#pragma once

#include <stdbool.h>

typedef enum JsonKind { JSON_NULL, JSON_BOOL, JSON_NUMBER, JSON_STRING, JSON_ARRAY, JSON_OBJECT } JsonKind;

typedef struct JsonNode {
    JsonKind kind;
    char *key;                     // null outside objects
    char *text;                    // of strings
    double number;                 // of numbers, and 0 or 1 of booleans
    struct JsonNode *first, *next; // first child; next sibling
} JsonNode;

// Parses a file; null after printing why to standard error.
JsonNode *json_read(const char *path);
void json_free(JsonNode *node);

// All of these accept null and give null, or the fallback, when there is no such thing.
const JsonNode *json_get(const JsonNode *object, const char *key);
const JsonNode *json_path(const JsonNode *object, const char *path); // keys separated by dots
const char *json_text(const JsonNode *object, const char *path, const char *fallback);
double json_value(const JsonNode *object, const char *path, double fallback);
