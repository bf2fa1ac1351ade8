// posed_move.h: shapes of one surface that move with their pose: spheres, disks, cylinders. They slide along dp_du and
// dp_dv.
#pragma once

#include "shape/cylinder.h"
#include "shape/disk.h"
#include "shape/motion.h"
#include "shape/sphere.h"

// Shapes whose points are A q + t with a fixed q.
KFN void affine_move_adj(const SceneView *scene, const Hit *hit, const Interaction *si, const SurfaceAdj *d, Sink *sink,
                         Mask m) {
    Int at = i_gather(sink->pose_at, hit->shape);
    pose_move_adj(scene, SHAPE_FIELD(scene, hit->shape, to_world), at, si, d, sink, m);
}

// ---- disks: p = o + r (cos phi x + sin phi y), uv = (r, phi / 2 pi) ----------------------------------------------

static NOINLINE void disk_slide(const SceneView *scene, int32_t flags, const Hit *hit, const Interaction *si, Slide out[2]) {
    Int pose = SHAPE_FIELD(scene, hit->shape, to_world);
    UNUSED(flags);
    out[0] = slide_along(si->dp_du, f_set(1), f_set(0));
    out[1] = slide_along(si->dp_dv, f_set(0), f_set(1));
    out[0].dp_dv = out[1].dp_du = v3_scale(si->dp_dv, f_safe_rcp(si->uv.x));
    out[1].dp_dv = v3_scale(v3_sub(si->p, pose_theta_column(scene, pose, 3)), f_set(-TWO_PI * TWO_PI));
}

static NOINLINE void disk_move_adj(const SceneView *scene, int32_t flags, const Hit *hit, const Interaction *si,
                                   const SurfaceAdj *d, Sink *sink, Mask m) {
    UNUSED(flags);
    affine_move_adj(scene, hit, si, d, sink, m);
}

// ---- cylinders: p = o + cos phi x + sin phi y + v z, uv = (phi / 2 pi, v) ----------------------------------------

static NOINLINE void cylinder_slide(const SceneView *scene, int32_t flags, const Hit *hit, const Interaction *si, Slide out[2]) {
    Int pose = SHAPE_FIELD(scene, hit->shape, to_world), at = SHAPE_FIELD(scene, hit->shape, table);
    Float sine, cosine;
    f_sincos(TWO_PI * si->uv.x, &sine, &cosine);
    out[0] = slide_along(si->dp_du, f_set(1), f_set(0));
    out[1] = slide_along(si->dp_dv, f_set(0), f_set(1));
    // n = normalize(cos phi a + sin phi b) with the first rows a, b of the inverse
    Vec3 a = table_v3(scene, at + 12), b = table_v3(scene, at + 16);
    Vec3 dn = slide_normalized(v3_madd(v3_scale(a, cosine), sine, b), v3_madd(v3_scale(b, cosine), -sine, a));
    out[0].n = out[0].ng = v3_scale(dn, f_set(flags & SHAPE_FLIP_NORMALS ? -TWO_PI : TWO_PI));
    Vec3 x = pose_theta_column(scene, pose, 0), y = pose_theta_column(scene, pose, 1);
    out[0].dp_du = v3_scale(v3_madd(v3_scale(x, cosine), sine, y), f_set(-TWO_PI * TWO_PI));
}

static NOINLINE void cylinder_move_adj(const SceneView *scene, int32_t flags, const Hit *hit, const Interaction *si,
                                       const SurfaceAdj *d, Sink *sink, Mask m) {
    UNUSED(flags);
    affine_move_adj(scene, hit, si, d, sink, m);
}

// ---- spheres: p = c + r n, uv = (phi / 2 pi, theta / pi) ---------------------------------------------------------

