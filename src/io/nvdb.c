// nvdb.c: NanoVDB files. Offsets are those of the format's version 32; each is checked against the size before it is read.
#include "io/nvdb.h"

#include <blosc.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <zlib.h>

enum { FILE_HEADER = 16, GRID_RECORD = 176, CODEC_NONE = 0, CODEC_ZIP = 1, CODEC_BLOSC = 2 };
enum { GRID_SIZE = 672, GRID_MATRIX = 296 + 88, GRID_OFFSET = 296 + 232, GRID_TYPE = 636 };
enum { TYPE_FLOAT = 1, TYPE_DOUBLE, TYPE_VEC3F = 6, TYPE_FP4 = 13, TYPE_FP8, TYPE_FP16, TYPE_FPN };
enum { ROOT_TILES = 24, TILE_SIZE = 32, TILE_CHILD = 8, LEAF_MINIMUM = 80, LEAF_QUANTUM = 84 };
enum { MOST_RATIO = 1032, MOST_VOXELS_PER_BYTE = 256 }; // of zlib, more than of LZ4; of trees whose large nodes are constant

// What depends on the size of a value: the root's own size and where its background begins, a tile's value, what an inner
// node holds for one child, and where a leaf's voxels begin.
typedef struct Layout {
    uint32_t root, background, tile_value, entry, leaf_table;
} Layout;

static Layout layout_of(uint32_t type) {
    return type == TYPE_VEC3F    ? (Layout){96, 28, 20, 16, 128}
           : type == TYPE_DOUBLE ? (Layout){96, 32, 24, 8, 128}
                                 : (Layout){64, 28, 20, 8, 96};
}

// Inner nodes, from below.
static const struct {
    int bits, side;             // nodes along an axis, as a power of two; voxels along the side of one
    uint32_t child_mask, table; // offsets
} levels[] = {{4, 8, 544, 1088}, {5, 128, 4128, 8256}};

static uint64_t load(const unsigned char *at, int bytes) {
    uint64_t value = 0;
    for (int i = 0; i < bytes; i++) {
        value |= (uint64_t)at[i] << (8 * i);
    }
    return value;
}

