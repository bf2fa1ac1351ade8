// decimal.c: text to the nearest float. The fast path computes in double, whose error of under two units in the last
// place can only matter when the result lies close to the middle between two floats; those cases, and large exponents,
// go to the C library in a spelling without a decimal point, which no locale changes.
#include "io/decimal.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double powers_of_ten[] = {1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,  1e8,  1e9,  1e10, 1e11,
                                       1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22};

static bool is_digit(char c) {
    return c >= '0' && c <= '9';
}

static bool starts_with(const char *text, const char *end, const char *word) {
    for (; *word; text++, word++) {
        if (text == end || (*text | 0x20) != *word) {
            return false;
        }
    }
    return true;
}

static const char *parse_special(const char *text, const char *end, bool negative, float *value) {
    if (starts_with(text, end, "nan")) {
        *value = NAN;
        return text + 3;
    }
    if (starts_with(text, end, "inf")) {
        *value = negative ? -INFINITY : INFINITY;
        return text + (starts_with(text, end, "infinity") ? 8 : 3);
    }
    return NULL;
}

// Digits (with at most one point) times 10^exponent through strtof. The middle between two floats has at most 113
// significant digits, so longer numbers round the same when what follows is replaced by a single nonzero digit.
static float parse_slowly(const char *text, const char *end, int64_t exponent) {
    enum { MOST_DIGITS = 120, LARGEST_EXPONENT = 9999 };
    char spelled[MOST_DIGITS + 32];
    int count = 0;
    bool after_point = false, more = false;
    for (; text < end; text++) {
        if (*text == '.') {
            after_point = true;
        } else if (count < MOST_DIGITS) {
            if (count || *text != '0') {
                spelled[count++] = *text;
            }
            exponent -= after_point;
        } else {
            more |= *text != '0';
            exponent += !after_point;
        }
    }
    if (more) {
        spelled[count++] = '1';
        exponent--;
    }
    exponent = exponent > LARGEST_EXPONENT ? LARGEST_EXPONENT : exponent;
    exponent = exponent < -LARGEST_EXPONENT ? -LARGEST_EXPONENT : exponent;
    snprintf(spelled + count, sizeof spelled - (size_t)count, "e%d", (int)exponent);
    return strtof(spelled, NULL);
}

// True when every double within a few units in the last place of d rounds to the same float as d.
static bool rounds_safely(double d) {
    uint64_t bits;
    memcpy(&bits, &d, sizeof bits);
    // A double has 29 bits more than a float: the middle between two floats is 2^28 in those.
    int64_t below = (int64_t)(bits & 0x1FFFFFFF) - 0x10000000;
    return (below > 8 || below < -8) && d < (double)FLT_MAX;
}

// Reads e [+-] digits if all of that is there; returns text itself if not.
static const char *parse_exponent(const char *text, const char *end, int64_t *exponent) {
    const char *at = text;
    if (at == end || (*at | 0x20) != 'e') {
        return text;
    }
    at++;
    bool negative = at < end && *at == '-';
    at += at < end && (*at == '-' || *at == '+');
    if (at == end || !is_digit(*at)) {
        return text;
    }
    int64_t value = 0;
    for (; at < end && is_digit(*at); at++) {
        value = value < INT64_C(1000000000000) ? 10 * value + (*at - '0') : value;
    }
    *exponent += negative ? -value : value;
    return at;
}

const char *rey_parse_float(const char *text, const char *end, float *value) {
    const uint64_t full = UINT64_C(1000000000000000000); // one more digit still fits 64 bits
    const char *at = text;
    bool negative = at < end && *at == '-';
    at += at < end && (*at == '-' || *at == '+');
    const char *first = at;
    uint64_t digits = 0;
    int64_t exponent = 0; // the value is digits 10^exponent, digits cut off after the 19th
    for (; at < end && is_digit(*at); at++) {
        if (digits < full) {
            digits = 10 * digits + (uint64_t)(*at - '0');
        } else {
            exponent++;
        }
    }
    bool any = at > first;
    if (at < end && *at == '.') {
        const char *fraction = ++at;
        for (; at < end && is_digit(*at); at++) {
            if (digits < full) {
                digits = 10 * digits + (uint64_t)(*at - '0');
                exponent--;
            }
        }
        any |= at > fraction;
    }
    if (!any) {
        return parse_special(first, end, negative, value);
    }
    const char *last = at;
    int64_t stated = 0;
    at = parse_exponent(at, end, &stated);
    exponent += stated;
    float magnitude = 0;
    if (digits) {
        double d = INFINITY;
        if (exponent >= -22 && exponent <= 22) {
            d = exponent < 0 ? (double)digits / powers_of_ten[-exponent] : (double)digits * powers_of_ten[exponent];
        }
        magnitude = rounds_safely(d) ? (float)d : parse_slowly(first, last, stated);
    }
    *value = negative ? -magnitude : magnitude;
    return at;
}

const char *rey_parse_int(const char *text, const char *end, int64_t *value) {
    const char *at = text;
    bool negative = at < end && *at == '-';
    at += at < end && (*at == '-' || *at == '+');
    const char *first = at;
    int64_t magnitude = 0;
    for (; at < end && is_digit(*at); at++) {
        if (magnitude > INT64_C(99999999999999999)) {
            return NULL;
        }
        magnitude = 10 * magnitude + (*at - '0');
    }
    *value = negative ? -magnitude : magnitude;
    return at > first ? at : NULL;
}
