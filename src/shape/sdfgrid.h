// sdfgrid.h: the zero level set of a grid of signed distances at nodes that span the unit cube, trilinear in between.
// Table: rows of to_world (12) and of its inverse (12), numbers of nodes along x, y, z (3). uv = 0. The ray tracer sees
// one box per voxel that the surface passes; along a ray the distance is a cubic there [soderlund2022].
#pragma once

#include "shape/pose.h"

enum { SDFGRID_TABLE = 28, SDFGRID_NODES = 24 };

static inline bool sdfgrid_fold(const double *v, double m[16]) {
    UNUSED(v), UNUSED(m);
    return true;
}

static inline bool sdfgrid_follow(const float m[16], float *t, float *area) {
    *area = 0; // never a light
    return pose_table(m, t);
}

// ---- host: rays ----------------------------------------------------------------------------------------------------

// The eight distances at the corners of a voxel, x fastest; returns whether the surface passes.
static inline bool sdfgrid_corners(const Surface *s, int32_t voxel, double c[8], int32_t at[3]) {
    int32_t nx = (int32_t)s->table[SDFGRID_NODES], ny = (int32_t)s->table[SDFGRID_NODES + 1];
    bool below = false, above = false;
    at[0] = voxel % (nx - 1);
    at[1] = voxel / (nx - 1) % (ny - 1);
    at[2] = voxel / (nx - 1) / (ny - 1);
    for (int k = 0; k < 8; k++) {
        int64_t x = at[0] + (k & 1), y = at[1] + (k >> 1 & 1), z = at[2] + (k >> 2);
        c[k] = s->grid[(z * ny + y) * nx + x];
        below |= c[k] <= 0;
        above |= c[k] >= 0;
    }
    return below && above;
}

static inline void sdfgrid_bounds(const Surface *s, unsigned prim, float low[3], float high[3]) {
    double c[8];
    int32_t at[3];
    sdfgrid_corners(s, s->voxels[prim], c, at);
    for (int k = 0; k < 3; k++) {
        low[k] = INFINITY;
        high[k] = -INFINITY;
        for (int corner = 0; corner < 8; corner++) {
            float p = s->table[4 * k + 3];
            for (int axis = 0; axis < 3; axis++) {
                float node = (float)(at[axis] + (corner >> axis & 1));
                p += s->table[4 * k + axis] * node / (s->table[SDFGRID_NODES + axis] - 1);
            }
            low[k] = fminf(low[k], p);
            high[k] = fmaxf(high[k], p);
        }
    }
}

static inline double sdfgrid_value(const double c[8], const double p[3]) {
    double x0 = c[0] + (c[1] - c[0]) * p[0], x1 = c[2] + (c[3] - c[2]) * p[0];
    double x2 = c[4] + (c[5] - c[4]) * p[0], x3 = c[6] + (c[7] - c[6]) * p[0];
    double y0 = x0 + (x1 - x0) * p[1], y1 = x2 + (x3 - x2) * p[1];
    return y0 + (y1 - y0) * p[2];
}

// First zero in [0, 1] of the cubic with values f at 0, 1/3, 2/3, 1; negative when there is none.
static inline double sdfgrid_root(const double f[4]) {
    double c1 = 0.5 * (-11 * f[0] + 18 * f[1] - 9 * f[2] + 2 * f[3]);
    double c2 = 4.5 * (2 * f[0] - 5 * f[1] + 4 * f[2] - f[3]), c3 = 4.5 * (-f[0] + 3 * f[1] - 3 * f[2] + f[3]);
    double ends[4] = {0, 1, 1, 1}, q = c2 * c2 - 3 * c1 * c3;
    int n = 1;
    if (q > 0) {
        // Where the slope c1 + 2 c2 s + 3 c3 s^2 is zero, in order.
        double k = -(c2 + copysign(sqrt(q), c2)), a = c3 != 0 ? k / (3 * c3) : -1, b = k != 0 ? c1 / k : -1;
        double low = fmin(a, b), high = fmax(a, b);
        n = 1;
        if (low > 0 && low < 1) {
            ends[n++] = low;
        }
        if (high > 0 && high < 1) {
            ends[n++] = high;
        }
        ends[n] = 1;
    }
    for (int i = 0; i < n; i++) {
        double a = ends[i], b = ends[i + 1];
        double fa = f[0] + a * (c1 + a * (c2 + a * c3)), fb = f[0] + b * (c1 + b * (c2 + b * c3));
        if (fa == 0 || fa * fb > 0) {
            continue;
        }
        for (int step = 0; step < 48; step++) {
            double m = 0.5 * (a + b), fm = f[0] + m * (c1 + m * (c2 + m * c3));
            bool left = fa * fm <= 0;
            a = left ? a : m;
            b = left ? m : b;
        }
        return 0.5 * (a + b);
    }
    return -1;
}

