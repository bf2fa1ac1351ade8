// json.c: the JSON writer (RFC 8259).
#include "json.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

Json json_begin(FILE *file) {
    return (Json){.file = file};
}

// Length of the well-formed UTF-8 sequence at s, 0 when there is none (RFC 3629, table in section 4).
static int utf8_length(const unsigned char *s) {
    if (s[0] < 0x80) {
        return 1;
    }
    int length = s[0] >= 0xC2 && s[0] <= 0xDF ? 2 : (s[0] & 0xF0) == 0xE0 ? 3 : s[0] >= 0xF0 && s[0] <= 0xF4 ? 4 : 0;
    for (int i = 1; i < length; i++) {
        if ((s[i] & 0xC0) != 0x80) {
            return 0;
        }
    }
    bool overlong = (s[0] == 0xE0 && s[1] < 0xA0) || (s[0] == 0xF0 && s[1] < 0x90);
    bool outside = (s[0] == 0xED && s[1] > 0x9F) || (s[0] == 0xF4 && s[1] > 0x8F);
    return overlong || outside ? 0 : length;
}

static void write_string(FILE *file, const char *text) {
    fputc('"', file);
    for (const unsigned char *s = (const unsigned char *)text; *s;) {
        int length = utf8_length(s);
        if (length == 0) {
            fputs("\\ufffd", file);
            s++;
        } else if (*s == '"' || *s == '\\') {
            fprintf(file, "\\%c", *s++);
        } else if (*s == '\n') {
            fputs("\\n", file);
            s++;
        } else if (*s < 0x20 || *s == 0x7F) {
            fprintf(file, "\\u%04x", *s++);
        } else {
            fwrite(s, 1, (size_t)length, file);
            s += length;
        }
    }
    fputc('"', file);
}

static void start_item(Json *json, const char *key) {
    if (json->started[json->depth]) {
        fputs(", ", json->file);
    }
    json->started[json->depth] = true;
    if (key) {
        write_string(json->file, key);
        fputs(": ", json->file);
    }
}

static void open_container(Json *json, const char *key, char bracket) {
    start_item(json, key);
    fputc(bracket, json->file);
    json->depth++;
    json->started[json->depth] = false;
}

static void close_container(Json *json, char bracket) {
    fputc(bracket, json->file);
    json->depth--;
}

void json_end(Json *json) {
    fputc('\n', json->file);
}

void json_object(Json *json, const char *key) {
    open_container(json, key, '{');
}

void json_object_end(Json *json) {
    close_container(json, '}');
}

void json_array(Json *json, const char *key) {
    open_container(json, key, '[');
}

void json_array_end(Json *json) {
    close_container(json, ']');
}

void json_string(Json *json, const char *key, const char *value) {
    start_item(json, key);
    if (value) {
        write_string(json->file, value);
    } else {
        fputs("null", json->file);
    }
}

void json_number(Json *json, const char *key, double value) {
    start_item(json, key);
    if (!isfinite(value)) {
        fputs("null", json->file);
        return;
    }
    char text[40];
    for (int digits = 6; digits <= 17; digits++) {
        snprintf(text, sizeof text, "%.*g", digits, value);
        if (strtod(text, NULL) == value) {
            break;
        }
    }
    fputs(text, json->file);
}

void json_integer(Json *json, const char *key, int64_t value) {
    start_item(json, key);
    fprintf(json->file, "%lld", (long long)value);
}

void json_bool(Json *json, const char *key, bool value) {
    start_item(json, key);
    fputs(value ? "true" : "false", json->file);
}
