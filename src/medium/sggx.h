// sggx.h: specular microflakes with the SGGX distribution of normals [heitz2015]: p = D(h) / (4 sigma(wi)), where
// sigma(w)^2 = w' S w is the projected area (eq. 6), D(h) = |S|^(3/2) / (pi (h' adj(S) h)^2) (eq. 9 with the inverse
// written as adjugate over determinant), and h the half vector.
#pragma once

#include "math/warp.h"
#include "medium/phase_record.h"

#define SGGX_PARAMS(P) P(MATRIX, S, 0, -INFINITY, INFINITY, "shape of the flakes: xx, yy, zz, xy, xz, yz; positive definite")
PHASE_RECORD(Sggx, SGGX_PARAMS)

enum { SGGX_XX, SGGX_YY, SGGX_ZZ, SGGX_XY, SGGX_XZ, SGGX_YZ };

// v' S v
KFN Float sggx_form(const Float *s, Vec3 v) {
    return s[SGGX_XX] * v.x * v.x + s[SGGX_YY] * v.y * v.y + s[SGGX_ZZ] * v.z * v.z +
           2.0f * (s[SGGX_XY] * v.x * v.y + s[SGGX_XZ] * v.x * v.z + s[SGGX_YZ] * v.y * v.z);
}

// S v
KFN Vec3 sggx_times(const Float *s, Vec3 v) {
    return v3(s[SGGX_XX] * v.x + s[SGGX_XY] * v.y + s[SGGX_XZ] * v.z,
              s[SGGX_XY] * v.x + s[SGGX_YY] * v.y + s[SGGX_YZ] * v.z,
              s[SGGX_XZ] * v.x + s[SGGX_YZ] * v.y + s[SGGX_ZZ] * v.z);
}

// Accumulates the adjoint d of v' S v into ds.
KFN void sggx_form_adj(Vec3 v, Float d, Float *ds) {
    ds[SGGX_XX] = ds[SGGX_XX] + d * v.x * v.x;
    ds[SGGX_YY] = ds[SGGX_YY] + d * v.y * v.y;
    ds[SGGX_ZZ] = ds[SGGX_ZZ] + d * v.z * v.z;
    ds[SGGX_XY] = ds[SGGX_XY] + 2.0f * d * v.x * v.y;
    ds[SGGX_XZ] = ds[SGGX_XZ] + 2.0f * d * v.x * v.z;
    ds[SGGX_YZ] = ds[SGGX_YZ] + 2.0f * d * v.y * v.z;
}

// The adjugate, and the determinant.
KFN Float sggx_adjugate(const Float *s, Float *a) {
    a[SGGX_XX] = s[SGGX_YY] * s[SGGX_ZZ] - s[SGGX_YZ] * s[SGGX_YZ];
    a[SGGX_YY] = s[SGGX_XX] * s[SGGX_ZZ] - s[SGGX_XZ] * s[SGGX_XZ];
    a[SGGX_ZZ] = s[SGGX_XX] * s[SGGX_YY] - s[SGGX_XY] * s[SGGX_XY];
    a[SGGX_XY] = s[SGGX_XZ] * s[SGGX_YZ] - s[SGGX_XY] * s[SGGX_ZZ];
    a[SGGX_XZ] = s[SGGX_XY] * s[SGGX_YZ] - s[SGGX_XZ] * s[SGGX_YY];
    a[SGGX_YZ] = s[SGGX_XY] * s[SGGX_XZ] - s[SGGX_YZ] * s[SGGX_XX];
    return s[SGGX_XX] * a[SGGX_XX] + s[SGGX_XY] * a[SGGX_XY] + s[SGGX_XZ] * a[SGGX_XZ];
}

// Accumulates the adjoints da of the adjugate and ddet of the determinant into ds.
KFN void sggx_adjugate_adj(const Float *s, const Float *a, const Float *da, Float ddet, Float *ds) {
    // det: its gradient is the adjugate, twice that off the diagonal
    for (int i = 0; i < 6; i++) {
        ds[i] = ds[i] + (i < 3 ? ddet : 2.0f * ddet) * a[i];
    }
    const Float *x = da;
    ds[SGGX_XX] = ds[SGGX_XX] + x[SGGX_YY] * s[SGGX_ZZ] + x[SGGX_ZZ] * s[SGGX_YY] - x[SGGX_YZ] * s[SGGX_YZ];
    ds[SGGX_YY] = ds[SGGX_YY] + x[SGGX_XX] * s[SGGX_ZZ] + x[SGGX_ZZ] * s[SGGX_XX] - x[SGGX_XZ] * s[SGGX_XZ];
    ds[SGGX_ZZ] = ds[SGGX_ZZ] + x[SGGX_XX] * s[SGGX_YY] + x[SGGX_YY] * s[SGGX_XX] - x[SGGX_XY] * s[SGGX_XY];
    ds[SGGX_XY] = ds[SGGX_XY] - 2.0f * x[SGGX_ZZ] * s[SGGX_XY] - x[SGGX_XY] * s[SGGX_ZZ] + x[SGGX_XZ] * s[SGGX_YZ] +
                  x[SGGX_YZ] * s[SGGX_XZ];
    ds[SGGX_XZ] = ds[SGGX_XZ] - 2.0f * x[SGGX_YY] * s[SGGX_XZ] - x[SGGX_XZ] * s[SGGX_YY] + x[SGGX_XY] * s[SGGX_YZ] +
                  x[SGGX_YZ] * s[SGGX_XY];
    ds[SGGX_YZ] = ds[SGGX_YZ] - 2.0f * x[SGGX_XX] * s[SGGX_YZ] - x[SGGX_YZ] * s[SGGX_XX] + x[SGGX_XY] * s[SGGX_XZ] +
                  x[SGGX_XZ] * s[SGGX_XY];
}

