// kinds.h: what the tests of scattering functions, textures and lights share: small scenes held in double, and the
// kernels on them, compiled in float at every width and in double throughout (theta and tables included).
#pragma once

#include "scene/scene.h"

#include <stdbool.h>

enum { CASE_THETA = 768, CASE_TEXTURES = 48, CASE_BSDFS = 4, CASE_SHAPES = 2, CASE_TABLES = 1024 };

// No float in here: the double build reads the same bytes.
typedef struct CaseEmitter {
    int32_t kind, shape, slot[MAX_EMITTER_SLOTS], table;
    int32_t places; // bits: slots that are positions or poses
    bool gathered;  // handled as one of a family
} CaseEmitter;
typedef struct CaseShape {
    int32_t kind, flags, triangle_count, positions, uvs, table, area_cdf;
    double area;
} CaseShape;

typedef struct KindCase {
    int32_t theta_count, texture_count, bsdf_count, root, emitter_count, shape_count;
    double theta[CASE_THETA], low[CASE_THETA], high[CASE_THETA];
    int32_t owner[CASE_THETA];  // for coverage: slot of the root kind, -1 = none
    TextureNode textures[CASE_TEXTURES];
    BsdfNode bsdfs[CASE_BSDFS];
    CaseShape shapes[CASE_SHAPES];
    CaseEmitter emitter;
    int32_t triangles[6];
    double tables[CASE_TABLES];
    int32_t coat_eta, coat_alpha; // theta entries that the table depends on, -1 = the table is fixed
    double coat_base[2];          // their values when the table was made
    double floor;
    double surface[6]; // dp_du and dp_dv in the shading frame: ux, vx, vy; the geometric normal
} KindCase;

typedef struct Query {
    double wi[3], wo[3], uv[2];
    int32_t lobe;
} Query;

typedef struct Draw {
    double wi[3], uv[2], u1, u2[2];
    double wo[3], eta; // out
    int32_t lobe;
} Draw;

// Adjoint of one query: df in; the others out.
typedef struct Adjoint {
    double df[3];
    double dpdf;        // in: of the density, whose floor is 0 then
    double turn[3], u1; // delta lobes: adjoint of the sampled direction, in; u1 samples the lobe
    double dwi[3], dwo[3], duv[2], dsurface[3];
    double forward; // along `tangent`
} Adjoint;

// A point on a light.
typedef struct LightDraw {
    double ref[3], u[2];
    double d[3], distance, pdf, uv[2], radiance[3]; // out
    int32_t valid;
} LightDraw;

typedef struct KindKernels {
    const char *name;
    int lanes;
    void (*eval)(const KindCase *c, int n, const Query *q, double (*f)[3], double *pdf);
    void (*sample)(const KindCase *c, int n, Draw *d);
    // Reverse when gradient is not null (theta_count numbers, added to), and forward along tangent when that is not.
    void (*adj)(const KindCase *c, int n, const Query *q, Adjoint *a, double *gradient, const double *tangent);
    // A texture alone, read as colour or as number.
    void (*texture)(const KindCase *c, int id, int n, const double (*uv)[2], double (*f)[3], double *number);
    void (*light_sample)(const KindCase *c, int n, LightDraw *d);
    // Density of a direction that meets the light; d->uv is filled in. Zero when it is missed.
    void (*light_pdf)(const KindCase *c, int n, LightDraw *d);
    void (*light_eval)(const KindCase *c, int n, LightDraw *d);
    void (*light_adj)(const KindCase *c, int n, const LightDraw *d, Adjoint *a, double *gradient,
                      const double *tangent);
    // The same, and of where the light lies: dwo of a is the adjoint of the sample's direction, in.
    void (*light_move_adj)(const KindCase *c, int n, const LightDraw *d, Adjoint *a, double *gradient,
                           const double *tangent);
} KindKernels;

extern const KindKernels kind_kernels_double, kind_kernels_w1, kind_kernels_w8, kind_kernels_w16;
