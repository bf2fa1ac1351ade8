// kernels.c: the kernels of kinds.h at one width and precision; compiled once for each. The double build replaces
// `float` as a whole, so that parameters and derived tables can be moved by less than a float's rounding.
#include <math.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#ifdef REAL_DOUBLE
#define float double
#define KERNELS kind_kernels_double
#define KERNELS_NAME "double"
#else
#define KERNELS KNAME(kind_kernels)
#define KERNELS_NAME "float"
#endif

#include "bsdf/bsdf.h"
#include "emitter/emitter.h"
#include "gather.h"
#include "kinds.h"

typedef struct View {
    SceneView scene;
    ShapeRecord shapes[CASE_SHAPES];
    EmitterRecord emitter;
    int32_t texture_at[CASE_TEXTURES], to_uv_at[CASE_TEXTURES], place_at[MAX_EMITTER_SLOTS];
    float theta[CASE_THETA], tables[CASE_TABLES], tangent[CASE_THETA];
} View;

// The coat's table follows the parameters to first order: its own derivatives are tested with rough_transmittance.
static void move_coat(const KindCase *c, View *v) {
    if (c->coat_eta < 0) {
        return;
    }
    double da = c->theta[c->coat_alpha] - c->coat_base[0], de = c->theta[c->coat_eta] - c->coat_base[1];
    for (int i = 0; i < COAT_NODES; i++) {
        v->tables[i] = (float)(c->tables[i] + da * c->tables[COAT_BY_ALPHA + i] + de * c->tables[COAT_BY_ETA + i]);
    }
    v->tables[COAT_INTERNAL] = (float)(c->tables[COAT_INTERNAL] + da * c->tables[COAT_INTERNAL + 1] +
                                       de * c->tables[COAT_INTERNAL + 2]);
}

static void view_make(const KindCase *c, View *v) {
    memset(v, 0, offsetof(View, theta));
    for (int i = 0; i < c->theta_count; i++) {
        v->theta[i] = (float)c->theta[i];
    }
    for (int i = 0; i < CASE_TABLES; i++) {
        v->tables[i] = (float)c->tables[i];
    }
    move_coat(c, v);
    for (int i = 0; i < c->texture_count; i++) {
        v->texture_at[i] = c->textures[i].kind == TEXTURE_CHECKERBOARD ? -1 : c->textures[i].theta;
        v->to_uv_at[i] = c->textures[i].to_uv;
    }
    for (int i = 0; i < c->shape_count; i++) {
        const CaseShape *s = c->shapes + i;
        v->shapes[i] = (ShapeRecord){.kind = s->kind, .flags = s->flags, .triangle_count = s->triangle_count,
                                     .positions = s->positions, .uvs = s->uvs, .normals = -1, .to_world = -1,
                                     .table = s->table, .area_cdf = s->area_cdf, .area = (float)s->area};
    }
    const CaseEmitter *e = &c->emitter;
    v->emitter = (EmitterRecord){.kind = e->kind, .shape = e->shape, .table = e->table, .family = -1, .weight = 1};
    for (int i = 0; i < MAX_EMITTER_SLOTS; i++) {
        v->emitter.slot[i] = e->slot[i];
        v->place_at[i] = e->places >> i & 1 ? e->slot[i] : -1;
    }
    if (e->kind == EMITTER_PROJECTOR) {
        v->place_at[SLOT(Projector, x_fov)] = c->textures[e->slot[SLOT(Projector, x_fov)]].theta;
    }
    SceneView *s = &v->scene;
    s->theta = v->theta;
    s->tables = v->tables;
    s->textures = (TextureNode *)(uintptr_t)c->textures;
    s->bsdfs = (BsdfNode *)(uintptr_t)c->bsdfs;
    s->shapes = v->shapes;
    s->triangles = (int32_t *)(uintptr_t)c->triangles;
    s->emitters = &v->emitter;
    s->bounds_radius = 10;
}

