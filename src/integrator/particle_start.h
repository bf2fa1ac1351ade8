// particle_start.h: where light tracing begins: a point on a light, a direction, and the flux that the pair carries,
// which is what the light sends there times a factor that no derivative touches.
#pragma once

#include "emitter/choice.h"

typedef struct ParticleStart {
    Vec3 o, d;    // of the particle's first ray
    Vec2 uv;      // where the light is read, as in LightSample
    Int prim;
    Float factor; // flux over density, of a light of value 1
    Mask valid;
} ParticleStart;

// Density over the area with which shape_sample finds si. Seen from a distance of 1 along the normal, a density over
// solid angles is the density over areas; spheres are sampled uniformly from inside.
KFN Float start_area_pdf(const SceneView *scene, int32_t shape, const Interaction *si) {
    if (scene->shapes[shape].kind == SHAPE_SPHERE) {
        return f_set(1 / (real)scene->shapes[shape].area);
    }
    return shape_pdf(scene, shape, v3_add(si->p, si->ng), v3_neg(si->ng), si);
}

static NOINLINE ParticleStart start_surface(const SceneView *scene, const EmitterRecord *e, Vec2 u1, Vec2 u2) {
    const ShapeRecord *shape = scene->shapes + e->shape;
    const float *t = scene->tables + shape->table;
    Vec3 inside = shape->kind == SHAPE_SPHERE ? v3(f_set(t[0]), f_set(t[1]), f_set(t[2])) : v3_zero();
    Hit hit = shape_sample(scene, e->shape, inside, u1);
    Interaction si = shape_interaction(scene, shape->kind, shape->flags, &hit);
    Float rcp = f_safe_rcp(start_area_pdf(scene, e->shape, &si));
    ParticleStart s = {.d = si.sh.n, .prim = hit.prim, .factor = rcp, .valid = m_set(true)};
    s.uv = light_sample_uv(scene, e, &hit, &si);
    if (e->kind != EMITTER_DIRECTIONALAREA) {
        Vec3 local = warp_cosine_hemisphere(u2);
        s.d = frame_to_world(&si.sh, local);
        // L |cos| dA dw over the densities 1/A and cos / pi, where the first cosine is the surface's own
        s.factor = PI * f_abs(v3_dot(s.d, si.ng)) / local.z * rcp;
    }
    s.o = interaction_offset(&si, s.d);
    return s;
}

static NOINLINE ParticleStart start_point(const SceneView *scene, const EmitterRecord *e, Vec2 u) {
    Light l = light_alone(e, i_set(0));
    const int slot = SLOT(Point, position);
    ParticleStart s = {.uv = {f_set(0), f_set(0)}, .prim = i_set(0), .factor = f_set(4 * PI), .valid = m_set(true)};
    s.o = v3(light_place(scene, &l, slot, 0), light_place(scene, &l, slot, 1), light_place(scene, &l, slot, 2));
    s.d = warp_uniform_sphere(u);
    return s;
}

// Spots and projectors: directions of their cone or frustum, in their own space, which the pose may stretch.
static NOINLINE ParticleStart start_beam(const SceneView *scene, const EmitterRecord *e, Vec2 u) {
    Light l = light_alone(e, i_set(0));
    bool spot = e->kind == EMITTER_SPOT;
    const int slot = spot ? SLOT(Spot, to_world) : SLOT(Projector, to_world);
    Vec3 local;
    Float angle; // solid angle over density
    if (spot) {
        Float sine, cosine;
        f_sincos(light_real(scene, &l, SLOT(Spot, cutoff_angle)) * TO_RADIANS, &sine, &cosine);
        local = warp_uniform_cone(u, cosine);
        angle = TWO_PI * (1.0f - cosine);
    } else {
        Float x = light_table(scene, &l, PROJECTOR_EXTENT), y = light_table(scene, &l, PROJECTOR_EXTENT + 1);
        Vec3 q = v3((2.0f * u.x - 1.0f) * x, (2.0f * u.y - 1.0f) * y, f_set(1));
        Float r2 = v3_dot(q, q);
        local = v3_normalize(q);
        angle = 4.0f * x * y / (r2 * f_sqrt(r2));
    }
    Vec3 a = light_pose_column(scene, &l, slot, 0), b = light_pose_column(scene, &l, slot, 1);
    Vec3 c = light_pose_column(scene, &l, slot, 2);
    Vec3 w = v3_madd(v3_madd(v3_scale(a, local.x), local.y, b), local.z, c);
    Float length = v3_length(w), det = f_abs(v3_dot(v3_cross(a, b), c));
    ParticleStart s = {.prim = i_set(0), .valid = m_gt(local.z, f_set(0))};
    s.uv = (Vec2){local.x * f_safe_rcp(local.z), local.y * f_safe_rcp(local.z)};
    s.o = light_pose_column(scene, &l, slot, 3);
    s.d = v3_scale(w, f_safe_rcp(length));
    // dw = |det M| / |M l|^3 dw_local
    s.factor = angle * det * f_safe_rcp(length * length * length);
    return s;
}

