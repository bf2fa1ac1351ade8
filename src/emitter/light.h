// light.h: what the kinds of light share: samples, parameters, and how a kernel reads the numbers of a light. A kind is
// written once and runs in two ways: with one light for all lanes, where numbers are broadcast, and with a light of the
// same family in each lane, where they are gathered.
#pragma once

#include "math/warp.h"
#include "shape/shape.h"

// A point on a light as seen from a reference point.
typedef struct LightSample {
    Vec3 d;         // unit direction towards the light
    Float distance; // to the point; infinite lights: beyond the scene
    Float pdf;      // per solid angle; delta lights: 1
    Vec2 uv;        // where the light is read, as its kind defines it; light_sample_uv on surfaces
    Int prim;       // triangle of the light's mesh, else 0
    Mask valid;     // the light can be seen from there
} LightSample;

// Where a sampled surface is read: its texture coordinates; on meshes, of attributes and volumes, the barycentrics.
KFN Vec2 light_sample_uv(const SceneView *scene, const EmitterRecord *e, const Hit *hit, const Interaction *si) {
    return e->attributes && scene->shapes[e->shape].kind == SHAPE_MESH ? (Vec2){hit->u, hit->v} : si->uv;
}

typedef struct Light {
    const EmitterRecord *e; // the light, or one of the family
    Int id;                 // numbers of the lanes' lights
    bool many;              // the lanes' lights differ
} Light;

KFN Light light_alone(const EmitterRecord *e, Int id) { return (Light){e, id, false}; }

// Adjoint of where and from where light arrives: of the sample's direction, distance and uv. prefix_move_adj adds that
// of the reference point, of lights that lie at a point.
typedef struct LightMove {
    Vec3 d;
    Float distance;
    Vec2 uv;
    Vec3 ref;
} LightMove;

KFN LightMove light_move_zero(void) { return (LightMove){v3_zero(), f_set(0), {f_set(0), f_set(0)}, v3_zero()}; }

// A kind's parameters as rows P(type, field, default, low, high, description, unit):
//   SPECTRUM  colour of intensity, radiance, irradiance, no picture
//   EMISSION  colour texture of radiance, irradiance               COLOUR    colour texture that filters it
//   REAL      constant number                                      FRACTION  the same; its default is relative to the row before
//   IMAGE     environment picture from `filename`                  FOV       horizontal field of view of a camera
//   POSITION  three numbers: `position`, or from to_world          POSE      to_world, whose motion moves shadows
//   AXIS      the same, or +z turned into `direction`              SKY       to_world of what lies beyond the scene
// Each becomes a slot of the record: a texture, or where its numbers begin in theta.
#define EMITTER_SLOT_FIELD(type, field, value, low, high, text, unit) int32_t field;
#define EMITTER_SLOTS(Record, PARAMS)                                                                                  \
    typedef struct Record {                                                                                            \
        PARAMS(EMITTER_SLOT_FIELD)                                                                                     \
    } Record;
#define SLOT(Record, field) ((int)(offsetof(Record, field) / sizeof(int32_t)))

#define EMITTER_FIELD(scene, id, field)                                                                                \
    i_gather((const int32_t *)(scene)->emitters, (id) * (int32_t)(sizeof(EmitterRecord) / 4) +                         \
                                                     (int32_t)(offsetof(EmitterRecord, field) / 4))

KFN Int light_slot(const SceneView *scene, const Light *l, int slot) {
    return l->many ? EMITTER_FIELD(scene, l->id, slot[slot]) : i_set(l->e->slot[slot]);
}

// Number i of a place: position or pose.
KFN Float light_place(const SceneView *scene, const Light *l, int slot, int32_t i) {
    return l->many ? theta_at(scene, light_slot(scene, l, slot) + i) : f_set((real)scene->theta[l->e->slot[slot] + i]);
}

// Number i of what the light derives.
KFN Float light_table(const SceneView *scene, const Light *l, int32_t i) {
    return l->many ? table_at(scene, EMITTER_FIELD(scene, l->id, table) + i)
                   : f_set((real)scene->tables[l->e->table + i]);
}

// Families have constants only.
KFN Int light_constant(const SceneView *scene, const Light *l, int slot) {
    return i_gather((const int32_t *)scene->textures,
                    light_slot(scene, l, slot) * (int32_t)(sizeof(TextureNode) / 4) +
                        (int32_t)(offsetof(TextureNode, theta) / 4));
}

