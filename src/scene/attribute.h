// attribute.h: the texture `mesh_attribute`: values stored at the vertices of a mesh, interpolated, or one per triangle,
// times `scale`. The texture names the attribute; each mesh brings its own values, and one without them reads 0.
//
// view.attributes holds, per attribute name, two numbers per shape: where the values begin in theta (-1 = none) and the
// numbers per item (1 or 3). A sink holds the same table with where the derivatives begin.
#pragma once

#include "scene/hit.h"
#include "scene/sink.h"

// Where each lane's values lie: up to three items with weights.
typedef struct AttributeFootprint {
    Int entry, stride; // in view.attributes; numbers per item
    Int item[3];
    Float weight[3];
    int count;
    Mask present;
} AttributeFootprint;

KFN AttributeFootprint attribute_footprint(const SceneView *scene, const TextureNode *t, const Hit *hit) {
    AttributeFootprint f;
    f.entry = hit->shape * 2 + t->attribute;
    Int begin = i_gather(scene->attributes, f.entry);
    f.present = mi_lt(i_set(-1), begin);
    f.stride = i_select(f.present, i_gather(scene->attributes, f.entry + 1), i_set(1));
    f.count = t->per_face ? 1 : 3;
    if (t->per_face) {
        f.item[0] = i_select(f.present, hit->prim, i_set(0));
        f.weight[0] = f_set(1);
        return f;
    }
    // Shapes without the attribute may have no triangles at all: they read triangle 0.
    Int at = (i_select(f.present, SHAPE_FIELD(scene, hit->shape, triangle) + hit->prim, i_set(0))) * 3;
    Float w[3] = {1.0f - hit->u - hit->v, hit->u, hit->v};
    for (int k = 0; k < 3; k++) {
        f.item[k] = i_select(f.present, i_gather(scene->triangles, at + k), i_set(0));
        f.weight[k] = w[k];
    }
    return f;
}

// Offset of channel c of an item: meshes with one number per item read it for every channel.
KFN Int attribute_offset(const AttributeFootprint *f, int k, int c) {
    return f->item[k] * f->stride + i_select(mi_eq(f->stride, i_set(3)), i_set(c), i_set(0));
}

KFN Spec attribute_values(const SceneView *scene, const AttributeFootprint *f) {
    Int begin = i_max(i_gather(scene->attributes, f->entry), i_set(0));
    Spec s = spec_zero();
    for (int k = 0; k < f->count; k++) {
        for (int c = 0; c < SPEC_N; c++) {
            Int at = i_select(f->present, begin + attribute_offset(f, k, c), i_set(0));
            s.c[c] = s.c[c] + f->weight[k] * theta_at(scene, at);
        }
    }
    return spec_zero_unless(f->present, s);
}

// d . item of each corner.
KFN void attribute_corners(const SceneView *scene, const AttributeFootprint *f, Spec d, Float worth[3]) {
    Int begin = i_max(i_gather(scene->attributes, f->entry), i_set(0));
    for (int k = 0; k < 3; k++) {
        worth[k] = f_set(0);
        for (int c = 0; c < SPEC_N; c++) {
            Int at = i_select(f->present, begin + attribute_offset(f, k, c), i_set(0));
            worth[k] = worth[k] + d.c[c] * theta_at(scene, at);
        }
    }
}

KFN Spec attribute_eval(const SceneView *scene, const TextureNode *t, const Hit *hit) {
    if (!hit) {
        return spec_zero();
    }
    AttributeFootprint f = attribute_footprint(scene, t, hit);
    return spec_scale(attribute_values(scene, &f), f_set(scene->theta[scene->textures[t->child[0]].theta]));
}

KFN void attribute_adj(const SceneView *scene, int32_t id, const Hit *hit, Spec d, Sink *sink, Mask m) {
    const TextureNode *t = scene->textures + id;
    if (!hit) {
        return;
    }
    AttributeFootprint f = attribute_footprint(scene, t, hit);
    // s = scale sum_k w_k item_k
    int32_t scale_at = sink->texture_at[t->child[0]];
    if (scale_at >= 0) {
        sink_add_uniform(sink, scale_at, spec_dot(d, attribute_values(scene, &f)), m);
    }
    Float scale = f_set(scene->theta[scene->textures[t->child[0]].theta]);
    if (sink->at && !t->per_face) {
        Float worth[3];
        attribute_corners(scene, &f, d, worth);
        scale = f_zero_unless(m & f.present, scale);
        sink->at->x = sink->at->x + scale * (worth[1] - worth[0]);
        sink->at->y = sink->at->y + scale * (worth[2] - worth[0]);
    }
    if (!sink->any_attributes) {
        return;
    }
    Int begin = i_gather(sink->attribute_at, f.entry);
    m = m & f.present & mi_lt(i_set(-1), begin);
    begin = i_max(begin, i_set(0));
    for (int k = 0; k < f.count; k++) {
        for (int c = 0; c < SPEC_N; c++) {
            Int at = i_select(m, begin + attribute_offset(&f, k, c), i_set(0));
            sink_add(sink, at, f.weight[k] * scale * d.c[c], m);
        }
    }
}
