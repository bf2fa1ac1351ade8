// image_npy.c: pictures in NumPy arrays.
#include "io/file.h"
#include "io/image.h"
#include "io/npy.h"

#include <stdio.h>
#include <string.h>

rey_result rey_npy_read_image(rey_context *ctx, const char *name, const unsigned char *bytes, size_t size,
                              rey_image *out) {
    rey_npy npy;
    rey_result result = rey_npy_header(ctx, name, bytes, size, size, &npy);
    if (result != REY_OK) {
        return result;
    }
    int64_t channels = npy.dims == 3 ? npy.shape[2] : 1;
    if (npy.dims < 2 || npy.dims > 3 || npy.shape[0] > IMAGE_LARGEST || npy.shape[1] > IMAGE_LARGEST || channels < 1 ||
        channels > 64) {
        return rey_fail(ctx, REY_ERROR_FORMAT,
                        "%s: expected an array of height x width or height x width x channels, each side at most %d and up "
                        "to 64 channels", name, IMAGE_LARGEST);
    }
    result = rey_image_new(ctx, name, npy.shape[1], npy.shape[0], (int)channels, out);
    for (int64_t i = 0; i < npy.count && result == REY_OK; i++) {
        double wide;
        if (npy.item == 4) {
            memcpy(out->data + i, bytes + npy.data + 4 * i, 4);
        } else {
            memcpy(&wide, bytes + npy.data + 8 * i, 8);
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
