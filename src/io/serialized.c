// serialized.c: Mitsuba's serialized meshes, versions 3 and 4. Little endian: uint16 0x041C, uint16 version, then one
// zlib stream: uint32 flags, name (version 4), uint64 vertex and triangle counts, then tight arrays of positions,
// normals, uv, colours and index triples. A file of several meshes ends with their offsets (uint64, in version 3
// uint32) and a uint32 count.
#include "io/file.h"
#include "io/mesh.h"

#include <math.h>
#include <stdio.h>
#include <string.h>
#include <zlib.h>

enum { MAGIC = 0x041C, HEADER_BYTES = 4, LONGEST_NAME = 1 << 16, BUFFER_BYTES = 1 << 14 };
enum { HAS_NORMALS = 1, HAS_UVS = 2, HAS_COLORS = 8, FACE_NORMALS = 16, FLOAT32 = 0x1000, FLOAT64 = 0x2000 };

typedef struct SerializedReader {
    rey_context *ctx;
    const char *name;
    const unsigned char *bytes; // the file
    int64_t size;
    int64_t at, end; // what of it the stream has not yet been given
    z_stream stream;
    bool doubles;
    unsigned char buffer[BUFFER_BYTES]; // a piece of inflated data before conversion
} SerializedReader;

static uint64_t load(const unsigned char *bytes, int size) {
    uint64_t value = 0;
    for (int i = 0; i < size; i++) {
        value |= (uint64_t)bytes[i] << (8 * i);
    }
    return value;
}

// Where in the file the stream stands.
static int64_t offset(const SerializedReader *r) {
    return r->at - (int64_t)r->stream.avail_in;
}

static rey_result fail(SerializedReader *r, int64_t at, const char *format, ...) PRINTF_LIKE(3, 4);

static rey_result fail(SerializedReader *r, int64_t at, const char *format, ...) {
    char message[256];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(message, sizeof message, format, arguments);
    va_end(arguments);
    return rey_fail(r->ctx, REY_ERROR_FORMAT, "%s: byte %lld: %s", r->name, (long long)at, message);
}

// Hands the stream its next piece of the file; zlib counts in 32 bits.
static void feed(SerializedReader *r) {
    enum { MOST_INPUT = 1 << 30 };
    int64_t piece = r->end - r->at < MOST_INPUT ? r->end - r->at : MOST_INPUT;
    r->stream.next_in = (Bytef *)(uintptr_t)(r->bytes + r->at);
    r->stream.avail_in = (uInt)piece;
    r->at += piece;
}

// Inflates exactly size bytes; what names them for messages.
static rey_result read_bytes(SerializedReader *r, void *to, size_t size, const char *what) {
    r->stream.next_out = to;
    r->stream.avail_out = (uInt)size; // at most BUFFER_BYTES
    while (r->stream.avail_out) {
        if (r->stream.avail_in == 0) {
            if (r->at == r->end) {
                return fail(r, offset(r), "the file ends inside the compressed data, expected %s", what);
            }
            feed(r);
        }
        int status = inflate(&r->stream, Z_NO_FLUSH);
        if (r->stream.avail_out == 0) {
            break; // all there: a wrong checksum, if next, is for check_end to report
        }
        if (status == Z_MEM_ERROR) {
            return REY_ERROR_MEMORY;
        }
        if (status == Z_STREAM_END) {
            return fail(r, offset(r), "the compressed data end early, expected %s", what);
        }
        if (status != Z_OK && status != Z_BUF_ERROR) {
            return fail(r, offset(r), "the compressed data are damaged (%s), expected %s",
                        r->stream.msg ? r->stream.msg : "no zlib stream", what);
        }
    }
    return REY_OK;
}

// After the last array: the stream's checksum must be there and right. More data than expected are left alone.
static rey_result check_end(SerializedReader *r) {
    for (;;) {
        unsigned char extra;
        r->stream.next_out = &extra;
        r->stream.avail_out = 1;
        int status = inflate(&r->stream, Z_NO_FLUSH);
        if (status == Z_STREAM_END || r->stream.avail_out == 0) {
            return REY_OK;
        }
        if ((status != Z_OK && status != Z_BUF_ERROR) || (r->stream.avail_in == 0 && r->at == r->end)) {
            return fail(r, offset(r), "the compressed data are damaged at their end (%s)",
                        r->stream.msg ? r->stream.msg : "checksum missing");
        }
        if (r->stream.avail_in == 0) {
            feed(r);
        }
    }
}