KFN Spec light_colour(const SceneView *scene, const Light *l, int slot, TexCoord uv) {
    if (!l->many) {
        return texture_eval(scene, l->e->slot[slot], uv);
    }
    Int at = light_constant(scene, l, slot);
    Spec s;
    for (int c = 0; c < SPEC_N; c++) {
        s.c[c] = theta_at(scene, at + c);
    }
    return s;
}

KFN Float light_real(const SceneView *scene, const Light *l, int slot) {
    return l->many ? theta_at(scene, light_constant(scene, l, slot))
                   : f_set((real)scene->theta[scene->textures[l->e->slot[slot]].theta]);
}

// One entry per lane, where it is asked for.
KFN void light_sink_add(Sink *sink, Int at, Float d, Mask m) {
    m = m & mi_lt(i_set(-1), at);
    sink_add(sink, i_max(at, i_set(0)), d, m);
}

// Of lights whose colour is a black body's: the adjoint of the temperature.
KFN void light_blackbody_adj(const SceneView *scene, const Light *l, int slot, Spec d, Sink *sink, Mask m) {
    Int texture = light_slot(scene, l, slot), at = light_constant(scene, l, slot) + BLACKBODY_SLOPE;
    Int child = i_gather((const int32_t *)scene->textures, texture * (int32_t)(sizeof(TextureNode) / 4) +
                                                               (int32_t)(offsetof(TextureNode, child) / 4));
    Float sum = f_set(0);
    for (int c = 0; c < SPEC_N; c++) {
        sum = sum + d.c[c] * theta_at(scene, at + c);
    }
    light_sink_add(sink, i_gather(sink->texture_at, child), sum, m);
}

// Accumulates the adjoint of light_colour into the sink and into duv (may be null).
KFN void light_colour_adj(const SceneView *scene, const Light *l, int slot, TexCoord uv, Spec d, Vec2 *duv, Sink *sink,
                          Mask m) {
    if (!l->many) {
        texture_adj(scene, l->e->slot[slot], uv, d, duv, sink, m);
        return;
    }
    if (scene->textures[l->e->slot[slot]].kind == TEXTURE_BLACKBODY) { // of one, so of all in the family
        light_blackbody_adj(scene, l, slot, d, sink, m);
        return;
    }
    Int at = i_gather(sink->texture_at, light_slot(scene, l, slot));
    for (int c = 0; c < SPEC_N; c++) {
        light_sink_add(sink, i_select(mi_lt(at, i_set(0)), at, at + c), d.c[c], m);
    }
}

KFN void light_real_adj(const SceneView *scene, const Light *l, int slot, Float d, Sink *sink, Mask m) {
    if (l->many) {
        light_sink_add(sink, i_gather(sink->texture_at, light_slot(scene, l, slot)), d, m);
    } else if (sink->texture_at[l->e->slot[slot]] >= 0) {
        sink_add_uniform(sink, sink->texture_at[l->e->slot[slot]], d, m);
    }
}

// Accumulates the adjoint of light_place.
KFN void light_place_adj(const Light *l, int slot, int32_t i, Float d, Sink *sink, Mask m) {
    Int at = i_gather(sink->place_at, l->id * MAX_EMITTER_SLOTS + slot);
    light_sink_add(sink, i_select(mi_lt(at, i_set(0)), at, at + i), d, m);
}

// ---- poses: the table begins with the rows of the inverse of to_world (12) --------------------------------------

// Columns of to_world: the axes of the light's space, and its place.
KFN Vec3 light_pose_column(const SceneView *scene, const Light *l, int slot, int32_t k) {
    return v3(light_place(scene, l, slot, k), light_place(scene, l, slot, 4 + k), light_place(scene, l, slot, 8 + k));
}

KFN Vec3 light_to_local(const SceneView *scene, const Light *l, Vec3 p) {
    Float r[3];
    for (int k = 0; k < 3; k++) {
        r[k] = light_table(scene, l, 4 * k) * p.x + light_table(scene, l, 4 * k + 1) * p.y +
               light_table(scene, l, 4 * k + 2) * p.z + light_table(scene, l, 4 * k + 3);
    }
    return v3(r[0], r[1], r[2]);
}

// The same for directions.
KFN Vec3 light_direction_to_local(const SceneView *scene, const Light *l, Vec3 d) {
    Float r[3];
    for (int k = 0; k < 3; k++) {
        r[k] = light_table(scene, l, 4 * k) * d.x + light_table(scene, l, 4 * k + 1) * d.y +
               light_table(scene, l, 4 * k + 2) * d.z;
    }
    return v3(r[0], r[1], r[2]);
}

