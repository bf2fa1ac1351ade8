// state.h: where a chunk of paths lives: structure-of-arrays in one block of scratch memory, listed once.
// A path state is compacted at every bounce; per-slot sums stay where they are. In derivative modes the vertices of the
// whole chunk are recorded, bounce after bounce, for the backward sweep.
#pragma once

#include "integrator/job.h"
#include "math/spec_rows.h"

enum {
    CHUNK = 2048,              // paths per chunk
    RECORDS_PER_PATH = 64,     // a chunk that needs more is run again in halves
    MAX_BOUNCES = 1 << 20
};

// A path on its way: ray, throughput, roulette state, density of the direction (-1: camera or delta), slot, and depth
// where that is not the bounce (scene->through). In media, skip: how far before its origin the ray left its surface; begins: what
// it begins at (BEGINS_).
#define PATH_FLOATS(F)                                                                                                 \
    F(ox) F(oy) F(oz) F(dx) F(dy) F(dz) F(tmax) F(eta2) F(roulette) F(pdf) F(px) F(py) F(pz) F(skip)
#define PATH_SPECS(S) S(beta)
#define PATH_INTS(I) I(slot) I(medium) I(depth) I(begins)
enum { BEGINS_AT_SURFACE, BEGINS_IN_AIR, BEGINS_AT_VEIL };

// A shadow ray: ray, what it brings if nothing is in the way (in derivatives: without the throughput before it), whom, and, where
// some of them end at what others pass (PathJob.veils), the light.
#define SHADOW_FLOATS(F) F(ox) F(oy) F(oz) F(dx) F(dy) F(dz) F(tmax)
#define SHADOW_SPECS(S) S(radiance)
#define SHADOW_INTS(I) I(slot) I(record) I(medium) I(light)

// A recorded vertex: its tag, the hit, the incoming ray, throughput before it, the MIS weight of its own emission,
// the light sample (direction, where the light's texture was read, distance, transmittance over density, value of the
// scattering function),
// the sampled direction (world) and 1 / (density x survival), and whether the vertex slides (SLIDES_): it lies where a ray from
// the camera or a collision, or one that was mirrored or refracted, meets its surface. Radiance leaving the vertex is local +
// weight x radiance arriving along the sampled direction. side: see corner.h and glossy.h, glance_: the latter; keep, slope, met
// and the density of the light sample: see kept.h.
#define RECORD_FLOATS(F)                                                                                               \
    F(u) F(v) F(px) F(py) F(pz) F(dx) F(dy) F(dz) F(mis) F(ldx) F(ldy) F(ldz) F(lu) F(lv) F(ldist) F(wox) F(woy) F(woz)  \
    F(sw) F(keep) F(slope) F(light_pdf) F(glance_distance)
#define RECORD_SPECS(S) S(beta) S(light_weight) S(light_f) S(local) S(weight) S(side) S(met)
#define RECORD_INTS(I) I(shape) I(prim) I(instance) I(slot) I(light) I(lprim) I(lobe) I(slides) I(medium) I(depth)  \
    I(glance_shape) I(glance_prim) I(glance_instance)

// Vertices are attached to the one before, or slide; in media SLIDES_SEEN where the ray is the sensor's own.
enum { SLIDES_NOT, SLIDES_ALONG, SLIDES_SEEN };

// Of a camera sample: where it lies on the film, its alpha, and whether it has met what a derivative is asked for (vertex.h).
#define SAMPLE_FLOATS(F) F(film_x) F(film_y) F(coverage) F(reached)

#define BORDER_FLOATS(F) F(border_total) F(border_worth) F(border_x) F(border_y) F(border_z) F(border_dx) F(border_dy) F(border_dz)

#define MOVE_FLOATS(F) F(next_px) F(next_py) F(next_pz) F(next_nx) F(next_ny) F(next_nz)

#define DECLARE_FLOAT(name) real *name;
#define DECLARE_SPEC(name) SpecRows name;
#define DECLARE_INT(name) int32_t *name;
typedef struct Paths {
    PATH_FLOATS(DECLARE_FLOAT) PATH_SPECS(DECLARE_SPEC) PATH_INTS(DECLARE_INT)
} Paths;
typedef struct Shadows {
    SHADOW_FLOATS(DECLARE_FLOAT) SHADOW_SPECS(DECLARE_SPEC) SHADOW_INTS(DECLARE_INT)
} Shadows;
typedef struct Records {
    RECORD_FLOATS(DECLARE_FLOAT) RECORD_SPECS(DECLARE_SPEC) RECORD_INTS(DECLARE_INT)
} Records;

