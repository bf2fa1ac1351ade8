// number.c: numbers in text files.
#define _GNU_SOURCE // strtod_l
#include "io/number.h"

#include <errno.h>
#include <float.h>
#include <locale.h>
#include <math.h>
#include <stdlib.h>

static bool is_digit(char c) {
    return c >= '0' && c <= '9';
}

// Length of [+-] digits [. digits] [e [+-] digits] at text, 0 when there is no such number.
static int decimal_length(const char *text) {
    int at = text[0] == '+' || text[0] == '-';
    int digits = 0;
    for (; is_digit(text[at]); at++) {
        digits++;
    }
    if (text[at] == '.') {
        for (at++; is_digit(text[at]); at++) {
            digits++;
        }
    }
    if (digits == 0) {
        return 0;
    }
    if (text[at] == 'e' || text[at] == 'E') {
        int exponent = at + 1 + (text[at + 1] == '+' || text[at + 1] == '-');
        if (is_digit(text[exponent])) {
            for (at = exponent; is_digit(text[at]); at++) {
            }
        }
    }
    return at;
}

bool rey_parse_real(const char *text, const char **end, double *value) {
    int length = decimal_length(text);
    if (length == 0) {
        return false;
    }
    locale_t c_locale = newlocale(LC_ALL_MASK, "C", (locale_t)0); // glibc hands out a constant, nothing is allocated
    if (!c_locale) {
        return false;
    }
    char *stop = NULL;
    double v = strtod_l(text, &stop, c_locale);
    freelocale(c_locale);
    if (stop != text + length || !isfinite(v)) {
        return false;
    }
    *end = stop;
    *value = v;
    return true;
}

bool rey_parse_single(const char *text, const char **end, double *value) {
    return rey_parse_real(text, end, value) && fabs(*value) <= (double)FLT_MAX;
}

bool rey_parse_integer(const char *text, const char **end, int64_t *value) {
    int sign = text[0] == '+' || text[0] == '-';
    if (!is_digit(text[sign])) {
        return false;
    }
    char *stop = NULL;
    errno = 0;
    long long v = strtoll(text, &stop, 10);
    if (errno == ERANGE) {
        return false;
    }
    *end = stop;
    *value = v;
    return true;
}
