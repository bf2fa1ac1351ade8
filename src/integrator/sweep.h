// sweep.h: what the backward sweep knows of the recorded vertices, and of the film's adjoint.
#pragma once

#include "integrator/path.h"

KFN Vec3 record_v3(const real *x, const real *y, const real *z, int32_t at) {
    return v3(f_load(x + at), f_load(y + at), f_load(z + at));
}

// The adjoint of one slot: in reverse mode the film's, in forward mode channel by channel 1.
KFN Spec slot_adjoint(const Tracer *t, Int slot, int channel) {
    if (t->job->mode == MODE_REVERSE) {
        return spec_gather(t->ws.adjoint, slot);
    }
    Spec delta = spec_zero();
    delta.c[channel] = f_set(1);
    return delta;
}

// Forward mode: moves what the sink gathered to the slots' derivative of one channel.
KFN void forward_flush(Tracer *t, Sink *sink, Int slot, int channel, Mask m) {
    if (t->job->mode == MODE_FORWARD) {
        f_scatter_add(t->ws.radiance[channel], slot, sink->derivative, m & m_finite(sink->derivative));
        sink->derivative = f_set(0);
    }
}

KFN int drives(const Tracer *t) { return t->job->mode == MODE_FORWARD ? SPEC_N : 1; }

// What the sweep knows of a batch of surface vertices.
typedef struct SurfaceSweep {
    int32_t at;           // first record of the batch
    bool first;           // the vertices that the camera sees
    Mask m, lit, connected, scattered;
    Mask slides, chained;  // see record; lanes that are mirrored or refracted
    Int slot, light, light_prim, lobe;
    Spec beta, suffix, attached, light_weight, light_value, f_light;
    Float mis, scatter_weight, light_distance, kept;
    Vec2 light_uv;
    Vec3 d, wi, light_d, wo_d, wl, wo;
    Vec3 dp;              // adjoint of its position, by what its shadow ray passes
    Hit hit;
    Interaction si;
    BsdfCall call;
    BsdfSurface surface;
    Vec3 dp_dv;
    const EmitterRecord *emitter;
    const Group *group;
    const struct Corner *corner; // where some look through a lens (corner.h), else null
    const struct Glossy *glossy; // where some scatter into narrow lobes (glossy.h), else null
} SurfaceSweep;

// Lanes whose path goes on along a direction that follows from how it came. Where shadow rays pass surfaces, so does
// the segment between two vertices that scatter.
KFN Mask chain_lanes(const Tracer *t, Int lobe, Mask slides) {
    return lobe_turns(lobe) | (lobe_is(lobe, LOBE_NULL) & (slides | m_set(!t->scene->through || t->job->veils)));
}

// Lanes of a batch that slide.
KFN Mask records_slide(const Tracer *t, int32_t at) { return mi_lt(i_set(SLIDES_NOT), i_load(t->ws.records.slides + at)); }
// In media, those on the sensor's ray.
KFN Mask records_seen(const Tracer *t, int32_t at) { return mi_eq(i_load(t->ws.records.slides + at), i_set(SLIDES_SEEN)); }

KFN Hit surface_hit(const Records *r, int32_t at) {
    return (Hit){i_load(r->shape + at), i_load(r->prim + at), f_load(r->u + at), f_load(r->v + at),
                 record_v3(r->px, r->py, r->pz, at), i_load(r->instance + at)};
}

