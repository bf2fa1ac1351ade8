// obj.c: Wavefront OBJ, the statements v, vt, vn and f; everything else is ignored.
#include "io/decimal.h"
#include "io/file.h"
#include "io/mesh.h"
#include "io/triples.h"

#include <math.h>
#include <string.h>

enum { POSITION, UV, NORMAL, POOLS };

typedef struct ObjReader {
    rey_context *ctx;
    const char *name;
    const char *at, *end;
    int64_t line; // of at, from 1
    bool flip_tex_coords;
    Array pools[POOLS]; // v, vt, vn in order: 3, 2 and 3 floats
    Array keys;         // Triple: 1-based indices into the pools, 0 = absent; one per render vertex
    TripleTable table;  // from keys to render vertices
    Array recent;       // uint32_t per v: 1 + the render vertex that used it last, which mostly is the next one too
    Array faces;        // 3 uint32_t
    int64_t largest[POOLS], largest_line[POOLS]; // indices may point forward: checked at the end
} ObjReader;

static const char *const pool_names[POOLS] = {"v", "vt", "vn"};
static const size_t pool_widths[POOLS] = {3, 2, 3};

// Moves to the next word of the statement, over a backslash that continues the line; false at the end of the line.
static bool next_word(ObjReader *r) {
    while (r->at < r->end) {
        char c = *r->at;
        if (c == '\\' && r->end - r->at > 1 && r->at[1] == '\n') {
            r->at += 2;
            r->line++;
        } else if (c == '\\' && r->end - r->at > 2 && r->at[1] == '\r' && r->at[2] == '\n') {
            r->at += 3;
            r->line++;
        } else if (c == ' ' || c == '\t' || c == '\r') {
            r->at++;
        } else {
            return c != '\n' && c != '#';
        }
    }
    return false;
}

static void skip_line(ObjReader *r) {
    const char *newline = memchr(r->at, '\n', (size_t)(r->end - r->at));
    r->at = newline ? newline + 1 : r->end;
    r->line++;
}

static bool word_ends(const ObjReader *r, const char *at) {
    return at == r->end || *at == ' ' || *at == '\t' || *at == '\r' || *at == '\n' || *at == '\\' || *at == '#';
}

// Length of the word at the reader, shortened for messages.
static int shown_length(const ObjReader *r) {
    int length = 0;
    while (length < 32 && !word_ends(r, r->at + length)) {
        length++;
    }
    return length;
}

// v x y z, vt u [v], vn x y z; more numbers (weights, colours) are ignored.
static rey_result read_values(ObjReader *r, int pool) {
    int width = (int)pool_widths[pool];
    int least = pool == UV ? 1 : width;
    float values[3] = {0};
    for (int k = 0; k < width; k++) {
        if (!next_word(r)) {
            if (k >= least) {
                break;
            }
            return rey_fail(r->ctx, REY_ERROR_FORMAT, "%s:%lld: %s has %d numbers, expected %d", r->name,
                            (long long)r->line, pool_names[pool], k, least);
        }
        const char *after = rey_parse_float(r->at, r->end, &values[k]);
        if (!after || !word_ends(r, after)) {
            return rey_fail(r->ctx, REY_ERROR_FORMAT, "%s:%lld: '%.*s' in %s is not a number", r->name,
                            (long long)r->line, shown_length(r), r->at, pool_names[pool]);
        }
        if (!isfinite(values[k])) {
            return rey_fail(r->ctx, REY_ERROR_FORMAT, "%s:%lld: '%.*s' in %s, expected a finite number in float range",
                            r->name, (long long)r->line, shown_length(r), r->at, pool_names[pool]);
        }
        r->at = after;
    }
    if (pool == UV && r->flip_tex_coords) {
        values[1] = 1 - values[1];
    }
    float *item = rey_array_push(r->ctx, &r->pools[pool], (size_t)width * sizeof(float), 1);
    if (!item) {
        return REY_ERROR_MEMORY;
    }
    memcpy(item, values, (size_t)width * sizeof(float));
    return REY_OK;
}

// Index into a pool, from 1; relative ones count back from the pool's end so far.
static rey_result resolve_index(ObjReader *r, int pool, int64_t index, uint32_t *resolved) {
    int64_t count = (int64_t)r->pools[pool].count;
    int64_t absolute = index < 0 ? count + 1 + index : index;
    if (absolute < 1 || absolute > MESH_MOST_ITEMS) {
        return rey_fail(r->ctx, REY_ERROR_FORMAT, "%s:%lld: %s index %lld is out of range, %lld are defined", r->name,
                        (long long)r->line, pool_names[pool], (long long)index, (long long)count);
    }
    if (absolute > r->largest[pool]) {
        r->largest[pool] = absolute;
        r->largest_line[pool] = r->line;
    }
    *resolved = (uint32_t)absolute;
    return REY_OK;
}

