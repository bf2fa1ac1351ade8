// particle.h: light tracing: particles start on lights, scatter, and every vertex is connected to the pinhole of the
// sensor, so that contributions carry a film position of their own. Paths of at least two segments; what the sensor sees
// of lights directly is left to a camera pass. The weights are those of the path tracer read backwards, shading normals
// included [veach1997 section 5.3]. NOT differentiated.
#pragma once

#include "integrator/particle_job.h"
#include "integrator/particle_start.h"
#include "integrator/path.h"
#include "sensor/filter.h"

// The sensor, ready to be looked up backwards.
typedef struct Pinhole {
    Vec3 origin;
    real to_local[9];       // rows of the inverse of the pose's linear part
    real tangent, aspect, shift_x, shift_y;
    real density;           // pixels per area of the film at depth 1, or of the film in the world
    bool parallel;          // orthographic
    Vec3 axis;              // of an orthographic sensor, unit
} Pinhole;

static void pinhole_invert(const float *m, Pinhole *p, double *det) {
    double a[9];
    for (int i = 0; i < 9; i++) {
        a[i] = (double)m[i / 3 * 4 + i % 3];
    }
    double c[9] = {a[4] * a[8] - a[5] * a[7], a[2] * a[7] - a[1] * a[8], a[1] * a[5] - a[2] * a[4],
                   a[5] * a[6] - a[3] * a[8], a[0] * a[8] - a[2] * a[6], a[2] * a[3] - a[0] * a[5],
                   a[3] * a[7] - a[4] * a[6], a[1] * a[6] - a[0] * a[7], a[0] * a[4] - a[1] * a[3]};
    *det = a[0] * c[0] + a[1] * c[3] + a[2] * c[6];
    for (int i = 0; i < 9; i++) {
        p->to_local[i] = (real)(c[i] / *det);
    }
}

static Pinhole pinhole_make(const SceneView *scene, const SensorRecord *s) {
    const float *m = scene->theta + s->to_world;
    Pinhole p = {.origin = v3(f_set(m[3]), f_set(m[7]), f_set(m[11])), .aspect = (real)s->width / (real)s->height};
    double det, pixels = (double)s->width * s->height, aspect = (double)p.aspect;
    pinhole_invert(m, &p, &det);
    p.parallel = s->kind == SENSOR_ORTHOGRAPHIC;
    if (p.parallel) {
        Vec3 x = v3(f_set(m[0]), f_set(m[4]), f_set(m[8])), y = v3(f_set(m[1]), f_set(m[5]), f_set(m[9]));
        p.tangent = 1;
        p.axis = v3_normalize(v3(f_set(m[2]), f_set(m[6]), f_set(m[10])));
        p.density = (real)(pixels * aspect / 4) / f_lane(v3_length(v3_cross(x, y)), 0);
        return p;
    }
    p.tangent = (real)tan(0.5 * 3.14159265358979323846 / 180 * (double)scene->theta[s->fov]);
    p.shift_x = (real)scene->theta[s->principal];
    p.shift_y = (real)scene->theta[s->principal + 1];
    p.density = (real)(pixels * aspect / (4 * (double)p.tangent * (double)p.tangent));
    return p;
}

// How a point is seen: where on the film, from which direction, and the pixels per area of a facing surface there.
typedef struct Sight {
    Float x, y, density, length; // length: of the ray up to the near plane
    Vec3 d;
    Mask valid;
} Sight;

KFN Sight pinhole_look(const Pinhole *p, const SensorRecord *s, Vec3 point) {
    Vec3 q = v3_sub(point, p->origin), local;
    const real *r = p->to_local;
    local = v3(r[0] * q.x + r[1] * q.y + r[2] * q.z, r[3] * q.x + r[4] * q.y + r[5] * q.z,
               r[6] * q.x + r[7] * q.y + r[8] * q.z);
    Mask inside = m_ge(local.z, f_set(s->near_clip)) & m_le(local.z, f_set(s->far_clip));
    Float z = f_select(inside, local.z, f_set(1)), scale = p->parallel ? f_set(1) : p->tangent * z;
    Float distance2 = v3_dot(q, q), distance = f_sqrt(distance2);
    Sight e;
    e.x = ((1.0f - local.x / scale) * 0.5f - p->shift_x) * (real)s->width;
    e.y = ((1.0f - local.y * p->aspect / scale) * 0.5f - p->shift_y) * (real)s->height;
    if (p->parallel) {
        e.d = v3_neg(p->axis);
        e.length = (z - s->near_clip) * (v3_dot(q, p->axis) / z);
        e.density = f_set(p->density);
    } else {
        // A pixel's solid angle is its area at depth 1 times the cube of the cosine; and the surface is that far away.
        Float cosine = z / f_select(inside, distance, f_set(1));
        e.d = v3_scale(q, -f_safe_rcp(distance));
        e.length = distance - s->near_clip / cosine;
        e.density = p->density * f_safe_rcp(cosine * cosine * cosine * distance2);
    }
    e.valid = inside;
    return e;
}

