// leaf_kernels.c: the leaves of leaf_checks.h at one width and precision; compiled once for each.
#include "math/leaf_checks.h"
#include "math/microfacet.h"
#include "math/rng.h"

#ifdef REAL_DOUBLE
#define LEAF_NAME(name) name##_double
#else
#define LEAF_NAME(name) KNAME(name)
#endif

KFN Vec3 at3(const Float *p) { return v3(p[0], p[1], p[2]); }
KFN Spec spec_at(const Float *p) { return (Spec){{p[0], p[1], p[2]}}; }
KFN Microfacet microfacet_at(const Float *p, bool ggx, bool visible) {
    return microfacet_make(ggx, visible, p[0], p[1]);
}
KFN void put3(Float *p, Vec3 v) {
    p[0] = v.x;
    p[1] = v.y;
    p[2] = v.z;
}
KFN Frame frame_at(const Float *p) { return (Frame){.s = at3(p), .t = at3(p + 3), .n = at3(p + 6)}; }
// The normal on v's own side: masking is then decided by v alone.
KFN Vec3 up(void) { return v3(f_set(0), f_set(0), f_set(1)); }

static void leaf_value(int leaf, const Float *in, Float *out) {
    Float unused;
    switch (leaf) {
    case LEAF_DIELECTRIC: out[0] = fresnel_dielectric(in[0], in[1], &out[1], &unused, &unused); break;
    case LEAF_CONDUCTOR: {
        Spec f = fresnel_conductor(in[0], spec_at(in + 1), spec_at(in + 4));
        memcpy(out, f.c, sizeof f.c);
        break;
    }
    case LEAF_DIFFUSE_REFLECTANCE: out[0] = fresnel_diffuse_reflectance(in[0]); break;
    case LEAF_SCHLICK: out[0] = schlick_weight(in[0]); break;
    case LEAF_D_GGX:
    case LEAF_D_BECKMANN: {
        Microfacet mf = microfacet_at(in, leaf == LEAF_D_GGX, true);
        out[0] = microfacet_D(&mf, at3(in + 2));
        break;
    }
    case LEAF_G1_GGX:
    case LEAF_G1_BECKMANN: {
        Microfacet mf = microfacet_at(in, leaf == LEAF_G1_GGX, true);
        out[0] = smith_G1(&mf, at3(in + 2), up());
        break;
    }
    case LEAF_AREA_GGX:
    case LEAF_AREA_BECKMANN: {
        Microfacet mf = microfacet_at(in, leaf == LEAF_AREA_GGX, true);
        out[0] = microfacet_projected_area(&mf, at3(in + 2));
        break;
    }
    case LEAF_SAMPLE_GGX:
    case LEAF_SAMPLE_BECKMANN: {
        Microfacet mf = microfacet_at(in, leaf == LEAF_SAMPLE_GGX, true);
        put3(out, microfacet_sample(&mf, at3(in + 2), in[5], in[6]));
        break;
    }
    case LEAF_SAMPLE_ALL_GGX:
    case LEAF_SAMPLE_ALL_BECKMANN: {
        Microfacet mf = microfacet_at(in, leaf == LEAF_SAMPLE_ALL_GGX, false);
        put3(out, microfacet_sample(&mf, up(), in[2], in[3]));
        break;
    }
    case LEAF_CROSS: put3(out, v3_cross(at3(in), at3(in + 3))); break;
    case LEAF_NORMALIZE: put3(out, v3_normalize(at3(in))); break;
    case LEAF_TO_LOCAL: {
        Frame f = frame_at(in);
        put3(out, frame_to_local(&f, at3(in + 9)));
        break;
    }
    case LEAF_EXP: out[0] = f_exp(in[0]); break;
    case LEAF_LOG: out[0] = f_log(in[0]); break;
    case LEAF_SINCOS: f_sincos(in[0], &out[0], &out[1]); break;
    case LEAF_ATAN2: out[0] = f_atan2(in[0], in[1]); break;
    case LEAF_ACOS: out[0] = f_acos(in[0]); break;
    case LEAF_ERFINV: out[0] = f_erfinv(in[0]); break;
    case LEAF_ERF: out[0] = f_erf(in[0]); break;
    default: break;
    }
}

