// mark.h: points of the curves along which textures of a surface jump (shape/marks.h).
#pragma once

#include "integrator/boundary/boundary_job.h"
#include "shape/interaction.h"

// The point with coordinates (u, v) of a surface, and its derivatives: barycentrics of meshes, uv of round shapes.
typedef struct MarkPoint {
    Vec3 p, du, dv;
} MarkPoint;

static MarkPoint mark_on_mesh(const SceneView *scene, const Hit *hit) {
    Corners c = mesh_corners(scene, hit->shape, hit->prim);
    Int positions = SHAPE_FIELD(scene, hit->shape, positions);
    Vec3 a = theta_v3(scene, positions + c.i[0] * 3);
    MarkPoint at = {a, v3_sub(theta_v3(scene, positions + c.i[1] * 3), a), v3_sub(theta_v3(scene, positions + c.i[2] * 3), a)};
    at.p = v3_madd(v3_madd(a, hit->u, at.du), hit->v, at.dv);
    return at;
}

// From a shapegroup's space to the world, in lanes of shapes that stand in one.
static void mark_through_instance(const SceneView *scene, const Hit *hit, Mask inside, MarkPoint *at) {
    Hit h = *hit;
    h.instance = i_select(inside, h.instance, i_set(0));
    Int table = instance_table(scene, &h);
    at->p = v3_select(inside, pose_to_world(scene, table, at->p), at->p);
    at->du = v3_select(inside, instance_vector(scene, table, at->du), at->du);
    at->dv = v3_select(inside, instance_vector(scene, table, at->dv), at->dv);
}

// uv = (phi / 2 pi, theta / pi)
static MarkPoint mark_on_sphere(const SceneView *scene, Int table, Float u, Float v) {
    Float radius = table_at(scene, table + 3), sp, cp, st, ct;
    Vec3 x = table_v3(scene, table + 4), y = table_v3(scene, table + 7), z = table_v3(scene, table + 10);
    f_sincos(TWO_PI * u, &sp, &cp);
    f_sincos(PI * v, &st, &ct);
    Vec3 out = v3_madd(v3_scale(x, cp), sp, y), around = v3_madd(v3_scale(y, cp), -sp, x);
    MarkPoint at;
    at.p = v3_madd(table_v3(scene, table), radius, v3_madd(v3_scale(out, st), ct, z));
    at.du = v3_scale(around, TWO_PI * radius * st);
    at.dv = v3_scale(v3_madd(v3_scale(out, ct), -st, z), PI * radius);
    return at;
}

// Cylinders: uv = (phi / 2 pi, z); disks: uv = (r, phi / 2 pi).
static MarkPoint mark_on_turned(const SceneView *scene, Int table, Mask disk, Float u, Float v) {
    Vec3 x = pose_column(scene, table, 0), y = pose_column(scene, table, 1);
    Float s, c, r = f_select(disk, u, f_set(1));
    f_sincos(TWO_PI * f_select(disk, v, u), &s, &c);
    Vec3 out = v3_madd(v3_scale(x, c), s, y), around = v3_scale(v3_madd(v3_scale(y, c), -s, x), TWO_PI * r);
    MarkPoint at;
    at.p = pose_to_world(scene, table, v3(r * c, r * s, f_select(disk, f_set(0), v)));
    at.du = v3_select(disk, out, around);
    at.dv = v3_select(disk, around, pose_column(scene, table, 2));
    return at;
}

// Of a mark's uv: how far beside it a path starts.
#define MARK_STEP 2e-5f

#define MARK_ROW(number) ((number) * (int32_t)(sizeof(MarkRecord) / 4))
#define MARK_FLOAT(job, number, field)                                                                                 \
    f_gather((const float *)(job)->marks, MARK_ROW(number) + (int32_t)(offsetof(MarkRecord, field) / 4))
#define MARK_INT(job, number, field)                                                                                   \
    i_gather((const int32_t *)(job)->marks, MARK_ROW(number) + (int32_t)(offsetof(MarkRecord, field) / 4))

// A mark's tangent, and where positive steps across it lead, by `unit` of which it is moved; the surface's uv, and what such steps
// change it by.
typedef struct MarkFrame {
    Vec3 tangent, across;
    Vec2 uv, turned;
    Float unit;
} MarkFrame;