static rey_result read_uint(SerializedReader *r, int size, uint64_t *value, const char *what) {
    unsigned char bytes[8] = {0};
    rey_result result = read_bytes(r, bytes, (size_t)size, what);
    *value = load(bytes, size);
    return result;
}

// Reads count x width floats, stored as floats or doubles.
static rey_result read_floats(SerializedReader *r, int64_t count, int width, float *values, const char *what) {
    int64_t item = r->doubles ? 8 : 4, total = count * width;
    for (int64_t done = 0; done < total;) {
        int64_t piece = total - done < BUFFER_BYTES / item ? total - done : BUFFER_BYTES / item;
        rey_result result = read_bytes(r, r->buffer, (size_t)(piece * item), what);
        if (result != REY_OK) {
            return result;
        }
        for (int64_t i = 0; i < piece; i++, done++) {
            uint64_t bits = load(r->buffer + i * item, (int)item);
            uint32_t low = (uint32_t)bits;
            double wide;
            memcpy(&wide, &bits, sizeof wide);
            memcpy(&values[done], &low, sizeof low);
            values[done] = r->doubles ? (float)wide : values[done];
            if (!isfinite(values[done])) {
                return fail(r, offset(r), "%s of vertex %lld are not finite", what, (long long)(done / width));
            }
        }
    }
    return REY_OK;
}

static rey_result read_faces(SerializedReader *r, rey_mesh *mesh) {
    int64_t total = 3 * mesh->face_count;
    for (int64_t done = 0; done < total;) {
        int64_t piece = total - done < BUFFER_BYTES / 4 ? total - done : BUFFER_BYTES / 4;
        rey_result result = read_bytes(r, r->buffer, (size_t)(4 * piece), "vertex indices");
        if (result != REY_OK) {
            return result;
        }
        for (int64_t i = 0; i < piece; i++, done++) {
            uint64_t index = load(r->buffer + 4 * i, 4);
            if (index >= (uint64_t)mesh->vertex_count) {
                return fail(r, offset(r), "vertex index %llu of face %lld is out of range, expected 0 to %lld",
                            (unsigned long long)index, (long long)(done / 3), (long long)mesh->vertex_count - 1);
            }
            mesh->faces[done] = (uint32_t)index;
        }
    }
    return REY_OK;
}

static rey_result read_name(SerializedReader *r) {
    for (int i = 0; i < LONGEST_NAME; i++) {
        uint64_t character;
        rey_result result = read_uint(r, 1, &character, "the mesh's name");
        if (result != REY_OK || character == 0) {
            return result;
        }
    }
    return fail(r, offset(r), "the mesh's name has no end, expected at most %d characters", LONGEST_NAME);
}

// Counts, checked against what the rest of the file could hold: deflate shrinks at most 1032 times [zlib manual].
static rey_result read_counts(SerializedReader *r, uint64_t flags, rey_mesh *mesh) {
    uint64_t vertices = 0, faces = 0;
    rey_result result = read_uint(r, 8, &vertices, "the vertex count");
    result = result == REY_OK ? read_uint(r, 8, &faces, "the triangle count") : result;
    if (result != REY_OK) {
        return result;
    }
    if (vertices == 0 || faces == 0) {
        return fail(r, offset(r), "the mesh has no %s", faces ? "vertices" : "faces");
    }
    uint64_t width =
        3u + (flags & HAS_NORMALS ? 3u : 0u) + (flags & HAS_UVS ? 2u : 0u) + (flags & HAS_COLORS ? 3u : 0u);
    uint64_t left = (uint64_t)(r->end - offset(r));
    if (vertices > MESH_MOST_ITEMS || faces > MESH_MOST_ITEMS ||
        vertices * width * (r->doubles ? 8 : 4) + 12 * faces > 1032 * left + BUFFER_BYTES) {
        return fail(r, offset(r), "%llu vertices and %llu triangles do not fit the %llu bytes left",
                    (unsigned long long)vertices, (unsigned long long)faces, (unsigned long long)left);
    }
    mesh->vertex_count = (int64_t)vertices;
    mesh->face_count = (int64_t)faces;
    return REY_OK;
}

