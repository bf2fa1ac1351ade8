// phase_kernels.c: the kernels of phase_kernels.h at one width and precision; compiled once for each. The double build
// replaces `float` as a whole, as in kernels.c.
#include <math.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#ifdef REAL_DOUBLE
#define float double
#define KERNELS phase_kernels_double
#define KERNELS_NAME "double"
#else
#define KERNELS KNAME(phase_kernels)
#define KERNELS_NAME "float"
#endif

#include "gather.h"
#include "medium/phase.h"
#include "phase_kernels.h"

typedef struct View {
    SceneView scene;
    int32_t texture_at[PHASE_TEXTURES], to_uv_at[PHASE_TEXTURES];
    float theta[PHASE_THETA], tables[PHASE_THETA], tangent[PHASE_THETA];
} View;

static void view_make(const PhaseCase *c, View *v) {
    memset(v, 0, sizeof *v);
    for (int i = 0; i < PHASE_THETA; i++) {
        v->theta[i] = (float)c->theta[i];
        v->tables[i] = (float)c->tables[i];
    }
    for (int i = 0; i < PHASE_TEXTURES; i++) {
        v->texture_at[i] = c->textures[i].theta;
        v->to_uv_at[i] = -1;
    }
    v->scene.theta = v->theta;
    v->scene.tables = v->tables;
    v->scene.textures = (TextureNode *)(uintptr_t)c->textures;
    v->scene.volumes = (VolumeNode *)(uintptr_t)c->volumes;
    v->scene.phases = (PhaseNode *)(uintptr_t)c->nodes;
}

#define CALL(uv) {&view.scene, c->root, texcoord(uv, &hit), (real)c->floor}
#define HIT(uv) {.p = {(uv).x, (uv).y, f_set(0.3f)}}

static void run_eval(const PhaseCase *c, int n, PhaseQuery *q) {
    View view;
    view_make(c, &view);
    for (int first = 0; first < n; first += LANES) {
        Vec3 wi, wo;
        Vec2 uv;
        GATHER3(wi, q[AT(lane)].wi);
        GATHER3(wo, q[AT(lane)].wo);
        GATHER(uv.x, q[AT(lane)].uv[0]);
        GATHER(uv.y, q[AT(lane)].uv[1]);
        Hit hit = HIT(uv);
        PhaseCall call = CALL(uv);
        Float f = phase_eval(&call, wi, wo), pdf = phase_pdf(&call, wi, wo);
        for (int lane = 0; lane < LANES && first + lane < n; lane++) {
            q[first + lane].f = (double)f_lane(f, lane);
            q[first + lane].pdf = (double)f_lane(pdf, lane);
        }
    }
}

static void run_sample(const PhaseCase *c, int n, PhaseDraw *d) {
    View view;
    view_make(c, &view);
    for (int first = 0; first < n; first += LANES) {
        Vec3 wi;
        Vec2 uv, u2;
        Float u1;
        GATHER3(wi, d[AT(lane)].wi);
        GATHER(uv.x, d[AT(lane)].uv[0]);
        GATHER(uv.y, d[AT(lane)].uv[1]);
        GATHER(u1, d[AT(lane)].u1);
        GATHER(u2.x, d[AT(lane)].u2[0]);
        GATHER(u2.y, d[AT(lane)].u2[1]);
        Hit hit = HIT(uv);
        PhaseCall call = CALL(uv);
        Vec3 wo = phase_sample(&call, wi, u1, u2);
        for (int lane = 0; lane < LANES && first + lane < n; lane++) {
            put3(d[first + lane].wo, wo, lane);
        }
    }
}

static void run_adj(const PhaseCase *c, int n, const PhaseQuery *q, PhaseAdjoint *a, double *gradient,
                    const double *tangent) {
    View view;
    view_make(c, &view);
    for (int i = 0; tangent && i < c->theta_count; i++) {
        view.tangent[i] = (float)tangent[i];
    }
    Sink sink = {.gradient = gradient, .tangent = gradient ? NULL : view.tangent, .texture_at = view.texture_at,
                 .to_uv_at = view.to_uv_at, .derivative = f_set(0)};
    for (int first = 0; first < n; first += LANES) {
        Vec3 wi, wo, dwi = v3_zero(), dwo = v3_zero();
        Vec2 uv;
        Float df;
        GATHER3(wi, q[AT(lane)].wi);
        GATHER3(wo, q[AT(lane)].wo);
        GATHER(uv.x, q[AT(lane)].uv[0]);
        GATHER(uv.y, q[AT(lane)].uv[1]);
        GATHER(df, a[AT(lane)].df);
        Hit hit = HIT(uv);
        PhaseCall call = CALL(uv);
        sink.derivative = f_set(0);
        phase_adj(&call, wi, wo, df, &sink, m_first_n(n - first), &dwi, &dwo);
        for (int lane = 0; lane < LANES && first + lane < n; lane++) {
            put3(a[first + lane].dwi, dwi, lane);
            put3(a[first + lane].dwo, dwo, lane);
            a[first + lane].forward = (double)f_lane(sink.derivative, lane);
        }
    }
}

const PhaseKernels KERNELS = {KERNELS_NAME, run_eval, run_sample, run_adj};
