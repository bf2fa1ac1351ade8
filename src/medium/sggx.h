// sggx.h: specular microflakes with the SGGX distribution of normals [heitz2015]: p = D(h) / (4 sigma(wi)), where
// sigma(w)^2 = w' S w is the projected area (eq. 6), D(h) = |S|^(3/2) / (pi (h' adj(S) h)^2) (eq. 9 with the inverse
// written as adjugate over determinant), and h the half vector.
#pragma once

#include "math/warp.h"
#include "medium/flakes.h"

#define SGGX_PARAMS(P) P(MATRIX, S, 0, -INFINITY, INFINITY, "shape of the flakes: xx, yy, zz, xy, xz, yz; positive definite")
PHASE_RECORD(Sggx, SGGX_PARAMS)

// The adjugate, and the determinant.
KFN Float sggx_adjugate(const Float *s, Float *a) {
    a[FLAKES_XX] = s[FLAKES_YY] * s[FLAKES_ZZ] - s[FLAKES_YZ] * s[FLAKES_YZ];
    a[FLAKES_YY] = s[FLAKES_XX] * s[FLAKES_ZZ] - s[FLAKES_XZ] * s[FLAKES_XZ];
    a[FLAKES_ZZ] = s[FLAKES_XX] * s[FLAKES_YY] - s[FLAKES_XY] * s[FLAKES_XY];
    a[FLAKES_XY] = s[FLAKES_XZ] * s[FLAKES_YZ] - s[FLAKES_XY] * s[FLAKES_ZZ];
    a[FLAKES_XZ] = s[FLAKES_XY] * s[FLAKES_YZ] - s[FLAKES_XZ] * s[FLAKES_YY];
    a[FLAKES_YZ] = s[FLAKES_XY] * s[FLAKES_XZ] - s[FLAKES_YZ] * s[FLAKES_XX];
    return s[FLAKES_XX] * a[FLAKES_XX] + s[FLAKES_XY] * a[FLAKES_XY] + s[FLAKES_XZ] * a[FLAKES_XZ];
}

// Accumulates the adjoints da of the adjugate and ddet of the determinant into ds.
KFN void sggx_adjugate_adj(const Float *s, const Float *a, const Float *da, Float ddet, Float *ds) {
    // det: its gradient is the adjugate, twice that off the diagonal
    for (int i = 0; i < 6; i++) {
        ds[i] = ds[i] + (i < 3 ? ddet : 2.0f * ddet) * a[i];
    }
    const Float *x = da;
    ds[FLAKES_XX] = ds[FLAKES_XX] + x[FLAKES_YY] * s[FLAKES_ZZ] + x[FLAKES_ZZ] * s[FLAKES_YY] - x[FLAKES_YZ] * s[FLAKES_YZ];
    ds[FLAKES_YY] = ds[FLAKES_YY] + x[FLAKES_XX] * s[FLAKES_ZZ] + x[FLAKES_ZZ] * s[FLAKES_XX] - x[FLAKES_XZ] * s[FLAKES_XZ];
    ds[FLAKES_ZZ] = ds[FLAKES_ZZ] + x[FLAKES_XX] * s[FLAKES_YY] + x[FLAKES_YY] * s[FLAKES_XX] - x[FLAKES_XY] * s[FLAKES_XY];
    ds[FLAKES_XY] = ds[FLAKES_XY] - 2.0f * x[FLAKES_ZZ] * s[FLAKES_XY] - x[FLAKES_XY] * s[FLAKES_ZZ] + x[FLAKES_XZ] * s[FLAKES_YZ] +
                  x[FLAKES_YZ] * s[FLAKES_XZ];
    ds[FLAKES_XZ] = ds[FLAKES_XZ] - 2.0f * x[FLAKES_YY] * s[FLAKES_XZ] - x[FLAKES_XZ] * s[FLAKES_YY] + x[FLAKES_XY] * s[FLAKES_YZ] +
                  x[FLAKES_YZ] * s[FLAKES_XY];
    ds[FLAKES_YZ] = ds[FLAKES_YZ] - 2.0f * x[FLAKES_XX] * s[FLAKES_YZ] - x[FLAKES_YZ] * s[FLAKES_XX] + x[FLAKES_XY] * s[FLAKES_XZ] +
                  x[FLAKES_XZ] * s[FLAKES_XY];
}

// The projected area of the flakes from a direction: the cross section of a medium of flakes is proportional to it.
KFN Float sggx_area(const Sggx *p, Vec3 w) { return f_safe_sqrt(flakes_form(p->S.m, w)); }

KFN Float sggx_eval(const Sggx *p, Vec3 wi, Vec3 wo) {
    Float a[6], det = f_max(sggx_adjugate(p->S.m, a), f_set(0));
    Float form = flakes_form(a, v3_normalize(v3_add(wi, wo)));
    return det * f_sqrt(det) * (INV_PI * 0.25f) * f_safe_rcp(form * form * sggx_area(p, wi));
}

KFN Float sggx_pdf(const Sggx *p, Vec3 wi, Vec3 wo) { return sggx_eval(p, wi, wo); }

// A normal among those visible from wi (supplemental listing 2): of a sphere stretched by S, seen in a frame around wi.
KFN Vec3 sggx_sample(const Sggx *p, Vec3 wi, Float u1, Vec2 u2) {
    UNUSED(u1);
    Frame f = frame_from_normal(wi);
    const Float *s = p->S.m;
    Vec3 sk = flakes_times(s, f.s), sj = flakes_times(s, f.t), si = flakes_times(s, f.n);
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
    Float a[6], da[6], det = f_max(sggx_adjugate(s, a), f_set(0)), form = flakes_form(a, h), area2 = flakes_form(s, wi);
    Float weighted = df * sggx_eval(p, wi, wo);
    // p = det^(3/2) / (4 pi form^2 sqrt(area2))
    Float ddet = 1.5f * weighted * f_safe_rcp(det), dform = -2.0f * weighted * f_safe_rcp(form);
    Float darea2 = -0.5f * weighted * f_safe_rcp(area2);
    // area2 = wi' S wi
    flakes_form_adj(wi, darea2, dp->S.m);
    v3_acc(dwi, v3_scale(flakes_times(s, wi), 2.0f * darea2));
    // form = h' A h, h = (wi + wo) / |wi + wo|
    for (int i = 0; i < 6; i++) {
        da[i] = f_set(0);
    }
    flakes_form_adj(h, dform, da);
    v3_normalize_adj(v, v3_scale(flakes_times(a, h), 2.0f * dform), &dv);
    v3_acc(dwi, dv);
    v3_acc(dwo, dv);
    // A, det of S
    sggx_adjugate_adj(s, a, da, ddet, dp->S.m);
}