static rey_result read_arrays(SerializedReader *r, uint64_t flags, rey_mesh *mesh) {
    int64_t count = mesh->vertex_count;
    float *colors = NULL;
    mesh->positions = rey_alloc_array(r->ctx, (size_t)count, 3 * sizeof(float));
    mesh->normals = flags & HAS_NORMALS ? rey_alloc_array(r->ctx, (size_t)count, 3 * sizeof(float)) : NULL;
    mesh->uvs = flags & HAS_UVS ? rey_alloc_array(r->ctx, (size_t)count, 2 * sizeof(float)) : NULL;
    mesh->faces = rey_alloc_array(r->ctx, (size_t)mesh->face_count, 3 * sizeof(uint32_t));
    if (flags & HAS_COLORS) {
        colors = rey_mesh_add_attribute(r->ctx, mesh, "vertex_color", false, 3);
    }
    if (!mesh->positions || !mesh->faces || (flags & HAS_NORMALS && !mesh->normals) ||
        (flags & HAS_UVS && !mesh->uvs) || (flags & HAS_COLORS && !colors)) {
        return REY_ERROR_MEMORY;
    }
    rey_result result = read_floats(r, count, 3, mesh->positions, "positions");
    if (result == REY_OK && mesh->normals) {
        result = read_floats(r, count, 3, mesh->normals, "normals");
    }
    if (result == REY_OK && mesh->uvs) {
        result = read_floats(r, count, 2, mesh->uvs, "uv coordinates");
    }
    if (result == REY_OK && colors) {
        result = read_floats(r, count, 3, colors, "colours");
    }
    result = result == REY_OK ? read_faces(r, mesh) : result;
    return result == REY_OK ? check_end(r) : result;
}

static rey_result read_stream(SerializedReader *r, int version, rey_mesh *mesh) {
    uint64_t flags = 0;
    rey_result result = read_uint(r, 4, &flags, "the mesh's flags");
    if (result != REY_OK) {
        return result;
    }
    if (flags & FLOAT32 && flags & FLOAT64) {
        return fail(r, offset(r), "the flags 0x%llx ask for both float and double", (unsigned long long)flags);
    }
    r->doubles = flags & FLOAT64;
    mesh->had_face_normals = flags & FACE_NORMALS;
    result = version >= 4 ? read_name(r) : REY_OK;
    result = result == REY_OK ? read_counts(r, flags, mesh) : result;
    result = result == REY_OK ? read_arrays(r, flags, mesh) : result;
    return result == REY_OK ? rey_mesh_weld(r->ctx, mesh) : result;
}

// Magic number and version of the mesh at r->at, which moves behind them.
static rey_result read_header(SerializedReader *r, int *version) {
    if (r->end - r->at < HEADER_BYTES) {
        return fail(r, r->at, "the file ends, expected a serialized mesh");
    }
    uint64_t magic = load(r->bytes + r->at, 2);
    *version = (int)load(r->bytes + r->at + 2, 2);
    if (magic != MAGIC) {
        return fail(r, r->at, "not a serialized mesh: 0x%04llx, expected 0x%04x", (unsigned long long)magic,
                    (unsigned)MAGIC);
    }
    if (*version != 3 && *version != 4) {
        return rey_fail(r->ctx, REY_ERROR_UNSUPPORTED,
                        "%s: byte %lld: serialized version %d is not supported, expected 3 or 4", r->name,
                        (long long)r->at + 2, *version);
    }
    r->at += HEADER_BYTES;
    return REY_OK;
}

// The list of offsets at the end of the file, behind byte `from`.
typedef struct MeshList {
    int64_t begin, count, width; // of an entry
} MeshList;

static rey_result find_list(SerializedReader *r, int version, int64_t from, MeshList *list) {
    list->width = version == 3 ? 4 : 8;
    list->count = r->size - from >= 4 ? (int64_t)load(r->bytes + r->size - 4, 4) : 0;
    list->begin = r->size - 4 - list->count * list->width;
    if (list->count == 0) {
        return fail(r, r->size, "the file ends without the list of its meshes, or within it");
    }
    return list->begin >= from ? REY_OK
                               : fail(r, r->size - 4, "a list of %lld meshes does not fit the file, which ends without its list or "
                                                      "within it", (long long)list->count);
}

