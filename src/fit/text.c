// text.c: a growing text.
#include "fit/text.h"

#include "io/number.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

void rey_text_bytes(Text *text, const void *bytes, size_t size) {
    if (text->failed || !size) {
        return;
    }
    char *end = rey_array_push(text->ctx, &text->bytes, 1, size);
    if (!end) {
        text->failed = true;
        return;
    }
    memcpy(end, bytes, size);
}

void rey_text_add(Text *text, const char *format, ...) {
    char line[1024];
    va_list arguments, again;
    va_start(arguments, format);
    va_copy(again, arguments);
    int length = vsnprintf(line, sizeof line, format, arguments);
    va_end(arguments);
    if (length >= (int)sizeof line) {
        char *big = rey_alloc(text->ctx, (size_t)length + 1);
        if (big) {
            vsnprintf(big, (size_t)length + 1, format, again);
            rey_text_bytes(text, big, (size_t)length);
            rey_free(text->ctx, big);
        } else {
            text->failed = true;
        }
    } else if (length > 0) {
        rey_text_bytes(text, line, (size_t)length);
    }
    va_end(again);
}

void rey_text_base64(Text *text, const unsigned char *bytes, size_t size) {
    static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    for (size_t i = 0; i < size; i += 3) {
        uint32_t word = (uint32_t)bytes[i] << 16;
        word |= i + 1 < size ? (uint32_t)bytes[i + 1] << 8 : 0;
        word |= i + 2 < size ? (uint32_t)bytes[i + 2] : 0;
        char four[4];
        for (int k = 0; k < 4; k++) {
            four[k] = i + (size_t)k > size ? '=' : digits[word >> (18 - 6 * k) & 63];
        }
        rey_text_bytes(text, four, 4);
    }
}

void rey_text_html(Text *text, const char *plain) {
    for (; *plain; plain++) {
        switch (*plain) {
        case '&':
            rey_text_bytes(text, "&amp;", 5);
            break;
        case '<':
            rey_text_bytes(text, "&lt;", 4);
            break;
        case '>':
            rey_text_bytes(text, "&gt;", 4);
            break;
        case '"':
            rey_text_bytes(text, "&quot;", 6);
            break;
        default:
            rey_text_bytes(text, plain, 1);
        }
    }
}

void rey_text_json(Text *text, const char *plain) {
    rey_text_bytes(text, "\"", 1);
    for (; *plain; plain++) {
        if ((unsigned char)*plain < 32) {
            rey_text_add(text, "\\u%04x", *plain);
        } else {
            if (*plain == '"' || *plain == '\\') {
                rey_text_bytes(text, "\\", 1);
            }
            rey_text_bytes(text, plain, 1);
        }
    }
    rey_text_bytes(text, "\"", 1);
}

void rey_text_number(Text *text, double value) {
    char digits[40];
    if (!isfinite(value)) {
        rey_text_bytes(text, "null", 4);
        return;
    }
    // Exponents are for numbers that need them.
    double size = fabs(value);
    int whole = size >= 1 && size < 1e15 ? (int)log10(size) + 1 : 1;
    for (int precision = whole; precision <= 17; precision++) {
        snprintf(digits, sizeof digits, "%.*g", precision, value);
        for (char *c = digits; *c; c++) {
            *c = *c == ',' ? '.' : *c; // locales with a decimal comma
        }
        const char *end;
        double back = 0;
        if (rey_parse_real(digits, &end, &back) && back == value) {
            break;
        }
    }
    rey_text_bytes(text, digits, strlen(digits));
}

void rey_text_free(Text *text) {
    rey_array_free(text->ctx, &text->bytes);
}

rey_result rey_text_take(Text *text, char **out) {
    rey_text_bytes(text, "", 1);
    *out = NULL;
    if (text->failed) {
        rey_text_free(text);
        return rey_fail_memory(text->ctx, text->bytes.count);
    }
    *out = text->bytes.data;
    text->bytes = (Array){0};
    return REY_OK;
}
