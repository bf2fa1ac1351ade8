// volume.h: fields over space, and their adjoints: to the values, and to the point, through which to_world moves.
// NOT differentiated: jumps of nearest voxels, and of a medium at the border of its box (integrator/border.h).
#pragma once

#include "scene/hit.h"
#include "scene/sink.h"
#include "scene/wrap.h"

// Where a grid is read: the eight voxels around a point (nearest: the first), and the weights of the upper ones.
typedef struct Voxels {
    Int at[8];
    Float f[3];
    int32_t count;
    Mask apart; // lanes whose two voxels along x are neighbours in memory, not one and the same
    bool near;  // in all lanes they are one of both
} Voxels;

// The two voxels along one axis, and the weight of the upper one. Voxel i lies at (i + 1/2) / n.
KFN void voxels_along(const VolumeNode *v, Float x, int32_t n, Int *low, Int *high, Float *f) {
    // Far-away coordinates lose their fraction anyway; the clamp keeps the integer conversion defined.
    x = f_clamp(x * (real)n, f_set(-1e7f), f_set(1e7f)) - (v->filter == FILTER_NEAREST ? 0.0f : 0.5f);
    Float whole = f_floor(x);
    *f = v->filter == FILTER_NEAREST ? f_set(0) : x - whole;
    *low = texture_wrap(i_from_f(whole), n, v->wrap);
    *high = texture_wrap(i_from_f(whole) + 1, n, v->wrap);
}

KFN Voxels voxels_around(const VolumeNode *v, Vec3 p) {
    Int x[2], y[2], z[2];
    Voxels s = {.count = v->filter == FILTER_NEAREST ? 1 : 8};
    voxels_along(v, p.x, v->nx, &x[0], &x[1], &s.f[0]);
    voxels_along(v, p.y, v->ny, &y[0], &y[1], &s.f[1]);
    voxels_along(v, p.z, v->nz, &z[0], &z[1], &s.f[2]);
    s.apart = mi_eq(x[1], x[0] + 1);
    s.near = !m_any(~(s.apart | mi_eq(x[1], x[0])));
    for (int k = 0; k < 8; k++) {
        s.at[k] = ((z[k >> 2] * v->ny + y[k >> 1 & 1]) * v->nx + x[k & 1]) * v->channels;
    }
    return s;
}

KFN Float voxel_weight(const Voxels *s, int k) {
    Float w = k & 1 ? s->f[0] : 1.0f - s->f[0];
    w = w * (k & 2 ? s->f[1] : 1.0f - s->f[1]);
    return w * (k & 4 ? s->f[2] : 1.0f - s->f[2]);
}

KFN Spec voxel_value(const SceneView *scene, const VolumeNode *v, Int at) {
    Spec s;
    if (v->channels == 1) {
        return spec_set(theta_at(scene, at + v->theta));
    }
    static_assert(SPEC_N == 3, "colours are read as three numbers");
    f_gather3(scene->theta, at + v->theta, s.c);
    return s;
}

// The values of the eight voxels of a volume of numbers: those that stand side by side are read together.
KFN void voxel_numbers(const SceneView *scene, const VolumeNode *v, const Voxels *s, Float *values) {
    for (int k = 0; k < 8; k += 2) {
        if (s->near) {
            Float row[3];
            f_gather3(scene->theta, s->at[k] + v->theta, row);
            values[k] = row[0];
            values[k + 1] = f_select(s->apart, row[1], row[0]);
        } else {
            values[k] = theta_at(scene, s->at[k] + v->theta);
            values[k + 1] = theta_at(scene, s->at[k + 1] + v->theta);
        }
    }
}

// A volume of numbers at the point that the voxels are around.
KFN Float voxels_number(const SceneView *scene, const VolumeNode *v, const Voxels *s) {
    if (s->count == 1) {
        return theta_at(scene, s->at[0] + v->theta);
    }
    Float values[8], value = f_set(0);
    voxel_numbers(scene, v, s, values);
    for (int k = 0; k < 8; k++) {
        value = value + voxel_weight(s, k) * values[k];
    }
    return value;
}

KFN Spec gridvolume_eval(const SceneView *scene, const VolumeNode *v, Vec3 p) {
    Voxels s = voxels_around(v, p);
    if (v->channels == 1) {
        return spec_set(voxels_number(scene, v, &s));
    }
    if (s.count == 1) {
        return voxel_value(scene, v, s.at[0]);
    }
    Spec value = spec_zero();
    for (int k = 0; k < 8; k++) {
        value = spec_madd(value, voxel_weight(&s, k), voxel_value(scene, v, s.at[k]));
    }
    return value;
}