// What mark coordinates on a mesh, and a change of them, are as uv.
static void mark_uv_on_mesh(const SceneView *scene, const Hit *hit, Mask m, MarkFrame *f) {
    Corners c = mesh_corners(scene, hit->shape, hit->prim);
    Int uvs = SHAPE_FIELD(scene, hit->shape, uvs);
    Mask given = m & mi_lt(i_set(-1), uvs);
    uvs = i_select(given, uvs, i_set(0));
    Float x[2], dx[2], a = f->turned.x, b = f->turned.y;
    for (int k = 0; k < 2; k++) {
        Float corner[3];
        for (int i = 0; i < 3; i++) {
            corner[i] = theta_at(scene, uvs + i_select(given, c.i[i], i_set(0)) * 2 + k);
        }
        x[k] = (1.0f - hit->u - hit->v) * corner[0] + hit->u * corner[1] + hit->v * corner[2];
        dx[k] = a * (corner[1] - corner[0]) + b * (corner[2] - corner[0]);
    }
    f->uv = (Vec2){f_select(given, x[0], f->uv.x), f_select(given, x[1], f->uv.y)};
    f->turned = (Vec2){f_select(given, dx[0], a), f_select(given, dx[1], b)};
}

// Point t of the mark `number` on the surface of *hit, moved by `off` across it: *hit gets its coordinates.
static Vec3 mark_at(const SceneView *scene, const BoundaryJob *b, Int number, Float t, Float off, Hit *hit, Mask m, MarkFrame *f) {
    number = i_select(m, number, i_set(0));
    Float u = MARK_FLOAT(b, number, ends[0]), v = MARK_FLOAT(b, number, ends[1]);
    Float du = MARK_FLOAT(b, number, ends[2]) - u, dv = MARK_FLOAT(b, number, ends[3]) - v;
    Float rcp = f_safe_rcp(f_sqrt(du * du + dv * dv));
    u = u + t * du - off * rcp * dv;
    v = v + t * dv + off * rcp * du;
    Int shape = i_select(m, hit->shape, i_set(i_lane(hit->shape, m_first(m)))), kind = SHAPE_FIELD(scene, shape, kind);
    Int table = SHAPE_FIELD(scene, shape, table);
    Mask mesh = m & mi_eq(kind, i_set(SHAPE_MESH)), sphere = m & mi_eq(kind, i_set(SHAPE_SPHERE));
    Mask turned = m & ~mesh & ~sphere;
    MarkPoint p = {v3_zero(), v3_zero(), v3_zero()}, other;
    f->uv = (Vec2){u, v};
    f->turned = (Vec2){-dv, du};
    f->unit = rcp;
    if (m_any(mesh)) {
        // lanes of other shapes stand in for triangles of this one
        Hit own = {i_select(mesh, shape, i_set(i_lane(shape, m_first(mesh)))),
                   i_select(mesh, hit->prim, i_set(0)),
                   u,
                   v,
                   hit->p,
                   hit->instance};
        p = mark_on_mesh(scene, &own);
        mark_uv_on_mesh(scene, &own, mesh, f);
    }
    if (m_any(sphere)) {
        other = mark_on_sphere(scene, i_select(sphere, table, i_set(i_lane(table, m_first(sphere)))), u, v);
        p = (MarkPoint){v3_select(sphere, other.p, p.p), v3_select(sphere, other.du, p.du), v3_select(sphere, other.dv, p.dv)};
    }
    if (m_any(turned)) {
        Int own = i_select(turned, table, i_set(i_lane(table, m_first(turned))));
        other = mark_on_turned(scene, own, mi_eq(kind, i_set(SHAPE_DISK)), u, v);
        p = (MarkPoint){v3_select(turned, other.p, p.p), v3_select(turned, other.du, p.du), v3_select(turned, other.dv, p.dv)};
    }
    Mask inside = m & mi_lt(i_set(-1), SHAPE_FIELD(scene, shape, collection));
    if (m_any(inside)) {
        mark_through_instance(scene, hit, inside, &p);
    }
    hit->u = f_select(mesh, u, hit->u);
    hit->v = f_select(mesh, v, hit->v);
    f->tangent = v3_madd(v3_scale(p.du, du), dv, p.dv);
    f->across = v3_madd(v3_scale(p.du, -dv), du, p.dv);
    return p.p;
}