// The projected area of the flakes from a direction: the cross section of a medium of flakes is proportional to it.
KFN Float sggx_area(const Sggx *p, Vec3 w) { return f_safe_sqrt(sggx_form(p->S.m, w)); }

KFN Float sggx_eval(const Sggx *p, Vec3 wi, Vec3 wo) {
    Float a[6], det = f_max(sggx_adjugate(p->S.m, a), f_set(0));
    Float form = sggx_form(a, v3_normalize(v3_add(wi, wo)));
    return det * f_sqrt(det) * (INV_PI * 0.25f) * f_safe_rcp(form * form * sggx_area(p, wi));
}

KFN Float sggx_pdf(const Sggx *p, Vec3 wi, Vec3 wo) { return sggx_eval(p, wi, wo); }

// A normal among those visible from wi (supplemental listing 2): of a sphere stretched by S, seen in a frame around wi.
KFN Vec3 sggx_sample(const Sggx *p, Vec3 wi, Float u1, Vec2 u2) {
    UNUSED(u1);
    Frame f = frame_from_normal(wi);
    const Float *s = p->S.m;
    Vec3 sk = sggx_times(s, f.s), sj = sggx_times(s, f.t), si = sggx_times(s, f.n);
    Float kk = v3_dot(f.s, sk), jj = v3_dot(f.t, sj), ii = v3_dot(f.n, si);
    Float kj = v3_dot(f.s, sj), ki = v3_dot(f.s, si), ji = v3_dot(f.t, si);
    Float det = f_max(kk * jj * ii - kj * kj * ii - ki * ki * jj - ji * ji * kk + 2.0f * kj * ki * ji, f_set(0));
    Float rcp_ii = f_safe_rcp(f_safe_sqrt(ii)), minor = f_safe_sqrt(jj * ii - ji * ji), rcp_minor = f_safe_rcp(minor);
    Vec3 mk = v3(f_sqrt(det) * rcp_minor, f_set(0), f_set(0));
    Vec3 mj = v3(-rcp_ii * (ki * ji - kj * ii) * rcp_minor, rcp_ii * minor, f_set(0));
    Vec3 mi = v3(rcp_ii * ki, rcp_ii * ji, rcp_ii * ii);
    // Uniform over the visible half, by area.
    Vec3 on = warp_cosine_hemisphere(u2);
    Vec3 local = v3_madd(v3_madd(v3_scale(mk, on.x), on.y, mj), on.z, mi);
    Vec3 m = frame_to_world(&f, v3_normalize(local));
    return v3_normalize(v3_sub(v3_scale(m, 2.0f * v3_dot(wi, m)), wi));
}

KFN void sggx_adj(const Sggx *p, Vec3 wi, Vec3 wo, Float df, Sggx *dp, Vec3 *dwi, Vec3 *dwo) {
    const Float *s = p->S.m;
    Vec3 v = v3_add(wi, wo), h = v3_normalize(v), dv = v3_zero();
    Float a[6], da[6], det = f_max(sggx_adjugate(s, a), f_set(0)), form = sggx_form(a, h), area2 = sggx_form(s, wi);
    Float weighted = df * sggx_eval(p, wi, wo);
    // p = det^(3/2) / (4 pi form^2 sqrt(area2))
    Float ddet = 1.5f * weighted * f_safe_rcp(det), dform = -2.0f * weighted * f_safe_rcp(form);
    Float darea2 = -0.5f * weighted * f_safe_rcp(area2);
    // area2 = wi' S wi
    sggx_form_adj(wi, darea2, dp->S.m);
    v3_acc(dwi, v3_scale(sggx_times(s, wi), 2.0f * darea2));
    // form = h' A h, h = (wi + wo) / |wi + wo|
    for (int i = 0; i < 6; i++) {
        da[i] = f_set(0);
    }
    sggx_form_adj(h, dform, da);
    v3_normalize_adj(v, v3_scale(sggx_times(a, h), 2.0f * dform), &dv);
    v3_acc(dwi, dv);
    v3_acc(dwo, dv);
    // A, det of S
    sggx_adjugate_adj(s, a, da, ddet, dp->S.m);
}