static float as_float(uint32_t bits) {
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

static double load_double(const unsigned char *at) {
    uint64_t bits = load(at, 8);
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

void rey_nvdb_free(rey_context *ctx, rey_nvdb *nvdb) {
    rey_free(ctx, nvdb->own);
    *nvdb = (rey_nvdb){0};
}

bool rey_nvdb_known(const unsigned char *bytes, size_t size) { return size >= 8 && memcmp(bytes, "NanoVDB", 7) == 0; }

// ---- header ------------------------------------------------------------------------------------------------------

// A block of compressed bytes, as large as its first eight say; returns how many bytes become of it, 0 where it is damaged.
static size_t uncompress_block(int codec, const unsigned char *bytes, size_t size, unsigned char *to, size_t room) {
    if (codec == CODEC_ZIP) { // the whole grid
        uLongf length = (uLongf)room;
        return uncompress(to, &length, bytes, (uLong)size) == Z_OK && length == room ? room : 0;
    }
    size_t length; // of a Blosc chunk, the next GiB of the grid
    bool valid = blosc_cbuffer_validate(bytes, size, &length) == 0 && length > 0 && length <= room;
    return valid && blosc_decompress_ctx(bytes, to, length, 1) == (int)length ? length : 0;
}

static rey_result uncompress_grid(rey_context *ctx, const char *name, int codec, const unsigned char *bytes, size_t size,
                                  uint64_t grid_size, rey_nvdb *out) {
    if (grid_size / MOST_RATIO <= size && grid_size <= SIZE_MAX / 2) { // else the file is too small for it in any case
        out->own = rey_alloc(ctx, (size_t)grid_size);
        if (!out->own) {
            return REY_ERROR_MEMORY;
        }
    }
    size_t at = 0, done = 0;
    do {
        uint64_t packed = size - at >= 8 ? load(bytes + at, 8) : 0;
        if (!out->own || size - at < 8 || packed > size - at - 8) {
            return rey_fail(ctx, REY_ERROR_FORMAT, "%s: the file ends inside its compressed grid of %llu bytes", name,
                            (unsigned long long)grid_size);
        }
        size_t got = uncompress_block(codec, bytes + at + 8, (size_t)packed, out->own + done, (size_t)grid_size - done);
        if (got == 0) {
            return rey_fail(ctx, REY_ERROR_FORMAT, "%s: the compressed grid is damaged after %zu of %llu bytes", name, done,
                            (unsigned long long)grid_size);
        }
        done += got;
        at += 8 + (size_t)packed;
    } while (done < grid_size);
    return REY_OK;
}

// The first grid's bytes.
static rey_result find_grid(rey_context *ctx, const char *name, const unsigned char *bytes, size_t size, rey_nvdb *out,
                            const unsigned char **grid, size_t *grid_size) {
    if (size < FILE_HEADER + GRID_RECORD || !rey_nvdb_known(bytes, size)) {
        return rey_fail(ctx, REY_ERROR_FORMAT, "%s: not a NanoVDB file of at least %d bytes", name, FILE_HEADER + GRID_RECORD);
    }
    uint64_t major = load(bytes + 8, 4) >> 21, grids = load(bytes + 12, 2), codec = load(bytes + 14, 2), at = FILE_HEADER;
    if (major != 32 || grids < 1) {
        return rey_fail(ctx, REY_ERROR_UNSUPPORTED, "%s: version %d with %d grids, expected version 32 with at least one", name,
                        (int)major, (int)grids);
    }
    if (codec > CODEC_BLOSC) {
        return rey_fail(ctx, REY_ERROR_UNSUPPORTED, "%s: the grid is compressed in way %d, expected none (0), zip (1) or "
                                                    "Blosc (2)", name, (int)codec);
    }
    uint64_t whole = load(bytes + FILE_HEADER, 8);
    for (uint64_t i = 0; i < grids && at <= size; i++) { // records and names
        at = at + GRID_RECORD <= size ? at + GRID_RECORD + load(bytes + at + 136, 4) : size + 1;
    }
    if (at > size) {
        return rey_fail(ctx, REY_ERROR_FORMAT, "%s: the file ends inside the records of its grids", name);
    }
    *grid = bytes + at;
    *grid_size = size - (size_t)at;
    if (codec != CODEC_NONE) {
        rey_result result = uncompress_grid(ctx, name, (int)codec, bytes + at, size - (size_t)at, whole, out);
        *grid = out->own;
        *grid_size = (size_t)whole;
        return result;
    }
    return REY_OK;
}

// Where the box of voxels lies; voxel (i, j, k) is the cube around that point.
static void place(const unsigned char *grid, rey_nvdb *out) {
    const int32_t n[3] = {out->nx, out->ny, out->nz};
    out->placed = true;
    for (int row = 0; row < 3; row++) {
        for (int k = 0; k < 3; k++) {
            double m = load_double(grid + GRID_MATRIX + 8 * (3 * row + k)), t = load_double(grid + GRID_OFFSET + 8 * row);
            if (row == k) {
                out->box[row] = (float)(m * ((double)out->low[row] - 0.5) + t);
                out->box[3 + row] = (float)(m * ((double)out->low[row] + n[row] - 0.5) + t);
            }
            out->placed = out->placed && isfinite(m) && isfinite(t) && (row == k ? isfinite(out->box[3 + row]) : m == 0);
        }
    }
}

static rey_result read_tree(rey_context *ctx, const char *name, const unsigned char *grid, size_t size, rey_nvdb *out) {
    uint64_t type = size >= GRID_SIZE + 64 ? load(grid + GRID_TYPE, 4) : 0,
             root = size >= GRID_SIZE + 64 ? load(grid + GRID_SIZE + 24, 8) : 0;
    if (size < GRID_SIZE + 64 || memcmp(grid, "NanoVDB", 7) != 0 || root > size - GRID_SIZE || size - GRID_SIZE - root < 96) {
        return rey_fail(ctx, REY_ERROR_FORMAT, "%s: the file ends inside its grid", name);
    }
    if (type != TYPE_FLOAT && type != TYPE_DOUBLE && type != TYPE_VEC3F && !(type >= TYPE_FP4 && type <= TYPE_FPN)) {
        return rey_fail(ctx, REY_ERROR_UNSUPPORTED, "%s: the voxels are of type %d, expected float (1), double (2), three "
                                                    "floats (6) or packed floats (13 to 16)", name, (int)type);
    }
    out->tree = grid + GRID_SIZE + root; // the root; nodes are found from there
    out->size = size - GRID_SIZE - (size_t)root;
    out->type = (uint32_t)type;
    out->channels = type == TYPE_VEC3F ? 3 : 1;
    int64_t n[3], count = out->channels;
    for (int k = 0; k < 3; k++) {
        out->low[k] = (int32_t)load(out->tree + 4 * k, 4);
        n[k] = (int32_t)load(out->tree + 12 + 4 * k, 4) - out->low[k] + 1;
        if (n[k] < 1 || n[k] > 1 << 20 || count > INT32_MAX / n[k]) {
            return rey_fail(ctx, REY_ERROR_FORMAT, "%s: the box of the grid has %lld voxels along axis %d, expected 1 or more "
                                                   "and at most %d in all", name, (long long)n[k], k, INT32_MAX);
        }
        count *= n[k];
    }
    if ((uint64_t)count / MOST_VOXELS_PER_BYTE > size) {
        return rey_fail(ctx, REY_ERROR_UNSUPPORTED, "%s: %lld voxels in a grid of %zu bytes, expected at most %d for each byte",
                        name, (long long)count, size, MOST_VOXELS_PER_BYTE);
    }
    out->nx = (int32_t)n[0];
    out->ny = (int32_t)n[1];
    out->nz = (int32_t)n[2];
    place(grid, out);
    return REY_OK;
}

rey_result rey_nvdb_open(rey_context *ctx, const char *name, const unsigned char *bytes, size_t size, rey_nvdb *out) {
    const unsigned char *grid = NULL;
    size_t grid_size = 0;
    *out = (rey_nvdb){0};
    rey_result result = find_grid(ctx, name, bytes, size, out, &grid, &grid_size);
    if (result == REY_OK) {
        result = read_tree(ctx, name, grid, grid_size, out);
    }
    if (result != REY_OK) {
        rey_nvdb_free(ctx, out);
    }
    return result;
}

// ---- voxels ------------------------------------------------------------------------------------------------------

typedef struct Walk {
    const rey_nvdb *nvdb;
    Layout layout;
    float *values;
    uint64_t filled;      // voxels that have a value; nodes that overlap are an error
    bool outside, strange; // an offset leads out of the grid, or there and back again; a value is not finite
} Walk;

// The bytes at an offset from the root; zeros where there are none.
static const unsigned char *bytes_at(Walk *w, uint64_t at, size_t count) {
    static const unsigned char zeros[16] = {0};
    if (at > w->nvdb->size || w->nvdb->size - (size_t)at < count) {
        w->outside = true;
        return zeros;
    }
    return w->nvdb->tree + at;
}

static uint32_t word_at(Walk *w, uint64_t at) { return (uint32_t)load(bytes_at(w, at, 4), 4); }

// Number n of those that begin at an offset.
static float number_at(Walk *w, uint64_t at, uint64_t n) {
    return w->nvdb->type == TYPE_DOUBLE ? (float)load_double(bytes_at(w, at + 8 * n, 8)) : as_float(word_at(w, at + 4 * n));
}

static void put(Walk *w, int64_t voxel, int channel, float value) {
    w->strange = w->strange || !isfinite(value);
    w->values[voxel * w->nvdb->channels + channel] = value;
}

// The part of a cube of voxels that lies in the box; false where there is none.
static bool clip(const rey_nvdb *v, const int64_t origin[3], int64_t side, int64_t low[3], int64_t high[3]) {
    const int64_t n[3] = {v->nx, v->ny, v->nz};
    for (int k = 0; k < 3; k++) {
        low[k] = origin[k] > v->low[k] ? origin[k] - v->low[k] : 0;
        high[k] = origin[k] + side - v->low[k] < n[k] ? origin[k] + side - v->low[k] : n[k];
        if (low[k] >= high[k]) {
            return false;
        }
    }
    return true;
}

// Counts the voxels of a part that gets its values now.
static bool claim(Walk *w, const int64_t low[3], const int64_t high[3]) {
    uint64_t all = (uint64_t)w->nvdb->nx * (uint64_t)w->nvdb->ny * (uint64_t)w->nvdb->nz;
    w->filled += (uint64_t)(high[0] - low[0]) * (uint64_t)(high[1] - low[1]) * (uint64_t)(high[2] - low[2]);
    w->outside = w->outside || w->filled > all;
    return !w->outside;
}

// One value from low to high.
static void fill_box(Walk *w, const int64_t low[3], const int64_t high[3], uint64_t value_at) {
    const rey_nvdb *v = w->nvdb;
    float value[3];
    for (int c = 0; c < v->channels; c++) {
        value[c] = number_at(w, value_at, (uint64_t)c);
    }
    for (int64_t z = low[2]; z < high[2]; z++) {
        for (int64_t y = low[1]; y < high[1]; y++) {
            for (int64_t x = low[0]; x < high[0]; x++) {
                for (int c = 0; c < v->channels; c++) {
                    put(w, (z * v->ny + y) * v->nx + x, c, value[c]);
                }
            }
        }
    }
}

static void fill(Walk *w, const int64_t origin[3], int64_t side, uint64_t value_at) {
    int64_t low[3], high[3];
    if (clip(w->nvdb, origin, side, low, high) && claim(w, low, high)) {
        fill_box(w, low, high, value_at);
    }
}

// Bits of a packed voxel, 0 where voxels are floats.
static uint32_t leaf_bits(Walk *w, uint64_t at) {
    uint32_t type = w->nvdb->type;
    uint32_t power = type == TYPE_FPN ? word_at(w, at + 12) >> 29 : type - TYPE_FP4 + 2;
    w->outside = w->outside || (type >= TYPE_FP4 && power > 4);
    return type < TYPE_FP4 || w->outside ? 0 : 1u << power;
}

static float leaf_value(Walk *w, uint64_t at, uint32_t bits, uint32_t n, int channel) {
    uint32_t channels = (uint32_t)w->nvdb->channels;
    if (bits == 0) {
        return number_at(w, at + w->layout.leaf_table, n * channels + (uint32_t)channel);
    }
    float minimum = as_float(word_at(w, at + LEAF_MINIMUM)), quantum = as_float(word_at(w, at + LEAF_QUANTUM));
    uint32_t word = word_at(w, at + w->layout.leaf_table + 4 * (uint64_t)(n * bits / 32));
    uint32_t code = word >> (n * bits % 32) & ((1u << bits) - 1);
    return minimum + quantum * (float)code;
}

static void read_leaf(Walk *w, uint64_t at, const int64_t origin[3]) {
    const rey_nvdb *v = w->nvdb;
    int64_t low[3], high[3];
    uint32_t bits = leaf_bits(w, at);
    if (!clip(v, origin, 8, low, high) || !claim(w, low, high)) {
        return;
    }
    for (int64_t z = low[2]; z < high[2]; z++) {
        for (int64_t y = low[1]; y < high[1]; y++) {
            for (int64_t x = low[0]; x < high[0]; x++) {
                int64_t i = x + v->low[0] - origin[0], j = y + v->low[1] - origin[1], k = z + v->low[2] - origin[2];
                for (int c = 0; c < v->channels; c++) {
                    put(w, (z * v->ny + y) * v->nx + x, c, leaf_value(w, at, bits, (uint32_t)(i << 6 | j << 3 | k), c));
                }
            }
        }
    }
}

static void read_node(Walk *w, uint64_t at, int level, const int64_t origin[3]) {
    const int bits = levels[level].bits, side = levels[level].side;
    int64_t low[3], high[3];
    for (int32_t n = 0; n < 1 << (3 * bits) && !w->outside; n++) {
        const int32_t mask = (1 << bits) - 1;
        const int64_t corner[3] = {origin[0] + (int64_t)(n >> (2 * bits)) * side, origin[1] + (int64_t)(n >> bits & mask) * side,
                                   origin[2] + (int64_t)(n & mask) * side};
        if (!clip(w->nvdb, corner, side, low, high)) {
            continue;
        }
        uint64_t entry = at + levels[level].table + w->layout.entry * (uint64_t)n;
        bool inner = word_at(w, at + levels[level].child_mask + 4 * (uint64_t)(n / 32)) >> (n % 32) & 1;
        uint64_t child = at + load(bytes_at(w, entry, 8), 8); // wraps round where it leads backwards
        if (!inner) {
            fill(w, corner, side, entry);
        } else if (level > 0) {
            read_node(w, child, level - 1, corner);
        } else {
            read_leaf(w, child, corner);
        }
    }
}

// The number of bits 0 to 20, 21 to 41 or 42 to 62, times the side of an upper node.
static int64_t key_corner(uint64_t key, int shift) { return (int64_t)(int32_t)((uint32_t)(key >> shift & 0xfffff) << 12); }

rey_result rey_nvdb_read(rey_context *ctx, const char *name, const rey_nvdb *nvdb, float *values) {
    enum { UPPER_SIDE = 4096 };
    Walk w = {.nvdb = nvdb, .layout = layout_of(nvdb->type), .values = values};
    uint64_t tiles = word_at(&w, ROOT_TILES);
    w.outside = w.outside || tiles > nvdb->size / TILE_SIZE;
    fill_box(&w, (int64_t[3]){0}, (int64_t[3]){nvdb->nx, nvdb->ny, nvdb->nz}, w.layout.background);
    for (uint64_t i = 0; i < tiles && !w.outside; i++) {
        uint64_t tile = w.layout.root + TILE_SIZE * i, key = load(bytes_at(&w, tile, 8), 8);
        uint64_t child = load(bytes_at(&w, tile + TILE_CHILD, 8), 8);
        const int64_t origin[3] = {key_corner(key, 42), key_corner(key, 21), key_corner(key, 0)};
        int64_t low[3], high[3];
        if (!clip(nvdb, origin, UPPER_SIDE, low, high)) {
            continue;
        }
        if (child) {
            read_node(&w, child, COUNT_OF(levels) - 1, origin);
        } else {
            fill(&w, origin, UPPER_SIDE, tile + w.layout.tile_value);
        }
    }
    return w.outside   ? rey_fail(ctx, REY_ERROR_FORMAT, "%s: a node of the grid lies outside of the file, or over another", name)
           : w.strange ? rey_fail(ctx, REY_ERROR_FORMAT, "%s: a voxel is not finite", name)
                       : REY_OK;
}
