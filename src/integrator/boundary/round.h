// round.h: points of the ends and outlines of round shapes. Those of shapegroups are found in the group's own space: what touches
// a surface there touches it in the world.
#pragma once

#include "integrator/boundary/edge_point.h"

// The end of a cylinder, or the rim of a disk: the unit circle at z = end through the pose.
static void edge_of_rim(const SceneView *scene, const BoundaryJob *b, Int e, Float t, Mask m, EdgePoint *out) {
    Int shape = i_select(m, out->hit.shape, i_set(i_lane(out->hit.shape, m_first(m))));
    Int at = SHAPE_FIELD(scene, shape, table);
    Float sine, cosine, end = f_select(mi_lt(i_set(0), EDGE_FIELD(b, e, corner)), f_set(1), f_set(0));
    f_sincos(TWO_PI * t, &sine, &cosine);
    Vec3 x = pose_column(scene, at, 0), y = pose_column(scene, at, 1);
    Vec3 p = pose_to_world(scene, at, v3(cosine, sine, end));
    Vec3 tangent = v3_scale(v3_madd(v3_scale(x, -sine), cosine, y), f_set(TWO_PI));
    out->p = v3_select(m, p, out->p);
    out->tangent = v3_select(m, tangent, out->tangent);
    // Into the surface: a disk's centre, along a cylinder.
    Vec3 inwards = v3_neg(v3_madd(v3_scale(x, cosine), sine, y)), axis = pose_column(scene, at, 2);
    Mask disk = mi_eq(SHAPE_FIELD(scene, shape, kind), i_set(SHAPE_DISK));
    inwards = v3_select(disk, inwards, v3_scale(axis, f_select(m_gt(end, f_set(0)), f_set(-1), f_set(1))));
    out->side[0] = v3_select(m, inwards, out->side[0]);
}

// The outline of a sphere, seen from `eye`, or along the direction `eye` where the view is parallel.
static void edge_of_outline(const SceneView *scene, Float t, Vec3 eye, bool parallel, Mask m, EdgePoint *out) {
    Int shape = i_select(m, out->hit.shape, i_set(i_lane(out->hit.shape, m_first(m))));
    Int at = SHAPE_FIELD(scene, shape, table);
    Vec3 centre = table_v3(scene, at), away = parallel ? v3_neg(eye) : v3_sub(eye, centre);
    Float radius = table_at(scene, at + 3), distance = v3_length(away), sine, cosine;
    Frame frame = frame_from_normal(v3_scale(away, f_safe_rcp(distance)));
    Float near = parallel ? f_set(0) : radius * f_safe_rcp(distance); // cosine of the angle of the cone to the axis
    Float wide = radius * f_safe_sqrt(1.0f - near * near);
    f_sincos(TWO_PI * t, &sine, &cosine);
    Vec3 local = v3(wide * cosine, wide * sine, radius * near);
    Vec3 tangent = frame_to_world(&frame, v3(wide * sine * -TWO_PI, wide * cosine * TWO_PI, f_set(0)));
    out->middle = v3_select(m, centre, out->middle);
    m = m & m_lt(near, f_set(1));
    Vec3 outwards = frame_to_world(&frame, local);
    out->p = v3_select(m, v3_add(centre, outwards), out->p);
    out->tangent = v3_select(m, tangent, out->tangent);
    out->side[0] = v3_select(m, v3_neg(outwards), out->side[0]);
    Vec3 view = v3_normalize(v3_sub(away, parallel ? v3_zero() : outwards));
    Vec3 turned = v3_normalize(v3_madd(outwards, OUTLINE_TURN * radius, view));
    out->inner = v3_select(m, v3_madd(centre, radius, turned), out->inner);
}

// A side of a cylinder, seen from `eye` or along it: the line at the angle at which the view touches the unit circle.
static void edge_of_side(const SceneView *scene, const BoundaryJob *b, Int e, Float t, Vec3 eye, bool parallel, Mask m,
                         EdgePoint *out) {
    Int shape = i_select(m, out->hit.shape, i_set(i_lane(out->hit.shape, m_first(m))));
    Int at = SHAPE_FIELD(scene, shape, table);
    Vec3 rows[2] = {table_v3(scene, at + 12), table_v3(scene, at + 16)};
    Float x = v3_dot(rows[0], eye), y = v3_dot(rows[1], eye), near = f_set(0);
    if (!parallel) {
        x = x + table_at(scene, at + 15);
        y = y + table_at(scene, at + 19);
        near = f_safe_rcp(f_sqrt(x * x + y * y));
    }
    out->middle = v3_select(m, pose_to_world(scene, at, v3(f_set(0), f_set(0), f_set((real)0.5))), out->middle);
    m = m & m_lt(near, f_set(1));
    // The point turned from the direction (x, y) by +- acos(near).
    Float r = f_safe_rcp(f_sqrt(x * x + y * y)), wide = f_safe_sqrt(1.0f - near * near);
    wide = f_select(mi_lt(i_set(0), EDGE_FIELD(b, e, corner)), wide, -wide);
    Float cx = (x * near - y * wide) * r, cy = (y * near + x * wide) * r;
    out->p = v3_select(m, pose_to_world(scene, at, v3(cx, cy, t)), out->p);
    out->tangent = v3_select(m, pose_column(scene, at, 2), out->tangent);
    Vec3 outwards = v3_madd(v3_scale(pose_column(scene, at, 0), cx), cy, pose_column(scene, at, 1));
    out->side[0] = v3_select(m, v3_neg(outwards), out->side[0]);
    // Turned to the middle of what the eye sees: (x, y), which parallel views look along.
    Float turn = (parallel ? -OUTLINE_TURN : OUTLINE_TURN) * r, nx = cx + turn * x, ny = cy + turn * y;
    Float unit = f_safe_rcp(f_sqrt(nx * nx + ny * ny));
    out->inner = v3_select(m, pose_to_world(scene, at, v3(nx * unit, ny * unit, t)), out->inner);
}

