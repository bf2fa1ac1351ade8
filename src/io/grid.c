// grid.c: fields over space from files.
#include "io/grid.h"

#include "io/file.h"
#include "io/npy.h"
#include "io/vol.h"

#include <string.h>
#include <unistd.h>

enum { GRID_VOL, GRID_NPY, GRID_NVDB };
enum { HEAD = 1 << 12, CHUNK = 1 << 20 }; // bytes; values

int64_t rey_grid_count(const rey_grid *grid) { return (int64_t)grid->nx * grid->ny * grid->nz * grid->channels; }

void rey_grid_close(rey_context *ctx, rey_grid *grid) {
    close(grid->file);
    grid->file = -1;
    rey_nvdb_free(ctx, &grid->nvdb);
    rey_free(ctx, grid->bytes);
    grid->bytes = NULL;
}

static rey_result read_vol_header(rey_context *ctx, const unsigned char *head, size_t size, rey_grid *out) {
    rey_vol vol;
    rey_result result = rey_vol_header(ctx, out->path, head, size, &vol, &out->encoding);
    out->nx = vol.nx;
    out->ny = vol.ny;
    out->nz = vol.nz;
    out->channels = vol.channels;
    memcpy(out->box, vol.box, sizeof out->box);
    out->placed = true;
    out->data = VOL_HEADER;
    return result;
}

// Z x Y x X, or Z x Y x X x channels.
static rey_result read_npy_header(rey_context *ctx, const unsigned char *head, size_t head_size, size_t size, rey_grid *out) {
    rey_npy npy;
    rey_result result = rey_npy_header(ctx, out->path, head, head_size, size, &npy);
    if (result != REY_OK) {
        return result;
    }
    const int64_t *n = npy.shape;
    if (npy.dims < 3 || npy.count < 1 || npy.count > INT32_MAX) {
        return rey_fail(ctx, REY_ERROR_FORMAT,
                        "%s: an array of %d dimensions and %lld numbers is no grid, expected Z x Y x X or Z x Y x X x channels "
                        "and 1 to 2^31 - 1 numbers", out->path, npy.dims, (long long)npy.count);
    }
    out->nz = (int32_t)n[0];
    out->ny = (int32_t)n[1];
    out->nx = (int32_t)n[2];
    out->channels = npy.dims == 4 ? (int32_t)n[3] : 1;
    out->encoding = npy.item;
    out->data = npy.data;
    return REY_OK;
}

static rey_result read_nvdb_header(rey_context *ctx, size_t size, rey_grid *out) {
    out->bytes = rey_alloc(ctx, size);
    rey_result result = out->bytes ? rey_file_read_part(ctx, out->path, out->file, 0, out->bytes, size) : REY_ERROR_MEMORY;
    if (result == REY_OK) {
        result = rey_nvdb_open(ctx, out->path, out->bytes, size, &out->nvdb);
    }
    if (out->nvdb.own) { // what was compressed is not needed twice
        rey_free(ctx, out->bytes);
        out->bytes = NULL;
    }
    if (result != REY_OK) {
        return result;
    }
    out->nx = out->nvdb.nx;
    out->ny = out->nvdb.ny;
    out->nz = out->nvdb.nz;
    out->channels = out->nvdb.channels;
    out->placed = out->nvdb.placed;
    memcpy(out->box, out->nvdb.box, sizeof out->box);
    return REY_OK;
}

static rey_result read_header(rey_context *ctx, const unsigned char *head, size_t head_size, size_t size, rey_grid *out) {
    if (rey_nvdb_known(head, head_size)) {
        out->format = GRID_NVDB;
        return read_nvdb_header(ctx, size, out);
    }
    if (head_size >= 6 && memcmp(head, "\x93NUMPY", 6) == 0) {
        out->format = GRID_NPY;
        return read_npy_header(ctx, head, head_size, size, out);
    }
    if (!rey_vol_known(head, head_size)) {
        return rey_fail(ctx, REY_ERROR_FORMAT, "%s: byte 0: not a VOL file, nor NanoVDB or .npy, expected 'VOL', 'NanoVDB' or "
                        "'\\x93NUMPY'", out->path);
    }
    return read_vol_header(ctx, head, size, out);
}

rey_result rey_grid_open(rey_context *ctx, const char *path, rey_grid *out) {
    unsigned char head[HEAD];
    size_t size;
    *out = (rey_grid){.path = path, .file = -1, .format = GRID_VOL, .box = {0, 0, 0, 1, 1, 1}};
    rey_result result = rey_file_open(ctx, path, &out->file, &size);
    if (result != REY_OK) {
        return result;
    }
    size_t known = size < HEAD ? size : HEAD;
    result = rey_file_read_part(ctx, path, out->file, 0, head, known);
    if (result == REY_OK) {
        result = read_header(ctx, head, known, size, out);
    }
    if (result != REY_OK) {
        rey_grid_close(ctx, out);
    }
    return result;
}

rey_result rey_grid_read(rey_context *ctx, const rey_grid *grid, float *values) {
    if (grid->format == GRID_NVDB) {
        return rey_nvdb_read(ctx, grid->path, &grid->nvdb, values);
    }
    size_t count = (size_t)rey_grid_count(grid),
           item = grid->format == GRID_NPY ? (size_t)grid->encoding : rey_vol_item(grid->encoding);
    unsigned char *bytes = rey_alloc_array(ctx, count < CHUNK ? count : CHUNK, item);
    rey_result result = bytes ? REY_OK : REY_ERROR_MEMORY;
    for (size_t first = 0; first < count && result == REY_OK; first += CHUNK) {
        size_t n = count - first < CHUNK ? count - first : CHUNK;
        result = rey_file_read_part(ctx, grid->path, grid->file, grid->data + item * first, bytes, item * n);
        if (result == REY_OK) {
            result = grid->format == GRID_NPY ? rey_npy_decode(ctx, grid->path, grid->encoding, bytes, first, n, values + first)
                                              : rey_vol_decode(ctx, grid->path, grid->encoding, bytes, first, n, values + first);
        }
    }
    rey_free(ctx, bytes);
    return result;
}

rey_result rey_grid_read_as(rey_context *ctx, const char *path, const int32_t size[3], int32_t channels, float *values) {
    rey_grid grid;
    rey_result result = rey_grid_open(ctx, path, &grid);
    if (result != REY_OK) {
        return result;
    }
    bool apart = grid.channels == channels && grid.nx == size[0], side = grid.channels == 1 && grid.nx == size[0] * channels;
    if (grid.nz == size[2] && grid.ny == size[1] && (apart || side)) {
        result = rey_grid_read(ctx, &grid, values);
    } else {
        result = rey_fail(ctx, REY_ERROR_PARAM,
                          "%s holds %d x %d x %d x %d numbers, expected %d x %d x %d x %d (z, y, x, channels)", path, grid.nz,
                          grid.ny, grid.nx, grid.channels, size[2], size[1], size[0], channels);
    }
    rey_grid_close(ctx, &grid);
    return result;
}
