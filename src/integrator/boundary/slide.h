// slide.h: near points of segments that the sensor sees: at fixed film positions they slide over their surfaces.
#pragma once

#include "integrator/boundary/glimpse.h"

// Where on its lens the sensor sees the near points of segments from.
KFN Vec2 near_lens(const Indirect *in, Int slot) {
    SampleKey key = slot_key(in->t, slot);
    key.scramble = in->b->job.scramble;
    return sample_lens(in->t, &key);
}

// Adds the adjoint `worth` of points that slide over their surfaces because the sensor sees them at fixed film positions.
static void surfaces_slide_adj(const Indirect *in, const Hit *hit, const SurfaceAdj *worth, Vec2 lens, Sink *sink, Mask m) {
    const Tracer *t = in->t;
    const SceneView *scene = t->scene;
    View view = view_make(scene, in->pinhole, t->sensor, lens);
    for (Mask left = m; m_any(left);) {
        int32_t id;
        Hit h;
        Mask mine = take_group(scene, hit, &left, &id, &h);
        const Group *group = scene->groups + id;
        bool moves = t->job->live[id] & LIVE_MOTION;
        if (!moves && !sink->any_camera) {
            continue;
        }
        Interaction si = shape_interaction(scene, group->shape_kind, group->shape_flags, &h);
        Seen seen = view_see(&view, si.p);
        Slide slide[2];
        SurfaceAdj d = *worth;
        shape_slide(scene, group->shape_kind, group->shape_flags, &h, &si, slide);
        Vec3 position = slide_adj(slide, seen.d, &d);
        if (moves) {
            d.p = v3_sub(d.p, position);
            shape_move_adj(scene, group->shape_kind, group->shape_flags, &h, &si, &d, sink, mine);
        }
        if (sink->any_camera) {
            RayAdj ray = {si.p, position, v3_zero()};
            sensor_ray_adj(scene, t->sensor, seen.x, seen.y, view.lens, &ray, sink, mine);
        }
    }
}

// Of their positions.
static void points_slide_adj(const Indirect *in, const Hit *hit, Vec3 dp, Vec2 lens, Sink *sink, Mask m) {
    SurfaceAdj d = surface_adj_zero();
    d.p = dp;
    surfaces_slide_adj(in, hit, &d, lens, sink, m);
}

// Of collisions that the sensor sees at fixed film positions and distances.
static void collisions_slide_adj(const Indirect *in, Vec3 p, Vec3 dp, Vec2 lens, Sink *sink, Mask m) {
    if (sink->any_camera && m_any(m)) {
        View view = view_make(in->t->scene, in->pinhole, in->t->sensor, lens);
        Seen seen = view_see(&view, p);
        RayAdj ray = {p, dp, v3_zero()};
        sensor_ray_adj(in->t->scene, in->t->sensor, seen.x, seen.y, view.lens, &ray, sink, m & seen.valid);
    }
}

