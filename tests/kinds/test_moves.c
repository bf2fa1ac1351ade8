// Surfaces that move, in double: the adjoint of an interaction at an attached point against central differences in every
// vertex, vertex normal and entry of every pose, and what an interaction does where its point slides along the surface
// against points found where a moved ray meets it. For every kind of surface that moves, flipped and in instances too.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#define REAL_DOUBLE
#define LANES 1
#define float double
#include "shape/move.h"

enum { POSITIONS, NORMALS = 9, UVS = 18, POSE = 24, INSTANCE = 40, CONTROL_POINTS = 56, DISTANCES = 72, NODES = 4 };
enum { NUMBERS = DISTANCES + NODES * NODES * NODES };

typedef struct Case {
    const char *name;
    int32_t kind, flags;
    bool posed_mesh; // of cones: the sphere at their end
} Case;

static const Case cases[] = {
    {"mesh", SHAPE_MESH, 0, false},
    {"mesh with texture coordinates", SHAPE_MESH, SHAPE_HAS_UVS, false},
    {"mesh with normals", SHAPE_MESH, SHAPE_HAS_NORMALS | SHAPE_HAS_UVS, false},
    {"flipped mesh", SHAPE_MESH, SHAPE_HAS_NORMALS | SHAPE_FLIP_NORMALS, false},
    {"mesh in an instance", SHAPE_MESH, SHAPE_HAS_NORMALS | SHAPE_HAS_UVS | SHAPE_INSTANCED, false},
    {"mesh that follows a pose", SHAPE_MESH, SHAPE_HAS_UVS, true},
    {"sphere", SHAPE_SPHERE, 0, false},
    {"flipped sphere", SHAPE_SPHERE, SHAPE_FLIP_NORMALS, false},
    {"sphere in an instance", SHAPE_SPHERE, SHAPE_INSTANCED, false},
    {"disk", SHAPE_DISK, 0, false},
    {"flipped disk in an instance", SHAPE_DISK, SHAPE_INSTANCED | SHAPE_FLIP_NORMALS, false},
    {"cylinder", SHAPE_CYLINDER, 0, false},
    {"flipped cylinder", SHAPE_CYLINDER, SHAPE_FLIP_NORMALS, false},
    {"cylinder in an instance", SHAPE_CYLINDER, SHAPE_INSTANCED, false},
    {"curve", SHAPE_BSPLINE, 0, false},
    {"flipped curve in an instance", SHAPE_BSPLINE, SHAPE_INSTANCED | SHAPE_FLIP_NORMALS, false},
    {"cone", SHAPE_LINEAR, 0, false},
    {"end of a flipped cone", SHAPE_LINEAR, SHAPE_FLIP_NORMALS, true},
    {"cone in an instance", SHAPE_LINEAR, SHAPE_INSTANCED, false},
    {"grid of distances", SHAPE_SDFGRID, 0, false},
    {"smooth grid of distances", SHAPE_SDFGRID, SHAPE_SMOOTH_GRADIENT | SHAPE_FLIP_NORMALS, false},
    {"smooth grid of distances in an instance", SHAPE_SDFGRID, SHAPE_SMOOTH_GRADIENT | SHAPE_INSTANCED, false},
};

static bool is_tube(const Case *c) { return c->kind == SHAPE_BSPLINE || c->kind == SHAPE_LINEAR; }

