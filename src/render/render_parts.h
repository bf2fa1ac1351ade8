// render_parts.h: what pictures (picture.c) and derivatives (render.c) share. Private to src/render.
#pragma once

#include "backend/backend.h"
#include "render/film.h"
#include "render/term_request.h"

#include <pthread.h>
#include <stdatomic.h>

// What a boundary term samples (boundary.c).
typedef struct BoundaryPlan {
    BoundaryJob job;         // what all units share
    EdgeRecord *edges;
    float *cdf;
    Array steps, step_at;    // where textures jump (shape/marks.h): StepRecord, and of every shape its first one
    Array beams;             // and light in the air: BeamRecord
    FilmPlan film;           // one tile that covers the picture
    double *films;           // forward: one per shard
    int64_t samples;         // of one set
    int32_t shards;
} BoundaryPlan;

// Everything about one call.
typedef struct Render {
    rey_scene *scene;
    rey_render_def def;
    const Backend *backend;
    FilmPlan plan;
    PathJob job;           // what all units share
    int32_t tiles, shards;
    bool particles;        // light tracing follows what the sensor sees of lights directly
    SceneView lights;      // then: the scene for paths of one segment
    void **workspaces;     // one per worker
    double *films;         // primal and forward: one per tile
    double *powers;        // the same of powers of the samples, or null
    double *coverage;      // the same of alpha and of 1, or null
    double *gradients;     // reverse: one per shard
    int64_t gradient_size, selection_size; // numbers selected, and what is gathered behind them for others
    float *tangent;        // forward: those numbers' motion
    double *normal_sums;   // of vertex normals that follow the selection (motion.c)
    double *columns, *rows;
    int32_t *offsets;      // texture_at, to_uv_at, normals_at, attribute_at, ..., live
    const int32_t *none;   // the same of a selection of nothing
    bool lines;            // the selection moves lines along which textures jump over their surfaces
    bool rims;             // it moves the ends of rough refraction in the light of points or of single directions
    bool facing;           // it moves where normals of maps turn away from what looks at them, and that is known
    bool turns_rays;       // the selection turns rays everywhere: the camera's, or mirrored and refracted ones
    float *adjoint;
    int needed, terms;     // REY_TERM_ bits that the selection needs; that are computed
    TermRequest request;
    double booked;         // of a set's value: what its terms have brought so far
    Array edges, fans;     // what all boundary terms choose from (shape/edges.h)
    Array sides;           // of edges that several surfaces share (shape/shared.h)
    Array meetings;        // curves that two boundary terms share (shape/meetings.h)
    bool meetings_found;
    Array corners;         // where the interior term looks through lenses (shape/corners.h)
    int32_t *corner_at;    // by viewer
    PaneSet panes;         // of the job, where there are some; their records, and which shapes they are of
    Array pane_records, pane_of;
    int32_t *pane_at;
    int32_t *lamp_medium;  // by emitter, where it matters, else null: the medium that it lies in, -1 = none (beacons.h)
    Beacon *beacons;       // those of the job
    int32_t *beacon_of;
    Array marks;           // curves along which textures jump (shape/marks.h)
    Array beams, beam_steps; // of the job: borders of light in media
    BoundaryPlan boundary[BOUNDARY_KINDS];
    int32_t faces;         // which way shading normals were met: FACES_ bits
    int64_t borders, astray; // as in PathJob, of paths from the sensor
    rey_stats stats;
    double done, total;    // progress
    int part, parts;       // this call is number `part` of `parts` equal ones
    atomic_bool cancelled;
    pthread_mutex_t lock;   // of stats and done, and around progress
} Render;

// Whether the scene can be rendered so.
rey_result rey_render_check(rey_scene *scene, const rey_render_def *def);
// Checks, brings the scene up to date and prepares what every mode needs. rey_render_end follows in any case.
rey_result rey_render_begin(Render *r, rey_scene *scene, const rey_render_def *def, int32_t mode, int32_t channels);
rey_result rey_render_end(Render *r, rey_result result, double start, rey_stats *stats);
// What the job is part of; all null: it is one of paths.
typedef struct UnitOfWork {
    ParticleJob *particles;
    BoundaryJob *boundary;
} UnitOfWork;

// Runs a unit of work and books its counts; false when the caller cancelled.
bool rey_render_run(Render *r, PathJob *job, UnitOfWork unit, int worker);
// A picture of `channels` channels: R G B and what the integrator adds. alpha: two numbers per pixel, whose ratio it is;
// or null.
rey_result rey_render_picture(rey_scene *scene, const rey_render_def *def, int32_t channels, float *image, double *alpha,
                              rey_stats *stats);
// Alpha is normalised by the weights of the samples, not by their expectation as colours are: what is opaque gets 1.
double rey_film_alpha(const double sums[2]);
// One tile into its film; fits rey_parallel_for.
void rey_render_film_unit(void *render, int64_t tile, int worker);
