// ply_values.c: single values and lists in the data of a PLY file.
#include "io/decimal.h"
#include "io/ply.h"

#include <string.h>

static uint64_t load(const PlyReader *r, int size) {
    uint64_t value = 0;
    for (int i = 0; i < size; i++) {
        int shift = 8 * (r->encoding == PLY_BIG_ENDIAN ? size - 1 - i : i);
        value |= (uint64_t)(unsigned char)r->at[i] << shift;
    }
    return value;
}

static rey_result fail_end(PlyReader *r, const char *what) {
    return rey_ply_fail(r, "the file ends inside its data, expected %s", what);
}

// Moves to the next word of ASCII data, over line ends.
static rey_result skip_space(PlyReader *r) {
    for (; r->at < r->end; r->at++) {
        if (*r->at == '\n') {
            r->line++;
        } else if (*r->at != ' ' && *r->at != '\t' && *r->at != '\r') {
            return REY_OK;
        }
    }
    return fail_end(r, "another number");
}

static bool word_ends(const PlyReader *r, const char *at) {
    return at == r->end || *at == ' ' || *at == '\t' || *at == '\r' || *at == '\n';
}

static rey_result fail_word(PlyReader *r, const char *expected) {
    int length = 0;
    while (length < 32 && !word_ends(r, r->at + length)) {
        length++;
    }
    return rey_ply_fail(r, "'%.*s', expected %s", length, r->at, expected);
}

rey_result rey_ply_read_int(PlyReader *r, PlyType type, int64_t *value) {
    if (r->text) {
        rey_result result = skip_space(r);
        if (result != REY_OK) {
            return result;
        }
        const char *after = rey_parse_int(r->at, r->end, value);
        if (!after || !word_ends(r, after)) {
            return fail_word(r, "an integer");
        }
        r->at = after;
        return REY_OK;
    }
    int size = rey_ply_type_size(type);
    if (r->end - r->at < size) {
        return fail_end(r, "another integer");
    }
    uint64_t bits = load(r, size);
    switch (type) {
    case PLY_INT8:
        *value = (int8_t)bits;
        break;
    case PLY_INT16:
        *value = (int16_t)bits;
        break;
    case PLY_INT32:
        *value = (int32_t)bits;
        break;
    default:
        *value = (int64_t)bits;
        break;
    }
    r->at += size;
    return REY_OK;
}

rey_result rey_ply_read_float(PlyReader *r, PlyType type, float *value) {
    if (r->text) {
        rey_result result = skip_space(r);
        if (result != REY_OK) {
            return result;
        }
        const char *after = rey_parse_float(r->at, r->end, value);
        if (!after || !word_ends(r, after)) {
            return fail_word(r, "a number");
        }
        r->at = after;
        return REY_OK;
    }
    if (type < PLY_FLOAT32) {
        int64_t integer;
        rey_result result = rey_ply_read_int(r, type, &integer);
        *value = result == REY_OK ? (float)integer : 0;
        return result;
    }
    int size = rey_ply_type_size(type);
    if (r->end - r->at < size) {
        return fail_end(r, "another number");
    }
    uint64_t bits = load(r, size);
    if (type == PLY_FLOAT32) {
        uint32_t low = (uint32_t)bits;
        memcpy(value, &low, sizeof low);
    } else {
        double wide;
        memcpy(&wide, &bits, sizeof wide);
        *value = (float)wide;
    }
    r->at += size;
    return REY_OK;
}

rey_result rey_ply_skip_value(PlyReader *r, PlyType type) {
    if (r->text) {
        rey_result result = skip_space(r);
        while (!word_ends(r, r->at)) {
            r->at++;
        }
        return result;
    }
    if (r->end - r->at < rey_ply_type_size(type)) {
        return fail_end(r, "another number");
    }
    r->at += rey_ply_type_size(type);
    return REY_OK;
}

rey_result rey_ply_read_length(PlyReader *r, const PlyProperty *property, int64_t *length) {
    rey_result result = rey_ply_read_int(r, property->count_type, length);
    int least = r->text ? 2 : rey_ply_type_size(property->type); // a digit and a space
    if (result == REY_OK && (*length < 0 || *length > (r->end - r->at + 1) / least)) {
        result = rey_ply_fail(r, "a list of %lld values does not fit the %lld bytes left", (long long)*length,
                              (long long)(r->end - r->at));
    }
    return result;
}

rey_result rey_ply_skip_list(PlyReader *r, const PlyProperty *property) {
    int64_t length;
    rey_result result = rey_ply_read_length(r, property, &length);
    for (int64_t i = 0; result == REY_OK && i < length; i++) {
        result = rey_ply_skip_value(r, property->type);
    }
    return result;
}