// ---- film --------------------------------------------------------------------------------------------------------

static void particle_splat(Tracer *t, double x, double y, const double *l) {
    PathJob *job = t->job;
    const SensorRecord *s = t->sensor;
    int32_t x0 = job->x - job->border, y0 = job->y - job->border;
    int32_t width = job->width + 2 * job->border, height = job->height + 2 * job->border;
    int32_t left, right, top, bottom;
    if (!(l[0] + l[1] + l[2] - (l[0] + l[1] + l[2]) == 0)) {
        job->nonfinite++;
        return;
    }
    if (s->filter == FILM_BOX) {
        left = (int32_t)floor(x);
        top = (int32_t)floor(y);
        right = left + 1;
        bottom = top + 1;
    } else {
        filter_range(s, (float)x, &left, &right);
        filter_range(s, (float)y, &top, &bottom);
    }
    for (int32_t j = top < y0 ? y0 : top; j < bottom && j < y0 + height; j++) {
        float wy = s->filter == FILM_BOX ? 1 : filter_eval(s, (float)(j + 0.5 - y));
        for (int32_t i = left < x0 ? x0 : left; i < right && i < x0 + width; i++) {
            float w = s->filter == FILM_BOX ? 1 : wy * filter_eval(s, (float)(i + 0.5 - x));
            double *pixel = job->film + ((int64_t)(j - y0) * width + i - x0) * SPEC_N;
            for (int c = 0; c < SPEC_N; c++) {
                pixel[c] += (double)w * l[c];
            }
        }
    }
}

// ---- vertices ----------------------------------------------------------------------------------------------------

// What a batch of lanes found, seen from the light: wl points back to where the particle came from.
typedef struct Landing {
    Vertex v;
    Interaction si;
    BsdfCall call;
    BsdfSurface surface;
    Vec3 wl, dp_dv;
    Float cosine; // of the surface itself
} Landing;

// Lanes of m whose ray reaches the sensor; lights that hide do not stand in the way.
KFN Mask particle_open(Tracer *t, const Ray *ray, Mask m) {
    t->job->rays += m_count(m);
    if (t->scene->hide_emitters) {
        Hit hit = trace_past_emitters(t, *ray, m, trace_closest(t->scene, ray, m, false));
        return m & mi_lt(hit.shape, i_set(0));
    }
    return m & m_gt(spec_max(trace_transmittance(t->scene, ray, m)), f_set(0));
}

// Adds what the vertices send to the sensor: with F = f |cos| as the path tracer has it, for a viewer at the sensor,
// beta F |ng . wc| / |ng . wl| x pixels per area.
static void particle_connect(Tracer *t, const Pinhole *pinhole, const Landing *at) {
    const PathJob *job = t->job;
    Sight sight = pinhole_look(pinhole, t->sensor, at->si.p);
    Mask m = at->v.m & sight.valid & m_gt(at->cosine, f_set(0)) & m_ge(sight.x, f_set((real)job->x)) &
             m_lt(sight.x, f_set((real)(job->x + job->width))) & m_ge(sight.y, f_set((real)job->y)) &
             m_lt(sight.y, f_set((real)(job->y + job->height)));
    if (!m_any(m)) {
        return;
    }
    Vec3 d = v3_select(m, sight.d, v3_neg(at->v.d));
    Spec f = bsdf_eval(&at->call, frame_to_local(&at->si.sh, d), at->wl, i_set(LOBE_SMOOTH));
    Float weight = f_abs(v3_dot(at->si.ng, d)) * f_safe_rcp(at->cosine) * sight.density;
    Spec l = spec_scale(spec_mul(at->v.beta, f), weight);
    m = m & m_gt(spec_max(l), f_set(0));
    Ray ray = {interaction_offset(&at->si, d), d, sight.length * (1.0f - 9e-4f)};
    m = particle_open(t, &ray, m);
    for (uint32_t bits = m_bits(m); bits; bits &= bits - 1) {
        int lane = __builtin_ctz(bits);
        double rgb[SPEC_N];
        for (int c = 0; c < SPEC_N; c++) {
            rgb[c] = (double)f_lane(l.c[c], lane);
        }
        particle_splat(t, (double)f_lane(sight.x, lane), (double)f_lane(sight.y, lane), rgb);
    }
}