// v, v/vt, v//vn or v/vt/vn.
static rey_result read_corner(ObjReader *r, Triple *key) {
    *key = (Triple){{0, 0, 0}};
    const char *at = r->at;
    for (int pool = 0; pool < POOLS; pool++) {
        int64_t index;
        const char *after = rey_parse_int(at, r->end, &index);
        if (after) {
            rey_result result = resolve_index(r, pool, index, &key->word[pool]);
            if (result != REY_OK) {
                return result;
            }
            at = after;
        }
        if (pool == POSITION && !after) {
            break;
        }
        if (word_ends(r, at)) {
            r->at = at;
            return REY_OK;
        }
        if (*at != '/') {
            break;
        }
        at++;
    }
    return rey_fail(r->ctx, REY_ERROR_FORMAT, "%s:%lld: '%.*s' in f, expected v, v/vt, v//vn or v/vt/vn", r->name,
                    (long long)r->line, shown_length(r), r->at);
}

static bool same_triple(const Triple *a, const Triple *b) {
    return a->word[0] == b->word[0] && a->word[1] == b->word[1] && a->word[2] == b->word[2];
}

static rey_result find_vertex(ObjReader *r, const Triple *key, uint32_t *vertex) {
    size_t count = r->keys.count, known = r->recent.count, positions = r->pools[POSITION].count;
    if (known < positions && !rey_array_push(r->ctx, &r->recent, sizeof(uint32_t), positions - known)) {
        return REY_ERROR_MEMORY;
    }
    uint32_t *recent = key->word[0] <= positions ? &ARRAY_AT(r->recent, uint32_t, key->word[0] - 1) : NULL;
    if (recent && *recent && same_triple(&ARRAY_AT(r->keys, Triple, *recent - 1), key)) {
        *vertex = *recent - 1;
        return REY_OK;
    }
    if (!triple_reserve(r->ctx, &r->table, r->keys.data, count)) {
        return REY_ERROR_MEMORY;
    }
    uint32_t *slot = triple_slot(&r->table, r->keys.data, key);
    if (!*slot) {
        if (count >= MESH_MOST_ITEMS) {
            return rey_fail(r->ctx, REY_ERROR_UNSUPPORTED, "%s:%lld: more than %d distinct vertices", r->name,
                            (long long)r->line, MESH_MOST_ITEMS);
        }
        Triple *stored = rey_array_push(r->ctx, &r->keys, sizeof *stored, 1);
        if (!stored) {
            return REY_ERROR_MEMORY;
        }
        *stored = *key;
        *slot = (uint32_t)(count + 1);
    }
    *vertex = *slot - 1;
    if (recent) {
        *recent = *slot;
    }
    return REY_OK;
}

static rey_result read_face(ObjReader *r) {
    uint32_t corners[3] = {0}; // the first, the one before and the current
    int64_t count = 0;
    for (; next_word(r); count++) {
        Triple key;
        rey_result result = read_corner(r, &key);
        if (result == REY_OK) {
            corners[1] = corners[2];
            result = find_vertex(r, &key, &corners[2]);
        }
        if (result != REY_OK) {
            return result;
        }
        if (count == 0) {
            corners[0] = corners[2];
        } else if (count >= 2) {
            if (r->faces.count >= MESH_MOST_ITEMS) {
                return rey_fail(r->ctx, REY_ERROR_UNSUPPORTED, "%s:%lld: more than %d triangles", r->name,
                                (long long)r->line, MESH_MOST_ITEMS);
            }
            uint32_t *face = rey_array_push(r->ctx, &r->faces, sizeof corners, 1);
            if (!face) {
                return REY_ERROR_MEMORY;
            }
            memcpy(face, corners, sizeof corners);
        }
    }
    if (count < 3) {
        return rey_fail(r->ctx, REY_ERROR_FORMAT, "%s:%lld: f has %lld corners, expected at least 3", r->name,
                        (long long)r->line, (long long)count);
    }
    return REY_OK;
}