// The slope of sum_k w_k along_k, with respect to the point. w_k is linear in each of f = n p - 1/2 - floor.
KFN Vec3 voxels_slope(const VolumeNode *v, const Voxels *s, const Float *along) {
    const int32_t n[3] = {v->nx, v->ny, v->nz};
    Float slope[3] = {f_set(0), f_set(0), f_set(0)};
    for (int k = 0; k < 8 && s->count == 8; k++) {
        for (int axis = 0; axis < 3; axis++) {
            Voxels flat = *s;
            flat.f[axis] = k >> axis & 1 ? f_set(1) : f_set(0);
            Float rest = voxel_weight(&flat, k) * along[k] * (real)n[axis];
            slope[axis] = slope[axis] + (k >> axis & 1 ? rest : -rest);
        }
    }
    return v3(slope[0], slope[1], slope[2]);
}

// Adds w_k d to the voxels of a volume of numbers, those that stand side by side together.
KFN void voxels_add(const Voxels *s, Float d, double *gradient, Mask m) {
    for (int k = 0; k < 8; k += 2) {
        Float low = voxel_weight(s, k) * d, high = voxel_weight(s, k + 1) * d;
        f_scatter_add_doubles(gradient, s->at[k], low, high, m & s->apart);
        f_scatter_add_double(gradient, s->at[k], low + high, m & ~s->apart);
    }
}

// at: where the values begin in the sink, -1 = not asked for; dp may be null.
KFN void gridvolume_adj(const SceneView *scene, const VolumeNode *v, Vec3 p, Spec d, int32_t at, Vec3 *dp, Sink *sink,
                        Mask m) {
    Voxels s = voxels_around(v, p);
    Float along[8];
    const int channels = v->channels == 1 ? 1 : SPEC_N;
    Spec each = v->channels == 1 ? spec_set(spec_sum(d)) : d;
    const bool rows = at >= 0 && v->channels == 1 && s.count == 8 && s.near && sink->gradient;
    if (rows) {
        voxels_add(&s, each.c[0], sink->gradient + at, m);
    }
    for (int k = 0; k < s.count; k++) {
        // value = sum_k w_k voxel_k
        Float w = voxel_weight(&s, k);
        for (int c = 0; c < channels && at >= 0 && !rows; c++) {
            sink_add(sink, s.at[k] + (at + c), w * each.c[c], m);
        }
        along[k] = dp ? spec_dot(d, voxel_value(scene, v, s.at[k])) : f_set(0);
    }
    if (dp) {
        v3_acc(dp, voxels_slope(v, &s, along));
    }
}

KFN Spec constvolume_eval(const SceneView *scene, const VolumeNode *v, Vec3 p) {
    UNUSED(p);
    return voxel_value(scene, v, i_set(0));
}

KFN void constvolume_adj(const SceneView *scene, const VolumeNode *v, Vec3 p, Spec d, int32_t at, Vec3 *dp, Sink *sink,
                         Mask m) {
    UNUSED(scene), UNUSED(p), UNUSED(dp);
    for (int c = 0; c < SPEC_N && at >= 0; c++) {
        sink_add_uniform(sink, at + (v->channels == 1 ? 0 : c), d.c[c], m);
    }
}

// Six numbers at a point, and their adjoint.
KFN void gridvolume_eval_six(const SceneView *scene, const VolumeNode *v, Vec3 p, Float *values) {
    Voxels s = voxels_around(v, p);
    for (int i = 0; i < 6; i++) {
        values[i] = f_set(0);
        for (int k = 0; k < s.count; k++) {
            Float w = s.count == 1 ? f_set(1) : voxel_weight(&s, k);
            values[i] = values[i] + w * theta_at(scene, s.at[k] + (v->theta + i));
        }
    }
}

// As gridvolume_adj.
KFN void gridvolume_adj_six(const SceneView *scene, const VolumeNode *v, Vec3 p, const Float *d, int32_t at, Vec3 *dp,
                            Sink *sink, Mask m) {
    Voxels s = voxels_around(v, p);
    Float along[8];
    for (int k = 0; k < s.count; k++) {
        Float w = s.count == 1 ? f_set(1) : voxel_weight(&s, k);
        along[k] = f_set(0);
        for (int i = 0; i < 6; i++) {
            if (at >= 0) {
                sink_add(sink, s.at[k] + (at + i), w * d[i], m);
            }
            along[k] = along[k] + d[i] * theta_at(scene, s.at[k] + (v->theta + i));
        }
    }
    if (dp) {
        v3_acc(dp, voxels_slope(v, &s, along));
    }
}

