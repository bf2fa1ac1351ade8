// json_lite.h: just enough JSON to read numbers out of files that are known to be well formed. Tests only.
// A value is a pointer to its first character; NULL stands for "not there" and passes through every function.
#pragma once

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// The whole file with a terminating zero, to be freed; NULL if it cannot be read.
static inline char *json_read_file(const char *path) {
    FILE *file = fopen(path, "rb");
    if (!file) {
        return NULL;
    }
    char *text = NULL;
    long size = fseek(file, 0, SEEK_END) == 0 ? ftell(file) : -1;
    rewind(file);
    if (size >= 0 && (text = malloc((size_t)size + 1))) {
        text[fread(text, 1, (size_t)size, file)] = 0;
    }
    fclose(file);
    return text;
}

static inline const char *json_space(const char *p) { return p + strspn(p, " \t\r\n"); }

// Behind a value.
static inline const char *json_skip(const char *p) {
    int depth = 0;
    do {
        p = json_space(p);
        if (*p == '"') {
            for (p++; *p && *p != '"'; p++) {
                p += *p == '\\' && p[1];
            }
            p += *p == '"';
        } else if (*p == '{' || *p == '[') {
            depth++;
            p++;
        } else if (*p == '}' || *p == ']') {
            depth--;
            p++;
        } else if (*p == ',' || *p == ':') {
            p++;
        } else {
            p += strcspn(p, ",:]} \t\r\n");
        }
    } while (depth > 0 && *p);
    return p;
}

// The value of a key in an object.
static inline const char *json_member(const char *object, const char *key) {
    if (!object || *(object = json_space(object)) != '{') {
        return NULL;
    }
    const char *p = json_space(object + 1);
    while (*p == '"') {
        const char *name = p + 1;
        p = json_space(json_skip(p));
        size_t length = strlen(key);
        const char *value = json_space(p + 1);
        if (strncmp(name, key, length) == 0 && name[length] == '"') {
            return value;
        }
        p = json_space(json_skip(value));
        p = *p == ',' ? json_space(p + 1) : p;
    }
    return NULL;
}

// An element of an array.
static inline const char *json_element(const char *array, int index) {
    if (!array || *(array = json_space(array)) != '[') {
        return NULL;
    }
    const char *p = json_space(array + 1);
    for (int i = 0; *p && *p != ']'; i++) {
        if (i == index) {
            return p;
        }
        p = json_space(json_skip(p));
        p = *p == ',' ? json_space(p + 1) : p;
    }
    return NULL;
}

// A number; NaN where there is none.
static inline double json_number(const char *value) {
    if (!value) {
        return strtod("nan", NULL);
    }
    char *end;
    double x = strtod(value, &end);
    return end == value ? strtod("nan", NULL) : x;
}

// Reads up to capacity numbers of an array of numbers, row by row where it is nested; returns how many there are.
static inline int json_numbers(const char *array, double *out, int capacity) {
    int count = 0;
    for (int i = 0;; i++) {
        const char *value = json_element(array, i);
        if (!value) {
            return count;
        }
        if (*value == '[') {
            count += json_numbers(value, out + count, capacity - count);
        } else if (count < capacity) {
            out[count++] = json_number(value);
        }
    }
}