// Tags of path vertices.
enum { VERTEX_SURFACE, VERTEX_ESCAPED, VERTEX_MEDIUM, VERTEX_NULL, VERTEX_LIGHT, VERTEX_FLIGHT };

// A run of recorded vertices that share tag and group; `count` lanes of the LANES from `first` on are alive.
typedef struct RecordBatch {
    int32_t tag, group, first, count; // group: that of surfaces, else the medium
    int32_t bounce;
    bool ends;         // the paths end here: their depth is reached
    bool first_vertex; // these are what the camera sees
    bool local;        // directions are recorded in the shading frame, and as u and v texture coordinates: all that materials need
} RecordBatch;

// A vector per slot, for each channel that forward mode drives.
typedef struct ChannelRows {
    real *x[SPEC_N], *y[SPEC_N], *z[SPEC_N];
} ChannelRows;

// What stands for the record of the next vertex where rays meet no surface: nothing, a point of the ray, such as a collision, or a
// collision a part of which moves with a light (beacon.h).
enum { NEXT_NONE = -1, NEXT_POINT = -2, NEXT_STILL = -3 };

typedef struct Workspace {
    Paths paths[2];
    Shadows shadows;
    Records records;
    RecordBatch *batches;
    int32_t batch_capacity, record_capacity;
    int32_t chunk;
    // per ray of the current bounce
    int32_t *hit_shape, *hit_prim, *hit_instance, *hit_group, *order;
    real *hit_u, *hit_v, *hit_x, *hit_y, *hit_z;
    // per slot: radiance (or derivative), film's adjoint, radiance of the path behind a vertex, film position, alpha, pixel
    // and sample numbers
    SpecRows radiance, adjoint, suffix;
    // how the adjoint changes across the film; in forward mode, what is carried across it (beacon_view.h)
    SpecRows adjoint_x, adjoint_y;
    SAMPLE_FLOATS(DECLARE_FLOAT)
    int32_t *pixel, *sample;
    // per slot, of the vertex that the sweep has just left (path_move.h): its record (or NEXT_), position and normal, what
    // leaves it but does not go on along a chain, and per channel the adjoint of the direction back to the vertex before it,
    // and where the vertex slides, of the ray's position there and of its direction; where it is attached in media, of points on
    // the way to it, and of these times their distance beyond it (ride_add); and beside which light it moves (beacon.h)
    int32_t *next, *next_light;
    MOVE_FLOATS(DECLARE_FLOAT)
    SpecRows attached;
    ChannelRows back, drag, turn, pull;
    // per slot, of the flight that has the path's probe (probe.h): its record (-1: none) and medium, what all flights
    // together and this one are worth, where along it the probe is, and what is scattered there; and what the collision that was
    // swept last scatters. Both per unit of albedo where media have a sigma_s
    int32_t *probe, *probe_medium;
    real *probe_total, *probe_worth, *probe_at;
    SpecRows scattered, collided;
    // the same of the border that has the path's probe (border.h); which side of it that is on, and where
    int32_t *border, *border_side, *border_medium, *border_depth;
    BORDER_FLOATS(DECLARE_FLOAT)
    SpecRows border_scattered;
    // per slot, where paths are dropped (kept.h): whether nothing is decided, how far what was met is kept, the sum of that,
    // and the throughput of pictures
    real *undecided, *kept;
    SpecRows met, throughput;
    // per slot: aovs
    real *channel[MOST_AOV_CHANNELS];
} Workspace;

#define CARVE(pointer, count)                                                                                          \
    {                                                                                                                  \
        (pointer) = block ? (void *)(block + at) : NULL;                                                               \
        at += ((count) * sizeof *(pointer) + 63) / 64 * 64;                                                            \
    }
#define CARVE_SPEC(rows, count)                                                                                        \
    for (int c = 0; c < SPEC_N; c++) {                                                                                 \
        CARVE((rows)[c], count)                                                                                        \
    }
#define CARVE_SAMPLE(name) CARVE(ws->name, n)

