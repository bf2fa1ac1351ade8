// move.h: dispatch over the kinds of surface that move: how an interaction slides along its surface, and the adjoint of an
// interaction that is attached to its surface in vertices, normals, poses of shapes and of instances.
// NOT differentiated: the control points of polylines and the distances of grids.
#pragma once

#include "shape/curve_move.h"
#include "shape/mesh_move.h"
#include "shape/pane.h"
#include "shape/posed_move.h"
#include "shape/sdfgrid_move.h"
#include "shape/shape.h"

KFN void surface_slide(const SceneView *scene, int32_t kind, int32_t flags, const Hit *hit, const Interaction *si,
                       Slide out[2]) {
    switch (kind) {
    case SHAPE_MESH:
        mesh_slide(scene, flags, hit, si, out);
        break;
    case SHAPE_SPHERE:
        sphere_slide(scene, flags, hit, si, out);
        break;
    case SHAPE_DISK:
        disk_slide(scene, flags, hit, si, out);
        break;
    case SHAPE_CYLINDER:
        cylinder_slide(scene, flags, hit, si, out);
        break;
    case SHAPE_BSPLINE:
        bspline_slide(scene, flags, hit, si, out);
        break;
    case SHAPE_LINEAR:
        linear_slide(scene, flags, hit, si, out);
        break;
    default:
        sdfgrid_slide(scene, flags, hit, si, out);
        break;
    }
}

KFN void shape_slide(const SceneView *scene, int32_t kind, int32_t flags, const Hit *hit, const Interaction *si,
                     Slide out[2]) {
    if (!(flags & SHAPE_INSTANCED)) {
        surface_slide(scene, kind, flags, hit, si, out);
        return;
    }
    Hit local = instance_hit(scene, hit);
    Interaction own = surface_interaction(scene, kind, flags, &local);
    surface_slide(scene, kind, flags, &local, &own, out);
    out[0] = instance_slide(scene, hit, &own, out);
    out[1] = instance_slide(scene, hit, &own, out + 1);
}

KFN void surface_move_adj(const SceneView *scene, int32_t kind, int32_t flags, const Hit *hit, const Interaction *si,
                          const SurfaceAdj *d, Sink *sink, Mask m) {
    SurfaceAdj kept;
    switch (kind) {
    case SHAPE_MESH:
        if (sink->panes) {
            kept = pane_adj(sink->panes, hit, si, d);
            d = &kept;
        }
        mesh_move_adj(scene, flags, hit, si, d, sink, m);
        break;
    case SHAPE_SPHERE:
        sphere_move_adj(scene, flags, hit, si, d, sink, m);
        break;
    case SHAPE_DISK:
        disk_move_adj(scene, flags, hit, si, d, sink, m);
        break;
    case SHAPE_CYLINDER:
        cylinder_move_adj(scene, flags, hit, si, d, sink, m);
        break;
    case SHAPE_BSPLINE:
        bspline_move_adj(scene, flags, hit, si, d, sink, m);
        break;
    case SHAPE_SDFGRID:
        sdfgrid_move_adj(scene, flags, hit, si, d, sink, m);
        break;
    default:
        break;
    }
}

// Accumulates the adjoint d of shape_interaction at an attached point into what is asked for.
static NOINLINE void shape_move_adj(const SceneView *scene, int32_t kind, int32_t flags, const Hit *hit,
                                    const Interaction *si, const SurfaceAdj *d, Sink *sink, Mask m) {
    if (!(flags & SHAPE_INSTANCED)) {
        surface_move_adj(scene, kind, flags, hit, si, d, sink, m);
        return;
    }
    Int at = i_gather(sink->instance_at, hit->instance);
    Int pose = i_gather((const int32_t *)scene->instances, hit->instance * (int32_t)(sizeof(InstanceRecord) / 4) +
                                                               (int32_t)(offsetof(InstanceRecord, to_world) / 4));
    if (m_any(m & mi_lt(i_set(-1), at))) {
        pose_move_adj(scene, pose, at, si, d, sink, m);
    }
    Hit local = instance_hit(scene, hit);
    Interaction own = surface_interaction(scene, kind, flags, &local);
    SurfaceAdj down = instance_local_adj(scene, hit, &own, d);
    surface_move_adj(scene, kind, flags, &local, &own, &down, sink, m);
}
