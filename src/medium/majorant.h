// majorant.h: walking along a ray through supervoxels, each with a bound of the extinction in it, to the next tentative
// collision [amanatides1987; yue2010]. All lanes step together, each through cells of its own.
#pragma once

#include "scene/tables.h"
#include "scene/volume.h"

typedef struct MajorantWalk {
    Vec3 o, d;        // in the space of sigma_t; d has the length that world distances give it
    Float t, end;     // where the walk stands and where it leaves the medium [world distance]
    Int at;           // number of the cell
    Int ahead[3];     // how many cells lie before the walk along each axis
    Float next[3], step[3]; // distances at which cells end along each axis, and between such ends
    Int stride[3];    // between the numbers of cells that follow each other along an axis
    Int cell[3];      // where it repeats: x, y and z of the cell, counted on beyond the grid
    Float majorant;   // of the cell that the walk stands in
    Float least;      // bounds of cells count as at least this much
    Mask m;           // lanes that are still inside
    int32_t wrap;     // of sigma_t; WRAP_CLAMP also where it is constant
    Mask coarse;      // where it repeats: lanes on whose way there are too many cells, which take the bound of all of them
} MajorantWalk;

// Distances at which the ray enters and leaves [0, 1] along one axis.
KFN void slab(Float o, Float d, Float *low, Float *high) {
    Mask parallel = m_lt(f_abs(d), f_set(1e-12f)), inside = m_ge(o, f_set(0)) & m_le(o, f_set(1));
    Float rcp = 1.0f / f_select(parallel, f_set(1), d), a = -o * rcp, b = (1.0f - o) * rcp;
    Float never = f_select(inside, f_set(INFINITY), f_set(-INFINITY));
    *low = f_max(*low, f_select(parallel, f_set(-INFINITY), f_min(a, b)));
    *high = f_min(*high, f_select(parallel, never, f_max(a, b)));
}

// A heterogeneous medium fills a box along the world's axes around the cube of its extinction, as the format has it. Up to that
// box, the voxels at the cube's border go on, or the grid repeats. Where the box begins along an axis, and its size.
KFN void medium_box(const SceneView *scene, const VolumeNode *v, int axis, real *corner, real *size) {
    *corner = 0;
    *size = 1;
    if (v->table < 0) {
        return;
    }
    const float *row = scene->theta + v->to_world + 4 * axis;
    real x = (real)row[0], y = (real)row[1], z = (real)row[2];
    *size = (x < 0 ? -x : x) + (y < 0 ? -y : y) + (z < 0 ? -z : z);
    *corner = (real)0.5 * (x + y + z - *size) + (real)row[3];
}

// Narrows [low, high] down to the part of a ray that lies in the medium.
KFN void medium_span(const SceneView *scene, const MediumNode *medium, const VolumeNode *v, Vec3 o, Vec3 d, Float *low,
                     Float *high) {
    if (!medium->bounded) {
        return;
    }
    const Float p[3] = {o.x, o.y, o.z}, q[3] = {d.x, d.y, d.z};
    for (int k = 0; k < 3; k++) {
        real corner, size;
        medium_box(scene, v, k, &corner, &size);
        slab((p[k] - corner) * (1 / size), q[k] * (1 / size), low, high);
    }
    *high = f_max(*high, *low);
}

// More cells than that are not worth the steps; only grids that repeat many times in their box have them.
enum { MOST_CELLS = 256 };

// Where a walk through cells that repeat leaves its cell along an axis; there is no rounding that adds up.
KFN Float majorant_border(const MajorantWalk *w, int k, Float p, Float v, int32_t n) {
    Mask up = m_gt(v, f_set(0)), still = ~m_finite(w->step[k]) | w->coarse;
    Float rcp = f_select(still, f_set(0), f_select(up, w->step[k], -w->step[k])) * (real)n;
    Float border = f_from_i(w->cell[k] + i_select(up, i_set(1), i_set(0))) * (1 / (real)n);
    return f_select(still, f_set(INFINITY), (border - p) * rcp);
}

