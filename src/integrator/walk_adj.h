// walk_adj.h: adjoints of what shadow rays pass, surfaces and media, and finding them again.
#pragma once

#include "integrator/passage_move.h"
#include "integrator/ride.h"

// What a surface on the way of a walk asks of the ray that it lets through, and of itself where it moves, in the lanes of m: given
// the adjoints of the ray's direction in its frame, of its texture coordinates, barycentrics and of its place in space.
static NOINLINE void walk_turn_adj(const Tracer *t, const Hit *hit, const Interaction *si, Vec3 d, Vec3 local, SurfaceAdj worth,
                                   Turn *turn, Sink *sink, Mask m) {
    Frame dframe = {v3_zero(), v3_zero(), v3_zero()};
    Vec3 dd = v3_zero();
    frame_to_local_adj(&si->sh, d, local, &dframe, &dd);
    frame_from_tangent_adj(&si->sh, si->dp_du, &dframe, &worth.n, &worth.dp_du);
    Vec3 drag = rays_find_adj(t, hit, d, &worth, sink, m);
    Float far = v3_dot(v3_sub(hit->p, turn->from), d);
    turn->d = v3_add(turn->d, v3_select(m, v3_madd(dd, far, drag), v3_zero()));
    turn->shift = v3_add(turn->shift, v3_select(m, drag, v3_zero()));
}

// Accumulates the adjoint dt of the product of what a walk's surfaces let through; turn: as passage_move_adj.
static NOINLINE void walk_adj(const Tracer *t, const Walk *walk, Spec dt, Turn *turn, Sink *sink) {
    const SceneView *scene = t->scene;
    Spec behind[MOST_SURFACES_IN_A_ROW], after = spec_set(f_set(1)), before = after;
    for (int32_t i = walk->count - 1; i >= 0; i--) {
        behind[i] = after;
        after = spec_select(walk->m[i], spec_mul(after, walk->pass[i]), after);
    }
    for (int32_t i = 0; i < walk->count; i++) {
        // T = before pass behind
        Spec dpass = spec_zero_unless(walk->m[i], spec_mul(dt, spec_mul(before, behind[i])));
        Int groups = SHAPE_FIELD(scene, i_max(walk->hit[i].shape, i_set(0)), group);
        before = spec_select(walk->m[i], spec_mul(before, walk->pass[i]), before);
        for (Mask left = walk->m[i]; m_any(left);) {
            int32_t id = i_lane(groups, m_first(left));
            Mask mine = left & mi_eq(groups, i_set(id));
            const Group *group = scene->groups + id;
            left = left & ~mine;
            if (!(t->job->live[id] & LIVE_SCATTERING)) {
                continue;
            }
            Hit hit = walk_hit(&walk->hit[i], mine);
            Interaction si = shape_interaction(scene, group->shape_kind, group->shape_flags, &hit);
            BsdfCall call = bsdf_call(scene, group->bsdf, texcoord(si.uv, &hit), t->floor);
            Vec3 wo = frame_to_local(&si.sh, walk->d), dwi = v3_zero(), dwo = v3_zero(), unused = v3_zero();
            Frame dframe = {v3_zero(), v3_zero(), v3_zero()};
            const bool turns = turn && (t->job->live[id] & LIVE_UNEVEN);
            SurfaceAdj worth = surface_adj_zero();
            sink->at = turns ? &worth.at : NULL;
            sink->point = turns ? &worth.p : NULL;
            bsdf_adj(&call, v3_neg(wo), wo, i_set(LOBE_NULL), spec_zero_unless(mine, dpass), sink, mine, &dwi, &dwo,
                     turns ? &worth.uv : NULL);
            sink->at = NULL;
            sink->point = NULL;
            if (turns) {
                walk_turn_adj(t, &hit, &si, walk->d, v3_sub(dwo, dwi), worth, turn, sink, mine);
            } else if (sink->any_normals && group->shape_kind == SHAPE_MESH) {
                frame_to_local_adj(&si.sh, walk->d, v3_sub(dwo, dwi), &dframe, &unused);
                mesh_interaction_adj(scene, group->shape_flags, &hit, &si, &dframe, sink, mine);
            }
        }
    }
}

// The light samples of a batch of vertices, and what their shadow rays pass: found once.
typedef struct Passage {
    bool found;
    Mask open;          // lanes that have one, and that some choice of parameters would not block
    Spec transmittance, light_value;
    Walk walk;
} Passage;

// The shadow rays of the lanes of m begin in `medium`.
static NOINLINE void passage_find(Tracer *t, const RecordBatch *batch, const Ray *ray, Int slot, Int medium, Mask m, Passage *p) {
    const Records *r = &t->ws.records;
    const int32_t at = batch->first;
    Mask blocked;
    Fog fog = {.past_lights = false};
    Walk *walk = &p->walk;
    const Int light = i_load(r->light + at);
    if (p->found) {
        return;
    }
    walk->count = walk->segments = 0;
    walk->d = ray->d;
    walk->clear = spec_set(f_set(1));
    if (t->scene->has_media) {
        fog.medium = medium;
        fog.key = stream_key(t, slot, batch->bounce, STREAM_SHADOW);
    }
    p->transmittance = walk_transmittance(t, *ray, veils_end(t, light), m, t->scene->has_media ? &fog : NULL, &blocked, walk);
    p->open = m & ~blocked;
    p->light_value = lights_eval(t->scene, light, m, (Vec2){f_load(r->lu + at), f_load(r->lv + at)},
                                 i_load(r->lprim + at), f_load(r->ldist + at));
    p->found = true;
}

