// job.h: one unit of work, the same for every kernel width: the samples of one tile of one sensor.
#pragma once

#include "scene/scene.h"
#include "shape/corners.h"
#include "shape/marks.h"
#include "shape/panes.h"

// MODE_REPLAY: the picture of another scene along the paths of this one (path_replay.h).
enum { MODE_PRIMAL, MODE_REVERSE, MODE_FORWARD, MODE_AOV, MODE_REPLAY };

// The weight of a vertex is its throughput in the scene that is asked for over that in the recording one. Sums of the
// recording throughput, of the other one, of its square over the former, of both together, and of both where the weight
// lies between 1 / within and within.
enum { WEIGHT_THEN, WEIGHT_NOW, WEIGHT_SQUARE, WEIGHT_ALL, WEIGHT_WITHIN, WEIGHTS };

// Modes that record every vertex.
static inline bool mode_records(int32_t mode) {
    return mode == MODE_REVERSE || mode == MODE_FORWARD || mode == MODE_REPLAY;
}

// What of a group depends on the selected parameters; and what of a medium.
enum { LIVE_SCATTERING = 1, LIVE_EMISSION = 2, LIVE_MOTION = 4, LIVE_UNEVEN = 8 };
enum { LIVE_EXTINCTION = 1, LIVE_ALBEDO = 2, LIVE_PHASE = 4, LIVE_GLOW = 8, LIVE_BORDER = 16 };

// A ball around a light at a point (beacon.h), and how far around it on the film nothing hides what is seen of the ball [pixels];
// 0 where the light itself is hidden, or neither it nor the sensor moves (beacon_view.h).
typedef struct Beacon {
    float x, y, z, radius, reach;
    int32_t light;
} Beacon;

typedef struct PathJob {
    const SceneView *scene;
    const SceneView *moved;       // MODE_REPLAY, MODE_REVERSE: the scene with other parameters, along the paths of `scene`; or null
    int32_t sensor, mode;
    int32_t x, y, width, height;  // tile in full-film pixels; may reach beyond the film with sample_border
    int32_t spp;
    uint32_t scramble;            // hash of (seed, set, sensor, term)
    bool sobol;
    bool score;                   // extinctions are differentiated by collisions alone (probe.h)
    // Film of the tile: (width + 2 border) x (height + 2 border) x 3, sums of filter weight times radiance.
    double *film;
    double *powers;               // the same of the samples' powers, of RGB or of XYZ; may be null
    int32_t power;                // 2, 4, ...
    bool powers_of_xyz;
    double *coverage;             // the same of alpha and of 1, two numbers per pixel; may be null
    double *weights;              // MODE_REPLAY: WEIGHT_ sums over the vertices, added to; may be null
    double within;                // of those: what weights are counted
    int32_t border;               // pixels by which filters reach over the tile's edge
    // Derivatives: adjoint of the film's sums, for the delivered picture (crop window), and the compact vectors.
    const float *adjoint;
    double *gradient;
    const float *tangent;
    const int32_t *texture_at, *to_uv_at, *normals_at, *attribute_at, *place_at;
    const int32_t *points_at, *pose_at, *instance_at, *camera_at, *volume_at;
    bool any_normals, any_attributes, any_places, any_motion, any_camera;
    bool any_sky;                 // the density of the environment is (render/dropped.c)
    int32_t sky_at;
    bool any_volumes, any_borders; // volumes move; so do surfaces that only separate media
    bool glides;                  // the camera moves, and paths with it (glide.h)
    bool rides;                   // surfaces move in media, and collisions with them (ride.h)
    bool veils_turn;              // what masks and thin glass let through changes as shadow rays turn: those of LIVE_UNEVEN groups
    bool veils;                   // shadow rays end at masks and thin glass, behind which light is met by chance (walk.h)
    const Beacon *beacons;        // null: lights at a point within media are not known beside what moves
    int32_t beacon_count;
    int32_t seen_x, seen_y, seen_width, seen_height; // what of the film is sampled, in pixels (beacon_view.h)
    const int32_t *beacon_of;     // by emitter: its beacon, -1 = none
    int32_t *lamp_medium;         // not null: by emitter, filled with the medium that it lies in, -1 = none, before all else
    const BeamRecord *beams;      // where light ends or jumps in media, if anything moves (shaft.h)
    const StepRecord *beam_steps;
    int32_t beam_count;
    const int32_t *none;          // the offsets of a selection of nothing
    const CornerRecord *corners;  // those of a viewer from corner_at[viewer] to corner_at[viewer + 1]
    const int32_t *corner_at;     // null: there are none
    const PaneSet *panes;         // over which points slide where they move (shape/pane.h); null: there are none
    bool glossy;                  // some surfaces scatter into narrow lobes (glossy.h)
    const int32_t *live;          // per group, and behind these per medium: LIVE_ mask
    bool live_extinctions;        // that of some medium depends on the selection
    bool live_borders;            // so does where some medium begins and ends
    bool live_lights;             // some emitter depends on the selection
    bool watch_turned;            // the selection turns shading normals: note which way they face
    bool watch_inward;            // note normals of maps that point into their surfaces
    bool watch_smooth;            // also those of smooth meshes, whose jumps no boundary term takes into account
    // Asked before each chunk of paths: false ends the job early. May be null.
    bool (*go_on)(void *user);
    void *user;
    // Scratch memory of the worker: rey_kernel_workspace_bytes.
    void *workspace;
    size_t workspace_bytes;
    // Results, added to.
    int64_t paths, rays, nonfinite;
    int64_t borders, astray;      // borders of media that paths met, and those that expected another medium on their side
    int32_t faces;                // FACES_ bits of scene/sink.h
    double trace_seconds;
} PathJob;

// The kernels of every width.
#define KERNEL_ENTRY(lanes)                                                                                            \
    void rey_kernel_run_w##lanes(PathJob *job);                                                                        \
    size_t rey_kernel_workspace_bytes_w##lanes(int32_t mode);
KERNEL_ENTRY(1)
KERNEL_ENTRY(8)
KERNEL_ENTRY(16)
