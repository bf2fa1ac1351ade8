// number.h: numbers in text files, read the same whatever locale the host program has set.
#pragma once

#include "base/platform.h"

// Reads one decimal number at text. On success stores it and the position after it, and returns true. Hexadecimal
// forms, "nan", "inf" and numbers too large for a double are refused.
bool rey_parse_real(const char *text, const char **end, double *value);

// The same for numbers that end up in single precision: those too large for it are refused as well.
bool rey_parse_single(const char *text, const char **end, double *value);

// Reads one decimal integer at text; false when there is none or it does not fit.
bool rey_parse_integer(const char *text, const char **end, int64_t *value);

// Blanks, tabs, line ends.
static inline bool rey_is_blank(char c) {
    return c == ' ' || c == '\t' || c == '\n' || c == '\r';
}