// Where the list says that a mesh begins.
static rey_result mesh_offset(SerializedReader *r, MeshList list, int64_t index, int64_t *out) {
    int64_t entry = list.begin + index * list.width;
    uint64_t at = load(r->bytes + entry, (int)list.width);
    if (at + HEADER_BYTES > (uint64_t)list.begin || at > (uint64_t)list.begin) {
        return fail(r, entry, "offset %llu of mesh %lld is out of range, expected less than %lld", (unsigned long long)at,
                    (long long)index, (long long)list.begin);
    }
    *out = (int64_t)at;
    return REY_OK;
}

// Moves to the mesh of this index.
static rey_result find_shape(SerializedReader *r, int version, int shape_index) {
    MeshList list;
    rey_result result = find_list(r, version, r->at, &list);
    if (result == REY_OK && shape_index >= list.count) {
        return fail(r, r->size - 4, "the file has %lld mesh%s, expected more than the shape index %d", (long long)list.count,
                    list.count == 1 ? "" : "es", shape_index);
    }
    result = result == REY_OK ? mesh_offset(r, list, shape_index, &r->at) : result;
    r->end = result == REY_OK ? list.begin : r->end;
    return result;
}

// The first mesh is found without the list, but a file that lost it has lost other meshes, too.
static rey_result check_list(SerializedReader *r, int version) {
    MeshList list;
    rey_result result = find_list(r, version, offset(r), &list);
    for (int64_t i = 0; i < list.count && result == REY_OK; i++) {
        int64_t at;
        result = mesh_offset(r, list, i, &at);
        if (result == REY_OK && load(r->bytes + at, 2) != MAGIC) {
            result = fail(r, list.begin + i * list.width, "no mesh begins at offset %lld of mesh %lld: the list of meshes is "
                                                          "damaged", (long long)at, (long long)i);
        }
    }
    return result;
}

static voidpf zlib_alloc(voidpf ctx, uInt count, uInt size) {
    return rey_alloc_array(ctx, count, size);
}

static void zlib_free(voidpf ctx, voidpf memory) {
    rey_free(ctx, memory);
}

static rey_result read_shape(SerializedReader *r, int shape_index, rey_mesh *mesh) {
    int version;
    rey_result result = read_header(r, &version);
    if (result == REY_OK && shape_index > 0) {
        result = find_shape(r, version, shape_index);
        result = result == REY_OK ? read_header(r, &version) : result;
    }
    if (result != REY_OK) {
        return result;
    }
    r->stream.zalloc = zlib_alloc;
    r->stream.zfree = zlib_free;
    r->stream.opaque = r->ctx;
    if (inflateInit(&r->stream) != Z_OK) {
        return REY_ERROR_MEMORY;
    }
    result = read_stream(r, version, mesh);
    inflateEnd(&r->stream);
    return result == REY_OK && shape_index == 0 ? check_list(r, version) : result;
}

rey_result rey_mesh_read_serialized_memory(rey_context *ctx, const char *name, const void *bytes, size_t size,
                                           int shape_index, rey_mesh *out) {
    *out = (rey_mesh){0};
    if (shape_index < 0) {
        return rey_fail(ctx, REY_ERROR_SCENE, "%s: shape index %d, expected 0 or more", name, shape_index);
    }
    SerializedReader *r = rey_alloc(ctx, sizeof *r);
    if (!r) {
        return REY_ERROR_MEMORY;
    }
    r->ctx = ctx;
    r->name = name;
    r->bytes = bytes;
    r->size = r->end = (int64_t)size;
    rey_result result = read_shape(r, shape_index, out);
    rey_free(ctx, r);
    if (result != REY_OK) {
        rey_mesh_free(ctx, out);
    }
    return result;
}

rey_result rey_mesh_read_serialized(rey_context *ctx, const char *path, int shape_index, rey_mesh *out) {
    *out = (rey_mesh){0};
    unsigned char *bytes;
    size_t size;
    rey_result result = rey_file_read(ctx, path, &bytes, &size);
    if (result == REY_OK) {
        result = rey_mesh_read_serialized_memory(ctx, path, bytes, size, shape_index, out);
        rey_free(ctx, bytes);
    }
    return result;
}
