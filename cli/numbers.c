// numbers.c: texts to numbers, all or nothing.
#include "cli.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>

bool cli_parse_integer(const char *text, int64_t low, int64_t high, int64_t *out) {
    char *end;
    errno = 0;
    long long value = strtoll(text, &end, 10);
    if (end == text || *end || errno || value < low || value > high) {
        return false;
    }
    *out = value;
    return true;
}

bool cli_parse_number(const char *text, double *out) {
    char *end;
    double value = strtod(text, &end);
    if (end == text || *end || !isfinite(value)) {
        return false;
    }
    *out = value;
    return true;
}

int cli_parse_list(const char *text, int max, double *out) {
    int count = 0;
    const char *s = text;
    for (;;) {
        char *end;
        double value = strtod(s, &end);
        if (end == s || !isfinite(value) || count == max || (*end && *end != ',')) {
            return -1;
        }
        out[count++] = value;
        if (!*end) {
            return count;
        }
        s = end + 1;
    }
}
