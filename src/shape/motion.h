// motion.h: what surfaces that move need. Points are attached to their surface, keeping barycentrics or the position in
// the space of the shape's pose, so that normals and texture coordinates move along with them. Here: the adjoint of an
// interaction, how an interaction changes where its point slides along the surface, and the adjoint of a pose.
#pragma once

#include "shape/interaction.h"

// Adjoint of an interaction; `at` is that of the barycentrics. area: that of the normal times the size of a patch that
// is attached to the surface, in units of the size that it has.
typedef struct SurfaceAdj {
    Vec3 p, ng, n, dp_du, dp_dv, area; // n: shading normal
    Vec2 uv, at;
} SurfaceAdj;

KFN SurfaceAdj surface_adj_zero(void) {
    Vec3 z = v3_zero();
    Vec2 zero = {f_set(0), f_set(0)};
    return (SurfaceAdj){z, z, z, z, z, z, zero, zero};
}

// Derivative of an interaction along one direction of its surface.
typedef struct Slide {
    Vec3 p, ng, n, dp_du, dp_dv;
    Vec2 uv, at;
} Slide;

KFN Slide slide_along(Vec3 p, Float u, Float v) {
    Vec3 z = v3_zero();
    return (Slide){p, z, z, z, z, {u, v}, {f_set(0), f_set(0)}};
}

KFN Float slide_worth(const Slide *s, const SurfaceAdj *d) {
    return v3_dot(s->p, d->p) + v3_dot(s->ng, d->ng) + v3_dot(s->n, d->n) + v3_dot(s->dp_du, d->dp_du) +
           v3_dot(s->dp_dv, d->dp_dv) + s->uv.x * d->uv.x + s->uv.y * d->uv.y + s->at.x * d->at.x + s->at.y * d->at.y;
}

// A point of the surface is where a ray along d meets it. The adjoint of the ray's position there, as far as it makes
// the point slide: offset v slides by b_i . v along slide i, with b_i . X_j = (i = j) and b_i . d = 0.
KFN Vec3 slide_adj(const Slide s[2], Vec3 d, const SurfaceAdj *adjoint) {
    Vec3 b1 = v3_cross(s[1].p, d), b2 = v3_cross(d, s[0].p);
    Float r = f_safe_rcp(v3_dot(s[0].p, b1));
    return v3_madd(v3_scale(b1, slide_worth(s, adjoint) * r), slide_worth(s + 1, adjoint) * r, b2);
}

// What normalize(a) does with the derivative da of a.
KFN Vec3 slide_normalized(Vec3 a, Vec3 da) {
    Vec3 r = v3_zero();
    v3_normalize_adj(a, da, &r); // the matrix is symmetric
    return r;
}

// ---- poses: row-major 4 x 4 matrices [A t] in theta ---------------------------------------------------------------

// A 3 x 3 matrix by rows.
typedef struct Matrix3 {
    Vec3 row[3];
} Matrix3;

KFN void matrix_add_outer(Matrix3 *b, Vec3 u, Vec3 v) {
    b->row[0] = v3_madd(b->row[0], u.x, v);
    b->row[1] = v3_madd(b->row[1], u.y, v);
    b->row[2] = v3_madd(b->row[2], u.z, v);
}

KFN Vec3 pose_theta_column(const SceneView *scene, Int pose, int column) {
    return v3(theta_at(scene, pose + column), theta_at(scene, pose + (4 + column)), theta_at(scene, pose + (8 + column)));
}

// Rows of the inverse of A.
KFN Matrix3 pose_theta_inverse(const SceneView *scene, Int pose) {
    Vec3 x = pose_theta_column(scene, pose, 0), y = pose_theta_column(scene, pose, 1), z = pose_theta_column(scene, pose, 2);
    Vec3 yz = v3_cross(y, z);
    Float r = 1.0f / v3_dot(x, yz);
    return (Matrix3){{v3_scale(yz, r), v3_scale(v3_cross(z, x), r), v3_scale(v3_cross(x, y), r)}};
}

// Adds the adjoint of A, b A^-T + a, and that of t, to the sink; `at` is -1 in lanes that are not asked for.
KFN void pose_sink_add(const Matrix3 *b, const Matrix3 *inverse, const Matrix3 *a, Vec3 dt, Int at, Sink *sink, Mask m) {
    Float t[3] = {dt.x, dt.y, dt.z};
    m = m & mi_lt(i_set(-1), at);
    at = i_max(at, i_set(0));
    for (int i = 0; i < 3; i++) {
        Float own[3] = {a->row[i].x, a->row[i].y, a->row[i].z};
        for (int j = 0; j < 3; j++) {
            sink_add(sink, at + (4 * i + j), v3_dot(b->row[i], inverse->row[j]) + own[j], m);
        }
        sink_add(sink, at + (4 * i + 3), t[i], m);
    }
}

// The adjoint of the pose of points that are attached to it. With B = dA A^-1: dp = B (p - t) + dt, tangents change by
// B a, unit normals by -(1 - n n^T) B^T n, and the area vector by (tr B) n - B^T n.
KFN void pose_move_adj(const SceneView *scene, Int pose, Int at, const Interaction *si, const SurfaceAdj *d, Sink *sink,
                       Mask m) {
    Vec3 zero = v3_zero(), n = si->sh.n, ng = si->ng;
    Matrix3 b = {{zero, zero, zero}}, none = b, inverse = pose_theta_inverse(scene, pose);
    matrix_add_outer(&b, d->p, v3_sub(si->p, pose_theta_column(scene, pose, 3)));
    matrix_add_outer(&b, d->dp_du, si->dp_du);
    matrix_add_outer(&b, d->dp_dv, si->dp_dv);
    matrix_add_outer(&b, v3_neg(n), v3_madd(d->n, -v3_dot(n, d->n), n));
    matrix_add_outer(&b, v3_neg(ng), v3_madd(d->ng, -v3_dot(ng, d->ng), ng));
    matrix_add_outer(&b, v3_neg(ng), d->area);
    Float grows = v3_dot(d->area, ng);
    b.row[0].x = b.row[0].x + grows;
    b.row[1].y = b.row[1].y + grows;
    b.row[2].z = b.row[2].z + grows;
    pose_sink_add(&b, &inverse, &none, d->p, at, sink, m);
}