// Stores the particles of m behind the `count` that are there already; returns their number.
static int32_t particle_append(Paths *next, int32_t count, Vec3 o, Vec3 d, Spec beta, Float eta2, Float roulette, Int slot,
                               Mask m) {
    f_compress(next->ox + count, o.x, m);
    f_compress(next->oy + count, o.y, m);
    f_compress(next->oz + count, o.z, m);
    f_compress(next->dx + count, d.x, m);
    f_compress(next->dy + count, d.y, m);
    f_compress(next->dz + count, d.z, m);
    f_compress(next->tmax + count, f_set(INFINITY), m);
    spec_compress(next->beta, count, beta, m);
    f_compress(next->eta2 + count, eta2, m);
    f_compress(next->roulette + count, roulette, m);
    i_compress(next->slot + count, slot, m);
    return count + m_count(m);
}

// Weight of a sampled direction over its density. The path tracer's value is taken with the directions exchanged; of
// delta lobes, whose value knows one direction only, with the factor by which radiance grows at refraction undone.
KFN Spec particle_weight(const Landing *at, const BsdfSample *s, Spec f, Float pdf) {
    Mask smooth = mi_eq(s->lobe, i_set(LOBE_SMOOTH));
    Vec3 d = frame_to_world(&at->si.sh, s->wo);
    Float ratio = f_abs(v3_dot(at->si.ng, d)) * f_safe_rcp(at->cosine);
    Spec exchanged = m_any(smooth) ? bsdf_eval(&at->call, s->wo, at->wl, i_set(LOBE_SMOOTH)) : f;
    Float turn = s->eta * s->eta * f_abs(at->wl.z) * f_safe_rcp(f_abs(s->wo.z));
    return spec_scale(spec_select(smooth, exchanged, spec_scale(f, turn)), ratio * f_safe_rcp(pdf));
}

static int32_t particle_scatter(Tracer *t, const Landing *at, int32_t bounce, int32_t next_count) {
    const Paths *p = &t->ws.paths[t->current];
    SampleKey key = slot_key(t, at->v.slot);
    BsdfSample s = bsdf_sample(&at->call, at->wl, rng_1d(&key, dimension(bounce + 1, PURPOSE_LOBE)),
                               rng_2d(&key, dimension(bounce + 1, PURPOSE_DIRECTION)));
    Float pdf, eta2 = real_gather(p->eta2, at->v.at) * f_safe_rcp(s.eta * s.eta);
    Spec f = bsdf_eval_pdf(&at->call, at->wl, s.wo, s.lobe, &pdf);
    Mask m = at->v.m & m_gt(pdf, f_set(0)) & m_gt(at->cosine, f_set(0));
    Spec weight = spec_zero_unless(m, particle_weight(at, &s, f, pdf));
    Spec beta = spec_mul(at->v.beta, weight);
    Float roulette = real_gather(p->roulette, at->v.at) * spec_max(weight);
    m = m & m_finite(spec_sum(beta)) & m_gt(spec_max(beta), f_set(0));
    if (bounce + 2 >= t->scene->rr_depth) {
        Float q = f_min(roulette, f_set(0.95f)), rcp = f_safe_rcp(q);
        m = m & m_lt(rng_1d(&key, dimension(bounce + 1, PURPOSE_ROULETTE)), q);
        beta = spec_scale(beta, rcp);
        roulette = roulette * rcp;
    }
    Vec3 d = frame_to_world(&at->si.sh, s.wo);
    return particle_append(&t->ws.paths[1 - t->current], next_count, interaction_offset(&at->si, d), d, beta, eta2,
                           roulette, at->v.slot, m);
}

