// npy.c: reader of NumPy's array files, format versions 1 to 3 (described in numpy.lib.format).
#include "npy.h"

#include "base/context.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <stdio.h>

void cli_shape_text(const rey_param_info *info, char *text, size_t size) {
    snprintf(text, size, "%s", info->dims ? "" : "1");
    for (int i = 0; i < info->dims; i++) {
        size_t used = strlen(text);
        snprintf(text + used, size - used, "%s%lld", i ? "x" : "", (long long)info->shape[i]);
    }
}

typedef struct Header {
    int item_bytes; // 4 or 8
    int64_t count;
    char shape[64]; // as text: "3x4"
} Header;

// Product of the numbers of "'shape': (a, b, c)", which come out as "axbxc"; -1 when it is malformed or overflows.
static int64_t shape_count(const char *text, char shape[64]) {
    const char *s = strstr(text, "'shape':");
    s = s ? strchr(s, '(') : NULL;
    if (!s) {
        return -1;
    }
    int64_t count = 1;
    for (s++; *s != ')'; s++) {
        if (*s >= '0' && *s <= '9') {
            char *end;
            errno = 0;
            long long n = strtoll(s, &end, 10);
            if (errno || __builtin_mul_overflow(count, n, &count)) {
                return -1;
            }
            size_t used = strlen(shape);
            snprintf(shape + used, 64 - used, "%s%lld", used ? "x" : "", n);
            s = end - 1;
        } else if (*s != ',' && *s != ' ') {
            return -1;
        }
    }
    return count;
}

static rey_result read_header(rey_context *ctx, FILE *file, const char *path, Header *header) {
    unsigned char head[12];
    if (fread(head, 1, 10, file) != 10 || memcmp(head, "\x93NUMPY", 6) || head[6] < 1 || head[6] > 3) {
        return rey_fail(ctx, REY_ERROR_FORMAT, "%s: not a NumPy .npy file", path);
    }
    size_t length = head[8] | (size_t)head[9] << 8;
    if (head[6] > 1) {
        if (fread(head + 10, 1, 2, file) != 2) {
            return rey_fail(ctx, REY_ERROR_FORMAT, "%s: truncated", path);
        }
        length |= (size_t)head[10] << 16 | (size_t)head[11] << 24;
    }
    char text[4096] = "";
    if (length >= sizeof text || fread(text, 1, length, file) != length) {
        return rey_fail(ctx, REY_ERROR_FORMAT, "%s: truncated header", path);
    }
    const char *type = strstr(text, "'descr':");
    bool single = type && strstr(type, "'<f4'"), dual = type && strstr(type, "'<f8'");
    if (!single && !dual) {
        const char *word = type ? strchr(type + 8, '\'') : NULL;
        return rey_fail(ctx, REY_ERROR_FORMAT, "%s: expected float32 or float64 numbers ('<f4' or '<f8'), found '%.*s'",
                        path, word ? (int)strcspn(word + 1, "'") : 1, word ? word + 1 : "?");
    }
    if (strstr(text, "'fortran_order': True")) {
        return rey_fail(ctx, REY_ERROR_FORMAT, "%s: expected an array in C order, this one is in Fortran order", path);
    }
    header->item_bytes = single ? 4 : 8;
    header->count = shape_count(text, header->shape);
    return REY_OK;
}

static rey_result read_values(rey_context *ctx, FILE *file, const char *path, const Header *header, float *values) {
    for (int64_t i = 0; i < header->count; i++) {
        double number = 0;
        float narrow = 0;
        void *target = header->item_bytes == 4 ? (void *)&narrow : (void *)&number;
        if (fread(target, (size_t)header->item_bytes, 1, file) != 1) {
            return rey_fail(ctx, REY_ERROR_FORMAT, "%s: truncated after %lld of %lld numbers", path, (long long)i,
                            (long long)header->count);
        }
        values[i] = header->item_bytes == 4 ? narrow : (float)number;
        if (!isfinite(values[i])) {
            return rey_fail(ctx, REY_ERROR_FORMAT, "%s: number %lld is not finite", path, (long long)i);
        }
    }
    return REY_OK;
}

// The shape of a grid with its channels in a dimension of their own; "" of others.
static void apart_text(const rey_param_info *info, int channels, char text[96]) {
    text[0] = 0;
    if (channels > 0 && info->dims == 3) {
        snprintf(text, 96, "%lldx%lldx%lldx%d", (long long)info->shape[0], (long long)info->shape[1],
                 (long long)info->shape[2] / channels, channels);
    }
}

// flat: an array of one dimension will do as well.
static rey_result npy_read(rey_context *ctx, const char *path, const rey_param_info *info, int channels, bool flat, float *values) {
    FILE *file = fopen(path, "rb");
    if (!file) {
        return rey_fail(ctx, REY_ERROR_IO, "%s: cannot open: %s", path, strerror(errno));
    }
    Header header = {.shape = ""};
    rey_result result = read_header(ctx, file, path, &header);
    char shape[64], apart[96];
    cli_shape_text(info, shape, sizeof shape);
    apart_text(info, channels, apart);
    const char *found = header.shape[0] ? header.shape : "1";
    flat = flat && !strchr(found, 'x');
    if (!result && !flat && strcmp(shape, found) != 0 && strcmp(apart, found) != 0) {
        const bool colours = channels > 1;
        result = rey_fail(ctx, REY_ERROR_PARAM, "%s: '%s' has the shape %s, expected %s%s%s as in the scene", path, info->name,
                          found, shape, colours ? " or " : "", colours ? apart : "");
    }
    if (!result && header.count != info->count) {
        result = rey_fail(ctx, REY_ERROR_FORMAT, "%s: holds %lld numbers, the parameter has %lld", path,
                          (long long)header.count, (long long)info->count);
    }
    if (!result) {
        result = read_values(ctx, file, path, &header, values);
    }
    fclose(file);
    return result;
}

rey_result cli_npy_read_param(rey_context *ctx, const char *path, const rey_param_info *info, int channels, float *values) {
    return npy_read(ctx, path, info, channels, false, values);
}

rey_result cli_npy_read_tangent(rey_context *ctx, const char *path, const rey_param_info *info, int channels, float *values) {
    return npy_read(ctx, path, info, channels, true, values);
}
