// within.h: which media lights at a point lie in. The host asks before it differentiates (render/beacons.h).
#pragma once

#include "integrator/border.h"
#include "integrator/lamps.h"

// -1: in none, or where there is nothing of it, and of other lights.
static void lights_within(const Tracer *t, int32_t *within) {
    const SceneView *scene = t->scene;
    for (int64_t i = 0; i < scene->emitters_count; i++) {
        int32_t at[3];
        within[i] = -1;
        if (scene->has_media && emitter_place(scene->emitters + i, at)) {
            Vec3 o = v3(f_set((real)scene->theta[at[0]]), f_set((real)scene->theta[at[1]]), f_set((real)scene->theta[at[2]]));
            int32_t id = i_lane(medium_around(t, o, lamp_way(), m_first_n(1)), 0);
            bool filled = id >= 0 && f_lane(spec_max(medium_filling(t, id, o, lamp_way()).extinction), 0) > 0;
            within[i] = filled ? id : -1;
        }
    }
}
