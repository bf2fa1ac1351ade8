// looked.h: vertices that something looks at, and the adjoint of functions of the direction from which it does: the ends of rough
// refraction (rim_vertex.h) and the normals of maps (facing.h). Either the vertices are attached to their surfaces, as what looks
// at them is, or they slide over these along rays whose directions are given.
#pragma once

#include "integrator/path_move.h"

// Those of one group.
typedef struct Looked {
    SurfaceSweep s;
    VertexAdj d;   // what is asked of them
    int32_t group;
    bool slides;
} Looked;

// The surfaces of a group. s must stay where it is.
static void looked_surface(const Tracer *t, int32_t group, const Hit *hit, Mask m, SurfaceSweep *s) {
    s->group = t->scene->groups + group;
    s->hit = *hit;
    s->m = m;
    s->si = shape_interaction(t->scene, s->group->shape_kind, s->group->shape_flags, hit);
    s->call = bsdf_call(t->scene, s->group->bsdf, texcoord(s->si.uv, NULL), t->floor);
    s->call.rim = RIM_ALWAYS;
    surface_parameterise(t, s);
}

// Takes those of the first group of *left, which are looked at along d. *at must stay where it is until
// looked_finish; looked_over follows before.
static void looked_take(const Tracer *t, const Hit *hit, Vec3 d, bool slides, Mask *left, Looked *at, Sink *sink) {
    Hit h;
    SurfaceSweep *s = &at->s;
    Mask mine = take_group(t->scene, hit, left, &at->group, &h);
    looked_surface(t, at->group, &h, mine, s);
    at->slides = slides;
    s->d = d;
    s->slides = s->chained = slides ? mine : m_set(false);
    s->wi = frame_to_local(&s->si.sh, v3_neg(d));
    vertex_adj_clear(&at->d, true);
    s->call.dsurface = s->call.surface ? &at->d.surface : NULL;
    sink->at = slides ? &at->d.at : NULL;
    sink->point = &at->d.point;
}

// Behind the function's adjoint.
KFN void looked_over(Sink *sink) {
    sink->at = NULL;
    sink->point = NULL;
}

// Adds what at->d and the adjoint dp of their positions ask of the surfaces, and to *all what that asks of the rays: of the
// position there and of the direction, or of the position of what looks, one over `behind` away.
static void looked_finish(const Tracer *t, Looked *at, Vec3 dp, Float behind, Sink *sink, Carried *all) {
    const SurfaceSweep *s = &at->s;
    Vec3 turn = frame_to_world(&s->si.sh, at->d.wi);
    Vec3 apart = v3_select(s->m, v3_scale(v3_madd(turn, -v3_dot(turn, s->d), s->d), behind), v3_zero());
    Carried own = {at->slides ? v3_zero() : apart, v3_zero()};
    dp = at->slides ? dp : v3_sub(dp, apart);
    vertex_place_adj(t, s, &at->d, dp, s->slides, t->job->live[at->group], &own, sink);
    all->drag = v3_select(s->m, own.drag, all->drag);
    all->turn = v3_select(s->m, own.turn, all->turn);
}
