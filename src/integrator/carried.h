// carried.h: what rays carry back to where they come from, and the sensor's part in it.
#pragma once

#include "integrator/sweep.h"

// What the ray that found a vertex carries back: the adjoints of its position there, and of its direction.
typedef struct Carried {
    Vec3 drag, turn;
} Carried;

// The sensor's part in the adjoints of the rays that it sent out.
static void camera_move_adj(const Tracer *t, Int slot, Vec3 target, const Carried *carried, Sink *sink, Mask m) {
    SampleKey key = slot_key(t, slot);
    RayAdj ray = {target, carried->drag, carried->turn};
    sensor_ray_adj(t->scene, t->sensor, real_gather(t->ws.film_x, slot), real_gather(t->ws.film_y, slot), sample_lens(t, &key),
                   &ray, sink, m);
}

// Keeps points of rays that are attached to nothing (path_move.h).
KFN void next_point(const Tracer *t, Int slot, Vec3 p, Mask m) {
    const Workspace *ws = &t->ws;
    i_scatter(ws->next, slot, i_set(NEXT_POINT), m);
    f_scatter(ws->next_px, slot, p.x, m);
    f_scatter(ws->next_py, slot, p.y, m);
    f_scatter(ws->next_pz, slot, p.z, m);
}

// The lanes of a batch's records that lie on the sensor's ray, or at its end, where surfaces move in media.
KFN Mask records_first(const Tracer *t, const RecordBatch *batch, Mask m) {
    return m & records_seen(t, batch->first);
}

// What they ask of the sensor: the adjoint c of the ray's position at p, and of its direction.
static NOINLINE void first_ride_adj(const Tracer *t, const RecordBatch *batch, Int slot, Vec3 p, const Carried *c, Sink *sink,
                                    Mask m) {
    m = m & m_finite(v3_dot(c->drag, c->drag) + v3_dot(c->turn, c->turn));
    if (sink->any_camera) {
        camera_move_adj(t, slot, p, c, sink, records_first(t, batch, m));
    }
}