static inline float sdfgrid_meet(const Surface *s, unsigned prim, const double o[3], const double d[3], float near,
                                 float far) {
    double c[8], from[3], along[3], t0 = near, t1 = far, f[4];
    int32_t at[3];
    sdfgrid_corners(s, s->voxels[prim], c, at);
    for (int k = 0; k < 3; k++) {
        double cells = (double)s->table[SDFGRID_NODES + k] - 1;
        from[k] = o[k] * cells - at[k];
        along[k] = d[k] * cells;
        double a = -from[k] / along[k], b = (1 - from[k]) / along[k]; // infinite for rays within the slab
        if (along[k] == 0 && (from[k] < 0 || from[k] > 1)) {
            return -1;
        }
        if (along[k] != 0) {
            t0 = fmax(t0, fmin(a, b));
            t1 = fmin(t1, fmax(a, b));
        }
    }
    if (!(t0 < t1)) {
        return -1;
    }
    for (int i = 0; i < 4; i++) {
        double t = t0 + (t1 - t0) * i / 3, p[3] = {from[0] + t * along[0], from[1] + t * along[1], from[2] + t * along[2]};
        f[i] = sdfgrid_value(c, p);
    }
    double root = sdfgrid_root(f);
    return root >= 0 ? (float)(t0 + (t1 - t0) * root) : -1;
}

// ---- kernels -------------------------------------------------------------------------------------------------------

typedef struct SdfNodes {
    Int grid, nx, ny, nz;
} SdfNodes;

// Distances at the corners of voxel (x, y, z), x fastest.
KFN void sdfgrid_distances(const SceneView *scene, const SdfNodes *n, Int x, Int y, Int z, Float c[8]) {
    Int at = (z * n->ny + y) * n->nx + x + n->grid;
    for (int k = 0; k < 8; k++) {
        Int offset = i_set(k & 1) + (k & 2 ? n->nx : i_set(0)) + (k & 4 ? n->nx * n->ny : i_set(0));
        c[k] = theta_at(scene, at + offset);
    }
}

// Gradient of the trilinear function of voxel (x, y, z) at q, both in grid coordinates.
KFN Vec3 sdfgrid_gradient(const SceneView *scene, const SdfNodes *n, Int x, Int y, Int z, Vec3 q) {
    Float c[8], fx = q.x - f_from_i(x), fy = q.y - f_from_i(y), fz = q.z - f_from_i(z);
    sdfgrid_distances(scene, n, x, y, z, c);
    Float gx, gy, gz;
    gx = f_lerp(f_lerp(c[1] - c[0], c[3] - c[2], fy), f_lerp(c[5] - c[4], c[7] - c[6], fy), fz);
    gy = f_lerp(f_lerp(c[2] - c[0], c[3] - c[1], fx), f_lerp(c[6] - c[4], c[7] - c[5], fx), fz);
    gz = f_lerp(f_lerp(c[4] - c[0], c[5] - c[1], fx), f_lerp(c[6] - c[2], c[7] - c[3], fx), fy);
    return v3(gx * f_from_i(n->nx - 1), gy * f_from_i(n->ny - 1), gz * f_from_i(n->nz - 1));
}