static BsdfSurface surface_make(const KindCase *c) {
    real s[6];
    for (int i = 0; i < 6; i++) {
        s[i] = (real)c->surface[i];
    }
    return (BsdfSurface){f_set(s[0]), f_set(s[1]), f_set(s[2]), v3(f_set(s[3]), f_set(s[4]), f_set(s[5]))};
}

static Sink sink_make(View *v, const KindCase *c, double *gradient, const double *tangent) {
    for (int i = 0; tangent && i < c->theta_count; i++) {
        v->tangent[i] = (float)tangent[i];
    }
    return (Sink){.gradient = gradient, .tangent = gradient ? NULL : v->tangent, .texture_at = v->texture_at,
                  .to_uv_at = v->to_uv_at, .place_at = v->place_at, .derivative = f_set(0)};
}

static Int gather_lobe(const Query *q, int first, int n) {
    int32_t lobes[LANES];
    for (int lane = 0; lane < LANES; lane++) {
        lobes[lane] = q[AT(lane)].lobe;
    }
    return i_load(lobes);
}

static void put_spec(double *to, Spec s, int lane) {
    for (int k = 0; k < SPEC_N; k++) {
        to[k] = (double)f_lane(s.c[k], lane);
    }
}

static void run_eval(const KindCase *c, int n, const Query *q, double (*f)[3], double *pdf) {
    View view;
    view_make(c, &view);
    for (int first = 0; first < n; first += LANES) {
        Vec3 wi, wo;
        Vec2 uv;
        GATHER3(wi, q[AT(lane)].wi);
        GATHER3(wo, q[AT(lane)].wo);
        GATHER(uv.x, q[AT(lane)].uv[0]);
        GATHER(uv.y, q[AT(lane)].uv[1]);
        Int lobe = gather_lobe(q, first, n);
        BsdfSurface surface = surface_make(c);
        BsdfCall call = bsdf_call(&view.scene, c->root, texcoord(uv, NULL), (real)c->floor);
        call.surface = &surface;
        Spec value = bsdf_eval(&call, wi, wo, lobe);
        Float density = pdf ? bsdf_pdf(&call, wi, wo, lobe) : f_set(0);
        for (int lane = 0; lane < LANES && first + lane < n; lane++) {
            put_spec(f[first + lane], value, lane);
            if (pdf) {
                pdf[first + lane] = (double)f_lane(density, lane);
            }
        }
    }
}

static void run_sample(const KindCase *c, int n, Draw *d) {
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
        BsdfSurface surface = surface_make(c);
        BsdfCall call = bsdf_call(&view.scene, c->root, texcoord(uv, NULL), (real)c->floor);
        call.surface = &surface;
        BsdfSample s = bsdf_sample(&call, wi, u1, u2);
        for (int lane = 0; lane < LANES && first + lane < n; lane++) {
            Draw *to = d + first + lane;
            put3(to->wo, s.wo, lane);
            to->lobe = i_lane(s.lobe, lane);
            to->eta = (double)f_lane(s.eta, lane);
        }
    }
}

static Spec gather_df(const Adjoint *a, int first, int n) {
    Spec df;
    for (int k = 0; k < SPEC_N; k++) {
        GATHER(df.c[k], a[AT(lane)].df[k]);
    }
    return df;
}

