// sightline.h: lines of sight: from a film position through smooth mirrors and glass, and what lets them pass, up to the first
// vertex that scatters.
// The random numbers are those of the path that path.h traces from there, which therefore takes the same way. In media, surfaces of
// the kind null are passed: they are no vertices of lines, but bounces of those paths; whether a path collides has no part in it.
#pragma once

#include "integrator/boundary/upstream.h"

// Vertices that mirror, refract or let pass; lines with more of them end.
enum { MOST_SIGHT = 64 };

typedef struct Sightline {
    Hit hit[MOST_SIGHT + 1]; // shape -1: nothing
    Vec3 d[MOST_SIGHT + 1];  // directions in which the line comes to them
    Vec3 o[MOST_SIGHT + 1];  // and where it begins behind the vertex before
    Vec2 uv[MOST_SIGHT + 1]; // of the surfaces
    Int lobe[MOST_SIGHT + 1], behind[MOST_SIGHT + 1]; // LOBE_SMOOTH at its end; whether a surface is met from behind
    Int depth[MOST_SIGHT + 1]; // segments that count before them
    Int turns;               // how many of them mirror, refract or let pass
    Spec through[MOST_SIGHT + 1]; // what the vertices before let through, over the probability of their lobes
    int32_t last;            // levels that are filled
} Sightline;

// Whether lines that meet a surface from both sides part there. What it sends out jumps where its shading normal is at right angles
// to a line, unless it is smooth glass: that mirrors all of the light there, from both sides and into the same direction. Of open
// tubes, and spheres that clip planes cut, the inside is seen next to the outside; on meshes, these are other triangles.
KFN bool sightline_minds_sides(const SceneView *scene, const Group *group) {
    return group->shape_kind != SHAPE_MESH || scene->bsdfs[group->bsdf].kind != BSDF_DIELECTRIC || group->emitter >= 0;
}

// The numbers that decide what the vertices of a bounce make of a ray.
static void sightline_numbers(const SampleKey *key, Int bounce, Mask m, Float *u, Vec2 *at) {
    *u = at->x = at->y = f_set(0);
    for (Mask left = m, mine; m_any(left); left = left & ~mine) {
        int32_t number = i_lane(bounce, m_first(left));
        Vec2 direction = rng_2d(key, dimension(number, PURPOSE_DIRECTION));
        mine = left & mi_eq(bounce, i_set(number));
        *u = f_select(mine, rng_1d(key, dimension(number, PURPOSE_LOBE)), *u);
        at->x = f_select(mine, direction.x, at->x);
        at->y = f_select(mine, direction.y, at->y);
    }
}