static NOINLINE void sphere_slide(const SceneView *scene, int32_t flags, const Hit *hit, const Interaction *si, Slide out[2]) {
    Int at = SHAPE_FIELD(scene, hit->shape, table);
    Vec3 away = v3_sub(si->p, table_v3(scene, at)), pole = table_v3(scene, at + 10);
    Float radius = table_at(scene, at + 3), rcp = f_safe_rcp(radius);
    Float sign = f_set(flags & SHAPE_FLIP_NORMALS ? -1 : 1);
    out[0] = slide_along(si->dp_du, f_set(1), f_set(0));
    out[1] = slide_along(si->dp_dv, f_set(0), f_set(1));
    for (int k = 0; k < 2; k++) {
        out[k].n = out[k].ng = v3_scale(out[k].p, sign * rcp);
    }
    // p_uu = -4 pi^2 (p - c without its part along the axis), p_uv = pi cot theta p_u, p_vv = -pi^2 (p - c)
    Float z = v3_dot(away, pole);
    Vec3 ring = v3_madd(away, -z, pole);
    out[0].dp_du = v3_scale(ring, f_set(-TWO_PI * TWO_PI));
    out[0].dp_dv = out[1].dp_du = v3_scale(si->dp_du, PI * z * f_safe_rcp(v3_length(ring)));
    out[1].dp_dv = v3_scale(away, f_set(-PI * PI));
}

// Attached points keep their place on the sphere, p = t + r (x e_1 + y e_2 + z e_3): they, their normals and tangents turn with the
// axes, which are the columns a_1, a_2, a_3 of the pose made orthonormal one after the other, and grow with r = |a_1|. With w the
// turn,
//   w . (e_1 x e_2) = e_2 . da_1 / r,   w . (e_1 x e_3) = e_3 . da_1 / r,
//   w . (e_2 x e_3) = e_3 . (da_2 - da_1 (e_1 . a_2) / r) / s,   s = e_2 . a_2.
static NOINLINE void sphere_move_adj(const SceneView *scene, int32_t flags, const Hit *hit, const Interaction *si,
                                     const SurfaceAdj *d, Sink *sink, Mask m) {
    Int at = SHAPE_FIELD(scene, hit->shape, table), pose = SHAPE_FIELD(scene, hit->shape, to_world);
    Float radius = table_at(scene, at + 3), rcp = f_safe_rcp(radius), sign = f_set(flags & SHAPE_FLIP_NORMALS ? -1 : 1);
    Vec3 n = v3_scale(si->ng, sign), e1 = table_v3(scene, at + 4), e2 = table_v3(scene, at + 7), e3 = table_v3(scene, at + 10);
    Vec3 second = pose_theta_column(scene, pose, 1);
    // area ~ r^2
    Float dr = v3_dot(d->p, n) + (v3_dot(d->dp_du, si->dp_du) + v3_dot(d->dp_dv, si->dp_dv) + 2.0f * v3_dot(d->area, si->ng)) * rcp;
    Vec3 dn = v3_madd(v3_scale(v3_add(v3_add(d->n, d->ng), d->area), sign), radius, d->p);
    Vec3 torque = v3_add(v3_cross(n, dn), v3_add(v3_cross(si->dp_du, d->dp_du), v3_cross(si->dp_dv, d->dp_dv)));
    Float about_third = v3_dot(torque, v3_cross(e1, e2)) * rcp, about_second = v3_dot(torque, v3_cross(e1, e3)) * rcp;
    Float about_first = v3_dot(torque, v3_cross(e2, e3)) * f_safe_rcp(v3_dot(e2, second));
    about_second = about_second - about_first * v3_dot(e1, second) * rcp;
    Vec3 first = v3_madd(v3_madd(v3_scale(e1, dr), about_third, e2), about_second, e3), zero = v3_zero();
    Matrix3 none = {{zero, zero, zero}}, a = none;
    matrix_add_outer(&a, first, v3(f_set(1), f_set(0), f_set(0)));
    matrix_add_outer(&a, v3_scale(e3, about_first), v3(f_set(0), f_set(1), f_set(0)));
    pose_sink_add(&none, &none, &a, d->p, i_gather(sink->pose_at, hit->shape), sink, m);
}