static void run_adj(const KindCase *c, int n, const Query *q, Adjoint *a, double *gradient, const double *tangent) {
    View view;
    view_make(c, &view);
    Sink sink = sink_make(&view, c, gradient, tangent);
    for (int first = 0; first < n; first += LANES) {
        Vec3 wi, wo, dwi = v3_zero(), dwo;
        Vec2 uv, duv = {f_set(0), f_set(0)};
        GATHER3(wi, q[AT(lane)].wi);
        GATHER3(wo, q[AT(lane)].wo);
        GATHER3(dwo, a[AT(lane)].turn);
        GATHER(uv.x, q[AT(lane)].uv[0]);
        GATHER(uv.y, q[AT(lane)].uv[1]);
        BsdfSurface surface = surface_make(c);
        BsdfCall call = bsdf_call(&view.scene, c->root, texcoord(uv, NULL), (real)c->floor);
        call.surface = &surface;
        Mask m = m_first_n(n - first);
        BsdfSurface ds = {f_set(0), f_set(0), f_set(0), v3_zero()};
        call.dsurface = &ds;
        sink.derivative = f_set(0);
        Float dpdf;
        GATHER(dpdf, a[AT(lane)].dpdf);
        bsdf_adj(&call, wi, wo, gather_lobe(q, first, n), spec_zero_unless(m, gather_df(a, first, n)), &sink, m, &dwi,
                 &dwo, &duv);
        bsdf_pdf_adj(&call, wi, wo, f_zero_unless(m, dpdf), &sink, m, &dwi, &dwo, &duv);
        for (int lane = 0; lane < LANES && first + lane < n; lane++) {
            Adjoint *to = a + first + lane;
            put3(to->dwi, dwi, lane);
            put3(to->dwo, dwo, lane);
            put3(to->dsurface, v3(ds.ux, ds.vx, ds.vy), lane);
            to->duv[0] = (double)f_lane(duv.x, lane);
            to->duv[1] = (double)f_lane(duv.y, lane);
            to->forward = (double)f_lane(sink.derivative, lane);
        }
    }
}

static void run_texture(const KindCase *c, int id, int n, const double (*at)[2], double (*f)[3], double *number) {
    View view;
    view_make(c, &view);
    for (int first = 0; first < n; first += LANES) {
        Vec2 uv;
        GATHER(uv.x, at[AT(lane)][0]);
        GATHER(uv.y, at[AT(lane)][1]);
        Spec s = texture_eval(&view.scene, id, texcoord(uv, NULL));
        Float x = texture_eval_real(&view.scene, id, texcoord(uv, NULL));
        for (int lane = 0; lane < LANES && first + lane < n; lane++) {
            put_spec(f[first + lane], s, lane);
            number[first + lane] = (double)f_lane(x, lane);
        }
    }
}

static void put_light(LightDraw *to, const LightSample *s, int lane) {
    put3(to->d, s->d, lane);
    to->distance = (double)f_lane(s->distance, lane);
    to->pdf = (double)f_lane(s->pdf, lane);
    to->uv[0] = (double)f_lane(s->uv.x, lane);
    to->uv[1] = (double)f_lane(s->uv.y, lane);
    to->valid = i_lane(s->valid, lane) != 0;
}

static Light light_of(const KindCase *c, const View *view) {
    return (Light){&view->emitter, i_set(0), c->emitter.gathered};
}

static void run_light_sample(const KindCase *c, int n, LightDraw *d) {
    View view;
    view_make(c, &view);
    Light light = light_of(c, &view);
    for (int first = 0; first < n; first += LANES) {
        Vec3 ref;
        Vec2 u;
        GATHER3(ref, d[AT(lane)].ref);
        GATHER(u.x, d[AT(lane)].u[0]);
        GATHER(u.y, d[AT(lane)].u[1]);
        LightSample s = emitter_sample_as(&view.scene, &light, ref, u);
        for (int lane = 0; lane < LANES && first + lane < n; lane++) {
            put_light(d + first + lane, &s, lane);
        }
    }
}

