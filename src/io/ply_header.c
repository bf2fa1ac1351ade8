// ply_header.c: the text at the start of every PLY file: encoding, elements and their properties.
#include "io/decimal.h"
#include "io/ply.h"

#include <stdio.h>
#include <string.h>

typedef struct PlyTypeRow {
    const char *names[2];
    int size;
} PlyTypeRow;

static const PlyTypeRow type_rows[] = {
    [PLY_INT8] = {{"char", "int8"}, 1},        [PLY_UINT8] = {{"uchar", "uint8"}, 1},
    [PLY_INT16] = {{"short", "int16"}, 2},     [PLY_UINT16] = {{"ushort", "uint16"}, 2},
    [PLY_INT32] = {{"int", "int32"}, 4},       [PLY_UINT32] = {{"uint", "uint32"}, 4},
    [PLY_FLOAT32] = {{"float", "float32"}, 4}, [PLY_FLOAT64] = {{"double", "float64"}, 8},
};

rey_result rey_ply_fail(PlyReader *r, const char *format, ...) {
    char message[512];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(message, sizeof message, format, arguments);
    va_end(arguments);
    if (r->text) {
        return rey_fail(r->ctx, REY_ERROR_FORMAT, "%s:%lld: %s", r->path, (long long)r->line, message);
    }
    return rey_fail(r->ctx, REY_ERROR_FORMAT, "%s: byte %lld: %s", r->path, (long long)(r->at - r->start), message);
}

int rey_ply_type_size(PlyType type) {
    return type_rows[type].size;
}

bool rey_ply_word_is(PlyWord word, const char *text) {
    return strlen(text) == (size_t)word.length && memcmp(word.text, text, (size_t)word.length) == 0;
}

// The next word of the current line; empty at its end.
static PlyWord next_word(PlyReader *r) {
    while (r->at < r->end && (*r->at == ' ' || *r->at == '\t' || *r->at == '\r')) {
        r->at++;
    }
    PlyWord word = {r->at, 0};
    while (r->at < r->end && *r->at != ' ' && *r->at != '\t' && *r->at != '\r' && *r->at != '\n' &&
           word.length < INT32_MAX) {
        r->at++;
        word.length++;
    }
    return word;
}

static int shown(PlyWord word) {
    return word.length < 64 ? word.length : 64;
}

static rey_result next_line(PlyReader *r) {
    const char *newline = memchr(r->at, '\n', (size_t)(r->end - r->at));
    if (!newline) {
        return rey_ply_fail(r, "the file ends inside the header, expected end_header");
    }
    r->at = newline + 1;
    r->line++;
    return REY_OK;
}

static rey_result read_type(PlyReader *r, PlyType *type) {
    PlyWord word = next_word(r);
    for (int i = 0; i < PLY_TYPE_COUNT; i++) {
        if (rey_ply_word_is(word, type_rows[i].names[0]) || rey_ply_word_is(word, type_rows[i].names[1])) {
            *type = (PlyType)i;
            return REY_OK;
        }
    }
    return rey_ply_fail(r,
                        "unknown property type '%.*s', expected char, uchar, short, ushort, int, uint, float or double",
                        shown(word), word.text);
}

static rey_result read_format(PlyReader *r) {
    static const char *const names[] = {"ascii", "binary_little_endian", "binary_big_endian"};
    PlyWord encoding = next_word(r), version = next_word(r);
    for (int i = 0; i < COUNT_OF(names); i++) {
        if (rey_ply_word_is(encoding, names[i]) && rey_ply_word_is(version, "1.0")) {
            r->encoding = (PlyEncoding)i;
            return REY_OK;
        }
    }
    return rey_ply_fail(r, "format '%.*s %.*s', expected ascii, binary_little_endian or binary_big_endian, and 1.0",
                        shown(encoding), encoding.text, shown(version), version.text);
}

static rey_result read_element(PlyReader *r) {
    PlyElement element = {.name = next_word(r), .first_property = r->property_count};
    PlyWord count = next_word(r);
    const char *end = count.text + count.length;
    if (!element.name.length || rey_parse_int(count.text, end, &element.count) != end || element.count < 0) {
        return rey_ply_fail(r, "'%.*s' is not an element count, expected 'element NAME COUNT'", shown(count),
                            count.text);
    }
    for (int i = 0; i < r->element_count; i++) {
        PlyWord other = r->elements[i].name;
        if (other.length == element.name.length && memcmp(other.text, element.name.text, (size_t)other.length) == 0) {
            return rey_ply_fail(r, "element '%.*s' appears twice", shown(other), other.text);
        }
    }
    if (r->element_count == PLY_MOST_ELEMENTS) {
        return rey_ply_fail(r, "more than %d elements", PLY_MOST_ELEMENTS);
    }
    r->elements[r->element_count++] = element;
    return REY_OK;
}

static rey_result read_property(PlyReader *r) {
    if (r->element_count == 0) {
        return rey_ply_fail(r, "property before the first element");
    }
    PlyProperty property = {.stride = 0};
    const char *start = r->at;
    property.list = rey_ply_word_is(next_word(r), "list");
    rey_result result;
    if (property.list) {
        result = read_type(r, &property.count_type);
        if (result == REY_OK && property.count_type >= PLY_FLOAT32) {
            result = rey_ply_fail(r, "the length of a list has a floating-point type, expected an integer type");
        }
        if (result != REY_OK) {
            return result;
        }
    } else {
        r->at = start;
    }
    result = read_type(r, &property.type);
    if (result != REY_OK) {
        return result;
    }
    property.name = next_word(r);
    if (!property.name.length) {
        return rey_ply_fail(r, "property without a name, expected 'property TYPE NAME'");
    }
    if (r->property_count == PLY_MOST_PROPERTIES) {
        return rey_ply_fail(r, "more than %d properties", PLY_MOST_PROPERTIES);
    }
    r->properties[r->property_count++] = property;
    r->elements[r->element_count - 1].property_count++;
    return REY_OK;
}

rey_result rey_ply_read_header(PlyReader *r) {
    r->text = true;
    r->line = 1;
    if (!rey_ply_word_is(next_word(r), "ply")) {
        return rey_ply_fail(r, "not a PLY file, expected 'ply' at the start");
    }
    bool has_format = false;
    for (;;) {
        rey_result result = next_line(r);
        if (result != REY_OK) {
            return result;
        }
        PlyWord word = next_word(r);
        if (rey_ply_word_is(word, "end_header")) {
            break;
        } else if (rey_ply_word_is(word, "format")) {
            result = read_format(r);
            has_format = true;
        } else if (rey_ply_word_is(word, "element")) {
            result = read_element(r);
        } else if (rey_ply_word_is(word, "property")) {
            result = read_property(r);
        } else if (word.length && !rey_ply_word_is(word, "comment") && !rey_ply_word_is(word, "obj_info")) {
            result = rey_ply_fail(r,
                                  "unknown header line '%.*s', expected format, comment, obj_info, element, property "
                                  "or end_header",
                                  shown(word), word.text);
        }
        if (result != REY_OK) {
            return result;
        }
    }
    if (!has_format) {
        return rey_ply_fail(r, "the header has no format line");
    }
    rey_result result = next_line(r);
    r->text = r->encoding == PLY_ASCII;
    return result;
}