static int32_t particle_batch(Tracer *t, const Pinhole *pinhole, const Group *group, const int32_t *order, int32_t count,
                              int32_t bounce, int32_t next_count) {
    const SceneView *scene = t->scene;
    Landing at;
    at.v = vertex_load(t, order, count, bounce);
    at.si = shape_interaction(scene, group->shape_kind, group->shape_flags, &at.v.hit);
    at.wl = frame_to_local(&at.si.sh, v3_neg(at.v.d));
    at.cosine = f_abs(v3_dot(at.si.ng, at.v.d));
    at.call = (BsdfCall){scene, group->bsdf, texcoord(at.si.uv, &at.v.hit), 0, NULL, NULL};
    if (scene->bsdfs[group->bsdf].surface) {
        find_surface(scene, group, &at.v.hit, &at.surface, &at.dp_dv);
        at.call.surface = &at.surface;
    }
    if (!scene->hide_emitters || group->emitter < 0) {
        particle_connect(t, pinhole, &at);
    }
    if (scene->max_depth >= 0 && bounce + 3 > scene->max_depth) {
        return next_count;
    }
    return particle_scatter(t, &at, bounce, next_count);
}

// ---- particles ---------------------------------------------------------------------------------------------------

// Starts `count` particles from number `first` on.
static void particle_start_stage(Tracer *t, int64_t first, int32_t count) {
    enum { PER_SET = 1 << 24 }; // samples of one scramble
    const SceneView *scene = t->scene;
    for (int32_t i = 0; i < count; i++) {
        t->ws.pixel[i] = (int32_t)((first + i) / PER_SET);
        t->ws.sample[i] = (int32_t)((first + i) % PER_SET);
    }
    t->active = t->current = 0;
    for (int32_t i = 0; i < count; i += LANES) {
        Mask m = m_first_n(count - i);
        Int slot = i_select(m, i_iota() + i, i_set(i));
        SampleKey key = slot_key(t, slot);
        Float choice;
        Int light = emitter_choose(scene, rng_1d(&key, dimension(0, PURPOSE_LIGHT_CHOICE)), &choice);
        Vec2 u1 = rng_2d(&key, dimension(0, PURPOSE_LIGHT)), u2 = rng_2d(&key, dimension(0, PURPOSE_DIRECTION));
        ParticleStart s = {v3_zero(), v3_zero(), spec_zero(), m_set(false)};
        for (Mask left = m, mine; m_any(left); left = left & ~mine) {
            int32_t id = i_lane(light, m_first(left));
            mine = left & mi_eq(light, i_set(id));
            ParticleStart one = emitter_start(scene, id, u1, u2);
            s.o = v3_select(mine, one.o, s.o);
            s.d = v3_select(mine, one.d, s.d);
            s.weight = spec_select(mine, one.weight, s.weight);
            s.valid = s.valid | (mine & one.valid);
        }
        Spec beta = spec_scale(s.weight, f_safe_rcp(choice));
        m = m & s.valid & m_finite(spec_sum(beta)) & m_gt(spec_max(beta), f_set(0));
        t->active = particle_append(&t->ws.paths[0], t->active, s.o, s.d, beta, f_set(1), f_set(1), slot, m);
    }
    t->job->paths += count;
}

// Runs the particles to their ends. begin: scratch of group count + 2 entries.
static void particle_forward(Tracer *t, const Pinhole *pinhole, int32_t *begin) {
    const SceneView *scene = t->scene;
    int32_t groups = (int32_t)scene->groups_count + 1;
    for (int32_t bounce = 0; t->active > 0 && bounce < MAX_BOUNCES; bounce++) {
        if (scene->max_depth >= 0 && bounce + 2 > scene->max_depth) {
            return;
        }
        trace_stage(t, 1);
        sort_stage(t, begin, groups);
        int32_t next_count = 0;
        for (int32_t g = 1; g < groups; g++) {
            for (int32_t k = begin[g]; k < begin[g + 1]; k += LANES) {
                int32_t count = begin[g + 1] - k < LANES ? begin[g + 1] - k : LANES;
                next_count = particle_batch(t, pinhole, scene->groups + g - 1, t->ws.order + k, count, bounce, next_count);
            }
        }
        t->current = 1 - t->current;
        t->active = next_count;
    }
}
