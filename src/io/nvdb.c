// nvdb.c: NanoVDB files. Records and compression are read here, trees by PNanoVDB.h, the format's own header in plain C, through
// a buffer that checks every read against the size.
#include "io/nvdb.h"

#include <blosc.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <zlib.h>

// What the header reads from: an offset counts from the beginning of the grid. It writes nothing here, though later versions of it
// have functions that would.
typedef struct pnanovdb_buf_t {
    const unsigned char *bytes;
    uint64_t size;
    bool *outside; // set where something is read that the grid does not have, which is 0 then
} pnanovdb_buf_t;
typedef uint32_t pnanovdb_grid_type_t;

static inline void read_bytes(pnanovdb_buf_t buf, uint64_t at, void *to, size_t count) {
    if (at <= buf.size && buf.size - at >= count) {
        memcpy(to, buf.bytes + at, count);
    } else {
        *buf.outside = true;
    }
}

static inline uint32_t pnanovdb_buf_read_uint32(pnanovdb_buf_t buf, uint64_t at) {
    uint32_t value = 0;
    read_bytes(buf, at, &value, sizeof value);
    return value;
}

static inline uint64_t pnanovdb_buf_read_uint64(pnanovdb_buf_t buf, uint64_t at) {
    uint64_t value = 0;
    read_bytes(buf, at, &value, sizeof value);
    return value;
}

#define pnanovdb_buf_write_uint32(buf, at, value) ((void)0)
#define pnanovdb_buf_write_uint64(buf, at, value) ((void)0)
#define PNANOVDB_C
#define PNANOVDB_BUF_CUSTOM
#define PNANOVDB_GRID_TYPE_GET(type, name) pnanovdb_grid_type_constants[type].name
#include <nanovdb/PNanoVDB.h>

enum { FILE_HEADER = 16, GRID_RECORD = 176, NAME_SIZE = 136, CODEC_NONE = 0, CODEC_ZIP = 1, CODEC_BLOSC = 2, MAJOR = 32 };
enum { MOST_RATIO = 1032, MOST_VOXELS_PER_BYTE = 256 }; // of zlib, more than of LZ4; of trees whose large nodes are constant