// Where a ray meets the light's shape, without Embree: its own intersections, first hit.
static Mask meet_triangles(const SceneView *scene, const ShapeRecord *shape, Vec3 o, Vec3 d, Hit *hit) {
    Float nearest = f_set(1e30f);
    Mask found = m_set(false);
    hit->u = hit->v = f_set(0);
    hit->prim = i_set(0);
    for (int32_t k = 0; k < shape->triangle_count; k++) {
        const int32_t *t = scene->triangles + 3 * k;
        Vec3 p[3];
        for (int j = 0; j < 3; j++) {
            const float *at = scene->theta + shape->positions + 3 * t[j];
            p[j] = v3(f_set((real)at[0]), f_set((real)at[1]), f_set((real)at[2]));
        }
        Vec3 e1 = v3_sub(p[1], p[0]), e2 = v3_sub(p[2], p[0]), s = v3_sub(o, p[0]);
        Vec3 pv = v3_cross(d, e2), qv = v3_cross(s, e1);
        Float r = f_safe_rcp(v3_dot(e1, pv));
        Float u = v3_dot(s, pv) * r, v = v3_dot(d, qv) * r, distance = v3_dot(e2, qv) * r;
        Mask inside = m_ge(u, f_set(0)) & m_ge(v, f_set(0)) & m_le(u + v, f_set(1)) & m_gt(distance, f_set(1e-4f)) &
                      m_lt(distance, nearest);
        nearest = f_select(inside, distance, nearest);
        hit->u = f_select(inside, u, hit->u);
        hit->v = f_select(inside, v, hit->v);
        hit->prim = i_select(inside, i_set(k), hit->prim);
        found = found | inside;
    }
    hit->p = v3_madd(o, nearest, d);
    return found;
}

static Mask meet_shape(const SceneView *scene, int32_t id, Vec3 o, Vec3 d, Hit *hit) {
    const ShapeRecord *shape = scene->shapes + id;
    const float *t = scene->tables + shape->table;
    hit->shape = i_set(id);
    if (shape->kind == SHAPE_MESH) {
        return meet_triangles(scene, shape, o, d, hit);
    }
    hit->prim = i_set(0);
    hit->u = hit->v = f_set(0);
    if (shape->kind == SHAPE_SPHERE) {
        Vec3 s = v3_sub(o, v3(f_set((real)t[0]), f_set((real)t[1]), f_set((real)t[2])));
        Float b = v3_dot(s, d), c = v3_dot(s, s) - (real)(t[3] * t[3]), q = b * b - c;
        Float root = f_safe_sqrt(q), near = -b - root, far = -b + root;
        Float distance = f_select(m_gt(near, f_set(0)), near, far);
        hit->p = v3_madd(o, distance, d);
        return m_gt(q, f_set(0)) & m_gt(distance, f_set(0));
    }
    if (shape->kind == SHAPE_CYLINDER) {
        real at[LANES];
        for (int lane = 0; lane < LANES; lane++) {
            float from[3] = {(float)f_lane(o.x, lane), (float)f_lane(o.y, lane), (float)f_lane(o.z, lane)};
            float along[3] = {(float)f_lane(d.x, lane), (float)f_lane(d.y, lane), (float)f_lane(d.z, lane)};
            double local_o[3], local_d[3];
            pose_ray(t, from, along, local_o, local_d);
            at[lane] = (real)cylinder_meet(NULL, 0, local_o, local_d, 0, INFINITY);
        }
        Float distance = f_load(at);
        hit->p = v3_madd(o, distance, d);
        return m_gt(distance, f_set(0));
    }
    const float *r = t + 12; // rows of the inverse
    Float oz = r[8] * o.x + r[9] * o.y + r[10] * o.z + r[11], dz = r[8] * d.x + r[9] * d.y + r[10] * d.z;
    Float distance = -oz * f_safe_rcp(dz);
    hit->p = v3_madd(o, distance, d);
    Float x = r[0] * hit->p.x + r[1] * hit->p.y + r[2] * hit->p.z + r[3];
    Float y = r[4] * hit->p.x + r[5] * hit->p.y + r[6] * hit->p.z + r[7];
    return m_gt(distance, f_set(0)) & m_le(x * x + y * y, f_set(1));
}

