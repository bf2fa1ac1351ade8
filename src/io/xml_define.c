// xml_define.c: <default> and $name substitution.
#include "io/xml_parts.h"

#include <string.h>

static XmlDefine *find_define(XmlReader *reader, const char *name) {
    for (size_t i = 0; i < reader->defines.count; i++) {
        XmlDefine *define = &ARRAY_AT(reader->defines, XmlDefine, i);
        if (strcmp(define->name, name) == 0) {
            return define;
        }
    }
    return NULL;
}

rey_result rey_xml_add_define(XmlReader *reader, const char *name, const char *value, bool from_caller,
                              rey_xml_position at) {
    if (find_define(reader, name)) {
        return from_caller ? rey_xml_fail(reader->ctx, at, REY_ERROR_ARGUMENT, "'%.100s' is defined twice", name)
                           : REY_OK; // the caller or an earlier <default> goes first
    }
    if (reader->defines.count >= XML_MOST_NAMES) {
        return rey_xml_fail(reader->ctx, at, REY_ERROR_SCENE, "more than %d defaults", XML_MOST_NAMES);
    }
    XmlDefine define = {.name = rey_xml_keep_text(reader->ctx, reader->document, name, strlen(name)),
                        .value = rey_xml_keep_text(reader->ctx, reader->document, value, strlen(value)),
                        .from_caller = from_caller};
    XmlDefine *slot =
        define.name && define.value ? rey_array_push(reader->ctx, &reader->defines, sizeof define, 1) : NULL;
    if (!slot) {
        return REY_ERROR_MEMORY;
    }
    *slot = define;
    return REY_OK;
}

static const char *define_name(void *user, int i) {
    XmlReader *reader = user;
    return (size_t)i < reader->defines.count ? ARRAY_AT(reader->defines, XmlDefine, i).name : NULL;
}

// The define with the longest name that text starts with: `$spp_low` prefers spp_low over spp.
static XmlDefine *longest_match(XmlReader *reader, const char *text) {
    XmlDefine *best = NULL;
    size_t best_length = 0;
    for (size_t i = 0; i < reader->defines.count; i++) {
        XmlDefine *define = &ARRAY_AT(reader->defines, XmlDefine, i);
        size_t length = strlen(define->name);
        if (length > best_length && strncmp(text, define->name, length) == 0) {
            best = define;
            best_length = length;
        }
    }
    return best;
}

static rey_result fail_undefined(XmlReader *reader, const char *text, rey_xml_position at) {
    char name[64];
    size_t length = 0;
    while (length + 1 < sizeof name &&
           ((text[length] >= 'a' && text[length] <= 'z') || (text[length] >= 'A' && text[length] <= 'Z') ||
            (text[length] >= '0' && text[length] <= '9') || text[length] == '_')) {
        name[length] = text[length];
        length++;
    }
    name[length] = '\0';
    return rey_xml_fail_word(reader->ctx, at, name, define_name, reader,
                             "undefined parameter '$%s', expected a <default> before this line or -D %s=value "
                             "(write \\$ for a dollar sign)",
                             name, length ? name : "name");
}

static rey_result append(XmlReader *reader, Array *out, const char *text, size_t length, rey_xml_position at) {
    reader->substituted += length;
    if (out->count + length > XML_LONGEST_VALUE || reader->substituted > XML_MOST_SUBSTITUTED) {
        return rey_xml_fail(reader->ctx, at, REY_ERROR_SCENE, "substitution makes this value too long");
    }
    char *place = length ? rey_array_push(reader->ctx, out, 1, length) : NULL;
    if (place) {
        memcpy(place, text, length);
    }
    return place || !length ? REY_OK : REY_ERROR_MEMORY;
}

rey_result rey_xml_substitute(XmlReader *reader, const char *text, rey_xml_position at, const char **out) {
    *out = text;
    if (!strchr(text, '$')) {
        return REY_OK;
    }
    Array buffer = {0};
    rey_result result = REY_OK;
    for (const char *c = text; *c && !result;) {
        if (c[0] == '\\' && c[1] == '$') {
            result = append(reader, &buffer, "$", 1, at);
            c += 2;
        } else if (c[0] == '$') {
            XmlDefine *define = longest_match(reader, c + 1);
            if (define) {
                define->used = true;
                c += 1 + strlen(define->name);
                result = append(reader, &buffer, define->value, strlen(define->value), at);
            } else {
                result = fail_undefined(reader, c + 1, at);
            }
        } else {
            size_t plain = 1 + strcspn(c + 1, "\\$");
            result = append(reader, &buffer, c, plain, at);
            c += plain;
        }
    }
    if (!result) {
        *out = rey_xml_keep_text(reader->ctx, reader->document, buffer.data ? buffer.data : "", buffer.count);
        result = *out ? REY_OK : REY_ERROR_MEMORY;
    }
    rey_array_free(reader->ctx, &buffer);
    return result;
}

static const char *unclaimed_name(void *user, int i) { // names that the file itself defines
    XmlReader *reader = user;
    for (size_t k = 0; k < reader->defines.count; k++) {
        XmlDefine *define = &ARRAY_AT(reader->defines, XmlDefine, k);
        if (!define->from_caller && i-- == 0) {
            return define->name;
        }
    }
    return NULL;
}

rey_result rey_xml_check_defines(XmlReader *reader, rey_xml_position at) {
    for (size_t i = 0; i < reader->defines.count; i++) {
        XmlDefine *define = &ARRAY_AT(reader->defines, XmlDefine, i);
        if (define->from_caller && !define->used) {
            const char *nearest = rey_nearest_word(define->name, unclaimed_name, reader);
            return rey_xml_fail(reader->ctx, at, REY_ERROR_ARGUMENT,
                                "the parameter '%.100s' was given but the scene never uses '$%.100s'%s%.100s%s", define->name,
                                define->name, nearest ? ", did you mean '" : "", nearest ? nearest : "", nearest ? "'?" : "");
        }
    }
    return REY_OK;
}
