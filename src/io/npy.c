// npy.c: NumPy's arrays: a header that is a Python dictionary, "{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3), }",
// and the numbers.
#include "io/npy.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const int64_t most_numbers = INT64_MAX / 16;

static bool parse_shape(const char *list, rey_npy *out) {
    out->dims = 0;
    out->count = 1;
    for (const char *p = list; *p && *p != ')';) {
        char *end;
        long long n = strtoll(p, &end, 10);
        if (end == p || n < 0 || out->dims == NPY_MOST_DIMS) {
            return false;
        }
        out->shape[out->dims++] = n;
        out->count = n > 0 && out->count > most_numbers / n ? most_numbers : out->count * n; // no file has that many
        p = end + strspn(end, ", ");
    }
    return true;
}

static bool parse_header(const char *text, rey_npy *out) {
    const char *descr = strstr(text, "'descr'"), *order = strstr(text, "'fortran_order'"), *list = strstr(text, "'shape'");
    if (!descr || !order || !list) {
        return false;
    }
    const char *number = descr + 7 + strspn(descr + 7, ": "), *falsehood = strstr(order, "False");
    out->item = strncmp(number, "'<f4'", 5) == 0 ? 4 : strncmp(number, "'<f8'", 5) == 0 ? 8 : 0;
    list = strchr(list, '(');
    return out->item && list && falsehood && falsehood - order <= 24 && parse_shape(list + 1, out);
}

rey_result rey_npy_header(rey_context *ctx, const char *name, const unsigned char *head, size_t head_size, size_t size,
                          rey_npy *out) {
    char text[1024];
    *out = (rey_npy){0};
    bool enough = head_size > 12 && memcmp(head, "\x93NUMPY", 6) == 0, second = enough && head[6] >= 2;
    size_t length = enough ? (size_t)head[8] | (size_t)head[9] << 8 : 0, begin = second ? 12 : 10;
    length |= second ? (size_t)head[10] << 16 | (size_t)head[11] << 24 : 0;
    if (!enough || length >= sizeof text || begin + length > head_size) {
        return rey_fail(ctx, REY_ERROR_FORMAT, "%s: byte %d: malformed NPY header, expected a dictionary of less than %zu bytes",
                        name, enough ? 8 : 0, sizeof text);
    }
    memcpy(text, head + begin, length);
    text[length] = 0;
    if (!parse_header(text, out)) {
        return rey_fail(ctx, REY_ERROR_FORMAT,
                        "%s: byte %zu: expected a C-ordered float32 or float64 array ('<f4', '<f8') of up to %d dimensions", name,
                        begin, NPY_MOST_DIMS);
    }
    out->data = begin + length;
    if ((uint64_t)out->count > (size - out->data) / (size_t)out->item) {
        return rey_fail(ctx, REY_ERROR_FORMAT, "%s: byte %zu: the file ends before its array of %lld numbers", name, size,
                        (long long)out->count);
    }
    return REY_OK;
}

rey_result rey_npy_decode(rey_context *ctx, const char *name, int item, const unsigned char *bytes, size_t first,
                          size_t count, float *values) {
    for (size_t i = 0; i < count; i++) {
        double wide;
        if (item == 4) {
            memcpy(values + i, bytes + 4 * i, 4);
        } else {
            memcpy(&wide, bytes + 8 * i, 8);
            values[i] = (float)wide;
        }
        if (!isfinite(values[i])) {
            return rey_fail(ctx, REY_ERROR_FORMAT, "%s: number %zu is not finite", name, first + i);
        }
    }
    return REY_OK;
}
