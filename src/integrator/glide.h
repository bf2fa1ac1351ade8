// glide.h: rays that move because their camera does, in media. Directions after a collision and distances to it stay, so that all
// that follows moves with the point where the camera's ray collides, by o' + s d' at the distance s along it: collisions are fixed
// in space no longer, and next to a vertex nothing moves differently than it does. Along a ray whose point at x moves by v(x), what
// is looked up in a volume f changes by grad f . v, and borders of media are crossed at dx = -n . v / n . d (border.h).
// Where surfaces scatter, or lights at a point lie within media, cameras move as surfaces do (ride.h).
#pragma once

#include "integrator/sweep.h"

// Adjoint of the ray that the sweep is at: of its position at a point of it, and of its direction.
typedef struct Glide {
    Vec3 ref, d;         // the point, and the direction
    Vec3 position, turn;
} Glide;

// Where the adjoints of the slots' rays are kept: from.. unless there is nothing of them yet.
KFN Vec3 glide_reference(const Tracer *t, Int slot, Vec3 from) {
    const Workspace *ws = &t->ws;
    return v3_select(mi_lt(i_set(-1), i_gather(ws->next, slot)), LOAD_V3(*ws, next_px, next_py, next_pz, slot), from);
}

KFN Glide glide_load(const Tracer *t, int channel, Int slot, Vec3 ref, Vec3 d) {
    const Workspace *ws = &t->ws;
    return (Glide){ref, d, rows_gather(&ws->drag, channel, slot), rows_gather(&ws->turn, channel, slot)};
}

KFN void glide_store(const Tracer *t, const Glide *g, int channel, Int slot, Mask m) {
    rows_scatter(&t->ws.drag, channel, slot, g->position, m);
    rows_scatter(&t->ws.turn, channel, slot, g->turn, m);
}

// Notes where the adjoints are kept, of all channels.
KFN void glide_refer(Tracer *t, Int slot, Vec3 ref, Mask m) {
    Workspace *ws = &t->ws;
    i_scatter(ws->next, slot, i_set(0), m);
    f_scatter(ws->next_px, slot, ref.x, m);
    f_scatter(ws->next_py, slot, ref.y, m);
    f_scatter(ws->next_pz, slot, ref.z, m);
}

// Adds the adjoint of a point p of the ray.
KFN void glide_add(Glide *g, Vec3 p, Vec3 dp, Mask m) {
    dp = v3_select(m, dp, v3_zero());
    g->position = v3_add(g->position, dp);
    g->turn = v3_madd(g->turn, v3_dot(v3_sub(p, g->ref), g->d), dp);
}

// The same, given the adjoint d of what a volume is there.
static NOINLINE void glide_look(const SceneView *scene, Glide *g, const VolumeNode *v, Vec3 p, Spec d, Mask m) {
    if (v->kind == VOLUME_GRID) {
        glide_add(g, p, volume_slope(scene, v, p, spec_zero_unless(m, d)), m);
    }
}

// Forgets the rays of the chunk before.
KFN void glides_forget(Tracer *t) {
    const size_t bytes = CHUNK * sizeof(real);
    memset(t->ws.next, 0xff, CHUNK * sizeof *t->ws.next);
    const ChannelRows *rows[] = {&t->ws.drag, &t->ws.turn};
    for (int i = 0; i < 2; i++) {
        for (int c = 0; c < drives(t); c++) {
            memset(rows[i]->x[c], 0, bytes);
            memset(rows[i]->y[c], 0, bytes);
            memset(rows[i]->z[c], 0, bytes);
        }
    }
}
