// area.h: a surface that emits the same radiance into all directions of its shading normal's side, sampled through its
// shape. NOT differentiated: where the surface lies.
#pragma once

#include "emitter/light.h"

#define AREA_PARAMS(P) P(EMISSION, radiance, 1, 0, INFINITY, "emitted radiance", "W/(m^2 sr)")
EMITTER_SLOTS(Area, AREA_PARAMS)

KFN LightSample area_sample(const SceneView *scene, const Light *l, Vec3 ref, Vec2 u) {
    const ShapeRecord *shape = scene->shapes + l->e->shape;
    Int id = l->many ? EMITTER_FIELD(scene, l->id, shape) : i_set(l->e->shape);
    Hit hit = l->many ? shape_sample_many(scene, shape->kind, id, ref, u) : shape_sample(scene, l->e->shape, ref, u);
    Interaction si = shape_interaction(scene, shape->kind, shape->flags, &hit);
    LightSample s = light_at_point(ref, si.p);
    s.pdf = l->many ? shape_pdf_many(scene, shape->kind, id, ref, s.d, &si)
                    : shape_pdf(scene, l->e->shape, ref, s.d, &si);
    s.uv = light_sample_uv(scene, l->e, &hit, &si);
    s.prim = hit.prim;
    s.valid = s.valid & m_lt(v3_dot(s.d, si.sh.n), f_set(0)) & m_gt(f_abs(v3_dot(s.d, si.ng)), f_set(1e-7f)) &
              m_gt(s.pdf, f_set(0));
    return s;
}

// Density with which area_sample picks the direction d from ref to the point si of the light's shape.
KFN Float area_pdf(const SceneView *scene, const EmitterRecord *e, Vec3 ref, Vec3 d, const Interaction *si) {
    return shape_pdf(scene, e->shape, ref, d, si);
}

KFN Spec area_eval(const SceneView *scene, const Light *l, TexCoord uv, Float distance) {
    UNUSED(distance);
    return light_colour(scene, l, SLOT(Area, radiance), uv);
}

KFN void area_adj(const SceneView *scene, const Light *l, TexCoord uv, Float distance, Spec dl, LightMove *move,
                  Sink *sink, Mask m) {
    UNUSED(distance);
    light_colour_adj(scene, l, SLOT(Area, radiance), uv, dl, move ? &move->uv : NULL, sink, m);
}