KFN Int sdfgrid_cell(Float q, Int nodes) { return i_max(i_min(i_from_f(f_floor(q)), nodes - 2), i_set(0)); }

// Unit gradients of the eight voxels around q, interpolated between the voxels' centres.
KFN Vec3 sdfgrid_smooth(const SceneView *scene, const SdfNodes *n, Vec3 q) {
    Float bx = f_floor(q.x - 0.5f), by = f_floor(q.y - 0.5f), bz = f_floor(q.z - 0.5f);
    Float fx = q.x - 0.5f - bx, fy = q.y - 0.5f - by, fz = q.z - 0.5f - bz;
    Vec3 sum = v3_zero();
    for (int k = 0; k < 8; k++) {
        Int x = sdfgrid_cell(bx + (real)(k & 1), n->nx), y = sdfgrid_cell(by + (real)(k >> 1 & 1), n->ny);
        Int z = sdfgrid_cell(bz + (real)(k >> 2), n->nz);
        Float w = (k & 1 ? fx : 1.0f - fx) * (k & 2 ? fy : 1.0f - fy) * (k & 4 ? fz : 1.0f - fz);
        sum = v3_madd(sum, w, v3_normalize(sdfgrid_gradient(scene, n, x, y, z, q)));
    }
    return sum;
}

// A hit in grid coordinates.
typedef struct SdfPoint {
    SdfNodes nodes;
    Vec3 q;
} SdfPoint;

KFN SdfPoint sdfgrid_point(const SceneView *scene, const Hit *hit) {
    Int at = SHAPE_FIELD(scene, hit->shape, table);
    Vec3 local = pose_to_local(scene, at, hit->p), nodes = table_v3(scene, at + SDFGRID_NODES);
    SdfPoint p = {{SHAPE_FIELD(scene, hit->shape, positions), i_from_f(nodes.x), i_from_f(nodes.y), i_from_f(nodes.z)}, v3_zero()};
    p.q = v3(local.x * (nodes.x - 1.0f), local.y * (nodes.y - 1.0f), local.z * (nodes.z - 1.0f));
    return p;
}

static NOINLINE Interaction sdfgrid_interaction(const SceneView *scene, int32_t flags, const Hit *hit) {
    Interaction si;
    Int at = SHAPE_FIELD(scene, hit->shape, table);
    SdfPoint point = sdfgrid_point(scene, hit);
    SdfNodes n = point.nodes;
    Vec3 q = point.q;
    Vec3 g = sdfgrid_gradient(scene, &n, sdfgrid_cell(q.x, n.nx), sdfgrid_cell(q.y, n.ny), sdfgrid_cell(q.z, n.nz), q);
    si.p = hit->p;
    si.ng = pose_normal(scene, at, g);
    Vec3 shading = si.ng;
    if (flags & SHAPE_SMOOTH_GRADIENT) {
        shading = pose_normal(scene, at, sdfgrid_smooth(scene, &n, q));
    }
    if (flags & SHAPE_FLIP_NORMALS) {
        si.ng = v3_neg(si.ng);
        shading = v3_neg(shading);
    }
    si.uv = (Vec2){f_set(0), f_set(0)};
    si.sh = frame_from_normal(shading);
    si.dp_du = si.sh.s;
    si.dp_dv = si.sh.t;
    return si;
}

// Never a light (refused when loading): nothing is sampled.
KFN Hit sdfgrid_sample(const SceneView *scene, int32_t id, Vec3 ref, Vec2 u) {
    UNUSED(scene), UNUSED(u);
    return hit_at(id, ref);
}

KFN Float sdfgrid_pdf(const SceneView *scene, int32_t id, Vec3 ref, Vec3 d, const Interaction *si) {
    UNUSED(scene), UNUSED(id), UNUSED(ref), UNUSED(d), UNUSED(si);
    return f_set(0);
}
