// image_raw.c: PFM and NumPy arrays.
#include "io/file.h"
#include "io/image.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

rey_result rey_pfm_read(rey_context *ctx, const char *name, const unsigned char *bytes, size_t size, rey_image *out) {
    char header[128];
    int width, height, used = 0;
    float scale;
    size_t n = size < sizeof header - 1 ? size : sizeof header - 1;
    memcpy(header, bytes, n);
    header[n] = 0;
    int channels = bytes[1] == 'F' ? 3 : 1;
    if (sscanf(header + 2, "%d %d %f%n", &width, &height, &scale, &used) != 3 || scale == 0) {
        return rey_fail(ctx, REY_ERROR_FORMAT, "%s: malformed PFM header, expected 'PF', width, height and scale", name);
    }
    if (scale > 0) {
        return rey_fail(ctx, REY_ERROR_UNSUPPORTED, "%s: big-endian PFM is not supported", name);
    }
    size_t at = 2 + (size_t)used + 1;
    size_t row = (size_t)(width > 0 ? width : 0) * (size_t)channels * sizeof(float);
    if (width > 0 && height > 0 && (at > size || row > (size - at) / (size_t)height)) {
        return rey_fail(ctx, REY_ERROR_FORMAT, "%s: the file ends before its %d x %d pixels", name, width, height);
    }
    rey_result result = rey_image_new(ctx, name, width, height, channels, out);
    for (int y = 0; y < height && result == REY_OK; y++) { // rows from the bottom
        memcpy(out->data + (size_t)(height - 1 - y) * row / sizeof(float), bytes + at + (size_t)y * row, row);
    }
    return result;
}

// Shape and element size from the array's header text: "{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3), }".
static bool npy_header(const char *text, int *item, int64_t shape[3], int *dims) {
    const char *descr = strstr(text, "'descr'"), *order = strstr(text, "'fortran_order'"), *list = strstr(text, "'shape'");
    if (!descr || !order || !list) {
        return false;
    }
    *item = strstr(descr, "'<f4'") ? 4 : strstr(descr, "'<f8'") ? 8 : 0;
    list = strchr(list, '(');
    const char *falsehood = strstr(order, "False");
    if (!*item || !list || !falsehood || falsehood - order > 24) {
        return false;
    }
    *dims = 0;
    for (const char *p = list + 1; *p && *p != ')';) {
        char *end;
        long long n = strtoll(p, &end, 10);
        if (end == p || n < 0 || *dims == 3) {
            return false;
        }
        shape[(*dims)++] = n;
        p = end + strspn(end, ", ");
    }
    return true;
}

rey_result rey_npy_read_image(rey_context *ctx, const char *name, const unsigned char *bytes, size_t size,
                              rey_image *out) {
    char text[1024];
    int item, dims;
    int64_t shape[3] = {0, 0, 1};
    bool second = size > 12 && bytes[6] >= 2;
    size_t length = size > 12 ? (size_t)bytes[8] | (size_t)bytes[9] << 8 : 0;
    if (second) {
        length |= (size_t)bytes[10] << 16 | (size_t)bytes[11] << 24;
    }
    size_t at = (second ? 12u : 10u) + length;
    if (size <= 12 || at > size || length >= sizeof text) {
        return rey_fail(ctx, REY_ERROR_FORMAT, "%s: malformed NPY header", name);
    }
    memcpy(text, bytes + at - length, length);
    text[length] = 0;
    if (!npy_header(text, &item, shape, &dims) || dims < 2) {
        return rey_fail(ctx, REY_ERROR_FORMAT,
                        "%s: expected a C-ordered float32 or float64 array of 2 or 3 dimensions", name);
    }
    if (shape[0] > IMAGE_LARGEST || shape[1] > IMAGE_LARGEST || shape[2] < 1 || shape[2] > 64 ||
        (uint64_t)(shape[0] * shape[1] * shape[2]) > (size - at) / (size_t)item) {
        return rey_fail(ctx, REY_ERROR_FORMAT, "%s: the file ends before its array", name);
    }
    rey_result result = rey_image_new(ctx, name, shape[1], shape[0], (int)shape[2], out);
    for (int64_t i = 0; i < shape[0] * shape[1] * shape[2] && result == REY_OK; i++) {
        double wide;
        if (item == 4) {
            memcpy(out->data + i, bytes + at + 4 * i, 4);
        } else {
            memcpy(&wide, bytes + at + 8 * i, 8);
            out->data[i] = (float)wide;
        }
    }
    return result;
}

rey_result rey_npy_write(rey_context *ctx, const char *path, const float *data, const int64_t *shape, int dims) {
    char list[128] = "", header[256];
    size_t count = 1;
    for (int i = 0; i < dims; i++) {
        size_t used = strlen(list);
        snprintf(list + used, sizeof list - used, "%lld%s", (long long)shape[i], dims == 1 || i + 1 < dims ? ", " : "");
        count *= (size_t)shape[i];
    }
    int n = snprintf(header, sizeof header, "{'descr': '<f4', 'fortran_order': False, 'shape': (%s), }", list);
    int padded = (10 + n + 1 + 63) / 64 * 64 - 10; // the data begins at a multiple of 64
    size_t size = 10 + (size_t)padded + count * sizeof(float);
    unsigned char *bytes = rey_alloc(ctx, size);
    if (!bytes) {
        return REY_ERROR_MEMORY;
    }
    memcpy(bytes, "\x93NUMPY\x01\x00", 8);
    bytes[8] = (unsigned char)(padded & 255);
    bytes[9] = (unsigned char)(padded >> 8);
    memset(bytes + 10, ' ', (size_t)padded);
    memcpy(bytes + 10, header, (size_t)n);
    bytes[10 + padded - 1] = '\n';
    memcpy(bytes + 10 + padded, data, count * sizeof(float));
    rey_result result = rey_file_write(ctx, path, bytes, size);
    rey_free(ctx, bytes);
    return result;
}