// The same as in majorant_start where cells repeat: they are counted on beyond the grid.
static NOINLINE void majorant_start_repeated(const MediumNode *medium, MajorantWalk *w) {
    const int32_t n[3] = {medium->nx, medium->ny, medium->nz};
    const Float p[3] = {w->o.x, w->o.y, w->o.z}, v[3] = {w->d.x, w->d.y, w->d.z};
    Float length = f_select(w->m, w->end - w->t, f_set(0)), cells = f_set(0);
    for (int k = 0; k < 3; k++) {
        Float at = (p[k] + w->t * v[k]) * (real)n[k];
        cells = cells + f_abs(at) + f_abs(v[k] * length) * (real)n[k];
    }
    w->coarse = m_ge(cells, f_set(MOST_CELLS)) | ~m_finite(cells);
    for (int k = 0; k < 3; k++) {
        Float at = f_select(w->coarse, f_set(0), (p[k] + w->t * v[k]) * (real)n[k]);
        w->cell[k] = i_from_f(f_floor(at));
        w->next[k] = majorant_border(w, k, p[k], v[k], n[k]);
    }
}

// From world point o along the unit direction d, for the distance tmax.
KFN MajorantWalk majorant_start(const SceneView *scene, const MediumNode *medium, const VolumeNode *sigma_t, Vec3 o, Vec3 d,
                                Float tmax, Mask m) {
    const int32_t n[3] = {medium->nx, medium->ny, medium->nz};
    MajorantWalk w = {.o = volume_to_local(scene, sigma_t, o, 1), .d = volume_to_local(scene, sigma_t, d, 0)};
    w.wrap = medium->bounded && sigma_t->kind == VOLUME_GRID ? sigma_t->wrap : WRAP_CLAMP;
    w.coarse = m_set(false);
    const Float p[3] = {w.o.x, w.o.y, w.o.z}, v[3] = {w.d.x, w.d.y, w.d.z};
    w.t = f_set(0);
    w.end = tmax;
    w.majorant = w.least = f_set(0);
    medium_span(scene, medium, sigma_t, o, d, &w.t, &w.end);
    w.m = m & m_lt(w.t, w.end);
    w.t = f_select(w.m, w.t, f_set(0));
    w.at = i_set(medium->table);
    int32_t size = 1;
    for (int k = 0; k < 3; k++) {
        Mask up = m_gt(v[k], f_set(0)), still = m_lt(f_abs(v[k]), f_set(1e-12f)) | m_set(!medium->bounded);
        Float rcp = 1.0f / f_select(still, f_set(1), v[k]);
        Float at = f_clamp((p[k] + w.t * v[k]) * (real)n[k], f_set(0), f_set((real)n[k]));
        Int cell = i_min(i_from_f(at), i_set(n[k] - 1));
        Float border = f_from_i(cell + i_select(up, i_set(1), i_set(0))) * (1 / (real)n[k]);
        w.ahead[k] = i_select(up, n[k] - 1 - cell, cell);
        Mask last = mi_eq(w.ahead[k], i_set(0)); // it reaches as far as the medium
        w.next[k] = f_select(still | last, f_set(INFINITY), (border - p[k]) * rcp);
        w.step[k] = f_select(still, f_set(INFINITY), f_abs(rcp) * (1 / (real)n[k]));
        w.at = w.at + cell * size;
        w.stride[k] = i_select(up, i_set(size), i_set(-size));
        size *= n[k];
    }
    if (w.wrap != WRAP_CLAMP) {
        majorant_start_repeated(medium, &w);
    }
    return w;
}