// Gradients and normals of the light's space in the world: by A^-T.
KFN Vec3 light_gradient_to_world(const SceneView *scene, const Light *l, Vec3 g) {
    Float q[3];
    for (int k = 0; k < 3; k++) {
        q[k] = light_table(scene, l, k) * g.x + light_table(scene, l, 4 + k) * g.y + light_table(scene, l, 8 + k) * g.z;
    }
    return v3(q[0], q[1], q[2]);
}

// From the adjoint of y = A^-1 x to that of A: dA = -q y^T with q = A^-T dy, which is the adjoint of x.
KFN Vec3 light_direction_to_local_adj(const SceneView *scene, const Light *l, int slot, Vec3 y, Vec3 dy, Sink *sink,
                                      Mask m) {
    Vec3 q = light_gradient_to_world(scene, l, dy);
    Float rows[3] = {q.x, q.y, q.z};
    for (int k = 0; k < 3; k++) {
        light_place_adj(l, slot, 4 * k, -rows[k] * y.x, sink, m);
        light_place_adj(l, slot, 4 * k + 1, -rows[k] * y.y, sink, m);
        light_place_adj(l, slot, 4 * k + 2, -rows[k] * y.z, sink, m);
    }
    return q;
}

// Host: what kinds derive from their parameters; false when a pose is singular.
static inline int64_t light_nothing_size(const TextureNode *textures, const EmitterRecord *e) {
    UNUSED(textures), UNUSED(e);
    return 0;
}
static inline bool light_nothing_follow(const SceneView *view, const EmitterRecord *e) {
    UNUSED(view), UNUSED(e);
    return true;
}

// The rows of a pose's inverse (12).
static inline bool light_pose_follow(const SceneView *view, const EmitterRecord *e, int slot) {
    double inverse[12];
    if (!rey_affine_inverse(view->theta + e->slot[slot], inverse)) {
        return false;
    }
    for (int k = 0; k < 12; k++) {
        view->tables[e->table + k] = (float)inverse[k];
    }
    return true;
}

// ---- lights at a point -------------------------------------------------------------------------------------------

KFN LightSample light_at_point(Vec3 ref, Vec3 position) {
    Vec3 to_light = v3_sub(position, ref);
    LightSample s;
    s.distance = v3_length(to_light);
    s.d = v3_scale(to_light, f_safe_rcp(s.distance));
    s.pdf = f_set(1);
    s.uv = (Vec2){f_set(0), f_set(0)};
    s.prim = i_set(0);
    s.valid = m_gt(s.distance, f_set(0));
    return s;
}

// The adjoint of the position, through direction and distance.
KFN Vec3 light_at_point_adj(Vec3 d, Float distance, const LightMove *move) {
    // distance = |p - ref|, d = (p - ref) / distance
    Vec3 dp = v3_scale(d, move->distance);
    v3_normalize_adj(v3_scale(d, distance), move->d, &dp);
    return dp;
}

// A light at the origin of its pose that shines along z; uv is the slope (x, y) / z of the direction to ref.
KFN LightSample light_along_slope(const SceneView *scene, const Light *l, int slot, Vec3 ref) {
    LightSample s = light_at_point(ref, light_pose_column(scene, l, slot, 3));
    Vec3 local = light_to_local(scene, l, ref);
    Mask front = m_gt(local.z, f_set(0));
    Float rcp = f_safe_rcp(local.z);
    s.uv = (Vec2){f_zero_unless(front, local.x * rcp), f_zero_unless(front, local.y * rcp)};
    s.valid = s.valid & front;
    return s;
}

// What moves such a light.
KFN void slope_move_adj(const SceneView *scene, const Light *l, int slot, Vec3 ref, Vec3 d, Float distance,
                        LightMove *move, Sink *sink, Mask m) {
    // slope = (x, y) / z of the local ref
    Vec3 local = light_to_local(scene, l, ref);
    Float rcp = f_safe_rcp(local.z);
    Vec3 dlocal = v3(move->uv.x * rcp, move->uv.y * rcp,
                     -(move->uv.x * local.x + move->uv.y * local.y) * rcp * rcp);
    // local = A^-1 (ref - p)
    Vec3 q = light_direction_to_local_adj(scene, l, slot, local, dlocal, sink, m);
    Vec3 dp = v3_sub(light_at_point_adj(d, distance, move), q);
    move->ref = v3_sub(move->ref, dp);
    light_place_adj(l, slot, 3, dp.x, sink, m);
    light_place_adj(l, slot, 7, dp.y, sink, m);
    light_place_adj(l, slot, 11, dp.z, sink, m);
}