// Where vertices of level i lie on surfaces that mirror or refract, turns the ray; returns these lanes.
static NOINLINE Mask sightline_turn(Tracer *t, const SampleKey *key, int32_t i, Int bounce, Mask m, Sightline *s, Ray *ray) {
    const SceneView *scene = t->scene;
    const Hit *hit = s->hit + i;
    Float u;
    Vec2 at;
    sightline_numbers(key, bounce, m, &u, &at);
    Mask deeper = depth_allows(scene, s->depth[i] + 2);
    Mask turned = m_set(false);
    s->through[i + 1] = spec_zero();
    s->depth[i + 1] = s->depth[i];
    for (Mask left = m; m_any(left);) {
        int32_t id;
        Hit h;
        Mask mine = take_group(scene, hit, &left, &id, &h);
        const Group *group = scene->groups + id;
        Interaction si = shape_interaction(scene, group->shape_kind, group->shape_flags, &h);
        Vec3 wi = frame_to_local(&si.sh, v3_neg(s->d[i])), dp_dv;
        BsdfCall call = bsdf_call(scene, group->bsdf, texcoord(si.uv, &h), t->floor);
        s->uv[i].x = f_select(mine, si.uv.x, s->uv[i].x);
        s->uv[i].y = f_select(mine, si.uv.y, s->uv[i].y);
        BsdfSurface surface;
        if (scene->bsdfs[group->bsdf].surface) {
            find_surface(scene, group, &h, &surface, &dp_dv);
            call.surface = &surface;
        }
        if (sightline_minds_sides(scene, group)) {
            s->behind[i] = i_select(mine & m_lt(wi.z, f_set(0)), i_set(1), s->behind[i]);
        }
        BsdfSample b = bsdf_sample(&call, wi, u, at);
        Float pdf;
        Spec f = bsdf_eval_pdf(&call, wi, b.wo, b.lobe, &pdf);
        Mask passes = m_set(scene->through) & lobe_is(b.lobe, LOBE_NULL);
        Mask turns = mine & lobe_follows(b.lobe) & (passes | deeper);
        turns = turns & m_gt(pdf, f_set(0)) & m_gt(spec_max(f), f_set(0));
        Vec3 wo = frame_to_world(&si.sh, b.wo);
        s->lobe[i] = i_select(turns, b.lobe, s->lobe[i]);
        s->depth[i + 1] = i_select(turns & ~passes, s->depth[i] + 1, s->depth[i + 1]);
        s->through[i + 1] = spec_select(turns, spec_scale(spec_mul(s->through[i], f), f_safe_rcp(pdf)), s->through[i + 1]);
        Vec3 o = interaction_offset(&si, wo);
        ray->o = v3_select(turns, o, ray->o);
        ray->d = v3_select(turns, wo, ray->d);
        turned = turned | turns;
    }
    ray->tmax = f_set(INFINITY);
    return turned;
}

// The random numbers of a path's lobes.
KFN SampleKey sightline_key(const Tracer *t, Int slot) {
    SampleKey key = slot_key(t, slot);
    key.sample = t->scene->split ? split_of(t->scene, key.sample).scatter_sample : key.sample;
    return key;
}

static NOINLINE void sightline_trace(Tracer *t, const SampleKey *key, Vec2 lens, Float x, Float y, Mask m, Sightline *s) {
    SensorRay start = sensor_ray(t->scene, t->sensor, x, y, lens);
    Ray ray = start.ray;
    Int bounce = i_set(0);
    s->turns = i_set(0);
    s->through[0] = spec_set(start.weight);
    s->depth[0] = i_set(0);
    s->last = 0;
    for (int32_t i = 0; i <= MOST_SIGHT && m_any(m); i++) {
        Hit hit = trace_solid(t, &ray, i == 0, m, &bounce);
        s->hit[i] = hit;
        s->d[i] = ray.d;
        s->o[i] = ray.o;
        s->lobe[i] = i_set(LOBE_SMOOTH);
        s->behind[i] = i_set(0);
        s->uv[i] = (Vec2){f_set(0), f_set(0)};
        s->last = i + 1;
        m = m & mi_lt(i_set(-1), hit.shape);
        m = i < MOST_SIGHT && m_any(m) ? sightline_turn(t, key, i, bounce, m, s, &ray) : m_set(false);
        s->turns = s->turns + i_select(m, i_set(1), i_set(0));
        bounce = bounce + i_set(1);
    }
}

// Takes the lanes of m of another line.
static void sightline_take(Sightline *to, const Sightline *from, Mask m) {
    for (int32_t i = 0; i < from->last; i++) {
        if (i >= to->last) {
            to->hit[i] = from->hit[i];
            to->d[i] = from->d[i];
            to->o[i] = from->o[i];
            to->lobe[i] = from->lobe[i];
            to->behind[i] = from->behind[i];
            to->uv[i] = from->uv[i];
            to->through[i] = from->through[i];
            to->depth[i] = from->depth[i];
            continue;
        }
        to->hit[i] = hit_select(m, from->hit + i, to->hit + i);
        to->d[i] = v3_select(m, from->d[i], to->d[i]);
        to->o[i] = v3_select(m, from->o[i], to->o[i]);
        to->lobe[i] = i_select(m, from->lobe[i], to->lobe[i]);
        to->behind[i] = i_select(m, from->behind[i], to->behind[i]);
        to->uv[i] = (Vec2){f_select(m, from->uv[i].x, to->uv[i].x), f_select(m, from->uv[i].y, to->uv[i].y)};
        to->through[i] = spec_select(m, from->through[i], to->through[i]);
        to->depth[i] = i_select(m, from->depth[i], to->depth[i]);
    }
    to->turns = i_select(m, from->turns, to->turns);
    to->last = from->last > to->last ? from->last : to->last;
}