// What the sweep keeps per slot of what moves, from `at` on; returns where it ends.
static inline size_t workspace_layout_moves(Workspace *ws, char *block, size_t at, size_t n) {
    CARVE(ws->next, n)
    CARVE(ws->next_light, n)
    MOVE_FLOATS(CARVE_SAMPLE)
    CARVE_SPEC(ws->attached, n)
    CARVE_SPEC(ws->adjoint_x, n)
    CARVE_SPEC(ws->adjoint_y, n)
    ChannelRows *rows[] = {&ws->back, &ws->drag, &ws->turn, &ws->pull};
    for (int i = 0; i < 4; i++) {
        CARVE_SPEC(rows[i]->x, n)
        CARVE_SPEC(rows[i]->y, n)
        CARVE_SPEC(rows[i]->z, n)
    }
    return at;
}

// What derivatives with respect to media keep per slot.
static inline size_t workspace_layout_probes(Workspace *ws, char *block, size_t at, size_t n) {
    CARVE(ws->probe, n)
    CARVE(ws->probe_medium, n)
    CARVE(ws->probe_total, n)
    CARVE(ws->probe_worth, n)
    CARVE(ws->probe_at, n)
    CARVE_SPEC(ws->scattered, n)
    CARVE_SPEC(ws->collided, n)
    CARVE(ws->border, n)
    CARVE(ws->border_side, n)
    CARVE(ws->border_medium, n)
    CARVE(ws->border_depth, n)
    BORDER_FLOATS(CARVE_SAMPLE)
    CARVE_SPEC(ws->border_scattered, n)
    return at;
}

// What derivatives keep per slot where paths are dropped.
static inline size_t workspace_layout_kept(Workspace *ws, char *block, size_t at, size_t n) {
    CARVE(ws->undecided, n)
    CARVE(ws->kept, n)
    CARVE_SPEC(ws->met, n)
    CARVE_SPEC(ws->throughput, n)
    return at;
}

// Lays the workspace out in a block; with block null only measures. Returns the bytes needed.
static inline size_t workspace_layout(Workspace *ws, char *block, int32_t mode) {
    size_t at = 0;
    bool derivative = mode_records(mode);
    ws->chunk = CHUNK;
    size_t n = (size_t)ws->chunk + 2 * LANES;
    ws->record_capacity = derivative ? CHUNK * RECORDS_PER_PATH : 0;
    ws->batch_capacity = derivative ? ws->record_capacity / 8 : 0;
    size_t m = (size_t)ws->record_capacity + 2 * LANES;
#define CARVE_PATH(name) CARVE(ws->paths[i].name, n)
#define CARVE_PATH_SPEC(name) CARVE_SPEC(ws->paths[i].name, n)
    for (int i = 0; i < 2; i++) {
        PATH_FLOATS(CARVE_PATH)
        PATH_SPECS(CARVE_PATH_SPEC)
        PATH_INTS(CARVE_PATH)
    }
#define CARVE_SHADOW(name) CARVE(ws->shadows.name, n)
#define CARVE_SHADOW_SPEC(name) CARVE_SPEC(ws->shadows.name, n)
    SHADOW_FLOATS(CARVE_SHADOW)
    SHADOW_SPECS(CARVE_SHADOW_SPEC)
    SHADOW_INTS(CARVE_SHADOW)
    if (derivative) {
#define CARVE_RECORD(name) CARVE(ws->records.name, m)
#define CARVE_RECORD_SPEC(name) CARVE_SPEC(ws->records.name, m)
        RECORD_FLOATS(CARVE_RECORD)
        RECORD_SPECS(CARVE_RECORD_SPEC)
        RECORD_INTS(CARVE_RECORD)
        CARVE(ws->batches, (size_t)ws->batch_capacity)
    }
    CARVE(ws->hit_shape, n)
    CARVE(ws->hit_prim, n)
    CARVE(ws->hit_instance, n)
    CARVE(ws->hit_group, n)
    CARVE(ws->order, n)
    CARVE(ws->hit_u, n)
    CARVE(ws->hit_v, n)
    CARVE(ws->hit_x, n)
    CARVE(ws->hit_y, n)
    CARVE(ws->hit_z, n)
    CARVE_SPEC(ws->radiance, n)
    CARVE_SPEC(ws->adjoint, n)
    CARVE_SPEC(ws->suffix, n)
    SAMPLE_FLOATS(CARVE_SAMPLE)
    CARVE(ws->pixel, n)
    CARVE(ws->sample, n)
    at = derivative ? workspace_layout_moves(ws, block, at, n) : at;
    at = derivative ? workspace_layout_probes(ws, block, at, n) : at;
    at = derivative ? workspace_layout_kept(ws, block, at, n) : at;
    for (int c = 0; c < MOST_AOV_CHANNELS && mode == MODE_AOV; c++) {
        CARVE(ws->channel[c], n)
    }
    return at;
}