static rey_result read_statements(ObjReader *r) {
    while (r->at < r->end) {
        rey_result result = REY_OK;
        if (next_word(r)) {
            const char *word = r->at;
            while (!word_ends(r, r->at)) {
                r->at++;
            }
            size_t length = (size_t)(r->at - word);
            if (length == 1 && word[0] == 'v') {
                result = read_values(r, POSITION);
            } else if (length == 2 && word[0] == 'v' && word[1] == 't') {
                result = read_values(r, UV);
            } else if (length == 2 && word[0] == 'v' && word[1] == 'n') {
                result = read_values(r, NORMAL);
            } else if (length == 1 && word[0] == 'f') {
                result = read_face(r);
            }
        }
        if (result != REY_OK) {
            return result;
        }
        skip_line(r);
    }
    for (int pool = 0; pool < POOLS; pool++) {
        if (r->largest[pool] > (int64_t)r->pools[pool].count) {
            return rey_fail(r->ctx, REY_ERROR_FORMAT, "%s:%lld: %s index %lld is out of range, the file has %zu",
                            r->name, (long long)r->largest_line[pool], pool_names[pool], (long long)r->largest[pool],
                            r->pools[pool].count);
        }
    }
    if (!r->faces.count) {
        return rey_fail(r->ctx, REY_ERROR_FORMAT, "%s:%lld: the file ends without a face, expected at least one f",
                        r->name, (long long)r->line);
    }
    return REY_OK;
}

// Copies one pool's values to the vertices that use it. Vertices without an index keep zeros.
static float *gather(const ObjReader *r, int pool) {
    size_t width = pool_widths[pool];
    float *values = rey_alloc_array(r->ctx, r->keys.count, width * sizeof *values);
    for (size_t i = 0; values && i < r->keys.count; i++) {
        uint32_t index = ARRAY_AT(r->keys, Triple, i).word[pool];
        if (index) {
            memcpy(values + width * i, (const float *)r->pools[pool].data + width * (index - 1),
                   width * sizeof *values);
        }
    }
    return values;
}

// Corners without vn in a file where others have it: the smooth normal.
static rey_result fill_missing_normals(const ObjReader *r, rey_mesh *mesh) {
    size_t missing = 0;
    for (size_t i = 0; i < r->keys.count; i++) {
        missing += !ARRAY_AT(r->keys, Triple, i).word[NORMAL];
    }
    if (!missing) {
        return REY_OK;
    }
    float *stored = mesh->normals;
    mesh->normals = NULL;
    rey_result result = rey_mesh_compute_normals(r->ctx, mesh);
    for (size_t i = 0; result == REY_OK && i < r->keys.count; i++) {
        if (ARRAY_AT(r->keys, Triple, i).word[NORMAL]) {
            memcpy(mesh->normals + 3 * i, stored + 3 * i, 3 * sizeof *stored);
        }
    }
    rey_free(r->ctx, stored);
    return result;
}

static rey_result build(ObjReader *r, rey_mesh *mesh) {
    mesh->vertex_count = (int64_t)r->keys.count;
    mesh->face_count = (int64_t)r->faces.count;
    mesh->faces = r->faces.data;
    r->faces = (Array){0};
    mesh->positions = gather(r, POSITION);
    mesh->uvs = r->largest[UV] ? gather(r, UV) : NULL;
    mesh->normals = r->largest[NORMAL] ? gather(r, NORMAL) : NULL;
    if (!mesh->positions || (r->largest[UV] && !mesh->uvs) || (r->largest[NORMAL] && !mesh->normals)) {
        return REY_ERROR_MEMORY;
    }
    rey_result result = rey_mesh_weld(r->ctx, mesh);
    return result == REY_OK && mesh->normals ? fill_missing_normals(r, mesh) : result;
}

rey_result rey_mesh_read_obj_memory(rey_context *ctx, const char *name, const void *bytes, size_t size,
                                    bool flip_tex_coords, rey_mesh *out) {
    *out = (rey_mesh){0};
    const char *text = size ? bytes : "";
    ObjReader r = {
        .ctx = ctx, .name = name, .at = text, .end = text + size, .line = 1, .flip_tex_coords = flip_tex_coords};
    rey_result result = read_statements(&r);
    if (result == REY_OK) {
        triple_free(ctx, &r.table);
        result = build(&r, out);
    }
    triple_free(ctx, &r.table);
    for (int pool = 0; pool < POOLS; pool++) {
        rey_array_free(ctx, &r.pools[pool]);
    }
    rey_array_free(ctx, &r.keys);
    rey_array_free(ctx, &r.recent);
    rey_array_free(ctx, &r.faces);
    if (result != REY_OK) {
        rey_mesh_free(ctx, out);
    }
    return result;
}

rey_result rey_mesh_read_obj(rey_context *ctx, const char *path, bool flip_tex_coords, rey_mesh *out) {
    *out = (rey_mesh){0};
    unsigned char *bytes;
    size_t size;
    rey_result result = rey_file_read(ctx, path, &bytes, &size);
    if (result == REY_OK) {
        result = rey_mesh_read_obj_memory(ctx, path, bytes, size, flip_tex_coords, out);
        rey_free(ctx, bytes);
    }
    return result;
}