static double uniform(uint64_t *state) {
    uint64_t z = (*state += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return (double)((z ^ (z >> 31)) >> 11) * 0x1p-52 - 1;
}

// One shape in one scene, and an attached point: barycentrics, or a position in the space of the pose.
typedef struct World {
    const Case *c;
    SceneView scene;
    ShapeRecord shape;
    InstanceRecord instance;
    double theta[NUMBERS], tables[64], a[2];
    int32_t triangles[3], segments[2];
    Vec3 q; // tubes: along e, in the frame about the tangent
} World;

static void inverse_rows(const double *m, double *r) {
    Vec3 x = {m[0], m[4], m[8]}, y = {m[1], m[5], m[9]}, z = {m[2], m[6], m[10]}, t = {m[3], m[7], m[11]};
    double det = v3_dot(x, v3_cross(y, z));
    Vec3 rows[3] = {v3_cross(y, z), v3_cross(z, x), v3_cross(x, y)};
    for (int k = 0; k < 3; k++) {
        Vec3 row = v3_scale(rows[k], 1 / det);
        memcpy(r + 4 * k, (double[4]){row.x, row.y, row.z, -v3_dot(row, t)}, 4 * sizeof *r);
    }
}

enum { INSTANCE_AT = 32 };

// What shape and instance derive from theta.
static void follow(World *w) {
    double *t = w->tables;
    const double *m = w->theta + POSE;
    memcpy(t, m, 12 * sizeof *t);
    inverse_rows(m, t + 12);
    if (w->c->kind == SHAPE_SPHERE) { // the columns made orthonormal, one after the other
        Vec3 a[3];
        for (int k = 0; k < 3; k++) {
            a[k] = v3(m[k], m[4 + k], m[8 + k]);
        }
        t[3] = v3_length(a[0]);
        for (int k = 0; k < 3; k++) {
            t[k] = m[4 * k + 3];
            for (int i = 0; i < k; i++) {
                a[k] = v3_madd(a[k], -v3_dot(a[k], a[i]), a[i]);
            }
            a[k] = v3_normalize(a[k]);
            memcpy(t + 4 + 3 * k, (double[3]){a[k].x, a[k].y, a[k].z}, 3 * sizeof *t);
        }
    }
    memcpy(t + INSTANCE_AT, w->theta + INSTANCE, 12 * sizeof *t);
    inverse_rows(w->theta + INSTANCE, t + INSTANCE_AT + 12);
    if (w->c->posed_mesh) {
        const double unit[3][2] = {{-1, -1}, {1, -1}, {1, 1}};
        for (int k = 0; k < 9; k++) {
            const double *row = m + 4 * (k % 3);
            w->theta[POSITIONS + k] = row[0] * unit[k / 3][0] + row[1] * unit[k / 3][1] + row[3];
        }
    }
}

// The distance at a point in the space of a grid's pose.
static double distance_at(const World *w, Vec3 q) {
    double g[3] = {q.x * (NODES - 1), q.y * (NODES - 1), q.z * (NODES - 1)}, c[8], f[3];
    int32_t at[3];
    for (int k = 0; k < 3; k++) {
        at[k] = (int32_t)fmin(fmax(floor(g[k]), 0), NODES - 2);
        f[k] = g[k] - at[k];
    }
    for (int k = 0; k < 8; k++) {
        c[k] = w->theta[DISTANCES + ((at[2] + (k >> 2)) * NODES + at[1] + (k >> 1 & 1)) * NODES + at[0] + (k & 1)];
    }
    return sdfgrid_value(c, f);
}

// A bumpy ball, and where a ray from its middle meets it.
static void grid_make(World *w, uint64_t *random) {
    const Vec3 middle = {0.5, 0.5, 0.5};
    for (int k = 0; k < NODES * NODES * NODES; k++) {
        Vec3 node = v3_scale(v3(k % NODES, k / NODES % NODES, k / NODES / NODES), 1.0 / (NODES - 1));
        w->theta[DISTANCES + k] = v3_length(v3_sub(node, middle)) - 0.4 + 0.05 * w->theta[DISTANCES + k];
    }
    Vec3 d = v3_normalize(v3(uniform(random), uniform(random), uniform(random)));
    double low = 0, high = 0.5;
    for (int i = 0; i < 100; i++) {
        double half = 0.5 * (low + high);
        *(distance_at(w, v3_madd(middle, half, d)) < 0 ? &low : &high) = half;
    }
    w->q = v3_madd(middle, low, d);
}

static Vec3 distance_slope(const World *w, Vec3 q) {
    const double h = 1e-6;
    double g[3];
    for (int k = 0; k < 3; k++) {
        Vec3 step = v3(h * (k == 0), h * (k == 1), h * (k == 2));
        g[k] = (distance_at(w, v3_add(q, step)) - distance_at(w, v3_sub(q, step))) / (2 * h);
    }
    return v3(g[0], g[1], g[2]);
}

static void world_make(World *w, const Case *c, uint64_t *random) {
    memset(w, 0, sizeof *w);
    w->c = c;
    for (int i = 0; i < NUMBERS; i++) {
        w->theta[i] = uniform(random);
    }
    for (int k = 0; k < 3; k++) { // normals about z, poses not too far from the identity
        w->theta[NORMALS + 3 * k + 2] += 2;
        w->theta[POSE + 5 * k] += 3;
        w->theta[INSTANCE + 5 * k] += 3;
    }
    for (int k = 0; k < 4; k++) { // a tube along z
        w->theta[CONTROL_POINTS + 4 * k + 2] += 3 * k;
        w->theta[CONTROL_POINTS + 4 * k + 3] = 0.7 + 0.2 * w->theta[CONTROL_POINTS + 4 * k + 3];
    }
    w->triangles[1] = 1;
    w->triangles[2] = 2;
    w->shape = (ShapeRecord){.kind = c->kind, .flags = c->flags, .triangle_count = 1, .vertex_count = 3,
                             .positions = is_tube(c)                 ? CONTROL_POINTS
                                          : c->kind == SHAPE_SDFGRID ? DISTANCES
                                                                     : POSITIONS,
                             .segment_count = 2,
                             .normals = NORMALS, .uvs = UVS, .to_world = POSE};
    w->instance = (InstanceRecord){.to_world = INSTANCE, .table = INSTANCE_AT};
    w->a[0] = 0.3 + 0.1 * uniform(random);
    w->a[1] = 0.4 + 0.1 * uniform(random);
    double phi = uniform(random) * 3, z = 0.5 + 0.3 * uniform(random);
    w->q = c->kind == SHAPE_SPHERE  ? v3(cos(phi) * sqrt(1 - z * z), sin(phi) * sqrt(1 - z * z), z)
           : c->kind == SHAPE_DISK ? v3(z * cos(phi), z * sin(phi), 0)
                                    : v3(cos(phi), sin(phi), z);
    if (c->kind == SHAPE_LINEAR && c->posed_mesh) {
        w->a[0] = 1;
    }
    for (int k = 0; k < 3; k++) {
        w->tables[SDFGRID_NODES + k] = NODES;
    }
    if (c->kind == SHAPE_SDFGRID) {
        grid_make(w, random);
    }
    follow(w);
}

static void world_link(World *w) {
    w->scene.theta = w->theta;
    w->scene.tables = w->tables;
    w->scene.shapes = &w->shape;
    w->scene.instances = &w->instance;
    w->scene.triangles = w->triangles;
    w->scene.segments = w->segments;
}

static Vec3 apply(const double *m, Vec3 p) {
    return v3(m[0] * p.x + m[1] * p.y + m[2] * p.z + m[3], m[4] * p.x + m[5] * p.y + m[6] * p.z + m[7],
              m[8] * p.x + m[9] * p.y + m[10] * p.z + m[11]);
}

// The point of a curve at v whose e has the coordinates x and y in the frame about the tangent.
static Vec3 curve_point(const World *w, double v, double x, double y) {
    CurveWeights b = bspline_weights(v);
    Vec3 c = v3_zero(), c1 = v3_zero();
    double r = 0;
    for (int k = 0; k < 4; k++) {
        const double *p = w->theta + CONTROL_POINTS + 4 * k;
        c = v3_madd(c, b.b[k], v3(p[0], p[1], p[2]));
        c1 = v3_madd(c1, b.b1[k], v3(p[0], p[1], p[2]));
        r += b.b[k] * p[3];
    }
    Frame f = curve_frame(v3_normalize(c1));
    return v3_madd(c, r, v3_normalize(v3_madd(v3_scale(f.s, x), y, f.t)));
}

// The same of a cone, or of the sphere at its end.
static Vec3 cone_point(const World *w, double v, double x, double y) {
    const double *a = w->theta + CONTROL_POINTS, *b = a + 4;
    Vec3 c1 = v3(b[0] - a[0], b[1] - a[1], b[2] - a[2]), tangent = v3_normalize(c1);
    double r1 = b[3] - a[3], along = w->c->posed_mesh ? 0.8 : -r1 / v3_length(c1);
    Frame f = curve_frame(tangent);
    Vec3 e = v3_normalize(v3_madd(v3_scale(f.s, x), y, f.t));
    Vec3 n = v3_madd(v3_scale(tangent, along), sqrt(1 - along * along), e);
    return v3_madd(v3_madd(v3(a[0], a[1], a[2]), v, c1), a[3] + v * r1, n);
}

// Spheres stay round.
static Vec3 round_point(const double *t, Vec3 q) {
    Vec3 n = v3_add(v3_scale(v3(t[4], t[5], t[6]), q.x), v3_scale(v3(t[7], t[8], t[9]), q.y));
    n = v3_madd(n, q.z, v3(t[10], t[11], t[12]));
    return v3_madd(v3(t[0], t[1], t[2]), t[3], n);
}

static Hit attached(const World *w, const double a[2], Vec3 q) {
    Vec3 p = w->c->kind == SHAPE_BSPLINE  ? curve_point(w, a[0], q.x, q.y)
             : w->c->kind == SHAPE_LINEAR ? cone_point(w, a[0], q.x, q.y)
             : w->c->kind == SHAPE_SPHERE ? round_point(w->tables, q)
                                          : apply(w->theta + POSE, q);
    Hit hit = {0, 0, a[0], a[1], p, 0};
    if (w->c->flags & SHAPE_INSTANCED) {
        hit.p = apply(w->theta + INSTANCE, p);
    }
    return hit;
}

static Interaction look(World *w, const Hit *hit) {
    world_link(w);
    return shape_interaction(&w->scene, w->c->kind, w->c->flags, hit);
}

// A patch around the attached point, as area times normal.
static Vec3 patch(World *w) {
    const double e = 1e-5;
    Vec3 p[3];
    Frame f = frame_from_normal(v3_normalize(w->c->kind == SHAPE_DISK      ? v3(0, 0, 1)
                                             : w->c->kind == SHAPE_SDFGRID ? distance_slope(w, w->q)
                                                                           : w->q));
    for (int k = 0; k < 3; k++) {
        double a[2] = {w->a[0] + e * (k == 1), w->a[1] + e * (k == 2)};
        Vec3 q = v3_madd(v3_madd(w->q, e * (k == 1), f.s), e * (k == 2), f.t);
        if (w->c->kind == SHAPE_CYLINDER || w->c->kind == SHAPE_BSPLINE) {
            double phi = atan2(w->q.y, w->q.x) + e * (k == 1);
            q = v3(cos(phi), sin(phi), w->q.z + e * (k == 2));
            a[0] = w->a[0] + e * (k == 2);
        }
        q = w->c->kind == SHAPE_SPHERE ? v3_normalize(q) : q;
        Hit hit = attached(w, a, q);
        p[k] = look(w, &hit).p;
    }
    return v3_scale(v3_cross(v3_sub(p[1], p[0]), v3_sub(p[2], p[0])), 1 / (e * e));
}

static SurfaceAdj random_adj(uint64_t *random) {
    double v[22];
    for (int i = 0; i < 22; i++) {
        v[i] = uniform(random);
    }
    SurfaceAdj d = surface_adj_zero();
    d.p = v3(v[0], v[1], v[2]);
    d.ng = v3(v[3], v[4], v[5]);
    d.n = v3(v[6], v[7], v[8]);
    d.dp_du = v3(v[9], v[10], v[11]);
    d.dp_dv = v3(v[12], v[13], v[14]);
    d.area = v3(v[15], v[16], v[17]);
    d.uv = (Vec2){v[18], v[19]};
    d.at = (Vec2){v[20], v[21]};
    return d;
}

// The interaction's worth. unit: size of the patch to begin with, 0 = without it.
static double worth(World *w, const Hit *hit, const SurfaceAdj *d, double unit, double side) {
    Interaction si = look(w, hit);
    double sum = v3_dot(d->p, si.p) + v3_dot(d->ng, si.ng) + v3_dot(d->n, si.sh.n) + v3_dot(d->dp_du, si.dp_du) +
                 v3_dot(d->dp_dv, si.dp_dv) + d->uv.x * si.uv.x + d->uv.y * si.uv.y;
    return unit > 0 ? sum + side * v3_dot(d->area, patch(w)) / unit : sum + d->at.x * hit->u + d->at.y * hit->v;
}

static double worth_attached(World *w, const SurfaceAdj *d, double unit, double side) {
    Hit hit = attached(w, w->a, w->q);
    return worth(w, &hit, d, unit, side);
}

static void test_adjoint(void **state) {
    const Case *c = *state;
    static World w, moved;
    uint64_t random = (uint64_t)(c - cases) + 1;
    const bool curve = c->kind == SHAPE_BSPLINE, free_mesh = c->kind == SHAPE_MESH && !c->posed_mesh;
    const int32_t points = curve ? CONTROL_POINTS : c->posed_mesh ? -1 : POSITIONS, pose = curve || free_mesh ? -1 : POSE;
    const int32_t normals = NORMALS, instance = INSTANCE;
    double size = 0;
    for (int round = 0; round < 20; round++) {
        world_make(&w, c, &random);
        SurfaceAdj d = random_adj(&random);
        double gradient[NUMBERS] = {0};
        Sink sink = {.gradient = gradient, .points_at = &points, .pose_at = &pose, .normals_at = &normals,
                     .instance_at = &instance};
        Hit hit = attached(&w, w.a, w.q);
        Interaction si = look(&w, &hit);
        Vec3 area = patch(&w);
        double unit = v3_length(area), side = v3_dot(area, si.ng) < 0 ? -1 : 1;
        shape_move_adj(&w.scene, c->kind, c->flags, &hit, &si, &d, &sink, m_set(true));
        for (int i = 0; i < NUMBERS; i++) {
            const double h = 1e-4;
            double difference = 0;
            if ((c->posed_mesh && i < POSE) || i >= DISTANCES) {
                continue;
            }
            for (int k = -1; k <= 1; k += 2) {
                moved = w;
                moved.theta[i] += k * h;
                follow(&moved);
                difference += k * worth_attached(&moved, &d, unit, side) / (2 * h);
            }
            size += fabs(difference);
            if (i >= UVS && i < POSE) {
                continue; // texture coordinates are no parameters
            }
            if (fabs(difference - gradient[i]) > 2e-4 * (1 + fabs(difference))) {
                fail_msg("%s: number %d has derivative %.8g, expected %.8g", c->name, i, gradient[i], difference);
            }
        }
    }
    assert_true(size > 1);
}

// The distance at a point of the world.
static double distance_of(const World *w, Vec3 p) {
    p = w->c->flags & SHAPE_INSTANCED ? apply(w->tables + INSTANCE_AT + 12, p) : p;
    return distance_at(w, apply(w->tables + 12, p));
}

// Where the ray p + t d meets the surface near the attached point.
static Hit meet(World *w, Vec3 p, Vec3 d) {
    Hit hit = attached(w, w->a, w->q);
    for (int i = 0; i < 20; i++) {
        Interaction si = look(w, &hit);
        Slide s[2];
        shape_slide(&w->scene, w->c->kind, w->c->flags, &hit, &si, s);
        Vec3 off = v3_sub(p, si.p), b1 = v3_cross(s[1].p, d), b2 = v3_cross(d, s[0].p);
        double det = v3_dot(s[0].p, b1), x = v3_dot(off, b1) / det, y = v3_dot(off, b2) / det;
        hit.u += !is_tube(w->c) ? x : w->c->kind == SHAPE_LINEAR && w->c->posed_mesh ? 0 : 2 * y; // of two segments
        hit.v += y;
        hit.p = v3_madd(v3_madd(si.p, x, s[0].p), y, s[1].p);
        if (w->c->kind == SHAPE_SDFGRID) { // along the ray to where the distance is 0
            const double h = 1e-4;
            double here = distance_of(w, hit.p), slope = (distance_of(w, v3_madd(hit.p, h, d)) - here) / h;
            hit.p = v3_madd(hit.p, -here / slope, d);
        }
    }
    return hit;
}

static void test_slide(void **state) {
    const Case *c = *state;
    static World w;
    uint64_t random = (uint64_t)(c - cases) + 100;
    for (int round = 0; round < 20; round++) {
        world_make(&w, c, &random);
        SurfaceAdj adjoint = random_adj(&random);
        if (c->kind != SHAPE_MESH) {
            adjoint.at = (Vec2){0, 0};
        }
        Hit hit = attached(&w, w.a, w.q);
        Interaction si = look(&w, &hit);
        Slide slide[2];
        shape_slide(&w.scene, c->kind, c->flags, &hit, &si, slide);
        Vec3 away = v3(uniform(&random), uniform(&random), uniform(&random));
        Vec3 d = v3_normalize(v3_madd(away, v3_dot(away, si.ng) < 0 ? -2 : 2, si.ng));
        Vec3 g = slide_adj(slide, d, &adjoint), v = v3(uniform(&random), uniform(&random), uniform(&random));
        const double h = 1e-5;
        double difference = 0;
        for (int k = -1; k <= 1; k += 2) {
            Hit at = meet(&w, v3_madd(si.p, k * h, v), d);
            difference += k * worth(&w, &at, &adjoint, 0, 0) / (2 * h);
        }
        if (fabs(v3_dot(g, v) - difference) > 1e-6 * (1 + fabs(difference))) {
            fail_msg("%s: sliding is worth %.8g, expected %.8g", c->name, v3_dot(g, v), difference);
        }
    }
}

static Vec3 random_vector(uint64_t *random) { return v3(uniform(random), uniform(random), uniform(random)); }

static double frame_worth(const Frame *f, const Frame *d) { return v3_dot(f->s, d->s) + v3_dot(f->t, d->t) + v3_dot(f->n, d->n); }

// The frame that is built on a normal and a tangent, in each of their numbers.
static void test_frame(void **state) {
    uint64_t random = 300;
    (void)state;
    for (int round = 0; round < 100; round++) {
        Vec3 v[2] = {v3_normalize(random_vector(&random)), random_vector(&random)}, g[2] = {v3_zero(), v3_zero()};
        Frame f = frame_from_tangent(v[0], v[1]), d = {random_vector(&random), random_vector(&random), random_vector(&random)};
        frame_from_tangent_adj(&f, v[1], &d, g, g + 1);
        for (int i = 0; i < 6; i++) {
            const double h = 1e-6;
            double difference = 0, found = (&g[i / 3].x)[i % 3];
            for (int side = -1; side <= 1; side += 2) {
                Vec3 w[2] = {v[0], v[1]};
                (&w[i / 3].x)[i % 3] += side * h;
                Frame moved = frame_from_tangent(w[0], w[1]);
                difference += side * frame_worth(&moved, &d) / (2 * h);
            }
            if (fabs(found - difference) > 1e-6 * (1 + fabs(difference))) {
                fail_msg("number %d has derivative %.9g, expected %.9g", i, found, difference);
            }
        }
    }
}

// The shading frame of a mesh that stands still, in each number of its vertex normals.
static void test_mesh_frame(void **state) {
    static World w;
    uint64_t random = 400;
    const int32_t normals = NORMALS;
    (void)state;
    for (int k = 0; k < 5; k++) {
        const Case *c = cases + k;
        for (int round = 0; round < 20; round++) {
            world_make(&w, c, &random);
            Hit hit = attached(&w, w.a, w.q);
            Interaction si = look(&w, &hit);
            Frame d = {random_vector(&random), random_vector(&random), random_vector(&random)};
            double gradient[NUMBERS] = {0};
            Sink sink = {.gradient = gradient, .normals_at = &normals};
            mesh_interaction_adj(&w.scene, c->flags, &hit, &si, &d, &sink, m_set(true));
            for (int i = NORMALS; i < UVS; i++) {
                const double h = 1e-6, start = w.theta[i];
                double difference = 0;
                for (int side = -1; side <= 1; side += 2) {
                    w.theta[i] = start + side * h;
                    Interaction moved = look(&w, &hit);
                    difference += side * frame_worth(&moved.sh, &d) / (2 * h);
                }
                w.theta[i] = start;
                if (fabs(gradient[i] - difference) > 1e-6 * (1 + fabs(difference))) {
                    fail_msg("%s: number %d has derivative %.9g, expected %.9g", c->name, i, gradient[i], difference);
                }
            }
        }
    }
}

int main(void) {
    enum { CASES = sizeof cases / sizeof *cases };
    struct CMUnitTest tests[2 * CASES + 2];
    static char names[2 * CASES][64];
    int count = 0;
    for (int i = 0; i < 2 * CASES; i++) {
        void *c = (void *)(uintptr_t)(cases + i / 2);
        snprintf(names[i], sizeof names[i], "%s: %s", i % 2 ? "slide" : "adjoint", cases[i / 2].name);
        if (i % 2 || cases[i / 2].kind != SHAPE_LINEAR) { // whose control points do not move
            tests[count++] = (struct CMUnitTest){names[i], i % 2 ? test_slide : test_adjoint, NULL, NULL, c};
        }
    }
    tests[count++] = (struct CMUnitTest)cmocka_unit_test(test_frame);
    tests[count++] = (struct CMUnitTest)cmocka_unit_test(test_mesh_frame);
    return _cmocka_run_group_tests("tests", tests, (size_t)count, NULL, NULL);
}