static void leaf_adj(int leaf, const Float *in, const Float *dout, Float *din) {
    switch (leaf) {
    case LEAF_DIELECTRIC: fresnel_dielectric_adj(in[0], in[1], dout[0], dout[1], &din[0], &din[1]); break;
    case LEAF_CONDUCTOR: {
        Spec deta = spec_at(din + 1), dk = spec_at(din + 4);
        fresnel_conductor_adj(in[0], spec_at(in + 1), spec_at(in + 4), spec_at(dout), &din[0], &deta, &dk);
        memcpy(din + 1, deta.c, sizeof deta.c);
        memcpy(din + 4, dk.c, sizeof dk.c);
        break;
    }
    case LEAF_DIFFUSE_REFLECTANCE: fresnel_diffuse_reflectance_adj(in[0], dout[0], &din[0]); break;
    case LEAF_SCHLICK: schlick_weight_adj(in[0], dout[0], &din[0]); break;
    case LEAF_D_GGX:
    case LEAF_D_BECKMANN:
    case LEAF_G1_GGX:
    case LEAF_G1_BECKMANN: {
        Microfacet mf = microfacet_at(in, leaf == LEAF_D_GGX || leaf == LEAF_G1_GGX, true);
        Float du = f_set(0), dv = f_set(0);
        Vec3 d3 = at3(din + 2);
        if (leaf == LEAF_D_GGX || leaf == LEAF_D_BECKMANN) {
            microfacet_D_adj(&mf, at3(in + 2), dout[0], &du, &dv, &d3);
        } else {
            smith_G1_adj(&mf, at3(in + 2), up(), dout[0], &du, &dv, &d3);
        }
        microfacet_alpha_adj(in[0], du, &din[0]);
        microfacet_alpha_adj(in[1], dv, &din[1]);
        put3(din + 2, d3);
        break;
    }
    case LEAF_CROSS: {
        Vec3 da = at3(din), db = at3(din + 3);
        v3_cross_adj(at3(in), at3(in + 3), at3(dout), &da, &db);
        put3(din, da);
        put3(din + 3, db);
        break;
    }
    case LEAF_NORMALIZE: {
        Vec3 da = at3(din);
        v3_normalize_adj(at3(in), at3(dout), &da);
        put3(din, da);
        break;
    }
    case LEAF_TO_LOCAL: {
        Frame f = frame_at(in), df = frame_at(din);
        Vec3 dv = at3(din + 9);
        frame_to_local_adj(&f, at3(in + 9), at3(dout), &df, &dv);
        put3(din, df.s);
        put3(din + 3, df.t);
        put3(din + 6, df.n);
        put3(din + 9, dv);
        break;
    }
    default: break;
    }
}

// LANES rows of LEAF_MAX numbers from p, one number of each per Float. Rows from count on repeat the last one.
static void load_rows(const double *p, int count, Float *x) {
    for (int j = 0; j < LEAF_MAX; j++) {
        real lanes[LANES];
        for (int lane = 0; lane < LANES; lane++) {
            lanes[lane] = (real)p[(lane < count ? lane : count - 1) * LEAF_MAX + j];
        }
        x[j] = f_load(lanes);
    }
}
static void store_rows(double *p, int count, const Float *x) {
    for (int j = 0; j < LEAF_MAX; j++) {
        for (int lane = 0; lane < LANES && lane < count; lane++) {
            p[lane * LEAF_MAX + j] = (double)f_lane(x[j], lane);
        }
    }
}

void LEAF_NAME(leaf_value)(int leaf, int count, const double *in, double *out) {
    for (int i = 0; i < count; i += LANES) {
        Float x[LEAF_MAX], y[LEAF_MAX];
        load_rows(in + i * LEAF_MAX, count - i, x);
        for (int j = 0; j < LEAF_MAX; j++) {
            y[j] = f_set(0);
        }
        leaf_value(leaf, x, y);
        store_rows(out + i * LEAF_MAX, count - i, y);
    }
}

void LEAF_NAME(leaf_adj)(int leaf, int count, const double *in, const double *dout, double *din) {
    for (int i = 0; i < count; i += LANES) {
        Float x[LEAF_MAX], dy[LEAF_MAX], dx[LEAF_MAX];
        load_rows(in + i * LEAF_MAX, count - i, x);
        load_rows(dout + i * LEAF_MAX, count - i, dy);
        load_rows(din + i * LEAF_MAX, count - i, dx);
        leaf_adj(leaf, x, dy, dx);
        store_rows(din + i * LEAF_MAX, count - i, dx);
    }
}

void LEAF_NAME(leaf_rng)(unsigned pixel, unsigned scramble, unsigned dimension, bool sobol, int count, float *out) {
    for (int i = 0; i < count; i += LANES) {
        SampleKey key = {u_set(pixel), (UInt)(i_iota() + i), scramble, sobol};
        Vec2 two = rng_2d(&key, dimension);
        Float one = rng_1d(&key, dimension + 1);
        for (int lane = 0; lane < LANES && i + lane < count; lane++) {
            out[3 * (i + lane) + 0] = (float)f_lane(two.x, lane);
            out[3 * (i + lane) + 1] = (float)f_lane(two.y, lane);
            out[3 * (i + lane) + 2] = (float)f_lane(one, lane);
        }
    }
}
