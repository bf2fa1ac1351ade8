// flakes.h: the matrices S of microflakes, the same everywhere or a grid, and media that are made of such flakes. There, flakes
// stand in the way of light along w with their projected area, so that the extinction is scale x sigma_t x area,
// area^2 = w' S w [heitz2015 eq. 6]. The format has it so where `sggx` is the medium's phase function itself; inside of others
// flakes only scatter.
// NOT differentiated: jumps of nearest voxels.
#pragma once

#include "medium/phase_record.h"
#include "scene/volume.h"

enum { FLAKES_XX, FLAKES_YY, FLAKES_ZZ, FLAKES_XY, FLAKES_XZ, FLAKES_YZ };

// v' S v
KFN Float flakes_form(const Float *s, Vec3 v) {
    return s[FLAKES_XX] * v.x * v.x + s[FLAKES_YY] * v.y * v.y + s[FLAKES_ZZ] * v.z * v.z +
           2.0f * (s[FLAKES_XY] * v.x * v.y + s[FLAKES_XZ] * v.x * v.z + s[FLAKES_YZ] * v.y * v.z);
}

// S v
KFN Vec3 flakes_times(const Float *s, Vec3 v) {
    return v3(s[FLAKES_XX] * v.x + s[FLAKES_XY] * v.y + s[FLAKES_XZ] * v.z,
              s[FLAKES_XY] * v.x + s[FLAKES_YY] * v.y + s[FLAKES_YZ] * v.z,
              s[FLAKES_XZ] * v.x + s[FLAKES_YZ] * v.y + s[FLAKES_ZZ] * v.z);
}

// Accumulates the adjoint d of v' S v into ds.
KFN void flakes_form_adj(Vec3 v, Float d, Float *ds) {
    ds[FLAKES_XX] = ds[FLAKES_XX] + d * v.x * v.x;
    ds[FLAKES_YY] = ds[FLAKES_YY] + d * v.y * v.y;
    ds[FLAKES_ZZ] = ds[FLAKES_ZZ] + d * v.z * v.z;
    ds[FLAKES_XY] = ds[FLAKES_XY] + 2.0f * d * v.x * v.y;
    ds[FLAKES_XZ] = ds[FLAKES_XZ] + 2.0f * d * v.x * v.z;
    ds[FLAKES_YZ] = ds[FLAKES_YZ] + 2.0f * d * v.y * v.z;
}

// ---- matrices at points of the world -----------------------------------------------------------------------------

// The grid of matrices that differ from place to place; null = they are the same everywhere.
KFN const VolumeNode *matrix_grid(const SceneView *scene, int32_t texture) {
    const TextureNode *t = scene->textures + texture;
    const VolumeNode *v = t->kind == TEXTURE_VOLUME ? scene->volumes + t->volume : NULL;
    return v && v->nx * v->ny * v->nz > 1 ? v : NULL;
}

KFN PhaseMatrix matrix_fetch(const SceneView *scene, int32_t texture, Vec3 p) {
    const VolumeNode *grid = matrix_grid(scene, texture);
    const float *s = scene->theta + scene->textures[texture].theta;
    PhaseMatrix matrix;
    if (grid) {
        gridvolume_eval_six(scene, grid, volume_to_local(scene, grid, p, 1), matrix.m);
        return matrix;
    }
    for (int i = 0; i < 6; i++) {
        matrix.m[i] = f_set((real)s[i]);
    }
    return matrix;
}

KFN void matrix_scatter(const SceneView *scene, int32_t texture, Vec3 p, PhaseMatrix d, Sink *sink, Mask m) {
    const VolumeNode *grid = matrix_grid(scene, texture);
    int32_t at = sink->texture_at[texture];
    if (grid) {
        Vec3 q = volume_to_local(scene, grid, p, 1), dq = v3_zero();
        bool moves = volume_moves(scene, grid, sink);
        gridvolume_adj_six(scene, grid, q, d.m, at, moves || sink->point ? &dq : NULL, sink, m);
        if (moves) {
            volume_place_adj(scene, grid, q, dq, sink, m);
        }
        if (sink->point) {
            v3_acc(sink->point, v3_select(m, volume_to_world_adj(scene, grid, dq), v3_zero()));
        }
        return;
    }
    for (int i = 0; i < 6 && at >= 0; i++) {
        sink_add_uniform(sink, at + i, d.m[i], m);
    }
}

// ---- projected areas ---------------------------------------------------------------------------------------------

static NOINLINE Float flakes_area(const SceneView *scene, int32_t texture, Vec3 p, Vec3 w) {
    PhaseMatrix s = matrix_fetch(scene, texture, p);
    return f_safe_sqrt(flakes_form(s.m, w));
}

// The adjoint of area^2, given that of the area.
KFN Float flakes_square_adj(const PhaseMatrix *s, Vec3 w, Float d) {
    return 0.5f * d * f_safe_rcp(f_safe_sqrt(flakes_form(s->m, w)));
}

// Accumulates the adjoint d of the area.
static NOINLINE void flakes_area_adj(const SceneView *scene, int32_t texture, Vec3 p, Vec3 w, Float d, Sink *sink, Mask m) {
    PhaseMatrix s = matrix_fetch(scene, texture, p), ds;
    for (int i = 0; i < 6; i++) {
        ds.m[i] = f_set(0);
    }
    flakes_form_adj(w, flakes_square_adj(&s, w, d), ds.m);
    matrix_scatter(scene, texture, p, ds, sink, m);
}

// Accumulates the adjoint d of the area into those of the point and the direction.
static NOINLINE void flakes_area_turn(const SceneView *scene, int32_t texture, Vec3 p, Vec3 w, Float d, Vec3 *dp, Vec3 *dw) {
    const VolumeNode *grid = matrix_grid(scene, texture);
    PhaseMatrix s = matrix_fetch(scene, texture, p), ds;
    Float square = flakes_square_adj(&s, w, d);
    *dw = v3_madd(*dw, 2.0f * square, flakes_times(s.m, w));
    if (grid) {
        Vec3 q = volume_to_local(scene, grid, p, 1), dq = v3_zero();
        for (int i = 0; i < 6; i++) {
            ds.m[i] = f_set(0);
        }
        flakes_form_adj(w, square, ds.m);
        gridvolume_adj_six(scene, grid, q, ds.m, -1, &dq, NULL, m_set(false));
        v3_acc(dp, volume_to_world_adj(scene, grid, dq));
    }
}