static void run_light_pdf(const KindCase *c, int n, LightDraw *draws) {
    View view;
    view_make(c, &view);
    const EmitterRecord *e = &view.emitter;
    for (int first = 0; first < n; first += LANES) {
        Vec3 ref, d;
        GATHER3(ref, draws[AT(lane)].ref);
        GATHER3(d, draws[AT(lane)].d);
        LightSample s = {d, f_set(1), f_set(INV_FOUR_PI), {f_set(0), f_set(0)}, i_set(0), m_set(true)};
        if (e->shape < 0) {
            s.uv = environment_uv(&view.scene, e, d);
            s.pdf = environment_pdf(&view.scene, e, d, s.uv);
        } else {
            const ShapeRecord *shape = view.shapes + e->shape;
            Hit hit;
            Mask met = meet_shape(&view.scene, e->shape, ref, d, &hit);
            Interaction si = shape_interaction(&view.scene, shape->kind, shape->flags, &hit);
            s.valid = met & m_lt(v3_dot(d, si.sh.n), f_set(0));
            s.pdf = f_zero_unless(s.valid, surface_light_pdf(&view.scene, e, ref, d, &si));
            s.uv = si.uv;
            s.distance = v3_length(v3_sub(si.p, ref));
        }
        for (int lane = 0; lane < LANES && first + lane < n; lane++) {
            put_light(draws + first + lane, &s, lane);
        }
    }
}

static void run_light_eval(const KindCase *c, int n, LightDraw *d) {
    View view;
    view_make(c, &view);
    Light light = light_of(c, &view);
    for (int first = 0; first < n; first += LANES) {
        Vec2 uv;
        Float distance;
        GATHER(uv.x, d[AT(lane)].uv[0]);
        GATHER(uv.y, d[AT(lane)].uv[1]);
        GATHER(distance, d[AT(lane)].distance);
        Spec l = emitter_eval_as(&view.scene, &light, texcoord(uv, NULL), distance);
        for (int lane = 0; lane < LANES && first + lane < n; lane++) {
            put_spec(d[first + lane].radiance, l, lane);
        }
    }
}

static void light_adjoint(const KindCase *c, int n, const LightDraw *d, Adjoint *a, double *gradient,
                          const double *tangent, bool moves) {
    View view;
    view_make(c, &view);
    Sink sink = sink_make(&view, c, gradient, tangent);
    Light light = light_of(c, &view);
    for (int first = 0; first < n; first += LANES) {
        Vec2 uv;
        Float distance;
        GATHER(uv.x, d[AT(lane)].uv[0]);
        GATHER(uv.y, d[AT(lane)].uv[1]);
        GATHER(distance, d[AT(lane)].distance);
        Mask m = m_first_n(n - first);
        sink.derivative = f_set(0);
        LightMove move = light_move_zero();
        GATHER3(move.d, a[AT(lane)].dwo);
        emitter_adj_as(&view.scene, &light, texcoord(uv, NULL), distance, spec_zero_unless(m, gather_df(a, first, n)),
                       moves ? &move : NULL, &sink, m);
        if (moves) {
            Vec3 ref, direction;
            GATHER3(ref, d[AT(lane)].ref);
            GATHER3(direction, d[AT(lane)].d);
            emitter_move_adj_as(&view.scene, &light, ref, direction, distance, &move, &sink, m);
        }
        for (int lane = 0; lane < LANES && first + lane < n; lane++) {
            a[first + lane].forward = (double)f_lane(sink.derivative, lane);
        }
    }
}

static void run_light_adj(const KindCase *c, int n, const LightDraw *d, Adjoint *a, double *gradient,
                          const double *tangent) {
    light_adjoint(c, n, d, a, gradient, tangent, false);
}

static void run_light_move_adj(const KindCase *c, int n, const LightDraw *d, Adjoint *a, double *gradient,
                               const double *tangent) {
    light_adjoint(c, n, d, a, gradient, tangent, true);
}

const KindKernels KERNELS = {KERNELS_NAME, LANES, run_eval, run_sample, run_adj, run_texture, run_light_sample,
                             run_light_pdf, run_light_eval, run_light_adj, run_light_move_adj};