// ---- dispatch ----------------------------------------------------------------------------------------------------

KFN Vec3 volume_to_local(const SceneView *scene, const VolumeNode *v, Vec3 p, real w) {
    if (v->table < 0) {
        return p;
    }
    const float *r = scene->tables + v->table;
    return v3(r[0] * p.x + r[1] * p.y + r[2] * p.z + r[3] * w, r[4] * p.x + r[5] * p.y + r[6] * p.z + r[7] * w,
              r[8] * p.x + r[9] * p.y + r[10] * p.z + r[11] * w);
}

// A volume of numbers at a point of its own space.
KFN Float volume_eval_real(const SceneView *scene, const VolumeNode *v, Vec3 p) {
    if (v->kind == VOLUME_CONSTANT) {
        return f_set((real)scene->theta[v->theta]);
    }
    Voxels s = voxels_around(v, p);
    return voxels_number(scene, v, &s);
}

// At a point of the volume's own space.
KFN Spec volume_eval(const SceneView *scene, const VolumeNode *v, Vec3 p) {
    switch (v->kind) {
#define VOLUME(ENUM, prefix, name)                                                                                     \
    case VOLUME_##ENUM:                                                                                                \
        return prefix##_eval(scene, v, p);
    default:
#include "scene/volumes.inl"
#undef VOLUME
    }
}

KFN void volume_adj(const SceneView *scene, const VolumeNode *v, Vec3 p, Spec d, int32_t at, Vec3 *dp, Sink *sink, Mask m) {
    switch (v->kind) {
#define VOLUME(ENUM, prefix, name)                                                                                     \
    case VOLUME_##ENUM:                                                                                                \
        prefix##_adj(scene, v, p, d, at, dp, sink, m);                                                                 \
        break;
#include "scene/volumes.inl"
#undef VOLUME
    default:
        break;
    }
}

// ---- in the world ------------------------------------------------------------------------------------------------

KFN bool volume_moves(const SceneView *scene, const VolumeNode *v, const Sink *sink) {
    return sink->any_volumes && sink->volume_at[v - scene->volumes] >= 0;
}

// The adjoint of a point of the world, given that in the volume's space.
KFN Vec3 volume_to_world_adj(const SceneView *scene, const VolumeNode *v, Vec3 dq) {
    if (v->table < 0) {
        return dq;
    }
    const float *r = scene->tables + v->table;
    return v3(r[0] * dq.x + r[4] * dq.y + r[8] * dq.z, r[1] * dq.x + r[5] * dq.y + r[9] * dq.z,
              r[2] * dq.x + r[6] * dq.y + r[10] * dq.z);
}

// The slope of d . f at a point of the world, f a grid.
KFN Vec3 volume_slope(const SceneView *scene, const VolumeNode *v, Vec3 p, Spec d) {
    Voxels s = voxels_around(v, volume_to_local(scene, v, p, 1));
    Float along[8];
    for (int k = 0; k < s.count; k++) {
        along[k] = spec_dot(d, voxel_value(scene, v, s.at[k]));
    }
    return volume_to_world_adj(scene, v, voxels_slope(v, &s, along));
}

// Adds the adjoint dq of a fixed point of the world, which is q in the volume's space: q = M^-1 p moves by -M^-1 dM q.
KFN void volume_place_adj(const SceneView *scene, const VolumeNode *v, Vec3 q, Vec3 dq, Sink *sink, Mask m) {
    const int32_t at = sink->volume_at[v - scene->volumes];
    Vec3 back = volume_to_world_adj(scene, v, dq);
    const Float d[3] = {-back.x, -back.y, -back.z};
    for (int i = 0; i < 3; i++) {
        sink_add_uniform(sink, at + 4 * i, d[i] * q.x, m);
        sink_add_uniform(sink, at + 4 * i + 1, d[i] * q.y, m);
        sink_add_uniform(sink, at + 4 * i + 2, d[i] * q.z, m);
        sink_add_uniform(sink, at + 4 * i + 3, d[i], m);
    }
}

// The adjoint d of the field at a point p of the world, which is fixed.
KFN void volume_world_adj(const SceneView *scene, const VolumeNode *v, Vec3 p, Spec d, Sink *sink, Mask m) {
    Vec3 q = volume_to_local(scene, v, p, 1), dq = v3_zero();
    bool moves = volume_moves(scene, v, sink);
    volume_adj(scene, v, q, d, sink->texture_at[v->texture], moves ? &dq : NULL, sink, m);
    if (moves) {
        volume_place_adj(scene, v, q, dq, sink, m);
    }
}
