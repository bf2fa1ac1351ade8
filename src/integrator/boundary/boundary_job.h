// boundary_job.h: one unit of work of a boundary term: a range of its samples.
#pragma once

#include "integrator/job.h"
#include "shape/marks.h"
#include "shape/meetings.h"
#include "shape/shared.h"

// What the camera sees; silhouettes that other vertices see, and where they meet surfaces whose shading normals turn away, or
// whose geometric normals do (turning.h); curves that they see along which surfaces pass through each other (meeting.h); edges
// along chains of smooth mirrors and glass (chained.h); those that the camera sees along such chains (mirrored.h); the planes
// at which maps cut light off (turning.h); lines of textures that move over their surfaces (lines.h); and edges as collisions see
// them (riding.h). CHAINED_TERMINATOR and CHAINED_HORIZON are those of turning.h along such chains, RIDING_TERMINATOR and
// RIDING_HORIZON those that collisions see or light. RIM and RIM_VIEW are the ends of rough refraction in the light of a point or
// of one direction, as other vertices and as the sensor see them (rim_light.h, rim_view.h); CHAINED_RIM and, in media, RIDING_RIM
// are those of segments that keep their directions. FACING and FACING_VIEW are where normals of maps turn away, as other vertices
// and as the sensor see that (facing.h, facing_view.h), and CHAINED_FACING and RIDING_FACING as vertices see it along chains, and
// as collisions do.
enum {
    BOUNDARY_PRIMARY,
    BOUNDARY_INDIRECT,
    BOUNDARY_TERMINATOR,
    BOUNDARY_HORIZON,
    BOUNDARY_MEETING,
    BOUNDARY_CHAINED,
    BOUNDARY_MIRRORED,
    BOUNDARY_CUT,
    BOUNDARY_LINES,
    BOUNDARY_CHAINED_TERMINATOR,
    BOUNDARY_CHAINED_HORIZON,
    BOUNDARY_RIDING,
    BOUNDARY_RIDING_TERMINATOR,
    BOUNDARY_RIDING_HORIZON,
    BOUNDARY_RIM,
    BOUNDARY_RIM_VIEW,
    BOUNDARY_CHAINED_RIM,
    BOUNDARY_FACING,
    BOUNDARY_FACING_VIEW,
    BOUNDARY_CHAINED_FACING,
    BOUNDARY_RIDING_FACING,
    BOUNDARY_RIDING_RIM,
    BOUNDARY_KINDS
};

typedef struct BoundaryJob {
    PathJob job;              // its tile is all of the film; reverse: adjoint, gradient; forward: tangent, film
    int32_t kind;             // BOUNDARY_
    const EdgeRecord *edges;
    const int32_t *fans;      // see EdgeRecord
    const SharedSide *sides;
    const MeetingRecord *meetings;
    const MarkRecord *marks;
    const StepRecord *steps;  // where textures jump: those of a shape from step_at[shape] to step_at[shape + 1]
    const int32_t *step_at;   // null: nothing jumps
    const BeamRecord *beams;  // where light ends or jumps in the air; their steps are among these
    const float *cdf;         // cumulative probabilities of the edges
    int32_t edge_count, beam_count;
    bool round;               // outlines of round surfaces, marks, borders, terminators or edges of meshes are among them
    float scale;              // of the adjoint: samples per pixel of the interior over samples of this term
    int64_t first, count;     // of the samples, in their numbering
    bool lines;               // lines of textures move over their surfaces
    bool chains;              // the scene has chains of smooth mirrors and glass
    bool mirrored;            // and the camera sees them
    bool everywhere;          // what the camera sees of them moves also where it meets nothing that moves
    const int32_t *none;      // the offsets of a selection of nothing
    const PathJob *still;     // the job with that selection
} BoundaryJob;

// Kinds of turning.h: curves on which n . w = 0, n the shading normal, or that of a map, of what is seen along w, or the geometric
// normal of what looks along it; those whose segments keep their directions, as pieces of chains or because they begin one; and
// those of them that compare what is seen on both sides of edges.
static inline bool boundary_is_facing(int32_t kind) {
    return kind == BOUNDARY_FACING || kind == BOUNDARY_CHAINED_FACING || kind == BOUNDARY_RIDING_FACING;
}
static inline bool boundary_is_terminator(int32_t kind) {
    return kind == BOUNDARY_TERMINATOR || kind == BOUNDARY_CHAINED_TERMINATOR || kind == BOUNDARY_RIDING_TERMINATOR ||
           boundary_is_facing(kind);
}
static inline bool boundary_is_horizon(int32_t kind) {
    return kind == BOUNDARY_HORIZON || kind == BOUNDARY_CHAINED_HORIZON || kind == BOUNDARY_RIDING_HORIZON;
}
static inline bool boundary_is_riding(int32_t kind) {
    return kind == BOUNDARY_RIDING || kind == BOUNDARY_RIDING_TERMINATOR || kind == BOUNDARY_RIDING_HORIZON ||
           kind == BOUNDARY_RIDING_FACING || kind == BOUNDARY_RIDING_RIM;
}
static inline bool boundary_is_chained(int32_t kind) {
    return kind == BOUNDARY_CHAINED || kind == BOUNDARY_CHAINED_TERMINATOR || kind == BOUNDARY_CHAINED_HORIZON ||
           kind == BOUNDARY_CHAINED_RIM || kind == BOUNDARY_CHAINED_FACING || boundary_is_riding(kind);
}
static inline bool boundary_is_paired(int32_t kind) { return kind == BOUNDARY_CHAINED || kind == BOUNDARY_RIDING; }

static inline bool boundary_is_rim(int32_t kind) {
    return kind == BOUNDARY_RIM || kind == BOUNDARY_RIM_VIEW || kind == BOUNDARY_CHAINED_RIM || kind == BOUNDARY_RIDING_RIM;
}

// Whether near points may move with what lies further towards the sensor (upstream.h), where something moves.
static inline bool boundary_has_ways(const BoundaryJob *b) {
    return (b->chains || b->job.rides) && (b->job.any_motion || b->job.any_places || !boundary_is_rim(b->kind));
}

// Samples of one number of a `pixel` of their random numbers.
enum { BOUNDARY_PER_SET = 1 << 24 };

// The kernels of every width.
#define BOUNDARY_ENTRY(lanes)                                                                                          \
    void rey_kernel_boundary_w##lanes(BoundaryJob *job);                                                               \
    size_t rey_kernel_boundary_bytes_w##lanes(void);
BOUNDARY_ENTRY(1)
BOUNDARY_ENTRY(8)
BOUNDARY_ENTRY(16)