KFN void surface_load(const Tracer *t, const RecordBatch *batch, Int slot, Spec suffix, SurfaceSweep *s) {
    const Records *r = &t->ws.records;
    int32_t at = batch->first;
    s->at = at;
    s->first = batch->first_vertex;
    s->m = m_first_n(batch->count);
    s->slot = slot;
    s->suffix = suffix;
    s->attached = suffix;
    s->group = t->scene->groups + batch->group;
    s->corner = NULL;
    s->glossy = NULL;
    s->dp = v3_zero();
    s->hit = batch->local ? (Hit){.u = f_load(r->u + at), .v = f_load(r->v + at)} : surface_hit(r, at);
    s->d = record_v3(r->dx, r->dy, r->dz, at);
    s->beta = spec_load(r->beta, at);
    s->mis = f_load(r->mis + at);
    s->light_weight = spec_load(r->light_weight, at);
    s->scatter_weight = f_load(r->sw + at);
    s->lit = s->m & m_gt(s->mis, f_set(0));
    s->connected = s->m & m_gt(spec_max(s->light_weight), f_set(0));
    s->kept = t->scene->drops ? f_load(r->keep + at) : f_set(1);
    s->scattered = s->m & m_gt(s->scatter_weight, f_set(0));
    s->lobe = i_load(r->lobe + at);
    if (!t->spares) {
        s->f_light = spec_load(r->light_f, at);
        s->light = i_load(r->light + at);
        s->light_prim = i_load(r->lprim + at);
        s->light_uv = (Vec2){f_load(r->lu + at), f_load(r->lv + at)};
        s->light_distance = f_load(r->ldist + at);
    }
    // Lanes without a light sample or a continuation get directions that do no harm.
    Vec3 back = v3_neg(s->d);
    s->light_d = v3_select(s->connected, record_v3(r->ldx, r->ldy, r->ldz, at), back);
    s->wo_d = v3_select(s->scattered, record_v3(r->wox, r->woy, r->woz, at), back);
    s->lobe = i_select(s->scattered, s->lobe, i_set(LOBE_SMOOTH));
    if (batch->local) {
        s->slides = s->chained = m_set(false);
        s->si = (Interaction){.uv = {s->hit.u, s->hit.v}};
        s->wi = back;
        s->wl = s->light_d;
        s->wo = s->wo_d;
    } else {
        s->slides = s->m & records_slide(t, at);
        s->chained = chain_lanes(t, s->lobe, s->slides);
        s->si = shape_interaction(t->scene, s->group->shape_kind, s->group->shape_flags, &s->hit);
        s->wi = frame_to_local(&s->si.sh, back);
        s->wl = frame_to_local(&s->si.sh, s->light_d);
        s->wo = frame_to_local(&s->si.sh, s->wo_d);
    }
    s->call = bsdf_call(t->scene, s->group->bsdf, texcoord(s->si.uv, NULL), t->floor);
    s->emitter = s->group->emitter >= 0 ? t->scene->emitters + s->group->emitter : NULL;
}

// What the scattering function of a batch asks of the surface; s must stay where it is.
KFN void surface_parameterise(const Tracer *t, SurfaceSweep *s) {
    s->call.uv.hit = &s->hit;
    if (t->scene->bsdfs[s->group->bsdf].surface) {
        find_surface(t->scene, s->group, &s->hit, &s->surface, &s->dp_dv);
        s->call.surface = &s->surface;
    }
}

// The door through which the derivatives of a job leave.
static Sink sink_of(const PathJob *job) {
    return (Sink){.gradient = job->gradient,
                  .tangent = job->tangent,
                  .texture_at = job->texture_at,
                  .to_uv_at = job->to_uv_at,
                  .normals_at = job->normals_at,
                  .attribute_at = job->attribute_at,
                  .place_at = job->place_at,
                  .any_normals = job->any_normals,
                  .any_attributes = job->any_attributes,
                  .any_places = job->any_places,
                  .points_at = job->points_at,
                  .pose_at = job->pose_at,
                  .instance_at = job->instance_at,
                  .camera_at = job->camera_at,
                  .volume_at = job->volume_at,
                  .panes = job->panes,
                  .any_volumes = job->any_volumes,
                  .any_sky = job->any_sky,
                  .sky_at = job->sky_at,
                  .any_motion = job->any_motion,
                  .any_camera = job->any_camera,
                  .watch_turned = job->watch_turned,
                  .watch_inward = job->watch_inward,
                  .derivative = f_set(0)};
}
