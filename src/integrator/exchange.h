// exchange.h: the value of a vertex that was not found from the sensor's side, and its derivative.
// NOT differentiated: where the vertex lies.
#pragma once

#include "integrator/sweep.h"

// The value of a vertex as the path tracer sees it: from the sensor's side towards the light's.
typedef struct Exchange {
    Vec3 view, light, view_d, light_d; // local, and in the world
    Int lobe;
    Mask m;
} Exchange;

// Accumulates the adjoint df of the value into the parameters of the function and into vertex normals.
static void exchange_adj(const Tracer *t, const SurfaceSweep *s, const Exchange *x, Spec df, Sink *sink) {
    BsdfCall call = s->call;
    BsdfSurface dsurface = {f_set(0), f_set(0), f_set(0), v3_zero()};
    Vec3 dview = v3_zero(), dlight = v3_zero(), unused = v3_zero();
    call.dsurface = call.surface && sink->any_normals ? &dsurface : NULL;
    bsdf_adj(&call, x->view, x->light, x->lobe, spec_zero_unless(x->m, df), sink, x->m, &dview, &dlight, NULL);
    if (sink->any_normals && s->group->shape_kind == SHAPE_MESH) {
        Frame dframe = {v3_zero(), v3_zero(), v3_zero()};
        // view = to_local(view_d), light = to_local(light_d)
        frame_to_local_adj(&s->si.sh, x->view_d, dview, &dframe, &unused);
        frame_to_local_adj(&s->si.sh, x->light_d, dlight, &dframe, &unused);
        // ux = s . dp_du, vx = s . dp_dv, vy = t . dp_dv
        if (call.surface) {
            v3_acc(&dframe.s, v3_madd(v3_scale(s->si.dp_du, dsurface.ux), dsurface.vx, s->dp_dv));
            v3_acc(&dframe.t, v3_scale(s->dp_dv, dsurface.vy));
        }
        mesh_interaction_adj(t->scene, s->group->shape_flags, &s->hit, &s->si, &dframe, sink, x->m);
    }
}
