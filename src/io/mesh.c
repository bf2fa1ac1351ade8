// mesh.c: what all meshes share: life cycle, attributes, welding of positions.
#include "io/mesh.h"

#include "io/triples.h"

#include <math.h>
#include <string.h>

void rey_mesh_free(rey_context *ctx, rey_mesh *mesh) {
    rey_free(ctx, mesh->positions);
    rey_free(ctx, mesh->normals);
    rey_free(ctx, mesh->uvs);
    rey_free(ctx, mesh->faces);
    rey_free(ctx, mesh->position_index);
    for (int i = 0; i < mesh->attribute_count; i++) {
        rey_free(ctx, mesh->attributes[i].data);
    }
    rey_free(ctx, mesh->attributes);
    *mesh = (rey_mesh){0};
}

float *rey_mesh_add_attribute(rey_context *ctx, rey_mesh *mesh, const char *name, bool per_face, int channels) {
    if (strlen(name) >= sizeof mesh->attributes->name) {
        rey_fail(ctx, REY_ERROR_FORMAT, "mesh attribute name '%s' is too long, expected at most %zu characters", name,
                 sizeof mesh->attributes->name - 1);
        return NULL;
    }
    rey_mesh_attribute attribute = {.per_face = per_face, .channels = channels};
    memcpy(attribute.name, name, strlen(name));
    size_t count = (size_t)(per_face ? mesh->face_count : mesh->vertex_count);
    size_t held = (size_t)mesh->attribute_count;
    rey_mesh_attribute *list = rey_alloc_array(ctx, held + 1, sizeof *list);
    attribute.data = list ? rey_alloc_array(ctx, count, (size_t)channels * sizeof *attribute.data) : NULL;
    if (!attribute.data) {
        rey_free(ctx, list);
        return NULL;
    }
    if (held) {
        memcpy(list, mesh->attributes, held * sizeof *list);
    }
    list[held] = attribute;
    rey_free(ctx, mesh->attributes);
    mesh->attributes = list;
    mesh->attribute_count++;
    return attribute.data;
}

// Positions that differ by rounding alone are one: where a script closes a torus, sin(2 pi) is not 0, and a seam of two borders
// would hide light from itself. How far that reaches depends on the position's own size, so that a stray vertex far away changes
// nothing. Vertices lie in cells of CELL times the reach of their size.
enum { WELD_BITS = 21, CELL = 8 }; // reach: 2^-21 of the next power of two, some units in the last place

typedef struct Welder {
    TripleTable table; // of cells: the first vertex of each, plus 1
    Triple *keys;      // the cell of vertices that are the first at their position
    uint32_t *next;    // the next one of the same cell, plus 1
    const float *positions;
} Welder;

// The cell of a position of size 2^exponent. step: to those next to it that are within reach.
static Triple weld_cell(const float *p, int exponent, int32_t step[3]) {
    const double cells = ldexp(1, WELD_BITS - exponent) / CELL;
    Triple key;
    for (int k = 0; k < 3; k++) {
        double x = (double)p[k] * cells, low = floor(x), part = (x - low) * CELL;
        key.word[k] = (uint32_t)(int32_t)low;
        step[k] = part < 1.5 ? -1 : part > CELL - 1.5 ? 1 : 0;
    }
    return key;
}

// Cells are numbers of at most WELD_BITS bits: what tells those of one size from others' lies above them.
static Triple weld_key(Triple cell, int exponent) {
    cell.word[0] = (cell.word[0] & 0x3fffff) | (uint32_t)exponent << 22;
    return cell;
}

static double weld_apart(const float *a, const float *b) {
    double most = 0;
    for (int k = 0; k < 3; k++) {
        most = fmax(most, fabs((double)a[k] - (double)b[k]));
    }
    return most;
}

// The nearest of the first vertices within *reach of number i among those of a size, or `found`; *reach becomes its distance.
static size_t weld_look(const Welder *w, size_t i, int exponent, double *reach, size_t found) {
    const float *p = w->positions + 3 * i;
    int32_t step[3];
    const Triple cell = weld_cell(p, exponent, step);
    for (int n = 0; n < 8; n++) {
        Triple key = cell;
        bool beside = true;
        for (int k = 0; k < 3; k++) {
            beside = beside && (!(n >> k & 1) || step[k]);
            key.word[k] += (uint32_t)((n >> k & 1) * step[k]);
        }
        key = weld_key(key, exponent);
        const uint32_t *slot = beside ? triple_slot(&w->table, w->keys, &key) : NULL;
        for (uint32_t vertex = slot ? *slot : 0; vertex; vertex = w->next[vertex - 1]) {
            double apart = weld_apart(p, w->positions + 3 * (size_t)(vertex - 1));
            if (apart <= *reach && (found == i || apart < *reach)) {
                *reach = apart;
                found = vertex - 1;
            }
        }
    }
    return found;
}

// The first vertex at the position of number i, which becomes one if there is none before it.
static uint32_t weld_find(Welder *w, size_t i) {
    const float *p = w->positions + 3 * i;
    const float zero[3] = {0, 0, 0};
    int exponent, beside = 0;
    const double size = frexp(weld_apart(p, zero), &exponent), near = ldexp(2, -WELD_BITS);
    double reach = ldexp(1, exponent - WELD_BITS);
    size_t found = weld_look(w, i, exponent, &reach, i);
    beside = size < 0.5 + near ? -1 : size > 1 - near ? 1 : 0;
    found = beside ? weld_look(w, i, exponent + beside, &reach, found) : found;
    if (found != i) {
        return (uint32_t)found;
    }
    int32_t step[3];
    w->keys[i] = weld_key(weld_cell(p, exponent, step), exponent);
    uint32_t *slot = triple_slot(&w->table, w->keys, &w->keys[i]);
    w->next[i] = *slot ? w->next[*slot - 1] : 0;
    *(*slot ? &w->next[*slot - 1] : slot) = (uint32_t)(i + 1);
    return (uint32_t)i;
}

rey_result rey_mesh_weld(rey_context *ctx, rey_mesh *mesh) {
    const size_t count = (size_t)mesh->vertex_count;
    Welder w = {.positions = mesh->positions};
    w.keys = rey_alloc_array(ctx, count, sizeof *w.keys);
    w.next = rey_alloc_array(ctx, count, sizeof *w.next);
    uint32_t *first = rey_alloc_array(ctx, count, sizeof *first);
    bool room = w.keys && w.next && first && triple_reserve(ctx, &w.table, w.keys, count);
    for (size_t i = 0; room && i < count; i++) {
        first[i] = weld_find(&w, i);
    }
    triple_free(ctx, &w.table);
    rey_free(ctx, w.keys);
    rey_free(ctx, w.next);
    if (!room) {
        rey_free(ctx, first);
        return REY_ERROR_MEMORY;
    }
    rey_free(ctx, mesh->position_index);
    mesh->position_index = first;
    return REY_OK;
}
