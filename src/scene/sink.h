// sink.h: the one door through which derivatives leave a kernel. A reverse sink scatters into the gradient of the
// selected parameters; a forward sink contracts with their tangent into one number per lane. Both vectors are compact:
// a table says where the values of each texture (or the normals of each shape) begin, -1 = not asked for.
#pragma once

#include "math/vec.h"
#include "scene/scene.h"

// Which way shading normals that depend on the selection were met: as the surface faces, or the other way round.
enum { FACES_ALIKE = 1, FACES_AWAY = 2, FACES_BOTH = 3 };
// Beside these: a light at a point that moves was met within a medium.
// The camera saw something smooth mirror or refract while something moves. And a map's normal pointed into its surface.
// The sensor looked past a hidden light within a medium, which is lit before the light and not behind it.
enum { LIGHT_WITHIN = 4, CAMERA_MIRRORED = 8, FACES_INWARD = 16, LIGHT_HIDDEN = 32 };

typedef struct Sink {
    double *gradient;          // reverse, else null
    const float *tangent;      // forward, else null
    const int32_t *texture_at; // per texture
    const int32_t *to_uv_at;   // per texture: its to_uv
    const int32_t *normals_at; // per shape: its vertex normals
    const int32_t *attribute_at; // like view.attributes: every second entry
    const int32_t *place_at;   // per emitter and slot: position or pose
    const int32_t *points_at;   // per shape: its vertex positions
    const int32_t *pose_at;     // per shape: its to_world
    const int32_t *instance_at; // per instance: its to_world
    const int32_t *camera_at;   // CAMERA_ numbers, of batches those of each part
    const int32_t *volume_at;   // per volume: its to_world
    const struct PaneSet *panes; // over which points slide (shape/pane.h); null = there are none
    bool any_volumes;
    bool any_normals, any_attributes, any_places;
    bool any_motion, any_camera; // surfaces or the sensor move; the sensor does
    bool any_sky;      // the density of the environment is asked for, which depends on
    int32_t sky_at;    // the logarithm of the sum of its table: kept here (emitter/envmap.h)
    Vec2 *at;          // gathers the adjoint of the barycentrics at which attributes are read; null = not asked for
    Vec3 *point;       // the same of the points of the world at which textures read volumes
    bool watch_turned, watch_inward; // see PathJob
    int32_t faces;     // FACES_ bits
    Float derivative;          // forward: accumulates
} Sink;

// Forward mode: takes what was accumulated.
KFN Float sink_taken(Sink *s) {
    Float d = s->derivative;
    s->derivative = f_set(0);
    return d;
}

// The same entry for all lanes of m.
KFN void sink_add_uniform(Sink *s, int32_t at, Float d, Mask m) {
    if (s->gradient) {
        s->gradient[at] += f_sum(d, m);
    } else {
        s->derivative = s->derivative + f_zero_unless(m, d) * s->tangent[at];
    }
}

// One entry per lane; `at` must be valid in every lane.
KFN void sink_add(Sink *s, Int at, Float d, Mask m) {
    if (s->gradient) {
        f_scatter_add_double(s->gradient, at, d, m);
    } else {
#ifdef REAL_DOUBLE
        s->derivative += f_zero_unless(m, d) * (Float)s->tangent[at];
#else
        s->derivative = s->derivative + f_zero_unless(m, d) * f_gather(s->tangent, at);
#endif
    }
}

// sink_add of the three entries from `at` on.
KFN void sink_add3(Sink *s, Int at, const Float d[3], Mask m) {
    if (s->gradient) {
        f_scatter_add_double3(s->gradient, at, d, m);
    } else {
        for (int k = 0; k < 3; k++) {
            sink_add(s, at + k, d[k], m);
        }
    }
}
KFN void sink_add_v3(Sink *s, Int at, Vec3 d, Mask m) {
    const Float each[3] = {d.x, d.y, d.z};
    sink_add3(s, at, each, m);
}
KFN void sink_add_spec(Sink *s, Int at, Spec d, Mask m) {
    static_assert(SPEC_N == 3, "a colour is three numbers in a row");
    sink_add3(s, at, d.c, m);
}