static uint64_t load(const unsigned char *at, int bytes) {
    uint64_t value = 0;
    for (int i = 0; i < bytes; i++) {
        value |= (uint64_t)at[i] << (8 * i);
    }
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
static rey_result find_grid(rey_context *ctx, const char *name, const unsigned char *bytes, size_t size, rey_nvdb *out) {
    if (size < FILE_HEADER + GRID_RECORD || !rey_nvdb_known(bytes, size)) {
        return rey_fail(ctx, REY_ERROR_FORMAT, "%s: not a NanoVDB file of at least %d bytes", name, FILE_HEADER + GRID_RECORD);
    }
    uint64_t grids = load(bytes + 12, 2), codec = load(bytes + 14, 2), at = FILE_HEADER;
    uint32_t major = pnanovdb_version_get_major((uint32_t)load(bytes + 8, 4));
    if (major != MAJOR || grids < 1) {
        return rey_fail(ctx, REY_ERROR_UNSUPPORTED, "%s: version %d with %d grids, expected version %d with at least one", name,
                        (int)major, (int)grids, MAJOR);
    }
    if (codec > CODEC_BLOSC) {
        return rey_fail(ctx, REY_ERROR_UNSUPPORTED, "%s: the grid is compressed in way %d, expected none (0), zip (1) or "
                                                    "Blosc (2)", name, (int)codec);
    }
    uint64_t whole = load(bytes + FILE_HEADER, 8);
    for (uint64_t i = 0; i < grids && at <= size; i++) { // records and names
        at = at + GRID_RECORD <= size ? at + GRID_RECORD + load(bytes + at + NAME_SIZE, 4) : size + 1;
    }
    if (at > size) {
        return rey_fail(ctx, REY_ERROR_FORMAT, "%s: the file ends inside the records of its grids", name);
    }
    out->grid = bytes + at;
    out->size = size - (size_t)at;
    if (codec != CODEC_NONE) {
        rey_result result = uncompress_grid(ctx, name, (int)codec, out->grid, out->size, whole, out);
        out->grid = out->own;
        out->size = (size_t)whole;
        return result;
    }
    return REY_OK;
}

static pnanovdb_buf_t buffer_of(const rey_nvdb *nvdb, bool *outside) {
    *outside = false;
    return (pnanovdb_buf_t){nvdb->grid, nvdb->size, outside};
}

static pnanovdb_root_handle_t root_of(pnanovdb_buf_t buf) {
    const pnanovdb_grid_handle_t grid = {{0}};
    return pnanovdb_tree_get_root(buf, pnanovdb_grid_get_tree(buf, grid));
}

// Where the box of voxels lies; voxel (i, j, k) is the cube around that point.
static void place(pnanovdb_buf_t buf, rey_nvdb *out) {
    const pnanovdb_grid_handle_t grid = {{0}};
    const pnanovdb_map_handle_t map = pnanovdb_grid_get_map(buf, grid);
    const int32_t n[3] = {out->nx, out->ny, out->nz};
    out->placed = true;
    for (uint32_t row = 0; row < 3; row++) {
        for (uint32_t k = 0; k < 3; k++) {
            double m = pnanovdb_map_get_matd(buf, map, 3 * row + k), t = pnanovdb_map_get_vecd(buf, map, row);
            if (row == k) {
                out->box[row] = (float)(m * ((double)out->low[row] - 0.5) + t);
                out->box[3 + row] = (float)(m * ((double)out->low[row] + n[row] - 0.5) + t);
            }
            out->placed = out->placed && isfinite(m) && isfinite(t) && (row == k ? isfinite(out->box[3 + row]) : m == 0);
        }
    }
}

static bool is_packed(uint32_t type) { return type >= PNANOVDB_GRID_TYPE_FP4 && type <= PNANOVDB_GRID_TYPE_FPN; }

static rey_result read_grid(rey_context *ctx, const char *name, rey_nvdb *out) {
    bool outside;
    const pnanovdb_buf_t buf = buffer_of(out, &outside);
    const pnanovdb_grid_handle_t grid = {{0}};
    const pnanovdb_root_handle_t root = root_of(buf);
    const pnanovdb_coord_t first = pnanovdb_root_get_bbox_min(buf, root), last = pnanovdb_root_get_bbox_max(buf, root);
    out->type = pnanovdb_grid_get_grid_type(buf, grid);
    if (outside || !rey_nvdb_known(out->grid, out->size)) {
        return rey_fail(ctx, REY_ERROR_FORMAT, "%s: the file ends inside its grid", name);
    }
    bool vectors = out->type == PNANOVDB_GRID_TYPE_VEC3F;
    if (out->type != PNANOVDB_GRID_TYPE_FLOAT && out->type != PNANOVDB_GRID_TYPE_DOUBLE && !vectors && !is_packed(out->type)) {
        return rey_fail(ctx, REY_ERROR_UNSUPPORTED, "%s: the voxels are of type %d, expected float (1), double (2), three "
                                                    "floats (6) or packed floats (13 to 16)", name, (int)out->type);
    }
    out->channels = vectors ? 3 : 1;
    const int32_t low[3] = {first.x, first.y, first.z}, high[3] = {last.x, last.y, last.z};
    int64_t n[3], count = out->channels;
    for (int k = 0; k < 3; k++) {
        out->low[k] = low[k];
        n[k] = (int64_t)high[k] - low[k] + 1;
        if (n[k] < 1 || n[k] > 1 << 20 || count > INT32_MAX / n[k]) {
            return rey_fail(ctx, REY_ERROR_FORMAT, "%s: the box of the grid has %lld voxels along axis %d, expected 1 or more "
                                                   "and at most %d in all", name, (long long)n[k], k, INT32_MAX);
        }
        count *= n[k];
    }
    if ((uint64_t)count / MOST_VOXELS_PER_BYTE > out->size) {
        return rey_fail(ctx, REY_ERROR_UNSUPPORTED, "%s: %lld voxels in a grid of %zu bytes, expected at most %d for each byte",
                        name, (long long)count, out->size, MOST_VOXELS_PER_BYTE);
    }
    out->nx = (int32_t)n[0];
    out->ny = (int32_t)n[1];
    out->nz = (int32_t)n[2];
    place(buf, out);
    return REY_OK;
}

rey_result rey_nvdb_open(rey_context *ctx, const char *name, const unsigned char *bytes, size_t size, rey_nvdb *out) {
    *out = (rey_nvdb){0};
    rey_result result = find_grid(ctx, name, bytes, size, out);
    if (result == REY_OK) {
        result = read_grid(ctx, name, out);
    }
    if (result != REY_OK) {
        rey_nvdb_free(ctx, out);
    }
    return result;
}

// ---- voxels ------------------------------------------------------------------------------------------------------

enum { LEAF, LOWER, UPPER, ROOT }; // levels of nodes
static const int sides[] = {8, 128, 4096}; // of the cube of voxels that a node below the root stands for

typedef struct Box {
    int64_t low[3], high[3]; // voxels, without those at `high`
} Box;

typedef struct Walk {
    const rey_nvdb *nvdb;
    pnanovdb_buf_t buf;
    float *values;
    bool strange;             // a value is not finite,
    int64_t strange_voxel[3]; // first of this voxel
} Walk;

static void put(Walk *w, int64_t x, int64_t y, int64_t z, int channel, float value) {
    const rey_nvdb *v = w->nvdb;
    int64_t voxel = ((z - v->low[2]) * v->ny + y - v->low[1]) * v->nx + x - v->low[0];
    if (!isfinite(value) && !w->strange) {
        w->strange = true;
        memcpy(w->strange_voxel, (int64_t[]){x, y, z}, sizeof w->strange_voxel);
    }
    w->values[voxel * v->channels + channel] = value;
}

// Number n of those that begin at an address.
static float number_at(const Walk *w, pnanovdb_address_t at, uint32_t n) {
    return w->nvdb->type == PNANOVDB_GRID_TYPE_DOUBLE ? (float)pnanovdb_read_double(w->buf, at)
                                                      : pnanovdb_read_float(w->buf, pnanovdb_address_offset(at, 4 * n));
}

// One value in all of a box.
static void fill(Walk *w, const Box *box, pnanovdb_address_t at) {
    float value[3];
    for (int c = 0; c < w->nvdb->channels; c++) {
        value[c] = number_at(w, at, (uint32_t)c);
    }
    for (int64_t z = box->low[2]; z < box->high[2]; z++) {
        for (int64_t y = box->low[1]; y < box->high[1]; y++) {
            for (int64_t x = box->low[0]; x < box->high[0]; x++) {
                for (int c = 0; c < w->nvdb->channels; c++) {
                    put(w, x, y, z, c, value[c]);
                }
            }
        }
    }
}

static float packed_value(const Walk *w, pnanovdb_leaf_handle_t leaf, const pnanovdb_coord_t *ijk) {
    pnanovdb_address_t table = pnanovdb_leaf_get_table_address(w->nvdb->type, w->buf, leaf, 0);
    switch (w->nvdb->type) {
    case PNANOVDB_GRID_TYPE_FP4:
        return pnanovdb_leaf_fp4_read_float(w->buf, table, ijk);
    case PNANOVDB_GRID_TYPE_FP8:
        return pnanovdb_leaf_fp8_read_float(w->buf, table, ijk);
    case PNANOVDB_GRID_TYPE_FP16:
        return pnanovdb_leaf_fp16_read_float(w->buf, table, ijk);
    default:
        return pnanovdb_leaf_fpn_read_float(w->buf, table, ijk);
    }
}

static void read_leaf(Walk *w, pnanovdb_leaf_handle_t leaf, const Box *box) {
    enum { MOST_POWER = 4 }; // of the bits of a voxel, which the leaf itself says
    const uint32_t type = w->nvdb->type;
    if (type == PNANOVDB_GRID_TYPE_FPN && pnanovdb_leaf_get_bbox_dif_and_flags(w->buf, leaf) >> 29 > MOST_POWER) {
        *w->buf.outside = true;
        return;
    }
    for (int64_t z = box->low[2]; z < box->high[2]; z++) {
        for (int64_t y = box->low[1]; y < box->high[1]; y++) {
            for (int64_t x = box->low[0]; x < box->high[0]; x++) {
                const pnanovdb_coord_t ijk = {(int32_t)x, (int32_t)y, (int32_t)z};
                for (int c = 0; c < w->nvdb->channels; c++) {
                    pnanovdb_address_t at = pnanovdb_leaf_get_value_address(type, w->buf, leaf, &ijk); // of what is not packed
                    put(w, x, y, z, c, is_packed(type) ? packed_value(w, leaf, &ijk) : number_at(w, at, (uint32_t)c));
                }
            }
        }
    }
}

// The child of a node in which a voxel lies; where there is none, false and the address of the value that it has.
static bool find_child(const Walk *w, int level, pnanovdb_address_t node, const pnanovdb_coord_t *ijk, pnanovdb_address_t *out) {
    const uint32_t type = w->nvdb->type;
    if (level == ROOT) {
        const pnanovdb_root_handle_t root = {node};
        const pnanovdb_root_tile_handle_t tile = pnanovdb_root_find_tile(type, w->buf, root, ijk);
        bool none = pnanovdb_address_is_null(tile.address), inner = !none && pnanovdb_root_tile_get_child(w->buf, tile) != 0;
        *out = none    ? pnanovdb_address_offset(node, PNANOVDB_GRID_TYPE_GET(type, root_off_background))
               : inner ? pnanovdb_root_get_child(type, w->buf, root, tile).address
                       : pnanovdb_root_tile_get_value_address(type, w->buf, tile);
        return inner;
    }
    if (level == UPPER) {
        const pnanovdb_upper_handle_t upper = {node};
        const uint32_t n = pnanovdb_upper_coord_to_offset(ijk);
        bool inner = pnanovdb_upper_get_child_mask(w->buf, upper, n);
        *out = inner ? pnanovdb_upper_get_child(type, w->buf, upper, n).address
                     : pnanovdb_upper_get_table_address(type, w->buf, upper, n);
        return inner;
    }
    const pnanovdb_lower_handle_t lower = {node};
    const uint32_t n = pnanovdb_lower_coord_to_offset(ijk);
    bool inner = pnanovdb_lower_get_child_mask(w->buf, lower, n);
    *out = inner ? pnanovdb_lower_get_child(type, w->buf, lower, n).address
                 : pnanovdb_lower_get_table_address(type, w->buf, lower, n);
    return inner;
}

static int64_t lesser(int64_t a, int64_t b) { return a < b ? a : b; }

// The first voxel behind one along an axis that belongs to another child.
static int64_t child_end(int64_t voxel, int level) { return (voxel & -(int64_t)sides[level - 1]) + sides[level - 1]; }

static void read_node(Walk *w, int level, pnanovdb_address_t node, const Box *box) {
    Box part;
    for (part.low[2] = box->low[2]; part.low[2] < box->high[2]; part.low[2] = part.high[2]) {
        part.high[2] = lesser(child_end(part.low[2], level), box->high[2]);
        for (part.low[1] = box->low[1]; part.low[1] < box->high[1]; part.low[1] = part.high[1]) {
            part.high[1] = lesser(child_end(part.low[1], level), box->high[1]);
            for (part.low[0] = box->low[0]; part.low[0] < box->high[0] && !*w->buf.outside; part.low[0] = part.high[0]) {
                part.high[0] = lesser(child_end(part.low[0], level), box->high[0]);
                const pnanovdb_coord_t ijk = {(int32_t)part.low[0], (int32_t)part.low[1], (int32_t)part.low[2]};
                pnanovdb_address_t at;
                if (!find_child(w, level, node, &ijk, &at)) {
                    fill(w, &part, at);
                } else if (level == LOWER) {
                    read_leaf(w, (pnanovdb_leaf_handle_t){at}, &part);
                } else {
                    read_node(w, level - 1, at, &part);
                }
            }
        }
    }
}

rey_result rey_nvdb_read(rey_context *ctx, const char *name, const rey_nvdb *nvdb, float *values) {
    bool outside;
    Walk w = {.nvdb = nvdb, .buf = buffer_of(nvdb, &outside), .values = values};
    const Box all = {{nvdb->low[0], nvdb->low[1], nvdb->low[2]},
                     {nvdb->low[0] + nvdb->nx, nvdb->low[1] + nvdb->ny, nvdb->low[2] + nvdb->nz}};
    const pnanovdb_root_handle_t root = root_of(w.buf);
    outside = pnanovdb_root_get_tile_count(w.buf, root) > nvdb->size / PNANOVDB_GRID_TYPE_GET(nvdb->type, root_tile_size);
    if (!outside) {
        read_node(&w, ROOT, root.address, &all);
    }
    if (outside) {
        return rey_fail(ctx, REY_ERROR_FORMAT, "%s: a node of the grid lies outside of the file", name);
    }
    const long long x = w.strange_voxel[0], y = w.strange_voxel[1], z = w.strange_voxel[2];
    return w.strange ? rey_fail(ctx, REY_ERROR_FORMAT, "%s: voxel %lld, %lld, %lld is not finite", name, x, y, z) : REY_OK;
}