// Position t of a tube's segment, of one of them in the lanes that are not in m.
static Hit tube_hit(const BoundaryJob *b, Int e, Float t, Mask m, const EdgePoint *out) {
    Int shape = i_select(m, out->hit.shape, i_set(i_lane(out->hit.shape, m_first(m))));
    return (Hit){shape, i_select(m, EDGE_FIELD(b, e, prim), i_set(0)), t, f_set(0), v3_zero(), i_set(0)};
}

// A side of a tube, seen from `eye` or along it: at position t of the segment, the point at the angle at which the normal n, along
// stretch e - r' tangent, is at right angles to the view: stretch (e . a - r) = r' tangent . a, a from the axis to the eye, and
// without the r where the view is parallel. `stretch` changes little with e: Newton's steps from where it would not.
static void edge_of_tube(const SceneView *scene, const BoundaryJob *b, Int e, Float t, Vec3 eye, bool parallel, Mask m,
                         EdgePoint *out) {
    Hit hit = tube_hit(b, e, t, m, out);
    CurvePoint c = bspline_point(scene, &hit);
    Float speed = v3_length(c.c1), rcp = f_safe_rcp(speed), round = parallel ? f_set(0) : c.r;
    Frame frame = frame_from_normal(v3_scale(c.c1, rcp));
    Vec3 a = frame_to_local(&frame, parallel ? v3_neg(eye) : v3_sub(eye, c.c)), bend = frame_to_local(&frame, c.c2);
    Float far = f_sqrt(a.x * a.x + a.y * a.y), first = f_atan2(a.y, a.x), sine, cosine;
    Float near = (round + c.r1 * a.z * rcp) * f_safe_rcp(far);
    Float side = f_select(mi_lt(i_set(0), EDGE_FIELD(b, e, corner)), f_set(1), f_set(-1));
    Float angle = first + side * f_acos(f_clamp(near, f_set(-1), f_set(1)));
    for (int i = 0; i < 3; i++) {
        f_sincos(angle, &sine, &cosine);
        Float stretch = speed - c.r * rcp * (bend.x * cosine + bend.y * sine);
        Float dstretch = c.r * rcp * (bend.x * sine - bend.y * cosine);
        Float towards = a.x * cosine + a.y * sine - round, turn = a.y * cosine - a.x * sine;
        Float slope = stretch * turn + dstretch * towards;
        angle = angle - f_clamp((stretch * towards - c.r1 * a.z) * f_safe_rcp(slope), f_set((real)-0.1), f_set((real)0.1));
    }
    out->middle = v3_select(m, c.c, out->middle);
    m = m & m_lt(f_abs(near), f_set(1));
    f_sincos(angle, &sine, &cosine);
    hit.p = v3_madd(c.c, c.r, frame_to_world(&frame, v3(cosine, sine, f_set(0))));
    // Along the outline n . view stays 0, as both ways of sliding over the surface change it.
    Slide slide[2];
    Interaction si = bspline_interaction(scene, 0, &hit);
    bspline_slide(scene, 0, &hit, &si, slide);
    Vec3 view = parallel ? v3_neg(eye) : v3_sub(eye, si.p);
    Float around = v3_dot(slide[0].ng, view), along = v3_dot(slide[1].ng, view);
    Vec3 tangent = v3_madd(slide[1].p, -along * f_safe_rcp(around), slide[0].p);
    Float segments = f_from_i(SHAPE_FIELD(scene, hit.shape, segment_count));
    m = m & m_gt(f_abs(around), f_set(0));
    // Where the surface is hollow along the view, rays touch it from within, on the other side of what they meet: the sensor sees
    // it through an open end, and other vertices do not.
    Float a11 = v3_dot(slide[0].p, slide[0].p), a12 = v3_dot(slide[0].p, slide[1].p), a22 = v3_dot(slide[1].p, slide[1].p);
    Float b1 = v3_dot(slide[0].p, view), b2 = v3_dot(slide[1].p, view), det = f_safe_rcp(a11 * a22 - a12 * a12);
    Vec3 turn = v3_madd(v3_scale(slide[0].ng, (b1 * a22 - b2 * a12) * det), (b2 * a11 - b1 * a12) * det, slide[1].ng);
    Mask hollow = m & m_lt(v3_dot(turn, view), f_set(0));
    out->outside = v3_select(hollow, view, out->outside);
    out->hit.prim = i_select(m, hit.prim, out->hit.prim);
    out->hit.u = f_select(m, t, out->hit.u);
    out->p = v3_select(m, si.p, out->p);
    out->tangent = v3_select(m, v3_scale(tangent, f_safe_rcp(segments)), out->tangent);
    out->side[0] = v3_select(m, v3_scale(si.ng, f_select(hollow, c.r, -c.r)), out->side[0]);
    f_sincos(angle - side * OUTLINE_TURN, &sine, &cosine);
    out->inner = v3_select(m, v3_madd(c.c, c.r, frame_to_world(&frame, v3(cosine, sine, f_set(0)))), out->inner);
}

