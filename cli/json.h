// json.h: writes one JSON value to a stream, comma by comma.
#pragma once

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

enum { JSON_MAX_DEPTH = 16 };

typedef struct Json {
    FILE *file;
    int depth;
    bool started[JSON_MAX_DEPTH]; // whether the container at this depth has an item already
} Json;

Json json_begin(FILE *file);
void json_end(Json *json); // ends the line

// key is null inside arrays and for the outermost value.
void json_object(Json *json, const char *key);
void json_object_end(Json *json);
void json_array(Json *json, const char *key);
void json_array_end(Json *json);
void json_string(Json *json, const char *key, const char *value); // null becomes null; broken UTF-8 becomes U+FFFD
void json_number(Json *json, const char *key, double value);      // shortest exact form; null when not finite
void json_integer(Json *json, const char *key, int64_t value);
void json_bool(Json *json, const char *key, bool value);
