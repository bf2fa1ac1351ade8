// media_kernels.c: the kernels of media_kernels.h at one width and precision; compiled once for each, as phase_kernels.c.
#include <math.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#ifdef REAL_DOUBLE
#define float double
#define KERNELS media_kernels_double
#else
#define KERNELS KNAME(media_kernels)
#endif

#include "gather.h"
#include "media_kernels.h"
#include "medium/track.h"

typedef struct View {
    SceneView scene;
    float theta[MEDIA_THETA], tables[MEDIA_TABLES], tangent[MEDIA_THETA];
} View;

static void view_make(const MediaCase *c, View *v) {
    memset(v, 0, sizeof *v);
    for (int i = 0; i < MEDIA_THETA; i++) {
        v->theta[i] = (float)c->theta[i];
    }
    for (int i = 0; i < MEDIA_TABLES; i++) {
        v->tables[i] = (float)c->tables[i];
    }
    v->scene.theta = v->theta;
    v->scene.tables = v->tables;
    v->scene.textures = (TextureNode *)(uintptr_t)&c->flakes;
    v->scene.volumes = (VolumeNode *)(uintptr_t)&c->grid;
}

static void run_eval(const MediaCase *c, int n, MediaLookup *q) {
    View view;
    view_make(c, &view);
    for (int first = 0; first < n; first += LANES) {
        Vec3 p;
        GATHER3(p, q[AT(lane)].p);
        Spec s = volume_eval(&view.scene, &c->sigma_t, p);
        for (int k = 0; k < 3 * LANES; k++) {
            if (first + k / 3 < n) {
                q[first + k / 3].value[k % 3] = (double)f_lane(s.c[k % 3], k / 3);
            }
        }
    }
}

static void run_adj(const MediaCase *c, int n, MediaLookup *q, double *gradient, const double *tangent) {
    View view;
    view_make(c, &view);
    for (int i = 0; tangent && i < c->theta_count; i++) {
        view.tangent[i] = (float)tangent[i];
    }
    Sink sink = {.gradient = gradient, .tangent = gradient ? NULL : view.tangent};
    for (int first = 0; first < n; first += LANES) {
        Vec3 p, dp = v3_zero();
        Spec df;
        GATHER3(p, q[AT(lane)].p);
        for (int k = 0; k < 3; k++) {
            GATHER(df.c[k], q[AT(lane)].df[k]);
        }
        sink.derivative = f_set(0);
        volume_adj(&view.scene, &c->sigma_t, p, df, c->sigma_t.theta, &dp, &sink, m_first_n(n - first));
        for (int lane = 0; lane < LANES && first + lane < n; lane++) {
            MediaLookup *to = q + first + lane;
            put3(to->dp, dp, lane);
            to->forward = (double)f_lane(sink.derivative, lane);
        }
    }
}

static void run_flakes(const MediaCase *c, int n, MediaFlakes *q, double *gradient, const double *tangent) {
    View view;
    view_make(c, &view);
    for (int i = 0; tangent && i < c->theta_count; i++) {
        view.tangent[i] = (float)tangent[i];
    }
    const int32_t at = c->flakes.theta, nowhere = -1;
    Sink sink = {.gradient = gradient, .tangent = gradient ? NULL : view.tangent, .texture_at = &at, .volume_at = &nowhere};
    for (int first = 0; first < n; first += LANES) {
        Vec3 p, w, dp = v3_zero(), dw = v3_zero();
        Float d;
        GATHER3(p, q[AT(lane)].p);
        GATHER3(w, q[AT(lane)].w);
        GATHER(d, q[AT(lane)].d);
        sink.derivative = f_set(0);
        Float area = flakes_area(&view.scene, 0, p, w);
        flakes_area_adj(&view.scene, 0, p, w, d, &sink, m_first_n(n - first));
        flakes_area_turn(&view.scene, 0, p, w, d, &dp, &dw);
        for (int lane = 0; lane < LANES && first + lane < n; lane++) {
            MediaFlakes *to = q + first + lane;
            to->area = (double)f_lane(area, lane);
            put3(to->dp, dp, lane);
            put3(to->dw, dw, lane);
            to->forward = (double)f_lane(sink.derivative, lane);
        }
    }
}

// Where the extinction is the largest share of its bound, along the rays of the first lanes.
static void follow_bounds(const View *view, const MediaCase *c, Vec3 o, Vec3 d, Float tmax, Mask m, MediaRay *r) {
    enum { STOPS = 400 };
    Track track = {&view->scene, &view->scene, &c->medium, &c->sigma_t, false, true, NULL, 0};
    MajorantWalk w = track_start(&track, o, d, tmax, m);
    Float bound = f_set(1), sigma = f_set(0);
    Mask left = w.m;
    for (int i = 0; i < STOPS && m_any(left); i++) {
        left = majorant_next(&view->scene, &c->medium, &w, f_set((real)0.05), left);
        Float there = spec_max(walk_extinction(&view->scene, &track, &w, o, d));
        Mask closer = left & m_gt(there * bound, sigma * w.majorant);
        bound = f_select(closer, w.majorant, bound);
        sigma = f_select(closer, there, sigma);
    }
    for (int lane = 0; lane < LANES; lane++) {
        if (i_lane(m, lane)) {
            r[lane].bound = (double)f_lane(bound, lane);
            r[lane].sigma = (double)f_lane(sigma, lane);
        }
    }
}

static void run_track(const MediaCase *c, int n, MediaRay *r) {
    View view;
    view_make(c, &view);
    for (int first = 0; first < n; first += LANES) {
        Vec3 o, d;
        Float tmax;
        int32_t samples[LANES];
        GATHER3(o, r[AT(lane)].o);
        GATHER3(d, r[AT(lane)].d);
        GATHER(tmax, r[AT(lane)].tmax);
        for (int lane = 0; lane < LANES; lane++) {
            samples[lane] = (int32_t)r[AT(lane)].sample;
        }
        SampleKey key = {.pixel = u_set(0), .sample = (UInt)i_load(samples), .scramble = 7, .sobol = false};
        Mask m = m_first_n(n - first);
        if (first == 0 && c->medium.bounded) {
            follow_bounds(&view, c, o, d, tmax, m, r);
        }
        Track track = {&view.scene, &view.scene, &c->medium, &c->sigma_t, false, true, NULL, 0};
        Spec transmittance = track_transmittance(&track, o, d, tmax, m, &key, 0);
        Spec even = spec_set(f_set((real)1 / SPEC_N));
        Flight flight = track_flight(&track, o, d, tmax, even, m, &key, 1u << 20);
        for (int lane = 0; lane < LANES && first + lane < n; lane++) {
            MediaRay *to = r + first + lane;
            for (int k = 0; k < 3; k++) {
                to->transmittance[k] = (double)f_lane(transmittance.c[k], lane);
                to->weight[k] = (double)f_lane(flight.weight.c[k], lane);
            }
            to->t = (double)f_lane(flight.t, lane);
            to->collided = i_lane(flight.real, lane) != 0;
        }
    }
}

const MediaKernels KERNELS = {run_eval, run_adj, run_flakes, run_track};
