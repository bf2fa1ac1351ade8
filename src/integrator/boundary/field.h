// field.h: between which points of a surface its textures jump (shape/marks.h).
#pragma once

#include "integrator/boundary/boundary_job.h"
#include "shape/interaction.h"

#define STEP_INT(job, i, field)                                                                                        \
    i_gather((const int32_t *)(job)->steps,                                                                            \
             (i) * (int32_t)(sizeof(StepRecord) / 4) + (int32_t)(offsetof(StepRecord, field) / 4))
#define STEP_FLOAT(job, i, field)                                                                                      \
    f_gather((const float *)(job)->steps,                                                                              \
             (i) * (int32_t)(sizeof(StepRecord) / 4) + (int32_t)(offsetof(StepRecord, field) / 4))

// The number of the field between two lines of a step that a point lies in.
KFN Float step_field(const BoundaryJob *b, Int step, Vec2 uv) {
    Float at = STEP_FLOAT(b, step, u) * uv.x + STEP_FLOAT(b, step, v) * uv.y + STEP_FLOAT(b, step, offset);
    return f_min(f_max(f_floor(at), STEP_FLOAT(b, step, low) - 1.0f), STEP_FLOAT(b, step, high));
}

// Lanes of m in which textures of a shape jump between two of its points; in these, *across is the direction in uv in which a
// line between them is crossed, and *which the step, -1 where uv itself jumps. Two points of a mesh lie in the same triangle.
static Mask fields_part(const SceneView *scene, const BoundaryJob *b, Int shape, Vec2 from, Vec2 to, Mask m, Vec2 *across,
                        Int *which) {
    *across = (Vec2){f_set(1), f_set(0)};
    *which = i_set(-1);
    if (!b->step_at || !m_any(m)) {
        return m_set(false);
    }
    shape = i_select(m, shape, i_set(0));
    Int step = i_gather(b->step_at, shape), end = i_gather(b->step_at, shape + 1), kind = SHAPE_FIELD(scene, shape, kind);
    Mask found = m_set(false), disk = mi_eq(kind, i_set(SHAPE_DISK)), round = m & ~mi_eq(kind, i_set(SHAPE_MESH));
    for (Mask left = m & mi_lt(step, end); m_any(left); step = step + 1, left = left & mi_lt(step, end)) {
        Int at = i_select(left, step, i_set(0));
        Int sort = STEP_INT(b, at, sort);
        Mask line = left & mi_eq(sort, i_set(STEP_LINES)) & ~found & ~m_eq(step_field(b, at, from), step_field(b, at, to));
        across->x = f_select(line, STEP_FLOAT(b, at, u), across->x);
        across->y = f_select(line, STEP_FLOAT(b, at, v), across->y);
        *which = i_select(line, at, *which);
        found = found | line;
        // Where the angle begins anew all of uv changes.
        Float turn = f_abs(f_select(disk, to.y - from.y, to.x - from.x));
        Mask seam = left & round & mi_eq(sort, i_set(STEP_SEAMS)) & m_gt(turn, f_set((real)0.5));
        across->x = f_select(seam, f_select(disk, f_set(0), f_set(1)), across->x);
        across->y = f_select(seam, f_select(disk, f_set(1), f_set(0)), across->y);
        found = found | seam;
    }
    return found;
}
