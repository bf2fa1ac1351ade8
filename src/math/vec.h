// vec.h: three-vectors, frames and colours on wide floats, with the adjoints of what needs one.
#pragma once

#include "math/functions.h"

typedef struct Vec2 {
    Float x, y;
} Vec2;

typedef struct Vec3 {
    Float x, y, z;
} Vec3;

KFN Vec3 v3(Float x, Float y, Float z) { return (Vec3){x, y, z}; }
KFN Vec3 v3_zero(void) { return v3(f_set(0), f_set(0), f_set(0)); }
KFN Vec3 v3_add(Vec3 a, Vec3 b) { return v3(a.x + b.x, a.y + b.y, a.z + b.z); }
KFN Vec3 v3_sub(Vec3 a, Vec3 b) { return v3(a.x - b.x, a.y - b.y, a.z - b.z); }
KFN Vec3 v3_neg(Vec3 a) { return v3(-a.x, -a.y, -a.z); }
KFN Vec3 v3_scale(Vec3 a, Float s) { return v3(a.x * s, a.y * s, a.z * s); }
KFN Vec3 v3_madd(Vec3 a, Float s, Vec3 b) { return v3(a.x + s * b.x, a.y + s * b.y, a.z + s * b.z); } // a + s b
KFN Float v3_dot(Vec3 a, Vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
KFN Vec3 v3_cross(Vec3 a, Vec3 b) {
    return v3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
}
KFN Float v3_length(Vec3 a) { return f_sqrt(v3_dot(a, a)); }
// a / |a|, and the zero vector for a zero vector.
KFN Vec3 v3_normalize(Vec3 a) { return v3_scale(a, f_safe_rcp(v3_length(a))); }
KFN Vec3 v3_select(Mask m, Vec3 a, Vec3 b) {
    return v3(f_select(m, a.x, b.x), f_select(m, a.y, b.y), f_select(m, a.z, b.z));
}
KFN void v3_acc(Vec3 *a, Vec3 b) { *a = v3_add(*a, b); }
// Accumulates the adjoint of y = a / |a| into da.
KFN void v3_normalize_adj(Vec3 a, Vec3 dy, Vec3 *da) {
    // y = a r, r = 1/|a|: da = (dy - y (y . dy)) r
    Float r = f_safe_rcp(v3_length(a));
    Vec3 y = v3_scale(a, r);
    v3_acc(da, v3_scale(v3_madd(dy, -v3_dot(y, dy), y), r));
}
KFN void v3_cross_adj(Vec3 a, Vec3 b, Vec3 dy, Vec3 *da, Vec3 *db) {
    // y = a x b: da = b x dy, db = dy x a
    v3_acc(da, v3_cross(b, dy));
    v3_acc(db, v3_cross(dy, a));
}

// Orthonormal frame: s, t, n (n is the shading normal).
typedef struct Frame {
    Vec3 s, t, n;
} Frame;

KFN Vec3 frame_to_local(const Frame *f, Vec3 v) { return v3(v3_dot(f->s, v), v3_dot(f->t, v), v3_dot(f->n, v)); }
KFN Vec3 frame_to_world(const Frame *f, Vec3 v) {
    return v3_madd(v3_madd(v3_scale(f->s, v.x), v.y, f->t), v.z, f->n);
}
// Accumulates the adjoint of y = frame_to_local(f, v).
KFN void frame_to_local_adj(const Frame *f, Vec3 v, Vec3 dy, Frame *df, Vec3 *dv) {
    // y.x = s . v, y.y = t . v, y.z = n . v
    v3_acc(&df->s, v3_scale(v, dy.x));
    v3_acc(&df->t, v3_scale(v, dy.y));
    v3_acc(&df->n, v3_scale(v, dy.z));
    v3_acc(dv, frame_to_world(f, dy));
}

// What the frame makes of the adjoint dy of frame_to_world(f, v).
KFN void frame_to_world_adj(Vec3 v, Vec3 dy, Frame *df) {
    // y = s v.x + t v.y + n v.z
    v3_acc(&df->s, v3_scale(dy, v.x));
    v3_acc(&df->t, v3_scale(dy, v.y));
    v3_acc(&df->n, v3_scale(dy, v.z));
}

// A tangent for a normal without a parameterisation [duff2017 listing 3].
KFN Frame frame_from_normal(Vec3 n) {
    Float sign = f_sign(n.z);
    Float a = -1.0f / (sign + n.z);
    Float b = n.x * n.y * a;
    Frame f;
    f.s = v3(1.0f + sign * n.x * n.x * a, sign * b, -sign * n.x);
    f.t = v3(b, sign + n.y * n.y * a, -n.y);
    f.n = n;
    return f;
}

// Colour: an opaque type of SPEC_N channels (linear sRGB now).
enum { SPEC_N = 3 };

typedef struct Spec {
    Float c[SPEC_N];
} Spec;

KFN Spec spec_set(Float x) {
    Spec s;
    for (int i = 0; i < SPEC_N; i++) {
        s.c[i] = x;
    }
    return s;
}
KFN Spec spec_zero(void) { return spec_set(f_set(0)); }
KFN Spec spec_add(Spec a, Spec b) {
    for (int i = 0; i < SPEC_N; i++) {
        a.c[i] = a.c[i] + b.c[i];
    }
    return a;
}
KFN Spec spec_sub(Spec a, Spec b) {
    for (int i = 0; i < SPEC_N; i++) {
        a.c[i] = a.c[i] - b.c[i];
    }
    return a;
}
KFN Spec spec_mul(Spec a, Spec b) {
    for (int i = 0; i < SPEC_N; i++) {
        a.c[i] = a.c[i] * b.c[i];
    }
    return a;
}
KFN Spec spec_scale(Spec a, Float s) {
    for (int i = 0; i < SPEC_N; i++) {
        a.c[i] = a.c[i] * s;
    }
    return a;
}
KFN Spec spec_madd(Spec a, Float s, Spec b) { return spec_add(a, spec_scale(b, s)); } // a + s b
KFN void spec_acc(Spec *a, Spec b) { *a = spec_add(*a, b); }
KFN Float spec_dot(Spec a, Spec b) {
    Float sum = f_set(0);
    for (int i = 0; i < SPEC_N; i++) {
        sum = sum + a.c[i] * b.c[i];
    }
    return sum;
}
KFN Float spec_sum(Spec a) { return spec_dot(a, spec_set(f_set(1))); }
KFN Float spec_mean(Spec a) { return spec_sum(a) * (1.0f / SPEC_N); }
KFN Float spec_max(Spec a) {
    Float m = a.c[0];
    for (int i = 1; i < SPEC_N; i++) {
        m = f_max(m, a.c[i]);
    }
    return m;
}
KFN Spec spec_select(Mask m, Spec a, Spec b) {
    for (int i = 0; i < SPEC_N; i++) {
        a.c[i] = f_select(m, a.c[i], b.c[i]);
    }
    return a;
}
KFN Spec spec_zero_unless(Mask m, Spec a) { return spec_select(m, a, spec_zero()); }
