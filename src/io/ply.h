// ply.h: the header of a PLY file.
#pragma once

#include "io/mesh.h"

typedef enum PlyType {
    PLY_INT8,
    PLY_UINT8,
    PLY_INT16,
    PLY_UINT16,
    PLY_INT32,
    PLY_UINT32,
    PLY_FLOAT32,
    PLY_FLOAT64,
    PLY_TYPE_COUNT
} PlyType;

typedef enum PlyEncoding { PLY_ASCII, PLY_LITTLE_ENDIAN, PLY_BIG_ENDIAN } PlyEncoding;

typedef struct PlyWord { // a stretch of the file
    const char *text;
    int length;
} PlyWord;

typedef struct PlyProperty {
    PlyWord name;
    PlyType type; // of the value, or of a list's values
    bool list;
    PlyType count_type; // of a list's length
    float *target;      // values of item i go to target[i * stride]; null: skipped
    int stride;
} PlyProperty;

typedef struct PlyElement {
    PlyWord name;
    int64_t count;
    int first_property, property_count;
} PlyElement;

enum { PLY_MOST_PROPERTIES = 1024, PLY_MOST_ELEMENTS = 64 };

// A position in the file and all that is known from the header.
typedef struct PlyReader {
    rey_context *ctx;
    const char *path;
    const char *start, *at, *end;
    int64_t line; // of at, from 1; counted in text only
    bool text;    // at is in text: the header or ASCII data
    PlyEncoding encoding;
    PlyElement elements[PLY_MOST_ELEMENTS];
    int element_count;
    PlyProperty properties[PLY_MOST_PROPERTIES];
    int property_count;
} PlyReader;

// Reads from "ply" to the line after "end_header".
rey_result rey_ply_read_header(PlyReader *r);

// REY_ERROR_FORMAT with "PATH:LINE: " or "PATH: byte OFFSET: " before the message.
rey_result rey_ply_fail(PlyReader *r, const char *format, ...) PRINTF_LIKE(2, 3);

int rey_ply_type_size(PlyType type); // [bytes]
bool rey_ply_word_is(PlyWord word, const char *text);

// ---- values, in the file's encoding: each checks the end of the file and moves on ----------------------------------

rey_result rey_ply_read_int(PlyReader *r, PlyType type, int64_t *value);
rey_result rey_ply_read_float(PlyReader *r, PlyType type, float *value); // may be infinite or not a number
rey_result rey_ply_skip_value(PlyReader *r, PlyType type);
// A list's length, checked against what is left of the file.
rey_result rey_ply_read_length(PlyReader *r, const PlyProperty *property, int64_t *length);
rey_result rey_ply_skip_list(PlyReader *r, const PlyProperty *property);
