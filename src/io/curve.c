// curve.c: text files of curves.
#include "io/curve.h"

#include "io/decimal.h"
#include "io/file.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

void rey_curves_free(rey_context *ctx, rey_curves *curves) {
    rey_array_free(ctx, &curves->points);
    rey_array_free(ctx, &curves->segments);
}

// Ends a curve that began at point `first`.
static rey_result end_curve(rey_context *ctx, const char *name, int64_t line, size_t first, int order, rey_curves *out) {
    size_t count = out->points.count - first;
    if (count == 0) {
        return REY_OK;
    }
    if (count < (size_t)order) {
        return rey_fail(ctx, REY_ERROR_FORMAT, "%s:%lld: a curve of %zu control points, expected at least %d", name,
                        (long long)line, count, order);
    }
    size_t segments = count - (size_t)order + 1;
    int32_t *to = rey_array_push(ctx, &out->segments, sizeof *to, segments);
    for (size_t i = 0; to && i < segments; i++) {
        to[i] = (int32_t)(first + i);
    }
    return to ? REY_OK : REY_ERROR_MEMORY;
}

static const char *skip_blanks(const char *at, const char *end) {
    while (at < end && (*at == ' ' || *at == '\t' || *at == '\r')) {
        at++;
    }
    return at;
}

static rey_result read_point(rey_context *ctx, const char *name, int64_t line, const char *at, const char *end,
                             rey_curves *out) {
    if (out->points.count >= INT32_MAX / 4) {
        return rey_fail(ctx, REY_ERROR_UNSUPPORTED, "%s: more than %d control points", name, INT32_MAX / 4);
    }
    float *point = rey_array_push(ctx, &out->points, 4 * sizeof *point, 1);
    if (!point) {
        return REY_ERROR_MEMORY;
    }
    for (int k = 0; k < 4; k++) {
        const char *after = rey_parse_float(skip_blanks(at, end), end, &point[k]);
        bool ends = after && (after == end || *after == ' ' || *after == '\t' || *after == '\r');
        if (!ends || !isfinite(point[k]) || (k == 3 && point[k] < 0)) {
            return rey_fail(ctx, REY_ERROR_FORMAT, "%s:%lld: expected 'x y z radius', four finite numbers, radius >= 0",
                            name, (long long)line);
        }
        at = after;
    }
    return REY_OK;
}

static rey_result read_lines(rey_context *ctx, const char *name, const char *at, const char *end, int order,
                             rey_curves *out) {
    size_t first = 0;
    int64_t line = 0;
    while (at < end) {
        const char *newline = memchr(at, '\n', (size_t)(end - at)), *stop = newline ? newline : end;
        const char *word = skip_blanks(at, stop);
        rey_result result;
        line++;
        if (word == stop) {
            result = end_curve(ctx, name, line, first, order, out);
            first = out->points.count;
        } else {
            result = read_point(ctx, name, line, word, stop, out);
        }
        if (result != REY_OK) {
            return result;
        }
        at = newline ? newline + 1 : end;
    }
    rey_result result = end_curve(ctx, name, line, first, order, out);
    if (result == REY_OK && out->segments.count == 0) {
        return rey_fail(ctx, REY_ERROR_FORMAT, "%s: the file has no curves", name);
    }
    return result;
}

rey_result rey_curves_read_memory(rey_context *ctx, const char *name, const char *bytes, size_t size, int order,
                                  rey_curves *out) {
    *out = (rey_curves){{0}, {0}};
    const char *start = size ? bytes : "";
    rey_result result = read_lines(ctx, name, start, start + size, order, out);
    if (result != REY_OK) {
        rey_curves_free(ctx, out);
    }
    return result;
}

rey_result rey_curves_read(rey_context *ctx, const char *path, int order, rey_curves *out) {
    unsigned char *bytes;
    size_t size;
    *out = (rey_curves){{0}, {0}};
    rey_result result = rey_file_read(ctx, path, &bytes, &size);
    if (result == REY_OK) {
        result = rey_curves_read_memory(ctx, path, (const char *)bytes, size, order, out);
        rey_free(ctx, bytes);
    }
    return result;
}

static bool put_line(rey_context *ctx, Array *text, const float *p) {
    char line[128];
    int n = p ? snprintf(line, sizeof line, "%.9g %.9g %.9g %.9g\n", (double)p[0], (double)p[1], (double)p[2], (double)p[3])
              : snprintf(line, sizeof line, "\n");
    char *to = rey_array_push(ctx, text, 1, (size_t)n);
    if (to) {
        memcpy(to, line, (size_t)n);
    }
    return to != NULL;
}

rey_result rey_curves_write(rey_context *ctx, const char *path, const float *points, const int32_t *segments,
                            int32_t segment_count, int order) {
    Array text = {0};
    bool good = true;
    for (int32_t i = 0; i < segment_count && good; i++) {
        bool begins = i == 0 || segments[i] != segments[i - 1] + 1;
        good = !begins || i == 0 || put_line(ctx, &text, NULL);
        for (int k = begins ? 0 : order - 1; k < order && good; k++) {
            good = put_line(ctx, &text, points + 4 * (size_t)(segments[i] + k));
        }
    }
    rey_result result = good ? rey_file_write(ctx, path, text.data, text.count) : REY_ERROR_MEMORY;
    rey_array_free(ctx, &text);
    return result;
}