// Light from beyond the scene, through the disk that the scene's bounding sphere shows it.
static NOINLINE ParticleStart start_far(const SceneView *scene, const EmitterRecord *e, Vec2 u1, Vec2 u2) {
    Vec3 centre = v3(f_set(scene->bounds_centre[0]), f_set(scene->bounds_centre[1]), f_set(scene->bounds_centre[2]));
    real radius = (real)scene->bounds_radius * 1.001f;
    LightSample l = emitter_sample(scene, e, centre, u2);
    ParticleStart s = {.d = v3_neg(l.d), .uv = l.uv, .prim = l.prim, .valid = l.valid};
    Frame frame = frame_from_normal(l.d);
    Vec2 q = warp_uniform_disk(u1);
    s.o = v3_add(centre, frame_to_world(&frame, v3(q.x * radius, q.y * radius, f_set(radius))));
    s.factor = PI * radius * radius * f_safe_rcp(l.pdf);
    return s;
}

static ParticleStart emitter_start(const SceneView *scene, const EmitterRecord *e, Vec2 u1, Vec2 u2) {
    switch (e->kind) {
    case EMITTER_AREA:
    case EMITTER_DIRECTIONALAREA:
        return start_surface(scene, e, u1, u2);
    case EMITTER_POINT:
        return start_point(scene, e, u2);
    case EMITTER_SPOT:
    case EMITTER_PROJECTOR:
        return start_beam(scene, e, u2);
    default:
        return start_far(scene, e, u1, u2);
    }
}

// What each lane's light sends where its particle starts: as from a distance of 1.
static NOINLINE Spec starts_value(const SceneView *scene, Int light, Mask m, Vec2 uv, Int prim) {
    Spec value = spec_zero();
    for (Mask left = m, mine; m_any(left); left = left & ~mine) {
        Light l = lights_next(scene, light, left, &mine);
        Hit hit;
        TexCoord at = emitter_texcoord(scene, l.e, uv, i_select(mine, prim, i_set(0)), &hit);
        Spec one = l.e->kind == EMITTER_DIRECTIONALAREA ? light_colour(scene, &l, SLOT(DirectionalArea, radiance), at)
                                                        : emitter_eval_as(scene, &l, at, f_set(1));
        value = spec_select(mine, one, value);
    }
    return value;
}

// Accumulates the adjoint of starts_value into the lights' own parameters.
static NOINLINE void starts_adj(const SceneView *scene, Int light, Mask m, Vec2 uv, Int prim, Spec dl, Sink *sink) {
    for (Mask left = m, mine; m_any(left); left = left & ~mine) {
        Light l = lights_next(scene, light, left, &mine);
        Hit hit;
        TexCoord at = emitter_texcoord(scene, l.e, uv, i_select(mine, prim, i_set(0)), &hit);
        Spec d = spec_zero_unless(mine, dl);
        if (l.e->kind == EMITTER_DIRECTIONALAREA) {
            light_colour_adj(scene, &l, SLOT(DirectionalArea, radiance), at, d, NULL, sink, mine);
        } else {
            emitter_adj_as(scene, &l, at, f_set(1), d, NULL, sink, mine);
        }
    }
}
