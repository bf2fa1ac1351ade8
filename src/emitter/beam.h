// beam.h: the borders in the air at which the light of spots and projectors ends abruptly or jumps (render/light_borders.h): planes
// and cones through the light.
#pragma once

#include "emitter/emitter.h"
#include "scene/sink.h"
#include "shape/marks.h"

// The extent of a light's picture along x and y, by which (u, v) = 1/2 - (x, y) / (2 z extent) of points of the light's space.
KFN void beam_extent(const SceneView *scene, const Light *l, Float extent[2]) {
    if (l->e->kind == EMITTER_SPOT) {
        extent[0] = extent[1] = -spot_beam(scene, l, texcoord((Vec2){f_set(0), f_set(0)}, NULL)).tangent;
        return;
    }
    extent[0] = light_table(scene, l, PROJECTOR_EXTENT);
    extent[1] = light_table(scene, l, PROJECTOR_EXTENT + 1);
}

// The normal, in the light's space, of the plane in which line `level` of a step of its picture lies; the step grows along it.
KFN Vec3 beam_plane(const StepRecord *s, const Float extent[2], Float level) {
    const Float u = f_set((real)s->u), v = f_set((real)s->v);
    return v3(-0.5f * u / extent[0], -0.5f * v / extent[1], 0.5f * (u + v) + (real)s->offset - level);
}

// Adds the adjoint dp of points p of the borders of lights, which move with their poses and projectors' fields of view: p = A q,
// where q moves with the extent of the picture across the axis.
static void borders_move_adj(const SceneView *scene, Int light, Vec3 p, Vec3 dp, Sink *sink, Mask m) {
    static const int kinds[2][2] = {{EMITTER_SPOT, SLOT(Spot, to_world)}, {EMITTER_PROJECTOR, SLOT(Projector, to_world)}};
    Float rows[3] = {dp.x, dp.y, dp.z};
    for (int i = 0; i < 2; i++) {
        Mask mine = m & mi_eq(EMITTER_FIELD(scene, i_select(m, light, i_set(0)), kind), i_set(kinds[i][0]));
        if (!m_any(mine)) {
            continue;
        }
        Light of = {scene->emitters, i_select(mine, light, i_set(i_lane(light, m_first(mine)))), true};
        Vec3 q = light_to_local(scene, &of, p);
        for (int k = 0; k < 3; k++) {
            light_place_adj(&of, kinds[i][1], 4 * k, rows[k] * q.x, sink, mine);
            light_place_adj(&of, kinds[i][1], 4 * k + 1, rows[k] * q.y, sink, mine);
            light_place_adj(&of, kinds[i][1], 4 * k + 2, rows[k] * q.z, sink, mine);
            light_place_adj(&of, kinds[i][1], 4 * k + 3, rows[k], sink, mine);
        }
        if (kinds[i][0] == EMITTER_PROJECTOR) {
            Vec3 across = v3_madd(v3_scale(light_pose_column(scene, &of, kinds[i][1], 0), q.x), q.y,
                                  light_pose_column(scene, &of, kinds[i][1], 1));
            projector_extent_adj(scene, &of, v3_dot(dp, across) / light_table(scene, &of, PROJECTOR_EXTENT), sink, mine);
        }
    }
}