// One cell on where cells repeat: along the axis whose border comes first.
static NOINLINE void majorant_step_repeated(const MediumNode *medium, MajorantWalk *w, Float border, Mask m) {
    const int32_t n[3] = {medium->nx, medium->ny, medium->nz};
    const Float p[3] = {w->o.x, w->o.y, w->o.z}, v[3] = {w->d.x, w->d.y, w->d.z};
    Mask left = m;
    for (int k = 0; k < 3; k++) {
        Mask mine = left & m_le(w->next[k], border);
        w->cell[k] = i_select(mine, w->cell[k] + i_select(m_gt(v[k], f_set(0)), i_set(1), i_set(-1)), w->cell[k]);
        w->next[k] = f_select(mine, majorant_border(w, k, p[k], v[k], n[k]), w->next[k]);
        left = left & ~mine;
    }
}

// One cell on, along all axes whose border comes first. Lanes of m that leave the medium leave the walk.
KFN void majorant_step(const MediumNode *medium, MajorantWalk *w, Float border, Mask m) {
    if (w->wrap != WRAP_CLAMP) {
        majorant_step_repeated(medium, w, border, m);
    } else {
        for (int k = 0; k < 3; k++) {
            Mask mine = m & m_le(w->next[k], border) & mi_lt(i_set(0), w->ahead[k]);
            w->at = w->at + (mine & w->stride[k]);
            w->ahead[k] = w->ahead[k] + mine;
            Float next = f_select(mi_lt(i_set(0), w->ahead[k]), w->next[k] + w->step[k], f_set(INFINITY));
            w->next[k] = f_select(mine, next, w->next[k]);
        }
    }
    w->m = w->m & ~(m & m_ge(w->t, w->end));
}

// The bound of the cell that the walk stands in.
KFN Float majorant_here(const SceneView *scene, const MediumNode *medium, const MajorantWalk *w) {
    if (w->wrap == WRAP_CLAMP) {
        return f_max(table_at(scene, w->at), w->least);
    }
    Int x = texture_wrap(w->cell[0], medium->nx, w->wrap), y = texture_wrap(w->cell[1], medium->ny, w->wrap);
    Int z = texture_wrap(w->cell[2], medium->nz, w->wrap);
    Int cell = (z * medium->ny + y) * medium->nx + x;
    cell = i_select(w->coarse, i_set(medium->nx * medium->ny * medium->nz), cell); // that of all cells
    return f_max(table_at(scene, cell + medium->table), w->least);
}

// Goes on until the majorants on the way have used up the optical depths, or, unless `stop` is null, to the distance *stop. Lanes
// that get to either are returned and stand at w->t under w->majorant; the others have left the medium.
KFN Mask majorant_go(const SceneView *scene, const MediumNode *medium, MajorantWalk *w, Float depth, const Float *stop, Mask m) {
    Mask left = m & w->m, found = m_set(false);
    while (m_any(left)) {
        Float majorant = majorant_here(scene, medium, w);
        Float border = f_min(f_min(w->next[0], w->next[1]), w->next[2]), exit = f_min(border, w->end);
        Mask stops = stop ? left & m_lt(*stop, exit) : m_set(false);
        exit = stop ? f_min(*stop, exit) : exit;
        Float through = majorant * f_max(exit - w->t, f_set(0));
        Mask here = left & m_gt(majorant, f_set(0)) & m_lt(depth, through);
        w->majorant = f_select(left, majorant, w->majorant);
        w->t = f_select(here, w->t + depth * f_safe_rcp(majorant), f_select(left, exit, w->t));
        depth = depth - through;
        found = found | here | stops;
        left = left & ~(here | stops);
        if (m_any(left)) {
            majorant_step(medium, w, border, left);
            left = left & w->m;
        }
    }
    return found;
}

KFN Mask majorant_next(const SceneView *scene, const MediumNode *medium, MajorantWalk *w, Float depth, Mask m) {
    return majorant_go(scene, medium, w, depth, NULL, m);
}

static NOINLINE Mask majorant_until(const SceneView *scene, const MediumNode *medium, MajorantWalk *w, Float depth, Float stop,
                                    Mask m) {
    return majorant_go(scene, medium, w, depth, &stop, m);
}

KFN Vec3 majorant_point(const MajorantWalk *w) { return v3_madd(w->o, w->t, w->d); }
