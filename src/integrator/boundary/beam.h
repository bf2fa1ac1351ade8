// beam.h: between which points of a surface the light of a spot or a projector ends abruptly or jumps (render/light_borders.h).
#pragma once

#include "emitter/beam.h"
#include "integrator/boundary/field.h"

// A border of light between two points: whose it is, -1 = there is none, and its unit normal.
typedef struct BeamBorder {
    Int light;
    Vec3 normal;
} BeamBorder;

// The slopes x / z and y / z of a point of a light's space, which lights look up.
KFN TexCoord beam_slope(Vec3 q) {
    Float rcp = f_zero_unless(m_gt(q.z, f_set(0)), f_safe_rcp(q.z));
    return texcoord((Vec2){q.x * rcp, q.y * rcp}, NULL);
}

// Two points of a light's space, as its picture has them.
typedef struct BeamPoints {
    Vec3 q[2];
    Vec2 uv[2];
    Mask inside[2];
    Float extent[2]; // (u, v) = 1/2 - (x, y) / (2 z extent)
} BeamPoints;

static BeamPoints beam_points(const SceneView *scene, const Light *l, Vec3 from, Vec3 to) {
    BeamPoints p = {.q = {light_to_local(scene, l, from), light_to_local(scene, l, to)}};
    beam_extent(scene, l, p.extent);
    for (int k = 0; k < 2; k++) {
        Mask before = m_gt(p.q[k].z, f_set(0));
        TexCoord uv;
        if (l->e->kind == EMITTER_SPOT) {
            SpotBeam beam = spot_beam(scene, l, beam_slope(p.q[k]));
            p.inside[k] = before & m_gt(beam.falloff, f_set(0));
            uv = beam.uv;
        } else {
            ProjectorBeam beam = projector_beam(scene, l, beam_slope(p.q[k]), f_set(1));
            p.inside[k] = before & beam.inside;
            uv = beam.uv;
        }
        p.uv[k] = (Vec2){uv.x, uv.y};
    }
    return p;
}

// Lanes of m in which a light's cone, or a line of its picture, lies between two points. *normal: of that, at the first one.
static Mask beam_parts(const BoundaryJob *b, const BeamRecord *beam, const BeamPoints *p, Mask m, Vec3 *normal) {
    const Vec3 q = p->q[0];
    Mask found = m & (p->inside[0] ^ p->inside[1]) & m_set(beam->cone);
    *normal = v3(q.x, q.y, -p->extent[0] * p->extent[0] * q.z);
    m = m & ~found & (p->inside[0] | p->inside[1]) & m_gt(p->q[0].z, f_set(0)) & m_gt(p->q[1].z, f_set(0));
    for (int32_t i = beam->first; i < beam->end && m_any(m); i++) {
        const Int step = i_set(i);
        Mask line = m & ~m_eq(step_field(b, step, p->uv[0]), step_field(b, step, p->uv[1]));
        Float u = f_set((real)b->steps[i].u) * f_safe_rcp(p->extent[0]), v = f_set((real)b->steps[i].v) * f_safe_rcp(p->extent[1]);
        *normal = v3_select(line, v3(-u * q.z, -v * q.z, u * q.x + v * q.y), *normal);
        found = found | line;
        m = m & ~line;
    }
    return found;
}

// Lanes of m in which a border lies between two points.
static NOINLINE Mask beams_part(const SceneView *scene, const BoundaryJob *b, Vec3 from, Vec3 to, Mask m, BeamBorder *border) {
    *border = (BeamBorder){i_set(-1), v3_zero()};
    for (int32_t i = 0; i < b->beam_count && m_any(m); i++) {
        const BeamRecord *beam = b->beams + i;
        const EmitterRecord *e = scene->emitters + beam->light;
        Light l = light_alone(e, i_set(beam->light));
        BeamPoints p = beam_points(scene, &l, from, to);
        Vec3 n;
        Mask found = beam_parts(b, beam, &p, m, &n);
        border->light = i_select(found, i_set(beam->light), border->light);
        border->normal = v3_select(found, v3_normalize(light_gradient_to_world(scene, &l, n)), border->normal);
        m = m & ~found;
    }
    return mi_lt(i_set(-1), border->light);
}