static void surface_passage_find(Tracer *t, const RecordBatch *batch, const SurfaceSweep *s, Passage *p) {
    Ray ray;
    shadow_ray(&s->si, s->light_d, s->light_distance, &ray);
    Int medium = medium_behind(s->group, s->si.ng, s->light_d, i_load(t->ws.records.medium + s->at));
    passage_find(t, batch, &ray, s->slot, medium, s->connected, p);
}

static void collision_passage_find(Tracer *t, const RecordBatch *batch, Vec3 from, Int slot, Passage *p) {
    const Records *r = &t->ws.records;
    const int32_t at = batch->first;
    Mask connected = m_first_n(batch->count) & m_gt(spec_max(spec_load(r->light_weight, at)), f_set(0));
    Vec3 d = v3_select(connected, record_v3(r->ldx, r->ldy, r->ldz, at), record_v3(r->dx, r->dy, r->dz, at));
    Ray ray;
    collision_shadow_ray(from, d, f_load(r->ldist + at), &ray);
    passage_find(t, batch, &ray, slot, i_set(batch->group), connected, p);
}

// Adds what the light samples of a batch bring, whose shadow rays were left to the sweep, to what leaves its vertices.
// s: what the sweep knows of them where they are on surfaces.
static NOINLINE void passage_light(Tracer *t, const RecordBatch *batch, Int slot, const SurfaceSweep *s, Passage *p) {
    const Records *r = &t->ws.records;
    const int32_t at = batch->first;
    if (!m_any(m_first_n(batch->count) & m_gt(spec_max(spec_load(r->light_weight, at)), f_set(0)))) {
        return;
    }
    if (batch->tag == VERTEX_MEDIUM) {
        collision_passage_find(t, batch, record_v3(r->px, r->py, r->pz, at), slot, p);
    } else {
        surface_passage_find(t, batch, s, p);
    }
    Spec arrives = spec_mul(spec_mul(p->light_value, p->transmittance), spec_load(r->light_weight, at));
    Spec lit = spec_zero_unless(p->open, spec_mul(arrives, spec_load(r->light_f, at)));
    spec_store(r->local, at, spec_add(spec_load(r->local, at), lit));
}

// Accumulates the adjoint dt of a walk's transmittance, whose value is `transmittance`; turn: as passage_move_adj.
static void passage_adj(const Tracer *t, const Walk *walk, Spec transmittance, Spec dt, Int slot, int32_t bounce, Turn *turn,
                        Sink *sink) {
    walk_adj(t, walk, spec_mul(dt, walk->clear), turn, sink);
    SampleKey key = stream_key(t, slot, bounce, STREAM_SHADOW_PROBE);
    if (t->job->live_extinctions) {
        fog_adj(t, walk, transmittance, dt, &key, sink);
    }
    if (t->job->live_borders || (turn && t->scene->has_media)) {
        passage_move_adj(t, walk, transmittance, dt, &key, turn, sink);
    }
}

// Whether shadow rays turn, and what lets more or less of the light pass with them.
KFN bool lights_turn(const Tracer *t) {
    return t->job->veils_turn || ((t->job->any_places || t->job->glides || t->job->rides) && t->scene->has_media);
}

// Lights at a point whose place is selected, or from which collisions move away.
KFN Mask points_that_move(const Tracer *t, Int light) {
    const SceneView *scene = t->scene;
    light = i_max(light, i_set(0));
    Mask moves = m_set(t->job->glides || t->job->rides);
    for (int k = 0; k < MAX_EMITTER_SLOTS; k++) {
        moves = moves | mi_lt(i_set(-1), i_gather(t->job->place_at, light * MAX_EMITTER_SLOTS + k));
    }
    return moves & light_is_delta(scene, light) & ~mi_eq(EMITTER_FIELD(scene, light, kind), i_set(EMITTER_DIRECTIONAL));
}

// passage_adj, and what the turning of the shadow rays makes of where their lights are; returns the adjoint of where they begin.
// slides: rays to points of surfaces keep their direction, and meet those elsewhere; otherwise they keep the point.
static Vec3 connection_passage_adj(const Tracer *t, const Walk *walk, Spec transmittance, Spec dt, Int slot, int32_t bounce,
                                   const Connection *c, bool slides, Sink *sink) {
    bool turns = lights_turn(t);
    Mask points = turns && t->scene->has_media ? c->m & points_that_move(t, c->light) : m_set(false);
    Mask beacons = points & m_gt(beacon_radius(t, c->light, points), f_set(0));
    Turn turn = {c->from, v3_zero(), v3_zero(), f_set(0), points, beacons};
    passage_adj(t, walk, transmittance, spec_zero_unless(c->m, dt), slot, bounce, turns ? &turn : NULL, sink);
    if (!turns || !m_any(c->m)) {
        return v3_zero();
    }
    LightMove move = light_move_zero();
    move.d = v3_select(c->m, turn.d, v3_zero());
    move.distance = f_zero_unless(c->m, turn.distance);
    lights_move_adj(t->scene, c->light, c->m, c->from, c->d, c->distance, &move, sink);
    Vec3 dp = v3_select(c->m, v3_add(turn.shift, move.ref), v3_zero());
    return t->job->rides ? v3_add(dp, connection_end_adj(t, c, &move, (Vec2){f_set(0), f_set(0)}, v3_zero(), slides, sink))
                          : dp;
}

// Whether shadow rays pass surfaces or media whose transmittance depends on the selection.
KFN bool passing_is_live(const Tracer *t) {
    for (int64_t g = 0; g < t->scene->groups_count && t->scene->through; g++) {
        if ((t->job->live[g] & LIVE_SCATTERING) && t->scene->bsdfs[t->scene->groups[g].bsdf].transmits) {
            return true;
        }
    }
    return t->job->live_extinctions || t->job->live_borders || lights_turn(t);
}
