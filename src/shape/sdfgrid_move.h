// sdfgrid_move.h: grids of distances that move with their pose, and how points slide over them. Their tangents are those that
// frame_from_normal makes of the shading normal.
// NOT differentiated: distances.
#pragma once

#include "shape/posed_move.h"
#include "shape/sdfgrid.h"

// Derivatives of the tangents of frame_from_normal(n), where n changes by dn.
KFN void frame_slide(Vec3 n, Vec3 dn, Vec3 *ds, Vec3 *dt) {
    Float sign = f_sign(n.z), a = -1.0f / (sign + n.z), da = a * a * dn.z;
    Float db = (dn.x * n.y + n.x * dn.y) * a + n.x * n.y * da;
    *ds = v3(sign * (2.0f * n.x * dn.x * a + n.x * n.x * da), sign * db, -sign * dn.x);
    *dt = v3(db, 2.0f * n.y * dn.y * a + n.y * n.y * da, -dn.y);
}

// Adjoint of n from those of the tangents.
KFN Vec3 frame_slide_adj(Vec3 n, Vec3 ds, Vec3 dt) {
    Float sign = f_sign(n.z), a = -1.0f / (sign + n.z), db = sign * ds.y + dt.x;
    Float da = sign * n.x * n.x * ds.x + n.y * n.y * dt.y + n.x * n.y * db;
    return v3(2.0f * sign * n.x * a * ds.x - sign * ds.z + n.y * a * db, 2.0f * n.y * a * dt.y - dt.z + n.x * a * db, a * a * da);
}

// What sdfgrid_gradient does where q moves along v, in grid coordinates.
KFN Vec3 sdfgrid_bend(const SceneView *scene, const SdfNodes *n, Int x, Int y, Int z, Vec3 q, Vec3 v) {
    Float c[8];
    sdfgrid_distances(scene, n, x, y, z, c);
    Float fx = q.x - f_from_i(x), fy = q.y - f_from_i(y), fz = q.z - f_from_i(z);
    Float xy = f_lerp(c[3] - c[2] - c[1] + c[0], c[7] - c[6] - c[5] + c[4], fz);
    Float xz = f_lerp(c[5] - c[4] - c[1] + c[0], c[7] - c[6] - c[3] + c[2], fy);
    Float yz = f_lerp(c[6] - c[4] - c[2] + c[0], c[7] - c[5] - c[3] + c[1], fx);
    return v3((xy * v.y + xz * v.z) * f_from_i(n->nx - 1), (xy * v.x + yz * v.z) * f_from_i(n->ny - 1),
              (xz * v.x + yz * v.y) * f_from_i(n->nz - 1));
}

// What sdfgrid_smooth does there.
KFN Vec3 sdfgrid_smooth_bend(const SceneView *scene, const SdfNodes *n, Vec3 q, Vec3 v) {
    Float bx = f_floor(q.x - 0.5f), by = f_floor(q.y - 0.5f), bz = f_floor(q.z - 0.5f);
    Float fx = q.x - 0.5f - bx, fy = q.y - 0.5f - by, fz = q.z - 0.5f - bz;
    Vec3 sum = v3_zero();
    for (int k = 0; k < 8; k++) {
        Int x = sdfgrid_cell(bx + (real)(k & 1), n->nx), y = sdfgrid_cell(by + (real)(k >> 1 & 1), n->ny);
        Int z = sdfgrid_cell(bz + (real)(k >> 2), n->nz);
        Float wx = k & 1 ? fx : 1.0f - fx, wy = k & 2 ? fy : 1.0f - fy, wz = k & 4 ? fz : 1.0f - fz;
        Float dx = k & 1 ? v.x : -v.x, dy = k & 2 ? v.y : -v.y, dz = k & 4 ? v.z : -v.z;
        Vec3 g = sdfgrid_gradient(scene, n, x, y, z, q);
        sum = v3_madd(sum, dx * wy * wz + wx * dy * wz + wx * wy * dz, v3_normalize(g));
        sum = v3_madd(sum, wx * wy * wz, slide_normalized(g, sdfgrid_bend(scene, n, x, y, z, q, v)));
    }
    return sum;
}

// From the space of the pose to directions that are at right angles to what was.
KFN Vec3 sdfgrid_across(const SceneView *scene, Int at, Vec3 g) {
    return v3_madd(v3_madd(v3_scale(table_v3(scene, at + 12), g.x), g.y, table_v3(scene, at + 16)), g.z, table_v3(scene, at + 20));
}

static NOINLINE void sdfgrid_slide(const SceneView *scene, int32_t flags, const Hit *hit, const Interaction *si, Slide out[2]) {
    Int at = SHAPE_FIELD(scene, hit->shape, table);
    SdfPoint p = sdfgrid_point(scene, hit);
    Int x = sdfgrid_cell(p.q.x, p.nodes.nx), y = sdfgrid_cell(p.q.y, p.nodes.ny), z = sdfgrid_cell(p.q.z, p.nodes.nz);
    Vec3 g = sdfgrid_across(scene, at, sdfgrid_gradient(scene, &p.nodes, x, y, z, p.q));
    Frame tangents = frame_from_normal(si->ng);
    Float sign = f_set(flags & SHAPE_FLIP_NORMALS ? -1 : 1);
    for (int k = 0; k < 2; k++) {
        Vec3 d = k ? tangents.t : tangents.s;
        out[k] = slide_along(d, f_set(0), f_set(0));
        Vec3 v = v3(v3_dot(table_v3(scene, at + 12), d) * f_from_i(p.nodes.nx - 1),
                    v3_dot(table_v3(scene, at + 16), d) * f_from_i(p.nodes.ny - 1),
                    v3_dot(table_v3(scene, at + 20), d) * f_from_i(p.nodes.nz - 1));
        Vec3 bend = sdfgrid_across(scene, at, sdfgrid_bend(scene, &p.nodes, x, y, z, p.q, v));
        out[k].n = out[k].ng = v3_scale(slide_normalized(g, bend), sign);
        if (flags & SHAPE_SMOOTH_GRADIENT) {
            Vec3 smooth = sdfgrid_across(scene, at, sdfgrid_smooth(scene, &p.nodes, p.q));
            bend = sdfgrid_across(scene, at, sdfgrid_smooth_bend(scene, &p.nodes, p.q, v));
            out[k].n = v3_scale(slide_normalized(smooth, bend), sign);
        }
        frame_slide(si->sh.n, out[k].n, &out[k].dp_du, &out[k].dp_dv);
    }
}

static NOINLINE void sdfgrid_move_adj(const SceneView *scene, int32_t flags, const Hit *hit, const Interaction *si,
                                      const SurfaceAdj *d, Sink *sink, Mask m) {
    SurfaceAdj own = *d;
    UNUSED(flags);
    v3_acc(&own.n, frame_slide_adj(si->sh.n, d->dp_du, d->dp_dv));
    own.dp_du = own.dp_dv = v3_zero();
    affine_move_adj(scene, hit, si, &own, sink, m);
}