// The circle at an end of a tube.
static void edge_of_tube_end(const SceneView *scene, const BoundaryJob *b, Int e, Float t, Mask m, EdgePoint *out) {
    Float end = f_select(mi_lt(i_set(0), EDGE_FIELD(b, e, corner)), f_set(1), f_set(0)), sine, cosine;
    Hit hit = tube_hit(b, e, end, m, out);
    CurvePoint c = bspline_point(scene, &hit);
    Frame frame = frame_from_normal(v3_normalize(c.c1));
    f_sincos(TWO_PI * t, &sine, &cosine);
    hit.p = v3_madd(c.c, c.r, frame_to_world(&frame, v3(cosine, sine, f_set(0))));
    Interaction si = bspline_interaction(scene, 0, &hit);
    out->outside = v3_select(m, si.ng, out->outside);
    out->hit.prim = i_select(m, hit.prim, out->hit.prim);
    out->hit.u = f_select(m, end, out->hit.u);
    out->p = v3_select(m, hit.p, out->p);
    out->tangent = v3_select(m, v3_scale(frame_to_world(&frame, v3(-sine, cosine, f_set(0))), TWO_PI * c.r), out->tangent);
    out->side[0] = v3_select(m, v3_scale(si.dp_dv, f_select(m_gt(end, f_set(0)), f_set(-1), f_set(1))), out->side[0]);
}

static void edge_of_round(const SceneView *scene, const BoundaryJob *b, Int e, Int kind, Float t, Vec3 eye, bool parallel,
                          EdgePoint *out) {
    Mask rim = mi_eq(kind, i_set(EDGE_RIM)), outline = mi_eq(kind, i_set(EDGE_OUTLINE)), side = mi_eq(kind, i_set(EDGE_SIDE));
    Mask tube = mi_eq(kind, i_set(EDGE_TUBE)), tube_end = mi_eq(kind, i_set(EDGE_TUBE_END));
    Mask all = rim | outline | side | tube | tube_end;
    out->round = outline | side | tube;
    if (!m_any(all)) {
        return;
    }
    Int shape = i_select(all, out->hit.shape, i_set(i_lane(out->hit.shape, m_first(all)))), at = i_set(0);
    Mask inside = all & mi_lt(i_set(-1), SHAPE_FIELD(scene, shape, collection));
    if (m_any(inside)) {
        Hit hit = out->hit;
        hit.instance = i_select(inside, hit.instance, i_set(0));
        at = instance_table(scene, &hit);
        eye = v3_select(inside, parallel ? pose_direction_to_local(scene, at, eye) : pose_to_local(scene, at, eye), eye);
    }
    if (m_any(rim)) {
        edge_of_rim(scene, b, e, t, rim, out);
    }
    if (m_any(outline)) {
        edge_of_outline(scene, t, eye, parallel, outline, out);
    }
    if (m_any(side)) {
        edge_of_side(scene, b, e, t, eye, parallel, side, out);
    }
    if (m_any(tube)) {
        edge_of_tube(scene, b, e, t, eye, parallel, tube, out);
    }
    if (m_any(tube_end)) {
        edge_of_tube_end(scene, b, e, t, tube_end, out);
    }
    if (m_any(inside)) {
        out->p = v3_select(inside, pose_to_world(scene, at, out->p), out->p);
        out->inner = v3_select(inside, pose_to_world(scene, at, out->inner), out->inner);
        out->middle = v3_select(inside, pose_to_world(scene, at, out->middle), out->middle);
        Mask one_sided = inside & m_gt(v3_dot(out->outside, out->outside), f_set(0));
        out->outside = v3_select(one_sided, pose_normal(scene, at, out->outside), out->outside);
        out->tangent = v3_select(inside, instance_vector(scene, at, out->tangent), out->tangent);
        out->side[0] = v3_select(inside, instance_vector(scene, at, out->side[0]), out->side[0]);
    }
}