// Carries the adjoints of the position of the ray that comes to vertex `level`, at p, and of its direction back to the sensor.
static Carried sightline_back(const Tracer *t, const Sightline *s, Int level, Vec3 p, const Carried *end, Sink *sink, Mask m) {
    Carried c = {v3_select(m, end->drag, v3_zero()), v3_select(m, end->turn, v3_zero())};
    for (int32_t i = s->last - 2; i >= 0; i--) {
        Mask on = m & mi_lt(i_set(i), level);
        if (!m_any(on)) {
            continue;
        }
        Vec3 next = v3_select(mi_eq(level, i_set(i + 1)), p, s->hit[i + 1].p);
        Float distance = v3_length(v3_sub(next, s->hit[i].p));
        Carried back = rays_turn_adj(t, s->hit + i, s->d[i], v3_select(on, s->d[i + 1], v3_neg(s->d[i])), s->lobe[i], distance,
                                     &c, sink, on);
        c.drag = v3_select(on, back.drag, c.drag);
        c.turn = v3_select(on, back.turn, c.turn);
    }
    return c;
}

// In media, weighs l with what the first `pieces` pieces of lines of m let through.
static Spec sightline_clear(Tracer *t, const Sightline *s, Int pieces, Int slot, int32_t bounce, Mask m, Spec l) {
    for (int32_t i = 0; i < s->last; i++) {
        Mask on = m & mi_lt(i_set(i), pieces);
        if (!m_any(on)) {
            return l;
        }
        Spec arrives = l;
        Vec3 o = s->o[i], d = s->d[i];
        Ray ray = {o, d, v3_dot(v3_sub(s->hit[i].p, o), d) * (1.0f - SHADOW_SHORT)};
        sight_clear(t, &ray, medium_around(t, o, d, on), slot, bounce + MAX_BOUNCES * (i + 1), i == 0, on, &arrives);
        l = spec_select(on, arrives, l);
    }
    return l;
}

// Half of the difference of film positions that slopes are taken over, in film widths: rays turn by little more than rounding.
#define FILM_STEP ((real)0.004)

// What the film position is worth to the ray that the sensor sends to p.
static Vec2 film_adj(const Tracer *t, Float x, Float y, Vec2 lens, Vec3 p, const Carried *c) {
    const real step = FILM_STEP * (real)t->sensor->width;
    Float out[2];
    for (int k = 0; k < 2; k++) {
        real sx = k ? 0 : step, sy = k ? step : 0;
        Ray a = sensor_ray(t->scene, t->sensor, x + sx, y + sy, lens).ray;
        Ray b = sensor_ray(t->scene, t->sensor, x - sx, y - sy, lens).ray;
        Vec3 turn = v3_scale(v3_sub(a.d, b.d), f_set(1 / (2 * step)));
        Vec3 move = v3_scale(v3_sub(a.o, b.o), f_set(1 / (2 * step)));
        Float reach = v3_length(v3_sub(p, v3_scale(v3_add(a.o, b.o), f_set((real)0.5))));
        out[k] = v3_dot(c->drag, v3_madd(move, reach, turn)) + v3_dot(c->turn, turn);
    }
    return (Vec2){out[0], out[1]};
}
